"""What is not known exactly in saved designs, in TOML files and in reports."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import fisherpoint as fp
from conftest import REGION
from defaults import problem, same_bits
from test_assumed import QUICK, STARTS, UNCERTAIN


@pytest.mark.parametrize("label", ["uncertain", "varies"])
def test_a_design_with_uncertain_constants_comes_back_and_repeats(tmp_path: Path, label: str) -> None:
    stated: dict[str, Any] = {label: UNCERTAIN, "assumed_covariance": "tangents"}
    given = problem(initial_state_std=STARTS, rule=fp.SparseGaussHermite(2), **stated)
    design = fp.exchange(given, **QUICK)
    design.save(tmp_path)
    loaded = fp.Design.load(tmp_path)
    assert dict(getattr(loaded.problem, label)) == UNCERTAIN
    assert dict(loaded.problem.initial_state_std or {}) == STARTS
    assert same_bits(loaded.evaluation.output_covariance, design.evaluation.output_covariance)
    again = fp.exchange(loaded.problem, **QUICK)
    assert same_bits(again.points.table, design.points.table)
    assert same_bits(again.evaluation.fisher, design.evaluation.fisher)


EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "cylinder.toml"
TABLES = """
[uncertain]
T_1 = { value = 2.2e-4, unit = "s" }
p_s = 1e5

[varies]
A_A = 1e-6

[initial_state_std]
q = 1e-5
v = { value = 2e-3, unit = "m/s" }
"""


def load(tmp_path: Path, tables: str, **changes: str) -> fp.DesignProblem:
    config = pytest.importorskip("fisherpoint.design.file.configuration", reason="needs the extras", exc_type=ImportError)
    text = EXAMPLE.read_text()
    for old, new in changes.items():
        text = text.replace(old, new)
    (tmp_path / "run.toml").write_text(text + tables)
    return config.load_config(tmp_path / "run.toml").problem()  # type: ignore[no-any-return]


def test_tables_of_a_file(tmp_path: Path) -> None:
    given = load(tmp_path, TABLES)
    assert dict(given.uncertain or {}) == {"T_1": 2.2e-4, "p_s": 1e5}
    assert dict(given.varies or {}) == {"A_A": 1e-6}
    assert dict(given.initial_state_std or {}) == {"q": 1e-5, "v": 2e-3}
    assert given.assumed_covariance == "tangents"
    predictive = load(tmp_path, TABLES, **{"seed = 0 ": 'assumed_covariance = "predictive" '})
    assert predictive.assumed_covariance == "predictive"
    assert load(tmp_path, "").assumed is None


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("T_1 =", "T1 =", 'unknown key uncertain.T1; expected one of .*p_s, T_1, k_u.*did you mean "T_1"'),
        (
            'unit = "s"',
            'unit = "m"',
            "uncertain.T_1.unit: expected a unit of what is in 's', given 'm', which measures something else",
        ),
        ("p_s = 1e5", "p_s = 0", "uncertain.p_s.value: expected a number > 0, given 0"),
        ("p_s = 1e5", "c_L = 1e-9", r"uncertain.c_L: expected a constant, or a parameter that is not among design.parameters"),
        ("A_A = 1e-6", "p_s = 1e4", r"varies.p_s: expected a name that is not in \[uncertain\], given one that is"),
        ("A_A = 1e-6", "c_L = 1e-9", r"varies.c_L: expected a constant, or a parameter that is not among design.parameters"),
        ("v = {", "u = {", "unknown key initial_state_std.u; expected one of q, v, p_A, p_B, x_v"),
        ("value = 2e-3", "value = 2e-3, std = 1", "unknown key initial_state_std.v.std; expected one of value, unit"),
        ('"m/s"', '"rad/s"', "initial_state_std.v.unit: expected a unit of what is in 'm/s', given 'rad/s'.*: rad/s, not m/s"),
    ],
)
def test_mistakes_in_tables(tmp_path: Path, old: str, new: str, expected: str) -> None:
    assert old in TABLES
    with pytest.raises(ValueError, match=expected):
        load(tmp_path, TABLES.replace(old, new))


def test_the_report_says_what_is_uncertain() -> None:
    constants = {name: UNCERTAIN[name] for name in ("A_A", "p_s")}
    given = problem(uncertain=constants, varies={"T_1": 2.2e-4}, initial_state_std={"v": 0.02}, region=fp.ExperimentRegion(REGION))
    design = fp.exchange(given, **QUICK)
    text = " ".join(str(design).split())
    for part in (
        "A_A 2e-6 m2, p_s 1e5 Pa",
        "drawn anew in each point or run T_1 0.00022 s",
        "starts deviate by",
        "v 0.02 m/s",
        "plus what is drawn anew in each point",
        "(R_k), with uncertain constants unknown too",
        "To first order in what is drawn anew",
    ):
        assert part in text
    assert "starts near v = 0" in text and "three of initial_state_std" in text
