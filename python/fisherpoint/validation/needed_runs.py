"""Number of virtual experiments that would decide whether a promise holds: from the power of the tests of `verdict`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from .figures import LEVEL, Figure
from .verdict import (
    BROKEN,
    CHANCE,
    COVERAGE_TOLERANCE,
    RATIO_TOLERANCE,
    Bounds,
    ParameterVerdict,
    normal_quantile,
    ratio_bounds,
    share_bounds,
)

POWER = 0.9
"""Probability with which the reported number of runs decides."""

NEAREST = 0.25
"""Smallest assumed distance of a figure from the edge of its tolerance, as a share of this."""

MOST_RUNS, MORE = 10_000_000, 1.05
"""Most runs that are named, and the factor between numbers that are tried."""


class _Assumed(NamedTuple):
    """Assumed value of a figure: the expected one where that agrees with the runs, at 5 % over all, else the observed one."""

    value: float
    expected: float
    tolerance: float
    spread: float  # of a ratio in one run; 0 for a share

    @property
    def outside(self) -> bool:
        return abs(self.value - self.expected) > self.tolerance

    def power(self, n: int, level: float) -> float:
        """Probability with which n runs show on which side of the tolerance it is; `level` is that of what is broken."""
        low, high = self.expected - self.tolerance, self.expected + self.tolerance
        of = self._of_ratio if self.spread else self._of_share
        if not self.outside:
            return max(0.0, of(n, low, CHANCE, 1) + of(n, high, CHANCE, -1) - 1.0)
        return of(n, high, level, 1) if self.value > high else of(n, low, level, -1)

    def _of_ratio(self, n: int, edge: float, level: float, sign: int) -> float:
        """Probability of the bound at this level above (1) or below (-1) an edge."""
        from scipy.special import ndtr  # late: `import fisherpoint` does without

        return float(ndtr(sign * (self.value - edge) * np.sqrt(n) / self.spread - normal_quantile(level)))

    def _of_share(self, n: int, edge: float, level: float, sign: int) -> float:
        from scipy.special import bdtr, bdtrc, bdtrik

        if not 0.0 < edge < 1.0:  # nothing lies beyond it
            return 0.0
        if sign > 0:  # at least so many hits; more have a probability of at most the level
            return float(bdtrc(np.ceil(bdtrik(1 - level, n, edge)), n, self.value))
        fewest = np.floor(bdtrik(level, n, edge))
        return float(bdtr(fewest - (bdtr(fewest, n, edge) > level), n, self.value)) if fewest >= 0 else 0.0


def needed_runs(verdicts: Mapping[str, ParameterVerdict], runs: int, level: float) -> int:
    """Approximate number of runs that decide for all parameters together, with a probability of nine in ten.

    Parameters
    ----------
    verdicts : mapping of parameter name to ParameterVerdict
        Of one design.
    runs : int
        That there were.
    level : float
        Of each test for what is broken.
    """
    left = [one for one in verdicts.values() if one.outcome != BROKEN]
    assumed = [_assumed(one, CHANCE / (4 * len(left))) for one in left]
    n = float(runs)
    while n < MOST_RUNS and sum(_missed(figures, int(n), level) for figures in assumed) > 1 - POWER:
        n *= MORE
    digits = 10 ** int(np.floor(np.log10(n)))
    return int(np.ceil(n / digits) * digits)


def _missed(figures: list[_Assumed], n: int, level: float) -> float:
    """Maximum probability that n runs do not decide for a parameter: one figure outside is enough, and all must be inside."""
    outside = [1.0 - one.power(n, level) for one in figures if one.outside]
    return min(outside) if outside else sum(1.0 - one.power(n, level) for one in figures)


def _assumed(verdict: ParameterVerdict, level: float) -> list[_Assumed]:
    """Ratio and coverage, each as expected unless it is off beyond chance at this level."""
    of = verdict.figures
    figures = []
    if np.isfinite(of.ratio.value):
        value = _value(of.ratio, ratio_bounds(of.ratio, level), 1.0, RATIO_TOLERANCE)
        spread = max(of.ratio.error * np.sqrt(of.ratio.n), value / np.sqrt(2.0))
        figures.append(_Assumed(value, 1.0, RATIO_TOLERANCE, float(spread)))
    if np.isfinite(of.coverage.value):
        value = _value(of.coverage, share_bounds(of.coverage, level), LEVEL, COVERAGE_TOLERANCE)
        figures.append(_Assumed(value, LEVEL, COVERAGE_TOLERANCE, 0.0))
    return figures


def _value(figure: Figure, bounds: Bounds, expected: float, tolerance: float) -> float:
    if bounds.low <= expected <= bounds.high:
        return expected
    off, least = figure.value - expected, NEAREST * tolerance
    away = min(abs(off), tolerance - least) if abs(off) <= tolerance else max(abs(off), tolerance + least)
    return float(expected + np.sign(off) * away)
