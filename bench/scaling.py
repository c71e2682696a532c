"""How the cost grows: ``python -m bench scaling``.

With nodes R, candidates M, points L of a design, states n_x, parameters p, outputs n_y, points K at once, and threads. Seconds are
of the processor, but for those over threads, which are of the clock.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

import fisherpoint as fp
from fisherpoint.engine import _core
from fisherpoint.points.settings import resolve_threads

from .chains import Chain, diffusion, masses
from .timing import best_times, least_seconds
from .workload import MODEL, PRIOR, Array, candidates, random_pairs

AXES = 7
"""Parameters on the grid; the others stay at their means."""

MIXED = 12
"""Candidates of the smallest set, spread over all; larger sets repeat them, so that a candidate costs the same in each."""


BATCH = 256
"""Trajectories of chains in one call."""

STATES = (6, 12, 24, 50, 100, 200)
COUNTS = (1, 2, 5, 10, 20, 40)

CHAIN = 40
"""States of the chain of masses whose parameters and outputs are varied."""


@dataclass(frozen=True)
class Series:
    """Seconds against one quantity, and the exponent of a power law fitted to them; targets are bounds on the exponent."""

    quantity: str
    what: str
    values: list[int]
    seconds: list[float]
    exponent: float
    low: float | None
    high: float | None

    @property
    def met(self) -> bool:
        return (self.low is None or self.exponent >= self.low) and (self.high is None or self.exponent <= self.high)


def measure(quick: bool) -> list[Series]:
    """Measure all series, on one thread apart from the last."""
    rounds = 2 if quick else 7
    most_levels = 4 if quick else 6
    return [
        _series("R", "predictive covariances", _over_nodes(most_levels), rounds, 0.95, 1.05),
        _series("M", "predictive covariances", _over_candidates(), rounds, 0.95, 1.05),
        _series("L", "500 candidates beside L points", _over_points(), rounds, None, 0.1),
        _series("p", "500 candidates, p parameters", _over_parameters(), rounds, None, None),
        _series("n_x", "trajectories, masses", _over_states(masses, quick, False), rounds, None, None),
        _series("n_x", "sensitivities, masses", _over_states(masses, quick, True), rounds, None, None),
        _series("n_x", "trajectories, diffusion", _over_states(diffusion, quick, False), rounds, None, None),
        _series("n_x", "sensitivities, diffusion", _over_states(diffusion, quick, True), rounds, None, None),
        _series("p", "sensitivities, one output", _of_springs([(p, 1) for p in COUNTS]), rounds, None, None),
        _series("p", f"sensitivities, {CHAIN} outputs", _of_springs([(p, CHAIN) for p in COUNTS]), rounds, None, None),
        _series("n_y", f"sensitivities, {CHAIN} parameters", _of_springs([(CHAIN, n) for n in COUNTS]), rounds, None, None),
        _series("K", "sensitivities of K points", _over_batches(), rounds, None, None),
        _series("threads", "predictive covariances", _over_threads(), rounds, None, None, clock=True),
    ]


def _series(
    quantity: str,
    what: str,
    tasks: Mapping[int, Callable[[], object]],
    rounds: int,
    low: float | None,
    high: float | None,
    clock: bool = False,
) -> Series:
    named = {str(value): task for value, task in tasks.items()}
    of_clock = {name: timing.seconds for name, timing in best_times(named, rounds).items()} if clock else {}
    least = of_clock or least_seconds(named, rounds)
    seconds = [least[str(value)] for value in tasks]
    exponent = float(np.polyfit(np.log(list(tasks)), np.log(seconds), 1)[0]) if len(tasks) > 1 else float("nan")
    return Series(quantity, what, list(tasks), seconds, exponent, low, high)


def _covariances(points: fp.Experiments, levels: int, threads: int) -> None:
    rule = fp.TensorGrid({name: levels if i < AXES else 1 for i, name in enumerate(PRIOR.names)})
    result = fp.predictive_covariance(MODEL, points, PRIOR, rule, threads=threads, jumps="exclude")
    if result.status.any():
        raise RuntimeError(f"expected valid candidates, given status {result.status}")


def _mixed() -> NDArray[np.intp]:
    return np.arange(0, len(candidates()), len(candidates()) // MIXED)


def _over_nodes(most_levels: int) -> dict[int, Callable[[], object]]:
    """From 2187 nodes on; below that, what a point costs before its first node is seen."""
    points = candidates()[_mixed()]
    return {levels**AXES: partial(_covariances, points, levels, 1) for levels in range(3, most_levels + 1)}


def _over_candidates() -> dict[int, Callable[[], object]]:
    return {MIXED * n: partial(_covariances, candidates()[np.tile(_mixed(), n)], 3, 1) for n in (1, 2, 4, 8, 16)}


def _over_threads() -> dict[int, Callable[[], object]]:
    most = resolve_threads(None)
    counts = sorted({most, *(2**i for i in range(most.bit_length()))})
    return {n: partial(_covariances, candidates(), 3, n) for n in counts}


def _over_batches() -> dict[int, Callable[[], object]]:
    """From a point on its own, whose call costs more than it does, to packs that are always full."""
    pairs = random_pairs(105, seed=9)
    return {
        count: partial(fp.sensitivities, MODEL, pairs.points[:count], pairs.theta[:count], threads=1, jumps="exclude")
        for count in (1, 3, 50, 10000)
    }


def _over_states(kind: Callable[[int], Chain], quick: bool, sensitivities: bool) -> dict[int, Callable[[], object]]:
    """Chains with two parameters whose last state is measured, at the default tolerance."""
    return {n: _call(chain.model(), chain, sensitivities) for n in (STATES[:-1] if quick else STATES) for chain in [kind(n)]}


def _call(model: fp.SymbolicModel, chain: Chain, sensitivities: bool) -> Callable[[], object]:
    """A batch of trajectories of a chain; parameters are spread by 5 %."""
    theta = np.array([chain.theta[q.name] for q in model.parameters])
    spread = theta * (1 + 0.05 * np.random.default_rng(0).standard_normal((BATCH, len(theta))))
    function = fp.sensitivities if sensitivities else fp.simulate
    call = partial(function, model, chain.points(BATCH), spread, threads=1)
    if call().status.any():
        raise RuntimeError(f"expected trajectories of {chain.kind} with {len(chain.f)} states, given {call().status}")
    return call


def _of_springs(counts: Sequence[tuple[int, int]]) -> dict[int, Callable[[], object]]:
    """A chain of masses with springs and dampers of their own, so many of them parameters, and so many states measured.

    The key is whichever number is not the same for all.
    """
    chain = masses(CHAIN)
    f, theta = dict(chain.f), {}
    for kind in "kd":
        for i in range(1, CHAIN // 2 + 1):
            theta[f"{kind}{i}"] = chain.theta[kind]
    for i in range(1, CHAIN // 2 + 1):
        before = f"k{i}*(x{i - 1} - x{i}) + d{i}*(v{i - 1} - v{i})" if i > 1 else "-k1*x1 - d1*v1"
        behind = f" + k{i + 1}*(x{i + 1} - x{i}) + d{i + 1}*(v{i + 1} - v{i})" if i < CHAIN // 2 else " + 1"
        f[f"v{i}"] = before + behind
    own = chain._replace(f=f, theta=theta)
    order = [name for pair in zip(list(theta)[: CHAIN // 2], list(theta)[CHAIN // 2 :], strict=True) for name in pair]
    found: dict[int, Callable[[], object]] = {}
    for p, n_y in counts:
        whole = fp.SymbolicModel(
            list(f.values()),
            list(f)[-n_y:],
            {name: ("1", 1.0) for name in f},
            {},
            dict.fromkeys(order, "1"),
            check_units=False,
        )
        model = whole.fix(**{name: theta[name] for name in order[p:]}) if p < len(order) else whole
        found[p if len({of[0] for of in counts}) > 1 else n_y] = _call(model, own, True)
    return found


def _over_points() -> dict[int, Callable[[], object]]:
    return {count: _exchange_step(count, 9) for count in (10, 100, 1000, 10000)}


def _over_parameters() -> dict[int, Callable[[], object]]:
    return {p: _exchange_step(100, p) for p in (1, 2, 4, 6, 9)}


def _exchange_step(count: int, p: int) -> Callable[[], object]:
    """Return the evaluation of 50 candidates one at a time beside a design of `count` points, ten times over."""
    pairs = random_pairs(1, seed=8)
    result = fp.sensitivities(MODEL, pairs.points, pairs.theta)
    outputs = [0, 1, 2]  # x_v carries no sensitivity
    scaled = np.ascontiguousarray((result.dy_dtheta * np.array([PRIOR.std[name] for name in PRIOR.names]))[:, outputs, :p])
    scaled /= np.array([0.5, 1e7, 1e7])[:, None]
    covariance = np.einsum("kia,kja->kij", scaled, scaled)
    accumulator, rows = _core.FisherAccumulator(3, p), np.resize(np.arange(len(pairs)), count)
    accumulator.add(np.ascontiguousarray(scaled[rows]), np.ascontiguousarray(covariance[rows]))
    noise: Array = np.diag([1e-5, 2e-3, 2e-3]) ** 2
    return lambda: [accumulator.log_det_with(scaled[:50], covariance[:50], noise, True) for _ in range(10)]
