"""What the core does with programs, next to what the table of operations says."""

from __future__ import annotations

import numpy as np
import pytest

from fisherpoint.engine import _core
from fisherpoint.models.tape.program import TABLE, Program, to_core

PLACES = [operation.name for operation in TABLE]


def test_codes_are_the_cores() -> None:
    assert _core.operations() == PLACES


def core_values(program: Program, x: np.ndarray) -> np.ndarray:
    """Outputs (K, 1) of a program with states a, b, c and no parameter but one, as the core computes them."""
    none = Program(np.empty(0), np.empty((0, 5), np.int32), np.empty((0, 5), np.int32), np.empty(0, np.int32), 7)
    x_leaf = Program(none.literals, none.setup, none.stage, np.array([1, 1, 1], np.int32), 7)
    model = _core.TapeModel(
        [1.0, 1.0, 1.0],
        *(0, 1, 1, 0, 0, 0, 0, 0),
        *map(to_core, (x_leaf, program, none, none, none, x_leaf, program, none)),
        [],
        [],
        [],
        [],
        [True, True, True],
        [True],
        [],
        [],
        [],
        [],
        [],
        [],
        *(0, to_core(none), to_core(none), [], [], []),
        0,
        to_core(none),
        to_core(none),
        [],
        [],
    )
    return model.output(x, np.empty((len(x), 0)), np.ones((len(x), 1)))


@pytest.mark.parametrize("operation", TABLE, ids=lambda operation: operation.name)
def test_every_operation_is_what_the_table_says(operation) -> None:
    """Registers: theta, the three states, their rates, the result."""
    stage = np.array([[PLACES.index(operation.name), 7, 1, 2, 3]], np.int32)
    program = Program(np.empty(0), np.empty((0, 5), np.int32), stage, np.array([7], np.int32), 8)
    rng = np.random.default_rng(1)
    x = rng.uniform(0.05, 0.95, (41, 3)) * rng.choice([-1.0, 1.0], (41, 3))
    x[0], x[1], x[2] = 0.0, [0.0, 0.5, -0.5], [-0.0, 2.0, 1.0]
    expected = program.evaluate([[1.0]], np.empty((1, 0)), x, np.empty((1, 0)), np.zeros((1, 3)))
    assert np.isfinite(expected).sum() > 15
    np.testing.assert_allclose(core_values(program, x), expected, rtol=4e-16 * 4, atol=0)
