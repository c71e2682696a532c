"""Systems with jumps, each as the package reads it and as `filippov` integrates it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

import fisherpoint as fp
from filippov import System

Array = np.ndarray[Any, Any]


@dataclass(frozen=True)
class JumpCase:
    """A model, the same as a `System`, and random points: rows of x0, u, p, dt."""

    model: fp.Model
    system: System
    draw: Callable[[np.random.Generator, int], tuple[Array, Array, Array, Array]]


def _model(f: Sequence[str], states: Sequence[str], inputs: Sequence[str], parameters: Sequence[str]) -> fp.SymbolicModel:
    return fp.SymbolicModel(
        list(f), [states[0]], dict.fromkeys(states, "1"), dict.fromkeys(inputs, "1"), dict.fromkeys(parameters, "1")
    )


def _between(low: Sequence[float], high: Sequence[float]) -> Callable[[np.random.Generator, int], Array]:
    return lambda rng, count: rng.uniform(low, high, (count, len(low)))


def _draws(
    x0: Callable[..., Array], u: Callable[..., Array], p: Callable[..., Array], dt: tuple[float, float], rest: dict[int, float]
) -> Callable[[np.random.Generator, int], tuple[Array, Array, Array, Array]]:
    """Half of the starts have these states at these values: at rest."""

    def draw(rng: np.random.Generator, count: int) -> tuple[Array, Array, Array, Array]:
        start = x0(rng, count)
        for i, value in rest.items():
            start[::2, i] = value
        return start, u(rng, count), p(rng, count), rng.uniform(*dt, count)

    return draw


def pendulum() -> JumpCase:
    model = _model(["v", "-g*sin(a) - c*sign(v) - b*v + u"], ["a", "v"], ["u"], ["g", "c", "b"])
    system = System(
        lambda x, u, p, s: [x[1], -p[0] * np.sin(x[0]) - p[1] * s[0] - p[2] * x[1] + u[0]],
        lambda x, u, p: [x[1]],
        np.ones(2),
        1,
    )
    draw = _draws(_between([-2, -2], [2, 2]), _between([-1], [1]), _between([4, 0.3, 0.05], [9, 2, 0.3]), (0.3, 4.0), {1: 0.0})
    return JumpCase(model, system, draw)


def relay() -> JumpCase:
    """A relay that acts on an output which is delayed by two lags: it oscillates."""
    model = _model(["y", "z", "-z*a - y*b - x*c - k*sign(x)"], ["x", "y", "z"], [], ["a", "b", "c", "k"])
    system = System(
        lambda x, u, p, s: [x[1], x[2], -x[2] * p[0] - x[1] * p[1] - x[0] * p[2] - p[3] * s[0]],
        lambda x, u, p: [x[0]],
        np.ones(3),
        1,
    )
    p = _between([1.5, 1.0, 0.2, 0.5], [3, 2, 1.0, 2])
    return JumpCase(model, system, _draws(_between([-1] * 3, [1] * 3), _between([], []), p, (0.5, 6.0), {}))


def belt() -> JumpCase:
    """A mass on a belt that runs at speed w: it sticks and slips."""
    model = _model(["v", "-k*x - c*sign(v - w)/(1 + abs(v - w)) - d*v"], ["x", "v"], ["w"], ["k", "c", "d"])

    def f(x: Array, u: Array, p: Array, s: Array) -> list[float]:
        slip = x[1] - u[0]
        return [x[1], -p[0] * x[0] - p[1] * s[0] / (1 + slip * s[0]) - p[2] * x[1]]

    system = System(f, lambda x, u, p: [x[1] - u[0]], np.ones(2), 1)
    p = _between([1, 1, 0.02], [4, 3, 0.2])
    return JumpCase(model, system, _draws(_between([-2, -1], [2, 1]), _between([0.2], [1]), p, (0.5, 6.0), {}))


def thermostat() -> JumpCase:
    """A heater that is on below a threshold, seen through a sensor's lag: the threshold is a parameter."""
    model = _model(["-k*(x - u) + q*heaviside(r - y)", "(x - y)/l"], ["x", "y"], ["u"], ["k", "q", "r", "l"])
    system = System(
        lambda x, u, p, s: [-p[0] * (x[0] - u[0]) + p[1] * (1 + s[0]) / 2, (x[0] - x[1]) / p[3]],
        lambda x, u, p: [p[2] - x[1]],
        np.ones(2),
        1,
    )
    p = _between([0.5, 2, 0.8, 0.1], [1, 4, 1.2, 0.3])
    return JumpCase(model, system, _draws(_between([0, 0], [2, 2]), _between([0], [0.5]), p, (0.5, 5.0), {}))


def sharp_thermostat() -> JumpCase:
    """Without the lag it slides along the threshold, which a parameter moves."""
    model = _model(["-k*(x - u) + q*heaviside(r - x*(1 + w/4))", "e*(x - w)"], ["x", "w"], ["u"], ["k", "q", "r", "e"])
    system = System(
        lambda x, u, p, s: [-p[0] * (x[0] - u[0]) + p[1] * (1 + s[0]) / 2, p[3] * (x[0] - x[1])],
        lambda x, u, p: [p[2] - x[0] * (1 + x[1] / 4)],
        np.ones(2),
        1,
    )
    p = _between([0.5, 2, 0.8, 0.3], [1, 4, 1.2, 2])
    return JumpCase(model, system, _draws(_between([0, 0], [2, 2]), _between([0], [0.5]), p, (0.5, 4.0), {}))


def tanks() -> JumpCase:
    """Two tanks; above its rim the first one spills over into the second, and a float valve shuts off at a level."""
    model = _model(
        ["u*heaviside(z - b) - k*sqrt(a) - m*max(a - r, 0)", "k*sqrt(a) + m*max(a - r, 0) - c*sqrt(b)"],
        ["a", "b"],
        ["u"],
        ["k", "m", "r", "z", "c"],
    )

    def f(x: Array, u: Array, p: Array, s: Array) -> list[float]:
        spill, out = p[1] * (x[0] - p[2]) * (1 + s[1]) / 2, p[0] * np.sqrt(x[0])
        return [u[0] * (1 + s[0]) / 2 - out - spill, out + spill - p[4] * np.sqrt(x[1])]

    system = System(f, lambda x, u, p: [p[3] - x[1], x[0] - p[2]], np.ones(2), 1)
    p = _between([0.5, 1, 0.8, 0.6, 0.4], [0.8, 3, 1.2, 1.2, 0.6])
    return JumpCase(model, system, _draws(_between([0.3, 0.3], [1.5, 1.5]), _between([0.5], [2]), p, (0.5, 4.0), {}))


def motor() -> JumpCase:
    """A direct-current motor with Coulomb friction."""
    model = _model(["(u - R*i - K*w)/L", "(K*i - T*sign(w) - B*w)/J"], ["i", "w"], ["u"], ["R", "L", "K", "T", "B", "J"])
    system = System(
        lambda x, u, p, s: [
            (u[0] - p[0] * x[0] - p[2] * x[1]) / p[1],
            (p[2] * x[0] - p[3] * s[0] - p[4] * x[1]) / p[5],
        ],
        lambda x, u, p: [x[1]],
        np.ones(2),
        1,
    )
    p = _between([0.8, 0.1, 0.5, 0.2, 0.02, 0.05], [1.2, 0.3, 1, 0.6, 0.1, 0.2])
    return JumpCase(model, system, _draws(_between([-1, -2], [1, 2]), _between([-2], [2]), p, (0.1, 2.0), {1: 0.0}))


def saturated() -> JumpCase:
    """A servo with a saturated controller and Coulomb friction: kinks and a jump."""
    model = _model(["v", "max(min(k*(r - x) - d*v, u), -u) - c*sign(v)"], ["x", "v"], ["r", "u"], ["k", "d", "c"])

    def f(x: Array, u: Array, p: Array, s: Array) -> list[float]:
        wished = p[0] * (u[0] - x[0]) - p[1] * x[1]
        force = u[1] if s[1] > 0 else -u[1] if s[2] > 0 else wished
        return [x[1], force - p[2] * s[0]]

    def h(x: Array, u: Array, p: Array) -> list[float]:
        wished = p[0] * (u[0] - x[0]) - p[1] * x[1]
        return [x[1], wished - u[1], -u[1] - wished]

    system = System(f, h, np.ones(2), 1)
    p = _between([2, 0.5, 0.1], [8, 2, 0.5])
    return JumpCase(model, system, _draws(_between([-2, -1], [2, 1]), _between([-1, 0.5], [1, 2]), p, (0.3, 3.0), {1: 0.0}))


def cylinder() -> JumpCase:
    model = fp.HydraulicCylinder()
    names = [q.name for q in model.parameters]
    constants = model.constants
    nominal = np.array([model.nominal[name] for name in names])

    def f(x: Array, u: Array, p: Array, s: Array) -> list[float]:
        q, v, p_A, p_B, x_v = x
        a_tau, b_tau, m_q, E_oil, p_t, B_v, c_L, V_0A, V_0B = p
        p_s, A_A, A_B = constants["p_s"], constants["A_A"], constants["A_B"]
        opening, closing = x_v * (1 + s[1]) / 2, -x_v * (1 - s[1]) / 2
        s_A, t_A, s_B, t_B = np.sqrt(p_s - p_A), np.sqrt(p_A - p_t), np.sqrt(p_s - p_B), np.sqrt(p_B - p_t)
        flow_A = B_v * (opening * s_A - closing * t_A) + c_L * (s_A - t_A)
        flow_B = B_v * (closing * s_B - opening * t_B) + c_L * (s_B - t_B)
        V_A, V_B = A_A * (q - constants["q_min"]) + V_0A, A_B * (constants["q_max"] - q) + V_0B
        force = A_A * p_A - A_B * p_B - a_tau * s[0] - b_tau * v
        return [
            v,
            force / m_q,
            E_oil / V_A * (flow_A - v * A_A),
            E_oil / V_B * (flow_B + v * A_B),
            (constants["k_u"] * u[0] - x_v) / constants["T_1"],
        ]

    system = System(f, lambda x, u, p: [x[1], x[4]], np.array([0.5, 1.0, 1e7, 1e7, 1.0]), 1)

    def draw(rng: np.random.Generator, count: int) -> tuple[Array, Array, Array, Array]:
        x0 = rng.uniform([0.05, -0.1, 3e6, 6e6, -0.6], [0.25, 0.1, 9e6, 1.4e7, 0.6], (count, 5))
        x0[::2, 1] = 0.0
        p = nominal * rng.uniform(0.9, 1.1, (count, len(nominal)))
        return x0, rng.uniform(-0.6, 0.6, (count, 1)), p, rng.uniform(2e-3, 1.2e-2, count)

    return JumpCase(model, system, draw)


CASES = {case.__name__: case for case in (cylinder, pendulum, relay, belt, thermostat, sharp_thermostat, tanks, motor, saturated)}
