"""Designs beside each other."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import fisherpoint as fp

MODEL = fp.SymbolicModel(["-k*x + b*u"], ["x"], {"x": "m"}, {"u": "V"}, {"k": "1/s", "b": "m/(s V)"}, {"y": "m"})
PRIOR = fp.GaussianPrior({"k": 1.0, "b": 0.5}, {"k": 0.2, "b": 0.1})
PROBLEM = fp.DesignProblem(MODEL, PRIOR, None, noise={"y": 0.01}, along=["x < 1.5"])
POINTS = fp.Experiments([[1.0], [0.5], [0.2]], [[0.0], [1.0], [0.5]], [0.5, 1.0, 2.0])
RUNS = fp.Runs([[0.0]], np.array([[[1.0], [0.0], [1.0]]]), np.array([[0.5, 1.0, 0.7]]))


def test_each_design_is_what_it_is_alone() -> None:
    found = fp.compare(PROBLEM, {"points": POINTS, "run": RUNS}, draws=200, seed=3)
    for name, of, kind, samples, duration in (("points", POINTS, "point", 3, 3.5), ("run", RUNS, "run", 3, 2.2)):
        alone, one = fp.evaluate(PROBLEM, of), found.designs[name]
        assert one.log_det == pytest.approx(np.linalg.slogdet(alone.information)[1])
        assert one.standard_errors == alone.standard_errors
        assert (one.kind, one.count, one.samples) == (kind, len(of), samples) and one.duration == pytest.approx(duration)
        assert one.feasibility.able == fp.feasibility(PROBLEM, of, draws=200, seed=3).able


def test_a_design_that_is_repeated_has_twice_the_efficiency_and_the_same_per_sample() -> None:
    twice = fp.Experiments.join([POINTS, POINTS])
    found = fp.compare(PROBLEM, {"once": POINTS, "twice": twice, "one": POINTS[:1]}, draws=20)
    assert found.efficiency == pytest.approx({"once": 0.5, "twice": 1.0, "one": 0.0})
    assert found.efficiency_per_sample == pytest.approx({"once": 1.0, "twice": 1.0, "one": 0.0})
    assert "-inf: singular" in str(found) and found.designs["one"].standard_errors is None
    assert np.isnan(found.to_pandas().loc["one"].standard_error).all()


def test_results_of_searches_are_taken() -> None:
    region = fp.RunRegion({"x": 0.0, "u": (0, 1), "dt": 0.5}, 3)
    design = fp.design_runs(PROBLEM.replace(region=region), n_starts=1, n_candidates=20)
    found = fp.compare(PROBLEM, {"found": design, "given": RUNS}, draws=20)
    assert found.designs["found"].log_det == pytest.approx(design.log_det, abs=1e-4)
    assert set(fp.validate(PROBLEM, {"found": design}, runs=20).designs) == {"found"}


def test_a_design_that_leaves_a_limit_stands_beside_the_others(tmp_path: Path) -> None:
    over = fp.Experiments([[1.4], [0.5]], [[9.0], [1.0]], [2.0, 1.0])
    run = fp.Runs([[1.4]], np.full((1, 2, 1), 9.0), np.ones((1, 2)))
    found = fp.compare(PROBLEM, {"points": POINTS, "over": over, "run": run}, draws=50)
    assert found.designs["points"].log_det == fp.compare(PROBLEM, {"points": POINTS}, draws=50).designs["points"].log_det
    for name, samples in (("over", 2), ("run", 2)):
        one = found.designs[name]
        assert (one.log_det, one.standard_errors, one.samples) == (-np.inf, None, samples) and one.feasibility.share < 0.5
        assert (
            f"Warning: No information of {name}: {name if name == 'run' else 'point'}s: expected trajectories that are ok"
            in str(found)
        )
    assert (
        found.efficiency == {"points": 1.0, "over": 0.0, "run": 0.0}
        and np.isnan(found.to_pandas().loc["over"].standard_error).all()
    )
    found.plot()
    found.save(tmp_path / "found.json")
    assert str(fp.results.DesignComparison.load(tmp_path / "found.json")) == str(found)


def test_misuse_is_told() -> None:
    with pytest.raises(ValueError, match="designs: expected at least one, given none"):
        fp.compare(PROBLEM, {})
    with pytest.raises(TypeError, match=r"designs\['a'\]: expected Experiments, Runs or a Design, given int"):
        fp.compare(PROBLEM, {"a": 3})
    with pytest.raises(ValueError, match="noise: expected the sensor noise, as designs are compared by it, given None"):
        fp.compare(PROBLEM.replace(noise=None, output_covariance="pooled"), {"a": POINTS})
    with pytest.raises(ValueError, match=r"designs\['a'\]: x0: expected shape"):
        fp.compare(PROBLEM, {"a": fp.Experiments([[1.0, 2.0]], [[0.0]], [0.5])})
