"""What a fit says of its residuals: warnings, report, files, and what has nothing to judge."""

from __future__ import annotations

import json
import warnings
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import fisherpoint as fp
from oracle import Floats
from test_whiteness import markov

LINE = fp.SymbolicModel([], ["p + q*s"], {}, {"s": "1"}, {"p": "V", "q": "V"}, {"y": "V"}, name="line")
LAG = fp.SymbolicModel(
    ["(u - x)/tau"], ["x", "g*x"], {"x": "V"}, {"u": "V"}, {"tau": "s", "g": "1"}, {"x": "V", "y": "V"}, name="lag"
)
THETA = {"tau": 2.0, "g": 3.0}


def expects_white() -> pytest.WarningsRecorder:
    return pytest.warns(RuntimeWarning, match="residuals: expected white noise")


def of_line(s: Floats, y: Floats) -> fp.Measurements:
    return fp.Measurements(fp.Experiments(np.zeros((len(s), 0)), s[:, None]), y[:, None])


@cache
def simulated(n: int) -> tuple[Floats, Floats, Floats]:
    t, u = 0.5 * np.arange(n), np.where(np.arange(n) // 17 % 2, 1.0, 0.2)
    return t, u, fp.simulate_record(LAG, t, u, THETA, {"x": 0.0}).y


def record(phi: float, n: int = 400, seed: int = 0) -> fp.Record:
    """A record whose second output alone has noise with a memory."""
    t, u, y = simulated(n)
    rng = np.random.default_rng(seed)
    noise = np.stack([0.02 * rng.standard_normal(n), 0.05 * markov(rng, n, phi)], axis=1)
    return fp.Record(t, u, y + noise, x0={"x": 0.0})


@cache
def of_memory() -> fp.Fit:
    with expects_white():
        return fp.estimate(LAG, record(0.9), start=THETA)


def test_white_noise_makes_no_warning() -> None:
    fit = fp.estimate(LAG, record(0.0), start=THETA)
    assert all(check.white and check.lags == 16 for check in fit.residual_checks.values())
    assert "robust" not in str(fit)
    assert "Are the residuals white?" in str(fit)
    for name, error in fit.robust_standard_errors.items():
        assert error == pytest.approx(fit.standard_errors[name], rel=0.35)


def test_a_memory_is_said_first_and_of_its_output_alone() -> None:
    fit = of_memory()
    assert fit.residual_checks["x"].white
    check = fit.residual_checks["y"]
    assert not check.white and check.memory is not None
    assert check.memory.samples == pytest.approx(-1 / np.log(0.9), rel=0.5)
    first, second, *_ = fit.report().warnings
    assert first.startswith("y: the residuals are not white, with a correlation of 0.")
    assert second.startswith("standard errors are about ") or second.startswith("the data are only ")
    assert "times too small for g" in second and "let the noise be found" in second
    assert fit.robust_ratios["g"] == pytest.approx(np.sqrt(1.9 / 0.1), rel=0.4)
    (row,) = [line for line in str(fit).split("\n") if line.strip().startswith("g ")]
    assert f"{fit.robust_standard_errors['g']:.3g}" in row


def test_short_records_cannot_tell() -> None:
    with expects_white():
        fit = fp.estimate(LAG, record(0.98, 300), start=THETA)
    assert fit.residual_checks["y"].correlation_times < 50
    assert "correlation times long: too short to show" in fit.report().warnings[1]
    with expects_white():
        fit = fp.estimate(LAG, record(0.5, 300), start=THETA)
    assert "too short" not in "".join(fit.report().warnings)


def test_files_have_the_checks(tmp_path: Path) -> None:
    fit = of_memory()
    fit.save(tmp_path)
    kept = json.loads((tmp_path / "fit.json").read_text())
    assert kept["residual_checks"]["x"]["white"] is True
    assert kept["residual_checks"]["y"]["white"] is False
    assert kept["residual_checks"]["y"]["memory_in_samples"] == pytest.approx(fit.residual_checks["y"].memory.samples)  # type: ignore[union-attr]
    assert kept["parameters"]["g"]["robust_standard_error"] == pytest.approx(fit.robust_standard_errors["g"])
    again = fp.Fit.load(tmp_path)
    assert again.robust_standard_errors == pytest.approx(dict(fit.robust_standard_errors))
    assert fit.to_pandas()["robust_standard_error"]["g"] == fit.robust_standard_errors["g"]


def test_missing_samples_and_unequal_steps_are_no_memory() -> None:
    whole, rng = record(0.0), np.random.default_rng(1)
    y = whole.y.copy()
    y[rng.random(len(y)) < 0.6, 0] = np.nan
    y[:, 1] = np.where(np.arange(len(y)) % 5 == 0, y[:, 1], np.nan)
    fit = fp.estimate(LAG, fp.Record(whole.t, whole.u, y, x0={"x": 0.0}), start=THETA)
    assert fit.residual_checks["y"].count == 80
    assert all(check.white and check.lag_p_value is not None for check in fit.residual_checks.values())


def test_an_output_that_was_never_measured_is_not_judged() -> None:
    whole = record(0.9)
    fit = fp.estimate(LAG, fp.Record(whole.t, whole.u, whole.y * [1.0, np.nan], x0={"x": 0.0}), start=THETA, parameters=["tau"])
    assert set(fit.residual_checks) == {"x"}


def test_numerical_errors_are_not_judged() -> None:
    t, u, y = simulated(400)
    fit = fp.estimate(LAG, fp.Record(t, u, y, x0={"x": 0.0}), start={"tau": 2.1, "g": 2.9})
    assert not fit.residual_checks
    assert "estimated noise" in "".join(fit.report().warnings)


def test_points_have_signs_and_runs_of_one_segment_are_points() -> None:
    rng, s = np.random.default_rng(2), np.linspace(0, 1, 40)
    y = 1 + 2 * s + 0.8 * s**2 + 0.02 * rng.standard_normal(40)
    order = rng.permutation(40)
    with expects_white():
        fit = fp.estimate(LINE, of_line(s[order], y[order]), start={"p": 1.0, "q": 2.0})
    check = fit.residual_checks["y"]
    assert check.lag_p_value is None and check.count == 0
    assert check.signs is not None and check.signs.setting == "s" and check.signs.count < 8
    assert "the model lacks something that depends on s" in fit.report().warnings[0]
    straight = fp.estimate(LINE, of_line(s[order], (y - 0.8 * s**2)[order]), start={"p": 1.0, "q": 2.0})
    assert straight.residual_checks["y"].white


def of_runs(order: Floats, phi: float) -> fp.Measurements:
    rng = np.random.default_rng(3)
    u = rng.uniform(0, 1, (12, 8))
    runs = fp.Runs([[0.0]] * 12, u, 0.5)
    noise = np.stack([markov(rng, 8, phi) for _ in range(24)]).reshape(2, 12, 8).transpose(1, 2, 0)
    return fp.Measurements(runs[order], (fp.simulate(LAG, runs, THETA).y + 0.05 * noise)[order])


def test_the_order_of_runs_does_not_count() -> None:
    with expects_white():
        first = fp.estimate(LAG, of_runs(np.arange(12), 0.9), start=THETA, noise={"x": 0.05, "y": 0.05})
    with expects_white():
        other = fp.estimate(LAG, of_runs(np.arange(12)[::-1], 0.9), start=THETA, noise={"x": 0.05, "y": 0.05})
    for name, check in first.residual_checks.items():
        assert check.p_value == pytest.approx(other.residual_checks[name].p_value, rel=1e-6)
    assert dict(first.robust_standard_errors) == pytest.approx(dict(other.robust_standard_errors), rel=1e-6)


def test_units_do_not_count() -> None:
    s, v = np.arange(60.0), markov(np.random.default_rng(4), 60, 0.9)
    fits = []
    for unit in (1.0, 1e-7):
        record = fp.Record(s, s, unit * (1 + 2 * s + v))
        with expects_white():
            fits.append(fp.estimate(LINE, record, start={"p": unit, "q": 2 * unit}))
    assert fits[0].robust_ratios["q"] == pytest.approx(fits[1].robust_ratios["q"], rel=1e-6)
    assert fits[0].residual_checks["y"].p_value == pytest.approx(fits[1].residual_checks["y"].p_value, rel=1e-6)


@pytest.mark.parametrize("y", [[1.0], [1.0, 3.0], [1.0, 3.0, 5.0], [0.0, 0.0, 0.0]])
def test_few_numbers_have_nothing_to_judge(y: list[float]) -> None:
    s = np.arange(float(len(y)))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fit = fp.estimate(LINE, fp.Record(s, s, y), start={"p": 1.0, "q": 2.0}, noise={"y": 0.1})
    assert all(check.white and check.p_value is None for check in fit.residual_checks.values())
    assert "Are the residuals white?" not in str(fit)
    assert np.isinf(list(fit.robust_standard_errors.values())).all() == (len(y) < 3)


def test_alternating_residuals_are_said() -> None:
    s = np.arange(60.0)
    with expects_white():
        fit = fp.estimate(LINE, fp.Record(s, s, 1 + 2 * s + 0.1 * (-1) ** s), start={"p": 1.0, "q": 2.0})
    assert fit.report().warnings[0].startswith("y: the residuals are not white, with a correlation of -0.98")
    assert "hardly too small" in fit.report().warnings[1]


def test_an_unknown_that_nothing_determines_has_no_robust_error() -> None:
    s = np.ones(30)
    fit = fp.estimate(LINE, of_line(s, 3 + 0.1 * np.random.default_rng(5).standard_normal(30)), start={"p": 1.0, "q": 2.0})
    assert list(fit.robust_standard_errors.values()) == [np.inf, np.inf]
    assert not fit.robust_ratios
    with expects_white():
        held = fp.estimate(LINE, record_of_line(), start={"p": 1.0, "q": 2.5}, bounds={"q": (2.5, None)}, noise={"y": 30.0})
    assert held.at_bounds == ("q",)
    assert held.robust_standard_errors["q"] == np.inf and np.isfinite(held.robust_standard_errors["p"])


def record_of_line() -> fp.Record:
    s = np.linspace(0, 1, 50)
    return fp.Record(s, s, 1 + 2 * s + 0.1 * np.random.default_rng(6).standard_normal(50))
