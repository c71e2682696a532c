"""States with all nine sensitivities: experiments per second, next to SciPy on the same equations."""

from __future__ import annotations

from functools import partial
from typing import Any

import fisherpoint as fp

from .scipy_peer import WAYS, solve_sensitivities
from .timing import best_times, loosest
from .workload import MODEL, Array, error_figures, meets_rule, output_errors, random_pairs, sensitivity_errors

LARGEST_ERROR = 1e-5
"""Of dy/dtheta, relative to the root mean square of the entry."""


def measure(quick: bool, threads: list[int]) -> dict[str, Any]:
    pairs = random_pairs(60 if quick else 200, seed=3)

    def meets(y: Array, dy_dtheta: Array) -> bool:
        return meets_rule(output_errors(y, pairs.y)) and bool(sensitivity_errors(dy_dtheta, pairs.dy_dtheta).max() < LARGEST_ERROR)

    def loosest_rtol(split: bool) -> float:
        return loosest(lambda rtol: meets(*solve_sensitivities(pairs, rtol, split)))

    peers = {name: (loosest_rtol(split), split) for name, split in WAYS.items()}
    many = random_pairs(20_000 if quick else 100_000, seed=4)
    tasks: dict[str, Any] = {name: partial(solve_sensitivities, pairs, *way) for name, way in peers.items()}
    tasks |= {f"{n} threads": partial(fp.sensitivities, MODEL, many.points, many.theta, threads=n) for n in threads}
    best = best_times(tasks, 2 if quick else 5)
    rates = {name: (len(pairs) if name in peers else len(many)) / seconds for name, seconds in best.items()}
    ours = fp.sensitivities(MODEL, pairs.points, pairs.theta)
    errors = sensitivity_errors(ours.dy_dtheta, pairs.dy_dtheta)
    return {
        "experiments per second": {str(n): rates[f"{n} threads"] for n in threads},
        "errors of dy_dtheta": error_figures(errors),
        "meets rule": meets(ours.y, ours.dy_dtheta),
        "scipy": {
            name: {
                "rtol": rtol,
                "experiments per second": rates[name],
                **error_figures(sensitivity_errors(solve_sensitivities(pairs, rtol, split)[1], pairs.dy_dtheta)),
            }
            for name, (rtol, split) in peers.items()
        },
        "ratio": rates[f"{threads[0]} threads"] / max(rates[name] for name in peers),
    }
