"""Designs for one function of the parameters by Elfving's theorem, against enumeration and the interior point method."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from fisherpoint.design.approximate.elfving import moved, smallest_sum
from fisherpoint.design.candidates.candidate_rows import CandidateRows
from fisherpoint.design.goal.variance import Variance
from fisherpoint.design.weights.weights import optimal_weights


@pytest.mark.parametrize("seed", range(10))
def test_the_smallest_sum_is_that_of_all_choices_of_points_and_the_plane_proves_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rows, c = rng.standard_normal((12, 3)), rng.standard_normal(3)
    found = smallest_sum(rows, c)
    assert found is not None
    b, y = found
    np.testing.assert_allclose(b @ rows, c, atol=1e-10)
    every = min(np.abs(np.linalg.solve(rows[list(some)].T, c)).sum() for some in itertools.combinations(range(12), 3))
    assert np.abs(b).sum() == pytest.approx(every) == pytest.approx(float(c @ y))
    assert np.abs(rows @ y).max() <= 1 + 1e-9
    weights = optimal_weights(CandidateRows(rows[:, None, :]), Variance("c", c[:, None]))
    assert np.exp(-weights.log_phi) == pytest.approx(every**2, rel=1e-5)
    # Of a design that is not optimal the sum is larger, and no plane proves it.
    worse = np.linalg.lstsq(rows.T, c, rcond=None)[0]
    assert np.abs(worse).sum() > 1.05 * every


def test_what_no_candidates_tell_has_no_sum() -> None:
    assert smallest_sum(np.array([[1.0, 0.0], [2.0, 0.0]]), np.array([0.0, 1.0])) is None


def test_points_move_to_where_the_sum_is_smallest_and_those_that_are_not_needed_go() -> None:
    def rows_at(z: np.ndarray) -> np.ndarray:  # a + b t - with t in [-1, 1]
        return np.column_stack([np.ones(len(z)), 2 * z[:, 0] - 1])

    slope = moved(rows_at, np.array([[0.2], [0.7]]), np.array([-1.0, 1.0]), np.array([0.0, 1.0]), 1e-5)
    assert slope is not None
    np.testing.assert_allclose(slope[0].ravel(), [0, 1], atol=1e-9)
    np.testing.assert_allclose(slope[1], [-0.5, 0.5], atol=1e-9)
    at_one_place = moved(rows_at, np.array([[0.6]]), np.array([0.9]), np.array([1.0, 0.5]), 1e-5)
    assert at_one_place is not None
    assert at_one_place[0] == pytest.approx(0.75) and at_one_place[1] == pytest.approx(1.0)
    assert moved(rows_at, np.array([[0.6]]), np.array([0.9]), np.array([1.0, 3.0]), 1e-5) is None
