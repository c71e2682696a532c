"""Where expressions are zero: when two of them are zero together, and whether one vanishes where another does."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import sympy

from .evaluate import evaluate

_POINTS, _NEGLIGIBLE, _ROUNDING = 12, 1e-8, 1e-11


def normal_form(expression: Any) -> tuple[Any, int]:
    """Return what is the same for all non-zero multiples of an expression, and the sign of the multiple, 1 or -1.

    Factors that are positive whatever their symbols are do not count.
    """
    factors = [factor for factor in sympy.Mul.make_args(expression) if not (factor.is_positive and not factor.is_Number)]
    coefficient, rest = sympy.Mul(*factors).as_coeff_Mul()
    terms = rest.as_coefficients_dict()
    first = min(terms, key=sympy.default_sort_key)
    scale = float(terms[first])
    form = frozenset((term, float(f"{float(factor) / scale:.12e}")) for term, factor in terms.items())
    return form, 1 if float(coefficient) * scale > 0 else -1


def reduced(expression: Any) -> tuple[Any, int]:
    """Return the expression without numerical factor and without positive factors, and the sign that was taken out."""
    factors = [factor for factor in sympy.Mul.make_args(expression) if not factor.is_positive]
    coefficient, rest = sympy.Mul(*factors).as_coeff_Mul()
    if rest == 1:
        return expression, 1
    sign = -1 if coefficient < 0 else 1
    rest = rest.primitive()[1]
    if rest.is_Add and sum(bool(term.could_extract_minus_sign()) for term in rest.args) == len(rest.args):
        rest, sign = -rest, -sign
    return rest, sign


def vanish_on(differences: Sequence[tuple[Any, Any]], surface: Any, states: Sequence[Any]) -> bool:
    """Whether a = b for every pair (a, b) where the surface is zero: exactly where that is seen at once, else at random points."""
    undecided = [(a, b) for a, b in differences if not _cancel(a - b, surface, states)]
    if not undecided:
        return True
    rng = np.random.default_rng(0)
    symbols = sorted(set().union(surface.free_symbols, *(side.free_symbols for pair in undecided for side in pair)), key=str)
    decided = 0
    for _ in range(_POINTS):
        values = {symbol: _random(symbol, rng) for symbol in symbols}
        beside = _pairs(undecided, values)
        if not _move_onto(surface, values, states):
            continue
        on = _pairs(undecided, values)
        if not np.isfinite(on).all():
            continue
        decided += 1
        # What is beside the surface tells what is small on it.
        size = _NEGLIGIBLE * np.abs(np.diff(beside)[:, 0]) + _ROUNDING * np.abs(beside).sum(axis=1)
        if (np.abs(np.diff(on)[:, 0]) > np.nan_to_num(size)).any():
            return False
    return decided > 0  # where no point is found, the worse is assumed


def _pairs(pairs: Sequence[tuple[Any, Any]], values: dict[Any, Any]) -> Any:
    return np.array(evaluate([side for pair in pairs for side in pair], values), dtype=complex).reshape(-1, 2)


def _cancel(difference: Any, surface: Any, states: Sequence[Any]) -> bool:
    """Whether the difference is seen to vanish when a symbol that enters the surface linearly is replaced by its value on it."""
    for unknown in (state for state in states if state in surface.free_symbols):
        slope = surface.diff(unknown)
        if slope == 0 or unknown in slope.free_symbols:
            continue
        on_surface = difference.xreplace({unknown: -surface.xreplace({unknown: sympy.S.Zero}) / slope})
        return bool(on_surface == 0 or (on_surface.is_Add and sympy.expand(on_surface, power_base=False, multinomial=False) == 0))
    return False


def _random(symbol: Any, rng: np.random.Generator) -> complex:
    if isinstance(symbol, sympy.Dummy):  # the side of another surface
        return float(rng.choice([-1.0, 1.0]))
    return complex(rng.uniform(0.3, 2.0), rng.uniform(-0.5, 0.5))


def _move_onto(surface: Any, values: dict[Any, Any], states: Sequence[Any]) -> bool:
    """Change one state so that the surface is zero, by secants; whether that worked."""
    for unknown in (state for state in states if state in surface.free_symbols):

        def height(z: complex, unknown: Any = unknown) -> complex:
            return complex(evaluate([surface], values | {unknown: z})[0])

        before, z = values[unknown], values[unknown] * 1.01
        h_before, h = height(before), height(z)
        size = abs(h_before) + abs(h)
        for _ in range(60):
            if not np.isfinite(h) or h == h_before:
                break
            before, z, h_before = z, z - h * (z - before) / (h - h_before), h
            h = height(z)
        if np.isfinite(h) and abs(h) <= 1e-12 * size:
            values[unknown] = z
            return True
    return False
