"""Right values that take long, kept between runs: every level of the instruction set is compared with the same ones."""

from __future__ import annotations

import hashlib
import os
import pickle
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import TypeVar

import numpy as np
import scipy

Value = TypeVar("Value")

FOLDER = Path(__file__).resolve().parents[2] / "build" / "right_values"


def remembered(compute: Callable[[], Value], *key: object) -> Value:
    """What `compute` returns, from a file where it is known.

    Parameters
    ----------
    compute : callable
        A function of a test's module. Its result must be a function of `key` and of the source of these modules alone.
    *key : str, float, int or array
        What `compute` depends on.
    """
    path = FOLDER / f"{_digest(compute, key)}.pickle"
    if path.exists():
        value: Value = pickle.loads(path.read_bytes())
        return value
    value = compute()
    FOLDER.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=FOLDER)
    with os.fdopen(handle, "wb") as file:
        pickle.dump(value, file)
    os.replace(name, path)  # whole, whatever other processes do
    return value


@cache
def _sources(test: str) -> bytes:
    helpers = (path for path in sorted(Path(__file__).parent.glob("*.py")) if not path.name.startswith("test_"))
    return b"".join(path.read_bytes() for path in (*helpers, Path(test)))


def _digest(compute: Callable[[], object], key: tuple[object, ...]) -> str:
    digest = hashlib.sha256(np.__version__.encode() + scipy.__version__.encode())
    digest.update(_sources(compute.__code__.co_filename))
    for part in key:
        value = np.asarray(part)
        assert value.dtype != object, "expected texts, numbers or arrays"
        digest.update(f"{value.dtype} {value.shape} ".encode() + value.tobytes())
    return digest.hexdigest()
