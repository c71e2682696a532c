"""Outputs that `noise` does not name are not measured: everything is as with a model that does not have them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.design.file.configuration import ConfigError, load_config
from fisherpoint.design.results.picture_list import plots_of
from fisherpoint.design.results.pictures import PLOTS
from fisherpoint.information.evaluate import evaluate
from fisherpoint_command.cli import main

MEAN = {"k": 1.0, "b": 0.5, "c": 0.3}
NOISE = {"y1": 0.01, "y3": 0.05}
OUTPUTS = {"y1": "a + 0.1*z", "y2": "b*z + u", "y3": "z"}
MEASURED = [0, 2]
QUICK: dict[str, Any] = {"threads": 1, "n_candidates": 30, "max_iterations": 3}


def model(*outputs: str) -> fp.SymbolicModel:
    return fp.SymbolicModel(
        f=["b*u - k*a", "a - c*z"],
        g=[OUTPUTS[name] for name in outputs],
        states={"a": "1", "z": "1"},
        inputs={"u": "1"},
        parameters=dict.fromkeys(MEAN, "1"),
        outputs=dict.fromkeys(outputs, "1"),
    )


ALL, FEW = model(*OUTPUTS), model(*NOISE)
BOUNDS = {"a": (0.1, 2.0), "z": (0.1, 2.0), "u": (0.0, 1.0), "dt": (0.1, 2.0)}
PRIOR = fp.GaussianPrior(MEAN, {name: 0.2 * value for name, value in MEAN.items()})
REGION = fp.ExperimentRegion(BOUNDS)
RUNS = fp.RunRegion(BOUNDS | {"a": 1.0, "z": 0.5}, 4)


def both(region: Any, **options: Any) -> tuple[fp.DesignProblem, fp.DesignProblem]:
    """Of the model with all outputs, of which two are measured, and of the model with these alone."""
    return tuple(fp.DesignProblem(one, PRIOR, region, noise=NOISE, **options) for one in (ALL, FEW))  # type: ignore[return-value]


def same(first: fp.Evaluation, second: fp.Evaluation) -> None:
    assert first.outputs == second.outputs == tuple(NOISE) and first.outputs_left_out == ("y2",)
    assert first.log_det == pytest.approx(second.log_det, rel=1e-9)
    np.testing.assert_allclose(first.fisher, second.fisher, rtol=1e-9)
    np.testing.assert_allclose(first.output_covariance, second.output_covariance, rtol=1e-9)


def data_of(points: fp.Experiments | fp.Runs, seed: int = 0) -> tuple[fp.Measurements, fp.Measurements]:
    """With numbers of all outputs, and those of two of them alone."""
    whole = fp.VirtualRig(ALL, MEAN, dict.fromkeys(OUTPUTS, 0.02), seed=seed).measure(points)
    return whole, fp.Measurements(points, whole.y[..., MEASURED])


OPTIONS: list[dict[str, Any]] = [
    {},
    {"output_covariance": "region"},
    {"output_covariance": "pooled"},
    {"output_covariance": "pointwise"},
    {"varies": {"c": 0.05}, "parameters": ["k", "b"]},
    {"uncertain": {"c": 0.05}, "parameters": ["k", "b"]},
    {"initial_state_std": {"a": 0.05}},
]


@pytest.mark.parametrize("options", OPTIONS, ids=str)
def test_designs_of_points(options: dict[str, Any]) -> None:
    one, other = (fp.exchange(problem, 5, seed=1, **QUICK) for problem in both(REGION, **options))
    assert one.points == other.points
    same(one.evaluation, other.evaluation)


@pytest.mark.parametrize("over", ["log", "worst"])
def test_designs_over_the_prior(over: str) -> None:
    asked = fp.OverPrior(over, scenarios=fp.Sobol(4))
    one, other = (fp.exchange(problem, 4, seed=0, goal=fp.Goal(over=asked), **QUICK) for problem in both(REGION))
    assert one.points == other.points


@pytest.mark.parametrize("options", [OPTIONS[0], *OPTIONS[-3:]], ids=str)
def test_designs_of_runs(options: dict[str, Any]) -> None:
    one, other = (fp.design_runs(problem, 2, seed=1, n_starts=1, n_candidates=10, threads=1) for problem in both(RUNS, **options))
    assert one.log_det == pytest.approx(other.log_det, rel=1e-6)
    evaluated = [evaluate(problem, one.runs) for problem in both(RUNS, **options)]
    same(*evaluated)


@pytest.mark.long
def test_weights_exact_designs_and_sweeps() -> None:
    first, second = both(REGION)
    one, other = (fp.approximate_design(problem, threads=1) for problem in (first, second))
    assert one.value == pytest.approx(other.value, abs=1e-4)
    candidates = fp.exchange(second, 12, seed=3, **QUICK).points
    one, other = (fp.exact_design(problem, candidates, 5) for problem in (first, second))
    assert one.points == other.points
    one, other = (fp.sweep(problem, [4, 6], **QUICK) for problem in (first, second))
    assert [step.evaluation.log_det for step in one.designs] == pytest.approx([step.evaluation.log_det for step in other.designs])


def test_previous_data_tell_what_the_measured_outputs_tell() -> None:
    first, second = both(REGION)
    for points in (fp.exchange(second, 4, **QUICK).points, fp.design_runs(both(RUNS)[1], 1, n_starts=1, n_candidates=5).runs):
        whole, part = data_of(points)
        one, other = fp.exchange(first, 3, previous=whole, **QUICK), fp.exchange(second, 3, previous=part, **QUICK)
        assert one.points == other.points
        same(one.evaluation, other.evaluation)


def logged() -> fp.Record:
    rng = np.random.default_rng(0)
    t, u = np.arange(60) * 0.1, np.repeat(rng.uniform(0, 1, 12), 5)
    y = fp.simulate_record(ALL, t, u, MEAN, {"a": 1.0, "z": 0.5}).y
    return fp.Record(t, u, y + 0.01 * rng.standard_normal(y.shape))


def test_pieces() -> None:
    record, a = logged(), np.linspace(1.0, 0.8, 60)
    few = fp.Record(record.t, record.u, record.y[:, MEASURED])
    designs = []
    for problem, part in zip(both(None, initial_state_std={"a": 0.05}), (record, few), strict=True):
        some = fp.pieces(part, problem.model, length=10, states={"a": a})
        designs.append(fp.design_pieces(problem, some, 3, threads=1))
    assert designs[0].windows.tolist() == designs[1].windows.tolist()
    assert designs[0].evaluation.log_det == pytest.approx(designs[1].evaluation.log_det, rel=1e-9)
    bad = fp.DesignProblem(ALL, PRIOR, None, noise={"y1": 0.01}, initial_state_std={"a": 0.05})
    with pytest.raises(ValueError, match="initial_state_std: expected a standard deviation of 'z', as noise has none of 'y3'"):
        fp.design_pieces(bad, fp.pieces(record, ALL, length=10, states={"a": a}), 3)


def test_fits_leave_out_what_is_not_named() -> None:
    points = fp.exchange(both(REGION)[1], 8, **QUICK).points
    whole, part = data_of(points)
    record = logged()
    few = fp.Record(record.t, record.u, record.y[:, MEASURED])
    for one, other in ((whole, part), (record, few), ([whole, record], [part, few])):
        first, second = (fp.estimate(of, data, PRIOR, noise=NOISE, threads=1) for of, data in ((ALL, one), (FEW, other)))
        assert first.estimate == pytest.approx(second.estimate, rel=1e-7)
        assert dict(first.standard_errors) == pytest.approx(dict(second.standard_errors), rel=1e-6)
        assert tuple(first.tests) == tuple(NOISE) and "y2" not in str(first)


def test_a_set_of_data_of_other_outputs_alone_is_left_out() -> None:
    whole, _ = data_of(fp.exchange(both(REGION)[1], 8, **QUICK).points)
    alone = fp.Measurements(whole.points, np.where([False, True, False], whole.y, np.nan))
    fit = fp.estimate(ALL, [alone, whole], PRIOR, noise=NOISE)
    assert len(fit.data) == 1
    with pytest.raises(ValueError, match="data: expected a number of y1, y3, whose noise is known; given none"):
        fp.estimate(ALL, alone, PRIOR, noise=NOISE)


@pytest.mark.parametrize("options", [{}, {"varies": {"c": 0.05}, "parameters": ["k", "b"]}], ids=str)
def test_validations(options: dict[str, Any]) -> None:
    first, second = both(REGION, **options)
    points = fp.exchange(second, 6, **QUICK).points
    one, other = (fp.validate(problem, {"d": points}, runs=30, seed=2, threads=1) for problem in (first, second))
    assert tuple(one.noise) == tuple(NOISE)
    for name, promise in one.designs["d"].parameters.items():
        assert promise.promised == pytest.approx(other.designs["d"].parameters[name].promised, rel=1e-9)
        assert 0.5 < promise.ratio.value < 2.0


@pytest.mark.parametrize("region", [REGION, RUNS], ids=["points", "runs"])
def test_campaigns(region: Any, tmp_path: Path) -> None:
    """The rig measures all outputs; the campaign takes those that are named."""
    quick = {"n_starts": 1, "n_candidates": 20} if region is RUNS else {"n_candidates": 60}
    found = []
    for k, problem in enumerate(both(region)):
        campaign = fp.Campaign(problem, batch=1 if region is RUNS else 5, directory=tmp_path / str(k), threads=1, **quick)
        for seed in range(2):
            campaign.tell(data_of(campaign.next(), seed)[k])
        found.append(campaign)
        again = fp.Campaign.load(tmp_path / str(k))
        assert again.problem.noise == NOISE and again.estimate == campaign.estimate
    assert found[0].estimate == pytest.approx(found[1].estimate, rel=1e-5)
    found[0].report()


def test_saved_designs_reports_and_pictures(tmp_path: Path) -> None:
    problem, _ = both(REGION)
    design = fp.exchange(problem, 4, **QUICK)
    design.save(tmp_path)
    again = fp.Design.load(tmp_path)
    assert again.problem.noise == NOISE and again.points == design.points
    assert "y2: not measured" in str(design.report())
    facts = problem._in_notebook().sections[0].rows
    assert ("not measured", "y2") in facts
    for plot in plots_of(design).values():
        plot()
    fp.design_runs(both(RUNS)[0], 1, n_starts=1, n_candidates=5, threads=1).report()


def test_a_picture_of_responses_has_no_bar_of_what_is_not_measured() -> None:
    problem = fp.DesignProblem(
        ALL, PRIOR, fp.ExperimentRegion(BOUNDS | {"a": (1.0, 1.0), "z": (0.5, 0.5), "u": (0.5, 0.5)}), noise=NOISE
    )
    figure = PLOTS["points"](fp.exchange(problem, 4, **QUICK))
    bars = [len(axes.containers[0].lines[2]) for axes in figure.axes]
    assert [bool(count) for count in bars] == [True, False, True]


def test_the_file_of_a_problem(tmp_path: Path) -> None:
    table = ALL.to_toml() + "".join(f"[prior.{name}]\nmean = {mean}\nstd = 0.1\n" for name, mean in MEAN.items())
    table += "[region]\n" + "".join(f"{name} = [{low}, {high}]\n" for name, (low, high) in BOUNDS.items())
    path = tmp_path / "problem.toml"
    path.write_text(table + "[noise]\ny1 = 0.01\ny3 = 0.05\n")
    assert dict(load_config(path).problem().noise or {}) == NOISE
    for noise, expected in (("", "at least one of y1, y2, y3, given none"), ("y4 = 1.0\n", "unknown key noise.y4")):
        path.write_text(f"{table}[noise]\n{noise}")
        with pytest.raises(ConfigError, match=expected):
            load_config(path)


def test_the_command_fits_what_the_file_names(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = ALL.to_toml() + "".join(f"[prior.{name}]\nmean = {mean}\nstd = 0.1\n" for name, mean in MEAN.items())
    (tmp_path / "problem.toml").write_text(table + "[noise]\ny1 = 0.01\ny3 = 0.05\n")
    whole, _ = data_of(fp.exchange(both(REGION)[1], 8, **QUICK).points)
    whole.to_csv(tmp_path / "data.csv", ALL)
    given = ["estimate", str(tmp_path / "problem.toml"), str(tmp_path / "data.csv")]
    for more, told in ((["--check"], "not measured  y2"), (["-o", str(tmp_path / "fit"), "--no-plots"], "y1")):
        with pytest.raises(SystemExit) as stopped:
            main([*given, *more])
        assert not stopped.value.code
        shown = " ".join(capsys.readouterr().out.split())
        assert " ".join(told.split()) in shown and ("y2" in shown) == (more == ["--check"])


@pytest.mark.parametrize(("noise", "message"), [({}, "at least one of y1, y2, y3; given none"), ({"y4": 1.0}, "y4")])
def test_no_output_or_another_is_an_error(noise: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=f"noise: expected .*{message}"):
        fp.DesignProblem(ALL, PRIOR, REGION, noise=noise)
    points = fp.Experiments([[1.0, 1.0]], [[0.5]], [1.0])
    with pytest.raises(ValueError, match=f"noise: expected .*{message}"):
        fp.estimate(ALL, fp.Measurements(points, [[1.0, 1.0, 1.0]]), PRIOR, noise=noise)
