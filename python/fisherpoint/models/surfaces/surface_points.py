"""Random points on a surface, and whether expressions are equal there."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import sympy

from ..tape.parts import symbols_of
from .precise import Calculation, Value, Work, digits

Pairs = list[tuple[Any, Any]]

_STEPS, _AT_REST = 100, 1e-50
_ASIDE = 1e-20
"""How far beside a point it is seen what is small at the point, as a part of the unknown."""
_SMALL = 1e-15
"""What is zero on the surface is smaller there than aside by this factor: the powers of a distance of 1e-60 from 3/8 on."""
_ROUNDING = 1e-45
_ROUNDED, _ROUNDINGS = 2.0**-50, 64
"""By how much a double is changed to see what its rounding does, and how often that may be a difference."""


class SurfacePoints:
    """Points where `surface` is zero, at which pairs of expressions are compared.

    Symbols are complex numbers, half of them within a decade of 1, the others within eight, of either sign but for the `positive`.
    """

    def __init__(self, pairs: Pairs, surface: Any, positive: Collection[Any], work: Work) -> None:
        expressions = [surface, *(side for pair in pairs for side in pair)]
        self._positive = positive
        self._calculation = Calculation(expressions, work)
        self._symbols = sorted(symbols_of(*expressions), key=str)
        self._rng = np.random.default_rng(0)
        self._changes = [
            {place: _ROUNDED * float(self._rng.choice([-1, 1]) * self._rng.uniform(0.5, 1)) for place in self._calculation.floats}
            for _ in range(2 if self._calculation.floats else 0)
        ]

    def around(self, unknown: Any) -> Iterator[tuple[bool, bool]]:
        """Whether roots are proper and all pairs are equal at up to two points, found by changing one unknown."""
        values = {symbol: self._drawn(symbol) for symbol in self._symbols}
        start = values[unknown]
        roots: list[Value] = []
        while len(roots) < 2 and (root := self._root(values, unknown, start, roots)) is not None:
            roots.append(root)
            values[unknown] = root
            (_, *on), proper = self._calculation(values)
            if all(value is not None for value in on):
                positive = unknown not in self._positive or root.real > 0
                yield proper and positive, self._same(on, values, unknown, start)

    def _drawn(self, symbol: Any) -> Value:
        if isinstance(symbol, sympy.Dummy):
            return digits.mpc(*self._rng.normal(size=2).tolist())
        size = 10.0 ** self._rng.uniform(*((-1, 1) if self._rng.random() < 0.5 else (-8, 8)))
        sign = 1.0 if symbol in self._positive else float(self._rng.choice([-1.0, 1.0]))
        return digits.mpc(sign * size, size * self._rng.uniform(-0.5, 0.5))

    def _root(self, values: Mapping[Any, Value], unknown: Any, start: Value, roots: Sequence[Value], changes: Any = None) -> Value:
        """A value of the unknown for which the surface is zero, by secants, other than the given ones; None where none is found."""

        def height(z: Value) -> Value:
            (h,), _ = self._calculation({**values, unknown: z}, changes, count=1)
            for root in roots:
                h = h / (z - root) if h is not None and z != root else None
            return h

        if height(nothing := digits.mpc(0)) == 0:
            return nothing
        before, z = start, start + (start or 1) / digits.mpf(97)
        h_before, h = height(before), height(z)
        for _ in range(_STEPS):
            if h is None or h_before is None:
                return None
            if h == 0:
                return z
            if h == h_before or abs(z - before) <= _AT_REST * abs(z):
                aside = height(z * (1 + digits.mpf(_ASIDE)))  # secants come to rest elsewhere too
                return z if aside is not None and abs(h) <= _SMALL * abs(aside - h) else None
            before, z, h_before = z, z - h * (z - before) / (h - h_before), h
            h = height(z)
        return None

    def _same(self, on: Sequence[Value], values: Mapping[Any, Value], unknown: Any, start: Value) -> bool:
        """Whether all pairs are equal but for what is small beside the surface, and for the rounding of numbers."""
        differences = [abs(a - b) for a, b in _paired(on)]
        small = [_ROUNDING * (abs(a) + abs(b)) for a, b in _paired(on)]
        if all(difference <= limit for difference, limit in zip(differences, small, strict=True)):
            return True
        root = values[unknown]
        (_, *aside), _ = self._calculation({**values, unknown: root + _ASIDE * (root or start)})
        for k, (a, b) in enumerate(_paired(aside)):
            small[k] += _SMALL * abs(a - b) if a is not None and b is not None else 0
        for changes in self._changes:
            moved = self._root(values, unknown, root, (), changes)
            if moved is None:
                continue
            (_, *changed), _ = self._calculation({**values, unknown: moved}, changes)
            for k, (a, b) in enumerate(_paired(changed)):
                small[k] += _ROUNDINGS * abs(abs(a - b) - differences[k]) if a is not None and b is not None else 0
        return all(difference <= limit for difference, limit in zip(differences, small, strict=True))


def _paired(values: Sequence[Value]) -> list[tuple[Value, Value]]:
    return list(zip(values[::2], values[1::2], strict=True))
