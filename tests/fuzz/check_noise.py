"""Designs and fits under noise of every kind, against whole covariances and sums over readings.

Normal readings with the covariance R(y) inform by J^T R^-1 J + 1/2 tr(R^-1 dR R^-1 dR), independent ones that are rounded or
limited by the sum of P'^2 / P over all that a sensor may show. At an estimate, the slope of the likelihood is zero.
"""

from __future__ import annotations

import math
import warnings
from itertools import pairwise
from typing import Any

import numpy as np
from scipy import stats

import fisherpoint as fp
from check_shared import THETA, model_of
from checks import Bench
from figures import Finding
from reading import Floats

TOLERANCE = 1e-5
SLOPE = 1e-3
"""Largest slope of the likelihood at an estimate, over what a change of one standard error makes of it."""

Given = dict[str, Any]


def check_noise(bench: Bench) -> None:
    """A design's covariance, and the estimate from data that a virtual rig has measured."""
    rng = np.random.default_rng(bench.case.seed)
    noise, correlation = drawn_noise(rng)
    given: Any = fp.NoiseModel(noise, correlation={("y", "v"): correlation}) if correlation else noise
    count, segments = int(rng.integers(2, 5)), int(rng.integers(1, 7))
    x0, u = rng.choice([0.0, 0.5, 1.0], (count, 2)), rng.choice([0.0, 1.0, 2.0], (count, segments, 1))
    dt = rng.choice([0.1, 0.5, 1.0], (count, segments))
    measured = rng.random((count, segments)) < 0.8
    measured[:, -1] = True
    runs = fp.Runs(x0, u, dt, measured=measured)
    model = model_of(tuple(THETA))
    expected = covariance(runs, measured, noise, correlation)
    code = f"# noise {given!r}\n# {x0.tolist()}, {u.tolist()}, {dt.tolist()}, measured {measured.tolist()}"
    prior = fp.GaussianPrior(THETA, relative_std=dict.fromkeys(THETA, 0.3))
    known = fp.GaussianPrior(THETA, relative_std=dict.fromkeys(THETA, 1e-6))  # rounding and limits are averaged over the prior
    if expected is None:
        bench.figures.count("noise: singular")
        return
    found = fp.evaluate(fp.DesignProblem(model, known, None, noise=given, rtol=1e-9), runs, threads=1).covariance
    if found is None:
        bench.figures.count("noise: singular")
        return
    size = np.sqrt(np.diag(expected))
    error = float(np.max(np.abs(found - expected) / np.outer(size, size)))
    bench.figures.count("noise: designs compared")
    bench.figures.ratio("noise: covariances", error / TOLERANCE)
    if not error <= TOLERANCE:
        more = f"\n# expected {expected.tolist()}, given {found.tolist()}"
        bench.findings.append(Finding("wrong ok: covariance under noise", error / TOLERANCE, code + more))
    data = fp.VirtualRig(model, THETA, noise=given, seed=bench.case.seed % 1000).measure(runs)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        fit = fp.estimate(model, data, prior, noise=given, threads=1)
    bench.figures.count(f"noise: fits, {fit.stop_reason}")
    if not fit.converged:
        return
    slope = slope_at(fit, prior, noise, correlation)
    bench.figures.ratio("noise: slopes at estimates", slope / SLOPE)
    if not slope <= SLOPE:
        bench.findings.append(Finding("wrong ok: estimate under noise", slope / SLOPE, f"{code}\n# {fit.estimate}"))


def drawn_noise(rng: np.random.Generator) -> tuple[dict[str, fp.Noise], float]:
    """Noise of both outputs, and the correlation of the white parts; either independent readings, or normal ones."""
    if rng.random() < 0.5:
        of_reading = [
            {},
            {"relative": 0.1},
            {"resolution": float(rng.choice([0.01, 0.1, 0.5]))},
            {"limits": (0.25, None)},
            {"limits": (0.0, 1.0), "resolution": 0.1},
            {"relative": 0.3, "resolution": 0.05},
        ]
        return {name: fp.Noise(float(rng.choice([0.01, 0.1])), **of_reading[int(rng.integers(6))]) for name in "yv"}, 0.0
    noise = {}
    for name in "yv":
        parts = [
            fp.GaussMarkov(float(rng.choice([0.01, 0.1])), float(rng.choice([0.1, 1.0, 10.0]))) for _ in range(int(rng.integers(3)))
        ]
        relative = float(rng.choice([0.0, 0.0, 0.1]))
        noise[name] = fp.Noise(float(rng.choice([0.01, 0.1])), relative=relative, colored=parts)
    return noise, float(rng.choice([0.0, 0.0, 0.5, -0.9]))


def is_normal(noise: dict[str, fp.Noise], correlation: float) -> bool:
    """Whether readings depend on each other."""
    return bool(correlation) or any(one.parts for one in noise.values())


def response(runs: fp.Runs, values: Any) -> tuple[Floats, Floats]:
    """Outputs (K, N, 2) and derivatives (K, N, 2, p)."""
    found = fp.sensitivities(model_of(tuple(THETA)), runs, values, rtol=1e-10, threads=1)
    return found.y, found.dy_dtheta


def whole(y: Floats, times: Floats, noise: dict[str, fp.Noise], correlation: float) -> Floats:
    """R (n, 2, n, 2) of one run with outputs (n, 2)."""
    n = len(y)
    std = np.stack([np.hypot(one.std, one.relative * y[:, j]) for j, one in enumerate(noise.values())], axis=1)
    r = np.zeros((n, 2, n, 2))
    both = np.array([[1.0, correlation], [correlation, 1.0]])
    for k in range(n):
        r[k, :, k, :] = np.outer(std[k], std[k]) * both
    for j, one in enumerate(noise.values()):
        for part in one.parts:
            r[:, j, :, j] += part.std**2 * np.exp(-np.abs(times[:, None] - times) / part.correlation_time)
    return r


def covariance(runs: fp.Runs, measured: Any, noise: dict[str, fp.Noise], correlation: float) -> Floats | None:
    """The inverse of the information; None where that is next to singular."""
    values = list(THETA.values())
    y, dy = response(runs, values)
    information = np.zeros((2, 2))
    for k in range(len(runs)):
        there = measured[k]
        times, out, j = np.cumsum(runs.dt[k])[there], y[k, there], dy[k, there].reshape(-1, 2)
        if not is_normal(noise, correlation):
            w = np.array([[reading_information(v, one) for v, one in zip(row, noise.values(), strict=True)] for row in out]).ravel()
            information += j.T @ (w[:, None] * j)
            continue
        r = whole(out, times, noise, correlation).reshape(len(j), len(j))
        information += j.T @ np.linalg.solve(r, j)
        slopes, h = [], 1e-6
        for p in range(2):
            step = h * dy[k, there][:, :, p]
            up, down = (whole(out + side * step, times, noise, correlation).reshape(len(j), len(j)) for side in (1, -1))
            slopes.append(np.linalg.solve(r, (up - down) / (2 * h)))
        information += 0.5 * np.array([[np.trace(a @ b) for b in slopes] for a in slopes])
    scale = np.sqrt(np.diag(information))
    if not scale.all() or np.linalg.cond(information / np.outer(scale, scale)) > 1e6:
        return None
    return np.asarray(np.linalg.inv(information))


def edges_of(y: float, one: fp.Noise) -> list[tuple[float, float]]:
    """The values before rounding and limits that are shown alike, one interval for each value that is shown."""
    low, high = (bound if bound is not None else side * math.inf for bound, side in zip(one.limits, (-1, 1), strict=True))
    q, reach = one.resolution, 10 * math.hypot(one.std, one.relative * y)
    if not q:
        edges = np.clip(np.linspace(y - reach, y + reach, 20_001), low, high).tolist()
        return list(pairwise([-math.inf, *edges, math.inf]))
    shown: dict[float, tuple[float, float]] = {}
    for n in range(math.floor((y - reach) / q), math.ceil((y + reach) / q) + 1):
        value = round(min(max(n * q, low), high), 12)
        old = shown.get(value, (math.inf, -math.inf))
        shown[value] = min(old[0], (n - 0.5) * q), max(old[1], (n + 0.5) * q)
    return [(a if v > low + 1e-9 else -math.inf, b if v < high - 1e-9 else math.inf) for v, (a, b) in shown.items()]


def reading_information(y: float, one: fp.Noise) -> float:
    """Information of one reading, the sum of P'^2 / P."""
    sigma = math.hypot(one.std, one.relative * y)
    slope = one.relative**2 * y / sigma
    if not one.resolution and not one.limited:
        return float((1 + 2 * slope**2) / sigma**2)
    low, high = (np.array(ends) for ends in zip(*edges_of(y, one), strict=True))
    a, b = (low - y) / sigma, (high - y) / sigma
    p = np.where(a > 0, stats.norm.sf(a) - stats.norm.sf(b), stats.norm.cdf(b) - stats.norm.cdf(a))

    def change(z: Floats) -> Floats:
        finite = np.where(np.isfinite(z), z, 0.0)
        return np.where(np.isfinite(z), stats.norm.pdf(finite) * (1 + finite * slope) / sigma, 0.0)

    square = np.square(change(b) - change(a))
    return float(np.sum(np.divide(square, p, out=np.zeros(len(p)), where=p > 1e-290)))


def slope_at(fit: fp.Fit, prior: fp.GaussianPrior, noise: dict[str, fp.Noise], correlation: float) -> float:
    """Largest slope of the likelihood at an estimate by a standard error: zero at its maximum."""
    data, errors = fit.data[0], np.array(list(fit.standard_errors.values()))
    assert isinstance(data, fp.Measurements)
    runs, there = data.runs, np.isfinite(data.run_outputs)
    at_estimate = response(runs, fit.values)[0]

    def cost(values: Floats) -> float:
        y, total = response(runs, values)[0], 0.0
        for k in range(len(runs)):
            some = there[k].all(axis=1)
            e = (data.run_outputs[k] - y[k])[some]
            if is_normal(noise, correlation):
                r = whole(at_estimate[k, some], np.cumsum(runs.dt[k])[some], noise, correlation).reshape(e.size, e.size)
                total += 0.5 * float(e.ravel() @ np.linalg.solve(r, e.ravel()))
            else:
                for m, v in zip(data.run_outputs[k][some], y[k][some], strict=True):
                    total -= sum(log_likelihood(float(a), float(b), one) for a, b, one in zip(m, v, noise.values(), strict=True))
        off = (values - np.array(list(prior.mean.values()))) / np.array(list(prior.std.values()))
        return total + 0.5 * float(off @ off)

    steps = 1e-3 * np.diag(errors)
    return max(abs(cost(fit.values + step) - cost(fit.values - step)) / 2e-3 for step in steps)


def log_likelihood(reading: float, y: float, one: fp.Noise) -> float:
    """Log-likelihood of an independent reading."""
    sigma, q = math.hypot(one.std, one.relative * y), one.resolution
    low, high = (bound if bound is not None else side * math.inf for bound, side in zip(one.limits, (-1, 1), strict=True))
    a, b = reading - q / 2, reading + q / 2
    if reading <= low + 1e-9:
        a, b = -math.inf, low + q / 2
    elif reading >= high - 1e-9:
        a, b = high - q / 2, math.inf
    elif not q:
        return float(stats.norm.logpdf(reading, y, sigma))
    a, b = (a - y) / sigma, (b - y) / sigma
    a, b = (-b, -a) if a > 0 else (a, b)
    first, second = stats.norm.logcdf(a), stats.norm.logcdf(b)
    return float(second + np.log1p(-np.exp(first - second)))
