"""``python -m bench.design_peers``: designs of fisherpoint next to those of pydex, Pyomo.DoE and discopt-doe.

Four problems with outputs in closed form (`peers/design_cases`), each with a fixed number of measurements. Every program states and
solves each of them the way its documentation tells, in processes of their own, in turn; the least seconds of the processor count,
without imports. All designs are then judged by one function: log det of the sum of g g^T/sigma^2 in the parameters' own units, with
derivatives of the closed form by mpmath at 40 digits, not those of any program. The D-efficiency is (det F/det F of the
best)^(1/p), the best being that of all programs. What is not installed is left out; ``--python`` names an interpreter that has the
programs.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import platform
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import mpmath

import fisherpoint as fp

from .machine import describe
from .peers.design_cases import CASES, DesignCase

ROOT = Path(__file__).resolve().parents[1]
DIGITS = 40
LONGEST = 120.0
"""Seconds after which a program is given up."""


@dataclass(frozen=True)
class Program:
    """A module of `peers`, one of its variants, and how it is installed; `ours` runs in this interpreter."""

    name: str
    module: str
    variant: str
    install: str = ""
    rounds: int | None = None

    @property
    def ours(self) -> bool:
        return not self.install


PYDEX, PYOMO, DISCOPT = "pip install pydex clarabel", "pip install pyomo pandas scipy pounce-solver", "pip install discopt-doe"
PROGRAMS = (
    Program("fisherpoint, exchange", "design_fisherpoint", "exchange"),
    Program("pydex, finite differences", "design_pydex", "differences", PYDEX),
    Program("pydex, derivatives given", "design_pydex", "derivatives", PYDEX),
    Program("Pyomo.DoE, 1 start", "design_pyomo", "1 start", PYOMO),
    Program("Pyomo.DoE, best of 3 starts", "design_pyomo", "3 starts", PYOMO, rounds=1),
    Program("discopt-doe, 10 starts", "design_discopt", "10 starts", DISCOPT),
    Program("discopt-doe, 1000 starts", "design_discopt", "1000 starts", DISCOPT),
)


@dataclass
class Figures:
    """What one program found for one problem."""

    points: list[float] = field(default_factory=list)
    seconds: float = math.inf
    failed: str = ""


def log_det(case: DesignCase, points: list[float]) -> float:
    """Return log det F of a design, with -inf for a singular one."""
    with mpmath.workdps(DIGITS):
        output = case.output(mpmath.exp)
        theta = {name: mpmath.mpf(value) for name, value in case.parameters.items()}

        def slope(x: Any, name: str) -> Any:
            return mpmath.diff(lambda value: output(x, theta | {name: value}), theta[name])

        rows = mpmath.matrix([[slope(mpmath.mpf(x), name) / case.sigma for name in theta] for x in points])
        determinant = mpmath.det(rows.T * rows)
        return float(mpmath.log(determinant)) if determinant > mpmath.mpf(10) ** (DIGITS // -2) else -math.inf


def run(program: Program, case: DesignCase, interpreter: str) -> dict[str, Any]:
    """Return what `peers/design_run` prints."""
    command = [sys.executable if program.ours else interpreter, "-m", "bench.peers.design_run"]
    environment = dict(os.environ) | {"OPENBLAS_NUM_THREADS": "1"}
    try:
        done = subprocess.run(
            [*command, program.module, program.variant, case.name],
            cwd=ROOT,
            env=environment,
            capture_output=True,
            text=True,
            timeout=LONGEST,
        )
    except subprocess.TimeoutExpired:
        return {"failed": f"nothing after {LONGEST:.0f} s", "seconds": math.inf}
    if done.returncode != 0:
        return {"failed": (done.stderr.strip().splitlines() or ["no message"])[-1], "seconds": math.inf}
    found: dict[str, Any] = json.loads(done.stdout.strip().splitlines()[-1])
    return found


def measure(interpreter: str, rounds: int) -> tuple[dict[tuple[str, str], Figures], dict[str, str]]:
    """Return the figures by program and problem, and the versions."""
    figures: dict[tuple[str, str], Figures] = {}
    versions: dict[str, str] = {}
    absent: set[str] = set()
    for turn in range(rounds):
        for case in CASES:
            for program in PROGRAMS:
                if program.module in absent or turn >= (program.rounds or rounds):
                    continue
                found = run(program, case, interpreter)
                if "missing" in found:
                    absent.add(program.module)
                    print(f"{program.module}: left out, for want of {found['missing']}: {program.install}", flush=True)
                    continue
                entry = figures.setdefault((program.name, case.name), Figures())
                entry.points = found.get("points", [])
                entry.failed = found.get("failed", "")
                entry.seconds = min(entry.seconds, found["seconds"])
                versions |= found.get("versions", {})
    return figures, versions


def show(figures: dict[tuple[str, str], Figures]) -> None:
    """Print a table for each problem."""
    for case in CASES:
        values = {name: log_det(case, entry.points) for (name, of), entry in figures.items() if of == case.name and entry.points}
        best = max(values.values(), default=math.nan)
        print(f"\n**{case.name}**, {case.n_points} measurements, {len(case.parameters)} parameters\n")
        print("| program | log det F | D-efficiency, % | processor, s | points |\n| --- | ---: | ---: | ---: | --- |")
        for program in PROGRAMS:
            entry = figures.get((program.name, case.name))
            if entry is None:
                continue
            if entry.failed:
                print(f"| {program.name} | | | {entry.seconds:.2f} | {entry.failed.splitlines()[0]} |")
                continue
            value = values[program.name]
            efficiency = 100 * math.exp((value - best) / len(case.parameters))
            print(f"| {program.name} | {value:.5f} | {efficiency:.3f} | {entry.seconds:.2f} | {_places(entry.points)} |")


def _places(points: list[float]) -> str:
    """Write the points in order, equal ones to four digits as one with its count."""
    rounded = [f"{point:.4g}" for point in sorted(points)]
    return ", ".join(f"{rounded.count(place)} x {place}" for place in dict.fromkeys(rounded))


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m bench.design_peers", description=__doc__.partition("\n")[0])
    parser.add_argument("--python", default=sys.executable, help="interpreter that has the other programs")
    parser.add_argument("--rounds", type=int, default=3, help="how often each is timed")
    given = parser.parse_args()
    figures, versions = measure(given.python, given.rounds)
    machine = describe()
    known = {"fisherpoint": fp.__version__, "python": platform.python_version(), **versions}
    print(f"\n{machine['processor']}, {machine['cores']} cores, load {machine['load at the start']}")
    print(", ".join(f"{name} {number}" for name, number in known.items()))
    show(figures)


if __name__ == "__main__":
    main()
