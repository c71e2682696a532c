"""Pictures of the points of a design: where they are in the state space, and their trajectories over the prior."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator, ScalarFormatter
from numpy.typing import NDArray

from ..basics.quantity import Quantity
from ..information.draws import drawn_from_prior
from ..information.problem import DesignProblem
from ..models import Model
from ..points.experiments import Experiments
from ..points.runs import Runs
from ..points.trajectories import simulate
from ..show.numbers import number
from ..show.style import NOISE, PRIOR, STYLE, TEXT, scale, settle, telling
from .evaluated import Evaluated
from .pictures_responses import free_axis, plot_responses

Floats = NDArray[np.float64]

FRACTIONS = np.unique(np.concatenate([[1e-6], np.geomspace(1e-4, 1.0, 17), np.linspace(0.0, 1.0, 41)[1:]]))
"""Of a duration, at which trajectories are drawn: what is fast at the start is seen beside what is slow."""

ALIKE = 0.01
"""Points of which all numbers differ by less than this share of them have one row of trajectories."""

MOST_NUMBERS = 5
"""Of points alike that are named beside their row."""

SAME_PLACE = 3.0
"""Starts that are closer on paper, in points of 1/72 inch, share one label."""


def plot_points(design: Evaluated) -> Figure:
    """The points in the state space, from start (numbered) to end (arrow), coloured by the first input, or else by dt.

    Points without a state are shown over the inputs. Where the region leaves a single coordinate free, `plot_responses` is drawn.
    """
    if free_axis(design) is not None:
        return plot_responses(design)
    model, points = design.problem.model, design.points
    paths, outputs = (path[:, 0] for path in _trajectories(design.problem, points, FRACTIONS, _mean(design)[None]))
    if not model.states:
        outputs = outputs[:, :1]
    values = {quantity.name: outputs[:, :, i] for i, quantity in enumerate(model.outputs)}
    values |= {quantity.name: paths[:, :, i] for i, quantity in enumerate(model.states)}
    values |= {quantity.name: points.u[:, [i]] for i, quantity in enumerate(model.inputs)}
    values["dt"] = points.dt[:, None]
    panels = _panels(model)
    held = (*model.inputs, *model.axes[-1:])[0]

    with mpl.rc_context(STYLE):
        columns = min(2, len(panels))
        rows = -(-len(panels) // columns)
        figure = Figure(figsize=(4.6 * columns + 0.8, 3.9 * rows), layout="constrained")
        grid = figure.subplots(rows, columns, squeeze=False).ravel()
        factor, unit = scale(held, values[held.name])
        limits = _limits(design, held.name, values[held.name])
        shade = ScalarMappable(Normalize(factor * limits[0], factor * limits[1]), "coolwarm")
        colors = shade.to_rgba(factor * values[held.name][:, 0])
        for axes, (horizontal, vertical) in zip(grid, panels, strict=False):
            _point_panel(axes, design, horizontal, vertical, values, colors)
        for axes in grid[len(panels) :]:
            axes.remove()
        bar = figure.colorbar(shade, ax=list(grid[: len(panels)]), shrink=0.5, aspect=30, pad=0.02)
        bar.set_label(f"{held.name} [{unit}]")
        dashed = "" if design.problem.region is None else "; dashed: the region"
        shown = "start (numbered) to end (arrow)" if model.states else "numbered"
        figure.suptitle(f"Experiment points: {shown}{dashed}", x=0.01, ha="left")
        settle(figure)  # the layout decides where labels have room
        for axes, (horizontal, vertical) in zip(grid, panels, strict=False):
            _number_points(axes, *_coordinates(design, horizontal, vertical, values))
    return figure


def plot_trajectories(design: Evaluated, max_points: int = 24, plants: int = 200, seed: int = 0) -> Figure:
    """Every point's outputs over time with their spread over the prior: a row per point, or of points alike, a column per output.

    Parameters
    ----------
    design
        A design or evaluated points.
    max_points
        So many points are shown, from the first on.
    plants
        So many are drawn from the prior; the shade is their 5 to 95 % range.
    seed
        Of that draw.
    """
    model, points = design.problem.model, design.points[:max_points]
    title = "Trajectories" if len(points) == len(design.points) else f"Trajectories of the first {len(points)} points"
    groups = _alike(points.table)
    points = points[[group[0] for group in groups]]
    theta, _ = drawn_from_prior(design.problem, plants, np.random.default_rng(seed))
    nominal = _trajectories(design.problem, points, FRACTIONS, _mean(design)[None])[1][:, 0]
    spread = _trajectories(design.problem, points, FRACTIONS, theta)[1]
    low, high = np.nanpercentile(spread, [5.0, 95.0], axis=1)
    noise_std = design.problem.noise_std
    times = [scale(Quantity("t", "s"), dt) for dt in points.dt]
    one_unit = len({unit for _, unit in times}) == 1

    with mpl.rc_context({**STYLE, "font.size": 8.0}):
        width = max(2.5 * len(model.outputs) + 0.6, 5.6)  # the legend needs that
        figure = Figure(figsize=(width, (1.25 if one_unit else 1.45) * len(points) + 1.0))
        grid = figure.subplots(len(points), len(model.outputs), squeeze=False)
        for j, output in enumerate(model.outputs):
            factor, unit = scale(output, nominal[:, :, j])
            for k, axes in enumerate(grid[:, j]):
                time = times[k][0] * points.dt[k] * FRACTIONS
                band = axes.fill_between(time, factor * low[k, :, j], factor * high[k, :, j], color=NOISE, alpha=0.3, linewidth=0)
                (line,) = axes.plot(time, factor * nominal[k, :, j], color=NOISE, linewidth=1.3)
                told = _told(groups[k], output.name, unit, factor * nominal[k, [0, -1], j], points.dt[k])
                telling((band, line), told, f"{k}-{j}")
                handles = [line, band]
                labels = ["at the prior mean", "5 to 95 % over the prior"]
                if noise_std is not None:
                    bar = axes.errorbar(
                        time[-1], factor * nominal[k, -1, j], factor * noise_std[output.name],
                        color=TEXT, fmt=".", markersize=4, capsize=2, linewidth=1,
                    )  # fmt: skip
                    handles.append(bar)
                    labels.append("sample, with one std of the noise")
                _few_ticks(axes)
        ncols = 3 if width > 6.5 else 2
        figure.legend(handles, labels, loc="upper left", ncols=ncols, title=title, alignment="left", borderaxespad=0.2)
        above = 0.46 + 0.16 * -(-len(handles) // ncols)
        titles = [f"{output.name} [{scale(output, nominal[:, :, j])[1]}]" for j, output in enumerate(model.outputs)]
        _place(figure, grid, titles, above, 0.3 if one_unit else 0.5)
        for k, axes in enumerate(grid[:, 0]):
            place = (0.06 / width, axes.get_position().y0 + axes.get_position().height / 2)
            numbers = [str(number + 1) for number in groups[k]]
            label = "\n".join(numbers if len(numbers) <= MOST_NUMBERS else [*numbers[: MOST_NUMBERS - 1], "…"])
            figure.text(*place, label, ha="left", va="center", fontsize=11, fontweight="bold")
        for row, (_, unit) in list(zip(grid, times, strict=True))[-1 if one_unit else 0 :]:
            for axes in row:
                axes.set_xlabel(f"t [{unit}]", labelpad=1)
    return figure


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


def _told(group: Sequence[int], name: str, unit: str, ends: Floats, dt: float) -> str:
    """What the curve of a point says of itself."""
    start, end = (number(value) for value in ends)
    of = f"point {group[0] + 1}" if len(group) == 1 else f"points {', '.join(str(k + 1) for k in group)}"
    return f"{of}: {name} from {start} to {end} {unit} in {number(dt)} s, at the prior mean"


def _place(figure: Figure, grid: NDArray[Any], titles: Sequence[str], above: float, between: float) -> None:
    """Give many small panels the room that their labels need, told by the number of characters.

    A layout engine would measure each label several times, which takes longer than all else that a command does with the design.
    Lengths are in inches.
    """
    digit = 0.65 * 8 / 72
    width, height = figure.get_size_inches()
    room = [max(_label_length(axes) for axes in column) * digit + 0.16 for column in grid.T]
    room[0] += 0.28  # the number of the point
    panel = max((width - sum(room) - 0.18) / len(room), 0.5)
    below = 0.4  # for labels
    row = (height - above - below + between) / len(grid)
    for j, title in enumerate(titles):
        left = sum(room[: j + 1]) + panel * j
        for k, axes in enumerate(grid[:, j]):
            bottom = below + (len(grid) - 1 - k) * row
            axes.set_position((left / width, bottom / height, panel / width, (row - between) / height))
        grid[0, j].set_title(title, loc="center")


def _label_length(axes: Axes) -> int:
    """Characters of the longest number at the vertical axis."""
    low, high = sorted(axes.get_ylim())
    places = [place for place in axes.yaxis.get_majorticklocs() if low <= place <= high]
    return max(map(len, axes.yaxis.get_major_formatter().format_ticks(places)), default=1)


def _panels(model: Model) -> list[tuple[Quantity, Quantity]]:
    """Pairs of axes: the states two by two, one that is left over with the first input, dt with every input.

    Without inputs dt is shown with the first state; without states the inputs are shown two by two, one that is left over with the
    first output.
    """
    if not model.states:
        return _pairs(model.inputs, model.outputs[:1])
    dt = model.axes[-1]
    return _pairs(model.states, model.inputs[:1]) + [(dt, other) for other in model.inputs or model.states[:1]]


def _pairs(quantities: Sequence[Quantity], partner: Sequence[Quantity]) -> list[tuple[Quantity, Quantity]]:
    """Two by two; what is left over, with the partner where there is one."""
    last = [(quantities[-1], partner[0])] if len(quantities) % 2 and partner else []
    return [*zip(quantities[:-1:2], quantities[1::2], strict=True), *last]


def _point_panel(
    axes: Axes,
    design: Evaluated,
    horizontal: Quantity,
    vertical: Quantity,
    values: dict[str, Floats],
    colors: Any,
) -> None:
    x, y = _coordinates(design, horizontal, vertical, values)
    limits_x, limits_y = (_limits(design, q.name, values[q.name]) for q in (horizontal, vertical))
    factor_x, unit_x = scale(horizontal, limits_x)
    factor_y, unit_y = scale(vertical, limits_y)
    bounds = {} if design.problem.region is None else design.problem.region.bounds
    if horizontal.name in bounds and vertical.name in bounds:
        low = (factor_x * limits_x[0], factor_y * limits_y[0])
        size = (factor_x * (limits_x[1] - limits_x[0]), factor_y * (limits_y[1] - limits_y[0]))
        axes.add_patch(Rectangle(low, *size, fill=False, edgecolor=PRIOR, linestyle="--", linewidth=0.8))
    for k in range(len(x)):
        if x.shape[1] > 1:
            axes.plot(x[k], y[k], color=TEXT, linewidth=1.0, alpha=0.7, zorder=2)
            arrow = {"arrowstyle": "-|>", "color": TEXT, "linewidth": 0, "mutation_scale": 9}
            there = np.flatnonzero(np.isfinite(x[k]) & np.isfinite(y[k]))
            if len(there) > 1:  # a sample at a jump may have no value
                first, last = there[[max(0, len(there) - 6), -1]]
                axes.annotate("", (x[k, last], y[k, last]), (x[k, first], y[k, first]), arrowprops=arrow, zorder=2)
    axes.scatter(x[:, 0], y[:, 0], c=colors, s=42, edgecolors=TEXT, linewidths=0.7, zorder=3)
    axes.margins(0.08)
    axes.set_xlabel(f"{horizontal.name} [{unit_x}]")
    axes.set_ylabel(f"{vertical.name} [{unit_y}]")
    axes.autoscale_view()


def _number_points(axes: Axes, x: Floats, y: Floats) -> None:
    """Number the points, each at the place around its marker that is farthest from everything else, and within the axes."""
    point = 72.0 / axes.figure.dpi  # in points of 1/72 inch distances are those that are seen

    def on_paper(column: int) -> Floats:
        return axes.transData.transform(np.column_stack([x[:, column], y[:, column]])) * point

    starts, (lowest, highest) = on_paper(0), axes.bbox.get_points() * point
    places: dict[int, list[str]] = {}  # numbers of starts that lie on each other, by the first of them
    for k, start in enumerate(starts):
        first = next((j for j in places if np.hypot(*(starts[j] - start)) < SAME_PLACE), k)
        places.setdefault(first, []).append(str(k + 1))
    middle = x.shape[1] // 2
    occupied = [*starts[list(places)], *on_paper(middle // 2), *on_paper(middle), *on_paper(-1)]
    angles = np.deg2rad(np.arange(45, 405, 30))
    around = np.column_stack([np.cos(angles), np.sin(angles)])
    for k, numbers in places.items():
        here, text = starts[k], ", ".join(numbers)
        half = np.array([2.4 * len(text), 4.0])  # width and height of the text
        others = np.array([other for other in occupied if not np.allclose(other, here)]).reshape(-1, 2)
        offsets = (half + 5.5) * around
        gaps = [np.min(np.hypot(*np.maximum(np.abs(here + offset - others) - half, 0.0).T), initial=12.0) for offset in offsets]
        outside = np.maximum(lowest - (here + offsets - half), here + offsets + half - highest)
        offset = offsets[int(np.argmax(gaps - 2.0 * np.maximum(outside, 0.0).sum(axis=1)))]  # beyond the axes are other labels
        occupied += [here + offset + np.array([along * half[0], 0.0]) for along in (-1, 0, 1)]
        label = axes.annotate(text, (x[k, 0], y[k, 0]), offset, textcoords="offset points", ha="center", va="center", zorder=4)
        label.set_path_effects([withStroke(linewidth=2, foreground="white")])


def _coordinates(design: Evaluated, horizontal: Quantity, vertical: Quantity, values: dict[str, Floats]) -> tuple[Floats, Floats]:
    """Both coordinates (K, T) of the points' paths in the units of the axes."""
    pair = [scale(q, _limits(design, q.name, values[q.name]))[0] * values[q.name] for q in (horizontal, vertical)]
    x, y = np.broadcast_arrays(*pair)
    return x, y


def _limits(design: Evaluated, name: str, values: Floats) -> tuple[float, float]:
    """The region's bounds of a quantity, or the range of its values where there is no region."""
    if design.problem.region is not None and name in design.problem.region.bounds:
        low, high = design.problem.region.bounds[name]
        return float(low), float(high)
    return float(np.nanmin(values)), float(np.nanmax(values))


def _few_ticks(axes: Axes) -> None:
    axes.xaxis.set_major_locator(MaxNLocator(4))
    axes.yaxis.set_major_locator(MaxNLocator(3))
    axes.yaxis.set_major_formatter(ScalarFormatter(useOffset=False))
    axes.margins(x=0.03, y=0.12)


def _mean(design: Evaluated) -> Floats:
    prior = design.problem.prior
    return np.array([prior.mean[quantity.name] for quantity in design.problem.model.parameters])


def _trajectories(problem: DesignProblem, points: Experiments, fractions: Floats, theta: Floats) -> tuple[Floats, Floats]:
    """States (K, N, T, n_x) and outputs (K, N, T, n_y) of every point for N theta at T fractions of dt, in one call.

    A trajectory that does not reach a fraction is NaN from there on.
    """
    nodes, times = len(theta), len(fractions)
    batch, each = points[np.repeat(np.arange(len(points)), nodes)], np.tile(theta, (len(points), 1))
    if not problem.model.states:
        y = simulate(problem.model, batch, each).y.reshape(len(points), nodes, 1, -1)
        return np.empty((len(points), nodes, times, 0)), np.repeat(y, times, axis=2)
    done = simulate(problem.model, Runs.of_points(batch).divided(fractions), each)
    missed = (np.arange(times) >= done.reached[:, None])[..., None]
    shape = (len(points), nodes, times, -1)
    return np.where(missed, np.nan, done.x[:, 1:]).reshape(shape), np.where(missed, np.nan, done.y).reshape(shape)
