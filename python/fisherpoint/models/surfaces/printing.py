"""Expressions as text that `text.parse_equation` reads back, and as a user would write them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import sympy
from sympy.printing.precedence import PRECEDENCE
from sympy.printing.str import StrPrinter

from ..tape.branch import Select
from ..tape.defined import Defined
from ..tape.latch import Latch, condition_of
from ..tape.parts import cases, is_number, reads, rebuilt


class _EquationPrinter(StrPrinter):  # type: ignore[misc]
    def _print_Float(self, number: Any) -> str:
        return repr(float(number))

    def _as_ordered_terms(self, expression: Any, order: Any = None) -> list[Any]:
        terms = list(super()._as_ordered_terms(expression, order=order))
        return sorted(terms, key=lambda term: term is not next((t for t in terms if not t.could_extract_minus_sign()), None))

    def _print_Mul(self, product: Any) -> str:
        number, rest = product.as_coeff_Mul()
        above, below = _multiplied_out(number, rest)
        if not (above or below):
            return str(super()._print_Mul(product))
        size = abs(number)
        over, under = (size.p, size.q) if size.is_Rational else (size, 1)
        first = "" if over == 1 else f"{self._print(sympy.sympify(over))}*"
        text = f"({self._print(rest)})" if above or first else str(self._print(rest))
        return f"{'-' if number < 0 else ''}{first}{text}{'' if under == 1 else f'/{under}'}"

    def _print_Add(self, total: Any, order: Any = None) -> str:
        first, *others = self._as_ordered_terms(total, order=order)
        if not any(term.is_Mul and term.args[0] == -1 and any(_multiplied_out(*term.as_coeff_Mul())) for term in others):
            return str(super()._print_Add(total, order=order))
        text = str(self._print(first))
        for term in others:  # a minus between terms is that of the whole product
            minus = term.is_Mul and term.args[0] == -1
            added = self.parenthesize(-term if minus else term, PRECEDENCE["Add"])
            text += f" - {added}" if minus else f" - {added[1:]}" if added.startswith("-") else f" + {added}"
        return text

    def _call(self, name: str, arguments: Any) -> str:
        return f"{name}({', '.join(self._print(argument) for argument in arguments)})"

    def _print_Abs(self, call: Any) -> str:
        return self._call(call.func.__name__.lower(), call.args)

    _print_Max = _print_Min = _print_Abs

    def _print_Defined(self, call: Any) -> str:
        value, *others = call.args
        return (
            " + ".join([f"({self._print(value)}", *("0*" + self.parenthesize(other, PRECEDENCE["Mul"]) for other in others)]) + ")"
        )

    def _print_Latch(self, call: Any) -> str:
        on, off, start = call.args
        conditions = ", ".join(self._print(condition_of(of)) for of in (on, off))
        return f"latch({conditions}, start=1)" if start == 1 else f"latch({conditions})"

    def _print_Heaviside(self, call: Any) -> str:
        return self._call("heaviside", call.args[:1])

    def _print_Piecewise(self, cases: Any) -> str:
        *branches, (last, _) = cases.args
        text: str = self._print(last)
        for value, condition in reversed(branches):
            text = f"where({self._print(condition)}, {self._print(value)}, {text})"
        return text

    def _joined(self, word: str, condition: Any) -> str:
        parts = (
            f"({self._print(part)})" if part.is_Boolean and not part.is_Relational else self._print(part) for part in condition.args
        )
        return f" {word} ".join(parts)

    def _print_And(self, condition: Any) -> str:
        return self._joined("and", condition)

    def _print_Or(self, condition: Any) -> str:
        return self._joined("or", condition)

    def _print_Not(self, condition: Any) -> str:
        return f"not ({self._print(condition.args[0])})"

    def _print_Relational(self, comparison: Any) -> str:
        if isinstance(comparison.lhs, Latch):  # as a condition
            return str(self._print(comparison.lhs))
        return f"{self._print(comparison.lhs)} {comparison.rel_op} {self._print(comparison.rhs)}"


def _multiplied_out(number: Any, rest: Any) -> tuple[bool, bool]:
    """Whether a number would be multiplied into a sum behind it, above or below, where a product is read from left to right."""
    if number == 1 or not number.is_finite:
        return False, False
    divisors = [one for one in rest.as_ordered_factors() if one.is_Pow and one.exp.as_coeff_Mul()[0] < 0]
    factors = [one for one in rest.as_ordered_factors() if one not in divisors]
    above = bool(factors and factors[0].is_Add and rest.is_Mul) and not (number.is_Rational and number.p == 1)
    below = bool(divisors and divisors[0].base.is_Add and divisors[0].exp == -1) and number.is_Rational and number.q != 1
    return above, below


_PRINTER = _EquationPrinter()


def to_text(expression: Any) -> str:
    """The expression in the language of equations."""
    text = str(_PRINTER.doprint(sympy.sympify(expression)))
    return text[1:-1] if isinstance(expression, Defined) else text


def in_words(expression: Any, sides: Mapping[Any, Any]) -> Any:
    """The expression without `Select` and sides; `sides` has what is zero on each surface by the symbol of its side."""
    if not reads(expression, sides) and not expression.has(Select):
        return expression

    def change(part: Any, now: Any) -> Any:
        if isinstance(part, Select):
            return cases(now.args[1], _condition(part.args[0], sides, made), now.args[2]) if isinstance(now, Select) else now
        return sympy.sign(sides[part]) if part in sides else now

    made: dict[Any, Any] = {}
    return rebuilt(expression, change, made)


def _condition(condition: Any, sides: Mapping[Any, Any], made: Mapping[Any, Any]) -> Any:
    """When what a branch goes by is positive."""
    if condition.is_number:
        return sympy.true if condition.is_positive else sympy.false
    if condition in sides:
        return sympy.StrictGreaterThan(sides[condition], 0, evaluate=False)
    if -condition in sides:
        return sympy.StrictLessThan(sides[-condition], 0, evaluate=False)
    if isinstance(condition, Select):
        first, a, b = condition.args
        holds = _condition(first, sides, made)
        if is_number(a, -1) and is_number(b, 1):
            return sympy.Not(holds, evaluate=False)
        if is_number(b, -1):
            return sympy.And(holds, _condition(a, sides, made), evaluate=False)
        if is_number(a, 1):
            return sympy.Or(holds, _condition(b, sides, made), evaluate=False)
    return sympy.StrictGreaterThan(made.get(condition, condition), 0, evaluate=False)
