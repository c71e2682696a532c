"""What decides the last bits of a result: versions, the instruction set, and how this machine multiplies matrices."""

from __future__ import annotations

import hashlib
import os
from functools import cache
from typing import NamedTuple

import numpy as np

from .versions import versions

SIZE = 60
"""Rows of the matrices that are tried; larger ones may be cut up among threads."""

ADVICE = {
    "fisherpoint": "install the same on all machines",
    "numpy": "install the same on all machines",
    "isa": "set FISHERPOINT_ISA to one that all machines have, here and there",
    "algebra": "set OPENBLAS_CORETYPE and NPY_DISABLE_CPU_FEATURES alike on all machines, such as OPENBLAS_CORETYPE=Haswell",
}


class Arithmetic(NamedTuple):
    """How a process computes; `algebra` is a digest of some results."""

    fisherpoint: str
    numpy: str
    isa: str
    algebra: str
    process: int

    def check(self, there: Arithmetic) -> None:
        """Raise where another process computes otherwise.

        Raises
        ------
        ValueError
            With what to do.
        """
        for name, advice in ADVICE.items():
            expected, given = getattr(self, name), getattr(there, name)
            if expected != given:
                raise ValueError(f"workers: expected {name} {expected} as here, given {given}: {advice}")


def arithmetic() -> Arithmetic:
    """Return how this process computes."""
    made = versions()
    return Arithmetic(made["fisherpoint"], made["numpy"], made["isa"], _algebra(), os.getpid())


@cache
def _algebra() -> str:
    rows = np.sin(np.arange(1.0, SIZE**2 + 1)).reshape(SIZE, SIZE)
    square = rows @ rows.T + SIZE * np.eye(SIZE)
    values, vectors = np.linalg.eigh(square)
    parts = (rows, square, np.linalg.cholesky(square), np.linalg.solve(square, rows), values, vectors, np.exp(rows), np.log(values))
    return hashlib.sha256(b"".join(np.ascontiguousarray(part).tobytes() for part in parts)).hexdigest()[:12]
