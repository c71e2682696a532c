"""Eq. (19) as SymPy equations: the cylinder with constants that can be estimated and parameters that can be fixed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .base import Model
from .decorator import model
from .math import heaviside, sign, sqrt, tanh
from .symbolic import SymbolicModel


def symbolic_cylinder(cylinder: Model, width: Mapping[str, float]) -> SymbolicModel:
    """The built-in cylinder as a model of equations; readings of the print are those of `HydraulicCylinder`."""
    constants = {quantity.name: (cylinder.constants[quantity.name], quantity) for quantity in cylinder.constant_quantities}

    def direction(v: Any) -> Any:
        return tanh(v / width["v"]) if "v" in width else sign(v)

    def positive(x_v: Any) -> Any:
        return (1 + tanh(x_v / width["x_v"])) / 2 if "x_v" in width else heaviside(x_v)

    @model(
        states=cylinder.states,
        inputs=cylinder.inputs,
        parameters=cylinder.parameters,
        outputs=cylinder.outputs,
        constants=constants,
        name=cylinder.name,
        nominal=cylinder.nominal,
    )
    def equations(x: Any, u: Any, p: Any) -> Any:
        opening, closing = x.x_v * positive(x.x_v), -x.x_v * positive(-x.x_v)
        s_A, t_A = sqrt(p.p_s - x.p_A), sqrt(x.p_A - p.p_t)  # supply to A, A to tank
        s_B, t_B = sqrt(p.p_s - x.p_B), sqrt(x.p_B - p.p_t)

        tau_f = p.a_tau * direction(x.v) + p.b_tau * x.v  # (19c)
        Q_A = p.B_v * (opening * s_A - closing * t_A)  # (19d)
        Q_B = p.B_v * (closing * s_B - opening * t_B)  # (19e)
        Q_LA = p.c_L * (s_A - t_A)  # (19f)
        Q_LB = p.c_L * (s_B - t_B)  # (19g)
        V_A = p.A_A * (x.q - p.q_min) + p.V_0A  # (19h)
        V_B = p.A_B * (p.q_max - x.q) + p.V_0B  # (19i)

        f = [  # (19a)
            x.v,
            (p.A_A * x.p_A - p.A_B * x.p_B - tau_f) / p.m_q,
            p.E_oil / V_A * (Q_A + Q_LA - x.v * p.A_A),
            p.E_oil / V_B * (Q_B + Q_LB + x.v * p.A_B),
            (p.k_u * u.u - x.x_v) / p.T_1,
        ]
        limits = [x.p_A - p.p_t, p.p_s - x.p_A, x.p_B - p.p_t, p.p_s - x.p_B, V_A, V_B]
        sensible = [p.p_s - p.p_t, p.T_1, p.m_q, p.E_oil, p.B_v, p.V_0A, p.V_0B, p.A_A, p.A_B, p.q_max - p.q_min]
        return f, [x.q, x.p_A, x.p_B, x.x_v], [*limits, *sensible]  # (19b)

    return equations
