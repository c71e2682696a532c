"""Whole designs of the default cylinder: seconds, candidates per second, and the share of the core in the time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter, process_time
from typing import Any

import fisherpoint as fp
from fisherpoint.engine import _core
from fisherpoint.engine.levels import kernels
from fisherpoint.prior.rules import Rule

RELATIVE_STD = dict(a_tau=0.3, b_tau=0.2, m_q=0.05, E_oil=0.2, p_t=0.2, B_v=0.1, c_L=0.3, V_0A=0.1, V_0B=0.1)
REGION = fp.ExperimentRegion(
    dict(q=(0.03, 0.27), v=(-0.25, 0.25), p_A=(2e6, 19e6), p_B=(2e6, 19e6), x_v=(-1, 1), u=(-1, 1), dt=(1e-3, 1e-2))
)
NOISE_STD = dict(q=5e-6, p_A=2e4, p_B=2e4, x_v=1e-3)

KERNELS = ("simulate", "sensitivities", "predictive_covariance")
ACCUMULATOR = ("add", "remove", "fisher", "log_det_with", "log_det_without", "output_covariance")


@dataclass(frozen=True)
class DesignFigures:
    """One search: what it was, how long it took, and the shares of the trajectories and of the Fisher accumulator in that."""

    name: str
    threads: int
    iterations: int
    seconds: float
    cores: float
    candidates_per_second: float | None
    share_of_trajectories: float
    share_of_accumulator: float
    log_det: float


@contextmanager
def timed_calls(owner: Any, names: tuple[str, ...]) -> Iterator[list[float]]:
    """Yield a list of one number, which grows by the seconds that calls of the named functions of `owner` take."""
    total, originals = [0.0], {name: getattr(owner, name) for name in names}

    def timed(function: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any, **named: Any) -> Any:
            begin = perf_counter()
            try:
                return function(*arguments, **named)
            finally:
                total[0] += perf_counter() - begin

        return call

    for name, original in originals.items():
        setattr(owner, name, timed(original))
    try:
        yield total
    finally:
        for name, original in originals.items():
            setattr(owner, name, original)


CASES = {
    "D = R": ("noise", False, None),
    "D = R, with references": ("noise", True, None),
    "pooled": ("pooled", False, None),
    "pooled, the paper's grid": ("pooled", False, fp.TensorGrid()),
}
"""Output covariance, whether the report's references are searched for too, and the rule where it is not the default."""


def default_problem(output_covariance: str, rule: Rule | None = None) -> fp.DesignProblem:
    """The default cylinder with its sensors, without points that meet a jump, as it has always been measured."""
    model = fp.HydraulicCylinder()
    prior = fp.GaussianPrior(mean=model.nominal, relative_std=RELATIVE_STD)
    problem = fp.DesignProblem(model, prior, REGION, noise=NOISE_STD, output_covariance=output_covariance, jumps="exclude")
    return problem if rule is None else problem.replace(rule=rule)


def measure(quick: bool, threads: list[int]) -> list[DesignFigures]:
    """Search with the sensor noise known, without and with the designs that the report compares it to, and in the paper's form."""
    best: dict[tuple[str, int], DesignFigures] = {}
    for _ in range(1 if quick else 3):
        for name in CASES:
            for n in threads:
                figures = _search(name, 20 if quick else 200, n)
                if (name, n) not in best or figures.seconds < best[name, n].seconds:
                    best[name, n] = figures
    return [best[name, n] for name in CASES for n in threads]


def _search(name: str, iterations: int, threads: int) -> DesignFigures:
    output_covariance, references, rule = CASES[name]
    problem = default_problem(output_covariance, rule)
    with timed_calls(kernels, KERNELS) as trajectories, timed_calls(_core.FisherAccumulator, ACCUMULATOR) as accumulator:
        begin, used = perf_counter(), process_time()
        design = fp.exchange(
            problem, max_iterations=iterations, threads=threads, method=fp.ExchangeMethod("paper", references=references)
        )
        seconds, cores = perf_counter() - begin, process_time() - used
    return DesignFigures(
        name=name,
        threads=threads,
        iterations=iterations,
        seconds=seconds,
        cores=cores / seconds,
        candidates_per_second=None if references else design.accepted / seconds,  # the references draw more, uncounted
        share_of_trajectories=trajectories[0] / seconds,
        share_of_accumulator=accumulator[0] / seconds,
        log_det=design.evaluation.log_det,
    )
