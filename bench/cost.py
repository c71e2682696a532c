"""What a trajectory costs on any machine: instructions, reads and writes, and misses of the first caches, counted by callgrind.

Counts show a slower kernel where times are noise. They are of caches of 32 kB with eight ways, as most processors have. The work is
`tests/cpp/cost.cpp`, compiled for x86-64-v3 (valgrind knows no AVX-512); what it cost when somebody last took responsibility for
it is in `cost.json`. `search` has points that a search for a design of the cylinder asks for: 600 of the 326,509 of
``exchange(problem, 12, seed=0)`` with `examples/cylinder.toml`, drawn evenly (`data/search_points.csv`). `search` and `runs` go on
over jumps, as searches do.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import tempfile
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path

PROJECT = Path(__file__).resolve().parents[1]
RECORD = Path(__file__).with_suffix(".json")
KINDS = ("tensor", "sparse", "simulate", "columns", "rows", "search", "runs")
POINTS = {"search": Path(__file__).parent / "data" / "search_points.csv"}
EVENTS = {"Ir": "instructions", "Dr": "data reads", "Dw": "data writes", "I1mr": "I1 misses", "D1mr": "D1 read misses"}
"""What is counted, by callgrind's names."""
CACHES = ("--cache-sim=yes", "--I1=32768,8,64", "--D1=32768,8,64", "--LL=8388608,16,64")
TOLERATED, LOOSELY = 0.03, 0.2
"""Growth that is tolerated: the larger of misses, which depend on the linker, and of runs, which a thread leaves by the clock."""
FEW = 5.0
"""Misses per trajectory by which a count may grow in any case: of few, a share says nothing."""

Counts = Mapping[str, Mapping[str, float]]


@dataclass(frozen=True)
class Cost:
    """Counts per trajectory by kind of work and event, and the compiler that made the work."""

    compiler: str
    counts: dict[str, dict[str, float]]


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
    with ThreadPoolExecutor() as pool:
        found = dict(zip(KINDS, pool.map(lambda kind: _count(program, kind), KINDS), strict=True))
    return Cost(found[KINDS[0]][1], {kind: counts for kind, (counts, _) in found.items()})


def recorded() -> Cost:
    """Return the cost that later ones are held against."""
    return Cost(**json.loads(RECORD.read_text()))


def record(cost: Cost) -> None:
    """Hold later costs against this one."""
    RECORD.write_text(json.dumps(asdict(cost), indent=1) + "\n")


def changes(now: Counts, before: Counts) -> dict[tuple[str, str], float]:
    """Return by which share each count grew, by kind and event; what differs by less than `FEW` did not."""
    grown = {}
    for kind, counts in now.items():
        for event, count in counts.items():
            old = before[kind][event]
            grown[kind, event] = 0.0 if abs(count - old) <= FEW else count / max(old, FEW) - 1
    return grown


def verdict(cost: Cost, before: Cost) -> tuple[list[str], bool]:
    """Return lines of a report, and whether no count grew by more than is tolerated."""
    grown = changes(cost.counts, before.counts)
    lines = []
    if _major(cost.compiler) != _major(before.compiler):
        lines.append(f"The record is of {before.compiler}, this is {cost.compiler}; the limit holds all the same.")
    dearer = [f"{kind} ({event})" for (kind, event), change in grown.items() if change > tolerated(kind, event)]
    cheaper = [f"{kind} ({event})" for (kind, event), change in grown.items() if change < -tolerated(kind, event)]
    if dearer:
        lines.append(f"Dearer than is tolerated: {', '.join(dearer)}. Where that is worth it: python -m bench cost --record.")
    if cheaper:
        lines.append(f"Much cheaper: {', '.join(cheaper)}. Keep it: python -m bench cost --record.")
    return lines, not dearer


def tolerated(kind: str, event: str) -> float:
    """Return the growth of a count that is tolerated, as a share."""
    return LOOSELY if kind == "runs" or event.endswith("misses") else TOLERATED


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


def _count(program: Path, kind: str) -> tuple[dict[str, float], str]:
    """Return the counts per trajectory by event, and the compiler."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out"
        valgrind = ["valgrind", "--tool=callgrind", *CACHES, "--toggle-collect=counted", f"--callgrind-out-file={out}"]
        work = [str(program), kind, *(str(POINTS[kind]) for _ in range(kind in POINTS))]
        done = subprocess.run([*valgrind, *work], capture_output=True, text=True)
        text = out.read_text() if out.exists() else ""
    events, totals = (re.search(rf"^{name}:(.*)$", text, re.MULTILINE) for name in ("events", "totals"))
    if done.returncode or events is None or totals is None:
        raise RuntimeError(f"expected a count of {kind}, given:\n{done.stderr}")
    trajectories, compiler = done.stdout.strip().split(" ", 1)
    found = dict(zip(events[1].split(), map(int, totals[1].split()), strict=False))
    return {name: round(found[event] / int(trajectories), 1) for event, name in EVENTS.items()}, compiler
