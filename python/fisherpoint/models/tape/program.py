"""Programs that the core runs, and the one table of their operations: names, codes, operands and meanings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...basics.function_table import FUNCTIONS
from ...basics.values import Array
from ...engine import _core


@dataclass(frozen=True)
class Operation:
    """An operation with its number of operands and what it computes of NumPy arrays."""

    name: str
    operands: int
    compute: Callable[..., Any]


def _select(condition: Any, positive: Any, other: Any) -> Any:
    return np.where(np.asarray(condition) > 0, positive, other)


_IN_CORE = [function for function in FUNCTIONS if not function.built]

TABLE = (  # an operation's place is its code in the core
    Operation("add", 2, np.add),
    Operation("sub", 2, np.subtract),
    Operation("mul", 2, np.multiply),
    Operation("div", 2, np.divide),
    Operation("neg", 1, np.negative),
    Operation("mul_add", 3, lambda a, b, c: a * b + c),
    Operation("mul_sub", 3, lambda a, b, c: a * b - c),
    Operation("sub_mul", 3, lambda a, b, c: c - a * b),
    *(Operation(one.name, 1, one.arrays) for one in _IN_CORE if not one.at_zero),
    Operation("pow", 2, np.power),
    *(Operation(one.name, 1, one.arrays) for one in _IN_CORE if one.at_zero),
    Operation("min", 2, np.minimum),
    Operation("max", 2, np.maximum),
    Operation("select", 3, _select),
)
OPERATIONS = {operation.name: operation for operation in TABLE}
CODES = {operation.name: code for code, operation in enumerate(TABLE)}
COMMUTATIVE = frozenset({"add", "mul", "min", "max"})
ODD = frozenset(one.name for one in _IN_CORE if one.symmetry == "odd")
PARTIAL = frozenset({"div", "pow", *(one.name for one in _IN_CORE if one.partial)})
"""Operations without a finite value everywhere: a product of one and zero may be NaN."""
EVEN = frozenset(one.name for one in _IN_CORE if one.symmetry == "even")


Integers = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Program:
    """Operations on registers [literals | theta | u | x | side | dx | temporaries]; equal where the arrays are.

    Attributes
    ----------
    literals : ndarray, (n_literals,)
        Numbers of the first registers.
    setup, stage : ndarray of int32, (n, 5)
        Operations as rows (code, result, a, b, c): `setup` is run once for each trajectory and reads theta and u alone, and
        `stage` for each evaluation. The stage writes to no register that setup writes to.
    outputs : ndarray of int32, (m,)
        Registers of the results.
    registers : int
        Number of registers.
    """

    literals: Array
    setup: Integers
    stage: Integers
    outputs: Integers
    registers: int

    def evaluate(self, theta: ArrayLike, u: ArrayLike, x: ArrayLike, side: ArrayLike, dx: ArrayLike) -> Array:
        """Results (K, m) for rows theta (K, p), u (K, n_u), x (K, n_x), side (K, n_sides) and dx (K, n_x); one row may serve all.

        Slow, and independent of the core: this is what an operation means.
        """
        areas = [np.atleast_2d(np.asarray(area, float)) for area in (theta, u, x, side, dx)]
        rows = max((len(area) for area in areas if area.shape[1]), default=1)
        registers: list[Any] = [np.full(rows, value) for value in self.literals]
        registers += [np.broadcast_to(column, rows) for area in areas for column in area.T]
        registers += [None] * (self.registers - len(registers))
        with np.errstate(all="ignore"):
            for code, result, *operands in np.concatenate([self.setup, self.stage]).tolist():
                operation = TABLE[code]
                registers[result] = operation.compute(*(registers[operand] for operand in operands[: operation.operands]))
        return np.stack([registers[output] for output in self.outputs], axis=1) if len(self.outputs) else np.empty((rows, 0))

    def _content(self) -> tuple[bytes | int, ...]:
        values = (getattr(self, field.name) for field in fields(self))
        return tuple(value.tobytes() if isinstance(value, np.ndarray) else value for value in values)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Program) and self._content() == other._content()

    def __hash__(self) -> int:
        return hash(self._content())


def to_core(program: Program) -> _core.Program:
    """Return the program as the core takes it."""
    return _core.Program(program.literals.tolist(), program.setup, program.stage, program.outputs.tolist(), program.registers)
