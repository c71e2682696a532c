"""``python -m bench runs``: designs of runs next to published ones, and the paper's cylinder from rest.

log det F is that of parameters in their own units for published problems, and of standardised ones for the cylinder.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import qmc

import fisherpoint as fp

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"

SAME = 1.1e-3
"""By what a value may fall short of a published one that is known to four or five digits: round numbers may cost 1e-3."""


@dataclass(frozen=True)
class RunProblem:
    """A problem, the best published log det F, and how it is searched."""

    name: str
    problem: fp.DesignProblem
    n_runs: int
    published: float
    seeds: int
    options: dict[str, Any]
    own_units: bool = True


@dataclass(frozen=True)
class RunFigures:
    """Of several seeds: the least and the largest log det F, how many reach the published one, seconds, plants that can run it."""

    name: str
    published: float
    least: float
    largest: float
    reached: int
    seeds: int
    longest: float
    least_share: float
    feasible: int


def reactor() -> RunProblem:
    """A -> B -> C under a temperature profile (discopt-doe, benchmarks/pyomo_doe_comparison)."""
    return RunProblem("batch reactor", fp.load_problem(EXAMPLES / "reactor.toml"), 1, 14.4998, 20, {})


def decay() -> RunProblem:
    """Three exponentials, all six parameters, six samples."""
    states, rates = ("x", "y", "z"), ("k_1", "k_2", "k_3")
    model = fp.SymbolicModel(
        f=[f"-{k}*{x}" for k, x in zip(rates, states, strict=True)],
        g=["a_1*x + a_2*y + a_3*z"],
        states=dict.fromkeys(states, "1"),
        inputs={},
        outputs={"s": "1"},
        parameters=dict.fromkeys(("a_1", "a_2", "a_3", *rates), "1"),
    )
    mean = {"a_1": 1.0, "a_2": 0.5, "a_3": 0.2, "k_1": 5.0, "k_2": 0.8, "k_3": 0.05}
    region = fp.RunRegion({**dict.fromkeys(states, 1.0), "dt": (0.01, 60)}, 6, duration=60)
    return RunProblem("three exponentials", _problem(model, mean, {"s": 0.01}, region), 1, 42.8697, 20, {})


def yeast() -> RunProblem:
    """Five fed-batch runs, mean over 128 plants (Asprey and Macchietto; MAGNUS, expdes_fermentation)."""
    model = fp.SymbolicModel(
        f=["(mu*S/(K + S) - D - a)*X", "-mu*S/(K + S)*X/Y + D*(S_in - S)"],
        g=["X", "S"],
        states=dict.fromkeys("XS", "kg/m3"),
        inputs={"D": "1", "S_in": "kg/m3"},
        outputs=dict.fromkeys(("x", "s"), "kg/m3"),
        parameters=dict.fromkeys(("mu", "Y", "K", "a"), "1"),
    )
    mean = {"mu": 0.31, "Y": 0.18, "K": 0.55, "a": 0.05}
    box: dict[str, Any] = {"X": (1, 10), "S": 0.1, "D": (0.05, 0.2), "S_in": (5, 35), "dt": 2.0}
    region = fp.RunRegion(box, 5, constant=("D", "S_in"))
    problem = _problem(model, mean, {"x": 0.2, "s": 0.2}, region)
    points = problem.theta * (0.6 + 0.8 * qmc.Sobol(4, scramble=False).random_base2(8)[1:129])
    over = fp.OverPrior("log", scenarios=[dict(zip(mean, row, strict=True)) for row in points.tolist()])
    return RunProblem("yeast, 128 plants", problem, 5, 44.8997, 3, {"goal": fp.Goal(over=over), "n_starts": 4})


def cylinder() -> RunProblem:
    """The default cylinder from rest, one run of 48 segments of 5 ms, sharp friction; 72 is what was aimed at."""
    problem = fp.load_problem(EXAMPLES / "cylinder.toml")
    areas = problem.model.constants
    box: dict[str, Any] = {
        "q": (0.03, 0.27),
        "v": 0.0,
        "p_A": 5e6,
        "p_B": 5e6 * areas["A_A"] / areas["A_B"],
        "x_v": 0.0,
        "u": (-1, 1),
        "dt": 5e-3,
    }
    problem = problem.replace(region=fp.RunRegion(box, 48))
    return RunProblem("cylinder from rest", problem, 1, 72.0, 10, {}, own_units=False)


CASES: tuple[Callable[[], RunProblem], ...] = (reactor, decay, yeast, cylinder)


def _problem(model: fp.Model, mean: dict[str, float], noise: dict[str, float], region: fp.RunRegion) -> fp.DesignProblem:
    prior = fp.GaussianPrior(mean, {name: 0.1 * value for name, value in mean.items()})
    return fp.DesignProblem(model, prior, region, noise=noise)


def measure(quick: bool, show: Callable[[str], None]) -> list[RunFigures]:
    """Search each problem from all seeds, or in a quick measurement from two."""
    found = []
    for make in CASES:
        case = make()
        seeds = min(case.seeds, 2) if quick else case.seeds
        designs = []
        for seed in range(seeds):
            design = fp.design_runs(case.problem, case.n_runs, seed=seed, **case.options)
            designs.append(design)
            share = design.feasibility.share
            show(f"{case.name}, seed {seed}: {_value(case, design):.5f} in {design.seconds:.1f} s, {share:.1%} of plants")
        values = [_value(case, design) for design in designs]
        found.append(
            RunFigures(
                case.name,
                case.published,
                min(values),
                max(values),
                sum(value >= case.published - SAME * case.own_units for value in values),
                seeds,
                max(design.seconds for design in designs),
                min(design.feasibility.share for design in designs),
                sum(design.feasible for design in designs),
            )
        )
    return found


def _value(case: RunProblem, design: fp.RunDesign) -> float:
    return float(design.log_det - (2 * np.log(case.problem.std).sum() if case.own_units else 0.0))
