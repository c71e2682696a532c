"""Designs of several sizes, as a picture."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, NullFormatter, PercentFormatter

from ...show.parameter_pictures import DECADE
from ...show.style import NOISE, PRIOR, STYLE, Picture, share_formatter
from .sweep_record import SweptDesigns

_COLOURS = mpl.colormaps["tab20"].colors  # type: ignore[attr-defined]


def plot_sweep(sweep: SweptDesigns) -> Figure:
    """Standard errors of all parameters, and the D-efficiency that is proven, over the number of points; the knee as a line."""
    sizes = np.array(sweep.sizes)
    with mpl.rc_context(STYLE):
        figure = Picture(figsize=(7.5, 6.0), layout="constrained")
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
        for k, name in enumerate(sweep.problem.estimated):
            errors = [(of.evaluation.standard_errors or {}).get(name, np.nan) for of in sweep.designs]
            share = np.array(errors, dtype=float) / sweep.problem.prior.std[name]
            above.plot(sizes, share, marker=".", linewidth=1.4, color=_COLOURS[k % len(_COLOURS)], label=name)
        above.axhline(1.0, color=PRIOR, linewidth=1.5)
        above.set_yscale("log")
        above.yaxis.set_major_formatter(share_formatter())
        above.yaxis.set_minor_formatter(NullFormatter())
        above.set_ylim(bottom=min(above.get_ylim()[0], DECADE))
        above.set_ylabel("standard error, share of the prior std")
        above.set_title(f"What more experiments add, {sweep.problem.model.name}")
        figure.legend(loc="outside right upper")
        at_least = np.array([of.at_least if of.at_least is not None else np.nan for of in sweep.designs], dtype=float)
        below.plot(sizes, at_least, marker=".", color=NOISE)
        below.yaxis.set_major_formatter(PercentFormatter(1.0, decimals=None))
        name = sweep.settings.goal.criterion
        below.set_ylabel(f"{name}-efficiency\nat least")
        below.set_xlabel("points of the design")
        below.xaxis.set_major_locator(MaxNLocator(integer=True))
        if sweep.knee is not None:
            for axes in (above, below):
                axes.axvline(sweep.knee, color=PRIOR, linestyle="--", linewidth=1.2)
            above.annotate(
                f"knee: {sweep.knee}",
                (sweep.knee, 0.0),
                xycoords=("data", "axes fraction"),
                xytext=(4, 5),
                textcoords="offset points",
            )
    return figure
