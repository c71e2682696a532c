"""A whole machine in one model: a platform on six servo-hydraulic legs, with 30 states, six valves and up to 64 parameters.

    python examples/hexapod.py

The platform stands at a given pose, under control. The program finds where pressures and spools are there, and how that depends on
the parameters, and designs one run of two seconds from there for 54 of them. docs/how_to/whole_machine.md goes on from here.

The equations are those of a textbook. The pose is that of the plane of the platform's joints, R = Rz Ry Rx; velocities are in the
body's frame; Newton and Euler hold about the centre of gravity c. Legs have no mass. Each is the cylinder of eq. (19).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

import fisherpoint as fp

LEGS = range(1, 7)
RADIUS_BASE, RADIUS_PLATFORM, HALF_ANGLE = 1.0, 0.6, math.radians(12.0)
L_0, STROKE = 1.0, 0.5  # a leg's length at q = 0, and by how much it can grow, m
CONSTANTS = {"A_A": (1.9635e-3, "m2"), "A_B": (9.4562e-4, "m2"), "p_s": (21e6, "Pa"), "g": (9.81, "m/s2"), "k_u": (-1.0, "1")}
CONSTANTS |= {"v_s": (5e-3, "m/s")}  # at which smooth friction is three quarters of dry friction
FLOW = "m3/(s sqrt(Pa))"
LEG: dict[str, tuple[float, str, float]] = {  # value, unit and relative standard deviation
    "a_tau": (400.0, "N", 0.30), "b_tau": (1500.0, "N s/m", 0.20), "E_oil": (1.2e9, "Pa", 0.20), "p_t": (0.5e6, "Pa", 0.20),
    "B_v": (1.782e-7, FLOW, 0.10), "c_L": (2.5e-9, FLOW, 0.30), "V_0A": (5e-5, "m3", 0.10), "V_0B": (4e-5, "m3", 0.10),
    "T_1": (2.2e-3, "s", 0.10),
}  # fmt: skip
BODY: dict[str, tuple[float, str, float]] = {
    "m": (500.0, "kg", 0.05), "c_x": (0.02, "m", 0.5), "c_y": (-0.01, "m", 1.0), "c_z": (0.15, "m", 0.2),
    "J_xx": (60.0, "kg m2", 0.2), "J_yy": (70.0, "kg m2", 0.2), "J_zz": (110.0, "kg m2", 0.2),
    "J_xy": (2.0, "kg m2", 1.0), "J_xz": (-1.5, "kg m2", 1.0), "J_yz": (1.0, "kg m2", 1.0),
}  # fmt: skip
VARIANTS: dict[int, tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]] = {
    9: (tuple(k for k in LEG if k != "T_1"), (), ("m",)),  # of all legs, of each leg, of the body
    19: (tuple(LEG), (), tuple(BODY)),
    54: ((), tuple(LEG), ()),
    64: ((), tuple(LEG), tuple(BODY)),
}
NOISE = {f"q{i}": 5e-6 for i in LEGS} | {f"p_{k}{i}": 2e4 for k in "AB" for i in LEGS} | {f"x_v{i}": 1e-3 for i in LEGS}
POSE, VELOCITY = ("x", "y", "z", "roll", "pitch", "yaw"), ("v_x", "v_y", "v_z", "w_x", "w_y", "w_z")


def parameters(variant: int) -> dict[str, tuple[float, str, float]]:
    """Value, unit and relative standard deviation of each parameter; no two legs are quite alike."""
    shared, per_leg, body = VARIANTS[variant]
    each = {f"{k}_{i}": (LEG[k][0] * (1 + 0.02 * (i - 3.5)), *LEG[k][1:]) for i in LEGS for k in per_leg}
    return {k: LEG[k] for k in shared} | each | {k: BODY[k] for k in body}


def prior(variant: int = 54) -> fp.GaussianPrior:
    """What is known of the parameters."""
    of = parameters(variant)
    return fp.GaussianPrior(
        {k: value for k, (value, _, _) in of.items()}, std={k: abs(v) * share for k, (v, _, share) in of.items()}
    )


def joints() -> tuple[Any, Any]:
    """Joints of the base and of the platform (6, 3), in pairs; those of the base at 0, 120 and 240 degrees, the others between."""
    pair, side = np.repeat([0, 1, 2], 2), np.tile([1, -1], 3)
    base = np.radians(120.0) * pair + side * HALF_ANGLE
    platform = np.radians(120.0) * pair + side * (np.radians(60.0) - HALF_ANGLE)

    def circle(radius: float, angle: Any) -> Any:
        return radius * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(6)])

    return circle(RADIUS_BASE, base), circle(RADIUS_PLATFORM, platform)


def cross(a: Any, b: Any) -> Any:
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def inverse(of: Any) -> Any:
    a, b, c = of
    return np.array([cross(b, c), cross(c, a), cross(a, b)]).T / (a @ cross(b, c))


def rotation(roll: Any, pitch: Any, yaw: Any) -> Any:
    (sr, cr), (sp, cp), (sy, cy) = ((fp.math.sin(angle), fp.math.cos(angle)) for angle in (roll, pitch, yaw))
    z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    return z @ y @ x


def hexapod(variant: int = 54, friction: str = "tanh", names: bool = True) -> Any:
    """The model with 9, 19, 54 or 64 parameters; friction is "tanh" or "coulomb", which is dry. With names of terms or without."""
    shared, per_leg, body = VARIANTS[variant]
    states: dict[str, Any] = dict.fromkeys(POSE[:3], ("m", 0.1)) | dict.fromkeys(POSE[3:], ("rad", 0.1))  # with natural sizes
    states |= dict.fromkeys(VELOCITY[:3], ("m/s", 0.1)) | dict.fromkeys(VELOCITY[3:], ("rad/s", 0.1))
    for i in LEGS:
        states |= {f"p_A{i}": ("Pa", 1e7), f"p_B{i}": ("Pa", 1e7), f"x_v{i}": ("1", 0.1)}
    outputs = {f"{k}{i}": unit for k, unit in (("q", "m"), ("p_A", "Pa"), ("p_B", "Pa"), ("x_v", "1")) for i in LEGS}
    constants = CONSTANTS | {k: v[:2] for k, v in LEG.items() if k not in (*shared, *per_leg)}
    constants |= {k: v[:2] for k, v in BODY.items() if k not in body}
    base, platform = joints()
    sqrt, where = fp.math.sqrt, fp.math.where
    let = fp.let if names else lambda _, value: value

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
        for i in LEGS:
            a = platform[i - 1]
            arm = turn.T @ (r - base[i - 1]) + a
            length = let(f"length_{i}", sqrt(arm @ arm))
            n = arm / length
            rate = let(f"rate_{i}", n @ (v + cross(w, a)))
            q = length - L_0
            p_A, p_B, x_v = (getattr(s, f"{k}{i}") for k in ("p_A", "p_B", "x_v"))
            slip = fp.math.sign(rate) if friction == "coulomb" else fp.math.tanh(rate / p.v_s)
            pull = let(f"pull_{i}", p.A_A * p_A - p.A_B * p_B - leg("a_tau", i) * slip - leg("b_tau", i) * rate)
            force = force + pull * n
            moment = moment + cross(a - c, pull * n)
            p_t, c_L, B_v, E = leg("p_t", i), leg("c_L", i), leg("B_v", i), leg("E_oil", i)
            flow_A = B_v * x_v * sqrt(where(x_v > 0, p.p_s - p_A, p_A - p_t))
            flow_B = -B_v * x_v * sqrt(where(x_v > 0, p_B - p_t, p.p_s - p_B))
            leaks = [c_L * (sqrt(p.p_s - at) - sqrt(at - p_t)) for at in (p_A, p_B)]
            legs += [
                E / (p.A_A * q + leg("V_0A", i)) * (-p.A_A * rate + flow_A + leaks[0]),
                E / (p.A_B * (STROKE - q) + leg("V_0B", i)) * (p.A_B * rate + flow_B + leaks[1]),
                (p.k_u * getattr(u, f"u{i}") - x_v) / leg("T_1", i),
            ]
            lengths.append(q)
        moment = [let(f"moment_{k}", of) for k, of in zip("xyz", moment - cross(w, inertia @ w), strict=True)]
        dw = [let(f"dw_{k}", of) for k, of in zip("xyz", inverse(inertia) @ moment, strict=True)]
        weight = turn.T @ np.array([0, 0, -p.g])
        dv = force / p.m + weight - cross(w, v) - cross(dw, c) - cross(w, cross(w, c))
        spin = (fp.math.sin(s.roll) * w[1] + fp.math.cos(s.roll) * w[2]) / fp.math.cos(s.pitch)
        angles = [w[0] + fp.math.sin(s.pitch) * spin, fp.math.cos(s.roll) * w[1] - fp.math.sin(s.roll) * w[2], spin]
        measured = [getattr(s, f"{k}{i}") for k in ("p_A", "p_B", "x_v") for i in LEGS]
        positive = [leg(name, i) for name in ("V_0A", "V_0B", "T_1") for i in LEGS]  # which fits keep to
        return [*(turn @ v), *angles, *dv, *dw, *legs], [*lengths, *measured], positive

    options: dict[str, Any] = {"states": states, "inputs": {f"u{i}": "1" for i in LEGS}, "outputs": outputs}
    options |= {"parameters": {k: unit for k, (_, unit, _) in parameters(variant).items()}, "constants": constants}
    return fp.model(**options, name=f"hexapod_{variant}_{friction}")(equations)


STAND = {"x": 0.0, "y": 0.0, "z": 1.083, "roll": 0.0, "pitch": 0.0, "yaw": 0.0}
VALVES = tuple(f"u{i}" for i in LEGS)


def standing(model: Any) -> fp.Rest:
    """The platform stands under control: its speeds are zero, the valves are where pressures and spools stay as they are."""
    return fp.Rest(states=[q.name for q in model.states if q.name not in POSE], hold=VELOCITY, solve=VALVES)


def problem(duration: float = 2.0, variant: int = 54, friction: str = "tanh", largest: float = 0.5) -> fp.DesignProblem:
    """Which run from standstill determines the parameters: a multisine for each valve, up to 8 Hz, and what is not to happen."""
    model = hexapod(variant, friction)
    start = STAND | dict.fromkeys(VELOCITY, 0.0)
    for i in LEGS:  # pressures and spools are found; these are guesses
        start |= {f"p_A{i}": 7e6, f"p_B{i}": 14e6, f"x_v{i}": 0.0}
    bounds = start | dict.fromkeys(VALVES, (-largest, largest)) | {"dt": 0.02}
    signals = fp.Multisine(3, bandwidth=(0.5, 8.0))
    region = fp.RunRegion(bounds, round(duration / 0.02), rest=standing(model), profile=signals)
    along = [f"{L_0 + 0.02} < length_{i} < {L_0 + STROKE - 0.02}" for i in LEGS]
    along += [f"0.6e6 < p_{k}{i} < 20.5e6" for k in "AB" for i in LEGS] + [f"abs(x_v{i}) < 0.95" for i in LEGS]
    return fp.DesignProblem(model, prior(variant), region, noise=NOISE, along=along)


def main() -> None:
    of = problem()
    assert of.run_region is not None
    still = fp.Runs([[*STAND.values(), *[0.0] * 6, *[7e6, 14e6, 0.0] * 6]], np.zeros((1, 1, 6)), 1e-3, rest=standing(of.model))
    start = fp.simulate(of.model, still, of.theta).x[0, 0]
    for k, i in enumerate(LEGS):
        p_A, p_B, x_v = start[12 + 3 * k : 15 + 3 * k]
        print(f"leg {i}: {1e-5 * p_A:.1f} and {1e-5 * p_B:.1f} bar, spool at {100 * x_v:.2f} %")
    design = fp.design_runs(of, n_starts=4, n_candidates=100, time_limit=300)
    print(design)
    design.save("hexapod_run")


if __name__ == "__main__":
    main()
