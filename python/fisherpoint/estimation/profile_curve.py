"""The deviance over one unknown, with all others estimated anew at each of its values."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..basics.stop_reason import StopReason
from ..basics.values import Array

BETTER = 1e-4
"""Fall of the deviance below that of the fit from which on the fit was not at the minimum."""


@dataclass(frozen=True, eq=False)
class ProfileCurve:
    """The likelihood of one unknown, with all others estimated anew at each of its values.

    Attributes
    ----------
    name, unit : str
    level : float
        Of the confidence interval.
    estimate : float
    values : ndarray, (G,)
        Of the unknown, ascending, SI units; the ends of the interval and the estimate are among them.
    deviance : ndarray, (G,)
        Zero at the estimate; twice the fall of the log-likelihood.
    converged : ndarray of bool, (G,)
        Whether the search for the others came to its end at each value; where it did not, the deviance is too large.
    unknowns : ndarray, (G, P)
        All unknowns at each value, in the order of the fit's, SI units.
    threshold : float
        Deviance at the ends of the interval.
    interval : tuple of float
        Where the deviance reaches the threshold; -inf, or 0 of a positive unknown, and inf where it does not.
    ends : tuple of StopReason
        Why the search for each end of the interval ended: "converged" where it was found, else "at_bound", "not_bounded", or
        "not_evaluable" where trajectories are not valid beyond this value.
    linear_interval : tuple of float
        From the standard error, as `Fit.intervals`.
    """

    name: str
    unit: str
    level: float
    estimate: float
    values: Array
    deviance: Array
    converged: NDArray[np.bool_]
    unknowns: Array
    threshold: float
    interval: tuple[float, float]
    ends: tuple[StopReason, StopReason]
    linear_interval: tuple[float, float]

    @property
    def signed_root(self) -> Array:
        """Root of the deviance, negative below the estimate, (G,): over the values of a linear model, a straight line."""
        return np.sign(self.values - self.estimate) * np.sqrt(np.maximum(self.deviance, 0.0))

    @property
    def better(self) -> bool:
        """Whether a lower minimum than the fit's was found on the way; then estimate again from `unknowns` there."""
        return bool(self.deviance.min() < -BETTER)
