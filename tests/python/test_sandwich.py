"""Robust standard errors and the memory of noise, on arrays: against closed forms, and against the scatter of many fits."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import toeplitz

from fisherpoint.estimation.noise_memory import NoiseMemory, memory_of
from fisherpoint.estimation.sandwich import Sandwich, root, sandwich
from oracle import Floats
from test_whiteness import markov

WHITE = NoiseMemory()


def robust(e: Floats, jacobian: Floats, series: np.ndarray, memory: NoiseMemory = WHITE, prior: float = 0.0) -> Sandwich:
    of_prior = prior * np.eye(jacobian.shape[1])
    covariance = np.linalg.inv(jacobian.T @ jacobian + of_prior)
    return sandwich(e[:, None], jacobian[:, None], covariance, series, np.ones((len(e), 1), dtype=bool), [memory], of_prior)


@pytest.mark.parametrize(("phi", "share"), [(0.9, 1.0), (0.5, 1.0), (0.98, 0.4), (0.3, 0.1)])
def test_filters_are_those_of_the_noise(phi: float, share: float) -> None:
    memory, n = NoiseMemory(phi, share), 400
    rng = np.random.default_rng(0)
    u, x = rng.standard_normal((2, n, 1))
    recoloured = np.linalg.solve(memory.whitened(np.eye(n)), u)
    assert memory.whitened(recoloured) == pytest.approx(u)
    assert float(np.sum(recoloured * x)) == pytest.approx(float(np.sum(u * memory.adjoint(x))))
    noise = np.linalg.inv(memory.whitened(np.eye(n)))
    innovation = (1 + memory.phi**2 - 2 * memory.share * memory.phi**2) / (1 + memory.theta**2)
    covariance = innovation * noise @ noise.T
    expected = toeplitz(np.append(1.0, share * phi ** np.arange(1, n)))
    assert covariance[300:, 300:] == pytest.approx(expected[300:, 300:], abs=1e-4)


@pytest.mark.parametrize(("phi", "share"), [(0.8, 1.0), (0.95, 1.0), (0.95, 0.5)])
def test_the_memory_is_found_whatever_the_fit_has_taken(phi: float, share: float) -> None:
    rng, n = np.random.default_rng(1), 1500
    t = np.linspace(0, 1, n)
    jacobian = np.stack([t**k for k in range(6)], axis=1)
    found = []
    for _ in range(12):
        v = np.sqrt(share) * markov(rng, n, phi) + np.sqrt(1 - share) * rng.standard_normal(n)
        e = v - jacobian @ np.linalg.lstsq(jacobian, v, rcond=None)[0]
        found.append(memory_of(e, 1e6 * jacobian, [slice(0, n)]))
    assert np.median([one.samples for one in found]) == pytest.approx(-1 / np.log(phi), rel=0.2)
    assert np.median([one.share for one in found]) == pytest.approx(share, abs=0.06)


@pytest.mark.parametrize("e", [[], [1.0], [1.0, -1.0], [1.0, -1.0, 1.0, -1.0] * 10])
def test_short_and_alternating_residuals_have_no_memory(e: list[float]) -> None:
    assert memory_of(np.array(e), np.ones((len(e), 1)), [slice(0, len(e))]).phi == 0.0


@pytest.mark.parametrize("phi", [0.5, 0.9, 0.97])
def test_the_variance_of_a_mean_is_inflated_as_known(phi: float) -> None:
    n, rng = 20_000, np.random.default_rng(2)
    ones, series = np.ones((n, 1)), np.zeros(n, dtype=np.intp)
    ratios = []
    for _ in range(4):
        v = markov(rng, n, phi)
        e = v - v.mean()
        found = robust(e, ones, series, memory_of(e, ones, [slice(0, n)]))
        assert found.method == "window"
        ratios.append(float(found.covariance[0, 0]) * n)
    assert np.mean(ratios) == pytest.approx((1 + phi) / (1 - phi), rel=0.12)


def test_the_window_alone_finds_a_short_memory() -> None:
    n, rng = 20_000, np.random.default_rng(3)
    e = markov(rng, n, 0.5)
    found = robust(e - e.mean(), np.ones((n, 1)), np.zeros(n, dtype=np.intp))
    assert found.bandwidth > 10
    assert float(found.covariance[0, 0]) * n == pytest.approx(3.0, rel=0.12)


@pytest.mark.parametrize("phi", [0.0, 0.8])
def test_robust_errors_are_the_scatter_of_a_linear_model(phi: float) -> None:
    n, rng = 500, np.random.default_rng(4)
    t = np.linspace(0, 1, n)
    jacobian, series = np.stack([1 - np.exp(-5 * t), np.sin(9 * t)], axis=1), np.zeros(n, dtype=np.intp)
    estimates, errors = [], []
    for _ in range(100):
        v = markov(rng, n, phi)
        estimate = np.linalg.lstsq(jacobian, v, rcond=None)[0]
        e = v - jacobian @ estimate
        memory = memory_of(e, jacobian, [slice(0, n)]) if phi else WHITE
        estimates.append(estimate)
        errors.append(np.sqrt(np.diag(robust(e, jacobian, series, memory).covariance)))
    assert np.mean(errors, axis=0) == pytest.approx(np.std(estimates, axis=0), rel=0.17)


def test_each_of_many_series_counts_as_one() -> None:
    runs, length, rng = 60, 5, np.random.default_rng(5)
    series, x = np.repeat(np.arange(runs), length), np.linspace(-1, 1, runs)
    jacobian = np.stack([np.ones(runs * length), np.repeat(x, length)], axis=1)
    found, estimates = [], []
    for _ in range(200):
        v = np.repeat(rng.standard_normal(runs), length) + rng.standard_normal(runs * length)
        estimate = np.linalg.lstsq(jacobian, v, rcond=None)[0]
        one = robust(v - jacobian @ estimate, jacobian, series)
        assert one.method == "series"
        found.append(one.covariance)
        estimates.append(estimate)
    between = (1 + 1 / length) * np.array([1 / runs, 1 / np.square(x).sum()])
    assert np.diag(np.mean(found, axis=0)) == pytest.approx(between, rel=0.06)
    assert np.var(estimates, axis=0) == pytest.approx(between, rel=0.3)


def test_points_of_unlike_leverage_have_no_bias_at_white_noise() -> None:
    rng = np.random.default_rng(6)
    jacobian = np.stack([np.ones(40), np.arange(40.0) ** 1.5], axis=1)
    covariance, found = np.linalg.inv(jacobian.T @ jacobian), []
    for _ in range(2000):
        v = rng.standard_normal(40)
        found.append(robust(v - jacobian @ (covariance @ (jacobian.T @ v)), jacobian, np.arange(40)).covariance)
    assert np.mean(found, axis=0) == pytest.approx(covariance, rel=0.03)


@pytest.mark.parametrize("series", [np.zeros(60, dtype=np.intp), np.arange(60) // 2])
def test_neither_units_nor_the_order_of_series_count(series: np.ndarray) -> None:
    rng = np.random.default_rng(7)
    e, jacobian, units = rng.standard_normal(60), rng.standard_normal((60, 3)), np.array([1.0, 1e-8, 1e6])
    memory = NoiseMemory(0.6, 0.8)
    found = robust(e, jacobian, series, memory).covariance
    assert robust(e, jacobian * units, series, memory).covariance * np.outer(units, units) == pytest.approx(found)
    if series.any():
        order = np.argsort(-series, kind="stable")
        assert robust(e[order], jacobian[order], series[order], memory).covariance == pytest.approx(found)


def test_a_prior_alone_leaves_the_prior() -> None:
    found = robust(np.zeros(30), np.zeros((30, 2)), np.zeros(30, dtype=np.intp), prior=4.0)
    assert found.covariance == pytest.approx(np.eye(2) / 4)
    assert found.weight == 0.0


def test_a_root_is_that_of_any_units() -> None:
    covariance = np.diag([1e-20, 4.0, 0.0])
    assert root(covariance) @ root(covariance).T == pytest.approx(covariance, abs=1e-30)
