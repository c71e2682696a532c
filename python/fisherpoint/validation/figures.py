"""Figures of the fits of virtual data, each with its Monte Carlo error."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..basics.values import Array

FEWEST = 10
"""Minimum number of fits for a statement about a parameter."""

LEVEL = 0.95
"""Level of the intervals whose coverage is counted."""

MOST_OFF = 4.0
"""Promised standard errors that an error counts as at most in `limited_ratio`: a normal one hardly ever is as large."""

NORMAL_MEDIAN = 0.6744897501960817
"""Median of the absolute value of a standard normal variable."""


@dataclass(frozen=True)
class Figure:
    """A figure of a Monte Carlo study, its standard error, and of how many values it is; NaN and zero where there is none."""

    value: float
    error: float
    n: int = 0

    def over(self, size: float) -> Figure:
        return Figure(self.value / size, self.error / abs(size), self.n)


NOTHING = Figure(np.nan, np.nan)


class OneParameter(NamedTuple):
    """Fits of one parameter in all virtual experiments (n,): truth, estimate, standard error, whether the interval contains the
    truth, whether the fit ended at a bound, and whether it did not fail."""

    truth: Array
    estimate: Array
    standard_error: Array
    covered: NDArray[np.bool_]
    at_bound: NDArray[np.bool_]
    fine: NDArray[np.bool_]


@dataclass(frozen=True)
class ParameterFigures:
    """Figures of one parameter from the fits of one design, SI units; errors are those of estimates about the truth of each run.

    Attributes
    ----------
    parameter : str
    prior_std : float
    promised : float
        Standard error under the noise that the fits reckon with (R, or R_k), at the prior mean; NaN where the points do not
        determine the parameter.
    bias : Figure
        Mean error.
    achieved : Figure
        Standard deviation of the errors about their mean: the empirical standard error.
    typical : Figure
        Median of |error| over 0.6745, which is the standard deviation were the errors normal. A few diverging fits, as those of
        weakly determined parameters do, hardly move it.
    rmse : Figure
        Root mean square of the errors, over the prior std.
    claimed : Figure
        Mean of the standard errors that the fits themselves report.
    coverage : Figure
        Share of all virtual experiments in which the fit's own 95 % interval contains the truth. Those without an interval that has
        ends do not: fits that failed or do not determine the parameter, and experiments without data.
    at_bound : int
        Fits that ended at a bound of the parameter: they have neither a standard error of it nor an interval.
    too_low, too_high : Figure
        Shares of all virtual experiments in which the truth is not in an interval, and the estimate, or where the search ended, is
        below or above it. What is left beside these and `coverage` gave no data.
    without_interval : int
        Virtual experiments without an interval that has ends.
    limited_ratio : Figure
        Achieved over promised, where errors count as four promised standard errors from their median at most. It is never more than
        `ratio`, and its Monte Carlo error stays small where a few diverging fits make that of `ratio` large.
    """

    parameter: str
    prior_std: float
    promised: float
    bias: Figure
    achieved: Figure
    typical: Figure
    rmse: Figure
    claimed: Figure
    coverage: Figure
    at_bound: int
    too_low: Figure = NOTHING
    too_high: Figure = NOTHING
    without_interval: int = 0
    limited_ratio: Figure = NOTHING

    @property
    def ratio(self) -> Figure:
        """Achieved over promised standard error: 1 where the promise is kept."""
        return self.achieved.over(self.promised)

    @property
    def typical_ratio(self) -> Figure:
        """Typical over promised standard error."""
        return self.typical.over(self.promised)

    @property
    def well_determined(self) -> bool:
        """Whether the promise is below half of the prior std."""
        return self.promised < 0.5 * self.prior_std


def parameter_figures(parameter: str, prior_std: float, promised: float, fits: OneParameter) -> ParameterFigures:
    """Figures from all virtual experiments; what is said of errors is of the fits that did not fail."""
    fine, at_bound = fits.fine, int((fits.at_bound & fits.fine).sum())
    nothing = ParameterFigures(parameter, prior_std, promised, *(NOTHING,) * 6, at_bound)
    if np.isnan(promised):
        return nothing
    has_ends = fine & ~fits.at_bound & np.isfinite(fits.standard_error)
    covered, off = fits.covered & has_ends, fits.estimate - fits.truth
    counted = replace(
        nothing,
        coverage=share(covered),
        too_low=share(~covered & (off < 0)),
        too_high=share(~covered & (off > 0)),
        without_interval=int((~has_ends).sum()),
    )
    errors = off[fine]
    if len(errors) < FEWEST:
        return counted
    middle, reach = float(np.median(errors)), MOST_OFF * promised
    limited = np.clip(errors, middle - reach, middle + reach)  # which can only make them scatter less
    return replace(
        counted,
        bias=mean(errors),
        achieved=standard_deviation(errors - errors.mean(), 1),
        typical=typical_size(errors),
        rmse=standard_deviation(errors, 0).over(prior_std),
        claimed=mean(fits.standard_error[has_ends]),
        limited_ratio=standard_deviation(limited - limited.mean(), 1).over(promised),
    )


def mean(values: Array) -> Figure:
    if len(values) < FEWEST:
        return NOTHING
    return Figure(float(values.mean()), float(values.std(ddof=1) / np.sqrt(len(values))), len(values))


def standard_deviation(deviations: Array, taken: int) -> Figure:
    """Root mean square of deviations less `taken` degrees of freedom, with an error that holds for heavy tails too."""
    squares = deviations**2
    n = len(squares)
    value = float(np.sqrt(squares.sum() / (n - taken)))
    error = float(squares.std(ddof=1) / np.sqrt(n) / (2 * value)) if value else 0.0
    return Figure(value, error, n)


def typical_size(errors: Array) -> Figure:
    """Median of |error| over that of a standard normal variable; its error by the order statistics one standard deviation off."""
    sizes, n = np.sort(np.abs(errors)) / NORMAL_MEDIAN, len(errors)
    reach = np.sqrt(n) / 2
    low, high = int(np.floor(n / 2 - reach)), int(np.ceil(n / 2 + reach))
    return Figure(float(np.median(sizes)), float(sizes[min(high, n - 1)] - sizes[max(low, 0)]) / 2, n)


def share(hits: NDArray[np.bool_]) -> Figure:
    """A share with Wilson's error, which is not zero where all or none are hits."""
    if len(hits) < FEWEST:
        return NOTHING
    n, value = len(hits), float(hits.mean())
    return Figure(value, float(np.sqrt(value * (1 - value) / n + 1 / (4 * n**2)) / (1 + 1 / n)), n)
