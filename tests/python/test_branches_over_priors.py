"""Covariances over a prior whose nodes take other branches, and plans for trajectories that forget where they began."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

import fisherpoint as fp

pytestmark = pytest.mark.kernels

PRIOR = fp.GaussianPrior({"p": 1.05, "q": 1.05}, std={"p": 0.5, "q": 0.3})


@pytest.mark.parametrize("rule", [fp.TensorGrid(4, 1.5), fp.Sobol(256)], ids=["tensor", "sobol"])
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
