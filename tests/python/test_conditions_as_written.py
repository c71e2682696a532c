"""Conditions are written alike in text and in functions; what neither can be is refused in words that say what to write."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp

DESCRIBED: dict[str, Any] = {"states": {"x": "1", "z": "1"}, "inputs": {"u": "1"}, "parameters": {"k": "1"}, "outputs": {"y": "1"}}


def of_text(rate: str) -> fp.SymbolicModel:
    return fp.SymbolicModel([rate, "1"], ["k*x"], **DESCRIBED, check_units=False)


def of_function(rate: Callable[[Any, Any, Any], Any]) -> fp.SymbolicModel:
    return fp.model(**DESCRIBED, check_units=False)(lambda x, u, p: ([rate(x.x, x.z, u.u), 1], [p.k * x.x]))


@pytest.mark.parametrize(
    ("texts", "function", "holds"),
    [
        (["x > 0 and z > 0", "(x > 0) & (z > 0)"], lambda x, z, u: (x > 0) & (z > 0), lambda x, z: x > 0 and z > 0),
        (["x > 0 or z > 0", "(x > 0) | (z > 0)"], lambda x, z, u: (x > 0) | (z > 0), lambda x, z: x > 0 or z > 0),
        (["not x > 0", "~(x > 0)"], lambda x, z, u: ~(x > 0), lambda x, z: not x > 0),
        (
            ["not (x > 0 and z > 0) or z > 1", "~((x > 0) & (z > 0)) | (z > 1)", "~((x > 0) and z > 0) | (z > 1)"],
            lambda x, z, u: ~((x > 0) & (z > 0)) | (z > 1),
            lambda x, z: not (x > 0 and z > 0) or z > 1,
        ),
        (["0 < x < 1", "(0 < x) & (x < 1)"], lambda x, z, u: (x > 0) & (x < 1), lambda x, z: 0 < x < 1),
    ],
)
def test_conditions_are_the_same_in_text_and_in_a_function(
    texts: list[str], function: Callable[..., Any], holds: Callable[[float, float], bool]
) -> None:
    models = [of_text(f"where({text}, 1, 2)") for text in texts]
    models.append(of_function(lambda x, z, u: fp.math.where(function(x, z, u), 1, 2)))
    at = [(x, z) for x in (-0.5, 0.5, 1.5) for z in (-0.5, 0.5, 1.5)]
    for model in models:
        assert set(model.jumps) == set(models[0].jumps)
        np.testing.assert_array_equal(model.rhs(at, [0.0], [1.0])[:, 0], [1.0 if holds(*both) else 2.0 for both in at])


IN_FUNCTIONS: dict[str, Callable[[Any, Any, Any], Any]] = {
    r"expected conditions, with brackets .* &": lambda x, z, u: fp.math.where((x > 0) and (z > 0), 1, 0),
    r"expected conditions, with brackets .* \|": lambda x, z, u: fp.math.where((x > 0) or (z > 0), 1, 0),
    r"expected conditions, with brackets .* ~": lambda x, z, u: fp.math.where(not x > 0, 1, 0),
    r"expected conditions, with brackets .*given x > 0": lambda x, z, u: fp.math.where(0 < x < 1, 1, 0),
    r"expected conditions, with brackets .*given z": lambda x, z, u: fp.math.where(x > 0 & z > 0, 1, 0),
    r"expected conditions, .*where\(condition, a, b\) instead of if": lambda x, z, u: x if x > 0 else z,
    r"expected conditions, .*fp\.math\.max and fp\.math\.min instead of max": lambda x, z, u: max(x, z),
    r"expected conditions, .*given x,": lambda x, z, u: x or z,
    r"expected <, <=, > or >=, given == or != for x: write abs\(a - b\) < width": lambda x, z, u: fp.math.where(x == 0, 1, 0),
    r"expected <, <=, > or >=, given == or != for u": lambda x, z, u: fp.math.where(u != 0, 1, 0),
    r"expected no %, //, floor, .* given it for x": lambda x, z, u: x % 2,
    r"expected no %, //, floor, .* given it for 2\*x": lambda x, z, u: (2 * x) // 1,
    r"expected no %, //, floor, .* given it for z": lambda x, z, u: math.floor(z),
    r"expected no %, //, floor, .* given it for u": lambda x, z, u: round(u),
    r"expected a function of fisherpoint\.math, as fp\.math\.sqrt, .* for x": lambda x, z, u: math.sqrt(x),
    r"expected terms, given the condition x > 0: write where": lambda x, z, u: 2 * (x > 0),
}


@pytest.mark.parametrize("expected", IN_FUNCTIONS)
def test_what_a_function_cannot_say_is_refused_in_words(expected: str) -> None:
    with pytest.raises(ValueError, match=rf"^<lambda>, line 1: {expected}") as caught:
        of_function(IN_FUNCTIONS[expected])
    assert len(str(caught.value)) < 400
