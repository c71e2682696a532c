"""``python -m bench strokes``: runs within short strokes, swings, levels of tanks, several limits at once, and from rest.

A design is good where enough plants that the search has not seen can run it, where no classical run beats it in both respects, and
where the search ends in its time; that of the example of the cylinder at a log det F of 72 or more.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import fisherpoint as fp
from fisherpoint.design.file.configuration import load_config

from .runs import EXAMPLES

CYLINDER = EXAMPLES / "cylinder_runs.toml"

CONFIDENCE = 0.99

SEEDS = 5


@dataclass(frozen=True)
class StrokeFigures:
    """Of a problem and a seed: log det F, the share of plants that can run the design, the same of the best classical run that as
    many can run, seconds and their limit."""

    name: str
    seed: int
    log_det: float
    share: float
    classical: float
    classical_share: float
    seconds: float
    time_limit: float | None
    least: float

    @property
    def good(self) -> bool:
        in_time = self.time_limit is None or self.seconds <= 1.1 * self.time_limit
        return self.share >= CONFIDENCE and self.log_det >= max(self.classical, self.least) and in_time


def cart(stroke: float, segments: int = 50, dt: float = 0.5) -> fp.DesignProblem:
    """A cart that is pushed, and has to stay near its start."""
    model = fp.SymbolicModel(
        f=["v", "b*u - c*v"], g=["x"], states={"x": "m", "v": "m/s"}, inputs={"u": "V"}, outputs={"x_m": "m"},
        parameters={"b": "m/(s2 V)", "c": "1/s"},
    )  # fmt: skip
    region = fp.RunRegion({"x": 0.0, "v": 0.0, "u": (-1, 1), "dt": dt}, segments)
    prior = fp.GaussianPrior({"b": 2.0, "c": 1.0}, relative_std={"b": 0.1, "c": 0.2})
    return fp.DesignProblem(model, prior, region, noise={"x_m": 0.01}, along=[f"abs(x) < {stroke}"])


def arm(segments: int = 40) -> fp.DesignProblem:
    """An arm that hangs from a motor, and must not swing further than its cables allow."""
    model = fp.SymbolicModel(
        f=["w", "k*u - a*sin(phi) - d*w"], g=["phi"], states={"phi": "rad", "w": "rad/s"}, inputs={"u": "V"},
        outputs={"phi_m": "rad"}, parameters={"k": "rad/(s2 V)", "a": "1/s2", "d": "1/s"},
    )  # fmt: skip
    region = fp.RunRegion({"phi": 0.0, "w": 0.0, "u": (-10, 10), "dt": 0.1}, segments)
    prior = fp.GaussianPrior({"k": 8.0, "a": 12.0, "d": 0.4}, relative_std={"k": 0.1, "a": 0.1, "d": 0.3})
    return fp.DesignProblem(model, prior, region, noise={"phi_m": 0.01}, along=["abs(phi) < 1.2"])


def tanks(segments: int = 24) -> fp.DesignProblem:
    """Five tanks, to one of which a valve directs what a pump delivers; none may run over, or dry."""
    each = range(1, 6)
    model = fp.SymbolicModel(
        f=[f"(where(abs(tank - {i}) < 0.5, q, 0) - k_{i}*sqrt(h_{i}))/A" for i in each],
        g=[f"h_{i}" for i in each],
        states={f"h_{i}": "m" for i in each},
        inputs={"q": "m3/s", "tank": "1"},
        outputs={f"y_{i}": "m" for i in each},
        parameters={"A": "m2"} | {f"k_{i}": "m2 sqrt(m)/s" for i in each},
    )
    box: dict[str, Any] = {**{f"h_{i}": 0.5 for i in each}, "q": (0.0, 0.02), "tank": (1, 5), "dt": 10.0}
    region = fp.RunRegion(box, segments, levels={"tank": [1, 2, 3, 4, 5]})
    mean = {"A": 0.5} | {f"k_{i}": 0.002 for i in each}
    prior = fp.GaussianPrior(mean, relative_std=dict.fromkeys(mean, 0.1))
    limits = [f"0.1 < h_{i} < 0.9" for i in each]
    return fp.DesignProblem(model, prior, region, noise={f"y_{i}": 0.01 for i in each}, along=limits)


def cylinder() -> fp.DesignProblem:
    return fp.load_problem(CYLINDER)


def axis(segments: int = 24) -> fp.DesignProblem:
    """The cylinder as an axis of which position, pressures and spool are limited."""
    limits = ["0.10 < q < 0.20", "1e6 < p_A < 9e6", "4e6 < p_B < 16e6", "abs(x_v) < 0.6"]
    problem = cylinder()
    assert isinstance(problem.region, fp.RunRegion)
    bounds = {**problem.region.bounds, "q": (0.14, 0.16)}
    return problem.replace(region=fp.RunRegion(bounds, segments), along=limits)


def rests(segments: int = 12) -> fp.DesignProblem:
    """Two tanks in a column that have settled before a run; the upper one must not run over, nor either run dry."""
    model = fp.SymbolicModel(
        f=["(u*b - k_1*sqrt(h_1))/A", "(k_1*sqrt(h_1) - k_2*sqrt(h_2))/A"], g=["h_2"], states={"h_1": "m", "h_2": "m"},
        inputs={"u": "V"}, outputs={"y": "m"}, constants={"A": 0.05},
        parameters={"b": "m3/(s V)", "k_1": "m2 sqrt(m)/s", "k_2": "m2 sqrt(m)/s"},
    )  # fmt: skip
    region = fp.RunRegion({"h_1": (0.1, 0.9), "h_2": (0.1, 0.9), "u": (0, 10), "dt": 10.0}, segments, rest=fp.Rest({"u": 4.0}))
    prior = fp.GaussianPrior({"b": 5e-4, "k_1": 3e-3, "k_2": 3.2e-3}, relative_std={"b": 0.05, "k_1": 0.05, "k_2": 0.05})
    return fp.DesignProblem(model, prior, region, noise={"y": 0.005}, along=["0.05 < h_1 < 0.9", "0.05 < h_2 < 0.9"])


@dataclass(frozen=True)
class StrokeCase:
    """A problem, how it is searched, and the least log det F of a good design."""

    name: str
    make: Callable[[], fp.DesignProblem]
    n_runs: int = 1
    time_limit: float | None = None
    n_starts: int = 8
    least: float = -float("inf")


CASES: tuple[StrokeCase, ...] = (
    *(StrokeCase(f"cart, |x| < {stroke}", partial(cart, stroke), time_limit=60) for stroke in (0.05, 0.1, 0.2, 0.5)),
    StrokeCase("arm, |phi| < 1.2", arm, time_limit=60),
    StrokeCase("five tanks", tanks, time_limit=60),
    StrokeCase("cylinder from rest", cylinder, n_starts=load_config(CYLINDER).run_settings()["n_starts"], least=72.0),
    StrokeCase("servo axis", axis, time_limit=120),
    StrokeCase("two runs from rest", rests, 2, time_limit=60),
)


def measure(quick: bool, show: Callable[[str], None], cases: tuple[StrokeCase, ...] = CASES) -> list[StrokeFigures]:
    """Search each problem from all seeds, or in a quick measurement from one."""
    found = []
    for case in cases:
        problem = case.make()
        for seed in range(1 if quick else SEEDS):
            found.append(one(case, problem, seed))
            figures = found[-1]
            show(
                f"{case.name}, seed {seed}: {figures.log_det:.3f} ({figures.share:.1%} of plants), classical runs"
                f" {figures.classical:.3f} ({figures.classical_share:.1%}), {figures.seconds:.1f} s:"
                f" {'good' if figures.good else 'NOT GOOD'}"
            )
    return found


def one(case: StrokeCase, problem: fp.DesignProblem, seed: int) -> StrokeFigures:
    """Figures of one search."""
    design = fp.design_runs(
        problem, case.n_runs, n_starts=case.n_starts, seed=seed, goal=fp.Goal(confidence=CONFIDENCE), time_limit=case.time_limit
    )
    share = design.feasibility.share
    as_many = {one: value for one, value in design.classical.items() if design.classical_shares[one] >= share}
    best = max(as_many, key=lambda one: as_many[one], default=None)
    classical = (-float("inf"), 0.0) if best is None else (as_many[best], design.classical_shares[best])
    return StrokeFigures(case.name, seed, design.log_det, share, *classical, design.seconds, case.time_limit, case.least)
