"""Constraints on experiment points: comparisons of terms, read with numpy arrays instead of names."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Iterable, Mapping
from functools import reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..basics.formulas import Formula, Reader
from ..basics.function_table import FUNCTIONS
from ..basics.messages import shown
from ..basics.values import Array

Constraint = str | Callable[[Mapping[str, Array]], NDArray[np.bool_]]


def parse_constraint(text: str, names: Iterable[str]) -> Callable[[Mapping[str, Array]], NDArray[np.bool_]]:
    """Turn a text such as ``"p_A + p_B < 2.5e7"`` into a function of the named columns.

    Parameters
    ----------
    text : str
        One comparison (``0 < v < 0.1`` too) of terms, see `Formula`.
    names : iterable of str
        The names that may occur.

    Returns
    -------
    callable
        Takes a mapping of name to array (K,), returns a boolean array (K,).

    Raises
    ------
    ValueError
        For anything else; the message shows the part that is not understood.
    """
    formula = Formula(text, f"constraint {shown(text)}")

    def holds(columns: Mapping[str, Array]) -> NDArray[np.bool_]:
        with np.errstate(all="ignore"):
            result = _Arrays(formula, columns).comparison()
        return np.broadcast_to(result, (len(next(iter(columns.values()), ())),))

    holds({name: np.empty(0) for name in names})  # what cannot be read is found in any columns
    return holds


class _Arrays(Reader):
    """Terms as arrays; entries may be infinite or NaN where the numbers make them so."""

    def number(self, node: ast.expr, value: float) -> Any:
        return np.float64(value)

    def combined(self, node: ast.expr, how: str, *values: Any) -> Any:
        return _OPERATIONS[how](*values)


_OPERATIONS: dict[str, Callable[..., Any]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
    "**": operator.pow,
    "negative": operator.neg,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
    "and": lambda *conditions: reduce(np.logical_and, conditions),
    "or": lambda *conditions: reduce(np.logical_or, conditions),
    "not": np.logical_not,
    **{function.name: function.arrays for function in FUNCTIONS},
    "atan2": np.arctan2,
    "where": np.where,
    "min": lambda *values: reduce(np.minimum, values),
    "max": lambda *values: reduce(np.maximum, values),
}
