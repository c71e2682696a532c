"""Which pictures of runs there are; each imports what it needs when it is drawn."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from ...information.evaluation import Evaluation
from ...information.problem import DesignProblem
from ...points.runs import Runs
from ...show.display import Plots

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PICTURES = ("runs.png", "information.png", "standard_errors.png", "correlation.png")
"""What the command line draws."""


def plots_of(problem: DesignProblem, runs: Runs, evaluation: Evaluation) -> Plots:
    """Every picture of runs that were evaluated."""
    return {
        "runs": partial(_runs, problem, runs),
        "information": partial(_information, problem, runs),
        "standard_errors": partial(evaluation.plot, "standard_errors"),
        "correlation": partial(evaluation.plot, "correlation"),
    }


def _runs(problem: DesignProblem, runs: Runs) -> Figure:
    from .run_pictures import plot_runs

    return plot_runs(problem, runs)


def _information(problem: DesignProblem, runs: Runs) -> Figure:
    from .run_pictures import plot_information

    return plot_information(problem, runs)
