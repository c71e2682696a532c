"""What a design is worth beside others: what bounds those of the same candidates, random ones, the bound of the pooled form.

The value of the pooled criterion says little. To first order (7), (16) and (17) without noise give tr(Sigma_theta F) = 2 n_y for
every design, and with noise, which makes D larger, less; so log det(Sigma_theta F) <= p log(2 n_y / p), whatever the points are.
What counts is the information under the sensor noise. Here Sigma_theta is the covariance that the rule's nodes have, which is not
quite the prior's.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from ...basics.values import Array
from ...basics.work_clock import Clock, OutOfTime
from ...engine import _core
from ...information.candidates import LARGEST_BATCH, CandidateSource
from ...information.output_covariance import OutputCovariance, output_covariance
from ...information.point_information import PointInformation
from ...information.problem import DesignProblem

MEDIAN_ERROR = 0.02
"""Standard error of the D-efficiency against the median random design, as a share, down to which random designs are drawn."""

MOST_RANDOM_POINTS = 20_000
"""Points of all random designs together, after which there are enough in any case: the search draws several times as many."""

LEAST_RANDOM_DESIGNS = 25


class Bound(NamedTuple):
    """The largest log det F under the sensor noise, (7), that a design of some candidates can have, and how many these are.

    With another criterion, what is maximised in its place.
    """

    log_det: float
    n_candidates: int


@dataclass(frozen=True)
class Efficiency:
    """Log dets (standardised, (7)'s scaling) and D-efficiencies (det ratio)^(1/p); None where something does not exist.

    With another criterion than "D", log dets are replaced by what is maximised in their place, as in `TraceRecord`, and
    D-efficiencies by those of the criterion: the share of the measurements with which the better design would do.

    Attributes
    ----------
    under_noise : float or None
        log det F of the design with D = R: of what the points of the region determine, where that is not everything.
    at_most : float or None
        Proven: no design of as many of the candidates that were evaluated has a larger log det with D = R. None where the points
        are too few to determine as much as these candidates do. Weights of candidates
        that need not be whole numbers reach it, so that designs may all be below. With a criterion over the prior, log dets are
        replaced by what is maximised here and in `at_least`.
    at_least : float or None
        The D-efficiency of the design against that, a lower bound of its efficiency among designs of these candidates. It says
        nothing of points between them: `fisherpoint.approximate_design` searches the region.
    n_candidates : int
        How many candidates the bound is of.
    best_found, vs_best : float or None
        Where the criterion's D is another than R: the largest log det that another search for D = R found, or that the design
        itself has, and the D-efficiency against it. There may be better designs.
    random_median, vs_random : float or None
        Median over random designs of as many points, D = R, see `random_designs`, and the D-efficiency against it; None where about
        half of them are singular.
    below_random : bool
        Whether the design is worse than the median random design.
    bound, vs_bound : float or None
        The closed bound where D is "pooled" and every estimated parameter varies over the nodes, and the D-efficiency against it;
        to first order in the spread of the outputs, so that without noise a design can exceed it a little.
    """

    under_noise: float | None
    at_most: float | None
    at_least: float | None
    n_candidates: int
    best_found: float | None
    vs_best: float | None
    random_median: float | None
    vs_random: float | None
    below_random: bool
    bound: float | None
    vs_bound: float | None

    _NEEDS: ClassVar[Mapping[str, str]] = {
        "at_least": "at_most",
        "vs_best": "best_found",
        "vs_random": "random_median",
        "vs_bound": "bound",
    }


def d_efficiency(log_det: float | None, reference: float | None, parameters: int) -> float | None:
    """(det ratio)^(1/p); None where a log det is missing or infinite, or the ratio overflows.

    With the level of another criterion instead of p, it is the efficiency by that criterion.
    """
    if log_det is None or reference is None or not np.isfinite(reference):
        return None
    with np.errstate(over="ignore"):
        ratio = float(np.exp((log_det - reference) / parameters))
    return ratio if np.isfinite(ratio) else None


def efficiency_of(
    problem: DesignProblem,
    d: OutputCovariance,
    log_det: float,
    under_noise: float | None = None,
    candidates: Bound | None = None,
    best_found: float | None = None,
    random_median: float | None = None,
    of_criterion: bool = False,
    level: int | None = None,
) -> Efficiency:
    """Collect the comparison of a design whose log dets under its criterion and under the noise are given.

    The bound of the candidates is of the noise at the prior mean, or `of_criterion`. `level` is that of the criterion where it is
    not "D".
    """
    p, n_y = len(problem.estimated), int(d.used.sum())
    bound = None
    if d.kind == "pooled":
        rows = [problem.prior.names.index(name) for name in problem.estimated]
        log_det_nodes = _core.log_det(problem.rule.second_moments(problem.prior, problem.estimated)[np.ix_(rows, rows)])
        if np.isfinite(log_det_nodes):
            bound = float(p * np.log(2 * n_y / p) - log_det_nodes)
    if under_noise is not None and best_found is not None:
        best_found = max(best_found, under_noise)
    at_most = None if candidates is None else candidates.log_det
    level = p if level is None else level
    vs_random = d_efficiency(under_noise, random_median, level)
    maximised = log_det if of_criterion else under_noise
    if maximised is None or not np.isfinite(maximised):
        candidates = at_most = None  # the bound of what is not determined says nothing
    return Efficiency(
        under_noise=under_noise,
        at_most=at_most,
        at_least=d_efficiency(maximised, at_most, level),
        n_candidates=0 if candidates is None else candidates.n_candidates,
        best_found=best_found,
        vs_best=d_efficiency(under_noise, best_found, level),
        random_median=random_median,
        vs_random=vs_random,
        below_random=vs_random is not None and vs_random < 1,
        bound=bound,
        vs_bound=d_efficiency(log_det, bound, p) if np.isfinite(log_det) else None,
    )


def random_designs(
    problem: DesignProblem,
    n_experiments: int,
    seed: int,
    threads: int,
    previous: PointInformation | None = None,
    clock: Clock | None = None,
    value: Callable[[Array], float] = _core.log_det,
) -> Array:
    """Log dets (n,) under the sensor noise of random designs that share no point, each beside the previous points.

    Their points are valid at the prior mean: on all nodes of the rule a design's own have to be, at many times the cost. As many
    are drawn as determine the median to `MEDIAN_ERROR`, up to `MOST_RANDOM_POINTS`, but 25 at least; fewer where the clock says so.
    `value` may be another function of F than log det F.
    """
    clock = Clock() if clock is None else clock
    source = CandidateSource(problem, np.random.default_rng([seed, 1]), threads, clock=clock)
    most = max(LEAST_RANDOM_DESIGNS, MOST_RANDOM_POINTS // n_experiments)
    group = int(np.clip(LARGEST_BATCH // n_experiments, 1, 4 * LEAST_RANDOM_DESIGNS))  # of designs that are drawn at once
    found: list[float] = []
    d = known = None
    while len(found) < most:
        try:
            drawn = source.draw(group * n_experiments)
        except OutOfTime:
            break
        if d is None:
            d = output_covariance(
                problem, drawn if previous is None else PointInformation.join([previous, drawn]), threads, "noise"
            )
            known = None if previous is None else d.prepare(previous)
        prepared = d.prepare(drawn)
        for k in range(group):
            design = prepared[k * n_experiments : (k + 1) * n_experiments]
            design = design if known is None else PointInformation.join([known, design])
            found.append(value(d.accumulate(design).fisher(d.given)))
        if len(found) >= LEAST_RANDOM_DESIGNS and _median_error(np.array(found)) <= MEDIAN_ERROR * len(problem.estimated):
            break
    return np.array(found)


def median_of(log_dets: Array) -> float | None:
    """Their median; None where it is not known whether that is finite."""
    return float(np.median(log_dets)) if np.isfinite(_median_error(log_dets)) else None


def _median_error(values: Array) -> float:
    """Standard error of the median: a quarter of what lies between the order statistics two standard deviations from it."""
    places = len(values) / 2 + np.sqrt(len(values)) * np.array([-1.0, 1.0])
    low, high = np.sort(values)[np.clip(places.round().astype(int), 0, len(values) - 1)]
    return 0.0 if low == high else float(high - low) / 4  # of -inf, where most are singular, there is no doubt
