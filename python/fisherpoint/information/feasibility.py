"""The share of plants on which a whole design runs: plants that the prior has, trajectories that end and keep their limits."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..basics.checks import as_probability, check_positive_int, check_type
from ..basics.extras import needed_for
from ..basics.field_checks import Choices, Extents
from ..basics.result_files import Kept
from ..basics.values import Array, FrozenMapping, IntArray
from ..basics.work_clock import Clock
from ..points.broken_limits import checked_broken_limits
from ..points.points_or_runs import Points, as_runs
from ..points.run_trajectories import checked_run_trajectories
from ..points.runs import Runs
from ..points.settings import Integration, checked_arguments
from ..points.status import Status
from ..show.display import Plots, Shown
from ..show.numbers import counted, percent
from ..show.section import Report, Section
from .draws import drawn_plants
from .problem import DesignProblem

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

MOST_SEGMENTS = 100_000
"""Points, or segments of runs, that the engine is given at once, so that memory stays bounded."""

MOST_DRAWS = 10**7
FEW = 50
"""Plants that are tried at least, where there is a limit of time, unless they take much of it."""

LISTED = 10
"""Points or runs that the report lists."""

CONFIDENCE = 0.95


@dataclass(frozen=True, eq=False, repr=False)
class Feasibility(Shown, Kept):
    """The share of plants on which a whole design runs.

    Attributes
    ----------
    kind : {"point", "run"}
    draws : int
        Plants that were drawn.
    able : int
        Those on which every point or run ends as ok.
    left_out : int
        Draws without physical sense, such as a negative mass, which others replaced.
    reasons : mapping of str to int
        The plants on which the design fails, by each reason that occurs on it: a status, and of "left_domain" the limit.
    failures : mapping of str to tuple of int
        The same for each point or run.
    n_points : int
        Points or runs of the design.
    along : tuple of str
        The limits along the way that were kept.
    """

    kind: str
    draws: int
    able: int
    left_out: int
    reasons: Mapping[str, int]
    failures: Mapping[str, tuple[int, ...]]
    n_points: int
    along: tuple[str, ...]

    _EXTENTS: ClassVar[Extents] = {"failures": ("reasons", "n_points")}
    _CHOICES: ClassVar[Choices] = {"kind": ("point", "run")}
    _POSITIVE = ("draws", "n_points")

    @property
    def share(self) -> float:
        """The share of plants on which the whole design runs."""
        return self.able / self.draws

    @property
    def interval(self) -> tuple[float, float]:
        """The interval of Clopper and Pearson for the share, of confidence 95 %."""
        return clopper_pearson(self.able, self.draws)

    @property
    def shares(self) -> Array:
        """The share of plants on which each point or run ends as ok, (K,)."""
        failed = np.array([[0] * self.n_points, *self.failures.values()]).sum(axis=0)
        shares: Array = 1 - failed / self.draws
        return shares

    def holds(self, share: float) -> bool:
        """Return whether at least this share of plants can run the design: whether the lower end of `interval` is above it."""
        return bool(self.interval[0] >= as_probability(share, "share"))

    def _plots(self) -> Plots:
        return {"feasibility": self.plot} if self.reasons else {}

    def plot(self, *, path: str | Path | None = None) -> Figure:
        """Draw which plants cannot run each point or run, and why; needs matplotlib.

        Parameters
        ----------
        path : path, optional
            Where the picture is also written; the ending says the format, PNG where there is none.
        """
        with needed_for("plot"):
            from ..show.style import drawn
            from .pictures import plot_failures

        return drawn(plot_failures(self.failures, self.draws, self.n_points, self.kind, self.report().headline), path)

    def to_pandas(self) -> pd.DataFrame:
        """One row per point or run: the share of plants that can run it, its interval, and counts of reasons."""
        with needed_for("to_pandas"):
            import pandas as pd

        able = np.rint(self.shares * self.draws).astype(int)
        ends = np.array([clopper_pearson(int(n), self.draws) for n in able]).reshape(-1, 2)
        columns = {"share": self.shares, "lower": ends[:, 0], "upper": ends[:, 1]}
        reasons = {reason: list(counts) for reason, counts in self.failures.items()}
        return pd.DataFrame({**columns, **reasons}, index=pd.RangeIndex(self.n_points, name=self.kind))

    def report(self) -> Report:
        """The share, why plants cannot run the design, and which points or runs are to blame."""
        low, high = self.interval
        facts = [
            ("can run the whole design", f"{self.able} of {counted(self.draws, 'plant')}: {percent(self.share)}"),
            ("95 % interval", f"{percent(low)} to {percent(high)}"),
            ("limits along the way", "; ".join(self.along) or "none"),
        ]
        if self.left_out:
            facts.append(("drawn anew", f"{self.left_out}, as they make no sense to the model"))
        sections = [Section("Share", (), facts)]
        if self.reasons:
            by_count = sorted(self.reasons.items(), key=lambda one: (-one[1], one[0]))
            rows = [(reason, str(count), percent(count / self.draws)) for reason, count in by_count]
            sections.append(Section("Why not", ("reason", "plants", "share"), rows))
            shares = self.shares
            worst = [k for k in np.argsort(shares, kind="stable").tolist() if shares[k] < 1]
            shown = [(str(k + 1), percent(shares[k]), self._reason_of(k)) for k in worst[:LISTED]]
            more = len(worst) - len(shown)
            notes = [f"and {counted(more, f'other {self.kind}')} that some plants cannot run"] if more else []
            sections.append(Section("Where", (self.kind, "plants that can", "mostly because of"), shown, notes=notes))
        return Report(f"{percent(self.share)} of the plants that the prior has can run the design", sections)

    def _reason_of(self, k: int) -> str:
        return max(self.failures, key=lambda reason: self.failures[reason][k])


def clopper_pearson(able: int, of: int) -> tuple[float, float]:
    """The exact interval of confidence 95 % for a share that is counted."""
    from scipy.special import betaincinv

    out = (1 - CONFIDENCE) / 2
    low = float(betaincinv(able, of - able + 1, out)) if able else 0.0
    high = float(betaincinv(able + 1, of - able, 1 - out)) if able < of else 1.0
    return low, high


def feasibility(
    problem: DesignProblem, points: Points, *, draws: int = 1000, seed: int = 0, threads: int | None = None
) -> Feasibility:
    """Count on which plants a whole design runs: every trajectory ends as ok and keeps the limits `problem.along`.

    A trajectory that touches a jump along its tangent, at the problem's tolerance, is computed again at a finer one.

    Parameters
    ----------
    problem : DesignProblem
        Its prior, `uncertain`, `varies` and `initial_state_std` say which plants there are: estimated parameters and uncertain
        constants are a plant's own; what varies, and starts, deviate in each point or run. Kinks and jumps are crossed or not as it
        says.
    points : Experiments or Runs
        At least one point, or run.
    draws : int
        Plants that are drawn. Of 1000, a share of 99 % is known to 0.7 %.
    seed : int
    threads : int, optional
        Number of threads; the result does not depend on it.

    Returns
    -------
    Feasibility

    Raises
    ------
    TypeError, ValueError
        For misuse, a point that starts on a surface which is not crossed, a run without a rest at the prior mean, and a prior of
        which next to no draw makes sense to the model.
    """
    return feasibility_within(problem, points, draws, seed, threads, None)


def feasibility_within(
    problem: DesignProblem,
    points: Points,
    draws: int,
    seed: int,
    threads: int | None,
    clock: Clock | None,
) -> Feasibility:
    """Return what `feasibility` does, from fewer plants where a clock leaves time for no more, but a block of them at least."""
    check_type(problem, DesignProblem, "problem")
    runs = as_runs(points)
    if not len(runs):
        raise ValueError("points: expected at least one point, given none")
    count = check_positive_int(draws, "draws", most=MOST_DRAWS)
    checked_arguments(problem.model, points, problem.theta, problem.rtol, threads, problem.kinks, problem.jumps, None)
    settings = problem.integration(threads)
    seed = check_positive_int(seed, "seed", 0)
    plants, left_out = drawn_plants(problem, count, np.random.default_rng([seed, 0]))
    of_starts = np.random.default_rng([seed, 1])
    tally = _Tally(problem, runs, settings)
    clock, done = Clock() if clock is None else clock, 0
    few = FEW if clock.limited and not clock.costly("plants", FEW * len(runs)) else 1
    each = max(1, min(MOST_SEGMENTS // runs.dt.size, count))
    while done < count:
        if done >= few and clock.late(clock.cost("plants", len(runs))):
            count = done
            break
        clock.report()
        size = min(each, max(few - done, clock.size("plants", len(runs))), count - done) if clock.measures else each
        began = clock.seconds
        tally.add(plants[done : done + size], of_starts)
        clock.measured("plants", size * len(runs), clock.seconds - began)
        done += size
    count = min(done, count)
    return Feasibility(
        kind=points.kind,
        draws=count,
        able=count - tally.unable,
        left_out=left_out,
        reasons=FrozenMapping(dict(tally.reasons)),
        failures=FrozenMapping({reason: tuple(counts.tolist()) for reason, counts in tally.failures.items()}),
        n_points=len(points),
        along=tuple(problem.along or ()),
    )


class _Tally:
    """Counts reasons over plants that are added."""

    def __init__(self, problem: DesignProblem, runs: Runs, settings: Integration) -> None:
        self._runs, self._settings = runs, settings
        assumed = problem.assumed
        self._model = problem.limited if assumed is None else assumed.model
        self._named = problem.limited if len(problem.limited.domain) == len(self._model.domain) else self._model
        self._columns, self._std = ([], np.empty(0)) if assumed is None else assumed.drawn
        self.unable = 0
        self.reasons: Counter[str] = Counter()
        self.failures: dict[str, IntArray] = {}

    def add(self, plants: Array, rng: np.random.Generator) -> None:
        k = len(self._runs)
        theta = np.repeat(plants, k, axis=0)
        theta[:, self._columns] += self._std * rng.standard_normal((len(theta), len(self._columns)))
        many = self._runs[np.tile(np.arange(k), len(plants))]
        status = checked_run_trajectories(self._model, many, theta, self._settings).status
        near = np.flatnonzero(status == Status.grazes_jump)
        if len(near):
            finer = self._settings.finer()
            status[near] = checked_run_trajectories(self._model, many[near], theta[near], finer).status
        bad = np.flatnonzero(status != Status.ok)
        self.unable += len(np.unique(bad // k))
        met = set()
        for row, limit in zip(bad.tolist(), self._limits(many, theta, status, bad), strict=True):
            reason = Status(status[row]).name + (f": {limit}" if limit else "")
            self.failures.setdefault(reason, np.zeros(k, dtype=np.int32))[row % k] += 1
            met.add((row // k, reason))
        self.reasons.update(reason for _, reason in met)

    def _limits(self, runs: Runs, theta: Array, status: IntArray, rows: NDArray[np.intp]) -> list[str | None]:
        """Limits that ended some trajectories; None where it was none."""
        left = rows[status[rows] == Status.left_domain]
        of_rows: dict[int, str | None] = {}
        if len(left):
            limits = checked_broken_limits(self._model, runs[left], theta[left], self._settings, self._named)
            of_rows = dict(zip(left.tolist(), limits, strict=True))
        return [of_rows.get(row) for row in rows.tolist()]
