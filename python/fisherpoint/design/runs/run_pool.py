"""Random runs with what they are worth, and starts of a search from them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...basics.messages import with_counts
from ...basics.values import Array
from ...basics.work_clock import OutOfTime
from ...information.null_space import information_without_rounding, null_directions
from ...points.broken_limits import statuses_in_words
from ...points.runs import Runs
from ..goal.estimable_space import RIDGE, SINGULAR
from .run_feasibility import RunGuard
from .run_objective import Judged, Lasted, RunObjective
from .run_profiles import Profile, draw_runs
from .run_repair import brought_within, first_within


class RunPool:
    """Random runs that reach their ends on all plants of an objective.

    Parameters
    ----------
    objective : RunObjective
    wanted : int
    rng : numpy.random.Generator
    profiles : sequence of functions, optional
        Of the inputs; all where none are given.
    explain : bool
        Whether is found out why runs do not reach their ends.

    Attributes
    ----------
    drawn : int
        Runs that were drawn for it.
    rejected : Counter
        Those of them that do not reach their ends, by reason.
    open : tuple of mappings of parameter name to float
        Combinations of standardised parameters that none of the runs has information on.
    singular : bool
        Whether not even all of its runs together, and what is known beside them, determine all parameters.
    interrupted : bool
        Whether Ctrl-C ended it before as many were drawn as were wanted.

    Raises
    ------
    ValueError
        Where no run reaches its end, not even small ones; the message says why.
    KeyboardInterrupt, OutOfTime
        Before there is any run.
    """

    def __init__(
        self,
        objective: RunObjective,
        wanted: int,
        rng: np.random.Generator,
        profiles: Sequence[Profile] | None = None,
        explain: bool = True,
    ) -> None:
        self._objective, self._begun = objective, list[int]()  # runs that starts have begun with
        self.drawn, self.rejected, self.interrupted = 0, Counter[str](), False
        self._parts: list[tuple[Array, Judged]] = []
        self._outside: list[Array] = []
        try:
            self._fill(wanted, rng, profiles, explain)
            objective.clock.paused = False
        except (KeyboardInterrupt, OutOfTime) as error:
            if not self._parts:
                raise
            self.interrupted = isinstance(error, KeyboardInterrupt)
        if not self._parts:
            reasons = with_counts(dict(self.rejected.most_common()))
            raise ValueError(
                f"region: expected runs that reach their ends, given none of {self.drawn} drawn ({reasons}), and "
                "none of held inputs: begin further inside the limits that are named, make runs shorter, or widen the limits"
            )
        self._z, self._judged = np.concatenate([z for z, _ in self._parts]), Judged.join([judged for _, judged in self._parts])
        everything = information_without_rounding(self._judged.matrices.sum(axis=(0, 1)) + objective.previous.sum(axis=0))
        size = np.sqrt(np.maximum(np.diag(everything), 1e-300))
        alone = np.linalg.eigvalsh(objective.previous)[:, 0].min() > 0 if objective.previous.any() else False
        values, vectors = np.linalg.eigh(everything / size / size[:, None])
        left = np.zeros(len(values), dtype=bool) if alone else values < SINGULAR
        self.singular = bool(left.any())
        length = np.sqrt(np.maximum(np.diag(everything), 0.0))
        names = objective.problem.estimated
        self.open = null_directions(vectors[: len(names), left].T, length[: len(names)], names)

    def __len__(self) -> int:
        return sum(len(z) for z, _ in self._parts)

    def _fill(self, wanted: int, rng: np.random.Generator, profiles: Sequence[Profile] | None, explain: bool) -> None:
        objective, tuning = self._objective, self._objective.tuning
        size, needed = tuning.first_batch, profiles is None
        while len(self) < wanted and self.drawn < tuning.most_drawn_per_wanted * wanted:
            drawn = draw_runs(objective.coordinates, wanted, rng, profiles)
            while len(drawn) and len(self) < wanted:
                if objective.clock.limited:  # what the time cuts off is lost
                    affordable = objective.clock.size("tangents", len(objective.plants), least=tuning.least_runs_at_once)
                    size = min(size, max(tuning.first_batch, affordable))
                part, drawn = drawn[:size], drawn[size:]
                objective.clock.paused = needed and not self._parts
                lasted = objective.lasted(part)
                self.drawn += len(part)
                taken = self._add(part, lasted.ok)
                if explain:
                    self._count(part, lasted)
                    if lost := int((lasted.ok & ~taken).sum()):
                        self.rejected["no derivative"] += lost
                self._outside.append(part[~lasted.ok])
                size = min(tuning.batch_growth * size, tuning.most_batch)
        outside = np.concatenate(self._outside)
        if len(self) < wanted and len(outside):
            inside = np.concatenate([z for z, _ in self._parts]) if self._parts else first_within(objective, outside, rng)
            if len(inside):
                self._add(inside, np.full(len(inside), not self._parts))
                some = outside[rng.permutation(len(outside))[: wanted - len(self)]]
                found = brought_within(objective, some, inside, lambda z: objective.lasted(z).ok, rng)
                self._add(found, np.ones(len(found), dtype=bool))

    def _add(self, z: Array, lasts: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Take in runs that last, and have derivatives; which (K,) do."""
        taken = lasts.copy()
        if lasts.any():
            judged = self._objective.judged(self._objective.tried(z[lasts], None))
            taken[lasts] = judged.ok
            if judged.ok.any():
                self._parts.append((z[taken], judged.some(judged.ok)))
        return taken

    def tighten(self, rng: np.random.Generator) -> None:
        """Judge the runs anew, now that they cost something near limits, and bring the best that cost much further inside."""
        objective = self._objective
        self._judged = objective.judged(objective.tried(self._z, None))
        if not objective.costly:
            return
        costs, own = self._judged.costs, self._values()
        most = objective.tuning.most_start_cost
        dear = [k for k in np.argsort(-own, kind="stable").tolist() if costs[k] > most][: objective.tuning.most_tightened]
        cheap = np.flatnonzero(costs <= most)
        if not len(cheap):
            quiet = objective.coordinates.quiet[None]
            if self._cheap(quiet)[0]:
                self._join(quiet)
                cheap = np.array([len(self._z) - 1])
        if len(dear) and len(cheap):
            self._join(brought_within(objective, self._z[dear], self._z[cheap], self._cheap, rng))

    def _cheap(self, z: Array) -> NDArray[np.bool_]:
        judged = self._objective.judged(self._objective.tried(z, None))
        return np.asarray(judged.ok & (judged.costs <= self._objective.tuning.most_start_cost))

    def _join(self, z: Array) -> None:
        if len(z):
            judged = self._objective.judged(self._objective.tried(z, None))
            self._z = np.concatenate([self._z, z[judged.ok]])
            self._judged = Judged.join([self._judged, judged.some(judged.ok)])

    def _values(self) -> Array:
        """What each run is worth by itself, without costs."""
        return self._objective.averages(self._judged.matrices + RIDGE * np.eye(self._judged.matrices.shape[-1]))

    @property
    def rows(self) -> Array:
        """Whitened rows (R, K, m, p) of all of them."""
        return self._objective.rows(self._objective.coordinates.runs(self._z))

    def _count(self, z: Array, lasted: Lasted) -> None:
        """Why runs do not reach their ends, and which limit it was."""
        objective = self._objective
        rows = np.flatnonzero(~lasted.ok).tolist()
        if rows:
            theta, runs = objective.plants[lasted.plant], objective.coordinates.held(z)
            self.rejected.update(statuses_in_words(objective.problem.limited, runs, theta, objective.settings, lasted.status, rows))

    def best(self, count: int) -> Runs:
        """The held segments of the runs that say most, each by itself, whatever they cost."""
        return self._objective.coordinates.held(self._z[np.argsort(-self._values(), kind="stable")[:count]])

    def able(self, guard: RunGuard, count: int) -> NDArray[np.intp]:
        """Places of those of the `count` best runs, each by itself, that enough plants can run as they are."""
        order = np.argsort(-self._values(), kind="stable")[:count]
        shares = guard.each(self._objective.coordinates.held(self._z[order]))
        return np.asarray(order[[guard.enough(share) for share in shares.tolist()]], dtype=np.intp)

    def best_numbers(self, count: int) -> Array:
        """Free numbers (count, d) of the best runs, less what they cost."""
        return self._z[np.argsort(self._judged.costs - self._values(), kind="stable")[:count]]

    def chosen(
        self, n_runs: int, rng: np.random.Generator, part: int | None = None, among: NDArray[np.intp] | None = None
    ) -> Array:
        """Free numbers of runs of a random part, by exchange: each gives way to the best one beside the others, until none does.

        A random one in `part` of the pool; default: the tuning's. Or of those `among` the pool, whatever they cost.
        """
        objective = self._objective
        part = objective.tuning.pool_part if part is None else part
        some = rng.permutation(len(self._z))[: max(n_runs, -(-len(self._z) // part))] if among is None else among
        if n_runs == 1 and len(fresh := some[~np.isin(some, self._begun)]):
            some = fresh
        f, costs = self._judged.matrices[some], self._judged.costs[some] * (among is None)
        chosen = rng.integers(len(some), size=n_runs)
        total = f[chosen].sum(axis=0) + objective.previous
        ridge = RIDGE * np.eye(total.shape[-1])
        value = -np.inf
        for _ in range(objective.tuning.most_start_rounds):
            before = value
            for k in range(n_runs):
                others, paid = total - f[chosen[k]], costs[chosen].sum() - costs[chosen[k]]
                values = objective.averages(others + f + ridge) - costs - paid
                chosen[k] = int(np.argmax(values))
                total, value = others + f[chosen[k]], float(values[chosen[k]])
            if not value > before + objective.tuning.start_least_gain:
                break
        self._begun += some[chosen].tolist()
        z = self._z[some[chosen]].copy()
        z[:, objective.coordinates.shared] = z[0, objective.coordinates.shared]
        return z


def determine_all(information: Array) -> bool:
    """Whether matrices (R, p, p) are regular, up to rounding."""
    size = np.sqrt(np.maximum(np.diagonal(information, axis1=-2, axis2=-1), 1e-300))
    return bool(np.linalg.eigvalsh(information / size[:, :, None] / size[:, None, :]).min() > SINGULAR)
