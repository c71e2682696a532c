"""Many small panels in one picture: how many, in bands below each other, and where they stand."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, ScalarFormatter
from numpy.typing import NDArray

COLUMNS = 6
"""Panels side by side; more follow below, in bands."""

MOST_PANELS = 144
"""Panels of a picture."""

BAND = 0.8
"""Inches between bands: for labels and titles."""


def place_panels(figure: Figure, grid: NDArray[Any], titles: Sequence[str], above: float, between: float) -> None:
    """Give many small panels (band, point, column) the room that their labels need, estimated from the number of characters.

    A layout engine would measure each label several times, which takes longer than all else that a command does with the design.
    Lengths are in inches.
    """
    bands, points, columns = grid.shape
    digit = 0.65 * 8 / 72
    width, height = figure.get_size_inches()
    room = [max(_label_length(axes) for axes in grid[:, :, j].ravel()) * digit + 0.16 for j in range(columns)]
    room[0] += 0.28  # the number of the point
    panel = max((width - sum(room) - 0.18) / columns, 0.5)
    below = 0.4  # for labels
    whole = (height - above - below + BAND) / bands  # of a band and what is between it and the next
    row = (whole - BAND + between) / points
    for band, k, j in np.ndindex(*grid.shape):
        left = sum(room[: j + 1]) + panel * j
        bottom = below + (bands - 1 - band) * whole + (points - 1 - k) * row
        axes: Any = grid[band, k, j]
        axes.set_position((left / width, bottom / height, panel / width, (row - between) / height))
    for j, title in enumerate(titles):
        grid[j // columns, 0, j % columns].set_title(title, loc="center")


def _label_length(axes: Axes) -> int:
    """Characters of the longest number at the vertical axis."""
    low, high = sorted(axes.get_ylim())
    places = [place for place in axes.yaxis.get_majorticklocs() if low <= place <= high]
    return max(map(len, axes.yaxis.get_major_formatter().format_ticks(places)), default=1)


def few_ticks(axes: Axes) -> None:
    """Few ticks, and these alone: a locator is called again and again, and names some out of sight, which are made all the same."""
    axes.margins(x=0.03, y=0.12)
    for axis, (low, high), most in ((axes.xaxis, axes.get_xlim(), 4), (axes.yaxis, axes.get_ylim(), 3)):
        axis.set_ticks([place for place in MaxNLocator(most).tick_values(low, high) if low <= place <= high])
    axes.yaxis.set_major_formatter(ScalarFormatter(useOffset=False))
