"""Criteria in the search for exact designs: what columns add to them, exchange over a pool, and bounds over scenarios."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from hypothesis import given as drawn_from
from hypothesis import settings as examples
from hypothesis import strategies as st

from fisherpoint.design.candidates.candidate_rows import CandidateRows
from fisherpoint.design.goal.criteria import Criterion
from fisherpoint.design.goal.determinant import slopes_of
from fisherpoint.design.goal.scenario_average import SOFTNESS, Average
from fisherpoint.design.points.bound_over_prior import over_bound
from fisherpoint.design.points.pool_exchange import PoolExchange, greedy
from fisherpoint.design.weights.weights import optimal_weights
from fisherpoint.engine.levels import kernels
from test_optimality import CONVEX, NAMES, P
from test_optimality import criteria as drawn

OTHERS = ("Ds", "A", "c", "I", "E", "ME")


def criteria(seed: int = 0) -> dict[str, Criterion]:
    return drawn(np.random.default_rng(seed))


def columns(seed: int, outputs: int, count: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.standard_normal((P, outputs, count)) * rng.uniform(0.3, 2.0, (1, 1, count))


def information_of(w: np.ndarray, chosen: Any) -> np.ndarray:
    own = w[:, :, list(chosen)]
    return np.asarray(np.einsum("pnk,qnk->pq", own, own))


@pytest.mark.parametrize("name", NAMES)
def test_many_matrices_are_worth_what_each_is(name: str) -> None:
    """Also those that do not determine what is asked, or all parameters."""
    rng, criterion = np.random.default_rng(4), criteria()[name]
    rows = [rng.standard_normal((k, P)) * 10.0 ** rng.uniform(-3, 3, P) for k in (1, 2, P, P + 1, 3 * P)]
    matrices = np.stack([*(own.T @ own for own in rows), np.zeros((P, P)), np.diag([*np.ones(P - 1), 0.0])]).reshape(7, 1, P, P)
    each = np.array([[criterion.objective(matrix[0])] for matrix in matrices])
    some = slice(2, 5) if name == "D" else slice(None)  # a singular matrix may have a tiny determinant
    np.testing.assert_allclose(criterion.objectives(matrices)[some], each[some], rtol=1e-7)
    assert np.isfinite(each[2:5]).all() and not np.isfinite(each[5])


# --- what F + W W^T is worth, for all W at once ------------------------------------------------------------------------------


@pytest.mark.parametrize("outputs", [1, 2, 5])
@pytest.mark.parametrize("name", NAMES)
def test_what_is_added_is_what_the_criterion_says_of_each_sum(name: str, outputs: int) -> None:
    w, criterion = columns(1, outputs, 40), criteria()[name]
    f = information_of(w, range(6))
    factor = np.linalg.cholesky(information_of(w, range(3, 12)))
    for one, matrix, seen, offset in (
        (criterion, f, w, criterion.offset(f, np.eye(P))),
        (
            criterion.in_coordinates(factor),
            np.linalg.solve(factor, np.linalg.solve(factor, f).T),
            kernels.divided(factor, w),
            None,
        ),
    ):
        offset = one.offset(matrix, factor) if offset is None else offset
        values = offset + np.log(one.added_exactly(matrix, seen))
        expected = [criterion.objective(f + w[:, :, k] @ w[:, :, k].T) for k in range(40)]
        np.testing.assert_allclose(values, expected, rtol=1e-9, atol=1e-9)
        bounds = offset + np.log(one.added(matrix, seen))
        assert (bounds >= values - 1e-9).all()
        assert one.bounded or np.array_equal(bounds, values)


@pytest.mark.parametrize("name", ("E", "ME"))
def test_the_bounds_of_eigenvalues_leave_few_to_be_looked_at(name: str) -> None:
    """Only so is an exchange over thousands of candidates quick."""
    w, criterion = columns(2, 2, 3000), criteria()[name]
    f = information_of(w, range(5))
    bounds, exact = criterion.added(f, w), criterion.added_exactly(f, w)
    assert (bounds > exact.max()).sum() < 300


@pytest.mark.parametrize("name", NAMES)
def test_a_slope_is_a_difference(name: str) -> None:
    w, criterion = columns(3, 2, 9), criteria()[name]
    f, rows = information_of(w, range(9)), np.eye(P)
    value, slope = criterion.objective_slope(f, rows)
    assert value == pytest.approx(criterion.objective(f), abs=2 * SOFTNESS * np.log(P) if criterion.bounded else 1e-9)
    for k, m in itertools.combinations_with_replacement(range(P), 2):
        step = np.zeros((P, P))
        step[k, m] = step[m, k] = 1e-5
        difference = (criterion.objective_slope(f + step, rows)[0] - criterion.objective_slope(f - step, rows)[0]) / 2e-5
        assert (2 if k != m else 1) * slope[k, m] == pytest.approx(difference, rel=1e-5, abs=1e-7)
    together = slopes_of([criterion, criterion], np.stack([f, 2 * f]), np.stack([rows, rows]))
    assert together is not None and together[0][0] == pytest.approx(value)
    np.testing.assert_allclose(together[1][0], slope, rtol=1e-9, atol=1e-12)
    assert slopes_of([criterion], np.zeros((1, P, P)), rows[None]) is None


# --- exchange over a pool -----------------------------------------------------------------------------------------------------


def exchanged(w: np.ndarray, size: int, criterion: Criterion, starts: int) -> Iterator[np.ndarray]:
    rng, nothing, mean = np.random.default_rng(7), np.zeros((1, P, P)), Average.of_all(1)
    for start in range(starts):
        first = rng.integers(w.shape[2], size=(0, size // 2, size)[start % 3])
        chosen = greedy(w[None], size, nothing, mean, [criterion], first)
        exchange = PoolExchange(w[None], chosen, nothing, mean, [criterion])
        exchange.run(np.arange(w.shape[2]), lambda: False)
        yield exchange.chosen


@pytest.mark.parametrize("name", OTHERS)
@pytest.mark.parametrize("size", [4, 5])
def test_an_exchange_ends_where_no_single_one_gains_and_some_start_finds_the_best(name: str, size: int) -> None:
    """Of all designs of 12 candidates, by enumeration; also with as few points as parameters."""
    w, criterion = columns(4, 1, 12), criteria()[name]
    best = max(
        criterion.objective(information_of(w, chosen)) for chosen in itertools.combinations_with_replacement(range(12), size)
    )
    found = []
    for chosen in exchanged(w, size, criterion, 60):
        found.append(criterion.objective(information_of(w, chosen)))
        for place, other in itertools.product(range(size), range(12)):
            changed = chosen.copy()
            changed[place] = other
            assert criterion.objective(information_of(w, changed)) <= found[-1] + 1e-5
    assert max(found) == pytest.approx(best, abs=1e-5)


@pytest.mark.parametrize("name", CONVEX)
@examples(max_examples=20, deadline=None)
@drawn_from(st.integers(0, 10**6), st.integers(P, 9), st.integers(1, 3))
def test_no_design_is_better_than_the_best_weights(name: str, seed: int, size: int, outputs: int) -> None:
    w, criterion = columns(seed, outputs, 30), criteria(seed)[name]
    candidates = CandidateRows(np.ascontiguousarray(w.transpose(2, 1, 0)))
    found = optimal_weights(candidates, criterion, tolerance=1e-3)
    bound = criterion.objective(candidates.information(found.chosen, found.weights)) - criterion.level * np.log(found.efficiency)
    for chosen in exchanged(w, size, criterion, 2):
        assert np.exp((criterion.objective(information_of(w, chosen) / size) - bound) / criterion.level) <= 1 + 1e-9


@pytest.mark.parametrize("name", CONVEX)
def test_the_bound_over_scenarios_is_near_what_weights_reach(name: str) -> None:
    """With one scenario that of the interior point method; with two, no mixture is better."""
    w, rng = columns(5, 2, 25), np.random.default_rng(5)
    criterion, rows = criteria()[name], np.ascontiguousarray(w.transpose(2, 1, 0))
    nothing = np.zeros((1, P, P))

    def everywhere(places: np.ndarray) -> np.ndarray:
        return np.ones(len(places), dtype=bool)

    one = over_bound(rows[None], nothing, Average.of_all(1), 8, everywhere, [criterion])
    exact = optimal_weights(CandidateRows(rows), criterion)
    best = criterion.objective(CandidateRows(rows).information(exact.chosen, exact.weights))
    assert one is not None and best - 1e-6 <= one < best + criterion.level * (0.2 if name == "E" else 0.02)
    both, average = np.stack([rows, rows[:, :, ::-1]]), Average(np.ones(2))
    two = over_bound(both, np.zeros((2, P, P)), average, 8, everywhere, [criterion, criterion])
    assert two is not None
    for weights in rng.dirichlet(np.full(25, 0.2), 300):
        assert np.mean([criterion.objective(CandidateRows(own).information(np.arange(25), weights)) for own in both]) <= two + 1e-9
