"""Pictures of a design. Every ``plot_...`` returns a :class:`matplotlib.figure.Figure` that belongs to no window."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, NullFormatter, PercentFormatter

from ..information.evaluation import Evaluation
from ..show.correlation import draw_correlation
from ..show.numbers import computed
from ..show.style import CRITERION, NOISE, PRIOR, STYLE, save_figure
from .evaluated import Evaluated
from .pictures_points import plot_points, plot_trajectories
from .result import Design

__all__ = [
    "plot_correlation",
    "plot_criterion",
    "plot_points",
    "plot_standard_errors",
    "plot_trajectories",
    "save_all",
]


def plot_criterion(design: Design) -> Figure:
    """log det F over the iterations of the exchange, with the references where they are of the same D."""
    iteration = np.array([record.iteration for record in design.trace])
    log_det = np.array([record.log_det for record in design.trace])
    exchanged = np.array([record.exchanged for record in design.trace], dtype=bool)
    log_det = np.where(np.isfinite(log_det), log_det, np.nan)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.0, 4.0), layout="constrained")
        axes = figure.subplots()
        kind = design.evaluation.output_covariance_kind
        color = NOISE if kind == "noise" else CRITERION
        axes.step(iteration, log_det, where="post", color=color, linewidth=1.6)
        label = f"exchange ({int(exchanged.sum())})"
        axes.plot(iteration[exchanged], log_det[exchanged], ".", color=color, markersize=6, label=label)
        if design.efficiency is not None:
            _reference(axes, design.efficiency.bound, "closed bound", "-.")
            if kind == "noise":
                _reference(axes, design.efficiency.noise_optimum, "noise-only optimum found", "--")
                _reference(axes, design.efficiency.random_median, "median random design", ":")
        axes.set_xlabel("iteration")
        axes.set_ylabel("log det F, parameters in prior std")
        axes.set_title(f'Criterion, output covariance "{kind}"')
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        axes.legend(loc="center right", frameon=True, framealpha=0.95, edgecolor="none")
    return figure


def plot_standard_errors(design: Evaluated) -> Figure:
    """Predicted standard errors under the sensor noise next to the prior's, as a share of the prior std on a logarithmic axis.

    Raises
    ------
    ValueError
        Where the sensor noise is not known: nothing can be predicted then.
    """
    evaluation = design.under_noise
    if evaluation is None:
        raise ValueError("noise_std: expected the sensor noise, from which standard errors follow; given none")
    names = evaluation.parameters
    units = {quantity.name: quantity.unit for quantity in design.problem.model.parameters}
    rows, errors = np.arange(len(names)), evaluation.standard_errors

    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(8.0, 1.7 + 0.4 * len(names)), layout="constrained")
        axes = figure.subplots()
        axes.axvline(1.0, color=PRIOR, linewidth=1.5, label="prior")
        axes.axvline(0.5, color=PRIOR, linewidth=1.0, linestyle=":", label="half the prior")
        label = "under the sensor noise"
        if errors is None:
            axes.plot([], [], "o", color=NOISE, label=f"{label}: F is singular")
        else:
            share = np.array([errors[name] / evaluation.prior_std[name] for name in names])
            axes.hlines(rows, np.minimum(share, 1.0), np.maximum(share, 1.0), color=NOISE, alpha=0.4)
            axes.plot(share, rows, "o", color=NOISE, markersize=6, label=label)
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter(PercentFormatter(1.0, decimals=None))
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.set_xlim(left=min(axes.get_xlim()[0], 0.08))  # a decade at least, so that there are two labels
        axes.set_yticks(rows, names)
        axes.set_ylim(len(names) - 0.5, -0.5)
        axes.set_xlabel("standard error, share of the prior std")
        axes.grid(axis="y", visible=False)
        # What that means in units, beside the axis.
        for row, name in zip(rows, names, strict=True):
            prior = f"{computed(float(evaluation.prior_std[name]))} {units[name]}"
            error = "" if errors is None else f"{computed(float(errors[name]))} of "
            axes.annotate(
                error + prior,
                (1.0, float(row)),
                xycoords=("axes fraction", "data"),
                xytext=(8, 0),
                textcoords="offset points",
                va="center",
                color=NOISE,
            )
        figure.legend(loc="outside upper left", ncols=2, title="Prior against predicted standard errors", alignment="left")
    return figure


def plot_correlation(design: Evaluated) -> Figure:
    """Correlation of the estimates, under the sensor noise where it is known."""
    shown = design.under_noise or design.evaluation
    names, count = shown.parameters, len(shown.parameters)
    where = "the sensor noise" if design.under_noise is not None else _criterion_d(shown)
    with mpl.rc_context({**STYLE, "axes.grid": False}):
        size = (6.0, 1.5) if shown.correlation is None else (2.2 + 0.52 * count, 1.6 + 0.5 * count)
        figure = Figure(figsize=size, layout="constrained")
        axes = figure.subplots()
        axes.set_title(f"Correlation of the estimates under {where}")
        if shown.correlation is None:
            text = f"F is singular: rank {shown.rank} of {count}"
            axes.text(0.5, 0.5, text, ha="center", va="center", transform=axes.transAxes)
            axes.set_axis_off()
            return figure
        correlation = np.asarray(shown.correlation)
        draw_correlation(axes, correlation, names)
    return figure


def save_all(design: Evaluated, directory: str | Path) -> list[Path]:
    """Write every picture of `design` as PNG; standard errors only where the sensor noise is known.

    Parameters
    ----------
    design
        A design, or evaluated points; these have no criterion over iterations.
    directory
        An existing directory.

    Returns
    -------
    list of Path
        The files.
    """
    plots: dict[str, Callable[[Any], Figure]] = {
        "points": plot_points,
        "standard_errors": plot_standard_errors,
        "correlation": plot_correlation,
        "trajectories": plot_trajectories,
    }
    if design.under_noise is None:
        del plots["standard_errors"]
    if not design.problem.model.states:
        del plots["trajectories"]  # nothing moves
    if isinstance(design, Design):
        plots = {"criterion": plot_criterion, **plots}
    paths = []
    for name, plot in plots.items():
        paths.append(Path(directory) / f"{name}.png")
        save_figure(plot(design), paths[-1])
    return paths


def _criterion_d(evaluation: Evaluation) -> str:
    return f'the D of the criterion ("{evaluation.output_covariance_kind}")'


def _reference(axes: Axes, value: float | None, label: str, style: str) -> None:
    if value is not None and np.isfinite(value):
        axes.axhline(value, color=PRIOR, linestyle=style, linewidth=1.2, label=f"{label}, {value:.2f}")
