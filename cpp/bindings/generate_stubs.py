"""Write the type stubs of the compiled modules, or with --check compare them with the committed ones.

Run it with the installed package: the modules are inspected, not the sources. The kernels of all levels look the
same, so one stub, _kernels.pyi, serves them all.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import fisherpoint as fp

STUBS = {"_core": "_core.pyi", f"_kernels_{fp.instruction_set()}": "_kernels.pyi"}
STUBS_DIRECTORY = Path(__file__).resolve().parents[2] / "python" / "fisherpoint" / "engine"


def generate(module: str) -> str:
    with tempfile.TemporaryDirectory() as directory:
        command = [sys.executable, "-m", "pybind11_stubgen", f"fisherpoint.engine.{module}", "-o", directory]
        subprocess.run([*command, "--numpy-array-use-type-var"], check=True, stderr=subprocess.DEVNULL)
        text = (Path(directory) / "fisherpoint" / "engine" / f"{module}.pyi").read_text()
    formatted = subprocess.run(
        [sys.executable, "-m", "ruff", "format", "--line-length", "120", "--stdin-filename", f"{module}.pyi", "-"],
        input=text.replace("ClassVar[list]", "ClassVar[list[typing.Any]]"),
        capture_output=True,
        text=True,
        check=True,
    )
    return formatted.stdout


def main() -> int:
    stale = []
    for module, stub in STUBS.items():
        text = generate(module)
        if "--check" in sys.argv:
            if (STUBS_DIRECTORY / stub).read_text() != text:
                stale.append(stub)
        else:
            (STUBS_DIRECTORY / stub).write_text(text)
    if stale:
        print(f"expected stubs as the modules are, given stale {', '.join(stale)}: run make stubs")
    return bool(stale)


if __name__ == "__main__":
    sys.exit(main())
