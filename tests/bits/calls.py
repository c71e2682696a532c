"""Calls of public functions whose results are recorded: each by a name, of a number of threads."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import fisherpoint as fp

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"

SMALL: dict[str, Any] = {"n_candidates": 20, "max_iterations": 4}
CYLINDER = fp.HydraulicCylinder()
CALLS: dict[str, Callable[[int], Any]] = {}


def case(name: str, function: Callable[..., Any], *given: Any, **options: Any) -> None:
    """A call, to which the number of threads is added."""
    CALLS[name] = lambda threads: function(*given, **options, threads=threads)


# --- what they are about ------------------------------------------------------------------------------------------------


def tanks() -> fp.Model:
    """Two tanks in a row; the upper one has an overflow."""
    return fp.SymbolicModel(
        ["c*u - k1*sqrt(a) - max(a - 1, 0)", "k1*sqrt(a) - k2*sqrt(b)"],
        ["b", "a"],
        states={"a": "m", "b": "m"},
        inputs={"u": "1"},
        outputs={"y": "m", "z": "m"},
        parameters={"k1": "1", "k2": "1"},
        constants={"c": (1.0, "1")},
        nominal={"k1": 1.0, "k2": 0.8},
        check_units=False,
    )


def late_tanks() -> fp.Model:
    """A tank that is filled late."""
    return fp.SymbolicModel(
        ["delay(u, tau) - k1*sqrt(a) - max(a - 1, 0)", "k1*sqrt(a) - k2*sqrt(b)"],
        ["b", "a"],
        states={"a": "m", "b": "m"},
        inputs={"u": "1"},
        outputs={"y": "m", "z": "m"},
        parameters={"k1": "1", "k2": "1", "tau": "s"},
        nominal={"k1": 1.0, "k2": 0.8, "tau": 0.15},
        check_units=False,
    )


def cylinder(**changes: Any) -> fp.DesignProblem:
    return fp.load_problem(EXAMPLES / "cylinder.toml").replace(**changes)


def tank_problem(**changes: Any) -> fp.DesignProblem:
    region = fp.ExperimentRegion({"a": (0.5, 2.0), "b": (0.5, 2.0), "u": (0.0, 2.0), "dt": (0.1, 2.0)}, ["a > b / 4"])
    return _tanks_in(region).replace(**changes)


def tank_runs(**changes: Any) -> fp.DesignProblem:
    return _tanks_in(fp.RunRegion({"a": 1.0, "b": (0.5, 1.0), "u": (0.0, 2.0), "dt": 0.2}, segments=8)).replace(**changes)


def _tanks_in(region: Any) -> fp.DesignProblem:
    prior = fp.GaussianPrior({"k1": 1.0, "k2": 0.8}, relative_std={"k1": 0.2, "k2": 0.3})
    return fp.DesignProblem(tanks(), prior, region, noise={"y": 0.01, "z": 0.02}, rule=fp.GaussHermite(3))


def line() -> fp.DesignProblem:
    """A saturation curve, of points that are quick."""
    return fp.load_problem(EXAMPLES / "michaelis_menten.toml")


@cache
def points(count: int = 200) -> fp.Experiments:
    """Points of the cylinder, some of which meet v = 0 or leave the domain."""
    region = cylinder().region
    assert isinstance(region, fp.ExperimentRegion)
    return region.draw(CYLINDER, count, seed=1)


@cache
def tank_points(count: int = 40) -> fp.Experiments:
    region = tank_problem().region
    assert isinstance(region, fp.ExperimentRegion)
    return region.draw(tank_problem().model, count, seed=2)


@cache
def driven() -> fp.Runs:
    rng = np.random.default_rng(3)
    measured = rng.random((6, 20)) < 0.7
    measured[:, -1] = True
    return fp.Runs(rng.uniform(0.5, 1.4, (6, 2)), rng.uniform(0.0, 1.6, (6, 20)), np.full((6, 20), 0.25), measured)


def rig() -> fp.VirtualRig:
    return fp.VirtualRig(tank_problem().model, {"k1": 1.1, "k2": 0.75}, {"y": 0.01, "z": 0.02}, seed=4)


@cache
def record() -> fp.Record:
    u = np.tile([1.0, 1.0, 0.3, 0.3], (1, 10))
    run = fp.Runs(np.array([[1.0, 0.7]]), u, np.full(u.shape, 0.1), np.ones(u.shape, bool))
    y = fp.VirtualRig(tank_problem().model, {"k1": 1.1, "k2": 0.75}, {"y": 0.01, "z": 0.02}, seed=5).measure(run).y[0]
    t = np.linspace(0.0, 4.0, 41)
    return fp.Record(t, np.append(u[0], 0.3)[:, None], np.vstack([[0.7, 1.0], y]), x0={"a": 1.0, "b": 0.7})


# --- trajectories ---------------------------------------------------------------------------------------------------------


def simulated_record(threads: int) -> fp.results.RecordTrajectory:
    """A record's trajectory, which takes one thread."""
    return fp.simulate_record(tanks(), record().t, record().u, tanks().nominal, record().x0)


def written_as_functions(threads: int) -> fp.Sensitivities:
    """A model that is no text of equations."""
    model = fp.CallableModel(
        lambda x, u, p: [u.u - p.k * np.sqrt(x.h)],
        lambda x, u, p: [x.h],
        states={"h": "m"}, inputs={"u": "1"}, parameters={"k": "1"}, outputs={"y": "m"}, nominal={"k": 1.0},
    )  # fmt: skip
    points = fp.Experiments([[1.0], [0.5]], [[0.5], [1.0]], [0.5, 1.0])
    return fp.sensitivities(model, points, model.nominal, threads=threads)


for jumps in ("cross", "exclude"):
    case(f"simulate, jumps {jumps}", fp.simulate, CYLINDER, points(), CYLINDER.nominal, jumps=jumps)
    case(f"sensitivities, jumps {jumps}", fp.sensitivities, CYLINDER, points(), CYLINDER.nominal, jumps=jumps)
case("simulate from equations", fp.simulate, tanks(), tank_points(), tanks().nominal)
case("sensitivities of runs", fp.sensitivities, tanks(), driven(), tanks().nominal)
case("sensitivities of runs with a dead time", fp.sensitivities, late_tanks(), driven(), late_tanks().nominal)
case("implicit method", fp.sensitivities, tanks(), tank_points(), tanks().nominal, method="Radau")
case("simulate a record", simulated_record)
case("model of functions", written_as_functions)

# --- information ----------------------------------------------------------------------------------------------------------

RULES = (fp.TensorGrid(levels=2), fp.GaussHermite(2), fp.SparseGaussHermite(3), fp.Unscented(), fp.LinearizedRule(), fp.Sobol(64))
ASSUMED = tank_problem(uncertain={"c": 0.1}, initial_state_std={"a": 0.01}, along=["a >= 0"])
BELOW = tank_problem(along=["a < 1.9"])

for rule in RULES:
    name = f"predictive covariance, {type(rule).__name__}"
    case(name, fp.predictive_covariance, CYLINDER, points(24), cylinder().prior, rule)
for covariance in ("noise", "region", "pooled", "pointwise"):
    case(f"evaluate, {covariance}", fp.evaluate, tank_problem(output_covariance=covariance), tank_points()[:6])
case("evaluate runs", fp.evaluate, tank_runs(), driven())
case("evaluate what is assumed", fp.evaluate, ASSUMED, tank_points()[:6])
case("compare rules", fp.compare_rules, tank_problem(), tank_points()[:3])
case("compare designs", fp.compare, tank_problem(), {"some": tank_points()[:4], "others": tank_points()[4:8]}, draws=50)
case("feasibility", fp.feasibility, BELOW, tank_points(), draws=50)
case("identifiability", fp.identifiability, tanks(), tank_problem().prior, tank_problem().region)
case("broken limits", fp.broken_limits, tanks(), tank_points(), tanks().nominal)

# --- designs --------------------------------------------------------------------------------------------------------------

GOALS = [
    fp.Goal("A"), fp.Goal("E"), fp.Goal("ME"), fp.Goal("Ds", of=["k1"]), fp.Goal("c", of="k1 / k2"),
    fp.Goal("I", of="y", conditions=tank_points()[:3]),
]  # fmt: skip
OVER = {kind: fp.OverPrior(kind, scenarios=fp.Sobol(4)) for kind in ("log", "worst", "cvar")}
DRAWN: dict[str, Any] = {"n_starts": 1, "n_candidates": 30}

case("exchange, auto, crossed", fp.exchange, cylinder(), 12, **SMALL)
case("exchange, auto, excluded", fp.exchange, cylinder(jumps="exclude"), 12, **SMALL)
case("exchange, paper", fp.exchange, cylinder(), 12, method="paper", **SMALL)
for goal in GOALS:
    case(f"exchange, {goal.criterion}", fp.exchange, tank_problem(), 4, goal=goal, **SMALL)
for kind, over in OVER.items():
    case(f"exchange over the prior, {kind}", fp.exchange, tank_problem(), 3, goal=fp.Goal(over=over), **SMALL)
    case(f"approximate over the prior, {kind}", fp.approximate_design, tank_problem(), tank_points(), goal=fp.Goal(over=over))
case("exchange, one point", fp.exchange, tank_problem(), 1, **SMALL)
case("exchange, with the prior", fp.exchange, tank_problem(), 3, goal=fp.Goal(prior_information=True), **SMALL)
case("exchange, confidence", fp.exchange, BELOW, 3, goal=fp.Goal(confidence=0.9), **SMALL)
case("exchange, kept and previous", fp.exchange, tank_problem(), 5, keep=tank_points()[:2], previous=tank_points()[2:5], **SMALL)
case("exchange, what is assumed", fp.exchange, ASSUMED, 4, **SMALL)
case("sweep", fp.sweep, tank_problem(), (2, 3, 4), cost=fp.Cost(per_experiment=1.0, per_change={"u": 2.0}), **SMALL)
case("approximate", fp.approximate_design, tank_problem(), tank_points())
case("approximate, of ascents", fp.approximate_design, line(), n_candidates=50, starts=5, tolerance=1e-3)
case("approximate, E", fp.approximate_design, tank_problem(), tank_points(), goal="E")
case("exact", fp.exact_design, tank_problem(), tank_points(), 4)
case("design of runs", fp.design_runs, tank_runs(), 2, **DRAWN)
case("design of runs within a limit", fp.design_runs, tank_runs(along=["a < 1.3"]), **DRAWN)
case("best pieces", fp.design_pieces, tank_problem(), fp.pieces(record(), tanks(), length=5), 2)

# --- estimates ------------------------------------------------------------------------------------------------------------


def profile(threads: int) -> Any:
    given = fp.estimate(tanks(), rig().measure(tank_points()), tank_problem().prior, threads=threads)
    return given.profile("k1", threads=threads)


case("estimate of points", fp.estimate, tanks(), rig().measure(tank_points()), noise={"y": 0.01, "z": 0.02})
case("estimate of runs", fp.estimate, tanks(), rig().measure(driven()), tank_problem().prior)
case("estimate of a record", fp.estimate, tanks(), record(), tank_problem().prior)
case("profile", profile)
case("validate", fp.validate, tank_problem(), {"points": tank_points()[:6]}, runs=20)
case("validate runs", fp.validate, tank_runs(), {"runs": driven()}, runs=10, noise_known=False)
