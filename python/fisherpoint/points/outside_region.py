"""Points and runs outside of a region, in words."""

from __future__ import annotations

from collections.abc import Iterator
from operator import itemgetter

import numpy as np

from ..basics.messages import shown
from ..basics.quantity import names_of
from ..basics.values import Array
from ..models import Model
from .points_or_runs import Points, as_runs
from .region import ExperimentRegion
from .run_region import RunRegion

ROUNDING = 1e-9
"""Share of a bound, or of the width, by which a number from a file may be beyond it."""


def outside(model: Model, region: ExperimentRegion | RunRegion | None, points: Points) -> Iterator[str]:
    """Each point that is beyond a bound or against a constraint, with the quantity; of runs each start and each segment."""
    if region is None:
        return
    runs = as_runs(points)
    k, n = np.nonzero(runs.dt)
    # Where runs start at rest, bounds of states say where to search for it.
    starts = {} if runs.rests is not None else dict(zip(names_of(model.states), runs.x0.T, strict=True))
    held = dict(zip(names_of(model.inputs), runs.u[k, n].T, strict=True))
    if getattr(region, "sample_every", None) is None:  # then parts of segments between samples are shorter
        held["dt"] = runs.dt[k, n]
    found = [(row, 0, what) for row, what in _beyond(model, region, starts)]
    found += [(int(k[i]), int(n[i]) + 1, what) for i, what in _beyond(model, region, held)]
    if isinstance(region, ExperimentRegion) and runs.points is not None:
        for constraint in region.constraints:
            holds = ExperimentRegion(region.bounds, [constraint]).satisfied(model, runs.points)
            found += [(row, 1, f"against the constraint {shown(constraint)}") for row in np.flatnonzero(~holds).tolist()]
    for row, segment, what in sorted(found, key=itemgetter(0, 1)):
        yield f"{points.kind} {row + 1}{f', segment {segment}' if segment and runs is points else ''}: {what}"


def few(places: list[str], most: int = 3) -> str:
    """The first of many places, and how many more there are."""
    more = f"; and {len(places) - most} more" if len(places) > most else ""
    return "; ".join(places[:most]) + more


def _beyond(model: Model, region: ExperimentRegion | RunRegion, columns: dict[str, Array]) -> Iterator[tuple[int, str]]:
    """Rows that are beyond a bound, with what is."""
    units = {quantity.name: quantity.unit for quantity in model.axes}
    for name, values in columns.items():
        if name not in region.bounds:
            continue
        low, high = region.bounds[name]
        slack = ROUNDING * max(abs(low), abs(high), high - low)
        unit = "" if units.get(name, "1") == "1" else f" {units[name]}"
        for k in np.flatnonzero(values < low - slack).tolist():
            yield k, f"{name} = {values[k]:g}{unit}, below {low:g}"
        for k in np.flatnonzero(values > high + slack).tolist():
            yield k, f"{name} = {values[k]:g}{unit}, above {high:g}"
