"""What a user says of the noise of sensors: white, growing with the signal, with a memory, rounded, limited, correlated."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Any

from ..basics.checks import as_float, as_positive, as_std, as_std_or_zero, by_name, check_mapping, check_type
from ..basics.messages import listed, shown
from ..basics.values import FrozenMapping

MOST_PARTS = 2
"""Gauss-Markov parts of one output: no record distinguishes the sum of more from two of them."""


@dataclass(frozen=True)
class GaussMarkov:
    """Noise with a memory: a first-order Gauss-Markov process, of covariance std^2 exp(-|t - t'| / correlation_time).

    Parameters
    ----------
    std : float
        Standard deviation, SI units.
    correlation_time : float
        s, the time in which the correlation falls to 1/e.

    Raises
    ------
    ValueError
        For numbers that are not positive.
    """

    std: float
    correlation_time: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "std", as_std(self.std, "std"))
        object.__setattr__(self, "correlation_time", as_positive(self.correlation_time, "correlation_time", "time"))


@dataclass(frozen=True)
class Noise:
    """The noise of one output, SI units.

    Parameters
    ----------
    std : float
        Standard deviation of its white part.
    relative : float
        Share of the noise-free output y that is added to it: the white part has the variance std^2 + (relative y)^2.
    colored : GaussMarkov, or a sequence of up to two, optional
        Parts with a memory, which add to the white one.
    resolution : float
        Readings are rounded to multiples of it; 0 where they are not.
    limits : pair of float or None
        What the sensor shows at least and at most: a value past a limit is shown as that limit.

    Raises
    ------
    ValueError
        Where nothing is random, and for limits beside a part with a memory.
    """

    std: float = 0.0
    _: KW_ONLY
    relative: float = 0.0
    colored: GaussMarkov | Sequence[GaussMarkov] | None = None
    resolution: float = 0.0
    limits: tuple[float | None, float | None] = (None, None)

    def __post_init__(self) -> None:
        set_field = object.__setattr__
        set_field(self, "std", as_std_or_zero(self.std, "std"))
        for name in ("relative", "resolution"):
            number = as_float(getattr(self, name), name)
            if number < 0:
                raise ValueError(f"{name}: expected a number of at least 0, given {number:g}")
            set_field(self, name, number)
        if self.relative > 1:
            raise ValueError(f"relative: expected a share of at most 1, such as 0.03 for 3 %, given {self.relative:g}")
        colored = self.colored if isinstance(self.colored, list | tuple) else () if self.colored is None else (self.colored,)
        for one in colored:
            check_type(one, GaussMarkov, "colored")
        if len(colored) > MOST_PARTS:
            raise ValueError(f"colored: expected at most {MOST_PARTS} parts, given {len(colored)}")
        set_field(self, "colored", tuple(colored))
        if not self.std and not colored:
            given = "0 beside relative: a reading of zero would be exact" if self.relative else "0"
            raise ValueError(f"std: expected a positive standard deviation, or a colored part, given {given}")
        self._check_limits()

    def _check_limits(self) -> None:
        if not isinstance(self.limits, list | tuple) or len(self.limits) != 2:
            raise ValueError(f"limits: expected a pair of numbers or None, given {shown(self.limits)}")
        limits = tuple(None if one is None else as_float(one, "limits") for one in self.limits)
        lower, upper = limits
        if lower is not None and upper is not None and not lower < upper:
            raise ValueError(f"limits: expected the lower one first, given {lower:g} and {upper:g}")
        if self.limited_by(limits) and self.colored:
            raise ValueError("limits: expected none beside a colored part, given both")
        object.__setattr__(self, "limits", limits)

    @staticmethod
    def limited_by(limits: Sequence[float | None]) -> bool:
        return any(one is not None for one in limits)

    @property
    def limited(self) -> bool:
        """Whether the sensor has a limit."""
        return self.limited_by(self.limits)

    @property
    def parts(self) -> tuple[GaussMarkov, ...]:
        """Its parts with a memory."""
        return tuple(self.colored) if isinstance(self.colored, tuple) else ()

    @property
    def white(self) -> bool:
        """Whether it is white and always the same, so that its standard deviation says all."""
        return not (self.relative or self.colored or self.resolution or self.limited)

    @property
    def nominal(self) -> float:
        """Standard deviation of a reading where the output is zero, without rounding and limits."""
        return float((self.std**2 + sum(one.std**2 for one in self.parts)) ** 0.5)


@dataclass(frozen=True)
class NoiseModel:
    """The noise of several outputs whose white parts are correlated.

    Parameters
    ----------
    outputs : mapping of output name to float or Noise
        A number is the standard deviation of white noise. Outputs that are left out are not measured.
    correlation : mapping of pairs of names to float, optional
        Correlations of the white parts, as ``{("p_A", "p_B"): 0.3}``; other pairs are independent.

    Raises
    ------
    ValueError
        For correlations that no covariance has, and beside limits.
    """

    outputs: Mapping[str, float | Noise]
    _: KW_ONLY
    correlation: Mapping[Any, float] | None = None

    def __post_init__(self) -> None:
        outputs = by_name(self.outputs, None, "outputs", as_noise)
        correlation: dict[str, float] = {}
        for key, value in check_mapping({} if self.correlation is None else self.correlation, "correlation").items():
            pair = tuple(name.strip() for name in key.split(",")) if isinstance(key, str) else key
            if not isinstance(pair, tuple) or len(pair) != 2 or pair[0] == pair[1]:
                raise ValueError(f"correlation: expected pairs of two outputs, given {shown(key)}")
            for name in (name for name in pair if name not in outputs):
                raise ValueError(f"correlation: expected names of {listed(outputs)}; given unknown {shown(name)}")
            label = ", ".join(pair)
            if label in correlation or ", ".join(reversed(pair)) in correlation:
                raise ValueError(f"correlation[{label!r}]: expected each pair once, given twice")
            correlation[label] = as_float(value, f"correlation[{label!r}]")
            if not -1 < correlation[label] < 1:
                raise ValueError(f"correlation[{label!r}]: expected a number between -1 and 1, given {correlation[label]:g}")
            for name in pair:
                noise = outputs[name]
                if isinstance(noise, Noise) and noise.limited:
                    raise ValueError(f"limits: expected none beside a correlation, given both of {name!r}")
        object.__setattr__(self, "outputs", outputs)
        object.__setattr__(self, "correlation", FrozenMapping(correlation))
        self._check_definite()

    def _check_definite(self) -> None:
        import numpy as np

        names, matrix = list(self.outputs), np.eye(len(self.outputs))
        for (i, j), value in self.pairs(names).items():
            matrix[i, j] = matrix[j, i] = value
        if np.linalg.eigvalsh(matrix).min(initial=1.0) <= 1e-12:
            raise ValueError("correlation: expected a positive definite matrix, given one that is not")

    def pairs(self, names: Sequence[str]) -> dict[tuple[int, int], float]:
        """Correlations by the places of outputs among some names, which have them all."""
        found = {}
        for key, value in (self.correlation or {}).items():
            first, second = key.split(", ")
            found[names.index(first), names.index(second)] = value
        return found


NoiseOf = Mapping[str, float | Noise] | NoiseModel
"""What functions take as the noise of the sensors."""


def as_noise(value: Any, name: str) -> float | Noise:
    """Return the noise of one output: a number where it is white and always the same."""
    if isinstance(value, Noise):
        return value.std if value.white else value
    return as_std(value, name)


def as_noise_or_zero(value: Any, name: str) -> float | Noise:
    """As `as_noise`, or 0 of a sensor without noise."""
    return as_noise(value, name) if isinstance(value, Noise) else as_std_or_zero(value, name)


def checked_noise(
    given: Any, outputs: Sequence[str], check: Callable[[Any, str], float | Noise] = as_noise, label: str = "noise"
) -> NoiseOf:
    """Return the noise of the `outputs` of a model, in their order; a mapping where none are correlated.

    Raises
    ------
    TypeError, ValueError
        For unknown names, where no output is measured, and for what is no noise.
    """
    correlation = given.correlation if isinstance(given, NoiseModel) else None
    found = by_name(given.outputs if isinstance(given, NoiseModel) else given, outputs, label, check)
    if not found:
        raise ValueError(f"{label}: expected at least one of {listed(outputs)}; given none")
    return NoiseModel(found, correlation=correlation) if correlation and any(correlation.values()) else found


def outputs_of(given: NoiseOf) -> Mapping[str, float | Noise]:
    """The noise of each output that is measured."""
    return given.outputs if isinstance(given, NoiseModel) else given


def nominal_std(given: NoiseOf | None) -> Mapping[str, float]:
    """Standard deviations of readings where the outputs are zero."""
    of = {} if given is None else outputs_of(given)
    return FrozenMapping({name: one.nominal if isinstance(one, Noise) else one for name, one in of.items()})
