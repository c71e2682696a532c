"""The sensitivity function of a design, over each coordinate."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from ...basics.quantity import Quantity
from ...basics.values import Array
from ...points.experiments import Experiments
from ...show.style import CRITERION, NOISE, PRIOR, STYLE, Picture
from ...show.time_axes import axis_scale, make_logarithmic


def sensitivity_figure(
    axes: Sequence[Quantity],
    sample: Experiments,
    values: Array,
    support: Experiments,
    of_support: Array,
    weights: Array,
    level: int,
) -> Figure:
    """Candidates as dots, the support with its weights, and the level that none exceeds at an optimum."""
    tables = sample.table, support.table
    free = [k for k in range(len(axes)) if np.ptp(tables[0][:, k]) > 0] or [0]
    columns = min(3, len(free))
    rows = -(-len(free) // columns)
    with mpl.rc_context(STYLE):
        figure = Picture(figsize=(3.4 * columns, 2.6 * rows), layout="constrained")
        for place, k in enumerate(free):
            plot = figure.add_subplot(rows, columns, place + 1)
            along = axis_scale(axes[k], tables[0][:, k], tables[1][:, k])
            plot.plot(tables[0][:, k] * along.factor, values, ".", color=PRIOR, markersize=2)
            plot.axhline(level, color=NOISE, linewidth=1)
            plot.scatter(tables[1][:, k] * along.factor, of_support, s=20 + 200 * weights, color=CRITERION, zorder=3, alpha=0.8)
            plot.set_xlabel(along.label(axes[k].name))
            if along.is_log:
                both = np.concatenate([table[:, k] for table in tables])
                make_logarithmic(plot, both.min() / 1.5, both.max() * 1.5, most=4)
            plot.set_ylim(bottom=0)
        figure.suptitle("Sensitivity function: candidates, the design's points, and the level of an optimum", fontsize=10)
    return figure
