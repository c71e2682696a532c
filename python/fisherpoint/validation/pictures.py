"""The picture of a validation: what designs promise against what virtual experiments achieve, and the coverage of intervals."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter, PercentFormatter

from ..basics.values import Array
from ..show.numbers import counted
from ..show.style import CRITERION, NOISE, PRIOR, STYLE, TEXT, Picture, share_formatter
from .design_validation import DesignValidation
from .figures import LEVEL
from .verdict import COVERAGE_TOLERANCE

MOST = 0.95
"""Quantile of the errors up to which the axis reaches."""

BANDS = 2.0
"""Monte Carlo standard errors that an error bar reaches to either side."""


def plot_validation(designs: Mapping[str, DesignValidation]) -> Figure:
    """One row of two panels per design: standard errors over the prior std, and the coverage of the fits' 95 % intervals."""
    count, rows = len(designs), max(len(design.figures) for design in designs.values())
    limits = _limits(designs.values())
    with mpl.rc_context(STYLE):
        figure = Picture(figsize=(8.6, 1.3 + count * (0.85 + 0.27 * rows)), layout="constrained")
        panels = figure.subplots(count, 2, squeeze=False, sharex="col", width_ratios=(2.6, 1))
        for (name, design), (errors, coverage) in zip(designs.items(), panels, strict=True):
            _errors(errors, design, limits)
            _coverage(coverage, design)
            why = "no trajectory at the prior mean" if design.without else "no parameter is determined"
            fits = f"{why}, nothing was fitted" if design.per_run is None else f"{design.fits} fits, {design.failed} failed"
            errors.set_title(f"{name}: {design.size}, {fits}")
        left, right = panels[-1]
        left.set_xscale("log")
        left.set_xlim(limits)
        left.xaxis.set_major_formatter(share_formatter())
        left.xaxis.set_minor_formatter(NullFormatter())
        left.set_xlabel("standard error, share of the prior std")
        right.set_xlabel(f"coverage of {LEVEL:.0%} intervals")
        right.xaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
        handles, labels = panels[0][0].get_legend_handles_labels()
        figure.legend(
            handles,
            labels,
            loc="outside upper left",
            ncols=4,
            title="Promised and achieved standard errors",
            alignment="left",
        )
    return figure


def _limits(designs: Iterable[DesignValidation]) -> tuple[float, float]:
    """Entries on the axis of standard errors: the prior, what is promised and typical, and the size of most errors.

    A few fits that ran off make the achieved standard error as large as it likes; then that lies outside, and is marked.
    """
    shown = [1.0]
    for design in designs:
        for name, of in design.figures.items():
            sizes = [of.promised, of.typical.value]
            if design.per_run is not None and np.isfinite(of.achieved.value):
                sizes.append(min(of.achieved.value, float(np.quantile(np.abs(design.errors(name)), MOST))))
            shown += [size / of.prior_std for size in sizes if np.isfinite(size) and size > 0]
    return min(shown) / 1.6, max(shown) * 1.6


def _errors(axes: Axes, design: DesignValidation, limits: tuple[float, float]) -> None:
    """Promised, achieved and typical standard errors of each parameter."""
    figures = list(design.figures.values())
    rows, prior = np.arange(len(figures)), np.array([of.prior_std for of in figures])
    promised = np.array([of.promised for of in figures]) / prior
    achieved, achieved_error = _values([(of.achieved.value, of.achieved.error) for of in figures], prior)
    typical, _ = _values([(of.typical.value, of.typical.error) for of in figures], prior)
    outside = np.flatnonzero(achieved > limits[1])
    achieved, achieved_error = np.delete(achieved, outside), np.delete(achieved_error, outside)
    inside = np.delete(rows, outside)
    axes.axvline(1.0, color=PRIOR, linewidth=1.5, label="prior")
    reached = np.full(len(rows), limits[1])
    reached[inside] = achieved
    axes.hlines(rows, np.fmin(promised, reached), np.fmax(promised, reached), color=CRITERION, alpha=0.35, linewidth=3)
    axes.plot(promised, rows, "|", color=NOISE, markersize=13, markeredgewidth=2.2, label="promised")
    axes.plot(typical, rows, "o", color=CRITERION, markerfacecolor="none", markersize=8, label="achieved, typical (median)")
    reach = np.array([np.fmin(BANDS * achieved_error, 0.9 * achieved), BANDS * achieved_error])
    axes.errorbar(
        achieved,
        inside,
        xerr=reach,
        fmt="o",
        color=CRITERION,
        markersize=4,
        linewidth=1.2,
        label=f"achieved, {BANDS:g} Monte Carlo std",
    )
    for row in outside:
        _mark_outside(axes, design, int(row), limits[1])
    for row, of in zip(rows, figures, strict=True):
        ratio = "not determined" if np.isnan(of.promised) else "-" if np.isnan(of.ratio.value) else f"{of.ratio.value:.2f}"
        axes.annotate(
            ratio, (1.0, float(row)), xycoords=("axes fraction", "data"), xytext=(6, 0), textcoords="offset points", va="center"
        )
    axes.annotate(
        "achieved /\npromised",
        (1.0, 1.0),
        xycoords="axes fraction",
        xytext=(6, 2),
        textcoords="offset points",
        fontsize=7,
        color=TEXT,
    )
    _parameters(axes, [*design.parameters, *(f"{name} (local)" for name in design.local)])


def _mark_outside(axes: Axes, design: DesignValidation, row: int, limit: float) -> None:
    """An arrow at the edge, and how many of the fits have errors beyond it."""
    name, of = list(design.figures.items())[row]
    errors = np.abs(design.errors(name)) / of.prior_std
    axes.plot([limit], [row], ">", color=CRITERION, markersize=8, clip_on=False)
    axes.annotate(
        f"{counted(int((errors > limit).sum()), 'fit')} outside",
        (limit, row),
        xytext=(-8, 5),
        textcoords="offset points",
        ha="right",
        fontsize=7,
        color=TEXT,
    )


def _coverage(axes: Axes, design: DesignValidation) -> None:
    figures = list(design.figures.values())
    rows, ones = np.arange(len(figures)), np.ones(len(figures))
    coverage, error = _values([(of.coverage.value, of.coverage.error) for of in figures], ones)
    axes.axvspan(LEVEL - COVERAGE_TOLERANCE, LEVEL + COVERAGE_TOLERANCE, color=PRIOR, alpha=0.15, linewidth=0)
    axes.axvline(LEVEL, color=PRIOR, linewidth=1.5)
    axes.errorbar(coverage, rows, xerr=BANDS * error, fmt="o", color=CRITERION, markersize=4, linewidth=1.2)
    low = float(np.nanmin(coverage - BANDS * error, initial=0.9))
    axes.set_xlim(min(axes.get_xlim()[0], max(0.0, low - 0.02)), 1.005)
    _parameters(axes, [""] * len(figures))


def _parameters(axes: Axes, names: list[str]) -> None:
    axes.set_yticks(np.arange(len(names)), names)
    axes.set_ylim(len(names) - 0.4, -0.6)
    axes.grid(axis="y", visible=False)


def _values(pairs: list[tuple[float, float]], size: Array) -> tuple[Array, Array]:
    values, errors = np.array(pairs).T
    return values / size, errors / size
