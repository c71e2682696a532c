"""The picture of the points of a design: where they are in the state space."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from ...basics.quantity import DURATION, Quantity
from ...models import Model
from ...show.style import PRIOR, STYLE, TEXT, Picture, scale, settle
from ...show.time_axes import AxisScale, axis_scale, make_logarithmic, mark
from .evaluated_points import EvaluatedPoints
from .paths import FRACTIONS, paths_of
from .pictures_responses import free_axis, plot_responses

Floats = NDArray[np.float64]

BEYOND = 0.08
"""Share of a logarithmic axis that lies beyond the bounds on either side, as on the others."""

DIGIT, LINE, MOST_LINES = 4.8, 10.0, 4
"""Size of numbers: the width of a character and the height of a line, in points of 1/72 inch, and the most lines."""

AWAY, ROOM, BETWEEN = (6.0, 13.0), 4.0, 3.0
"""Place of numbers, in points of 1/72 inch: distances from their marker, the gap to other things that is enough, and how densely
these are sampled."""

SAME_PLACE = 3.0
"""Starts that are closer on paper, in points of 1/72 inch, share one label."""


def plot_points(design: EvaluatedPoints) -> Figure:
    """The points in the state space, from start (numbered) to end (arrow), coloured by the first input, or else by dt.

    Points without a state are shown over the inputs. Where the region leaves a single coordinate free, `plot_responses` is drawn.
    """
    if free_axis(design) is not None:
        return plot_responses(design)
    model, points = design.problem.model, design.points
    paths, outputs = (path[:, 0] for path in paths_of(design.problem, points, FRACTIONS, design.problem.theta[None]))
    paths = np.concatenate([points.x0[:, None], paths], axis=1)
    if not model.states:
        outputs = outputs[:, :1]
    values = {quantity.name: outputs[:, :, i] for i, quantity in enumerate(model.outputs)}
    values |= {quantity.name: paths[:, :, i] for i, quantity in enumerate(model.states)}
    values |= {quantity.name: points.u[:, [i]] for i, quantity in enumerate(model.inputs)}
    values["dt"] = points.dt[:, None]
    panels = [pair for pair in _panels(model) if any(_is_free(design, q) for q in pair)] or _panels(model)
    held = (*model.inputs, *model.axes[-1:])[0]

    with mpl.rc_context(STYLE):
        columns = min(2, len(panels))
        rows = -(-len(panels) // columns)
        figure = Picture(figsize=(4.6 * columns + 0.8, 3.9 * rows), layout="constrained")
        grid = figure.subplots(rows, columns, squeeze=False).ravel()
        shading, limits = _scale(design, held, values), _limits(design, held, values)
        norm = LogNorm if shading.is_log else Normalize
        shade = ScalarMappable(norm(shading.factor * limits[0], shading.factor * limits[1]), "coolwarm")
        colors = shade.to_rgba(shading.factor * values[held.name][:, 0])
        for axes, (horizontal, vertical) in zip(grid, panels, strict=False):
            _point_panel(axes, design, horizontal, vertical, values, colors)
        for axes in grid[len(panels) :]:
            axes.remove()
        bar = figure.colorbar(shade, ax=list(grid[: len(panels)]), shrink=0.5, aspect=30, pad=0.02)
        bar.set_label(shading.label(held.name))
        if shading.is_log:
            mark(bar, *limits)
        dashed = "" if design.problem.region is None else "; dashed: the region"
        shown = "start (numbered) to end (arrow)" if model.states else "numbered"
        figure.suptitle(f"Experiment points: {shown}{dashed}", x=0.01, ha="left")
        settle(figure)  # the layout decides where labels have room
        for axes, (horizontal, vertical) in zip(grid, panels, strict=False):
            _number_points(axes, *_coordinates(design, horizontal, vertical, values))
    return figure


def _panels(model: Model) -> list[tuple[Quantity, Quantity]]:
    """Pairs of axes: the states two by two, one that is left over with the first input, dt with every input.

    Without inputs dt is shown with the first state; without states the inputs are shown two by two, one that is left over with the
    first output.
    """
    if not model.states:
        return _pairs(model.inputs, model.outputs[:1])
    dt = model.axes[-1]
    return _pairs(model.states, model.inputs[:1]) + [(dt, other) for other in model.inputs or model.states[:1]]


def _is_free(design: EvaluatedPoints, quantity: Quantity) -> bool:
    """Whether points differ in a quantity, or may by the region; outputs do."""
    if quantity not in design.problem.model.axes:
        return True
    column = design.points.table[:, design.problem.model.axes.index(quantity)]
    bounds = {} if design.problem.region is None else design.problem.region.bounds
    lower, upper = bounds.get(quantity.name, (column.min(), column.max()))
    return bool(lower < upper or np.ptp(column) > 0)


def _pairs(quantities: Sequence[Quantity], partner: Sequence[Quantity]) -> list[tuple[Quantity, Quantity]]:
    """Two by two; what is left over, with the partner where there is one."""
    last = [(quantities[-1], partner[0])] if len(quantities) % 2 and partner else []
    return [*zip(quantities[:-1:2], quantities[1::2], strict=True), *last]


def _point_panel(
    axes: Axes,
    design: EvaluatedPoints,
    horizontal: Quantity,
    vertical: Quantity,
    values: dict[str, Floats],
    colors: Any,
) -> None:
    x, y = _coordinates(design, horizontal, vertical, values)
    scale_x, scale_y = (_scale(design, q, values) for q in (horizontal, vertical))
    limits_x, limits_y = (_limits(design, q, values) for q in (horizontal, vertical))
    bounds = {} if design.problem.region is None else design.problem.region.bounds
    if horizontal.name in bounds and vertical.name in bounds:
        low = (scale_x.factor * limits_x[0], scale_y.factor * limits_y[0])
        size = (scale_x.factor * (limits_x[1] - limits_x[0]), scale_y.factor * (limits_y[1] - limits_y[0]))
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
    axes.set_xlabel(scale_x.label(horizontal.name))
    axes.set_ylabel(scale_y.label(vertical.name))
    axes.autoscale_view()
    if scale_x.is_log:
        beyond = (limits_x[1] / limits_x[0]) ** BEYOND
        make_logarithmic(axes, limits_x[0] / beyond, limits_x[1] * beyond)


def _number_points(axes: Axes, x: Floats, y: Floats) -> None:
    """Number the points, each at the place around its marker that is farthest from everything else, and within the axes."""
    point = 72.0 / axes.figure.dpi  # in points of 1/72 inch distances are those that are seen

    def on_paper(column: int) -> Floats:
        return axes.transData.transform(np.column_stack([x[:, column], y[:, column]])) * point

    starts = on_paper(0)
    places: dict[int, list[str]] = {}  # numbers of starts that lie on each other, by the first of them
    for k, start in enumerate(starts):
        first = next((j for j in places if np.hypot(*(starts[j] - start)) < SAME_PLACE), k)
        places.setdefault(first, []).append(str(k + 1))
    ways = np.concatenate([_densely(on_path) for on_path in np.stack([on_paper(t) for t in range(x.shape[1])], axis=1)])
    occupied = np.concatenate([ways, starts[list(places)]])
    for k, numbers in places.items():
        others = occupied[~np.isclose(occupied, starts[k]).all(axis=1)]
        layouts = [_in_lines(numbers, lines) for lines in range(1, min(len(numbers), MOST_LINES) + 1)]
        marks = starts[[other for other in places if other != k]]
        found = [_room(starts[k], np.array([DIGIT * width, LINE * lines]) / 2, others, marks, axes) for _, width, lines in layouts]
        best = int(np.argmax([score - line for line, (score, _, _) in enumerate(found)]))  # a line is easier to read than two
        _, offset, half = found[best]
        across = np.linspace(-half[0], half[0], 2 + int(2 * half[0] / BETWEEN))
        box = np.array([(along, up) for along in across for up in (-half[1], 0.0, half[1])])
        occupied = np.concatenate([occupied, starts[k] + offset + box])
        text = layouts[best][0]
        label = axes.annotate(
            text, (x[k, 0], y[k, 0]), tuple(offset), textcoords="offset points", ha="center", va="center", zorder=4
        )
        label.set(linespacing=1.0, path_effects=[withStroke(linewidth=3, foreground="white")])


def _in_lines(numbers: Sequence[str], lines: int) -> tuple[str, int, int]:
    """Numbers in so many lines, the characters of the longest line, and how many there are."""
    each = -(-len(numbers) // lines)
    parts = [", ".join(numbers[first : first + each]) for first in range(0, len(numbers), each)]
    return ",\n".join(parts), max(map(len, parts)), len(parts)


def _room(here: Floats, half: Floats, others: Floats, marks: Floats, axes: Axes) -> tuple[float, Floats, Floats]:
    """The best place around a marker for a label of this size: how good it is, the offset of its middle, and half of the size."""
    lowest, highest = axes.bbox.get_points() * 72.0 / axes.figure.dpi
    angles = np.deg2rad(np.arange(45, 405, 15))
    around = np.concatenate([away * np.column_stack([np.cos(angles), np.sin(angles)]) for away in AWAY])
    offsets = half * np.sign(np.round(around, 6)) * np.minimum(1.0, np.abs(around) / AWAY[0]) + around
    gaps, foreign = (
        np.min(np.hypot(*np.maximum(np.abs((here + offsets)[:, None] - things) - half, 0.0).T), axis=0, initial=most)
        for things, most in ((others, ROOM), (marks, np.inf))
    )
    own = np.hypot(*np.maximum(np.abs(offsets) - half, 0.0).T)
    outside = np.maximum(lowest - (here + offsets - half), here + offsets + half - highest)
    far = np.hypot(*around.T) > AWAY[0] + 1e-6  # nearer is better where there is as much room
    scores = gaps - 2.0 * np.maximum(outside, 0.0).sum(axis=1) - far  # beyond the axes are other labels
    scores -= ROOM * (foreign < own + 1.0)  # else it would seem to be another point's
    best = int(np.argmax(scores))
    return float(scores[best]), offsets[best], half


def _densely(path: Floats) -> Floats:
    """Places (T, 2) on paper with others between them, so that no label fits in between."""
    path = path[np.isfinite(path).all(axis=1)]
    if len(path) < 2:
        return path
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
    at = np.linspace(0.0, along[-1], 2 + int(along[-1] / BETWEEN))
    return np.column_stack([np.interp(at, along, path[:, 0]), np.interp(at, along, path[:, 1])])


def _coordinates(
    design: EvaluatedPoints, horizontal: Quantity, vertical: Quantity, values: dict[str, Floats]
) -> tuple[Floats, Floats]:
    """Both coordinates (K, T) of the points' paths in the units of the axes."""
    x, y = np.broadcast_arrays(*(_scale(design, q, values).factor * values[q.name] for q in (horizontal, vertical)))
    return x, y


def _scale(design: EvaluatedPoints, quantity: Quantity, values: dict[str, Floats]) -> AxisScale:
    """Scale of an axis by the region's bounds and by the points; only durations of points are ever logarithmic."""
    limits = _limits(design, quantity, values)
    if quantity is DURATION:
        return axis_scale(quantity, limits, values[quantity.name])
    return AxisScale(*scale(quantity, limits), False)


def _limits(design: EvaluatedPoints, quantity: Quantity, values: dict[str, Floats]) -> tuple[float, float]:
    """The region's bounds of a quantity, or the range of its values where there is no region."""
    if design.problem.region is not None and quantity.name in design.problem.region.bounds:
        low, high = design.problem.region.bounds[quantity.name]
        return float(low), float(high)
    return float(np.nanmin(values[quantity.name])), float(np.nanmax(values[quantity.name]))
