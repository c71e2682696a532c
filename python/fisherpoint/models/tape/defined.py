"""Values with what they were written of: SymPy makes sqrt(e)*sqrt(e) into e, which has a value where the roots have none."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import sympy

from .parts import contain, rebuilt


class Defined(sympy.Function):  # type: ignore[misc]
    """Defined(a, b, ...): a, which has a value where b and the others have one too."""

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        value = str(printer._print(self.args[0]))
        return value if exp is None else rf"\left({value}\right)^{{{exp}}}"

    def _eval_derivative(self, symbol: Any) -> Any:
        value, *others = self.args
        return Defined(value.diff(symbol), *others)


def defined(value: Any, others: Iterable[Any]) -> Any:
    """The value, where all others have one."""
    return Defined(value, *dict.fromkeys(others)) if others else value


def value_of(expression: Any) -> Any:
    """The expression without what it was written of beside."""
    return values_of([expression])[0]


def values_of(expressions: Iterable[Any]) -> list[Any]:
    """Expressions without what they were written of beside."""
    written, made = list(expressions), dict[Any, Any]()
    if not contain(written, Defined):
        return written
    return [rebuilt(one, lambda _, now: now.args[0] if isinstance(now, Defined) else now, made) for one in written]
