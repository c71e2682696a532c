"""Fits of data whose noise is more than white, against likelihoods of whole covariances and of single readings."""

from __future__ import annotations

import math
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy import optimize, special, stats

import fisherpoint as fp
from fisherpoint.basics.values import Array
from fisherpoint.noise.likelihood import ReadingLikelihood
from fisherpoint.noise.score_kurtosis import score_kurtosis
from fisherpoint.noise.sensors import Sensors

TRUTH = {"k1": 2.0, "k2": 1.2}
PRIOR = fp.GaussianPrior({"k1": 1.7, "k2": 1.4}, std={"k1": 0.5, "k2": 0.4})
MEMORY = fp.GaussMarkov(0.02, 0.4)

READINGS = {
    "exact": fp.Noise(0.02),
    "grows": fp.Noise(0.01, relative=0.1),
    "grows fast": fp.Noise(0.01, relative=0.5),
    "rounded": fp.Noise(0.02, resolution=0.05),
    "rounded finely": fp.Noise(0.02, resolution=1e-5),
    "limited": fp.Noise(0.03, limits=(0.3, 0.7)),
    "grows, rounded": fp.Noise(0.01, relative=0.1, resolution=0.05),
    "rounded, limited": fp.Noise(0.02, resolution=0.05, limits=(0.3, None)),
}


def tanks() -> fp.Model:
    return fp.SymbolicModel(
        ["u - k1*h1", "k1*h1 - k2*h2"],
        ["h1", "h2"],
        states={"h1": "m", "h2": "m"},
        inputs={"u": "1"},
        outputs={"y1": "m", "y2": "m"},
        parameters={"k1": "1", "k2": "1"},
        check_units=False,
    )


def runs(count: int = 3, samples: int = 30) -> fp.Runs:
    u = 1 + 0.8 * np.sin(np.arange(count * samples)).reshape(count, samples, 1)
    dt = 0.05 + 0.05 * (np.arange(samples) % 3)  # steps differ
    return fp.Runs(np.full((count, 2), 0.2), u, np.tile(dt, (count, 1)))


def measured(noise: Any, seed: int = 0, points: Any = None) -> fp.Measurements:
    rig = fp.VirtualRig(tanks(), TRUTH, noise=noise, seed=seed)
    return rig.measure(runs() if points is None else points)


def predicted(data: fp.Measurements, values: Array) -> Array:
    done = fp.simulate(tanks(), data.points, values, rtol=1e-11)
    return np.asarray(done.y[data.runs.measured]) if done.y.ndim == 3 else np.asarray(done.y)


# --- readings one by one ---------------------------------------------------------------------------------------------------


def log_likelihood(noise: fp.Noise, reading: float, y: float) -> float:
    """Of one reading, from the text of `Noise` alone; of fine rounding as a cell, too."""
    sigma, q = math.hypot(noise.std, noise.relative * y), noise.resolution
    lower, upper = (bound if bound is not None else side * math.inf for bound, side in zip(noise.limits, (-1, 1), strict=True))
    if q:
        edges = [reading - q / 2, reading + q / 2]
        if reading <= lower + 1e-9:
            edges = [-math.inf, (math.floor(lower / q + 1e-9) + 0.5) * q]
        if reading >= upper - 1e-9:
            edges = [(math.ceil(upper / q - 1e-9) - 0.5) * q, math.inf]
    elif reading <= lower:
        edges = [-math.inf, lower]
    elif reading >= upper:
        edges = [upper, math.inf]
    else:
        return float(stats.norm.logpdf(reading, y, sigma))
    low, high = ((edge - y) / sigma for edge in edges)
    low, high = (-high, -low) if low > 0 else (low, high)
    first, second = special.log_ndtr(low), special.log_ndtr(high)
    return float(second + np.log1p(-np.exp(first - second)))


@pytest.mark.parametrize("name", READINGS)
def test_likelihood_of_readings(name: str) -> None:
    noise = READINGS[name]
    sensors = Sensors.of({"y": noise}, ["y"])
    rng = np.random.default_rng(1)
    y = np.concatenate([rng.uniform(0.0, 1.0, 60), np.arange(11) / 10])  # with zeros, limits and edges of cells
    q = noise.resolution
    shown = np.concatenate([y[:30] + 0.02 * rng.standard_normal(30), y[30:]])
    shown = np.clip(np.rint(shown / q) * q if q else shown, *(bound if bound is not None else None for bound in noise.limits))
    of = ReadingLikelihood.of(shown, sensors, 0)
    given, slope = of.logarithm(y)
    shift = math.log(q) if 0 < q < 1e-3 * noise.std else 0.0  # there it is a density
    expected = [log_likelihood(noise, reading, at) - shift for reading, at in zip(shown, y, strict=True)]
    np.testing.assert_allclose(given, expected, rtol=1e-6 if shift else 1e-10, atol=1e-5 if shift else 1e-10)
    r, dr = of.residuals(y)
    np.testing.assert_allclose(0.5 * np.square(r), of.largest - given, rtol=1e-7, atol=1e-10)
    np.testing.assert_allclose(r * dr, -slope, rtol=1e-9, atol=1e-9)  # the gradient is that of the likelihood
    step = 1e-7
    differences = (of.residuals(y + step)[0] - of.residuals(y - step)[0]) / (2 * step)
    np.testing.assert_allclose(dr, differences, rtol=1e-4, atol=1e-3 / noise.std)
    assert (of.largest >= given - 1e-12).all()


@pytest.mark.parametrize("name", READINGS)
def test_scores_have_mean_zero_and_variance_one(name: str) -> None:
    noise, y = READINGS[name], 0.4 + 0.01 * np.arange(3)
    sensors = Sensors.of({"y": noise}, ["y"])
    rng = np.random.default_rng(0)
    shown = y[:, None] + np.hypot(noise.std, noise.relative * y)[:, None] * rng.standard_normal((3, 200_000))
    shown = np.rint(shown / noise.resolution) * noise.resolution if noise.resolution else shown
    shown = np.clip(shown, *noise.limits) if noise.limited else shown
    for k, at in enumerate(y):
        slope = ReadingLikelihood.of(shown[k], sensors, 0).logarithm(np.full(shown.shape[1], at))[1]
        s = slope / np.sqrt(sensors.precision(np.array([[at]]))[0, 0])
        fourth = float(score_kurtosis(np.array([at]), sensors, 0)[0])
        assert abs(s.mean()) < 0.01
        assert abs(np.square(s).mean() - 1) < 0.02 * math.sqrt(fourth)
        assert (s**4).mean() == pytest.approx(fourth, rel=0.1)


@pytest.mark.long
@pytest.mark.parametrize("name", READINGS)
def test_estimate_is_the_most_likely_one(name: str) -> None:
    noise = READINGS[name]
    data = measured({"y1": noise, "y2": 0.02})
    fit = fp.estimate(tanks(), data, start=PRIOR.mean, noise={"y1": noise, "y2": 0.02})

    def cost(values: Array) -> float:
        y, shown = predicted(data, values), data.samples
        total = sum(log_likelihood(noise, m, at) for m, at in zip(shown[:, 0], y[:, 0], strict=True))
        return float(0.5 * np.square((shown[:, 1] - y[:, 1]) / 0.02).sum() - total)

    best = optimize.minimize(cost, list(fit.values), method="Nelder-Mead", options={"xatol": 1e-7, "fatol": 1e-9})
    errors = np.array(list(fit.standard_errors.values()))
    assert fit.converged
    assert (np.abs(best.x - fit.values) < 2e-4 * errors).all()
    evaluation = fp.evaluate(problem({"y1": noise, "y2": 0.02}, dict(fit.estimate), 1e-6), data.points)
    np.testing.assert_allclose(errors, list(evaluation.standard_errors.values()), rtol=1e-3)


def problem(noise: Any, theta: dict[str, float] | None = None, relative_std: float = 0.1) -> fp.DesignProblem:
    mean = theta or TRUTH
    prior = fp.GaussianPrior(mean, std={name: relative_std * value for name, value in mean.items()})
    return fp.DesignProblem(tanks(), prior, None, noise=noise, rule=fp.GaussHermite(1))


# --- normal readings with a memory -------------------------------------------------------------------------------------------


WITH_MEMORY: dict[str, Any] = {
    "memory": {"y1": fp.Noise(0.01, colored=MEMORY), "y2": 0.02},
    "memory alone": {"y1": fp.Noise(colored=MEMORY), "y2": 0.02},
    "two parts": {"y1": fp.Noise(0.01, colored=[MEMORY, fp.GaussMarkov(0.01, 3.0)]), "y2": fp.Noise(0.02, colored=MEMORY)},
    "correlated": fp.NoiseModel({"y1": 0.02, "y2": 0.01}, correlation={("y1", "y2"): 0.8}),
    "correlated, memory": fp.NoiseModel({"y1": fp.Noise(0.02, colored=MEMORY), "y2": 0.01}, correlation={("y1", "y2"): -0.5}),
    "grows, memory": {"y1": fp.Noise(0.01, relative=0.05, colored=MEMORY), "y2": 0.02},
}


def dense_root(noise: Any, data: fp.Measurements, y: Array) -> Array:
    """L of R = L L^T of all that was measured, by the texts of `Noise` and `GaussMarkov`."""
    model = noise if isinstance(noise, fp.NoiseModel) else fp.NoiseModel(noise)
    there = data.runs.measured
    run, _ = np.nonzero(there)
    times = np.cumsum(data.runs.dt, axis=1)[there]
    n = len(times)
    r = np.zeros((n, 2, n, 2))
    white = np.zeros((n, 2))
    for j, name in enumerate(("y1", "y2")):
        given = model.outputs[name]
        one = given if isinstance(given, fp.Noise) else fp.Noise(given)
        white[:, j] = np.hypot(one.std, one.relative * y[:, j])
        for part in one.parts:
            lag = np.abs(times[:, None] - times) / part.correlation_time
            r[:, j, :, j] += np.where(run[:, None] == run, part.std**2 * np.exp(-lag), 0.0)
    correlation = np.eye(2)
    for value in (model.correlation or {}).values():
        correlation[0, 1] = correlation[1, 0] = value
    for k in range(n):
        r[k, :, k, :] += np.outer(white[k], white[k]) * correlation
    measured_there = np.isfinite(data.samples).ravel()
    return np.linalg.cholesky(r.reshape(2 * n, 2 * n)[np.ix_(measured_there, measured_there)])


def dense_fit(data: fp.Measurements, root: Callable[[Array], Array], begin: Array) -> tuple[Array, Array]:
    """Estimate and standard errors of generalised least squares, weighted by R at the estimate."""
    there, z = np.isfinite(data.samples).ravel(), begin
    for _ in range(12):
        factor = root(predicted(data, z))

        def whitened(values: Array, factor: Array = factor) -> Array:
            off = (predicted(data, values) - np.nan_to_num(data.samples)).ravel()[there]
            return np.asarray(np.linalg.solve(factor, off))

        found = optimize.least_squares(whitened, z, jac="3-point", x_scale=0.01, xtol=1e-14, ftol=1e-14, gtol=1e-14)
        if np.abs(found.x - z).max() < 1e-10:
            break
        z = found.x
    return found.x, np.sqrt(np.diag(np.linalg.inv(found.jac.T @ found.jac)))


@pytest.mark.parametrize("missing", [False, True])
@pytest.mark.parametrize("name", WITH_MEMORY)
def test_estimate_with_memory_is_that_of_a_whole_covariance(name: str, missing: bool) -> None:
    noise = WITH_MEMORY[name]
    data = measured(noise)
    if missing:
        y = data.y.copy()
        y[0, 3:6, 0], y[1, :, 1], y[2, 10:, :] = np.nan, np.nan, np.nan
        data = fp.Measurements(data.points, y)
    fit = fp.estimate(tanks(), data, start=PRIOR.mean, noise=noise)
    data = fit.data[0]  # runs end at their last number
    values, errors = dense_fit(data, lambda y: dense_root(noise, data, y), fit.values)
    assert fit.converged
    np.testing.assert_allclose(fit.values, values, atol=2e-6 * errors.max())
    np.testing.assert_allclose(list(fit.standard_errors.values()), errors, rtol=1e-6)
    white = np.linalg.solve(dense_root(noise, data, fit.predicted), fit.residuals.ravel()[np.isfinite(fit.residuals).ravel()])
    assert fit.chi_square == pytest.approx(float(white @ white), rel=1e-5)


def test_record_with_memory_is_fitted_as_the_run_that_it_is() -> None:
    noise = WITH_MEMORY["memory"]
    data = measured(noise, points=runs(1, 60))
    t = np.concatenate([[0.0], np.cumsum(data.runs.dt[0])])
    u = np.concatenate([data.runs.u[0], data.runs.u[0, -1:]])
    y = np.concatenate([[[np.nan, np.nan]], data.samples])
    record = fp.Record(t, u, y, x0={"h1": 0.2, "h2": 0.2})
    of_run, of_record = (fp.estimate(tanks(), part, start=PRIOR.mean, noise=noise) for part in (data, record))
    np.testing.assert_allclose(of_record.values, of_run.values, rtol=1e-6)
    np.testing.assert_allclose(list(of_record.standard_errors.values()), list(of_run.standard_errors.values()), rtol=1e-6)


def test_points_runs_and_records_are_fitted_together() -> None:
    """Each point, run and record has a memory of its own: against whole covariances, with an unknown start of a record."""
    noise, model = WITH_MEMORY["memory"], tanks()
    points = fp.Experiments(np.full((4, 2), 0.4), np.linspace(0.5, 1.5, 4)[:, None], [0.5, 0.5, 1.0, 2.0])
    of_points, of_runs = measured(noise, 1, points), measured(noise, 2, runs(2, 9))
    t, u = np.cumsum(np.tile([0.1, 0.3], 12)), np.where(np.arange(24) % 8 < 4, 1.5, 0.3)[:, None]
    rng = np.random.default_rng(0)
    of_record = fp.simulate_record(model, t, u, TRUTH, {"h1": 0.3, "h2": 0.5}).y + 0.02 * rng.standard_normal((24, 2))
    of_record[5:8, 0] = np.nan
    record = fp.Record(t, u, of_record, x0={"h1": 0.3})
    fit = fp.estimate(model, [of_points, record, of_runs], start={**PRIOR.mean, "x0_h2": 0.4}, noise=noise)

    def outputs(values: Array) -> list[tuple[Array, Array, Array]]:
        """Outputs, data and times of all series, in the order of the data."""
        theta, start = values[:2], values[2]
        found = [
            (row[None], of_points.y[k : k + 1], np.zeros(1))
            for k, row in enumerate(fp.simulate(model, points, theta, rtol=1e-11).y)
        ]
        found.append((fp.simulate_record(model, t, u, theta, {"h1": 0.3, "h2": start}, rtol=1e-11).y, of_record, t))
        y, times = fp.simulate(model, of_runs.points, theta, rtol=1e-11).y, np.cumsum(of_runs.runs.dt, axis=1)
        return found + [(y[k], of_runs.run_outputs[k], times[k]) for k in range(2)]

    def whitened(values: Array) -> Array:
        rows = []
        for y, shown, times in outputs(values):
            lag = np.abs(times[:, None] - times)
            for j, r in enumerate((0.01**2 * np.eye(len(times)) + 0.02**2 * np.exp(-lag / 0.4), 0.02**2 * np.eye(len(times)))):
                there = np.isfinite(shown[:, j])
                rows.append(np.linalg.solve(np.linalg.cholesky(r[np.ix_(there, there)]), (y - shown)[there, j]))
        return np.concatenate(rows)

    found = optimize.least_squares(whitened, fit.values, jac="3-point", x_scale=0.01, xtol=1e-14, ftol=1e-14, gtol=1e-14)
    errors = np.sqrt(np.diag(np.linalg.inv(found.jac.T @ found.jac)))
    np.testing.assert_allclose(fit.values, found.x, atol=2e-6 * errors.max())
    np.testing.assert_allclose(list(fit.standard_errors.values()), errors, rtol=1e-6)
    assert fit.chi_square == pytest.approx(2 * found.cost, rel=1e-8)


@pytest.mark.parametrize("name", ["memory", "grows, memory", "correlated"])
def test_what_varies_beside_a_memory(name: str) -> None:
    """R of each run has H P H^T beside the memory: against a whole covariance at the estimate."""
    noise, model = WITH_MEMORY[name], tanks()
    data = measured(noise)
    deviations = fp.Deviations(initial_state_std={"h1": 0.05})
    fit = fp.estimate(model, data, start=PRIOR.mean, noise=noise, deviations=deviations)
    moved = np.zeros((len(data.samples), 2, 3))
    step, sizes = 1e-4, data.runs.measured.sum(axis=1)
    ends = np.cumsum(sizes)
    for k in range(3):
        ways = []
        for side in (-1, 1):
            x0 = data.points.x0.copy()
            x0[k, 0] += side * step
            shifted = fp.Measurements(fp.Runs(x0, data.points.u, data.points.dt), data.y)
            ways.append(predicted(shifted, fit.values))
        moved[ends[k] - sizes[k] : ends[k], :, k] = ((ways[1] - ways[0]) / (2 * step) * 0.05)[ends[k] - sizes[k] : ends[k]]
    root = dense_root(noise, data, fit.predicted)
    by = moved.reshape(-1, 3)
    whole = np.linalg.cholesky(root @ root.T + by @ by.T)
    values, errors = dense_fit(data, lambda y: whole, fit.values)
    np.testing.assert_allclose(fit.values, values, atol=1e-4 * errors.max())
    np.testing.assert_allclose(list(fit.standard_errors.values()), errors, rtol=1e-5)


@pytest.mark.parametrize("name", [*READINGS, *WITH_MEMORY])
def test_fit_is_saved_and_read(name: str, tmp_path: Any) -> None:
    noise = {"y1": READINGS[name], "y2": 0.02} if name in READINGS else WITH_MEMORY[name]
    fit = fp.estimate(tanks(), measured(noise), start=PRIOR.mean, noise=noise)
    fit.save(tmp_path)
    again = fp.Fit.load(tmp_path)
    assert again.noise == fit.noise
    assert again.standard_errors == fit.standard_errors
    assert again.chi_square == fit.chi_square
    assert str(again) == str(fit)


@pytest.mark.parametrize("name", ["grows", "rounded, limited", "memory", "correlated, memory"])
def test_what_a_fit_can_do_it_can_under_such_noise(name: str) -> None:
    pytest.importorskip("matplotlib")
    noise = {"y1": READINGS[name], "y2": 0.02} if name in READINGS else WITH_MEMORY[name]
    fit = fp.estimate(tanks(), measured(noise), PRIOR, noise=noise)
    for parameter, (low, high) in fit.intervals().items():
        profile = fit.profile(parameter).interval
        np.testing.assert_allclose(profile, (low, high), atol=0.03 * (high - low))  # the model is nearly linear there
        assert 0.5 < fit.robust_ratios[parameter] < 1.5
    together = fit.stability().together
    assert together is not None and together.p_value > 1e-3
    assert pickle.loads(pickle.dumps(fit)).standard_errors == fit.standard_errors
    np.testing.assert_allclose(list(fit.posterior().std.values()), list(fit.standard_errors.values()))
    for kind in ("parity", "residuals", "time", "autocorrelation"):
        fit.plot(kind)


@pytest.mark.parametrize("name", [*READINGS, *WITH_MEMORY])
def test_validate_keeps_what_it_promises(name: str) -> None:
    noise = {"y1": READINGS[name], "y2": 0.02} if name in READINGS else WITH_MEMORY[name]
    found = fp.validate(problem(noise), runs(2, 20), runs=300, theta="mean", seed=3, threads=1).designs["design"]
    assert found.fits >= 299
    for figures in found.parameters.values():
        assert abs(figures.ratio.value - 1) < 4 / math.sqrt(2 * 300)


def test_misuse() -> None:
    limited = {"y1": fp.Noise(0.02, limits=(0, 1)), "y2": 0.02}
    data = measured(limited)
    with pytest.raises(ValueError, match="limits: expected none beside varies or starts that deviate, given both"):
        fp.estimate(tanks(), data, start=PRIOR.mean, noise=limited, deviations=fp.Deviations(initial_state_std={"h1": 0.01}))
    with pytest.raises(ValueError, match="noise_known: expected True beside noise that is more than white"):
        fp.validate(problem(WITH_MEMORY["memory"]), runs(), runs=10, noise_known=False)
