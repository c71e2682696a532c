"""The servo-hydraulic cylinder, eq. (19), written in Python; its design is the built-in model's."""

from pathlib import Path

import numpy as np

import fisherpoint as fp


@fp.model(
    states={"q": ("m", 0.5), "v": ("m/s", 1.0), "p_A": ("Pa", 1e7), "p_B": ("Pa", 1e7), "x_v": ("1", 1.0)},
    inputs={"u": "1"},
    parameters={
        "a_tau": "N",
        "b_tau": "N s/m",
        "m_q": "kg",
        "E_oil": "Pa",
        "p_t": "Pa",
        "B_v": "m3/(s sqrt(Pa))",
        "c_L": "m3/(s sqrt(Pa))",
        "V_0A": "m3",
        "V_0B": "m3",
    },
    outputs={"q": "m", "p_A": "Pa", "p_B": "Pa", "x_v": "1"},
    constants={
        "A_A": (1.9635e-3, "m2"),
        "A_B": (9.4562e-4, "m2"),
        "q_min": (0.0, "m"),
        "q_max": (0.30, "m"),
        "p_s": (21e6, "Pa"),
        "T_1": (2.2e-3, "s"),
        "k_u": -1.0,
    },
)
def cylinder(x, u, p):
    opening, closing = fp.math.max(x.x_v, 0), fp.math.max(-x.x_v, 0)
    supply_A, A_tank = fp.math.sqrt(p.p_s - x.p_A), fp.math.sqrt(x.p_A - p.p_t)
    supply_B, B_tank = fp.math.sqrt(p.p_s - x.p_B), fp.math.sqrt(x.p_B - p.p_t)
    V_A = p.A_A * (x.q - p.q_min) + p.V_0A
    V_B = p.A_B * (p.q_max - x.q) + p.V_0B

    friction = p.a_tau * fp.math.sign(x.v) + p.b_tau * x.v
    Q_A = p.B_v * (opening * supply_A - closing * A_tank) + p.c_L * (supply_A - A_tank)
    Q_B = p.B_v * (closing * supply_B - opening * B_tank) + p.c_L * (supply_B - B_tank)
    rates = [
        x.v,
        (p.A_A * x.p_A - p.A_B * x.p_B - friction) / p.m_q,
        p.E_oil / V_A * (Q_A - p.A_A * x.v),
        p.E_oil / V_B * (Q_B + p.A_B * x.v),
        (p.k_u * u.u - x.x_v) / p.T_1,
    ]
    # The roots say where the pressures may be; that the chambers have a volume has to be said.
    return rates, [x.q, x.p_A, x.p_B, x.x_v], [V_A, V_B]


if __name__ == "__main__":
    print(cylinder)
    problem = fp.load_problem(Path(__file__).with_name("cylinder.toml"))
    settings = {"n_experiments": 12, "max_iterations": 50, "seed": 1, "method": fp.ExchangeMethod(references=False)}
    built_in, written = (fp.exchange(given, **settings) for given in (problem, problem.replace(model=cylinder)))
    print(f"log det {written.evaluation.log_det:.6f}, built in {built_in.evaluation.log_det:.6f}")
    print("same points:", np.array_equal(written.points.table, built_in.points.table))
