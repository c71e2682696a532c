"""The information of readings about noise-free outputs, against probabilities that are summed, and whole covariances."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy import integrate, stats

from fisherpoint.basics.values import Array
from fisherpoint.noise.growing import dense_rows, rows_beside_common
from fisherpoint.noise.models import GaussMarkov, Noise, NoiseModel
from fisherpoint.noise.reading import averaged_information, reading_information
from fisherpoint.noise.sensors import Sensors


def summed(y: float, a: float, b: float, q: float, lower: float, upper: float) -> float:
    """sum of P'^2 / P over all readings, by a numerical derivative of 30 digits; of rounding first and limits then."""
    import mpmath as mp

    with mp.workdps(40):

        def sigma(at: Any) -> Any:
            return mp.sqrt(mp.mpf(a) ** 2 + (mp.mpf(b) * at) ** 2)

        reach = 12 * float(sigma(y))
        k = range(math.floor((y - reach) / q), math.ceil((y + reach) / q) + 1)
        shown: dict[float, list[Any]] = {}
        for n in k:
            low, high = (n - mp.mpf(1) / 2) * mp.mpf(q), (n + mp.mpf(1) / 2) * mp.mpf(q)
            value = min(max(n * q, lower), upper)
            old = shown.get(value)
            shown[value] = [low, high] if old is None else [min(old[0], low), max(old[1], high)]
        for value, edges in shown.items():
            edges[0] = -mp.inf if value <= lower else edges[0]
            edges[1] = mp.inf if value >= upper else edges[1]

        def probability(edges: list[Any], at: Any) -> Any:
            low, high = ((edge - at) / sigma(at) for edge in edges)
            return mp.ncdf(-low) - mp.ncdf(-high) if low > 0 else mp.ncdf(high) - mp.ncdf(low)

        total, step = mp.mpf(0), mp.mpf(10) ** -12 * sigma(y)
        for edges in shown.values():
            p = probability(edges, mp.mpf(y))
            change = (probability(edges, mp.mpf(y) + step) - probability(edges, mp.mpf(y) - step)) / (2 * step)
            total += change**2 / p if p > mp.mpf(10) ** -300 else 0
        return float(total)


@pytest.mark.parametrize("q", [0.5, 1.0, 2.0, 5.0, 30.0])
@pytest.mark.parametrize("b", [0.0, 0.2])
@pytest.mark.parametrize("y", [0.0, 0.25, 0.3, 1.0, -2.5, 15.0])
def test_rounded_readings_inform_as_their_probabilities_do(q: float, b: float, y: float) -> None:
    pytest.importorskip("mpmath")
    given = reading_information(np.array([y]), 1.0, b, q)
    assert given == pytest.approx([summed(y, 1.0, b, q, -math.inf, math.inf)], rel=1e-9, abs=1e-200)


@pytest.mark.parametrize("q", [1e-9, 1e-4, 0.9e-3, 1.1e-3, 0.01, 0.1, 0.29, 0.31, 0.5])
@pytest.mark.parametrize("b", [0.0, 0.3])
def test_fine_steps_are_noise_of_their_own_variance(q: float, b: float) -> None:
    """Beyond the fourth order, which the sum over cells of half a standard deviation has."""
    y = np.array([-1.0, 0.0, 0.123, 2.0])
    v = 1 + b**2 * y**2 + q**2 / 12
    expected = 1 / v + 2 * b**4 * y**2 / v**2
    np.testing.assert_allclose(reading_information(y, 1.0, b, q), expected, rtol=0.02 * q**4 + 1e-11)
    if q < 1e-8:
        np.testing.assert_allclose(reading_information(y, 1.0, b, q), reading_information(y, 1.0, b), rtol=1e-15)


@pytest.mark.parametrize("limits", [(-math.inf, 1.0), (0.0, math.inf), (0.0, 1.5), (-3.0, 12.0)])
@pytest.mark.parametrize("b", [0.0, 0.2])
@pytest.mark.parametrize("y", [0.0, 1.0, 0.4, 1.5, -6.0, 8.0])
def test_limited_readings_inform_as_their_probabilities_do(limits: tuple[float, float], b: float, y: float) -> None:
    lower, upper = limits

    def sigma(at: float) -> float:
        return math.hypot(1.0, b * at)

    s, slope = sigma(y), b**2 * y / sigma(y)

    def share(v: float) -> float:
        z = (v - y) / s
        score = (z + slope * (z * z - 1)) / s
        return float(score**2 * stats.norm.pdf(z) / s)

    ends = (max(lower, y - 12 * s), min(upper, y + 12 * s))
    expected = integrate.quad(share, *ends, epsabs=0, epsrel=1e-11)[0] if ends[0] < ends[1] else 0.0
    for edge, sign in ((lower, 1), (upper, -1)):
        if math.isfinite(edge):
            z = (edge - y) / s
            expected += (stats.norm.pdf(z) * (1 + z * slope) / s) ** 2 / stats.norm.cdf(sign * z)
    assert reading_information(np.array([y]), 1.0, b, 0.0, lower, upper) == pytest.approx([expected], rel=1e-8)


@pytest.mark.parametrize("limits", [(-math.inf, 1.0), (0.0, 2.0), (0.0, 1.3)])
@pytest.mark.parametrize("q", [0.25, 1.0, 3.0])
@pytest.mark.parametrize("y", [0.0, 1.0, 0.5, -2.0])
def test_limited_and_rounded_readings_inform_as_their_probabilities_do(limits: tuple[float, float], q: float, y: float) -> None:
    pytest.importorskip("mpmath")
    given = reading_information(np.array([y]), 1.0, 0.1, q, *limits)
    assert given == pytest.approx([summed(y, 1.0, 0.1, q, *limits)], rel=1e-9)


def test_values_of_use() -> None:
    """White noise; on the edge of a coarse cell, 4 phi(0)^2 / sigma^2; in its middle nothing; far past a limit nothing."""
    assert reading_information(np.zeros(1), 0.5)[0] == 4.0
    np.testing.assert_allclose(reading_information(np.array([50.0, 0.0, 100.0]), 1.0, 0.0, 100.0), [2 / np.pi, 0, 0], atol=1e-300)
    np.testing.assert_allclose(reading_information(np.array([1e3, 5.0]), 1.0, 0.0, 0.0, -np.inf, 5.0)[0], 0, atol=1e-300)
    half = reading_information(np.array([5.0]), 1.0, 0.0, 0.0, -np.inf, 5.0)[0]
    assert half == pytest.approx(0.5 + 1 / np.pi)  # half of the readings, and 2 phi(0)^2


def sequences(seed: int, count: int = 3, n: int = 12, n_y: int = 3) -> tuple[Array, Array, Any]:
    rng = np.random.default_rng(seed)
    times = np.cumsum(rng.exponential(1.0, (count, n)) * rng.choice([0.01, 1.0, 5.0], (count, n)), axis=1)
    return times, rng.normal(2.0, 1.0, (count, n, n_y)), rng.random((count, n, n_y)) < 0.7


MEMORY: dict[str, Any] = {
    "one part": {"a": Noise(0.1, colored=GaussMarkov(0.3, 2.0)), "b": 0.2, "c": 0.5},
    "two parts": {"a": Noise(0.1, colored=[GaussMarkov(0.3, 2.0), GaussMarkov(0.5, 0.1)]), "b": 0.2, "c": 0.5},
    "no white part": {
        "a": Noise(colored=GaussMarkov(0.3, 2.0)),
        "b": Noise(colored=[GaussMarkov(1, 5), GaussMarkov(0.2, 0.5)]),
    },
    "correlated": NoiseModel({"a": 0.1, "b": 0.2, "c": 0.5}, correlation={("a", "b"): 0.5, ("b", "c"): -0.3}),
    "correlated with a memory": NoiseModel(
        {"a": Noise(0.1, colored=GaussMarkov(0.3, 2.0)), "b": Noise(0.2, colored=GaussMarkov(0.1, 0.3)), "c": 0.5},
        correlation={("a", "c"): 0.9},
    ),
    "growing": {"a": Noise(0.1, relative=0.1, colored=GaussMarkov(0.3, 2.0)), "b": Noise(0.2, relative=0.3), "c": 0.5},
    "rounded": {"a": Noise(0.1, resolution=0.3, colored=GaussMarkov(0.3, 2.0)), "b": 0.2, "c": 0.5},
}


@pytest.mark.parametrize("noise", MEMORY.values(), ids=MEMORY.keys())
def test_the_filter_whitens_as_cholesky_does(noise: Any) -> None:
    times, y, measured = sequences(1)
    sensors = Sensors.of(noise, ("a", "b", "c"))
    rng = np.random.default_rng(2)
    columns = rng.normal(size=(*y.shape, 20))
    white, log_det = sensors.whitened(columns, times, y, measured)
    for threads in (2, 3):
        again = sensors.whitened(columns, times, y, measured, threads)
        assert np.array_equal(white, again[0]) and np.array_equal(log_det, again[1])
    alone = sensors.whitened(columns[..., :1], times, y, measured)[0]
    assert np.array_equal(alone, white[..., :1])
    covariance = sensors.covariance(times, y)
    for k in range(len(y)):
        flat = measured[k].ravel()
        factor = np.linalg.cholesky(covariance[k][np.ix_(flat, flat)])
        expected = np.linalg.solve(factor, columns[k].reshape(-1, 20)[flat])
        np.testing.assert_allclose(white[k].reshape(-1, 20)[flat], expected, rtol=1e-9, atol=1e-9)
        assert not white[k].reshape(-1, 20)[~flat].any()
        assert log_det[k] == pytest.approx(2 * np.log(np.diag(factor)).sum(), rel=1e-10)


def test_the_same_instant_again_informs_no_more_without_white_noise() -> None:
    sensors = Sensors.of({"a": Noise(colored=GaussMarkov(1.0, 2.0))}, ("a",))
    white, log_det = sensors.whitened(
        np.ones((1, 3, 1, 1)), np.array([[1.0, 1.0, 1e9]]), np.zeros((1, 3, 1)), np.ones((1, 3, 1), bool)
    )
    np.testing.assert_allclose(white.ravel(), [1.0, 0.0, 1.0])
    assert log_det[0] == pytest.approx(0.0)


def exact(sensors: Sensors, j: Array, moved: Array, times: Array, y: Array, measured: Any) -> Array:
    """J^T R^-1 J + 1/2 tr(R^-1 dR R^-1 dR) of one run, with dR by central differences of the whole covariance."""
    flat, p = measured.ravel(), j.shape[2]
    together = moved.reshape(flat.size, moved.shape[2])
    common = together @ together.T

    def r(at: Array) -> Array:
        return (sensors.covariance(times[None], at[None])[0] + common)[np.ix_(flat, flat)]

    q, steps, h = np.linalg.inv(r(y)), [], 1e-5
    for c in range(p):
        steps.append((r(y + h * j[..., c]) - r(y - h * j[..., c])) / (2 * h))
    flat_j = j.reshape(-1, p)[flat]
    found = flat_j.T @ q @ flat_j
    return found + np.array([[np.trace(q @ one @ q @ other) / 2 for other in steps] for one in steps])


KINDS = MEMORY | {
    "white": {"a": 0.1, "b": 0.2, "c": 0.5},
    "grows alone": {"a": Noise(0.1, relative=0.2), "b": Noise(0.2, relative=0.3), "c": 0.5},
    "grows and is correlated": NoiseModel(
        {"a": Noise(0.1, relative=0.1), "b": Noise(0.2, relative=0.3), "c": 0.5}, correlation={("a", "b"): 0.5}
    ),
}


@pytest.mark.parametrize("common", [0, 1, 2])
@pytest.mark.parametrize("noise", KINDS.values(), ids=KINDS.keys())
def test_rows_have_the_information_of_the_whole_covariance(noise: Any, common: int) -> None:
    times, y, measured = sequences(3)
    sensors = Sensors.of(noise, ("a", "b", "c"))
    rng = np.random.default_rng(4)
    j, moved = rng.normal(size=(*y.shape, 4)), rng.normal(size=(*y.shape, common))
    rows = sensors.rows(j, moved if common else None, times, y, measured)
    assert not rows[~measured].any()
    for k in range(len(y)):
        flat = rows[k].reshape(-1, 4)
        expected = exact(sensors, j[k], moved[k], times[k], y[k], measured[k])
        np.testing.assert_allclose(flat.T @ flat, expected, rtol=1e-8, atol=1e-8 * np.abs(expected).max())


def test_the_quick_way_is_that_of_the_whole_matrix() -> None:
    rng = np.random.default_rng(5)
    j, moved, variance, slope = (
        rng.normal(size=(1, 9, 3)),
        rng.normal(size=(1, 9, 2)),
        rng.random((1, 9)) + 0.5,
        rng.random((1, 9)) / 4,
    )
    quick = rows_beside_common(j, moved, variance, slope)[0]
    whole = dense_rows(j[0], np.diag(variance[0]) + moved[0] @ moved[0].T, np.diag(slope[0]))
    np.testing.assert_allclose(quick.T @ quick, whole.T @ whole, rtol=1e-12)


@pytest.mark.parametrize("y", [0.0, 0.25, 0.9, 3.3])
@pytest.mark.parametrize(
    "noise", [Noise(0.1, resolution=0.5), Noise(0.1, resolution=1.0, limits=(0.0, 3.0)), Noise(0.2, limits=(None, 1.0))]
)
def test_information_over_where_outputs_lie(noise: Noise, y: float) -> None:
    """Beside integrals over normal outputs; of no spread, that of the reading; of a wide one, the mean over a step.

    Of limits, what leaves the same mean variance of the output where ten readings are alike.
    """
    sensors = Sensors.of({"y": noise}, ["y"])

    def information(at: Array) -> Array:
        return np.asarray(sensors.precision(np.atleast_1d(at)[:, None])[:, 0])

    for spread in (0.05, 0.2):
        nodes = np.linspace(-8, 8, 20001)
        there = y + spread * nodes

        def mean(of: Array) -> float:
            return float(np.trapezoid(of * stats.norm.pdf(nodes), nodes))  # noqa: B023

        expected = mean(information(there))
        if noise.limited:
            low, high = (edge if edge is not None else side for edge, side in zip(noise.limits, (-np.inf, np.inf), strict=True))
            wide = float(np.hypot(noise.std, noise.resolution / np.sqrt(12)))
            past = np.maximum(np.maximum(low - there, there - high), 0.0)
            known = np.where(past > 0, spread**2 / (past**2 + wide**2), 0.0)
            smooth = 10 * spread**2 * reading_information(there, wide, lower=low, upper=high)
            expected *= (1 / mean(1 / (1 + smooth + known)) - 1) / mean(smooth)
        given = float(sensors.precision(np.array([[y]]), np.array([[spread]]))[0, 0])
        assert given == pytest.approx(expected, rel=0.03, abs=0.003 / noise.std**2)
    exact = sensors.precision(np.array([[y]]), np.zeros((1, 1)))
    assert float(exact[0, 0]) == pytest.approx(float(information(np.array(y))[0]), rel=1e-12)
    if not noise.limited:
        mean = float(information(np.linspace(0, noise.resolution, 1001)[:-1]).mean())
        assert float(sensors.precision(np.array([[y]]), np.full((1, 1), 1e3))[0, 0]) == pytest.approx(mean, rel=0.1)


@pytest.mark.long
@pytest.mark.parametrize("q", [0.01, 1.0, 2.0, 5.0, 30.0, 200.0])
@pytest.mark.parametrize("spread", [0.0, 0.05, 0.3, 1.0, 20.0])
def test_the_mean_over_steps_is_that_of_many_places(q: float, spread: float) -> None:
    """By the trapezoidal rule, whose error is next to nothing; outputs on an edge, in the middle of a step and elsewhere."""
    y, z = q * np.array([0.0, 0.25, 0.5, -1.5, 0.7]), np.linspace(-8.5, 8.5, 40_001)
    density = np.exp(-np.square(z) / 2) / np.exp(-np.square(z) / 2).sum()
    expected = [np.dot(density, reading_information(at + q * spread * z, 1.0, resolution=q)) for at in y]
    found = averaged_information(y, np.full(5, q * spread), 1.0, 0.0, q, -np.inf, np.inf)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)
    assert (found >= 0).all()
