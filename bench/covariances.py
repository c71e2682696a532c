"""Predictive covariances over the 3^9 grid: trajectories per second, next to SciPy at the same accuracy."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

import fisherpoint as fp
from fisherpoint.engine.levels import kernels
from fisherpoint.points.settings import resolve_threads

from . import fresh_process
from .accuracy import ACCURACY_RULE, Errors, loosest_rtol, output_errors
from .scipy_peer import WAYS, solve_states
from .scipy_stacked import NODES, solve_stacked
from .timing import Timing, best_times
from .workload import MODEL, OUTPUT_SCALES, PRIOR, RULE, Array, Pairs, candidates, random_pairs, source

DEFAULT_RTOL, TIGHT_RTOL = 1e-6, 1e-12


@dataclass(frozen=True)
class Contender:
    """One way to do the work: its tolerance, its rate per second, the cores that it got for that, and its errors."""

    name: str
    rtol: float
    rate: float
    cores: float
    errors: Errors

    @staticmethod
    def of(name: str, rtol: float, work: int, timing: Timing, errors: Errors) -> Contender:
        return Contender(name, rtol, work / timing.seconds, timing.cores, errors)


@dataclass(frozen=True)
class CovarianceFigures:
    """What `measure` finds; rates are trajectories per second."""

    workload: str
    trajectories: int
    sample: int
    ours: dict[int, Contender]
    peers: list[Contender]
    stacked: Contender
    ratio: float
    ratio_to_stacked: float
    grid_sample: int
    grid_errors: Errors
    std_error: float
    reference_difference: float
    rate_by_isa: dict[str, float]
    accurate: bool


def covariances(points: fp.Experiments, threads: int | None, rtol: float = DEFAULT_RTOL) -> Array:
    """Predictive covariances of points over the whole grid, (K, n_y, n_y)."""
    result = fp.predictive_covariance(MODEL, points, PRIOR, RULE, rtol=rtol, threads=threads, jumps="exclude")
    if (result.status != fp.Status.ok).any():
        raise RuntimeError(f"expected valid candidates, given status {result.status}")
    return result.covariance


def measure(quick: bool, threads: list[int]) -> CovarianceFigures:
    """Measure; the first number of threads is the one that the ratios are taken at."""
    points = candidates()
    pairs = random_pairs(1 if quick else 8, seed=1)
    reference = solve_states(pairs, TIGHT_RTOL, True, "DOP853")
    tight = fp.simulate(MODEL, pairs.points, pairs.theta, rtol=TIGHT_RTOL).y
    ours_on_pairs = np.concatenate(
        [grid_outputs(points[[k]])[0, nodes] for k, nodes in enumerate(pairs.nodes.reshape(len(points), -1))]
    )
    default = Errors.of(output_errors(ours_on_pairs, reference))

    def peer_errors(restart: bool, rtol: float) -> Errors:
        return Errors.of(output_errors(solve_states(pairs, rtol, restart), reference))

    def peer_rtol(restart: bool) -> float:
        return loosest_rtol(lambda rtol: ACCURACY_RULE.met_by(peer_errors(restart, rtol)))

    rtols = {name: peer_rtol(restart) for name, restart in WAYS.items()}
    stacked = _stacked_pairs(8 if quick else 24)
    stacked_reference = fp.simulate(MODEL, stacked.points, stacked.theta, rtol=TIGHT_RTOL).y

    def stacked_errors(rtol: float) -> Errors:
        return Errors.of(output_errors(solve_stacked(stacked, rtol), stacked_reference))

    stacked_rtol = loosest_rtol(lambda rtol: ACCURACY_RULE.met_by(stacked_errors(rtol)))

    timed = pairs[::2]  # half of the sample, still every candidate equally often
    tasks: dict[str, Any] = {f"{n}": partial(covariances, points, n) for n in threads}
    tasks |= {name: partial(solve_states, timed, rtols[name], restart) for name, restart in WAYS.items()}
    tasks["stacked"] = partial(solve_stacked, stacked, stacked_rtol)
    best = best_times(tasks, 2 if quick else 5)

    trajectories = len(points) * RULE.size(PRIOR)
    ours = {n: Contender.of(f"fisherpoint, {threads_text(n)}", DEFAULT_RTOL, trajectories, best[f"{n}"], default) for n in threads}
    peers = [
        Contender.of(f"solve_ivp, {name}", rtols[name], len(timed), best[name], peer_errors(restart, rtols[name]))
        for name, restart in WAYS.items()
    ]
    beside = Contender.of(
        f"solve_ivp, {NODES} stacked nodes", stacked_rtol, len(stacked), best["stacked"], stacked_errors(stacked_rtol)
    )
    grid_errors = _errors_over_the_grid(80 if quick else 8)
    return CovarianceFigures(
        workload=source(),
        trajectories=trajectories,
        sample=len(pairs),
        ours=ours,
        peers=peers,
        stacked=beside,
        ratio=ours[threads[0]].rate / max(peer.rate for peer in peers),
        ratio_to_stacked=ours[threads[0]].rate / beside.rate,
        grid_sample=len(grid_errors),
        grid_errors=Errors.of(grid_errors),
        std_error=_std_error(2 if quick else 24),
        reference_difference=float(output_errors(tight, reference).max()),
        rate_by_isa=_rate_by_isa(1 if quick else 4, 8 if quick else 2),
        accurate=ACCURACY_RULE.met_by(default) and ACCURACY_RULE.met_by(Errors.of(grid_errors)),
    )


def threads_text(n: int) -> str:
    return "1 thread" if n == 1 else f"{n} threads"


def rate_on_one_thread(stride: int) -> float:
    """Trajectories per second on every `stride`-th candidate, the better of two; called in a process of its own."""
    points = candidates()[::stride]
    timing = best_times({"": partial(covariances, points, 1)}, 2)[""]
    return len(points) * RULE.size(PRIOR) / timing.seconds


def _stacked_pairs(count: int) -> Pairs:
    """`count` candidates spread over the list, each with `NODES` random nodes."""
    points, nodes = candidates(), RULE.nodes(PRIOR)[0]
    rows = np.repeat(np.linspace(0, len(points) - 1, count).astype(int), NODES)
    chosen = np.random.default_rng(2).integers(len(nodes), size=len(rows))
    return Pairs(points[rows], nodes[chosen], chosen)


def _errors_over_the_grid(stride: int) -> Array:
    """Errors at the default tolerance on every `stride`-th trajectory of the whole workload, against our own tight solution."""
    points, nodes, errors = candidates(), RULE.nodes(PRIOR)[0], []
    for k in range(len(points)):
        rows = np.arange(k % stride, len(nodes), stride)
        tight = fp.simulate(MODEL, points[np.full(len(rows), k)], nodes[rows], rtol=TIGHT_RTOL).y
        errors.append(output_errors(grid_outputs(points[[k]])[0, rows], tight))
    return np.concatenate(errors)


def grid_outputs(points: fp.Experiments, rtol: float = DEFAULT_RTOL) -> Array:
    """Outputs at every node of the grid as the covariances take them, (K, R, n_y)."""
    theta, threads = MODEL.theta(PRIOR.mean), resolve_threads(None)
    arguments = (points.x0, points.u, points.dt, theta, RULE.core_nodes(PRIOR), rtol, True, False, "fastest", threads)
    return kernels.predictive_covariance(MODEL.core, *arguments, keep_outputs=True)[3]


def _std_error(count: int) -> float:
    """Largest error of predictive standard deviations at the default tolerance, in units of the output scales."""
    points = candidates()[:count]
    std, tight = (np.sqrt(np.einsum("kii->ki", covariances(points, None, rtol))) for rtol in (DEFAULT_RTOL, 1e-10))
    return float(np.max(np.abs(std - tight) / OUTPUT_SCALES))


def _rate_by_isa(rounds: int, stride: int) -> dict[str, float]:
    """`rate_on_one_thread` for every instruction set of this machine, the best of rounds taken in turn."""
    levels = fp.instruction_sets()
    best = dict.fromkeys(levels, 0.0)
    for _ in range(rounds):
        for level in levels:
            best[level] = max(best[level], fresh_process.call(__name__, rate_on_one_thread.__name__, stride, isa=level))
    return best
