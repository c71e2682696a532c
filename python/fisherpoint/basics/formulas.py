"""Formulas as text, of models and of constraints: read through a whitelist of Python's syntax tree.

Nothing is evaluated as code: a file is data.
"""

from __future__ import annotations

import ast
import math
import warnings
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, NoReturn

from .function_table import FUNCTIONS
from .messages import listed, shown

MAX_LENGTH = 10_000
MAX_DEPTH = 60
"""How deep the terms of a formula may be nested; a long sum or product is not deep."""

ARGUMENTS = {function.name: (1, 1) for function in FUNCTIONS} | {"atan2": (2, 2), "min": (2, 32), "max": (2, 32), "where": (3, 3)}
"""The functions that a formula may use, each with the least and the largest number of its arguments."""

_SUMS_AND_PRODUCTS: dict[type[ast.AST], str] = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}
_COMPARISONS: dict[type[ast.AST], str] = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">="}
_BLANKS = str.maketrans("\t\n\r", "   ")  # a formula may go over several lines
_FUNCTIONS = f"the functions {', '.join(ARGUMENTS)}"
_EXPECTED = f"expected names, numbers, + - * / ** and {_FUNCTIONS}"
REPEATED = (
    "expected no %, //, floor, ceil or round, which jump again and again: write each jump as where() or heaviside(), "
    "as heaviside(x - 1) + heaviside(x - 2) for floor(x) up to 3"
)
"""Message about functions that jump at infinitely many places."""
_REPEATING = ("floor", "ceil", "ceiling", "round", "mod", "fmod", "trunc", "int", "frac")
_EQUAL = "expected <, <=, > or >=, as == holds for no length of time: write abs(a - b) < width"
_JOINED = "expected brackets around each comparison beside &, | and ~: (a > 0) & (b > 0)"
_TOO_DEEP = f"expected terms nested at most {MAX_DEPTH} deep"


class Formula:
    """A text such as ``"-k1*sqrt(h1) + k4*u"`` as a syntax tree.

    It is made of names, numbers, + - * / **, pi and `ARGUMENTS`; the condition of where() is a comparison, or several joined by
    and, or, not, or by &, |, ~ with brackets around each. What else is in it is found where it is read.

    Parameters
    ----------
    text : str
    place : str
        Of the formula, for messages.

    Raises
    ------
    ValueError
        Where it is no text, too long, or nothing that Python could read: one line that names the place, and the column.
    """

    def __init__(self, text: object, place: str) -> None:
        if not isinstance(text, str):
            raise ValueError(f"{place}: expected a formula as text, given {shown(text)}")
        if len(text) > MAX_LENGTH:
            raise ValueError(f"{place}: expected a formula of at most {MAX_LENGTH} characters, given {len(text)}")
        self.text, self.place = text.translate(_BLANKS).strip(), place
        self._indent = len(text) - len(text.translate(_BLANKS).lstrip())
        opened: list[int] = []
        unopened = -1
        for column, character in enumerate(self.text):
            if character in "([{":
                opened.append(column)
            elif character in ")]}" and opened:
                opened.pop()
            elif character in ")]}" and unopened < 0:
                unopened = column
            if len(opened) > MAX_DEPTH:
                self._refuse(_TOO_DEEP, column)
            if character == "\0":  # versions of Python raise different errors for it
                self._refuse(_EXPECTED, column)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                self.tree = ast.parse(self.text, mode="eval").body
        except SyntaxError as error:
            if unopened >= 0:
                self._refuse(f"expected an opening bracket before this {self.text[unopened]}", unopened)
            if opened:
                self._refuse(f"expected a closing bracket for this {self.text[opened[-1]]}", opened[-1])
            self._refuse(_EXPECTED, (error.offset or 1) - 1)
        except (ValueError, RecursionError, MemoryError):
            raise ValueError(f"{place}: {_EXPECTED}; given a text that cannot be read") from None

    def refuse(self, what: str, node: ast.expr) -> NoReturn:
        """Raise for a part that is not what was expected."""
        self._refuse(what, len(self.text.encode()[: node.col_offset].decode()))  # the tree counts bytes

    def _refuse(self, what: str, column: int) -> NoReturn:
        given = self.text[max(column, 0) :][:30] or "the end"
        raise ValueError(f"{self.place}: column {self._indent + column + 1}: {what}; given {given!r}")


class Reader(ABC):
    """Makes a formula into something of the kind that its names stand for, part by part: see `number` and `combined`.

    The names that are `hidden` may occur too; messages do not list them.
    """

    remembers = False
    """Whether latch() and delay() may occur."""

    def __init__(self, formula: Formula, names: Mapping[str, Any], hidden: Mapping[str, Any] | None = None) -> None:
        self.formula, self.names, self.hidden = formula, names, hidden or {}

    @abstractmethod
    def number(self, node: ast.expr, value: float) -> Any:
        """Value of a finite number."""

    @abstractmethod
    def combined(self, node: ast.expr, how: str, *values: Any) -> Any:
        """Value of an operator, such as "+", "<", "and" or "negative", or of a function; `node` is where it stands."""

    def check_finite(self, node: ast.expr, value: Any) -> None:
        """Raise for a number that no double holds."""
        try:
            finite = math.isfinite(float(value))
        except (OverflowError, TypeError):
            finite = False
        if not finite:
            self.formula.refuse("expected finite numbers of at most 1.8e308", node)

    def term(self) -> Any:
        """The formula, which is a term."""
        return self._term(self.formula.tree, 0)

    def comparison(self) -> Any:
        """The formula, which is a comparison of terms."""
        tree = self.formula.tree
        if not isinstance(tree, ast.Compare):
            self.formula.refuse("expected a comparison with <, <=, > or >=", tree)
        return self._condition(tree, 0)

    def condition(self) -> Any:
        """The formula, which is a condition."""
        return self._condition(self.formula.tree, 0)

    def _term(self, node: ast.expr, depth: int) -> Any:
        if depth > MAX_DEPTH:
            self.formula.refuse(_TOO_DEEP, node)
        match node:
            case ast.BinOp(_, op) if type(op) in _SUMS_AND_PRODUCTS:
                return self._sum_or_product(node, depth)
            case ast.BinOp(base, ast.Pow(), exponent):
                return self.combined(node, "**", self._term(base, depth + 1), self._term(exponent, depth + 1))
            case ast.UnaryOp(ast.USub() | ast.UAdd() as sign, operand):
                value = self._term(operand, depth + 1)
                return self.combined(node, "negative", value) if isinstance(sign, ast.USub) else value
            case ast.Call(ast.Name(name), arguments, []) if name in ARGUMENTS:
                return self._call(node, name, arguments, depth + 1)
            case ast.Call(ast.Name("latch"), _, _) if self.remembers:
                return self._latch(node, depth + 1)
            case ast.Call(ast.Name("delay"), _, _) if self.remembers:
                return self._delay(node, depth + 1)
            case ast.Call(ast.Name(name), _, _) if name in _REPEATING and name not in self.names:
                self.formula.refuse(REPEATED, node)
            case ast.BinOp(_, ast.Mod() | ast.FloorDiv(), _):
                self.formula.refuse(REPEATED, node)
            case ast.Call(ast.Name(), _, _):
                self.formula.refuse(f"expected {_FUNCTIONS}", node)
            case ast.Name(name) if name in self.hidden and name not in self.names:
                return self.hidden[name]
            case ast.Name(name):
                if name not in self.names and name != "pi":
                    self.formula.refuse(f"expected the names {listed(self.names)}", node)
                return self.names[name] if name in self.names else self.number(node, math.pi)
            case ast.Constant(value) if isinstance(value, int | float) and not isinstance(value, bool):
                self.check_finite(node, value)
                return self.number(node, value)
            case ast.BinOp(_, ast.BitXor(), _):
                self.formula.refuse("expected powers written as **", node)
            case ast.BinOp(_, ast.BitAnd() | ast.BitOr(), _) | ast.UnaryOp(ast.Invert(), _) if not _compares(node):
                self.formula.refuse(_JOINED, node)
            case (
                ast.Compare()
                | ast.BoolOp()
                | ast.BinOp(_, ast.BitAnd() | ast.BitOr(), _)
                | ast.UnaryOp(ast.Not() | ast.Invert(), _)
            ):
                self.formula.refuse("expected a comparison only as the condition of where()", node)
        self.formula.refuse(_EXPECTED, node)

    def _sum_or_product(self, node: ast.expr, depth: int) -> Any:
        """Sums and products hang to the left; they are taken one by one, however long they are."""
        steps = []
        while isinstance(node, ast.BinOp) and type(node.op) in _SUMS_AND_PRODUCTS:
            steps.append(node)
            node = node.left
        value = self._term(node, depth + 1)
        for step in reversed(steps):
            value = self.combined(step, _SUMS_AND_PRODUCTS[type(step.op)], value, self._term(step.right, depth + 1))
        return value

    def _call(self, node: ast.expr, name: str, arguments: list[ast.expr], depth: int) -> Any:
        least, most = ARGUMENTS[name]
        if not least <= len(arguments) <= most:
            self.formula.refuse(f"expected {least if least == most else f'{least} to {most}'} arguments of {name}()", node)
        first = self._condition if name == "where" else self._term
        values = [first(arguments[0], depth), *(self._term(argument, depth) for argument in arguments[1:])]
        return self.combined(node, name, *values)

    def _latch(self, node: ast.Call, depth: int) -> Any:
        start, named = node.args[2:], node.keywords
        if not 2 <= len(node.args) <= 3 - len(named) or len(named) > 1 or any(one.arg != "start" for one in named):
            self.formula.refuse("expected latch(on, off) or latch(on, off, start=1)", node)
        conditions = [self._condition(argument, depth) for argument in node.args[:2]]
        values = [self._term(argument, depth) for argument in (*start, *(one.value for one in named))]
        return self.combined(node, "latch", *conditions, *values)

    def _delay(self, node: ast.Call, depth: int) -> Any:
        match node.args:
            case [ast.Name(), ast.Name() | ast.Constant()] if not node.keywords:
                return self.combined(node, "delay", *(self._term(argument, depth) for argument in node.args))
        self.formula.refuse("expected delay(u, tau) with an input and a parameter, a known constant or a number of seconds", node)

    def _condition(self, node: ast.expr, depth: int) -> Any:
        if depth > MAX_DEPTH:
            self.formula.refuse(_TOO_DEEP, node)
        match node:
            case ast.BoolOp(op, conditions):
                how = "and" if isinstance(op, ast.And) else "or"
                return self.combined(node, how, *(self._condition(one, depth + 1) for one in conditions))
            case ast.BinOp(left, ast.BitAnd() | ast.BitOr() as op, right):
                how = "and" if isinstance(op, ast.BitAnd) else "or"
                return self.combined(node, how, self._condition(left, depth + 1), self._condition(right, depth + 1))
            case ast.UnaryOp(ast.Not() | ast.Invert(), operand):
                return self.combined(node, "not", self._condition(operand, depth + 1))
            case ast.Compare(left, ops, rights) if all(type(op) in _COMPARISONS for op in ops):
                sides = [self._term(side, depth + 1) for side in (left, *rights)]
                pairs = zip(ops, sides[:-1], sides[1:], strict=True)
                comparisons = [self.combined(node, _COMPARISONS[type(op)], a, b) for op, a, b in pairs]
                return comparisons[0] if len(comparisons) == 1 else self.combined(node, "and", *comparisons)
            case ast.Call(ast.Name("latch"), _, _) if self.remembers:
                return self.combined(node, "set", self._latch(node, depth + 1))
            case ast.Compare(_, ops, _) if any(isinstance(op, ast.Eq | ast.NotEq) for op in ops):
                self.formula.refuse(_EQUAL, node)
        self.formula.refuse("expected a condition such as h > 0", node)


def _compares(node: ast.expr) -> bool:
    """Whether comparisons stand directly in a part."""
    return any(isinstance(inner, ast.Compare) for inner in ast.iter_child_nodes(node))
