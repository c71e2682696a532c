"""Evaluated points: what reports and pictures of designs show."""

from __future__ import annotations

from dataclasses import dataclass

from ...information.evaluate import evaluate
from ...information.evaluation import Evaluation
from ...information.problem import DesignProblem
from ...points.experiments import Experiments


@dataclass(frozen=True, eq=False, repr=False)
class EvaluatedPoints:
    """Points with their evaluation; `FoundDesign` adds how they were found.

    Attributes
    ----------
    problem : DesignProblem
    points : Experiments
    evaluation : Evaluation
        Under the problem's output covariance; of the previous points, where there are any, and these together.
    under_noise : Evaluation or None
        Under the sensor noise alone; None where it is not known.
    """

    problem: DesignProblem
    points: Experiments
    evaluation: Evaluation
    under_noise: Evaluation | None


def evaluate_points(problem: DesignProblem, points: Experiments, threads: int | None = None) -> EvaluatedPoints:
    """Evaluate `points` under the problem's output covariance and, where the noise is known, under it alone."""
    evaluation = evaluate(problem, points, threads=threads)
    if problem.output_covariance == "noise":
        under_noise: Evaluation | None = evaluation
    elif problem.noise is None:
        under_noise = None
    else:
        under_noise = evaluate(problem, points, output_covariance="noise", threads=threads)
    return EvaluatedPoints(problem, points, evaluation, under_noise)
