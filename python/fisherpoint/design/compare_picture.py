"""Standard errors of several designs, as a picture."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter, PercentFormatter

from ..show.style import CRITERION, NOISE, PRIOR, STYLE, TEXT

COLOURS = (NOISE, CRITERION, "#009e73", "#cc79a7", TEXT, "#56b4e9")
MARKERS = "osD^vP"


def plot_comparison(designs: Mapping[str, Mapping[str, float] | None], prior_std: Mapping[str, float]) -> Figure:
    """Standard errors as shares of the prior's on a logarithmic axis, a row for each parameter, a mark for each design.

    The errors of a design are None where F is singular.
    """
    names, count = list(prior_std), len(designs)
    rows = np.arange(len(names))
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.0, 1.6 + 0.4 * len(names) + 0.2 * ((count + 2) // 3)), layout="constrained")
        axes = figure.subplots()
        axes.axvline(1.0, color=PRIOR, linewidth=1.5, label="prior")
        for k, (name, errors) in enumerate(designs.items()):
            style: dict[str, Any] = {
                "color": COLOURS[k % len(COLOURS)],
                "marker": MARKERS[k // len(COLOURS) % len(MARKERS)],
                "linestyle": "",
            }
            if errors is None:
                axes.plot([], [], label=f"{name}: F is singular", **style)
                continue
            share = [errors[parameter] / prior_std[parameter] for parameter in names]
            axes.plot(share, rows + 0.4 * ((k + 0.5) / count - 0.5), label=name, markersize=5, **style)
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter(PercentFormatter(1.0, decimals=None))
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.set_xlim(left=min(axes.get_xlim()[0], 0.08))  # a decade at least, so that there are two labels
        axes.set_yticks(rows, names)
        axes.set_ylim(len(names) - 0.5, -0.5)
        axes.set_xlabel("standard error, share of the prior std")
        axes.grid(axis="y", visible=False)
        figure.legend(loc="outside upper left", ncols=3)
    return figure
