"""Constraints on experiment points: a comparison of names and numbers, read as data and never evaluated as code."""

from __future__ import annotations

import ast
import operator
import sys
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..basics.messages import listed, shortened, shown
from ..basics.values import Array

Constraint = str | Callable[[Mapping[str, Array]], NDArray[np.bool_]]

_ARITHMETIC: dict[type[ast.AST], Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
}
_COMPARISONS: dict[type[ast.AST], Callable[..., Any]] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}
_FUNCTIONS: dict[str, Callable[[Any], Any]] = {"abs": np.abs, "sqrt": np.sqrt}

MAX_DEPTH = 200
"""How deep the terms of a constraint may be nested."""


def parse_constraint(text: str, names: Iterable[str]) -> Callable[[Mapping[str, Array]], NDArray[np.bool_]]:
    """Turn a text such as ``"p_A + p_B < 2.5e7"`` into a function of the named columns.

    Parameters
    ----------
    text : str
        One comparison (``0 < v < 0.1`` too) of names, numbers, + - * / **, abs() and sqrt().
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
    names = tuple(names)

    def refuse(what: str) -> ValueError:
        return ValueError(f"constraint {shown(text, 80)}: {shortened(what, 300)}")

    try:
        tree = ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise refuse('expected a comparison such as "p_A + p_B < 2.5e7", given something else') from error

    def check(node: ast.AST, depth: int = 0) -> None:
        if depth > MAX_DEPTH:
            raise refuse(f"expected terms nested at most {MAX_DEPTH} deep, given more")
        match node:
            case ast.BinOp(left, op, right) if type(op) in _ARITHMETIC:
                check(left, depth + 1)
                check(right, depth + 1)
            case ast.UnaryOp(op, operand) if type(op) in _ARITHMETIC:
                check(operand, depth + 1)
            case ast.Call(ast.Name(function), [argument], []) if function in _FUNCTIONS:
                check(argument, depth + 1)
            case ast.Name(name):
                if name not in names:
                    raise refuse(f"expected the names {listed(names)}; given unknown {shown(name)}")
            case ast.Constant(value) if isinstance(value, int | float) and not isinstance(value, bool):
                if abs(value) > sys.float_info.max:
                    raise refuse(f"expected numbers of at most {sys.float_info.max:.1e}, given a larger one")
            case _:
                part = ast.get_source_segment(text.strip(), node) or type(node).__name__
                raise refuse(f"expected names, numbers, + - * / **, abs() and sqrt(); given {shown(part)}")

    def value(node: ast.AST, columns: Mapping[str, Array]) -> Any:
        match node:
            case ast.BinOp(left, op, right):
                return _ARITHMETIC[type(op)](value(left, columns), value(right, columns))
            case ast.UnaryOp(op, operand):
                return _ARITHMETIC[type(op)](value(operand, columns))
            case ast.Call(ast.Name(function), [argument]):
                return _FUNCTIONS[function](value(argument, columns))
            case ast.Name(name):
                return columns[name]
            case ast.Constant(number):
                return np.float64(number)  # type: ignore[arg-type]
        raise AssertionError(node)

    if not isinstance(tree, ast.Compare) or any(type(op) not in _COMPARISONS for op in tree.ops):
        raise refuse("expected a comparison with <, <=, > or >=, given none")
    terms = [tree.left, *tree.comparators]
    for term in terms:
        check(term)
    comparisons = [_COMPARISONS[type(op)] for op in tree.ops]

    def holds(columns: Mapping[str, Array]) -> NDArray[np.bool_]:
        with np.errstate(all="ignore"):
            values = [value(term, columns) for term in terms]
            results = [compare(a, b) for compare, a, b in zip(comparisons, values[:-1], values[1:], strict=True)]
        count = len(next(iter(columns.values())))
        return np.broadcast_to(np.logical_and.reduce(results), (count,))

    return holds
