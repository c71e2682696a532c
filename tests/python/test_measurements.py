"""Measured outputs of points: shapes, what is refused, rows and parts, and files that bring all of it back."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import fisherpoint as fp
from conftest import random_points
from defaults import MODEL, same_bits

POINTS = random_points(np.random.default_rng(0), 4)
Y = np.array([[0.1, 5e6, np.nan, 0.2], [np.nan] * 4, [0.2, np.nan, 6e6, -0.1], [0.3, 7e6, 8e6, 0.3]])


def test_they_hold_points_and_outputs() -> None:
    data = fp.Measurements(POINTS, Y)
    assert len(data) == 4 and data.points is POINTS and same_bits(data.y, Y)
    assert repr(data) == "Measurements(4 points, 4 outputs, 10 of 16 numbers)"
    with pytest.raises(ValueError, match="read-only"):
        data.y[0, 0] = 1.0
    Y_changed = Y.copy()
    kept = fp.Measurements(POINTS, Y_changed)
    Y_changed[0, 0] = 9.0
    assert kept.y[0, 0] == 0.1


def test_one_output_may_be_a_row_of_numbers() -> None:
    assert fp.Measurements(POINTS, [1.0, np.nan, 2.0, 3.0]).y.shape == (4, 1)


@pytest.mark.parametrize(
    ("y", "message"),
    [
        (Y[:3], r"y: expected shape \(4, n_y\), given \(3, 4\)"),
        (np.zeros((4, 2, 2)), r"y: expected shape \(4, n_y\)"),
        (1.0, r"y: expected shape \(4, n_y\), given \(\)"),
        ([["a"]] * 4, "y: expected numbers, given"),
        (np.full((4, 2), 1j), "y: expected numbers, given"),
        (
            np.where(np.isnan(Y), -np.inf, Y),
            r"y: expected finite numbers, or NaN for what was not measured; given -inf at \(0, 2\)",
        ),
        (np.full((4, 4), np.nan), "y: expected at least one measured number, given none"),
        (np.empty((4, 0)), "y: expected at least one measured number, given none"),
    ],
)
def test_what_are_no_outputs_of_the_points_is_refused(y: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        fp.Measurements(POINTS, y)  # type: ignore[arg-type]


def test_points_must_be_experiments() -> None:
    with pytest.raises(TypeError, match="points: expected Experiments or Runs, given list"):
        fp.Measurements([1, 2], [1.0, 2.0])  # type: ignore[arg-type, arg-type]


def test_rows_are_chosen_as_points_are() -> None:
    data = fp.Measurements(POINTS, Y)
    for rows in (2, -1, slice(1, None, 2), [3, 0, 3], np.array([True, False, True, True])):
        part = data[rows]
        assert part.points == POINTS[rows]
        assert same_bits(part.y, np.atleast_2d(Y[rows]))
    with pytest.raises(IndexError, match="given 4"):
        data[4]
    with pytest.raises(ValueError, match="at least one measured number"):
        data[1]


def test_parts_are_joined_in_order() -> None:
    data = fp.Measurements(POINTS, Y)
    assert fp.Measurements.join([data[:2], data[2:]]) == data
    assert len(fp.Measurements.join([data, data, data])) == 12
    with pytest.raises(ValueError, match="parts: expected at least one"):
        fp.Measurements.join([])
    with pytest.raises(ValueError, match=r"parts: expected \(5, 1, 4\) states, inputs and outputs in each, given \(5, 1, 2\)"):
        fp.Measurements.join([data, fp.Measurements(POINTS, Y[:, :2])])


def test_they_are_equal_where_all_numbers_are() -> None:
    data, other = fp.Measurements(POINTS, Y), Y.copy()
    other[0, 0] += 1e-16
    assert data == fp.Measurements(POINTS, Y.copy())
    assert data != fp.Measurements(POINTS, other)
    assert data != fp.Measurements(POINTS[[1, 0, 2, 3]], Y)
    assert data != "data"
    with pytest.raises(TypeError, match="unhashable"):
        hash(data)


# --- Files --------------------------------------------------------------------------------------------------------------


def test_they_come_back_from_a_file_to_the_last_bit(tmp_path: Path) -> None:
    points = random_points(np.random.default_rng(1), 300)
    done = fp.simulate(MODEL, points, MODEL.nominal)
    data = fp.Measurements(points, np.where(done.status[:, None] == 0, done.y, np.nan))
    assert 50 < np.isnan(data.y[:, 0]).sum() < 250
    data.to_csv(tmp_path / "data.csv", MODEL)
    back = fp.Measurements.from_table(tmp_path / "data.csv", MODEL)
    assert same_bits(back.points.table, points.table) and np.array_equal(back.y, data.y, equal_nan=True)
    assert back.points.columns == ("q", "v", "p_A", "p_B", "x_v", "u")
    assert (tmp_path / "data.csv").read_text().startswith("q,v,p_A,p_B,x_v,u,dt,y_q,y_p_A,y_p_B,y_x_v\n")


PLAIN = fp.SymbolicModel(
    ["-k*a + w", "k*a"],
    ["a", "a + b"],
    states={"a": "m", "b": "m"},
    inputs={"w": "m/s"},
    parameters={"k": "1/s"},
    outputs={"a": "m", "total": "m"},
    nominal={"k": 1.0},
)
"""Without a domain; its outputs have no natural sizes."""
FINITE = st.floats(allow_nan=False, allow_infinity=False)
SIZED = st.just(0.0) | st.just(-0.0) | st.just(np.nan) | st.floats(1.0, 999.0) | st.floats(-999.0, -1.0)
"""Outputs that no check of sizes refuses."""


@st.composite
def measurements(draw: st.DrawFn) -> fp.Measurements:
    """Points of any numbers, each of its own duration, with at least one measured output."""
    durations = draw(st.lists(st.floats(0, exclude_min=True, allow_infinity=False), min_size=1, max_size=6, unique=True))
    count = len(durations)
    rows = st.lists(st.tuples(FINITE, FINITE, FINITE, SIZED, SIZED), min_size=count, max_size=count)
    table = np.array(draw(rows))
    y = table[:, 3:]
    y[0, 0] = 1.0 if np.isnan(y).all() else y[0, 0]
    return fp.Measurements(fp.Experiments(table[:, :2], table[:, 2:3], durations), y)


@settings(deadline=None, max_examples=150)
@given(data=measurements())
def test_any_numbers_come_back_to_the_last_bit(tmp_path_factory: pytest.TempPathFactory, data: fp.Measurements) -> None:
    path = tmp_path_factory.getbasetemp() / "any.csv"
    data.to_csv(path, PLAIN)
    back = fp.Measurements.from_table(path, PLAIN)
    assert same_bits(back.points.table, data.points.table)
    measured = ~np.isnan(data.y)
    assert np.array_equal(np.isnan(back.y), ~measured) and same_bits(back.y[measured], data.y[measured])


def test_points_without_state_need_no_duration(tmp_path: Path) -> None:
    line = fp.SymbolicModel(None, ["k*w"], {}, {"w": "V"}, {"k": "1"}, outputs={"z": "V"}, nominal={"k": 1.0})
    data = fp.Measurements(fp.Experiments(np.empty((3, 0)), [1.0, 2.0, 1.0]), [1.0, 2.1, 1.1])
    data.to_csv(tmp_path / "data.csv", line)
    assert (tmp_path / "data.csv").read_text() == "w,y_z\n1.0,1.0\n2.0,2.1\n1.0,1.1\n"
    assert fp.Measurements.from_table(tmp_path / "data.csv", line) == data


def test_a_file_is_of_the_model(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"model: expected one of \(5, 1, 4\) states, inputs and outputs, given .* of \(2, 1, 2\)"):
        fp.Measurements(POINTS, Y).to_csv(tmp_path / "data.csv", PLAIN)
    assert not list(tmp_path.iterdir())


def test_a_write_that_fails_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    data = fp.Measurements(POINTS, Y)
    data.to_csv(tmp_path / "data.csv", MODEL)
    before = (tmp_path / "data.csv").read_bytes()

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(OSError, match=r"No space left.*data\.csv"):
        fp.Measurements.join([data, data]).to_csv(tmp_path / "data.csv", MODEL)
    assert (tmp_path / "data.csv").read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["data.csv"]


def test_a_link_stays_and_a_missing_directory_is_named(tmp_path: Path) -> None:
    data = fp.Measurements(POINTS, Y)
    data.to_csv(tmp_path / "data.csv", MODEL)
    (tmp_path / "link.csv").symlink_to("data.csv")
    data[[0, 3]].to_csv(tmp_path / "link.csv", MODEL)
    assert (tmp_path / "link.csv").is_symlink() and len(fp.Measurements.from_table(tmp_path / "data.csv", MODEL)) == 2
    with pytest.raises(FileNotFoundError, match=r"nowhere.data\.csv'$"):
        data.to_csv(tmp_path / "nowhere" / "data.csv", MODEL)


def test_a_pipe_is_written_to_and_stays(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    data = fp.Measurements(POINTS, Y)
    data.to_csv(tmp_path / "data.csv", MODEL)
    with ThreadPoolExecutor(1) as pool:
        read = pool.submit((tmp_path / "pipe").read_bytes)
        data.to_csv(tmp_path / "pipe", MODEL)
        assert read.result(10) == (tmp_path / "data.csv").read_bytes()
    assert (tmp_path / "pipe").is_fifo()


WRITER = """
import sys
import fisherpoint as fp
model = fp.HydraulicCylinder()
data = fp.Measurements.from_table(sys.argv[1], model)
while True:
    for part in (data, data[:100]):
        part.to_csv(sys.argv[2], model)
"""


def test_who_reads_while_it_is_written_or_after_a_kill_finds_a_whole_file(tmp_path: Path) -> None:
    points = random_points(np.random.default_rng(2), 3000)
    fp.Measurements(points, points.x0[:, [0, 2, 3, 4]]).to_csv(tmp_path / "source.csv", MODEL)
    written = tmp_path / "written.csv"
    writer = subprocess.Popen([sys.executable, "-c", WRITER, tmp_path / "source.csv", written])
    try:
        deadline = time.monotonic() + 60
        while not written.exists() and time.monotonic() < deadline:
            time.sleep(0.01)
        seen = {len(fp.Measurements.from_table(written, MODEL)) for _ in range(30)}
    finally:
        writer.kill()
        writer.wait()
    assert seen | {len(fp.Measurements.from_table(written, MODEL))} <= {100, 3000}
