"""Fits of parts of the data against each other: where they differ by more than their standard errors, the model lacks something."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..basics.checks import check_positive_int
from ..basics.values import Array, FrozenMapping
from ..show.display import Shown
from ..show.numbers import counted, number, p_value_text, probability
from ..show.section import Report, Section
from .least_squares import CONVERGED, ENDS, NOT_EVALUABLE, UNNOTICED, minimise
from .precision import Precision
from .residual_checks import OFF
from .statistics import FitStatistics
from .weighting import WeightedResiduals

MOST_EVALUATIONS = 200
"""Evaluations of the search of one part, which starts at the fit of all data."""

ALIKE = 1e-9
"""Share of the estimates' variance up to which that of a difference is nothing: the prior alone knows the parameter."""


@dataclass(frozen=True)
class PartOfData:
    """The fit of one part of the data.

    Attributes
    ----------
    name : str
    count : int
        Numbers measured in it.
    estimate, standard_errors : mapping of name to float
        SI units, by the noise of the fit of all data; without unknowns that the part does not determine.
    reason : str
        Why there is no fit; "" where there is one.
    """

    name: str
    count: int
    estimate: Mapping[str, float]
    standard_errors: Mapping[str, float]
    reason: str = ""


@dataclass(frozen=True)
class Difference:
    """How much the parts' estimates of one unknown, or of all together, differ.

    Attributes
    ----------
    chi_square : float
        Sum of squares of their differences, in units of what white noise makes of these.
    degrees_of_freedom : int
    p_value : float
        Probability of more by chance.
    """

    chi_square: float
    degrees_of_freedom: int
    p_value: float


@dataclass(frozen=True, eq=False, repr=False)
class Stability(Shown):
    """Fits of parts of the data beside each other, as `Fit.stability` makes them.

    Attributes
    ----------
    parts : tuple of PartOfData
    differences : mapping of name to Difference
        Of every unknown that two parts or more determine.
    together : Difference or None
        Of all unknowns that all fitted parts determine; None where there are none.
    units : mapping of name to str
    """

    parts: tuple[PartOfData, ...]
    differences: Mapping[str, Difference]
    together: Difference | None
    units: Mapping[str, str]

    def report(self) -> Report:
        """The estimates of the parts beside each other, and the tests of their differences."""
        fitted = [part for part in self.parts if not part.reason]
        rows, marked = [], []
        for k, (name, difference) in enumerate(self.differences.items()):
            estimates = [
                f"{number(part.estimate[name], 6)} +- {number(part.standard_errors[name], 2)}" if name in part.estimate else "-"
                for part in fitted
            ]
            test = (number(difference.chi_square, 3), str(difference.degrees_of_freedom), probability(difference.p_value))
            rows.append((name, self.units[name], *estimates, *test))
            if difference.p_value < OFF:
                marked.append(k)
        columns = ("parameter", "unit", *(part.name for part in fitted), "chi-square", "dof", "p")
        sections = [Section("Estimates of parts of the data", columns, tuple(rows), tuple(marked))] if rows else []
        facts = [(part.name, part.reason or f"{counted(part.count, 'number')}, fitted") for part in self.parts]
        sections.append(Section("Parts", (), facts))
        return Report(self._headline, sections, self._warnings)

    @property
    def _headline(self) -> str:
        if self.together is None:
            return f"Stability: {counted(len(self.parts), 'part')} of the data, which cannot be compared"
        test = f"chi-square {number(self.together.chi_square, 3)} with {self.together.degrees_of_freedom} degrees of freedom"
        return f"Stability: {counted(len(self.parts), 'part')} of the data, {test}, {p_value_text(self.together.p_value)}"

    @property
    def _warnings(self) -> Sequence[str]:
        apart = [name for name, difference in self.differences.items() if difference.p_value < OFF]
        if not apart and (self.together is None or self.together.p_value >= OFF):
            return ()
        which = f" in {', '.join(apart)}" if apart else " in all unknowns together"
        why = "the model or the noise is wrong, or the plant changed"
        return (f"the parts' fits differ by more than their standard errors{which}: {why}",)


class _Fitted(NamedTuple):
    """Estimate (P,) of a part in coordinates, covariance (P, P), and which unknowns are determined (P,)."""

    z: Array
    covariance: Array
    determined: NDArray[np.bool_]


def stability_of(fit: FitStatistics, parts: int | None = None) -> Stability:
    """See `Fit.stability`."""
    if parts is not None and check_positive_int(parts, "parts") < 2:
        raise ValueError(f"parts: expected at least 2, given {parts}")
    masks = _sets(fit) if parts is None and len(fit.data) > 1 else _pieces(fit, 2 if parts is None else parts)
    found, described = [], []
    for name, rows in masks.items():
        one, part = _fitted(fit, name, rows)
        described.append(part)
        if one is not None:
            found.append(one)
    prior = fit.weighted.prior_factor
    information = np.zeros((len(fit.z), len(fit.z))) if prior is None else prior.T @ prior
    degrees = np.inf if fit.noise_known else fit.degrees_of_freedom
    differences = {}
    for j, name in enumerate(fit.parameters):
        some = [one for one in found if one.determined[j]]
        if (difference := _difference(some, np.array([j]), information, degrees)) is not None:
            differences[name] = difference
    common = np.flatnonzero(np.all([one.determined for one in found], axis=0)) if found else np.zeros(0, dtype=np.intp)
    together = _difference(found, common, information, degrees)
    return Stability(tuple(described), FrozenMapping(differences), together, fit.units)


def _sets(fit: FitStatistics) -> dict[str, NDArray[np.bool_]]:
    """Which samples are of each set of data, by its name."""
    of = np.repeat(np.arange(len(fit.data)), [len(part.samples) for part in fit.data])
    return {f"data {k + 1}": of == k for k in range(len(fit.data))}


def _pieces(fit: FitStatistics, parts: int) -> dict[str, NDArray[np.bool_]]:
    """Which samples are of each group of consecutive points or runs, or of each piece of a record or single run, by its name."""
    of, first = np.zeros(len(fit.residuals), dtype=np.intp), 0
    for part in fit.data:
        rows = slice(first, first + len(part.samples))
        numbers = fit.series.numbers[rows] - fit.series.numbers[first]
        count = int(numbers[-1]) + 1
        if count == 1:
            numbers, count = np.arange(len(numbers)), len(numbers)
        of[rows] = numbers * parts // count
        first = rows.stop
    words = ("first half", "second half") if parts == 2 else tuple(f"part {k + 1}" for k in range(parts))
    return {name: of == k for k, name in enumerate(words)}


def _fitted(fit: FitStatistics, name: str, rows: NDArray[np.bool_]) -> tuple[_Fitted | None, PartOfData]:
    before = _starts_before(fit, rows)
    weighted = _with_starts(fit, _only(fit.weighted, rows), before)
    count = int(weighted.measured.sum())
    unknowns = weighted.unknowns

    def without(reason: str) -> tuple[None, PartOfData]:
        return None, PartOfData(name, count, FrozenMapping({}), FrozenMapping({}), reason)

    if not count:
        return without("nothing was measured in it")
    z0, bounds = np.where(before, 0.0, fit.z)[None], (unknowns.lower, unknowns.upper)
    minima = minimise(weighted, z0, *bounds, MOST_EVALUATIONS, accuracy=weighted.accuracy)
    end = int(unknowns.ended(minima)[0])
    if end == NOT_EVALUABLE:
        return without("no fit: its trajectories are not ok")
    if end not in (CONVERGED, UNNOTICED):
        return without(f"no fit: {ENDS[end].words}")
    z = minima.z[0]
    precision = Precision.of(weighted.scores(z[None], np.zeros(1, dtype=np.intp))[1][0], unknowns.held(z))
    determined = precision.determined & ~before
    if not determined.any():
        return without("no fit: it determines no unknown")
    values = unknowns.values(z[None])
    errors = np.sqrt(np.diag(precision.covariance)) * np.abs(unknowns.slopes(values)[0])
    estimates, stds = (
        FrozenMapping({n: float(v) for n, v, d in zip(unknowns.names, given, determined, strict=True) if d})
        for given in (values[0], errors)
    )
    return _Fitted(z, precision.covariance, determined), PartOfData(name, count, estimates, stds)


def _starts_before(fit: FitStatistics, rows: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which unknowns (P,) are starts of records whose first samples are not in the part, though all data determine them."""
    firsts = np.cumsum([0, *(len(part.samples) for part in fit.data)])
    place = {id(part): int(first) for part, first in zip(fit.data, firsts, strict=False)}
    starts = fit.weighted.observed.starts
    away = [name in starts and not rows[place[id(starts[name][1])]] for name in fit.parameters]
    return np.asarray(np.array(away, dtype=bool) & fit.precision.determined)


def _with_starts(fit: FitStatistics, weighted: WeightedResiduals, before: NDArray[np.bool_]) -> WeightedResiduals:
    """The residuals where these starts are as all data have them, with their standard errors: a late part would not find them."""
    if not before.any():
        return weighted
    unknowns, errors = weighted.unknowns, np.sqrt(np.diag(fit.precision.covariance)) * np.abs(fit.slopes)
    unknowns = replace(
        unknowns,
        center=np.where(before, fit.values, unknowns.center),
        scale=np.where(before, errors, unknowns.scale),
        log=unknowns.log & ~before,
        lower=np.where(before, -np.inf, unknowns.lower),
        upper=np.where(before, np.inf, unknowns.upper),
    )
    of_prior = np.zeros((0, len(before))) if weighted.prior_factor is None else np.where(before, 0.0, weighted.prior_factor)
    return replace(weighted, unknowns=unknowns, prior_factor=np.concatenate([of_prior, np.eye(len(before))[before]]))


def _only(weighted: WeightedResiduals, rows: NDArray[np.bool_]) -> WeightedResiduals:
    """The residuals of some samples, the others as if they were not measured."""
    y = np.where(rows[:, None], weighted.y, np.nan)
    common = tuple(replace(error, moved=np.where(rows[error.rows, None, None], error.moved, 0.0)) for error in weighted.common)
    return replace(weighted, y=y, common=common)


def _difference(found: Sequence[_Fitted], columns: NDArray[np.intp], information: Array, degrees: float) -> Difference | None:
    """The differences of estimates of some unknowns; `information` (P, P) of the prior is in all of them."""
    from scipy.special import chdtrc, fdtrc

    if len(found) < 2 or not len(columns):
        return None
    n, g = len(columns), len(found)
    covariance = np.empty((g, n, g, n))
    for k, one in enumerate(found):
        for other in range(g):
            shared = one.covariance if other == k else one.covariance @ information @ found[other].covariance
            covariance[k, :, other] = shared[np.ix_(columns, columns)]
    contrast = np.kron(np.eye(g)[1:] - np.eye(g)[0], np.eye(n))
    off = contrast @ np.concatenate([one.z[columns] for one in found])
    of_differences = contrast @ covariance.reshape(g * n, g * n) @ contrast.T
    size = np.tile(np.sqrt(np.sum([np.diag(one.covariance)[columns] for one in found], axis=0)), g - 1)
    sizes, directions = np.linalg.eigh(of_differences / np.outer(size, size))
    there = sizes > ALIKE
    rank = int(there.sum())
    if not rank:
        return None
    chi_square = float(np.sum(np.square(directions[:, there].T @ (off / size)) / sizes[there]))
    p_value = fdtrc(rank, degrees, chi_square / rank) if np.isfinite(degrees) else chdtrc(rank, chi_square)
    return Difference(chi_square, rank, float(p_value))
