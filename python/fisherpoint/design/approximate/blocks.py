"""Candidates in blocks: drawn, evaluated and thinned where they are computed, so that their number is not bounded by memory.

A block is its seed and its number. Of each only those candidates come back whose sensitivity exceeds the level under the present
weights; they join the pool, its weights are solved again, and all blocks are looked at once more. Where none has such a candidate,
the weights are the best for all candidates of all blocks, by the equivalence theorem.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...basics.values import Array
from ...engine.workers import Distributor
from ...information.problem import DesignProblem
from ...points.experiments import Experiments
from ..candidates.candidate_rows import CandidateRows
from ..candidates.point_rows import PointRows
from ..goal.criteria import Criterion
from ..goal.estimable_space import Estimable
from ..weights.weights import Weights, optimal_weights
from .tuning import BlockTuning


class Block(NamedTuple):
    """Some of the candidates: the seed of all, the number of this block, and how many candidates it has."""

    seed: int
    number: int
    size: int


class _Thinned(NamedTuple):
    """What a block has above the level, how many of its candidates are valid at the prior mean, and why others are not."""

    table: Array
    rows: Array
    valid: int
    rejected: Counter[str]


def drawn(problem: DesignProblem, count: int, rng: np.random.Generator) -> Experiments:
    """Points of the region, of every second some coordinates on its bounds, where optima often lie."""
    region, model = problem.point_region, problem.model
    table = region.draw(model, count, seed=rng, decades=True).table[:, : len(model.axes)].copy()
    lower, upper = region.box(model)
    on_bounds = rng.random(table.shape) < 0.5
    on_bounds[::2] = False
    table = np.where(on_bounds, np.where(rng.random(table.shape) < 0.5, lower, upper), table)
    return Experiments.of_table(model, table)


def blocks_of(seed: int, count: int) -> Iterator[Block]:
    """Blocks of all candidates but those of the first, which is in memory."""
    size = BlockTuning().candidates
    for number in range(1, -(-count // size)):
        yield Block(seed, number, min(size, count - number * size))


@dataclass(frozen=True, eq=False)
class _Thinning:
    """Draws a block, evaluates it, and keeps what exceeds the level under weights of this `half`."""

    problem: DesignProblem
    elsewhere: tuple[DesignProblem, ...]
    half: Array
    constant: Array | None
    above: float
    most: int
    threads: int

    def __call__(self, block: Block) -> _Thinned:
        source = PointRows(self.problem, self.threads, self.elsewhere)
        points = drawn(self.problem, block.size, np.random.default_rng([block.seed, block.number]))
        rows, places = source.at_mean(points)
        rejected = source.rejected.copy()
        along = CandidateRows(rows, self.constant).along(self.half)
        order = np.argsort(-along, kind="stable")
        order = order[along[order] > 1.0 + self.above]
        found, have = [np.empty(0, dtype=np.intp)], 0
        for first in range(0, len(order), self.most):  # many of the highest are none on the nodes of the prior
            some = order[first : first + self.most]
            _, good = source.valid(points[places[some]])
            found.append(some[good])
            have += len(good)
            if have >= self.most:
                break
        chosen = np.concatenate(found)[: self.most]
        return _Thinned(points[places[chosen]].table, rows[chosen], len(rows), rejected)


class Blocks:
    """The candidates that are not in memory.

    Parameters
    ----------
    source : PointRows
    elsewhere : tuple of DesignProblem
        Scenarios, in which candidates have to be valid too.
    seed : int
    count : int
        Candidates, with those of the first block, which are in memory.
    constant : ndarray or None
        As of `CandidateRows`.
    distributor : Distributor
    report : callable
        Is given what is done, and how many candidates were looked at.

    Attributes
    ----------
    tried : int
        Candidates that are valid at the prior mean.
    rejected : Counter
        Why others are not.
    """

    def __init__(
        self,
        source: PointRows,
        elsewhere: tuple[DesignProblem, ...],
        seed: int,
        count: int,
        constant: Array | None,
        distributor: Distributor,
        report: Callable[[str, int], None],
    ) -> None:
        self.tuning = BlockTuning()
        self._blocks = list(blocks_of(seed, count))
        self._source, self._elsewhere, self._constant = source, elsewhere, constant
        self._distributor, self._report = distributor, report
        self.tried, self.rejected = 0, Counter[str]()

    def __bool__(self) -> bool:
        return bool(self._blocks)

    def _look(self, half: Array, above: float) -> tuple[Array, Array]:
        """Those whose sensitivity exceeds the level by more than a share, the highest of each block: their numbers and rows."""
        most = max(self.tuning.least_kept, self.tuning.kept // len(self._blocks))
        work = _Thinning(self._source.problem, self._elsewhere, half, self._constant, above, most, self._distributor.threads)
        first, tables, rows, tried = not self.tried, list[Array](), list[Array](), 0
        for thinned in self._distributor.map(work, self._blocks, "block {} of the candidates".format):
            tables.append(thinned.table)
            rows.append(thinned.rows)
            tried += thinned.valid
            if first:
                self.rejected.update(thinned.rejected)
            self._report("trying", tried)
        self.tried = tried
        return np.concatenate(tables), np.concatenate(rows)

    def joined(self, points: Experiments, pool: CandidateRows, weights: Weights, above: float) -> tuple[Experiments, CandidateRows]:
        """The pool, and behind it what exceeds the level under its weights."""
        (found, rows), model = self._look(weights.half, above), self._source.problem.model
        if not len(found):
            return points, pool
        table = np.concatenate([points.table, found])[:, : len(model.axes)]
        return Experiments.of_table(model, table), CandidateRows(np.concatenate([pool.rows, rows]), self._constant)

    def solved(
        self, points: Experiments, pool: CandidateRows, weights: Weights, criterion: Criterion, space: Estimable, tolerance: float
    ) -> tuple[Experiments, CandidateRows, Weights]:
        """A pool with all candidates that may have a weight, and the weights that are best for it and the blocks."""
        for _ in range(self.tuning.most_looks if self else 0):
            more, larger = self.joined(points, pool, weights, tolerance)
            if larger is pool:
                break
            first = np.union1d(weights.chosen, np.arange(len(pool), len(larger)))
            points, pool = more, larger
            self._report("weighing", len(pool))
            weights = optimal_weights(pool, criterion, tolerance=tolerance, space=space, first=first)
        return points, pool, weights
