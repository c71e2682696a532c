"""Coefficients of numbers/elementary.hpp: best polynomials by Remez' exchange of nodes, and constants cut into parts.

Printed are arrays of C++, lowest power first, and of each the largest error, relative to the function. What is fitted is the
factor of the highest known power: in exp(r) = 1 + r + r^2 / 2 + r^3 q(r) it is q, so that coefficients which are exact stay so.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import mpmath as mp

mp.mp.prec = 300

Real = Any
Function = Callable[[Real], Real]


def best(target: Function, weight: Function, low: Real, high: Real, degree: int, rounds: int = 12) -> list[float]:
    """Coefficients, as doubles, of the polynomial with the least largest error of weight * (polynomial - target) on [low, high]."""
    middle, half, count = (low + high) / 2, (high - low) / 2, degree + 2
    nodes = [middle - half * mp.cos(mp.pi * k / (count - 1)) for k in range(count)]
    coefficients: Any = None
    for _ in range(rounds):
        rows = [[x**k for k in range(degree + 1)] + [(-1) ** i / weight(x)] for i, x in enumerate(nodes)]
        solved = mp.lu_solve(mp.matrix(rows), mp.matrix([target(x) for x in nodes]))
        coefficients = [solved[k] for k in range(degree + 1)]
        nodes = _extremes(lambda x, c=coefficients: weight(x) * (mp.polyval(c[::-1], x) - target(x)), low, high, nodes)  # type: ignore[misc]
    return [float(c) for c in coefficients]


def _extremes(error: Function, low: Real, high: Real, nodes: list[Real]) -> list[Real]:
    """Where the error is largest between its changes of sign, which lie between the nodes."""
    zeros = [mp.findroot(error, (a, b), solver="anderson", tol=1e-60, verify=False) for a, b in pairwise(nodes)]
    ends = [low, *zeros, high]
    return [_largest(error, a, b) for a, b in pairwise(ends)]


def _largest(error: Function, a: Real, b: Real) -> Real:
    """By golden sections; ends included, where the error may be largest without a slope of zero."""
    golden = (mp.sqrt(5) - 1) / 2
    left, right = a, b
    for _ in range(60):
        one, other = right - golden * (right - left), left + golden * (right - left)
        if abs(error(one)) > abs(error(other)):
            right = other
        else:
            left = one
    return max((a, b, (left + right) / 2), key=lambda x: abs(error(x)))


def largest(error: Function, low: Real, high: Real) -> float:
    """The largest error on a fine grid."""
    return float(max(abs(error(low + (high - low) * k / 2000)) for k in range(2001)))


def cut(value: Real, bits: list[int]) -> list[float]:
    """Parts of a constant: so many bits each, but the last, which is what is left."""
    parts = []
    for count in bits:
        scale = mp.ldexp(1, count - 1 - int(mp.floor(mp.log(abs(value), 2))))
        parts.append(float(mp.floor(value * scale) / scale))
        value -= parts[-1]
    return [*parts, float(value)]


def show(name: str, numbers: list[float], error: float | None = None) -> None:
    """Print an array."""
    print(f"constexpr double {name}[] = {{{', '.join(map(float.hex, numbers))}}};", "" if error is None else f"// {error:.1e}")


def polynomial(numbers: list[float]) -> Function:
    """The polynomial with these coefficients."""
    return lambda x: mp.polyval([mp.mpf(c) for c in numbers[::-1]], x)


def main() -> None:
    """Print all."""
    show("log_2", cut(mp.log(2), [42]))
    show("half_pi", cut(mp.pi / 2, [36, 36, 36]))

    end, tiny = mp.log(2) / 2 * (1 + mp.mpf(2) ** -20), mp.mpf(2) ** -40
    # Relative to exp(r) - 1, from which hyperbolic functions are made.
    q = best(lambda r: (mp.expm1(r) - r - r**2 / 2) / r**3, lambda r: r**3 / mp.expm1(r), tiny - end, end, 9)
    show("exp_q", q, largest(lambda r: (r + r**2 / 2 + r**3 * polynomial(q)(r)) / mp.expm1(r) - 1, tiny - end, end))

    # log((1 + s) / (1 - s)) = 2 s + s^3 p(s^2)
    end = ((mp.sqrt(2) - 1) / (mp.sqrt(2) + 1)) ** 2 * (1 + mp.mpf(2) ** -20)
    p = best(lambda z: (2 * mp.atanh(mp.sqrt(z)) / mp.sqrt(z) - 2) / z, lambda z: z / 2, tiny, end, 6)
    show("log_p", p, largest(lambda z: (2 + z * polynomial(p)(z)) * mp.sqrt(z) / (2 * mp.atanh(mp.sqrt(z))) - 1, tiny, end))

    # sin r = r + r^3 s(r^2), cos r = 1 - r^2 / 2 + r^4 c(r^2)
    end = (mp.pi / 4) ** 2 * (1 + mp.mpf(2) ** -15)
    s = best(lambda z: (mp.sinc(mp.sqrt(z)) - 1) / z, lambda z: z / mp.sinc(mp.sqrt(z)), tiny, end, 6)
    show("sin_s", s, largest(lambda z: (1 + z * polynomial(s)(z)) / mp.sinc(mp.sqrt(z)) - 1, tiny, end))
    c = best(lambda z: (mp.cos(mp.sqrt(z)) - 1 + z / 2) / z**2, lambda z: z**2 / mp.cos(mp.sqrt(z)), tiny, end, 5)
    show("cos_c", c, largest(lambda z: (1 - z / 2 + z**2 * polynomial(c)(z)) / mp.cos(mp.sqrt(z)) - 1, tiny, end))


if __name__ == "__main__":
    main()
