"""Designs beside local parameters: against the whole information of all unknowns, and fleets of plants."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.data.plans import planned
from fisherpoint.information.nuisance import marginal_rows
from fisherpoint.information.previous import previous_information
from local_cases import NOISE, START, cart, measured

STD = {"d": 0.3, "c": 0.1, "m_load": 1.0}
RUNS = measured(5, 8).points
PRIOR = fp.GaussianPrior(mean=START, std=STD)


def problem(region: Any = None, **options: Any) -> fp.DesignProblem:
    return fp.DesignProblem(cart(), PRIOR, region, noise={"y": NOISE}, **options)


def brute_force(runs: fp.Points, groups: Sequence[int], spread: float | None, weights: np.ndarray | None = None) -> np.ndarray:
    """F (2, 2) of friction from the matrix of all unknowns, a load for each group; sensitivities from finite differences."""
    theta = np.array(list(START.values()))
    steps = 1e-3 * np.eye(3)

    def outputs(at: np.ndarray) -> np.ndarray:
        return fp.simulate(cart(), runs, at, rtol=1e-12).y.reshape(len(runs), -1)

    columns = [
        (8 * (outputs(theta + h) - outputs(theta - h)) - outputs(theta + 2 * h) + outputs(theta - 2 * h)) / 12e-3 for h in steps
    ]
    j = np.stack(columns, axis=2) * np.array(list(STD.values())) / NOISE
    whole = np.zeros((*j.shape[:2], 2 + max(groups) + 1))
    for k, group in enumerate(groups):
        whole[k, :, :2], whole[k, :, 2 + group] = j[k, :, :2], j[k, :, 2]
    rows = whole.reshape(-1, whole.shape[2])
    rows = rows if weights is None else weights @ rows
    information = rows.T @ rows
    if spread is not None:
        information[2:, 2:] += np.eye(max(groups) + 1) * (STD["m_load"] / spread) ** 2
    own = information[2:, 2:]
    return np.asarray(information[:2, :2] - information[:2, 2:] @ np.linalg.solve(own, information[2:, :2]))


@pytest.mark.parametrize("spread", [None, 0.5])
@pytest.mark.parametrize(("by", "groups"), [("run", range(5)), ("record", range(5)), ("plant", [0] * 5)])
def test_information_is_that_of_all_unknowns(by: str, groups: Sequence[int], spread: float | None) -> None:
    found = fp.evaluate(problem(local={"m_load": fp.Local(by, spread=spread)}, rtol=1e-10), RUNS)
    assert found.parameters == ("d", "c")
    assert found.information == pytest.approx(brute_force(RUNS, groups, spread), rel=1e-8)


def test_a_known_spread_is_what_varies() -> None:
    local = fp.evaluate(problem(local={"m_load": fp.Local("run", spread=0.5)}), RUNS)
    varies = fp.evaluate(problem(parameters=["d", "c"], varies={"m_load": 0.5}), RUNS)
    assert local.information == pytest.approx(varies.information, rel=1e-8)
    plant = fp.evaluate(problem(local={"m_load": fp.Local("plant", spread=0.5)}), RUNS)
    uncertain = fp.evaluate(problem(parameters=["d", "c"], uncertain={"m_load": 0.5}), RUNS)
    assert plant.information == pytest.approx(uncertain.information, rel=1e-8)


def test_a_wide_spread_comes_close_to_none() -> None:
    none = fp.evaluate(problem(local={"m_load": "run"}), RUNS).information
    errors = [
        np.abs(fp.evaluate(problem(local={"m_load": fp.Local("run", spread=s)}), RUNS).information / none - 1).max()
        for s in (1e2, 1e3, 1e4)
    ]
    assert errors[0] > 50 * errors[1] > 2500 * errors[2] > 0 and errors[2] < 1e-8


def test_points_are_like_runs() -> None:
    points = fp.Experiments(RUNS.x0 + np.arange(5)[:, None] / 5, RUNS.u[:, 0], np.full(5, 0.3))
    one_each = fp.evaluate(problem(local={"m_load": "plant"}), points)
    assert one_each.information == pytest.approx(brute_force(points, [0] * 5, None), rel=1e-6)
    spread = fp.evaluate(problem(local={"m_load": fp.Local("run", spread=0.5)}), points)
    assert spread.information == pytest.approx(brute_force(points, range(5), 0.5), rel=1e-6)


def test_noise_with_a_memory_goes_with_it() -> None:
    noise = {"y": fp.Noise(NOISE, colored=fp.GaussMarkov(0.02, 0.5))}
    given = fp.DesignProblem(cart(), PRIOR, None, noise=noise, local={"m_load": "run"}, rtol=1e-10)
    t = np.arange(1, 9) * 0.2
    covariance = NOISE**2 * np.eye(8) + 0.02**2 * np.exp(-np.abs(t[:, None] - t) / 0.5)
    white = np.kron(np.eye(5), np.linalg.inv(np.linalg.cholesky(covariance))) * NOISE
    assert fp.evaluate(given, RUNS).information == pytest.approx(brute_force(RUNS, range(5), None, white), rel=1e-7)


@pytest.mark.parametrize("spread", [None, 0.5])
def test_previous_data_of_other_plants_have_loads_of_their_own(spread: float | None) -> None:
    given = problem(local={"m_load": fp.Local("plant", spread=spread)}, rtol=1e-10)
    others = fp.Measurements(RUNS[:3], np.zeros((3, 8, 1)), labels={"plant": ["A", "A", "B"]})
    expected = brute_force(RUNS, [0, 0, 1, 2, 2], spread)
    assert fp.evaluate(given, RUNS[3:], previous=others).information == pytest.approx(expected, rel=1e-8)
    parts = [others[:1], others[1:]]
    assert fp.evaluate(given, RUNS[3:], previous=parts).information == pytest.approx(expected, rel=1e-8)
    same = fp.Measurements(RUNS[1:3], np.zeros((2, 8, 1)))
    both = fp.evaluate(given, RUNS[3:], previous=[others[:1], same])
    assert both.information == pytest.approx(brute_force(RUNS, [0, 1, 1, 1, 1], spread), rel=1e-8)
    assert len(previous_information(given, others, 1)[0] or ()) == 24


def test_a_plant_that_says_nothing_of_its_own_value_loses_nothing() -> None:
    """With pumps at rest nothing shows their gain, and not knowing it costs nothing; two values that look alike cost one row."""
    given, rng = tanks().replace(rtol=1e-10), np.random.default_rng(0)
    x0 = rng.uniform(0.3, 2.0, (5, 2))
    still = fp.Experiments(x0, np.zeros((5, 1)), np.full(5, 20.0))
    known = fp.evaluate(given.replace(local=None, parameters=["k1", "k2", "k3"]), still)
    assert fp.evaluate(given, still).information == pytest.approx(known.information, rel=1e-9)
    moving = fp.Experiments(x0, np.ones((5, 1)), np.full(5, 20.0))
    both = [planned(one, 1, {"plant": name}) for one, name in ((still, "A"), (moving, "B"))]
    of_moving = fp.evaluate(given, moving).information
    for points, others in ((still, both[1]), (moving, both[0])):
        found = fp.evaluate(given, points, previous=others).information
        assert found == pytest.approx(known.information + of_moving, rel=1e-8)
    rows = rng.standard_normal((6, 4))
    twice = np.column_stack([rows, rows[:, 3]])  # of two unknowns only the sum shows
    left, expected = marginal_rows(twice, 2), marginal_rows(rows, 1)
    assert left.T @ left == pytest.approx(expected.T @ expected, rel=1e-10)


def test_designs_are_found_and_saved(tmp_path: Path) -> None:
    region = fp.RunRegion({"v": 0.0, "F": (1, 6), "dt": 0.2}, segments=8)
    for by in ("run", "plant"):
        design = fp.design_runs(problem(region, local={"m_load": by}), n_runs=2, n_starts=1, n_candidates=20)
        groups = range(2) if by == "run" else [0, 0]
        assert design.evaluation.information == pytest.approx(brute_force(design.points, groups, None), rel=1e-4)
        other = fp.design_runs(problem(region, parameters=["d", "c"]), n_runs=2, n_starts=1, n_candidates=20)
        its = np.linalg.slogdet(brute_force(other.points, groups, None))[1]
        assert np.linalg.slogdet(design.evaluation.information)[1] > its - 1e-3  # one that knows the load is no better
        assert f"m_load of each {by}" in str(design.report())
        design.save(tmp_path / by)
        assert fp.RunDesign.load(tmp_path / by).problem.local == {"m_load": fp.Local(by)}


def test_points_of_a_plant() -> None:
    region = fp.ExperimentRegion({"v": (0.0, 2.0), "F": (1, 6), "dt": (0.05, 0.5)})
    quick: dict[str, Any] = {"n_candidates": 20, "max_iterations": 4}
    given = problem(region, local={"m_load": "plant"})
    design = fp.exchange(given, 6, method=fp.ExchangeMethod(references=False), **quick)
    assert design.evaluation.rank == 2
    assert design.evaluation.information == pytest.approx(brute_force(design.points, [0] * 6, None), rel=1e-4)
    with pytest.raises(ValueError, match="method: expected 'auto' beside m_load, local to a plant and without a spread"):
        fp.exchange(given, 6, method="paper", **quick)


# Fleets


def tanks() -> fp.DesignProblem:
    @fp.model(
        states={"h1": "m", "h2": "m"},
        inputs={"u": "V"},
        parameters={"k1": "m^0.5/s", "k2": "m^0.5/s", "k3": "m^0.5/s", "k4": "m/(s V)"},
        outputs={"y": "m"},
    )
    def tanks(x: Any, u: Any, p: Any) -> Any:
        return [-p.k1 * fp.math.sqrt(x.h1) + p.k4 * u.u, p.k2 * fp.math.sqrt(x.h1) - p.k3 * fp.math.sqrt(x.h2)], [x.h2]

    mean = {"k1": 0.05, "k2": 0.05, "k3": 0.05, "k4": 0.02}
    prior = fp.GaussianPrior(mean=mean, relative_std=dict.fromkeys(mean, 0.2))
    region = fp.ExperimentRegion({"h1": (0.2, 2.0), "h2": (0.2, 2.0), "u": (0.0, 5.0), "dt": (5.0, 30.0)})
    return fp.DesignProblem(tanks, prior, region, noise={"y": 0.005}, local={"k4": "plant"})


@pytest.mark.long
@pytest.mark.parametrize("seed", range(10))
def test_a_fleet_of_five_tanks_is_regular(seed: int) -> None:
    """Two points say nothing alone of four unknowns; those of five tanks determine the three that are shared."""
    fleet = fp.design_fleet(tanks(), 5, 2, starts=1, rounds=1, max_iterations=2, seed=seed)
    assert fleet.evaluation.rank == 3 and len(fleet.points) == 5 and not fleet.alike
    assert all(np.isfinite(error) for error in (fleet.evaluation.standard_errors or {"": np.inf}).values())


def test_one_design_for_all_adds_up(tmp_path: Path) -> None:
    given = tanks()
    fleet = fp.design_fleet(given, ["A", "B", "C"], 5, alike=True, starts=1)
    assert fleet.alike and list(fleet.points) == ["A", "B", "C"]
    alone = fp.evaluate(given, fleet.points["A"])
    assert fleet.evaluation.information == pytest.approx(3 * alone.information, rel=1e-9)
    fleet.to_csv(tmp_path / "fleet.csv")
    rows = (tmp_path / "fleet.csv").read_text().splitlines()
    assert rows[0] == "h1,h2,u,dt,plant" and [row[-1] for row in rows[1:]] == ["A"] * 5 + ["B"] * 5 + ["C"] * 5
    (tmp_path / "data.csv").write_text("\n".join([rows[0] + ",y_y", *(row + ",0.5" for row in rows[1:])]) + "\n")
    data = fp.Measurements.from_csv(tmp_path / "data.csv", given.model)
    assert data.labels == {"plant": ("A",) * 5 + ("B",) * 5 + ("C",) * 5}
    assert "All have the same." in str(fleet) and "k4 of each plant" in str(fleet)


# Misuse


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"local": {"mass": "run"}}, "local: expected names of d, c, m_load; given unknown 'mass'"),
        (
            {"local": {"m_load": "run"}, "parameters": ["d", "m_load"]},
            "parameters: expected those that all data share, given 'm_load'",
        ),
        (
            {"local": {"m_load": "run"}, "varies": {"m_load": 0.1}},
            "local: expected parameters that are not in varies, given 'm_load'",
        ),
        ({"local": dict.fromkeys(START, "run")}, "parameters: expected those that all data share, given 'd', which is local"),
        ({"local": {"m_load": "run"}, "assumed_covariance": "predictive"}, "local: expected a spread between points or runs"),
    ],
)
def test_misuse_is_one_line(options: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        problem(**options)


def test_points_that_say_nothing_are_refused() -> None:
    region = fp.ExperimentRegion({"v": (0.0, 2.0), "F": (1, 6), "dt": (0.05, 0.5)})
    with pytest.raises(
        ValueError, match="local: expected more than 1 measured output to know something beside 1 value of each point"
    ):
        problem(region, local={"m_load": "run"})
    single = fp.Experiments([[0.0], [1.0]], [[3.0], [4.0]], [0.2, 0.2])
    nothing = fp.evaluate(problem(local={"m_load": "run"}), single)
    assert nothing.rank == 0 and nothing.standard_errors is None and not nothing.information.any()


def test_what_cannot_have_local_parameters_says_so() -> None:
    given = problem(local={"m_load": "run"})
    with pytest.raises(ValueError, match=r"local: expected parameters that are local to a plant, as .*, given labels none"):
        fp.design_fleet(given, 3, 2)
    with pytest.raises(ValueError, match="plants: expected at least one label, and each once; given A, A"):
        fp.design_fleet(tanks(), ["A", "A"], 2)


@pytest.mark.parametrize("alike", [False, True])
def test_a_fleet_is_saved_and_shown(alike: bool, tmp_path: Path) -> None:
    given = tanks()
    fleet = fp.design_fleet(given, ["A", "B"], 4, alike=alike, starts=1, rounds=1, n_candidates=10, max_iterations=2)
    fleet.save(tmp_path / "fleet")
    again = fp.FleetDesign.load(tmp_path / "fleet")
    assert again.points == fleet.points and again.settings == fleet.settings and str(again) == str(fleet)
    rows = (tmp_path / "fleet" / "design.csv").read_text().splitlines()
    assert rows[0] == "h1,h2,u,dt,plant" and [row[-1] for row in rows[1:]] == ["A"] * 4 + ["B"] * 4
    # What a plant says of a parameter: from the whole matrix of sensitivities, without the rows of the other's.
    for name in fleet.evaluation.parameters:
        assert sum(of[name] for of in fleet.shares.values()) == pytest.approx(1)
        if alike:
            assert fleet.shares["A"][name] == pytest.approx(0.5)
    each = [fp.evaluate(given, one).information for one in fleet.points.values()]
    assert fleet.evaluation.information == pytest.approx(sum(each), rel=1e-8)
    assert set(fleet._plots()) == {"plants", "standard_errors", "correlation"}
    with pytest.raises(ValueError, match="expected a file of format 'fisherpoint Design', given another"):
        fp.Design.load(tmp_path / "fleet")
    with pytest.raises(ValueError, match="kind: expected"):
        fleet.plot("points")


def test_runs_of_a_fleet_have_a_time_table(tmp_path: Path) -> None:
    region = fp.RunRegion({"v": 0.0, "F": (1, 6), "dt": 0.2}, segments=4)
    given = problem(region, local={"m_load": "rig"})
    fleet = fp.design_fleet(given, 2, 1, starts=1, rounds=1, n_candidates=5)
    fleet.save(tmp_path)
    assert (tmp_path / "design.csv").read_text().splitlines()[0].endswith("rig")
    assert (tmp_path / "plan.csv").exists() and fp.FleetDesign.load(tmp_path).points == fleet.points
    fleet.to_html(tmp_path / "fleet.html", pictures=False)
    assert "Runs of rig 2" in (tmp_path / "fleet.html").read_text()


def test_one_plant_is_a_fleet() -> None:
    fleet = fp.design_fleet(tanks(), 1, 5, starts=1, rounds=1, n_candidates=10, max_iterations=2)
    assert list(fleet.points) == ["1"] and fleet.alike and "All have the same" not in str(fleet)
    assert all(share == pytest.approx(1) for share in fleet.shares["1"].values())
    few = fp.design_fleet(tanks(), 2, 1, starts=1, rounds=1, n_candidates=5, max_iterations=1)  # fewer numbers than unknowns
    assert few.evaluation.covariance is None and not few.shares and "plants" not in few._plots() and "nan" not in str(few)
