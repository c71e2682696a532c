"""Pictures of standard errors beside those of the prior, and of the correlation of estimates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from ..basics.values import Array
from .numbers import computed
from .style import NOISE, PRIOR, STYLE, TEXT, Picture, share_formatter

DECADE = 0.08
"""Largest lower end of logarithmic axes of shares of the prior std: a decade below 1, so that there are two labels."""


def standard_error_figure(
    errors: Mapping[str, float] | None, prior_std: Mapping[str, float], label: str, units: Mapping[str, str]
) -> Figure:
    """Standard errors as shares of the prior's on a logarithmic axis, with their values beside it; None where F is singular."""
    names = list(prior_std)
    rows = np.arange(len(names))
    with mpl.rc_context(STYLE):
        figure = Picture(figsize=(8.0, 1.7 + 0.4 * len(names)), layout="constrained")
        axes = figure.subplots()
        axes.axvline(1.0, color=PRIOR, linewidth=1.5, label="prior")
        axes.axvline(0.5, color=PRIOR, linewidth=1.0, linestyle=":", label="half the prior")
        if errors is None:
            axes.plot([], [], "o", color=NOISE, label=f"{label}: F is singular")
        else:
            share = np.array([errors[name] / prior_std[name] for name in names])
            axes.hlines(rows, np.minimum(share, 1.0), np.maximum(share, 1.0), color=NOISE, alpha=0.4)
            axes.plot(share, rows, "o", color=NOISE, markersize=6, label=label)
        share_axis(axes, names)
        # What that means in units, beside the axis.
        for row, name in zip(rows, names, strict=True):
            prior = f"{computed(float(prior_std[name]))} {units.get(name, '')}".removesuffix(" 1").rstrip()
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


def share_axis(axes: Axes, names: Sequence[str]) -> None:
    """Standard errors as shares of the prior's along a logarithmic axis, a row for each parameter, the first on top."""
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter(share_formatter())
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlim(left=min(axes.get_xlim()[0], DECADE))
    axes.set_yticks(np.arange(len(names)), names)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.set_xlabel("standard error, share of the prior std")
    axes.grid(axis="y", visible=False)


MOST_WITH_NUMBERS = 20
"""Parameters up to which a correlation matrix has its numbers; more have a page's width by their colours alone."""

CELL, LEAST_CELL, WIDEST = 0.5, 0.16, 9.0
"""Inches of a matrix's cell, of one that has room for its parameter's name, and of a whole matrix without numbers."""


def correlation_figure(correlation: Array | None, names: Sequence[str], title: str, otherwise: str) -> Figure:
    """A picture of a correlation matrix (p, p) alone; where there is none, a sentence."""
    count = len(names)
    cell = CELL if count <= MOST_WITH_NUMBERS else WIDEST / count
    with mpl.rc_context({**STYLE, "axes.grid": False}):
        size = (6.0, 1.5) if correlation is None else (2.2 + 1.04 * cell * count, 1.6 + cell * count)
        figure = Picture(figsize=size, layout="constrained")
        axes = figure.subplots()
        axes.set_title(title)
        if correlation is None:
            axes.text(0.5, 0.5, otherwise, ha="center", va="center", transform=axes.transAxes)
            axes.set_axis_off()
        else:
            _draw_correlation(axes, np.asarray(correlation), names, cell)
    return figure


def _draw_correlation(axes: Axes, correlation: Array, names: Sequence[str], cell: float) -> None:
    """Draw a matrix (p, p) with a scale, and numbers where there is room; entries that are not finite stay blank."""
    count = len(names)
    image = axes.imshow(correlation, cmap="RdBu_r", vmin=-1, vmax=1)
    for i, j in np.argwhere(np.isfinite(correlation)).tolist() if count <= MOST_WITH_NUMBERS else []:
        color = "white" if abs(correlation[i, j]) > 0.6 else TEXT
        text = "1" if i == j else f"{correlation[i, j]:.2f}".replace("-0.00", "0.00")
        axes.text(j, i, text, ha="center", va="center", color=color, fontsize=8)
    every = int(np.ceil(LEAST_CELL / cell))
    size = min(9.0, 72 * 0.7 * cell * every)
    axes.set_xticks(range(0, count, every), names[::every], rotation=45, ha="right", rotation_mode="anchor", fontsize=size)
    axes.set_yticks(range(0, count, every), names[::every], fontsize=size)
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)
    axes.figure.colorbar(image, ax=axes, shrink=0.8, label="correlation", ticks=[-1, -0.5, 0, 0.5, 1])
