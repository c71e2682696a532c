"""The best weights of many candidates: weights of a small set, and rounds that add those that would help most.

An interior point method finds the weights of a working set. The sensitivity function of all candidates then bounds how far these
are from the optimum over all, and shows which candidates join. Between evaluations of all, only those with the largest sensitivity
are evaluated, until they improve nothing more. For "D", candidates that cannot be part of any optimum are deleted. At the end
candidates that hardly count are dropped. `WeightsTuning` has the numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...basics.values import Array
from ...basics.work_clock import OutOfTime
from ..candidates.candidate_rows import CandidateRows, Places
from ..goal.criteria import Criterion, Slope
from ..goal.determinant import Determinant
from ..goal.estimable_space import Estimable, estimable
from .interior import best_weights
from .interior_criteria import mean_of
from .tuning import WeightsTuning

HELPS = 1.0 - 1e-9
"""Least sensitivity of a candidate that may help."""


@dataclass(frozen=True, eq=False)
class Weights:
    """Weights of candidates, and what bounds those of any others.

    Attributes
    ----------
    chosen : ndarray of int, (m,)
        Candidates with a weight.
    weights : ndarray, (m,)
        They sum to 1.
    half : ndarray, (p, q)
        Y of the sensitivity function |J_i Y|^2.
    largest : float
        Its largest value over all candidates; 1 at an optimum.
    efficiency : float
        Lower bound of the share of the optimum over all candidates that the weights have.
    log_phi, log_bound : float
        Of the weights, and the largest that any weights can have; in coordinates of their own.
    estimable : Estimable
    deleted : int
        Candidates that were proven to have no weight in any optimum.
    rounds : int
    """

    chosen: Places
    weights: Array
    half: Array
    largest: float
    efficiency: float
    log_phi: float
    log_bound: float
    estimable: Estimable
    deleted: int
    rounds: int


def optimal_weights(
    candidates: CandidateRows,
    criterion: Criterion,
    *,
    tolerance: float = 1e-6,
    seed: int = 0,
    space: Estimable | None = None,
    first: Places | None = None,
    allowed: Callable[[Places], NDArray[np.bool_]] | None = None,
    between_steps: Callable[[], None] = lambda: None,
    tuning: WeightsTuning = WeightsTuning(),
) -> Weights:
    """Find the weights with the best criterion.

    Parameters
    ----------
    candidates : CandidateRows
    criterion : Criterion
        With an information function; what it needs must be estimable from the candidates.
    tolerance : float
        What the efficiency may lack of 1.
    seed : int
        Of the first candidates that are looked at.
    space : Estimable, optional
        Coordinates of what the candidates determine together. Default: computed.
    first : ndarray of int, optional
        Candidates to begin with. Default: some at random.
    allowed : callable, optional
        Takes candidates that would have a weight and returns which of them may; the first may. Others are left out, of the bound of
        the optimum too. Default: all may.
    between_steps : callable, optional
        Called between steps. What it raises ends the search; with `OutOfTime` the weights so far are returned, if there are any.
    tuning : WeightsTuning, optional

    Returns
    -------
    Weights
        Where the tolerance cannot be reached in double precision, or in time, `efficiency` says what was.
    """
    space = estimable(candidates.triangle()) if space is None else space
    inner = criterion.within(space)
    search = _WeightSearch(candidates, inner, space, tolerance, allowed, between_steps, tuning)
    if first is None:
        count = min(tuning.first_candidates, len(candidates))
        first = np.sort(np.random.default_rng(seed).choice(len(candidates), count, replace=False))
    with suppress(OutOfTime):
        search.run(search.regular(search.unlike(first, np.empty(0, dtype=np.intp), tuning.same)))
    return search.found()


class _WeightSearch:
    """The working set, the candidates that are left, and the best weights so far."""

    def __init__(
        self,
        candidates: CandidateRows,
        criterion: Criterion,
        space: Estimable,
        tolerance: float,
        allowed: Callable[[Places], NDArray[np.bool_]] | None,
        between_steps: Callable[[], None],
        tuning: WeightsTuning,
    ) -> None:
        self.tuning, self.between_steps = tuning, between_steps
        self.best: _Raw | None = None
        self.candidates, self.criterion, self.space, self.tolerance = candidates, criterion, space, tolerance
        self.allowed, self.excluded = allowed, np.zeros(len(candidates), dtype=bool)
        self.stored, self.places = candidates, np.arange(len(candidates))
        self.possible = np.ones(len(candidates), dtype=bool)
        self.deletes = isinstance(criterion, Determinant) and criterion.whole
        self.deleted = self.rounds = 0

    def run(self, working: Places) -> None:
        """Rounds until the sensitivity function of no candidate exceeds 1 by more than the tolerance, or none gets closer."""
        gap = smallest = of_all = since = np.inf
        idle = 0
        near: _Near | None = None
        tuning = self.tuning
        searched = tuning.searched_share * self.tolerance
        while self.rounds < tuning.most_rounds and idle < tuning.most_idle_rounds and smallest > searched:
            before = working
            self.rounds += 1
            matrices = self.candidates.matrices(working, self.space.into)
            precision = self._precision(gap)
            weights, slope = best_weights(matrices, self.criterion, precision, tuning, self.between_steps)
            evaluated = near or _Near(self.stored, self.places)
            along = evaluated.candidates.along(self.space.into @ slope.half)
            along[self.excluded[evaluated.places]] = -np.inf
            added = self._added(along, evaluated.places, working, slope)
            gap = max(float(along.max()) - 1.0, 0.0)
            if near is None:
                of_all = gap
                idle, since = (0, gap) if gap < 0.9 * since else (idle + 1, since)
                if gap < smallest:
                    smallest, self.best = gap, _Raw(working, weights, slope)
                if self.deletes:
                    along = self._delete(along, gap)
                near = self._near(along)
            elif gap <= max(0.5 * self.tolerance, tuning.much_closer * of_all):
                near = None
            kept = (slope.along(matrices) > 1.0 - max(10 * gap, 1e-3)) | (weights > 1e-4)
            missed = float(slope.along(matrices).max()) - 1.0 > precision
            fewer = len(working) > tuning.large_working_set or missed
            if fewer and np.linalg.eigvalsh(matrices[kept].mean(axis=0))[0] > tuning.regular:
                working = working[kept]
            working = np.union1d(working, added)
            if np.array_equal(working, before):
                if evaluated.candidates is self.stored and self._precision(gap) >= 0.5 * precision:
                    return  # the same weights once more
                near = None

    def _precision(self, gap: float) -> float:
        """Precision of the weights of the next working set."""
        return float(np.clip(0.03 * gap, 0.2 * self.tolerance, 0.01))

    def _near(self, along: Array) -> _Near | None:
        """The candidates with the largest sensitivity; None where there are hardly more."""
        count = self.tuning.near_candidates
        if len(along) < 2 * count:
            return None
        few = np.sort(np.argpartition(-along, count)[:count])
        return _Near(CandidateRows(self.stored.rows[few], self.candidates.constant), self.places[few])

    def regular(self, working: Places) -> Places:
        """Candidates with a regular mean: these, and where they do not suffice, others that determine the rest."""
        for _ in range(self.space.rank):
            matrix = self.candidates.matrices(working, self.space.into).mean(axis=0)
            values, vectors = np.linalg.eigh(matrix)
            if values[0] > self.tuning.regular:
                break
            taken = np.empty(0, dtype=np.intp)
            while not len(taken) and not self.excluded.all():
                along = self.candidates.along(self.space.into @ vectors[:, :1])
                along[self.excluded] = -np.inf
                taken = self._taken(np.array([np.argmax(along)]))
            working = np.union1d(working, taken)
        return working

    def _added(self, along: Array, places: Places, working: Places, slope: Slope) -> Places:
        """Candidates that would help and may have a weight; what may not is -inf in `along` from now on.

        Where most may not, more are tried: without any the weights would stay as they are, and be computed once more.
        """
        added, left, tuning = np.empty(0, dtype=np.intp), along.copy(), self.tuning
        share, looks, many = tuning.same, 0, tuning.most_added
        if self.deletes:
            share = float(np.clip(tuning.alike_share_of_gap * (along.max() - 1.0), tuning.same, tuning.most_alike))
        while len(added) < tuning.least_added and looks < tuning.looks_for_more and len(wanted := _helpful(left, many)):
            taken = self._taken(places[wanted])
            along_taken = left[wanted[np.isin(places[wanted], taken)]]
            best_first = taken[np.argsort(-along_taken, kind="stable")][: tuning.most_added]
            beside = np.union1d(working, added)
            new = self.unlike(best_first, beside, share, slope)
            if not len(new) and not len(added):  # no weights are as good as those of what is alike, but not the same
                new = self.unlike(best_first, beside, tuning.same)
            added = np.union1d(added, new)
            if len(taken) >= min(len(wanted), tuning.most_added):
                if len(added):
                    break
                looks += 1
            elif len(taken) < len(wanted) / 2:
                many = min(2 * many, tuning.most_checked)
            left[wanted] = -np.inf
        along[self.excluded[places]] = -np.inf
        return added

    def unlike(self, wanted: Places, beside: Places, share: float, slope: Slope | None = None) -> Places:
        """Candidates whose matrices differ by more than a share from those of others beside them, and of those before them.

        For "D" in coordinates in which M is the identity, so that their sensitivities differ by about as much at most.
        """
        into = self.space.into
        if slope is not None and self.deletes:
            into = np.asarray(np.linalg.solve(slope.factor, into.T).T, dtype=np.float64)
        matrices = self.candidates.matrices(np.concatenate([beside, wanted]), into)
        matrices = matrices.reshape(len(matrices), -1)
        size, count, kept = np.linalg.norm(matrices, axis=1), len(beside), list(range(len(beside)))
        for k in range(count, len(matrices)):
            if not len(kept) or np.linalg.norm(matrices[kept] - matrices[k], axis=1).min() > share * size[k]:
                kept.append(k)
        return np.asarray(wanted[np.array(kept[count:], dtype=np.intp) - count])

    def _taken(self, wanted: Places) -> Places:
        """Those that may have a weight; the others are left out from now on."""
        if self.allowed is None or not len(wanted):
            return wanted
        may = self.allowed(wanted)
        self.excluded[wanted[~may]] = True
        return wanted[may]

    def _largest(self, half: Array) -> float:
        along = self.candidates.along(half)
        return float(along[~self.excluded].max())

    def _delete(self, along: Array, gap: float) -> Array:
        """What is left of tr(G F_i) where what cannot have a weight is deleted."""
        self.possible &= along >= least_sensitivity(gap, self.space.rank) * (1 - 1e-9)
        if self.possible.mean() < self.tuning.compact_share:
            self.places, along = self.places[self.possible], along[self.possible]
            self.stored = CandidateRows(self.stored.rows[self.possible], self.candidates.constant)
            self.possible = np.ones(len(self.places), dtype=bool)
        self.deleted = len(self.candidates) - int(self.possible.sum())
        return along

    def found(self) -> Weights:
        """Few weights, and the sensitivity function of all candidates that bounds any; `OutOfTime` where none were found."""
        raw = self.best
        if raw is None:
            raise OutOfTime
        chosen, weights, information = self._few(raw)
        log_phi = self.criterion.log_phi(information)
        half = self.space.into @ raw.slope.half
        largest = self._largest(half)
        log_bound = raw.slope.log_phi + float(np.log(largest))
        try:  # where there are kinks, of many derivatives only that of the saddle point bounds well
            own = None if self.criterion.kinked else self.criterion.slope(information)
        except np.linalg.LinAlgError:  # the optimum does not determine all that could be determined
            own = None
        if own is not None:
            of_own = self._largest(self.space.into @ own.half)
            if own.log_phi + np.log(of_own) <= max(log_bound, log_phi + self.tolerance):
                half, largest = self.space.into @ own.half, of_own
                log_bound = own.log_phi + float(np.log(of_own))
        efficiency = float(np.exp(min(log_phi - log_bound, 0.0)))
        return Weights(chosen, weights, half, largest, efficiency, log_phi, log_bound, self.space, self.deleted, self.rounds)

    def _few(self, raw: _Raw) -> tuple[Places, Array, Array]:
        """The candidates of the best weights without those that hardly count, and their information matrix."""
        lost = self.tuning.dropped_share * self.tolerance
        matrices = self.candidates.matrices(raw.working, self.space.into)
        least = raw.slope.log_phi - lost
        for smallest in self.tuning.least_weights:
            some = raw.weights > smallest
            if not some.any():
                continue
            weights = raw.weights[some] / raw.weights[some].sum()
            information = mean_of(matrices[some], weights)
            if self.criterion.log_phi(information) < least:
                try:
                    weights, _ = best_weights(matrices[some], self.criterion, lost, self.tuning, self.between_steps)
                except (np.linalg.LinAlgError, OutOfTime):
                    continue
                information = mean_of(matrices[some], weights)
            if self.criterion.log_phi(information) >= least:
                return raw.working[some], weights, information
        return raw.working, raw.weights, mean_of(matrices, raw.weights)


class _Near(NamedTuple):
    """Candidates to be evaluated, and their places among all."""

    candidates: CandidateRows
    places: Places


class _Raw(NamedTuple):
    """The weights of a working set, as the interior point method leaves them."""

    working: Places
    weights: Array
    slope: Slope


def least_sensitivity(gap: float, p: int) -> float:
    """What tr(M^-1 F_i) / p of a candidate must be at least for it to have a weight in any D-optimal design.

    With max_i tr(M^-1 F_i) = p (1 + gap). Harman and Pronzato (2007) proved it for matrices of rank one. It holds for any: where
    the optimum M* gives F_i a weight, tr(M*^-1 F_i) = p, so that tr(M^-1 F_i) >= p b, with b the smallest eigenvalue of
    B = M^-1/2 M* M^-1/2. Now tr B <= p (1 + gap), as M* is a mixture of the F_i, and tr B^-1 = tr(M*^-1 M) <= p, as M is one and
    M* optimal. Of all eigenvalues with these two sums the smallest is least where the others are equal; this is it.
    """
    if p == 1:
        return 1.0 - 1e-9  # B is the number that both sums bound
    e = p * gap
    return max(0.0, 1.0 + e / 2 - float(np.sqrt(e * (4.0 + e - 4.0 / p))) / 2)


def _helpful(along: Array, parts: int) -> Places:
    """Candidates that would help: the largest of each part of the list, so that they differ, and as many as are missing of all."""
    size = -(-len(along) // parts)
    padded = np.full(size * -(-len(along) // size), -np.inf)
    padded[: len(along)] = along
    first = padded.reshape(-1, size).argmax(axis=1) + size * np.arange(len(padded) // size)
    first = first[padded[first] >= HELPS]
    few = min(len(along), max(parts // 4, parts - len(first)))
    largest = np.argpartition(-along, few - 1)[:few]
    return np.asarray(np.union1d(first, largest[along[largest] >= HELPS]))
