"""Numbers with which the texts of a model are carried out besides floats: with a derivative, and with roundings of their own.

Derivatives are exact where differences are not: of an output such as sin(exp(40)) a difference over any step that is not lost in
rounding spans many oscillations. And where two sides of a condition are the same but for rounding, as of p*sign(u) > p, which
rounding it was cannot be known; with varied roundings such a condition is seen to change.
"""

from __future__ import annotations

import math
import operator
import random
from collections.abc import Callable, Mapping
from typing import Any

Function = Callable[..., float]
ROUNDING = 1e-15  # relative: a few of those that a number has


class Number:
    """What behaves as its value where it is compared."""

    __slots__ = ("value",)

    def __init__(self, value: float) -> None:
        self.value = value

    def __float__(self) -> float:
        return float(self.value)

    def __lt__(self, other: Any) -> bool:
        return float(self) < float(other)

    def __le__(self, other: Any) -> bool:
        return float(self) <= float(other)

    def __gt__(self, other: Any) -> bool:
        return float(self) > float(other)

    def __ge__(self, other: Any) -> bool:
        return float(self) >= float(other)


class Dual(Number):
    """A value and its derivative."""

    __slots__ = ("slope",)

    def __init__(self, value: float, slope: float = 0.0) -> None:
        super().__init__(value)
        self.slope = slope


class Rough(Number):
    """A value that every operation rounds at random."""

    __slots__ = ()


def slope_of(value: Any) -> float:
    return value.slope if isinstance(value, Dual) else 0.0


def _dual(function: Function, partials: tuple[Function, ...]) -> Callable[..., Any]:
    def apply(*operands: Any) -> Any:
        values = [float(operand) for operand in operands]
        slope = 0.0
        for partial, operand in zip(partials, operands, strict=True):
            if known := slope_of(operand):  # where there is none, a partial derivative need not exist
                slope += partial(*values) * known
        return Dual(function(*values), slope)

    return apply


def _rough(function: Function, _: tuple[Function, ...]) -> Callable[..., Any]:
    def apply(*operands: Any) -> Any:
        return Rough(function(*map(float, operands)) * (1 + random.uniform(-ROUNDING, ROUNDING)))

    return apply


def _power_by_exponent(a: float, b: float) -> float:
    return math.pow(a, b) * math.log(a)


OPERATORS: dict[str, tuple[Function, tuple[Function, ...]]] = {
    "add": (operator.add, (lambda a, b: 1.0, lambda a, b: 1.0)),
    "sub": (operator.sub, (lambda a, b: 1.0, lambda a, b: -1.0)),
    "mul": (operator.mul, (lambda a, b: b, lambda a, b: a)),
    "truediv": (operator.truediv, (lambda a, b: 1 / b, lambda a, b: -a / b / b)),
    "pow": (math.pow, (lambda a, b: b * math.pow(a, b - 1), _power_by_exponent)),
}
PARTIALS: dict[str, tuple[Function, ...]] = {
    "sqrt": (lambda a: 0.5 / math.sqrt(a),),
    "log": (lambda a: 1 / a,),
    "sin": (math.cos,),
    "cos": (lambda a: -math.sin(a),),
    "tan": (lambda a: 1 + math.tan(a) ** 2,),
    "asin": (lambda a: 1 / math.sqrt(1 - a * a),),
    "acos": (lambda a: -1 / math.sqrt(1 - a * a),),
    "atan": (lambda a: 1 / (1 + a * a),),
    "atan2": (lambda a, b: b / (a * a + b * b), lambda a, b: -a / (a * a + b * b)),
    "tanh": (lambda a: 1 - math.tanh(a) ** 2,),
    "exp": (math.exp,),
    "sinh": (math.cosh,),
    "cosh": (math.sinh,),
}


def _equip(kind: type[Number], made: Callable[[Function, tuple[Function, ...]], Callable[..., Any]]) -> None:
    """Give a kind of number its operators."""
    for name, (function, partials) in OPERATORS.items():
        apply = made(function, partials)
        setattr(kind, f"__{name}__", apply)
        setattr(kind, f"__r{name}__", lambda self, other, apply=apply: apply(other, self))
    setattr(kind, "__neg__", lambda self: self * -1.0)  # noqa: B010
    setattr(kind, "__abs__", lambda self: -self if self < 0 else self * 1.0)  # noqa: B010


_equip(Dual, _dual)
_equip(Rough, _rough)


def names_for(names: Mapping[str, Any], kind: type[Number]) -> dict[str, Any]:
    """The functions of `names`, of such numbers too; those that only compare or choose serve any number as they are."""
    made = _dual if kind is Dual else _rough
    functions = {name: made(names[name], partials) for name, partials in PARTIALS.items()}
    functions["_power"] = made(*OPERATORS["pow"])

    def either(name: str) -> Callable[..., Any]:
        def call(*arguments: Any) -> Any:
            of = functions if any(isinstance(argument, Number) for argument in arguments) else names
            return of[name](*arguments)

        return call

    return {**names, **{name: either(name) for name in functions}}
