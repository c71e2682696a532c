"""Noise that is found in residuals: the restricted likelihood, the form that is chosen, and what it does to intervals."""

from __future__ import annotations

import warnings
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.basics.values import Array
from fisherpoint.estimation.noise_forms import FORMS, likely_forms, log_covariance
from fisherpoint.estimation.restricted_likelihood import OutputNoise, RestrictedLikelihood

LINE = fp.SymbolicModel([], ["p + q*s"], {}, {"s": "1"}, {"p": "V", "q": "V"}, {"y": "V"}, name="line")
LAG = fp.SymbolicModel(
    ["(u - x)/tau"], ["x", "g*x"], {"x": "V"}, {"u": "V"}, {"tau": "s", "g": "1"}, {"x": "V", "y": "V"}, name="lag"
)
THETA = {"tau": 2.0, "g": 3.0}
PART, SLOW = (0.1, 3.0), (0.2, 40.0)
NOISES = {
    "white": OutputNoise(0.1),
    "growing": OutputNoise(0.05, 0.2),
    "memory": OutputNoise(0.0, 0.0, (PART,)),
    "white, memory": OutputNoise(0.1, 0.0, (PART,)),
    "growing, memory": OutputNoise(0.05, 0.2, (PART,)),
    "two memories": OutputNoise(0.0, 0.0, (PART, SLOW)),
    "white, two memories": OutputNoise(0.1, 0.0, (PART, SLOW)),
}


def samples(lengths: tuple[int, ...]) -> tuple[Array, Array, Array, Any]:
    """Times with unequal steps, outputs, derivatives, and numbers of series."""
    rng = np.random.default_rng(0)
    times = np.concatenate([np.cumsum(rng.uniform(0.1, 2.0, n)) for n in lengths])
    outputs = 1 + np.sin(0.05 * times)
    jacobian = np.column_stack([np.ones(len(times)), times, np.cos(0.1 * times), 2 * np.ones(len(times))])  # one is another's
    return times, outputs, jacobian, np.repeat(np.arange(len(lengths)), lengths)


def covariance(noise: OutputNoise, times: Array, outputs: Array, series: Any) -> Array:
    r = np.diag(noise.std**2 + np.square(noise.relative * outputs))
    lag, same = np.abs(times[:, None] - times), series[:, None] == series
    for std, time in noise.parts:
        r += np.where(same, std**2 * np.exp(-lag / time), 0.0)
    return np.asarray(r)


def drawn(noise: OutputNoise, times: Array, outputs: Array, series: Any, seed: int) -> Array:
    root = np.linalg.cholesky(covariance(noise, times, outputs, series))
    return np.asarray(root @ np.random.default_rng(seed).standard_normal(len(times)))


@pytest.mark.parametrize("lengths", [(40,), (1, 7, 7, 25), (1, 1, 1, 1, 1, 1, 1)])
@pytest.mark.parametrize("name", NOISES)
def test_restricted_likelihood_is_that_of_a_whole_covariance(name: str, lengths: tuple[int, ...]) -> None:
    noise, (times, outputs, jacobian, series) = NOISES[name], samples(lengths)
    e = drawn(noise, times, outputs, series, 1)
    likelihood = RestrictedLikelihood.of(e, jacobian, times, outputs, series)
    assert likelihood.degrees_of_freedom == len(e) - 3
    assert sum(likelihood.spans) == pytest.approx(
        sum(times[series == k].max() - times[series == k].min() for k in range(len(lengths)))
    )
    r = covariance(noise, times, outputs, series)
    basis = np.linalg.qr(jacobian[:, :3])[0]
    inside = basis.T @ np.linalg.solve(r, basis)
    projected = np.linalg.solve(r, e) - np.linalg.solve(r, basis) @ np.linalg.solve(inside, basis.T @ np.linalg.solve(r, e))
    expected = np.linalg.slogdet(r)[1] + np.linalg.slogdet(inside)[1] + e @ projected
    assert likelihood.deviance(noise) == pytest.approx(expected, rel=1e-9, abs=1e-8)
    best, least = likelihood.best_scale(noise)
    assert least == pytest.approx(likelihood.deviance(best), rel=1e-9, abs=1e-8)
    assert all(likelihood.deviance(best.scaled(factor)) > least for factor in (0.99, 1.01))


@pytest.mark.long
@pytest.mark.parametrize("name", NOISES)
def test_form_and_numbers_are_found(name: str) -> None:
    """Of five data of 800 samples each, most have the true form, and its numbers are within what their uncertainty allows."""
    noise, (times, outputs, jacobian, series) = NOISES[name], samples((800,))
    hits, away = 0, []
    for seed in range(5):
        likelihood = RestrictedLikelihood.of(drawn(noise, times, outputs, series, seed), jacobian, times, outputs, series)
        forms = likely_forms(likelihood)
        assert all(one.penalised <= other.penalised for one, other in pairwise(forms))
        hits += forms[0].form.name == name
        own = next(one for one in forms if one.form.name == name)
        spread = np.sqrt(np.diag(log_covariance(likelihood, own)))
        away.append((own.form.logs(own.noise) - own.form.logs(noise)) / spread)
        if noise.parts:
            assert next(one for one in forms if one.form.name == "white").penalised > forms[0].penalised + 50
    assert hits >= {"white, two memories": 0, "two memories": 2}.get(name, 4)
    typical = np.median(np.abs(away), axis=0)
    assert (typical[np.isfinite(typical)] < 2.5).all()


def test_forms_have_as_many_numbers_as_they_say() -> None:
    for form in FORMS:
        noise = NOISES[form.name]
        assert len(form.labels) == form.size == len(form.logs(noise))
        again = form.noise(form.logs(noise))
        assert (again.std, again.relative) == pytest.approx((noise.std, noise.relative))
        np.testing.assert_allclose(again.parts, noise.parts)


# --- fits ------------------------------------------------------------------------------------------------------------------


def record(n: int = 1000, seed: int = 0, correlated: float = 0.0) -> fp.Record:
    """A record of the lag: white noise of x, and noise with a memory of 10 s of y."""
    t, u = 0.5 * np.arange(n), np.where(np.arange(n) // 17 % 2, 1.0, 0.2)
    y = fp.simulate_record(LAG, t, u, THETA, {"x": 0.0}).y
    fresh = np.random.default_rng(seed).standard_normal((n, 2))
    fresh[:, 1] = correlated * fresh[:, 0] + np.sqrt(1 - correlated**2) * fresh[:, 1]
    phi = np.array([0.0, np.exp(-0.05) if not correlated else 0.0])
    for k in range(1, n):
        fresh[k] = phi * fresh[k - 1] + np.sqrt(1 - phi**2) * fresh[k]
    return fp.Record(t, u, y + 0.05 * fresh, x0={"x": 0.0})


def test_found_noise_weighs_the_fit_as_if_it_were_given(tmp_path: Path) -> None:
    data = record()
    fit = fp.estimate(LAG, data, start=THETA, noise="estimated")
    assert fit.noise_estimate is not None
    assert {name: one.form for name, one in fit.noise_estimate.items()} == {"x": "white", "y": "memory"}
    found = fit.noise_estimate["y"]
    for label, true in (("std of memory", 0.05), ("correlation time", 10.0)):
        assert abs(found.values[label] - true) < 4 * found.standard_errors[label]
    assert found.correlation_times == pytest.approx(499.5 / found.values["correlation time"])
    given = fp.estimate(LAG, data, start=THETA, noise=fit.noise)
    np.testing.assert_allclose(fit.values, given.values, rtol=1e-8)
    np.testing.assert_allclose(list(fit.standard_errors.values()), list(given.standard_errors.values()), rtol=1e-6)
    with pytest.warns(RuntimeWarning, match="y: the residuals are not white"):
        white = fp.estimate(LAG, data, start=THETA, noise={"x": 0.05, "y": 0.05})
    assert fit.standard_errors["g"] > 2 * white.standard_errors["g"]
    assert all(check.white for check in fit.residual_checks.values())
    fit.save(tmp_path)
    again = fp.Fit.load(tmp_path)
    assert again.intervals() == fit.intervals()
    assert str(again) == str(fit)
    assert "Noise found in the residuals" in str(fit)
    # The profile is the interval by standard errors where the model is as good as linear.
    profile = fit.profile("g")
    np.testing.assert_allclose(profile.interval, fit.intervals()["g"], rtol=1e-3)


def test_degrees_of_freedom_are_those_of_differences_of_whole_covariances() -> None:
    n = 120
    t = 0.5 * np.arange(n)
    fresh = np.random.default_rng(1).standard_normal(n)
    for k in range(1, n):
        fresh[k] = 0.8 * fresh[k - 1] + 0.6 * fresh[k]
    s = np.linspace(-1, 1, n)
    data = fp.Record(t, s[:, None], 1 + 2 * s + 0.1 * fresh)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        fit = fp.estimate(LINE, data, start={"p": 1.0, "q": 2.0}, noise="estimated")
    assert fit.noise_estimate is not None
    found = fit.noise_estimate["y"]
    assert found.form == "memory"
    j = np.column_stack([np.ones(n), s])

    def log_variances(std: float, time: float) -> Array:
        r = std**2 * np.exp(-np.abs(t[:, None] - t) / time)
        return np.asarray(np.log(np.diag(np.linalg.inv(j.T @ np.linalg.solve(r, j)))))

    std, time = found.values.values()
    h = 1e-4
    g = np.array(
        [
            (log_variances(std * np.exp(a * h), time * np.exp(b * h)) - log_variances(std * np.exp(-a * h), time * np.exp(-b * h)))
            / (2 * h)
            for a, b in ((1, 0), (0, 1))
        ]
    )
    expected = 2 / np.einsum("kp,kl,lp->p", g, found.log_covariance, g)
    np.testing.assert_allclose(list(fit.quantile_degrees_of_freedom.values()), expected, rtol=0.02)


def test_white_noise_gives_the_fit_of_white_noise() -> None:
    t, u = 0.5 * np.arange(300), np.where(np.arange(300) // 17 % 2, 1.0, 0.2)
    y = fp.simulate_record(LAG, t, u, THETA, {"x": 0.0}).y + 0.05 * np.random.default_rng(4).standard_normal((300, 2))
    data = fp.Record(t, u, y, x0={"x": 0.0})
    plain, found = (fp.estimate(LAG, data, start=THETA, noise=noise) for noise in (None, "estimated"))
    assert found.noise is None and found.noise_estimate is not None
    assert {one.form for one in found.noise_estimate.values()} == {"white"}
    assert found.standard_errors == plain.standard_errors
    assert found.intervals() == plain.intervals()


@pytest.mark.long
@pytest.mark.parametrize("kind", ["record", "runs"])
def test_intervals_hold(kind: str) -> None:
    """95 % intervals of 25 fits to 50 correlation times: one in 1000 such tests would have less than 42 of 50 that hold."""
    held, n, phi = 0, 500, float(np.exp(-0.1))
    s = np.linspace(-1, 1, n)
    rng = np.random.default_rng(3)
    for _ in range(25):
        fresh = rng.standard_normal(n)
        for k in range(1, n):
            if kind == "record" or k % 50:
                fresh[k] = phi * fresh[k - 1] + np.sqrt(1 - phi**2) * fresh[k]
        y = 1 + 2 * s + 0.1 * fresh
        if kind == "record":
            data: Any = fp.Record(np.arange(n), s[:, None], y)
        else:
            runs = fp.Runs(np.zeros((10, 0)), s.reshape(10, 50, 1), 1.0)
            data = fp.Measurements(runs, y.reshape(10, 50, 1))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            fit = fp.estimate(LINE, data, start={"p": 1.0, "q": 2.0}, noise="estimated")
        held += sum(low <= true <= high for (low, high), true in zip(fit.intervals().values(), (1.0, 2.0), strict=True))
    assert held >= 42


def test_growing_noise_of_points_is_found() -> None:
    s = np.tile(np.linspace(0, 1, 40), 5)
    y = 1 + 2 * s
    y = y + np.hypot(0.01, 0.1 * y) * np.random.default_rng(0).standard_normal(len(s))
    data = fp.Measurements(fp.Experiments(np.zeros((len(s), 0)), s[:, None]), y[:, None])
    fit = fp.estimate(LINE, data, start={"p": 1.0, "q": 2.0}, noise="estimated")
    assert fit.noise_estimate is not None
    found = fit.noise_estimate["y"]
    assert found.form == "growing"
    assert found.values["relative"] == pytest.approx(0.1, abs=3 * found.standard_errors["relative"])
    assert set(found.tried) == {"white", "growing"}


def test_short_data_and_correlated_outputs_are_findings() -> None:
    short = record(120, seed=5)
    with pytest.warns(RuntimeWarning, match=r"y: the data are only .* correlation times of the noise long: too short"):
        fit = fp.estimate(LAG, short, start=THETA, noise="estimated")
    assert all(np.isfinite(list(fit.standard_errors.values())))
    both = record(400, correlated=0.7)
    with pytest.warns(RuntimeWarning, match=r"x and y: the residuals are correlated by 0\.\d\d, which the noise is not"):
        fp.estimate(LAG, both, start=THETA, noise={"x": 0.05, "y": 0.05})
    given = fp.NoiseModel({"x": 0.05, "y": 0.05}, correlation={("x", "y"): 0.7})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fp.estimate(LAG, both, start=THETA, noise=given)


def test_misuse() -> None:
    with pytest.raises(ValueError, match="noise: expected 'estimated', given 'guessed'"):
        fp.estimate(LAG, record(100), start=THETA, noise="guessed")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="noise: expected the sensor noise together with varies or initial_state_std, given none"):
        fp.estimate(LAG, record(100), start=THETA, noise="estimated", deviations=fp.Deviations(initial_state_std={"x": 0.1}))
