"""Estimates from runs, against dense algebra, records and points; and measured runs as previous information."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from oracle import Floats
from run_cases import NOISE, THETA, drawn, filled, tanks, with_gaps

MODEL, STD = tanks(), np.array(list(NOISE.values()))
START, CONSTANT = {"a": 0.05, "b": 0.02}, {"c": 0.03}
PRIOR = fp.GaussianPrior(THETA, {"k1": 0.1, "k2": 0.1})


def measured(runs: fp.Runs, seed: int = 5, **changes: Any) -> fp.Measurements:
    return fp.VirtualRig(MODEL, THETA, NOISE, seed=seed, **changes).measure(runs)


def dense(data: fp.Measurements, theta: Floats, start: bool, constant: bool) -> tuple[list[Floats], list[Floats], list[Floats]]:
    """Of each run, the residuals, J and R_k of what was measured, by the sensitivities of a model that has all as parameters."""
    runs = data.points
    assert isinstance(runs, fp.Runs)
    done = fp.sensitivities(MODEL.estimate("c").free_start("a", "b"), runs, [*theta, 1.0, 0.0, 0.0], rtol=1e-11)
    p = np.array([CONSTANT["c"] * constant, *(np.array(list(START.values())) * start)])
    residuals, jacobians, covariances = [], [], []
    for k in range(len(runs)):
        there = np.isfinite(data.y[k])
        g = done.dy_dtheta[k][there][:, 2:] * p
        residuals.append((data.y[k] - done.y[k])[there])
        jacobians.append(done.dy_dtheta[k][there][:, :2])
        covariances.append(np.diag(np.tile(STD, (len(there), 1))[there] ** 2) + g @ g.T)
    return residuals, jacobians, covariances


@pytest.mark.parametrize(("start", "constant"), [(False, False), (True, False), (False, True), (True, True)])
def test_a_fit_is_that_of_dense_algebra(start: bool, constant: bool) -> None:
    data = with_gaps(measured(drawn(), initial_state_std=START if start else None))
    uncertain, initial = CONSTANT if constant else None, START if start else None
    fit = fp.estimate(MODEL, data, noise=NOISE, deviations=fp.Deviations(varies=uncertain, initial_state_std=initial), rtol=1e-11)
    assert fit.converged
    parts = list(zip(*dense(data, fit.values, start, constant), strict=True))
    information = sum(j.T @ np.linalg.solve(r_k, j) for _, j, r_k in parts)
    gradient = sum(j.T @ np.linalg.solve(r_k, r) for r, j, r_k in parts)
    squares = sum(float(r @ np.linalg.solve(r_k, r)) for r, _, r_k in parts)
    close = 1e-5 if start or constant else 1e-9  # the weights are those of the estimate before
    np.testing.assert_allclose(fit.covariance, np.linalg.inv(information), rtol=close)
    off = np.linalg.solve(information, gradient) / np.sqrt(np.diag(fit.covariance))
    assert np.abs(off).max() < 10 * close  # of a standard error
    assert fit.chi_square == pytest.approx(squares, rel=close)
    variances = np.concatenate([np.diag(r_k) for _, _, r_k in parts])
    told = fit.residuals[np.isfinite(fit.residuals)]
    np.testing.assert_allclose(fit.standardised[np.isfinite(fit.residuals)], told / np.sqrt(variances), rtol=close)
    assert fit.degrees_of_freedom == pytest.approx(len(told) - 2, abs=1e-6)


def test_an_error_of_each_sample_is_another_one() -> None:
    """What the samples of a run share does not average out."""
    data = measured(drawn(share=1.0))
    shared = fp.estimate(MODEL, data, noise=NOISE, deviations=fp.Deviations(initial_state_std=START))
    runs = data.points
    assert isinstance(runs, fp.Runs)
    _, jacobians, covariances = dense(data, shared.values, True, False)
    wrong = np.linalg.inv(
        sum(
            j.T @ np.linalg.solve(r_k * np.kron(np.eye(len(r_k) // 2), np.ones((2, 2))), j)
            for j, r_k in zip(jacobians, covariances, strict=True)
        )
    )
    ratio = np.sqrt(np.diag(wrong)) / list(shared.standard_errors.values())
    assert np.abs(ratio - 1).max() > 0.1


def as_record(data: fp.Measurements) -> fp.Record:
    runs = data.points
    assert isinstance(runs, fp.Runs) and len(runs) == 1
    t, u = np.concatenate([[0.0], runs.t[0]]), np.append(runs.u[0, :, 0], 0.0)
    return fp.Record(t, u, np.concatenate([[[np.nan, np.nan]], data.y[0]]), x0=dict(zip("ab", runs.x0[0].tolist(), strict=True)))


@pytest.mark.parametrize("noise", [None, NOISE])
@pytest.mark.parametrize("prior", [None, PRIOR])
def test_a_run_gives_the_figures_of_its_record(noise: dict[str, float] | None, prior: fp.GaussianPrior | None) -> None:
    data = with_gaps(measured(drawn(1, 40)))
    run, record = (fp.estimate(MODEL, one, prior, noise=noise) for one in (data, as_record(data)))
    errors = np.array(list(record.standard_errors.values()))
    assert np.abs((run.values - record.values) / errors).max() < 1e-6
    np.testing.assert_allclose(list(run.standard_errors.values()), errors, rtol=1e-6)
    assert run.chi_square == pytest.approx(record.chi_square, rel=1e-6)
    assert run.degrees_of_freedom == pytest.approx(record.degrees_of_freedom, rel=1e-6)
    np.testing.assert_allclose(run.noise_covariance, record.noise_covariance, rtol=1e-6, atol=1e-12)
    one, other = (fit.profile("k1").interval for fit in (run, record))
    assert np.abs(np.subtract(one, other)).max() < 1e-5 * errors[0]
    if prior is not None:
        np.testing.assert_allclose(run.posterior().covariance, record.posterior().covariance, rtol=1e-6)


def test_a_run_of_one_segment_is_a_point_to_the_last_bit() -> None:
    points = drawn(20).starts
    data = measured(fp.Runs.of_points(points))
    runs, of_points = (fp.estimate(MODEL, one, noise=NOISE) for one in (data, fp.Measurements(points, data.y[:, 0])))
    assert np.array_equal(runs.values, of_points.values) and np.array_equal(runs.covariance, of_points.covariance)


def test_runs_points_and_records_together() -> None:
    runs, points = with_gaps(measured(drawn())), fp.VirtualRig(MODEL, THETA, NOISE, seed=6).measure(drawn(9).starts)
    alone = measured(drawn(1, 20, seed=4), seed=7)
    fit = fp.estimate(MODEL, [points, runs, as_record(alone)], noise=NOISE)
    other = fp.estimate(MODEL, [fp.Measurements.join([runs, alone]), points], noise=NOISE)
    errors = np.array(list(fit.standard_errors.values()))
    assert np.abs((fit.values - other.values) / errors).max() < 1e-6
    np.testing.assert_allclose(errors, list(other.standard_errors.values()), rtol=1e-6)
    one, other = (
        fp.estimate(MODEL, given, noise=NOISE, deviations=fp.Deviations(initial_state_std=START))
        for given in ([points, runs], [runs, points])
    )
    np.testing.assert_allclose(one.covariance, other.covariance, rtol=1e-6)
    assert one.chi_square == pytest.approx(other.chi_square, rel=1e-6)


def test_runs_that_are_the_same_are_simulated_once_and_all_count() -> None:
    runs = drawn(2)
    data = measured(fp.Runs.join([runs, runs, runs]))
    fit = fp.estimate(MODEL, data, noise=NOISE, deviations=fp.Deviations(initial_state_std=START))
    order = [3, 0, 5, 2, 1, 4]
    other = fp.estimate(MODEL, data[order], noise=NOISE, deviations=fp.Deviations(initial_state_std=START))
    np.testing.assert_allclose(fit.values, other.values, rtol=1e-7)
    assert fit.chi_square == pytest.approx(other.chi_square, rel=1e-6)


def test_a_run_that_stopped_is_fitted_up_to_there() -> None:
    """Behind its last number the trajectory leaves the domain, which does not matter."""
    runs = fp.Runs([[1.0, 1.0]], [[1.0] * 10 + [-9.0] * 2], 0.3)
    with pytest.warns(RuntimeWarning, match="left_domain"):
        data = measured(runs)
    fit = fp.estimate(MODEL, data, noise=NOISE)
    assert fit.converged and len(fit.residuals) == 10


@pytest.mark.parametrize("noise", [None, NOISE])
def test_files_restore_a_fit(noise: dict[str, float] | None, tmp_path: Path) -> None:
    points = fp.VirtualRig(MODEL, THETA, NOISE, seed=6).measure(drawn(9).starts)
    given = {"noise": noise, "deviations": fp.Deviations(initial_state_std=START if noise else None)}
    fit = fp.estimate(MODEL, [with_gaps(measured(drawn())), points], **given)  # type: ignore[arg-type]
    fit.save(tmp_path)
    again = fp.Fit.load(tmp_path)
    assert again.data == fit.data and again.chi_square == fit.chi_square
    for name in ("values", "covariance", "residuals", "standardised", "whitened"):
        assert np.array_equal(getattr(again, name), getattr(fit, name), equal_nan=True)
    rows = [line.split(",") for line in (tmp_path / "residuals.csv").read_text().splitlines()]
    assert rows[0][:5] == ["data", "sample", "run", "segment", "output"]
    assert len(rows) - 1 == np.isfinite(fit.residuals).sum()
    runs = fit.data[0].points
    places = [tuple(place) for place in (np.argwhere(runs.measured) + 1).tolist()]
    for row in rows[1:]:
        assert (row[2:4] == ["", ""]) if row[0] == "2" else ((int(row[2]), int(row[3])) == places[int(row[1]) - 1])


def test_pictures_and_reports_know_runs() -> None:
    fit = fp.estimate(
        MODEL, measured(drawn(8), initial_state_std=START), noise=NOISE, deviations=fp.Deviations(initial_state_std=START)
    )
    figure = fit.plot("time")
    assert len(figure.axes) == 12 and "the first 6 of 8" in figure.get_suptitle()
    runs = fit.data[0].points
    line = figure.axes[1].lines[-1].get_xdata()
    assert np.array_equal(line, runs.t[1][runs.measured[1]])
    for kind in ("parity", "residuals", "correlation", "ellipses"):
        assert fit.plot(kind).axes
    text = str(fit)
    assert f"from {2 * runs.measured.sum()} numbers in {runs.measured.sum()} samples" in text and "with assumed" in text


def test_what_runs_cannot_have_is_refused() -> None:
    data = measured(drawn())
    with pytest.raises(ValueError, match=r"^rule: expected tangents, None, for runs, given"):
        fp.estimate(MODEL, data, noise=NOISE, deviations=fp.Deviations(initial_state_std=START, rule=fp.SparseGaussHermite(1)))
    with pytest.raises(ValueError, match=r"^y: expected shape \(K, N, 2\) for the outputs of"):
        fp.estimate(MODEL, fp.Measurements(data.points, data.y[:, :, :1]), noise=NOISE)


# --- previous information ------------------------------------------------------------------------------------------------


def problem(**changes: Any) -> fp.DesignProblem:
    return fp.DesignProblem(MODEL, PRIOR, None, noise=NOISE, rtol=1e-11, **changes)


@pytest.mark.parametrize("start", [None, START])
def test_an_output_that_was_not_measured_says_nothing(start: dict[str, float] | None) -> None:
    data, new = with_gaps(measured(drawn(4))), drawn(2, seed=9)
    evaluation = fp.evaluate(problem(initial_state_std=start), new, previous=data)
    y = filled(new, np.ones((*new.dt.shape, 2)))
    parts = [dense(one, MODEL.theta(THETA), start is not None, False) for one in (data, fp.Measurements(new, y))]
    information = sum(j.T @ np.linalg.solve(r_k, j) for _, js, rs in parts for j, r_k in zip(js, rs, strict=True))
    np.testing.assert_allclose(evaluation.information, information * 0.01, rtol=1e-7)


def test_what_a_run_has_behind_its_last_number_says_nothing() -> None:
    runs = drawn(2)
    data = measured(runs)
    y = data.y.copy()
    y[0, 6:] = np.nan
    u, dt = runs.u.copy(), runs.dt.copy()
    u[0, 6:], dt[0, 6:] = -9.0, 5.0  # where there is no trajectory
    cut = fp.Measurements(fp.Runs(runs.x0, u, dt, runs.measured), y)
    short = fp.Runs(runs.x0, runs.u, np.where(np.arange(12) < [[6], [12]], runs.dt, 0.0), runs.measured)
    one, other = (fp.evaluate(problem(), drawn(2, seed=9), previous=given) for given in (cut, short))
    np.testing.assert_allclose(one.information, other.information, rtol=1e-12)


def test_points_and_runs_count_together() -> None:
    """A point is a run of one segment, whichever of them is previous; also where the parameters are off."""
    given, runs, points = problem(initial_state_std=START, varies=CONSTANT), drawn(2), drawn(6, seed=9).starts
    of_points = with_gaps(fp.VirtualRig(MODEL, THETA, NOISE, seed=6).measure(points))
    of_runs = fp.Measurements(fp.Runs.of_points(points), of_points.y[:, None])
    one, other, swapped = (
        fp.evaluate(given, new, previous=old) for new, old in ((runs, of_points), (runs, of_runs), (points, runs))
    )
    np.testing.assert_allclose(one.information, other.information, rtol=1e-9)
    assert one.nearby is not None and other.nearby is not None and swapped.nearby is not None
    np.testing.assert_allclose(list(one.nearby.growth.values()), list(other.nearby.growth.values()), rtol=1e-9)
    whole = fp.evaluate(given, fp.Runs.join([runs, fp.Runs.of_points(points)]))
    assert whole.nearby is not None
    np.testing.assert_allclose(swapped.information, whole.information, rtol=1e-9)
    np.testing.assert_allclose(list(swapped.nearby.growth.values()), list(whole.nearby.growth.values()), rtol=1e-9)


def test_what_an_output_would_have_said_nearby_does_not_count() -> None:
    runs = drawn(3)
    y = filled(runs, np.ones((*runs.dt.shape, 2)))
    y[:, :, 1] = np.nan
    quiet = fp.DesignProblem(MODEL, PRIOR, None, noise=NOISE | {"z": 1e6}, initial_state_std=START, rtol=1e-11)
    alone = fp.evaluate(quiet, runs)
    silent = fp.evaluate(quiet, runs[:1], previous=fp.Measurements(runs[1:], y[1:]))
    assert alone.nearby is not None and silent.nearby is not None
    np.testing.assert_allclose(list(alone.nearby.growth.values()), list(silent.nearby.growth.values()), rtol=1e-6)


@pytest.mark.parametrize(
    "call",
    [
        lambda runs: fp.assumed_covariance(MODEL, runs, THETA, varies=CONSTANT),
        lambda runs: fp.predictive_covariance(MODEL, runs, PRIOR, fp.LinearizedRule()),
    ],
)
def test_covariances_of_points_are_not_of_runs(call: Any) -> None:
    with pytest.raises(TypeError, match=r"^points: expected Experiments, given Runs$"):
        call(drawn())
