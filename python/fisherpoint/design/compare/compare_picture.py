"""Standard errors of several designs, as a picture."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from ...show.parameter_pictures import share_axis
from ...show.style import CRITERION, NOISE, PRIOR, STYLE, TEXT, Picture

COLOURS = (NOISE, CRITERION, "#009e73", "#cc79a7", TEXT, "#56b4e9")
MARKERS = "osD^vP"


def plot_comparison(designs: Mapping[str, Mapping[str, float] | None], prior_std: Mapping[str, float]) -> Figure:
    """Standard errors as shares of the prior's on a logarithmic axis, a row for each parameter, a mark for each design.

    The errors of a design are None where F is singular.
    """
    names, count = list(prior_std), len(designs)
    rows = np.arange(len(names))
    with mpl.rc_context(STYLE):
        figure = Picture(figsize=(7.0, 1.6 + 0.4 * len(names) + 0.2 * ((count + 2) // 3)), layout="constrained")
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
        share_axis(axes, names)
        figure.legend(loc="outside upper left", ncols=3)
    return figure
