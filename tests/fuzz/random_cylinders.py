"""The built-in cylinder with random constants, as a case of the campaign: its equations written down once more, as text."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from hypothesis import strategies as st

import fisherpoint as fp
from random_models import Case
from reading import Floats

STATES = ("q", "v", "p_A", "p_B", "x_v")
PARAMETERS = ("a_tau", "b_tau", "m_q", "E_oil", "p_t", "B_v", "c_L", "V_0A", "V_0B")
RATES = (
    "v",
    "(A_A*p_A - A_B*p_B - (a_tau*sign(v) + b_tau*v))/m_q",
    "E_oil/(A_A*(q - q_min) + V_0A)*(-v*A_A + B_v*x_v*where(x_v > 0, sqrt(p_s - p_A), sqrt(p_A - p_t))"
    " + c_L*(sqrt(p_s - p_A) - sqrt(p_A - p_t)))",
    "E_oil/(A_B*(q_max - q) + V_0B)*(v*A_B - B_v*x_v*where(x_v > 0, sqrt(p_B - p_t), sqrt(p_s - p_B))"
    " + c_L*(sqrt(p_s - p_B) - sqrt(p_B - p_t)))",
    "(k_u*u - x_v)/T_1",
)
MEAN = (400.0, 1500.0, 150.0, 1.2e9, 0.5e6, 1.782e-7, 2.5e-9, 5e-5, 4e-5)
DEFAULTS = {"A_A": 1.9635e-3, "A_B": 9.4562e-4, "q_min": 0.0, "q_max": 0.3, "p_s": 21e6, "T_1": 2.2e-3, "k_u": -1.0}


@dataclass(frozen=True)
class CylinderCase(Case):
    """As a case, with the names of eq. (19)."""

    @property
    def states(self) -> tuple[str, ...]:
        return STATES

    @property
    def inputs(self) -> tuple[str, ...]:
        return ("u",)

    @property
    def parameters(self) -> tuple[str, ...]:
        return PARAMETERS

    def model(self) -> Any:
        return fp.HydraulicCylinder(**dict(self.constants))

    def code(self) -> str:
        given = ", ".join(f"{name}={value!r}" for name, value in self.constants if value != DEFAULTS[name])
        return f"import fisherpoint as fp\n\nmodel = fp.HydraulicCylinder({given})"

    def points(self, count: int) -> tuple[fp.Experiments, Floats]:
        rng, known = np.random.default_rng(self.seed), dict(self.constants)
        low = [known["q_min"], -0.3, 0.6e6, 0.6e6, -1.0, -1.0]
        high = [known["q_max"], 0.3, known["p_s"] - 1e4, known["p_s"] - 1e4, 1.0, 1.0]
        drawn = rng.uniform(low, high, (count, 6))
        dt = self.time * np.exp(rng.uniform(*np.log(self.duration), count))
        theta = self.mean * (1 + np.array(self.relative_std) * rng.uniform(-1, 1, (count, 9)))
        return fp.Experiments(drawn[:, :5], drawn[:, 5:], dt), theta


@st.composite
def cylinders(draw: Callable[[Any], Any]) -> CylinderCase:
    """Cylinders about the default one."""
    constants = {name: value * draw(st.sampled_from((1.0, 0.7, 1.4))) for name, value in DEFAULTS.items()}
    share = draw(st.sampled_from((0.1, 0.02, 0.3)))
    levels = {name: 2 if name in ("a_tau", "B_v", "m_q") else 1 for name in PARAMETERS}
    rules = (f"TensorGrid({levels})", "SparseGaussHermite(2)", "Unscented()", "LinearizedRule()", "Sobol(64)")
    return CylinderCase(
        rates=RATES,
        outputs=("q", "p_A", "p_B", "x_v"),
        state_sizes=(0.5, 1.0, 1e7, 1e7, 1.0),
        input_sizes=(1.0,),
        parameter_sizes=tuple(value * draw(st.sampled_from((1.0, 0.8, 1.3))) for value in MEAN),
        constants=tuple(constants.items()),
        time=1e-2,
        duration=draw(st.sampled_from(((0.1, 1.0), (1e-3, 0.1), (1.0, 10.0)))),
        relative_std=(share,) * 9,
        log=(False,) * 9,
        rule=draw(st.sampled_from(rules)),
        seed=draw(st.integers(0, 9999)),
        also=draw(st.sampled_from(("bits", "record", "levels", "runs"))),
    )
