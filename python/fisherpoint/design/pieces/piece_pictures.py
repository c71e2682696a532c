"""The windows that were picked of a record, as a picture."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from ...basics.quantity import DURATION, Quantity
from ...basics.values import Array
from ...points.runs import Runs
from ...show.style import CRITERION, NOISE, STYLE, Picture, scale


def plot_windows(start: Array, runs: Runs, y: Array, shares: Array, outputs: Sequence[Quantity], title: str) -> Figure:
    """What was measured in the windows over the record's time, and the share of each in what is known."""
    ends = start[:, None] + runs.t
    by, unit = scale(DURATION, ends)
    with mpl.rc_context(STYLE):
        figure = Picture(figsize=(9.0, 1.6 + 1.3 * (len(outputs) + 1)), layout="constrained")
        *panels, last = figure.subplots(len(outputs) + 1, 1, sharex=True)
        for i, (output, axes) in enumerate(zip(outputs, panels, strict=True)):
            factor, of = scale(output, y[..., i])
            for times, values in zip(ends, y[..., i], strict=True):
                axes.plot(by * times, factor * values, ".-", color=NOISE, markersize=3, linewidth=1.0)
            axes.set_ylabel(f"{output.name} [{of}]")
        width = by * runs.dt.sum(axis=1)
        last.bar(by * start, np.nan_to_num(shares), width=width, align="edge", color=CRITERION, edgecolor="white", linewidth=0.5)
        last.yaxis.set_major_formatter(PercentFormatter(1.0, decimals=None))
        last.set_ylabel("share")
        last.set_xlabel(f"time in the record [{unit}]")
        figure.suptitle(title, x=0.01, ha="left", fontsize=10)
    return figure
