"""`fp.validate` with designs of runs: what is promised is achieved, with what deviates once per run and once per experiment."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.validation.truths import Rig, Streams
from run_cases import NOISE, THETA, drawn, tanks

mpl.use("Agg")
MODEL, START, CONSTANT = tanks(), {"a": 0.05, "b": 0.03}, {"c": 0.03}
PRIOR = fp.GaussianPrior(THETA, {"k1": 0.05, "k2": 0.05})
RUNS = drawn(2, 24, share=1.0)
REPEATED = fp.Runs(np.tile(RUNS.x0[:1], (2, 1)), np.tile(RUNS.u[:1], (2, 1, 1)), np.tile(RUNS.dt[:1], (2, 1)))


def problem(**changes: Any) -> fp.DesignProblem:
    return fp.DesignProblem(MODEL, PRIOR, None, noise=NOISE, **changes)


def sigmas(figure: Any, expected: float) -> float:
    return abs(figure.value - expected) / figure.error


@pytest.mark.parametrize("start", [None, START])
@pytest.mark.parametrize("noise", [NOISE, {"y": 0.01}])
def test_runs_keep_their_promise(start: dict[str, float] | None, noise: dict[str, float]) -> None:
    given = problem(initial_state_std=start)
    found = fp.validate(given, {"two": RUNS, "twice": REPEATED}, runs=400, theta="mean", noise=noise)
    for design in found.designs.values():
        assert design.fits == 400 and not design.failures
        for of in design.parameters.values():
            assert of.claimed.value == pytest.approx(of.promised, rel=0.02)
            assert sigmas(of.ratio, 1) < 4 and sigmas(of.coverage, 0.95) < 4
    if noise == NOISE:
        promised = fp.evaluate(given, RUNS).standard_errors
        assert promised is not None
        for name, of in found.designs["two"].parameters.items():
            assert of.promised == pytest.approx(promised[name], rel=1e-6)


def test_an_error_of_each_sample_would_be_seen() -> None:
    """The promise of a run whose samples had the errors of its start independently is far from what is achieved."""
    found = fp.validate(problem(initial_state_std=START), {"runs": RUNS}, runs=800, theta="mean").designs["runs"]
    done = fp.sensitivities(MODEL.free_start("a", "b"), RUNS, [*MODEL.theta(THETA), 0.0, 0.0])
    spread = done.dy_dtheta[..., 2:] * list(START.values())
    covariance = spread @ spread.swapaxes(-1, -2) + np.diag(np.square(list(NOISE.values())))
    slopes = done.dy_dtheta[..., :2]
    information = (slopes.swapaxes(-1, -2) @ np.linalg.solve(covariance, slopes)).sum(axis=(0, 1))
    wrong = np.sqrt(np.diag(np.linalg.inv(information)))
    off = [abs(of.achieved.value - error) / of.achieved.error for of, error in zip(found.parameters.values(), wrong, strict=True)]
    assert max(off) > 6


def test_constants_deviate_once_per_virtual_experiment_and_starts_once_per_run() -> None:
    rig = Rig.of(problem(uncertain=CONSTANT, initial_state_std=START), None, dict.fromkeys(NOISE, 1e-12))
    theta = np.tile(MODEL.theta(THETA), (300, 1))
    y, status, constants = rig.measure(REPEATED, theta, Streams.of(1, 2), 2)
    assert y.shape == (300, 48, 2) and not status.any()
    assert constants.shape == (300, 1) and np.std(constants) == pytest.approx(0.03, rel=4 / np.sqrt(600))
    exact = fp.simulate(MODEL, REPEATED, THETA, rtol=1e-10).y.reshape(48, 2)
    one, other = np.split(y - exact, 2, axis=1)  # of both runs
    done = fp.sensitivities(MODEL.estimate("c").free_start("a", "b"), REPEATED[0], [*MODEL.theta(THETA), 1.0, 0.0, 0.0])
    by_constant, by_start = done.dy_dtheta[0, -1, 0, 2] * 0.03, done.dy_dtheta[0, -1, 0, 3:] * list(START.values())
    shared = np.mean(one[:, -1, 0] * other[:, -1, 0])
    assert shared == pytest.approx(by_constant**2, rel=4 / np.sqrt(300) * 2)
    assert np.var(one[:, 0, 0] - other[:, 0, 0]) > 1e-4  # the starts differ
    size = by_constant**2 + by_start @ by_start
    assert np.mean(one[:, -1, 0] ** 2) == pytest.approx(size, rel=4 * np.sqrt(2 / 300))


def test_a_true_run_that_fails_is_counted() -> None:
    runs = fp.Runs([[1.0, 1.0]], [[-0.3, -0.3]], 0.52)  # after 1.12 s at the prior mean the first tank is empty
    prior = fp.GaussianPrior(THETA, {"k1": 0.1, "k2": 0.1})
    given = fp.DesignProblem(MODEL, prior, None, noise=NOISE)
    found = fp.validate(given, {"d": runs}, runs=60).designs["d"]
    assert found.failures["the true trajectory: left_domain"] > 5 and found.fits + sum(found.failures.values()) == 60


def test_estimated_noise_and_a_prior_serve_too() -> None:
    found = fp.validate(problem(), {"d": drawn(3)}, runs=300, theta="mean", noise_known=False).designs["d"]
    again = fp.validate(problem(), {"d": drawn(3)}, runs=300, use_prior=True).designs["d"]
    for of in (*found.parameters.values(), *again.parameters.values()):
        assert sigmas(of.ratio, 1) < 4 and sigmas(of.coverage, 0.95) < 4


def test_what_is_found_is_shown_and_kept(tmp_path: Path) -> None:
    given = problem(initial_state_std=START)
    found = fp.validate(given, {"runs": RUNS, "points": RUNS.starts}, runs=20, theta="mean")
    text = str(found)
    assert "runs: 2 runs of 48 samples, 20 fits" in text and "points: 2 points, 20 fits" in text
    assert "starts off by an error of each point and run" in text
    assert found.plot(path=tmp_path / "picture.png").axes[0].get_title("left").startswith("runs: 2 runs of 48 samples")
    found.save(tmp_path / "kept.json")
    again = fp.Validation.load(tmp_path / "kept.json")
    assert again.designs["runs"].points == RUNS and str(again) == text
    assert np.array_equal(again.designs["runs"].per_run.estimate, found.designs["runs"].per_run.estimate)  # type: ignore[union-attr]


def test_runs_that_do_not_serve_are_refused() -> None:
    wrong = fp.Runs([[1.0, 1.0]], [[1.0, -9.0]], 0.4)
    with pytest.raises(
        ValueError, match=r"^designs\['d'\]: runs: expected trajectories that are ok, given runs\[0\] \(left_domain: a > 0\)"
    ):
        fp.validate(problem(), {"d": wrong}, runs=20)
    with pytest.raises(ValueError, match=r"^designs\['d'\]: u: expected shape \(K, N, 1\)"):
        fp.validate(problem(), {"d": fp.Runs([[1.0, 1.0]], np.ones((1, 2, 2)), 0.4)}, runs=20)
    with pytest.raises(ValueError, match=r"^designs\['d'\]: output_covariance: expected 'noise' for runs"):
        fp.validate(problem(output_covariance="pooled"), {"d": RUNS}, runs=20)


def test_a_design_without_a_trajectory_at_the_mean_stands_beside_the_others(tmp_path: Path) -> None:
    prior = fp.GaussianPrior(THETA, {"k1": 0.1, "k2": 0.1})
    given = fp.DesignProblem(MODEL, prior, None, noise=NOISE)
    empties = fp.Runs([[1.0, 1.0]], [[-0.3, -0.3, -0.3]], 0.52)
    point = fp.Experiments([[1.0, 1.0], [1.0, 1.0]], [[-0.3], [0.5]], [2.0, 0.5])
    good = fp.Runs([[1.0, 1.0]], [[0.5, 0.3, 0.5]], 0.52)
    found = fp.validate(given, {"empties": empties, "good": good, "point": point}, runs=30)
    assert dict(found.designs["good"].parameters) == dict(fp.validate(given, {"good": good}, runs=30).designs["good"].parameters)
    for name, first in (("empties", "runs[0] (left_domain"), ("point", "points[0] (left_domain")):
        one = found.designs[name]
        assert first in one.without and one.per_run is None and not one.fits and not one.failures and not found.verdicts[name]
        assert f"{name}: nothing is promised: {one.without}" in found.report().lines
        assert np.isnan(found.to_pandas().loc[name].promised).all()
    assert not found.designs["good"].without
    found.plot()
    found.save(tmp_path / "found.json")
    again = fp.Validation.load(tmp_path / "found.json")
    assert str(again) == str(found) and again.designs["point"].without == found.designs["point"].without
    with pytest.raises(ValueError, match=r"designs\['empties'\]: runs: expected trajectories that are ok, given runs\[0\]"):
        fp.validate(given, {"empties": empties, "point": point}, runs=30)
