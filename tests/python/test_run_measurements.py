"""Measurements of runs: arrays, files and virtual rigs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import fisherpoint as fp
from run_cases import NOISE, THETA, drawn, filled, tanks, with_gaps

RUNS = fp.Runs([[1.0, 1.0], [1.2, 0.9]], [[0.5, 1.5, 1.0]] * 2, [[0.2, 0.3, 0.4], [0.2, 0.3, 0.0]], [True, False, True])
HEADER = "run,segment,a,b,u,dt,measured,y_y,y_z\n"
WHOLE = "1,1,1,1,0.5,0.2,1,1.1,0.9\n1,2,,,1.5,0.3,0,,\n1,3,,,1.0,0.4,1,1.2,\n"


def rig(**changes: object) -> fp.VirtualRig:
    return fp.VirtualRig(tanks(), THETA, NOISE, **changes)  # type: ignore[arg-type]


# --- arrays --------------------------------------------------------------------------------------------------------------


def test_numbers_stand_at_measured_segments_alone() -> None:
    y = filled(RUNS, np.ones((2, 3, 2)))
    data = fp.Measurements(RUNS, y)
    assert len(data) == 2 and data.samples.shape == (3, 2) and repr(data).startswith("Measurements(2 runs, 3 samples, 2 outputs, 6")
    assert fp.Measurements(RUNS, y[:, :, 0]).y.shape == (2, 3, 1)
    assert data[1].points == RUNS[1] and np.array_equal(data[1].y, y[1:], equal_nan=True)
    y[0, 1, 1] = 0.7
    with pytest.raises(ValueError, match=r"^y: expected NaN where runs are not measured, given 0.7 in segment 1 of runs\[0\]$"):
        fp.Measurements(RUNS, y)


@pytest.mark.parametrize(
    ("y", "said"),
    [
        (np.ones((2, 2)), r"y: expected shape \(2, 3, n_y\), given \(2, 2\)"),
        (np.ones((3, 2, 1)), r"y: expected shape \(2, 3, n_y\), given \(3, 2, 1\)"),
        (np.full((2, 3), np.nan), "at least one measured number, given none"),
        (filled(RUNS, np.full((2, 3, 1), np.inf)), r"given inf at \(0, 0, 0\)"),
    ],
)
def test_wrong_outputs_are_refused(y: np.ndarray, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        fp.Measurements(RUNS, y)


def test_parts_of_different_lengths_are_joined() -> None:
    short, long = (rig(seed=seed).measure(drawn(2, segments, seed)) for seed, segments in ((1, 4), (2, 7)))
    joined = fp.Measurements.join([short, long])
    assert joined.points == fp.Runs.join([short.points, long.points])  # type: ignore[list-item]
    assert np.array_equal(joined.samples, np.concatenate([short.samples, long.samples]), equal_nan=True)
    assert joined[2:] == long and joined != long
    points = rig().measure(drawn().starts)
    both = fp.Measurements.join([short, points])  # a point is a run of one segment
    assert both.points == fp.Runs.join([short.points, points.runs])  # type: ignore[list-item]
    assert np.array_equal(both.samples, np.concatenate([short.samples, points.y]), equal_nan=True)


def test_what_has_no_number_is_left_out() -> None:
    runs = drawn(3, 5, share=1.0)
    y = np.ones((3, 5, 2))
    y[0, 3:], y[1] = np.nan, np.nan
    y[2, 1, 0], y[2, 2] = np.nan, np.nan
    told = fp.Measurements(runs, y).measured_part
    assert isinstance(told.points, fp.Runs)
    assert told.points.segments.tolist() == [3, 5] and told.points.measured.sum(axis=1).tolist() == [3, 4]
    assert np.array_equal(told.points.dt[0, :3], runs.dt[0, :3]) and np.array_equal(told.points.x0, runs.x0[[0, 2]])
    assert len(told.samples) == 7 and told.measured_part is told


# --- files ---------------------------------------------------------------------------------------------------------------


def read(tmp_path: Path, text: str, model: fp.Model | None = None) -> fp.Measurements:
    (tmp_path / "data.csv").write_text(text)
    return fp.Measurements.from_table(tmp_path / "data.csv", model or tanks())


def test_files_keep_every_digit(tmp_path: Path) -> None:
    data = fp.Measurements.join([with_gaps(rig(seed=3).measure(drawn())), rig(seed=4).measure(drawn(1, 3))])
    data.to_csv(tmp_path / "data.csv", tanks())
    assert fp.Measurements.from_table(tmp_path / "data.csv", tanks()) == data
    assert (tmp_path / "data.csv").read_text().startswith(HEADER.replace("\n", "\r\n")[:-2])


def test_a_file_may_have_units_and_notes_and_miss_outputs(tmp_path: Path) -> None:
    text = "run;segment;a [mm];b [mm];u;dt [ms];measured;y_z [mm];comment\n1;1;1000;900;0,5;200;1;950,5;first\n1;2;;;1;300;0;;1,5\n"
    data = read(tmp_path, text)
    assert data.points == fp.Runs([[1.0, 0.9]], [[0.5, 1.0]], [[0.2, 0.3]], [[True, False]])
    assert np.array_equal(data.y, [[[np.nan, 0.9505], [np.nan, np.nan]]], equal_nan=True)


def test_run_alone_is_a_note_of_points_and_may_be_a_state(tmp_path: Path) -> None:
    points = read(tmp_path, "run,a,b,u,dt,y_y\n7,1,1,0.5,0.2,1.1\n")
    assert points.points == fp.Experiments([[1.0, 1.0]], [[0.5]], [0.2])
    names = {"states": {"run": "1", "b": "1"}, "inputs": {"segment": "1"}}
    model = fp.SymbolicModel(["segment - k*run", "run - b"], ["b"], outputs={"y": "1"}, parameters={"k": "1"}, **names)
    data = read(tmp_path, "run,b,segment,dt,y_y\n1,1,0.5,0.2,1.1\n2,1,0.5,0.2,1.1\n", model)
    assert data.points == fp.Experiments([[1.0, 1.0], [2.0, 1.0]], [[0.5], [0.5]], [0.2, 0.2])
    runs = fp.Runs([[1.0, 1.0]], [[0.5, 0.6]], 0.2)
    with pytest.raises(ValueError, match=r"^columns: expected names that differ from run, segment, dt, measured, y_y; given run"):
        fp.Measurements(runs, np.ones((1, 2, 1))).to_csv(tmp_path / "data.csv", model)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (HEADER + WHOLE.replace("0.3,0,,", "0.3,0,1.1,"), "row 2, column y_y: expected no number where measured is 0, given '1.1'"),
        (HEADER + WHOLE.replace("1,3,,,", "1,4,,,"), "row 3, column segment: expected the segments of a run in order"),
        (HEADER + "1,1,1,1,0.5,0.2,1,1.1\n", "row 1: expected 9 entries, given 8"),
        (HEADER + WHOLE.replace("1.1", "?"), "row 1, column y_y: expected a number, given '?'"),
        (HEADER + "1,1,1,1,0.5,0.2,1,,\n", "expected at least one measured output, given none in y_y, y_z"),
        (
            HEADER.replace(",measured", "") + "1,1,1,1,0.5,0.2,1.1,0.9\n",
            "expected the columns run, segment, a, b, u, dt, measured",
        ),
        ("run,segment,a,b,u,dt,measured\n1,1,1,1,0.5,0.2,1\n", "expected of the columns y_y, y_z those that were measured"),
        (HEADER.replace("y_y", "y_x") + WHOLE, "expected the columns run, segment, a, b, u, dt, measured; given"),
        (HEADER + "1,1,1,1,0.5,0.2,1,1.1,0.9\n2,1,1,1,0.5,0.2,0,,\n", r"data.csv: runs: expected at least one measured segment"),
        (HEADER + "1,1,1,1,0.5,0.2,1,1,1\n2,1,-1,1,0.5,0.2,1,1,1\n", r"row 2, column a: expected a start with a > 0 .*a = -1 m"),
    ],
)
def test_what_is_wrong_is_told_with_row_and_column(text: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=said) as caught:
        read(tmp_path, text)
    assert "\n" not in str(caught.value)


def test_a_file_without_a_line_break_at_its_end_is_warned_of(tmp_path: Path) -> None:
    with pytest.warns(UserWarning, match=r"data\.csv: row 3: expected a line break at the end of the file, given '' there"):
        assert read(tmp_path, HEADER + WHOLE[:-1]) == read(tmp_path, HEADER + WHOLE)


def test_numbers_beyond_physics_are_refused(tmp_path: Path) -> None:
    rows = [f"{k},{n},{'1,1' if n == 1 else ','},0.5,0.2,1,{1 + 0.01 * k + n:.2f},1\n" for k in (1, 2, 3) for n in (1, 2)]
    assert len(read(tmp_path, HEADER + "".join(rows))) == 3
    for wrong, said in (
        ("3030.0", "row 6, column y_y: expected about 3.0., as in row"),
        ("1e6", "row 6, column y_y: expected at most"),
    ):
        changed = [*rows[:-1], rows[-1].replace("3.03", wrong)]
        with pytest.raises(ValueError, match=said):
            read(tmp_path, HEADER + "".join(changed))


# --- the virtual rig -----------------------------------------------------------------------------------------------------


def test_the_same_seed_gives_the_same_bits_and_a_run_of_one_segment_is_a_point() -> None:
    runs = drawn()
    one, again, other = (rig(seed=seed, initial_state_std={"a": 0.01}).measure(runs, repeats=2) for seed in (1, 1, 2))
    assert one == again and one != other and len(one) == 6
    assert np.array_equal(np.isnan(one.y[..., 0]), ~one.points.measured)  # type: ignore[union-attr]
    points = runs.starts
    of_points, of_runs = (rig(seed=1, initial_state_std={"a": 0.01}).measure(k) for k in (points, fp.Runs.of_points(points)))
    assert np.array_equal(of_points.y, of_runs.y[:, 0])


def test_the_start_deviates_once_and_every_sample_has_noise() -> None:
    model = fp.SymbolicModel(["0*x"], ["x"], states={"x": ("m", 1.0)}, inputs={}, outputs={"y": "m"}, parameters={"k": "1"})
    runs = fp.Runs(np.ones((2000, 1)), np.zeros((2000, 4, 0)), 0.1)
    y = fp.VirtualRig(model, [1.0], {"y": 0.1}, initial_state_std={"x": 0.3}, seed=1).measure(runs).y[:, :, 0] - 1
    covariance = np.cov(y.T)
    assert np.allclose(covariance, 0.09 + 0.01 * np.eye(4), rtol=0, atol=0.01)  # three standard errors


def test_a_run_that_fails_is_measured_up_to_there() -> None:
    runs = fp.Runs([[1.0, 1.0], [1.0, 1.0], [1.0, 1.0]], [[1.0] * 4, [1.0, 1.0, -9.0, 1.0], [-9.0, 1.0, 1.0, 1.0]], 0.4)
    one = rig(seed=1)
    with pytest.warns(RuntimeWarning, match="2 of 3 runs are not measured to their ends: 2 left_domain"):
        data = one.measure(runs)
    assert np.isfinite(data.y).all(axis=2).tolist() == [[True] * 4, [True, True, False, False], [False] * 4]
    assert dict(one.failures) == {"left_domain": 2}
    with pytest.raises(ValueError, match="expected at least one whose trajectory reaches a sample, given none: 1 left_domain"):
        one.measure(runs[2])


@pytest.mark.parametrize("wrong", [lambda: rig().measure([1.0]), lambda: rig().measure(fp.Runs([[1.0]], [[1.0]], 0.1))])
def test_what_does_not_fit_is_refused(wrong: Callable[[], object]) -> None:
    with pytest.raises((TypeError, ValueError), match="expected"):
        wrong()
