"""Whole designs of the default cylinder: seconds, candidates per second, and how much of the time is the core's."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import perf_counter
from typing import Any

import fisherpoint as fp
from fisherpoint.kernels import kernels

RELATIVE_STD = dict(a_tau=0.3, b_tau=0.2, m_q=0.05, E_oil=0.2, p_t=0.2, B_v=0.1, c_L=0.3, V_0A=0.1, V_0B=0.1)
REGION = dict(q=(0.03, 0.27), v=(-0.25, 0.25), p_A=(2e6, 19e6), p_B=(2e6, 19e6), x_v=(-1, 1), u=(-1, 1), dt=(1e-3, 1e-2))
NOISE = dict(q=5e-6, p_A=2e4, p_B=2e4, x_v=1e-3)


@contextmanager
def core_seconds() -> Iterator[list[float]]:
    """A list of one number that grows by the seconds that kernels take."""
    total, originals = [0.0], {name: getattr(kernels, name) for name in ("sensitivities", "predictive_covariance")}

    def timed(kernel: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any) -> Any:
            begin = perf_counter()
            try:
                return kernel(*arguments)
            finally:
                total[0] += perf_counter() - begin

        return call

    for name, kernel in originals.items():
        setattr(kernels, name, timed(kernel))
    try:
        yield total
    finally:
        for name, kernel in originals.items():
            setattr(kernels, name, kernel)


def measure(quick: bool, threads: list[int]) -> list[dict[str, Any]]:
    model = fp.HydraulicCylinder()
    prior = fp.GaussianPrior(mean=model.nominal, relative_std=RELATIVE_STD)
    rows = []
    for kind, iterations in (("noise", 20 if quick else 200), ("pooled", 3 if quick else 30)):
        problem = fp.DesignProblem(model, prior, fp.ExperimentRegion(REGION), noise_std=NOISE, output_covariance=kind)
        for n in threads:
            with core_seconds() as core:
                begin = perf_counter()
                design = fp.exchange(problem, max_iterations=iterations, threads=n, references=False)
                seconds = perf_counter() - begin
            rows.append(
                {
                    "output covariance": kind,
                    "threads": n,
                    "iterations": iterations,
                    "seconds": seconds,
                    "candidates per second": design.accepted / seconds,
                    "share of the core": core[0] / seconds,
                    "log det": design.evaluation.log_det,
                }
            )
    return rows
