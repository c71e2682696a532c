"""``python -m bench pieces``: the 200 best windows of a log of a million samples; time, and memory in a process of its own."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import numpy as np

import fisherpoint as fp
from fisherpoint.noise.models import nominal_std

from . import fresh_process
from .memory import peak_memory

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"

STEP, LENGTH, PICKED = 1e-3, 50, 200


@dataclass(frozen=True)
class PieceFigures:
    """Of a choice: windows, seconds, MB at the peak and before, the least D-efficiency, and that against other choices."""

    samples: int
    every: int
    windows: int
    left_out: int
    seconds: float
    peak: float
    before: float
    efficiency: float
    share: float
    versus_spread: float
    versus_random: float


def measure(quick: bool) -> list[PieceFigures]:
    """Windows that share no sample, and ones that do."""
    samples = 100_000 if quick else 1_000_000
    return [PieceFigures(**fresh_process.call(__name__, picked.__name__, samples, every)) for every in (LENGTH, 10)]


def picked(samples: int, every: int) -> dict[str, float]:
    """The figures of one choice."""
    problem, record = motor_log(samples)
    before, begin = peak_memory(), perf_counter()
    pieces = fp.pieces(record, problem.model, length=LENGTH, every=every)
    design = fp.design_pieces(problem, pieces, PICKED)
    seconds = perf_counter() - begin
    return {
        "samples": samples,
        "every": every,
        "windows": len(pieces),
        "left_out": sum(design.left_out.values()),
        "seconds": seconds,
        "peak": peak_memory(),
        "before": before,
        "efficiency": design.efficiency or 0.0,
        "share": design.versus("all") or 0.0,
        "versus_spread": design.versus("spread") or 0.0,
        "versus_random": design.versus("random") or 0.0,
    }


def motor_log(samples: int, seed: int = 0) -> tuple[fp.DesignProblem, fp.Record]:
    """The DC motor of the examples at a steady speed that is set anew every few seconds, sampled each millisecond."""
    problem = fp.load_problem(EXAMPLES / "dc_motor.toml").replace(region=None, jumps="cross")
    rng = np.random.default_rng(seed)
    t = np.arange(samples, dtype=np.float64) * STEP
    changes = rng.random(samples) < STEP / 2.0
    changes[0] = True
    levels = rng.uniform(6.0, 24.0, samples)
    u = levels[np.maximum.accumulate(np.where(changes, np.arange(samples), 0))]
    start = {"i": 0.1, "w": float((u[0] - 0.23) / problem.prior.mean["K"])}
    y = fp.simulate_record(problem.model, t, u, problem.prior.mean, start).y
    noise = list(nominal_std(problem.noise).values())
    return problem, fp.Record(t, u, y + np.array(noise) * rng.standard_normal(y.shape))
