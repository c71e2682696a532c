"""A branch as a SymPy function: Select(c, a, b) is a where c > 0, else b, which may have no value where it is not taken.

Guards are the conditions under which a branch is taken.
"""

from __future__ import annotations

from typing import Any

import sympy


class Select(sympy.Function):  # type: ignore[misc]
    """Select(c, a, b): a where c > 0, else b."""

    nargs = 3

    @classmethod
    def eval(cls, condition: Any, a: Any, b: Any) -> Any:
        if condition.is_number and condition.is_extended_real:
            return a if condition.is_positive else b
        return a if a == b else None

    def _eval_rewrite_as_Piecewise(self, condition: Any, a: Any, b: Any, **_: Any) -> Any:
        return sympy.Piecewise((a, condition > 0), (b, True))

    def _eval_derivative(self, symbol: Any) -> Any:
        condition, a, b = self.args
        return Select(condition, a.diff(symbol), b.diff(symbol))

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        condition, a, b = (printer._print(argument) for argument in self.args)
        cases = rf"\begin{{cases}} {a} & \text{{for}}\: {condition} > 0 \\ {b} & \text{{otherwise}} \end{{cases}}"
        return cases if exp is None else rf"\left({cases}\right)^{{{exp}}}"


Guards = tuple[tuple[Any, bool], ...]
"""Conditions, and whether each holds."""


def guards_of(condition: Any, holds: bool) -> Guards:
    """What holds, or does not, where a condition does or does not: of "a and b" that holds, a and b."""
    if isinstance(condition, Select):
        first, *branches = condition.args
        for taken, other in ((True, branches[1]), (False, branches[0])):
            if other.is_number and (other > 0) != holds:  # so the first went the other way
                rest = branches[0] if taken else branches[1]
                return (*guards_of(first, taken), *(() if rest.is_number else guards_of(rest, holds)))
    return ((condition, holds),)
