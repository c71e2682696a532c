"""Noise-free data give theta back, from starts two prior standard deviations away; where they cannot, the open direction is told.

The rule for starts: the search begins at the one that is given. Where trajectories are not ok there, that is an error, and where
it ends in a minimum that does not explain the data, chi-square says so. A prior as `start` then gives several starts around that
point, in the place of those that are not ok further ones.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.design.file.configuration import load_config

EXAMPLES = Path(__file__).parents[2] / "examples"
NAMES = sorted(path.stem for path in EXAMPLES.glob("*.toml") if "[runs]" not in path.read_text(encoding="utf-8"))
PATTERNS = {"figure2": 2}  # of signs; others have 4
RTOL = 1e-12


def experiment(name: str) -> tuple[fp.DesignProblem, fp.Measurements, dict[str, float]]:
    """A quick design, noise-free data of it at the prior mean, and a noise for the weights."""
    config = load_config(EXAMPLES / f"{name}.toml")
    problem = config.problem()
    count = max(12, len(problem.parameters) + 2)
    design = fp.exchange(problem, n_experiments=count, method="paper", n_candidates=30, max_iterations=5, seed=2)
    theta = problem.model.theta(dict(problem.prior.mean))
    y = fp.simulate(problem.model, design.points, theta, rtol=RTOL).y
    noise = problem.noise or {quantity.name: 1e-3 for quantity in problem.model.outputs}
    return problem, fp.Measurements(design.points, y), dict(noise)


def prior_around(prior: fp.GaussianPrior, signs: np.ndarray) -> fp.GaussianPrior:
    """The prior with its center moved by two standard deviations, of the logarithm where that is normal."""
    mean, std = {}, {}
    for name, sign, spread in zip(prior.names, signs, prior.normal_std, strict=True):
        factor = float(np.exp(2 * sign * spread)) if name in prior.log else 1.0
        mean[name] = prior.mean[name] * factor if name in prior.log else prior.mean[name] + 2 * sign * prior.std[name]
        std[name] = prior.std[name] * factor
    return fp.GaussianPrior(mean, std, log=prior.log)


@pytest.mark.long
@pytest.mark.parametrize("name", NAMES)
def test_theta_is_recovered_from_noise_free_data(name: str) -> None:
    problem, data, noise = experiment(name)
    rng, recovered, patterns = np.random.default_rng(0), 0, PATTERNS.get(name, 4)
    for _ in range(patterns):
        start = prior_around(problem.prior, rng.choice([-1.0, 1.0], len(problem.prior.names)))
        fit, said = None, False
        try:
            fit = fp.estimate(problem.model, data, start=dict(start.mean), noise=noise, rtol=RTOL)
        except ValueError as error:
            said = "expected parameters at which trajectories are ok" in str(error)
        if fit is not None and not is_recovered(fit, problem):
            said = "is wrong" in str(fit)
        elif fit is not None:
            recovered += 1
            continue
        assert said, str(fit)
        fit = fp.estimate(problem.model, data, start=start, noise=noise, rtol=RTOL)
        assert is_recovered(fit, problem), str(fit)
    assert recovered >= patterns // 2


def is_recovered(fit: fp.Fit, problem: fp.DesignProblem) -> bool:
    errors = [abs(fit.estimate[name] / problem.prior.mean[name] - 1) for name in fit.parameters]
    return fit.converged and not fit.null_directions and max(errors) < 1e-8


def test_the_gain_of_the_axis_is_told_to_be_open() -> None:
    problem, data, noise = experiment("positioning_axis")
    model = problem.model.estimate("g")
    start = {name: mean * 1.1 for name, mean in problem.prior.mean.items()} | {"g": 33.0}
    fit = fp.estimate(model, data, start=start, noise=noise, rtol=RTOL)
    assert len(fit.null_directions) == 1
    assert sorted(fit.null_directions[0].split(", ")) == [f"{name} up 1 %" for name in ("F_c", "F_v", "M", "g", "offset")]
    assert all(np.isinf(error) for error in fit.standard_errors.values())
    assert "not determined" in str(fit)
    # What can be told, the ratios, is right.
    for name, mean in problem.prior.mean.items():
        assert fit.estimate[name] / fit.estimate["g"] == pytest.approx(mean / problem.model.constants["g"], rel=1e-8)
    assert fit.profile("M").interval == (-np.inf, np.inf) or fit.profile("M").interval[1] == np.inf


def test_a_prior_closes_the_open_direction() -> None:
    problem, data, noise = experiment("positioning_axis")
    model = problem.model.estimate("g")
    mean = {**problem.prior.mean, "g": problem.model.constants["g"]}
    prior = fp.GaussianPrior(mean, {**problem.prior.std, "g": 0.05 * mean["g"]})
    fit = fp.estimate(model, data, prior, noise=noise, rtol=RTOL)
    assert not fit.null_directions
    assert fit.rse["g"] == pytest.approx(0.0438, abs=0.01)  # 5 %, and a little from the priors of the others
    assert fit.correlation[0, -1] > 0.999


def test_a_tank_of_which_the_level_at_the_start_is_not_known_is_told_to_have_no_scale() -> None:
    """Without the rim, k1, k4 and the start of the upper tank can change together."""
    config = load_config(EXAMPLES / "cascaded_tanks.toml")
    model, theta = config.build_model(), dict(config.build_prior().mean)
    t = 4.0 * np.arange(120)
    u = 2.0 + np.where((np.arange(120) // 15) % 2, 1.0, -1.0)
    y = fp.simulate_record(model, t, u, theta, {"h1": 5.0, "h2": 4.0}, rtol=RTOL).y
    names = ["k1", "k2", "k3", "k4"]
    fit = fp.estimate(
        model,
        fp.Record(t, u, y, x0={"h2": 4.0}),
        start={"k1": 0.05, "x0_h1": 5.3},
        parameters=names,
        noise={"level": 0.05},
        rtol=RTOL,
    )
    assert len(fit.null_directions) == 1
    moves = dict(move.split(" ", 1) for move in fit.null_directions[0].split(", "))
    assert moves in (
        {"k1": "up 0.5 %", "k2": "down 0.5 %", "k4": "up 1 %", "x0_h1": "up 1 %"},
        {"k1": "down 0.5 %", "k2": "up 0.5 %", "k4": "down 1 %", "x0_h1": "down 1 %"},
    )
    known = fp.estimate(
        model,
        fp.Record(t, u, y, x0={"h1": 5.0, "h2": 4.0}),
        start={"k1": 0.05},
        parameters=names,
        noise={"level": 0.05},
        rtol=RTOL,
    )
    assert not known.null_directions
    assert max(abs(known.estimate[name] / theta[name] - 1) for name in names) < 1e-8


def test_points_on_a_line_tell_no_more_than_two_lines_do() -> None:
    """Where speed and voltage go up together, each output is a straight line over the points: four numbers, for six parameters."""
    config = load_config(EXAMPLES / "dc_motor.toml")
    model, theta = config.build_model(), dict(config.build_prior().mean)
    speed, voltage = np.linspace(100.0, 600.0, 6), np.linspace(4.0, 24.0, 6)
    points = fp.Experiments(np.stack([np.zeros(6), speed], axis=1), voltage[:, None], np.full(6, 1e-2))
    y = fp.simulate(model, points, model.theta(theta), rtol=RTOL).y
    fit = fp.estimate(model, fp.Measurements(points, y), noise={"i": 2e-3, "w": 0.3}, start={"L": 2e-4}, rtol=RTOL)
    assert len(fit.null_directions) == 2
    assert fit.degrees_of_freedom == pytest.approx(12 - 4)
    assert fit.chi_square < 1e-9
