"""Models whose states are set anew, and the same for `hybrid.py`, with points and parameters at random."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import fisherpoint as fp
from hybrid import Array, Event, Hybrid


@dataclass(frozen=True)
class ResetCase:
    model: fp.SymbolicModel
    reference: Hybrid
    lower: Array  # of x0, u, dt, theta
    upper: Array

    def drawn(self, count: int, seed: int) -> tuple[fp.Experiments, Array]:
        rng = np.random.default_rng(seed)
        n_x, n_u = len(self.model.states), len(self.model.inputs)
        rows = rng.uniform(self.lower, self.upper, (count, len(self.lower)))
        x0, u, dt, theta = np.split(rows, [n_x, n_x + n_u, n_x + n_u + 1], axis=1)
        return fp.Experiments(x0, u, dt[:, 0]), theta


def relay() -> ResetCase:
    """A heated room with a relay of two thresholds; loss by a square, so that nothing is in closed form."""
    model = fp.SymbolicModel(
        ["-k*(T - T_a) - c*(T - T_a)**2 + where(latch(T < low, T > high), P, 0)"],
        ["T"],
        {"T": ("K", 10.0)},
        {"T_a": "K"},
        {"k": "1/s", "c": "1/(K s)", "P": "K/s", "low": "K", "high": "K"},
        {"T": "K"},
    )

    def rates(x: Array, theta: Array, u: Array, on: int) -> tuple[Array, Array, Array]:
        k, c, power, *_ = theta
        d = x[0] - u[0]
        return (
            np.array([-k * d - c * d**2 + on * power]),
            np.array([[-k - 2 * c * d]]),
            np.array([[-d, -(d**2), float(on), 0.0, 0.0]]),
        )

    def same(x: Array, _: Array) -> tuple[Array, Array, Array]:
        return x, np.eye(1), np.zeros((1, 5))

    low = Event((0,), lambda x, p: x[0] - p[3], lambda *_: (np.array([1.0]), np.array([0, 0, 0, -1.0, 0])), same, 1)
    high = Event((1,), lambda x, p: p[4] - x[0], lambda *_: (np.array([-1.0]), np.array([0, 0, 0, 0, 1.0])), same, 0)
    reference = Hybrid(rates, (low, high), lambda x, p: int(x[0] < p[3]))
    return ResetCase(
        model, reference, *np.array([(15, 26), (0, 10), (5, 100), (0.04, 0.06), (1e-4, 5e-4), (1.5, 2), (19, 20.5), (21, 23)]).T
    )


def bouncing_mass() -> ResetCase:
    """A mass that falls through air onto a floor at an estimated height, with an estimated coefficient of restitution."""
    model = fp.SymbolicModel(
        ["v", "-g - d*v*abs(v)"],
        ["x"],
        {"x": "m", "v": "m/s"},
        {},
        {"g": "m/s2", "d": "1/m", "e": "1", "floor": "m"},
        {"x": "m"},
        resets={"x < floor": {"v": "-e*v"}},
    )

    def rates(x: Array, theta: Array, *_: object) -> tuple[Array, Array, Array]:
        g, d, *_others = theta
        v = x[1]
        f_theta = np.zeros((2, 4))
        f_theta[1, :2] = -1.0, -v * abs(v)
        return np.array([v, -g - d * v * abs(v)]), np.array([[0.0, 1.0], [0.0, -2 * d * abs(v)]]), f_theta

    def bounce(x: Array, theta: Array) -> tuple[Array, Array, Array]:
        r_theta = np.zeros((2, 4))
        r_theta[1, 2] = -x[1]
        return np.array([x[0], -theta[2] * x[1]]), np.diag([1.0, -theta[2]]), r_theta

    floor = Event((0,), lambda x, p: x[0] - p[3], lambda *_: (np.array([1.0, 0.0]), np.array([0, 0, 0, -1.0])), bounce, 0)
    reference = Hybrid(rates, (floor,), lambda *_: 0)
    return ResetCase(model, reference, *np.array([(0.2, 2), (-3, 3), (0.1, 2.5), (8, 11), (0, 0.1), (0.6, 0.95), (-0.1, 0.1)]).T)


def stroke() -> ResetCase:
    """A piston under a force with a stop at either end of its stroke."""
    model = fp.SymbolicModel(
        ["v", "(F - b*v)/m"],
        ["x", "v"],
        {"x": ("m", 0.1), "v": "m/s"},
        {"F": "N"},
        {"b": "N s/m", "m": "kg", "e": "1", "L": "m"},
        {"x": "m", "v": "m/s"},
        resets={"x < 0": {"v": "-e*v"}, "x > L": {"v": "-e*v"}},
    )

    def rates(x: Array, theta: Array, u: Array, _: int) -> tuple[Array, Array, Array]:
        b, m, *_others = theta
        a = (u[0] - b * x[1]) / m
        return (
            np.array([x[1], a]),
            np.array([[0.0, 1.0], [0.0, -b / m]]),
            np.array([[0.0] * 4, [-x[1] / m, -a / m, 0.0, 0.0]]),
        )

    def bounce(x: Array, theta: Array) -> tuple[Array, Array, Array]:
        r_theta = np.zeros((2, 4))
        r_theta[1, 2] = -x[1]
        return np.array([x[0], -theta[2] * x[1]]), np.diag([1.0, -theta[2]]), r_theta

    near = Event((0,), lambda x, _: x[0], lambda *_: (np.array([1.0, 0.0]), np.zeros(4)), bounce, 0)
    far = Event((0,), lambda x, p: p[3] - x[0], lambda *_: (np.array([-1.0, 0.0]), np.array([0, 0, 0, 1.0])), bounce, 0)
    reference = Hybrid(rates, (near, far), lambda *_: 0)
    return ResetCase(
        model, reference, *np.array([(0.02, 0.25), (-2, 2), (-3, 3), (0.05, 0.6), (0.2, 2), (0.5, 2), (0.3, 0.9), (0.27, 0.4)]).T
    )


CASES = {"relay": relay, "bouncing mass": bouncing_mass, "stroke": stroke}
