"""The goal of a design: a criterion by its name, with what it needs, for the parameters of a problem."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np

from ...basics.checks import as_std, by_name, check_choice, check_type, some_names_among
from ...basics.quantity import names_of
from ...basics.values import Array
from ...information.evaluation import Evaluation
from ...information.point_information import point_information
from ...information.problem import DesignProblem
from ...points.experiments import Experiments
from ...points.settings import resolve_threads
from .criteria import Criterion, Determinant, Variance
from .eigenvalue_criteria import ConditionNumber, Scaled, SmallestEigenvalue
from .functions import gradient_of

WORDS = {
    "D": "log det F",
    "A": "trace of F^-1",
    "E": "smallest eigenvalue of F",
    "ME": "condition number of F",
    "c": "variance of the function",
    "Ds": "log det of the information about the subset",
    "I": "mean prediction variance",
}
CRITERIA = tuple(WORDS)
OF_ALL = ("D", "A", "E", "ME")
"""Criteria of all parameters; the others ask for certain functions of them."""


def criterion(
    problem: DesignProblem,
    name: str = "D",
    *,
    of: str | Sequence[str] | None = None,
    conditions: Experiments | None = None,
    scale: Mapping[str, float] | None = None,
    threads: int | None = None,
) -> Criterion:
    """A criterion of optimality as a function of Fisher information, with its derivative and efficiency.

    Parameters
    ----------
    problem : DesignProblem
    name : {"D", "A", "E", "ME", "c", "Ds", "I"}
        log det F; the trace of F^-1; the smallest eigenvalue of F; the ratio of the largest to the smallest; the variance of a
        function of the parameters; log det of the information about some parameters, with the others unknown too; the mean
        variance of a predicted output.
    of : str or sequence of str, optional
        For "c" the function as text, such as ``"a / b"``; for "Ds" names of parameters; for "I" the name of an output.
    conditions : Experiments, optional
        For "I", where the output is predicted.
    scale : mapping of parameter name to float, optional
        For "A", "E" and "ME", what errors of the parameters are compared with, SI units. Default: the prior std.
    threads : int, optional

    Returns
    -------
    Criterion
        Its `value`, `gradient` and `efficiency` take matrices (p, p) for parameters divided by their prior std, in sum form, as
        `Evaluation.information` is.

    Raises
    ------
    TypeError, ValueError
        For another name, and what is missing, or not used by the criterion.
    """
    check_type(problem, DesignProblem, "problem")
    name, threads = check_choice(name, CRITERIA, "criterion"), resolve_threads(threads)
    _check_used(name, of, conditions, scale)
    p = len(problem.estimated)
    if name == "D":
        return Determinant("D", np.eye(p), True)
    if name == "Ds":
        chosen = some_names_among((of,) if isinstance(of, str) else of or (), problem.estimated, "of")
        return Determinant("Ds", np.eye(p)[:, [problem.estimated.index(one) for one in chosen]], len(chosen) == p)
    if name == "c":
        return Variance("c", _function(problem, of))
    if name == "I":
        return Variance("I", _predictions(problem, of, conditions, threads))
    given = by_name(scale, problem.estimated, "scale", as_std, complete=True) if scale is not None else {}
    sizes = problem.std / np.array([given[one] for one in problem.estimated]) if given else np.ones(p)
    if name == "A":
        return Variance("A", np.diag(sizes), True)
    scaled = Scaled(np.diag(1 / sizes))
    return SmallestEigenvalue(scaled) if name == "E" else ConditionNumber(scaled)


class CriterionSettings(Protocol):
    """The settings of a search that define its criterion."""

    @property
    def criterion(self) -> str: ...
    @property
    def of(self) -> str | Sequence[str] | None: ...
    @property
    def conditions(self) -> Experiments | None: ...
    @property
    def scale(self) -> Mapping[str, float] | None: ...


def criterion_of(problem: DesignProblem, settings: CriterionSettings, threads: int | None = None) -> Criterion:
    """The criterion of a search as a function of information about all unknowns: the parameters and the nuisance ones."""
    found = criterion(
        problem, settings.criterion, of=settings.of, conditions=settings.conditions, scale=settings.scale, threads=threads
    )
    return found.beside_nuisance(problem.n_nuisance)


def criterion_of_design(problem: DesignProblem, settings: CriterionSettings, evaluation: Evaluation) -> Criterion:
    """The criterion of a search as a function of F (p, p); where a design's F is singular, "A", "E" and "ME" are of the rest."""
    found = criterion(problem, settings.criterion, of=settings.of, conditions=settings.conditions, scale=settings.scale)
    nulls = evaluation.null_directions
    if not nulls:
        return found
    columns = np.array([[null.get(name, 0.0) for name in evaluation.parameters] for null in nulls]).T
    return found.restricted(np.linalg.qr(columns, mode="complete")[0][:, len(nulls) :])


def named(name: str, of: str | Sequence[str] | None) -> str:
    """A criterion as part of a sentence."""
    if of is None:
        return WORDS[name]
    what = of if isinstance(of, str) else ", ".join(of)
    return {"c": f"variance of {what}", "Ds": f"log det of the information about {what}"}.get(name, f"{WORDS[name]} of {what}")


def _check_used(name: str, of: object, conditions: object, scale: object) -> None:
    needs = {"c": "a function of the parameters as text", "Ds": "names of parameters", "I": "the name of an output"}
    if name in needs and of is None:
        raise ValueError(f"of: expected {needs[name]} for criterion {name!r}, given none")
    if name == "I" and conditions is None:
        raise ValueError("conditions: expected the points at which criterion 'I' predicts, given none")
    unused = (("of", of, needs), ("conditions", conditions, ("I",)), ("scale", scale, ("A", "E", "ME")))
    for label, given, users in unused:
        if given is not None and name not in users:
            raise ValueError(f"{label}: expected none for criterion {name!r}, given one")


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
