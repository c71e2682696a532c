"""Pictures of a fit. Every ``plot_...`` returns a :class:`matplotlib.figure.Figure` that belongs to no window."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import combinations
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from ..basics.quantity import Quantity
from ..basics.stop_reason import StopReason
from ..data import Record
from ..points.run_trajectories import checked_run_trajectories
from ..points.runs import Runs
from ..points.sampling import holds_of
from ..points.settings import checked_arguments
from ..show.parameter_pictures import correlation_figure
from ..show.style import (
    CRITERION,
    NOISE,
    PRIOR,
    STYLE,
    TEXT,
    Picture,
    labelled,
    nothing_drawn,
    said,
    scale,
    show_each_under_mouse,
    show_under_mouse,
)
from ..show.time_axes import RunTime, is_crowded, make_logarithmic_from_zero, shares_of
from .local_pictures import plot_local
from .profile_curve import ProfileCurve
from .residual_pictures import plot_autocorrelation
from .statistics import FitStatistics

MANY = 150
"""Samples from which on they are drawn as small dots."""

MOST_SERIES = 6
"""Records and runs that are shown over time."""

MOST_PAIRS = 6
"""Maximum number of pairs of unknowns whose ellipses are shown."""


def plot_parity(fit: FitStatistics) -> Figure:
    """Measured against predicted outputs: on the diagonal where the model is right. A panel per measured output."""
    measured = fit.predicted + fit.residuals
    with mpl.rc_context(STYLE):
        figure, panels = _grid(len(fit.tests), 3.4, 3.2)
        figure.suptitle("Measured against predicted outputs", x=0.01, ha="left")
        for axes, (i, quantity) in zip(panels, _measured_outputs(fit), strict=True):
            measured_here = np.isfinite(fit.residuals[:, i])
            factor, unit = scale(quantity, measured[measured_here, i])
            x, y = factor * fit.predicted[measured_here, i], factor * measured[measured_here, i]
            ends = (min(x.min(), y.min()), max(x.max(), y.max()))
            margin = 0.06 * (ends[1] - ends[0]) or 0.5 * abs(ends[0]) or 1.0
            limits = (ends[0] - margin, ends[1] + margin)
            axes.plot(limits, limits, color=PRIOR, linewidth=1.2)
            std = factor * fit.sample_std[measured_here, i]
            if len(x) <= MANY and std.max() > 0.01 * (limits[1] - limits[0]):
                axes.errorbar(x, y, yerr=2 * std, fmt="none", ecolor=NOISE, elinewidth=1.0, alpha=0.45)
            (dots,) = axes.plot(x, y, "o", color=NOISE, markersize=2 if len(x) > MANY else 5, alpha=0.5 if len(x) > MANY else 0.9)
            _name_samples(fit, dots, np.flatnonzero(measured_here), i)
            axes.set_xlim(limits)
            axes.set_ylim(limits)
            axes.set_aspect("equal")
            axes.xaxis.set_major_locator(MaxNLocator(4))
            axes.yaxis.set_major_locator(MaxNLocator(4))
            axes.set_xlabel(labelled(f"predicted {quantity.name}", unit))
            axes.set_ylabel(labelled("measured", unit))
    return figure


def plot_residuals(fit: FitStatistics) -> Figure:
    """Residuals in units of the noise's standard deviation over the samples, with the band of two of them."""
    residuals, parts = fit.standardised, np.cumsum([len(part.samples) for part in fit.data])[:-1]
    noise = "given" if fit.noise_known else "estimated"
    with mpl.rc_context(STYLE):
        figure = Picture(figsize=(7.2, 0.9 + 1.35 * len(fit.tests)), layout="constrained")
        panels = figure.subplots(len(fit.tests), 1, sharex=True, squeeze=False)[:, 0]
        figure.suptitle(f"Residuals (measured - predicted) in units of the {noise} noise; the band is +-2", x=0.01, ha="left")
        for axes, (i, quantity) in zip(panels, _measured_outputs(fit), strict=True):
            samples, r = np.arange(1, len(residuals) + 1), residuals[:, i]
            outside = np.abs(r) > 2
            axes.axhspan(-2, 2, color=NOISE, alpha=0.10, linewidth=0)
            axes.axhline(0, color=PRIOR, linewidth=0.8)
            size = 1.5 if len(r) > MANY else 4.5
            if len(r) <= MANY:
                axes.vlines(samples, 0, r, color=PRIOR, linewidth=0.8)
            for which, color in ((np.abs(r) <= 2, NOISE), (outside, CRITERION)):
                (dots,) = axes.plot(samples[which], r[which], "o", color=color, markersize=size)
                _name_samples(fit, dots, np.flatnonzero(which), i)
            reach = max(3.0, 1.1 * float(np.nanmax(np.abs(r))))
            axes.set_ylim(-reach, reach)
            axes.set_ylabel(quantity.name)
            axes.yaxis.set_major_locator(MaxNLocator(5, integer=True))
            for edge in parts:
                axes.axvline(edge + 0.5, color=TEXT, linewidth=0.8, linestyle=":")
            axes.grid(axis="x", visible=False)
        panels[-1].set_xlabel("sample" + ("; dotted: the next set of data" if len(parts) else ""))
        panels[-1].xaxis.set_major_locator(MaxNLocator(integer=True))
        panels[-1].set_xlim(0.5 - 0.01 * len(residuals), len(residuals) + 0.5 + 0.01 * len(residuals))
    return figure


def plot_correlation(fit: FitStatistics) -> Figure:
    """Correlation of the estimates; empty rows are unknowns that the data do not determine."""
    names, count = fit.common, len(fit.common)
    known = fit.precision.determined[:count]
    correlation = np.where(np.outer(known, known), fit.correlation[:count, :count], np.nan)
    return correlation_figure(correlation, names, "Correlation of the estimates", "")


def ellipse(covariance: NDArray[Any], quantile: float, count: int = 181) -> NDArray[np.float64]:
    """Points (count, 2) of the ellipse d^T C^-1 d = quantile about zero: L times a circle, with C = L L^T."""
    std = np.sqrt(np.diag(covariance))
    correlation = float(np.clip(covariance[0, 1] / (std[0] * std[1]), -1.0, 1.0))
    angle = np.linspace(0.0, 2 * np.pi, count)
    first, second = np.cos(angle), np.sin(angle)
    both = np.stack([first, correlation * first + np.sqrt(1 - correlation**2) * second], axis=1)
    return np.asarray(np.sqrt(quantile) * both * std)


def plot_ellipses(fit: FitStatistics, level: float = 0.95) -> Figure:
    """Joint confidence ellipses of pairs of unknowns: of all pairs up to four unknowns, else of the most correlated ones.

    The quantile is that of chi-square with two degrees of freedom; where the noise was estimated, twice that of F.
    """
    names, unknowns, determined = fit.common, fit.weighted.unknowns, fit.precision.determined
    pairs = [pair for pair in combinations(range(len(names)), 2) if determined[list(pair)].all()]
    pairs = sorted(sorted(pairs, key=lambda pair: -abs(fit.correlation[pair]))[:MOST_PAIRS])
    degrees = np.array(list(fit.quantile_degrees_of_freedom.values()))
    intervals = list(fit.intervals(level).values())
    covariance = fit.precision.covariance
    with mpl.rc_context(STYLE):
        if not pairs:
            return nothing_drawn("Confidence ellipses: no two unknowns are determined")
        figure, panels = _grid(len(pairs), 3.3, 3.0)
        title = f"Joint {100 * level:g} % regions; bars: of each alone"
        if len(pairs) < len(names) * (len(names) - 1) // 2:
            title = f"{title}; the {len(pairs)} most correlated pairs"
        figure.suptitle(title, x=0.01, ha="left")
        for axes, (i, j) in zip(panels, pairs, strict=True):
            z = np.tile(fit.z, (181, 1))
            z[:, [i, j]] += ellipse(covariance[np.ix_([i, j], [i, j])], _joint_quantile(level, min(degrees[i], degrees[j])))
            curve = unknowns.values(z)[:, [i, j]]
            labels, factors = [], []
            for column, k in enumerate((i, j)):
                factor, unit = scale(Quantity(names[k], fit.units[names[k]]), curve[:, column])
                factors.append(factor)
                labels.append(labelled(names[k], unit))
            x, y = (factors[c] * fit.values[k] for c, k in enumerate((i, j)))
            axes.fill(*(curve * factors)[:-1].T, color=NOISE, alpha=0.15, linewidth=0)
            axes.plot(*(curve * factors).T, color=NOISE, linewidth=1.4)
            axes.plot(x, y, "+", color=TEXT, markersize=8)
            low, high = (np.array([intervals[k][side] * factors[c] for c, k in enumerate((i, j))]) for side in (0, 1))
            axes.plot([low[0], high[0]], [y, y], color=PRIOR, linewidth=1.0, marker="|", markersize=6, zorder=1)
            axes.plot([x, x], [low[1], high[1]], color=PRIOR, linewidth=1.0, marker="_", markersize=6, zorder=1)
            axes.set_title(f"correlation {fit.correlation[i, j]:.2f}", fontsize=9)
            axes.ticklabel_format(useOffset=False)
            axes.set_xlabel(labels[0])
            axes.set_ylabel(labels[1])
            axes.xaxis.set_major_locator(MaxNLocator(4))
            axes.yaxis.set_major_locator(MaxNLocator(4))
    return figure


def plot_profiles(profiles: Sequence[ProfileCurve]) -> Figure:
    """Deviance of each unknown with all others estimated anew, its interval, and the parabola of the standard error."""
    with mpl.rc_context(STYLE):
        figure, panels = _grid(len(profiles), 3.6, 2.9)
        figure.suptitle(f"Profile likelihood and its {100 * profiles[0].level:g} % interval", x=0.01, ha="left")
        for axes, profile in zip(panels, profiles, strict=True):
            _profile_panel(axes, profile)
        figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


class _Series(NamedTuple):
    """Samples over time: of a record, or of a run; their rows among those of the fit."""

    t: NDArray[np.float64]
    rows: slice
    run: Runs | None


def _series(fit: FitStatistics) -> Iterator[_Series]:
    first = 0
    for part in fit.data:
        if isinstance(part, Record):
            yield _Series(part.t, slice(first, first + len(part)), None)
        elif part.points is part.runs:
            ends = first + np.cumsum(part.runs.measured.sum(axis=1))
            for run, end in zip(part.runs, ends.tolist(), strict=True):
                t = run.t[run.measured]
                yield _Series(t, slice(end - len(t), end), run)
        first += len(part.samples)


def plot_time(fit: FitStatistics) -> Figure:
    """Measured and simulated outputs over time: a column per record or run, a row per measured output."""
    everything, outputs = list(_series(fit)), list(_measured_outputs(fit))
    series = everything[:MOST_SERIES]
    with mpl.rc_context(STYLE):
        if not series:
            return nothing_drawn("Over time: there is no record or run among the data")
        paths = [None if run is None else _between_samples(fit, run, rows.start) for _, rows, run in series]
        times = [
            None
            if run is None
            else RunTime((held := holds_of(run.u, run.dt, run.readings).dt[0])[held > 0], path if run.segments[0] == 1 else None)
            for (_, _, run), path in zip(series, paths, strict=True)
        ]
        width = max(7.2 / len(series), 4.6, *(time.width for time in times if time))
        figure = Picture(figsize=(width * len(series), 0.9 + 2.2 * len(outputs)), layout="constrained")
        grid = figure.subplots(len(outputs), len(series), sharex="col", squeeze=False)
        of = f"; the first {len(series)} of {len(everything)}" if len(series) < len(everything) else ""
        figure.suptitle(f"Measured and simulated over time{of}", x=0.01, ha="left")
        handles: list[Line2D] = []
        measured = fit.predicted + fit.residuals
        for column, ((t, rows, run), time, path) in enumerate(zip(series, times, paths, strict=True)):
            if run is None or time is None or path is None:
                crowded = is_crowded(t)
                time_factor, time_unit = (1.0, "s") if crowded else scale(Quantity("t", "s", "time"), t)
                at = t - t[0] if crowded else time_factor * t
                curve, simulated = at, fit.predicted[rows]
                if crowded:
                    make_logarithmic_from_zero(grid[-1, column], at[1], at[-1])
                grid[-1, column].set_xlabel("time from the first sample, logarithmic" if crowded else f"time [{time_unit}]")
            else:
                at, simulated = time(t), path
                shares = shares_of(int(run.segments[0]))
                dense = len(time.durations) < run.segments[0]
                curve = time(run.divided(shares).t[0, : len(path)]) if dense else time.within(np.array(shares))
                time.mark(grid[:, column])
            few = len(t) <= MANY
            for axes, (i, quantity) in zip(grid[:, column], outputs, strict=True):
                y = measured[rows, i]
                measured_here = np.isfinite(y)
                factor, unit = scale(quantity, np.append(y[measured_here], simulated[:, i]))
                (line,) = axes.plot(curve, factor * simulated[:, i], color=NOISE, linewidth=1.3, zorder=1 if few else 3)
                size = {"marker": "o", "markersize": 4} if few else {"marker": ".", "markersize": 3}
                color = TEXT if few else PRIOR
                (dots,) = axes.plot(at[measured_here], factor * y[measured_here], linestyle="", color=color, zorder=2, **size)
                handles = handles or [line, dots]
                show_under_mouse([line], f"{quantity.name} as simulated", f"simulated-{column}-{i}")
                _name_samples(fit, dots, np.arange(rows.start, rows.stop)[measured_here], i)
                rms = np.sqrt(np.mean(np.square(fit.residuals[rows, i][measured_here]))) if measured_here.any() else np.nan
                text = f"root mean square of the residuals {said(quantity, rms)}"
                axes.set_title(text, fontsize=9, loc="right")
                axes.set_ylabel(labelled(quantity.name, unit))
        grid[0, 0].legend(handles, ("simulated", "measured"), loc="best", frameon=True, framealpha=0.9, edgecolor="none", ncols=2)
    return figure


def _between_samples(fit: FitStatistics, run: Runs, sample: int) -> NDArray[np.float64]:
    """Outputs on the whole way of a run, as the estimate has it; NaN where the trajectory does not get to."""
    n = int(run.segments[0])
    shares = shares_of(n)
    fine, count = run.divided(shares), n * len(shares)
    observed = fit.weighted.observed
    model, theta = observed.model, observed.of_sample(fit.values, sample)
    settings = checked_arguments(model, fine, theta, observed.rtol, None, "cross", "cross", None)
    found = checked_run_trajectories(model, fine, theta, settings)
    reached = np.arange(count) < found.reached[0]
    return np.where(reached[:, None], found.y[0, :count], np.nan)


PLOTS: dict[str, Callable[[FitStatistics], Figure]] = {
    "parity": plot_parity,
    "residuals": plot_residuals,
    "time": plot_time,
    "autocorrelation": plot_autocorrelation,
    "correlation": plot_correlation,
    "ellipses": plot_ellipses,
    "local": plot_local,
}
"""The pictures of a fit by their kind, but for profiles, which are computed first."""


def _grid(count: int, width: float, height: float) -> tuple[Figure, list[Axes]]:
    columns = min(3, count) if count != 4 else 2
    rows = -(-count // columns)
    figure = Picture(figsize=(max(width * columns, 4.4), height * rows + 0.3), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes in grid[count:]:
        axes.remove()
    return figure, list(grid[:count])


def _measured_outputs(fit: FitStatistics) -> Iterator[tuple[int, Quantity]]:
    return ((i, quantity) for i, quantity in enumerate(fit.model.outputs) if quantity.name in fit.tests)


def _name_samples(fit: FitStatistics, dots: Line2D, samples: NDArray[np.intp], i: int) -> None:
    """Label each dot of an output with its sample and what was measured; not where there are too many to hit one."""
    if len(samples) > MANY or not len(samples):
        return
    quantity = fit.model.outputs[i]
    texts = [
        f"sample {k + 1}: {quantity.name} measured {said(quantity, (fit.predicted + fit.residuals)[k, i])}, "
        f"predicted {said(quantity, fit.predicted[k, i])}, off by {fit.standardised[k, i]:+.2f} std of the noise"
        for k in samples.tolist()
    ]
    show_each_under_mouse(dots, texts, f"samples-{i}-{samples[0]}")


def _joint_quantile(level: float, degrees: float) -> float:
    from scipy.stats import chi2, f

    return float(2 * f.ppf(level, 2, degrees) if np.isfinite(degrees) else chi2.ppf(level, 2))


def _profile_panel(axes: Axes, profile: ProfileCurve) -> None:
    from scipy.interpolate import PchipInterpolator

    linear, estimate = profile.linear_interval, profile.estimate
    ends = [value for value in (*profile.interval, *linear) if np.isfinite(value)]
    half = (linear[1] - linear[0]) / 2 if np.isfinite(linear).all() else float(np.ptp(profile.values))
    ends += [estimate + side * 3 * half for side, how in zip((-1, 1), profile.ends, strict=True) if how == StopReason.not_bounded]
    margin = 0.12 * (max(ends) - min(ends))
    limits = min(ends) - margin, max(ends) + margin
    inside = (profile.values >= limits[0]) & (profile.values <= limits[1])
    at = np.union1d(np.linspace(*limits, 400), profile.values[inside])
    factor, unit = scale(Quantity(profile.name, profile.unit, ""), at)
    values, first = np.unique(profile.values, return_index=True)
    root = PchipInterpolator(values, profile.signed_root[first], extrapolate=False)
    axes.axhline(profile.threshold, color=PRIOR, linestyle="--", linewidth=1.0, label="threshold")
    low, high = (end if np.isfinite(end) else limit for end, limit in zip(profile.interval, limits, strict=True))
    axes.axvspan(factor * low, factor * high, color=NOISE, alpha=0.10, linewidth=0)
    if np.isfinite(linear).all():
        curve = profile.threshold * np.square((at - estimate) / half)
        axes.plot(factor * at, curve, color=CRITERION, linewidth=1.1, linestyle=":", label="from the standard error")
    axes.plot(factor * at, np.square(root(at)), color=NOISE, linewidth=1.6, label="profile")
    axes.plot(factor * profile.values[inside], profile.deviance[inside], "o", color=NOISE, markersize=2.5)
    for side, how in zip((0, 1), profile.ends, strict=True):
        if how == StopReason.not_bounded:
            x, align = (0.02, "left") if side == 0 else (0.98, "right")
            axes.text(x, 0.03, how.words, transform=axes.transAxes, ha=align, va="bottom", color=CRITERION, fontsize=8)
    axes.set_ylim(-0.04 * profile.threshold, 1.5 * profile.threshold)
    axes.set_xlabel(labelled(profile.name, unit))
    axes.set_ylabel("deviance")
    axes.xaxis.set_major_locator(MaxNLocator(5))
