"""The Fisher accumulator against a loop over the points in NumPy."""

from __future__ import annotations

import sys
import threading
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from fisherpoint.engine import _core

Floats = NDArray[np.float64]
N_Y, P = 3, 4


def random_design(count: int, seed: int, n_y: int = N_Y, p: int = P) -> tuple[Floats, Floats, Floats]:
    """Sensitivities, predictive covariances and a regular D."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(count, n_y, n_y))
    d_root = rng.normal(size=(n_y, n_y))
    return rng.normal(size=(count, n_y, p)), root @ root.transpose(0, 2, 1), d_root @ d_root.T + np.eye(n_y)


def filled(s: Floats, c: Floats) -> Any:
    accumulator = _core.FisherAccumulator(s.shape[1], s.shape[2])
    accumulator.add(s, c)
    return accumulator


def fisher(s: Floats, d: Floats) -> Floats:
    """(7) as it is written."""
    total = np.zeros((s.shape[2], s.shape[2]))
    for s_k in s:
        total += s_k.T @ np.linalg.solve(d, s_k)
    return 2.0 / len(s) * total


def pooled(given: Floats, c: Floats) -> Floats:
    """(17)."""
    return given + sum(c) / len(c)


def log_det(a: Floats) -> float:
    sign, value = np.linalg.slogdet(a)
    return float(value) if sign > 0 else -np.inf


# Well conditioned throughout: a few hundred operations on numbers of order one leave 1e-12.
CLOSE = {"rtol": 1e-11, "atol": 1e-11}


@pytest.mark.parametrize("count", [1, 2, 5, 40])
def test_fisher_for_any_output_covariance(count: int) -> None:
    s, c, _ = random_design(count, count)
    accumulator = filled(s, c)
    assert len(accumulator) == count
    for seed in range(5):
        _, _, d = random_design(1, 100 + seed)
        np.testing.assert_allclose(accumulator.fisher(d), fisher(s, d), **CLOSE)


def test_fisher_is_symmetric_to_the_last_bit() -> None:
    s, c, d = random_design(7, 0)
    f = filled(s, c).fisher(d)
    np.testing.assert_array_equal(f, f.T)


def test_points_one_by_one_are_the_points_at_once() -> None:
    s, c, d = random_design(6, 1)
    accumulator = _core.FisherAccumulator(N_Y, P)
    for k in range(6):
        accumulator.add(s[k : k + 1], c[k : k + 1])
    np.testing.assert_array_equal(accumulator.fisher(d), filled(s, c).fisher(d))


def test_removed_points_are_gone() -> None:
    s, c, d = random_design(8, 2)
    accumulator = filled(s, c)
    accumulator.remove(s[[1, 4]], c[[1, 4]])
    left = [0, 2, 3, 5, 6, 7]
    assert len(accumulator) == 6
    np.testing.assert_allclose(accumulator.fisher(d), fisher(s[left], d), **CLOSE)
    np.testing.assert_allclose(accumulator.output_covariance(d, True), pooled(d, c[left]), **CLOSE)


def test_output_covariance_is_given_or_pooled() -> None:
    s, c, d = random_design(5, 3)
    accumulator = filled(s, c)
    np.testing.assert_array_equal(accumulator.output_covariance(d, False), d)
    np.testing.assert_allclose(accumulator.output_covariance(d, True), pooled(d, c), **CLOSE)
    np.testing.assert_allclose(accumulator.output_covariance(np.zeros((N_Y, N_Y)), True), c.mean(axis=0), **CLOSE)


@pytest.mark.parametrize("is_pooled", [False, True])
@pytest.mark.parametrize("ridge", [0.0, 1e-3])
def test_log_det_with_each_candidate(is_pooled: bool, ridge: float) -> None:
    s, c, d = random_design(9, 4)
    more_s, more_c, _ = random_design(11, 5)
    result = filled(s, c).log_det_with(more_s, more_c, d, is_pooled, ridge)
    for m in range(11):
        joined_s, joined_c = np.concatenate([s, more_s[m : m + 1]]), np.concatenate([c, more_c[m : m + 1]])
        used = pooled(d, joined_c) if is_pooled else d
        assert result[m] == pytest.approx(log_det(fisher(joined_s, used) + ridge * np.eye(P)), rel=1e-11, abs=1e-11)


@pytest.mark.parametrize("is_pooled", [False, True])
@pytest.mark.parametrize("ridge", [0.0, 1e-3])
def test_log_det_without_each_point(is_pooled: bool, ridge: float) -> None:
    s, c, d = random_design(9, 6)
    result = filled(s, c).log_det_without(s, c, d, is_pooled, ridge)
    for m in range(9):
        left_s, left_c = np.delete(s, m, axis=0), np.delete(c, m, axis=0)
        used = pooled(d, left_c) if is_pooled else d
        assert result[m] == pytest.approx(log_det(fisher(left_s, used) + ridge * np.eye(P)), rel=1e-10, abs=1e-10)


@pytest.mark.parametrize("is_pooled", [False, True])
@pytest.mark.parametrize("without", [False, True])
def test_nuisance_parameters_are_marginalised(is_pooled: bool, without: bool) -> None:
    """The inverse of the rest of the inverse, with unit information of each nuisance parameter beside the points."""
    s, c, d = random_design(9, 4)
    more_s, more_c, _ = random_design(5, 5)
    accumulator = filled(s, c)
    if without:
        found = accumulator.log_det_without(s, c, d, is_pooled, 0.0, 2)
        designs = [(np.delete(s, m, axis=0), np.delete(c, m, axis=0)) for m in range(9)]
    else:
        found = accumulator.log_det_with(more_s, more_c, d, is_pooled, 0.0, 2)
        designs = [(np.concatenate([s, more_s[m : m + 1]]), np.concatenate([c, more_c[m : m + 1]])) for m in range(5)]
    for value, (own_s, own_c) in zip(found, designs, strict=True):
        known = np.diag([0.0, 0.0, *[2 / len(own_s)] * (P - 2)])
        whole = fisher(own_s, pooled(d, own_c) if is_pooled else d) + known
        marginal = np.linalg.inv(np.linalg.inv(whole)[:2, :2])
        assert value == pytest.approx(log_det(marginal), rel=1e-10, abs=1e-10)
    with pytest.raises(ValueError, match="nuisance: expected fewer than the parameters"):
        accumulator.log_det_with(s, c, d, False, 0.0, P)


def test_asking_changes_nothing() -> None:
    s, c, d = random_design(5, 7)
    accumulator = filled(s, c)
    before = accumulator.fisher(d)
    accumulator.log_det_with(s, c, d, True)
    accumulator.log_det_without(s, c, d, False)
    np.testing.assert_array_equal(accumulator.fisher(d), before)
    assert len(accumulator) == 5


@given(st.integers(1, 4), st.integers(1, 6), st.integers(1, 12), st.integers(0, 2**32 - 1))
@settings(deadline=None, max_examples=60)
def test_any_size(n_y: int, p: int, count: int, seed: int) -> None:
    s, c, d = random_design(count, seed, n_y, p)
    accumulator = filled(s, c)
    expected = fisher(s, d)
    np.testing.assert_allclose(accumulator.fisher(d), expected, rtol=1e-10, atol=1e-10 * np.abs(expected).max())
    if count * n_y >= p + 2 and np.linalg.cond(expected) < 1e6:
        assert _core.log_det(accumulator.fisher(d)) == pytest.approx(log_det(expected), rel=1e-9, abs=1e-8)


# --- singular -----------------------------------------------------------------------------------------------------------


def test_fewer_equations_than_parameters_are_singular() -> None:
    s, c, d = random_design(1, 8)  # three rows for four parameters
    accumulator = filled(s, c)
    assert _core.log_det(accumulator.fisher(d)) == -np.inf
    assert accumulator.log_det_with(s, c, d, False)[0] == -np.inf  # the same rows again
    other_s, other_c, _ = random_design(1, 9)
    assert np.isfinite(accumulator.log_det_with(other_s, other_c, d, False)[0])


def test_taking_the_last_point_leaves_nothing() -> None:
    s, c, d = random_design(1, 10)
    for is_pooled in (False, True):
        assert filled(s, c).log_det_without(s, c, d, is_pooled)[0] == -np.inf
        assert filled(s, c).log_det_without(s, c, d, is_pooled, 1.0)[0] == -np.inf


def test_a_ridge_tells_singular_designs_apart() -> None:
    s, c, d = random_design(1, 11, n_y=1)
    more_s, more_c, _ = random_design(6, 12, n_y=1)  # two rows for four parameters: still singular
    ridge = 1e-9
    accumulator = filled(s, c)
    assert np.all(accumulator.log_det_with(more_s, more_c, d, False) == -np.inf)
    result = accumulator.log_det_with(more_s, more_c, d, False, ridge)
    expected = [log_det(fisher(np.stack([s[0], m]), d) + ridge * np.eye(P)) for m in more_s]
    assert len(set(result)) == 6
    np.testing.assert_allclose(result, expected, rtol=1e-6)  # eigenvalues of 1e-9 beside 1 keep about 7 digits


def test_a_parameter_without_influence_is_singular() -> None:
    s, c, d = random_design(9, 13)
    s[:, :, 2] = 0.0
    f = filled(s, c).fisher(d)
    assert np.all(f[2] == 0) and _core.log_det(f) == -np.inf


def test_log_det_does_not_depend_on_scales() -> None:
    """17 decades between parameters cost no digits, because the diagonal is scaled first."""
    s, c, d = random_design(9, 14)
    f = filled(s, c).fisher(d)
    scale = np.array([1e9, 1e-9, 1.0, 1e-7])
    shifted = 2 * np.log(scale).sum()
    assert _core.log_det(f * np.outer(scale, scale)) == pytest.approx(log_det(f) + shifted, rel=1e-12)


@pytest.mark.parametrize(
    "matrix", [[[1.0, 1.0], [1.0, 1.0]], [[1.0, 2.0], [2.0, 1.0]], [[0.0, 0.0], [0.0, 1.0]], [[-1.0]], [[np.nan]], [[np.inf]]]
)
def test_log_det_of_what_is_not_positive_definite(matrix: list[list[float]]) -> None:
    assert _core.log_det(np.array(matrix)) == -np.inf


def test_a_singular_output_covariance_is_an_error() -> None:
    s, c, _ = random_design(3, 15)
    singular = np.diag([1.0, 0.0, 1.0])
    with pytest.raises(ValueError, match="D is not positive definite"):
        filled(s, c).fisher(singular)
    with pytest.raises(ValueError, match="D is not positive definite"):
        filled(s, c).log_det_with(s, c, singular, False)
    assert np.isfinite(filled(s, c).log_det_with(s, c, singular, True)).all()  # pooled: the points make it regular


def test_python_runs_on_while_the_accumulator_works() -> None:
    """Threads change only where one lets the lock go: within the test the interpreter does not ask for it."""
    s, c, given = random_design(100_000, seed=5)
    f, began, ended = filled(s[:50], c[:50]), threading.Event(), threading.Event()

    def work() -> None:
        began.set()
        f.log_det_with(s, c, given, True)
        ended.set()

    interval = sys.getswitchinterval()
    sys.setswitchinterval(600)
    try:
        thread = threading.Thread(target=work)
        thread.start()
        began.wait()
        assert not ended.is_set()
        f.add(s[50:], c[50:])  # waits for the other, and is no part of what that saw
        assert len(f) == 100_000
        thread.join()
    finally:
        sys.setswitchinterval(interval)


def test_misuse_is_named() -> None:
    s, c, d = random_design(2, 16)
    accumulator = _core.FisherAccumulator(N_Y, P)
    with pytest.raises(ValueError, match="remove: expected an accumulator with points, given an empty one"):
        accumulator.remove(s, c)
    with pytest.raises(ValueError, match=r"dy_dtheta: expected shape \(any, 3, 4.*given \(2, 4, 3"):
        accumulator.add(s.transpose(0, 2, 1), c)
    with pytest.raises(ValueError, match=r"predictive_covariance: expected shape \(2, 3, 3.*given \(1, 3, 3"):
        accumulator.add(s, c[:1])
    with pytest.raises(ValueError, match=r"given: expected shape \(3, 3.*given \(2, 2"):
        accumulator.output_covariance(d[:2, :2], False)
    assert len(accumulator) == 0


def test_an_empty_accumulator_knows_nothing() -> None:
    accumulator = _core.FisherAccumulator(N_Y, P)
    np.testing.assert_array_equal(accumulator.fisher(np.eye(N_Y)), np.zeros((P, P)))
    np.testing.assert_array_equal(accumulator.output_covariance(np.eye(N_Y), True), np.eye(N_Y))
