"""Random runs with what they are worth, and starts of a search from them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from ...basics.values import Array
from ...information.null_space import null_directions
from ...information.run_tangents import run_tangents
from ...points.runs import Runs
from ...points.status import failures_of
from .run_objective import Judged, RunObjective
from .run_profiles import Profile, draw_runs

PART = 4
"""A start takes its runs from one in so many of the pool, at random, so that starts differ; 1 for all."""

MOST_DRAWN = 20
"""Runs that are drawn at most, for each one that is wanted."""

SINGULAR = 1e-13
"""Eigenvalue of the information of all runs, scaled to unit diagonal, below which a combination of parameters is not told."""

RIDGE = 1e-9
"""Share of the prior's information that is added to F where runs do not determine all parameters, to tell such runs apart."""

LEAST_GAIN, MOST_ROUNDS = 1e-4, 40
"""What log det F must gain for another round of exchange, and how many there are at most."""


class RunPool:
    """Random runs that reach their ends on all plants of an objective.

    Parameters
    ----------
    objective : RunObjective
    wanted : int
    rng : numpy.random.Generator
    profiles : sequence of functions, optional
        Of the inputs; all where none are given.

    Attributes
    ----------
    drawn : int
        Runs that were drawn for it.
    rejected : Counter
        Those of them that do not reach their ends, by reason.
    open : tuple of mappings of parameter name to float
        Combinations of standardised parameters that none of the runs tells about.
    singular : bool
        Whether not even all of its runs together, and what is known beside them, determine all parameters.

    Raises
    ------
    ValueError
        Where hardly any run reaches its end; the message says why.
    """

    def __init__(
        self, objective: RunObjective, wanted: int, rng: np.random.Generator, profiles: Sequence[Profile] | None = None
    ) -> None:
        self._objective, self._begun = objective, list[int]()  # with which starts have begun
        self.drawn, self.rejected = 0, Counter[str]()
        z: list[Array] = []
        found: list[Judged] = []
        while (have := sum(len(part) for part in z)) < wanted:
            if self.drawn >= MOST_DRAWN * wanted:
                reasons = ", ".join(f"{name} {count}" for name, count in self.rejected.most_common())
                raise ValueError(
                    f"region: expected runs that reach their ends, given {have} of {self.drawn} drawn ({reasons}): "
                    "shorten them or narrow the region"
                )
            drawn = draw_runs(objective.coordinates, wanted, rng, profiles)
            judged = objective.judged(objective.tried(drawn, None))
            self.drawn += wanted
            if not judged.ok.all():
                self._count(objective.coordinates.runs(drawn[~judged.ok]))
            z.append(drawn[judged.ok])
            found.append(judged.some(judged.ok))
        self._z, self._judged = np.concatenate(z), Judged.join(found)
        everything = self._judged.matrices.sum(axis=(0, 1)) + objective.previous.sum(axis=0)
        size = np.sqrt(np.maximum(np.diag(everything), 1e-300))
        alone = np.linalg.eigvalsh(objective.previous)[:, 0].min() > 0 if objective.previous.any() else False
        values, vectors = np.linalg.eigh(everything / size / size[:, None])
        left = np.zeros(len(values), dtype=bool) if alone else values < SINGULAR
        self.singular = bool(left.any())
        length = np.sqrt(np.maximum(np.diag(everything), 0.0))
        names = objective.problem.estimated
        self.open = null_directions(vectors[: len(names), left].T, length[: len(names)], names)

    @property
    def rows(self) -> Array:
        """Whitened rows (R, K, m, p) of all of them."""
        return self._objective.rows(self._objective.tried(self._z, None))

    def _count(self, runs: Runs) -> None:
        """Why runs do not reach their ends, at the prior mean."""
        problem = self._objective.problem
        done = run_tangents(problem, runs, problem.theta, self._objective.settings, outputs_alone=True)
        reasons = failures_of(done.status)
        elsewhere = len(runs) - reasons.total()
        self.rejected.update(reasons + Counter({"not ok on another plant": elsewhere} if elsewhere else {}))

    def judge_again(self) -> None:
        """What the runs are worth, now that the objective takes other costs."""
        self._judged = self._objective.judged(self._objective.tried(self._z, None))

    def best(self, count: int) -> Runs:
        """The runs that say most, each by itself."""
        values = self._objective.averages(self._judged.matrices + RIDGE * np.eye(self._judged.matrices.shape[-1]))
        return self._objective.coordinates.runs(self._z[np.argsort(-values, kind="stable")[:count]])

    def chosen(self, n_runs: int, rng: np.random.Generator, part: int = PART) -> Array:
        """Free numbers of runs of a random part, by exchange: each gives way to the best one beside the others, until none does."""
        objective = self._objective
        some = rng.permutation(len(self._z))[: max(n_runs, -(-len(self._z) // part))]
        if n_runs == 1 and len(fresh := some[~np.isin(some, self._begun)]):
            some = fresh
        f, costs = self._judged.matrices[some], self._judged.costs[some]
        chosen = rng.integers(len(some), size=n_runs)
        total = f[chosen].sum(axis=0) + objective.previous
        ridge = RIDGE * np.eye(total.shape[-1])
        value = -np.inf
        for _ in range(MOST_ROUNDS):
            before = value
            for k in range(n_runs):
                others, paid = total - f[chosen[k]], costs[chosen].sum() - costs[chosen[k]]
                values = objective.averages(others + f + ridge) - costs - paid
                chosen[k] = int(np.argmax(values))
                total, value = others + f[chosen[k]], float(values[chosen[k]])
            if not value > before + LEAST_GAIN:
                break
        self._begun += some[chosen].tolist()
        z = self._z[some[chosen]].copy()
        z[:, objective.coordinates.shared] = z[0, objective.coordinates.shared]
        return z
