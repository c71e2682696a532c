"""The picture of a campaign: relative standard errors over its batches."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import ceil

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator, NullFormatter

from ..show.style import CRITERION, NOISE, PRIOR, STYLE, Picture

ACROSS = 3


def plot_campaign(series: Sequence[Mapping[str, float]], targets: Mapping[str, float]) -> Figure:
    """Relative standard errors of every parameter over the batches, on one logarithmic scale, with the targets as lines."""
    names, batches = list(series[0]), np.arange(len(series))
    across = min(ACROSS, len(names))
    down = ceil(len(names) / across)
    with mpl.rc_context(STYLE):
        figure = Picture(figsize=(1.2 + 2.3 * across, 1.1 + 1.6 * down), layout="constrained")
        panels = figure.subplots(down, across, sharex=True, sharey=True, squeeze=False)
        for axes, name in zip(panels.flat, names, strict=False):
            share = np.array([one[name] for one in series])
            share = np.where(np.isfinite(share), share, np.nan)
            axes.plot(batches, share, color=NOISE, linewidth=1.6)
            axes.plot(batches[1:], share[1:], "o", color=NOISE, markersize=4.5, label="estimate")
            axes.plot(batches[:1], share[:1], "o", color=PRIOR, markersize=4.5, label="prior")
            if name in targets:
                axes.axhline(targets[name], color=CRITERION, linestyle="--", linewidth=1.2, label="target")
            axes.set_title(name)
        for axes in panels.flat[len(names) :]:
            axes.set_axis_off()
        for axes in panels.flat[max(0, len(names) - across) : len(names)]:
            axes.tick_params(labelbottom=True)
        first = panels.flat[0]
        first.set_yscale("log")
        low, high = first.get_ylim()
        if high < 10 * low:  # a decade at least, so that there are two labels
            first.set_ylim(low / 3, 3 * high)
        first.yaxis.set_major_formatter(FuncFormatter(lambda share, _: f"{100 * share:g} %"))
        first.yaxis.set_minor_formatter(NullFormatter())
        first.set_xlim(-0.3, max(batches[-1], 1) + 0.3)
        first.xaxis.set_major_locator(MaxNLocator(integer=True, nbins=6))
        figure.supxlabel("batch (0: before the first)", fontsize=9)
        figure.supylabel("relative standard error", fontsize=9)
        handles = {label: handle for axes in panels.flat for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)}
        figure.legend(handles.values(), handles.keys(), loc="outside upper center", ncols=3)
    return figure
