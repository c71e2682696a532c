"""Files of measurements as rigs write them: what is read, and what is refused with row and column."""

from __future__ import annotations

import csv
import io
import time
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import fisherpoint as fp
from conftest import random_points
from defaults import MODEL, NOISE, same_bits, valid_points
from pages import blocks

HEADER = "q,v,p_A,p_B,x_v,u,dt,y_q,y_p_A,y_p_B,y_x_v"
ROWS = (
    "0.15,0.2,8e6,9e6,0.3,-0.3,1e-3,0.1502,8.1e6,8.9e6,0.29",
    "0.10,0.1,6e6,1e7,-0.2,0.4,2e-3,0.1001,6.2e6,9.9e6,-0.25",
    "0.20,-0.1,7e6,8e6,0.1,0.2,2e-3,0.1999,6.9e6,8.1e6,-0.02",
)
PLANNED = np.array([[0.15, 0.2, 8e6, 9e6, 0.3], [0.1, 0.1, 6e6, 1e7, -0.2], [0.2, -0.1, 7e6, 8e6, 0.1]])
MEASURED = np.array([[0.1502, 8.1e6, 8.9e6, 0.29], [0.1001, 6.2e6, 9.9e6, -0.25], [0.1999, 6.9e6, 8.1e6, -0.02]])
Read = Callable[[str], fp.Measurements]


@pytest.fixture
def read(tmp_path: Path) -> Read:
    """Measurements of the cylinder from a text."""

    def read(text: str) -> fp.Measurements:
        (tmp_path / "data.csv").write_bytes(text.encode())
        return fp.Measurements.from_table(tmp_path / "data.csv", MODEL)

    return read


def text(*rows: str, header: str = HEADER) -> str:
    return "\n".join((header, *(rows or ROWS))) + "\n"


def changed(row: int, **entries: str) -> str:
    """The file with other entries in one row, counted from 1, and further columns, empty elsewhere, where they are new."""
    table = [dict(zip(HEADER.split(","), line.split(","), strict=True)) for line in ROWS]
    table[row - 1] |= entries
    file = io.StringIO()
    writer = csv.DictWriter(file, list(dict.fromkeys([*HEADER.split(","), *entries])), restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(table)
    return file.getvalue()


# --- What is read -------------------------------------------------------------------------------------------------------


def test_the_designs_csv_with_measured_outputs(read: Read) -> None:
    data = read(text())
    assert same_bits(data.points.x0, PLANNED) and same_bits(data.y, MEASURED)
    assert data.points.u.tolist() == [[-0.3], [0.4], [0.2]] and data.points.dt.tolist() == [1e-3, 2e-3, 2e-3]


@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("mark", ["", "\ufeff"])
def test_spreadsheets_have_their_ways(read: Read, newline: str, mark: str) -> None:
    names = HEADER.split(",")
    lines = [", ".join(reversed(line.split(","))) for line in (HEADER, *ROWS)]
    quoted = ",".join(f'"{name}"' for name in reversed(names))
    assert read(mark + newline.join([quoted, lines[1], "", *lines[2:], "", ""])) == read(text())


def test_decimal_commas_between_semicolons(read: Read) -> None:
    german = text().replace(",", ";").replace(".", ",")
    assert read(german) == read(text())
    assert read(german.replace(";", "\t")) == read(text())
    assert read(text().replace(",", ";")) == read(text())  # semicolons alone


@pytest.mark.parametrize("missing", ["", "nan", "NaN", " "])
def test_what_was_not_measured_is_missing(read: Read, missing: str) -> None:
    data = read(changed(2, y_p_A=missing, y_x_v=missing))
    assert np.argwhere(np.isnan(data.y)).tolist() == [[1, 1], [1, 3]]
    assert np.array_equal(data.y[~np.isnan(data.y)], MEASURED[~np.isnan(data.y)])


def test_columns_of_outputs_may_be_missing(read: Read) -> None:
    names, rows = HEADER.split(",")[:8], [",".join(row.split(",")[:8]) for row in ROWS]
    data = read(text(*rows, header=",".join(names)))
    assert np.isnan(data.y[:, 1:]).all() and same_bits(np.ascontiguousarray(data.y[:, 0]), np.ascontiguousarray(MEASURED[:, 0]))


def test_replicates_stay_rows(read: Read) -> None:
    again = ROWS[0].replace("0.1502", "0.1503")
    data = read(text(ROWS[0], again, ROWS[0]))
    assert len(data) == 3 and data.points == data.points[[0, 0, 0]] and data.y[:, 0].tolist() == [0.1502, 0.1503, 0.1502]


def test_measured_starts_count_instead_of_planned_ones(read: Read) -> None:
    data = read(changed(2, x0_q="0.101", x0_p_B="1.01e7"))
    expected = PLANNED.copy()
    expected[1, [0, 3]] = 0.101, 1.01e7
    assert same_bits(data.points.x0, expected)
    assert read(changed(1, x0_v="nan")) == read(text())
    assert read(changed(1, x0_v="0.2", v="")) == read(text())


def test_a_measured_start_alone_serves(read: Read) -> None:
    assert read(text(header=HEADER.replace("q,", "x0_q,", 1))) == read(text())


def test_a_plain_name_serves_where_it_is_no_state(tmp_path: Path) -> None:
    tank = fp.SymbolicModel(
        ["-k*h"], ["c*h"], {"h": "m"}, {}, {"k": "1/s"}, {"level": "V"}, constants={"c": (2.0, "V/m")}, nominal={"k": 1.0}
    )
    (tmp_path / "data.csv").write_text("h,dt,level\n1,0.5,1.2\n")
    data = fp.Measurements.from_table(tmp_path / "data.csv", tank)
    assert data.y.tolist() == [[1.2]] and data.points.x0.tolist() == [[1.0]]
    (tmp_path / "data.csv").write_text("h,dt,level,y_level\n1,0.5,1.2,1.2\n")
    with pytest.raises(ValueError, match="expected one column of the output level, given y_level and level"):
        fp.Measurements.from_table(tmp_path / "data.csv", tank)


@pytest.mark.parametrize("brackets", ["[]", "()"])
def test_units_of_the_header_are_converted(read: Read, brackets: str) -> None:
    left, right = brackets
    units = {"q": "mm", "p_A": "bar", "p_B": "MPa", "dt": "ms", "y_q": "cm", "y_p_A": "kPa", "u": "-", "x_v": "%", "v": "mm/s"}
    factors = {"q": 1e3, "p_A": 1e-5, "p_B": 1e-6, "dt": 1e3, "y_q": 1e2, "y_p_A": 1e-3, "x_v": 1e2, "v": 1e3}
    names = HEADER.split(",")
    header = ",".join(f"{name} {left}{units[name]}{right}" if name in units else name for name in names)
    rows = [
        ",".join(repr(float(f"{float(e) * factors.get(n, 1):.12g}")) for n, e in zip(names, row.split(","), strict=True))
        for row in ROWS
    ]
    data, plain = read(text(*rows, header=header)), read(text())
    assert "150.0,200.0,80.0,9.0,30.0,-0.3,1.0,15.02,8100.0" in rows[0]
    assert same_bits(data.points.table, plain.points.table)  # decimal factors round once
    assert same_bits(data.y, plain.y)


def test_bookkeeping_is_not_read(read: Read) -> None:
    assert read(changed(2, comment='"1,5", a_b', time="12:30", operator="M. N.")) == read(text())


def test_rows_that_failed_have_no_outputs(read: Read) -> None:
    data = read(changed(2, status="left_domain"))
    assert np.isnan(data.y).all(axis=1).tolist() == [False, True, False]
    assert read(changed(3, status="ok")) == read(text())
    with pytest.raises(ValueError, match=r"row 3, column status: expected one of ok, met_jump, .* or nothing, given 'fine'"):
        read(changed(3, status="fine"))


def test_a_virtual_rigs_file_comes_back(tmp_path: Path) -> None:
    points = valid_points(12)
    data = fp.VirtualRig(MODEL, MODEL.nominal, NOISE, initial_state_std={"q": 1e-5}, seed=4).measure(points, repeats=3)
    data.to_csv(tmp_path / "data.csv", MODEL)
    assert fp.Measurements.from_table(tmp_path / "data.csv", MODEL) == data


def test_a_hundred_thousand_rows_are_read_soon(tmp_path: Path) -> None:
    points = random_points(np.random.default_rng(3), 1000)
    done = fp.simulate(MODEL, points, MODEL.nominal)
    few = fp.Measurements(points, np.where(done.status[:, None] == 0, done.y, np.nan))
    few.to_csv(tmp_path / "few.csv", MODEL)
    header, *rows = (tmp_path / "few.csv").read_text().splitlines(keepends=True)
    (tmp_path / "data.csv").write_text("".join([header, *(rows * 100)]))
    start = time.process_time()
    back = fp.Measurements.from_table(tmp_path / "data.csv", MODEL)
    assert time.process_time() - start < 6  # 1 to 2 s on a busy machine
    assert back == fp.Measurements.join([few] * 100)


# --- What is refused ----------------------------------------------------------------------------------------------------

GERMAN = text().replace(",", ";").replace(".", ",")
WITHOUT_OUTPUTS = text(*(",".join([*row.split(",")[:7], "", "nan", "", ""]) for row in ROWS))
WRONG = {
    "": "expected a header and at least one row, given none",
    "\n\n": "expected a header and at least one row, given none",
    HEADER + "\n": "expected a header and at least one row, given a header alone",
    text(ROWS[0], "1,2"): "row 2: expected 11 entries, given 2$",
    text(ROWS[0] + ","): "row 1: expected 11 entries, given 12",
    text()[
        : text().index("-0.02") - 3
    ]: r"row 3: expected 11 entries, given 10, at the end of the file, which has no line break: is it cut",
    text(*(row.replace(".", ",") for row in ROWS)): "row 1: expected 11 entries, given 1.; use semicolons",
    changed(2, y_q="0,1001"): "row 2, column y_q: expected a number, given '0,1001'; use semicolons",
    GERMAN.replace(
        "0,1502", "0.1502"
    ): "row 1, column q: expected either decimal commas or decimal points in a file, given '0,15' and '0.15",
    GERMAN.replace("0,1502", "0,150,2"): "row 1, column y_q: expected a number, given '0,150,2'",
    changed(2, y_p_A="6.2e6 Pa"): "row 2, column y_p_A: expected a number, given '6.2e6 Pa'",
    changed(3, v="fast"): "row 3, column v: expected a number, given 'fast'",
    changed(3, dt="1_0"): "row 3, column dt: expected a number, given '1_0'",
    changed(3, p_A=""): "row 3, column p_A: expected a start value, given ''",
    changed(2, p_A="nan", x0_p_B="1e7"): "row 2, column p_A: expected a start value, given 'nan'",
    changed(2, u=""): "row 2, column u: expected a number, given ''",
    changed(2, dt="nan"): "row 2, column dt: expected a number, given 'nan'",
    changed(1, dt="0"): "row 1, column dt: expected a positive duration in s, given '0'",
    changed(1, dt="-1e-3"): "row 1, column dt: expected a positive duration in s, given '-1e-3'",
    changed(2, y_q="inf"): "row 2, column y_q: expected a finite number, given 'inf'",
    changed(2, x0_q="-inf"): "row 2, column x0_q: expected a finite number, given '-inf'",
    changed(2, q="1e999"): "row 2, column q: expected a finite number, given '1e999'",
    text(header=HEADER.replace("y_q", "y_q [km]")).replace("0.1502", "1e307"): "row 1, column y_q: expected a finite number in m",
    WITHOUT_OUTPUTS: "expected at least one measured output, given none in y_q, y_p_A, y_p_B, y_x_v",
    changed(1, status='"ok'): "row 1, column status: expected one of ok, .* or nothing, given '\"ok'",
    text(ROWS[0], ROWS[1][:-5] + '"0.2\n'): "expected a complete CSV file, given one that breaks: unexpected end of data",
}


@pytest.mark.parametrize(("given", "message"), WRONG.items(), ids=range(len(WRONG)))
def test_what_is_wrong_is_told_with_row_and_column(read: Read, given: str, message: str) -> None:
    with pytest.raises(ValueError, match=rf"^\S*data\.csv: {message}"):
        read(given)


def test_bytes_that_are_no_text(tmp_path: Path) -> None:
    for content in (text().encode("utf-16-le"), text().encode("utf-16")[:-1], b"PK\3\4\x14\0\6\0" + text().encode()):
        (tmp_path / "data.csv").write_bytes(content)
        with pytest.raises(ValueError, match=r"data\.csv: expected a table as text, given bytes that are not text: read it by a"):
            fp.Measurements.from_table(tmp_path / "data.csv", MODEL)
    with pytest.raises(FileNotFoundError):
        fp.Measurements.from_table(tmp_path / "nothing.csv", MODEL)


def test_half_a_file_is_never_a_whole_one(tmp_path: Path) -> None:
    """Cut within a row, it is refused, or warned of within its last number; behind a row, nothing can tell that it was longer."""
    whole = text().encode()
    path = tmp_path / "data.csv"
    for end in range(len(whole)):
        path.write_bytes(whole[:end])
        if end and whole[end - 1 : end] == b"\n" and end > len(HEADER) + 1:
            assert len(fp.Measurements.from_table(path, MODEL)) == whole[:end].count(b"\n") - 1
            continue
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            try:
                read = fp.Measurements.from_table(path, MODEL)
            except ValueError as error:
                assert "data.csv: " in str(error)
                continue
        (warned,) = map(str, (one.message for one in told))
        assert "expected a line break at the end of the file, given '" in warned and "cut off within it?" in warned
        if end == len(whole) - 1:
            assert "row 3: " in warned and "given '-0.02' there" in warned and len(read) == 3


def test_columns_of_another_model_are_named(read: Read) -> None:
    unknown = "none for q, v, p_A, p_B, x_v; none for an output; the unknown h1, h2, y_level: the file of another model than"
    expected = (
        r"data\.csv: expected the columns q, v, p_A, p_B, x_v, u, dt, and of y_q, y_p_A, y_p_B, y_x_v those that were measured"
    )
    with pytest.raises(ValueError, match=f"{expected}; given {unknown} hydraulic_cylinder; columns="):
        read("h1,h2,u,dt,y_level\n1,2,3,4,5\n")
    with pytest.raises(ValueError, match=r"given none for q, u$"):
        read(text(header=HEADER.replace("q,", "time,", 1).replace(",u,", ",run,")))
    with pytest.raises(ValueError, match=rf"{expected}; given the unknown colour; columns="):
        read(changed(1, colour="red"))
    with pytest.raises(ValueError, match=r"given none for an output$"):
        read(text(*(",".join(row.split(",")[:7]) for row in ROWS), header=HEADER[: HEADER.index(",y_q")]))
    with pytest.raises(ValueError, match="expected each column once, given y_q more than once"):
        read(text(header=HEADER.replace("y_x_v", "y_q [mm]")))


@pytest.mark.parametrize(
    ("unit", "message"),
    {
        "bar": "column q: expected a unit of what is in 'm', given 'bar', which measures something else",
        "furlong": "column q: expected a unit such as .* given 'furlong': unknown unit",
        "(m": "column q: expected a unit such as",
    }.items(),
)
def test_units_that_do_not_fit(read: Read, unit: str, message: str) -> None:
    with pytest.raises(ValueError, match=rf"data\.csv: {message}"):
        read(text(header=HEADER.replace("q,", f"q [{unit}],", 1)))


# --- Beyond physics -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        ({"p_A": "60"}, r"column p_A: expected a start with p_A - p_t > 0 at .* given p_A = 60 Pa: is the unit wrong\?"),
        ({"p_B": "9e7"}, r"column p_B: expected a start with p_s - p_B > 0 .* given p_B = 9e\+07 Pa"),
        ({"x0_p_A": "60"}, r"column x0_p_A: expected a start with p_A - p_t > 0 at .* given p_A = 60 Pa"),
        ({"q": "-100"}, r"column q, v, p_A, p_B, x_v: expected a start with V_A > 0 .* q = -100 m"),
        ({"y_p_A": "6.2e11"}, r"column y_p_A: expected at most 1000 times its natural size, 1e\+07, given 6.2e\+11"),
        ({"y_x_v": "-2900"}, r"column y_x_v: expected at most 1000 times its natural size, 1, given -2900"),
        ({"y_x_v": "-450"}, r"column y_x_v: expected at most 1000 times the largest of the other rows, .* given -450:"),
    ],
)
def test_numbers_beyond_physics(read: Read, entries: dict[str, str], message: str) -> None:
    with pytest.raises(ValueError, match=rf"data\.csv: row 2, {message}"):
        read(changed(2, **entries))


def test_sizes_that_span_decades_are_no_outliers(tmp_path: Path) -> None:
    decay = fp.SymbolicModel(["-k*c"], ["c"], {"c": "mol/m3"}, {}, {"k": "1/s"}, {"c": "mol/m3"}, nominal={"k": 1.0})
    dt = np.linspace(0.1, 30, 40)
    data = fp.Measurements(fp.Experiments(np.ones((40, 1)), np.empty((40, 0)), dt), np.exp(-dt))
    data.to_csv(tmp_path / "data.csv", decay)
    assert fp.Measurements.from_table(tmp_path / "data.csv", decay) == data


@pytest.mark.parametrize(
    ("column", "entry", "message"),
    [
        ("y_p_A", "61", r"row 4, column y_p_A: .* 6.2e\+06, as in row 2 of .*, given 61: a factor of 100000 \(bar for Pa\) apart"),
        ("y_p_B", "9910", r"row 4, column y_p_B: .* as in row 2 .* a factor of 1000 \(mm for m, or any other prefix\) apart"),
        ("y_q", "100.2", r"row 4, column y_q: .* as in row 2 .* given 100.2: a factor of 1000"),
    ],
)
def test_replicates_in_different_units(read: Read, column: str, entry: str, message: str) -> None:
    place = HEADER.split(",").index(column)
    again = ROWS[1].split(",")
    again[place] = entry
    with pytest.raises(ValueError, match=rf"data\.csv: {message}"):
        read(text(*ROWS, ",".join(again)))
    # Also where all rows have a replicate in other units, and where measured starts differ.
    second = [row.split(",") for row in ROWS]
    for row in second:
        row[place] = repr(float(row[place]) * float(entry) / float(ROWS[1].split(",")[place]))
    lines = [
        f"{row},{start}" for row, start in zip((*ROWS, *map(",".join, second)), ["", "", "", "0.15", "0.1002", "0.2"], strict=True)
    ]
    with pytest.raises(ValueError, match=rf"data\.csv: row [456], column {column}: .* of the same point"):
        read(text(*lines, header=HEADER + ",x0_q"))


def test_noise_around_zero_is_no_change_of_unit(tmp_path: Path) -> None:
    """Replicates of an output that is nearly zero have any ratio; a thousand pairs of them have many near 60, 100 and 1000."""
    decay = fp.SymbolicModel(["-k*c"], ["c"], {"c": "1"}, {}, {"k": "1/s"}, {"c": "1"}, nominal={"k": 1.0})
    rng = np.random.default_rng(0)
    dt = np.repeat(np.linspace(1.0, 40.0, 1000), 2)
    data = fp.Measurements(
        fp.Experiments(np.ones((2000, 1)), np.empty((2000, 0)), dt), np.exp(-dt) + 1e-3 * rng.standard_normal(2000)
    )
    pairs = np.sort(np.abs(data.y.reshape(1000, 2)), axis=1)
    ratios = pairs[:, 1] / pairs[:, 0]
    assert (np.abs(ratios[:, None] / [60, 100, 1000] - 1) < 0.05).any(axis=1).sum() >= 3
    data.to_csv(tmp_path / "data.csv", decay)
    assert fp.Measurements.from_table(tmp_path / "data.csv", decay) == data


def test_the_documented_file_is_read(tmp_path: Path) -> None:
    page = Path(__file__).parents[2] / "docs" / "how_to" / "measurements.md"
    if not page.exists():
        pytest.skip("the documentation is not beside the tests")
    (tmp_path / "data.csv").write_text(next(block.code for block in blocks(page) if block.language == "csv"))
    data = fp.Measurements.from_table(tmp_path / "data.csv", MODEL)
    assert data.points.x0[:, 0].tolist() == [0.1503, 0.1498, 0.1]
    np.testing.assert_allclose(data.y[:, :2], [[0.1505, 8.103e6], [0.1501, 8.076e6], [0.1002, np.nan]], rtol=1e-15)
    assert np.isnan(data.y[:, 2:]).all()
