"""The functions of one argument that equations may have: the one table of their values, derivatives and domains.

What reads formulas, differentiates them, interprets them or looks for their limits takes the functions from here, so that a further
one is a further row; `fisherpoint.math` has it for users.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True, kw_only=True)
class Function:
    """A function of x. The texts are formulas, in x; `slope` may also have y, the value of the function at x.

    Attributes
    ----------
    name : str
        In equations, in the core, and in mpmath.
    value : callable
        Its value at a number.
    arrays : callable
        Its values at an array; at complex ones too, unless it has a kink or jump.
    sympy : str
        Its name in SymPy.
    slope : str
        Its derivative; empty where that is zero.
    built : str
        The function by others, where the core has no operation for it.
    symmetry : {"", "odd", "even"}
    at_zero : {"", "kink", "jump"}
    partial : bool
        Whether there are numbers at which it has no finite value: a product of it and zero may be NaN.
    positive, nonzero : tuple of str
        What must be positive, and what other than zero, so that it has a value.
    of_number : bool
        Whether its argument has no unit.
    slow_far_out : bool
        Whether many digits of its value at a large number take long.
    """

    name: str
    value: Callable[[float], float]
    arrays: Callable[[Any], Any]
    sympy: str
    slope: str
    built: str = ""
    symmetry: str = ""
    at_zero: str = ""
    partial: bool = False
    positive: tuple[str, ...] = ()
    nonzero: tuple[str, ...] = ()
    of_number: bool = True
    slow_far_out: bool = False


def _row(name: str, slope: str, **further: Any) -> Function:
    """A function that Python, NumPy and SymPy call by its name, unless another one is given."""
    known: dict[str, Any] = {"value": getattr(math, name, None), "arrays": getattr(np, name, None), "sympy": name}
    return Function(name=name, slope=slope, **known | further)


FUNCTIONS = (  # the core has their operations in this order
    _row("sqrt", "0.5 / y", partial=True, of_number=False),
    _row("exp", "y", partial=True, slow_far_out=True),
    _row("log", "1 / x", partial=True, positive=("x",), of_number=False),
    _row("sin", "cos(x)", symmetry="odd", slow_far_out=True),
    _row("cos", "-sin(x)", symmetry="even", slow_far_out=True),
    _row("tan", "1 + y*y", symmetry="odd", partial=True, nonzero=("cos(x)",), slow_far_out=True),
    # As a product: no cancellation near |x| = 1.
    _row("asin", "1 / sqrt((1 - x)*(1 + x))", arrays=np.arcsin, symmetry="odd", partial=True, positive=("1 - x", "1 + x")),
    _row("acos", "-(1 / sqrt((1 - x)*(1 + x)))", arrays=np.arccos, partial=True, positive=("1 - x", "1 + x")),
    _row("atan", "1 / (1 + x*x)", arrays=np.arctan, symmetry="odd"),
    _row("sinh", "cosh(x)", symmetry="odd", partial=True, slow_far_out=True),
    _row("cosh", "sinh(x)", symmetry="even", partial=True, slow_far_out=True),
    _row("tanh", "1 - y*y", symmetry="odd", slow_far_out=True),
    _row("abs", "where(x > 0, 1, -1)", value=abs, sympy="Abs", symmetry="even", at_zero="kink", of_number=False),
    _row("sign", "", value=np.sign, symmetry="odd", at_zero="jump", of_number=False),
    _row(
        "heaviside",
        "",
        value=lambda x: float(x > 0),
        arrays=lambda x: np.heaviside(x, 0.0),
        sympy="Heaviside",
        built="where(x > 0, 1, 0)",
        at_zero="jump",
        of_number=False,
    ),
)
