"""Evaluated points: what reports and pictures of designs show."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from ..information.evaluate import evaluate_design, evaluate_under_noise
from ..information.evaluation import Evaluation
from ..information.problem import DesignProblem
from ..points.experiments import Experiments


class Evaluated(Protocol):
    """What reports and pictures need: a :class:`fisherpoint.Design` has it, and :class:`EvaluatedPoints`."""

    @property
    def problem(self) -> DesignProblem: ...
    @property
    def points(self) -> Experiments: ...
    @property
    def evaluation(self) -> Evaluation: ...
    @property
    def under_noise(self) -> Evaluation | None: ...


@dataclass(frozen=True)
class EvaluatedPoints:
    """Points that were not designed here, with their evaluation under the criterion's D and under the sensor noise."""

    problem: DesignProblem
    points: Experiments
    evaluation: Evaluation
    under_noise: Evaluation | None


def evaluate_points(problem: DesignProblem, points: Experiments, threads: int | None = None) -> EvaluatedPoints:
    """Evaluate `points` under the problem's output covariance and, where the noise is known, under it alone."""
    evaluation = evaluate_design(problem, points, threads=threads)
    same = problem.output_covariance == "noise"
    under_noise = evaluation if same else evaluate_under_noise(problem, points, threads=threads)
    return EvaluatedPoints(problem, points, evaluation, under_noise)
