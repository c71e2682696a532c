"""Where states are set anew."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Reset:
    """States that get new values where a condition becomes true.

    Attributes
    ----------
    condition : sympy.Expr
        Positive where it holds.
    values : tuple of (sympy.Symbol, sympy.Expr)
        States with what they are set to.
    by_level : bool
        Whether it counts at a start too where its condition holds.
    """

    condition: Any
    values: tuple[tuple[Any, Any], ...]
    by_level: bool = False
