"""Stiff models with published solutions, and the reference that their sensitivities are compared with.

`python bench/stiff_cases.py` computes the reference anew, in a minute: SciPy's Radau at rtol 1e-12 carries x and dx/dtheta, with
derivatives by SymPy, and writes them to stiff.json. Published values of x: F. Mazzia, C. Magherini, "Test set for initial value
problem solvers", release 2.4 (2008), for HIRES, the Oregonator and van der Pol's equation.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import sympy
from numpy.typing import NDArray

import fisherpoint as fp

REFERENCE = Path(__file__).parent / "stiff.json"


@dataclass(frozen=True)
class Stiff:
    """x' = f from x0 over `duration`, with the natural sizes of the states, and the published end where there is one."""

    f: dict[str, str]
    x0: list[float]
    sizes: list[float]
    theta: dict[str, float]
    duration: float
    published: list[float] | None = None

    def model(self) -> fp.Model:
        sizes = zip(self.f, self.sizes, strict=True)
        return fp.SymbolicModel(
            f=list(self.f.values()),
            g=list(self.f),
            states={name: ("1", size) for name, size in sizes},
            inputs={},
            parameters=dict.fromkeys(self.theta, "1"),
        )

    def points(self, count: int = 1) -> fp.Experiments:
        return fp.Experiments([self.x0] * count, [[]] * count, [self.duration] * count)


_CELLS = 20


def _diffusion(cell: int) -> str:
    """Of a particle in a battery's electrode, cut into cells; at its surface a reaction under a constant current."""
    inner = f"c{cell - 1} - c{cell}" if cell > 1 else "0"
    outer = f"c{cell + 1} - c{cell}" if cell < _CELLS else "0"
    flux = f" + {_CELLS}*(0.5 - k*sinh(4*(c{cell} - 0.5)))" if cell == _CELLS else ""
    return f"D*{_CELLS**2}*(({inner}) + ({outer})){flux}"


CASES = {
    "robertson": Stiff(
        {"a": "-k1*a + k3*b*c", "b": "k1*a - k3*b*c - k2*b**2", "c": "k2*b**2"},
        [1.0, 0.0, 0.0],
        [1.0, 1e-5, 1.0],
        {"k1": 0.04, "k2": 3e7, "k3": 1e4},
        1e4,
    ),
    "van_der_pol": Stiff(
        {"x": "v", "v": "mu*(1 - x**2)*v - x"},
        [2.0, 0.0],
        [1.0, 1.0],
        {"mu": 1000.0},
        2000.0,
        [1.706167732170469, -0.8928097010248125e-3],
    ),
    "hires": Stiff(
        {
            "y1": "-p1*y1 + 0.43*y2 + 8.32*y3 + 0.0007",
            "y2": "p1*y1 - 8.75*y2",
            "y3": "-10.03*y3 + 0.43*y4 + p2*y5",
            "y4": "8.32*y2 + 1.71*y3 - 1.12*y4",
            "y5": "-1.745*y5 + 0.43*y6 + 0.43*y7",
            "y6": "-p3*y6*y8 + 0.69*y4 + 1.71*y5 - 0.43*y6 + 0.69*y7",
            "y7": "p3*y6*y8 - 1.81*y7",
            "y8": "-p3*y6*y8 + 1.81*y7",
        },
        [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0057],
        [1e-2, 1e-3, 1e-4, 1e-2, 1e-2, 1e-1, 5e-3, 5e-3],
        {"p1": 1.71, "p2": 0.035, "p3": 280.0},
        321.8122,
        [
            0.7371312573325668e-3,
            0.1442485726316185e-3,
            0.5888729740967575e-4,
            0.1175651343283149e-2,
            0.2386356198831331e-2,
            0.6238968252742796e-2,
            0.2849998395185769e-2,
            0.2850001604814231e-2,
        ],
    ),
    "oregonator": Stiff(
        {"y1": "s*(y2 + y1*(1 - q*y1 - y2))", "y2": "(y3 - (1 + y1)*y2)/s", "y3": "w*(y1 - y3)"},
        [1.0, 2.0, 3.0],
        [1.0, 1.0, 1.0],
        {"s": 77.27, "q": 8.375e-6, "w": 0.161},
        360.0,
        [1.000814870318523, 1228.178521549917, 132.0554942846706],
    ),
    "particle": Stiff(
        {f"c{cell}": _diffusion(cell) for cell in range(1, _CELLS + 1)},
        [1.0] * _CELLS,
        [1.0] * _CELLS,
        {"D": 1.0, "k": 0.7},
        2.0,
    ),
}


def reference(name: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """x (n_x) and dx/dtheta (n_x, p) at the end."""
    stored = json.loads(REFERENCE.read_text())[name]
    return np.array(stored["x"]), np.array(stored["dx_dtheta"])


def _computed(case: Stiff) -> dict[str, object]:
    from scipy.integrate import solve_ivp

    x, theta = sympy.symbols(list(case.f)), sympy.symbols(list(case.theta))
    names = {str(symbol): symbol for symbol in (*x, *theta)}
    f = sympy.Matrix([sympy.sympify(text, names) for text in case.f.values()])
    columns = sympy.Matrix(len(x), len(theta), lambda i, j: sympy.Symbol(f"s_{i}_{j}"))
    both = sympy.Matrix([*f, *(f.jacobian(x) * columns + f.jacobian(theta))])
    variables = [*x, *columns]
    values = list(case.theta.values())
    rates = sympy.lambdify([variables, theta], list(both))
    slopes = sympy.lambdify([variables, theta], both.jacobian(variables))
    start = np.concatenate([case.x0, np.zeros(len(columns))])
    sizes = np.concatenate([case.sizes, np.outer(case.sizes, 1 / np.abs(values)).ravel()])
    done = solve_ivp(
        lambda _, z: np.array(rates(z, values)),
        (0.0, case.duration),
        start,
        "Radau",
        rtol=1e-12,
        atol=1e-14 * sizes,
        jac=lambda _, z: np.array(slopes(z, values), float),
    )
    end = done.y[:, -1]
    return {"x": end[: len(x)].tolist(), "dx_dtheta": end[len(x) :].reshape(columns.shape).tolist()}


if __name__ == "__main__":
    REFERENCE.write_text(json.dumps({name: _computed(case) for name, case in CASES.items()}, indent=1) + "\n")
