"""Instructions per trajectory, counted by valgrind's callgrind: they show a slower kernel where times are noise.

The work is `tests/cpp/cost.cpp`, compiled for x86-64-v3 (valgrind knows no AVX-512); what it cost when somebody last took
responsibility for it is in `cost.json`.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import tempfile
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

PROJECT = Path(__file__).resolve().parents[1]
RECORD = Path(__file__).with_suffix(".json")
KINDS = ("tensor", "sparse", "simulate", "sensitivities")
TOLERATED = 0.10


@dataclass(frozen=True)
class Cost:
    """Instructions per trajectory by kind of work, and the compiler that made them."""

    compiler: str
    instructions: dict[str, int]


def missing() -> str | None:
    """Return what the count lacks, None where nothing."""
    if shutil.which("valgrind") is None:
        return "valgrind: apt-get install valgrind"
    cpuinfo = Path("/proc/cpuinfo")
    if not cpuinfo.exists() or " avx2 " not in cpuinfo.read_text():
        return "a machine with AVX2, which valgrind does not make up"
    return None


def measure() -> Cost:
    """Compile the work and count."""
    program = _build()
    counts = {kind: _count(program, kind) for kind in KINDS}
    return Cost(counts[KINDS[0]][1], {kind: instructions for kind, (instructions, _) in counts.items()})


def recorded() -> Cost:
    """Return the cost that later ones are held against."""
    return Cost(**json.loads(RECORD.read_text()))


def record(cost: Cost) -> None:
    """Hold later costs against this one."""
    RECORD.write_text(json.dumps(asdict(cost), indent=1) + "\n")


def changes(now: Mapping[str, int], before: Mapping[str, int]) -> dict[str, float]:
    """Return by how much each kind grew, as a share of what it was."""
    return {kind: now[kind] / before[kind] - 1 for kind in now}


def verdict(cost: Cost, before: Cost) -> tuple[list[str], bool]:
    """Return what is to be said, and whether no kind of work grew by more than is tolerated."""
    grown = changes(cost.instructions, before.instructions)
    said = []
    if _major(cost.compiler) != _major(before.compiler):
        said.append(f"The record is of {before.compiler}, this is {cost.compiler}; the limit holds all the same.")
    dearer = [kind for kind, change in grown.items() if change > TOLERATED]
    cheaper = [kind for kind, change in grown.items() if change < -TOLERATED]
    if dearer:
        said.append(
            f"More than {TOLERATED:.0%} dearer: {', '.join(dearer)}. Where that is worth it: python -m bench cost --record."
        )
    if cheaper:
        said.append(f"More than {TOLERATED:.0%} cheaper: {', '.join(cheaper)}. Keep it: python -m bench cost --record.")
    return said, not dearer


def _major(compiler: str) -> str:
    return compiler.split(".")[0]


def _build() -> Path:
    """Compile next to the C++ tests, whose kernels these are."""
    build = PROJECT / "build" / "release"
    for command in (["cmake", "--preset", "release"], ["cmake", "--build", "--preset", "release", "--target", "cost"]):
        done = subprocess.run(command, cwd=PROJECT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        if done.returncode:
            raise RuntimeError(f"{' '.join(command)}:\n{done.stdout}")
    return build / "tests" / "cpp" / "cost"


def _count(program: Path, kind: str) -> tuple[int, str]:
    """Return the instructions per trajectory, and the compiler."""
    with tempfile.TemporaryDirectory() as folder:
        valgrind = ["valgrind", "--tool=callgrind", "--toggle-collect=counted", f"--callgrind-out-file={folder}/out"]
        done = subprocess.run([*valgrind, str(program), kind], capture_output=True, text=True)
    collected = re.search(r"Collected : (\d+)", done.stderr)
    if done.returncode or collected is None or not int(collected[1]):
        raise RuntimeError(f"expected a count of {kind}, given:\n{done.stderr}")
    trajectories, compiler = done.stdout.strip().split(" ", 1)
    return round(int(collected[1]) / int(trajectories)), compiler
