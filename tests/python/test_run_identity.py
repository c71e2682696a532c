"""Which runs are the same: their starts, and how these are found, inputs and durations, wherever replicates are looked for."""

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.campaign.repeated import check_new
from fisherpoint.design.runs.design_runs import _matrix
from fisherpoint.information.previous import previous_information

MODEL = fp.SymbolicModel(["k*(u - x)", "x - z"], ["z"], {"x": "1", "z": "1"}, {"u": "1"}, {"k": "1"}, {"y": "1"})
LOW, HIGH = fp.Rest({"u": 0.01}), fp.Rest({"u": 1.0})


def runs(rest: Any, count: int = 2, **more: Any) -> fp.Runs:
    given = {"x0": [[0.5, 0.5]] * count, "u": [[0.3, 0.8, 0.1]] * count, "dt": 0.5} | more
    return fp.Runs(**given, rest=rest)


def test_runs_from_different_rests_are_no_replicates() -> None:
    different = runs([LOW, HIGH, LOW, None], 4)
    assert [part.tolist() for part in different.distinct()] == [[0, 1, 3], [0, 1, 0, 2]]
    data = fp.VirtualRig(MODEL, {"k": 1.3}, {"y": 1e-4}).measure(different)
    fit = fp.estimate(MODEL, data, start={"k": 0.8}, noise={"y": 1e-4})
    assert fit.converged and fit.estimate["k"] == pytest.approx(1.3, abs=1e-3)


@pytest.mark.parametrize("seed", range(8))
def test_an_estimate_is_that_of_runs_simulated_one_by_one(seed: int) -> None:
    """Replicates, and runs that differ in one thing alone: start, rest, an input, a duration, or what is measured."""
    rng = np.random.default_rng(seed)
    base = {"x0": [0.5, 0.2], "u": [0.3, 0.8, 0.1], "dt": [0.5, 0.2, 0.4], "measured": [True, False, True], "rest": None}
    others = {"x0": [0.5, -0.2], "u": [0.3, 0.8, 0.6], "dt": [0.5, 0.2, 0.9], "measured": [False, True, True], "rest": HIGH}
    kinds = [base, *({**base, name: value} for name, value in others.items()), {**base, "rest": LOW}]
    kinds.append({**base, "dt": [0.5, 0.2, 0.0]})  # two segments, and what stands behind them says nothing
    kinds[-1]["measured"] = [True, True, False]
    kinds.append({**kinds[-1], "u": [0.3, 0.8, 7.0]})
    chosen = rng.permutation([*range(len(kinds)), *rng.integers(0, len(kinds), 6)])
    arrays = {name: np.array([kinds[k][name] for k in chosen]) for name in base if name != "rest"}
    many = fp.Runs(**arrays, rest=[kinds[k]["rest"] for k in chosen])
    first, of = many.distinct()
    same = np.where(chosen == len(kinds) - 1, len(kinds) - 2, chosen)
    assert (same[first][of] == same).all() and len(first) == len(set(same))
    data = fp.VirtualRig(MODEL, {"k": 1.3}, {"y": 1e-3}, seed=seed).measure(many)
    whole = fp.estimate(MODEL, data, start={"k": 1.0}, noise={"y": 1e-3})
    single = fp.estimate(MODEL, [data[k] for k in range(len(many))], start={"k": 1.0}, noise={"y": 1e-3})
    assert whole.estimate["k"] == pytest.approx(single.estimate["k"], rel=1e-9)
    assert whole.standard_errors["k"] == pytest.approx(single.standard_errors["k"], rel=1e-9)


def test_files_of_runs_from_rests_a_hundred_apart_are_read(tmp_path: Path) -> None:
    """The rests are 0.01 and 1, and so are the outputs next to them; replicates in other units are still refused."""
    many = runs([LOW, HIGH, LOW, HIGH], 4, u=[[0.01, 0.01, 0.01]] * 4, dt=1e-3)
    data = fp.VirtualRig(MODEL, {"k": 1.3}, {"y": 1e-6}).measure(many)
    assert np.abs(data.y[1] / data.y[0] / 100 - 1).max() < 0.01
    data.to_csv(tmp_path / "data.csv", MODEL)
    assert fp.Measurements.from_table(tmp_path / "data.csv", MODEL) == data
    wrong = fp.Measurements(runs(LOW, 4), np.tile([[1.0], [1.01], [100.0], [1.02]], (1, 3)))
    wrong.to_csv(tmp_path / "wrong.csv", MODEL)
    with pytest.raises(ValueError, match="a factor of 100"):
        fp.Measurements.from_table(tmp_path / "wrong.csv", MODEL)


def test_replicates_of_which_other_segments_are_measured_are_compared(tmp_path: Path) -> None:
    there = np.array([[True, True, False], [False, True, True]] * 2)
    y = np.where(there, [[1.0], [1.01], [100.0], [1.02]] * np.ones(3), np.nan)
    fp.Measurements(runs(LOW, 4, measured=there), y).to_csv(tmp_path / "wrong.csv", MODEL)
    with pytest.raises(ValueError, match="a factor of 100"):
        fp.Measurements.from_table(tmp_path / "wrong.csv", MODEL)


def test_minus_zero_is_zero(tmp_path: Path) -> None:
    plus, minus = ({"x0": [[zero, 0.5]], "u": [[zero, 0.8]], "rest": [fp.Rest({"u": zero}, states=["z"])]} for zero in (0.0, -0.0))
    many = fp.Runs.join([fp.Runs(dt=0.5, **one) for one in (plus, minus)])
    assert many.distinct()[0].tolist() == [0] and many[0] == many[1]
    points = fp.Experiments([[0.0, 1.0], [-0.0, 1.0]], [-0.0, 0.0], [1.0, 1.0])
    assert [part.tolist() for part in fp.Runs.of_points(points).distinct()] == [[0], [0, 0]]
    fp.Runs(dt=0.5, **minus).to_csv(tmp_path / "runs.csv", MODEL)
    assert fp.Runs.from_csv(tmp_path / "runs.csv", MODEL) == fp.Runs(dt=0.5, **plus)
    for of in (many, points):
        first, again = (fp.Measurements(of[[k]], np.array([[0.25, 0.5]]) if of is many else [0.25]) for k in (0, 1))
        refused: Any = pytest.raises(ValueError, match="given those of batch 1")
        with refused if of is many else pytest.warns(match="is also in"):
            check_new([first], again)


def test_campaigns_take_runs_from_other_rests_for_new() -> None:
    y = np.array([[0.25, 0.5, 0.75]])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_new([fp.Measurements(runs(LOW, 1), y)], fp.Measurements(runs(HIGH, 1), y))
    with pytest.raises(ValueError, match="given those of batch 1"):
        check_new([fp.Measurements(runs(LOW, 1), y)], fp.Measurements(runs(LOW, 1), y))


def test_the_order_of_resting_states_does_not_matter() -> None:
    a, b = fp.Rest({"u": 0.1}, states=["x", "z"]), fp.Rest({"u": 0.1}, states=["z", "x"])
    assert a == b and hash(a) == hash(b) and runs([a, b]).distinct()[0].tolist() == [0]
    assert a != fp.Rest({"u": 0.1}, states=["x"]) and a != fp.Rest({"u": 0.2}, states=["x", "z"])


def test_runs_that_are_only_padded_are_equal() -> None:
    short, long = runs(LOW, 1), runs(LOW, 1, u=[[0.3, 0.8, 0.1, 0.4]])
    assert fp.Runs.join([short, long])[0] == short and fp.Runs.join([short, long]) != fp.Runs.join([long, short])


def test_runs_go_different_ways_from_where_they_differ() -> None:
    base = runs([LOW, HIGH])
    u = base.u.copy()
    u[1, 2] += 0.1
    assert runs([LOW, HIGH], u=u).first_difference(base, np.array([0, 1])).tolist() == [3, 2]
    assert base.first_difference(base, np.array([0, 0])).tolist() == [3, 0]
    assert runs([LOW, HIGH], x0=[[0.5, 0.5], [0.5, 0.6]]).first_difference(base, np.array([0, 1])).tolist() == [3, 0]
    assert runs(None).first_difference(base, np.array([0, 1])).tolist() == [0, 0]


@pytest.mark.parametrize("kind", ["noise", "region", "pooled", "pointwise"])
def test_a_run_of_one_segment_is_a_point(kind: str) -> None:
    region = fp.ExperimentRegion({"x": (0.0, 0.2), "z": (0.0, 0.2), "u": (0.5, 1.0), "dt": (0.5, 2.0)})
    prior = fp.GaussianPrior({"k": 1.0}, relative_std={"k": 0.1})
    problem = fp.DesignProblem(MODEL, prior, region, noise={"y": 0.01}, output_covariance=kind, initial_state_std={"x": 0.02})
    points = fp.Experiments([[0.0, 0.1], [0.1, 0.0], [0.2, 0.2]], [0.5, 0.8, 1.0], [0.6, 1.0, 1.9])
    alone = fp.Runs.of_points(points)
    data = fp.VirtualRig(MODEL, {"k": 1.1}, {"y": 0.01}, seed=1).measure(points)
    for previous in (None, data):
        evaluations = [fp.evaluate(problem, one, previous=previous) for one in (points, alone)]
        assert evaluations[0].to_pandas().equals(evaluations[1].to_pandas())
        assert np.array_equal(evaluations[0].output_covariance, evaluations[1].output_covariance)
    fits = [
        fp.estimate(MODEL, one, prior=prior, noise={"y": 0.01}, deviations=fp.Deviations(initial_state_std={"x": 0.02}))
        for one in (data, fp.Measurements(alone, data.y[:, None]))
    ]
    assert np.array_equal(fits[0].covariance, fits[1].covariance) and fits[0].chi_square == fits[1].chi_square


def test_runs_are_designed_beside_points_with_the_scatter_of_their_starts() -> None:
    prior = fp.GaussianPrior({"k": 1.0}, relative_std={"k": 0.1})
    problem = fp.DesignProblem(MODEL, prior, None, noise={"y": 0.01}, initial_state_std={"x": 0.02})
    points = fp.Experiments([[0.0, 0.1], [0.1, 0.0], [0.2, 0.2]], [0.5, 0.8, 1.0], [0.6, 1.0, 1.9])
    for previous in (points, fp.Runs.of_points(points)):
        known, _ = previous_information(problem, previous, 1)
        expected = fp.evaluate(problem, points).information
        assert _matrix(problem, known, 1) == pytest.approx(expected, rel=1e-12)
