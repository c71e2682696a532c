"""``python -m bench stiff``: stiff models, next to CVODES through CasADi at matched accuracy, on one core.

Both use the largest tolerance, in steps of 10^(1/2), with which every state is within 1e-6 of the reference, and every column of
dx/dtheta within 1e-5 of its largest entry. The parameters of the thousand trajectories are spread by 5 %.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy
from numpy.typing import NDArray

import fisherpoint as fp

from .stiff_cases import CASES, Stiff, reference
from .timing import best_times

WITHIN_X, WITHIN_S = 1e-6, 1e-5
LADDER = 10.0 ** -np.arange(3, 11.5, 0.5)
BATCH = 1000
CVODES_ONES = 20
"""Of the batch, which CVODES computes one after the other, those that are timed."""

Ends = tuple[NDArray[np.float64], NDArray[np.float64] | None]


@dataclass(frozen=True)
class StiffFigures:
    """Of one model, with or without sensitivities: tolerances, and seconds for one trajectory and for each of a thousand.

    Where no tolerance reaches the accuracy, the smallest is used, and `rtol` or `rtol_cvodes` is None.
    """

    model: str
    sensitivities: bool
    rtol: float | None
    rtol_cvodes: float | None
    one: float
    one_interpreted: float
    one_cvodes: float
    each: float
    each_interpreted: float
    each_cvodes: float


def measure(quick: bool) -> list[StiffFigures]:
    """Measure all models; with `quick` the first two."""
    names = list(CASES)[:2] if quick else list(CASES)
    return [_measured(name, CASES[name], of_s, 2 if quick else 5) for name in names for of_s in (False, True)]


def _measured(name: str, case: Stiff, of_s: bool, rounds: int) -> StiffFigures:
    interpreted = case.model()
    compiled = interpreted.compile()
    theta = np.array(list(case.theta.values()))
    spread = theta * (1 + 0.05 * np.random.default_rng(0).standard_normal((BATCH, len(theta))))
    points, many = case.points(), case.points(BATCH)

    def ours(model: fp.Model, at: fp.Experiments, parameters: NDArray[np.float64], rtol: float) -> Ends:
        if of_s:
            found = fp.sensitivities(model, at, parameters, rtol=rtol, threads=1)
            return found.x[0], found.dx_dtheta[0]
        return fp.simulate(model, at, parameters, rtol=rtol, threads=1).x[0], None

    expected = reference(name)
    rtol = _matched(lambda rtol: ours(compiled, points, theta, rtol), expected)
    rtol_cvodes = _matched(lambda rtol: _cvodes(case, rtol, of_s)(theta), expected)
    used, cvodes = rtol or LADDER[-1], _cvodes(case, rtol_cvodes or LADDER[-1], of_s)
    times = best_times(
        {
            "one": lambda: ours(compiled, points, theta, used),
            "one interpreted": lambda: ours(interpreted, points, theta, used),
            "one cvodes": lambda: cvodes(theta),
            "each": lambda: ours(compiled, many, spread, used),
            "each interpreted": lambda: ours(interpreted, many, spread, used),
            "each cvodes": lambda: [cvodes(one) for one in spread[:CVODES_ONES]],
        },
        rounds,
    )
    seconds = {task: timing.seconds for task, timing in times.items()}
    return StiffFigures(
        name,
        of_s,
        rtol,
        rtol_cvodes,
        one=seconds["one"],
        one_interpreted=seconds["one interpreted"],
        one_cvodes=seconds["one cvodes"],
        each=seconds["each"] / BATCH,
        each_interpreted=seconds["each interpreted"] / BATCH,
        each_cvodes=seconds["each cvodes"] / CVODES_ONES,
    )


def _matched(solve: Callable[[float], Ends], expected: tuple[NDArray[np.float64], NDArray[np.float64]]) -> float | None:
    x, s = expected
    for rtol in LADDER:
        found_x, found_s = solve(float(rtol))
        good = bool((np.abs(found_x - x) <= WITHIN_X * np.abs(x)).all())
        if good and (found_s is None or (np.abs(found_s - s) <= WITHIN_S * np.abs(s).max(axis=0)).all()):
            return float(rtol)
    return None


def _cvodes(case: Stiff, rtol: float, of_s: bool) -> Callable[[NDArray[np.float64]], Ends]:
    """CVODES by its BDF formulas, absolute tolerances by the states' natural sizes."""
    import casadi

    symbols = {name: casadi.SX.sym(name) for name in (*case.f, *case.theta)}
    plain = [sympy.Symbol(name) for name in symbols]
    rates = sympy.lambdify(
        plain, [sympy.sympify(text, {str(s): s for s in plain}) for text in case.f.values()], modules=[casadi, "math"]
    )
    x, theta = casadi.vertcat(*(symbols[name] for name in case.f)), casadi.vertcat(*(symbols[name] for name in case.theta))
    sizes = np.array(case.sizes)
    # One absolute tolerance for all: the states count in units of their natural sizes.
    scaled = casadi.substitute(casadi.vertcat(*rates(*symbols.values())), x, x * sizes) / sizes
    problem = {"x": x, "p": theta, "ode": scaled}
    options = {"reltol": rtol, "abstol": 1e-2 * rtol, "max_num_steps": 10**6}
    integrator = casadi.integrator("cvodes", "cvodes", problem, 0, case.duration, options)
    start = np.array(case.x0) / sizes
    if not of_s:
        return lambda at: (np.asarray(integrator(x0=start, p=at)["xf"]).ravel() * sizes, None)
    both = integrator.factory("both", ["x0", "p"], ["xf", "jac:xf:p"])

    def solve(at: NDArray[np.float64]) -> Ends:
        end: Any
        slopes: Any
        end, slopes = both(start, at)
        return np.asarray(end).ravel() * sizes, np.asarray(slopes) * sizes[:, None]

    return solve
