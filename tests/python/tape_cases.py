"""What the tests of programs share: the paper's cylinder as SymPy expressions, and small graphs of two states."""

from __future__ import annotations

from typing import Any

import numpy as np
import sympy as sp

import fisherpoint as fp
from fisherpoint.models.tape.branch import Select
from fisherpoint.models.tape.graph import Graph, Leaves
from fisherpoint.models.tape.program import Program
from fisherpoint.models.tape.programs import Surfaces
from oracle import Floats


def cylinder() -> dict[str, Any]:
    """Arguments of `build_programs` for eq. (19), with known constants as symbols."""
    q, v, p_A, p_B, x_v = states = sp.symbols("q v p_A p_B x_v", real=True)
    (u,) = inputs = sp.symbols("u,", real=True)
    parameters = sp.symbols([quantity.name for quantity in fp.HydraulicCylinder.parameters], real=True)
    a_tau, b_tau, m_q, E_oil, p_t, B_v, c_L, V_0A, V_0B = parameters
    constants = {sp.Symbol(name, real=True): value for name, value in fp.HydraulicCylinder().constants.items()}
    A_A, A_B, q_min, q_max, p_s, T_1, k_u = constants
    motion, spool = sides = sp.symbols("motion spool", real=True)

    opening, closing = x_v * Select(spool, 1, 0), -x_v * Select(-spool, 1, 0)
    s_A, t_A, s_B, t_B = sp.sqrt(p_s - p_A), sp.sqrt(p_A - p_t), sp.sqrt(p_s - p_B), sp.sqrt(p_B - p_t)
    Q_A, Q_B = B_v * (opening * s_A - closing * t_A), B_v * (closing * s_B - opening * t_B)
    Q_LA, Q_LB = c_L * (s_A - t_A), c_L * (s_B - t_B)
    V_A, V_B = A_A * (q - q_min) + V_0A, A_B * (q_max - q) + V_0B
    rates = [
        v,
        (A_A * p_A - A_B * p_B - (a_tau * motion + b_tau * v)) / m_q,
        E_oil / V_A * (Q_A + Q_LA - v * A_A),
        E_oil / V_B * (Q_B + Q_LB + v * A_B),
        (k_u * u - x_v) / T_1,
    ]
    surfaces = [v, x_v, p_A - p_t, p_s - p_A, p_B - p_t, p_s - p_B, V_A, V_B]
    return {
        "rates": rates,
        "output": [q, p_A, p_B, x_v],
        "surfaces": Surfaces(surfaces, sides),
        "states": states,
        "inputs": inputs,
        "parameters": parameters,
        "constants": constants,
    }


def small_graph() -> tuple[Graph, int, int]:
    """A graph of two states, and these."""
    graph = Graph(Leaves(parameters=2, inputs=1, states=2, sides=1))
    return graph, *graph.leaves.x


def at(program: Program, x: Any, theta: Any = (0.0, 0.0), u: Any = (0.0,), side: Any = (1.0,), dx: Any = (0.0, 0.0)) -> Floats:
    """Results of a small graph's program, one row for each row of x."""
    return program.evaluate(theta, u, x, side, dx)


def written(rows: np.ndarray) -> set[int]:
    """Registers that rows of operations write."""
    return set(rows[:, 1].tolist())
