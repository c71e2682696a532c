"""Every public picture, of small inputs that are given: points, runs and data, and searches only where a picture is of one."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import cache

import numpy as np
from matplotlib.figure import Figure

import fisherpoint as fp
from fisherpoint.campaign.pictures import plot_campaign
from fisherpoint.design.approximate.approximate_pictures import sensitivity_figure
from fisherpoint.design.compare.compare_picture import plot_comparison
from fisherpoint.design.fleet.share_picture import plot_shares
from fisherpoint.design.pieces.piece_pictures import plot_windows
from fisherpoint.design.results.evaluated_points import evaluate_points
from fisherpoint.design.results.pictures import plot_points, plot_standard_errors, plot_trajectories
from fisherpoint.design.runs.run_picture_list import plots_of
from fisherpoint.information.pictures import plot_failures, plot_rules, plot_singular_values

TWO = fp.SymbolicModel(
    ["(u - a)/tau", "(u - b)/T"],
    ["a", "a + b"],
    {"a": "V", "b": "V"},
    {"u": "V"},
    {"tau": "s", "T": "s"},
    {"y": "V", "z": "V"},
    name="two",
)
"""A transient of 1 s beside one of 1000 s."""

DECAY = fp.SymbolicModel(["-k*c"], ["c"], {"c": "mol/m3"}, {}, {"k": "1/s"}, {"c": "mol/m3"}, name="decay")
LINE = fp.SymbolicModel([], ["p*s + q*t"], {}, {"s": "1", "t": "m"}, {"p": "Pa", "q": "Pa/m"}, {"y": "Pa"}, name="line")


@cache
def problem() -> fp.DesignProblem:
    prior = fp.GaussianPrior({"tau": 1.0, "T": 1000.0}, relative_std={"tau": 0.2, "T": 0.2})
    region = fp.ExperimentRegion({"a": (0.0, 1.0), "b": (0.0, 1.0), "u": (0.0, 1.0), "dt": (0.1, 1e4)})
    return fp.DesignProblem(TWO, prior, region, noise={"y": 0.02, "z": 0.03}, along=["b <= 1.2", "a <= 1.5"])


@cache
def points() -> fp.Experiments:
    table = [[0.2, 0.1, 1.0, 0.5], [0.2, 0.1, 1.0, 5.0], [0.9, 0.4, 0.0, 1.2], [0.0, 1.0, 0.5, 900.0], [0.2, 0.1, 1.0, 8000.0]]
    return fp.Experiments.of_table(TWO, np.array(table))


@cache
def runs() -> fp.Runs:
    return fp.Runs([[0.0, 0.0]] * 2, [[1.0, 0.0, 1.0], [1.0, -1.0, 0.0]], [[1000.0, 0.5, 2.0], [800.0, 1.0, 1.0]])


@cache
def single_segments() -> fp.Runs:
    """Of which the first is long and fast at first, and the second short."""
    return fp.Runs([[0.0, 0.0]] * 2, [[1.0], [1.0]], [[8000.0], [2.0]])


@cache
def crowded_record() -> fp.Record:
    t = np.concatenate([[0.0], np.geomspace(0.1, 8000.0, 30)])
    noise = np.random.default_rng(3).standard_normal((len(t), 2)) * [0.02, 0.03]
    y = np.stack([1 - np.exp(-t / 1.1), 2 - np.exp(-t / 1.1) - np.exp(-t / 900.0)], axis=1)
    return fp.Record(t, np.ones(len(t)), y + noise, x0={"a": 0.0, "b": 0.0})


@cache
def fit_over_decades() -> fp.Fit:
    rig = fp.VirtualRig(TWO, {"tau": 1.1, "T": 900.0}, problem().noise, seed=1)
    data = [rig.measure(single_segments()), crowded_record()]
    return fp.estimate(TWO, data, problem().prior, noise=problem().noise)


def in_one_variable() -> fp.DesignProblem:
    region = fp.ExperimentRegion({"c": (1.0, 1.0), "dt": (1.0, 40_000.0)})
    return fp.DesignProblem(DECAY, fp.GaussianPrior({"k": 1e-4}, relative_std={"k": 0.1}), region, noise={"c": 0.1})


@cache
def static() -> fp.DesignProblem:
    prior = fp.GaussianPrior({"p": 2.0, "q": 1e6}, relative_std={"p": 0.1, "q": 0.1})
    return fp.DesignProblem(LINE, prior, fp.ExperimentRegion({"s": (-1.0, 1.0), "t": (0.0, 2.0)}), noise={"y": 0.1})


@cache
def fit() -> fp.Fit:
    rig = fp.VirtualRig(TWO, {"tau": 1.1, "T": 900.0}, problem().noise, seed=1)
    return fp.estimate(TWO, [rig.measure(points()), rig.measure(runs())], problem().prior, noise=problem().noise)


@cache
def fit_of_local() -> fp.Fit:
    """Of lines of one slope, whose levels differ between plants."""
    rng, of = np.random.default_rng(5), np.repeat(np.arange(6), 4)
    s = rng.uniform(-1, 1, len(of))
    y = 3.0 * s + np.array([4.0, 5.2, 4.7, 5.9, 4.4, 5.1])[of] + 0.2 * rng.standard_normal(len(of))
    data = fp.Measurements(
        fp.Experiments(np.zeros((len(of), 0)), np.column_stack([s, np.ones(len(of))])), y, labels={"plant": of.tolist()}
    )
    local = fp.Deviations(local={"q": fp.Local("plant", spread="estimated")})
    return fp.estimate(LINE, data, start={"p": 2.0, "q": 4.0}, noise={"y": 0.2}, deviations=local)


@cache
def fit_with_memory() -> fp.Fit:
    """Of a record, in which what the model lacks has left a slow wave in one output."""
    t = 0.25 * np.arange(120)
    noise = np.random.default_rng(4).standard_normal((len(t), 2)) * [0.02, 0.03]
    y = np.stack([1 - np.exp(-t / 1.1), 2 - np.exp(-t / 1.1) - np.exp(-t / 900.0)], axis=1) + noise
    y[:, 1] += 0.04 * np.sin(t)
    y[5:20, 0] = np.nan
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "residuals: expected white noise")
        return fp.estimate(TWO, fp.Record(t, np.ones(len(t)), y, x0={"a": 0.0, "b": 0.0}), problem().prior)


@cache
def small_fit() -> fp.Fit:
    """Of parameters far from one, in units without prefixes."""
    rig = fp.VirtualRig(DECAY, {"k": 1.1e-4}, {"c": 0.02}, seed=2)
    durations = fp.Experiments.of_table(DECAY, np.array([[1.0, 2000.0], [1.0, 9000.0], [1.0, 20_000.0]]))
    return fp.estimate(DECAY, rig.measure(durations), start={"k": 1e-4}, noise={"c": 0.02})


@cache
def fit_of_line() -> fp.Fit:
    rig = fp.VirtualRig(LINE, {"p": 2e-6, "q": 3e6}, {"y": 1e-7}, seed=2)
    table = np.array([[-1.0, 0.0], [1.0, 1e-13], [-1.0, 2e-13], [1.0, 0.0], [0.0, 2e-13]])
    return fp.estimate(LINE, rig.measure(fp.Experiments.of_table(LINE, table)), start={"p": 2e-6, "q": 3e6}, noise={"y": 1e-7})


def of_points(kind: Callable[..., Figure]) -> Callable[[], Figure]:
    return lambda: kind(evaluate_points(problem(), points()))


def of_runs(kind: str, runs: Callable[[], fp.Runs] = runs) -> Callable[[], Figure]:
    without_region = problem().replace(region=None)
    return lambda: plots_of(without_region, runs(), fp.evaluate(without_region, runs()))[kind]()


def responses() -> Figure:
    durations = [[1.0, 2.0], [1.0, 2.1], [1.0, 9000.0], [1.0, 30_000.0]]
    return plot_points(evaluate_points(in_one_variable(), fp.Experiments.of_table(DECAY, np.array(durations))))


def static_points() -> Figure:
    table = np.array([[-1.0, 0.0], [1.0, 2.0], [1.0, 0.5]])
    return plot_points(evaluate_points(static(), fp.Experiments.of_table(LINE, table)))


def criterion() -> Figure:
    found = fp.exchange(static(), 4, n_candidates=5, max_iterations=6, method=fp.ExchangeMethod("paper", references=False))
    return found.plot("criterion")


def sweep() -> Figure:
    return fp.sweep(static(), range(2, 6), max_iterations=5).plot()


def sensitivity() -> Figure:
    sample, support = points(), points()[:2]
    values = np.array([1.0, 1.5, 0.5, 1.2, 2.0])
    return sensitivity_figure(TWO.axes, sample, values, support, np.array([2.0, 2.0]), np.array([0.4, 0.6]), 2)


def validation() -> Figure:
    return fp.validate(problem(), {"points": points()}, runs=30, use_prior=True).plot()


def fleet() -> Figure:
    return plot_shares({"A": {"tau": 0.7, "T": 0.1}, "B": {"tau": 0.2, "T": 0.9}, "C": {"tau": 0.1, "T": 0.0}}, "plant")


def validation_of_local() -> Figure:
    prior = fp.GaussianPrior({"p": 2.0, "q": 4.0}, {"p": 1.0, "q": 2.0})
    of_runs = fp.DesignProblem(LINE, prior, None, noise={"y": 0.2}, local={"q": "run"})
    runs = fp.Runs(np.zeros((3, 0)), np.linspace(0.0, 2.0, 24).reshape(3, 4, 2) ** 2, np.ones((3, 4)))
    return fp.validate(of_runs, {"runs": runs}, runs=30).plot()


def windows() -> Figure:
    y = np.array([[[0.1], [0.4]], [[0.9], [0.5]]])
    held = fp.Runs([[0.0, 0.0], [1.0, 0.5]], [[1.0, 1.0], [0.0, 0.0]], [[1.0, 1.0], [1.0, 1.0]])
    return plot_windows(np.array([0.0, 30.0]), held, y, np.array([0.7, 0.3]), TWO.outputs[:1], "windows")


SERIES = [{"tau": 0.2, "T": 0.2}, {"tau": 0.05, "T": 0.1}, {"tau": 0.01, "T": 0.04}]

PICTURES: dict[str, Callable[[], Figure]] = {
    "points": of_points(plot_points),
    "responses": responses,
    "static points": static_points,
    "trajectories": of_points(plot_trajectories),
    "standard errors": of_points(plot_standard_errors),
    "criterion": criterion,
    **{f"runs: {kind}": of_runs(kind) for kind in ("runs", "information", "standard_errors", "correlation")},
    "runs: single segments": of_runs("runs", single_segments),
    "fit: over decades": lambda: fit_over_decades().plot("time"),
    **{f"fit: {kind}": lambda kind=kind: fit().plot(kind) for kind in ("parity", "residuals", "time", "correlation", "ellipses")},
    "fit: autocorrelation": lambda: fit_with_memory().plot("autocorrelation"),
    "fit: autocorrelation of few": lambda: small_fit().plot("autocorrelation"),
    "fit: profile": lambda: fit().profile("tau").plot(),
    "fit: local": lambda: fit_of_local().plot("local"),
    "small numbers: ellipses": lambda: fit_of_line().plot("ellipses"),
    "small numbers: profile": lambda: small_fit().profile("k").plot(),
    "validation": validation,
    "fleet": fleet,
    "validation: local": validation_of_local,
    "comparison": lambda: plot_comparison({"points": {"tau": 0.01, "T": 90.0}, "runs": None}, {"tau": 0.2, "T": 200.0}),
    "campaign": lambda: plot_campaign(SERIES, {"tau": 0.02}),
    "sweep": sweep,
    "sensitivity": sensitivity,
    "windows": windows,
    "failures": lambda: plot_failures({"left_domain: a <= 1.5": [3, 0, 1], "met_jump": [0, 0, 20]}, 200, 3, "points", "failures"),
    "singular values": lambda: plot_singular_values(np.array([[1.0, 0.1, 1e-4], [1.0, 0.2, 0.0]]), 1e-3, 2, "singular values"),
    "rules": lambda: plot_rules(
        ["grid", "sparse"], np.array([1e-3, 1e-4]), np.array([[1e-3, 1e-2], [np.nan, np.nan]]), 0.05, "grid"
    ),
}
