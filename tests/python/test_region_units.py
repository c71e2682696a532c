"""Bounds of regions in units of their own, which are converted to the model's."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import pytest

import fisherpoint as fp

EXAMPLES = Path(__file__).parents[2] / "examples"
MODEL = fp.SymbolicModel(["k*u"], ["T"], {"T": "K"}, {"u": "W"}, {"k": "K/J"}, {"y": "K"})
GIVEN: dict[str, Any] = {"T": (20, 30, "degC"), "u": (0.5, "kW"), "dt": (1, 2, "min")}
BOUNDS = {"T": (293.15, 303.15), "u": (500.0, 500.0), "dt": (60.0, 120.0)}


def problem(region: fp.ExperimentRegion | fp.RunRegion) -> fp.DesignProblem:
    return fp.DesignProblem(MODEL, fp.GaussianPrior({"k": 1.0}, relative_std={"k": 0.1}), region, noise={"y": 0.1})


def test_a_problem_has_them_in_the_models_units() -> None:
    region = fp.ExperimentRegion(GIVEN, ["T < 300"])
    assert region.bounds["dt"] == (60.0, 120.0) and region.units == {"T": "degC", "u": "kW"}
    own = problem(region).region
    assert own == fp.ExperimentRegion(BOUNDS, ["T < 300"]) and own is not None and own.units == {}
    assert region.in_units_of(MODEL) == own != region and own.in_units_of(MODEL) is own
    assert "(20.0, 30.0, 'degC')" in repr(region)
    assert pickle.loads(pickle.dumps(region)) == region


def test_draws_are_in_the_models_units() -> None:
    region, own = fp.ExperimentRegion(GIVEN), fp.ExperimentRegion(BOUNDS)
    points = own.draw(MODEL, 20)
    assert region.draw(MODEL, 20) == points
    assert region.draw_at_edges(MODEL, 20) == own.draw_at_edges(MODEL, 20)
    assert region.draw_near(MODEL, points) == own.draw_near(MODEL, points)


def test_runs_have_them_too() -> None:
    settings: dict[str, Any] = {"segments": 3, "levels": {"u": [0.0, 500.0]}, "slew": {"u": 600.0}, "duration": 200.0, "samples": 2}
    region = fp.RunRegion({"T": (20, "degC"), "u": (0, 1, "kW"), "dt": (1, "min")}, **settings)
    own = problem(region).region
    assert own == fp.RunRegion({"T": 293.15, "u": (0.0, 1000.0), "dt": 60.0}, **settings) != region


def test_levels_and_slew_have_them() -> None:
    bounds = {"T": 293.15, "u": (0.0, 1000.0), "dt": 60.0}
    region = fp.RunRegion(bounds, 3, levels={"u": [0, 0.5, 1, "kW"]}, slew={"u": (0.6, "kW")})
    own = problem(region).region
    assert own == fp.RunRegion(bounds, 3, levels={"u": [0.0, 500.0, 1000.0]}, slew={"u": 600.0}) != region
    assert own is not None and own.in_units_of(MODEL) is own and region.in_units_of(MODEL) == own
    assert pickle.loads(pickle.dumps(region)) == region


def test_a_slew_of_a_temperature_is_a_difference() -> None:
    heated = fp.SymbolicModel(["k*(u - T)"], ["T"], {"T": "K"}, {"u": "K"}, {"k": "1/s"}, {"y": "K"})
    bounds = {"T": (20, "degC"), "u": (20, 40, "degC"), "dt": 60.0}
    region = fp.RunRegion(bounds, 3, levels={"u": [20, 30, "degC"]}, slew={"u": (10, "degC")}).in_units_of(heated)
    assert region.levels["u"] == (293.15, 303.15) and region.slew["u"] == pytest.approx(10.0)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"levels": {"u": [0, 1, "Pa"]}}, r"levels\['u'\]: expected a unit of what is in 'W', given 'Pa'"),
        ({"slew": {"u": (1, "Pa")}}, r"slew\['u'\]: expected a unit of what is in 'W', given 'Pa'"),
        ({"levels": {"u": [0, 1, "kX"]}}, r"levels\['u'\]: expected a unit such as .*unknown unit 'kX'"),
        ({"levels": {"u": [0, 2, "kW"]}}, r"levels\['u'\]: expected values within 0 and 1000"),
        ({"slew": {"u": (1, 2, "kW")}}, r"slew\['u'\]: expected a number, or \(number, unit\)"),
        ({"slew": {"u": (-1, "kW")}}, r"slew\['u'\]: expected"),
    ],
)
def test_mistakes_in_levels_and_slew_are_told(settings: dict[str, Any], message: str) -> None:
    with pytest.raises((ValueError, TypeError), match=message):
        problem(fp.RunRegion({"T": 293.15, "u": (0.0, 1000.0), "dt": 60.0}, 3, **settings))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"dt": (1, 2, "m")}, r"region\['dt'\]: expected a unit of what is in 's', given 'm', which measures something else"),
        ({"T": (20, 30, "degX")}, r"region\['T'\]: expected a unit such as .*unknown unit 'degX'"),
        ({"T": (20, 30, "Pa")}, r"region\['T'\]: expected a unit of what is in 'K', given 'Pa'"),
        ({"T": (30, 20, "degC")}, r"region\['T'\]: expected lower <= upper, given \(30, 20\)"),
        ({"T": ("20", "30", "degC")}, r"region\['T'\]: expected"),
        ({"T": (20, 30, 40, "degC")}, r"region\['T'\]: expected"),
        ({"T": (20, 30, 40)}, r"region\['T'\]: expected a pair \(lower, upper\)"),
        ({"T": "degC"}, r"region\['T'\]: expected"),
    ],
)
def test_mistakes_are_told(changes: dict[str, Any], message: str) -> None:
    with pytest.raises((ValueError, TypeError), match=message):
        problem(fp.ExperimentRegion(GIVEN | changes))


def test_levels_are_checked_in_the_models_unit() -> None:
    region = fp.RunRegion({"T": (20, "degC"), "u": (0, 1, "kW"), "dt": 60.0}, segments=3, levels={"u": [0.0, 2000.0]})
    with pytest.raises(ValueError, match=r"levels\['u'\]: expected values within 0 and 1000, given"):
        problem(region)


def test_files_have_them_for_levels_and_slew(tmp_path: Path) -> None:
    text = (EXAMPLES / "reactor.toml").read_text()
    runs = '[runs]\nlevels = { T = { values = [100, 200], unit = "degC" } }\nslew = { T = { value = 50, unit = "degC" } }\n'
    (tmp_path / "own.toml").write_text(text.replace("[runs]\n", runs))
    region = fp.load_problem(tmp_path / "own.toml").region
    assert isinstance(region, fp.RunRegion)
    assert region.levels["T"] == (373.15, 473.15) and region.slew["T"] == pytest.approx(50.0)
