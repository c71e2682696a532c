"""The picture of a design in a single variable: the outputs along it, and where they are sampled."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from ...basics.quantity import Quantity
from ...information.problem import DesignProblem
from ...noise.models import nominal_std
from ...points.experiments import Experiments
from ...points.simulate import simulate
from ...points.status import Status
from ...show.style import NOISE, STYLE, TEXT, Picture, labelled, scale, settle
from ...show.time_axes import axis_scale, make_logarithmic
from .evaluated_points import EvaluatedPoints

Floats = NDArray[np.float64]

CURVE = 401
"""Places at which a curve is computed."""

HARDLY_APART = 1 / 60
"""Share of the axis: points that are nearer share one label."""

BEYOND = 0.05
"""Share of a logarithmic axis that lies beyond the bounds on either side, as on others."""

ABOVE, LIFTED, DIGIT = 6.0, 90.0, 4.8
"""Place of labels, in points of 1/72 inch: the least and largest height above the point, and the width of a character."""


def free_axis(design: EvaluatedPoints) -> Quantity | None:
    """The coordinate of a point that the region leaves free, where it is the only one."""
    region = design.problem.region
    if region is None:
        return None
    free = [axis for axis in design.problem.model.axes if region.bounds[axis.name][0] < region.bounds[axis.name][1]]
    return free[0] if len(free) == 1 else None


def plot_responses(design: EvaluatedPoints) -> Figure:
    """Every output at the prior mean over the only free coordinate, with the points and one std of the noise.

    Raises
    ------
    ValueError
        Where more than one coordinate is free.
    """
    axis, problem, points = free_axis(design), design.problem, design.points
    if axis is None or problem.region is None:
        raise ValueError("design: expected a region that leaves a single coordinate free, given another")
    model, column = problem.model, [quantity.name for quantity in problem.model.axes].index(axis.name)
    lower, upper = problem.region.bounds[axis.name]
    curve = np.repeat(points.table[:1], CURVE, axis=0)
    along_axis = axis_scale(axis, (lower, upper), points.table[:, column])
    curve[:, column] = np.geomspace(lower, upper, CURVE) if along_axis.is_log else np.linspace(lower, upper, CURVE)
    along, sampled = curve[:, column], points.table[:, column]
    expected, at_points = _outputs(problem, curve), _outputs(problem, points.table)
    factor = along_axis.factor
    nominal = nominal_std(problem.noise)
    stds = [nominal.get(output.name, 0.0) for output in model.outputs]

    with mpl.rc_context(STYLE):
        figure = Picture(figsize=(7.0, 0.6 + 2.9 * len(model.outputs)), layout="constrained")
        grid = figure.subplots(len(model.outputs), 1, squeeze=False, sharex=True)[:, 0]
        for j, (axes, output) in enumerate(zip(grid, model.outputs, strict=True)):
            factor_y, unit_y = scale(output, np.append(expected[:, j], stds[j]))
            axes.plot(factor * along, factor_y * expected[:, j], color=NOISE, linewidth=1.3)
            noise = factor_y * stds[j] or None
            axes.errorbar(
                factor * sampled, factor_y * at_points[:, j], noise, fmt="o", color=NOISE, ecolor=TEXT, markersize=6,
                markeredgecolor=TEXT, markeredgewidth=0.7, capsize=2, linewidth=1, zorder=3,
            )  # fmt: skip
            axes.set_ylabel(labelled(output.name, unit_y))
            axes.margins(x=0.05, y=0.18)
        grid[-1].set_xlabel(along_axis.label(axis.name))
        if along_axis.is_log:
            beyond = (upper / lower) ** BEYOND
            make_logarithmic(grid[-1], lower / beyond, upper * beyond)
        bars = "" if problem.noise is None else "; bars: std of the noise"
        figure.suptitle(f"Experiment points (numbered), outputs at the prior mean{bars}", x=0.01, ha="left")
        settle(figure)  # the layout decides where labels have room
        for j, (axes, output) in enumerate(zip(grid, model.outputs, strict=True)):
            factor_y = scale(output, np.append(expected[:, j], stds[j]))[0]
            noise = factor_y * stds[j]
            for place, numbers in _places(sampled, lower, upper, along_axis.is_log):
                above = (factor * place, factor_y * at_points[numbers[0], j] + noise)
                text = ", ".join(str(number + 1) for number in numbers)
                ha, lift = _room(axes, text, above, np.column_stack([factor * along, factor_y * expected[:, j]]))
                label = axes.annotate(text, above, (0, lift), textcoords="offset points", ha=ha, va="bottom", zorder=4)
                label.set_path_effects([withStroke(linewidth=2, foreground="white")])
    return figure


def _room(axes: Axes, text: str, above: tuple[float, float], curve: Floats) -> tuple[str, float]:
    """Alignment and height of a label, the first at which it is within the axes and off the curve; else it is centred and low."""
    point = 72.0 / axes.figure.dpi  # distances are in points of 1/72 inch
    (x, y), path = axes.transData.transform(above) * point, axes.transData.transform(curve) * point
    (lowest, _), (highest, top) = axes.bbox.get_points() * point
    width = DIGIT * len(text)
    for lift in np.arange(ABOVE, LIFTED, DIGIT).tolist():
        for name, begin in (("center", x - width / 2), ("left", x), ("right", x - width)):
            beside = (path[:, 0] > begin) & (path[:, 0] < begin + width)
            on_it = beside & (path[:, 1] > y + lift - 1) & (path[:, 1] < y + lift + 2 * DIGIT)
            within = lowest <= begin and begin + width <= highest and (lift == ABOVE or y + lift + 2 * DIGIT < top)
            if within and not on_it.any():
                return name, lift
    return "center", ABOVE


def _outputs(problem: DesignProblem, table: Floats) -> Floats:
    """Outputs (K, n_y) at the prior mean of points given as rows; NaN where a trajectory is not ok."""
    done = simulate(problem.model, Experiments.of_table(problem.model, table), problem.theta)
    return np.where((np.asarray(done.status) == Status.ok)[:, None], done.y, np.nan)


def _places(values: Floats, lower: float, upper: float, is_log: bool) -> Sequence[tuple[float, list[int]]]:
    """Where values lie that are hardly apart along the axis, and which they are."""
    along = np.log(values / lower) / np.log(upper / lower) if is_log else (values - lower) / (upper - lower)
    order = np.argsort(along, kind="stable")
    groups = np.split(order, np.flatnonzero(np.diff(along[order]) > HARDLY_APART) + 1)
    return [(float(np.median(values[group])), sorted(map(int, group))) for group in groups]
