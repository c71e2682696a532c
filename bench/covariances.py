"""Predictive covariances over the 3^9 grid: trajectories per second, next to SciPy at the same accuracy."""

from __future__ import annotations

import os
import subprocess
import sys
from functools import partial
from time import perf_counter
from typing import Any

import numpy as np

import fisherpoint as fp
from fisherpoint.kernels import available_isas

from .scipy_peer import WAYS, solve_states
from .timing import best_times, loosest
from .workload import MODEL, PRIOR, RULE, TIGHT, Array, candidates, error_figures, meets_rule, output_errors, random_pairs


def covariances(points: fp.Experiments, threads: int, rtol: float = 1e-6) -> fp.PredictiveCovariance:
    return fp.predictive_covariance(MODEL, points, PRIOR, RULE, rtol=rtol, threads=threads)


def rate(seconds: float) -> float:
    """Trajectories per second on one thread, over at least so many seconds."""
    points, done, begin = candidates()[0], 0, perf_counter()
    while (spent := perf_counter() - begin) < seconds:
        covariances(points[[done % len(points)]], threads=1)
        done += 1
    return done * RULE.size(PRIOR) / spent


def rates_of_levels(seconds: float) -> dict[str, float]:
    """`rate` for every instruction set of this machine, each in a process of its own."""
    code = f"from bench.covariances import rate; rate(0.2); print(rate({seconds}))"

    def printed(level: str) -> str:
        environment = {**os.environ, "FISHERPOINT_ISA": level}
        return subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True).stdout

    return {level: float(printed(level)) for level in available_isas()}


def errors_over_the_grid(stride: int) -> dict[str, Any]:
    """Errors of y(dt) at the default tolerance on every `stride`-th of all 96 x 19683 trajectories."""
    nodes, points = RULE.nodes(PRIOR)[0], candidates()[0]
    errors = []
    for k in range(len(points)):
        theta = nodes[k % stride :: stride]
        repeated = points[np.full(len(theta), k)]
        loose, tight = fp.simulate(MODEL, repeated, theta), fp.simulate(MODEL, repeated, theta, rtol=TIGHT)
        errors.append(output_errors(loose.y, tight.y))
    together = np.concatenate(errors)
    return {"trajectories": len(together), "meets rule": meets_rule(together), **error_figures(together)}


def covariance_error(count: int) -> float:
    """Largest relative Frobenius error of `count` covariances at the default tolerance, outputs scaled by their std."""
    points = candidates()[0][:count]
    threads = os.cpu_count() or 1
    loose, tight = (covariances(points, threads, rtol).covariance for rtol in (1e-6, 1e-11))
    std = np.sqrt(np.einsum("kii->ki", tight))
    scale = np.where(std > 0, std, 1.0)[:, :, None] * np.where(std > 0, std, 1.0)[:, None, :]
    norm = np.linalg.norm
    return float(np.max(norm((loose - tight) / scale, axis=(1, 2)) / norm(tight / scale, axis=(1, 2))))


def measure(quick: bool, threads: list[int]) -> dict[str, Any]:
    points, source = candidates()
    pairs = random_pairs(150 if quick else 1000, seed=1)

    def errors(split: bool, rtol: float) -> Array:
        return output_errors(solve_states(pairs, rtol, split), pairs.y)

    def loosest_rtol(split: bool) -> float:
        return loosest(lambda rtol: meets_rule(errors(split, rtol)))

    peers = {name: (loosest_rtol(split), split) for name, split in WAYS.items()}

    chosen = points[:24] if quick else points
    some = random_pairs(100 if quick else 300, seed=2)
    tasks: dict[str, Any] = {name: partial(solve_states, some, *way) for name, way in peers.items()}
    tasks |= {f"{n} threads": partial(covariances, chosen, n) for n in threads}
    best = best_times(tasks, 2 if quick else 5)
    work = dict.fromkeys(peers, len(some)) | {f"{n} threads": len(chosen) * RULE.size(PRIOR) for n in threads}
    rates = {name: work[name] / seconds for name, seconds in best.items()}
    fastest = max(peers, key=lambda name: rates[name])
    return {
        "workload": source,
        "trajectories per second": {str(n): rates[f"{n} threads"] for n in threads},
        "levels": rates_of_levels(0.5 if quick else 3.0),
        "scipy": {
            name: {
                "rtol": rtol,
                "trajectories per second": rates[name],
                **error_figures(errors(split, rtol)),
            }
            for name, (rtol, split) in peers.items()
        },
        "same pairs": error_figures(output_errors(fp.simulate(MODEL, pairs.points, pairs.theta).y, pairs.y)),
        "accuracy": errors_over_the_grid(50 if quick else 1),
        "covariance error": covariance_error(4 if quick else 24),
        "ratio": rates[f"{threads[0]} threads"] / rates[fastest],
    }
