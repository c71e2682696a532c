"""Picture of what is left in the residuals of records and runs: their autocorrelation and their spectrum."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ..show.numbers import p_value_text
from ..show.style import CRITERION, NOISE, PRIOR, STYLE, Picture, nothing_drawn
from .residual_checks import ResidualCheck
from .statistics import FitStatistics

QUANTILE = 1.358
"""95 % quantile of Kolmogorov's distribution."""


def plot_autocorrelation(fit: FitStatistics) -> Figure:
    """Autocorrelation and cumulative periodogram of whitened residuals, with the 95 % bands of white noise: a row per output."""
    checks = {name: check for name, check in fit.residual_checks.items() if len(check.autocorrelation.values)}
    with mpl.rc_context(STYLE):
        if not checks:
            return nothing_drawn("Autocorrelation: no record or run among the data has samples enough")
        figure = Picture(figsize=(7.6, 0.9 + 2.0 * len(checks)), layout="constrained")
        panels = figure.subplots(len(checks), 2, sharex="col", squeeze=False)
        figure.suptitle("Are the residuals white? Bands: 95 % of white noise, after the fit", x=0.01, ha="left")
        for (left, right), (name, check) in zip(panels, checks.items(), strict=True):
            _draw_autocorrelation(left, name, check)
            _draw_spectrum(right, check)
        panels[-1, 0].set_xlabel("lag in samples")
        panels[-1, 1].set_xlabel("frequency in cycles per sample")
    return figure


def _draw_autocorrelation(axes: Axes, name: str, check: ResidualCheck) -> None:
    found = check.autocorrelation
    lags = np.arange(1, len(found.values) + 1)
    low, high = found.expected - found.band, found.expected + found.band
    edges = np.concatenate([lags - 0.5, lags[-1:] + 0.5])
    axes.stairs(high, edges, baseline=low, fill=True, color=NOISE, alpha=0.12)
    axes.axhline(0, color=PRIOR, linewidth=0.8)
    axes.vlines(lags, 0, found.values, color=PRIOR, linewidth=1.0)
    outside = (found.values < low) | (found.values > high)
    for which, color in ((~outside, NOISE), (outside, CRITERION)):
        axes.plot(lags[which], found.values[which], "o", color=color, markersize=4)
    reach = max(0.3, 1.1 * float(np.abs(np.concatenate([found.values, low, high])).max()))
    axes.set_ylim(-reach, reach)
    axes.set_xlim(0.4, max(lags[-1] + 0.6, 4.6))
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_ylabel(name)
    p_value = "too few samples" if check.lag_p_value is None else p_value_text(check.lag_p_value)
    axes.set_title(f"autocorrelation, {p_value}", fontsize=9, loc="right")


def _draw_spectrum(axes: Axes, check: ResidualCheck) -> None:
    found = check.spectrum
    p_value = "too few samples" if check.spectrum_p_value is None else p_value_text(check.spectrum_p_value)
    axes.set_title(f"cumulative periodogram, {p_value}", fontsize=9, loc="right")
    axes.set_xlim(0, 0.5)
    axes.set_ylim(-0.02, 1.02)
    if found.ordinates < 2:
        return
    band = QUANTILE / np.sqrt(found.ordinates - 1)
    low, high = np.maximum(found.expected - band, 0), np.minimum(found.expected + band, 1)
    axes.fill_between(found.frequencies, low, high, color=NOISE, alpha=0.12, linewidth=0)
    axes.plot(found.frequencies, found.expected, color=PRIOR, linewidth=0.8)
    outside = bool((np.abs(found.cumulative - found.expected) > band).any())
    axes.plot(found.frequencies, found.cumulative, color=CRITERION if outside else NOISE, linewidth=1.4)
