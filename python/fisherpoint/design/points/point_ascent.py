"""Ascent from points to better ones, all free numbers of all points together.

An experiment point is a run of one segment: the criterion to first order and the steps that are tried are those of runs
(linear_rows.py, run_ascent.py). A point that would not be valid keeps its place, and may go less far the next time.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ...basics.values import Array, IntArray
from ...basics.work_clock import Clock, OutOfTime
from ...information.candidates import CandidateSource
from ...information.output_covariance import OutputCovariance, cholesky_factor, whitened
from ...information.point_information import PointInformation, point_sensitivities
from ...information.problem import DesignProblem
from ...points.experiments import Experiments
from ...points.status import Status
from ..goal.criteria import Criterion
from ..goal.determinant import slopes_of
from ..goal.over_prior import Scenarios
from ..runs.linear_rows import LinearRows
from ..runs.run_ascent import trial_changes
from .tuning import PointSearchTuning


class PointAscent:
    """What an ascent needs to know.

    Parameters
    ----------
    problem : DesignProblem
    source : CandidateSource
        Determines which points are valid.
    d : OutputCovariance
        With a D that does not depend on the other points.
    fixed : ndarray, (S, p, p)
        What is added to F, the sum over the points, in each scenario.
    threads : int
    over : Scenarios
    criteria : sequence of Criterion
        What is maximised in each scenario.
    tuning : PointSearchTuning
    clock : Clock, optional
    """

    def __init__(
        self,
        problem: DesignProblem,
        source: CandidateSource,
        d: OutputCovariance,
        fixed: Array,
        threads: int,
        over: Scenarios,
        criteria: Sequence[Criterion],
        tuning: PointSearchTuning,
        clock: Clock | None = None,
    ) -> None:
        self.tuning, self._clock = tuning, Clock() if clock is None else clock
        self._over, self._criteria = over, criteria
        self._problem, self._source, self._d, self._threads = problem, source, d, threads
        self.fixed = fixed
        self._lower, self._upper = problem.point_region.box(problem.model)
        self._width = self._upper - self._lower
        self._free = np.flatnonzero(self._width > 0)

    def rows(self, information: PointInformation) -> Array:
        """Whitened rows (S, K, n, p)."""
        return scenario_rows(self._d, information)

    def run(self, start: PointInformation, iterations: int, late: Callable[[], bool]) -> PointInformation:
        """The points to which an ascent leads, in so many iterations at most."""
        points, rows, ascent = start, self.rows(start), self.tuning.ascent
        value, reach, small = self._value(rows), np.full(len(start), ascent.first_reach), 0
        for _ in range(iterations):
            ended = small == ascent.most_small_gains or reach.max() < ascent.least_reach
            if not len(self._free) or not np.isfinite(value) or ended or late():
                break
            z = self._numbers(points.experiments)
            here = z[:, self._free].ravel()
            try:
                changes = trial_changes(self._linear(z, rows), here, np.repeat(reach, len(self._free)), ascent.step_shares, late)
                after, gain = self._best_of(points, rows, value, np.clip(here + changes, 0.0, 1.0), z)
            except OutOfTime:
                break
            if after is None:
                reach = reach * ascent.reach_factors[-1]
            else:
                points, rows, trial, moved = after
                value = self._value(rows)
                factors = ascent.reach_factors
                factor = factors[trial % len(factors)] * ascent.step_shares[trial // len(factors)]
                longer = np.clip(ascent.reach_growth * factor * reach, ascent.least_reach, ascent.most_reach)
                reach = np.where(moved, longer, factors[-1] * factor * reach)
            small = small + 1 if gain < ascent.small_gain else 0
        return points

    def _best_of(
        self, points: PointInformation, rows: Array, value: float, free: Array, z: Array
    ) -> tuple[tuple[PointInformation, Array, int, NDArray[np.bool_]] | None, float]:
        """The best of some designs with free numbers (T, L * d): points, rows, which it is and which points moved; and the gain."""
        count, trials = len(points), len(free)
        tried = np.tile(z, (trials, 1))
        tried[:, self._free] = free.reshape(trials * count, -1)
        survivors, kept = self._source.survivors(self._points(tried))
        place = np.full((trials, count), -1)
        place.flat[kept] = np.arange(len(kept))
        found = self.rows(survivors)[:, place] if len(kept) else 0.0
        there = np.where((place >= 0)[:, :, None, None], found, rows[:, None])
        values = np.array([self._value(there[:, trial]) for trial in range(trials)])
        trial = int(np.argmax(values))
        if not values[trial] > value:
            return None, 0.0
        moved = place[trial] >= 0
        chosen, valid = self._source.confirmed(survivors[place[trial, moved]])
        moved[moved] = valid
        rows_there = np.where(moved[:, None, None], there[:, trial], rows)
        gain = self._value(rows_there) - value
        if not gain > 0:
            return None, 0.0
        source = np.arange(count)
        source[moved] = count + np.flatnonzero(valid)
        return (PointInformation.join([points, chosen])[source], rows_there, trial, moved), gain

    def _linear(self, z: Array, rows: Array) -> LinearRows:
        """The criterion to first order, by differences; a number without a derivative stays."""
        count, d, least = len(z), len(self._free), self.tuning.ascent_difference_step
        slopes, known = np.zeros((d, count, len(rows), *rows.shape[2:])), np.zeros((d, count), dtype=bool)
        for side in (1.0, -1.0):
            step = side * np.where(z[:, self._free] < 0.5, least, -least)
            number, point = np.nonzero(~known & ((z[:, self._free] + step >= 0) & (z[:, self._free] + step <= 1)).T)
            if not len(point):
                break
            beside = z[point].copy()
            beside[np.arange(len(point)), self._free[number]] += step[point, number]
            points = self._points(beside)
            found = [self._sensitivities(problem, points) for problem in self._over.problems]
            ok = np.flatnonzero(np.all([status == Status.ok for _, status in found], axis=0))
            number, point = number[ok], point[ok]
            there = np.stack([whitened_rows(self._d, information[ok]) for information, _ in found])
            difference = (there - rows[:, point]).swapaxes(0, 1)
            slopes[number, point] = difference / step[point, number][:, None, None, None]
            known[number, point] = True
        nothing = np.zeros((len(rows), count, 0)), np.zeros((count, d, len(rows), 0))  # no distances to limits
        variable = np.arange(count * d).reshape(count, d)
        own = np.ascontiguousarray(slopes.swapaxes(0, 1))
        slopes_there = partial(slopes_of, self._criteria)
        return LinearRows(
            rows,
            own,
            nothing[0],
            nothing[1],
            self.fixed,
            self._over.average,
            0.0,
            variable,
            slopes_there,
            self.tuning.ascent,
        )

    def _sensitivities(self, problem: DesignProblem, points: Experiments) -> tuple[PointInformation, IntArray]:
        blocks = self._clock.blocks("sensitivities", len(points))
        parts, statuses = zip(*(point_sensitivities(problem, points[some], self._threads) for some in blocks), strict=True)
        return (parts[0], statuses[0]) if len(parts) == 1 else (PointInformation.join(parts), np.concatenate(statuses))

    def _value(self, rows: Array) -> float:
        values = []
        for own, fixed, criterion in zip(rows, self.fixed, self._criteria, strict=True):
            flat = own.reshape(-1, own.shape[-1])
            values.append(criterion.objective(np.einsum("kp,kq->pq", flat, flat) + fixed))
        return float(self._over.average.value(np.array(values)))

    def _numbers(self, points: Experiments) -> Array:
        table = points.table[:, : len(self._lower)]
        z: Array = np.clip((table - self._lower) / np.where(self._width > 0, self._width, 1.0), 0.0, 1.0)
        return z

    def _points(self, z: Array) -> Experiments:
        table = np.clip(self._lower + self._width * z, self._lower, self._upper)
        return Experiments.of_table(self._problem.model, table)


def whitened_rows(d: OutputCovariance, information: PointInformation) -> Array:
    """Rows (K, n, p) whose squares are the information of each point, for a D that does not depend on the others."""
    factor = cholesky_factor(d.given, d.names, d.kind)
    return whitened(factor, d.prepare(information).sensitivity)


def scenario_rows(d: OutputCovariance, information: PointInformation) -> Array:
    """Whitened rows of points in each scenario, (S, K, n, p); at the prior mean where there are none."""
    return np.stack([whitened_rows(d, one) for one in information.everywhere])
