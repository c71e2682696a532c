"""Designs of several sizes, and what they cost."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from defaults import problem as cylinder
from defaults import valid_points
from fisherpoint.design.points.candidate_archive import CandidateArchive
from fisherpoint.design.points.point_search import PointSearch
from fisherpoint_command import cli

QUADRATIC = fp.SymbolicModel(
    [], ["a + b*x + c*x**2"], states={}, inputs={"x": "1"}, outputs={"y": "1"}, parameters={"a": "1", "b": "1", "c": "1"}
)
EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def quadratic() -> fp.DesignProblem:
    prior = fp.GaussianPrior({"a": 1.0, "b": 1.0, "c": 1.0}, std={"a": 2.0, "b": 2.0, "c": 2.0})
    return fp.DesignProblem(QUADRATIC, prior, fp.ExperimentRegion({"x": (-1.0, 1.0)}), noise={"y": 0.5})


@pytest.fixture(scope="module")
def found() -> fp.Sweep:
    return fp.sweep(quadratic(), range(2, 13), n_candidates=10, max_iterations=30, cost=fp.Cost(fixed=5, per_experiment=2))


def test_every_size_has_the_best_design(found: fp.Sweep) -> None:
    """A third of the points at -1, 0 and 1 (Kiefer 1959); what is left over goes to any of these."""
    for size in range(3, 13):
        points = found[size].points
        assert len(points) == size
        places, counts = np.unique(points.u.round(3) + 0.0, return_counts=True)
        np.testing.assert_allclose(places, [-1, 0, 1], atol=2e-3)
        assert counts.max() - counts.min() <= 1
        at_least = found[size].at_least
        assert at_least is not None and at_least == pytest.approx(1.0, abs=0.06 if size % 3 else 2e-3)


def test_figures_are_those_of_the_designs_alone(found: fp.Sweep) -> None:
    for of in found.designs:
        alone = fp.evaluate(quadratic(), of.points)
        if len(of.points) == 2:
            assert of.evaluation.standard_errors is None and of.information == -np.inf and not of.at_least
            continue
        assert of.information == pytest.approx(np.linalg.slogdet(alone.information)[1], abs=1e-9)
        assert of.mean_error == pytest.approx(np.exp(-of.information / 6))
        assert of.evaluation.standard_errors == pytest.approx(alone.standard_errors, rel=1e-9)
    information = [of.information for of in found.designs]
    assert (np.diff(information[1:]) > 0).all()
    frame = found.to_pandas()
    assert list(frame.index) == list(range(2, 13)) and np.isnan(frame.loc[2, "a"])


def test_which_to_take(found: fp.Sweep) -> None:
    errors = found[6].evaluation.standard_errors
    assert errors is not None
    assert found.reaching({"b": errors["b"]}) == 6 and found.reaching({"b": errors["b"] * 1.001, "c": 10.0}) == 6
    assert found.reaching({"b": 1e-9}) is None
    assert found.within(17.0) == 6 and found.within(18.9) == 6 and found.within(3.0) is None
    assert found[6].cost == 17.0
    assert found.knee is not None and 4 <= found.knee <= 8
    text = " ".join(str(found).split())
    assert "F is singular" in text and f"From {found.knee} points on" in text


def test_previous_points_count() -> None:
    given, known = cylinder(parameters=("E_oil", "p_t", "B_v")), valid_points(5, seed=3, jumps="exclude")
    found = fp.sweep(given, (1, 3), n_candidates=5, max_iterations=6, previous=known)
    assert found.n_previous == 5 and found.sizes == (1, 3)
    for of in found.designs:
        alone = fp.evaluate(given, of.points, previous=known)
        assert of.evaluation.log_det == pytest.approx(alone.log_det, rel=1e-9)
        assert of.at_least is not None and 0 < of.at_least <= 1


def test_designs_get_better_along_the_sizes() -> None:
    """What a search of one size finds alone is hardly better."""
    given = cylinder()
    found = fp.sweep(given, (9, 10, 12), n_candidates=10, max_iterations=40)
    alone = fp.exchange(given, 12, n_candidates=10, max_iterations=40, method=fp.ExchangeMethod(references=False))
    assert found[12].evaluation.log_det > alone.evaluation.log_det - 9 * 0.1
    assert found[9].information < found[10].information < found[12].information


def test_the_method_of_the_paper_has_sizes_too() -> None:
    given = cylinder(output_covariance="pooled")
    found = fp.sweep(given, (9, 11), n_candidates=4, max_iterations=3)
    assert found.sizes == (9, 11) and all(of.evaluation.output_covariance_kind == "noise" for of in found.designs)


def test_an_interrupt_keeps_what_is_done() -> None:
    def stop(now: fp.Progress) -> None:
        if now.step == 2:
            raise KeyboardInterrupt

    found = fp.sweep(quadratic(), range(3, 8), n_candidates=5, max_iterations=8, progress=stop)
    assert found.sizes == (3, 4) and found.stop_reason == "interrupted"
    assert "The sweep was ended early (interrupted): larger sizes are missing" in str(found)
    limited = fp.sweep(quadratic(), range(3, 8), n_candidates=5, max_iterations=8, method=fp.ExchangeMethod(time_limit=1e-6))
    assert limited.sizes == (3,) and limited.stop_reason == "time_limit"
    told = "The sweep was ended early (the time limit): the search for 3 points was not done, and larger sizes are missing"
    assert told in " ".join(str(limited).split())


def test_a_time_limit_is_that_of_all_sizes_and_the_last_is_not_done_either(monkeypatch: pytest.MonkeyPatch) -> None:
    limits, run = [], PointSearch.run

    def noted(search: PointSearch, progress: Any) -> str:
        limits.append(search.settings.method.time_limit)
        return run(search, progress)

    monkeypatch.setattr(PointSearch, "run", noted)
    fp.sweep(quadratic(), (3, 4, 5), n_candidates=5, max_iterations=4, method=fp.ExchangeMethod(time_limit=1000.0))
    assert 1000.0 > limits[0] > limits[1] > limits[2] > 0
    assert (
        fp.sweep(quadratic(), (3,), n_candidates=5, max_iterations=8, method=fp.ExchangeMethod(time_limit=1e-6)).stop_reason
        == "time_limit"
    )


@pytest.mark.parametrize(("errors", "knee"), [((1.0, 0.6, 0.5), 4), ((1.0, 0.9, 0.5), None), ((1.0, 0.9, 1.1), None)])
def test_no_knee_is_told_where_the_errors_fall_ever_faster_or_rise(
    found: fp.Sweep, errors: tuple[float, ...], knee: int | None
) -> None:
    sized = [replace(found[n], maximised=-2 * np.log(e), level=1, degree=0) for n, e in zip((3, 4, 5), errors, strict=True)]
    other = replace(found, designs=tuple(sized))
    assert [of.mean_error for of in other.designs] == pytest.approx(list(errors)) and other.knee == knee
    assert ("points on, which are marked" in str(other)) == (knee is not None)


def test_candidates_of_the_next_size_are_chosen_by_the_criterion_at_the_mean(monkeypatch: pytest.MonkeyPatch) -> None:
    """Not by the function's gradient in the first of the scenarios, for information at the mean."""
    asked, best = [], CandidateArchive.best

    def noted(seen: CandidateArchive, *given: Any) -> Any:
        asked.extend(criterion for criterion in seen.criteria)
        return best(seen, *given)

    monkeypatch.setattr(CandidateArchive, "best", noted)
    problem = fp.load_problem(EXAMPLES / "michaelis_menten.toml")
    over = fp.OverPrior("log", scenarios=[{"K": 0.2}, {}])
    found = fp.sweep(problem, [2, 3], goal=fp.Goal("c", of="V / K", over=over), n_candidates=10, max_iterations=8)
    assert len(asked) == 1 and found[3].at_least is not None
    np.testing.assert_array_equal(asked[0].k, fp.criterion(problem, fp.Goal("c", of="V / K")).k)


def test_an_interrupt_before_the_first_is_done_keeps_the_best_so_far(tmp_path: Path) -> None:
    def stop(now: fp.Progress) -> None:
        raise KeyboardInterrupt

    found = fp.sweep(quadratic(), range(3, 8), n_candidates=5, max_iterations=8, progress=stop)
    assert found.sizes == (3,) and found.stop_reason == "interrupted_first" and found[3].at_most is None
    assert "the search for 3 points was not done, and larger sizes are missing" in " ".join(str(found).split())
    found.save(tmp_path / "sweep.json")
    assert fp.Sweep.load(tmp_path / "sweep.json").stop_reason == "interrupted_first"


def test_an_interrupted_command_saves_the_best_so_far(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    search = fp.sweep

    def interrupted(*given: Any, progress: Any, **settings: Any) -> fp.Sweep:
        def stop(now: fp.Progress) -> None:
            raise KeyboardInterrupt

        return search(*given, progress=stop, **settings)

    monkeypatch.setattr(fp, "sweep", interrupted)
    with pytest.raises(SystemExit) as caught:
        cli.main(["sweep", str(EXAMPLES / "michaelis_menten.toml"), "-L", "2:4", "-o", str(tmp_path / "run")])
    told = capsys.readouterr()
    assert caught.value.code == 130 and "the search for 2 points was not done" in " ".join(told.out.split())
    names = {path.name for path in (tmp_path / "run").iterdir()}
    assert names == {"design_2.csv", "sweep.csv", "sweep.json", "report.txt", "report.html"}


# --- costs --------------------------------------------------------------------------------------------------------------


def test_costs_add_up() -> None:
    model = fp.SymbolicModel(["-k*x + u + w"], ["x"], {"x": "m"}, {"u": "m/s", "w": "m/s"}, {"k": "1/s"}, {"y": "m"})
    u = [[1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.0, 0.0], [0.0, 1.0]]
    points = fp.Experiments(np.zeros((5, 1)), u, [1.0, 2.0, 3.0, 4.0, 5.0])
    assert fp.Cost(fixed=10, per_experiment=2, per_second=0.5).of(points, model) == 10 + 10 + 7.5
    # Sorted by u, then by w: (0, 0), (0, 1), (0, 1), (1, 0), (1, 1): u changes once, w three times.
    assert fp.Cost(per_change={"u": 100, "w": 1}).of(points, model) == 103
    # Sorted by w, then by u: (0, 0), (1, 0), (0, 1), (0, 1), (1, 1): w changes once, u three times.
    assert fp.Cost(per_change={"u": 1, "w": 100}).of(points, model) == 103
    assert fp.Cost(per_change={"x": 7}).of(points, model) == 0
    with pytest.raises(ValueError, match="per_change: expected"):
        fp.Cost(per_change={"z": 1}).of(points, model)
    with pytest.raises(ValueError, match="per_second: expected a cost of 0 or more, given -1"):
        fp.Cost(per_second=-1)


def test_misuse_is_told(found: fp.Sweep) -> None:
    with pytest.raises(ValueError, match="n_experiments: expected between 1 and 1000 sizes, given 0"):
        fp.sweep(quadratic(), [])
    with pytest.raises(TypeError, match="n_experiments: expected a sequence of whole numbers, such as range"):
        fp.sweep(quadratic(), 3)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="noise: expected the sensor noise"):
        fp.sweep(cylinder(noise=None, output_covariance="pooled"), [9])
    with pytest.raises(KeyError, match="n_experiments: expected one of 2, 3"):
        found[99]
    with pytest.raises(ValueError, match="budget: expected a sweep with costs"):
        fp.sweep(quadratic(), [3], n_candidates=5, max_iterations=1).within(3.0)
    with pytest.raises(ValueError, match="standard_errors: expected at least one parameter"):
        found.reaching({})


# --- for other criteria -------------------------------------------------------------------------------------------------


@pytest.mark.long
@pytest.mark.parametrize(
    "goal",
    [
        fp.Goal("c", of="V / K"),
        fp.Goal("A"),
        fp.Goal("E"),
        fp.Goal(over=fp.OverPrior("worst", scenarios=[{}, {"K": 0.2}])),
        fp.Goal("c", of="V / K", over=fp.OverPrior("log", scenarios=[{}, {"K": 0.2}])),
        fp.Goal(prior_information=True),
        fp.Goal("A", prior_information=True),
    ],
)
def test_sizes_are_those_of_exchange(goal: fp.Goal, tmp_path: Path) -> None:
    problem = fp.load_problem(EXAMPLES / "michaelis_menten.toml")
    found = fp.sweep(problem, [2, 3, 5], n_candidates=20, goal=goal)
    for of in found.designs:
        size = len(of.points)
        alone = fp.exchange(problem, size, n_candidates=20, goal=goal)
        level = alone.criterion.level
        value = alone.trace[-1].log_det + level * np.log(size / 2)
        assert of.information == pytest.approx(value, abs=2e-3 * level)
        assert of.evaluation.log_det == pytest.approx(
            fp.evaluate(problem, of.points, prior_information=goal.prior_information).log_det, abs=1e-9
        )
        assert of.at_least is not None and alone.efficiency is not None and of.at_most is not None
        assert of.at_least == pytest.approx(alone.efficiency.at_least, abs=2e-2) and of.at_least <= 1 + 1e-9
        if goal == fp.Goal("c", of="V / K"):
            assert of.mean_error == pytest.approx(np.sqrt(alone.value), rel=1e-3)
        if goal == fp.Goal("A", prior_information=True):
            assert of.mean_error == pytest.approx(np.sqrt(alone.value), rel=1e-3)
    assert found[5].mean_error < found[3].mean_error < found[2].mean_error and found.knee is not None
    found.save(tmp_path / "sweep.json")
    again = fp.Sweep.load(tmp_path / "sweep.json")
    assert str(again.report()) == str(found.report()) and again.settings == found.settings
    assert ("prior information: counts once" in str(found.report())) == goal.prior_information


def test_sizes_that_cannot_tell_what_is_asked_are_an_error() -> None:
    problem = fp.load_problem(EXAMPLES / "michaelis_menten.toml")
    with pytest.raises(ValueError, match="n_experiments: expected enough points to determine"):
        fp.sweep(problem, [1, 2], goal=fp.Goal("c", of="V / K"), n_candidates=20, max_iterations=20)
    with pytest.raises(ValueError, match="n_experiments: expected enough points to determine 2 parameters, as singular = 'error'"):
        fp.sweep(problem, [1, 2], goal=fp.Goal("A", singular="error"), n_candidates=20, max_iterations=20)
    with pytest.raises(ValueError, match='over: expected method = "auto"'):
        fp.sweep(problem, [2], goal=fp.Goal(over=fp.OverPrior("log")), method="paper")


def test_sizes_that_cannot_tell_all_are_chosen_by_log_det() -> None:
    """Nothing is claimed of them; those after them are by the criterion."""
    found = fp.sweep(quadratic(), [2, 3, 4], goal="A", n_candidates=10, max_iterations=30)
    few, enough, more = found.designs
    assert few.evaluation.rank == 2 and few.information == -np.inf and few.at_least is None
    assert enough.at_least is not None and more.information > enough.information and not found.not_estimable
    for of in (enough, more):
        assert of.mean_error**2 == pytest.approx(np.trace(np.linalg.inv(of.evaluation.information)), rel=1e-6)


@pytest.mark.parametrize("goal", [fp.Goal("A"), fp.Goal(over=fp.OverPrior("log", scenarios=[{}, {"a": 2.0}]))])
def test_criteria_ask_for_what_can_be_told(goal: fp.Goal) -> None:
    model = fp.SymbolicModel([], ["(a + b) * x"], states={}, inputs={"x": "1"}, outputs={"y": "1"}, parameters={"a": "1", "b": "1"})
    prior = fp.GaussianPrior({"a": 1.0, "b": 1.0}, std={"a": 1.0, "b": 2.0})
    problem = fp.DesignProblem(model, prior, fp.ExperimentRegion({"x": (-1.0, 1.0)}), noise={"y": 0.5})
    found = fp.sweep(problem, [1, 2], n_candidates=10, max_iterations=30, goal=goal)
    (left,) = found.not_estimable
    assert left["a"] / left["b"] == pytest.approx(-2.0, rel=1e-6)
    for of in found.designs:
        assert np.abs(of.points.u) == pytest.approx(1.0, abs=1e-6)
        assert of.at_least == pytest.approx(1.0, abs=5e-3)
        assert of.mean_error**2 == pytest.approx(0.25 / 5 / len(of.points), rel=1e-5)  # of a + 2 b, in units of its length
    strict = replace(goal, singular="error")
    with_prior = fp.sweep(problem, [1, 2], n_candidates=10, max_iterations=30, goal=replace(strict, prior_information=True))
    assert not with_prior.not_estimable and with_prior.ridge == 0 and with_prior[1].evaluation.rank == 2
    with pytest.raises(ValueError, match=r"^region: expected points that determine all parameters, as singular = 'error' requires"):
        fp.sweep(problem, [1, 2], n_candidates=10, max_iterations=30, goal=strict)


# --- the command --------------------------------------------------------------------------------------------------------


def test_the_command_writes_every_size(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("matplotlib")
    file, out = tmp_path / "problem.toml", tmp_path / "sizes"
    text = (EXAMPLES / "michaelis_menten.toml").read_text().replace("max_iterations = 200", "max_iterations = 4\nn_candidates = 5")
    file.write_text(text + "\n[cost]\nper_experiment = 3\n")
    out.mkdir()
    for name in ("design_77.csv", "report.txt"):
        (out / name).write_text("of another run")
    with pytest.raises(SystemExit) as left:
        cli.main(["sweep", str(file), "-L", "2:4", "-o", str(out), "--budget", "10", "--force"])
    printed = capsys.readouterr()
    assert left.value.code == 0, printed.err
    names = {path.name for path in out.iterdir()}
    assert names == {
        "sweep.csv",
        "sweep.json",
        "report.txt",
        "report.html",
        "sweep.png",
        "design_2.csv",
        "design_3.csv",
        "design_4.csv",
    }
    assert "Within a budget of 10: the design of 3 points has the most information." in printed.out
    again = fp.Sweep.load(out / "sweep.json")
    assert again.sizes == (2, 3, 4) and again[3].cost == 9.0


def test_the_command_has_the_criteria_of_the_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, out = tmp_path / "problem.toml", tmp_path / "sizes"
    asked = 'max_iterations = 24\nn_candidates = 5\n\n[goal]\ncriterion = "c"\nof = "V / K"\nover = "log"\nscenarios = 2'
    file.write_text((EXAMPLES / "michaelis_menten.toml").read_text().replace("max_iterations = 200", asked))
    with pytest.raises(SystemExit) as left:
        cli.main(["sweep", str(file), "-L", "2,3", "-o", str(out), "--no-plots"])
    printed = capsys.readouterr()
    assert left.value.code == 0, printed.err
    settings = fp.Sweep.load(out / "sweep.json").settings
    assert settings is not None and settings.goal == fp.Goal("c", of="V / K", over=fp.OverPrior("log", scenarios=fp.Sobol(2)))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("-L", "4:2"), "--sizes: expected whole numbers, at most 1000 of them, as 9:30 or 6,9,12; given 4:2"),
        (("-L", "a"), "--sizes: expected whole numbers"),
        (("-L", "0,3"), "--sizes: expected whole numbers"),
        (("-L", "2:3", "--budget", "3"), "cost: missing; expected a table [cost] with --budget"),
    ],
)
def test_mistakes_get_one_line(
    arguments: tuple[str, ...], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as left:
        cli.main(["sweep", str(EXAMPLES / "michaelis_menten.toml"), "-o", str(tmp_path / "out"), *arguments])
    error = capsys.readouterr().err
    assert left.value.code == 2 and message in error and error.count("\n") == 1
    assert not (tmp_path / "out").exists()
