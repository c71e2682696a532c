"""The time axis of pictures of runs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import fisherpoint as fp
from fisherpoint.show.time_axes import SHARES, RunTime, duration, is_crowded, shares_of


def test_segments_of_decades_are_equally_wide() -> None:
    time = RunTime(np.array([700.0, 0.1, 5.0]))
    assert time.by_segment
    assert time(np.array([0.0, 350.0, 700.0, 700.05, 705.1])) == pytest.approx([0.0, 0.5, 1.0, 1.5, 3.0])
    at = time.within(np.array(SHARES))
    assert len(at) == 3 * len(SHARES) and (np.diff(at) > 0).all() and at[-1] == 3.0


def test_other_runs_have_an_ordinary_axis() -> None:
    time = RunTime(np.array([60.0, 120.0, 30.0]))
    assert not time.by_segment and time.unit == "min"
    assert time(np.array([0.0, 90.0, 210.0])) == pytest.approx([0.0, 1.5, 3.5])
    assert time.within(np.array([0.5, 1.0])) == pytest.approx([0.5, 1.0, 2.0, 3.0, 3.25, 3.5])


@pytest.mark.parametrize("segments", [99, 100, 101])
def test_segments_of_one_duration_have_an_ordinary_axis(segments: int) -> None:
    """A hundred of 20 ms are each a hundredth of their run, or, by rounding, less."""
    time = RunTime(np.full(segments, 0.02))
    assert not time.by_segment and time.width == 0.0
    assert time(np.array([1.0])) == pytest.approx([1.0 * time.factor])


def test_a_single_segment_that_is_fast_at_first_has_a_logarithmic_axis() -> None:
    shares = np.array(shares_of(1))
    fast, slow = (1 - np.exp(-8000.0 * shares[:, None] / tau) for tau in (1.0, 3000.0))
    time = RunTime(np.array([8000.0]), fast)
    assert time.is_log and 1e-3 < time.first < 0.1
    assert time(np.array([0.0, 1.0, 8000.0])) == pytest.approx([time.first, 1.0, 8000.0])
    assert time.within(shares)[-1] == 8000.0 and time.within(shares).min() == time.first
    assert not RunTime(np.array([8000.0]), slow).is_log and not RunTime(np.array([8000.0])).is_log


def test_only_records_that_are_denser_at_first_have_a_logarithmic_axis() -> None:
    assert is_crowded(np.append(0.0, np.geomspace(0.1, 8000.0, 30)))
    assert not is_crowded(np.linspace(0.0, 8000.0, 10_000))
    gap = np.append(np.linspace(0.0, 1.0, 50), 2.0)
    assert not is_crowded(gap)
    assert not is_crowded(8000.0 - np.append(0.0, np.geomspace(0.1, 8000.0, 30))[::-1])  # denser at the end


@pytest.mark.parametrize(
    ("seconds", "text"), [(740.56, "12.3 min"), (0.0741, "74.1 ms"), (7.644, "7.64 s"), (90000.0, "1.04 d"), (2e-7, "0.2 µs")]
)
def test_durations_are_in_units_that_are_easy_to_read(seconds: float, text: str) -> None:
    assert duration(seconds) == text


def two_time_constants() -> tuple[fp.DesignProblem, fp.Runs]:
    model = fp.SymbolicModel(
        ["(u - a)/T", "(u - b)/tau"], ["a + b"], {"a": "1", "b": "1"}, {"u": "1"}, {"T": "s", "tau": "s"}, {"y": "1"}
    )
    prior = fp.GaussianPrior({"T": 1000.0, "tau": 1.0}, relative_std={"T": 0.2, "tau": 0.2})
    runs = fp.Runs([[0.0, 0.0]] * 2, [[1.0, 0.0, 1.0], [1.0, -1.0, 0.0]], [[1000.0, 0.5, 2.0], [800.0, 1.0, 1.0]])
    return fp.DesignProblem(model, prior, None, noise={"y": 0.01}), runs


def test_short_segments_are_seen_beside_long_ones() -> None:
    from fisherpoint.design.runs.run_pictures import plot_runs

    problem, runs = two_time_constants()
    above, below = columns(plot_runs(problem, runs))[0]
    assert [label.get_text() for label in below.get_xticklabels(minor=True)] == ["16.7 min", "500 ms", "2 s"]
    samples = below.lines[-1]
    assert samples.get_xdata() == pytest.approx([1.0, 2.0, 3.0])
    assert samples.get_ydata() == pytest.approx(fp.simulate(problem.model, runs, problem.theta).y[0, :, 0])
    assert above.lines[0].get_xdata() == pytest.approx([0.0, 1.0, 2.0, 3.0])


def test_a_fit_shows_its_trajectory_between_samples(tmp_path: Path) -> None:
    problem, runs = two_time_constants()
    runs = fp.Runs(runs.x0, runs.u, runs.dt, [False, False, True])
    rig = fp.VirtualRig(problem.model, problem.prior.mean, problem.noise, seed=1)
    fit = fp.estimate(problem.model, rig.measure(runs), problem.prior, noise={"y": 0.01})
    for column, run in zip(columns(fit.plot("time", path=tmp_path / "time.png")), runs, strict=True):
        simulated, measured = column[0].lines
        fine = fp.simulate(problem.model, run.divided(SHARES), fit.theta, rtol=1e-9)
        assert simulated.get_ydata() == pytest.approx(fine.y[0, :, 0], abs=1e-5)
        assert len(simulated.get_xdata()) == 3 * len(SHARES)
        assert measured.get_xdata() == pytest.approx([3.0])


def columns(figure: Figure) -> list[list]:  # type: ignore[type-arg]
    """The panels of a picture, column after column."""
    columns = figure.axes[0].get_gridspec().ncols
    return [figure.axes[k::columns] for k in range(columns)]
