"""The picture of the trajectories of a design: outputs over time, and their spread over the prior."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ...basics.quantity import Quantity
from ...information.draws import drawn_from_prior
from ...information.problem import DesignProblem
from ...noise.models import nominal_std
from ...points.experiments import Experiments
from ...show.panels import BAND, COLUMNS, MOST_PANELS, few_ticks, place_panels
from ...show.style import NOISE, STYLE, TEXT, Picture, labelled, said, scale, show_under_mouse
from ...show.time_axes import begin, duration, is_fast, make_logarithmic
from .evaluated_points import EvaluatedPoints
from .paths import FRACTIONS, paths_of

Floats = NDArray[np.float64]

DECADES = np.geomspace(1e-7, 1.0, 99)
"""Fractions of a duration at which trajectories are drawn over a logarithmic time."""

ALIKE = 0.01
"""Points whose numbers all differ by less than this share have one row of trajectories."""

MOST_NUMBERS = 5
"""Most numbers of equal points that are shown beside their row."""

RANGE = (5.0, 95.0)
"""Percentiles of the plants between which the shade lies."""


class _Row(NamedTuple):
    """Trajectories of a point: times in the axis's unit, outputs (T, n_y) at the prior mean, and their range over the prior."""

    time: Floats
    mean: Floats
    low: Floats
    high: Floats
    unit: str
    is_log: bool


def plot_trajectories(design: EvaluatedPoints, max_points: int = 24, plants: int = 200, seed: int = 0) -> Figure:
    """Every point's outputs over time with their spread over the prior: a row per point, or of points alike, a column per output.

    Outputs that do not fit side by side follow below, with the same rows.

    Parameters
    ----------
    design
        A design or evaluated points.
    max_points
        So many points are shown, from the first on, or fewer where there are many outputs.
    plants
        So many are drawn from the prior; the shade is their 5 to 95 % range.
    seed
        Of that draw.
    """
    model = design.problem.model
    points = design.points[: min(max_points, max(1, MOST_PANELS // len(model.outputs)))]
    title = "Trajectories" if len(points) == len(design.points) else f"Trajectories of the first {len(points)} points"
    groups = _alike(points.table)
    points = points[[group[0] for group in groups]]
    theta, _ = drawn_from_prior(design.problem, plants, np.random.default_rng(seed))
    lines = _rows(design.problem, points, theta)
    starts = _at_once(design.problem, points)
    noise = nominal_std(design.problem.noise)
    one_unit = len({line.unit for line in lines}) == 1 and not any(line.is_log for line in lines)

    with mpl.rc_context({**STYLE, "font.size": 8.0}):
        bands = -(-len(model.outputs) // COLUMNS)
        columns = -(-len(model.outputs) // bands)
        width = max(2.5 * columns + 0.6, 5.6)  # the legend needs that
        figure = Picture(figsize=(width, bands * ((1.25 if one_unit else 1.45) * len(points) + BAND) + 1.0 - BAND))
        # (band, point, column)
        grid = figure.subplots(bands * len(points), columns, squeeze=False).reshape(bands, len(points), columns)
        titles: list[str] = []
        handles: dict[str, Any] = {}
        for j, output in enumerate(model.outputs):
            std = noise.get(output.name, 0.0)
            factor, unit = scale(output, np.concatenate([[std], *(row.mean[:, j] for row in lines)]))
            titles.append(labelled(output.name, unit))
            panels = grid[j // columns, :, j % columns]
            for axes, row, group, start, dt in zip(panels, lines, groups, starts, points.dt, strict=True):
                shade = {"color": NOISE, "alpha": 0.3, "linewidth": 0}
                band = axes.fill_between(row.time, factor * row.low[:, j], factor * row.high[:, j], **shade)
                (line,) = axes.plot(row.time, factor * row.mean[:, j], color=NOISE, linewidth=1.3)
                show_under_mouse((band, line), _curve_label(group, output, (start[j], row.mean[-1, j]), dt), f"{group[0]}-{j}")
                handles |= {"at the prior mean": line, "5 to 95 % over the prior": band}
                if std:
                    bar = axes.errorbar(
                        row.time[-1], factor * row.mean[-1, j], factor * std,
                        color=TEXT, fmt=".", markersize=4, capsize=2, linewidth=1,
                    )  # fmt: skip
                    handles["sample, with one std of the noise"] = bar
                few_ticks(axes)
                if row.is_log:
                    make_logarithmic(axes, row.time[0], row.time[-1] * 1.4, most=4)
        ncols = 3 if width > 6.5 else 2
        figure.legend(
            list(handles.values()), list(handles), loc="upper left", ncols=ncols, title=title, alignment="left", borderaxespad=0.2
        )
        above = 0.46 + 0.16 * -(-len(handles) // ncols)
        for axes in grid[-1, :, len(model.outputs) - (bands - 1) * columns :].ravel():
            axes.remove()
        place_panels(figure, grid, titles, above, 0.3 if one_unit else 0.5)
        for band, k in np.ndindex(bands, len(points)):
            first = grid[band, k, 0].get_position()
            numbers = [str(number + 1) for number in groups[k]]
            label = "\n".join(numbers if len(numbers) <= MOST_NUMBERS else [*numbers[: MOST_NUMBERS - 1], "…"])
            place = (0.06 / width, first.y0 + first.height / 2)
            figure.text(*place, label, ha="left", va="center", fontsize=11, fontweight="bold")
            for axes in grid[band, k]:
                # Without a label, its distance from all numbers must not be computed: that takes time.
                axes.yaxis.set_label_coords(0.0, 0.5)
                if one_unit and k + 1 < len(points):
                    axes.xaxis.set_label_coords(0.5, 0.0)
                else:
                    axes.set_xlabel("t, logarithmic" if lines[k].is_log else f"t [{lines[k].unit}]", labelpad=1)
    return figure


def _rows(problem: DesignProblem, points: Experiments, theta: Floats) -> list[_Row]:
    """A row for each point; of what is fast at first, over a logarithmic time."""
    means, ranges = _spread(problem, points, FRACTIONS, theta)
    fast = np.array([is_fast(mean, FRACTIONS) for mean in means], dtype=bool)
    rows = {}
    for k in np.flatnonzero(~fast).tolist():
        factor, unit = scale(Quantity("t", "s"), points.dt[k])
        rows[k] = _Row(factor * points.dt[k] * FRACTIONS, means[k], ranges[0, k], ranges[1, k], unit, False)
    if fast.any():
        means, ranges = _spread(problem, points[fast], DECADES, theta)
        for k, mean, low, high in zip(np.flatnonzero(fast).tolist(), means, *ranges, strict=True):
            first = begin(mean)
            rows[k] = _Row(points.dt[k] * DECADES[first:], mean[first:], low[first:], high[first:], "s", True)
    return [rows[k] for k in range(len(points))]


def _spread(problem: DesignProblem, points: Experiments, fractions: Floats, theta: Floats) -> tuple[Floats, Floats]:
    """Outputs (K, T, n_y) at the prior mean, and both ends (2, K, T, n_y) of their range over the prior."""
    mean = paths_of(problem, points, fractions, problem.theta[None])[1][:, 0]
    paths = paths_of(problem, points, fractions, theta)[1]
    return mean, np.stack([_percentile(paths, share) for share in RANGE])


def _percentile(paths: Floats, share: float) -> Floats:
    """As `np.nanpercentile` of paths (K, plants, T, n_y) over the plants, in a hundredth of the time: few of them end early."""
    ordered = np.sort(paths, axis=1)  # what is not there stands last
    last = np.count_nonzero(~np.isnan(paths), axis=1)[:, None] - 1
    place = last * (share / 100)
    below = np.floor(place).astype(np.intp)
    low, high = (np.take_along_axis(ordered, np.minimum(at, last), axis=1) for at in (below, below + 1))
    between: Floats = low + (place - below) * (high - low)
    return between[:, 0]


def _at_once(problem: DesignProblem, points: Experiments) -> Floats:
    """Outputs (K, n_y) at the starts and the prior mean; NaN where one of them has no finite output."""
    try:
        return problem.model.output(points.x0, points.u, problem.theta)
    except ValueError:
        return np.full((len(points), len(problem.model.outputs)), np.nan)


def _alike(table: Floats) -> list[list[int]]:
    """Rows of a table that are equal but for a small share of their numbers, by the first of them."""
    groups: list[list[int]] = []
    for k, row in enumerate(table):
        for group in groups:
            if (np.abs(row - table[group[0]]) <= ALIKE * np.abs(row)).all():
                group.append(k)
                break
        else:
            groups.append([k])
    return groups


def _curve_label(group: Sequence[int], output: Quantity, ends: Sequence[float], dt: float) -> str:
    """What the curve of a point says of itself."""
    of = f"point {group[0] + 1}" if len(group) == 1 else f"points {', '.join(str(k + 1) for k in group)}"
    start, end = (said(output, value) for value in ends)
    return f"{of}: {output.name} is {start} at the start, {end} after {duration(dt)}, at the prior mean"
