"""Models and inputs of the tests of records, and trajectories by SciPy, piece after piece."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

import fisherpoint as fp
from oracle import Floats

RNG = np.random.default_rng(5)
T = np.concatenate([[0.0], np.cumsum(RNG.uniform(0.2, 1.5, 59))])
U = np.where(np.arange(60) // 12 % 2, 0.3, 6.0) * RNG.uniform(0.5, 1.0, 60)


@fp.model(
    states={"h1": "m", "h2": "m"},
    inputs={"u": "V"},
    parameters={"k1": "1", "k2": "1", "k3": "1", "k4": "1", "k5": "1"},
    outputs={"level": "m"},
    constants={"rim": (1.0, "m")},
)
def tanks(x: Any, u: Any, p: Any) -> Any:
    """Two tanks in a column, the upper one flows over."""
    over = fp.math.max(x.h1 - p.rim, 0)
    return [-p.k1 * fp.math.sqrt(x.h1) + p.k4 * u.u - over, p.k2 * fp.math.sqrt(x.h1) - p.k3 * fp.math.sqrt(x.h2) + p.k5 * over], [
        fp.math.min(x.h2, 1)
    ]


@fp.model(
    states={"i": "A", "omega": "rad/s"},
    inputs={"u": "V"},
    parameters={"R": "V/A", "K": "V s/rad", "L": "V s/A", "J": "kg m2", "friction": "1"},
    outputs={"i": "A", "omega": "rad/s"},
    check_units=False,
)
def motor(x: Any, u: Any, p: Any) -> Any:
    """A direct current motor with smooth friction."""
    torque = p.K * x.i - 0.01 * p.friction * fp.math.tanh(x.omega)
    return [(u.u - p.R * x.i - p.K * x.omega) / p.L, torque / p.J], [x.i, x.omega]


@fp.model(states={"s": "1"}, inputs={"u": "1"}, parameters={"T": "s", "a": "1"}, outputs={"flow": "1"})
def valve(x: Any, u: Any, p: Any) -> Any:
    """A valve that closes faster than it opens: a kink where it rests."""
    return [(u.u - x.s - p.a * fp.math.max(x.s, 0)) / p.T], [x.s + p.a * x.s * u.u]


def piecewise(model: fp.Model, theta: Any, t: Floats, u: Floats, x0: Any) -> Floats:
    """States at the samples to about 1e-11, where x0 is in SI units."""
    x = [np.asarray(x0, dtype=float)]
    scale = np.array([q.scale or 1.0 for q in model.states])
    for n in range(len(t) - 1):

        def rates(_: float, z: Floats, n: int = n) -> Floats:
            return np.asarray(model.rhs(z * scale, u[n], theta) / scale)

        step = (t[n + 1] - t[n]) / 4  # so that a kink spoils a short step alone
        done = solve_ivp(rates, (t[n], t[n + 1]), x[-1] / scale, "DOP853", rtol=3e-13, atol=1e-13, max_step=step)
        x.append(done.y[:, -1] * scale)
    return np.array(x)
