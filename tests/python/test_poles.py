"""Trajectories that run into a pole of f in finite time, and end there: x' = p / (2 - x) reaches 2 at t = (2 - x0)^2 / (2 p)."""

from __future__ import annotations

import numpy as np
import pytest

import fisherpoint as fp

pytestmark = pytest.mark.kernels
P = 0.5025
COUNT = 5000


def poles() -> fp.Model:
    return fp.SymbolicModel(["p / (2 - x)"], ["x"], {"x": "1"}, {}, {"p": "1"})


def starts() -> tuple[np.ndarray, np.ndarray]:
    """Starts, and the times at which their trajectories end."""
    distance = 10 ** np.random.default_rng(0).uniform(-3, 0, COUNT)
    return 2 - distance, distance**2 / 2 / P


def points(x0: np.ndarray, dt: np.ndarray) -> fp.Experiments:
    return fp.Experiments(x0[:, None], np.zeros((len(x0), 0)), dt)


@pytest.mark.parametrize("method", ["RK45", "DOP853"])
@pytest.mark.parametrize("rtol", [1e-3, 1e-4, 1e-6, 1e-8])
def test_no_step_goes_past_a_pole(rtol: float, method: str) -> None:
    x0, end = starts()
    longer = end * np.random.default_rng(1).uniform(1.001, 3, COUNT)
    done = fp.simulate(poles(), points(x0, longer), [P], rtol=rtol, method=method)
    assert (done.status == fp.Status.left_domain).all()


@pytest.mark.parametrize("method", ["RK45", "DOP853"])
@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-8])
def test_what_ends_before_the_pole_is_right(rtol: float, method: str) -> None:
    x0, end = starts()
    shorter = end * np.random.default_rng(1).uniform(0.1, 0.99, COUNT)
    done = fp.simulate(poles(), points(x0, shorter), [P], rtol=rtol, method=method)
    assert (done.status == fp.Status.ok).all()
    np.testing.assert_allclose(done.x[:, 0], 2 - np.sqrt((2 - x0) ** 2 - 2 * P * shorter), rtol=0, atol=100 * rtol)


@pytest.mark.parametrize("method", ["RK45", "DOP853"])
@pytest.mark.parametrize("rtol", [1e-3, 1e-5, 1e-8])
def test_no_step_goes_over_a_divisor_that_touches_zero(rtol: float, method: str) -> None:
    # x falls to pi / 2 like the cube root of the time that is left, and would go on below it with the same sign of the divisor.
    model = fp.SymbolicModel(
        f=["p * x / (1.2 + x) + p / (sin(x) - 1)"], g=["x"], states={"x": "1"}, inputs={"u": "1"}, parameters={"p": "1"}
    )
    off = np.random.default_rng(0).uniform(0.05, 0.6, 2000)
    points = fp.Experiments(np.pi / 2 + off[:, None], np.zeros((2000, 1)), np.linspace(1.1, 4.0, 2000) * off**3 / 6)
    status = fp.simulate(model, points, [1.0], rtol=rtol, method=method).status
    assert (status != fp.Status.ok).mean() > 0.999
    early = fp.simulate(model, fp.Experiments(points.x0, points.u, 0.5 * off**3 / 6), [1.0], rtol=rtol, method=method).status
    assert (early == fp.Status.ok).all()


def test_nodes_that_run_into_a_pole_are_lost() -> None:
    """The last node of the rule would reach the pole before dt, the others after it."""
    x0, end = starts()
    prior = fp.GaussianPrior({"p": P}, {"p": 0.2 * P})
    rule = fp.GaussHermite(5)
    theta, weights = rule.nodes(prior)
    order = np.argsort(theta[:, 0])
    dt = end * P / theta[order[-2:], 0].mean()  # of the mean, at which the fastest node alone is past its end
    done = fp.predictive_covariance(poles(), points(x0[:500], dt[:500]), prior, rule, rtol=1e-4)
    ok = done.status == fp.Status.ok
    np.testing.assert_allclose(done.lost_weight[ok], weights[order[-1]])
    assert (done.lost_weight[~ok] >= weights[order[-1]]).all()
