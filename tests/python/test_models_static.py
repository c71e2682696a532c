"""Models without state, whose points have no dt, and models without input: from points to designs, files and pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.design.results import pictures as plots
from fisherpoint.design.results import report
from fisherpoint.design.results.frames import simulation_frame
from fisherpoint.show.section import to_text


@fp.model(
    inputs={"d": "mol/L"},
    parameters={"E0": "1", "Emax": "1", "EC50": "mol/L", "n": "1"},
    outputs={"E": "1"},
    nominal={"E0": 1.0, "Emax": 5.0, "EC50": 2.0, "n": 1.5},
)
def dose(x: Any, u: Any, p: Any) -> Any:
    return None, [p.E0 + p.Emax * u.d**p.n / (p.EC50**p.n + u.d**p.n)]


@fp.model(states={"c": "mol/L"}, parameters={"k": "1/s"}, outputs={"c": "mol/L"}, nominal={"k": 0.1})
def decay(x: Any, u: Any, p: Any) -> Any:
    return [-p.k * x.c], [x.c]


def relative(model: fp.Model, share: float = 0.1) -> fp.GaussianPrior:
    return fp.GaussianPrior(mean=model.nominal, relative_std=dict.fromkeys(model.nominal, share))


DOSE = fp.DesignProblem(dose, relative(dose), fp.ExperimentRegion({"d": (0.01, 10.0)}), noise={"E": 0.1})
DECAY = fp.DesignProblem(decay, relative(decay), fp.ExperimentRegion({"c": (1.0, 1.0), "dt": (0.1, 50.0)}), noise={"c": 0.01})


def test_runs_of_a_static_model_are_its_points(tmp_path: Path) -> None:
    levels = np.array([[0.5, 2.0, 8.0], [1.0, 4.0, 4.0]])
    runs = fp.Runs(np.empty((2, 0)), levels, [[1.0, 1.0, 2.0], [1.0, 1.0, 0.0]])
    points = fp.Experiments(np.empty((6, 0)), levels.ravel())
    for compute in (fp.simulate, fp.sensitivities):
        of_runs, of_points = compute(dose, runs, dose.nominal), compute(dose, points, dose.nominal)
        assert np.array_equal(of_runs.y.ravel()[:5], of_points.y.ravel()[:5]) and of_runs.y[1, 2, 0] == 0.0
        assert of_runs.reached.tolist() == [3, 2] and of_runs.status.tolist() == [0, 0] and of_runs.x.shape == (2, 4, 0)
    assert np.array_equal(of_runs.dy_dtheta.reshape(6, 1, 4)[:5], of_points.dy_dtheta[:5])  # type: ignore[attr-defined]
    evaluations = [fp.evaluate(DOSE, given) for given in (runs, points[:5])]
    assert evaluations[0].standard_errors == evaluations[1].standard_errors
    runs.to_csv(tmp_path / "runs.csv", dose)
    assert fp.Runs.from_csv(tmp_path / "runs.csv", dose) == runs
    data = fp.VirtualRig(dose, dose.nominal, {"E": 0.1}).measure(runs)
    fit = fp.estimate(dose, data, noise={"E": 0.1}, prior=DOSE.prior)
    fit.save(tmp_path)
    assert fit.converged and fp.Fit.load(tmp_path).data[0] == data


def test_a_run_of_a_static_model_ends_where_there_is_no_value() -> None:
    runs = fp.Runs(np.empty((1, 0)), [[1.0, -1.0, 1.0]], 1.0)
    done = fp.simulate(dose, runs, dose.nominal)
    assert done.reached.tolist() == [1] and done.statuses[0] != fp.Status.ok and not done.y[0, 1:].any()


def test_a_static_model_is_its_output() -> None:
    points, theta = fp.Experiments(np.empty((3, 0)), [0.5, 2.0, 8.0]), dose.theta(dose.nominal)
    done = fp.sensitivities(dose, points, theta)
    assert done.status.tolist() == [0, 0, 0] and done.x.shape == (3, 0) and done.dx_dtheta.shape == (3, 0, 4)
    assert done.y[1, 0] == pytest.approx(3.5)
    d, r = points.u[:, 0], (points.u[:, 0] / 2.0) ** 1.5
    exact = np.column_stack([np.ones(3), r / (1 + r), -5 * 1.5 / 2 * r / (1 + r) ** 2, 5 * r * np.log(d / 2) / (1 + r) ** 2])
    np.testing.assert_allclose(done.dy_dtheta[:, 0], exact, rtol=1e-12, atol=1e-14)
    assert dose.domain == ("d",) and [axis.name for axis in dose.axes] == ["d"]
    covariance = fp.predictive_covariance(dose, points, DOSE.prior, DOSE.rule).covariance[:, 0, 0]
    assert (covariance > 0).all()


def test_the_region_of_a_static_model_has_no_dt() -> None:
    assert DOSE.region is not None
    points = DOSE.region.draw(dose, 5, seed=0)
    assert points.table.shape == (5, 2) and (points.dt == 1.0).all()
    with pytest.raises(ValueError, match=r"region: expected the names d; given unknown 'dt'"):
        fp.DesignProblem(dose, DOSE.prior, fp.ExperimentRegion({"d": (0, 1), "dt": (1, 1)}), noise={"E": 0.1})
    half = fp.ExperimentRegion({"d": (0.0, 1.0)}, ["d < 0.5"])
    np.testing.assert_array_equal(half.satisfied(dose, points), points.u[:, 0] < 0.5)


def test_points_of_a_static_model_in_files(tmp_path: Path) -> None:
    points = fp.Experiments(np.empty((2, 0)), [0.25, 2.0])
    points.to_csv(tmp_path / "points.csv", dose)
    assert (tmp_path / "points.csv").read_text().split() == ["d", "0.25", "2.0"]
    assert fp.Experiments.from_csv(tmp_path / "points.csv", dose) == points
    (tmp_path / "with_dt.csv").write_text("dt,d\n1.0,0.25\n1.0,2.0\n")
    assert fp.Experiments.from_csv(tmp_path / "with_dt.csv", dose) == points
    points.to_csv(tmp_path / "by_place.csv")
    assert fp.Experiments.from_csv(tmp_path / "by_place.csv", dose) == points
    for text, wrong in (("d,c\n1,2\n", "d, and besides .*; given the unknown c"), ("dt\n1\n", "d; given dt")):
        (tmp_path / "wrong.csv").write_text(text)
        with pytest.raises(ValueError, match=f"expected the columns {wrong}$"):
            fp.Experiments.from_csv(tmp_path / "wrong.csv", dose)


def test_a_static_design_has_its_points_where_theory_puts_them() -> None:
    # Two parameters of a line: half of the points at each end.
    line = fp.SymbolicModel([], ["a + b*t_h"], {}, {"t_h": "h"}, {"a": "m", "b": "m/h"}, {"y": "m"}, name="line")
    prior = fp.GaussianPrior(mean={"a": 1.0, "b": 1.0}, std={"a": 1.0, "b": 1.0})
    problem = fp.DesignProblem(line, prior, fp.ExperimentRegion({"t_h": (-1.0, 1.0)}), noise={"y": 1.0})
    design = fp.exchange(problem, n_experiments=4, max_iterations=60, method=fp.ExchangeMethod(references=False))
    assert np.sort(design.points.u[:, 0]) == pytest.approx([-1, -1, 1, 1], abs=0.05)
    assert design.evaluation.log_det == pytest.approx(np.log(4.0), abs=0.1)  # F = (2/L) diag(4, 4)


def test_decay_is_sampled_after_one_time_constant() -> None:
    design = fp.exchange(DECAY, n_experiments=2, max_iterations=80, method=fp.ExchangeMethod(references=False))
    assert design.points.dt == pytest.approx([10.0, 10.0], rel=0.05)
    assert (design.points.x0 == 1.0).all() and design.points.u.shape == (2, 0)


@pytest.mark.parametrize("problem", [DOSE, DECAY], ids=["static", "without input"])
def test_designs_are_saved_reported_and_drawn(problem: fp.DesignProblem, tmp_path: Path) -> None:
    design = fp.exchange(problem, n_experiments=5, n_candidates=10, max_iterations=3)
    design.save(tmp_path)
    again = fp.Design.load(tmp_path)
    assert again.problem.model == problem.model and again.points == design.points
    assert fp.Experiments.from_csv(tmp_path / "design.csv", problem.model) == design.points
    text = to_text(report.design_report(design))
    assert all(f"[{axis.unit}]" in text for axis in problem.model.axes) and ("[s]" in text) == bool(problem.model.states)
    done = fp.simulate(problem.model, design.points, problem.theta)
    assert "ok" in to_text(report.simulation_report(problem.model, design.points, done.y, done.status))
    frame = simulation_frame(problem.model, design.points, done.y, done.status)
    assert list(frame.columns)[: len(problem.model.axes)] == [axis.name for axis in problem.model.axes]
    drawn = [name for name, plot in design._plots().items() if plot()]
    moving = ["trajectories"] if problem.model.states else []
    assert drawn == ["criterion", "points", "standard_errors", "correlation", *moving]
    axes = plots.plot_points(design).axes[0]
    shown = ("d [mol/L]", "E") if problem.model is dose else ("dt, logarithmic", "c [mol/L]")
    assert (axes.get_xlabel(), axes.get_ylabel()) == shown
