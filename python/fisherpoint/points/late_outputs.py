"""Outputs that show the states as they were before, as those of a sensor behind a bus: y(t) = g(x(t - tau)).

What a late output shows at the end of a segment is known at the end of an earlier part of the run, to which the run is divided. Up
to tau it is that of the start. dy/dtheta is that of the part's end, and dy/dtau = -dy/dt = -(g_x f + g_t) there, on the side of
larger tau. Where f jumps, the trajectory alone knows along which surfaces it slides, and what latches remember: y at two more ends
just before shows it.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..basics.quantity import names_of
from ..basics.values import Array
from ..models import Model

Places = NDArray[np.intp]

BESIDE = 1e-4
"""Distance between the further ends, as a share of the part that they are in."""

LEAST = 1e-7
"""Length of a part, as a share of the run, below which further ends are in the one before, if nothing switches between."""

SAME = 1e-2
"""Share by which dy/dt from the further ends may differ from that of the equations, beside rounding, to be the same."""

ROUNDING = 50 * np.finfo(float).eps

INSTANT = 1e-6
"""Step in time, as a share of the run, for the derivative of outputs that read the time."""


class Along(NamedTuple):
    """Trajectories at the ends of S parts dt (K, S): x (K, S + 1, n_x), y (K, S, n_y), inputs u (K, S, n_u), theta (K, p).

    They start at the times `since` (K, 1).
    """

    x: Array
    y: Array
    u: Array
    dt: Array
    theta: Array
    since: Array | float = 0.0


class LateEnds(NamedTuple):
    """Parts (K, N, G) of runs at whose ends late outputs are known, for each segment and each different delay.

    `ends` are -1 at the start. `slopes` is the part whose end, with those of the two before, shows dy/dt where f may jump.
    """

    ends: Places
    slopes: Places

    def behind(self, begin: Places) -> LateEnds:
        """Those of the parts from `begin` (K, 1) on."""
        return LateEnds(self.ends - begin[..., None], self.slopes - begin[..., None])

    def flags(self, measured: NDArray[np.bool_], parts: int) -> NDArray[np.bool_]:
        """At which ends of parts (K, S) measured late outputs are known."""
        found = np.zeros((len(measured), parts), dtype=bool)
        k, n, g = np.nonzero(measured[:, :, None] & (self.ends >= 0))
        found[k, self.ends[k, n, g]] = True
        return found

    def values(self, model: Model, own: Array, y: Array, start: Array) -> Array:
        """Outputs (K, N, n_y) of which late ones are of `y` (K, S, n_y) and `start` (K, n_y); or derivatives of all."""
        shown, row = own.copy(), np.arange(len(own))[:, None]
        for i, _, g in late_places(model):
            at = self.ends[:, :, g]
            first = (at < 0).reshape(*at.shape, *[1] * (own.ndim - 3))
            shown[:, :, i] = np.where(first, start[:, None, i], y[row, at, i])
        return shown

    def moved(self, model: Model, dy: Array, along: Along) -> Array:
        """Derivatives (K, N, n_y, p) with what the delay itself moves."""
        for g in sorted({g for _, j, g in late_places(model) if j is not None}):
            k, n = np.nonzero(self.ends[:, :, g] >= 0)
            rates = self._rates(model, along, k, self.ends[k, n, g], self.slopes[k, n, g])
            for i, j, of in late_places(model):
                if j is not None and of == g:
                    dy[k, n, i, j] -= rates[:, i]
        return dy

    def _rates(self, model: Model, along: Along, k: Places, at: Places, slopes: Places) -> Array:
        """dy/dt (R, n_y) at ends of parts, on the side before."""
        dt, y = along.dt, along.y
        t = (along.since + np.cumsum(dt, axis=1))[k, at]
        with np.errstate(all="ignore"):
            rates = _by_equations(model, along.x[k, at + 1], along.u[k, at], along.theta[k], t, INSTANT * dt.sum(axis=1)[k])
            if slopes_are_seen(model):
                step, last, before = dt[k, slopes][:, None], y[k, slopes] - y[k, slopes - 1], y[k, slopes - 1] - y[k, slopes - 2]
                shown = (3 * last - before) / (2 * step)
                rounded = ROUNDING * (np.abs(y[k, slopes]) + np.abs(shown) * dt.sum(axis=1)[k][:, None])
                even = np.abs(last - before) <= SAME * np.abs(last) + rounded
                other = np.abs(rates - shown) * step > SAME * np.abs(shown) * step + rounded
                rates = np.where(~np.isfinite(rates) | (other & (even | bool(model.latches))), shown, rates)
        return np.where(np.isfinite(rates), rates, 0.0)


def slopes_are_seen(model: Model) -> bool:
    """Whether dy/dt of late outputs takes further ends: f alone does not say on which side of a jump a trajectory runs."""
    return bool(model.late_columns) and bool(model.jumps or model.latches)


def _by_equations(model: Model, x: Array, u: Array, theta: Array, t: Array, step: Array) -> Array:
    """g_x f + g_t (R, n_y) at states x (R, n_x); what reads the time is differentiated by a `step` (R,)."""
    count, p = theta.shape
    free, values = _freed(model), np.column_stack([theta, np.zeros_like(x)])
    g = np.array(free.core.output_jacobian(free.at(x, t), u, values)).reshape(count, len(model.outputs), values.shape[1])[..., p:]
    f = np.array(model.core.rhs(model.at(x, t), u, theta)).reshape(*x.shape, 1)
    rates = (g @ f)[..., 0]
    if model.clock is not None:
        later, sooner = (np.array(model.core.output(model.at(x, t + by), u, theta)) for by in (step, -step))
        rates += (later - sooner).reshape(rates.shape) / (2 * step[:, None])
    return np.asarray(rates)


def late_places(model: Model) -> list[tuple[int, int | None, int]]:
    """The place of each late output, that of its delay among the parameters, if it is one, and among the different delays."""
    times, outputs = list(dict.fromkeys(model.late_outputs.values())), names_of(model.outputs)
    return [(outputs.index(y), model.late_columns.get(y), times.index(tau)) for y, tau in model.late_outputs.items()]


def at_start(model: Model, x0: Array, since: float, u: Array, theta: Array) -> Array:
    """Outputs (K, n_y) at the starts x0 (K, n_x), at the time `since`."""
    return np.array(model.core.output(model.at(x0, since), u, theta)).reshape(len(x0), -1)


def slopes_at_start(model: Model, x0: Array, u: Array, theta: Array, s: Array) -> Array:
    """dy/dtheta (K, n_y, p) at the starts of runs, which move by s (K, n_x, p) with theta, or not if that is empty."""
    count, p = theta.shape
    if not s.size:
        return np.array(model.core.output_jacobian(model.at(x0, 0.0), u, theta)).reshape(count, len(model.outputs), p)
    free = _freed(model)
    values = np.column_stack([theta, np.zeros_like(x0)])
    g = np.array(free.core.output_jacobian(free.at(x0, 0.0), u, values)).reshape(count, len(model.outputs), values.shape[1])
    return g[..., :p] + g[..., p:] @ s


@lru_cache(maxsize=16)
def _freed(model: Model) -> Model:
    return model.free_start(*names_of(model.states))


class DividedParts(NamedTuple):
    """Parts of which some are divided in three: the new parts' lengths dt (K, M), which old one `of` each is, and the new ends."""

    dt: Array
    of: Places
    first: NDArray[np.bool_]  # (K, M), of the new parts of an old one
    ends: Places  # (K, S), the places of the old ones' ends


def sources(late: Places, dt: Array, switches: NDArray[np.bool_]) -> Places:
    """The parts (K, N, G) at whose ends dy/dt is taken: those of late outputs, or the ones before where these are too short."""
    row, at = np.arange(len(late))[:, None, None], np.maximum(late, 0)
    short = (dt[row, at] < LEAST * dt.sum(axis=1)[:, None, None]) & (at > 0) & ~switches[row, at]
    return np.where(late < 0, late, at - short)


def divided(dt: Array, at: NDArray[np.bool_]) -> DividedParts:
    """Parts dt (K, S), divided near the ends of those `at` (K, S)."""
    count, parts = dt.shape
    pieces = np.where(at, 3, 1)
    ends = np.cumsum(pieces, axis=1) - 1
    length = int(ends[:, -1].max()) + 1
    of, there = np.full((count, length), parts - 1, dtype=np.intp), np.zeros((count, length), dtype=bool)
    row = np.repeat(np.arange(count), pieces.sum(axis=1))
    number = np.arange(len(row)) - np.repeat(np.cumsum(pieces.sum(axis=1)) - pieces.sum(axis=1), pieces.sum(axis=1))
    of[row, number] = np.repeat(np.tile(np.arange(parts), count), pieces.reshape(-1))
    there[row, number] = True
    every = np.arange(count)[:, None]
    three, first = at[every, of] & there, there & (np.diff(of, axis=1, prepend=-1) != 0)
    whole = dt[every, of]
    beside = BESIDE * whole
    new = np.where(three, np.where(first, whole - 2 * beside, beside), np.where(there, whole, 0.0))
    return DividedParts(new, of, first, ends)
