"""The recorder: digests of what public calls and commands give, so that a change can say "the same bits".

    python tests/bits/record.py before.json
    python tests/bits/record.py after.json --against before.json

Everything is computed with one thread and with two, which must agree. A record holds for one machine and one instruction set:
made before a change and after it, there, it tells what the change moves. Exit code 1: something differs.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

clock = time.process_time
time.perf_counter = lambda: 0.0  # before it is imported: seconds in reports are zero then

import fisherpoint as fp  # noqa: E402
from calls import CALLS  # noqa: E402
from commands import Command, commands, files  # noqa: E402
from digest import parts  # noqa: E402

THREADS = (1, 2)

Digests = dict[str, dict[str, str]]


def of_call(function: Callable[[int], Any], threads: int) -> dict[str, str]:
    """The digests of a call's result, and of its report."""
    result = function(threads)
    found = dict(parts(result))
    if hasattr(result, "report"):
        found["report"] = dict(parts(str(result.report())))[""]
    return found


def of_command(command: Command, threads: int) -> dict[str, str]:
    with tempfile.TemporaryDirectory() as name:
        directory = Path(name) / "bits"
        command(directory, threads)
        return {
            place: digest
            for file, data in files(directory)
            for place, digest in parts(_anywhere(data, name), file)
        }  # fmt: skip


def _anywhere(data: object, directory: str) -> object:
    """What a file says, wherever it is."""
    return json.loads(json.dumps(data).replace(directory, "."))


def recorded(chosen: str) -> Iterator[tuple[str, dict[str, str]]]:
    """The digests of all whose name contains a text; of what fails, the error."""
    things: dict[str, Callable[[int], dict[str, str]]] = {name: partial(of_call, one) for name, one in CALLS.items()}
    things |= {f"$ {name}": partial(of_command, one) for name, one in commands().items()}
    for name, thing in things.items():
        if chosen not in name:
            continue
        try:
            one, *others = [thing(n) for n in THREADS]
            yield name, one
            for threads, other in zip(THREADS[1:], others, strict=True):
                for place in differences(one, other):
                    print(f"{name}: differs with {threads} threads at {place}", flush=True)
        except Exception as error:
            yield name, {"error": "".join(traceback.format_exception_only(error)).strip()}


def differences(one: dict[str, str], other: dict[str, str]) -> list[str]:
    return [place for place in {**one, **other} if one.get(place) != other.get(place)]


def compare(before: Digests, after: Digests, most: int = 6) -> int:
    """Print what differs; how many calls that are."""
    differ = 0
    for name in sorted({**before, **after}):
        if name not in before or name not in after:
            print(f"{name}: only {'after' if name in after else 'before'}")
            continue
        if places := differences(before[name], after[name]):
            differ += 1
            of = len({**before[name], **after[name]})
            print(f"{name}: {len(places)} of {of} differ: {', '.join(places[:most])}{' ...' if len(places) > most else ''}")
            for where in (before, after):
                if "error" in where[name]:
                    print(f"    {where[name]['error']}")
    both = len(before.keys() & after.keys())
    print(f"{both - differ} of {both} the same bits")
    return differ


def main(given: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", type=Path, help="where the record is written")
    parser.add_argument("--against", type=Path, help="a record to compare with")
    parser.add_argument("--only", default="", metavar="TEXT", help="calls whose name contains this")
    chosen = parser.parse_args(given)
    warnings.simplefilter("ignore")
    digests: Digests = {}
    begun = clock()
    for name, digest in recorded(chosen.only):
        digests[name], begun, since = digest, clock(), begun
        print(f"{name}: {digest.get('error', f'{len(digest)} digests')}, {begun - since:.1f} s", flush=True)
    chosen.file.write_text(json.dumps(digests, indent=1))
    print(f"{len(digests)} calls, instruction set {fp.instruction_set()}")
    if chosen.against is None:
        return int(any("error" in digest for digest in digests.values()))
    before = json.loads(chosen.against.read_text())
    return int(compare({name: one for name, one in before.items() if chosen.only in name}, digests) > 0)


if __name__ == "__main__":
    sys.exit(main())
