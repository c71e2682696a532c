"""The evaluation of any points or runs, beside previous ones."""

from __future__ import annotations

import warnings

from ..basics.checks import check_flag, check_type
from ..basics.messages import with_counts
from ..basics.values import Array
from ..basics.work_clock import Clock
from ..points.points_or_runs import Points, as_runs
from ..points.runs import Runs
from .evaluation import Evaluation, evaluate_information
from .output_covariance import OutputCovariance, needs_covariances
from .output_covariance import output_covariance as d_of
from .point_information import PointInformation
from .previous import Previous, previous_information
from .prior_information import parameter_rows
from .problem import DesignProblem
from .run_information import information_of


def evaluate(
    problem: DesignProblem,
    points: Points,
    *,
    output_covariance: str | OutputCovariance | None = None,
    threads: int | None = None,
    previous: Previous | None = None,
    prior_information: bool = False,
) -> Evaluation:
    """Evaluate any design, also one with fewer points than parameters.

    Parameters
    ----------
    problem : DesignProblem
        Its region may be None.
    points : Experiments or Runs
        At least one point, or run. The rule is run over the prior where D needs it ("pooled" and "pointwise"); runs take D = R, and
        what is uncertain moves all samples of a run at once.
    output_covariance : "noise", "region", "pooled", "pointwise" or array (n_y, n_y), optional
        D of (7), or None for that of the problem. Under "noise" standard errors are those of an estimate.
    threads : int, optional
    previous : Measurements, Experiments, Design, or a sequence of these, optional
        Points whose information is already collected, as for `exchange`: the evaluation is of all points together.
    prior_information : bool
        Whether the inverse of the prior's covariance counts beside them, as for `exchange`; where D is R.

    Returns
    -------
    Evaluation
        Where F is singular: its rank and null directions, and no standard errors.

    Raises
    ------
    ValueError
        Where a point is none (its trajectory is not ok, or it starts on a switching surface), D is singular, or the prior's
        information is to count under another D than R.
    """
    check_type(problem, DesignProblem, "problem")
    if output_covariance is not None:
        problem = problem.replace(output_covariance=output_covariance)
    runs, kind = _checked_runs(points), str(problem.output_covariance)
    if check_flag(prior_information, "prior_information") and kind != "noise":
        raise ValueError(f"prior_information: expected output_covariance 'noise', under which F is information, given {kind!r}")
    known, left_out = previous_information(problem, previous, threads)
    if left_out:
        reasons = with_counts(left_out)
        warnings.warn(f"previous: expected points that are valid at the prior mean, left out {reasons}", stacklevel=2)
    return evaluate_beside(problem, runs, threads, known, parameter_rows(problem) if prior_information else None)


def evaluate_beside(
    problem: DesignProblem,
    runs: Runs,
    threads: int | None,
    known: PointInformation | None,
    prior: Array | None,
    clock: Clock | None = None,
) -> Evaluation:
    """Evaluate runs beside what is already measured, and beside rows (k, n_unknowns) of what is known of the parameters."""
    information = information_of(problem, runs, threads, needs_covariances(str(problem.output_covariance)))
    if known is not None:
        information = PointInformation.join([known, information])
    return evaluate_information(problem, information, d_of(problem, information, threads), threads, prior, clock)


def _checked_runs(points: Points) -> Runs:
    runs = as_runs(points)
    if not len(runs):
        raise ValueError("points: expected at least one point, given none")
    return runs
