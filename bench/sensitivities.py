"""States with all nine sensitivities: experiments per second, next to SciPy on the same variational equation.

Finite differences are not tried: nine or more solutions of a tighter tolerance cost more than one of the variational equation.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import fisherpoint as fp

from .accuracy import ACCURACY_RULE, Errors, loosest_rtol, output_errors, root_mean_square, sensitivity_errors
from .covariances import DEFAULT_RTOL, TIGHT_RTOL, Contender, threads_text
from .scipy_peer import WAYS, solve_sensitivities
from .timing import best_times
from .workload import MODEL, OUTPUT_ROWS, Array, random_pairs


@dataclass(frozen=True)
class SensitivityFigures:
    """What `measure` finds; rates are experiments per second, errors those of dy/dtheta."""

    experiments: int
    sample: int
    ours: dict[int, Contender]
    peers: list[Contender]
    ratio: float
    output_errors: Errors
    reference_difference: float
    accurate: bool


def measure(quick: bool, threads: list[int]) -> SensitivityFigures:
    """Measure; the first number of threads is the one that the ratio is taken at."""
    pairs = random_pairs(1, seed=3)[::2] if quick else random_pairs(2, seed=3)
    tight = fp.sensitivities(MODEL, pairs.points, pairs.theta, rtol=TIGHT_RTOL)
    scales = root_mean_square(tight.dx_dtheta)
    scales[scales == 0] = 1.0
    y, dx_dtheta = solve_sensitivities(pairs, TIGHT_RTOL, True, scales, "DOP853")
    dy_dtheta = dx_dtheta[:, OUTPUT_ROWS]

    def errors_of(outputs: Array, slopes: Array) -> tuple[Errors, Errors]:
        return Errors.of(output_errors(outputs, y)), Errors.of(sensitivity_errors(slopes, dy_dtheta))

    def peer_errors(restart: bool, rtol: float) -> tuple[Errors, Errors]:
        outputs, slopes = solve_sensitivities(pairs, rtol, restart, scales)
        return errors_of(outputs, slopes[:, OUTPUT_ROWS])

    def accurate(errors: tuple[Errors, Errors]) -> bool:
        return all(map(ACCURACY_RULE.met_by, errors))

    def peer_rtol(restart: bool) -> float:
        return loosest_rtol(lambda rtol: accurate(peer_errors(restart, rtol)))

    rtols = {name: peer_rtol(restart) for name, restart in WAYS.items()}
    many = random_pairs(200 if quick else 1000, seed=4)
    tasks: dict[str, Any] = {
        f"{n}": partial(fp.sensitivities, MODEL, many.points, many.theta, threads=n, jumps="exclude") for n in threads
    }
    tasks |= {name: partial(solve_sensitivities, pairs, rtols[name], restart, scales) for name, restart in WAYS.items()}
    best = best_times(tasks, 2 if quick else 6)

    default = fp.sensitivities(MODEL, pairs.points, pairs.theta)
    of_outputs, of_slopes = errors_of(default.y, default.dy_dtheta)
    ours = {n: Contender.of(f"fisherpoint, {threads_text(n)}", DEFAULT_RTOL, len(many), best[f"{n}"], of_slopes) for n in threads}
    peers = [
        Contender.of(f"solve_ivp, {name}", rtols[name], len(pairs), best[name], peer_errors(restart, rtols[name])[1])
        for name, restart in WAYS.items()
    ]
    return SensitivityFigures(
        experiments=len(many),
        sample=len(pairs),
        ours=ours,
        peers=peers,
        ratio=ours[threads[0]].rate / max(peer.rate for peer in peers),
        output_errors=of_outputs,
        reference_difference=float(sensitivity_errors(tight.dy_dtheta, dy_dtheta).max()),
        accurate=accurate((of_outputs, of_slopes)),
    )
