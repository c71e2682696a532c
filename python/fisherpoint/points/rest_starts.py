"""Where runs that start at rest start, by the parameters, and how that moves with them.

With f the rates of the states z that are at rest, f(z, rest of x0, u, theta) = 0 gives dz/dtheta = -f_z^-1 f_theta.
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
from .equilibrium import Equilibria, equilibria, free_unknowns, solved
from .experiments import Experiments
from .rest import Rest
from .runs import Runs
from .status import Status

NEAR = 1e-7
"""Distance from a switching surface, in natural sizes, below which an equilibrium lies on it."""

APART = 1e-5
"""Distance of two equilibria, in natural sizes, above which they are two."""

MOST_LOOKED_AT = 20
"""Different starts of which other equilibria are looked for."""


class RunStarts(NamedTuple):
    """Starts x0 (K, n_x), s = dx0/dtheta (K, n_x, p), empty where that is zero, and status (K,): ok or `Status.no_rest`."""

    x0: Array
    s: Array
    status: IntArray


def starts_of(model: Model, runs: Runs, theta: Array, tangents: bool = True) -> RunStarts:
    """Where runs start at parameters (p,) or (K, p) of the model; what has no rest keeps its x0."""
    status = np.zeros(len(runs), dtype=np.int32)
    if runs.rests is None:
        return RunStarts(runs.x0, np.empty(0), status)
    x0, s = runs.x0.copy(), np.zeros((len(runs), len(model.states), len(model.parameters)) if tangents else 0)
    for names, rows in _groups(model, runs):
        resting = _Resting(model, names, *_given(model, runs, theta, rows))
        found = resting.settle(resting.guess)
        good = found.good & ~resting.on_surface(found.z, len(model.jumps)).any(axis=1)
        status[rows[~good]] = Status.no_rest
        x0[rows[good][:, None], resting.places] = found.z[good]
        if tangents:
            s[rows[good][:, None], resting.places] = resting.slopes(found, np.flatnonzero(good))
    return RunStarts(x0, s, status)


def checked_starts(model: Model, runs: Runs, theta: Array) -> Array:
    """The starts (K, n_x) at one set of parameters (p,), where every run has its rest.

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
    for names, rows in _groups(model, runs):
        resting = _Resting(model, names, *_given(model, runs, theta, rows))
        found = resting.settle(resting.guess)
        resting.refuse(found, rows)
        x0[rows[:, None], resting.places] = found.z
        _, different = np.unique(np.column_stack([resting.x0, resting.inputs]), axis=0, return_index=True)
        for row in np.sort(different)[: max(0, MOST_LOOKED_AT - looked_at)].tolist():
            resting.warn_of_others(found.z[row], row, int(rows[row]))
        looked_at += len(different)
    return x0


def start_points(model: Model, runs: Runs, theta: Array) -> Experiments:
    """The first segments of runs as points that start where the runs do."""
    return runs.starts.starting(starts_of(model, runs, theta, tangents=False).x0)


def _groups(model: Model, runs: Runs) -> list[tuple[tuple[str, ...], NDArray[np.intp]]]:
    """The runs of which the same states are at rest."""
    rows: dict[tuple[str, ...], list[int]] = {}
    states, names = names_of(model.states), dict[Sequence[str] | None, tuple[str, ...]]()
    for k, rest in enumerate(runs.rest):
        if rest is not None:
            if rest.states not in names:
                names[rest.states] = rest.names(states)
            rows.setdefault(names[rest.states], []).append(k)
    return [(of, np.array(places)) for of, places in rows.items()]


def _given(model: Model, runs: Runs, theta: Array, rows: NDArray[np.intp]) -> tuple[Array, Array, Array]:
    """x0, held inputs and parameters of some runs."""
    inputs = names_of(model.inputs)
    rests: Sequence[Rest] = [] if runs.rests is None else runs.rests[rows].tolist()
    held = {rest: rest.held(inputs) for rest in set(rests)}
    u = np.array([held[rest] for rest in rests], dtype=np.float64).reshape(len(rows), len(inputs))
    return runs.x0[rows], u, np.array(np.broadcast_to(theta, (len(runs), theta.shape[-1]))[rows])


@lru_cache(maxsize=64)
def _rates_of(model: Model, names: tuple[str, ...]) -> Model:
    try:
        return model.rates_of(*names)
    except TypeError as error:
        raise TypeError(f"rest: expected a model with equations, given a {type(model).__name__}") from error
    except ValueError as error:
        raise ValueError(f"rest.{error}") from error


@dataclass
class _Resting:
    """Runs of which the states `names` are at rest: starts (n, n_x), held inputs (n, n_u) and parameters (n, p) of the model."""

    model: Model
    names: tuple[str, ...]
    x0: Array
    inputs: Array
    theta: Array

    def __post_init__(self) -> None:
        states, parameters = names_of(self.model.states), names_of(self.model.parameters)
        self.places = [states.index(name) for name in self.names]
        self._core = _rates_of(self.model, self.names).core
        others = [i for i, name in enumerate(states) if name not in self.names]
        u = np.column_stack([self.inputs, self.x0[:, others]])
        self._u = u if u.shape[1] else np.zeros((len(u), 1))
        # A deviation of the start comes on top of the rest, which it does not move.
        self._offsets = [j for j, name in enumerate(parameters) if name in self.model.offsets]
        self._theta = self.theta.copy()
        self._theta[:, self._offsets] = 0.0
        self.scale = np.array([self.model.states[i].scale or 1.0 for i in self.places])

    @property
    def guess(self) -> Array:
        return self.x0[:, self.places]

    def _rates(self, z: Array, rows: NDArray[np.intp]) -> tuple[Array, Array]:
        given = np.empty((len(z), 0)), self._u[rows], np.column_stack([self._theta[rows], z])
        f = np.array(self._core.output(*given)).reshape(len(z), len(self.names))
        f[~self._inside(z, rows)] = np.nan
        return f, self._slopes(given, len(z))[:, :, self._theta.shape[1] :]

    def _slopes(self, given: tuple[Array, ...], count: int) -> Array:
        """The rates' derivatives by theta and z, (count, r, p + r)."""
        return np.array(self._core.output_jacobian(*given)).reshape(count, len(self.names), self._theta.shape[1] + len(self.names))

    def _inside(self, z: Array, rows: NDArray[np.intp], all_limits: bool = False) -> NDArray[np.bool_]:
        """Where unknowns keep inside the model's domain, and on the guess's side of its poles; limits along the way are no part."""
        model, poles = self.model, len(self.model.poles)
        own = [m for m, name in enumerate(model.domain) if m >= poles and (all_limits or name not in model.along)]
        if not model.domain or not len(z):
            return np.asarray(np.isfinite(z).all(axis=1))
        values = self._limits(z, rows)
        sides = values[:, :poles] * self._limits(self.guess[rows], rows)[:, :poles] > 0 if poles else True
        return np.asarray((values[:, own] > 0).all(axis=1) & np.all(sides, axis=-1))

    def _limits(self, z: Array, rows: NDArray[np.intp]) -> Array:
        given = self.states(z, rows), self.inputs[rows], self._theta[rows]
        return np.asarray(self.model.core.limits(*given)).reshape(len(z), len(self.model.domain))

    def settle(self, guess: Array, rows: NDArray[np.intp] | None = None) -> Equilibria:
        """Equilibria from guesses (m, r) of some rows, or of all."""
        of = np.arange(len(guess)) if rows is None else rows
        return equilibria(lambda z, some: self._rates(z, of[some]), guess, self.scale)

    def slopes(self, found: Equilibria, rows: NDArray[np.intp]) -> Array:
        """dz/dtheta (m, r, p) of some rows."""
        given = np.empty((len(rows), 0)), self._u[rows], np.column_stack([self._theta[rows], found.z[rows]])
        by_theta = self._slopes(given, len(rows))[:, :, : self._theta.shape[1]]
        by_theta[:, :, self._offsets] = 0.0
        return -solved(found.jacobian[rows], by_theta, self.scale) if len(rows) else by_theta

    def states(self, z: Array, rows: NDArray[np.intp]) -> Array:
        """Whole states (m, n_x) of unknowns (m, r)."""
        x = self.x0[rows]
        x[:, self.places] = z
        return x

    def on_surface(self, z: Array, count: int) -> NDArray[np.bool_]:
        """On which of the first `count` switching surfaces equilibria (n, r) lie, (n, count), so that moving z changes sides."""
        model, rows = self.model, np.arange(len(z))
        signs = []
        for move in (np.zeros_like(self.scale), *np.diag(self.scale), *-np.diag(self.scale)):
            x = self.states(z + NEAR * move, rows)
            signs.append(np.sign(np.asarray(model.core.switching(x, self.inputs, self._theta)).reshape(len(z), -1)[:, :count]))
        return np.asarray(np.max(signs, axis=0) != np.min(signs, axis=0))

    def refuse(self, found: Equilibria, runs: NDArray[np.intp]) -> None:
        """Raise for the first run without an equilibrium, in words that say why."""
        expected = f"rest: expected an equilibrium of {listed(self.names)}"
        jumps, kinks = self.model.jumps, self.model.kinks
        on = self.on_surface(found.z, len(jumps) + len(kinks))
        for row, k in enumerate(runs.tolist()):
            where = f"from x0 of runs[{k}]"
            jump = next((name for name, there in zip(jumps, on[row], strict=False) if there), None)
            jump = jump if found.found[row] else self._jump_ahead(found.z[[row]], np.array([row]))
            if jump is not None:
                raise ValueError(
                    f"{expected} off jumps, given one on the jump {jump} = 0 of runs[{k}]: a whole range of states rests there,"
                    " as under dry friction; leave states out of the rest, or make the jump smooth"
                )
            if not found.found[row]:
                raise ValueError(f"{expected}, found none {where}: a better guess may help, or fewer states at rest")
            if found.singular[row]:
                free = [self.names[i] for i in free_unknowns(found.jacobian[row], self.scale)]
                raise ValueError(
                    f"{expected}, given rates that leave {listed(free)} free in runs[{k}]: f_x is singular, and there are none or"
                    " many; leave states out of the rest"
                )
            if not found.stable[row]:
                raise ValueError(f"{expected} at which the plant stays, found an unstable one {where}: give a better guess")
            moving = self._moving_kink(found, row, on[row, len(jumps) :])
            if moving is not None:
                raise ValueError(
                    f"{expected} off kinks, given one on the kink {moving} = 0 of runs[{k}], of which the sides move differently"
                    " with the parameters"
                )

    def _jump_ahead(self, z: Array, row: NDArray[np.intp]) -> str | None:
        """A jump past which the Newton step from z (1, r) leads, so that it may be where the search got stuck."""
        f, jacobian = self._rates(z, row)
        if not (np.isfinite(f).all() and np.isfinite(jacobian).all()) or not np.linalg.det(jacobian[0]):
            return None
        x = np.concatenate(
            [self.states(z + share * solved(jacobian, -f[:, :, None], self.scale)[:, :, 0], row) for share in (0, 1)]
        )
        signs = np.sign(self.model.core.switching(x, np.tile(self.inputs[row], (2, 1)), np.tile(self._theta[row], (2, 1))))
        passed = np.asarray(signs).reshape(2, -1)
        return next((name for m, name in enumerate(self.model.jumps) if passed[0, m] != passed[1, m]), None)

    def _moving_kink(self, found: Equilibria, row: int, on: NDArray[np.bool_]) -> str | None:
        """A kink on which an equilibrium lies, and from which it moves off with the parameters."""
        if not on.any():
            return None
        one = np.array([row])
        theta, jumps = self._theta[row], len(self.model.jumps)
        slopes = self.slopes(found, one)[0]
        steps = np.diag(np.where(theta != 0, 1e-4 * np.abs(theta), 1e-4))
        x = self.states(found.z[one] + steps @ slopes.T, np.repeat(one, len(steps)))
        values = self.model.core.switching(x, np.repeat(self.inputs[one], len(steps), axis=0), theta + steps)
        # By how much a natural size of each state changes the surface, to compare with.
        near = self.states(found.z[one] + NEAR * np.diag(self.scale), np.repeat(one, len(self.scale)))
        size = self.model.core.switching(near, np.repeat(self.inputs[one], len(near), axis=0), np.tile(theta, (len(near), 1)))
        moves = np.abs(np.asarray(values)[:, jumps:]).max(axis=0) > 1e-3 * np.abs(np.asarray(size)[:, jumps:]).max(axis=0)
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
            there = ", ".join(f"{name} = {b:.4g} in the place of {a:.4g}" for name, (a, b) in differs.items())
            warnings.warn(
                f"rest: expected one stable equilibrium, found another one than that of runs[{run}]: {there}; the x0 of the run"
                " says which is meant",
                stacklevel=5,
            )
