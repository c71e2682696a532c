"""Runs as the kernels take them: in segments at whose ends inputs switch late, by their dead times, or states are updated.

u is held, so that u(t - tau) switches at t_s + tau. A switch that comes at the end or later does not act. Instants that differ by
rounding alone are one: dead times of whole segments make no new ones. The segments of a run at one theta are not those at another.

x goes on through a switch, and S jumps by f_before - f_after in the column of tau: the kernels do that (`moved`). Where a switch
comes just with an end, or with other switches, the derivative is that for a larger tau, by which it comes last.

An update comes at the start of a segment. Times of updates that differ from an end by rounding alone are that end; what is sampled
there is sampled just before.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..basics.quantity import names_of
from ..basics.values import Array, IntArray
from ..models import Model
from ..models.tape.update import UpdateTimes
from .late_outputs import Along, LateEnds, at_start, divided, late_places, slopes_are_seen, slopes_at_start, sources
from .rest_starts import starts_of
from .runs import Flags, Runs
from .status import Status
from .trajectories import Sensitivities, Trajectories

_Result = TypeVar("_Result", Trajectories, Sensitivities)

_ROUNDED = 8 * np.finfo(float).eps
"""Shares of a run's length, up to which instants are the same."""

_SAME = 1e-9
"""Shares of the time between updates, up to which one is at an end."""


class Schedule(NamedTuple):
    """Segments u (K, E, n_u), dt (K, E) between all switches; ends (K, N), at which of them each given segment ends.

    Columns `moved` (K, E, C) of the parameters that move the switch at a segment's start, -1 for none, and the inputs `moved_u`
    (K, E, C, n_u) just before; empty where no dead time is a parameter. The `updates` (K, E) of the starts, as bits, or none.
    `late`: where the late outputs of each given segment are known.
    """

    u: Array
    dt: Array
    ends: NDArray[np.intp]
    moved: IntArray
    moved_u: Array
    updates: IntArray
    late: LateEnds

    def until(self, length: int) -> Schedule:
        """The first segments alone."""
        of_parts = ("u", "dt", "moved", "moved_u", "updates")
        return self._replace(**{name: getattr(self, name)[:, :length] for name in of_parts})

    def measured(self, model: Model, flags: Flags) -> Flags:
        """At which ends of parts there are samples, of flags (K, N) of the given segments."""
        found = self.late.flags(flags, self.dt.shape[1])
        if len(model.late_outputs) < len(model.outputs):
            k, n = np.nonzero(flags)
            found[k, self.ends[k, n]] = True
        return found

    def options(self, rows: Any = slice(None)) -> dict[str, Any]:
        """What the kernel of sensitivities is given of some rows."""
        moved = {"moved": self.moved[rows], "moved_u": self.moved_u[rows]} if self.moved.size else {}
        return moved | self.of_states(rows)

    def of_states(self, rows: Any = slice(None)) -> dict[str, Any]:
        """What every kernel is given of some rows."""
        return {"updates": self.updates[rows]} if self.updates.size else {}


def has_schedule(model: Model, runs: Runs) -> bool:
    """Whether runs have further segments: a single one has no late switch where the inputs before are its own."""
    return bool(model.updates or model.late_outputs) or (bool(model.delays) and runs.points is None)


def dead_times(model: Model, theta: Array, count: int) -> Array:
    """The dead times (K, J) of the delayed inputs, in the order of `Model.delays`, at parameters (p,) or (K, p)."""
    return _times(model, model.delays.values(), theta, count)


def output_delays(model: Model, theta: Array, count: int) -> Array:
    """The different delays (K, G) of late outputs at parameters (p,) or (K, p)."""
    return _times(model, dict.fromkeys(model.late_outputs.values()), theta, count)


def _times(model: Model, times: Iterable[str | float], theta: Array, count: int) -> Array:
    places = {name: j for j, name in enumerate(names_of(model.parameters))}
    rows = np.broadcast_to(theta, (count, theta.shape[-1]))

    def one(tau: str | float) -> Any:
        if not isinstance(tau, str):
            return tau
        return rows[:, places[tau]] if tau in places else model.constants[tau]

    return np.array([np.broadcast_to(one(tau), count) for tau in times], dtype=float).reshape(-1, count).T


def before_all(model: Model, theta: Array, count: int) -> Flags:
    """Which of K parameters have a delay below zero, for which there is no trajectory."""
    return np.asarray(((dead_times(model, theta, count) < 0).any(axis=1)) | (output_delays(model, theta, count) < 0).any(axis=1))


class Earlier(NamedTuple):
    """Times t (H,), below zero, at which inputs before the start began to be held, and these, u (H, n_u)."""

    t: Array
    u: Array


def scheduled(
    model: Model,
    u: Array,
    dt: Array,
    before: Array,
    theta: Array,
    earlier: Earlier | None = None,
    since: float = 0.0,
    slopes: bool = False,
) -> Schedule:
    """Segments of K runs, u (K, N, n_u) and dt (K, N), with parameters (p,) or (K, p), from the time `since` on.

    The inputs before are `earlier`, and `before` (K, n_u) until then. With `slopes` there are the ends that those of late outputs
    take.
    """
    (count, n), places = dt.shape, [names_of(model.inputs).index(name) for name in model.delays]
    tau, there, row = np.maximum(dead_times(model, theta, count), 0.0), dt > 0, np.arange(count)[:, None]
    ends = np.cumsum(dt, axis=1)
    rounded = _ROUNDED * ends[:, -1:]
    given = np.concatenate([np.zeros((count, 1)), np.where(there, ends, np.inf)], axis=1)
    starts, held, acts = given[:, :-1], u, there
    if earlier is not None:
        further = len(earlier.t)
        starts = np.concatenate([np.broadcast_to(earlier.t, (count, further)), starts], axis=1)
        held = np.concatenate([np.broadcast_to(earlier.u, (count, *earlier.u.shape)), held], axis=1)
        acts = np.concatenate([np.ones((count, further), dtype=bool), acts], axis=1)
    late = starts[:, :, None] + tau[:, None, :]
    over, was = (late < -rounded[:, :, None]).sum(axis=1), np.array(before)
    for j, place in enumerate(places):
        was[:, place] = np.where(over[:, j] > 0, held[row[:, 0], np.maximum(over[:, j] - 1, 0), place], before[:, place])
    late = np.where(acts[:, :, None] & (late < (ends[:, -1:] - rounded)[:, :, None]), np.maximum(late, 0.0), np.inf)
    late = late.reshape(count, -1)
    timed = [q for q, one in enumerate(model.updates) if not one.each_segment]
    updated = [_update_instants(model.updates[q], given, since) for q in timed]

    delays = np.maximum(output_delays(model, theta, count), 0.0)
    shown = ends[:, :, None] - delays[:, None, :]
    shown = np.where(there[:, :, None] & (shown > rounded[:, :, None]), shown, np.inf)
    of_late = len(places) + len(model.updates)

    # All instants in order, those of the given ends first where they are the same.
    kind = np.concatenate([np.full(n + 1, -1), np.tile(np.arange(len(places)), starts.shape[1])])
    kind = np.concatenate([kind, *(np.full(of.shape[1], len(places) + q) for q, of in zip(timed, updated, strict=True))])
    kind = np.append(kind, np.full(shown[0].size, of_late))
    instants = np.concatenate([given, late, *updated, shown.reshape(count, -1)], axis=1)
    order = np.argsort(instants, axis=1, kind="stable")
    t = np.take_along_axis(instants, order, axis=1)
    own = kind[order] < 0
    last = np.maximum.accumulate(np.where(own, t, -np.inf), axis=1)
    next_one = np.minimum.accumulate(np.where(own, t, np.inf)[:, ::-1], axis=1)[:, ::-1]
    with np.errstate(invalid="ignore"):
        t = np.where(t - last <= rounded, last, np.where(next_one - t <= rounded, next_one, t))
    again = np.lexsort((~own, t), axis=1)
    t, order = np.take_along_axis(t, again, axis=1), np.take_along_axis(order, again, axis=1)
    own, of = kind[order] < 0, kind[order]
    finite = t < np.inf
    with np.errstate(invalid="ignore"):
        first = finite & (own | (np.diff(t, axis=1, prepend=-np.inf) > rounded))
    closing = finite & np.append(first[:, 1:] | ~finite[:, 1:], np.ones((count, 1), dtype=bool), axis=1)
    group = np.cumsum(first, axis=1) - 1
    groups = int(group.max()) + 1

    def at_groups(values: NDArray[Any], which: Flags, rest: Any) -> NDArray[Any]:
        found = np.full((count, groups), rest, dtype=values.dtype)
        k, m = np.nonzero(which)
        found[k, group[k, m]] = values[k, m]
        return found

    time, is_given = at_groups(t, first, np.inf), at_groups(own, first, False)
    segment = np.minimum(at_groups(np.cumsum(own & finite, axis=1) - 1, closing, n - 1), n - 1)
    values = u[row, segment]
    for j, place in enumerate(places):
        switches = at_groups(np.cumsum(finite & (of == j), axis=1), closing, 0)
        switches = np.maximum.accumulate(switches, axis=1)
        values[:, :, place] = np.where(switches > 0, held[row, np.maximum(switches - 1, 0), place], before[:, None, place])
    changed = (np.diff(values[:, :, places], axis=1, prepend=was[:, None, places]) != 0).any(axis=2)
    which = np.zeros((count, groups), dtype=np.int32)
    for q, one in enumerate(model.updates):
        here = is_given if one.each_segment else at_groups(finite, finite & (of == len(places) + q), False)
        which |= np.where(here, np.int32(1 << q), np.int32(0))
    is_late = finite & (of == of_late)
    kept = (time < np.inf) & (is_given | changed | (which != 0) | at_groups(is_late, is_late, False))

    # Of these alone; the last is the end.
    number = np.cumsum(kept, axis=1) - 1
    length = int(number.max())
    at = np.zeros((count, length + 1), dtype=np.intp)
    k, m = np.nonzero(kept)
    at[k, number[k, m]] = m
    some = np.arange(length) < number[:, -1:]
    start, stop = at[:, :-1], at[:, 1:]
    with np.errstate(invalid="ignore"):
        parts = time[row, stop] - time[row, start]
    whole = is_given[row, start] & is_given[row, stop]
    parts = np.where(some, np.where(whole, dt[row, segment[row, start]], parts), 0.0)
    inputs = np.where(some[:, :, None], values[row, start], u[:, -1:])
    own_end = at_groups(np.cumsum(own & finite, axis=1) - 2, first & own, -1)
    places_of_ends = np.full((count, n), length - 1, dtype=np.intp)
    k, m = np.nonzero(kept & (own_end >= 0))
    places_of_ends[k, own_end[k, m]] = number[k, m] - 1
    updates = np.where(some, which[row, start], np.int32(0)) if model.updates else np.zeros((count, 0), dtype=np.int32)
    lates = np.full((count, shown[0].size), -1, dtype=np.intp)
    k, m = np.nonzero(is_late)
    lates[k, order[k, m] - (instants.shape[1] - shown[0].size)] = number[k, group[k, m]] - 1
    lates = lates.reshape(shown.shape)
    found = Schedule(
        inputs, parts, places_of_ends, *_moved(model, inputs, some, was, places), updates, LateEnds(lates, np.maximum(lates, 0))
    )
    return _with_slopes(model, found) if slopes and slopes_are_seen(model) else found


def _with_slopes(model: Model, found: Schedule) -> Schedule:
    """The schedule with further ends, between which late outputs have slopes."""
    switches = (np.diff(found.u, axis=1, prepend=found.u[:, :1]) != 0).any(axis=2)
    if found.updates.size:
        switches |= found.updates != 0
    slopes, at = sources(found.late.ends, found.dt, switches), np.zeros(found.dt.shape, dtype=bool)
    columns = [g for _, j, g in late_places(model) if j is not None]
    k, n, g = np.nonzero(slopes[:, :, columns] >= 0)
    at[k, slopes[:, :, columns][k, n, g]] = True
    new, row = divided(found.dt, at), np.arange(len(at))[:, None]
    moved, updates = found.moved[row, new.of], found.updates
    moved[~new.first] = -1
    if updates.size:
        updates = np.where(new.first, updates[row, new.of], np.int32(0))
    lates = [np.where(of < 0, of, new.ends[row[:, None], np.maximum(of, 0)]) for of in (found.late.ends, slopes)]
    return Schedule(
        found.u[row, new.of], new.dt, new.ends[row, found.ends], moved, found.moved_u[row, new.of], updates, LateEnds(*lates)
    )


def _update_instants(times: UpdateTimes, ends: Array, since: float) -> Array:
    """Times (K, M) of updates of runs, from their starts, which end at ends (K, N + 1), inf behind; none at their last ends."""
    last = np.where(ends < np.inf, ends, -np.inf).max(axis=1, keepdims=True)
    at = times.until(since + float(last.max())) - since
    apart = min([times.every, *np.diff(times.at)] if times.every else [*np.diff(times.at), float("inf")])
    near = _SAME * min(apart, float(last.max())) + _ROUNDED * float(last.max())
    at = np.maximum(at[at >= -near], 0.0)
    found = np.empty((len(ends), len(at)))
    for k, own in enumerate(ends):  # each has ends of its own
        right = np.clip(np.searchsorted(own, at), 1, len(own) - 1)
        nearest = np.where(at - own[right - 1] <= own[right] - at, own[right - 1], own[right])
        found[k] = np.where(np.abs(nearest - at) <= near, nearest, at)
    return np.where(found < last - near, found, np.inf)


def _moved(model: Model, held: Array, some: Flags, before: Array, places: list[int]) -> tuple[IntArray, Array]:
    by_column: dict[int, list[int]] = {}
    for place, name in zip(places, model.delays, strict=True):
        if name in model.delay_columns:
            by_column.setdefault(model.delay_columns[name], []).append(place)
    shape = (*held.shape[:2], len(by_column))
    moved, moved_u = np.full(shape, -1, dtype=np.int32), np.repeat(held[:, :, None], len(by_column), axis=2)
    was = np.concatenate([before[:, None], held[:, :-1]], axis=1)
    for c, (column, of) in enumerate(by_column.items()):
        moved[some & (was[:, :, of] != held[:, :, of]).any(axis=2), c] = column
        moved_u[:, :, c, of] = was[:, :, of]
    return moved, moved_u


def inputs_before(model: Model, runs: Runs) -> Array:
    """The inputs (K, n_u) before the starts of runs: as given, else those of the rest, else those of the first segments."""
    if runs.before is not None:
        return runs.before
    before, names = runs.u[:, 0].copy(), names_of(model.inputs)
    for k, rest in enumerate(runs.rest):
        if rest is not None:
            before[k] = rest.held(names)
            for name in rest.solve:
                if name in model.delays:
                    raise ValueError(f"rest.solve: expected inputs without a dead time, given {name!r}: it is not known before")
    return before


def scheduled_runs(model: Model, runs: Runs, theta: Array, slopes: bool = False) -> tuple[Runs, Schedule]:
    """Runs in which every input switches at the ends of segments, measured where the given ones are."""
    found = scheduled(model, runs.u, runs.dt, inputs_before(model, runs), theta, slopes=slopes)
    measured = found.measured(model, runs.measured)
    return Runs._of(runs.x0, found.u, found.dt, measured, runs.columns, runs.rests), found  # all outputs are computed


def folded(model: Model, runs: Runs, theta: Array, found: Schedule, result: _Result) -> _Result:
    """Results of the given runs, of those with more segments."""
    row, there = np.arange(len(runs))[:, None], runs.dt > 0
    done = there & (found.ends < result.reached[:, None])
    others: dict[str, Array] = {name: getattr(result, name) for name in result._fields if name not in ("x", "status", "reached")}
    folds = {name: values[row, found.ends] if len(values) else values for name, values in others.items()}
    if model.late_outputs:
        start = result.x[:, 0], runs.u[:, 0], np.array(np.broadcast_to(theta, (len(runs), theta.shape[-1])))
        folds["y"] = found.late.values(model, folds["y"], others["y"], at_start(model, start[0], 0.0, *start[1:]))
        if "dy_dtheta" in folds:
            first = slopes_at_start(model, *start, starts_of(model, runs, theta).s)
            dy = found.late.values(model, folds["dy_dtheta"], others["dy_dtheta"], first)
            folds["dy_dtheta"] = found.late.moved(model, dy, Along(result.x, others["y"], found.u, found.dt, start[2]))
    others = folds
    for values in others.values():
        if len(values):
            values[~done] = 0.0
    x = result.x[row, np.concatenate([np.zeros_like(found.ends[:, :1]), found.ends + 1], axis=1)]
    status = np.where(before_all(model, theta, len(runs)), Status.left_domain, result.status).astype(np.int32)
    outside = status != result.status
    done &= ~outside[:, None]
    for values in others.values():
        if len(values):
            values[outside] = 0.0
    x[outside] = x[outside, :1]
    return result._replace(**others, x=x, status=status, reached=done.sum(axis=1))
