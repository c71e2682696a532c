"""Whether f jumps on a switching surface or has a kink there: the same on both sides, whatever else its symbols are."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
import sympy

from ..tape.branch import Select
from ..tape.parts import exact, is_number, reads, rebuilt, replaced, symbols_of
from .branches import Branches, Surface
from .precise import TooMuchWork, Work
from .real_points import RealPoints
from .surface_points import Pairs, SurfacePoints
from .zeros import normal_form

_WORK = 100_000
"""Operations in many digits for one model, a few seconds; what is not decided by then is taken for a jump."""
_POINTS = 8
"""At how many points of a surface expressions are compared."""
_OUTCOMES = 8
"""How many other branches are tried both ways in all combinations."""
_NESTED = 6
"""Number of outcomes for which a condition that reads other ones is looked at separately."""

_SIGNS = sympy.S.One, sympy.S.NegativeOne


def classified(
    rates: Sequence[Any],
    branches: Branches,
    states: Sequence[sympy.Symbol],
    constants: Mapping[Any, float],
    conditions: Sequence[Any] = (),
) -> list[Surface]:
    """Return the surfaces, each classified as a jump or a kink, jumps first.

    A surface is a kink where f, and every surface that reads its side, are the same on both sides of it: for all states, inputs and
    parameters, and for either outcome of all other branches, known constants being what they are. Where that is not decided, it is
    taken for a jump.

    Parameters
    ----------
    rates : sequence of expressions
        f as `branches` has rewritten it.
    branches : Branches
    states : sequence of symbols
    constants : mapping of symbol to number
    conditions : sequence of expressions, optional
        What is positive.
    """
    if not branches.surfaces:
        return []
    judge = _Judge(rates, branches, states, constants, conditions)
    classed = [replace(surface, jump=judge.jumps(surface)) for surface in branches.surfaces]
    classed = [replace(surface, crossable=surface.jump and not judge.moves_others(surface)) for surface in classed]
    return [surface for surface in classed if surface.jump] + [surface for surface in classed if not surface.jump]


class _Judge:
    def __init__(
        self,
        rates: Sequence[Any],
        branches: Branches,
        states: Sequence[sympy.Symbol],
        constants: Mapping[Any, float],
        conditions: Sequence[Any],
    ) -> None:
        self.states, self.branches = states, branches
        self.sides = {side: second for second, side in branches.seamless.items()}
        self.seamless = branches.seamless
        self.numbers = {symbol: exact(value) for symbol, value in constants.items()}
        self.surfaces = {surface.side: surface.expression for surface in branches.surfaces}
        self.everything = [(expression, symbols_of(expression)) for expression in (*rates, *self.surfaces.values())]
        self.conditions = conditions
        self.work = Work(_WORK)

    @cached_property
    def positive(self) -> set[Any]:
        """Symbols that are positive wherever f has a value."""
        declared = {condition for condition in self.conditions if condition.is_Symbol}
        return declared.union(*(_under_roots(expression) for expression, _ in self.everything))

    @cached_property
    def points(self) -> RealPoints:
        expressions = [expression for expression, _ in self.everything]
        return RealPoints(expressions, self.branches, self.states, self.numbers, self.positive, self.conditions)

    @cached_property
    def signs(self) -> dict[Any, int]:
        """Signs of forms that the user states to be positive or negative."""
        declared = (replaced(condition, self.numbers) for condition in self.conditions)
        return dict(normal_form(condition) for condition in declared if not condition.is_number)

    def jumps(self, surface: Surface) -> bool:
        """Whether f or another surface may jump there."""
        reading = [expression for expression, symbols in self.everything if surface.side in symbols]
        return bool(reading) and (self.points.jumps(surface, reading) or self._jump(surface, reading))

    def moves_others(self, surface: Surface) -> bool:
        """Whether another surface may jump there. What reads the side by min, max or abs alone does not."""
        of_surfaces = self.everything[-len(self.surfaces) :]
        return self._jump(surface, [expression for expression, symbols in of_surfaces if surface.side in symbols])

    def _jump(self, surface: Surface, reading: Sequence[Any]) -> bool:
        held = {**self.numbers, **self.seamless, self.sides[surface.side]: sympy.S.One}
        if not reading:
            return False
        outcomes = _Outcomes(self.surfaces, self.signs)
        columns = []
        for sign in _SIGNS:
            new, made = held | {surface.side: sign}, dict[Any, Any]()
            columns.append([outcomes.freed(replaced(expression, new, made)) for expression in reading])
        pairs = [_apart(a, b) for a, b in zip(*columns, strict=True) if a != b]
        made = {}
        zero = outcomes.freed(replaced(surface.expression, held, made))
        others = {
            side: outcomes.freed(replaced(self.surfaces[side], held, made))
            for side in _dummies(pairs, zero)
            if side in self.surfaces and not reads(self.surfaces[side], {surface.side})
        }
        try:
            return bool(pairs) and not self._same(pairs, zero, others)
        except (TooMuchWork, RecursionError):
            return True

    def _same(self, pairs: Pairs, surface: Any, others: Mapping[Any, Any]) -> bool:
        pairs, surface = self._with_known_sides(pairs, surface, others)
        open_ = _dummies(pairs, surface)
        if not open_:
            return self._same_for_outcome(pairs, surface)
        if self._differ_where_it_is_no_surface(pairs, surface):
            return False
        components = self._undecided(pairs, surface)
        # Not only 1 and -1, but anything in between: where that makes no difference, no outcome does.
        if all(self._vanish(undecided, factor, real=False) for factor, undecided in components):
            return True
        if len(open_) > _OUTCOMES:
            return False
        for signs in product(_SIGNS, repeat=len(open_)):
            outcome = dict(zip(open_, signs, strict=True))
            if not self._same_for_outcome(*_replaced(pairs, surface, outcome)):
                return False
        return True

    def _differ_where_it_is_no_surface(self, pairs: Pairs, surface: Any) -> bool:
        """Whether some outcome of other branches makes it zero everywhere, as heaviside(x)*x for x < 0, and pairs differ there."""
        read = _dummies([], surface)
        if len(read) > _OUTCOMES:
            return True
        outcomes = (dict(zip(read, signs, strict=True)) for signs in product(_SIGNS, repeat=len(read)))
        return any(left and is_number(zero, 0) for left, zero in (_replaced(pairs, surface, outcome) for outcome in outcomes))

    def _same_for_outcome(self, pairs: Pairs, surface: Any) -> bool:
        return all(self._vanish(undecided, factor, real=True) for factor, undecided in self._undecided(pairs, surface))

    def _with_known_sides(self, pairs: Pairs, surface: Any, others: Mapping[Any, Any]) -> tuple[Pairs, Any]:
        """With the sides of other surfaces put in where this surface lies on one side of them, as that of x - 2 where x = 1."""
        while True:
            solution = self._solution(surface)
            known: dict[Any, Any] = {}
            for side in _dummies(pairs, surface) if solution else ():
                if side in others and (sign := self._sign(replaced(others[side], solution), solution)):
                    known[side] = sympy.Integer(sign)
            if not known:
                return pairs, surface
            pairs, surface = _replaced(pairs, surface, known)
            others = {side: replaced(expression, known) for side, expression in others.items()}

    def _sign(self, value: Any, solution: Mapping[Any, Any]) -> int:
        """The sign of a value, 0 where it is not known."""
        if value.is_number:
            numbers = value.atoms(sympy.Number).union(*(new.atoms(sympy.Number) for new in solution.values()))
            size = max((abs(float(number)) for number in numbers), default=0.0)
            return int(np.sign(float(value))) if value.is_real and abs(float(value)) > 1e-12 * size else 0
        form, sign = normal_form(value)
        return sign * int(self.signs.get(form, 0))

    def _solution(self, surface: Any) -> dict[Any, Any]:
        """A state on the surface as an expression of the others, where that is all of the surface; else nothing."""
        for state in _in_order(self.states, surface):
            if (value := self._solved(surface, state)) is not None:
                return {state: value}
        return {}

    def _solved(self, surface: Any, state: Any) -> Any:
        """The value of a state that enters linearly, with a factor that no state enters."""
        rest, term = surface.as_independent(state, as_Add=True)
        slope, alone = term.as_independent(state, as_Add=False)
        if alone != state or reads(slope, self.states) or slope.has(Select):
            return None
        if any(reads(factor, _dummies([], slope)) and not factor.is_Symbol for factor in sympy.Mul.make_args(slope)):
            return None
        return -rest / slope

    def _undecided(self, pairs: Pairs, surface: Any) -> list[tuple[Any, Pairs]]:
        """The factors of what is zero on the surface, each with the pairs that are not seen at once to be equal there."""
        found = []
        for factor in sympy.Mul.make_args(surface):
            while isinstance(factor, sympy.Pow) and factor.exp.is_Number:
                factor = factor.base
            if reads(factor, self.states):
                solution, left = self._solution(factor), pairs
                if solution:
                    left = [(a, b) for a, b in pairs if not is_number(replaced(a - b, solution), 0)]
                if left:
                    found.append((factor, left))
        return found

    def _vanish(self, pairs: Pairs, surface: Any, real: bool) -> bool:
        """Whether a = b for all pairs wherever the surface is zero, at random complex points.

        An identity that holds there holds everywhere, but for the signs of roots: with `real`, points count where what stands under
        roots has a positive real part, if there are any.
        """
        points = SurfacePoints(pairs, surface, self.positive, self.work)
        unknowns = _in_order(self.states, surface)
        unknowns += sorted(symbols_of(surface) - set(unknowns) - set(_dummies([], surface)), key=str)
        of_states = sum(unknown in self.states for unknown in unknowns)
        found = {True: 0, False: 0}
        other = False
        for attempt in range(4 * max(_POINTS, of_states)):
            none = not any(found.values())
            if none and attempt >= _POINTS + 2 * len(unknowns):
                break
            # Others than states only where none of them leads to the surface.
            among = unknowns if none and attempt >= 2 * of_states else unknowns[:of_states]
            for proper, same in points.around(among[attempt % len(among)]):
                found[proper] += 1
                if not same and (proper or not real):
                    return False
                other |= not same
            if found[True] >= max(_POINTS, 2 * of_states):
                return True
        return found[True] > 0 or (found[False] > 0 and not other)


class _Outcomes:
    """Puts a symbol, which is 1 or -1, in place of every condition that the state does not enter.

    Parameters
    ----------
    sides : collection of sympy.Dummy
        Symbols for the sides of surfaces.
    signs : mapping of forms to 1 or -1
        Of conditions of which the sign is known.
    """

    def __init__(self, sides: Collection[Any], signs: Mapping[Any, int]) -> None:
        self.signs = signs
        self._symbols = set(sides)
        self._known: dict[Any, Any] = {}
        self._by_form: dict[Any, Any] = {}

    def freed(self, expression: Any) -> Any:
        """The expression in which all conditions are such symbols, sides, or chosen by them."""
        return rebuilt(expression, self._change, self._known)

    def _change(self, _: Any, part: Any) -> Any:
        if isinstance(part, Select):
            condition, a, b = part.args
            return Select(self._outcome(condition), a, b)
        if isinstance(part, sympy.sign):
            return self._outcome(part.args[0], sympy.S.Zero)
        if isinstance(part, sympy.Abs):
            return self._outcome(part.args[0]) * part.args[0]
        if isinstance(part, sympy.Max | sympy.Min):
            value, *others = part.args
            for other in others:
                larger = self._outcome(value - other)
                value = Select(larger, *((value, other) if isinstance(part, sympy.Max) else (other, value)))
            return value
        return part

    def _outcome(self, condition: Any, at_zero: Any = sympy.S.NegativeOne) -> Any:
        """1 where the condition is positive, else -1, but `at_zero` for 0 itself, as sign(u > 0) - 1 may be."""
        if is_number(condition, 0):
            return at_zero
        if condition.is_number or condition.is_positive or condition.is_negative:
            return sympy.S.One if condition.is_positive else sympy.S.NegativeOne
        if condition in self._symbols or -condition in self._symbols:
            return condition
        if isinstance(condition, Select):
            chosen, a, b = condition.args
            return Select(chosen, self._outcome(a, at_zero), self._outcome(b, at_zero))
        if 0 < len(read := _dummies([], condition)) <= _NESTED:
            return Select(read[0], *(self._outcome(replaced(condition, {read[0]: sign}), at_zero) for sign in _SIGNS))
        form, sign = normal_form(condition)
        if form in self.signs:
            return sympy.Integer(sign * self.signs[form])
        if form not in self._by_form:
            self._by_form[form] = sympy.Dummy(f"outcome_{len(self._by_form)}", real=True)
            self._symbols.add(self._by_form[form])
        return sign * self._by_form[form]


def _apart(a: Any, b: Any) -> tuple[Any, Any]:
    """Two expressions of the same difference, without the terms that both have: one may be so large that it hides the others."""
    if a.is_Add and b.is_Add:
        common = set(a.args) & set(b.args)
        a, b = (sympy.Add(*(term for term in of.args if term not in common)) for of in (a, b))
    elif a.is_Mul and b.is_Mul:
        common = set(a.args) & set(b.args)
        factor = [one for one in a.args if one in common]
        own = (sympy.Mul(*(one for one in of.args if one not in common)) for of in (a, b))
        a, b = (sympy.Mul(*factor, rest) for rest in _apart(*own)) if common else (a, b)
    return a, b


def _in_order(symbols: Sequence[Any], expression: Any) -> list[Any]:
    read = symbols_of(expression)
    return [symbol for symbol in symbols if symbol in read]


def _dummies(pairs: Pairs, expression: Any) -> list[Any]:
    """Symbols for sides and outcomes, in the order in which they were made."""
    read = symbols_of(expression, *(side for pair in pairs for side in pair))
    return sorted((symbol for symbol in read if isinstance(symbol, sympy.Dummy)), key=lambda symbol: symbol.dummy_index)


def _replaced(pairs: Pairs, surface: Any, new: Mapping[Any, Any]) -> tuple[Pairs, Any]:
    made: dict[Any, Any] = {}
    columns = [(replaced(a, new, made), replaced(b, new, made)) for a, b in pairs]
    return [(a, b) for a, b in columns if a != b], replaced(surface, new, made)


def _under_roots(expression: Any) -> set[Any]:
    """Symbols that must be positive, as a root or logarithm is taken of them whatever branch is taken."""
    found, seen, stack = set(), set(), [expression]
    while stack:
        part = stack.pop()
        if part in seen:
            continue
        seen.add(part)
        if part.args and part.args[0].is_Symbol and (part.func is sympy.log or (part.is_Pow and not part.exp.is_Integer)):
            found.add(part.args[0])
        stack += part.args[:1] if isinstance(part, Select) else part.args
    return found
