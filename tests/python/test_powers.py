"""Powers of what is zero on one side of an edge: they have a value and derivatives on both sides, above 1 on the edge too."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import gamma, gammainc

import fisherpoint as fp
from fisherpoint import Status

THETA = {"c": 0.5, "p": 1.2}


def model(rate: str, output: str = "h") -> fp.SymbolicModel:
    return fp.SymbolicModel([rate], [output], {"h": "1"}, {"u": "1"}, {"c": "1", "p": "1"}, {"y": "1"})


def sensitivities(made: fp.SymbolicModel, h0: float, u: float, dt: float = 1.0) -> Any:
    return fp.sensitivities(made, fp.Experiments([[h0]], [[u]], [dt]), THETA, rtol=1e-10)


def by_scipy(rate: str, h0: float, u: float, **theta: float) -> float:
    names: dict[str, Any] = {"sqrt": np.sqrt, "max": max, "min": min, "abs": abs, "u": u, **theta}
    code = compile(rate, "rate", "eval")
    rates = solve_ivp(lambda _, h: [eval(code, names, {"h": h[0]})], (0, 1), [h0], rtol=1e-12, atol=1e-14, max_step=2e-3)
    return float(rates.y[0, -1])


@pytest.mark.parametrize(("h0", "u"), [(0.3, -0.3), (0.3, 0.4), (0.9, -0.6), (0.9, 0.4)], ids=["below", "up", "down", "above"])
@pytest.mark.parametrize(
    "rate",
    [
        "u - p*max(h - c, 0)**1.5",
        "u - p*sqrt(max(0, h - c))**3",
        "u - max(h - c, 0)**2.3*p",
        "u + p*max(c - h, 0)**1.5",
        "u + p*(2*p/c*max(c - h, 0))**1.5",
        "u - p*abs(h - c)**1.5",
        "u - p*abs(c - h)**1.25",
        "u - p*(max(h - c, 0)*max(c + h, 0))**1.5",
        "u - p*max(min(h - c, 0.1), 0)**1.5",
        "u - p*sqrt(max(u, 0))*max(h - c, 0)**1.5",
    ],
)
def test_powers_above_one_cross_their_edge(rate: str, h0: float, u: float) -> None:
    made = model(rate)
    result = sensitivities(made, h0, u)
    assert result.status[0] == Status.ok and not made.jumps and not [name for name in made.domain if name != "c + h"]
    assert result.y[0, 0] == pytest.approx(by_scipy(rate, h0, u, **THETA), abs=1e-8)
    for k, name in enumerate(THETA):
        high, low = (by_scipy(rate, h0, u, **THETA | {name: THETA[name] + step}) for step in (1e-4, -1e-4))
        assert result.dy_dtheta[0, 0, k] == pytest.approx((high - low) / 2e-4, abs=3e-5)


def test_it_is_the_closed_form() -> None:
    """Of z' = -p z**1.5 with z = h - c, and of z' = -p z**0.5."""
    z, p = 0.4, THETA["p"]
    result = sensitivities(model("-p*max(h - c, 0)**1.5"), 0.9, 0.0)
    root = z**-0.5 + p / 2
    assert result.y[0, 0] == pytest.approx(0.5 + root**-2, rel=1e-9)
    assert result.dy_dtheta[0, 0] == pytest.approx([1 - root**-3 * z**-1.5, -(root**-3)], rel=1e-8)
    result = sensitivities(model("-p*sqrt(max(h - c, 0))"), 0.9, 0.0, 0.5)
    root = z**0.5 - p / 4
    assert result.y[0, 0] == pytest.approx(0.5 + root**2, rel=1e-9)
    assert result.dy_dtheta[0, 0] == pytest.approx([1 - root * z**-0.5, -root / 2], rel=1e-8)


@pytest.mark.parametrize(
    "flow", ["sqrt(max(h - c, 0))", "max(h - c, 0)**0.4", "sqrt(2*p*max(h - c, 0)/c)", "sqrt(max(min(h - c, c), 0))"]
)
def test_roots_are_crossed_with_their_derivatives(flow: str) -> None:
    made = model(f"u - p*{flow}")
    below = sensitivities(made, 0.3, 0.1)
    assert below.status[0] == Status.ok and below.y[0, 0] == pytest.approx(0.4, rel=1e-12) and not below.dy_dtheta.any()
    for h0, u in ((0.3, 0.4), (0.9, -3.0), (0.9, 0.7)):  # up, down and above
        result = sensitivities(made, h0, u)
        assert result.status[0] == Status.ok
        assert result.y[0, 0] == pytest.approx(by_scipy(f"u - p*{flow}", h0, u, **THETA), abs=1e-8)
        for k, name in enumerate(THETA):
            high, low = (by_scipy(f"u - p*{flow}", h0, u, **THETA | {name: THETA[name] + step}) for step in (1e-4, -1e-4))
            assert result.dy_dtheta[0, 0, k] == pytest.approx((high - low) / 2e-4, abs=3e-6)


@pytest.mark.parametrize("output", ["sqrt(max(h - c, 0))", "max(h - c, 0)**1.5", "sqrt(p*max(0, h - c, h - 1))"])
def test_outputs_are_zero_below_the_edge_and_powers_above(output: str) -> None:
    made = model("u", f"{output} + h")
    assert not made.domain or made.domain == ("p",)
    below, above = (sensitivities(made, 0.3, u) for u in (0.1, 0.5))
    assert below.status[0] == above.status[0] == Status.ok
    assert below.y[0, 0] == pytest.approx(0.4) and not below.dy_dtheta.any()
    names: dict[str, Any] = {"sqrt": np.sqrt, "max": max, "h": 0.8}
    assert above.y[0, 0] == pytest.approx(0.8 + eval(output, names | THETA))
    high, low = (eval(output, names | THETA | {"c": THETA["c"] + step}) for step in (1e-6, -1e-6))
    assert above.dy_dtheta[0, 0, 0] == pytest.approx((high - low) / 2e-6, rel=1e-6)


@pytest.mark.parametrize(
    "flow", ["sqrt(max(u - p, 0))", "where(u > p, sqrt(u - p), 0)", "max(u - p, 0)**1.5", "where(u > p, log(u/p), 0)"]
)
@pytest.mark.parametrize("by", ["h", "max(h - c, 0)**1.5", "where(h > 5, 0, h)"])
def test_a_branch_that_an_input_closes_brings_nothing_into_derivatives(flow: str, by: str) -> None:
    """A root of a negative number, times the zero of the branch that is not taken, is no number."""
    for u, is_open in ((0.3, False), (1.7, True)):
        result = sensitivities(model(f"0.1*u + {flow}*{by}"), 0.9, u, 0.5)
        assert result.status[0] == Status.ok
        if is_open:
            assert result.y[0, 0] > 0.9 + 0.06 and result.dy_dtheta[0, 0, 1] < 0
        else:
            assert result.y[0, 0] == pytest.approx(0.915) and not result.dy_dtheta.any()


@pytest.mark.parametrize("method", ["RK45", "DOP853"])
def test_steps_behind_an_edge_of_power_one_and_a_half_are_judged_by_their_own_error(method: str) -> None:
    """x2' = x2 + t**1.5 from the edge on: a smooth part that DOP853's coarse estimate sees made it trust its fine one too much."""
    model = fp.SymbolicModel(["1", "x2 + max(x1, 0)**1.5"], ["x2"], {"x1": "1", "x2": "1"}, {"u": "1"}, {"p": "1"})
    starts = np.linspace(-0.6, -0.1, 40)
    points = fp.Experiments(np.column_stack([starts, np.zeros(40)]), np.zeros((40, 1)), np.ones(40))
    behind = 1.0 + starts
    exact = np.exp(behind) * gamma(2.5) * gammainc(2.5, behind)
    for rtol in (1e-6, 1e-8, 1e-9):
        done = fp.simulate(model, points, [1.0], rtol=rtol, method=method)
        assert np.abs(done.x[:, 1] - exact).max() < 30 * rtol
