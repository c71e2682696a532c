"""``python -m bench.odeint_order``: public calls next to Boost.odeint on packs, experiments in random order, by processor time.

A pack of odeint's has one step size for its lanes. The task of `peers` has every candidate many times, and sorting fills packs with
copies of one trajectory. Here the order is random, and the peer takes experiments as they come, or sorts them by duration.
Experiments are those of the task, or distinct ones, as the candidates of a design are. Each side is at its loosest tolerance with
99 % of the errors of y, and of dy/dtheta, below 1e-6.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from time import process_time

import numpy as np

import fisherpoint as fp

from . import machine
from .accuracy import output_errors, sensitivity_errors
from .covariances import TIGHT_RTOL
from .peers.boost_odeint import Odeint
from .peers.compare import neighbours, one_core
from .peers.ours import Fisherpoint
from .peers.peer import Solution
from .workload import MODEL, PRIOR, REGION, RULE, Pairs, random_pairs

ROUNDS = 7
LEAST = 0.25
"""Processor time of one measurement, s."""

Solve = Callable[[float], Solution]
Work = tuple[int, Callable[[], object]]
"""How many trajectories are made, and the call that makes them."""


def shuffled() -> Pairs:
    """Every candidate 64 times."""
    pairs = random_pairs(64, seed=3)
    order = np.random.default_rng(11).permutation(len(pairs))
    return Pairs(pairs.points[order], pairs.theta[order], pairs.nodes[order])


def distinct() -> Pairs:
    """As many points of the region, no two alike, each with a node of the grid."""
    drawn, nodes = REGION.draw(MODEL, 40_000, seed=5), RULE.nodes(PRIOR)[0]
    chosen = np.random.default_rng(12).integers(len(nodes), size=len(drawn))
    ok = np.flatnonzero(fp.sensitivities(MODEL, drawn, nodes[chosen], jumps="exclude").status == fp.Status.ok)[:6144]
    return Pairs(drawn[ok], nodes[chosen[ok]], chosen[ok])


def public(pairs: Pairs, rtol: float) -> Solution:
    """Return y and dy/dtheta as a user has them."""
    done = fp.sensitivities(MODEL, pairs.points, pairs.theta, rtol=rtol, jumps="exclude", threads=1)
    return Solution(done.y, done.dy_dtheta)


def loosest(solve: Solve, reference: Solution) -> float:
    """Return the largest of 10^(-k/8) that meets the rule."""
    for k in range(36, 88):
        rtol = float(10 ** (-k / 8))
        found = solve(rtol)
        errors = [output_errors(found.y, reference.y)]
        if found.dy_dtheta is not None and reference.dy_dtheta is not None:
            errors.append(sensitivity_errors(found.dy_dtheta, reference.dy_dtheta))
        if all(np.quantile(one, 0.99) < 1e-6 for one in errors):
            return rtol
    raise RuntimeError("expected a tolerance above 1e-11 with 99 % of the errors below 1e-6, found none")


def states() -> dict[str, Work]:
    """W1: predictive covariances, and the peer's outputs alone."""
    pairs = neighbours(9, seed=1)
    reference = Solution(fp.simulate(MODEL, pairs.points, pairs.theta, rtol=TIGHT_RTOL).y)
    both = {"fisherpoint": Fisherpoint(), "odeint": Odeint("Boost.odeint on packs", "packs")}
    return {f"W1 {name}": peer.states_task(pairs, loosest(partial(peer.outputs, pairs), reference)) for name, peer in both.items()}


def sensitivities(what: str, pairs: Pairs) -> dict[str, Work]:
    """W2."""
    reference = public(pairs, TIGHT_RTOL)
    solvers: dict[str, Solve] = {
        "fisherpoint": partial(public, pairs),
        "odeint, as they come": partial(Odeint("Boost.odeint", "packs_as_given").sensitivities, pairs),
        "odeint, by duration": partial(Odeint("Boost.odeint", "packs").sensitivities, pairs),
    }
    return {f"W2 {what}, {name}": (len(pairs), partial(solve, loosest(solve, reference))) for name, solve in solvers.items()}


def rate(count: int, work: Callable[[], object]) -> float:
    """Trajectories per second of processor time."""
    calls, begin = 0, process_time()
    while process_time() - begin < LEAST:
        work()
        calls += 1
    return count * calls / (process_time() - begin)


def main() -> None:
    """Measure in turn and print medians, ranges, and the ratios of each round to ours."""
    print(machine.describe())
    with one_core():
        works = states() | sensitivities("candidates", shuffled()) | sensitivities("distinct", distinct())
        rates = {name: np.empty(ROUNDS) for name in works}
        for k in range(ROUNDS):
            for name, work in works.items():
                rates[name][k] = rate(*work)
    for name, found in rates.items():
        ours = rates[name.rsplit("odeint", 1)[0] + "fisherpoint"] if "odeint" in name else found
        ratio = ours / found
        print(
            f"{name:40} {np.median(found):12,.0f} ({found.min():,.0f} to {found.max():,.0f})"
            f"  ours {np.median(ratio):.2f} times ({ratio.min():.2f} to {ratio.max():.2f})"
        )


if __name__ == "__main__":
    main()
