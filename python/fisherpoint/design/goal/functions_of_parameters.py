"""Functions of the parameters as text, with their derivatives: numbers that carry a gradient through every operation."""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...basics.formulas import Formula, Reader
from ...basics.function_table import FUNCTIONS, Function
from ...basics.values import Array


@dataclass(frozen=True, eq=False)
class _Number:
    value: float
    gradient: Array


def gradient_of(text: str, theta: Mapping[str, float], label: str) -> tuple[float, Array]:
    """Value of a function such as ``"c_1 / k_1 - c_2 / k_2"`` and its derivative by each of the names, in their order.

    Raises
    ------
    ValueError
        For what is no such function, a place where it has no derivative or is not finite, and a function that is constant there.
    """
    formula = Formula(text, label)
    units = np.eye(len(theta))
    names = {name: _Number(float(value), unit) for (name, value), unit in zip(theta.items(), units, strict=True)}
    try:
        found = _Derivative(formula, names).term()
        finite = math.isfinite(found.value) and bool(np.isfinite(found.gradient).all())
    except (ArithmeticError, ValueError) as error:
        if isinstance(error, ValueError) and str(error).startswith(label):
            raise
        finite = False
    if not finite:
        raise ValueError(f"{label}: expected a function with a derivative at the prior mean, given {text!r}, which has none there")
    return found.value, found.gradient


class _Derivative(Reader):
    def number(self, node: ast.expr, value: float) -> Any:
        return _Number(float(value), np.zeros(len(self.names)))

    def combined(self, node: ast.expr, how: str, *values: Any) -> Any:
        if how not in _RULES:
            self.formula.refuse("expected + - * / ** and functions with a derivative", node)
        return _RULES[how](*values)


class _Value(Reader):
    """A formula of numbers, such as a slope."""

    def number(self, node: ast.expr, value: float) -> Any:
        return float(value)

    def combined(self, node: ast.expr, how: str, *values: Any) -> Any:
        return _VALUES[how](*values)


_VALUES: dict[str, Callable[..., Any]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
    "negative": operator.neg,
    ">": operator.gt,
    "where": lambda condition, a, b: a if condition else b,
    **{function.name: function.value for function in FUNCTIONS},
}


def _of_one(function: Function) -> Callable[[_Number], _Number]:
    slope = Formula(function.slope, "slope")

    def of_one(a: _Number) -> _Number:
        if function.at_zero and not a.value:
            raise ZeroDivisionError
        y = function.value(a.value)
        return _Number(y, _Value(slope, {"x": a.value, "y": y}).term() * a.gradient)

    return of_one


def _power(a: _Number, b: _Number) -> _Number:
    value = float(a.value**b.value) if a.value > 0 or b.value.is_integer() else math.nan
    gradient = np.zeros_like(a.gradient)
    if b.value:
        gradient = b.value * a.value ** (b.value - 1) * a.gradient
    if b.gradient.any():
        gradient = gradient + value * math.log(a.value) * b.gradient
    return _Number(value, gradient)


def _atan2(a: _Number, b: _Number) -> _Number:
    square = a.value**2 + b.value**2
    return _Number(math.atan2(a.value, b.value), (b.value * a.gradient - a.value * b.gradient) / square)


_RULES: dict[str, Callable[..., _Number]] = {
    "+": lambda a, b: _Number(a.value + b.value, a.gradient + b.gradient),
    "-": lambda a, b: _Number(a.value - b.value, a.gradient - b.gradient),
    "*": lambda a, b: _Number(a.value * b.value, a.gradient * b.value + a.value * b.gradient),
    "/": lambda a, b: _Number(a.value / b.value, (a.gradient - a.value / b.value * b.gradient) / b.value),
    "**": _power,
    "negative": lambda a: _Number(-a.value, -a.gradient),
    **{function.name: _of_one(function) for function in FUNCTIONS if function.slope},
    "atan2": _atan2,
}
