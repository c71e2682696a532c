"""Results of the virtual experiments of one design."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from ..basics.field_checks import Extents
from ..basics.values import Array, FrozenMapping
from ..points.points_or_runs import Points, as_runs
from ..show.numbers import computed, counted, with_error
from ..show.section import Report, Section
from ..show.table_preview import InNotebooks
from .figures import OneParameter, ParameterFigures, parameter_figures
from .fits import NO_DATA, WRONG, VirtualFits


@dataclass(frozen=True, eq=False)
class DesignValidation(InNotebooks):
    """Results of the virtual experiments of one design.

    Attributes
    ----------
    points : Experiments or Runs
    parameters : mapping of parameter name to ParameterFigures
    fits : int
        That did not fail: figures of errors are of these.
    failures : mapping of reason to int
    null_directions : tuple of str
        Changes of the parameters that the points do not notice at the prior mean.
    per_run : VirtualFits or None
        Truths, estimates and standard errors of every virtual experiment; None where the points determine no parameter, or are
        `without` a promise, and nothing was fitted.
    local : mapping of parameter name to ParameterFigures
        Of local parameters: figures of all their values together, as if each was a fit of its own. The promise is the root mean
        square of those of the values.
    values : mapping of parameter name to int
        How many values each local parameter has.
    without : str
        Why nothing is promised: which points or runs have no trajectory at the prior mean; empty where all have one.
    """

    points: Points
    parameters: Mapping[str, ParameterFigures]
    fits: int
    failures: Mapping[str, int]
    null_directions: tuple[str, ...]
    per_run: VirtualFits | None
    local: Mapping[str, ParameterFigures]
    values: Mapping[str, int]
    without: str = ""

    _EXTENTS: ClassVar[Extents] = {
        "per_run.truth": ("runs", "parameters"),
        "per_run.estimate": ("runs", "parameters"),
        "per_run.standard_error": ("runs", "parameters"),
        "per_run.covered": ("runs", "parameters"),
        "per_run.at_bound": ("runs", "parameters"),
        "per_run.failure": ("runs",),
        **{f"per_run.local_{name}": ("runs", "L") for name in ("error", "standard_error", "covered")},
        "values": ("local",),
    }

    @classmethod
    def of(
        cls,
        points: Points,
        promised: Mapping[str, float],
        prior_std: Mapping[str, float],
        null_directions: tuple[str, ...],
        fits: VirtualFits | None,
        local: Mapping[str, Array] = FrozenMapping({}),
    ) -> Self:
        """Figures of the fits (n, P), whose parameters are in the order of `promised`; `local` is promised of their values."""
        values = {name: len(of) for name, of in local.items()}
        given = fits if fits is not None else VirtualFits.none(len(promised), sum(values.values()))
        fine = given.failure == ""
        figures = {}
        for j, (name, error) in enumerate(promised.items()):
            truth, estimate, standard_error = given.truth[:, j], given.estimate[:, j], given.standard_error[:, j]
            one = OneParameter(truth, estimate, standard_error, given.covered[:, j], given.at_bound[:, j], fine)
            figures[name] = parameter_figures(name, prior_std[name], error, one)
        failures = FrozenMapping(dict(Counter(given.failure[~fine].tolist())))
        found = cls(points, FrozenMapping(figures), int(fine.sum()), failures, null_directions, fits, {}, FrozenMapping(values))
        pooled = {}
        for name, errors in local.items():
            columns, again = found._columns(name), np.repeat(fine, values[name])
            off, standard_error = given.local_error[:, columns].ravel(), given.local_standard_error[:, columns].ravel()
            one = OneParameter(0 * off, off, standard_error, given.local_covered[:, columns].ravel(), ~again & again, again)
            pooled[name] = parameter_figures(name, prior_std[name], float(np.sqrt(np.mean(np.square(errors)))), one)
        return replace(found, local=FrozenMapping(pooled))

    @property
    def figures(self) -> Mapping[str, ParameterFigures]:
        """Figures of all parameters, local ones last."""
        return {**self.parameters, **self.local}

    def errors(self, name: str) -> Array:
        """Errors of the estimates of a parameter, or of all values of a local one, in the fits that did not fail."""
        assert self.per_run is not None
        errors: Array = self.per_run.estimate - self.per_run.truth
        columns = self._columns(name) if name in self.local else [list(self.parameters).index(name)]
        errors = self.per_run.local_error if name in self.local else errors
        return np.asarray(errors[self.per_run.failure == ""][:, columns].ravel())

    def _columns(self, name: str) -> slice:
        """Where the values of a local parameter are among all."""
        first = sum(count for other, count in self.values.items() if list(self.values).index(other) < list(self.values).index(name))
        return slice(first, first + self.values[name])

    @classmethod
    def none(cls, points: Points, estimated: Iterable[str], local: Iterable[str], std: Mapping[str, float], why: str) -> Self:
        """Validation of points some of which have no trajectory at the prior mean."""
        nothing = {name: np.full(1, np.nan) for name in local}
        return replace(cls.of(points, dict.fromkeys(estimated, np.nan), std, (), None, nothing), without=why)

    def _in_notebook(self) -> Report:
        rows = []
        for name, of in self.figures.items():
            prior = of.prior_std
            ratio, coverage = of.ratio, of.coverage
            shares = (with_error(ratio.value, ratio.error), with_error(100 * coverage.value, 100 * coverage.error, " %"))
            rows.append((name, computed(of.promised / prior), computed(of.achieved.value / prior), *shares))
        columns = ("parameter", "promised, of prior std", "achieved", "ratio", "coverage")
        failed = [f"{counted(count, 'virtual experiment')} without a fit: {reason}" for reason, count in self.failures.items()]
        return Report(f"{self.size}, {counted(self.fits, 'fit')}", [Section("", columns, rows, notes=failed)])

    @property
    def size(self) -> str:
        """How many points there are, or runs and samples."""
        runs, count = as_runs(self.points), counted(len(self.points), self.points.kind)
        return f"{count} of {counted(int(runs.measured.sum()), 'sample')}" if runs is self.points else count

    @property
    def failed(self) -> int:
        """Virtual experiments without a fit: no data, no minimum, or a wrong one."""
        return sum(self.failures.values())

    @property
    def wrong_minima(self) -> int:
        """Fits that ended in a wrong minimum from all starts: from the true parameters the search ends clearly lower."""
        return self.failures.get(WRONG, 0)

    @property
    def without_data(self) -> int:
        """Virtual experiments whose true trajectories do not exist."""
        return sum(count for reason, count in self.failures.items() if reason.startswith(NO_DATA))

    @property
    def rmse(self) -> float:
        """Geometric mean over the parameters of the root mean square error over the prior std; NaN where one has none."""
        sizes: Array = np.array([figures.rmse.value for figures in self.parameters.values()])
        return float(np.exp(np.mean(np.log(sizes))))
