"""What the core's packs could be made of: the same `StateEquation` and `Replay` on each kind of vector.

`packs.cpp` is the work, every fourth candidate over 3^7 nodes of the prior; `backing.hpp` wraps each kind of vector. One program
per kind, width and instruction set is compiled when it is first asked for.
"""

from __future__ import annotations

import subprocess
from dataclasses import dataclass
from pathlib import Path

import fisherpoint as fp

from ..compiled import Program, compiled, missing
from ..workload import MODEL, PRIOR, candidates

SOURCES = Path(__file__).parent
CORE = SOURCES.parents[1] / "cpp" / "include"
EIGEN = ["-isystem", "/usr/include/eigen3"]
OPTIONS = ["-std=c++20", "-O3", "-DNDEBUG", "-ffp-contract=fast", "-fno-math-errno", "-Wno-psabi", f"-I{CORE}", *EIGEN]
CONSTANTS = ("A_A", "A_B", "q_min", "q_max", "p_s", "T_1", "k_u")
NATIVE_LANES = {"v3": 4, "v4": 8}

BACKINGS = {
    "ours": ("Pack", (1, 2), {}),
    "vector": ("vector of the compiler, plain roots", (1, 2), {}),
    "simd": ("<experimental/simd>", (1, 2), {"experimental/simd": "<experimental/simd>: apt-get install g++"}),
    "xsimd": ("xsimd::batch", (1,), {"xsimd/xsimd.hpp": "xsimd: apt-get install libxsimd-dev"}),
    "eigen": ("Eigen::Array", (1, 2), {"Eigen/Core": "Eigen: apt-get install libeigen3-dev"}),
}
"""By the name that `backing.hpp` knows: the name to show, widths in registers, and headers with what holds them."""


@dataclass(frozen=True)
class Figures:
    """One kind of vector at one width: trajectories per second of processor time, and seconds to compile."""

    level: str
    name: str
    lanes: int
    rate: float
    ratio: float
    compile_seconds: float


def measure(quick: bool) -> tuple[list[Figures], list[str]]:
    """Run all kinds in turn, the best of several rounds; return them with what had to be left out."""
    reasons = {kind: missing(headers, EIGEN) for kind, (_, _, headers) in BACKINGS.items()}
    programs = {
        (level, kind, lanes * width): _program(level, kind, lanes * width)
        for level, lanes in NATIVE_LANES.items()
        if level in fp.instruction_sets()
        for kind, (_, widths, _) in BACKINGS.items()
        if reasons[kind] is None
        for width in widths
    }
    task, best = _task(), dict.fromkeys(programs, 0.0)
    totals = set()
    for _ in range(1 if quick else 5):
        for key, program in programs.items():
            done = subprocess.run([str(program.path)], input=task, capture_output=True, text=True, check=True)
            rate, total = map(float, done.stdout.split())
            best[key] = max(best[key], rate)
            totals.add(total)
    if totals and max(totals) > min(totals) * (1 + 1e-9):
        raise RuntimeError(f"expected the same sum of variances from all, given {sorted(totals)}")
    figures = []
    for (level, kind, lanes), rate in best.items():
        ratio = rate / best[level, "ours", NATIVE_LANES[level]]
        figures.append(Figures(level, BACKINGS[kind][0], lanes, rate, ratio, programs[level, kind, lanes].seconds))
    return figures, sorted({reason for reason in reasons.values() if reason is not None})


def _program(level: str, kind: str, lanes: int) -> Program:
    options = [*OPTIONS, f"-march=x86-64-{level}", f"-DBACKING_{kind}", f"-DWIDTH={lanes}"]
    sources = [*SOURCES.glob("*.?pp"), *CORE.rglob("*.hpp")]
    return compiled(f"packs-{kind}-{lanes}-{level}", SOURCES / "packs.cpp", options, sources)


def _task() -> str:
    rows = [[MODEL.constants[name] for name in CONSTANTS], PRIOR.mean.values(), PRIOR.std.values(), *candidates().table[::4]]
    return "\n".join(" ".join(repr(float(value)) for value in row) for row in rows)
