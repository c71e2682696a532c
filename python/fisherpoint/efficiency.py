"""What a design is worth beside others: the best under the sensor noise, random ones, and the bound of the pooled form.

The criterion's own value says little. To first order (7), (16) and (17) without noise give tr(Sigma_theta F) = 2 n_y for
every design, so that log det(Sigma_theta F) <= p log(2 n_y / p), whatever the points are; what counts is the information under
the sensor noise. Here Sigma_theta is the covariance that the rule's nodes have, which is not quite the prior's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import _core
from .candidates import CandidateSource
from .information import PointInformation
from .output_covariance import Criterion, criterion
from .problem import DesignProblem
from .quantity import Array

RANDOM_DESIGNS = 201


@dataclass(frozen=True)
class Efficiency:
    """Log dets (standardised, (7)'s scaling) and D-efficiencies (det ratio)^(1/p); None where something does not exist.

    Attributes
    ----------
    under_noise : float or None
        log det F of the design with D = R.
    noise_optimum : float or None
        The largest found with D = R: by a search for it with another seed, or by the design itself.
    random_median : float or None
        Median over random designs of as many points, D = R.
    vs_optimum, vs_random : float or None
        D-efficiencies of the design against the two.
    below_random : bool
        Whether the design is worse than the median random design.
    bound, vs_bound : float or None
        The closed bound where D is "pooled" without noise and every estimated parameter varies over the nodes, and the
        D-efficiency against it; to first order in the spread of the outputs, so that a design can exceed it a little.
    """

    under_noise: float | None
    noise_optimum: float | None
    random_median: float | None
    vs_optimum: float | None
    vs_random: float | None
    below_random: bool
    bound: float | None
    vs_bound: float | None


def d_efficiency(log_det: float | None, reference: float | None, parameters: int) -> float | None:
    """(det ratio)^(1/p); None where a log det is missing or infinite."""
    if log_det is None or reference is None or not np.isfinite(reference):
        return None
    return float(np.exp((log_det - reference) / parameters))


def efficiency_of(
    problem: DesignProblem,
    d: Criterion,
    log_det: float,
    under_noise: float | None,
    noise_optimum: float | None,
    random_median: float | None,
) -> Efficiency:
    """Collect the comparison of a design whose log dets under its criterion and under the noise are given."""
    p, n_y = len(problem.estimated), int(d.used.sum())
    bound = None
    if d.kind == "pooled" and problem.noise_std is None:
        rows = [problem.prior.names.index(name) for name in problem.estimated]
        log_det_nodes = _core.log_det(problem.rule.second_moments(problem.prior, problem.estimated)[np.ix_(rows, rows)])
        if np.isfinite(log_det_nodes):
            bound = float(p * np.log(2 * n_y / p) - log_det_nodes)
    if under_noise is not None and noise_optimum is not None:
        noise_optimum = max(noise_optimum, under_noise)
    vs_random = d_efficiency(under_noise, random_median, p)
    return Efficiency(
        under_noise=under_noise,
        noise_optimum=noise_optimum,
        random_median=random_median,
        vs_optimum=d_efficiency(under_noise, noise_optimum, p),
        vs_random=vs_random,
        below_random=vs_random is not None and vs_random < 1,
        bound=bound,
        vs_bound=d_efficiency(log_det, bound, p),
    )


def random_designs(
    problem: DesignProblem, n_experiments: int, seed: int, threads: int, previous: PointInformation | None = None
) -> Array:
    """Log dets under the sensor noise of random designs out of a pool of points, beside the previous ones; (RANDOM_DESIGNS,)."""
    rng = np.random.default_rng([seed, 1])
    pool = CandidateSource(problem, rng, threads).draw_confirmed(4 * n_experiments)
    both = pool if previous is None else PointInformation.join([previous, pool])
    d = criterion(problem, both, threads, "noise")
    prepared, known = d.prepare(pool), None if previous is None else d.prepare(previous)
    result = np.empty(RANDOM_DESIGNS)
    for i in range(RANDOM_DESIGNS):
        chosen = prepared[rng.choice(len(pool), n_experiments, replace=False)]
        chosen = chosen if known is None else PointInformation.join([known, chosen])
        result[i] = _core.log_det(d.accumulate(chosen).fisher(d.given))
    return result
