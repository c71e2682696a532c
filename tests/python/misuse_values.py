"""Clumsy values, to put in the place of an argument, and what each may be taken for."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from typing import Any

import numpy as np
import pandas as pd
import sympy

import fisherpoint as fp
from misuse_examples import files, model, points, prior

NONE, NUMBER, INT, FLAG, TEXT, TERM, ARRAY, NAMES, MAP = "none", "number", "int", "flag", "text", "term", "array", "names", "map"
MODEL, POINTS, PRIOR, FUNCTION, CLASS, SLICE, PATH = "model", "points", "prior", "function", "class", "slice", "path"


@dataclass(frozen=True)
class Clumsy:
    """A value, made anew for each call, and what it may be taken for: an argument that takes nothing of that must refuse it."""

    make: Callable[[], Any]
    kinds: frozenset[str]


class Rude:
    """An object of which nothing works."""

    def __repr__(self) -> str:
        raise RuntimeError("no repr")

    def __len__(self) -> int:
        raise RuntimeError("no length")

    def __iter__(self) -> Iterator[Any]:
        raise RuntimeError("no iteration")

    def __float__(self) -> float:
        raise RuntimeError("no number")

    def __eq__(self, other: object) -> bool:
        raise RuntimeError("no comparison")

    __hash__ = None  # type: ignore[assignment]


def _value(make: Callable[[], Any], *kinds: str) -> Clumsy:
    return Clumsy(make, frozenset(kinds))


CLUMSY: dict[str, Clumsy] = {
    "None": _value(lambda: None, NONE),
    "''": _value(lambda: "", TEXT),
    "'1.0'": _value(lambda: "1.0", TEXT, PATH),
    "'a'": _value(lambda: "a", TEXT, PATH),
    "bytes": _value(lambda: b"h"),
    "control characters": _value(lambda: "\x1b[31m\n\x00", TEXT),
    "long text": _value(lambda: "x" * 100_000, TEXT),
    "10**9": _value(lambda: 10**9, NUMBER, INT),
    "10**400": _value(lambda: 10**400),
    "-10**400": _value(lambda: -(10**400)),
    "10**5000": _value(lambda: 10**5000),
    "2**63": _value(lambda: 2**63, NUMBER, INT),
    "Fraction": _value(lambda: Fraction(1, 3), NUMBER),
    "Decimal": _value(lambda: Decimal("0.25"), NUMBER),
    "Decimal NaN": _value(lambda: Decimal("nan")),
    "sympy number": _value(lambda: sympy.Rational(1, 3), NUMBER),
    "sympy symbol": _value(lambda: sympy.Symbol("a"), TERM),
    "nan": _value(lambda: float("nan")),
    "inf": _value(lambda: float("inf")),
    "-inf": _value(lambda: float("-inf")),
    "1e308": _value(lambda: 1e308, NUMBER),
    "1e-308": _value(lambda: 1e-308, NUMBER),
    "-1": _value(lambda: -1, NUMBER, INT),
    "0": _value(lambda: 0, NUMBER, INT),
    "1": _value(lambda: 1, NUMBER, INT),
    "0.5": _value(lambda: 0.5, NUMBER),
    "2.0": _value(lambda: 2.0, NUMBER),
    "True": _value(lambda: True, FLAG),
    "False": _value(lambda: False, FLAG),
    "np.True_": _value(lambda: np.True_, FLAG),
    "1j": _value(lambda: 1 + 1j),
    "[]": _value(list, ARRAY, NAMES),
    "()": _value(tuple, ARRAY, NAMES),
    "[[]]": _value(lambda: [[]], ARRAY),
    "{}": _value(dict, MAP, NAMES),
    "a set": _value(lambda: {1.0, 2.0}),
    "[None]": _value(lambda: [None]),
    "['a']": _value(lambda: ["a"], NAMES),
    "['h']": _value(lambda: ["h"], NAMES),
    "[1j]": _value(lambda: [1j]),
    "[True]": _value(lambda: [True]),
    "[10**400]": _value(lambda: [10**400]),
    "ragged": _value(lambda: [[1.0], [1.0, 2.0]]),
    "[Fraction]": _value(lambda: [Fraction(1, 2)], ARRAY),
    "a vector": _value(lambda: np.ones(3), ARRAY),
    "a matrix": _value(lambda: np.ones((2, 2)), ARRAY),
    "a cube": _value(lambda: np.ones((2, 1, 1)), ARRAY),
    "an empty array": _value(lambda: np.empty((0, 1)), ARRAY, NAMES),
    "a numpy number": _value(lambda: np.float64(0.5), NUMBER),
    "a 0-d array": _value(lambda: np.array(0.5), NUMBER, ARRAY),
    "complex": _value(lambda: np.ones((2, 1), complex)),
    "objects": _value(lambda: np.array([[object()]])),
    "an array of text": _value(lambda: np.array([["1.0"]])),
    "dates": _value(lambda: np.array([["2020-01-01"]], dtype="M8[D]")),
    "an array of nan": _value(lambda: np.array([[np.nan]])),
    "a structured array": _value(lambda: np.zeros(2, dtype=[("a", float)])),
    "a masked array": _value(lambda: np.ma.masked_array([[1.0], [2.0]], [[True], [False]])),
    "an array of flags": _value(lambda: np.array([True, False])),
    "a DataFrame": _value(lambda: pd.DataFrame({"h": [1.0, 2.0]}), ARRAY, NAMES),
    "a Series": _value(lambda: pd.Series([1.0, 2.0], index=["h", "u"]), ARRAY),
    "{'x': 1.0}": _value(lambda: {"x": 1.0}, MAP),
    "{1: 2}": _value(lambda: {1: 2}),
    "a mapping to text": _value(lambda: dict.fromkeys(("k", "a", "h", "u", "dt", "y"), "x")),
    "a mapping to None": _value(lambda: dict.fromkeys(("k", "a", "h", "u", "dt", "y"))),
    "a mapping to 10**400": _value(lambda: dict.fromkeys(("k", "a", "h", "u", "dt", "y"), 10**400)),
    "a mapping to lists": _value(lambda: {key: [1.0] for key in ("k", "a", "h", "u", "dt", "y")}),
    "many keys": _value(lambda: dict.fromkeys(map(str, range(20_000)), 1.0), MAP),
    "many names": _value(lambda: [f"n{i}" for i in range(20_000)]),
    "a model": _value(lambda: model(), MODEL),
    "points": _value(lambda: points(), POINTS),
    "a prior": _value(lambda: prior(), PRIOR),
    "a class": _value(lambda: fp.Experiments, CLASS),
    "a function": _value(lambda: lambda *_: 1.0, FUNCTION),
    "a generator": _value(lambda: (x for x in (1.0, 2.0)), NAMES),
    "an iterator of names": _value(lambda: iter(["k"]), NAMES),
    "a range": _value(lambda: range(3), ARRAY),
    "an object": _value(object),
    "a rude object": _value(Rude),
    "Ellipsis": _value(lambda: ...),
    "a slice": _value(lambda: slice(None), SLICE),
    "a path": _value(lambda: files() / "\x1b[31m", PATH),
}
"""Values that a hurried user, another program or a damaged file may hand in."""
