"""Results of the virtual experiments of one design."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from ..basics.field_checks import Extents
from ..basics.values import Array, FrozenMapping
from ..points.runs import Points, as_runs
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
    without : str
        Why nothing is promised: which points or runs have no trajectory at the prior mean; empty where all have one.
    """

    points: Points
    parameters: Mapping[str, ParameterFigures]
    fits: int
    failures: Mapping[str, int]
    null_directions: tuple[str, ...]
    per_run: VirtualFits | None
    without: str = ""

    _EXTENTS: ClassVar[Extents] = {
        "per_run.truth": ("runs", "parameters"),
        "per_run.estimate": ("runs", "parameters"),
        "per_run.standard_error": ("runs", "parameters"),
        "per_run.covered": ("runs", "parameters"),
        "per_run.at_bound": ("runs", "parameters"),
        "per_run.failure": ("runs",),
    }

    @classmethod
    def of(
        cls,
        points: Points,
        promised: Mapping[str, float],
        prior_std: Mapping[str, float],
        null_directions: tuple[str, ...],
        fits: VirtualFits | None,
    ) -> DesignValidation:
        """Figures of the fits (n, P), whose parameters are in the order of `promised`."""
        given = fits if fits is not None else VirtualFits.none(len(promised))
        fine = given.failure == ""
        figures = {}
        for j, (name, error) in enumerate(promised.items()):
            truth, estimate, standard_error = given.truth[:, j], given.estimate[:, j], given.standard_error[:, j]
            one = OneParameter(truth, estimate, standard_error, given.covered[:, j], given.at_bound[:, j], fine)
            figures[name] = parameter_figures(name, prior_std[name], error, one)
        failures = Counter(given.failure[~fine].tolist())
        return cls(points, FrozenMapping(figures), int(fine.sum()), FrozenMapping(dict(failures)), null_directions, fits)

    @classmethod
    def none(cls, points: Points, prior_std: Mapping[str, float], why: str) -> DesignValidation:
        """Validation of points some of which have no trajectory at the prior mean."""
        return replace(cls.of(points, dict.fromkeys(prior_std, np.nan), prior_std, (), None), without=why)

    def _in_notebook(self) -> Report:
        rows = []
        for name, of in self.parameters.items():
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
