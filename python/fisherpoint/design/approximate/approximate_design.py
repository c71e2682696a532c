"""Designs as weights of points, with the proof of how good they are."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...basics.checks import check_choice, check_positive_int
from ...basics.extras import needed_for
from ...basics.result_files import Kept
from ...basics.values import Array
from ...information.previous import HasPoints
from ...information.problem_report import problem_sections
from ...points.experiments import Experiments
from ...points.points_or_runs import as_runs, points_of
from ...show.display import Plots, Shown
from ...show.section import Report, Section
from ..candidates.candidate_rows import CandidateRows
from ..candidates.point_rows import PointRows
from ..goal.averaged_criterion import Averaged, joined
from ..goal.criteria import Criterion
from ..goal.goal_criterion import criterion_of, known_beforehand
from ..weights.rounding import efficient_rounding
from .approximate_report import approximate_report
from .approximate_weights import ApproximateWeights

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


BEYOND = 1e-4
"""Largest excess of log phi of a design over its bound, by rounding and the tolerance of trajectories."""


@dataclass(frozen=True, eq=False, repr=False)
class ApproximateDesign(ApproximateWeights, Shown, Kept):
    """Weights of points: the share of all measurements that each is to get; `ApproximateWeights` has its attributes."""

    def _check_content(self) -> None:
        _ = self.criterion

    @cached_property
    def _goal_criterion(self) -> Criterion:
        """What was maximised, of block-diagonal matrices where that is over scenarios."""
        if self._scenarios is None:
            return self.criterion
        problems, average = self._scenarios
        return Averaged([criterion_of(one, self.goal) for one in problems], average, [self.problem.n_unknowns] * len(problems))

    def _rows(self, threads: int | None) -> PointRows:
        return PointRows(self.problem, threads, () if self._scenarios is None else self._scenarios[0])

    @property
    def _constant(self) -> Array | None:
        if self.n_experiments is None:
            return None
        return known_beforehand(self.problem, self.goal) / self.n_experiments

    def sensitivity(self, points: Experiments, *, threads: int | None = None) -> Array:
        """The sensitivity function (K,) at any points; NaN where a point is none. The design is optimal where it is <= `level`."""
        result = np.full(len(points), np.nan)
        rows, places = self._rows(threads).at_mean(points)
        result[places] = self.level * CandidateRows(rows, self._constant).along(self.half)
        return result

    def efficiency_of(self, points: Experiments | HasPoints, *, threads: int | None = None) -> float:
        """Lower bound of the efficiency of an exact design of L points, each measured once, against the best L measurements.

        The best weights are at least as good as the best L points, and what they can reach is bounded. The bound holds for
        designs of points among what was searched; a better design, which shows that the search has missed something, is warned of.

        Raises
        ------
        TypeError, ValueError
            For what are no points, points that are not valid at the prior mean, and another number than `n_experiments` where the
            prior's information was added.
        """
        of = points_of(points)
        given = None if of is None else as_runs(of).points
        if given is None:
            raise TypeError(f"points: expected Experiments or a design of these, given {type(points).__name__}")
        count = len(given)
        if not count:
            raise ValueError("points: expected at least one point, given none")
        if self.n_experiments not in (None, count):
            raise ValueError(f"points: expected as many as n_experiments, {self.n_experiments}, given {count}")
        rows, places = self._rows(threads).at_mean(given)
        if len(rows) < count:
            wrong = int(np.setdiff1d(np.arange(count), places)[0])
            raise ValueError(f"points: expected valid ones, given points[{wrong}], which is none at the prior mean")
        return self._share(CandidateRows(rows, self._constant).information(np.arange(count), np.full(count, 1 / count)))

    def _share(self, information: Array) -> float:
        into, own = self.estimable.into, self.information if self.goal.over is None else joined(list(self.information))
        inner = self._goal_criterion.within(self.estimable)
        ratio = inner.log_phi(into.T @ information @ into) - inner.log_phi(into.T @ own @ into)
        if ratio + np.log(self.efficiency) > BEYOND:
            warnings.warn(
                "points: expected a design that the bound holds for, given a better one: it has points that were not found when "
                "the region was searched; approximate again with another seed, or with candidates among which they are",
                stacklevel=3,
            )
        return float(np.exp(min(ratio + np.log(self.efficiency), 0.0)))

    def rounded(self, n: int) -> Experiments:
        """The points of an exact design of n measurements, by efficient rounding (Pukelsheim and Rieder 1992); points repeat.

        Raises
        ------
        ValueError
            For fewer measurements than points with a weight.
        """
        n = check_positive_int(n, "n")
        if n < len(self.points):
            raise ValueError(f"n: expected at least as many measurements as the design has points, {len(self.points)}, given {n}")
        return self.points[np.repeat(np.arange(len(self.points)), efficient_rounding(self.weights, n))]

    def plot(self, kind: str = "sensitivity", *, path: str | Path | None = None) -> Figure:
        """Draw the sensitivity function over each coordinate; needs matplotlib.

        Parameters
        ----------
        kind : {"sensitivity"}
        path : path, optional
            Where the picture is also written; the ending says the format, PNG where there is none.

        Returns
        -------
        matplotlib.figure.Figure
        """
        check_choice(kind, ("sensitivity",), "kind")
        with needed_for("plot"):
            from ...show.style import drawn
            from .approximate_pictures import sensitivity_figure

        model, values = self.problem.model, self.sensitivity(self.sample)
        of_support = self.sensitivity(self.points)
        return drawn(sensitivity_figure(model.axes, self.sample, values, self.points, of_support, self.weights, self.level), path)

    def to_pandas(self) -> pd.DataFrame:
        """One row per point of the support: its coordinates, SI units, and its weight."""
        with needed_for("to_pandas"):
            from ..results.frames import points_frame

        return points_frame(self.problem.model, self.points).assign(weight=self.weights)

    def _problem_sections(self) -> Sequence[Section]:
        return problem_sections(self.problem)

    def _plots(self) -> Plots:
        return {"sensitivity": self.plot}

    def report(self) -> Report:
        """The support, the value, and what is proven about it."""
        return approximate_report(self)
