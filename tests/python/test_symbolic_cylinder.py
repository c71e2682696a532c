"""The cylinder written in Python, as the interpreter of the core runs it, next to the built-in one."""

import numpy as np
import pytest

import fisherpoint as fp

pytestmark = pytest.mark.kernels

MODEL = fp.HydraulicCylinder()
SYMBOLIC = MODEL.symbolic()
THETA = MODEL.theta(MODEL.nominal)


@pytest.fixture(scope="module")
def points():
    """10,000 points all over the domain: many meet jumps, kinks and limits on their way."""
    rng = np.random.default_rng(7)
    k = 10_000
    x0 = np.column_stack(
        [
            rng.uniform(0.01, 0.29, k),
            rng.uniform(-0.3, 0.3, k),
            rng.uniform(0.6e6, 20.9e6, k),
            rng.uniform(0.6e6, 20.9e6, k),
            rng.uniform(-1, 1, k),
        ]
    )
    return fp.Experiments(x0, rng.uniform(-1, 1, (k, 1)), rng.uniform(1e-3, 1e-2, k))


@pytest.fixture(scope="module")
def theta(points):
    return THETA * np.random.default_rng(8).uniform(0.8, 1.2, (len(points), len(THETA)))


def check_close(a, b, rows, tolerance=1e-12):
    """Relative to the largest entry of each column, over the given rows."""
    a, b = a[rows], b[rows]
    scale = np.abs(a).max(axis=0)
    assert (np.abs(a - b) <= tolerance * scale).all()


@pytest.mark.parametrize("jumps", ["cross", "exclude"])
@pytest.mark.parametrize("method", ["RK45", "DOP853"])
def test_trajectories_and_statuses_are_the_built_in_ones(points, theta, method, jumps):
    built_in, interpreted = (fp.simulate(model, points, theta, method=method, jumps=jumps) for model in (MODEL, SYMBOLIC))
    assert np.array_equal(built_in.status, interpreted.status)
    counts = np.bincount(built_in.status, minlength=3)
    assert counts[fp.Status.ok] > 3000
    assert (counts[fp.Status.met_jump] > 300) == (jumps == "exclude")
    assert counts[fp.Status.left_domain] > 30
    ok = built_in.status == fp.Status.ok
    crossed = ok & (np.sign(built_in.x[:, 4]) != np.sign(points.x0[:, 4]))
    assert crossed.sum() > 1000  # kinks
    check_close(built_in.x, interpreted.x, ok)
    check_close(built_in.y, interpreted.y, ok)


@pytest.mark.parametrize("method", ["RK45", "DOP853"])
def test_sensitivities_are_the_built_in_ones(points, theta, method):
    built_in, interpreted = (fp.sensitivities(model, points, theta, method=method) for model in (MODEL, SYMBOLIC))
    assert np.array_equal(built_in.status, interpreted.status)
    ok = built_in.status == fp.Status.ok
    check_close(built_in.dx_dtheta, interpreted.dx_dtheta, ok)
    check_close(built_in.dy_dtheta, interpreted.dy_dtheta, ok)


def test_predictive_covariances_are_the_built_in_ones(points):
    prior = fp.GaussianPrior(MODEL.nominal, relative_std=dict.fromkeys(MODEL.nominal, 0.05))
    some = points[:60]
    for rule in (fp.SparseGaussHermite(2), fp.TensorGrid(levels=2)):
        built_in, interpreted = (fp.predictive_covariance(model, some, prior, rule) for model in (MODEL, SYMBOLIC))
        assert np.array_equal(built_in.status, interpreted.status)
        ok = built_in.status == fp.Status.ok
        assert ok.sum() > 10
        check_close(built_in.covariance, interpreted.covariance, ok, 1e-9)
