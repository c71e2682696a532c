"""Many least-squares problems at once, against SciPy's one at a time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.optimize import least_squares

from fisherpoint.basics.values import Array
from fisherpoint.estimation.least_squares import CONVERGED, LIMIT, NOT_EVALUABLE, STALLED, UNNOTICED, Accuracy, minimise

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
        costs.append(minimise(residuals, starts, *free(2), max_evaluations=most).cost)
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


SHORT = np.linspace(0.0, 1.0, 60)
SWINGS = np.random.default_rng(3).standard_normal((20, 3))


def swing(z: Array, row: int) -> tuple[Array, Array]:
    """A decaying swing with a frequency that weighs most, a rate and a drift that weigh little; each unit is a prior's std."""

    def modelled(z: Array) -> tuple[Array, Array]:
        decay, phase = np.exp(-(0.5 + 0.1 * z[1]) * SHORT), (10 + 1.5 * z[0]) * SHORT + 0.06 * z[2] * SHORT**2
        slopes = [1.5 * SHORT * np.cos(phase), -0.1 * SHORT * np.sin(phase), 0.06 * SHORT**2 * np.cos(phase)]
        return decay * np.sin(phase), decay[:, None] * np.stack(slopes, axis=1)

    y, slopes = modelled(z)
    data = modelled(SWINGS[row])[0] + 1e-3 * np.random.default_rng(row).standard_normal(len(SHORT))
    return np.concatenate([(y - data) / 1e-3, z]), np.concatenate([slopes / 1e-3, np.eye(3)])


def test_what_a_prior_has_is_not_led_off_by_the_models_curvature() -> None:
    starts, lowest = np.zeros(SWINGS.shape), minimise(together(swing)[0], SWINGS, *free(3)).cost
    residuals, trials = together(swing)
    minima = minimise(residuals, starts, *free(3), has_prior=np.ones(3, dtype=bool))
    assert (minima.end == CONVERGED).all()
    np.testing.assert_allclose(minima.cost, lowest, rtol=1e-6)
    residuals, trials_without = together(swing)
    without = minimise(residuals, starts, *free(3))
    assert (without.cost > 1e3 * lowest).any()  # or the test shows nothing
    farthest, farthest_without = (max(np.abs(z).max() for _, z, _ in some) for some in (trials, trials_without))
    assert farthest < 0.2 * farthest_without


def test_a_prior_of_some_coordinates_leaves_the_minimum_where_it_is() -> None:
    starts = np.tile([1.0, 0.3, 0.0], (len(NOISE), 1))
    plain = minimise(together(exponential)[0], starts, *free(3))
    for has_prior in np.eye(3, dtype=bool):
        minima = minimise(together(exponential)[0], starts, *free(3), has_prior=has_prior)
        assert (minima.end == CONVERGED).all()
        np.testing.assert_allclose(minima.z, plain.z, atol=1e-7)


def test_a_bound_at_which_nothing_can_be_evaluated_is_come_near_to() -> None:
    def volume(z: Array, row: int) -> tuple[Array, Array]:
        least = max(float(z[0]), 1e-300)
        return np.array([100 * (np.log(least) + (row + 1) * np.log(10.0)), 0.01 * z[1]]), np.array(
            [[100 / least, 0.0], [0.0, 0.01]]
        )

    lower, upper = np.array([0.0, -np.inf]), np.full(2, np.inf)
    minima = minimise(together(volume, lambda z: z[0] <= 0)[0], np.tile([1.0, 0.0], (6, 1)), lower, upper)
    assert (minima.end == CONVERGED).all()
    np.testing.assert_allclose(minima.z[:, 0], 10.0 ** -np.arange(1.0, 7.0), rtol=1e-7)


def test_a_minimum_on_a_bound_is_found_though_a_trial_there_has_failed() -> None:
    def cubes(z: Array, row: int) -> tuple[Array, Array]:
        slope = 10.0**row
        return np.array([slope * (z[0] + 1), z[1] ** 3 - 0.125]), np.array([[slope, 0.0], [0.0, 3 * z[1] ** 2]])

    residuals, trials = together(cubes, lambda z: bool(z[1] > 0.55))
    lower, upper = np.array([0.0, -np.inf]), np.full(2, np.inf)
    minima = minimise(residuals, np.tile([0.05, 0.1], (2, 1)), lower, upper)
    assert any(z[0] == 0 and z[1] > 0.55 for _, z, _ in trials)  # or the test shows nothing
    assert (minima.end == CONVERGED).all()
    np.testing.assert_allclose(minima.z, [[0.0, 0.5]] * 2, rtol=1e-7)
    assert (minima.z[:, 0] == 0).all()


def test_a_start_that_cannot_be_evaluated_is_told_and_left() -> None:
    starts = np.array([[1.0, 0.3, 0.0], [1.0, 5.0, 0.0]])
    minima = minimise(together(exponential, lambda z: bool(z[1] > 3))[0], starts, *free(3))
    assert minima.end.tolist() == [CONVERGED, NOT_EVALUABLE]
    np.testing.assert_array_equal(minima.z[1], starts[1])


def test_a_minimum_past_what_can_be_evaluated_does_not_count_as_one() -> None:
    minima = minimise(together(exponential, lambda z: bool(z[1] > 0.7))[0], np.array([[1.0, 0.3, 0.0]]), *free(3))
    assert minima.end[0] != CONVERGED


def test_a_singular_direction_is_not_moved_along() -> None:
    """Only z0 + z1 matters, in units that differ by ten decades; 1e-8 of residuals in units of the noise is what is asked for."""

    def summed(z: Array, row: int) -> tuple[Array, Array]:
        return np.array([z[0] + 1e10 * z[1] - 3 - row, 0.5]), np.array([[1.0, 1e10], [0.0, 0.0]])

    minima = minimise(together(summed)[0], np.zeros((3, 2)), *free(2))
    assert (minima.end == CONVERGED).all()
    np.testing.assert_allclose(minima.z[:, 0] + 1e10 * minima.z[:, 1], [3.0, 4.0, 5.0], rtol=1e-8)
    # The least step in scaled columns: both share alike.
    np.testing.assert_allclose(minima.z[:, 0], 1e10 * minima.z[:, 1], rtol=1e-6)


def test_a_coordinate_without_influence_stays() -> None:
    def partly(z: Array, row: int) -> tuple[Array, Array]:
        r, jacobian = exponential(z[:3], row)
        return r, np.column_stack([jacobian, np.zeros(len(T))])

    minima = minimise(together(partly)[0], np.tile([1.0, 0.3, 0.0, 7.0], (4, 1)), *free(4))
    without = minimise(together(exponential)[0], np.tile([1.0, 0.3, 0.0], (4, 1)), *free(3))
    assert (minima.end == UNNOTICED).all()  # the gradient is zero, and says nothing of this one
    np.testing.assert_allclose(minima.z[:, :3], without.z, rtol=1e-7)
    assert (minima.z[:, 3] == 7.0).all()


def test_a_plateau_that_overflow_made_is_not_a_minimum() -> None:
    """a (1 - exp(-b t)) at a large b: nothing depends on b any more, and the mean of the data has no gradient."""
    data = np.array([109.0, 149, 149, 191, 213, 224])
    t = np.array([1.0, 2, 3, 5, 7, 10])

    def saturating(z: Array, row: int) -> tuple[Array, Array]:
        gone = np.exp(-z[1] * t)
        return z[0] * (1 - gone) - data, np.stack([1 - gone, z[0] * t * gone], axis=1)

    minima = minimise(together(saturating)[0], np.array([[1.0, 1e48], [170.0, 800.0], [100.0, 0.75]]), *free(2), unit=0.0)
    assert minima.end.tolist() == [UNNOTICED, UNNOTICED, CONVERGED]
    assert minima.z[2] == pytest.approx([213.80940889, 0.54723748542], rel=1e-8)


def test_what_is_too_large_to_be_squared_is_stepped_around() -> None:
    def steep(z: Array, rows: Array) -> tuple[Array, Array, Array]:
        with np.errstate(over="ignore"):
            grown = np.exp(700 * z)
        return np.tile(grown - 2, 2), 700 * np.tile(grown[:, :, None], (1, 2, 1)), np.ones(len(z), dtype=bool)

    minima = minimise(steep, np.array([[-0.01], [0.02], [0.6]]), *free(1))
    assert minima.end.tolist() == [CONVERGED, CONVERGED, NOT_EVALUABLE]
    np.testing.assert_allclose(minima.z[:2, 0], np.log(2) / 700, rtol=1e-8)


def test_units_of_unknowns_do_not_count() -> None:
    scale = np.array([1e-12, 1e9, 1e4])

    def scaled(z: Array, row: int) -> tuple[Array, Array]:
        r, jacobian = exponential(z * scale, row)
        return r, jacobian * scale

    starts = np.tile([1.0, 0.3, 0.0], (10, 1))
    one, other = (minimise(together(of)[0], z, *free(3)) for of, z in ((exponential, starts), (scaled, starts / scale)))
    assert (one.end == other.end).all() and (one.end == CONVERGED).all()
    np.testing.assert_allclose(other.z * scale, one.z, rtol=1e-6)


def test_a_search_ends_where_its_evaluations_are_spent() -> None:
    """Rosenbrock's valley from its usual start, told honestly."""
    residuals, asked = together(rosenbrock)
    minima = minimise(residuals, np.array([[-1.2, 1.0]]), *free(2), max_evaluations=5)
    assert minima.end.tolist() == [LIMIT] and len(asked) == minima.evaluations[0] == 5


def test_where_rounding_hides_the_minimum_is_near_enough() -> None:
    """Residuals that are no finer than 1e-6: the gradient comes no nearer to zero, and is as near as these let it."""

    def rounded(z: Array, row: int) -> tuple[Array, Array]:
        r, jacobian = exponential(z, row)
        return np.round(r, 6), jacobian

    starts = np.tile([1.0, 0.3, 0.0], (40, 1))
    rounding = Accuracy(1e-6 * np.sqrt(len(T)), 1e-8)
    minima, exact = (
        minimise(together(rounded)[0], starts, *free(3), accuracy=rounding),
        minimise(together(exponential)[0], starts, *free(3)),
    )
    assert (minima.end == CONVERGED).all() and minima.evaluations.max() < 40
    for row, z in enumerate(minima.z):
        assert np.linalg.norm(exponential(z, row)[1] @ (z - exact.z[row])) < 1e-5  # standard errors
    blind = minimise(together(rounded)[0], starts, *free(3))  # not told that they are
    assert (blind.end != CONVERGED).sum() > 20


def test_a_search_that_creeps_has_stalled() -> None:
    """The residual falls from 10.001 towards 10 without an end, while the tangent promises to remove all of it."""

    def creeping(z: Array, row: int) -> tuple[Array, Array]:
        return np.array([10 + 1e-3 / (1 + z[0] ** 2)]), np.array([[-2e-3 * z[0] / (1 + z[0] ** 2) ** 2]])

    minima = minimise(together(creeping)[0], np.array([[1.0]]), *free(1), 200)
    assert minima.end.tolist() == [STALLED] and minima.evaluations[0] < 50


def test_a_search_for_a_cost_alone_ends_early() -> None:
    starts = np.tile([1.0, 0.3, 0.0], (40, 1))
    exact = minimise(together(exponential)[0], starts, *free(3))
    near = minimise(together(exponential)[0], starts, *free(3), tolerance=1e-2)
    assert (near.end == CONVERGED).all() and near.evaluations.sum() < exact.evaluations.sum()
    assert (near.cost >= exact.cost).all() and (near.cost - exact.cost).max() < 1e-4
