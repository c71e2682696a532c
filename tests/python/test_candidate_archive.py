"""The bound of a design among the candidates of its search."""

from __future__ import annotations

from itertools import combinations_with_replacement
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.design.candidates.candidate_rows import CandidateRows
from fisherpoint.design.goal.determinant import Determinant
from fisherpoint.design.points.candidate_archive import CandidateArchive
from fisherpoint.design.weights.weights import optimal_weights
from fisherpoint.information.candidates import CandidateSource
from fisherpoint.information.point_information import PointInformation

QUADRATIC = fp.SymbolicModel(
    [], ["a + b*x + c*x**2"], states={}, outputs={"y": "1"}, inputs={"x": "1"}, parameters={"a": "1", "b": "1", "c": "1"}
)
"""Its D-optimal design has a third of the points at -1, 0 and 1 (Kiefer 1959)."""


def problem(**changes: object) -> fp.DesignProblem:
    prior = fp.GaussianPrior({"a": 1.0, "b": 1.0, "c": 1.0}, std={"a": 1.0, "b": 1.0, "c": 1.0})
    region = fp.ExperimentRegion({"x": (-1.0, 1.0)})
    return fp.DesignProblem(QUADRATIC, prior, region, noise={"y": 1.0}, output_covariance="noise", **changes)  # type: ignore[arg-type]


def at(*x: float) -> fp.Experiments:
    return fp.Experiments(np.zeros((len(x), 0)), np.array(x)[:, None])


def information(given: fp.DesignProblem, *x: float) -> PointInformation:
    survivors, _ = CandidateSource(given, np.random.default_rng(0), 1).survivors(at(*x))
    return survivors


def log_det(*x: float) -> float:
    """(7) with D = 1: 2 / L times the sum of squares."""
    rows = np.vander(x, 3)
    return float(np.linalg.slogdet(2 / len(x) * rows.T @ rows)[1])


def bound_of(*candidates: float, design: tuple[float, ...] = (-1.0, 0.2, 1.0)) -> tuple[float, int]:
    given = problem()
    seen = CandidateArchive(given, 1)
    for x in candidates:
        seen.add(information(given, x))
    found = seen.bound(information(given, *design), None)
    assert found is not None
    return found


def test_the_quadratics_bound_is_its_optimum() -> None:
    value, count = bound_of(*np.linspace(-1, 1, 21))
    assert count == 21
    assert log_det(-1, 0, 1) <= value <= log_det(-1, 0, 1) + 3 * 1e-3


def test_no_design_of_the_candidates_exceeds_it() -> None:
    candidates = np.random.default_rng(3).uniform(-1, 1, 9)
    value, _ = bound_of(*candidates, design=tuple(candidates[:3]))
    best = max(log_det(*some) for some in combinations_with_replacement(candidates, 5))
    assert best <= value < best + 0.5


def test_it_is_of_these_candidates_alone() -> None:
    inner, _ = bound_of(*np.linspace(-0.5, 0.5, 11), design=(-0.5, 0.0, 0.5))
    assert log_det(-0.5, 0, 0.5) <= inner + 1e-12 < log_det(-0.5, 0, 0.5) + 3e-3 < log_det(-1, 0, 1)


def test_previous_points_stay() -> None:
    given = problem()
    seen = CandidateArchive(given, 1)
    grid = np.linspace(-1, 1, 5)
    seen.add(information(given, *grid))
    found = seen.bound(information(given, -1.0, 0.5, 1.0), information(given, 0.9, 0.9, 0.9, 0.8))
    best = max(log_det(*some, 0.9, 0.9, 0.9, 0.8) for some in combinations_with_replacement(grid, 3))
    assert found is not None and best <= found.log_det < best + 0.5


def test_candidates_that_some_plants_cannot_run_do_not_count() -> None:
    """x' = p x^2 explodes at 1 / p: later samples tell more, and are none on some nodes of the rule."""
    model = fp.SymbolicModel(["p*x**2"], ["x"], states={"x": "1"}, outputs={"y": "1"}, inputs={}, parameters={"p": "1"})
    prior = fp.GaussianPrior({"p": 1.0}, std={"p": 0.1})
    region = fp.ExperimentRegion({"x": (1.0, 1.0), "dt": (0.1, 0.95)})
    given = fp.DesignProblem(
        model, prior, region, noise={"y": 0.1}, output_covariance="noise", rule=fp.TensorGrid(3, span=2.0), rtol=1e-6
    )

    def of(*dt: float) -> PointInformation:
        points = fp.Experiments(np.ones((len(dt), 1)), np.zeros((len(dt), 0)), np.array(dt))
        return CandidateSource(given, np.random.default_rng(0), 1).survivors(points)[0]

    seen = CandidateArchive(given, 1)
    seen.add(of(0.3, 0.5, 0.93))  # the last ends at p = 1.2, which explodes at 0.83
    found = seen.bound(of(0.4), None)
    assert found is not None
    dy = 0.5 / (1 - 0.5) ** 2 / 0.1 * 0.1  # dx/dp = t / (1 - p t)^2, in units of the noise and of the prior
    assert found.log_det == pytest.approx(np.log(2 * dy**2), abs=2e-3)


def test_there_is_none_where_not_all_parameters_can_be_determined() -> None:
    given = problem()
    seen = CandidateArchive(given, 1)
    assert seen.bound(information(given, 0.5, -0.5), None) is None


@pytest.mark.parametrize("method", ["paper", "auto"])
def test_a_designs_efficiency_is_at_least_what_it_says(method: str) -> None:
    design = fp.exchange(problem(), 3, n_candidates=5, max_iterations=20, method=method)
    efficiency = design.efficiency
    assert efficiency is not None and efficiency.at_least is not None
    true = np.exp((design.evaluation.log_det - log_det(-1, 0, 1)) / 3)
    assert efficiency.at_least == pytest.approx(true, abs=0.05)


def test_a_poor_design_is_not_said_to_be_good() -> None:
    poor = fp.exchange(
        problem(), 3, n_candidates=200, max_iterations=1, method=fp.ExchangeMethod("paper", max_redraws=50, local=0.0)
    ).efficiency
    assert poor is not None and poor.at_least is not None and poor.at_least < 0.9


def test_what_may_not_have_a_weight_is_tried_as_rarely_as_needed_and_left_out() -> None:
    """Many candidates, most of the best of which may not: the weights are those of the others alone, to the tolerance."""
    random = np.random.default_rng(3)
    rows = random.standard_normal((30_000, 1, 4)) * np.exp(random.standard_normal((30_000, 1, 1)))
    may = random.random(len(rows)) < np.exp(-np.linalg.norm(rows[:, 0], axis=1) / 4)
    tried = np.zeros(len(rows), dtype=int)

    def allowed(places: Any) -> Any:
        tried[places] += 1
        return may[places]

    first, determinant = np.flatnonzero(may)[:8], Determinant("D", np.eye(4), True)
    found = optimal_weights(CandidateRows(rows), determinant, tolerance=1e-6, first=first, allowed=allowed)
    others = optimal_weights(CandidateRows(rows[may]), determinant, tolerance=1e-6)
    every = optimal_weights(CandidateRows(rows), determinant, tolerance=1e-6)

    def log_det(rows: Any, weights: Any) -> float:
        return float(np.linalg.slogdet(CandidateRows(rows).information(weights.chosen, weights.weights))[1])

    assert may[found.chosen].all() and found.efficiency > 1 - 2e-6
    assert log_det(rows, found) == pytest.approx(log_det(rows[may], others), abs=1e-5)
    assert log_det(rows, every) > log_det(rows, found) + 0.1
    assert tried[~may].max() == 1 and (tried > 0).sum() < 5000


def test_weights_are_not_computed_anew_where_nothing_entered() -> None:
    """One of a thousand may have a weight: the rounds are those that had one to take in, but for the last of each kind."""
    random = np.random.default_rng(5)
    rows = random.standard_normal((30_000, 1, 4))
    may = random.random(len(rows)) < 1e-3

    found = optimal_weights(
        CandidateRows(rows), Determinant("D", np.eye(4), True), first=np.flatnonzero(may)[:8], allowed=lambda places: may[places]
    )
    assert may[found.chosen].all() and found.efficiency > 1 - 2e-6
    assert found.rounds <= 12
