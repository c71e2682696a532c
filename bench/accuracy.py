"""The accuracy that is asked of both sides, and the search for the loosest tolerance that gives it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .workload import OUTPUT_SCALES, Array


@dataclass(frozen=True)
class Errors:
    """Quantiles of the errors of many solutions."""

    median: float
    quantile_99: float
    worst: float

    @staticmethod
    def of(errors: Array) -> Errors:
        median, quantile_99, worst = np.quantile(errors, [0.5, 0.99, 1.0])
        return Errors(float(median), float(quantile_99), float(worst))


@dataclass(frozen=True)
class AccuracyRule:
    """99 % of the errors below one bound, all of them below another."""

    quantile_99: float = 1e-6
    worst: float = 1e-5

    def met_by(self, errors: Errors) -> bool:
        return errors.quantile_99 < self.quantile_99 and errors.worst < self.worst


ACCURACY_RULE = AccuracyRule()
"""For outputs and, in the measure of `sensitivity_errors`, for dy/dtheta."""


def output_errors(y: Array, reference: Array) -> Array:
    """Return the largest error of each trajectory's outputs relative to max(|y|, scale), (K,)."""
    return np.asarray(np.max(np.abs(y - reference) / np.maximum(np.abs(reference), OUTPUT_SCALES), axis=-1))


def sensitivity_errors(dy_dtheta: Array, reference: Array) -> Array:
    """Return the largest error of each experiment's dy/dtheta relative to the root mean square of the entry over all, (K,)."""
    size = root_mean_square(reference)
    return np.asarray(np.max(np.abs(dy_dtheta - reference) / np.where(size > 0, size, 1.0), axis=(1, 2)))


def root_mean_square(values: Array) -> Array:
    """Return it for each entry over the first axis."""
    return np.asarray(np.sqrt(np.mean(values**2, axis=0)))


def loosest_rtol(meets_rule: Callable[[float], bool]) -> float:
    """Return the loosest of 10^(-k/8), from 1e-3 on, that meets the rule.

    A search by halves on the assumption that the error grows with the tolerance, followed by a look at the next three looser
    ones, because it does not do so strictly. That is to the good of the side that is searched for.
    """
    loose, tight = 24, 88
    while tight - loose > 1:
        middle = (loose + tight) // 2
        loose, tight = (loose, middle) if meets_rule(_tolerance(middle)) else (middle, tight)
    if tight == 88:
        raise RuntimeError("expected a tolerance above 1e-11 that meets the accuracy rule, found none")
    looser = [k for k in range(max(tight - 4, 24), tight - 1) if meets_rule(_tolerance(k))]
    return _tolerance(looser[0] if looser else tight)


def _tolerance(k: int) -> float:
    return float(10 ** (-k / 8))
