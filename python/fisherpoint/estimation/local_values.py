"""The values of local parameters and their spread, as a fit has found them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ..basics.values import FrozenMapping


@dataclass(frozen=True)
class Spread:
    """Standard deviation between the values of a local parameter.

    Attributes
    ----------
    std : float
        SI units, as given or estimated.
    standard_error : float or None
        None of one that was given.
    interval : tuple of float, or None
        By the restricted likelihood, with a probability of 95 %; from zero where the values may all be the same.
    """

    std: float
    standard_error: float | None = None
    interval: tuple[float, float] | None = None

    @property
    def nothing(self) -> bool:
        """Whether the values may all be the same."""
        return self.interval is not None and self.interval[0] == 0


NO_SPREAD: Mapping[str, Spread] = FrozenMapping({})


@dataclass(frozen=True)
class LocalValue:
    """The value of a local parameter in one group.

    Attributes
    ----------
    parameter, by, group : str
        Such as "m_load", "run" and "3", or "k_valve", "plant" and "A".
    estimate, standard_error : float
        SI units; the error is inf of what the data do not determine.
    interval : tuple of float
        Of 95 %.
    """

    parameter: str
    by: str
    group: str
    estimate: float
    standard_error: float
    interval: tuple[float, float]
