"""Functions for the equations of a model: ``fp.math.sqrt(x.h)``, on the symbols that a model function receives, or on numbers.

They need SymPy. The same functions, under the same names, may be used in equations as text.

Arguments are terms of equations or numbers; anything else raises TypeError or ValueError. Where a function is not smooth or not
defined, the core ends its steps there or ends the trajectory: see the statuses.
"""

from typing import Any

from .functions import FUNCTIONS as _FUNCTIONS

__all__ = [
    "abs",
    "acos",
    "asin",
    "atan",
    "atan2",
    "cos",
    "cosh",
    "delay",
    "exp",
    "heaviside",
    "latch",
    "log",
    "max",
    "min",
    "sign",
    "sin",
    "sinh",
    "sqrt",
    "tan",
    "tanh",
    "where",
]


def abs(x: Any) -> Any:
    """Absolute value; a kink at 0."""
    return _FUNCTIONS["abs"](x)


def acos(x: Any) -> Any:
    """Inverse cosine, rad, of -1 to 1."""
    return _FUNCTIONS["acos"](x)


def asin(x: Any) -> Any:
    """Inverse sine, rad, of -1 to 1."""
    return _FUNCTIONS["asin"](x)


def atan(x: Any) -> Any:
    """Inverse tangent, rad."""
    return _FUNCTIONS["atan"](x)


def atan2(y: Any, x: Any) -> Any:
    """Angle, rad, of the point (x, y)."""
    return _FUNCTIONS["atan2"](y, x)


def cos(x: Any) -> Any:
    """Cosine of an angle in rad."""
    return _FUNCTIONS["cos"](x)


def cosh(x: Any) -> Any:
    """Hyperbolic cosine."""
    return _FUNCTIONS["cosh"](x)


def delay(u: Any, tau: Any) -> Any:
    """The input u as it was the dead time tau before: a parameter, a known constant, or a number, s."""
    return _FUNCTIONS["delay"](u, tau)


def exp(x: Any) -> Any:
    """Exponential function."""
    return _FUNCTIONS["exp"](x)


def heaviside(x: Any) -> Any:
    """0 up to 0 itself and 1 above; a jump at 0."""
    return _FUNCTIONS["heaviside"](x)


def latch(on: Any, off: Any, start: int = 0) -> Any:
    """1 from when the condition `on` holds until `off` does, which wins where both hold; `start` where neither does at first.

    A relay with two thresholds is ``latch(x.T < 20, x.T > 22)``. It is a number and a condition. Rates and resets read it; outputs
    and limits do not, which take a state that `resets` set.
    """
    return _FUNCTIONS["latch"](on, off, start)


def log(x: Any) -> Any:
    """Natural logarithm of what is positive."""
    return _FUNCTIONS["log"](x)


def max(*x: Any) -> Any:
    """The largest of two or more; a kink where it changes."""
    return _FUNCTIONS["max"](*x)


def min(*x: Any) -> Any:
    """The smallest of two or more; a kink where it changes."""
    return _FUNCTIONS["min"](*x)


def sign(x: Any) -> Any:
    """-1 below 0, 0 at 0 and 1 above; a jump at 0."""
    return _FUNCTIONS["sign"](x)


def sin(x: Any) -> Any:
    """Sine of an angle in rad."""
    return _FUNCTIONS["sin"](x)


def sinh(x: Any) -> Any:
    """Hyperbolic sine."""
    return _FUNCTIONS["sinh"](x)


def sqrt(x: Any) -> Any:
    """Square root of what is positive."""
    return _FUNCTIONS["sqrt"](x)


def tan(x: Any) -> Any:
    """Tangent of an angle in rad."""
    return _FUNCTIONS["tan"](x)


def tanh(x: Any) -> Any:
    """Hyperbolic tangent."""
    return _FUNCTIONS["tanh"](x)


def where(condition: Any, a: Any, b: Any) -> Any:
    """a where the condition, a comparison or several joined by &, | and ~, holds, else b; a jump, or a kink where a equals b."""
    return _FUNCTIONS["where"](condition, a, b)
