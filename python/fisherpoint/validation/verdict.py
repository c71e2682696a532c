"""Whether a promise holds: in words, with the Monte Carlo error and the number of parameters taken into account.

A promise of a parameter is broken where its ratio or its coverage lies outside a tolerance beyond chance: at a level of 5 % over
all parameters and directions of all designs together (Bonferroni). It holds where both lie inside beyond chance, each at 5 %: no
correction is needed there, as all parts have to be shown. Between the two the runs are too few to tell, and nothing is claimed.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

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

HOLDS, BROKEN, OPEN = "holds", "broken", "open"


@dataclass(frozen=True)
class ParameterVerdict:
    """What was shown of one parameter.

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
    tests = 4 * sum(not np.isnan(of.promised) for design in designs.values() for of in design.parameters.values())
    return {
        name: {
            parameter: _verdict(of, _quantile(CHANCE / max(tests, 1)), _quantile(CHANCE))
            for parameter, of in design.parameters.items()
            if not np.isnan(of.promised)
        }
        for name, design in designs.items()
    }


def _quantile(level: float) -> float:
    from scipy.special import ndtri  # late: `import fisherpoint` does without

    return float(-ndtri(level))


def _verdict(of: ParameterFigures, far: float, near: float) -> ParameterVerdict:
    ratio = _outside(of.ratio, 1.0, RATIO_TOLERANCE, far)
    if not ratio and _outside(of.limited_ratio, 1.0, RATIO_TOLERANCE, far) == "high":
        ratio = "high"
    coverage = _outside(of.coverage, LEVEL, COVERAGE_TOLERANCE, far)
    inside = _inside(of.ratio, 1.0, RATIO_TOLERANCE, near) and _inside(of.coverage, LEVEL, COVERAGE_TOLERANCE, near)
    outcome = BROKEN if ratio or coverage else HOLDS if inside else OPEN
    return ParameterVerdict(of.parameter, outcome, ratio, coverage, of)


def _outside(figure: Figure, expected: float, tolerance: float, quantile: float) -> str:
    if not np.isfinite(figure.value):
        return ""
    if figure.value - quantile * figure.error > expected + tolerance:
        return "high"
    return "low" if figure.value + quantile * figure.error < expected - tolerance else ""


def _inside(figure: Figure, expected: float, tolerance: float, quantile: float) -> bool:
    return bool(abs(figure.value - expected) + quantile * figure.error < tolerance)


def needed_runs(verdicts: Mapping[str, ParameterVerdict], runs: int) -> int:
    """About how many runs tell what is open, if the ratios and coverages are as they seem or as promised, whichever is nearer."""
    quantile, most = _quantile(CHANCE), float(runs)
    for of in (verdict.figures for verdict in verdicts.values() if verdict.outcome == OPEN):
        for figure, expected, tolerance in ((of.ratio, 1.0, RATIO_TOLERANCE), (of.coverage, LEVEL, COVERAGE_TOLERANCE)):
            if np.isfinite(figure.value):
                room = max(abs(tolerance - abs(figure.value - expected)), tolerance / 4)
                most = max(most, runs * (quantile * figure.error / room) ** 2)
    digits = 10 ** int(np.floor(np.log10(most)))
    return int(np.ceil(most / digits) * digits)


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
