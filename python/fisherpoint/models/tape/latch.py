"""A condition that holds its side until another one releases it."""

from __future__ import annotations

from typing import Any

import sympy

from .parts import cases, compared


class Latch(sympy.Function):  # type: ignore[misc]
    """Latch(on, off, start): 1 from when `on` is positive, 0 from when `off` is, which wins where both are; at first `start`."""

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        on, off, _ = (printer._print(condition_of(of)) for of in self.args)
        value = rf"\operatorname{{latch}}\left({on},\ {off}\right)"
        return value if exp is None else rf"{value}^{{{exp}}}"


def latched(on: Any, off: Any, start: int) -> Latch:
    """The latch of two conditions."""
    return Latch(holds(on), holds(off), sympy.Integer(start))


def holds(condition: Any) -> Any:
    """1 where a condition holds, else 0."""
    return cases(sympy.S.One, condition, sympy.S.Zero)


def as_condition(value: Any) -> Any:
    """A latch as the condition that it is set; anything else as it is."""
    return compared(sympy.StrictGreaterThan, value, sympy.S.Half) if isinstance(value, Latch) else value


def condition_of(of: Any) -> Any:
    """What `holds` was made of; a number as it is."""
    return of.args[0][1] if isinstance(of, sympy.Piecewise) else of
