"""Whether what equations add, compare and give to functions is in the same units.

A finding is certain, or there is none. What has the unit "1" may have been left without one, and numbers other than small whole
ones may carry units, as 8.314, 0.1 and 3600 do: nothing follows from them, and they may be added to anything. Angles have no
dimension here.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from fractions import Fraction
from itertools import pairwise
from math import inf, isclose
from typing import Any

import sympy
from sympy.core.relational import Relational
from sympy.functions.elementary.piecewise import ExprCondPair

from ..basics.messages import shortened
from ..basics.quantity import Quantity
from ..basics.units import CELSIUS, UnitValue, dimension, unit_value
from .surfaces.printing import to_text
from .tape.defined import Defined
from .tape.kinds import KINDS
from .tape.parts import parts

SMALL = 12
"""Whole numbers up to this, and their quotients, are taken for plain numbers; any other, as 0.1 in -0.1*v, may carry a unit."""

TIMES = (60.0, 3600.0, 86400.0)
"""Seconds of a minute, an hour and a day."""

Unit = UnitValue | None
"""None for what may be in any unit."""

_SECOND = unit_value("s")
_NONE = unit_value("1")

_SAME = (sympy.Add, sympy.Min, sympy.Max)
_OF_NUMBERS = tuple(kind for kind, function in KINDS.items() if function.of_number)


def mistakes_in_units(
    equations: Iterable[tuple[str, Any, Unit]],
    conditions: Iterable[tuple[str, Any]],
    rates: Mapping[str, UnitValue],
    quantities: Iterable[Quantity],
) -> list[str]:
    """A sentence for each place where units do not fit.

    Parameters
    ----------
    equations : iterable of (place, expression, unit)
        With what each should be in.
    conditions : iterable of (place, expression)
        What must stay positive, in whatever unit.
    rates : mapping of place to unit
        Of the equations that are rates: what each would be in if "1" were no unit that was left out.
    quantities : iterable of Quantity
        All that occur.
    """
    quantities = list(quantities)
    units = {quantity.name: stated(quantity) for quantity in quantities}
    celsius = {quantity.name for quantity in quantities if quantity.unit.strip() in CELSIUS}
    plain = {quantity.name: stated(quantity) or _NONE for quantity in quantities}
    found: list[str] = []
    known: dict[Any, Unit] = {}
    plainly: dict[Any, Unit] = {}
    for place, expression, wanted in (*equations, *((place, expression, None) for place, expression in conditions)):
        checked = _Check(units, known, celsius)
        unit = checked.unit_of(expression)
        found += [f"{place}: {text}" for text in checked.findings]
        if unit is not None and wanted is not None and not _alike(unit, wanted):
            found.append(f"{place}: expected {_text(wanted)}, given {_shown(expression)} in {_text(unit)}")
        elif unit is None and not checked.findings and place in rates:
            found += [f"{place}: {text}" for text in _other_times(expression, rates[place], plain, plainly)]
    return found


def _other_times(expression: Any, wanted: UnitValue, plain: Mapping[str, Unit], known: dict[Any, Unit]) -> Iterator[str]:
    """Terms of a rate that are per hour where time is in s: that a quantity in "1" may be in any unit does not change it."""
    checked = _Check(plain, known, ())
    for term in sympy.Add.make_args(expression):
        unit = checked.unit_of(term)
        if unit is not None and unit.powers == wanted.powers and not _alike(unit, wanted):
            size = unit.times * wanted.over / (unit.over * wanted.times)
            if any(isclose(size * seconds, 1.0, rel_tol=1e-9) for seconds in TIMES):
                yield f"expected {_text(wanted)}, as time is in s, given {_shown(term)} in {_text(unit)}"


def is_time(quantity: Quantity) -> bool:
    """Whether a quantity is a time, or may be one."""
    unit = stated(quantity)
    return unit is None or _alike(unit, _SECOND)


def stated(quantity: Quantity) -> Unit:
    """The unit of a quantity without its angle; None where it is "1", which may mean that none was given."""
    unit = _without_angle(unit_value(quantity.unit))
    of_doubles = 0 < unit.times < inf and 0 < unit.over < inf
    return unit if quantity.unit != "1" and of_doubles else None


def plain_rate_of(quantity: Quantity) -> UnitValue:
    """Unit of a state's rate, where "1" is a unit and not one that was left out."""
    return (stated(quantity) or _NONE) * _SECOND ** Fraction(-1)


def rate_of(quantity: Quantity) -> Unit:
    """Unit of a state's rate; None where it is not stated."""
    unit = stated(quantity)
    return None if unit is None else unit * _SECOND ** Fraction(-1)


class _Check:
    """Units of the parts of an expression, and what does not fit among them; known parts are not reported twice."""

    def __init__(self, units: Mapping[str, Unit], known: dict[Any, Unit], celsius: Collection[str]) -> None:
        self.units, self.known, self.celsius, self.findings = units, known, celsius, list[str]()

    def unit_of(self, expression: Any) -> Unit:
        for part in parts(expression, known=self.known):
            self.known[part] = self._unit(part)
        return self.known[expression]

    def _unit(self, part: Any) -> Unit:
        known = self.known
        if part.is_Symbol:
            return self.units.get(part.name)
        if isinstance(part, Relational):
            self._same(part.args, "compared")
            return None
        if not isinstance(part, sympy.Expr) or part.is_number:
            return None
        if isinstance(part, _SAME):
            return self._same(part.args, "added" if part.is_Add else "compared")
        if part.is_Mul:
            return self._product(part.args)
        if part.is_Pow:
            return self._power(*part.args)
        if isinstance(part, _OF_NUMBERS):
            (argument,) = part.args
            unit = known[argument]
            if unit is not None and not _alike(unit, _NONE):
                given = f"{_shown(argument)} in {_text(unit)}"
                self.findings.append(f"expected a number without unit in {part.func.__name__}(), given {given}")
            return _NONE
        if isinstance(part, sympy.Abs | Defined):
            return known[part.args[0]]
        if isinstance(part, sympy.Piecewise):
            return self._same([case.args[0] for case in part.args], "given by turns")
        if isinstance(part, sympy.atan2):
            self._same(part.args, "divided in atan2()")
            return _NONE
        return _NONE if isinstance(part, sympy.sign | sympy.Heaviside) else None

    def _same(self, terms: Iterable[Any], done: str) -> Unit:
        """The unit that all terms have; None where one of them may have any."""
        units = [(term, self.known[term]) for term in terms if not (isinstance(term, ExprCondPair) or term.is_Boolean)]
        stated_units = [(term, unit) for term, unit in units if unit is not None]
        for (one, unit), (other, another) in pairwise(stated_units):
            if not _alike(unit, another):
                self.findings.append(f"{_shown(one)} in {_text(unit)} and {_shown(other)} in {_text(another)} cannot be {done}")
                return None
        self._same_zero([term for term, _ in stated_units], done)
        # A number beside a quantity is in its unit; anything else without a unit leaves open what the sum is in.
        open_terms = any(unit is None and not term.is_number for term, unit in units)
        return stated_units[0][1] if stated_units and not open_terms else None

    def _same_zero(self, terms: Iterable[Any], done: str) -> None:
        """Temperatures in degC and in K have other zeros; of what is no quantity, a difference may be meant."""
        alone = [term.as_coeff_Mul()[1] for term in terms]
        named = [(quantity.name, quantity.name in self.celsius) for quantity in alone if quantity.is_Symbol]
        if self.celsius and len({there for _, there in named}) == 2:
            one, other = (next(name for name, there in named if there is wanted) for wanted in (True, False))
            self.findings.append(
                f"{one} in degC and {other} in K cannot be {done}, as 0 degC is 273.15 K: expected one unit of both"
            )

    def _product(self, factors: Iterable[Any]) -> Unit:
        unit = _NONE
        for factor in factors:
            if factor.is_number:
                if not _plain(factor):
                    return None
                continue
            of = self.known[factor]
            if of is None:
                return None
            unit = unit * of
        return unit

    def _power(self, base: Any, exponent: Any) -> Unit:
        unit = self.known[base]
        if exponent.is_number:
            return None if unit is None else unit ** Fraction(float(exponent)).limit_denominator(1000)
        power = self.known[exponent]
        if power is not None and not _alike(power, _NONE):
            self.findings.append(f"expected an exponent without unit, given {_shown(exponent)} in {_text(power)}")
        return _NONE if unit is not None and _alike(unit, _NONE) else None


def _plain(number: Any) -> bool:
    return bool(number.is_Rational and abs(number.p) <= SMALL and number.q <= SMALL)


def _without_angle(unit: UnitValue) -> UnitValue:
    *powers, _, other = unit.powers
    return UnitValue(unit.times, unit.over, (*powers, Fraction(0), other))


def _alike(one: UnitValue, other: UnitValue) -> bool:
    sizes = one.times * other.over, other.times * one.over
    of_doubles = all(0 < size < inf for size in sizes)
    return one.powers == other.powers and (not of_doubles or isclose(*sizes, rel_tol=1e-9))


def _text(unit: UnitValue) -> str:
    size, of = unit.times / unit.over, dimension(unit.powers)
    return of if isclose(size, 1.0, rel_tol=1e-9) else f"{size:.4g}" if of == "1" else f"{size:.4g} {of}"


def _shown(expression: Any) -> str:
    return shortened(to_text(expression), 60)
