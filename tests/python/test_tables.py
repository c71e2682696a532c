"""Tables as loggers write them, and tables that are objects: each form is read as the same record, or refused with what to do."""

from __future__ import annotations

import datetime
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from defaults import MODEL
from record_cases import tanks

pd = pytest.importorskip("pandas", reason="needs the extras")

T, U, LEVEL = [0.0, 0.5, 1.25], [1.5, 1.625, -2.0], [0.5, np.nan, 0.75]
OWN = "t,u,level\n0,1.5,0.5\n0.5,1.625,\n1.25,-2,0.75\n"
NAMES = {"t": "t", "u": "u", "level": "level"}
COLUMNS = {"t": "Zeit", "u": "Spannung", "level": "Pegel"}


def logged(times: tuple[str, str, str], head: str = "Zeit,Spannung,Pegel", gap: str = "") -> str:
    """A logger's file with other times, names of columns, or another entry where nothing was measured."""
    rows = (f"{times[0]},1.5,0.5", f"{times[1]},1.625,{gap}", f"{times[2]},-2,0.75")
    return "\n".join((head, *rows)) + "\n"


def german(text: str) -> str:
    return text.replace(",", ";").replace(".", ",")


SECONDS = ("0", "0.5", "1.25")
PLAIN = logged(SECONDS)
FORMS: dict[str, tuple[str | bytes, dict[str, str] | None]] = {
    "semicolons with decimal commas": (german(OWN), None),
    "semicolons with points": (OWN.replace(",", ";"), None),
    "tabs": (OWN.replace(",", "\t"), None),
    "tabs with decimal commas": (german(OWN).replace(";", "\t"), None),
    "a byte order mark": ("\ufeff" + OWN, None),
    "a unit in brackets": ("t [ms],u,level\n0,1.5,0.5\n500,1.625,\n1250,-2,0.75\n", None),
    "a unit in parentheses": ("t,u (mV),level\n0,1500,0.5\n0.5,1625,\n1.25,-2000,0.75\n", None),
    "nan": (OWN.replace("1.625,", "1.625,nan"), None),
    "other names": (PLAIN, COLUMNS),
    "other names, further columns": (
        "Nr;Zeit;Pegel;Temp;Spannung;\n1;0;0,5;21,5;1,5;\n2;0,5;;-;1,625;\n3;1,25;0,75;;-2;\n",
        COLUMNS,
    ),
    "names with units": (
        "Zeit [ms],Spannung (V),Pegel [cm]\n0,1.5,50\n500,1.625,\n1250,-2,75\n",
        {"t": "Zeit", "u": "Spannung (V)", "level": "Pegel"},
    ),
    "a unit that the name gives": (
        "Zeit,Spannung,Pegel [Ch 2]\n0,1500,50\n0.5,1625,\n1.25,-2000,75\n",
        {"t": "Zeit", "u": "Spannung [mV]", "level": "Pegel [Ch 2] (cm)"},
    ),
    "rows above the heads": ("Logger 7\n\nRate: 2 Hz, 3 Kanäle\n;;;\n" + PLAIN, COLUMNS),
    "a row of groups above": ("Pegel;Pegel;Pumpe\n" + german(PLAIN), COLUMNS),
    "rows above with an open quote": ('Pump "3 in, old\n' + PLAIN, COLUMNS),
    "a row of units": (PLAIN.replace("Pegel\n", "Pegel\nms,mV,cm\n").replace("1.5,0.5", "1500,50")
                       .replace("0.5,1.625", "500,1625").replace("1.25,-2,0.75", "1250,-2000,75"), COLUMNS),
    "a row of units in brackets, some without": ("t,u,level\n[s],[V],\n" + OWN.split("\n", 1)[1], None),
    "a row of units over times of day": (
        "Zeit,Spannung,Pegel\nhh:mm:ss,mV,m\n12:00:00,1500,0.5\n12:00:00.5,1625,\n12:00:01.25,-2000,0.75\n",
        COLUMNS,
    ),
    "ISO 8601": (logged(("2025-05-01T23:59:59.5", "2025-05-02T00:00:00", "2025-05-02T00:00:00.75")), COLUMNS),
    "ISO 8601 with a space, commas": (
        "Zeit;Spannung;Pegel\n2025-05-01 12:00:00,5;1,5;0,5\n2025-05-01 12:00:01;1,625;\n2025-05-01 12:00:01,75;-2;0,75\n",
        COLUMNS,
    ),
    "ISO 8601 with offsets": (
        logged(("2025-10-26T02:59:59.5+02:00", "2025-10-26T02:00:00+01:00", "2025-10-26T01:00:00.75Z")),
        COLUMNS,
    ),
    "the day first": (
        "Zeit;Spannung;Pegel\n02.01.2025 12:00:00,000;1,5;0,5\n02.01.2025 12:00:00,500;1,625;\n02.01.2025 12:00:01,250;-2;0,75\n",
        COLUMNS,
    ),
    "times of day": (logged(("9:00:00", "9:00:00.5", "9:00:01.250")), COLUMNS),
    "times of day over midnight": (logged(("23:59:59.25", "23:59:59.75", "00:00:00.5")), COLUMNS),
    "times of day with decimal commas": (
        "Zeit;Spannung;Pegel\n12:00:00,0;1,5;0,5\n12:00:00,5;1,625;\n12:00:01,25;-2;0,75\n",
        COLUMNS,
    ),
    "Latin-1": (PLAIN.replace("Pegel", "Pegel über Grund").encode("latin-1"), COLUMNS | {"level": "Pegel über Grund"}),
    "Latin-1 in a further column": ("T °C;t;u;level\n;0;1,5;0,5\n;0,5;1,625;\n;1,25;-2;0,75\n".encode("latin-1"), NAMES),
    "UTF-16": (OWN.replace(",", "\t").encode("utf-16"), None),
    "UTF-16, big end first": (("\ufeff" + PLAIN).encode("utf-16-be"), COLUMNS),
    **{f"missing: {gap}": (logged(SECONDS, gap=gap), COLUMNS) for gap in ("NA", "N/A", "#N/A", "null", "None", " ", "NaN")},
    "all at once": (
        "Logger 7, Prüfstand\r\nZeit\tTemp °C\tSpannung\tPegel\t\r\n\t°C\tmV\tcm\t\r\n"
        "23:59:59,75\t21,5\t1500,0\t50\t\r\n00:00:00,25\t\t1625\tNA\t\r\n00:00:01\tNA\t-2000,0\t75\t\r\n".encode("utf-16"),
        COLUMNS,
    ),
}  # fmt: skip


def read(tmp_path: Path, content: str | bytes, columns: dict[str, str] | None) -> fp.Record:
    path = tmp_path / "log.csv"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return fp.Record.from_table(path, tanks, columns=columns)


def same(record: fp.Record) -> None:
    np.testing.assert_allclose(record.t, T, rtol=0, atol=1e-12)
    np.testing.assert_allclose(record.u[:, 0], U, rtol=1e-15)
    np.testing.assert_allclose(record.y[:, 0], LEVEL, rtol=1e-15)


@pytest.mark.filterwarnings("ignore:.*left out what is not named")
@pytest.mark.parametrize(("content", "columns"), FORMS.values(), ids=FORMS)
def test_a_loggers_file_is_read(tmp_path: Path, content: str | bytes, columns: dict[str, str] | None) -> None:
    same(read(tmp_path, content, columns))


def test_times_that_begin_late_stay(tmp_path: Path) -> None:
    record = read(tmp_path, logged(("1000", "1000.5", "1007")), COLUMNS)
    assert record.t.tolist() == [1000.0, 1000.5, 1007.0]


REFUSED: dict[str, tuple[str | bytes, dict[str, str] | None, str]] = {
    "thousands separators": (german(PLAIN).replace("-2;", "1.234,5;"), COLUMNS, "expected either decimal commas or decimal points"),
    "a time twice": (logged(("0", "0.5", "0.5")), COLUMNS, "row 3, column Zeit: expected a time after that .* given '0.5'"),
    "an hour twice, in autumn": (
        logged(("2025-10-26 02:59:59", "2025-10-26 02:00:00", "2025-10-26 02:00:01")),
        COLUMNS,
        "row 2, column Zeit: expected a time after that of the row before, given '2025-10-26 02:00:00'",
    ),
    "infinite": (PLAIN.replace("0.75", "inf"), COLUMNS, "row 3, column Pegel: expected a finite number, given 'inf'"),
    "no input": (PLAIN.replace("1.625", "NA"), COLUMNS, "row 2, column Spannung: expected a number, given 'NA'"),
    "no time": (logged(("2025-05-01", "NA", "2025-05-02")), COLUMNS, "row 2, column Zeit: expected a time such as .* given 'NA'"),
    "other names": (PLAIN, None, r"given Zeit, Spannung, Pegel; columns=\{...\}, --column, or \[data\] .* names"),
    "a name that is not there": (
        PLAIN,
        COLUMNS | {"u": "Strom"},
        "log.csv: expected the columns Strom, given Zeit, Spannung",
    ),
    "another unit than in the head": (
        PLAIN.replace("Spannung", "Spannung [kV]"),
        COLUMNS | {"u": "Spannung [mV]"},
        r"expected the columns Spannung \[mV\], given Zeit, Spannung \[kV\], Pegel",
    ),
    "a name that two have": (
        "Zeit,Spannung [V],Spannung [mV],Pegel\n0,1,1000,0.5\n",
        COLUMNS,
        r"columns: expected the name of one column, given Spannung, which fits Spannung \[V\], Spannung \[mV\]",
    ),
    "the month first": (
        logged(("05/01/2025 12:00", "05/01/2025 12:01", "")),
        COLUMNS,
        r"row 1, .* \(pandas.to_datetime reads others\), given '05/01/2025",
    ),
    "no seconds": (logged(("12:00", "12:01", "12:02")), COLUMNS, "row 1, column Zeit: expected a time such as"),
    "no such day": (logged(("2025-02-28", "2025-02-29", "2025-03-01")), COLUMNS, "row 2, column Zeit: .* given '2025-02-29'"),
    "a number among dates": (
        logged(("2025-05-01", "5", "6")),
        COLUMNS,
        "row 2, column Zeit: .*, given '5'",
    ),
    "dates for an input": (PLAIN, COLUMNS | {"u": "Zeit", "t": "Spannung"}, "row 3, column Spannung: expected a time after"),
    "an unknown unit": (PLAIN.replace("Spannung", "Spannung [Volts]"), COLUMNS, "column Spannung: .* unknown unit 'Volts'"),
    "a unit of something else": (PLAIN.replace("Pegel\n", "Pegel\ns,V,bar\n"), COLUMNS, "column Pegel: .* measures something else"),
    "units alone": ("Zeit,Spannung,Pegel\ns,V,m\n", COLUMNS, "column Zeit: expected at least one row, given 0"),
    "a short row": (PLAIN + "2,1\n", COLUMNS, "row 4: expected 3 entries, given 2"),
    "a footer": (PLAIN + "3 Werte gelesen\n", COLUMNS, "row 4: expected 3 entries, given 1"),
    "cut off": (PLAIN.removesuffix(",0.75\n"), COLUMNS, "row 3: .* at the end of the file, which has no line break"),
    "UTF-16 without a mark": (OWN.encode("utf-16-le"), None, "given bytes that are not text: read it by a library for such files"),
    "a workbook": (b"PK\3\4\x14\0\6\0\x08\0" + PLAIN.encode(), COLUMNS, "given bytes that are not text: read it by a library"),
    "nothing": (b"\n\n", COLUMNS, "expected a header and at least one row, given none"),
    "no columns": (PLAIN, {}, "columns: expected the column of each quantity that was measured, given none"),
    "a quantity of no model": (
        PLAIN,
        {**COLUMNS, "depth": "Pegel"},
        "y_level, .* given t, u, level, depth",
    ),
}


@pytest.mark.parametrize(("content", "columns", "message"), REFUSED.values(), ids=REFUSED)
def test_a_loggers_file_is_refused(tmp_path: Path, content: str | bytes, columns: dict[str, str] | None, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        read(tmp_path, content, columns)


def test_what_is_left_out_is_listed(tmp_path: Path) -> None:
    with pytest.warns(UserWarning, match=r"log\.csv: left out what is not named: Nr, Temp °C$") as caught:
        read(tmp_path, "Nr,Zeit,Spannung,Temp °C,Pegel,\n1,0,1,20,0.5,\n", COLUMNS)
    assert caught[0].filename == __file__


def test_a_nanosecond_is_kept(tmp_path: Path) -> None:
    record = read(
        tmp_path, logged(("2025-05-01T12:00:00.000000001", "2025-05-01T12:00:00.000000003", "2025-05-01T12:00:01")), COLUMNS
    )
    assert record.t.tolist() == [0.0, 2e-9, 0.999999999]


# --- Objects ------------------------------------------------------------------------------------------------------------


def frame(**changes: Any) -> Any:
    return pd.DataFrame({"t": T, "u": U, "level": LEVEL} | changes)


BEGIN = pd.Timestamp("2025-05-01 12:00:00.25")
DURATIONS = pd.to_timedelta(T, unit="s")
OBJECTS: dict[str, tuple[Callable[[], Any], dict[str, str] | None]] = {
    "a frame": (frame, None),
    "a dict of lists": (lambda: {"t": T, "u": U, "level": [0.5, None, 0.75]}, None),
    "a dict of columns of a matrix": (lambda: {"t": np.array([T]), "u": np.array([U]).T, "level": np.array([LEVEL])}, None),
    "nullable floats": (lambda: frame(level=pd.array([0.5, pd.NA, 0.75], dtype="Float64")), None),
    "masked": (lambda: {"t": T, "u": U, "level": np.ma.masked_values([0.5, -99.0, 0.75], -99.0)}, None),
    "single precision": (lambda: frame().astype(np.float32), None),
    "a structured array": (lambda: frame().to_records(index=False), None),
    "texts": (lambda: frame().astype(str).replace("nan", "NA"), None),
    "texts with decimal commas": (lambda: frame(u=["1,5", "1,625", "-2"], level=["0,5", "NA", "0,75"]), None),
    "texts in bytes": (lambda: frame(level=[b"0.5", b"NA", b"0.75"]), None),
    "units above texts": (lambda: pd.DataFrame({"t": ["s", *map(str, T)], "u": ["mV", "1500", "1625", "-2000"],
                                               "level": ["m", "0.5", "", "0.75"]}), None),
    "a level of units": (lambda: pd.DataFrame({("t", "s"): T, ("u", "mV"): np.array(U) * 1e3, ("level", "m"): LEVEL}), None),
    "other names": (lambda: frame().rename(columns={"t": "Zeit", "u": "Spannung", "level": "Pegel"}), COLUMNS),
    "a named index": (lambda: frame().set_index("t"), None),
    "an index of dates": (lambda: frame().set_index(BEGIN + DURATIONS)[["u", "level"]], NAMES | {"t": "index"}),
    "an index of durations": (lambda: frame().set_index(DURATIONS)[["u", "level"]], NAMES | {"t": "index"}),
    "dates": (lambda: frame(t=BEGIN + DURATIONS), None),
    "dates with a time zone": (lambda: frame(t=(BEGIN + DURATIONS).tz_localize("Europe/Berlin")), None),
    "dates in an array": (lambda: {"t": (BEGIN + DURATIONS).to_numpy("M8[us]"), "u": U, "level": LEVEL}, None),
    "durations": (lambda: frame(t=DURATIONS), None),
    "dates of Python": (lambda: {"t": [(BEGIN + one).to_pydatetime() for one in DURATIONS], "u": U, "level": LEVEL}, None),
    "times of Python": (lambda: {"t": [(BEGIN + one).time() for one in DURATIONS], "u": U, "level": LEVEL}, None),
    "durations of Python": (
        lambda: {"t": [datetime.timedelta(days=2, seconds=10 + one) for one in T], "u": U, "level": LEVEL}, None),
}  # fmt: skip


@pytest.mark.parametrize(("table", "columns"), OBJECTS.values(), ids=OBJECTS)
def test_an_object_with_columns_is_read(table: Callable[[], Any], columns: dict[str, str] | None) -> None:
    same(fp.Record.from_table(table(), tanks, columns=columns))


def test_polars() -> None:
    pl = pytest.importorskip("polars", reason="polars is not installed")
    table = pl.DataFrame(
        {"Zeit": [BEGIN.to_pydatetime() + one.to_pytimedelta() for one in DURATIONS], "u": U, "Pegel": [0.5, None, 0.75]}
    )
    same(fp.Record.from_table(table, tanks, columns=COLUMNS | {"u": "u"}))
    same(fp.Record.from_table(table.with_columns(pl.col("Pegel").cast(pl.String)), tanks, columns=COLUMNS | {"u": "u"}))


def test_xarray() -> None:
    xr = pytest.importorskip("xarray", reason="xarray is not installed")
    table = xr.Dataset({"u": ("t", np.array(U) * 1e3, {"units": "mV"}), "level": ("t", LEVEL)}, {"t": BEGIN + DURATIONS})
    same(fp.Record.from_table(table, tanks))
    same(fp.Record.from_table(table.rename(t="time"), tanks, columns=NAMES | {"t": "time"}))


def test_a_digital_channel_is_zero_or_one() -> None:
    record = fp.Record.from_table(frame(u=[True, False, True]), tanks)
    assert record.u[:, 0].tolist() == [1.0, 0.0, 1.0]


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (5, "table: expected a path, or named columns as a frame or a dict of arrays has, given int"),
        ([T, U, LEVEL], "table: expected a path, or named columns .* given list"),
        (np.array([T, U, LEVEL]), "table: expected a path, or named columns .* given ndarray"),
        ({}, "table: expected the columns of the model, given none"),
        ({"t": T, "u": U[:2], "level": LEVEL}, "table: column u: expected 3 rows, as in t, given 2: Record.merged takes"),
        ({"t": T, "u": [U, U, U], "level": LEVEL}, r"table: column u: expected a number in each row, .* given shape \(3, 3\)"),
        ({"t": [], "u": [], "level": []}, r"table: column t: expected a number in each row, at least one, given shape \(0,\)"),
        ({"t": T, "u": [1j, 0, 0], "level": LEVEL}, "table: column u: expected numbers, given array"),
        ({"t": T, "u": ["a", "b", "c"], "level": LEVEL}, "table: row 1, column u: expected a number, given 'a'"),
        ({"t": T, "u": U, "level": [0.5, np.inf, 1]}, "table: row 2, column level: expected a finite number, given inf"),
        ({"t": T, "u": [1, np.nan, 2], "level": LEVEL}, "table: row 2, column u: expected a number, given nan"),
        ({"t": T, "u": BEGIN + DURATIONS, "level": LEVEL}, "table: row 1, column u: expected a number, given '2025-05-01"),
        ({"t": [BEGIN, pd.NaT, BEGIN], "u": U, "level": LEVEL}, "table: row 2, column t: expected a time such as"),
        ({"t": T, "u": DURATIONS, "level": LEVEL}, "table: column u: expected a unit of what is in 'V', given 's'"),
    ],
)  # fmt: skip
def test_an_object_is_refused(table: Any, message: str) -> None:
    with pytest.raises((TypeError, ValueError), match=message):
        fp.Record.from_table(table, tanks)


# --- Measurements -------------------------------------------------------------------------------------------------------

POINTS = {
    "q": "Weg [mm]", "v": "v", "p_A": "Druck A [bar]", "p_B": "Druck B [bar]", "x_v": "Ventil", "u": "Soll", "dt": "Dauer",
    "y_q": "Weg danach (mm)", "y_p_A": "Druck A danach",
}  # fmt: skip
ROWS = [(150, 0.2, 80, 90, 0.3, -0.3, 1.0, 150.2, 8.1e6), (100, 0.1, 60, 100, -0.2, 0.4, 2.0, 100.1, np.nan)]


def test_measured_points_of_a_frame() -> None:
    table = pd.DataFrame(ROWS, columns=list(POINTS.values()))
    table["Dauer"] = pd.to_timedelta(table["Dauer"], unit="ms")
    data = fp.Measurements.from_table(table.assign(Notiz="x").iloc[:, :-1], MODEL, columns=POINTS)
    assert data.points.x0[:, :3].tolist() == [[0.15, 0.2, 8e6], [0.1, 0.1, 6e6]] and data.points.dt.tolist() == [1e-3, 2e-3]
    np.testing.assert_allclose(data.y[:, :2], [[0.1502, 8.1e6], [0.1001, np.nan]], rtol=1e-15)
    assert np.isnan(data.y[:, 2:]).all()
    table["Druck A [bar]"] = [80.0, 6e-4]
    with pytest.raises(ValueError, match="table: row 2, column Druck A: expected a start with p_A - p_t > 0"):
        fp.Measurements.from_table(table, MODEL, columns=POINTS)


def test_measured_runs_of_a_file_with_other_names(tmp_path: Path) -> None:
    runs = fp.Runs([[0.4, 0.3]] * 2, [[[1.0], [2.0]], [[2.0], [1.0]]], 0.5)
    data = fp.Measurements(runs, [[0.1, 0.2], [0.3, np.nan]])
    data.to_csv(tmp_path / "own.csv", tanks)
    own = (tmp_path / "own.csv").read_text()
    heads = own.splitlines()[0].split(",")
    (tmp_path / "log.csv").write_text("Logger\n" + own.replace(",".join(heads), ",".join(f"Kanal {name}" for name in heads)))
    assert fp.Measurements.from_table(tmp_path / "log.csv", tanks, columns={name: f"Kanal {name}" for name in heads}) == data
    assert fp.Measurements.from_table(pd.read_csv(tmp_path / "own.csv"), tanks) == data


# --- Channels of different rates ----------------------------------------------------------------------------------------


def test_inputs_are_held_and_outputs_stay_where_they_were_measured() -> None:
    rng = np.random.default_rng(2)
    t_u, t_y = (np.unique(np.round(rng.uniform(0.0, 5.0, n), 2)) for n in (30, 45))
    assert set(t_u) & set(t_y)  # some samples of both at once
    u, y = rng.normal(size=len(t_u)), rng.normal(size=len(t_y))
    t_u[0], y[[3, 7]] = 0.0, np.nan
    record = fp.Record.merged({"u": (t_u, u), "level": (t_y, y)}, tanks, x0={"h1": 0.4})
    assert record.x0 == {"h1": 0.4} and set(record.t) == {*t_u, *t_y[np.isfinite(y)]}
    for n, time in enumerate(record.t):
        assert record.u[n, 0] == u[t_u <= time][-1]
        measured = y[t_y == time]
        assert np.array_equal(record.y[n], measured if len(measured) else [np.nan], equal_nan=True)


def test_merging_one_rate_is_a_plain_record() -> None:
    record = fp.Record.merged({"u": (T, U), "y_level": (T, LEVEL)}, tanks)
    assert record.t.tolist() == T and record.u[:, 0].tolist() == U and np.array_equal(record.y[:, 0], LEVEL, equal_nan=True)


def test_a_merged_record_begins_where_all_inputs_are_known() -> None:
    model = fp.SymbolicModel(["a*u + b*w - x"], ["x"], {"x": "1"}, {"u": "1", "w": "1"}, {"a": "1", "b": "1"}, {"u": "1"})
    channels = {"u": ([0.0, 2.0], [1.0, 2.0]), "w": ([1.0, 4.0], [5.0, np.nan]), "y_u": ([0.5, 1.0, 3.0], [7.0, 8.0, 9.0])}
    with pytest.warns(UserWarning, match="channels: left out 1 numbers of outputs before 1 s, where not all inputs are known"):
        record = fp.Record.merged(channels, model)
    assert record.t.tolist() == [1.0, 2.0, 3.0] and record.u.tolist() == [[1.0, 5.0], [2.0, 5.0], [2.0, 5.0]]
    assert np.array_equal(record.y[:, 0], [8.0, np.nan, 9.0], equal_nan=True)


def test_dates_of_channels_are_seconds_since_the_first_of_all() -> None:
    times = np.datetime64("2025-05-01T12:00") + np.array([0, 500, 1250], dtype="m8[ms]")
    channels = {"u": (times, U), "level": (pd.DatetimeIndex(times[1:]), LEVEL[1:])}
    record = fp.Record.merged(channels, tanks)
    assert record.t.tolist() == T and np.array_equal(record.y[:, 0], [np.nan, np.nan, 0.75], equal_nan=True)
    with pytest.raises(ValueError, match=r"channels\['level'\]: expected dates, as other channels have, given other times"):
        fp.Record.merged(channels | {"level": (T, LEVEL)}, tanks)


@pytest.mark.parametrize(
    ("channels", "message"),
    [
        ({"level": (T, LEVEL)}, "channels: expected the samples of the input u, given none"),
        ({"u": (T, U), "depth": (T, LEVEL)}, "channels: expected names of u, y_level, level; given unknown 'depth'"),
        ({"u": (T, U)}, "channels: expected a measured output from 0 s on, where all inputs are known; given none"),
        ({"u": ([2.0, 3.0], [1, 2]), "level": ([0.0, 1.0], [1, 2])}, "channels: expected a measured output from 2 s on"),
        ({"u": (T, U), "level": ([0.0, 0.0, 1.0], [1, 2, 3])}, r"channels\['level'\]: t: expected increasing times"),
        ({"u": (T, U[:2]), "level": (T, LEVEL)}, r"channels\['u'\]: expected as many numbers as times, given shapes"),
        ({"u": (T, [1, np.inf, 2]), "level": (T, LEVEL)}, r"channels\['u'\]: expected finite numbers, or NaN where"),
        ({"u": (T, [np.nan] * 3), "level": (T, LEVEL)}, r"channels\['u'\]: expected at least one number, given none"),
        ({"u": U, "level": (T, LEVEL)}, r"channels\['u'\]: expected a pair of times and numbers, given"),
        ({"u": (["a", "b", "c"], U), "level": (T, LEVEL)}, r"channels\['u'\]: t: expected numbers, given"),
        ([T, U], "channels: expected a mapping of names to times and numbers, given list"),
    ],
)  # fmt: skip
def test_channels_that_cannot_be_merged(channels: Any, message: str) -> None:
    with pytest.raises((TypeError, ValueError), match=message):
        fp.Record.merged(channels, tanks)
