"""Pictures of a design. Every ``plot_...`` returns a :class:`matplotlib.figure.Figure` that belongs to no window."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ...basics.checks import check_choice
from ...show.parameter_pictures import standard_error_figure
from ...show.style import CRITERION, NOISE, PRIOR, STYLE, Picture
from .evaluated_points import EvaluatedPoints
from .found_design import FoundDesign
from .pictures_points import plot_points
from .pictures_trajectories import plot_trajectories


def plot_criterion(design: FoundDesign) -> Figure:
    """What is maximised over the iterations of the exchange, with the references where they are of the same D."""
    iteration = np.array([record.iteration for record in design.trace])
    log_det = np.array([record.log_det for record in design.trace])
    exchanged = np.array([record.exchanged for record in design.trace], dtype=bool)
    log_det = np.where(np.isfinite(log_det), log_det, np.nan)
    with mpl.rc_context(STYLE):
        figure = Picture(figsize=(7.0, 4.0), layout="constrained")
        axes = figure.subplots()
        kind = design.evaluation.output_covariance_kind
        color = NOISE if kind == "noise" else CRITERION
        axes.step(iteration, log_det, where="post", color=color, linewidth=1.6)
        label = f"exchange ({int(exchanged.sum())})"
        axes.plot(iteration[exchanged], log_det[exchanged], ".", color=color, markersize=6, label=label)
        if design.efficiency is not None:
            _reference(axes, design.efficiency.bound, "closed bound", "-.")
            if kind == "noise":
                _reference(axes, design.efficiency.at_most, "bound for these candidates", "--")
                if design.scenarios is None:
                    _reference(axes, design.efficiency.random_median, "median random design", ":")
        axes.set_xlabel("iteration")
        units = ", parameters in prior std" if design.settings.goal.row.log_det else ", F as in (7)"
        axes.set_ylabel(f"{design.settings.goal.maximised}{units}")
        axes.set_title(f'Criterion, output covariance "{kind}"')
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        axes.legend(loc="center right", frameon=True, framealpha=0.95, edgecolor="none")
    return figure


def plot_standard_errors(design: EvaluatedPoints) -> Figure:
    """Predicted standard errors under the sensor noise next to the prior's, as a share of the prior std on a logarithmic axis.

    Raises
    ------
    ValueError
        Where the sensor noise is not known: nothing can be predicted then.
    """
    evaluation = design.under_noise
    if evaluation is None:
        raise ValueError("noise: expected the sensor noise, from which standard errors follow; given none")
    units = {quantity.name: quantity.unit for quantity in design.problem.model.parameters}
    return standard_error_figure(evaluation.standard_errors, evaluation.prior_std, "under the sensor noise", units)


def plot_correlation(design: EvaluatedPoints) -> Figure:
    """Correlation of the estimates, under the sensor noise where it is known."""
    return (design.under_noise or design.evaluation).plot("correlation")


PLOTS: dict[str, Callable[[Any], Figure]] = {
    "criterion": plot_criterion,
    "points": plot_points,
    "standard_errors": plot_standard_errors,
    "correlation": plot_correlation,
    "trajectories": plot_trajectories,
}
"""The pictures of a design by their kind; of evaluated points, all but the first."""


def plot_of(design: FoundDesign, kind: str) -> Figure:
    """The picture of this kind; see `Design.plot`."""
    check_choice(kind, tuple(PLOTS), "kind")
    if kind == "trajectories" and not design.problem.model.states:
        raise ValueError("kind: expected a model with states for 'trajectories', given one without")
    return PLOTS[kind](design)


def _reference(axes: Axes, value: float | None, label: str, style: str) -> None:
    if value is not None and np.isfinite(value):
        axes.axhline(value, color=PRIOR, linestyle=style, linewidth=1.2, label=f"{label}, {value:.2f}")
