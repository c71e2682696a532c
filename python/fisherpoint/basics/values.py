"""Arrays of numbers, also as JSON has them, and mappings that do not change."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
IntArray = NDArray[np.int32]
Value = TypeVar("Value", covariant=True)


class FrozenMapping(Mapping[str, Value]):
    """A mapping that does not change, so that what holds it can be compared, hashed and sent to another process."""

    def __init__(self, values: Mapping[str, Value]) -> None:
        self._values = dict(values)

    def __getitem__(self, name: str) -> Value:
        return self._values[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __hash__(self) -> int:
        return hash(frozenset(self._values.items()))

    def __repr__(self) -> str:
        return repr(self._values)


def relative_errors(errors: Mapping[str, float], values: Mapping[str, float]) -> FrozenMapping[float]:
    """Standard errors as shares of the absolute values of the same names; inf of a value that is zero."""
    return FrozenMapping({name: error / abs(values[name]) if values[name] else np.inf for name, error in errors.items()})


def finite_or_none(values: Array) -> list[Any]:
    """The numbers of an array as nested lists, None for what is not finite, which JSON does not have."""
    return [finite_or_none(row) if row.ndim else float(row) if np.isfinite(row) else None for row in np.asarray(values)]
