"""Optimal designs with known answers, found again by the exchange from models written in Python.

The file's information matrix is M = sum of weight times g g^T, with g the gradient of the output and sigma = 1. By (7) with L
points of equal weight F = 2 M in units of theta; in units of the prior's standard deviations s it is 2 s_i s_j M_ij / sigma^2:

    log det F = log det M + p log(2 / sigma^2) + 2 sum_i log s_i.

The standard deviations enter as scales only. A duration must be positive: where a design measures at t = 0, the region begins at
1e-6 s.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp

CASES = {case["name"]: case for case in json.loads((Path(__file__).parent / "data" / "designs.json").read_text())["cases"]}
SOON = 1e-6


@fp.model(states={"c": "1"}, parameters={"A": "1", "k": "1/s"}, outputs={"y": "1"})
def decay(x, u, p):  # type: ignore[no-untyped-def]
    """The state is the share of A that is left, since sensitivities start at zero."""
    return [-p.k * x.c], [p.A * x.c]


@fp.model(inputs={"s": "mol/m3"}, parameters={"V": "mol/(m3 s)", "K": "mol/m3"}, outputs={"y": "mol/(m3 s)"})
def michaelis_menten(x, u, p):  # type: ignore[no-untyped-def]
    return None, [p.V * u.s / (p.K + u.s)]


@fp.model(states={"d": "1", "c": "1"}, parameters={"k_e": "1/s", "k_a": "1/s", "C": "1"}, outputs={"y": "1"})
def absorption(x, u, p):  # type: ignore[no-untyped-def]
    """c = C (exp(-k_e t) - exp(-k_a t)) for a dose d(0) = 1."""
    return [-p.k_a * x.d, p.C * (p.k_a - p.k_e) * x.d - p.k_e * x.c], [x.c]


@fp.model(states={"A": "1", "B": "1"}, parameters={"k_1": "1/s", "k_2": "1/s"}, outputs={"y": "1"})
def box_lucas(x, u, p):  # type: ignore[no-untyped-def]
    return [-p.k_1 * x.A, p.k_1 * x.A - p.k_2 * x.B], [x.B]


@fp.model(states={"y": "1"}, parameters={"a": "1", "b": "1/s"}, outputs={"y": "1"})
def growth(x, u, p):  # type: ignore[no-untyped-def]
    return [p.b * (p.a - x.y)], [x.y]


@fp.model(states={"x": "1"}, inputs={"u": "1"}, parameters={"a": "1/s", "b": "1/s"}, outputs={"y": "1"})
def linear(x, u, p):  # type: ignore[no-untyped-def]
    return [-p.a * x.x + p.b * u.u], [x.x]


def level(z):  # type: ignore[no-untyped-def]
    """A factor with three settings, -1, 0 and 1."""
    return fp.math.where(z > 1 / 3, 1, fp.math.where(z < -1 / 3, -1, 0))


QUADRATIC = {f"c_{i}": "1" for i in range(6)}


@fp.model(inputs={"a": "1", "b": "1"}, parameters=QUADRATIC, outputs={"y": "1"})
def quadratic(x, u, p):  # type: ignore[no-untyped-def]
    a, b = level(u.a), level(u.b)
    return None, [p.c_0 + p.c_1 * a + p.c_2 * b + p.c_3 * a * a + p.c_4 * b * b + p.c_5 * a * b]


Bounds = dict[str, tuple[float, float]]


def problem(model: fp.SymbolicModel, mean: dict[str, float], bounds: Bounds, sigma: float = 1.0, **given: Any) -> fp.DesignProblem:
    std = {name: 0.1 * (i + 1) for i, name in enumerate(mean)}  # all different
    prior = fp.GaussianPrior(mean=mean, std=std)
    return fp.DesignProblem(model, prior, fp.ExperimentRegion(bounds), noise={"y": sigma}, **given)


def log_det_m(given: fp.DesignProblem, evaluation: fp.Evaluation) -> float:
    """log det of the file's M."""
    assert given.noise is not None
    sigma = given.noise["y"]
    return evaluation.log_det - len(given.std) * math.log(2 / sigma**2) - 2 * float(np.log(given.std).sum())


# model, mean, region, points
ONE_FACTOR: dict[str, tuple[Any, dict[str, float], Bounds, int]] = {
    "exponential decay": (decay, {"A": 1, "k": 1}, {"c": (1, 1), "dt": (SOON, 5)}, 2),
    "Michaelis-Menten": (michaelis_menten, {"V": 1, "K": 1}, {"s": (0, 5)}, 2),
    "one-compartment with absorption": (
        absorption,
        {"k_e": 0.05884, "k_a": 4.298, "C": 21.80},
        {"d": (1, 1), "c": (0, 0), "dt": (SOON, 48)},
        3,
    ),
    "Box-Lucas": (box_lucas, {"k_1": 0.7, "k_2": 0.2}, {"A": (1, 1), "B": (0, 0), "dt": (SOON, 20)}, 2),
    "saturating growth": (growth, {"a": 15, "b": 0.5}, {"y": (0, 0), "dt": (SOON, 10)}, 2),
}


@pytest.mark.long
@pytest.mark.parametrize("copies", [1, 3])
@pytest.mark.parametrize("name", ONE_FACTOR)
def test_designs_in_one_variable(name: str, copies: int) -> None:
    """With a point for each of the support, and with three, of which the exchange must make equal weights."""
    model, mean, bounds, count = ONE_FACTOR[name]
    given = problem(model, mean, bounds)
    design = fp.exchange(given, copies * count, n_candidates=50, max_iterations=300, method=fp.ExchangeMethod(references=False))
    assert log_det_m(given, design.evaluation) == pytest.approx(CASES[name]["log_det_M"], abs=1e-4)
    axis = "dt" if "dt" in bounds else "s"
    width = bounds[axis][1] - bounds[axis][0]
    column = design.points.dt if axis == "dt" else design.points.u[:, 0]
    assert {weight for _, weight in CASES[name]["design"]} == {1 / count}
    expected = np.repeat([place for place, _ in CASES[name]["design"]], copies)
    np.testing.assert_allclose(np.sort(column), expected, atol=3e-3 * width)


@pytest.mark.parametrize("seed", range(3))
def test_a_linear_state_space_model(seed: int) -> None:
    """The start, the input and the duration are chosen; the optimum lies on five bounds."""
    given = problem(linear, {"a": 1, "b": 1}, {"x": (-1, 1), "u": (-1, 1), "dt": (SOON, 5)})
    design = fp.exchange(given, 4, n_candidates=50, max_iterations=200, seed=seed, method=fp.ExchangeMethod(references=False))
    assert log_det_m(given, design.evaluation) == pytest.approx(CASES["linear state space"]["log_det_M"], abs=1e-4)
    turned = design.points.table * np.sign(design.points.table[:, 1:2])  # (x0, u) and (-x0, -u) are worth the same
    turned[:, 2] = design.points.dt
    expected = [(-1, 1, 1), (-1, 1, 1), (1, 1, 5), (1, 1, 5)]
    np.testing.assert_allclose(turned[np.argsort(turned[:, 2])], expected, atol=0.01)


def test_the_next_point_of_a_growth_curve() -> None:
    """One more point beside six: the end of the interval is best, with a lower local maximum at an earlier time."""
    case, times = CASES["augmentation"], np.array([1, 2, 3, 4, 5, 7.0])
    given = problem(growth, {"a": 15, "b": 0.5}, {"y": (0, 0), "dt": (SOON, 10)}, sigma=0.1)

    def evaluated(t: float) -> fp.Evaluation:
        dt = np.append(times, t)
        return fp.evaluate(given, fp.Experiments(np.zeros((7, 1)), np.zeros((7, 0)), dt))

    def log_det_f(t: float) -> float:
        """Of the sum of the points, not their mean."""
        return log_det_m(given, evaluated(t)) - 2 * math.log(given.noise["y"] ** 2) + 2 * math.log(7)  # type: ignore[index]

    grid = np.linspace(0.002, 10, 5000)
    values = np.array([log_det_f(t) for t in grid[::10]])
    assert grid[::10][np.argmax(values)] == pytest.approx(case["best_next"], abs=0.03)
    assert log_det_f(10.0) / math.log(10) == pytest.approx(case["log10_det_F"], abs=1e-5)
    inner = grid[(grid > 0.5) & (grid < 3)]
    assert inner[np.argmax([log_det_f(t) for t in inner[::2]]) * 2] == pytest.approx(case["local_D_maximum_at"], abs=0.01)
    covariance = evaluated(10.0).covariance
    assert covariance is not None
    assert math.log10(np.trace(covariance)) == pytest.approx(case["log10_trace_inv_F"], abs=1e-4)


ZERO = {name: 0.0 for name in QUADRATIC}
SQUARE: Bounds = {"a": (-1, 1), "b": (-1, 1)}


@pytest.mark.parametrize("n_experiments", [6, 7, 8])
def test_exact_designs_of_a_quadratic_in_two_factors(n_experiments: int) -> None:
    """The best choice of so few among the nine settings, against the best weights."""
    given = problem(quadratic, ZERO, SQUARE)
    design = fp.exchange(given, n_experiments, n_candidates=50, max_iterations=300, method=fp.ExchangeMethod(references=False))
    best = CASES["full quadratic in two factors on the 3 x 3 grid, continuous"]["log_det_M"]
    efficiency = math.exp((log_det_m(given, design.evaluation) - best) / 6)
    expected = CASES["same, exact by exhaustive search"]["D_efficiency"][str(n_experiments)]
    assert efficiency == pytest.approx(expected, abs=1e-4)


def test_a_quadratic_in_two_factors_with_many_points() -> None:
    """With 124 points the best shares are within 2e-3 of the best weights: 18 at each corner, 10 at each edge, 12 in the middle."""
    case = CASES["full quadratic in two factors on the 3 x 3 grid, continuous"]
    given = problem(quadratic, ZERO, SQUARE)
    design = fp.exchange(given, 124, n_candidates=50, max_iterations=300, method=fp.ExchangeMethod(references=False))
    assert log_det_m(given, design.evaluation) == pytest.approx(case["log_det_M"], abs=1e-4)
    settings = np.where(np.abs(design.points.u) > 1 / 3, np.sign(design.points.u), 0)
    places, counts = np.unique(settings, axis=0, return_counts=True)
    names = [("centre", "edge", "corner")[int(np.abs(place).sum())] for place in places]
    np.testing.assert_allclose(counts / 124, [case["weights"][name] for name in names], atol=2e-3)
