"""A servo-hydraulic platform on six legs as a textbook writes it: 30 states, nothing reformulated, names where a book has them.

The pose is that of the plane of the platform's joints, R = Rz Ry Rx; velocities are in the body's frame. Newton and Euler about the
centre of gravity c, the inertia inverted as a matrix.
"""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np

import fisherpoint as fp


def textbook(hx: ModuleType, variant: int = 9, friction: str = "coulomb", names: bool = True) -> Any:
    """The model of the module `hx`, which has its numbers and names, with or without definitions."""
    shared, per_leg, body = hx.VARIANTS[variant]
    states: dict[str, Any] = dict(x="m", y="m", z="m", roll="rad", pitch="rad", yaw="rad", v_x="m/s", v_y="m/s", v_z="m/s")
    states |= dict(w_x="rad/s", w_y="rad/s", w_z="rad/s")
    for i in hx.LEGS:
        states |= {f"p_A{i}": ("Pa", 1e7), f"p_B{i}": ("Pa", 1e7), f"x_v{i}": "1"}
    outputs = {f"q{i}": "m" for i in hx.LEGS} | {
        f"{k}{i}": u for k, u in (("p_A", "Pa"), ("p_B", "Pa"), ("x_v", "1")) for i in hx.LEGS
    }
    parameters = {k: hx.LEG[k][1] for k in shared} | {f"{k}_{i}": hx.LEG[k][1] for i in hx.LEGS for k in per_leg}
    parameters |= {k: hx.BODY[k][1] for k in body}
    constants = dict(hx.CONSTANTS) | {k: v[:2] for k, v in hx.LEG.items() if k not in (*shared, *per_leg)}
    constants |= {k: v[:2] for k, v in hx.BODY.items() if k not in body}
    base, platform = map(np.array, hx.joints())
    m_ = fp.math
    let = fp.let if names else lambda _, value: value

    def rotation(roll: Any, pitch: Any, yaw: Any) -> Any:
        (sr, cr), (sp, cp), (sy, cy) = ((m_.sin(angle), m_.cos(angle)) for angle in (roll, pitch, yaw))
        z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
        y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
        x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
        return z @ y @ x

    def cross(a: Any, b: Any) -> Any:
        return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])

    def inverse(of: Any) -> Any:
        a, b, c = of
        return np.array([cross(b, c), cross(c, a), cross(a, b)]).T / (a @ cross(b, c))

    def equations(s: Any, u: Any, p: Any) -> Any:
        def leg(name: str, i: int) -> Any:
            return getattr(p, f"{name}_{i}" if name in per_leg else name)

        turn = rotation(s.roll, s.pitch, s.yaw)
        r, v, w = np.array([s.x, s.y, s.z]), np.array([s.v_x, s.v_y, s.v_z]), np.array([s.w_x, s.w_y, s.w_z])
        c = np.array([p.c_x, p.c_y, p.c_z])
        inertia = np.array([[p.J_xx, p.J_xy, p.J_xz], [p.J_xy, p.J_yy, p.J_yz], [p.J_xz, p.J_yz, p.J_zz]])
        force: Any = np.zeros(3)
        moment: Any = np.zeros(3)
        legs, lengths = [], []
        for i in hx.LEGS:
            a = platform[i - 1]
            arm = turn.T @ (r - base[i - 1]) + a
            length = let(f"length_{i}", m_.sqrt(arm @ arm))
            n = arm / length
            rate = let(f"rate_{i}", n @ (v + cross(w, a)))
            q = length - hx.L_0
            p_A, p_B, x_v = (getattr(s, f"{k}{i}") for k in ("p_A", "p_B", "x_v"))
            slip = m_.sign(rate) if friction == "coulomb" else m_.tanh(rate / p.v_s)
            pull = let(f"pull_{i}", p.A_A * p_A - p.A_B * p_B - leg("a_tau", i) * slip - leg("b_tau", i) * rate)
            force = force + pull * n
            moment = moment + cross(a - c, pull * n)
            p_t, c_L, B_v, E = leg("p_t", i), leg("c_L", i), leg("B_v", i), leg("E_oil", i)
            flow_A = B_v * x_v * m_.sqrt(m_.where(x_v > 0, p.p_s - p_A, p_A - p_t))
            flow_B = -B_v * x_v * m_.sqrt(m_.where(x_v > 0, p_B - p_t, p.p_s - p_B))
            leaks = [c_L * (m_.sqrt(p.p_s - at) - m_.sqrt(at - p_t)) for at in (p_A, p_B)]
            legs += [
                E / (p.A_A * q + leg("V_0A", i)) * (-p.A_A * rate + flow_A + leaks[0]),
                E / (p.A_B * (hx.STROKE - q) + leg("V_0B", i)) * (p.A_B * rate + flow_B + leaks[1]),
                (p.k_u * getattr(u, f"u{i}") - x_v) / leg("T_1", i),
            ]
            lengths.append(q)
        moment = [let(f"moment_{k}", of) for k, of in zip("xyz", moment - cross(w, inertia @ w), strict=True)]
        dw = [let(f"dw_{k}", of) for k, of in zip("xyz", inverse(inertia) @ moment, strict=True)]
        weight = turn.T @ np.array([0, 0, -p.g])
        dv = force / p.m + weight - cross(w, v) - cross(dw, c) - cross(w, cross(w, c))
        spin = (m_.sin(s.roll) * w[1] + m_.cos(s.roll) * w[2]) / m_.cos(s.pitch)
        angles = [w[0] + m_.sin(s.pitch) * spin, m_.cos(s.roll) * w[1] - m_.sin(s.roll) * w[2], spin]
        measured = [getattr(s, f"{k}{i}") for k in ("p_A", "p_B", "x_v") for i in hx.LEGS]
        return [*(turn @ v), *angles, *dv, *dw, *legs], [*lengths, *measured]

    options: dict[str, Any] = dict(states=states, inputs={f"u{i}": "1" for i in hx.LEGS}, parameters=parameters, outputs=outputs)
    return fp.model(**options, constants=constants, name=f"hexapod_{variant}_{friction}")(equations)
