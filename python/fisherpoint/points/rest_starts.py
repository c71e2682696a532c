"""Starts of runs that start at rest, by the parameters, and their derivatives by these.

With f the rates of the states z that are at rest, f(z, rest of x0, u, theta) = 0 gives dz/dtheta = -f_z^-1 f_theta. Where some
states or outputs are given instead, z has the inputs too that keep them there, and f has the outputs less what they are to be.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..basics.messages import listed
from ..basics.quantity import names_of
from ..basics.values import Array, IntArray
from ..models import Model
from .conserved_totals import ConservedTotals
from .equilibrium import Equilibria, equilibria, free_unknowns, solved
from .experiments import Experiments
from .rest import Conditions, Rest
from .runs import Runs
from .status import Status

NEAR = 1e-7
"""Distance from a switching surface, in natural sizes, below which an equilibrium lies on it."""

APART = 1e-5
"""Distance of two equilibria, in natural sizes, above which they are two."""

BESIDE = 1e-3
"""Distance, in natural sizes, to either side of a switching surface from which the search begins anew."""

MOST_LOOKED_AT = 20
"""Number of different starts whose other equilibria are searched for."""


class RunStarts(NamedTuple):
    """Starts x0 (K, n_x), s = dx0/dtheta (K, n_x, p), empty where that is zero, and status (K,): ok or `Status.no_rest`."""

    x0: Array
    s: Array
    status: IntArray


def starts_of(model: Model, runs: Runs, theta: Array, tangents: bool = True) -> RunStarts:
    """Starts of runs at parameters (p,) or (K, p) of the model; a run without rest keeps its x0."""
    status = np.zeros(len(runs), dtype=np.int32)
    if runs.rests is None:
        return RunStarts(runs.x0, np.empty(0), status)
    x0, s = runs.x0.copy(), np.zeros((len(runs), len(model.states), len(model.parameters)) if tangents else 0)
    for conditions, rows in _groups(model, runs):
        resting = _Resting(model, conditions, *_given(model, runs, theta, rows))
        found = resting.settled()
        good = found.good & ~resting.on_surface(found.z, len(model.jumps)).any(axis=1)
        status[rows[~good]] = Status.no_rest
        x0[rows[good][:, None], resting.places] = resting.starts(found, np.flatnonzero(good))
        if tangents:
            s[rows[good][:, None], resting.places] = resting.start_slopes(found, np.flatnonzero(good))
    return RunStarts(x0, s, status)


def checked_starts(model: Model, runs: Runs, theta: Array, deviation: Array | None = None) -> Array:
    """The starts (K, n_x) at one set of parameters (p,), where every run has its rest.

    With a `deviation` (K, n_x), what it has to be added to.

    Raises
    ------
    TypeError
        For a model without equations.
    ValueError
        Where a run has no rest, or a whole range of them; the message says which, and names the states.

    Warns
    -----
    UserWarning
        Where a run has another stable rest than the one next to its x0.
    """
    if runs.rests is None:
        return runs.x0
    x0, looked_at = runs.x0.copy(), 0
    for conditions, rows in _groups(model, runs):
        given = _given(model, runs, theta, rows)
        resting = _Resting(model, conditions, *given, None if deviation is None else deviation[rows])
        found = resting.settled()
        resting.refuse(found, rows)
        x0[rows[:, None], resting.places] = resting.starts(found, np.arange(len(rows)))
        _, different = np.unique(np.column_stack(given[:3]), axis=0, return_index=True)
        for row in np.sort(different)[: max(0, MOST_LOOKED_AT - looked_at)].tolist():
            resting.warn_of_others(found.z[row], row, int(rows[row]))
        looked_at += len(different)
    return x0


def start_points(model: Model, runs: Runs, theta: Array) -> Experiments:
    """The first segments of runs as points that start where the runs do."""
    return runs.starts.starting(starts_of(model, runs, theta, tangents=False).x0)


def _groups(model: Model, runs: Runs) -> list[tuple[Conditions, NDArray[np.intp]]]:
    """The runs that rest under the same conditions."""
    rows: dict[Conditions, list[int]] = {}
    names = names_of(model.states), names_of(model.inputs), names_of(model.outputs)
    known: dict[Rest, Conditions] = {}
    for k, rest in enumerate(runs.rest):
        if rest is not None:
            if rest not in known:
                known[rest] = rest.conditions(*names)
            rows.setdefault(known[rest], []).append(k)
    return [(of, np.array(places)) for of, places in rows.items()]


def _given(model: Model, runs: Runs, theta: Array, rows: NDArray[np.intp]) -> tuple[Array, Array, Array, Array]:
    """x0, held inputs, given outputs in the model's order, and parameters of some runs."""
    inputs, outputs = names_of(model.inputs), names_of(model.outputs)
    rests: Sequence[Rest] = [] if runs.rests is None else runs.rests[rows].tolist()
    held = {rest: (rest.held(inputs), [rest.outputs[name] for name in outputs if name in rest.outputs]) for rest in set(rests)}
    u, y = (np.array([held[rest][i] for rest in rests], dtype=np.float64).reshape(len(rows), -1) for i in (0, 1))
    return runs.x0[rows], u, y, np.array(np.broadcast_to(theta, (len(runs), theta.shape[-1]))[rows])


@lru_cache(maxsize=64)
def _rates_of(model: Model, conditions: Conditions) -> Model:
    from ..models.rates import rates_of  # which needs SymPy

    unknown = (*conditions.states, *conditions.inputs)
    try:
        return rates_of(model, conditions.rates, conditions.outputs, unknown)
    except TypeError as error:
        raise TypeError(f"rest: expected a model with equations, given a {type(model).__name__}") from error
    except ValueError as error:
        raise ValueError(f"rest.{error}") from error


@dataclass
class _Resting:
    """Runs that rest under the same conditions.

    Starts (n, n_x), held inputs (n, n_u), given outputs (n, o), parameters (n, p) of the model, and by what the runs start off
    their rest (n, n_x), beside the offsets among the parameters. The unknowns z (n, r) are states, then inputs.
    """

    model: Model
    conditions: Conditions
    x0: Array
    inputs: Array
    outputs: Array
    theta: Array
    deviation: Array | None = None

    def __post_init__(self) -> None:
        states, inputs, parameters = (names_of(of) for of in (self.model.states, self.model.inputs, self.model.parameters))
        self.names = (*self.conditions.states, *self.conditions.inputs)
        self.places = [states.index(name) for name in self.conditions.states]
        self._solved = [inputs.index(name) for name in self.conditions.inputs]
        self._core = _rates_of(self.model, self.conditions).core
        known = [i for i in range(len(inputs)) if i not in self._solved], [i for i in range(len(states)) if i not in self.places]
        u = np.column_stack([self.inputs[:, known[0]], self.x0[:, known[1]]])
        self._u = u if u.shape[1] else np.zeros((len(u), 1))
        # A deviation of the start comes on top of the rest, which it does not move, but for totals that are kept.
        self._offsets = {
            j: states.index(of) for j, name in enumerate(parameters) if (of := self.model.offsets.get(name)) is not None
        }
        self._theta = self.theta.copy()
        self._theta[:, list(self._offsets)] = 0.0
        self._deviation = np.zeros(self.x0.shape) if self.deviation is None else self.deviation.copy()
        for j, i in self._offsets.items():
            self._deviation[:, i] += self.theta[:, j]
        sizes = [self.model.states[i].scale for i in self.places] + [self.model.inputs[i].scale for i in self._solved]
        self.scale = np.array([size or 1.0 for size in sizes])
        held = self.guess.copy()
        held[:, : len(self.places)] += self._deviation[:, self.places]
        self._totals = ConservedTotals(self._rates, self.guess, held, self.scale)
        self._count = len(self.conditions.rates) + len(self.conditions.outputs)

    @property
    def guess(self) -> Array:
        return np.column_stack([self.x0[:, self.places], self.inputs[:, self._solved]])

    def _rates(self, z: Array, rows: NDArray[np.intp]) -> tuple[Array, Array]:
        """Residuals (m, r), zero at rest, and their derivatives by theta and z (m, r, p + r) at unknowns (m, r) of rows."""
        given = np.empty((len(z), 0)), self._u[rows], np.column_stack([self._theta[rows], z])
        f = np.array(self._core.output(*given)).reshape(len(z), self._count)
        f[:, len(self.conditions.rates) :] -= self.outputs[rows]
        f[~self._inside(z, rows)] = np.nan
        slopes = np.array(self._core.output_jacobian(*given)).reshape(len(z), self._count, -1)
        slopes[:, :, list(self._offsets)] = 0.0
        return f, slopes

    def _pulled(self, z: Array, rows: NDArray[np.intp]) -> tuple[Array, Array]:
        """Residuals, zero at the rest that has the totals of the start, and their derivatives by z (m, r, r)."""
        f, slopes = self._rates(z, rows)
        return self._totals.pulled(f, slopes[:, :, self._theta.shape[1] :], z, rows)

    def _inside(self, z: Array, rows: NDArray[np.intp], all_limits: bool = False) -> NDArray[np.bool_]:
        """Whether unknowns are inside the model's domain, and on the guess's side of its poles; other limits are ignored."""
        model, poles = self.model, len(self.model.poles)
        own = [m for m, name in enumerate(model.domain) if m >= poles and (all_limits or name not in model.along)]
        if not model.domain or not len(z):
            return np.asarray(np.isfinite(z).all(axis=1))
        values = self._limits(z, rows)
        sides = values[:, :poles] * self._limits(self.guess[rows], rows)[:, :poles] > 0 if poles else True
        return np.asarray((values[:, own] > 0).all(axis=1) & np.all(sides, axis=-1))

    def _limits(self, z: Array, rows: NDArray[np.intp]) -> Array:
        limits = self.model.core.limits(*self._whole(z, rows), self._theta[rows])
        return np.asarray(limits).reshape(len(z), len(self.model.domain))

    def settled(self) -> Equilibria:
        """The equilibria of all rows, from their starts; of those that are not isolated, the ones with the totals of the start."""
        found = self.settle(self.guess)
        self._settle_beside(found)
        rows = np.flatnonzero(~found.good) if self.conditions.moving else np.empty(0, dtype=np.intp)
        if len(rows):
            kept = rows[self._totals.find(rows)]
            if not len(kept):
                return found
            for whole, part in zip(found, self.settle(self.guess[kept], kept), strict=True):
                whole[kept] = part
        return found

    def _settle_beside(self, found: Equilibria) -> None:
        """Try again where nothing was found from a guess on a switching surface, as a valve that is closed, where slopes are those
        of neither side: a little to either side."""
        rows = np.flatnonzero(~found.found)
        if not len(rows) or not (count := len(self.model.jumps) + len(self.model.kinks)):
            return
        rows = rows[self.on_surface(self.guess[rows], count, rows).any(axis=1)]
        for aside in (BESIDE, -BESIDE):
            if not len(rows):
                return
            again = self.settle(self.guess[rows] + aside * self.scale, rows)
            for whole, part in zip(found, again, strict=True):
                whole[rows[again.found]] = part[again.found]
            rows = rows[~again.found]

    def settle(self, guess: Array, rows: NDArray[np.intp] | None = None) -> Equilibria:
        """Equilibria from guesses (m, r) of some rows, or of all."""
        of = np.arange(len(guess)) if rows is None else rows
        return equilibria(lambda z, some: self._pulled(z, of[some]), guess, self.scale, self.conditions.moving)

    def slopes(self, found: Equilibria, rows: NDArray[np.intp]) -> Array:
        """dz/dtheta (m, r, p) of some rows."""
        p = self._theta.shape[1]
        if not len(rows):
            return np.zeros((0, len(self.names), p))
        z = found.z[rows]
        by_theta = self._totals.turned(self._rates(z, rows)[1][:, :, :p], z, rows)
        for j, i in self._offsets.items():
            if i in self.places:  # which moves the total that is kept
                by_theta[:, :, j] = self._totals.pull[rows, :, self.places.index(i)]
        return -solved(found.jacobian[rows], by_theta, self.scale)

    def starts(self, found: Equilibria, rows: NDArray[np.intp]) -> Array:
        """The solved states (m, n) of some rows, less the deviation where that is part of a conserved total."""
        n = len(self.places)
        return np.asarray(found.z[rows, :n] - self._totals.shared[rows, :n] * self._deviation[rows][:, self.places])

    def start_slopes(self, found: Equilibria, rows: NDArray[np.intp]) -> Array:
        """Their derivatives (m, n, p) by theta."""
        n = len(self.places)
        slopes = self.slopes(found, rows)[:, :n]
        for j, i in self._offsets.items():
            if i in self.places:
                slopes[:, self.places.index(i), j] -= self._totals.shared[rows, self.places.index(i)]
        return slopes

    def _whole(self, z: Array, rows: NDArray[np.intp]) -> tuple[Array, Array]:
        """Whole states (m, n_x) and inputs (m, n_u) of unknowns (m, r)."""
        x, u, n = self.x0[rows], self.inputs[rows], len(self.places)
        x[:, self.places], u[:, self._solved] = z[:, :n], z[:, n:]
        return x, u

    def _switching(self, z: Array, rows: NDArray[np.intp], theta: Array) -> Array:
        return np.asarray(self.model.core.switching(*self._whole(z, rows), theta)).reshape(len(z), -1)

    def on_surface(self, z: Array, count: int, rows: NDArray[np.intp] | None = None) -> NDArray[np.bool_]:
        """Whether unknowns (n, r) of some rows, or of all, lie on the first `count` switching surfaces, (n, count), so that moving
        them changes sides."""
        signs = []
        rows = np.arange(len(z)) if rows is None else rows
        for move in (np.zeros_like(self.scale), *np.diag(self.scale), *-np.diag(self.scale)):
            signs.append(np.sign(self._switching(z + NEAR * move, rows, self._theta[rows])[:, :count]))
        return np.asarray(np.max(signs, axis=0) != np.min(signs, axis=0))

    def refuse(self, found: Equilibria, runs: NDArray[np.intp]) -> None:
        """Raise for the first run without an equilibrium, in words that say why."""
        expected = f"rest: expected an equilibrium of {listed(self.names)}"
        jumps, kinks = self.model.jumps, self.model.kinks
        on = self.on_surface(found.z, len(jumps) + len(kinks))
        from_there = self.on_surface(self.guess, len(jumps))
        for row, k in enumerate(runs.tolist()):
            where = f"from x0 of runs[{k}]"
            jump = next((name for name, there in zip(jumps, on[row], strict=False) if there), None)
            if not found.found[row]:
                at_first = next((name for name, there in zip(jumps, from_there[row], strict=True) if there), None)
                jump = self._jump_ahead(found.z[[row]], np.array([row])) or jump or at_first
            if jump is not None:
                many, advice = "states rests", "leave states out of the rest"
                if self.conditions.inputs:
                    many, advice = "inputs keeps the plant", "hold speeds in the place of positions"
                raise ValueError(
                    f"{expected} off jumps, given one on the jump {jump} = 0 of runs[{k}]: a whole range of {many} there,"
                    f" as under dry friction; {advice}, or make the jump smooth"
                )
            if not found.found[row]:
                raise ValueError(f"{expected}, found none {where}: a better guess may help, or fewer states at rest")
            if found.singular[row]:
                free = [self.names[i] for i in free_unknowns(found.jacobian[row], self.scale)]
                raise ValueError(
                    f"{expected}, given rates that leave {listed(free)} free in runs[{k}]: f_x is singular, and there are none or"
                    " many; leave states out of the rest, or hold them and solve for an input"
                )
            if not found.stable[row]:
                raise ValueError(f"{expected} at which the plant stays, found an unstable one {where}: give a better guess")
            moving = self._moving_kink(found, row, on[row, len(jumps) :])
            if moving is not None:
                raise ValueError(
                    f"{expected} off kinks, given one on the kink {moving} = 0 of runs[{k}], whose sides move differently"
                    " with the parameters"
                )

    def _jump_ahead(self, z: Array, row: NDArray[np.intp]) -> str | None:
        """A jump past which the Newton step from z (1, r) leads, so that it may be where the search got stuck."""
        f, jacobian = self._pulled(z, row)
        if not (np.isfinite(f).all() and np.isfinite(jacobian).all()) or not np.linalg.det(jacobian[0]):
            return None
        step = solved(jacobian, -f[:, :, None], self.scale)[:, :, 0]
        passed = np.sign(self._switching(np.concatenate([z, z + step]), np.repeat(row, 2), np.tile(self._theta[row], (2, 1))))
        return next((name for m, name in enumerate(self.model.jumps) if passed[0, m] != passed[1, m]), None)

    def _moving_kink(self, found: Equilibria, row: int, on: NDArray[np.bool_]) -> str | None:
        """A kink on which an equilibrium lies, and from which it moves off with the parameters."""
        if not on.any():
            return None
        one = np.array([row])
        theta, jumps = self._theta[row], len(self.model.jumps)
        slopes = self.slopes(found, one)[0]
        steps = np.diag(np.where(theta != 0, 1e-4 * np.abs(theta), 1e-4))
        values = self._switching(found.z[one] + steps @ slopes.T, np.repeat(one, len(steps)), theta + steps)
        # By how much a natural size of each unknown changes the surface, to compare with.
        near, count = found.z[one] + NEAR * np.diag(self.scale), len(self.scale)
        size = self._switching(near, np.repeat(one, count), np.tile(theta, (count, 1)))
        moves = np.abs(values[:, jumps:]).max(axis=0) > 1e-3 * np.abs(size[:, jumps:]).max(axis=0)
        return next((name for name, there, off in zip(self.model.kinks, on, moves, strict=True) if there and off), None)

    def warn_of_others(self, z: Array, row: int, run: int) -> None:
        """Warn where a few other guesses lead to another stable equilibrium inside the domain."""
        size = np.maximum(self.scale, np.abs(z))
        units = np.concatenate([np.diag(size), size[None]])
        guesses = z + np.concatenate([share * units for share in (0.3, -0.3, 2.0, -2.0)])
        rows = np.full(len(guesses), row)
        other = self.settle(guesses, rows)
        apart = (np.abs(other.z - z) > APART * size).any(axis=1)
        for found in other.z[other.good & self._inside(other.z, rows, all_limits=True) & apart][:1]:
            differs = {name: (a, b) for name, a, b, s in zip(self.names, z, found, size, strict=True) if abs(a - b) > APART * s}
            there = ", ".join(f"{name} = {b:.4g} instead of {a:.4g}" for name, (a, b) in differs.items())
            warnings.warn(
                f"rest: expected one stable equilibrium, found another one than that of runs[{run}]: {there}; the x0 of the run"
                " says which is meant",
                stacklevel=5,
            )
