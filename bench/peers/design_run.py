"""One design by one program, in a process of its own: ``python -m bench.peers.design_run MODULE VARIANT CASE`` prints JSON.

Seconds are those of the processor, of this process and those that it starts, for stating the problem and solving it; imports are
not among them.
"""

from __future__ import annotations

import json
import resource
import sys
from importlib import import_module
from importlib.metadata import version

from .design_cases import CASES


def _seconds() -> float:
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(usage.ru_utime + usage.ru_stime for usage in used)


def main(module: str, variant: str, name: str) -> dict[str, object]:
    """Return the points and seconds, or what went wrong."""
    try:
        program = import_module(f"{__package__}.{module}")
    except ImportError as error:
        return {"missing": error.name or str(error)}
    case = next(case for case in CASES if case.name == name)
    begin = _seconds()
    try:
        points = program.solve(case, variant)
    except Exception as error:  # whatever another program raises
        return {"failed": f"{type(error).__name__}: {error}", "seconds": _seconds() - begin}
    versions = {package: version(package) for package in program.PACKAGES}
    return {"points": points, "seconds": _seconds() - begin, "versions": versions}


if __name__ == "__main__":
    result = main(*sys.argv[1:])
    print("\n" + json.dumps(result))
