"""What friction holds, and what is too small to be told from rounding, carries no information: everywhere the same rank."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.estimation.precision import Precision, covariances
from fisherpoint.information.null_space import UNTOLD, information_without_rounding, without_rounding

NOMINAL = {"R": 1.0, "L": 0.1, "k": 0.3, "J": 0.05, "d": 0.02, "T": 0.5}
NOISE = {"i": 1e-2, "w": 1e-2}
TOLD = {"R", "L"}


@cache
def motor() -> fp.SymbolicModel:
    return fp.SymbolicModel(
        ["(u - R*i - k*w)/L", "(k*i - T*sign(w) - d*w)/J"],
        ["i", "w"],
        {"i": "A", "w": "rad/s"},
        {"u": "V"},
        {"R": "V/A", "L": "V s/A", "k": "V s", "J": "kg m^2", "d": "N m s", "T": "N m"},
        {"i": "A", "w": "rad/s"},
    )


def prior() -> fp.GaussianPrior:
    return fp.GaussianPrior(mean=NOMINAL, relative_std=dict.fromkeys(NOMINAL, 0.1))


def locked(region: fp.ExperimentRegion | fp.RunRegion) -> fp.DesignProblem:
    """At |u| <= 1 V the torque 0.3 A k never exceeds the friction: the rotor does not turn."""
    return fp.DesignProblem(motor(), prior(), region, noise=NOISE)


def points() -> fp.DesignProblem:
    return locked(fp.ExperimentRegion({"i": (0, 0), "w": (0, 0), "u": (-1, 1), "dt": (0.01, 1.0)}))


def run() -> fp.Runs:
    return fp.Runs([[0.0, 0.0]], np.sin(1.3 * np.arange(20.0))[None, :, None], 0.05)


def left_open(directions: tuple[object, ...]) -> set[str]:
    """The parameters of null directions, each of which is one alone."""
    names = [tuple(direction) for direction in directions]  # type: ignore[call-overload]
    assert all(len(name) == 1 for name in names)
    return {name[0] for name in names}


@pytest.mark.kernels
def test_sensitivities_of_what_friction_holds_are_zero() -> None:
    done = fp.sensitivities(motor(), run(), NOMINAL)
    assert done.status[0] == fp.Status.ok
    told = np.isin(list(NOMINAL), list(TOLD))
    assert np.abs(done.dx_dtheta[:, :, 0][..., told]).max() > 1e-2
    assert not done.dx_dtheta[:, :, 1].any() and not done.dx_dtheta[..., ~told].any() and not done.x[:, :, 1].any()


@pytest.mark.kernels
def test_of_two_masses_and_of_a_level_that_is_held() -> None:
    # A mass that rests beside one that moves.
    masses = fp.SymbolicModel(
        ["v", "(u - c*sign(v))/m", "w", "(u - e*sign(w) - b*w)/n"],
        ["q", "s"],
        dict.fromkeys("qvsw", "1"),
        {"u": "1"},
        dict.fromkeys("cmebn", "1"),
    )
    theta = {"c": 2.0, "m": 0.7, "e": 0.3, "b": 0.4, "n": 1.3}
    done = fp.sensitivities(masses, fp.Runs([[0.1, 0.0, 0.0, 0.2]], np.full((1, 12, 1), 1.1), 0.1), theta)
    assert done.status[0] == fp.Status.ok
    assert not done.dy_dtheta[:, :, 0].any() and (np.abs(done.dy_dtheta[:, 5:, 1, 2:]) > 1e-4).all()
    # Once it has come to rest, its place alone tells.
    done = fp.sensitivities(masses, fp.Runs([[0.1, 1.0, 0.0, 0.2]], np.full((1, 12, 1), 1.1), 0.1), theta)
    rests = done.x[0, 1:, 1] == 0.0
    assert rests[-3:].all() and not done.dx_dtheta[0, rests, 1].any() and done.dy_dtheta[0, -1, 0, :2].all()
    # A level that is held at a threshold by what flows in only below: it is that threshold, whatever flows.
    tank = fp.SymbolicModel(
        ["a*heaviside(r - h) - k*sqrt(h)"], ["h"], {"h": "m"}, {"u": "1"}, {"a": "m/s", "r": "m", "k": "m^0.5/s"}
    )
    done = fp.sensitivities(tank, fp.Runs([[0.5]], np.zeros((1, 20, 1)), 0.1), {"a": 2.0, "r": 1.0, "k": 0.5})
    np.testing.assert_array_equal(done.dx_dtheta[0, -1, 0], [0.0, 1.0, 0.0])


def test_a_locked_motor_tells_about_its_winding_alone() -> None:
    everything = fp.evaluate(points(), run())
    assert everything.rank == 2 and everything.log_det == -np.inf and everything.standard_errors is None
    assert left_open(everything.null_directions) == NOMINAL.keys() - TOLD
    found = fp.exchange(points(), n_experiments=4, max_iterations=40, method=fp.ExchangeMethod(references=False)).evaluation
    assert found.rank == 2 and left_open(found.null_directions) == NOMINAL.keys() - TOLD
    u = np.linspace(-1.0, 1.0, 5)
    given = fp.Experiments(np.zeros((20, 2)), np.tile(u, 4)[:, None], np.repeat([0.03, 0.1, 0.3, 1.0], 5))
    approximate = fp.approximate_design(points(), given)
    assert left_open(approximate.null_directions) == NOMINAL.keys() - TOLD
    region = fp.RunRegion({"i": 0.0, "w": 0.0, "u": (-1, 1), "dt": 0.05}, segments=8)
    designed = fp.design_runs(locked(region), n_runs=1, n_starts=1, n_candidates=60)
    assert designed.evaluation.rank == 2 and left_open(designed.evaluation.null_directions) == NOMINAL.keys() - TOLD


def test_no_parameter_of_what_does_not_move_is_identifiable() -> None:
    region = fp.ExperimentRegion({"i": (0, 0), "w": (0, 0), "u": (-1, 1), "dt": (0.01, 1.0)})
    found = fp.identifiability(motor(), region=region, parameters=["k", "J", "T"], prior=prior())
    assert found.identifiable is False and found.rank == 0
    assert fp.identifiability(motor(), region=region, prior=prior()).rank == 2


@pytest.mark.parametrize("with_noise", [True, False])
def test_an_estimate_from_a_locked_motor_leaves_the_rest_open(with_noise: bool) -> None:
    data = fp.VirtualRig(motor(), NOMINAL, NOISE, seed=3).measure(run())
    fit = fp.estimate(motor(), data, start=NOMINAL, noise=NOISE if with_noise else None)
    assert all(np.isfinite(fit.standard_errors[name]) == (name in TOLD) for name in NOMINAL)


def faint(share: float) -> fp.DesignProblem:
    """What b adds to y is `share` of what a does."""
    model = fp.SymbolicModel([], [f"a*u + {share!r}*b*u**2"], {}, {"u": "1"}, dict.fromkeys("ab", "1"))
    mean = {"a": 1.0, "b": 1.0}
    region = fp.ExperimentRegion({"u": (-1, 1)})
    return fp.DesignProblem(model, fp.GaussianPrior(mean, std=mean), region, noise={"y": 1e-2})


@pytest.mark.parametrize(("share", "rank"), [(1e-8, 2), (1e-12, 1)])
def test_what_is_below_rounding_counts_nowhere(share: float, rank: int) -> None:
    problem = faint(share)
    some = fp.Experiments(np.empty((3, 0)), [[1.0], [-1.0], [0.5]], np.ones(3))
    evaluated = fp.evaluate(problem, some)
    assert evaluated.rank == rank and np.isfinite(evaluated.log_det) == (rank == 2)
    assert (evaluated.fisher[1, 1] == 0.0) == (rank == 1)
    for method in ("auto", "paper"):
        found = fp.exchange(problem, n_experiments=3, max_iterations=20, method=fp.ExchangeMethod(method, references=False))
        assert found.evaluation.rank == rank
    assert len(fp.approximate_design(problem, some).null_directions) == 2 - rank
    assert len(fp.exact_design(problem, some, 3).null_directions) == 2 - rank
    beside = fp.evaluate(problem, some, prior_information=True)
    assert beside.rank == 2 and np.isinf(beside.without_prior["b"]) == (rank == 1)  # type: ignore[index]
    data = fp.VirtualRig(problem.model, {"a": 1.0, "b": 1.0}, {"y": 1e-2}).measure(some)
    fit = fp.estimate(problem.model, data, prior=None, start={"a": 1.0, "b": 1.0}, noise={"y": 1e-2})
    assert np.isfinite(fit.standard_errors["b"]) == (rank == 2)


def test_matrices_of_which_columns_are_rounding() -> None:
    white = np.array([[1.0, 0.3 * UNTOLD, 0.0], [2.0, -0.4 * UNTOLD, 3 * UNTOLD]])
    cleaned = without_rounding(white)
    np.testing.assert_array_equal(cleaned, [[1.0, 0.0, 0.0], [2.0, 0.0, 3 * UNTOLD]])
    np.testing.assert_array_equal(information_without_rounding(white.T @ white), cleaned.T @ cleaned)
    full = np.array([[1.0, 2.0]])
    assert without_rounding(full) is full
    several = covariances(np.stack([white, np.eye(2, 3)]))
    for covariance, determined, jacobian in zip(*several, [white, np.eye(2, 3)], strict=True):
        one = Precision.of(jacobian)
        np.testing.assert_allclose(covariance, one.covariance, rtol=1e-12)
        np.testing.assert_array_equal(determined, one.determined)
