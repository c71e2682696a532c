"""Whether a promise holds: in words, with the Monte Carlo error and the number of parameters taken into account.

A promise of a parameter is broken where its ratio or its coverage lies outside a tolerance beyond chance: at a level of 5 % over
all tests of all parameters and designs together (Bonferroni). It holds where both lie inside beyond chance, each at 5 %: no
correction is needed there, as all parts have to be shown. Between the two the runs are too few, and nothing is claimed.

Shares have exact binomial bounds (Clopper and Pearson 1934). Ratios have those of chi-square, which are exact where errors are
normal, or those of the errors' own fourth moment where these are wider, as heavy tails make them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..show.numbers import computed
from .design_validation import DesignValidation
from .figures import LEVEL, Figure, ParameterFigures

RATIO_TOLERANCE = 0.1
"""Difference of achieved over promised from 1 that is tolerated."""

COVERAGE_TOLERANCE = 0.03
"""Difference of the coverage from 95 % that is tolerated."""

CHANCE = 0.05
"""Level of what is said."""

TESTS = 5
"""Number of tests of each parameter: ratio, limited ratio and coverage too high, ratio and coverage too low."""

HOLDS, BROKEN, OPEN = "holds", "broken", "open"


@dataclass(frozen=True)
class ParameterVerdict:
    """Verdict on one parameter.

    Attributes
    ----------
    parameter : str
    outcome : {"holds", "broken", "open"}
    ratio, coverage : {"", "low", "high"}
        The direction in which achieved over promised, and coverage, lie outside the tolerance; empty where that is not shown.
    figures : ParameterFigures
    """

    parameter: str
    outcome: str
    ratio: str
    coverage: str
    figures: ParameterFigures


def verdicts_of(designs: Mapping[str, DesignValidation]) -> dict[str, dict[str, ParameterVerdict]]:
    """The verdict on every parameter that a design promises something of."""
    level = level_of_each(designs)
    return {
        name: {parameter: _verdict(of, level) for parameter, of in design.parameters.items() if not np.isnan(of.promised)}
        for name, design in designs.items()
    }


def level_of_each(designs: Mapping[str, DesignValidation]) -> float:
    """Level of each of the tests for what is broken."""
    promised = sum(not np.isnan(of.promised) for design in designs.values() for of in design.parameters.values())
    return CHANCE / max(TESTS * promised, 1)


class Bounds(NamedTuple):
    """One-sided bounds of a figure, each at a level."""

    low: float
    high: float

    def beyond(self, expected: float, tolerance: float) -> str:
        """The direction in which the figure lies outside a tolerance: "low", "high", or "" where that is not shown."""
        if self.low > expected + tolerance:
            return "high"
        return "low" if self.high < expected - tolerance else ""

    def within(self, expected: float, tolerance: float) -> bool:
        """Whether it is shown that the figure lies inside."""
        return bool(expected - tolerance < self.low and self.high < expected + tolerance)


def ratio_bounds(ratio: Figure, level: float) -> Bounds:
    """Bounds of a standard deviation over its expected value; none where there is no figure."""
    from scipy.special import chdtri  # late: `import fisherpoint` does without

    if not np.isfinite(ratio.value):
        return Bounds(-np.inf, np.inf)
    freedom, reach = ratio.n - 1, normal_quantile(level) * ratio.error
    of_normal = [float(ratio.value * np.sqrt(freedom / chdtri(freedom, one))) for one in (level, 1 - level)]
    return Bounds(min(of_normal[0], ratio.value - reach), max(of_normal[1], ratio.value + reach))


def share_bounds(share: Figure, level: float) -> Bounds:
    """Exact bounds of a probability from the share of hits; none where there is no figure."""
    from scipy.special import betaincinv

    if not np.isfinite(share.value):
        return Bounds(-np.inf, np.inf)
    n, hits = share.n, round(share.value * share.n)
    low = float(betaincinv(hits, n - hits + 1, level)) if hits else 0.0
    return Bounds(low, float(betaincinv(hits + 1, n - hits, 1 - level)) if hits < n else 1.0)


def normal_quantile(level: float) -> float:
    """Standard errors that a normal variable exceeds with a probability of `level`."""
    from scipy.special import ndtri

    return float(-ndtri(level))


def _verdict(of: ParameterFigures, level: float) -> ParameterVerdict:
    ratio = ratio_bounds(of.ratio, level).beyond(1.0, RATIO_TOLERANCE)
    if not ratio and ratio_bounds(of.limited_ratio, level).beyond(1.0, RATIO_TOLERANCE) == "high":
        ratio = "high"
    coverage = share_bounds(of.coverage, level).beyond(LEVEL, COVERAGE_TOLERANCE)
    inside = ratio_bounds(of.ratio, CHANCE).within(1.0, RATIO_TOLERANCE)
    inside = inside and share_bounds(of.coverage, CHANCE).within(LEVEL, COVERAGE_TOLERANCE)
    outcome = BROKEN if ratio or coverage else HOLDS if inside else OPEN
    return ParameterVerdict(of.parameter, outcome, ratio, coverage, of)


def in_words(broken: Sequence[ParameterVerdict]) -> str:
    """What is wrong: "errors of a are 18 % larger than promised; intervals of a, b contain the truth in 79 to 88 % (...)"."""
    parts = [f"errors of {one.parameter} are {_size(one)} promised" for one in broken if one.ratio]
    for direction in ("low", "high"):
        some = [one for one in broken if one.coverage == direction]
        if some:
            shares = (_range(getattr(one.figures, label).value for one in some) for label in ("coverage", "too_low", "too_high"))
            covered, low, high = shares
            names = ", ".join(one.parameter for one in some)
            parts.append(f"intervals of {names} contain the truth in {covered} (estimates {low} too low, {high} too high)")
    return "; ".join(parts)


def _size(verdict: ParameterVerdict) -> str:
    value = verdict.figures.ratio.value
    if value >= 2:
        return f"{computed(value)} times as large as"
    return f"{100 * abs(value - 1):.0f} % {'larger' if verdict.ratio == 'high' else 'smaller'} than"


def _range(shares: Iterable[float]) -> str:
    rounded = sorted(round(100 * share) for share in shares)
    return f"{rounded[0]} %" if rounded[0] == rounded[-1] else f"{rounded[0]} to {rounded[-1]} %"
