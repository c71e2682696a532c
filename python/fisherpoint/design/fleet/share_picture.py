"""The picture of a fleet: what each plant says of the parameters that all share."""

from __future__ import annotations

from collections.abc import Mapping

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from ...show.style import STYLE, Picture


def plot_shares(shares: Mapping[str, Mapping[str, float]], label: str) -> Figure:
    """A bar for each parameter, divided by the shares of the plants in what is known of it."""
    names, plants = list(next(iter(shares.values()))), list(shares)
    colors = mpl.colormaps["cividis"](np.linspace(0.05, 0.95, len(plants)))
    with mpl.rc_context(STYLE):
        figure = Picture(figsize=(7.0, 1.5 + 0.35 * len(names)), layout="constrained")
        axes, left = figure.subplots(), np.zeros(len(names))
        for plant, color in zip(plants, colors, strict=True):
            of_each = np.array([shares[plant][name] for name in names])
            axes.barh(np.arange(len(names)), of_each, left=left, color=color, edgecolor="white", linewidth=0.8, label=str(plant))
            left += of_each
        axes.set_yticks(np.arange(len(names)), names)
        axes.set_ylim(len(names) - 0.4, -0.6)
        axes.set_xlim(0, 1)
        axes.grid(axis="y", visible=False)
        axes.xaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
        axes.set_xlabel(f"share of each {label} in what is known")
        if len(plants) <= 10:  # a longer legend has no room
            figure.legend(*axes.get_legend_handles_labels(), loc="outside upper left", ncols=5, title=label, alignment="left")
    return figure
