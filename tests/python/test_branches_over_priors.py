"""Branches that are not taken, or only at some nodes of a prior; and plans for trajectories that forget where they began."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

import fisherpoint as fp

pytestmark = pytest.mark.kernels

PRIOR = fp.GaussianPrior({"p": 1.05, "q": 1.05}, std={"p": 0.5, "q": 0.3})


@pytest.mark.parametrize("rule", [fp.TensorGrid(4, span=1.5), fp.Sobol(256)], ids=["tensor", "sobol"])
@pytest.mark.parametrize(
    ("rate", "output"),
    [
        ("heaviside(p - 1)*u", "x"),
        ("where(p > 1 and u > 0, 1, 2)*u", "x + 0*q"),
        ("u*q", "heaviside(p - 1)*u"),
        ("u*q", "sign(x - 1)"),
        ("u*q", "where(x > 1, 3, p)"),
        ("u", "where(p > 1, x, 2*x)"),
    ],
)
def test_what_a_parameter_reaches_through_a_branch_alone_varies(rate: str, output: str, rule: fp.Rule) -> None:
    """There is no derivative there, and there is a variance."""
    model = fp.SymbolicModel([rate], [output], {"x": "1"}, {"u": "1"}, {"p": "1", "q": "1"}, {"y": "1"})
    points = fp.Experiments([[0.0]], [[1.0]], [1.0])
    nodes, weights = rule.nodes(PRIOR)
    y = np.array([fp.simulate(model, points, theta).y[0, 0] for theta in nodes])
    deviation = y - fp.simulate(model, points, [1.05, 1.05]).y[0, 0]
    spread = fp.predictive_covariance(model, points, PRIOR, rule)
    assert spread.status[0] == fp.Status.ok
    assert spread.covariance[0, 0, 0] == pytest.approx(np.average(deviation**2, weights=weights), rel=1e-6)
    assert spread.covariance[0, 0, 0] > 0.1


def test_a_trajectory_that_ends_at_rest_is_planned() -> None:
    """Two solutions that agree to the last bit leave no error to tell the order by."""
    program = """
import fisherpoint as fp
model = fp.SymbolicModel(["1e3*(cos(x) - x)"], ["p*x"], {"x": "1"}, {}, {"p": "1"}, {"y": "1"})
prior = fp.GaussianPrior({"p": 2.0}, std={"p": 0.1})
points = fp.Experiments([[k / 16] for k in range(32)], [[]] * 32, [0.01 * 1.3**k for k in range(32)])
print(fp.predictive_covariance(model, points, prior, fp.Sobol(64)).status.tolist())
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0 and done.stdout.startswith("[0, "), done.stderr


@pytest.mark.parametrize(
    ("rate", "output", "x0", "u", "p"),
    [
        ("-k*x + where(u > 0, p*x/u, 0)", "x", 1.0, 0.0, 1.0),
        ("-k*x", "where(p > 0, x/p, 0) + x", 1.0, 0.0, 0.0),
        ("-k*x", "(1 + where(p > 0, exp(-1/p), 0))*x", 1.0, 0.0, 0.0),
        ("-k*x", "where(p < 5, x*exp(p), 0) + x", 1.0, 0.0, 800.0),
        ("-k*x", "where(p < 5, x*sinh(p), 0) + x", 1.0, 0.0, 800.0),
        ("-k*x", "where(p > 0, x**2*log(p), 0) + x", 1.0, 0.0, -1.0),
        ("-k*abs(u - p)**1.5*x - k*x", "x", 1.0, 1.0, 1.0),
    ],
)
def test_a_branch_that_has_no_value_and_is_not_taken_leaves_the_derivative(
    rate: str, output: str, x0: float, u: float, p: float
) -> None:
    model = fp.SymbolicModel([rate], [output], {"x": "1"}, {"u": "1"}, {"k": "1", "p": "1"}, {"y": "1"})
    done = fp.sensitivities(model, fp.Experiments([[x0]], [[u]], [1.0]), [1.0, p])
    assert done.status[0] == fp.Status.ok
    assert done.dy_dtheta[0, 0] == pytest.approx([-np.exp(-1.0), 0.0], abs=1e-8)


@pytest.mark.parametrize("exponent", [1.3, 1.5, 2.5])
def test_a_power_above_one_of_an_absolute_value_is_flat_where_that_is_zero(exponent: float) -> None:
    model = fp.SymbolicModel(["u - k*x"], [f"abs(x)**{exponent}"], {"x": "1"}, {"u": "1"}, {"k": "1"}, {"y": "1"})
    done = fp.sensitivities(model, fp.Experiments([[0.0]], [[0.0]], [1.0]), [2.0])
    assert (done.status[0], done.y[0, 0], done.dy_dtheta[0, 0, 0]) == (fp.Status.ok, 0.0, 0.0)
