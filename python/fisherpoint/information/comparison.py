"""Comparison of quadrature rules on a problem: error against a converged rule, and cost."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np

from ..basics.checks import as_float, as_sequence, check_type
from ..basics.extras import needed_for
from ..basics.result_files import Kept
from ..basics.values import Array
from ..points.experiments import Experiments
from ..points.predictive import PredictiveCovariance, predictive_covariance
from ..prior.rules import GaussHermite, LinearizedRule, Rule, Sobol, SparseGaussHermite, TensorGrid, Unscented
from ..show.display import Plots, Shown
from ..show.numbers import counted
from ..show.section import Report, Section
from .problem import DesignProblem

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

CONVERGED, NEXT_LOWER = Sobol(2**18), Sobol(2**17)
"""The reference rule, and the one that shows how far the reference is converged: with equal weights neither is thrown off by
outputs that are not smooth in the parameters, as the sparse rules of high level are."""

LARGEST_GRID = 10**5
"""Nodes up to which tensor rules are tried where no rules are given."""


@dataclass(frozen=True)
class Errors:
    """Median, 90th percentile and largest relative error of the covariances of points (Frobenius, outputs in converged stds)."""

    median: float
    most: float
    worst: float

    @staticmethod
    def of(errors: Array) -> Errors | None:
        """None where there is no point."""
        if not len(errors):
            return None
        return Errors(float(np.median(errors)), float(np.quantile(errors, 0.9)), float(np.max(errors)))


@dataclass(frozen=True)
class RuleRow:
    """Error and cost of one rule.

    Attributes
    ----------
    rule : Rule
    nodes : int
    errors : Errors or None
        Over the points that exist under this rule and under the converged one; None where there are none.
    seconds : float
        Wall time for one point.
    excluded : int
        Points whose status is not ok under the rule.
    projection : float
        The largest; see `PredictiveCovariance.projection`.
    """

    rule: Rule
    nodes: int
    errors: Errors | None
    seconds: float
    excluded: int
    projection: float


@dataclass(frozen=True, repr=False)
class RuleComparison(Shown, Kept):
    """Result of `compare_rules`; it shows itself as a table.

    Attributes
    ----------
    points : int
    rows : tuple of RuleRow
        In the order in which the rules were given.
    converged : RuleRow
        The rule that the others are measured against; its errors are its distance to `next_lower`, by the same measure: an
        error that is not much larger means nothing.
    next_lower : Rule
    """

    points: int
    rows: tuple[RuleRow, ...]
    converged: RuleRow
    next_lower: Rule

    def to_pandas(self) -> pd.DataFrame:
        """One row per rule, the converged one last; errors are relative, seconds are of one point."""
        with needed_for("to_pandas"):
            import pandas as pd

        none = Errors(np.nan, np.nan, np.nan)
        rows = [
            {"rule": str(row.rule), "nodes": row.nodes, **asdict(row.errors or none), "seconds": row.seconds,
             "excluded": row.excluded, "projection": row.projection}
            for row in (*self.rows, self.converged)
        ]  # fmt: skip
        return pd.DataFrame(rows).set_index("rule")

    def _plots(self) -> Plots:
        return {"rules": self.plot}

    def plot(self, *, path: str | Path | None = None) -> Figure:
        """Draw the errors of the rules over the time that they take; needs matplotlib.

        Parameters
        ----------
        path : path, optional
            Where the picture is also written; the ending says the format, PNG where there is none.
        """
        with needed_for("plot"):
            from ..show.style import drawn
            from .pictures import plot_rules

        names = [f"{row.rule}, {row.nodes} nodes" for row in self.rows]
        seconds = np.array([row.seconds for row in self.rows])
        errors = np.array([(row.errors.median, row.errors.most) if row.errors else (np.nan, np.nan) for row in self.rows])
        own = self.converged.errors.most if self.converged.errors else np.nan
        return drawn(plot_rules(names, seconds, errors, own, str(self.converged.rule)), path)

    def cheapest(self, within: float = 0.01) -> RuleRow | None:
        """Return the fastest rule whose error is within this at the 90th percentile; None where there is none."""
        limit = as_float(within, "within")
        enough = [row for row in self.rows if row.errors is not None and row.errors.most <= limit]
        return min(enough, key=lambda row: row.seconds, default=None)

    def report(self) -> Report:
        """One row per rule, the converged one last."""
        columns = ("rule", "nodes", "median", "90 %", "worst", "us/point", "excluded", "projected")
        rows = [*map(_cells, self.rows), _cells(self.converged)]
        cheapest = self.cheapest()
        enough = "none of these" if cheapest is None else f"{cheapest.rule}, the fastest such rule"
        notes = [
            f"The errors of {self.converged.rule} are its distance to {self.next_lower}",
            f"within 1 % at the 90th percentile: {enough}",
        ]
        headline = f"Predictive covariances of {counted(self.points, 'point')}, error relative to {self.converged.rule}"
        return Report(headline, [Section("", columns, rows, notes=notes)])


def compare_rules(
    problem: DesignProblem, points: Experiments, rules: Sequence[Rule] | None = None, *, threads: int | None = None
) -> RuleComparison:
    """Compare rules on a problem's points: error against a converged rule, and cost. Takes about a second for five points.

    Parameters
    ----------
    problem : DesignProblem
        Its model, prior, estimated parameters, tolerance, kinks and jumps are taken, and its rule where no rules are given.
    points : Experiments
        At least one; about twenty random points of the region say what is typical.
    rules : sequence of Rule, optional
        Default: one or a few of every kind, and the problem's own.
    threads : int, optional

    Returns
    -------
    RuleComparison

    Raises
    ------
    TypeError, ValueError
        For misuse, and where no point exists under the converged rule.
    """
    check_type(problem, DesignProblem, "problem")
    check_type(points, Experiments, "points")
    chosen = _default_rules(problem) if rules is None else as_sequence(rules, "rules", "rules")
    for rule in chosen:
        if not isinstance(rule, Rule):
            raise TypeError(f"rules: expected rules such as fisherpoint.SparseGaussHermite(2), given {type(rule).__name__}")

    def run(rule: Rule) -> PredictiveCovariance:
        return predictive_covariance(
            problem.model,
            points,
            problem.prior,
            rule,
            rtol=problem.rtol,
            threads=threads,
            kinks=problem.kinks,
            jumps=problem.jumps,
            parameters=problem.estimated,
        )

    converged, seconds = _timed(lambda: run(CONVERGED))
    if not (converged.status == 0).any():
        raise ValueError(f"points: expected at least one that is ok under {CONVERGED}, given none of {len(points)}")
    distances = Errors.of(_errors(run(NEXT_LOWER), converged))
    rows = []
    for rule in chosen:
        result, cost = _timed(lambda rule=rule: run(rule))  # type: ignore[misc]
        rows.append(_row(problem, rule, result, cost, Errors.of(_errors(result, converged))))
    return RuleComparison(len(points), tuple(rows), _row(problem, CONVERGED, converged, seconds, distances), NEXT_LOWER)


def _default_rules(problem: DesignProblem) -> tuple[Rule, ...]:
    small = 3 ** len(problem.estimated) <= LARGEST_GRID
    grids: list[Rule] = [TensorGrid(), GaussHermite(3)] if small else []
    rules = [LinearizedRule(), Unscented(), SparseGaussHermite(2), SparseGaussHermite(3), *grids, *(Sobol(4**n) for n in (5, 6, 7))]
    return tuple(rules if problem.rule in rules else [*rules, problem.rule])


def _timed(task: Callable[[], PredictiveCovariance]) -> tuple[PredictiveCovariance, float]:
    """The result, and the seconds: the best of three where the first is over soon, which pays for tables that are kept."""
    best = np.inf
    for _ in range(3):
        start = perf_counter()
        result = task()
        best = min(best, perf_counter() - start)
        if best > 0.2:
            break
    return result, best


def _row(problem: DesignProblem, rule: Rule, result: PredictiveCovariance, seconds: float, errors: Errors | None) -> RuleRow:
    nodes, points = len(rule.core_nodes(problem.prior, problem.estimated)), len(result.status)
    excluded, projection = int(np.count_nonzero(result.status)), float(result.projection.max(initial=0.0))
    return RuleRow(rule, nodes, errors, seconds / points, excluded, projection)


def _errors(result: PredictiveCovariance, converged: PredictiveCovariance) -> Array:
    """Relative Frobenius errors of the points that both have; outputs without spread count nothing."""
    both = (result.status == 0) & (converged.status == 0)
    std = np.sqrt(np.diagonal(converged.covariance[both], axis1=1, axis2=2))
    inverse = np.where(std > 0, 1.0, 0.0) / np.where(std > 0, std, 1.0)
    across, along = inverse[:, :, None], inverse[:, None, :]  # one after the other: their product may overflow
    difference = (result.covariance - converged.covariance)[both] * across * along
    size = np.linalg.norm(converged.covariance[both] * across * along, axis=(1, 2))
    return np.asarray(np.linalg.norm(difference, axis=(1, 2)) / np.where(size > 0, size, 1.0))


def _cells(row: RuleRow) -> list[str]:
    errors = ["-"] * 3 if row.errors is None else [f"{e:.1e}" for e in (row.errors.median, row.errors.most, row.errors.worst)]
    projection = f"{row.projection:.1e}" if row.projection else "-"
    return [str(row.rule), str(row.nodes), *errors, f"{1e6 * row.seconds:.0f}", str(row.excluded), projection]
