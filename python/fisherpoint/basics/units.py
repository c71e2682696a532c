"""Units: whether a text such as "m3/(s sqrt(Pa))" is one, and what it is in base units.

A model's own units are checked and shown, never converted: its equations are written in them. What files give besides, priors,
bounds and measurements, may be in other units, and is converted to the model's.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from math import inf, pi, pow
from typing import Any, overload

from numpy.typing import ArrayLike, NDArray

from .checks import as_floats, check_flag
from .messages import shown
from .quantity import LONGEST_UNIT
from .values import Array

_BASE = ("m", "kg", "s", "A", "K", "mol", "cd", "rad", "au")
"""The angle is one here, so that Hz, rad/s and rpm are not taken for each other, but see `_in_radians`; au may be anything, and is
only itself."""


@dataclass(frozen=True)
class UnitValue:
    """A unit as times / over, which are whole numbers where they can be, of a product of powers of base units."""

    times: float
    over: float
    powers: tuple[Fraction, ...]

    def __mul__(self, other: UnitValue) -> UnitValue:
        powers = tuple(a + b if a and b else a or b for a, b in zip(self.powers, other.powers, strict=True))
        return UnitValue(self.times * other.times, self.over * other.over, powers)

    def __pow__(self, power: Fraction) -> UnitValue:
        times, over = (self.times, self.over) if power >= 0 else (self.over, self.times)
        powers = tuple(a * power if a else a for a in self.powers)
        return UnitValue(_power(times, abs(power)), _power(over, abs(power)), powers)


def _power(number: float, power: Fraction) -> float:
    try:
        return pow(number, float(power))
    except OverflowError:
        return inf


def _value(times: float, over: float = 1.0, **powers: int) -> UnitValue:
    return UnitValue(times, over, tuple(Fraction(powers.get(name, 0)) for name in _BASE))


_PLAIN = {
    "min": _value(60, s=1),
    "h": _value(3600, s=1),
    "d": _value(86400, s=1),
    "deg": _value(pi, 180, rad=1),
    "degC": _value(1, K=1),
    "°C": _value(1, K=1),
    "%": _value(1, 100),
    "ppm": _value(1, 1e6),
    "rpm": _value(pi, 30, rad=1, s=-1),
    "ha": _value(1e4, m=2),
    "au": _value(1, au=1),
}
_PREFIXED = {
    **{name: _value(1, **{name: 1}) for name in _BASE if name not in ("kg", "au")},
    "g": _value(1, 1e3, kg=1),
    "Hz": _value(1, s=-1),
    "N": _value(1, kg=1, m=1, s=-2),
    "Pa": _value(1, kg=1, m=-1, s=-2),
    "J": _value(1, kg=1, m=2, s=-2),
    "W": _value(1, kg=1, m=2, s=-3),
    "C": _value(1, A=1, s=1),
    "F": _value(1, kg=-1, m=-2, s=4, A=2),
    "V": _value(1, kg=1, m=2, s=-3, A=-1),
    "ohm": _value(1, kg=1, m=2, s=-3, A=-2),
    "Ω": _value(1, kg=1, m=2, s=-3, A=-2),
    "S": _value(1, kg=-1, m=-2, s=3, A=2),
    "Wb": _value(1, kg=1, m=2, s=-2, A=-1),
    "T": _value(1, kg=1, s=-2, A=-1),
    "H": _value(1, kg=1, m=2, s=-2, A=-2),
    "sr": _value(1, rad=2),
    "lm": _value(1, cd=1, rad=2),
    "lx": _value(1, cd=1, rad=2, m=-2),
    "Bq": _value(1, s=-1),
    "Gy": _value(1, m=2, s=-2),
    "Sv": _value(1, m=2, s=-2),
    "kat": _value(1, mol=1, s=-1),
    "L": _value(1, 1e3, m=3),
    "l": _value(1, 1e3, m=3),
    "bar": _value(1e5, kg=1, m=-1, s=-2),
    "eV": _value(1.602176634e-19, kg=1, m=2, s=-2),
    "M": _value(1e3, mol=1, m=-3),
    "t": _value(1e3, kg=1),
    "cal": _value(4.184, kg=1, m=2, s=-2),
    "Ah": _value(3600, A=1, s=1),
    "Wh": _value(3600, kg=1, m=2, s=-2),
    "VA": _value(1, kg=1, m=2, s=-3),
    "var": _value(1, kg=1, m=2, s=-3),
    "Da": _value(1.66053906660e-27, kg=1),
    "U": _value(1, 1e6, mol=1) * _value(60, s=1) ** Fraction(-1),  # of an enzyme: one micromole a minute
}
_SMALL = dict.fromkeys("uµμ", 6) | {"m": 3, "c": 2, "d": 1} | {prefix: 3 * k for k, prefix in enumerate("npfazyrq", 3)}
_LARGE = {"da": 1, "h": 2} | {prefix: 3 * k for k, prefix in enumerate("kMGTPEZYRQ", 1)}
_PREFIXES = {
    "": _value(1),
    **{prefix: _value(1, 10.0**power) for prefix, power in _SMALL.items()},
    **{prefix: _value(10.0**power) for prefix, power in _LARGE.items()},
}
UNITS = {prefix + name: (prefix, name) for prefix in _PREFIXES for name in _PREFIXED}
UNITS |= {name: ("", name) for name in (*_PREFIXED, *_PLAIN)}  # before one with a prefix: min is a minute, cd a candela
CELSIUS = ("degC", "°C")
_OTHER_ANGLES = ("Hz", "Bq", "rpm", "deg", "sr", "lm", "lx")

_TOKEN = re.compile(
    r"\s*(?:(?P<power>(?:\^|\*\*)\s*[+-]?(?:\d+\.\d+|\d+)|(?<=[A-Za-zΩ%])[+-]?\d+)|(?P<name>sqrt(?=\s*\()|[^\W\d_]+|%|°C)"
    r"|(?P<one>\d+(?:\.\d+)?(?:[eE][+-]?\d+)?)|(?P<mark>[*·/()]))"
)


def check_unit(text: object, place: str) -> str:
    """Return `text` where it is a unit: products, quotients and powers of units, roots as ``sqrt(Pa)`` or ``Pa^0.5``, or ``1``.

    Raises
    ------
    ValueError
        Where it is none; the message names the place and the part that is not understood.
    """
    _read(text, place)
    return str(text)


@overload
def convert_unit(values: float, given: str, wanted: str, *, width: bool = ...) -> float: ...
@overload
def convert_unit(values: Sequence[float] | NDArray[Any], given: str, wanted: str, *, width: bool = ...) -> Array: ...
def convert_unit(values: ArrayLike, given: str, wanted: str, *, width: bool = False) -> float | Array:
    """Return numbers in another unit.

    Decimal factors are exact: 12.5 mm are the number nearest to 0.0125. Temperatures in degC and in K differ by 273.15, their
    differences do not.

    Parameters
    ----------
    values : float or array_like
        Numbers in the unit `given`.
    given, wanted : str
        Units of the same dimension.
    width : bool
        Whether the values are widths, such as standard deviations and other differences, of which only the size changes.

    Returns
    -------
    float or ndarray

    Raises
    ------
    ValueError
        Where a unit cannot be read, or they are of different dimensions; the message names both.
    """
    numbers = converted(as_floats(values, "values"), given, wanted, "given", check_flag(width, "width"))
    return float(numbers) if numbers.ndim == 0 else numbers


def converted(numbers: Array, given: str, wanted: str, place: str, width: bool = False) -> Array:
    """Return an array in another unit, as `convert` does; messages begin with `place`."""
    ratio = _ratio(given, wanted, place)
    if given == wanted:
        return numbers
    times, over = ratio.times / ratio.over, ratio.over / ratio.times
    scaled = numbers * times if times >= 1 else numbers / over
    above = 0.0 if width else _zero_between(given, wanted)
    return scaled + above if above else scaled


def unit_mistake(given: str | None, wanted: str, place: str) -> str | None:
    """What is wrong with a unit in which numbers are given, as a line; None where they can be converted."""
    try:
        if given is not None:
            _ratio(given, wanted, place)
    except ValueError as error:
        return str(error)
    return None


def same_zero(given: str, wanted: str) -> bool:
    """Whether zero in the one unit is zero in the other: not of temperatures in degC and K."""
    return not _zero_between(given, wanted)


def unit_value(text: str) -> UnitValue:
    """What a unit is in base units."""
    return _read(text, "unit")


def dimension(powers: tuple[Fraction, ...]) -> str:
    """Powers of base units as text: "kg m2/s3"."""
    named = sorted(zip(_BASE, powers, strict=True), key=lambda one: one[0] != "kg")
    above = [_power_text(name, power) for name, power in named if power > 0]
    below = [_power_text(name, -power) for name, power in named if power < 0]
    over = f"/({' '.join(below)})" if len(below) > 1 else f"/{below[0]}" if below else ""
    return (" ".join(above) or "1") + over


def _power_text(name: str, power: Fraction) -> str:
    if power.denominator == 1:
        return name if power == 1 else f"{name}{power}"
    return f"{name}^{float(power):.4g}"


def seconds(text: str, place: str) -> float:
    """The number of seconds that a time with its unit is, such as "5 ms"; raise ValueError for what is none."""
    found = re.fullmatch(r"\s*([0-9.]+(?:[eE][-+]?[0-9]+)?)\s*([A-Za-zµ]+)\s*", text)
    try:
        if found is None:
            raise ValueError
        value = float(found[1])
    except ValueError:
        raise ValueError(f"{place}: expected a time with its unit, as 5 ms, given {shown(text)}") from None
    try:
        return float(convert_unit(value, found[2], "s"))
    except ValueError as error:
        raise ValueError(f"{place}: expected a unit of time, given {shown(found[2])}") from error


def _zero_between(given: str, wanted: str) -> float:
    return 273.15 * ((given.strip() in CELSIUS) - (wanted.strip() in CELSIUS))


def _ratio(given: str, wanted: str, place: str) -> UnitValue:
    of, to = _read(given, place), _read(wanted, place)
    ratio = of * to ** Fraction(-1)
    if any(ratio.powers) and not (_of_angle_alone(ratio) and _in_radians(given) and _in_radians(wanted)):
        raise ValueError(
            f"{place}: expected a unit of what is in {wanted!r}, given {shown(given)}, which measures something else: "
            f"{dimension(of.powers)}, not {dimension(to.powers)}"
        )
    if not (0 < ratio.times < inf and 0 < ratio.over < inf):
        raise ValueError(f"{place}: expected a unit of the size of {wanted!r}, given {shown(given)}")
    return ratio


def _of_angle_alone(ratio: UnitValue) -> bool:
    return not any(power for name, power in zip(_BASE, ratio.powers, strict=True) if name != "rad")


def _in_radians(text: str) -> bool:
    """Whether angles in a unit can only be in rad, so that it may be left out, as in 1/s and in N m/rad: not in Hz, rpm or deg."""
    names = (match["name"] for match in _TOKEN.finditer(text) if match["name"] and match["name"] != "sqrt")
    return not any(UNITS[name][1] in _OTHER_ANGLES for name in names)


def _read(text: object, place: str) -> UnitValue:
    if not isinstance(text, str) or len(text) > LONGEST_UNIT:
        raise ValueError(f"{place}: expected a unit such as 'm3/(s sqrt(Pa))', given {shown(text)}")
    try:
        return _parsed(text)
    except ValueError as mistake:
        raise ValueError(f"{place}: {mistake}") from None


@lru_cache(maxsize=1000)
def _parsed(text: str) -> UnitValue:
    return _Parser(text.strip() or "1").whole()


def _of_name(name: str) -> UnitValue:
    prefix, unit = UNITS[name]
    return _PREFIXES[prefix] * (_PREFIXED[unit] if unit in _PREFIXED else _PLAIN[unit])


class _Parser:
    """Reads product = factor {[* | · | /] factor}, factor = (name | number | [sqrt] "(" product ")") [power]."""

    def __init__(self, text: str) -> None:
        self.text, self.end = text.rstrip(), 0
        self.advance()

    def advance(self) -> None:
        self.start, self.kind, self.token = self.end, "", ""
        if self.end < len(self.text):
            match = _TOKEN.match(self.text, self.end)
            if match is None:
                raise self.error("units, numbers, * / ^ and brackets")
            self.kind, self.token, self.end = str(match.lastgroup), match[0].strip(), match.end()

    def error(self, expected: str) -> ValueError:
        where = f"{shown(self.text[self.start :].strip())} at column {self.start + 1}" if self.start < len(self.text) else "its end"
        return ValueError(
            f"expected a unit such as 'm3/(s sqrt(Pa))', given {shown(self.text)}: {expected} expected before {where}"
        )

    def whole(self) -> UnitValue:
        value = self.product()
        if self.kind:
            raise self.error("the end")
        return value

    def product(self) -> UnitValue:
        value = self.factor()
        while self.kind and self.token != ")":
            power = Fraction(-1 if self.token == "/" else 1)
            if self.token in ("*", "·", "/"):
                self.advance()
            value *= self.factor() ** power
        return value

    def factor(self) -> UnitValue:
        if self.token == "(" or self.token == "sqrt":
            root = Fraction(1, 2 if self.token == "sqrt" else 1)
            if self.token == "sqrt":
                self.advance()
            self.advance()
            value = self.product() ** root
            if self.token != ")":
                raise self.error("')'")
        elif self.kind == "name" and self.token not in UNITS:
            raise ValueError(
                f"expected a unit such as 'm3/(s sqrt(Pa))', given {shown(self.text)}: unknown unit {shown(self.token)} "
                f"at column {self.end - len(self.token) + 1}"
            )
        elif self.kind not in ("name", "one"):
            raise self.error("a unit")
        else:
            value = _of_name(self.token) if self.kind == "name" else _value(float(self.token))
        self.advance()
        if self.kind == "power":
            value **= Fraction(self.token.lstrip("^* "))
            self.advance()
        return value
