"""Pictures of what is looked at before a search: which plants can run a design, what can be identified, what rules cost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, PercentFormatter

from ..basics.values import Array
from ..show.style import CRITERION, NOISE, PRIOR, STYLE, Picture

_COLOURS = mpl.colormaps["tab10"].colors  # type: ignore[attr-defined]


def plot_failures(failures: Mapping[str, Sequence[int]], draws: int, count: int, kind: str, title: str) -> Figure:
    """The share of plants that cannot run each point, or run, by its reasons."""
    with mpl.rc_context(STYLE):
        figure = Picture(figsize=(max(6.0, min(10.0, 2.5 + 0.3 * count)), 3.4), layout="constrained")
        axes = figure.subplots()
        numbers, below = np.arange(1, count + 1), np.zeros(count)
        for k, (reason, counts) in enumerate(sorted(failures.items(), key=lambda one: -sum(one[1]))):
            share = np.asarray(counts) / draws
            axes.bar(numbers, share, bottom=below, color=_COLOURS[k % len(_COLOURS)], label=reason)
            below = below + share
        axes.set_ylim(0.0, max(1.15 * float(below.max(initial=0.0)), 0.01))
        axes.set_xlim(0.3, count + 0.7)
        axes.yaxis.set_major_formatter(PercentFormatter(1.0, decimals=None))
        axes.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
        axes.set_xlabel(kind)
        axes.set_ylabel("plants that cannot run it")
        axes.grid(axis="x", visible=False)
        _headed(figure, title)
    return figure


def plot_singular_values(shares: Array, weak: float, rank: int, title: str) -> Figure:
    """Singular values (n_theta, p) as shares of the largest, one line for each theta; the rank, and where directions are weak."""
    least = 1e-17
    with mpl.rc_context(STYLE):
        figure = Picture(figsize=(max(6.0, min(9.0, 2.5 + 0.35 * shares.shape[1])), 3.6), layout="constrained")
        axes = figure.subplots()
        numbers = np.arange(1, shares.shape[1] + 1)
        for k, row in enumerate(np.maximum(shares, least)):
            axes.plot(numbers, row, "o-", markersize=4, linewidth=1.0, color=NOISE, alpha=0.6, label="" if k else "each theta")
        axes.axhline(weak, color=PRIOR, linestyle="--", linewidth=1.2, label="weak below this")
        if rank < shares.shape[1]:
            axes.axvspan(rank + 0.5, shares.shape[1] + 0.5, color=CRITERION, alpha=0.12, label="not determined")
        axes.set_yscale("log")
        axes.set_xlim(0.5, shares.shape[1] + 0.5)
        axes.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
        axes.set_xlabel("direction of the parameters")
        axes.set_ylabel("singular value, share of the largest")
        _headed(figure, title)
    return figure


def plot_rules(names: Sequence[str], seconds: Array, errors: Array, converged: float, reference: str) -> Figure:
    """Errors (n, 2), the median and the 90th percentile, of rules over the time for one point; NaN where there are none."""
    with mpl.rc_context(STYLE):
        figure = Picture(figsize=(8.0, 4.2), layout="constrained")
        axes = figure.subplots()
        for k, (name, time, (median, most)) in enumerate(zip(names, seconds, errors, strict=True)):
            colour = _COLOURS[k % len(_COLOURS)]
            if np.isfinite(most) and most > 0:
                axes.plot([time, time], [max(median, 1e-17), most], color=colour, linewidth=1.4, alpha=0.6)
                axes.plot(time, most, "o" if k < len(_COLOURS) else "s", color=colour, label=name)
        if np.isfinite(converged) and converged > 0:
            axes.axhline(converged, color=PRIOR, linestyle="--", linewidth=1.2, label=f"{reference} itself")
        axes.axhline(0.01, color=PRIOR, linestyle=":", linewidth=1.2, label="1 %")
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_xlabel("time for one point [s]")
        axes.set_ylabel(f"error relative to {reference}:\nmedian to 90th percentile")
        axes.set_title("What rules over the prior cost, and how exact they are")
        figure.legend(loc="outside right upper")
    return figure


def _headed(figure: Figure, title: str) -> None:
    """A title over all of the picture, which may be a sentence, and the legend below."""
    figure.suptitle(title, x=0.01, ha="left", fontsize=10, wrap=True)
    if any(axes.get_legend_handles_labels()[0] for axes in figure.axes):
        figure.legend(loc="outside lower left", ncols=4)
