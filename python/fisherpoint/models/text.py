"""Equations as text: read through a whitelist of Python's syntax tree into SymPy. Nothing is evaluated: a file is data."""

from __future__ import annotations

import ast
import math
import operator
import warnings
from collections.abc import Callable, Mapping
from typing import Any, NoReturn

import sympy

from ..basics.messages import listed, shown
from .expressions import MAX_EXPONENT, checked
from .functions import ARGUMENTS, FUNCTIONS, NAMES
from .tape.parts import compared

MAX_LENGTH = 10_000
MAX_DEPTH = 60
"""How deep the terms of an equation may be nested; a long sum or product is not deep."""

_ARITHMETIC: dict[type[ast.AST], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}
_COMPARISONS: dict[type[ast.AST], Any] = {
    ast.Lt: sympy.StrictLessThan,
    ast.LtE: sympy.LessThan,
    ast.Gt: sympy.StrictGreaterThan,
    ast.GtE: sympy.GreaterThan,
}
_BLANKS = str.maketrans("\t\n\r", "   ")  # an equation may go over several lines
_EXPECTED = f"names, numbers, + - * / ** and the functions {', '.join(NAMES)}"


def parse_equation(text: object, symbols: Mapping[str, sympy.Symbol], place: str) -> Any:
    """Turn a text such as ``"-k1*sqrt(h1) + k4*u"`` into a SymPy expression.

    Parameters
    ----------
    text : str
        Names, numbers, + - * / **, pi, and the functions of `fisherpoint.models.functions`; the condition of where() is a
        comparison, or several joined by and, or, not.
    symbols : mapping of str to sympy.Symbol
        The names that may occur.
    place : str
        Of the equation, for messages.

    Raises
    ------
    ValueError
        For anything else: one line that names the place, and the column.
    """
    if not isinstance(text, str):
        raise ValueError(f"{place}: expected an equation as text, given {shown(text)}")
    if len(text) > MAX_LENGTH:
        raise ValueError(f"{place}: expected an equation of at most {MAX_LENGTH} characters, given {len(text)}")
    reader = _Reader(text.translate(_BLANKS), symbols, place)
    return checked(reader.expression(reader.tree(), 0), symbols, place)


class _Reader:
    def __init__(self, text: str, symbols: Mapping[str, sympy.Symbol], place: str) -> None:
        self.text, self.symbols, self.place = text.strip(), symbols, place
        self.indent = len(text) - len(text.lstrip())

    def tree(self) -> ast.expr:
        self.check_brackets()
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                return ast.parse(self.text, mode="eval").body
        except SyntaxError as error:
            self.refuse(f"expected {_EXPECTED}", (error.offset or 1) - 1)
        except (ValueError, RecursionError, MemoryError):
            raise ValueError(f"{self.place}: expected {_EXPECTED}; given a text that cannot be read") from None

    def check_brackets(self) -> None:
        depth = 0
        for column, character in enumerate(self.text):
            depth += (character in "([{") - (character in ")]}")
            if depth > MAX_DEPTH:
                self.refuse(f"expected terms nested at most {MAX_DEPTH} deep", column)

    def refuse(self, what: str, column: int) -> NoReturn:
        given = self.text[max(column, 0) :][:30] or "the end"
        raise ValueError(f"{self.place}: column {self.indent + column + 1}: {what}; given {given!r}")

    def refuse_node(self, what: str, node: ast.expr) -> NoReturn:
        self.refuse(what, len(self.text.encode()[: node.col_offset].decode()))  # the tree counts bytes

    def expression(self, node: ast.expr, depth: int) -> Any:
        if depth > MAX_DEPTH:
            self.refuse_node(f"expected terms nested at most {MAX_DEPTH} deep", node)
        match node:
            case ast.BinOp(_, op) if type(op) in _ARITHMETIC:
                return self.sum_or_product(node, depth)
            case ast.BinOp(base, ast.Pow(), exponent):
                return self.power(node, self.expression(base, depth + 1), self.expression(exponent, depth + 1))
            case ast.UnaryOp(ast.USub() | ast.UAdd() as sign, operand):
                value = self.expression(operand, depth + 1)
                return -value if isinstance(sign, ast.USub) else value
            case ast.Call(ast.Name(name), arguments, []) if name in FUNCTIONS:
                return self.call(node, name, arguments, depth)
            case ast.Call(ast.Name(), _, _):
                self.refuse_node(f"expected the functions {', '.join(NAMES)}", node)
            case ast.Name(name):
                if name in self.symbols:
                    return self.symbols[name]
                if name == "pi":
                    return sympy.Float(math.pi)
                self.refuse_node(f"expected the names {listed(self.symbols)}", node)
            case ast.Constant(value) if isinstance(value, int | float) and not isinstance(value, bool):
                return self.number(node, value)
            case ast.BinOp(_, ast.BitXor(), _):
                self.refuse_node("expected powers written as **", node)
            case ast.Compare() | ast.BoolOp() | ast.UnaryOp(ast.Not(), _):
                self.refuse_node("expected a comparison only as the condition of where()", node)
        self.refuse_node(f"expected {_EXPECTED}", node)

    def sum_or_product(self, node: ast.expr, depth: int) -> Any:
        """Sums and products hang to the left; they are taken one by one, however long they are."""
        steps = []
        while isinstance(node, ast.BinOp) and type(node.op) in _ARITHMETIC:
            steps.append(node)
            node = node.left
        value = self.expression(node, depth + 1)
        for step in reversed(steps):
            right = self.expression(step.right, depth + 1)
            if isinstance(step.op, ast.Div) and right.is_zero:
                self.refuse_node("expected no division by zero", step.right)
            value = self.folded(step, _ARITHMETIC[type(step.op)](value, right))
        return value

    def power(self, node: ast.expr, base: Any, exponent: Any) -> Any:
        if exponent.is_Number:
            if abs(exponent) > MAX_EXPONENT:
                self.refuse_node(f"expected exponents of at most {MAX_EXPONENT}", node)
            factor, rest = base.as_coeff_Mul()
            if rest != 1 and factor.is_negative and not exponent.is_Integer:
                factor, rest = -factor, -rest
            if factor == 0 and not exponent > 0:
                self.refuse_node("expected no division by zero", node)
            # The number is taken by itself, as a double: sympy would work it out to the last digit.
            try:
                if abs(exponent) > 8 or not (factor.is_Integer and exponent.is_Integer):
                    factor = factor if factor == 1 else self.number(node, math.pow(float(factor), float(exponent)))
                else:
                    factor = self.folded(node, factor**exponent)
            except (ValueError, OverflowError):
                self.refuse_node("expected finite real numbers", node)
            return factor if rest == 1 else factor * rest**exponent
        if base.is_Number and not base > 0:
            self.refuse_node("expected a positive number under an exponent that varies", node)
        return base**exponent

    def call(self, node: ast.expr, name: str, arguments: list[ast.expr], depth: int) -> Any:
        least, most = ARGUMENTS[name]
        if not least <= len(arguments) <= most:
            self.refuse_node(f"expected {least if least == most else f'{least} to {most}'} arguments of {name}()", node)
        if name == "where":
            condition = self.condition(arguments[0], depth + 1)
            return FUNCTIONS[name](condition, *(self.expression(argument, depth + 1) for argument in arguments[1:]))
        values = [self.expression(argument, depth + 1) for argument in arguments]
        if not all(value.is_Number for value in values):
            return self.folded(node, FUNCTIONS[name](*values))
        try:
            return self.number(node, _NUMERIC[name](*map(float, values)))
        except (ValueError, OverflowError):
            self.refuse_node(f"expected {name}() of numbers for which it has a value", node)

    def condition(self, node: ast.expr, depth: int) -> Any:
        if depth > MAX_DEPTH:
            self.refuse_node(f"expected terms nested at most {MAX_DEPTH} deep", node)
        match node:
            case ast.BoolOp(op, values):
                kind = sympy.And if isinstance(op, ast.And) else sympy.Or
                return kind(*(self.condition(value, depth + 1) for value in values), evaluate=False)
            case ast.UnaryOp(ast.Not(), operand):
                return sympy.Not(self.condition(operand, depth + 1))
            case ast.Compare(left, ops, rights) if all(type(op) in _COMPARISONS for op in ops):
                sides = [self.expression(side, depth + 1) for side in (left, *rights)]
                pairs = zip(ops, sides[:-1], sides[1:], strict=True)
                comparisons = [compared(_COMPARISONS[type(op)], a, b) for op, a, b in pairs]
                return comparisons[0] if len(comparisons) == 1 else sympy.And(*comparisons, evaluate=False)
        self.refuse_node("expected a condition such as h > 0", node)

    def number(self, node: ast.expr, value: Any) -> Any:
        try:
            finite = math.isfinite(float(value))
        except (OverflowError, TypeError):
            finite = False
        if not finite:
            self.refuse_node("expected finite numbers of at most 1.8e308", node)
        return sympy.Integer(value) if isinstance(value, int) and abs(value) < 2**53 else sympy.Float(float(value))

    def folded(self, node: ast.expr, value: Any) -> Any:
        """A value of which the number, if it is one, a double holds; sums and products of short numbers stay exact."""
        if value.is_Number and not (value.is_Rational and max(abs(value.p), value.q) < 2**53):
            return self.number(node, value)
        return value


_NUMERIC: dict[str, Callable[..., float]] = {
    **{name: getattr(math, name) for name in ARGUMENTS if hasattr(math, name)},
    "abs": abs,
    "sign": lambda value: math.copysign(1.0, value) if value else 0.0,
    "heaviside": lambda value: float(value > 0),
    "min": min,
    "max": max,
}
