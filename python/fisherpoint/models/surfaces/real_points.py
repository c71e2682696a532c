"""Whether f jumps on a surface, seen at real points of it: what is proved there needs no digits and no cases.

At a point of the surface all other sides are what they are, so that two values of f which differ there are a jump of f. Equal
values prove nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

import numpy as np

from ...basics.values import Array
from .branches import Branches, Surface
from .evaluate import Evaluator

_POINTS = 24
"""How many points are looked for."""
_ENOUGH = 3
"""At how many of them, and at least half of those where values differ at all, the differences are steady where there is a jump."""
_FACTORS = np.array([[0.0], [1.0], [2.0]])
"""Factors of a state, which show whether a surface is a straight line in it."""
_STEPS, _AT_REST = 40, 1e-14
_ASIDE = 1e-7
"""By how much of itself every number is changed: differences that are rounding, or vanish on the surface, change with it."""
_DIFFERENT, _STEADY, _STRAIGHT = 1e-6, 1e-2, 1e-12


class RealPoints:
    """Values of expressions at random real points of surfaces.

    Parameters
    ----------
    expressions : sequence of sympy.Expr
        Those that may jump.
    branches : Branches
    states : sequence of sympy.Symbol
    numbers : mapping of sympy.Symbol to number
        Known constants.
    positive : collection of sympy.Symbol
        What is positive wherever f has a value.
    conditions : sequence of sympy.Expr
        What else is positive.
    """

    def __init__(
        self,
        expressions: Sequence[Any],
        branches: Branches,
        states: Sequence[Any],
        numbers: Mapping[Any, Any],
        positive: Collection[Any],
        conditions: Sequence[Any],
    ) -> None:
        self._surfaces, self._states, self._positive = branches.surfaces, states, positive
        self._all = Evaluator([*expressions, *conditions, *(one.expression for one in self._surfaces)])
        self._conditions = self._all.only(conditions)
        self._heights = {one: self._all.only([one.expression]) for one in self._surfaces}
        self._seconds = {side: second for second, side in branches.seamless.items()}
        self._numbers = {symbol: np.full(_POINTS, float(value)) for symbol, value in numbers.items()}

    @np.errstate(all="ignore")
    def jumps(self, surface: Surface, reading: Sequence[Any]) -> bool:
        """Whether one of the expressions that read the surface's side is found to differ between both sides."""
        rng = np.random.default_rng(0)
        of = self._all.only(reading)
        read = set(of.symbols).union(self._conditions.symbols, *(height.symbols for height in self._heights.values()))
        sides = {one.side for one in self._surfaces} | set(self._seconds.values())
        values = dict(self._numbers)
        for symbol in sorted(read - sides - values.keys(), key=str):
            values[symbol] = self._drawn(symbol, rng)
        height = self._height(surface)
        for unknown in self._unknowns(surface, height, values):
            root, found = self._root(height, values, unknown)
            on = values | {unknown: root}
            found = found & self._allowed(on)
            if np.count_nonzero(found) < _ENOUGH:
                continue
            aside = {
                one: at if one in self._numbers else at * (1 + _ASIDE * rng.choice([-1, 1], _POINTS)) for one, at in on.items()
            }
            aside[unknown] = root + _ASIDE * values[unknown]
            differences, sizes = self._differences(surface, of, on)
            different = found & (np.abs(differences) > _DIFFERENT * sizes)
            if not (different.sum(axis=1) >= _ENOUGH).any():
                continue
            changes = np.abs(self._differences(surface, of, aside)[0] - differences)
            steady = changes < _STEADY * np.abs(differences)
            proved = (different & steady).sum(axis=1)
            if bool(((proved >= _ENOUGH) & (2 * proved >= different.sum(axis=1))).any()):
                return True
        return False

    def _allowed(self, values: Mapping[Any, Array]) -> Any:
        """Where all conditions hold."""
        heights = [np.broadcast_to(np.real(height), _POINTS) for height in self._conditions(values)]
        return np.all([height > 0 for height in heights], axis=0) if heights else np.ones(_POINTS, dtype=bool)

    def _drawn(self, symbol: Any, rng: np.random.Generator) -> Array:
        size = 10.0 ** np.where(rng.random(_POINTS) < 0.5, rng.uniform(-1, 1, _POINTS), rng.uniform(-8, 8, _POINTS))
        return size if symbol in self._positive else size * rng.choice([-1.0, 1.0], _POINTS)

    def _height(self, surface: Surface) -> Callable[[Mapping[Any, Array]], Array]:
        """What is zero on the surface, by values of symbols; sides that it reads are those at the point."""
        read = set(self._heights[surface].symbols)
        before: list[Surface] = []
        for one in reversed(self._surfaces[: self._surfaces.index(surface)]):
            if not read.isdisjoint({one.side, self._seconds[one.side]}):
                read.update(self._heights[one].symbols)
                before.insert(0, one)

        def height(values: Mapping[Any, Array]) -> Array:
            known = dict(values)
            for one in (*before, surface):
                found = np.asarray(self._heights[one](known)[0])
                self._set(known, one, _sign(found))
            return found

        return height

    def _unknowns(self, surface: Surface, height: Callable[..., Array], values: Mapping[Any, Array]) -> list[Any]:
        """Two states to be solved for, first those in which the surface is a straight line."""
        read = set(self._heights[surface].symbols)

        def bent(state: Any) -> bool:
            along = height({**values, state: values[state] * _FACTORS})
            low, middle, high = np.broadcast_to(along, (len(_FACTORS), _POINTS))
            size = np.maximum(np.abs(low), np.abs(high))
            seen = np.abs(high - low) > _DIFFERENT * size
            return not (seen.any() and (np.abs(low + high - 2 * middle) <= _STRAIGHT * size)[seen].all())

        return sorted((state for state in self._states if state in read), key=bent)[:2]

    def _root(self, height: Callable[..., Array], values: Mapping[Any, Array], unknown: Any) -> tuple[Array, Any]:
        """Values of the unknown for which the surface is zero, by secants, and where they are found."""
        before, z = values[unknown], values[unknown] * (1 + 1 / 97)
        h_before, h = (height({**values, unknown: at}) for at in (before, z))
        for _ in range(_STEPS):
            step = np.where(h == 0, 0.0, h * (z - before) / (h - h_before))
            rest = np.abs(step) <= _AT_REST * np.abs(z)
            if (rest | ~np.isfinite(step)).all():
                break
            before, z, h_before = z, np.where(rest, z, z - step), h
            h = height({**values, unknown: z})
        return z, np.isfinite(h) & rest

    def _set(self, known: dict[Any, Any], surface: Surface, side: Array, second: Array | None = None) -> None:
        known[surface.side], known[self._seconds[surface.side]] = side, side if second is None else second

    def _differences(self, surface: Surface, of: Evaluator, values: Mapping[Any, Array]) -> tuple[Array, Array]:
        """Differences of expressions between both sides of the surface, and their sizes; other sides are those at the point."""
        sides = []
        for sign in (1.0, -1.0):
            known = dict(values)
            self._set(known, surface, np.full(_POINTS, sign), np.ones(_POINTS))
            for one, height in self._heights.items():
                if one is not surface:
                    self._set(known, one, _sign(np.broadcast_to(height(known)[0], _POINTS)))
            sides.append(np.array([np.broadcast_to(np.real(value), _POINTS) for value in of(known)]))
        above, below = sides
        return above - below, np.maximum(np.abs(above), np.abs(below))


def _sign(height: Array) -> Array:
    return np.where(height == 0, np.nan, np.sign(height))
