"""Whether a promise survives within what it promises.

Promised standard errors are those of the tangents at the prior mean. The truth is somewhere else, and where a model changes its
behaviour on the way there, as a motor does whose torque just overcomes friction, its tangents change too. So the points are
evaluated again at parameters that are two promised standard errors off: in each parameter, the others going along as their
correlation says, and along the principal axes of the covariance. The output covariance stays that at the mean, as it does in fits.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from ..basics.field_checks import Extents
from ..basics.values import Array, FrozenMapping, IntArray
from ..basics.work_clock import Clock, OutOfTime
from ..points.points_or_runs import as_runs
from ..points.status import Status
from ..show.numbers import computed
from .null_space import column_scaled_svd, without_rounding
from .output_covariance import OutputCovariance
from .point_information import PointInformation
from .problem import DesignProblem
from .run_information import samples_at

DISTANCE = 2.0
"""Distance, in promised standard errors, of the moved parameters; at one, edges are missed that one fit in ten meets."""

LARGEST_GROWTH = 2.0
"""Growth of a standard error past which a promise counts as broken.

Examples that keep their promise stay below 1.4, and below 1.6 with ten times their noise; those that break it are above 3.
"""

UNDETERMINED = 1e6
"""Growth past which a parameter counts as not determined any more."""

TINY = 1e-100
"""Size of sensitivities instead of zero, where no trajectory reaches its end: its square, and what it divides, are numbers."""

SHARE = 0.1
"""Share of the information that is lost from which a point counts among those that lose it."""

BLOCK = 8
"""Rows of a block of a long matrix, in multiples of its columns."""

WITHOUT_TANGENT = (Status.on_jump, Status.grazes_jump, Status.two_jumps)
"""Statuses at which the trajectory exists but its derivative does not, at that point only."""


@dataclass(frozen=True)
class Nearby:
    """Standard errors of a design where the parameters are two promised standard errors off the prior mean.

    No parameter is moved further than its prior standard deviation.

    Attributes
    ----------
    growth : mapping of parameter name to float
        The largest standard error there over the promised one; inf where the points do not determine the parameter there.
    parameters : mapping of parameter name to float
        The estimated parameters, SI units, where a standard error grows most.
    points : tuple of int
        The points, or samples of runs, previous ones first, that are much less informative there than at the mean, the worst first.
    lost : mapping of status name to int
        Points that have no trajectory, or no derivative, at some of these parameters.
    """

    growth: Mapping[str, float]
    parameters: Mapping[str, float]
    points: tuple[int, ...]
    lost: Mapping[str, int]

    _STATUSES = tuple(Status.__members__)
    _EXTENTS: ClassVar[Extents] = {"growth": ("parameters",), "lost": ("any _STATUSES",)}
    _POSITIVE = ("lost",)

    @property
    def worst(self) -> str:
        """The parameter whose standard error grows most."""
        return max(self.growth, key=lambda name: self.growth[name])

    @property
    def broken(self) -> tuple[str, ...]:
        """Parameters whose standard error grows to more than twice the promised one, the worst first."""
        names = [name for name, growth in self.growth.items() if growth > LARGEST_GROWTH]
        return tuple(sorted(names, key=lambda name: -self.growth[name]))

    @property
    def described(self) -> str:
        """The largest growth, as a sentence of a report."""
        growth = self.growth[self.worst]
        most = f"{times(growth)} ({self.worst})" if growth > 1.005 else times(1.0)
        promise = ": validate before measuring" if self.broken else ""
        return f"With parameters that are {DISTANCE:g} standard errors off, they are at most {most} as large{promise}."

    @property
    def without_trajectory(self) -> Mapping[str, int]:
        """`lost`, without points that only lack a derivative at that point."""
        beside = [status.name for status in WITHOUT_TANGENT]
        return FrozenMapping({name: count for name, count in self.lost.items() if name not in beside})


def times(growth: float) -> str:
    """A growth as a word of a sentence."""
    return "infinitely many times" if np.isinf(growth) else f"{computed(growth)} times"


def nearby_of(
    problem: DesignProblem,
    information: PointInformation,
    d: OutputCovariance,
    factor: Array,
    half: Array,
    threads: int | None,
    known: Array | None = None,
    clock: Clock | None = None,
) -> Nearby | None:
    """Evaluate points near the prior mean; None where the clock leaves no time for that.

    Parameters
    ----------
    problem : DesignProblem
    information : PointInformation
        The points at the prior mean.
    d : OutputCovariance
        The sensor noise.
    factor : ndarray
        Cholesky factor of the D by which prepared sensitivities are whitened.
    half : ndarray, (p, p)
        half half^T is the promised covariance of the standardised parameters; columns are its principal axes.
    threads : int or None
    known : ndarray, (k, n_unknowns), optional
        Rows that count beside those of the points wherever the parameters are: what is known beforehand.
    clock : Clock, optional
    """
    try:
        return _nearby_of(problem, information, d, factor, half, threads, known, clock)
    except OutOfTime:
        return None


def _nearby_of(
    problem: DesignProblem,
    information: PointInformation,
    d: OutputCovariance,
    factor: Array,
    half: Array,
    threads: int | None,
    known: Array | None,
    clock: Clock | None,
) -> Nearby:
    names, promised, moves = problem.estimated, np.linalg.norm(half, axis=1), _moves(half)
    at_mean = _white(d, factor, information)
    growth, worst = np.ones(len(names)), (0.0, 0, np.zeros(problem.n_unknowns), at_mean)
    status = np.zeros((len(information), 0), dtype=np.int32)
    runs, theta = as_runs(information.points), _moved(problem, moves)
    # What is drawn anew is part of the D of points, which stays as it is at the mean; with runs it is part of the rows.
    of_points = information.assumed is not None and runs.points is not None
    at_all = samples_at(problem, runs, theta, threads, information.measured, plain=of_points, clock=clock)
    if information.assumed is not None and not of_points:
        information = replace(information, assumed=np.zeros_like(information.assumed))
    for m, (sensitivity, found) in enumerate(at_all):
        there = _white(d, factor, replace(information, sensitivity=sensitivity))
        kept = np.isin(found, WITHOUT_TANGENT)
        there[kept] = at_mean[kept]
        root = _half(there, known)
        errors = np.linalg.norm(root[: len(names)], axis=1)
        ratio = errors / promised
        j = int(np.argmax(ratio))
        if ratio[j] > worst[0]:
            worst = ratio[j], m, root @ (root[j] / errors[j]), there
        growth = np.maximum(growth, ratio)
        status = np.column_stack([status, found])
    _, m, direction, there = worst
    values = _moved(problem, moves[m : m + 1])[0, problem.estimated_columns]
    growth = np.where(growth > UNDETERMINED, np.inf, growth)
    return Nearby(
        FrozenMapping(dict(zip(names, growth.tolist(), strict=True))),
        FrozenMapping(dict(zip(names, values.tolist(), strict=True))),
        _losing(at_mean, there, direction),
        FrozenMapping(dict(_lost(status))),
    )


def _moves(half: Array) -> Array:
    """Moves (4p, p) of the parameters, in prior standard deviations."""
    covariance = half @ half.T
    axes = DISTANCE * np.concatenate([covariance / np.linalg.norm(half, axis=1)[:, None], half.T])
    axes /= np.maximum(1.0, np.abs(axes).max(axis=1, keepdims=True))
    return np.concatenate([axes, -axes])


def _moved(problem: DesignProblem, moves: Array) -> Array:
    """Parameters (R, p) of the model; log-normal ones are moved by shares, so that they stay positive."""
    theta = np.tile(problem.theta, (len(moves), 1))
    log = np.array([name in problem.prior.log for name in problem.estimated])
    mean, steps = problem.theta[problem.estimated_columns], moves * problem.std
    shares = np.divide(steps, mean, out=np.zeros_like(steps), where=log)
    theta[:, problem.estimated_columns] = np.where(log, mean * np.exp(shares), mean + steps)
    return theta


def _white(d: OutputCovariance, factor: Array, information: PointInformation) -> Array:
    """Sensitivities (K, n, n_unknowns) in units of the outputs' standard deviations."""
    return np.asarray(np.linalg.solve(factor, d.prepare(information).sensitivity), dtype=np.float64)


def _half(white: Array, known: Array | None) -> Array:
    """A root of the covariance of all unknowns; what is not determined has a standard error that is large, but finite."""
    rows = without_rounding(_shortened(white.reshape(-1, white.shape[2])))
    singular_values, directions, length = column_scaled_svd(rows if known is None else np.concatenate([rows, known]))
    floor = max(singular_values[0], TINY) / (100 * UNDETERMINED)
    root: Array = directions.T / np.maximum(singular_values, floor) / np.where(length > 0, length, 1.0)[:, None]
    return root


def _shortened(matrix: Array) -> Array:
    """Few rows (m, p) with the same Gram matrix, by QR of blocks."""
    p = matrix.shape[1]
    while len(matrix) > BLOCK * p:
        whole = np.concatenate([matrix, np.zeros((-len(matrix) % (BLOCK * p), p))])
        matrix = np.asarray(np.linalg.qr(whole.reshape(-1, BLOCK * p, p), mode="r"), dtype=np.float64).reshape(-1, p)
    return matrix


def _losing(at_mean: Array, there: Array, direction: Array) -> tuple[int, ...]:
    """Points whose information along a direction of the unknowns is lost."""
    loss = np.square(at_mean @ direction).sum(axis=1) - np.square(there @ direction).sum(axis=1)
    total = np.maximum(loss, 0.0).sum()
    return tuple(k for k in np.argsort(-loss, kind="stable").tolist() if loss[k] > SHARE * total)


def _lost(status: IntArray) -> Iterator[tuple[str, int]]:
    """How many points (K, R) meet each status, each point counted once, by the first."""
    bad = status != Status.ok
    rows = np.flatnonzero(bad.any(axis=1))
    first = status[rows, np.argmax(bad[rows], axis=1)]
    yield from Counter(Status(int(code)).name for code in first).items()
