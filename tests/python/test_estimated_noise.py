"""Noise that the residuals tell: right down to the rounding of the data, and said where it is not."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.basics.values import Array
from fisherpoint.estimation import search, unknown_noise
from fisherpoint.estimation.report import warnings

LINE = fp.SymbolicModel([], ["a + b*x"], {}, {"x": "1"}, {"a": "1", "b": "1"}, {"y": "1"}, nominal={"a": 1.0, "b": 1.0})
X = np.linspace(0.0, 10.0, 40)
NOISE = 0.01 * np.random.default_rng(0).standard_normal(len(X))
POINTS = fp.Experiments(np.empty((len(X), 0)), X)


def least_squares_of_a_line(y: Array) -> tuple[list[float], list[float]]:
    """Estimates and standard errors in rational numbers, exact for the data as they are."""
    u, v = ([Fraction(float(value)) for value in values] for values in (X, y))
    n = len(u)
    mean_u, mean_v = sum(u) / n, sum(v) / n
    spread = sum((one - mean_u) ** 2 for one in u)
    b = sum((one - mean_u) * (other - mean_v) for one, other in zip(u, v, strict=True)) / spread
    a = mean_v - b * mean_u
    variance = sum((other - a - b * one) ** 2 for one, other in zip(u, v, strict=True)) / (n - 2)
    errors = [variance * (Fraction(1, n) + mean_u**2 / spread), variance / spread]
    return [float(a), float(b)], [float(error) ** 0.5 for error in errors]


@pytest.mark.parametrize("offset", [0.0, 1e5, 1e7, 1e9])
def test_an_offset_does_not_change_the_noise(offset: float) -> None:
    y = offset + 50 * X + NOISE
    fit = fp.estimate(LINE, fp.Measurements(POINTS, y))
    estimate, errors = least_squares_of_a_line(y)
    assert fit.converged
    assert list(fit.estimate.values()) == pytest.approx(estimate, rel=1e-9)
    assert list(fit.standard_errors.values()) == pytest.approx(errors, rel=1e-6)
    assert not list(warnings(fit))


def test_rounding_is_named_where_it_is_the_noise() -> None:
    y = 1e14 + 50 * X + NOISE  # to the nearest 1/64
    fit = fp.estimate(LINE, fp.Measurements(POINTS, y))
    told = [warning for warning in warnings(fit) if "the rounding of its numbers" in warning]
    assert len(told) == 1 and told[0].startswith("y: the estimated noise") and told[0] in str(fit)
    assert np.isfinite(list(fit.standard_errors.values())).all()


def test_the_tolerance_of_the_trajectories_is_named_where_it_may_be_the_noise() -> None:
    decay = fp.SymbolicModel(["-k*c"], ["c"], {"c": "1"}, {}, {"k": "1/s"}, {"c": "1"}, nominal={"k": 1.0})
    dt = np.linspace(0.1, 2.0, 12)
    points = fp.Experiments(np.ones((12, 1)), np.empty((12, 0)), dt)
    data = fp.Measurements(points, np.exp(-dt) + 1e-7 * np.random.default_rng(1).standard_normal(12))
    rough, fine = (fp.estimate(decay, data, rtol=rtol) for rtol in (1e-8, 1e-12))
    assert any("the tolerance of the trajectories, rtol = 1e-08" in warning for warning in warnings(rough))
    assert not list(warnings(fine))
    assert fine.noise_covariance[0, 0] ** 0.5 == pytest.approx(np.std(data.y[:, 0] - np.exp(-dt)), rel=0.1)


@pytest.mark.parametrize("every", [True, False])
def test_outputs_of_different_size_get_their_weights(every: bool) -> None:
    """Slopes in common, sizes apart by twelve decades: as by generalised least squares on data without the offset."""
    pair = fp.SymbolicModel(
        [],
        ["a + b*x", "1e-9*(c + b*x)"],
        {},
        {"x": "1"},
        {"a": "1", "b": "1", "c": "1"},
        {"y": "1", "w": "1"},
        nominal={"a": 1.0, "b": 1.0, "c": 1.0},
    )
    random = np.random.default_rng(3)
    small = np.stack([50 * X, 50 * X + 2], axis=1) + random.standard_normal((len(X), 2)) * [0.01, 0.05]
    y = np.stack([1e5 + small[:, 0], 1e-9 * small[:, 1]], axis=1)
    if not every:
        y[3, 1] = small[3, 1] = np.nan
    fit = fp.estimate(pair, fp.Measurements(POINTS, y))

    matrix = np.zeros((len(X), 2, 3))
    matrix[:, 0, 0] = matrix[:, 1, 2] = 1.0
    matrix[:, :, 1] = X[:, None]
    measured, covariance = np.isfinite(small), np.eye(2)
    for _ in range(100):
        white = np.linalg.inv(np.linalg.cholesky(covariance))
        rows, values = ((white @ part)[measured] for part in (matrix, np.nan_to_num(small)[:, :, None]))
        theta = np.linalg.lstsq(rows, values[:, 0], rcond=None)[0]
        e = np.where(measured, small - matrix @ theta, 0.0)
        covariance = e.T @ e / (measured.T.astype(float) @ measured)
        if not every:
            covariance *= np.eye(2)
    assert fit.converged
    np.testing.assert_allclose(fit.values - [1e5, 0, 0], theta, rtol=1e-6)
    np.testing.assert_allclose(fit.residual_covariance[0, 0], covariance[0, 0], rtol=1e-6)
    np.testing.assert_allclose(fit.residual_covariance[1, 1] * 1e18, covariance[1, 1], rtol=1e-6)


def test_a_profile_of_small_noise_on_large_numbers_is_that_of_least_squares() -> None:
    fit = fp.estimate(LINE, fp.Measurements(POINTS, 1e5 + 50 * X + NOISE))
    profile = fit.profile("b")
    assert profile.interval == pytest.approx(fit.intervals()["b"], abs=1e-4 * fit.standard_errors["b"])
    assert profile.converged.all()


def test_data_that_are_fitted_exactly_have_an_end() -> None:
    for y in (3 + 2 * X, np.zeros(len(X)), 1e5 + 0 * X):
        fit = fp.estimate(LINE, fp.Measurements(POINTS, y))
        assert fit.converged
        assert fit.values == pytest.approx([y[0], (y[1] - y[0]) / X[1]], abs=1e-9 * max(1.0, y[0]))
        assert np.isfinite(list(fit.standard_errors.values())).all()
        assert any("no larger than the rounding of its numbers" in warning for warning in warnings(fit))


def test_weights_that_do_not_come_to_rest_are_no_minimum(monkeypatch: pytest.MonkeyPatch) -> None:
    pair = fp.SymbolicModel([], ["a + b*x", "b - a*x"], {}, {"x": "1"}, {"a": "1", "b": "1"}, {"y": "1", "w": "1"})
    y = np.stack([NOISE, 7 * NOISE[::-1] ** 2], axis=1) + np.stack([1 + 2 * X, 2 - X], axis=1)
    arguments: dict[str, Any] = {"model": pair, "data": fp.Measurements(POINTS, y), "start": {"a": 0.0, "b": 0.0}}
    assert fp.estimate(**arguments).converged
    monkeypatch.setattr(unknown_noise, "MAX_ROUNDS", 1)
    fit = fp.estimate(**arguments)
    assert not fit.converged and fit.stop_reason == "weights_changed"


def test_nor_are_those_of_what_is_assumed(monkeypatch: pytest.MonkeyPatch) -> None:
    decay = fp.SymbolicModel(["-k*c"], ["c"], {"c": "1"}, {}, {"k": "1/s"}, {"c": "1"}, nominal={"k": 3.0})
    dt = np.linspace(0.1, 2.0, 12)
    data = fp.Measurements(fp.Experiments(np.ones((12, 1)), np.empty((12, 0)), dt), np.exp(-dt) + NOISE[:12])
    arguments: dict[str, Any] = {"noise": {"c": 0.01}, "deviations": fp.Deviations(initial_state_std={"c": 0.2})}
    assert fp.estimate(decay, data, **arguments).converged
    monkeypatch.setattr(search, "WEIGHTINGS", 1)
    fit = fp.estimate(decay, data, **arguments)
    assert not fit.converged and fit.stop_reason == "weights_changed"
