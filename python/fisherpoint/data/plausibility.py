"""Measured numbers beyond physics: they are mistakes of units or of typing, and an estimate from them would be nonsense."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ..basics.quantity import names_of
from ..basics.table import DataTable
from ..basics.values import Array
from ..models import Model

Places = NDArray[np.intp]

TOO_LARGE = 1e3
"""A number that is so many times its natural size, or the rest of its column, is no measurement."""
UNIT_MISTAKES = {
    180 / np.pi: "degrees for radians",
    60.0: "minutes for seconds",
    100.0: "cm for m, or percent",
    1e3: "mm for m, or any other prefix",
    3600.0: "hours for seconds",
    1e5: "bar for Pa",
    1e6: "MPa for Pa, or any other prefix",
}
"""Factors by which replicates differ where one is in another unit. Ten is left out: noise around zero gives it too often."""
CLOSE = 0.05
"""Relative distance from such a factor within which a ratio of replicates must be."""


def refuse_implausible(
    table: DataTable,
    model: Model,
    outputs: Mapping[str, str],
    replicates: Places,
    x0: Array,
    u: Array,
    y: Array,
    starts: Places | None = None,
) -> None:
    """Raise for starts outside the model's domain, outputs of an impossible size, and replicates in different units.

    Parameters
    ----------
    outputs : mapping of output name to column name
    replicates : ndarray of int, (K, ...)
        What a row of the table is of; equal rows are replicates, also where their measured starts differ.
    x0, u : ndarray
        Starts with the inputs there.
    y : ndarray, (K, n_y)
    starts : ndarray, optional
        Rows of the table in which the starts stand, where these are not all.
    """
    _refuse_starts(table, model, x0, u, np.arange(len(table)) if starts is None else starts)
    order, groups = _grouped(replicates)
    for j, quantity in enumerate(model.outputs):
        if quantity.name in outputs:
            column = outputs[quantity.name]
            _refuse_replicates(table, column, y[:, j], order, groups)
            _refuse_sizes(table, column, y[:, j], quantity.scale)


def _refuse_starts(table: DataTable, model: Model, x0: Array, u: Array, rows: Places) -> None:
    if not model.domain or not set(names_of(model.parameters)) <= set(model.nominal):
        return
    theta = np.tile(model.theta(model.nominal), (len(x0), 1))
    with np.errstate(all="ignore"):
        values = np.asarray(model.core.limits(x0, u, theta))
    poles = len(model.poles)
    outside = ~(np.abs(values) > 0)
    outside[:, poles:] |= ~(values[:, poles:] > 0)
    if not outside.any():
        return
    row, limit = (int(i) for i in np.argwhere(outside)[0])
    states = names_of(model.states)
    named = [i for i, name in enumerate(states) if re.search(rf"\b{re.escape(name)}\b", model.domain[limit])] or range(len(states))
    columns = [states[i] if f"x0_{states[i]}" not in table else f"x0_{states[i]}" for i in named]
    given = ", ".join(f"{states[i]} = {x0[row, i]:g} {model.states[i].unit}".removesuffix(" 1") for i in named)
    wanted = f"{model.domain[limit]} {'other than 0' if limit < poles else '> 0'}"
    what = f"expected a start with {wanted} at the model's nominal parameters, given {given}: is the unit wrong?"
    raise table.error(int(rows[row]), ", ".join(columns), what)


def _refuse_sizes(table: DataTable, column: str, y: Array, scale: float | None) -> None:
    """Raise where a number is far above its natural size, or, few as they are, far above all others of the column."""
    sizes = np.abs(y)
    if scale is not None:
        _refuse_above(table, column, y, scale, "its natural size")
    ordered = np.sort(sizes[~np.isnan(sizes)])
    upper = ordered[len(ordered) // 2 :]  # more than half of a column cannot be outliers
    if len(ordered) > 2:
        with np.errstate(over="ignore"):
            gaps = np.flatnonzero((upper[1:] > TOO_LARGE * upper[:-1]) & (upper[:-1] > 0))
        if len(gaps):
            _refuse_above(table, column, y, float(upper[gaps[0]]), "the largest of the other rows")


def _refuse_above(table: DataTable, column: str, y: Array, size: float, what: str) -> None:
    with np.errstate(over="ignore", invalid="ignore"):
        rows = np.flatnonzero(np.abs(y) > TOO_LARGE * size)
    if len(rows):
        limit = f"at most {TOO_LARGE:g} times {what}, {size:g}"
        raise table.error(
            int(rows[0]), column, f"expected {limit}, given {y[rows[0]]:g}: is the unit wrong, or the number mistyped?"
        )


def _grouped(replicates: Places) -> tuple[Places, Places]:
    """Return an order of the rows that brings equal ones together, and for each place in it the number of its group."""
    order = np.lexsort(replicates.T[::-1])
    ordered = replicates[order]
    return order, np.cumsum(np.concatenate([[0], (ordered[1:] != ordered[:-1]).any(axis=1)]))


def _refuse_replicates(table: DataTable, column: str, y: Array, order: Places, groups: Places) -> None:
    """Raise where the largest and the smallest of a point's replicates are a change of unit apart.

    Noise around zero can have any ratio, so their difference must stand out: by its size among the column's numbers, and against
    the differences of other replicates, unless half of those are a change of unit apart too.
    """
    measured = ~np.isnan(y[order])
    rows, groups = order[measured], groups[measured]
    if len(rows) < 2:
        return
    sizes = np.abs(y[rows])
    by_size = np.lexsort([sizes, groups])
    rows, groups, sizes = rows[by_size], groups[by_size], sizes[by_size]
    first = np.flatnonzero(np.concatenate([[True], groups[1:] != groups[:-1]]))
    last = np.concatenate([first[1:], [len(rows)]]) - 1
    first, last = first[last > first], last[last > first]
    if not len(first):
        return
    low, high = rows[first], rows[last]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        ratios = y[high] / y[low]  # negative where the sign differs, which no unit changes
        spread = np.abs(y[high] - y[low])
    factors = np.array(list(UNIT_MISTAKES))
    nearest = np.argmin(np.abs(np.log(np.where(ratios > 0, ratios, 1.0))[:, None] - np.log(factors)), axis=1)
    fits = np.abs(ratios / factors[nearest] - 1) < CLOSE
    stands_out = (spread > 20 * np.median(spread)) | (2 * np.count_nonzero(fits) >= len(fits))
    found = np.flatnonzero(fits & stands_out & (np.abs(y[high]) >= 0.1 * np.median(sizes)))
    if len(found):
        k = int(found[0])
        a, b = sorted((int(low[k]), int(high[k])))
        factor = f"{factors[nearest[k]]:.6g} ({UNIT_MISTAKES[factors[nearest[k]]]})"
        what = f"expected about {y[a]:g}, as in row {a + 1} of the same point, given {y[b]:g}: a factor of {factor} apart"
        raise table.error(b, column, what)
