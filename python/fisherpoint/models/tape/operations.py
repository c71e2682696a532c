"""The operations a program is made of: the one table of their names, codes, operands and meanings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Operation:
    """An operation with its number of operands and what it computes of NumPy arrays."""

    name: str
    operands: int
    compute: Callable[..., Any]


def _select(condition: Any, positive: Any, other: Any) -> Any:
    return np.where(np.asarray(condition) > 0, positive, other)


TABLE = (  # an operation's place is its code in the core
    Operation("add", 2, np.add),
    Operation("sub", 2, np.subtract),
    Operation("mul", 2, np.multiply),
    Operation("div", 2, np.divide),
    Operation("neg", 1, np.negative),
    Operation("mul_add", 3, lambda a, b, c: a * b + c),
    Operation("mul_sub", 3, lambda a, b, c: a * b - c),
    Operation("sub_mul", 3, lambda a, b, c: c - a * b),
    Operation("sqrt", 1, np.sqrt),
    Operation("exp", 1, np.exp),
    Operation("log", 1, np.log),
    Operation("sin", 1, np.sin),
    Operation("cos", 1, np.cos),
    Operation("tan", 1, np.tan),
    Operation("asin", 1, np.arcsin),
    Operation("acos", 1, np.arccos),
    Operation("atan", 1, np.arctan),
    Operation("sinh", 1, np.sinh),
    Operation("cosh", 1, np.cosh),
    Operation("tanh", 1, np.tanh),
    Operation("pow", 2, np.power),
    Operation("abs", 1, np.abs),
    Operation("sign", 1, np.sign),
    Operation("min", 2, np.minimum),
    Operation("max", 2, np.maximum),
    Operation("select", 3, _select),
)
OPERATIONS = {operation.name: operation for operation in TABLE}
CODES = {operation.name: code for code, operation in enumerate(TABLE)}
COMMUTATIVE = frozenset({"add", "mul", "min", "max"})
ODD = frozenset({"sin", "tan", "asin", "atan", "sinh", "tanh", "sign"})
PARTIAL = frozenset({"div", "sqrt", "log", "exp", "sinh", "cosh", "tan", "asin", "acos", "pow"})
"""Operations without a finite value everywhere: a product of one and zero may be NaN."""
EVEN = frozenset({"cos", "cosh", "abs"})
