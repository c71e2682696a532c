"""Tests of whether residuals are white, on arrays: their moments, size and power, and what they make of simple numbers."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.stats import binom

from fisherpoint.estimation.whiteness import autocorrelation, fewest_sign_changes, portmanteau, spectrum
from oracle import Floats


@cache
def columns(n: int, p: int) -> Floats:
    """Orthonormal smooth columns, as slow parameters have them."""
    t = np.linspace(0.0, 1.0, n)
    basis: Floats = np.linalg.qr(np.stack([np.exp(-k * t) if k % 2 else t**k for k in range(p)], axis=1))[0]
    return basis


def residuals(rng: np.random.Generator, q: Floats) -> Floats:
    v = rng.standard_normal(len(q))
    return np.asarray(v - q @ (q.T @ v))


def markov(rng: np.random.Generator, n: int, phi: float) -> Floats:
    v = rng.standard_normal(n)
    for k in range(1, n):
        v[k] = phi * v[k - 1] + np.sqrt(1 - phi**2) * v[k]
    return v


def one(n: int) -> np.ndarray:
    return np.zeros(n, dtype=np.intp)


def test_mean_and_covariance_after_a_fit_are_exact() -> None:
    rng, q = np.random.default_rng(0), columns(14, 4)
    series = np.repeat([0, 1], [9, 5])
    found = [autocorrelation(residuals(rng, q), q, series) for _ in range(4000)]
    values = np.array([one.values for one in found])
    assert values.shape[1] == 3  # at more lags less than half of the samples have a partner
    assert np.abs(values.mean(axis=0) - found[0].expected).max() < 4 * values.std(axis=0).max() / np.sqrt(len(found))
    assert np.cov(values.T) == pytest.approx(found[0].covariance, abs=0.08 * found[0].covariance.max())
    assert found[0].expected[0] < -0.1  # what would be taken for alternating noise without the fit's share


@pytest.mark.long
@pytest.mark.parametrize(("n", "p"), [(16, 3), (80, 4), (250, 8)])
def test_white_noise_is_called_others_as_seldom_as_the_level_says(n: int, p: int) -> None:
    rng, q, fits = np.random.default_rng(n), columns(n, p), 1500
    p_values = []
    for _ in range(fits):
        e = residuals(rng, q)
        frequencies = spectrum(e, q, one(n)).p_value
        p_values.append((portmanteau(autocorrelation(e, q, one(n)))[1], 1.0 if frequencies is None else frequencies))
    rejected = np.mean(np.array(p_values)[None] < np.array([0.05, 0.01, 0.001])[:, None, None], axis=1)
    assert (rejected[0] <= 0.07).all()
    assert (rejected[1] <= 0.025).all()
    assert (rejected[2] <= 0.006).all()
    assert rejected[0, 0] >= 0.02


@pytest.mark.parametrize(("phi", "n"), [(0.5, 150), (0.9, 150), (0.99, 300), (-0.5, 150)])
def test_noise_with_a_memory_is_found(phi: float, n: int) -> None:
    rng, q = np.random.default_rng(1), columns(n, 4)
    found = 0
    for _ in range(100):
        v = markov(rng, n, phi)
        found += (portmanteau(autocorrelation(v - q @ (q.T @ v), q, one(n)))[1] or 0.0) < 0.001
    assert found >= 95


def test_a_period_is_found_in_the_spectrum() -> None:
    rng, n = np.random.default_rng(2), 400
    e = rng.standard_normal(n) + 0.8 * np.sin(2 * np.pi * 0.11 * np.arange(n))
    found = spectrum(e, np.zeros((n, 0)), one(n))
    assert found.p_value is not None and found.p_value < 1e-3
    above = np.diff(found.cumulative - found.expected)
    assert found.frequencies[1:][np.argmax(above)] == pytest.approx(0.11, abs=1 / n)


def test_neither_the_order_of_series_nor_the_unit_counts() -> None:
    rng = np.random.default_rng(3)
    e, q = rng.standard_normal(60), columns(60, 3)
    series = np.repeat([0, 1, 2], [10, 20, 30])
    order = np.concatenate([np.arange(30, 60), np.arange(10), np.arange(10, 30)])
    first, other = autocorrelation(e, q, series), autocorrelation(1e9 * e[order], q[order], np.repeat([4, 7, 9], [30, 10, 20]))
    assert other.values == pytest.approx(first.values)
    assert other.covariance == pytest.approx(first.covariance)
    p_value = spectrum(e, q, series).p_value
    assert spectrum(1e-9 * e[order], q[order], np.repeat([0, 1, 2], [30, 10, 20])).p_value == pytest.approx(p_value)


def test_chunks_do_not_show(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(4)
    e, q, series = rng.standard_normal(50), columns(50, 3), np.repeat([0, 1], [22, 28])
    whole = autocorrelation(e, q, series)
    monkeypatch.setattr("fisherpoint.estimation.whiteness.CHUNK", 7)
    chunked = autocorrelation(e, q, series)
    assert chunked.values == pytest.approx(whole.values)
    assert chunked.covariance == pytest.approx(whole.covariance)


@pytest.mark.parametrize("e", [[], [0.3], [0.0] * 20, [0.0, 1.0]])
def test_there_is_nothing_to_judge(e: list[float]) -> None:
    n = len(e)
    found = autocorrelation(np.array(e), np.zeros((n, 2)), one(n))
    assert portmanteau(found) == (0, None)
    assert spectrum(np.array(e), np.zeros((n, 2)), one(n)).p_value is None


def test_samples_of_different_series_are_no_neighbours() -> None:
    e = np.tile([1.0, 1.0, -1.0, -1.0], 20)
    pairs = autocorrelation(e, np.zeros((80, 0)), np.repeat(np.arange(40), 2))
    assert pairs.values == pytest.approx([0.5])  # 40 products of 1 among 80 squares
    assert portmanteau(autocorrelation(e, np.zeros((80, 0)), np.arange(80))) == (0, None)


@pytest.mark.parametrize(("e", "lag_one"), [([1.0, -1.0] * 30, -59 / 60), ([1.0] * 60, 59 / 60)])
def test_alternating_and_equal_values_are_not_white(e: list[float], lag_one: float) -> None:
    found = autocorrelation(np.array(e), np.zeros((60, 0)), one(60))
    assert found.values[0] == pytest.approx(lag_one)
    assert (portmanteau(found)[1] or 0.0) < 1e-6


def test_as_many_unknowns_as_samples_leave_nothing_to_judge() -> None:
    found = autocorrelation(np.full(6, 1e-17), np.eye(6), one(6))
    assert portmanteau(found) == (0, None)


def test_signs_are_counted_along_the_setting() -> None:
    s = np.arange(30.0)
    settings = np.stack([s, np.tile([0.0, 1.0, 2.0, 3.0, 4.0], 6)], axis=1)
    e = np.where(s < 14.5, 1.0, -0.3)
    shuffled = np.random.default_rng(5).permutation(30)
    for order in (np.arange(30), shuffled):
        found = fewest_sign_changes(e[order], settings[order], ("s", "t"))
        assert found is not None
        assert (found.setting, found.count, found.most) == ("s", 1, 29)
        assert found.p_value == pytest.approx(2 * binom.cdf(1, 29, 0.5))


def test_replicates_count_as_one() -> None:
    settings = np.repeat(np.arange(12.0), 3)[:, None]
    e = np.tile([2.0, -0.5, -0.5], 12) * np.repeat(np.where(np.arange(12) % 2, 1.0, -1.0), 3)
    found = fewest_sign_changes(e, settings, ("s",))
    assert found is not None
    assert (found.count, found.most) == (11, 11)
    assert found.p_value == 1.0


@pytest.mark.parametrize("n", [0, 1, 4])
def test_few_settings_are_no_setting(n: int) -> None:
    assert fewest_sign_changes(np.ones(n), np.arange(n, dtype=float)[:, None], ("s",)) is None
    assert fewest_sign_changes(np.ones(30), np.tile(np.arange(4.0), 8)[:30, None], ("s",)) is None


def test_residuals_of_zero_have_no_sign() -> None:
    assert fewest_sign_changes(np.zeros(20), np.arange(20.0)[:, None], ("s",)) is None
