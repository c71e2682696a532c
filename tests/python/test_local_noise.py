"""Noise that is looked for beside local parameters: their values count among the unknowns that residuals have used up."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.basics.values import Array
from fisherpoint.estimation.restricted_likelihood import OutputNoise, RestrictedLikelihood
from local_cases import START, cart, measured

LINE = fp.SymbolicModel([], ["a * u + off"], {}, {"u": "1"}, {"a": "1", "off": "1"}, {"y": "1"}, name="line")
NOISES = (OutputNoise(0.1), OutputNoise(0.05, 0.2), OutputNoise(0.1, 0.0, ((0.2, 3.0),)), OutputNoise(0.0, 0.0, ((0.1, 1.0),)))


def whole(jacobian: Array, places: Array) -> Array:
    """The Jacobian with a column for each value of a local parameter."""
    common, width = jacobian.shape[1] - places.shape[1], places.shape[1]
    found = np.zeros((len(jacobian), common + int(places.max()) + 1))
    found[:, :common] = jacobian[:, :common]
    for k in range(width):
        found[np.arange(len(found)), common + places[:, k]] = jacobian[:, common + k]
    return found


def case(seed: int) -> tuple[Array, Array, Array, Array, Any, Array]:
    """Series with values of one or two local parameters each, of runs and of plants, some of which nothing shows."""
    rng = np.random.default_rng(seed)
    lengths = rng.integers(1, 9, int(rng.integers(1, 7)))
    series = np.repeat(np.arange(len(lengths)), lengths)
    n, plants = len(series), rng.integers(0, 2, len(lengths))
    places = [series, len(lengths) + plants[series]][: 1 + seed % 2]
    own = np.stack(places, axis=1)
    times = np.concatenate([np.cumsum(rng.uniform(0.2, 1.0, k)) for k in lengths])
    jacobian = rng.integers(-2, 3, (n, 2 + own.shape[1])).astype(float)
    if seed % 3 == 0:
        jacobian[:, 2] = jacobian[:, 0]  # the first parameter is to the first series what its own value is
    if seed % 5 == 0:
        jacobian[series == 0, 2:] = 0.0
    return rng.standard_normal(n), jacobian, times, rng.integers(-1, 3, n).astype(float), series, own


@pytest.mark.parametrize("seed", range(40))
def test_the_likelihood_by_blocks_is_that_of_the_whole_matrix(seed: int) -> None:
    e, jacobian, times, outputs, series, places = case(seed)
    blocks = RestrictedLikelihood.of(e, jacobian, times, outputs, series, places)
    dense = RestrictedLikelihood.of(e, whole(jacobian, places), times, outputs, series)
    assert blocks.degrees_of_freedom == dense.degrees_of_freedom == len(e) - np.linalg.matrix_rank(whole(jacobian, places))
    if not dense.degrees_of_freedom:
        return
    for noise in NOISES:
        assert blocks.deviance(noise) == pytest.approx(dense.deviance(noise), rel=1e-9, abs=1e-8)
        assert blocks.best_scale(noise)[1] == pytest.approx(dense.best_scale(noise)[1], rel=1e-9, abs=1e-7)


def line_data(seed: int, noise: fp.Noise | float, runs: int = 12, samples: int = 12) -> fp.Measurements:
    rng = np.random.default_rng([seed, 7])
    inputs = rng.uniform(-1, 1, (runs, samples, 1))
    of_runs = fp.Runs(np.zeros((runs, 0)), inputs, np.full((runs, samples), 0.5))
    rig = fp.VirtualRig(LINE, {"a": 2.0, "off": 0.0}, {"y": noise}, seed=seed)
    data = rig.measure(of_runs)
    return fp.Measurements(of_runs, data.y + rng.normal(1.0, 2.0, (runs, 1, 1)))


def found(data: fp.Measurements, noise: Any = "estimated") -> fp.Fit:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # data are short in correlation times
        return fp.estimate(LINE, data, start={"a": 1.0, "off": 0.0}, noise=noise, deviations=fp.Deviations(local={"off": "run"}))


@pytest.mark.long
def test_sizes_have_no_bias_from_the_values_that_were_fitted() -> None:
    """Of three samples each, a third of the squares goes into the offsets of the runs."""
    variances = [found(line_data(seed, 0.1, 40, 3)).noise_estimate["y"].values["std"] ** 2 for seed in range(12)]
    degrees = 40 * 3 - 41
    assert np.mean(variances) == pytest.approx(0.01, abs=4 * 0.01 * np.sqrt(2 / degrees / 12))


def test_white_noise_is_that_of_the_fit_that_estimates_it() -> None:
    data = line_data(3, 0.1)
    looked_for, white = found(data), found(data, None)
    assert looked_for.noise_estimate["y"].form == "white"
    for name in looked_for.parameters:
        assert looked_for.estimate[name] == pytest.approx(white.estimate[name], rel=1e-6)
        assert looked_for.standard_errors[name] == pytest.approx(white.standard_errors[name], rel=1e-6)


@pytest.mark.long
def test_a_memory_is_found_and_intervals_hold(tmp_path: Path) -> None:
    noise = fp.Noise(0.05, colored=fp.GaussMarkov(0.2, 2.0))
    inside, forms = [], []
    for seed in range(8):
        fit = found(line_data(seed, noise, 8, 60))
        forms.append(fit.noise_estimate["y"].form)
        low, high = fit.intervals()["a"]
        inside.append(low < 2.0 < high)
    assert sum("memory" in form for form in forms) >= 7 and sum(inside) >= 5
    fit = found(line_data(0, noise, 8, 60))
    given = found(line_data(0, noise, 8, 60), fit.noise)
    assert fit.converged
    for name in fit.parameters:
        assert given.estimate[name] == pytest.approx(fit.estimate[name], rel=1e-3)
        assert given.standard_errors[name] == pytest.approx(fit.standard_errors[name], rel=1e-3)
    fit.save(tmp_path / "fit")
    again = fp.Fit.load(tmp_path / "fit")
    assert str(again) == str(fit) and again.noise_estimate["y"].values == fit.noise_estimate["y"].values
    assert "off of each run" in str(fit)


def test_plants_and_runs_of_a_nonlinear_model() -> None:
    data = measured(6, 20, each=2, labels={"plant": ["A", "A", "B", "B", "C", "C"]})
    fits = [
        fp.estimate(cart(), data, start=START, noise=noise, deviations=fp.Deviations(local={"m_load": "plant"}))
        for noise in ("estimated", {"y": 0.01})
    ]
    assert fits[0].converged and fits[0].noise_estimate["y"].values["std"] == pytest.approx(0.01, rel=0.3)
    for name in fits[0].parameters:
        assert abs(fits[0].estimate[name] - fits[1].estimate[name]) < fits[1].standard_errors[name]


def test_one_run_alone() -> None:
    fit = found(line_data(1, 0.1, 1, 30))
    assert fit.noise_estimate["y"].values["std"] == pytest.approx(0.1, rel=0.5) and set(fit.local["off"]) == {"1"}
