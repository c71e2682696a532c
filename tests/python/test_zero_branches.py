"""What is zero on a whole branch stands in a root, a comparison or another branch, as where functions are composed.

The oracle is the same function written flat.
"""

from __future__ import annotations

import numpy as np
import pytest

import fisherpoint as fp

pytestmark = pytest.mark.kernels

FLOW = {
    "sqrt(max(k*max(x - 1, 0), 0))": "sqrt(k)*sqrt(max(x - 1, 0))",
    "sqrt(max(max(x - 1, 0), 0))": "sqrt(max(x - 1, 0))",
    "sqrt(max(where(x > 1, k*(x - 1), 0), 0))": "sqrt(k)*sqrt(max(x - 1, 0))",
    "sqrt(max(where(x <= 1, 0, k*(x - 1)), 0))": "sqrt(k)*sqrt(max(x - 1, 0))",
    "max(k*max(x - 1, 0), 0)**1.5": "k**1.5*max(x - 1, 0)**1.5",
    "sqrt(max(max(x - 1, 0.5 - x, 0), 0))": "sqrt(max(x - 1, 0)) + sqrt(max(0.5 - x, 0))",
    "sqrt(max(-k*min(1 - x, 0), 0))": "sqrt(k)*sqrt(max(x - 1, 0))",
    "sqrt(-min(-k*max(x - 1, 0), 0))": "sqrt(k)*sqrt(max(x - 1, 0))",
    "sqrt(min(max(x - 1, 0), 0.5))": "where(x < 1.5, sqrt(max(x - 1, 0)), sqrt(0.5))",
    "max(max(x - 1, 0)*max(3*k - x, 0), 0)**0.5": "sqrt(max(x - 1, 0))*sqrt(max(3*k - x, 0))",
    "where(max(x - 1, 0) > 0, k*(x - 1), 0)": "k*max(x - 1, 0)",
    "where(k*max(x - 1, 0) <= 0, 0, k*(x - 1))": "k*max(x - 1, 0)",
    "sign(k*max(x - 1, 0))*(x - 1)": "max(x - 1, 0)",
    "heaviside(max(x - 1, 0))*sqrt(abs(x - 1))": "sqrt(max(x - 1, 0))",
}


def model(flow: str, output: str = "x") -> fp.SymbolicModel:
    return fp.SymbolicModel([f"u + 0.5*({flow})"], [output], {"x": "1"}, {"u": "1"}, {"k": "1"})


@pytest.mark.parametrize("method", [None, "RK45", "Radau"])
@pytest.mark.parametrize("nested", FLOW)
def test_composed_and_flat_flows_are_one(nested: str, method: str | None) -> None:
    """Starts below, on and above the edge; trajectories that stay, arrive, cross, and come back.

    None starts on the edge with an input of zero, where a root has several solutions.
    """
    x0 = np.repeat([0.2, 0.8, 1.0, 1.25, 1.75], 3)[:, None]
    u = np.tile([[0.0], [0.75], [-1.5]], (5, 1))
    unique = (x0 != 1.0)[:, 0] | (u != 0.0)[:, 0]
    points = fp.Experiments(x0[unique], u[unique], np.full(14, 0.625))
    composed, flat = (fp.sensitivities(model(flow), points, [0.7], rtol=1e-9, method=method) for flow in (nested, FLOW[nested]))
    assert composed.status.tolist() == flat.status.tolist()
    assert np.count_nonzero(composed.status == fp.Status.ok) >= 12
    np.testing.assert_allclose(composed.x, flat.x, rtol=1e-8)
    np.testing.assert_allclose(composed.dx_dtheta, flat.dx_dtheta, rtol=1e-5, atol=1e-7)
    states, beside = (fp.simulate(model(flow), points, [0.7], rtol=1e-9, method=method) for flow in (nested, FLOW[nested]))
    assert states.status.tolist() == beside.status.tolist()
    np.testing.assert_allclose(states.x, beside.x, rtol=1e-8)


@pytest.mark.parametrize("nested", FLOW)
def test_composed_and_flat_outputs_are_one(nested: str) -> None:
    points = fp.Experiments([[0.2], [0.8], [1.25], [1.75]], [[0.125]] * 4, [0.5] * 4)
    composed, flat = (fp.sensitivities(model("0*k", output), points, [0.7]) for output in (nested, FLOW[nested]))
    assert not composed.status.any()
    np.testing.assert_allclose(composed.y, flat.y, rtol=1e-12)
    np.testing.assert_allclose(composed.dy_dtheta, flat.dy_dtheta, rtol=1e-12)
