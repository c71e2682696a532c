"""The same model as NumPy functions: `CallableModel` against the equations and against SciPy."""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Sequence
from functools import reduce
from typing import Any

import numpy as np

import fisherpoint as fp
from check_states import judge
from checks import OK, Bench
from reading import Floats
from scipy_route import End

RTOL = 1e-6
POINTS = 2


class _Vectorised(ast.NodeTransformer):
    """Conditions of arrays are joined by & and |."""

    def visit_BoolOp(self, node: ast.BoolOp) -> ast.expr:
        self.generic_visit(node)
        operator = ast.BitAnd() if isinstance(node.op, ast.And) else ast.BitOr()
        return reduce(lambda a, b: ast.BinOp(a, operator, b), node.values)


NUMPY: dict[str, Any] = {
    **{
        name: getattr(np, name)
        for name in ("sqrt", "exp", "log", "sin", "cos", "tan", "tanh", "sinh", "cosh", "abs", "sign", "where")
    },
    **{"asin": np.arcsin, "acos": np.arccos, "atan": np.arctan},
    "max": lambda *values: reduce(np.maximum, values),
    "min": lambda *values: reduce(np.minimum, values),
    "heaviside": lambda a: np.where(np.real(a) > 0, 1.0, 0.0),
    "pi": math.pi,
}


def function_of(texts: Sequence[str], bench: Bench, single: bool = False) -> Callable[..., Any]:
    """A function of x, u, p with named columns."""
    case = bench.case
    of = {"x": case.states, "u": case.inputs, "p": (*case.parameters, *dict(case.constants))}
    lines = [f"    {name} = {kind}.{name}" for kind, names in of.items() for name in names]
    body = ", ".join(ast.unparse(_Vectorised().visit(ast.parse(text, mode="eval").body)) for text in texts)
    result = f"{body} + 0*{case.parameters[0]}" if single else f"[{body}]"
    space = dict(NUMPY)
    exec("def function(x, u, p):\n" + "\n".join(lines) + f"\n    return {result}", space)
    function: Callable[..., Any] = space["function"]
    return function


def check_callable(bench: Bench) -> None:
    """Two points: states by SciPy's route, sensitivities against those of the equations."""
    case, reading = bench.case, bench.reading
    if reading.limits or not len(bench.points):
        return
    rows = list(range(min(POINTS, len(bench.points))))
    courses = [bench.course(k) for k in rows] if case.rates else []
    jumps = {true.surface for true in courses if true.end is End.jump}
    surfaces = {text: function_of([text], bench, single=True) for text in reading.surfaces}
    arguments = case.arguments()
    f = function_of(case.rates, bench) if case.rates else None
    model = fp.CallableModel(
        f,
        function_of(case.outputs, bench),
        arguments["states"],
        arguments["inputs"],
        arguments["parameters"],
        {quantity.name: quantity.unit for quantity in bench.model.outputs},
        constants=arguments["constants"],
        jumps={text: surfaces[text] for m, text in enumerate(reading.surfaces) if m in jumps},
        kinks={text: surfaces[text] for m, text in enumerate(reading.surfaces) if m not in jumps},
    )
    points, theta = bench.points[rows], bench.theta[rows]
    try:
        done = fp.sensitivities(model, points, theta, rtol=RTOL)
        simulated = fp.simulate(model, points, theta, rtol=RTOL)
    except ValueError:
        bench.figures.count("callables refused")
        return
    bench.figures.count("callable trajectories", len(rows))
    call = "the same model as CallableModel"
    for k in rows:
        if not all(np.isfinite(array[k]).all() for array in (*done, *simulated)):
            bench.report("callable: not finite", math.inf, k, call, "inf or NaN")
            return
        if case.rates:
            judge(bench, k, int(simulated.status[k]), simulated.x[k], RTOL, call)
    expected = fp.sensitivities(bench.model, points, theta, rtol=1e-9, threads=1, jumps="exclude")
    both = np.flatnonzero((done.status == OK) & (expected.status == OK))
    for k in both.tolist():
        if case.rates and bench.course(k).end is not End.ok:
            continue
        size = np.abs(expected.dy_dtheta[k]).max(axis=0) + 1e-3 / np.abs(theta[k])
        error = float(np.max(np.abs(done.dy_dtheta[k] - expected.dy_dtheta[k]) / size))
        if error > 1e-2 and loss_at_tolerance(bench, points[[k]], theta[[k]], expected.dy_dtheta[k], size) > 1e-3:
            bench.figures.count("callable outputs that lose their digits at the tolerance")
            continue
        if error > 1e-2 and at_a_corner(bench, points[[k]], theta[k], done.dy_dtheta[k], size):
            bench.figures.count("callable sensitivities at a corner of the parameters")
            continue
        bench.figures.count("callable sensitivities compared")
        bench.figures.ratio("callable sensitivities", error / RTOL)
        if error > 1e-2:
            remark = f"dy {expected.dy_dtheta[k].tolist()} from the equations, {done.dy_dtheta[k].tolist()} from the functions"
            bench.report("callable: sensitivities", error / 1e-2, k, call, remark)


def at_a_corner(bench: Bench, point: fp.Experiments, theta: Floats, given: Floats, size: Floats) -> bool:
    """Whether dy/dtheta by the equations changes with the side of the parameters, and the given ones lie between both sides."""
    for j in range(len(theta)):
        step = np.zeros(len(theta))
        step[j] = 1e-9 * (theta[j] or 1.0)
        try:
            sides = [
                fp.sensitivities(bench.model, point, moved, rtol=1e-9, threads=1, jumps="exclude").dy_dtheta[0, :, j]
                for moved in (theta - step, theta + step)
            ]
        except ValueError:  # such as the root of what is negative on one side
            continue
        low, high = np.minimum(*sides), np.maximum(*sides)
        if ((given[:, j] < low - 1e-2 * size[j]) | (given[:, j] > high + 1e-2 * size[j])).any():
            return False
    return True


def loss_at_tolerance(bench: Bench, point: fp.Experiments, theta: Floats, expected: Floats, size: Floats) -> float:
    """What is left of dy/dtheta by the equations at the tolerance of callables: of cos(p x) nothing, once x is a million."""
    found = fp.sensitivities(bench.model, point, theta, rtol=RTOL, threads=1, jumps="exclude")
    return float(np.max(np.abs(found.dy_dtheta[0] - expected) / size))
