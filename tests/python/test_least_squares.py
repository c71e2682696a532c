"""Many least-squares problems at once, against SciPy's one at a time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.optimize import least_squares

from fisherpoint.estimation.least_squares import CONVERGED, NOT_EVALUABLE, minimise
from fisherpoint.quantity import Array

One = Callable[[Array, int], tuple[Array, Array]]


def together(one: One, fails: Callable[[Array], bool] = lambda z: False) -> tuple[Any, list[tuple[int, Array, float]]]:
    """Residuals of many problems from those of one, z (P,) and its place, and what was asked, with the costs."""
    asked: list[tuple[int, Array, float]] = []

    def residuals(z: Array, rows: Array) -> tuple[Array, Array, Array]:
        found = [one(at, int(row)) for at, row in zip(z, rows, strict=True)]
        ok = np.array([not fails(at) for at in z], dtype=bool)
        asked.extend((int(row), at.copy(), 0.5 * float(r @ r)) for row, at, (r, _) in zip(rows, z, found, strict=True))
        r, jacobian = (np.array(part) for part in zip(*found, strict=True))
        return np.where(ok[:, None], r, 0.0), np.where(ok[:, None, None], jacobian, 0.0), ok

    return residuals, asked


def free(p: int) -> tuple[Array, Array]:
    return np.full(p, -np.inf), np.full(p, np.inf)


def rosenbrock(z: Array, row: int) -> tuple[Array, Array]:
    return np.array([10 * (z[1] - z[0] ** 2), 1 - z[0]]), np.array([[-20 * z[0], 10.0], [-1.0, 0.0]])


T = np.linspace(0.0, 3.0, 15)
NOISE = 0.05 * np.random.default_rng(1).standard_normal((40, len(T)))


def exponential(z: Array, row: int) -> tuple[Array, Array]:
    """Data of a exp(-b t) + c with a = 2, b = 1, c = 0.5, each problem with noise of its own, residuals in its units."""
    decay = np.exp(-z[1] * T)
    data = 2 * np.exp(-T) + 0.5 + NOISE[row]
    return (z[0] * decay + z[2] - data) / 0.05, np.stack([decay, -z[0] * T * decay, np.ones_like(T)], axis=1) / 0.05


def scipys(one: One, row: int, z0: Array, lower: Array, upper: Array) -> Array:
    # Bounds with inf ask for its bounded method, which keeps a little off them.
    found = least_squares(
        lambda z: one(z, row)[0], z0, lambda z: one(z, row)[1], (lower, upper), x_scale="jac", ftol=1e-15, xtol=1e-15, gtol=1e-15
    )
    return np.asarray(found.x)


def test_rosenbrock_from_many_starts() -> None:
    starts = np.random.default_rng(0).uniform(-3, 3, (30, 2))
    minima = minimise(together(rosenbrock)[0], starts, *free(2))
    assert (minima.end == CONVERGED).all()
    np.testing.assert_allclose(minima.z, 1.0, atol=1e-9)


def test_exponentials_as_scipy_finds_them() -> None:
    starts = np.tile([1.0, 0.3, 0.0], (len(NOISE), 1))
    minima = minimise(together(exponential)[0], starts, *free(3))
    assert (minima.end == CONVERGED).all()
    for row, z in enumerate(minima.z):
        other = scipys(exponential, row, starts[row], *free(3))
        assert np.linalg.norm(exponential(z, row)[1] @ (z - other)) < 1e-6  # standard errors
        gradient = np.multiply(*np.broadcast_arrays(exponential(z, row)[0][:, None], exponential(z, row)[1])).sum(axis=0)
        assert np.abs(gradient / np.linalg.norm(exponential(z, row)[1], axis=0)).max() < 1e-7


def test_a_problem_does_not_depend_on_its_neighbours() -> None:
    starts = np.tile([1.0, 0.3, 0.0], (len(NOISE), 1))
    whole = minimise(together(exponential)[0], starts, *free(3))
    alone = minimise(together(lambda z, row: exponential(z, row + 7))[0], starts[:1], *free(3))
    np.testing.assert_allclose(alone.z[0], whole.z[7], rtol=1e-12)


@pytest.mark.parametrize("bound", [0.9, 1.1])
def test_bounds_hold_and_the_rest_is_minimised_along_them(bound: float) -> None:
    lower, upper = np.array([-np.inf, -np.inf, -np.inf]), np.array([np.inf, np.inf, np.inf])
    (lower if bound > 1 else upper)[1] = bound
    starts = np.clip(np.tile([1.0, 0.3, 0.0], (10, 1)), lower, upper)
    residuals, asked = together(exponential)
    minima = minimise(residuals, starts, lower, upper)
    assert all((lower <= z).all() and (z <= upper).all() for _, z, _ in asked)
    assert (minima.end == CONVERGED).all()
    for row, z in enumerate(minima.z):
        other = scipys(exponential, row, np.clip(starts[row], lower + 1e-3, upper - 1e-3), lower, upper)
        # SciPy keeps off a bound by a hair; its cost cannot be lower than ours by more than rounding.
        ours, theirs = (0.5 * float(np.square(exponential(at, row)[0]).sum()) for at in (z, other))
        assert ours <= theirs * (1 + 1e-12)
        assert np.linalg.norm(exponential(z, row)[1] @ (z - other)) < 1e-3
    assert (minima.z[:, 1] == bound).any()


def test_cost_never_rises() -> None:
    starts = np.random.default_rng(2).uniform(-2, 2, (20, 2))
    residuals, asked = together(rosenbrock)
    costs = []
    for most in range(1, 12):
        costs.append(minimise(residuals, starts, *free(2), max_iterations=most).cost)
    assert (np.diff(costs, axis=0) <= 1e-7 * (1 + np.array(costs[:-1]))).all()
    minima = minimise(residuals, starts, *free(2))
    for row in range(len(starts)):
        assert minima.cost[row] <= min(cost for other, _, cost in asked if other == row) + 1e-12


def test_failing_trials_are_stepped_around() -> None:
    residuals, _ = together(exponential, lambda z: bool(z[1] > 1.5))
    minima = minimise(residuals, np.tile([3.0, 0.1, -1.0], (10, 1)), *free(3))
    without = minimise(together(exponential)[0], np.tile([3.0, 0.1, -1.0], (10, 1)), *free(3))
    assert (minima.end == CONVERGED).all()
    np.testing.assert_allclose(minima.z, without.z, atol=1e-9)


def test_a_start_that_cannot_be_evaluated_is_told_and_left() -> None:
    starts = np.array([[1.0, 0.3, 0.0], [1.0, 5.0, 0.0]])
    minima = minimise(together(exponential, lambda z: bool(z[1] > 3))[0], starts, *free(3))
    assert minima.end.tolist() == [CONVERGED, NOT_EVALUABLE]
    np.testing.assert_array_equal(minima.z[1], starts[1])


def test_a_minimum_past_what_can_be_evaluated_does_not_count_as_one() -> None:
    minima = minimise(together(exponential, lambda z: bool(z[1] > 0.7))[0], np.array([[1.0, 0.3, 0.0]]), *free(3))
    assert minima.end[0] != CONVERGED


def test_a_singular_direction_is_not_moved_along() -> None:
    """Only z0 + z1 matters, in units that differ by ten decades."""

    def summed(z: Array, row: int) -> tuple[Array, Array]:
        return np.array([z[0] + 1e10 * z[1] - 3 - row, 0.5]), np.array([[1.0, 1e10], [0.0, 0.0]])

    minima = minimise(together(summed)[0], np.zeros((3, 2)), *free(2))
    assert (minima.end == CONVERGED).all()
    np.testing.assert_allclose(minima.z[:, 0] + 1e10 * minima.z[:, 1], [3.0, 4.0, 5.0], rtol=1e-12)
    # The least step in scaled columns: both share alike.
    np.testing.assert_allclose(minima.z[:, 0], 1e10 * minima.z[:, 1], rtol=1e-6)


def test_a_coordinate_without_influence_stays() -> None:
    def partly(z: Array, row: int) -> tuple[Array, Array]:
        r, jacobian = exponential(z[:3], row)
        return r, np.column_stack([jacobian, np.zeros(len(T))])

    minima = minimise(together(partly)[0], np.tile([1.0, 0.3, 0.0, 7.0], (4, 1)), *free(4))
    assert (minima.end == CONVERGED).all()
    assert (minima.z[:, 3] == 7.0).all()
