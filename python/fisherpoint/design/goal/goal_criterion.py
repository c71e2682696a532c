"""A goal for the parameters of a problem: its criterion as a function of information, and what information counts beforehand."""

from __future__ import annotations

import numpy as np

from ...basics.checks import as_std, by_name, check_choice, check_type, some_names_among
from ...basics.options import with_options
from ...basics.quantity import names_of
from ...basics.values import Array
from ...information.evaluation import Evaluation
from ...information.point_information import point_information
from ...information.prior_information import least_rows, nuisance_rows, parameter_rows
from ...information.problem import DesignProblem
from ...points.experiments import Experiments
from ...points.settings import resolve_threads
from .criteria import Criterion
from .determinant import Determinant
from .eigenvalue_criteria import ConditionNumber, Scaled, SmallestEigenvalue
from .functions_of_parameters import gradient_of
from .goal import Goal, goal_of
from .variance import Variance


@with_options
def criterion(problem: DesignProblem, goal: str | Goal = "D", *, threads: int | None = None) -> Criterion:
    """A criterion of optimality as a function of Fisher information, with its derivative and efficiency.

    Parameters
    ----------
    problem : DesignProblem
    goal : str or Goal
        The criterion, and what it needs; at the prior mean.
    threads : int, optional

    Returns
    -------
    Criterion
        Its `value`, `gradient` and `efficiency` take matrices (p, p) for parameters divided by their prior std, in sum form, as
        `Evaluation.information` is.

    Raises
    ------
    TypeError, ValueError
        For names that the problem does not have, and functions and predictions that no parameter changes.
    """
    check_type(problem, DesignProblem, "problem")
    goal, threads = goal_of(goal), resolve_threads(threads)
    name, of, p = goal.criterion, goal.of, len(problem.estimated)
    if name == "D":
        return Determinant("D", np.eye(p), True)
    if name == "Ds":
        chosen = some_names_among((of,) if isinstance(of, str) else of or (), problem.estimated, "of")
        return Determinant("Ds", np.eye(p)[:, [problem.estimated.index(one) for one in chosen]], len(chosen) == p)
    if name == "c":
        return Variance("c", _function(problem, of))
    if name == "I":
        return Variance("I", _predictions(problem, of, goal.conditions, threads))
    sizes = np.ones(p)
    if goal.scale is not None:
        given = by_name(goal.scale, problem.estimated, "scale", as_std, complete=True)
        sizes = problem.std / np.array([given[one] for one in problem.estimated])
    if name == "A":
        return Variance("A", np.diag(sizes), True)
    scaled = Scaled(np.diag(1 / sizes))
    return SmallestEigenvalue(scaled) if name == "E" else ConditionNumber(scaled)


def criterion_of(problem: DesignProblem, goal: Goal, threads: int | None = None) -> Criterion:
    """The criterion of a search as a function of information about all unknowns: the parameters and the nuisance ones."""
    return criterion(problem, goal, threads=threads).beside_nuisance(problem.n_nuisance)


def criterion_of_design(problem: DesignProblem, goal: Goal, evaluation: Evaluation) -> Criterion:
    """The criterion of a search as a function of F (p, p); where a design's F is singular, "A", "E" and "ME" are of the rest."""
    found, nulls = criterion(problem, goal), evaluation.null_directions
    if not nulls:
        return found
    columns = np.array([[null.get(name, 0.0) for name in evaluation.parameters] for null in nulls]).T
    return found.restricted(np.linalg.qr(columns, mode="complete")[0][:, len(nulls) :])


def prior_rows(problem: DesignProblem, goal: Goal) -> Array | None:
    """What is known of the parameters, as rows (k, n_unknowns) beside those of data; None where that does not count."""
    return parameter_rows(problem) if goal.prior_information else None


def known_beforehand(problem: DesignProblem, goal: Goal) -> Array:
    """Information (n_unknowns, n_unknowns) that counts once beside the data: of nuisance parameters, and `prior_rows`."""
    of_parameters, rows = prior_rows(problem, goal), np.concatenate([nuisance_rows(problem), least_rows(problem)])
    rows = rows if of_parameters is None else np.concatenate([of_parameters, rows])
    return np.asarray(rows.T @ rows, dtype=np.float64)


def _function(problem: DesignProblem, of: object) -> Array:
    names = names_of(problem.model.parameters)
    _, gradient = gradient_of(of, dict(zip(names, problem.theta, strict=True)), "of")  # type: ignore[arg-type]  # it checks
    k = gradient[problem.estimated_columns] * problem.std
    if not k.any():
        raise ValueError(f"of: expected a function that changes with an estimated parameter, given {of!r}")
    return k[:, None]


def _predictions(problem: DesignProblem, of: object, conditions: object, threads: int | None) -> Array:
    """Gradients of the predictions as columns, so that tr(K^T M^-1 K) is their mean variance; at most p columns."""
    p = len(problem.estimated)
    output = names_of(problem.model.outputs).index(check_choice(of, names_of(problem.model.outputs), "of"))
    check_type(conditions, Experiments, "conditions")
    assert isinstance(conditions, Experiments)
    if not len(conditions):
        raise ValueError("conditions: expected at least one point, given none")
    rows = point_information(problem, conditions, False, threads).sensitivity[:, output, :p]
    if not rows.any():
        raise ValueError(f"of: expected an output that depends on a parameter under the conditions, given {of!r}")
    values, directions = np.linalg.svd(rows / np.sqrt(len(rows)), full_matrices=False)[1:]
    kept = values > 1e-12 * values[0]
    return np.asarray(directions[kept].T * values[kept])
