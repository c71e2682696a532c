"""Systems that are on several jumps at once, each as the package reads it and as `filippov_several` integrates it."""

from __future__ import annotations

import itertools
import math

import numpy as np

from filippov import System
from jump_cases import Array, JumpCase, _between, _draws, _model


def axes() -> JumpCase:
    """Two axes that have nothing to do with each other."""
    model = _model(["v", "w", "a*u - c*sign(v)", "-k*y - d*sign(w)"], ["x", "y", "v", "w"], ["u"], ["a", "c", "k", "d"])
    system = System(
        lambda x, u, p, s: [x[2], x[3], p[0] * u[0] - p[1] * s[0], -p[2] * x[1] - p[3] * s[1]],
        lambda x, u, p: [x[2], x[3]],
        np.ones(4),
        2,
    )
    x0, p = _between([-1, -1, -1, -1], [1, 1, 1, 1]), _between([0.5, 0.5, 1, 0.3], [2, 1.5, 4, 1])
    return JumpCase(model, system, _draws(x0, _between([-1], [1]), p, (0.5, 4.0), {2: 0.0, 3: 0.0}))


def arm() -> JumpCase:
    """Two joints in the plane, with dry friction in both; driven by torques."""
    # M = [[a + 2 b cos q, d + b cos q], [d + b cos q, d]]
    first, second = "(u - c*sign(v) + b*sin(q)*w*(2*v + w))", "(r - e*sign(w) - b*sin(q)*v**2)"
    det = "((a + 2*b*cos(q))*d - (d + b*cos(q))**2)"
    model = _model(
        [
            "v",
            "w",
            f"(d*{first} - (d + b*cos(q))*{second})/{det}",
            f"((a + 2*b*cos(q))*{second} - (d + b*cos(q))*{first})/{det}",
        ],
        ["g", "q", "v", "w"],
        ["u", "r"],
        ["a", "b", "d", "c", "e"],
    )

    def f(x: Array, u: Array, p: Array, s: Array) -> list[float]:
        a, b, d, c, e = p
        _, q, v, w = x
        m11, m12 = a + 2 * b * math.cos(q), d + b * math.cos(q)
        t1, t2 = u[0] - c * s[0] + b * math.sin(q) * w * (2 * v + w), u[1] - e * s[1] - b * math.sin(q) * v**2
        det = m11 * d - m12**2
        return [v, w, (d * t1 - m12 * t2) / det, (m11 * t2 - m12 * t1) / det]

    system = System(f, lambda x, u, p: [x[2], x[3]], np.ones(4), 2)
    x0, p = _between([-1, -2, -1, -1], [1, 2, 1, 1]), _between([2.5, 0.3, 0.6, 0.4, 0.1], [4, 0.5, 1, 1, 0.4])
    return JumpCase(model, system, _draws(x0, _between([-1.5, -0.6], [1.5, 0.6]), p, (0.3, 2.5), {2: 0.0, 3: 0.0}))


def platform() -> JumpCase:
    """A body on six legs with dry friction in each; it turns little, so that its angles are a vector."""
    base, body = [], []
    for i in range(6):
        k, side = i // 2, 1 if i % 2 == 0 else -1
        beta, alpha = math.radians(120 * k + 12 * side), math.radians(120 * k + 60 * side - 12 * side)
        base.append((math.cos(beta), math.sin(beta), -1.0))
        body.append((0.6 * math.cos(alpha), 0.6 * math.sin(alpha), 0.0))
    states = [f"{name}{i}" for name in ("r", "o", "v", "w") for i in range(3)]
    forces, moments = ["-k*r0", "-k*r1", "-k*r2"], ["-k*o0/4", "-k*o1/4", "-k*o2/4"]

    def crossed(a: list[str], b: list[str]) -> list[str]:
        return [f"(({a[i]})*({b[j]}) - ({a[j]})*({b[i]}))" for i, j in ((1, 2), (2, 0), (0, 1))]

    for i in range(6):
        point = [repr(c) for c in body[i]]
        turned = crossed(["o0", "o1", "o2"], point)
        leg = [f"(r{j} + {turned[j]} + {body[i][j] - base[i][j]!r})" for j in range(3)]
        moving = crossed(["w0", "w1", "w2"], point)
        rate = "(" + " + ".join(f"{leg[j]}*(v{j} + {moving[j]})" for j in range(3)) + ")"
        length = "sqrt(" + " + ".join(f"{one}**2" for one in leg) + ")"
        force = f"({'u' if i % 2 else 'q'}*{math.cos(2.0 * i):.3f} - c*sign({rate}) - d*{rate}/{length})/{length}"
        torque = crossed(point, leg)
        for j in range(3):
            forces[j] += f" + {force}*{leg[j]}"
            moments[j] += f" + {force}*{torque[j]}"
    rates = [*states[6:9], *states[9:12], *(f"({one})/m" for one in forces), *(f"({one})/(m/8)" for one in moments)]
    model = _model(rates, states, ["u", "q"], ["m", "c", "d", "k"])
    a, b = np.array(base), np.array(body)

    def legs(x: Array) -> tuple[Array, Array]:
        leg = x[:3] + np.cross(x[3:6], b) + b - a
        return leg, (leg * (x[6:9] + np.cross(x[9:12], b))).sum(axis=1)

    def f(x: Array, u: Array, p: Array, s: Array) -> Array:
        m, c, d, k = p
        leg, rate = legs(x)
        length = np.linalg.norm(leg, axis=1)
        drive = np.array([u[0] if i % 2 else u[1] for i in range(6)]) * np.array(
            [float(f"{math.cos(2.0 * i):.3f}") for i in range(6)]
        )
        force = ((drive - c * s - d * rate / length) / length)[:, None] * leg
        return np.concatenate(
            [x[6:], (force.sum(axis=0) - k * x[:3]) / m, (np.cross(b, force).sum(axis=0) - k * x[3:6] / 4) / (m / 8)]
        )

    system = System(f, lambda x, u, p: legs(x)[1], np.ones(12), 6)

    def draw(rng: np.random.Generator, count: int) -> tuple[Array, Array, Array, Array]:
        x0 = np.hstack([rng.uniform(-0.1, 0.1, (count, 6)), rng.uniform(-0.5, 0.5, (count, 6))])
        x0[::2, 6:] = 0.0
        p = rng.uniform([1, 0.2, 0.2, 1], [2, 0.8, 1, 4], (count, 4))
        return x0, rng.uniform(-2, 2, (count, 2)), p, rng.uniform(0.3, 2.0, count)

    return JumpCase(model, system, draw)


CASES = {of.__name__: of for of in (axes, arm, platform)}


def infusions(T1: float, s2: float, T2: float, R1: float, R2: float, k: float, t: float) -> float:
    """c at t of two infusions into one compartment."""

    def one(start: float, lasts: float, rate: float) -> float:
        on, past = max(min(t - start, lasts), 0.0), max(t - start - lasts, 0.0)
        return rate / k * (1 - math.exp(-k * on)) * math.exp(-k * past)

    return one(0.0, T1, R1) + one(s2, T2, R2)


def grid(values: list[float], repeat: int) -> list[tuple[float, ...]]:
    return list(itertools.product(values, repeat=repeat))
