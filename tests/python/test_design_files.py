"""Designs and points as files: they come back whole, repeat to the last bit, and what is broken says so."""

from __future__ import annotations

import json
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from conftest import REGION, random_points
from defaults import KINDS, MODEL, NAMES, NOISE, grid, problem, same_bits
from saved_places import DELETE, edit

QUICK: dict[str, Any] = {"n_experiments": 9, "n_candidates": 5, "max_iterations": 4}


@pytest.fixture(scope="module")
def design() -> fp.Design:
    return fp.exchange(problem(output_covariance="pooled"), **QUICK)


@pytest.fixture
def saved(design: fp.Design, tmp_path: Path) -> Path:
    design.save(tmp_path / "run")
    return tmp_path / "run"


def assert_same_evaluation(a: fp.Evaluation | None, b: fp.Evaluation | None) -> None:
    if a is None or b is None:
        assert a is b
        return
    for name, value in vars(a).items():
        other = getattr(b, name)
        if isinstance(value, np.ndarray):
            assert same_bits(value, other), name
        else:
            assert value == other, name


def assert_same_design(a: fp.Design, b: fp.Design) -> None:
    assert same_bits(a.points.table, b.points.table) and a.points.columns == b.points.columns
    assert_same_evaluation(a.evaluation, b.evaluation)
    assert_same_evaluation(a.under_noise, b.under_noise)
    assert (a.trace, a.rejected, a.drawn, a.accepted) == (b.trace, b.rejected, b.drawn, b.accepted)
    assert (a.stop_reason, a.seconds, a.settings, a.efficiency) == (b.stop_reason, b.seconds, b.settings, b.efficiency)
    for name in ("model", "prior", "region", "noise", "rule", "output_covariance", "parameters", "kinks", "jumps", "rtol"):
        assert getattr(a.problem, name) == getattr(b.problem, name), name


CASES: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    **{kind: ({"output_covariance": kind}, {}) for kind in KINDS},
    "without noise": ({"noise": None, "output_covariance": "pooled"}, {}),
    "default without noise": ({"noise": None}, {}),
    "some parameters": ({"parameters": ["E_oil", "a_tau"]}, {"n_experiments": 3}),
    "singular": ({}, {"n_experiments": 2}),
    "no references": ({}, {"method": fp.ExchangeMethod(references=False)}),
    "settings": ({}, {"method": fp.ExchangeMethod(patience=3, max_redraws=3, time_limit=100.5), "seed": 2**70}),
    "constants": ({"model": fp.HydraulicCylinder(k_u=1.0, T_1=3.3e-3, p_s=2.05e7)}, {}),
    "constraints": ({"region": fp.ExperimentRegion(REGION, ["v > 0.01", "p_A + p_B < 2.5e7"])}, {}),
    "one level": ({"rule": fp.TensorGrid(1, span=1.25)}, {}),
    "strict": ({"kinks": "exclude", "jumps": "exclude", "rtol": 1e-5}, {}),
}


@pytest.mark.parametrize("which", CASES)
def test_a_design_comes_back_whole(which: str, tmp_path: Path) -> None:
    changes, settings = CASES[which]
    original = fp.exchange(problem(**changes), **QUICK | settings)
    original.save(tmp_path / "deep" / "run")
    assert_same_design(fp.Design.load(tmp_path / "deep" / "run"), original)
    assert {path.name for path in (tmp_path / "deep" / "run").iterdir()} == {"design.csv", "design.json"}
    assert same_bits(fp.Experiments.from_csv(tmp_path / "deep" / "run" / "design.csv", MODEL).table, original.points.table)


@pytest.mark.long
@pytest.mark.parametrize("which", [name for name in CASES if name != "settings"])
def test_a_saved_run_repeats_to_the_last_bit(which: str, tmp_path: Path) -> None:
    changes, settings = CASES[which]
    original = fp.exchange(problem(**changes), **QUICK | settings)
    original.save(tmp_path)
    loaded = fp.Design.load(tmp_path)
    again = fp.exchange(loaded.problem, **vars(loaded.settings))
    assert same_bits(again.points.table, original.points.table)
    assert_same_evaluation(again.evaluation, original.evaluation)
    assert_same_evaluation(again.under_noise, original.under_noise)
    assert [(r.log_det, r.exchanged, r.drawn) for r in again.trace] == [(r.log_det, r.exchanged, r.drawn) for r in original.trace]
    assert (again.rejected, again.drawn, again.efficiency) == (original.rejected, original.drawn, original.efficiency)


def test_saving_twice_replaces(saved: Path, design: fp.Design) -> None:
    other = fp.exchange(problem(), **QUICK | {"n_experiments": 3})
    other.save(saved)
    assert len(fp.Design.load(saved).points) == 3
    design.save(str(saved))
    assert_same_design(fp.Design.load(str(saved)), design)


def test_an_interrupted_design_can_be_saved(tmp_path: Path) -> None:
    def interrupt(_: fp.Progress) -> None:
        raise KeyboardInterrupt

    original = fp.exchange(problem(), **QUICK, progress=interrupt)
    original.save(tmp_path)
    loaded = fp.Design.load(tmp_path)
    assert loaded.stop_reason == "interrupted"
    assert_same_design(loaded, original)


@pytest.mark.parametrize("kind", KINDS)
def test_constraints_that_are_functions_are_not_saved_but_the_design_is(kind: str, tmp_path: Path) -> None:
    region = fp.ExperimentRegion(REGION, [lambda x: x["v"] > 0])
    original = fp.exchange(
        problem(region=region, output_covariance=kind), **QUICK | {"method": fp.ExchangeMethod(references=False)}
    )
    original.save(tmp_path)
    loaded = fp.Design.load(tmp_path)
    assert same_bits(loaded.points.table, original.points.table)
    assert_same_evaluation(loaded.evaluation, original.evaluation)
    with pytest.raises(ValueError, match=r"constraint: expected the function"):  # no run with another region
        fp.exchange(loaded.problem, **vars(loaded.settings))


def test_the_json_is_strict_and_tells_versions(saved: Path) -> None:
    def refuse(constant: str) -> None:
        raise AssertionError(f"{constant} is no JSON")

    data = json.loads((saved / "design.json").read_text(), parse_constant=refuse)
    assert data["format"] == "fisherpoint Design" and data["versions"]["isa"] == fp.instruction_set()
    assert data["versions"]["numpy"] == np.__version__
    singular = fp.exchange(problem(), **QUICK | {"n_experiments": 1})
    singular.save(saved)
    json.loads((saved / "design.json").read_text(), parse_constant=refuse)


# --- broken files -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("share", [0.0, 0.001, 0.1, 0.5, 0.9, 0.999])
def test_a_truncated_file_is_one_clear_error(share: float, saved: Path) -> None:
    text = (saved / "design.json").read_text().rstrip()
    (saved / "design.json").write_text(text[: int(share * len(text))])
    with pytest.raises(ValueError, match=r"design\.json: expected a whole JSON file, given one that is cut off or malformed"):
        fp.Design.load(saved)


@pytest.mark.parametrize(
    "text",
    ["[]", "{}", "null", "3", '"fisherpoint Design"', '{"format": "other"}', '{"format": ["fisherpoint Design"]}'],
)
def test_a_foreign_file_is_one_clear_error(text: str, saved: Path) -> None:
    (saved / "design.json").write_text(text)
    with pytest.raises(ValueError, match=r"design\.json: expected a file of format 'fisherpoint Design', given another"):
        fp.Design.load(saved)


@pytest.mark.parametrize("content", [b"\xff\xfe\x00\x01", b"PK\x03\x04", b"[" * 100_000, b'{"a":' * 50_000])
def test_a_file_that_is_no_text_or_endless_is_one_clear_error(content: bytes, saved: Path) -> None:
    (saved / "design.json").write_bytes(content)
    with pytest.raises(ValueError, match=r"design\.json: expected"):
        fp.Design.load(saved)


def test_a_missing_file_is_an_os_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"design\.json"):
        fp.Design.load(tmp_path)


EDITS: list[tuple[str, Any]] = [
    *((name, DELETE) for name in ("problem", "settings", "points", "evaluation", "under_noise", "efficiency", "trace")),
    *((name, DELETE) for name in ("rejected", "drawn", "accepted", "stop_reason", "seconds")),
    *((name, 5) for name in ("problem", "settings", "points", "evaluation", "trace", "rejected")),
    ("evaluation", None),
    ("problem.model.name", "steam_engine"),
    ("problem.model.constants.A_A", -1.0),
    ("problem.model.constants.colour", 1.0),
    ("problem.prior.std.a_tau", -1.0),
    ("problem.prior.mean.a_tau", "many"),
    ("problem.prior.mean.p_t", 1e9),
    ("problem.prior.mean.a_tau", DELETE),
    ("problem.region.bounds.v", [1.0, -1.0]),
    ("problem.region.bounds.v", DELETE),
    ("problem.region.constraints", ["__import__('os') < 1"]),
    ("problem.noise.q", 0.0),
    ("problem.rule.levels", 0),
    ("problem.rule.span", -1.0),
    ("problem.output_covariance", "best"),
    ("problem.parameters", ["colour"]),
    ("problem.kinks", "sometimes"),
    ("problem.jumps", "sometimes"),
    ("problem.rtol", 7.0),
    ("points.dt.0", -1e-3),
    ("points.dt.0", "soon"),
    ("points.x0.0", [1.0, 2.0]),
    ("points.u", []),
    ("settings.colour", 1),
    ("settings.seed", DELETE),
    ("settings.seed", "abc"),
    ("settings.n_candidates", 10**9),
    ("settings.n_experiments", 0),
    ("settings.n_experiments", 8),
    ("trace.0", {}),
    ("trace.0.iteration", DELETE),
    ("trace.0.log_det", "high"),
    ("evaluation.fisher", DELETE),
    ("evaluation.fisher.0", [1.0]),
    ("evaluation.log_det", "high"),
    ("efficiency.colour", 1),
    ("rejected", ["met_jump"]),
    ("rejected.met_jump", "often"),
    ("drawn", "many"),
    ("stop_reason", "bored"),
]


@pytest.mark.parametrize(("path", "value"), EDITS, ids=[f"{path}={'-' if v is DELETE else v}"[:60] for path, v in EDITS])
def test_an_edited_file_is_one_clear_error(path: str, value: Any, saved: Path) -> None:
    edit(saved / "design.json", path, value)
    with pytest.raises(ValueError, match=r"design\.json: ") as caught:
        fp.Design.load(saved)
    message = str(caught.value)
    assert "expected" in message and "given" in message and len(message) < 500 and "\n" not in message


@pytest.mark.parametrize("number", ["NaN", "Infinity", "1e999"])
def test_a_number_that_is_none_is_refused(number: str, saved: Path) -> None:
    edit(saved / "design.json", "points.dt.0", float(number))
    with pytest.raises(ValueError, match=r"design\.json: .*(finite|whole JSON file)"):
        fp.Design.load(saved)


# --- CSV ----------------------------------------------------------------------------------------------------------------


def test_points_come_back_from_csv_to_the_last_bit(tmp_path: Path) -> None:
    points = random_points(np.random.default_rng(0), 200)
    tiny = fp.Experiments([[5e-324, -0.0, 1e308, 0.1 + 0.2, 1 / 3]], [[-1e-300]], [1e-17])
    for given in (points, tiny):
        given.to_csv(tmp_path / "points.csv", MODEL)
        back = fp.Experiments.from_csv(tmp_path / "points.csv", MODEL)
        assert same_bits(back.table, given.table)
        assert back.columns == ("q", "v", "p_A", "p_B", "x_v", "u")
    header, *rows = (tmp_path / "points.csv").read_text().splitlines()
    assert header == "q,v,p_A,p_B,x_v,u,dt" and len(rows) == 1


def test_points_without_names_are_written_by_place(tmp_path: Path) -> None:
    points = random_points(np.random.default_rng(1), 3)
    points.to_csv(tmp_path / "points.csv")
    assert (tmp_path / "points.csv").read_text().startswith("x0_0,x0_1,x0_2,x0_3,x0_4,u_0,dt")
    assert same_bits(fp.Experiments.from_csv(tmp_path / "points.csv", MODEL).table, points.table)


@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_columns_are_found_by_name_and_blanks_are_forgiven(newline: str, tmp_path: Path) -> None:
    lines = ["dt, u ,x_v,p_B,p_A,v,q", "1e-3,0.1,0.2, 1e7,8e6,0.3,0.15", "", "2e-3,0.1,0.2,1e7,8e6,0.3,0.15", ""]
    (tmp_path / "points.csv").write_bytes(newline.join(lines).encode())
    points = fp.Experiments.from_csv(tmp_path / "points.csv", MODEL)
    np.testing.assert_array_equal(points.x0, [[0.15, 0.3, 8e6, 1e7, 0.2]] * 2)
    np.testing.assert_array_equal(points.dt, [1e-3, 2e-3])


HEADER = "q,v,p_A,p_B,x_v,u,dt"
ROW = "0.15,0.2,8e6,9e6,0.3,-0.3,1e-3"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "expected a header and at least one row, given none"),
        (HEADER, "expected a header and at least one row, given a header alone"),
        ("q,v,p_A\n1,2,3", "expected the columns q, v, p_A, p_B, x_v, u, dt; given q, v, p_A"),
        (f"{HEADER},colour\n{ROW},1", "expected the columns .* given .*colour"),
        (f"q,{HEADER}\n0.1,{ROW}", "expected each column once, given q more than once"),
        (f"{HEADER}\n{ROW}\n{ROW},7", "row 2: expected 7 entries, given 8"),
        (f"{HEADER}\n{ROW}\n1,2", "row 2: expected 7 entries, given 2"),
        (f"{HEADER}\n{ROW}\n0.15,0.2,much,9e6,0.3,-0.3,1e-3", "row 2, column p_A: expected a number, given 'much'"),
        (f"{HEADER}\n{ROW}\n0.15,0.2,,9e6,0.3,-0.3,1e-3", "row 2, column p_A: expected a number, given ''"),
        (f"{HEADER}\n{ROW}\n0.15,0.2,nan,9e6,0.3,-0.3,1e-3", "row 2, column p_A: expected .*given .*nan"),
        (f"{HEADER}\n{ROW}\n0.15,0.2,8e6,9e6,0.3,inf,1e-3", "row 2, column u: expected .*given .*inf"),
        (f"{HEADER}\n{ROW}\n0.15,0.2,8e6,9e6,0.3,-0.3,0", "row 2, column dt: expected .*given .*0"),
        (f"{HEADER}\n{ROW}\n0.15,0.2,8e6,9e6,0.3,-0.3,-1e-3", "row 2, column dt: expected .*given .*-1e-3"),
    ],
)
def test_a_wrong_csv_names_row_and_column(text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "points.csv").write_text(text)
    with pytest.raises(ValueError, match=rf"points\.csv: .*{message}"):
        fp.Experiments.from_csv(tmp_path / "points.csv", MODEL)


def test_measured_points_are_points(tmp_path: Path) -> None:
    """What a file of measurements has besides is not read."""
    text = f"{HEADER},y_q,x_v_,comment,status,x0_q\n{ROW},0.15,0.3,first,ok,0.1502\n"
    (tmp_path / "points.csv").write_text(text.replace("x_v_", "y_x_v"))
    points = fp.Experiments.from_csv(tmp_path / "points.csv", MODEL)
    assert points.table.tolist() == [[float(entry) for entry in ROW.split(",")]]


def test_a_csv_of_bytes_is_one_clear_error(tmp_path: Path) -> None:
    (tmp_path / "points.csv").write_bytes(b"\x00\x01\x81q,v")
    with pytest.raises(ValueError, match=r"points\.csv: expected a table as text, given bytes that are not text: "):
        fp.Experiments.from_csv(tmp_path / "points.csv", MODEL)


def test_a_csv_written_by_a_spreadsheet_is_read(tmp_path: Path) -> None:
    """Spreadsheets put a byte order mark in front."""
    (tmp_path / "points.csv").write_text(f"{HEADER}\n{ROW}\n", encoding="utf-8-sig")
    assert len(fp.Experiments.from_csv(tmp_path / "points.csv", MODEL)) == 1


def test_points_may_have_units_and_decimal_commas(tmp_path: Path) -> None:
    header = HEADER.replace("q,", "q [mm],", 1).replace("p_A", "p_A (bar)").replace(",", ";")
    (tmp_path / "points.csv").write_text(f"{header}\n150,5;0,2;80,5;9e6;0,3;-0,3;1e-3\n")
    points = fp.Experiments.from_csv(tmp_path / "points.csv", MODEL)
    assert points.table.tolist() == [[0.1505, 0.2, 8.05e6, 9e6, 0.3, -0.3, 1e-3]]


def test_levels_by_name_come_back(tmp_path: Path) -> None:
    rule = grid(a_tau=2, B_v=3)
    fp.exchange(problem(rule=rule, noise=NOISE), **QUICK | {"method": fp.ExchangeMethod(references=False)}).save(tmp_path)
    loaded = fp.Design.load(tmp_path).problem.rule
    assert loaded == rule and loaded.levels_of(problem().prior) == dict.fromkeys(NAMES, 1) | {"a_tau": 2, "B_v": 3}


def test_everything_can_be_sent_to_another_process_and_hashed(saved: Path) -> None:
    design = fp.Design.load(saved)
    for given in (design.problem.model, design.problem.prior, design.problem.rule, design.problem.region, design.problem, design):
        copy = pickle.loads(pickle.dumps(given))
        assert type(copy) is type(given)
        hash(copy)
    copy = pickle.loads(pickle.dumps(design))
    assert copy.points == design.points
    assert copy.evaluation.standard_errors == design.evaluation.standard_errors
    assert fp.evaluate(copy.problem, copy.points).log_det == fp.evaluate(design.problem, design.points).log_det
