"""Designs of runs: published problems, gradients, what may vary, and which plants can run them."""

from __future__ import annotations

import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from bench.runs import decay, reactor
from fisherpoint.design.file.configuration import load_config
from fisherpoint.design.goal.scenario_average import Average
from fisherpoint.design.runs.run_moves import moved_runs
from fisherpoint.design.runs.run_objective import RunObjective
from fisherpoint.design.runs.run_pictures import limits_of
from fisherpoint.design.runs.run_profiles import PROFILES, draw_runs
from fisherpoint.design.runs.run_slopes import linear_rows
from fisherpoint.points.run_coordinates import RunCoordinates
from fisherpoint.points.settings import Integration
from fit_cases import EXAMPLES

FINE = Integration(1e-9)


def problem_of(
    model: fp.Model, mean: dict[str, float], noise: dict[str, float], region: fp.RunRegion, **options: Any
) -> fp.DesignProblem:
    prior = fp.GaussianPrior(mean, {name: 0.1 * value for name, value in mean.items()})
    return fp.DesignProblem(model, prior, region, noise=noise, **options)


def own_units(design: fp.RunDesign) -> float:
    """log det F of parameters that are not standardised."""
    return float(design.log_det - 2 * np.log(design.problem.std).sum())


def mover(**options: Any) -> fp.RunRegion:
    return fp.RunRegion({"x": 0.0, "v": 0.0, "u": (-1, 1), "dt": 0.5}, 8, **options)


def slider(region: fp.RunRegion, **options: Any) -> fp.DesignProblem:
    model = fp.SymbolicModel(
        f=["v", "b*u - c*v"],
        g=["x"],
        states={"x": "m", "v": "m/s"},
        inputs={"u": "1"},
        outputs={"y": "m"},
        parameters={"b": "1", "c": "1"},
    )
    return problem_of(model, {"b": 2.0, "c": 1.0}, {"y": 0.01}, region, **options)


@pytest.mark.long
@pytest.mark.parametrize("seed", range(3))
def test_the_reactor_reaches_its_best_known_value(seed: int) -> None:
    design = fp.design_runs(reactor().problem, seed=seed, n_starts=4)
    assert own_units(design) > 14.4998 - 1e-3  # what round numbers may cost
    assert design.again > 1 and design.stop_reason == "completed"
    np.testing.assert_allclose(design.runs.u[0, :3, 0], [300, 490.36, 300], atol=1.0)
    assert design.log_det == pytest.approx(np.linalg.slogdet(design.evaluation.information)[1], abs=1e-4)


@pytest.mark.long
@pytest.mark.parametrize("seed", range(3))
def test_the_decay_reaches_its_best_known_value(seed: int) -> None:
    design = fp.design_runs(decay().problem, seed=seed, n_starts=3)
    assert own_units(design) > 42.8697 - 1e-3
    np.testing.assert_allclose(design.runs.t[0], [0.01, 0.1753, 0.6679, 2.0025, 6.2531, 26.8048], rtol=2e-2)


def test_a_trap_is_told() -> None:
    """A heater of which one of two temperatures is measured: three of four parameters (published.md, problem 4)."""
    model = fp.SymbolicModel(
        f=["(U_a*(296 - T_H) + U_b*(T_S - T_H) + 0.032*u)*i_H", "U_b*(T_H - T_S)*i_S"],
        g=["T_S"],
        states={"T_H": ("K", 300.0), "T_S": ("K", 300.0)},
        inputs={"u": "1"},
        outputs={"T": "K"},
        parameters=dict.fromkeys(("U_a", "U_b", "i_H", "i_S"), "1"),
    )
    region = fp.RunRegion({"T_H": 296.0, "T_S": 296.0, "u": (0, 100), "dt": 60.0}, 10)
    mean = {"U_a": 0.0417, "U_b": 0.00944, "i_H": 0.1659, "i_S": 5.836}
    design = fp.design_runs(problem_of(model, mean, {"T": 0.25}, region), n_starts=2)
    assert design.evaluation.rank == 3 and design.evaluation.standard_errors is None
    (null,) = design.evaluation.null_directions
    assert set(null) == {"U_b", "i_H", "i_S"}  # the gain tells U_a
    assert "The runs determine 3 of 4 parameters" in str(design) and design.ridge == 1e-9
    told = " ".join(str(design).split())
    assert "1e-9 of the prior's information, to compare designs; no figure here contains it" in told
    assert "log det F of the rest" in told and np.isfinite(design.evaluation.log_det_estimable or np.inf)
    with pytest.raises(
        ValueError,
        match=r"^region: .*'error' requires; no run has information on 1.00 (i_H|U_b|i_S).*, in prior std: measure other",
    ):
        fp.design_runs(problem_of(model, mean, {"T": 0.25}, region), n_starts=2, goal=fp.Goal(singular="error"))
    short = fp.RunRegion({"T_H": 296.0, "T_S": 296.0, "u": (0, 100), "dt": 60.0}, 2)
    with pytest.raises(ValueError, match=r"^region: .*'error' requires; (these runs leave open|no run has information on) "):
        fp.design_runs(problem_of(model, mean, {"T": 0.25}, short), n_starts=1, goal=fp.Goal(singular="error"))


@pytest.mark.parametrize("kappa", [0.0, 3.0])
@pytest.mark.parametrize(("central", "error"), [(True, 2e-4), (False, 5e-3)])
def test_the_gradient_is_that_of_differences(kappa: float, central: bool, error: float) -> None:
    region = fp.RunRegion({"x": (0.0, 0.2), "v": 0.0, "u": (-1, 1), "dt": (0.2, 0.6)}, 6, measured=[False, True] * 3)
    model = slider(mover()).model.symbolic()
    assert isinstance(model, fp.SymbolicModel)
    limited = fp.SymbolicModel(
        f=["v", "b*u - c*v + 0.001*sqrt(1.2 - v)"], g=["x"], states={"x": "m", "v": "m/s"}, inputs={"u": "1"},
        outputs={"y": "m"}, parameters={"b": "1", "c": "1"}, constants={},
    )  # fmt: skip
    problem = problem_of(limited, {"b": 2.0, "c": 1.0}, {"y": 0.01}, region, uncertain=None, initial_state_std={"x": 0.01})
    coordinates = RunCoordinates(region, limited)
    plants = problem.theta * [[1.0, 1.0], [1.1, 0.9]]
    criteria = [fp.criterion(problem)] * 2
    objective = RunObjective(problem, coordinates, plants, Average.of_all(2), np.zeros((2, 2, 2)), criteria, FINE)
    objective.kappa = kappa
    z = np.random.default_rng(0).uniform(0.3, 0.7, (2, len(coordinates)))
    linear = linear_rows(objective, z, None, central, np.random.default_rng(0))
    assert linear is not None
    value, gradient = linear.value_and_gradient(np.zeros(z.size))

    def at(z: np.ndarray) -> float:
        return objective.of(objective.judged(objective.tried(z, None)))

    assert value == pytest.approx(at(z), rel=1e-9)
    assert objective.values(np.stack([z, z + 0.01])) == pytest.approx([at(z), at(z + 0.01)], rel=1e-9)
    expected = np.zeros_like(z)
    for index in np.ndindex(z.shape):
        step = np.zeros_like(z)
        step[index] = 3e-4
        expected[index] = (at(z + step) - at(z - step)) / 6e-4
    np.testing.assert_allclose(gradient.reshape(z.shape), expected, atol=error * np.abs(expected).max())
    step = np.random.default_rng(1).uniform(-0.01, 0.01, z.size)
    there = linear.value_and_gradient(step)
    ends = [linear.value_and_gradient(step + sign * 1e-6 * np.eye(z.size)[3])[0] for sign in (1, -1)]
    assert there[1][3] == pytest.approx((ends[0] - ends[1]) / 2e-6, rel=1e-5)
    assert there[0] == pytest.approx(at(z + step.reshape(z.shape)), abs=0.02 * abs(there[0] - value))


def test_levels_slew_lengths_and_samples_are_kept() -> None:
    problem = slider(mover(levels={"u": [-1, 0, 1]}, samples=3, measured=[False] * 2 + [True] * 6))
    design = fp.design_runs(problem, 2, n_starts=2, n_candidates=60)
    assert set(np.unique(design.runs.u)) <= {-1.0, 0.0, 1.0}
    assert (design.runs.measured.sum(axis=1) == 3).all() and not design.runs.measured[:, :2].any()
    assert design.evaluation.n_points == 6

    slow = fp.design_runs(slider(mover(slew={"u": 0.25})), n_starts=2, n_candidates=60)
    assert np.abs(np.diff(slow.runs.u[0, :, 0])).max() < 0.25 + 1e-12
    free = fp.design_runs(slider(mover()), n_starts=2, n_candidates=60)
    assert free.log_det > slow.log_det

    alike = fp.RunRegion(
        {"x": (0.0, 1.0), "v": 0.0, "u": (-1, 1), "dt": (0.1, 0.5)}, 5, constant=("u", "dt"), shared=("x", "dt"), duration=1.5
    )
    both = fp.design_runs(slider(alike), 2, n_starts=2, n_candidates=60).runs
    assert np.ptp(both.x0[:, 0]) == 0 and np.ptp(both.dt) == 0 and both.dt[0].sum() <= 1.5 + 1e-12
    assert np.ptp(both.u, axis=1).max() == 0


def test_few_samples_are_the_best_ones() -> None:
    """By trying all choices of 2 of 8 samples at the runs that were found."""
    problem = slider(mover(samples=2))
    design = fp.design_runs(problem, n_starts=3)
    runs = design.runs
    values = []
    for i in range(8):
        for j in range(i):
            measured = np.isin(np.arange(8), (i, j))
            information = fp.evaluate(problem, fp.Runs(runs.x0, runs.u, runs.dt, measured)).information
            values.append(np.linalg.slogdet(information)[1])
    assert design.log_det == pytest.approx(max(values), abs=1e-5)


@pytest.mark.long
def test_what_too_few_plants_can_run_is_avoided() -> None:
    """Walls at x = -1 and 1: at the prior mean the best run ends next to one, which half of the plants would hit."""
    model = fp.SymbolicModel(
        f=["v", "b*u - c*v + 0.001*sqrt(1 - x**2)"], g=["x"], states={"x": "m", "v": "m/s"}, inputs={"u": "1"},
        outputs={"y": "m"}, parameters={"b": "1", "c": "1"},
    )  # fmt: skip
    problem = problem_of(model, {"b": 2.0, "c": 1.0}, {"y": 0.01}, mover())
    bold = fp.design_runs(problem, n_starts=2, goal=fp.Goal(confidence=0.0))
    careful = fp.design_runs(problem, n_starts=2, goal=fp.Goal(confidence=0.99))
    assert bold.feasibility.share < 0.9 and bold.feasible
    assert careful.feasibility.share >= 0.99 and careful.feasible and careful.feasibility.draws == 1000
    assert careful.feasibility.interval[0] < careful.feasibility.share <= careful.feasibility.interval[1]
    assert careful.log_det < bold.log_det
    plants = np.random.default_rng(5).normal([2.0, 1.0], [0.2, 0.1], (4000, 2))
    done = fp.simulate(model, careful.runs[np.zeros(4000, dtype=int)], plants)
    assert (done.status == fp.Status.ok).mean() > 0.988


@pytest.mark.long
def test_seeds_threads_and_files(tmp_path: Path) -> None:
    problem = slider(mover())
    one = fp.design_runs(problem, 2, n_starts=2, n_candidates=60, seed=3, threads=1)
    two = fp.design_runs(problem, 2, n_starts=2, n_candidates=60, seed=3, threads=2)
    other = fp.design_runs(problem, 2, n_starts=2, n_candidates=60, seed=4)
    assert one.runs == two.runs and one.ends == two.ends and other.log_det == pytest.approx(one.log_det, abs=1e-3)
    one.save(tmp_path)
    kept = fp.RunDesign.load(tmp_path)
    assert str(kept) == str(one) and kept.runs == one.runs and kept.problem.region == problem.region
    assert str(pickle.loads(pickle.dumps(one))) == str(one)
    assert fp.Runs.from_csv(tmp_path / "design.csv", problem.model) == one.runs
    plan = (tmp_path / "plan.csv").read_text().splitlines()
    assert plan[0] == "run,t [s],u,measure" and all(len(entry) <= 17 for line in plan[1:] for entry in line.split(","))
    assert len(plan) == 1 + 2 * 9 and plan[1].endswith("no") and plan[9].endswith("yes")
    again = fp.design_runs(problem, 1, n_starts=2, n_candidates=60, previous=one)
    assert again.evaluation.n_points == 24 and again.log_det > one.log_det


def test_starts_that_end_without_a_value_are_told(tmp_path: Path) -> None:
    design = fp.design_runs(slider(mover()), n_starts=2)
    design = replace(design, ends=(design.ends[0], -np.inf))
    assert "1 ended at runs that touch a surface" in str(design) and "inf" not in str(design).split("Starts ended")[1][:60]
    design.save(tmp_path)
    assert fp.RunDesign.load(tmp_path).ends == design.ends


def test_classical_runs_stand_beside_the_design(tmp_path: Path) -> None:
    design = fp.design_runs(slider(mover()), n_starts=2)
    assert set(design.classical) == {"steps", "pulses", "binary sequences", "ramps", "sines and chirps"}
    assert all(-np.inf < value <= design.log_det + 1e-6 for value in design.classical.values())
    assert "Beside classical runs" in str(design) and "binary sequences" in str(design)
    # Those of one step, by hand.
    up = fp.Runs([[0.0, 0.0]], np.ones((1, 8, 1)), np.full((1, 8), 0.5))
    one_level = np.linalg.slogdet(fp.evaluate(design.problem, up).information)[1]
    assert design.classical["steps"] >= one_level - 1e-6
    design.save(tmp_path)
    again = fp.RunDesign.load(tmp_path)
    assert again.classical == design.classical and again.classical_shares == design.classical_shares
    assert set(design.classical_shares.values()) == {1.0}
    few = fp.design_runs(slider(mover(samples=3)), n_starts=1)
    assert max(few.classical.values()) <= few.log_det + 1e-6
    assert not fp.design_runs(slider(mover(constant=("u",))), n_starts=1).classical


@pytest.mark.long
def test_classical_runs_that_few_plants_can_run_are_told() -> None:
    """Of a slider that must stay within 1 m, runs that say more go where some plants leave."""
    design = fp.design_runs(slider(mover(), along=["abs(x) < 1"]), n_starts=2)
    assert set(design.classical_shares) == set(design.classical)
    better = [name for name, value in design.classical.items() if value > design.log_det]
    assert all(design.classical_shares[name] < 0.99 for name in better)
    assert min(design.classical_shares.values()) < 1.0
    assert "plants that can" in str(design)


def test_limits_of_single_quantities_are_lines() -> None:
    problem = slider(mover(), along=["x < 5e-1", "abs(v) < 0.4", "-1.5 <= x", "x + v < 3", "-.2 < x < 2.0"])
    lines = limits_of(problem)
    assert sorted(lines["x"]) == [-1.5, -0.2, 0.5, 2.0] and sorted(lines["v"]) == [-0.4, 0.4] and set(lines) == {"x", "v", "y"}
    assert lines["y"] == lines["x"]  # which it shows


def test_limits_of_what_an_output_shows_are_lines_of_it() -> None:
    problem = load_config(EXAMPLES / "battery.toml").problem()
    assert sorted(limits_of(problem)["V"]) == [2.8, 4.2]


def test_a_report_of_runs_has_means_and_says_what_is_known_of_the_best() -> None:
    design = fp.design_runs(slider(mover()), n_starts=1, n_candidates=60)
    report = design.report()
    (table,) = (section for section in report.sections if section.title == "Parameters")
    place = list(table.columns).index("mean")
    assert [float(row[place]) for row in table.rows] == pytest.approx(
        [design.problem.prior.mean[row[0]] for row in table.rows], rel=1e-3
    )
    (known,) = (dict(section.rows) for section in report.sections if section.title == "D-efficiency")
    best = max(design.classical, key=lambda name: design.classical[name])
    (table,) = (section for section in report.sections if section.title == "Beside classical runs")
    (efficiency,) = (row[2] for row in table.rows if row[0] == best)
    assert known["the best classical run"].startswith(f"{efficiency} of the design ({best}, which ")
    assert known["bound"].startswith("none is proven")
    (criterion,) = (dict(section.rows) for section in report.sections if section.title == "Criterion")
    (search,) = (dict(section.rows) for section in report.sections if section.title == "Search")
    assert float(criterion["log det F"].split()[0]) == pytest.approx(float(search["log det F, sum over samples"]), abs=1e-3)


def test_ctrl_c_keeps_the_best_runs() -> None:
    def stop(progress: fp.Progress) -> None:
        if progress.step == 1:  # before, seconds on a slow machine, the first runs are looked for
            raise KeyboardInterrupt

    design = fp.design_runs(slider(mover()), n_starts=4, n_candidates=60, progress=stop)
    assert design.stop_reason == "interrupted" and len(design.ends) == 1
    assert "ended early" in str(design)


def over_factors(problem: fp.DesignProblem, kind: str, share: float = 0.25) -> tuple[fp.OverPrior, Any]:
    plants = problem.theta * np.random.default_rng(0).uniform(0.7, 1.3, (6, 2))
    names = [quantity.name for quantity in problem.model.parameters]
    return fp.OverPrior(kind, scenarios=[dict(zip(names, row, strict=True)) for row in plants.tolist()], share=share), plants


def log_dets_at(problem: fp.DesignProblem, runs: fp.Runs, plants: Any) -> Any:
    each = [fp.sensitivities(problem.model, runs, theta).dy_dtheta[0, :, 0] * problem.std / 0.01 for theta in plants]
    return np.array([np.linalg.slogdet(s.T @ s)[1] for s in each])


@pytest.mark.long
@pytest.mark.parametrize("kind", ["log", "worst", "cvar"])
def test_a_criterion_over_the_prior_is_maximised(kind: str) -> None:
    problem = slider(mover())
    over, plants = over_factors(problem, kind, share=1 / 3)
    design = fp.design_runs(problem, n_starts=2, n_candidates=60, goal=fp.Goal(over=over))
    found, of_mean = (log_dets_at(problem, runs, plants) for runs in (design.runs, fp.design_runs(problem, n_starts=2).runs))
    average = {"log": np.mean, "worst": np.min, "cvar": lambda values: np.sort(values)[:2].mean()}[kind]
    assert design.log_det == pytest.approx(average(found), abs=1e-4)
    assert average(found) > average(of_mean) - 1e-3
    assert design.scenarios is not None and len(design.scenarios.log_dets) == 6
    scaling = 2 * np.log(2 / design.runs.measured.sum())
    np.testing.assert_allclose(design.scenarios.log_dets, found + scaling, atol=1e-4)
    assert design.scenarios.value == pytest.approx(design.log_det + scaling, abs=1e-4)
    assert "Criterion over the prior" in str(design)


def test_the_worst_scenario_gains_by_being_asked_for(tmp_path: Path) -> None:
    problem = slider(mover())
    designs = {}
    for kind in ("log", "worst"):
        over, plants = over_factors(problem, kind)
        designs[kind] = fp.design_runs(problem, n_starts=4, n_candidates=60, goal=fp.Goal(over=over))
    worst = {kind: log_dets_at(problem, design.runs, plants).min() for kind, design in designs.items()}
    assert worst["worst"] >= worst["log"] - 1e-3
    designs["worst"].save(tmp_path)
    again = fp.RunDesign.load(tmp_path)
    assert again.settings.goal.over == designs["worst"].settings.goal.over and again.scenarios == designs["worst"].scenarios


def test_profiles_and_changes_stay_in_the_box() -> None:
    rng = np.random.default_rng(0)
    for profile in PROFILES:
        for n in (1, 2, 3, 8, 48):
            values = profile(rng, n)
            assert values.shape == (n,) and (values >= 0).all() and (values <= 1).all()
    region = mover(levels={"u": [-1, 1]})
    coordinates = RunCoordinates(region, slider(region).model)
    z = draw_runs(coordinates, 5, rng)
    moved = moved_runs(coordinates, z[0], rng)
    assert ((moved >= 0) & (moved <= 1)).all() and (moved != z[0]).any(axis=1).sum() > 5


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"segments": 0}, "segments: expected a whole number of at least 1, given 0"),
        ({"measured": [False] * 8}, "at least one measured segment, given none"),
        ({"measured": [True] * 3}, "measured: expected 8 flags"),
        ({"levels": {"u": [-2, 1]}}, r"levels\['u'\]: expected values within -1 and 1"),
        ({"levels": {"w": [0.0]}}, "levels"),
        ({"samples": 9}, "samples"),
        ({"duration": 3.0}, "duration: expected at least that of 8 shortest segments, 4 s"),
        ({"constant": ("w",)}, "constant"),
        ({"slew": {"u": 0.0}}, "slew"),
    ],
)
def test_misuse_of_regions_is_told(given: dict[str, Any], said: str) -> None:
    arguments: dict[str, Any] = {"bounds": {"x": 0.0, "v": 0.0, "u": (-1, 1), "dt": 0.5}, "segments": 8, **given}
    with pytest.raises(ValueError, match=said):
        fp.RunRegion(**arguments)


def test_misuse_of_the_search_is_told() -> None:
    problem = slider(mover())
    with pytest.raises(ValueError, match="region: expected a RunRegion for runs, given None"):
        fp.design_runs(problem.replace(region=None))
    with pytest.raises(ValueError, match="region: expected an ExperimentRegion for points, given a RunRegion"):
        fp.exchange(problem)
    with pytest.raises(TypeError, match="over: expected an OverPrior or None, given list"):
        fp.design_runs(problem, goal=fp.Goal(over=[1.0, 2.0]))  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="confidence: expected a share of at least 0 and below 1"):
        fp.design_runs(problem, goal=fp.Goal(confidence=1.5))
    with pytest.raises(ValueError, match="output_covariance: expected 'noise' for runs"):
        fp.design_runs(problem.replace(output_covariance="pointwise"))
    with pytest.raises(ValueError, match="shared: expected names among"):
        slider(mover(shared=("u",)))
