"""Checks of a fit's residuals: is what is left white, and how far are standard errors to be believed if it is not?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..basics.quantity import names_of
from ..basics.values import Array, FrozenMapping
from ..data.measurements import Measurements
from ..data.record import Record
from ..models import Model
from .noise_memory import NoiseMemory, memory_of, slices_of
from .sandwich import Sandwich, root, sandwich
from .whiteness import (
    Autocorrelation,
    Periodogram,
    SignChanges,
    autocorrelation,
    fewest_sign_changes,
    portmanteau,
    spectrum,
)

OFF = 0.001
"""Probability of a chi-square by chance below which the model or the noise of an output is called wrong, and of residuals like
these below which they are not white."""

LONG = 50.0
"""Correlation times from which on data show how large standard errors are."""


@dataclass(frozen=True, eq=False)
class ResidualCheck:
    """What the residuals of one output look like beside white noise.

    Attributes
    ----------
    count : int
        Measured numbers in series of two samples and more; the lags of the tests count these.
    autocorrelation : Autocorrelation
        Within runs and records.
    lags : int
        Number of lags of the portmanteau test; 0 where there are too few samples.
    lag_p_value, spectrum_p_value : float or None
        Probability, if the noise is white, of larger autocorrelations, and of a spectrum that is farther from flat.
    spectrum : Periodogram
        Of runs and records.
    signs : SignChanges or None
        Of points, along the setting where signs change improbably seldom.
    memory : NoiseMemory or None
        White noise beside Gauss-Markov noise, as the residuals have it; None where they are white.
    """

    count: int
    autocorrelation: Autocorrelation
    lags: int
    lag_p_value: float | None
    spectrum: Periodogram
    spectrum_p_value: float | None
    signs: SignChanges | None
    memory: NoiseMemory | None = None

    @property
    def p_value(self) -> float | None:
        """The smallest of the tests' probabilities times their number; None where there is nothing to judge by."""
        return _of_tests(self.lag_p_value, self.spectrum_p_value, None if self.signs is None else self.signs.p_value)

    @property
    def series_p_value(self) -> float | None:
        """`p_value` of runs and records alone."""
        return _of_tests(self.lag_p_value, self.spectrum_p_value)

    @property
    def white(self) -> bool:
        """Whether the residuals may be white noise: their probability is not below 0.001."""
        return self.p_value is None or self.p_value >= OFF

    @property
    def correlation_times(self) -> float:
        """Length of the data in correlation times of the noise; inf of white noise."""
        return self.count / self.memory.samples if self.memory is not None and self.memory.phi > 0 else np.inf


@dataclass(frozen=True, eq=False)
class Series:
    """Which samples belong together.

    Attributes
    ----------
    numbers : ndarray of int, (N,)
        Of each sample's run or record; a point has a number of its own.
    points : ndarray of int, (k,)
        Samples that are points.
    settings : ndarray, (k, s)
        Their starts, inputs and durations.
    names : tuple of str
        Of the settings.
    """

    numbers: NDArray[np.intp]
    points: NDArray[np.intp]
    settings: Array
    names: tuple[str, ...]

    @classmethod
    def of(cls, model: Model, data: Sequence[Measurements | Record]) -> Series:
        names = names_of(model.axes)
        numbers, points, settings, samples, series = [], [np.zeros(0, dtype=np.intp)], [np.zeros((0, len(names)))], 0, 0
        for part in data:
            if isinstance(part, Record):
                own = np.zeros(len(part), dtype=np.intp)
            else:
                own = np.nonzero(part.runs.measured)[0]
                if (experiments := part.runs.points) is not None:
                    points.append(samples + np.arange(len(own)))
                    settings.append(experiments.table[own, : len(names)])
            numbers.append(series + own)
            samples, series = samples + len(own), series + int(own.max(initial=-1)) + 1
        return cls(np.concatenate(numbers), np.concatenate(points), np.concatenate(settings), names)


class ShareOfBlocks(NamedTuple):
    """Q with Q Q^T as what the fit has taken from the residuals' covariance.

    Attributes
    ----------
    rows : ndarray, (N, n_y, k)
        Columns that all samples share, and behind these those of a sample's own block.
    common : int
        Number of the former.
    number : ndarray of int, (N,)
        Of each sample's block.
    """

    rows: Array
    common: int
    number: NDArray[np.intp]


class WhitenedRows(NamedTuple):
    """All that the tests of residuals and robust standard errors need, beside which samples belong together.

    Attributes
    ----------
    residuals, jacobian : ndarray, (N, n_y) and (N, n_y, P)
        Whitened by the noise of the model, zero where not measured: innovations where the noise has a memory.
    covariance : ndarray, (P, P)
        F^-1, of what is determined.
    measured : ndarray of bool, (N, n_y)
    blocks : ShareOfBlocks or None
        What the fit has taken, by blocks of samples; None where that is from the whole Jacobian.
    """

    residuals: Array
    jacobian: Array
    covariance: Array
    measured: NDArray[np.bool_]
    blocks: ShareOfBlocks | None = None


def residual_checks(model: Model, series: Series, rows: WhitenedRows, judged: NDArray[np.bool_]) -> Mapping[str, ResidualCheck]:
    """The checks of every output that is judged, by name.

    Parameters
    ----------
    model : Model
    series : Series
    rows : WhitenedRows
    judged : ndarray of bool, (n_y,)
        Outputs whose residuals are more than numerical errors.
    """
    residuals, jacobian, covariance, measured, of_blocks = rows
    factor = root(covariance) if of_blocks is None else None
    is_point = np.zeros(len(residuals), dtype=bool)
    is_point[series.points] = True
    checks = {}
    for i, name in enumerate(names_of(model.outputs)):
        if not judged[i]:
            continue
        here = measured[:, i] & ~is_point
        counts = np.bincount(series.numbers[here], minlength=1)
        here &= (counts > 1)[np.minimum(series.numbers, len(counts) - 1)]
        e, numbers = residuals[here, i], series.numbers[here]
        share = jacobian[here, i] @ factor if of_blocks is None else of_blocks.rows[here, i]
        blocks = None if of_blocks is None else (of_blocks.common, of_blocks.number[here])
        found, frequencies = autocorrelation(e, share, numbers, blocks=blocks), spectrum(e, share, numbers)
        lags, lag_p_value = portmanteau(found)
        points = measured[series.points, i]
        signs = fewest_sign_changes(residuals[series.points[points], i], series.settings[points], series.names)
        check = ResidualCheck(len(e), found, lags, lag_p_value, frequencies, frequencies.p_value, signs)
        if check.series_p_value is not None and check.series_p_value < OFF:
            check = replace(check, memory=memory_of(e, jacobian[here, i], slices_of(numbers)))
        checks[name] = check
    return FrozenMapping(checks)


def _of_tests(*p_values: float | None) -> float | None:
    found = [p_value for p_value in p_values if p_value is not None]
    return min(1.0, len(found) * min(found)) if found else None


def robust(
    model: Model,
    series: Series,
    checks: Mapping[str, ResidualCheck],
    rows: WhitenedRows,
    of_prior: Array,
) -> Sandwich:
    """The robust covariance of the estimate, prewhitened where residuals are not white; `of_prior` (P, P) is its information.

    Series have the weight that they have for the common unknowns.
    """
    memories = [checks[name].memory or NoiseMemory() if name in checks else NoiseMemory() for name in names_of(model.outputs)]
    shares = None if rows.blocks is None else (rows.blocks.rows, rows.blocks.common)
    return sandwich(*rows[:3], series.numbers, rows.measured, memories, of_prior, shares)
