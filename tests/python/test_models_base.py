"""What any model has, and points of models without state, without input, or without either name."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest

import fisherpoint as fp
from defaults import MODEL


def test_the_cylinder_is_a_model_with_its_scales() -> None:
    assert isinstance(MODEL, fp.Model)
    assert [quantity.scale for quantity in MODEL.states] == [0.5, 1.0, 1e7, 1e7, 1.0]
    assert [axis.name for axis in MODEL.axes] == ["q", "v", "p_A", "p_B", "x_v", "u", "dt"]
    assert MODEL.domain[:2] == ("p_A - p_t", "p_s - p_A")
    again = pickle.loads(pickle.dumps(fp.HydraulicCylinder(k_u=1.0)))
    assert again == fp.HydraulicCylinder(k_u=1.0) != MODEL
    assert hash(again) == hash(fp.HydraulicCylinder(k_u=1.0))


def test_limits_are_the_distances_to_tank_and_supply() -> None:
    limits = MODEL.limits([0.1, 0.2, 6e6, 10e6, 0.3], 0.1, MODEL.theta(MODEL.nominal))
    assert limits[:4] == pytest.approx([5.5e6, 15e6, 9.5e6, 11e6])


def test_points_without_state_need_no_dt(tmp_path: Path) -> None:
    points = fp.Experiments(np.empty((3, 0)), [1.0, 2.0, 3.0])
    assert points.dt.tolist() == [1.0, 1.0, 1.0]
    points.to_csv(tmp_path / "points.csv")
    assert (tmp_path / "points.csv").read_text().split() == ["u_0", "1.0", "2.0", "3.0"]
    with pytest.raises(ValueError, match=r"dt: expected durations in s, given none"):
        fp.Experiments([[1.0]], [1.0])


def test_points_without_input_have_columns_for_states_and_dt(tmp_path: Path) -> None:
    points = fp.Experiments([[1.0], [2.0]], np.empty((2, 0)), [0.1, 0.2], columns=("c",))
    points.to_csv(tmp_path / "points.csv")
    assert (tmp_path / "points.csv").read_text().split() == ["c,dt", "1.0,0.1", "2.0,0.2"]


def test_a_problem_asks_for_the_natural_size_of_a_state_that_keeps_far_below_one() -> None:
    def tank(unit: object) -> fp.SymbolicModel:
        return fp.SymbolicModel(["-k*sqrt(v)"], ["v"], {"v": unit}, {}, {"k": "1"}, {"v": "m3"})

    def problem(model: fp.SymbolicModel, largest: float) -> fp.DesignProblem:
        region = fp.ExperimentRegion({"v": (largest / 2, largest), "dt": (0.1, 1.0)})
        return fp.DesignProblem(model, fp.GaussianPrior({"k": 1e-3}, relative_std={"k": 0.1}), region, noise={"v": 1e-6})

    with pytest.warns(RuntimeWarning, match=r"v: expected its natural size.*write \('m3', 0.002\)"):
        problem(tank("m3"), 2e-3)
    problem(tank(("m3", 1e-3)), 2e-3)  # pytest takes a warning for an error
    problem(tank("m3"), 0.3)
