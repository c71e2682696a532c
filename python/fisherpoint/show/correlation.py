"""A correlation matrix as a picture: of what a design promises, and of a fit."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..basics.values import Array
from .style import STYLE, TEXT, Picture


def correlation_figure(correlation: Array | None, names: Sequence[str], title: str, otherwise: str) -> Figure:
    """A picture of a correlation matrix (p, p) alone; where there is none, a sentence."""
    count = len(names)
    with mpl.rc_context({**STYLE, "axes.grid": False}):
        size = (6.0, 1.5) if correlation is None else (2.2 + 0.52 * count, 1.6 + 0.5 * count)
        figure = Picture(figsize=size, layout="constrained")
        axes = figure.subplots()
        axes.set_title(title)
        if correlation is None:
            axes.text(0.5, 0.5, otherwise, ha="center", va="center", transform=axes.transAxes)
            axes.set_axis_off()
        else:
            draw_correlation(axes, np.asarray(correlation), names)
    return figure


def draw_correlation(axes: Axes, correlation: Array, names: Sequence[str]) -> None:
    """Draw a matrix (p, p) with its numbers and a scale; entries that are not finite stay blank."""
    count = len(names)
    image = axes.imshow(correlation, cmap="RdBu_r", vmin=-1, vmax=1)
    for i, j in np.argwhere(np.isfinite(correlation)).tolist():
        color = "white" if abs(correlation[i, j]) > 0.6 else TEXT
        text = "1" if i == j else f"{correlation[i, j]:.2f}".replace("-0.00", "0.00")
        axes.text(j, i, text, ha="center", va="center", color=color, fontsize=8)
    axes.set_xticks(range(count), names, rotation=45, ha="right", rotation_mode="anchor")
    axes.set_yticks(range(count), names)
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)
    axes.figure.colorbar(image, ax=axes, shrink=0.8, label="correlation", ticks=[-1, -0.5, 0, 0.5, 1])
