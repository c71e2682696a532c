"""Picture of the values of local parameters, with their intervals and their spread."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from ..basics.quantity import Quantity
from ..show.style import NOISE, PRIOR, STYLE, Picture, labelled, nothing_drawn, scale
from .statistics import FitStatistics

MOST_LABELS = 30
"""Groups that have a label each along the axis."""


def plot_local(fit: FitStatistics) -> Figure:
    """Values of each local parameter with 95 % intervals, a panel each, about their mean and spread where there is one."""
    panels = {name: list(values.values()) for name, values in fit.local.items() if values}
    with mpl.rc_context(STYLE):
        if not panels:
            return nothing_drawn("Local parameters: there is none")
        figure = Picture(figsize=(7.6, 0.9 + 2.2 * len(panels)), layout="constrained")
        figure.suptitle("Local parameters, 95 % intervals", x=0.01, ha="left")
        for axes, (name, values) in zip(figure.subplots(len(panels), 1, squeeze=False)[:, 0], panels.items(), strict=True):
            found = np.array([one.estimate for one in values])
            ends = np.array([one.interval for one in values])
            known = np.isfinite(ends).all(axis=1)
            factor, unit = scale(Quantity(name, fit.units[f"{name}[{values[0].group}]"]), found)
            at = np.arange(len(values))
            if name in fit.spread:
                mean, std = fit.weighted.observed.of_mean(fit.values, name), fit.spread[name].std
                axes.axhspan(factor * (mean - std), factor * (mean + std), color=PRIOR, alpha=0.15, linewidth=0)
                axes.axhline(factor * mean, color=PRIOR, linewidth=1.0)
            axes.vlines(at[known], factor * ends[known, 0], factor * ends[known, 1], color=NOISE, linewidth=1.2)
            axes.plot(at, factor * found, "o", color=NOISE, markersize=4)
            step = -(-len(values) // MOST_LABELS)
            axes.set_xticks(at[::step], [one.group for one in values[::step]])
            axes.set_xlabel(values[0].by)
            axes.set_ylabel(labelled(name, unit))
    return figure
