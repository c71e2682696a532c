"""Values of expressions, part by part with NumPy: for checks of numbers, and at complex points for checks of identities.

An identity between smooth expressions that holds at random complex points holds everywhere, also where a square root has no real
value. Branches go by the real part.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from functools import reduce
from typing import Any

import numpy as np
import sympy
from sympy.functions.elementary.piecewise import ExprCondPair

from ..tape.branch import Select
from ..tape.defined import Defined
from ..tape.kinds import KINDS
from ..tape.parts import parts


class Evaluator:
    """Expressions as a list of operations, each part once, to be evaluated more than once.

    Attributes
    ----------
    symbols : list of sympy.Symbol
        Those that occur.
    """

    def __init__(self, expressions: Sequence[Any]) -> None:
        self._places: dict[Any, int] = {}
        self._steps: list[tuple[Callable[..., Any], tuple[int, ...]]] = []
        self._numbers: dict[int, Any] = {}
        self.symbols: list[Any] = []
        for part in parts(*expressions):
            self._add(part)
        self._results = [self._places[expression] for expression in expressions]
        self._needed: Sequence[int] = range(len(self._steps))

    def only(self, expressions: Sequence[Any]) -> Evaluator:
        """The operations that some of the expressions, or parts of them, need."""
        made = copy(self)
        made._results = [self._places[expression] for expression in expressions]
        needed = set(made._results)
        for place in reversed(self._needed):  # operands come before what is computed of them
            if place in needed:
                needed.update(self._steps[place][1])
        made._needed = sorted(needed)
        made.symbols = [symbol for symbol in self.symbols if self._places[symbol] in needed]
        return made

    def _add(self, part: Any) -> None:
        place = self._places[part] = len(self._steps)
        function, operands = _COMPUTE.get(part.func), tuple(self._places[argument] for argument in part.args)
        if part.is_Symbol:
            self.symbols.append(part)
        elif part.is_number and not part.args:  # also e, i and what a division by zero leaves
            number = complex(part) if part.is_finite else complex(np.nan)
            self._numbers[place] = number if number.imag else number.real
        elif isinstance(part, sympy.Piecewise):
            operands = tuple(self._places[argument] for pair in part.args for argument in pair.args)
            function = _piecewise
        elif isinstance(part, ExprCondPair):
            function, operands = lambda: None, ()
        elif function is None:
            raise KeyError(part.func)
        self._steps.append((function or _COMPUTE[sympy.Add], operands))

    def __call__(self, values: Mapping[Any, Any]) -> list[Any]:
        """The values of the expressions, where `values` has numbers or arrays for their symbols."""
        found: list[Any] = [None] * len(self._steps)
        for symbol in self.symbols:
            found[self._places[symbol]] = values[symbol]
        for place, number in self._numbers.items():
            found[place] = number
        with np.errstate(all="ignore"):
            for place in self._needed:
                if found[place] is None:
                    function, operands = self._steps[place]
                    found[place] = function(*[found[operand] for operand in operands])
        return [found[place] for place in self._results]


def evaluate(expressions: Sequence[Any], values: Mapping[Any, Any]) -> list[Any]:
    """Return the values of expressions, where `values` has numbers or arrays for their symbols."""
    return Evaluator(expressions)(values)


def _piecewise(*operands: Any) -> Any:
    pairs = list(zip(operands[::2], operands[1::2], strict=True))
    return reduce(lambda rest, pair: np.where(pair[1], pair[0], rest), reversed(pairs[:-1]), pairs[-1][0])


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
