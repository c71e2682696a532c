"""Runs for criteria other than log det F, and with the prior's information: against enumeration and each other."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.design.file.configuration import load_config
from fisherpoint.design.goal.scenario_average import Average
from fisherpoint.design.runs.run_objective import RunObjective
from fisherpoint.design.runs.run_slopes import linear_rows
from fisherpoint.points.run_coordinates import RunCoordinates
from fisherpoint.points.settings import Integration

FINE = Integration(1e-9)
QUICK: dict[str, Any] = {"n_starts": 2, "n_candidates": 60}
OTHERS = ("A", "E", "ME", "c", "Ds", "I")

CART = fp.SymbolicModel(
    f=["v", "b*u - c*v"],
    g=["x"],
    states={"x": "m", "v": "m/s"},
    inputs={"u": "V"},
    outputs={"y": "m"},
    parameters={"b": "m/(s2 V)", "c": "1/s"},
)
MEAN = {"b": 2.0, "c": 1.0}


def problem(segments: int = 4, std: dict[str, float] | None = None, **region: Any) -> fp.DesignProblem:
    """A cart that is pushed from rest."""
    bounds = fp.RunRegion({"x": 0.0, "v": 0.0, "u": (-1, 1), "dt": 0.5}, segments, **region)
    prior = fp.GaussianPrior(MEAN, std or {"b": 0.2, "c": 0.5})
    return fp.DesignProblem(CART, prior, bounds, noise={"y": 0.05})


def goal(name: str, **more: Any) -> fp.Goal:
    given: dict[str, dict[str, Any]] = {
        "c": {"of": "b / c"},
        "Ds": {"of": ["c"]},
        "I": {"of": "y", "conditions": fp.Experiments(x0=[[0.0, 0.0]], u=[[1.0]], dt=[3.0])},
        "A": {"scale": {"b": 0.1, "c": 0.5}},
    }
    return fp.Goal(name, **given.get(name, {}), **more)


def all_runs(count: int) -> fp.Runs:
    """Every run of three levels."""
    u = np.array(list(itertools.product((-1.0, 0.0, 1.0), repeat=count)))
    return fp.Runs(x0=np.zeros((len(u), 2)), u=u[:, :, None], dt=np.full(u.shape, 0.5))


# --- what is searched for -------------------------------------------------------------------------------------------------------


@pytest.mark.long
@pytest.mark.parametrize("with_prior", [False, True])
@pytest.mark.parametrize("name", ("D", *OTHERS))
def test_runs_are_the_best_of_all(name: str, with_prior: bool) -> None:
    given = problem(levels={"u": [-1, 0, 1]})
    criterion, best = fp.criterion(given, goal(name)), -np.inf
    runs = all_runs(4)
    for k in range(len(runs)):
        f = fp.evaluate(given, runs[k : k + 1]).information + with_prior * np.eye(2)
        best = max(best, criterion.log_phi(f))
    design = fp.design_runs(given, goal=goal(name, prior_information=with_prior), **QUICK)
    found = criterion.log_phi(design.evaluation.information)
    assert found == pytest.approx(best, abs=1e-5)
    assert design.log_det == pytest.approx(criterion.level * found, abs=1e-4)  # at the search's tolerance
    assert design.value == pytest.approx(criterion.value(design.evaluation.information))
    report = str(design.report())
    assert ("chosen by criterion" in report) == (name != "D")
    assert ("counts once beside the data" in report) == with_prior


@pytest.mark.long
@pytest.mark.parametrize("name", OTHERS)
def test_none_by_another_criterion_is_better(name: str) -> None:
    given = problem(6)
    own, usual = (fp.design_runs(given, 1, **QUICK, **asked) for asked in ({"goal": goal(name)}, {}))
    criterion = fp.criterion(given, goal(name))
    gain = criterion.log_phi(own.evaluation.information) - criterion.log_phi(usual.evaluation.information)
    assert gain >= -1e-6
    assert own.evaluation.log_det <= usual.evaluation.log_det + 1e-4
    if name == "c":
        assert gain > 0.05


@pytest.mark.parametrize("name", ("A", "c", "I", "Ds"))
def test_the_gradient_is_that_of_differences(name: str) -> None:
    given = problem(5, samples=None)
    assert isinstance(given.region, fp.RunRegion)
    coordinates = RunCoordinates(given.region, CART)
    plants = given.theta * [[1.0, 1.0], [1.1, 0.8]]
    criteria = [fp.criterion(given, goal(name))] * 2
    objective = RunObjective(given, coordinates, plants, Average.of_all(2), np.tile(np.eye(2), (2, 1, 1)), criteria, FINE)
    z = np.random.default_rng(0).uniform(0.3, 0.7, (2, len(coordinates)))
    linear = linear_rows(objective, z, None, True, np.random.default_rng(0))
    assert linear is not None
    value, gradient = linear.value_and_gradient(np.zeros(z.size))

    def at(z: np.ndarray) -> float:
        return objective.of(objective.judged(objective.tried(z, None)))

    assert value == pytest.approx(at(z), rel=1e-9)
    expected = np.zeros_like(z)
    for index in np.ndindex(z.shape):
        step = np.zeros_like(z)
        step[index] = 3e-4
        expected[index] = (at(z + step) - at(z - step)) / 6e-4
    np.testing.assert_allclose(gradient.reshape(z.shape), expected, atol=2e-4 * np.abs(expected).max())


@pytest.mark.parametrize("name", ("A", "c", "ME"))
def test_samples_are_the_best_of_all(name: str) -> None:
    """Of one run that nothing can be changed about, three of eight instants."""
    given = problem(8, samples=3, levels={"u": [1]})
    criterion, best = fp.criterion(given, goal(name)), -np.inf
    whole = fp.Runs(x0=np.zeros((1, 2)), u=np.ones((1, 8, 1)), dt=np.full((1, 8), 0.5))
    for chosen in itertools.combinations(range(8), 3):
        measured = np.isin(np.arange(8), chosen)[None]
        best = max(best, criterion.log_phi(fp.evaluate(given, whole.measuring(measured)).information))
    design = fp.design_runs(given, goal=goal(name), n_starts=1, n_candidates=20)
    assert criterion.log_phi(design.evaluation.information) == pytest.approx(best, abs=1e-6)


def test_over_the_prior_it_is_the_average_of_the_logarithms() -> None:
    given, scenarios = problem(levels={"u": [-1, 0, 1]}), [{}, {"c": 2.0}, {"b": 1.0}]
    over = fp.OverPrior("worst", scenarios=scenarios)
    design = fp.design_runs(given, goal=fp.Goal("c", of="b / c", over=over), **QUICK)
    best, values = -np.inf, []
    for k in range(81):
        values = []
        for one in scenarios:
            there = given.replace(prior=fp.GaussianPrior(MEAN | one, dict(given.prior.std)))
            f = fp.evaluate(there, all_runs(4)[k : k + 1]).information
            values.append(fp.criterion(there, fp.Goal("c", of="b / c")).log_phi(f))
        best = max(best, min(values))
    assert design.log_det == pytest.approx(best, abs=1e-4)
    assert design.scenarios is not None
    assert design.scenarios.value == pytest.approx(best - np.log(4 / 2), abs=1e-4)  # of F as in (7)
    assert "over 3 scenarios" in str(design.report())


# --- where not everything is determined ---------------------------------------------------------------------------------------

TOO_MANY = fp.SymbolicModel(
    f=["k*a*u - x"],
    g=["x"],
    states={"x": "m"},
    inputs={"u": "1"},
    outputs={"y": "m"},
    parameters={"k": "m/s", "a": "1", "d": "1"},
    check_units=False,
)


def unidentifiable(parameters: list[str]) -> fp.DesignProblem:
    region = fp.RunRegion({"x": 0.0, "u": (-1, 1), "dt": 0.5}, 4)
    prior = fp.GaussianPrior({"k": 2.0, "a": 1.0, "d": 1.0}, {"k": 0.2, "a": 0.5, "d": 0.1})
    return fp.DesignProblem(TOO_MANY, prior, region, noise={"y": 0.05}, parameters=parameters)


def test_what_can_be_told_is_told_and_the_rest_is_named() -> None:
    product = fp.design_runs(unidentifiable(["k", "a"]), goal=fp.Goal("c", of="k * a"), **QUICK)
    assert np.isfinite(product.value) and product.evaluation.rank == 1
    assert np.abs(product.runs.u).min() == pytest.approx(1.0)  # as much as goes, one way or the other
    assert "the runs determine criterion c, but not all parameters" in str(product.report())
    rest = fp.design_runs(unidentifiable(["k", "a"]), goal="A", **QUICK)
    assert np.isfinite(rest.log_det) and rest.value == pytest.approx(np.exp(-rest.log_det), rel=1e-4)


def test_what_no_run_tells_is_an_error_that_names_it() -> None:
    with pytest.raises(ValueError, match=r"region: expected runs that determine criterion 'c', given none with information on"):
        fp.design_runs(unidentifiable(["k", "a"]), goal=fp.Goal("c", of="k / a"), **QUICK)
    one = problem(1).replace(region=fp.RunRegion({"x": 0.0, "v": 0.0, "u": (-1, 1), "dt": (0.2, 2.0)}, 1))
    with pytest.raises(ValueError, match=r"n_runs: expected enough runs to determine .* given 1"):
        fp.design_runs(one, goal="A", **QUICK)
    with_prior = fp.design_runs(one, goal=fp.Goal("A", prior_information=True), **QUICK)
    assert np.isfinite(with_prior.log_det) and with_prior.evaluation.rank == 2


def test_the_prior_holds_open_what_no_run_tells() -> None:
    design = fp.design_runs(unidentifiable(["k", "a", "d"]), goal=fp.Goal(prior_information=True), **QUICK)
    assert np.isfinite(design.log_det)
    assert design.log_det == pytest.approx(np.linalg.slogdet(design.evaluation.information)[1], abs=1e-4)
    assert design.evaluation.standard_errors["d"] == pytest.approx(0.1, rel=1e-9)  # as before
    assert np.isinf(design.evaluation.without_prior["d"])


def test_what_was_measured_before_counts_beside_the_prior() -> None:
    before = all_runs(4)[40:42]
    design = fp.design_runs(problem(levels={"u": [-1, 0, 1]}), previous=before, goal=fp.Goal("A", prior_information=True), **QUICK)
    alone = sum(fp.evaluate(problem(), runs).information for runs in (before, design.runs))
    assert design.evaluation.information == pytest.approx(alone + np.eye(2), rel=1e-9)


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ("B", "criterion: expected 'D', 'A'"),
        ("c", "of: expected a function of the parameters as text"),
        (fp.Goal("c", of="q"), "of: "),
        (fp.Goal("A", scale={"b": 1.0}), "scale"),
    ],
)
def test_mistakes(given: str | fp.Goal, expected: str) -> None:
    with pytest.raises((ValueError, TypeError), match=expected):
        fp.design_runs(problem(), goal=given)


# --- runs that are kept -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "goal",
    [fp.Goal(), fp.Goal("c", of="b / c"), fp.Goal(over=fp.OverPrior("worst", scenarios=[{}, {"c": 2.0}]))],
)
def test_kept_runs_stay_and_the_others_are_the_best_beside_them(goal: fp.Goal, tmp_path: Path) -> None:
    given, kept = problem(levels={"u": [-1, 0, 1]}), all_runs(4)[[7]]
    design = fp.design_runs(given, 2, keep=kept, goal=goal, **QUICK)
    assert len(design.runs) == 2 and np.array_equal(design.runs.u[0], kept.u[0]) and design.n_kept == 1
    scenarios = [{}] if goal.over is None else [dict(one) for one in goal.over.scenarios]
    best = -np.inf
    for k in range(81):
        values = []
        for one in scenarios:
            there = given.replace(prior=fp.GaussianPrior(MEAN | one, dict(given.prior.std)))
            f = fp.evaluate(there, fp.Runs.join([kept, all_runs(4)[[k]]])).information
            criterion = fp.criterion(there, goal)
            values.append(criterion.level * criterion.log_phi(f))
        best = max(best, min(values))
    assert design.log_det == pytest.approx(best, abs=1e-4)
    assert "Run 1 was given, and kept" in str(design.report())
    design.save(tmp_path)
    assert fp.RunDesign.load(tmp_path).n_kept == 1


def test_kept_runs_may_be_a_design_and_be_shorter() -> None:
    first = fp.design_runs(problem(3), 1, **QUICK)
    more = fp.design_runs(problem(4), 2, keep=first, **QUICK)
    assert more.runs.segments.tolist() == [3, 4]
    assert more.log_det > first.log_det


@pytest.mark.parametrize(
    ("keep", "expected"),
    [
        (all_runs(4)[:2], "keep: expected fewer runs than n_runs, 2, and at least one; given 2"),
        ("runs", "keep: expected Runs or a RunDesign, given str"),
        (fp.Experiments(x0=[[0.0, 0.0]], u=[[1.0]], dt=[3.0]), "keep: expected Runs or a RunDesign, given Experiments"),
    ],
)
def test_mistakes_with_kept_runs(keep: Any, expected: str) -> None:
    with pytest.raises((ValueError, TypeError), match=expected):
        fp.design_runs(problem(), 2, keep=keep)


def test_kept_runs_that_leave_the_limits_are_refused() -> None:
    limited = problem().replace(along=["abs(x) < 0.5"])
    with pytest.raises(ValueError, match=r"keep: expected runs that reach their ends, given others: .*runs\[0\]"):
        fp.design_runs(limited, 2, keep=all_runs(4)[-1:])


# --- files --------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ("A", "I", "Ds"))
def test_files_keep_what_was_asked_and_repeat(name: str, tmp_path: Path) -> None:
    design = fp.design_runs(problem(), goal=goal(name, prior_information=True), **QUICK)
    design.save(tmp_path)
    loaded = fp.RunDesign.load(tmp_path)
    assert loaded.value == design.value and str(loaded.report()) == str(design.report())
    again = fp.design_runs(loaded.problem, **vars(loaded.settings))
    assert np.array_equal(again.runs.u, design.runs.u)


CYLINDER_RUNS = Path(__file__).parents[2] / "examples" / "cylinder_runs.toml"


def test_a_toml_file_asks_for_it(tmp_path: Path) -> None:
    path = tmp_path / "runs.toml"
    text = CYLINDER_RUNS.read_text()
    assert "[goal]\n" in text
    path.write_text(text.replace("[goal]\n", '[goal]\ncriterion = "c"\nof = "E_oil"\nprior_information = true\n', 1))
    settings = load_config(path).run_settings()
    assert settings["goal"] == fp.Goal("c", of="E_oil", prior_information=True, confidence=0.99)
