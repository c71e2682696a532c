"""Points that a design must have."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from defaults import KINDS, MODEL, point, problem, valid_points
from fisherpoint_command import cli

POINTS = valid_points(16, seed=5, jumps="exclude")
QUICK: dict[str, Any] = {"n_candidates": 10, "max_iterations": 8, "seed": 1}
EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


@pytest.mark.parametrize("method", ["paper", "auto"])
@pytest.mark.parametrize("kind", KINDS)
def test_they_are_the_first_points_and_count(kind: str, method: str) -> None:
    given, keep = problem(output_covariance=kind), POINTS[:5]
    design = fp.exchange(given, 12, keep=keep, method=method, **QUICK | {"max_iterations": 2})
    assert len(design.points) == 12 and design.n_kept == 5 and design.n_previous == 0
    np.testing.assert_array_equal(design.points.table[:5], keep.table)
    # F is that of all twelve.
    assert design.evaluation.log_det == pytest.approx(fp.evaluate(given, design.points).log_det, rel=1e-9)
    efficiency = design.efficiency
    assert efficiency is not None and efficiency.at_least is not None and 0 < efficiency.at_least <= 1


def test_the_others_are_chosen_beside_them() -> None:
    """Of designs that know nothing of what is kept, few tell as much with it."""
    hydraulic = problem(parameters=("E_oil", "p_t", "B_v", "c_L"))
    keep = fp.exchange(hydraulic, 4, **QUICK | {"max_iterations": 40}, method=fp.ExchangeMethod(references=False)).points[
        [0, 1, 2, 3] * 2
    ]
    design = fp.exchange(problem(), 13, keep=keep, **QUICK | {"max_iterations": 40}, method=fp.ExchangeMethod(references=False))
    blind = fp.exchange(problem(), 5, **QUICK | {"max_iterations": 40}, method=fp.ExchangeMethod(references=False)).points
    assert design.evaluation.log_det > fp.evaluate(problem(), fp.Experiments.join([keep, blind])).log_det


def test_with_previous_points_both_count() -> None:
    design = fp.exchange(problem(), 8, keep=POINTS[:3], previous=POINTS[3:7], **QUICK)
    assert (design.n_previous, design.n_kept, len(design.points)) == (4, 3, 8)
    together = fp.evaluate(problem(), design.points, previous=POINTS[3:7])
    assert design.evaluation.log_det == pytest.approx(together.log_det, rel=1e-9)


def test_a_design_can_be_kept_and_saved(tmp_path: Path) -> None:
    first = fp.exchange(problem(), 6, **QUICK, method=fp.ExchangeMethod(references=False))
    more = fp.exchange(problem(), 9, keep=first, **QUICK)
    np.testing.assert_array_equal(more.points.table[:6], first.points.table)
    assert "Points 1 to 6 were given, and kept" in " ".join(str(more.report()).split())
    more.save(tmp_path)
    again = fp.Design.load(tmp_path)
    assert again.n_kept == 6 and str(again.report()) == str(more.report())


@pytest.mark.parametrize(
    ("keep", "error", "message"),
    [
        (POINTS, ValueError, "keep: expected fewer points than n_experiments, 12, and at least one; given 16"),
        (POINTS[:0], ValueError, "keep: expected fewer points than n_experiments, 12, and at least one; given 0"),
        ([[1.0, 2.0]], TypeError, "keep: expected Experiments or a Design of points, given list"),
        (point(v=-1e-3, p_A=15e6, p_B=3e6), ValueError, "keep: expected valid points, given points[0], which is none: met_jump"),
    ],
)
def test_what_cannot_be_kept_is_refused(keep: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message.replace("[", r"\[").replace("]", r"\]")):
        fp.exchange(problem(jumps="exclude"), 12, keep=keep, **QUICK)


def test_points_that_break_a_limit_on_their_way_are_refused() -> None:
    given = problem(along=["v < -10"])
    with pytest.raises(ValueError, match=r"keep: expected valid points, given points\[0\]"):
        fp.exchange(given, 4, keep=POINTS[:1], **QUICK)


def test_the_command_line_keeps_points_and_adds_to_data(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    keep, data = tmp_path / "keep.csv", tmp_path / "data.csv"
    POINTS[:2].to_csv(keep, MODEL)
    rig = fp.VirtualRig(MODEL, MODEL.theta(MODEL.nominal), {"q": 5e-6, "p_A": 2e4, "p_B": 2e4, "x_v": 1e-3})
    rig.measure(POINTS[2:9]).to_csv(data, MODEL)
    file = tmp_path / "problem.toml"
    text = (EXAMPLES / "cylinder.toml").read_text().replace("n_candidates = 50", "n_candidates = 5")
    file.write_text(text.replace("max_iterations = 400", "max_iterations = 2"))
    out = tmp_path / "run"
    with pytest.raises(SystemExit) as left:
        cli.main(["design", str(file), "-o", str(out), "--no-plots", "--keep", str(keep), "--previous", str(data)])
    assert left.value.code == 0, capsys.readouterr().err
    design = fp.Design.load(out)
    assert (design.n_kept, design.n_previous, len(design.points)) == (2, 7, 12)
    np.testing.assert_allclose(design.points.table[:2], POINTS[:2].table, rtol=1e-12)
