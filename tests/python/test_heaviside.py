"""What a step is at zero: 0 as `heaviside`, and of SymPy's Heaviside what it says."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest
import sympy

import fisherpoint as fp

X, U, K = sympy.symbols("x u k", real=True)
INPUTS = np.array([-0.5, 0.0, 0.5])


def model_of(rate: Any) -> fp.SymbolicModel:
    described = {"states": {"x": "1"}, "inputs": {"u": "1"}, "parameters": {"k": "1"}, "outputs": {"y": "1"}}
    return fp.SymbolicModel([rate], ["k*x"], **described, check_units=False)


@pytest.mark.parametrize(
    ("rate", "at_zero"),
    [
        ("heaviside(u)", 0.0),
        (fp.math.heaviside(U), 0.0),
        (sympy.Heaviside(U, 0), 0.0),
        (sympy.Heaviside(U, 0.0), 0.0),
        (sympy.Heaviside(U, 1), 1.0),
        (sympy.Heaviside(U, 1.0), 1.0),
        (sympy.Heaviside(U), 0.5),
        (sympy.Heaviside(U, 0.5), 0.5),
        (sympy.Heaviside(U, sympy.Rational(1, 3)), 1 / 3),
        (sympy.Heaviside(U, K), 0.7),
        ("where(u >= 0, 1, 0)", 1.0),
        ("sign(u)/2 + 1/2", 0.5),
    ],
)
def test_a_step_of_an_input_has_its_value_at_zero(rate: Any, at_zero: float) -> None:
    """By f, by trajectories, and by what is stored of the model."""
    points = fp.Experiments(np.zeros((3, 1)), INPUTS[:, np.newaxis], np.full(3, 0.5))
    model = model_of(rate)
    for one in (model, pickle.loads(pickle.dumps(model))):
        np.testing.assert_allclose(one.rhs(np.zeros((3, 1)), INPUTS[:, np.newaxis], [0.7])[:, 0], [0.0, at_zero, 1.0], rtol=1e-15)
        np.testing.assert_allclose(fp.simulate(one, points, [0.7]).x[:, 0], [0.0, 0.5 * at_zero, 0.5], rtol=1e-12)


@pytest.mark.parametrize("value", [0, 0.5, 1, 0.3])
def test_a_step_of_a_state_is_a_jump_whatever_it_is_at_zero(value: float) -> None:
    model = model_of(sympy.Heaviside(X - 1, value) + K)
    assert model.jumps == ("x - 1",)
    found = fp.simulate(model, fp.Experiments(np.array([[0.0]]), np.zeros((1, 1)), np.array([3.0])), [0.5])
    assert found.x[0, 0] == pytest.approx(1 + 1.5, rel=1e-9)
