"""Sensitivities at random points of a region, stacked: they decide identifiability."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..basics.messages import with_counts
from ..basics.quantity import names_of
from ..basics.values import Array
from ..models import Model
from ..points.experiments import Experiments
from ..points.region import ExperimentRegion
from ..points.settings import crossed_surfaces, on_surface
from ..points.simulate import sensitivities
from ..points.status import Status, failures_of, only_finite

TIGHT, LOOSE = 1e-10, 1e-8
"""Tolerances of the sensitivities, and of others that show how far off these may be."""

AGREEMENT = 1e-5
"""Allowed difference of the two, as a share of the largest at any point."""

RECORD = 8
"""Samples of a record, where starts are not known."""

TINY = 1e-290
"""An output that changes by less has no influence of any parameter: what is smaller loses digits."""

OUTPUT_ROUNDING = 1e-13
"""An output that changes by less than this share of itself, whatever parameter is doubled, does nothing but round."""

MAX_ROUNDS = 20


@dataclass(frozen=True, eq=False)
class Stack:
    """Sensitivities at one theta.

    Attributes
    ----------
    names, starts : tuple of str
        The p parameters, and the q states whose start is not known.
    theta, size : ndarray, (p,)
        Parameters, and by what their sensitivities are multiplied: |theta|, or 1 where that is zero.
    x0 : ndarray, (K, q)
        Starts that are not known.
    tight, loose : ndarray, (K, m, p + q)
        For K points all samples of all outputs, scaled, by parameters and by starts; at the two tolerances.
    """

    names: tuple[str, ...]
    starts: tuple[str, ...]
    theta: Array
    size: Array
    x0: Array
    tight: Array
    loose: Array

    def projected(self, sensitivity: Array) -> Array:
        """Rows (K m, p) without what the sensitivities to the point's own starts explain."""
        by_theta, by_start = np.split(sensitivity, [len(self.names)], axis=2)
        if self.starts:
            length = np.linalg.norm(by_start, axis=1, keepdims=True)
            u, s, _ = np.linalg.svd(by_start / np.where(length > 0, length, 1.0), full_matrices=False)
            u = u * (s > 1e-7)[:, None, :]  # directions of the start that no sample sees explain nothing
            by_theta = by_theta - u @ (u.transpose(0, 2, 1) @ by_theta)
        return by_theta.reshape(-1, len(self.names)).copy()

    def start_changes(self, direction: Array) -> Array:
        """Relative changes (K, q) of the starts that undo what a change of theta (p,) does; absolute ones of starts at zero."""
        by_theta, by_start = np.split(self.tight, [len(self.names)], axis=2)
        undone = -by_theta @ (direction / self.size)
        moves = [np.linalg.lstsq(n, y, rcond=1e-7)[0] for n, y in zip(by_start, undone, strict=True)]
        return np.array(moves).reshape(self.x0.shape) / np.where(self.x0 != 0, self.x0, 1.0)


class Sampler:
    """Draws points of a region that are valid at a theta, and counts in `left_out` those that are not, by reason."""

    def __init__(
        self,
        model: Model,
        region: ExperimentRegion,
        names: tuple[str, ...],
        starts: tuple[str, ...],
        rng: np.random.Generator,
        threads: int | None,
    ) -> None:
        self._model, self._region, self._rng, self._threads = model, region, rng, threads
        self._freed = model.free_start(*starts) if starts else model
        self._names, self._starts = names, starts
        everything, n = names_of(model.parameters), len(model.parameters)
        self._columns = [everything.index(name) for name in names]
        self._all_columns = [*self._columns, *range(n, n + len(starts))]
        self._started = [names_of(model.states).index(name) for name in starts]
        self.left_out: Counter[str] = Counter()

    def stacks(self, theta: Array, count: int) -> list[Stack]:
        """Return the sensitivities at `count` points for each row of theta (n, p), all of them integrated together.

        Raises
        ------
        ValueError
            Where hardly any point survives.
        """
        drawn = [_PointsAtTheta() for _ in theta]
        while lacking := [i for i, of in enumerate(drawn) if of.found < count]:
            if any(drawn[i].tried >= MAX_ROUNDS * count for i in lacking):
                self._count_inaccurate(drawn)
                reasons = with_counts(dict(self.left_out.most_common()))
                found, tried = sum(of.found for of in drawn), sum(of.tried for of in drawn)
                raise ValueError(f"region: expected valid points, given {found} of {tried} drawn ({reasons})")
            wanted = [min(count, 2 * (count - drawn[i].found)) for i in lacking]
            for i, tried, part in zip(lacking, wanted, self._draw(theta[lacking], wanted), strict=True):
                drawn[i].add(tried, part)
        self._count_inaccurate(drawn)
        return [self._stack(row, of, count) for row, of in zip(theta, drawn, strict=True)]

    def _count_inaccurate(self, drawn: Sequence[_PointsAtTheta]) -> None:
        self.left_out.update({"inaccurate": sum(of.inaccurate for of in drawn)})
        self.left_out = +self.left_out  # without those that did not occur

    def _stack(self, theta: Array, drawn: _PointsAtTheta, count: int) -> Stack:
        x0, near, far = (values[drawn.accurate][:count] for values in (drawn.x0, drawn.near, drawn.far))
        scale = self._scale(theta)
        size = scale[: len(self._names)]
        output = np.abs(near[..., : len(size)]).max(axis=(0, 1, 3), initial=0.0)
        weight = np.where(output > TINY, output, 1.0)[:, None]
        near, far = ((given / weight).reshape(len(x0), -1, len(scale)) for given in (near, far))
        return Stack(self._names, self._starts, theta[self._columns], size, x0[:, self._started], near, far)

    def _scale(self, theta: Array) -> Array:
        """Factors of sensitivities: |theta|, or 1 where that is zero, and 1 for starts."""
        chosen = theta[..., self._columns]
        return np.concatenate(
            [np.where(chosen != 0, np.abs(chosen), 1.0), np.ones((*theta.shape[:-1], len(self._starts)))], axis=-1
        )

    def _draw(self, theta: Array, counts: Sequence[int]) -> list[_ValidPoints]:
        """What is found ok of `counts` points drawn for the rows of theta."""
        of = np.repeat(np.arange(len(theta)), counts)  # the row of theta of each point
        points = self._region.draw(self._model, len(of), seed=self._rng, decades=True)
        full = np.column_stack([theta[of], np.zeros((len(of), len(self._starts)))])
        keep = self._region.satisfied(self._model, points)
        self.left_out.update(constraint=int((~keep).sum()))
        crossed = crossed_surfaces(self._freed, kinks=True, jumps=True)
        for rows in on_surface(self._freed, points, full, crossed).values():
            self.left_out.update({"starts on a surface": int(keep[rows].sum())})
            keep[rows] = False
        points, full, of = points[keep], full[keep], of[keep]
        samples = RECORD if self._starts else 1
        shares = np.arange(1, samples + 1) / samples
        records = Experiments(
            np.repeat(points.x0, samples, axis=0), np.repeat(points.u, samples, axis=0), np.outer(points.dt, shares).ravel()
        )
        of_records = np.repeat(full, samples, axis=0)
        results = [
            sensitivities(self._freed, records, of_records, rtol=rtol, threads=self._threads, jumps="cross")
            for rtol in (TIGHT, LOOSE)
        ]
        status = np.max([result.status.reshape(-1, samples) for result in results], axis=(0, 2), initial=0)
        shape = (len(points), samples, len(self._model.outputs), len(self._all_columns))
        scale = self._scale(full)[:, None, None]
        with np.errstate(over="ignore", invalid="ignore"):  # what overflows is left out
            near, far = (result.dy_dtheta[:, :, self._all_columns].reshape(shape) * scale for result in results)
        status = only_finite(status, near, far)
        self.left_out.update(failures_of(status))
        size = np.abs(results[0].y.reshape(shape[:3])).max(axis=1, initial=0.0)
        ok = status == Status.ok
        return [_ValidPoints(*(values[ok & (of == i)] for values in (points.x0, near, far, size))) for i in range(len(theta))]


class _ValidPoints(NamedTuple):
    """Starts (n, n_x) of ok points, scaled samples at both tolerances, (n, samples, n_y, p + q), and |y| at most, (n, n_y)."""

    x0: Array
    near: Array
    far: Array
    size: Array


class _PointsAtTheta:
    """The points that were drawn at one theta and are ok: starts and scaled samples, and which are accurate."""

    def __init__(self) -> None:
        self.tried, self._parts = 0, list[_ValidPoints]()
        self.accurate = np.zeros(0, dtype=bool)

    def add(self, tried: int, part: _ValidPoints) -> None:
        """Take what is ok of `tried` more points."""
        self.tried += tried
        self._parts.append(part)
        self.x0, near, far, size = (np.concatenate(of) for of in zip(*self._parts, strict=True))
        changes = np.abs(near).max(axis=(0, 1, 3), initial=0.0)
        silent = changes <= OUTPUT_ROUNDING * size.max(axis=0, initial=0.0)
        near[:, :, silent] = far[:, :, silent] = 0.0
        self.near, self.far, self.accurate = near, far, _agree(near, far)

    @property
    def inaccurate(self) -> int:
        """How many points' sensitivities hang on the tolerance."""
        return len(self.accurate) - self.found

    @property
    def found(self) -> int:
        """How many points are accurate."""
        return int(self.accurate.sum())


def _agree(near: Array, far: Array) -> NDArray[np.bool_]:
    """Which points have sensitivities (K, samples, n_y, columns) that do not hang on the tolerance.

    One that grazes a kink may; it would hide small singular values.
    """
    size = np.abs(near).max(axis=(0, 1), initial=0.0)
    agreed: NDArray[np.bool_] = (np.abs(near - far) <= AGREEMENT * size).all(axis=(1, 2, 3))
    return agreed
