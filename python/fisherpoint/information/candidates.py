"""Candidates: drawn in the region's box or near given points, then filtered by constraints and by how their trajectories end."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ..basics.messages import listed, with_counts
from ..basics.quantity import names_of
from ..basics.values import Array, IntArray
from ..basics.work_clock import LANES, Clock, OutOfTime
from ..models import Model
from ..points.experiments import Experiments
from ..points.region import ExperimentRegion
from ..points.settings import on_surface
from ..points.status import Status, failures_of
from ..prior.gaussian import GaussianPrior
from ..prior.rules import Rule
from .assumed import starts_near
from .point_information import PointInformation, point_sensitivities, with_linearized_covariance
from .problem import DesignProblem
from .validity import Validity


def of_other_sign(
    model: Model, prior: GaussianPrior, rule: Rule, varied: Sequence[str], scenarios: Iterable[Array] = ()
) -> list[str]:
    """The names of those, at a node of the rule or in a scenario (p,)."""
    found = []
    everywhere = np.array(list(scenarios)).reshape(-1, len(model.parameters))
    for i, name in enumerate(names_of(model.parameters)):
        if name in prior.log or name not in varied:
            continue
        values = everywhere[:, i]
        try:
            values = np.append(values, rule.nodes(prior.marginal([name]))[0])
        except ValueError:  # a rule that says for other parameters too what it does
            values = np.append(values, prior.mean[name] + np.array([-1.0, 1.0]) * prior.std[name])
        if (values * prior.mean[name] < 0).any():
            found.append(name)
    return found


MAX_DRAWN_PER_CANDIDATE = 2000
"""Draws after which a region counts as one in which nothing survives."""

SMALLEST_BATCH, LARGEST_BATCH = 64, 1024
"""Draws at once; what is left over serves the next request."""

ONWARD = 0.5
"""Share of the candidates near points that go on where these have come from."""

EDGES_SHARE = 0.02
"""Share of a limit of time that a part of the candidates at the edges takes, where all would take more."""

Points = TypeVar("Points", Experiments, PointInformation)


class CandidateSource:
    """Draws valid candidates and counts what was rejected and why.

    Parameters
    ----------
    problem : DesignProblem
        With a region.
    rng : numpy.random.Generator
    threads : int or None
    keep : callable, optional
        Is given all that is valid at the prior mean.
    validity : Validity, optional
        Tries candidates on the nodes of the rule. Default: its own.
    elsewhere : tuple of DesignProblem
        The problem at other parameters, at which candidates have to be valid too, and are evaluated.
    clock : Clock, optional
        Where it is late, there are fewer candidates, or `OutOfTime` is raised where there are none.

    Raises
    ------
    ValueError
        Where the problem has no region.
    """

    def __init__(
        self,
        problem: DesignProblem,
        rng: np.random.Generator,
        threads: int | None,
        keep: Callable[[PointInformation], None] | None = None,
        elsewhere: tuple[DesignProblem, ...] = (),
        validity: Validity | None = None,
        clock: Clock | None = None,
    ) -> None:
        self._problem, self._region, self._rng, self._threads = problem, problem.point_region, rng, threads
        self._keep, self._elsewhere = keep, elsewhere
        self._validity = Validity(problem, threads) if validity is None else validity
        self._clock = Clock() if clock is None else clock
        self._spare: PointInformation | None = None
        self.drawn = 0
        self.rejected: Counter[str] = Counter()

    @property
    def accepted(self) -> int:
        return self.drawn - self.rejected.total()

    def include(self, other: CandidateSource) -> None:
        """Count what another source has drawn."""
        self.drawn += other.drawn
        self.rejected.update(other.rejected)

    def draw(self, count: int, partly: bool = False) -> PointInformation:
        """Return `count` candidates that are valid at the prior mean, without predictive covariances.

        Where the time is up, fewer are enough `partly`.

        Raises
        ------
        ValueError
            Where hardly any point of the region survives; the reasons are listed.
        """
        found = [] if self._spare is None else [self._spare]
        have, tried, before = sum(map(len, found)), 0, self.rejected.copy()
        while have < count:
            if tried >= max(MAX_DRAWN_PER_CANDIDATE, MAX_DRAWN_PER_CANDIDATE // 20 * count):
                raise ValueError(
                    f"region: expected valid points, given {have} of {tried} drawn ({self._since(before)}): "
                    f"{self._what_helps('widen or move the region')}"
                )
            share = max(self.accepted / self.drawn, 0.05) if self.drawn else 0.7
            batch = round(np.clip(4 * count / share, SMALLEST_BATCH, LARGEST_BATCH))
            tried += batch
            survivors, _ = self._survivors(self._region.draw(self._problem.model, batch, seed=self._rng), count - have)
            found.append(survivors)
            have += len(survivors)
            if have < count and self._clock.late():
                if not (partly and have):
                    raise OutOfTime
                count = have
        joined = PointInformation.join(found) if len(found) > 1 else found[0]
        self._spare = joined[count:] if have > count else None
        return joined[:count]

    def survivors(self, points: Experiments) -> tuple[PointInformation, NDArray[np.intp]]:
        """Return those that are valid at the prior mean, and their places; the others are counted."""
        return self._survivors(points, None)

    def _survivors(self, points: Experiments, enough: int | None) -> tuple[PointInformation, NDArray[np.intp]]:
        """Return survivors among the points that there is time for; `enough` of them where more would cost much."""
        parts, places, have = list[PointInformation](), list[NDArray[np.intp]](), 0
        lanes = 1 + len(self._elsewhere)
        try:
            for some in self._clock.blocks("sensitivities", len(points), lanes):
                found = surviving(self._problem, self._region, points[some], self._threads, self._elsewhere)
                information, kept, rejected = found
                self.drawn += some.stop - some.start  # with the reasons, so that the counts add up after an interrupt too
                self.rejected.update(+rejected)
                parts.append(information)
                places.append(kept + some.start)
                have += len(kept)
                left = (len(points) - some.stop) * lanes
                if enough is not None and have >= enough and self._clock.costly("sensitivities", left):
                    break
        except OutOfTime:
            if not parts:
                raise
        information = parts[0] if len(parts) == 1 else PointInformation.join(parts)
        if self._keep is not None:
            self._keep(information)
        return information, np.concatenate(places)

    def draw_at_edges(self, count: int) -> PointInformation:
        """Return what is valid at the prior mean of `count` candidates at the region's edges, sampled as late as plants allow."""
        points = self._region.draw_at_edges(self._problem.model, count, seed=self._rng)
        if (shortest := self._shortest) is None:
            return self.survivors(points)[0]
        # Where they cost much there may be time for a part of them: then each part goes all its way.
        each, parts = self._clock.affordable("sensitivities", EDGES_SHARE), list[PointInformation]()
        each = max(count, 1) if each >= count else max(LANES, int(each))
        for first in range(0, max(count, 1), each):
            try:
                some = points[first : first + each]
                cut, _, status = self._validity.cut_short(some, shortest, roughly=True)
                some = Experiments.join([some[np.flatnonzero(status == Status.ok)], cut])
                parts.append(self.survivors(some)[0])
            except OutOfTime:
                if not parts:
                    raise
                break
        return parts[0] if len(parts) == 1 else PointInformation.join(parts)

    def draw_near(self, points: Experiments, each: int, steps: Array | None = None) -> tuple[PointInformation, IntArray]:
        """Return what is valid at the prior mean of `each` candidates near every point, and the point of each.

        A share of them goes on where points have come from: `steps` (K, m, d) to each point, zero where there are none.
        """
        near = np.repeat(np.arange(len(points), dtype=np.int32), each)
        onward = None
        if steps is not None:
            onward = steps[near, self._rng.integers(steps.shape[1], size=len(near))]
            onward[self._rng.random(len(near)) > ONWARD] = 0.0
        survivors, kept = self.survivors(self._region.draw_near(self._problem.model, points[near], onward, seed=self._rng))
        return survivors, near[kept]

    def sampled_earlier(self, points: Experiments) -> tuple[PointInformation, IntArray, IntArray]:
        """Return valid points that some plants cannot run so long, sampled as late as these can: what is valid at the prior mean.

        With their places among the given ones, and the places of all that some plants cannot run; these are counted as rejected.
        """
        if (shortest := self._shortest) is None:
            nothing = np.empty(0, dtype=np.int32)
            return self.survivors(points[nothing])[0], nothing, nothing
        cut, places, status = self._validity.cut_short(points, shortest, ok_at_mean=True)
        if status.any():
            self.rejected.update(failures_of(status))
        survivors, kept = self.survivors(cut)
        return survivors, places[kept], np.flatnonzero(status).astype(np.int32)

    def cut_for_plants(self, points: Experiments) -> tuple[PointInformation, IntArray]:
        """Return points sampled as late as all required plants allow, those that are valid at the mean; and their places."""
        places = np.arange(len(points))
        if (shortest := self._shortest) is not None:
            points, found = self._validity.cut_for_plants(points, shortest)
            places = np.flatnonzero(found)
        survivors, kept = self.survivors(points)
        return survivors, places[kept].astype(np.int32)

    @property
    def _shortest(self) -> float | None:
        """The shortest dt; None where all are as long, or there is none."""
        shortest, longest = self._region.bounds.get("dt", (0.0, 0.0))
        return shortest if shortest < longest else None

    def confirm(self, chosen: PointInformation) -> PointInformation:
        """Return those that are valid on all nodes of the rule, with their covariances; count the others as rejected."""
        information, valid = self.confirmed(chosen)
        return information if valid.all() else information[valid]

    def confirmed(self, chosen: PointInformation) -> tuple[PointInformation, NDArray[np.bool_]]:
        """Return all with their covariances, and which are valid on all nodes of the rule; count the others as rejected."""
        return self._counted(*self._validity.tried(chosen))

    def linearized(self, candidates: PointInformation) -> tuple[PointInformation, NDArray[np.bool_]]:
        """Return all with their linearized covariances, and which of these are finite; count the others as rejected."""
        return self._counted(*with_linearized_covariance(self._problem, candidates))

    def _counted(self, information: PointInformation, status: IntArray) -> tuple[PointInformation, NDArray[np.bool_]]:
        if status.any():
            self.rejected.update(failures_of(status))
        return information, status == Status.ok

    def draw_confirmed(self, count: int) -> PointInformation:
        """Return `count` candidates that are valid on all nodes of the rule, with their predictive covariances."""
        found: list[PointInformation] = []
        tried, before = 0, self.rejected.copy()
        while (have := sum(map(len, found))) < count:
            if tried >= MAX_DRAWN_PER_CANDIDATE + 20 * count:
                raise ValueError(
                    f"region: expected points that are valid over the prior, given {have} of {tried} tried "
                    f"({self._since(before)}): {self._what_helps('widen or move it')}"
                )
            batch = self.draw(count - have)
            tried += len(batch)
            found.append(self.confirm(batch))
        return PointInformation.join(found)

    def _what_helps(self, otherwise: str) -> str:
        """Advice where hardly any point is valid: often the prior has values that the model was not made for."""
        problem = self._problem
        at = [other.theta for other in self._elsewhere]
        if names := of_other_sign(problem.model, problem.prior, problem.rule, problem.estimated, at):
            return (
                f"over the prior, {listed(names)} also takes the other sign: make it log-normal (log), or its standard deviation "
                f"smaller; or {otherwise}"
            )
        return otherwise

    def _since(self, before: Counter[str]) -> str:
        return with_counts(dict((self.rejected - before).most_common()))


def surviving(
    problem: DesignProblem,
    region: ExperimentRegion | None,
    points: Experiments,
    threads: int | None,
    elsewhere: tuple[DesignProblem, ...] = (),
) -> tuple[PointInformation, NDArray[np.intp], Counter[str]]:
    """Points that satisfy a region's constraints and are valid at the prior mean, their places, and reasons of the others.

    They have to be valid where the problem is at other parameters too.
    """
    rejected = Counter[str]()
    keep = np.ones(len(points), dtype=bool)
    if region is not None and region.constraints:
        keep = region.satisfied(problem.model, points)
        rejected["constraint"] += int((~keep).sum())
    inside = np.flatnonzero(keep)
    for surface, rows in on_surface(problem.model, _of(points, inside), problem.theta, problem.crossed).items():
        rejected[f"starts on {surface} = 0"] += int(keep[inside[rows]].sum())
        keep[inside[rows]] = False
    if problem.initial_state_std:
        near = starts_near(problem.limited, points, problem.theta, problem.initial_state_std, problem.kinks == "exclude")
        for surface, rows in near.items():
            rejected[f"starts near {surface}{'' if surface in problem.limited.along else ' = 0'}"] += int(keep[rows].sum())
            keep[rows] = False
    tried = np.flatnonzero(keep)
    information, status = point_sensitivities(problem, _of(points, tried), threads)
    rejected.update(failures_of(status))
    survive = np.flatnonzero(status == Status.ok)
    information, tried = _of(information, survive), tried[survive]
    found: list[PointInformation] = []
    for other in elsewhere:
        if other is problem:
            found.append(information)
            continue
        there, kept, lost = surviving(other, None, information.experiments, threads)
        rejected.update(lost)
        information, tried, found = information[kept], tried[kept], [*(one[kept] for one in found), there]
    return replace(information, elsewhere=tuple(found)) if found else information, tried, rejected


def _of(points: Points, rows: NDArray[np.intp]) -> Points:
    """Select rows of points; return the object itself where all are selected."""
    return points if len(rows) == len(points) else points[rows]
