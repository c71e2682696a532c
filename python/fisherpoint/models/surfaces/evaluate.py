"""Values of expressions, part by part with NumPy: for checks of numbers, and at complex points for checks of identities.

An identity between smooth expressions that holds at random complex points holds everywhere, also where a square root has no real
value. Branches go by the real part.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import reduce
from typing import Any

import numpy as np
import sympy

from ..tape.branch import Select
from ..tape.defined import Defined
from ..tape.kinds import KINDS
from ..tape.parts import parts


def evaluate(expressions: Sequence[Any], values: Mapping[Any, Any]) -> list[Any]:
    """Return the values of expressions, where `values` has numbers or arrays for their symbols."""
    known: dict[Any, Any] = dict(values)
    with np.errstate(all="ignore"):
        for expression in expressions:
            for part in parts(expression):
                if part not in known:
                    known[part] = _value(part, known)
    return [known[expression] for expression in expressions]


def _value(part: Any, known: Mapping[Any, Any]) -> Any:
    if part.is_number and not part.args:  # also e, i and what a division by zero leaves
        number = complex(part) if part.is_finite else complex(np.nan)
        return number if number.imag else number.real
    if isinstance(part, sympy.Piecewise):
        pairs = [(known[value], known[condition]) for value, condition in part.args]
        return reduce(lambda rest, pair: np.where(pair[1], pair[0], rest), reversed(pairs[:-1]), pairs[-1][0])
    if part.func is sympy.functions.elementary.piecewise.ExprCondPair:
        return None
    return _COMPUTE[part.func](*(known[argument] for argument in part.args))


def _power(base: Any, exponent: Any) -> Any:
    if np.ndim(exponent) == 0 and np.isreal(exponent) and float(np.real(exponent)).is_integer():
        return np.asarray(base, dtype=np.result_type(base, np.float64)) ** int(np.real(exponent))
    return np.power(base, exponent)


def _extreme(larger: bool) -> Callable[..., Any]:
    return lambda *values: reduce(lambda a, b: np.where((np.real(a) > np.real(b)) == larger, a, b), values)


def _atan2(y: Any, x: Any) -> Any:
    if np.iscomplexobj(y) or np.iscomplexobj(x):
        return 2 * np.arctan(y / (x + np.sqrt(x * x + y * y)))
    return np.arctan2(y, x)


_COMPUTE: dict[Any, Callable[..., Any]] = {
    sympy.Add: lambda *terms: sum(terms),
    sympy.Mul: lambda *factors: reduce(lambda a, b: a * b, factors),
    sympy.Pow: _power,
    **{kind: function.arrays for kind, function in KINDS.items() if not function.at_zero},
    sympy.atan2: _atan2,
    sympy.sign: lambda a: np.sign(np.real(a)),
    sympy.Abs: lambda a: a * np.sign(np.real(a)),
    sympy.Heaviside: lambda a, _: np.where(np.real(a) > 0, 1.0, 0.0),
    sympy.Max: _extreme(True),
    sympy.Min: _extreme(False),
    Defined: lambda value, *_: value,
    Select: lambda condition, a, b: np.where(np.real(condition) > 0, a, b),
    sympy.StrictGreaterThan: lambda a, b: np.real(a) > np.real(b),
    sympy.GreaterThan: lambda a, b: np.real(a) >= np.real(b),
    sympy.StrictLessThan: lambda a, b: np.real(a) < np.real(b),
    sympy.LessThan: lambda a, b: np.real(a) <= np.real(b),
    sympy.And: lambda *conditions: np.logical_and.reduce(np.broadcast_arrays(*conditions)),
    sympy.Or: lambda *conditions: np.logical_or.reduce(np.broadcast_arrays(*conditions)),
    sympy.Not: np.logical_not,
    type(sympy.true): lambda: True,
    type(sympy.false): lambda: False,
}
