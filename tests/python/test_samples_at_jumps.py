"""A sample in the instant of a jump that its outputs feel has no derivative; the others of its run, and its fit, have theirs."""

from __future__ import annotations

import numpy as np
import pytest

import fisherpoint as fp
from several_cases import infusions

pytestmark = [pytest.mark.kernels, pytest.mark.filterwarnings("ignore:.* expected its natural size")]

NAMES = ("T1", "s2", "T2", "R1", "R2", "k")
TRUTH = {"T1": 2.0, "s2": 2.0, "T2": 1.0, "R1": 0.5, "R2": 1.0, "k": 0.3}


def model() -> fp.SymbolicModel:
    return fp.SymbolicModel(
        ["1", "where(clock < T1, R1, 0) + where((clock >= s2) and (clock < s2 + T2), R2, 0) - k*c"],
        ["c"],
        {"clock": "s", "c": "1"},
        {},
        dict.fromkeys(NAMES, "1"),
        check_units=False,
        nominal=TRUTH,
    )


def right(t: float) -> tuple[float, np.ndarray]:
    theta, step = np.array([*TRUTH.values()]), 1e-6
    slopes = [(infusions(*(theta + step * e), t) - infusions(*(theta - step * e), t)) / (2 * step) for e in np.eye(6)]
    return infusions(*theta, t), np.array(slopes)


@pytest.mark.parametrize("dt", [0.1, 0.2, 0.25, 0.5])
def test_samples_of_a_run(dt: float) -> None:
    """Two infusions meet at 2 s, the second ends at 3 s; both are instants of samples."""
    n = round(5 / dt)
    runs = fp.Runs([[0.0, 0.0]], np.empty((1, n, 0)), dt, [[True] * n])
    done = fp.sensitivities(model(), runs, TRUTH)
    assert done.status[0] == fp.Status.ok and done.reached[0] == n
    for k in range(n):
        t = (k + 1) * dt
        y, slopes = right(t)
        assert done.y[0, k, 0] == pytest.approx(y, abs=1e-6)
        if min(abs(t - 2), abs(t - 3)) < 1e-9:
            assert not done.dy_dtheta[0, k].any()
        else:
            np.testing.assert_allclose(done.dy_dtheta[0, k, 0], slopes, rtol=2e-5, atol=1e-6)


FOUND = [name for name in NAMES if name != "s2"]
"""What one run determines: with s2, two of the times act in the same way."""


def test_a_design_of_such_runs_is_evaluated() -> None:
    """It is worth as much as without these samples."""
    prior = fp.GaussianPrior({name: TRUTH[name] for name in FOUND}, relative_std=dict.fromkeys(FOUND, 0.2))
    problem = fp.DesignProblem(model().fix(s2=2.0), prior, None, noise={"y": 0.01})
    n = 25
    every = fp.Runs([[0.0, 0.0]], np.empty((1, n, 0)), 0.2, [[True] * n])
    without = fp.Runs([[0.0, 0.0]], np.empty((1, n, 0)), 0.2, [[k not in (9, 14) for k in range(n)]])
    errors = [fp.evaluate(problem, runs).standard_errors for runs in (every, without)]
    for name in FOUND:
        assert errors[0][name] == pytest.approx(errors[1][name], rel=1e-6)


@pytest.mark.parametrize("kind", ["points", "record"])
def test_a_fit_may_start_there(kind: str) -> None:
    """Samples at 2 s and 3 s, where the infusions are said to meet and to end at the start of the search."""
    times = np.arange(1, 26) * 0.2
    truth = TRUTH | {"T1": 1.93, "T2": 1.05}
    y = np.array([infusions(*truth.values(), t) for t in times])
    data: fp.Measurements | fp.Record = fp.Measurements(fp.Experiments(np.zeros((25, 2)), np.empty((25, 0)), times), y[:, None])
    if kind == "record":
        t = np.append(0.0, times)
        data = fp.Record(t, np.empty((26, 0)), np.append(0.0, y)[:, None], x0={"clock": 0.0, "c": 0.0})
    start = {name: TRUTH[name] for name in FOUND}
    fit = fp.estimate(model().fix(s2=2.0), data, start=start, noise={"y": 0.01})
    for name in FOUND:
        assert fit.estimate[name] == pytest.approx(truth[name], rel=1e-4), name


@pytest.mark.parametrize("before", [3, 10, 30])
@pytest.mark.parametrize("dt", [0.1, 0.25, 0.5])
@pytest.mark.parametrize("r", [1.0, 2.0, 3.0])
def test_a_sample_of_a_record_at_a_jump_that_it_feels_adds_no_information(before: int, dt: float, r: float) -> None:
    """The counter starts in the instant of a sample, whichever side rounding puts that on: dy/dr jumps from 0 to x0/r^2 there."""
    model = fp.SymbolicModel(
        ["-r", "where(level <= 0, b, 0)"], ["n"], {"level": "1", "n": "1"}, {}, {"r": "1/s", "b": "1/s"}, {"y": "1"}
    )
    start, t = r * before * dt, dt * np.arange(2 * before + 1)
    y = np.maximum(t - before * dt, 0.0)
    record = fp.Record(t, np.empty((len(t), 0)), y[:, None], x0={"level": start, "n": 0.0})
    fit = fp.estimate(model, record, start={"r": r, "b": 1.0}, noise={"y": 0.01})
    behind = np.arange(len(t)) > before
    slopes = np.column_stack([behind * start / r**2, y]) / 0.01
    expected = np.sqrt(np.diag(np.linalg.inv(slopes.T @ slopes)))
    np.testing.assert_allclose([fit.standard_errors[name] for name in ("r", "b")], expected, rtol=1e-5)


def test_a_point_in_the_instant_of_a_jump_counts_no_information() -> None:
    """A design of points is evaluated, and validated, as without it; a warning names it."""
    infusion = fp.SymbolicModel(
        ["where(t < t_end, r, 0) - k*c"], ["c"], {"c": "1"}, {}, {"r": "1/s", "k": "1/s", "t_end": "s"}, {"y": "1"}
    )
    prior = fp.GaussianPrior({"r": 1.2, "k": 0.3, "t_end": 2.0}, relative_std={"r": 0.1, "k": 0.1, "t_end": 0.05})
    region = fp.ExperimentRegion({"c": (0.0, 1.0), "dt": (0.1, 6.0)})
    problem = fp.DesignProblem(infusion, prior, region, noise={"y": 0.01})
    points = fp.Experiments(np.zeros((8, 1)), np.empty((8, 0)), [0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 6.0])
    with pytest.warns(UserWarning, match=r"points\[3\] in the instant"):
        whole = fp.evaluate(problem, points, output_covariance="noise")
    others = fp.evaluate(problem, points[[0, 1, 2, 4, 5, 6, 7]], output_covariance="noise")
    assert whole.log_det == pytest.approx(others.log_det + 3 * np.log(7 / 8), rel=1e-12)  # F is the mean over the points
    with pytest.warns(UserWarning, match="in the instant"):
        validated = fp.validate(problem, {"design": points}, runs=20)
    assert validated.designs["design"].failed == 0


def test_a_point_that_starts_on_a_jump_that_nothing_decides_is_refused() -> None:
    runaway = fp.SymbolicModel(["a*sign(x)"], ["x"], {"x": "1"}, {}, {"a": "1/s"}, {"y": "1"})
    prior = fp.GaussianPrior({"a": 1.0}, relative_std={"a": 0.1})
    problem = fp.DesignProblem(runaway, prior, fp.ExperimentRegion({"x": (-1.0, 1.0), "dt": (0.1, 1.0)}), noise={"y": 0.01})
    with pytest.raises(ValueError, match=r"points\[1\] \(on_jump"):
        fp.evaluate(problem, fp.Experiments([[0.5], [0.0]], np.empty((2, 0)), [1.0, 1.0]), output_covariance="noise")
