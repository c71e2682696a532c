"""The operations a program is made of: the one table of their names, codes, operands and meanings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...basics.function_table import FUNCTIONS


@dataclass(frozen=True)
class Operation:
    """An operation with its number of operands and what it computes of NumPy arrays."""

    name: str
    operands: int
    compute: Callable[..., Any]


def _select(condition: Any, positive: Any, other: Any) -> Any:
    return np.where(np.asarray(condition) > 0, positive, other)


_IN_CORE = [function for function in FUNCTIONS if not function.built]

TABLE = (  # an operation's place is its code in the core
    Operation("add", 2, np.add),
    Operation("sub", 2, np.subtract),
    Operation("mul", 2, np.multiply),
    Operation("div", 2, np.divide),
    Operation("neg", 1, np.negative),
    Operation("mul_add", 3, lambda a, b, c: a * b + c),
    Operation("mul_sub", 3, lambda a, b, c: a * b - c),
    Operation("sub_mul", 3, lambda a, b, c: c - a * b),
    *(Operation(one.name, 1, one.arrays) for one in _IN_CORE if not one.at_zero),
    Operation("pow", 2, np.power),
    *(Operation(one.name, 1, one.arrays) for one in _IN_CORE if one.at_zero),
    Operation("min", 2, np.minimum),
    Operation("max", 2, np.maximum),
    Operation("select", 3, _select),
)
OPERATIONS = {operation.name: operation for operation in TABLE}
CODES = {operation.name: code for code, operation in enumerate(TABLE)}
COMMUTATIVE = frozenset({"add", "mul", "min", "max"})
ODD = frozenset(one.name for one in _IN_CORE if one.symmetry == "odd")
PARTIAL = frozenset({"div", "pow", *(one.name for one in _IN_CORE if one.partial)})
"""Operations without a finite value everywhere: a product of one and zero may be NaN."""
EVEN = frozenset(one.name for one in _IN_CORE if one.symmetry == "even")
