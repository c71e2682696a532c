"""Inputs with a dead time in expressions, as symbols that are called as equations have them: delay(u, tau)."""

from __future__ import annotations

import re

import sympy

_WRITTEN = re.compile(r"delay\((\w+), (\S+)\)")


def delayed(name: str, time: str | float) -> sympy.Symbol:
    """The symbol of an input with a dead time, which is the name of a quantity or a number."""
    return sympy.Symbol(f"delay({name}, {time})", real=True)


def delay_in(symbol: sympy.Symbol) -> tuple[str, str | float] | None:
    """The names of the input and of its dead time, or its value; None of another symbol."""
    found = _WRITTEN.fullmatch(symbol.name)
    if not found:
        return None
    time = found[2]
    return found[1], time if time[0].isalpha() or time[0] == "_" else float(time)
