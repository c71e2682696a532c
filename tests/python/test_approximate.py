"""Approximate designs of known problems, in a region and among candidates, and what they prove."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp


def algebraic(
    output: str, mean: Mapping[str, float], bounds: Mapping[str, tuple[float, float]], **options: Any
) -> fp.DesignProblem:
    model = fp.SymbolicModel([], [output], {}, dict.fromkeys(bounds, "1"), dict.fromkeys(mean, "1"), {"y": "1"})
    prior = fp.GaussianPrior(mean, dict.fromkeys(mean, 1.0))
    region = fp.ExperimentRegion(bounds)
    return fp.DesignProblem(model, prior, region, noise={"y": 1.0}, rule=fp.LinearizedRule(), **options)


COMPARTMENT = algebraic("c*(exp(-a*t) - exp(-b*t))", {"a": 0.05884, "b": 4.298, "c": 21.80}, {"t": (0, 48)})
MICHAELIS = algebraic("V*s/(K + s)", {"V": 1.0, "K": 1.0}, {"s": (0, 5)})
QUADRATIC = algebraic("p0 + p1*a + p2*b + p3*a*a + p4*b*b + p5*a*b", {f"p{k}": 1.0 for k in range(6)}, {"a": (-1, 1), "b": (-1, 1)})
GRID = np.array([(a, b) for a in (-1.0, 0.0, 1.0) for b in (-1.0, 0.0, 1.0)])


def inputs(values: Any) -> fp.Experiments:
    u = np.asarray(values, dtype=float)
    u = u[:, None] if u.ndim == 1 else u
    return fp.Experiments(np.empty((len(u), 0)), u)


KNOWN = {  # support, weights and log det of the literature, each solved again when it was collected
    "Michaelis-Menten": (MICHAELIS, [5 / 7, 5.0], [1 / 2] * 2, -5.252812),
    "one compartment": (COMPARTMENT, [0.22877, 1.38859, 18.41684], [1 / 3] * 3, 7.388692),
    "Box-Lucas": (
        algebraic("a/(a - b)*(exp(-b*t) - exp(-a*t))", {"a": 0.7, "b": 0.2}, {"t": (0, 20)}),
        [1.22947, 6.85769],
        [1 / 2] * 2,
        -1.80671,
    ),
    "saturating growth": (
        algebraic("A*(1 - exp(-k*t))", {"A": 15.0, "k": 0.5}, {"t": (0, 10)}),
        [1.932163, 10.0],
        [1 / 2] * 2,
        3.283717,
    ),
}


@pytest.mark.parametrize("name", KNOWN)
def test_known_d_optimal_designs_are_found(name: str) -> None:
    problem, support, weights, log_det = KNOWN[name]
    design = fp.approximate_design(problem, n_candidates=1000)
    order = np.argsort(design.points.u[:, 0])
    np.testing.assert_allclose(design.points.u[order, 0], support, atol=1e-3)
    np.testing.assert_allclose(design.weights[order], weights, atol=1e-3)
    assert design.value == pytest.approx(log_det, abs=1e-5)
    assert 0.999 <= design.efficiency <= 1 and design.starts >= 1000
    values = design.sensitivity(inputs(np.linspace(*problem.region.bounds[problem.model.inputs[0].name], 2001)))  # type: ignore[union-attr]
    assert np.nanmax(values) <= design.level * (1 + 1e-3) and design.level == len(support)


def test_the_exponential_decay_is_measured_at_once_and_after_a_time_constant() -> None:
    problem = algebraic("A*exp(-k*t)", {"A": 1.0, "k": 1.0}, {"t": (0, 5)})
    design = fp.approximate_design(problem, n_candidates=500)
    np.testing.assert_allclose(np.sort(design.points.u[:, 0]), [0, 1], atol=1e-3)
    np.testing.assert_allclose(design.weights, 0.5, atol=1e-3)
    assert design.value == pytest.approx(-3.386294, abs=1e-5)


@pytest.mark.long
@pytest.mark.parametrize(
    ("of", "support", "weights", "variance"),
    [
        ("c*(1/a - 1/b)", [0.2327, 17.6339], [0.0135, 0.9865], 2193.84),
        ("log(b/a)/(b - a)", [0.1793, 3.5658], [0.6062, 0.3938], 0.02813),
        ("c*(exp(-a*log(b/a)/(b - a)) - exp(-b*log(b/a)/(b - a)))", [1.0122], [1.0], 1.0),
    ],
)
def test_known_c_optimal_designs_are_found(of: str, support: Sequence[float], weights: Sequence[float], variance: float) -> None:
    """At the second times that Atkinson et al. (1993) print, 17.6322 and 3.5671, two points do not quite determine the function."""
    for seed in (0, 1):
        design = fp.approximate_design(COMPARTMENT, goal=fp.Goal("c", of=of), n_candidates=1000, seed=seed)
        order = np.argsort(design.points.u[:, 0])
        np.testing.assert_allclose(design.points.u[order, 0], support, atol=1e-3)
        np.testing.assert_allclose(design.weights[order], weights, atol=1e-3)
        assert design.value == pytest.approx(variance, rel=1e-3)
        assert 0.9999 < design.efficiency <= 1 and design.starts >= 1000
        values = design.sensitivity(inputs(np.linspace(0, 48, 5001)))
        assert np.nanmax(values) <= 1 + 1e-3
        # The bound is far from a design that is not optimal.
        away = design.efficiency_of(inputs([*support, 40.0]))
        assert away < 0.95


def test_the_quadratic_on_its_grid_and_on_the_square() -> None:
    for design in (fp.approximate_design(QUADRATIC, inputs(GRID)), fp.approximate_design(QUADRATIC, n_candidates=1000)):
        kind = (np.abs(design.points.u) > 0.5).sum(axis=1)
        for zeros, weight in ((2, 0.14579), (1, 0.08016), (0, 0.09619)):
            np.testing.assert_allclose(design.weights[kind == zeros], weight, atol=1e-3)
        np.testing.assert_allclose(design.points.u, design.points.u.round(), atol=1e-3)
        assert design.value == pytest.approx(-4.471776, abs=1e-5)


def test_the_linear_state_space_model() -> None:
    model = fp.SymbolicModel(["-a*x + b*u"], ["x"], {"x": "1"}, {"u": "1"}, {"a": "1", "b": "1"}, {"y": "1"})
    region = fp.ExperimentRegion({"x": (-1, 1), "u": (-1, 1), "dt": (1e-3, 5)})
    prior = fp.GaussianPrior({"a": 1.0, "b": 1.0}, {"a": 1.0, "b": 1.0})
    problem = fp.DesignProblem(model, prior, region, noise={"y": 1.0}, rule=fp.LinearizedRule(), rtol=1e-9)
    design = fp.approximate_design(problem, n_candidates=1000)
    assert design.value == pytest.approx(-2.013521, abs=1e-5)
    signs = design.points.x0[:, 0] * design.points.u[:, 0]
    assert design.weights[signs < 0].sum() == pytest.approx(0.5, abs=1e-3)
    np.testing.assert_allclose(np.abs(np.column_stack([design.points.x0, design.points.u])), 1.0, atol=1e-3)
    np.testing.assert_allclose(design.points.dt, np.where(signs < 0, 1.0, 5.0), atol=1e-3)


def test_exact_designs_are_bounded_and_rounded_ones_come_near() -> None:
    design = fp.approximate_design(QUADRATIC, inputs(GRID))
    # The best exact designs of n points by enumeration of all designs, and by the reference's D-efficiency
    for n, efficiency in ((6, 0.8849), (7, 0.9454), (8, 0.9572)):
        picked = _enumerated(n)
        assert design.efficiency_of(picked) == pytest.approx(efficiency, abs=1e-4)
    assert design.efficiency_of(design.rounded(200)) > 0.999
    assert len(design.rounded(9)) == 9
    with pytest.raises(ValueError, match=r"^n: expected at least as many"):
        design.rounded(8)
    rng = np.random.default_rng(0)
    values = [design.efficiency_of(inputs(GRID[rng.integers(9, size=12)])) for _ in range(30)]
    assert max(values) <= 1.0


def _enumerated(n: int) -> fp.Experiments:
    from itertools import combinations_with_replacement

    a, b = GRID.T
    f = np.column_stack([np.ones(9), a, b, a * a, b * b, a * b])
    outer = f[:, :, None] * f[:, None, :]
    every = np.array(list(combinations_with_replacement(range(9), n)))
    counts = np.apply_along_axis(np.bincount, 1, every, minlength=9)
    return inputs(GRID[every[np.argmax(np.linalg.det(np.tensordot(counts, outer, 1)))]])


@pytest.mark.parametrize(
    "goal", ["A", "E", fp.Goal("Ds", of=("p3", "p4")), fp.Goal("I", of="y", conditions=inputs([(0.5, 0.5), (-0.5, 1.0)]))]
)
def test_other_criteria_have_certificates(goal: str | fp.Goal) -> None:
    design = fp.approximate_design(QUADRATIC, inputs(GRID), goal=goal)
    assert 0.9999 < design.efficiency <= 1
    every = design.sensitivity(inputs(GRID))
    assert every.max() <= design.level * (1 + 1e-4)
    one = fp.criterion(QUADRATIC, goal)
    assert one.value(design.information) == pytest.approx(design.value)
    others = fp.approximate_design(QUADRATIC, inputs(GRID))
    assert one.efficiency(others.information, design.information) <= 1 + 1e-4


def test_the_prior_counts_more_where_less_is_measured() -> None:
    problem = QUADRATIC.replace(noise={"y": 3.0})
    few, many = (
        fp.approximate_design(problem, inputs(GRID), goal=fp.Goal(prior_information=True), n_experiments=n) for n in (2, 10**6)
    )
    without = fp.approximate_design(problem, inputs(GRID))
    np.testing.assert_allclose(np.sort(many.weights), np.sort(without.weights), atol=1e-3)
    assert few.efficiency > 1 - 1e-5
    assert len(few.points) < 9
    constant = few.information - _mean_information(few)
    np.testing.assert_allclose(constant, np.eye(6) / 2, atol=1e-12)
    with pytest.raises(ValueError, match=r"^n_experiments: expected how many"):
        fp.approximate_design(problem, inputs(GRID), goal=fp.Goal(prior_information=True))


def _mean_information(design: fp.ApproximateDesign) -> Any:
    rows = fp.sensitivities(QUADRATIC.model, design.points, QUADRATIC.theta).dy_dtheta[:, 0] / 3.0
    return (rows * design.weights[:, None]).T @ rows


def test_what_cannot_be_estimated_is_named() -> None:
    twice = algebraic("a*b*s/(K + s)", {"a": 1.0, "b": 2.0, "K": 1.0}, {"s": (0, 5)})
    design = fp.approximate_design(twice, inputs(np.linspace(0.1, 5, 50)))
    (null,) = design.null_directions
    assert null["a"] * 2.0 + null["b"] * 1.0 == pytest.approx(0, abs=1e-6) and "K" not in null
    assert "undetermined" in str(design) and len(design.points) == 2
    assert fp.approximate_design(twice, inputs(np.linspace(0.1, 5, 50)), goal=fp.Goal("c", of="a*b")).efficiency > 0.999
    with pytest.raises(ValueError, match=r"^candidates: expected some that determine criterion"):
        fp.approximate_design(twice, inputs(np.linspace(0.1, 5, 50)), goal=fp.Goal("c", of="a"))
    one = fp.approximate_design(MICHAELIS, inputs([1.0]))
    assert len(one.null_directions) == 1 and one.weights == pytest.approx([1.0])


def test_constraints_hold_and_the_support_lies_on_them() -> None:
    region = fp.ExperimentRegion({"s": (0, 5)}, ["s < 3"])
    design = fp.approximate_design(MICHAELIS.replace(region=region), n_candidates=500, starts=100)
    assert design.points.u.max() < 3 and design.points.u.max() > 2.98


def test_misuse_is_told() -> None:
    grid = inputs([0.5, 1.0, 5.0])
    with pytest.raises(ValueError, match=r"^goal: expected one without criterion 'ME' for fisherpoint\.approximate"):
        fp.approximate_design(MICHAELIS, grid, goal="ME")
    with pytest.raises(ValueError, match=r"^output_covariance: expected 'noise'"):
        fp.approximate_design(MICHAELIS.replace(output_covariance="pooled"), grid)
    with pytest.raises(ValueError, match=r"^of: expected names of parameters"):
        fp.approximate_design(MICHAELIS, grid, goal="Ds")
    with pytest.raises(ValueError, match=r"^scale: expected none for criterion 'D'"):
        fp.approximate_design(MICHAELIS, grid, goal=fp.Goal(scale={"V": 1.0, "K": 1.0}))
    with pytest.raises(ValueError, match=r"^region: expected an ExperimentRegion for points, given"):
        fp.approximate_design(MICHAELIS.replace(region=None))


def test_the_words_say_what_is_proven() -> None:
    text = str(fp.approximate_design(MICHAELIS, n_candidates=300, starts=50))
    assert "at least" in text and "not covered" in text and "optimum found" not in text


def test_a_proof_that_falls_short_says_why() -> None:
    design = fp.approximate_design(MICHAELIS, n_candidates=50, starts=20)
    short = replace(design, efficiency=0.8, largest=1.25)
    assert "at least 80 % only: the search ended while it still found places" in " ".join(str(short).split())
    assert "at least 80 % only: double precision has no more here" in " ".join(str(replace(short, starts=0)).split())
    assert "only:" not in str(design)


def test_a_design_that_refutes_the_bound_is_warned_of() -> None:
    inner = fp.approximate_design(QUADRATIC, inputs(GRID / 2))
    with pytest.warns(UserWarning, match="points: expected a design that the bound holds for, given a better one"):
        assert inner.efficiency_of(inputs(GRID)) == 1.0
    assert inner.efficiency_of(inputs(GRID / 2)) < 1.0
