"""Data to fit: an exponential decay, and the default cylinder."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import fisherpoint as fp
from fisherpoint.design.file.configuration import load_config

EXAMPLES = Path(__file__).parents[2] / "examples"


def decay(n: int = 12, noise: float = 0.2, seed: int = 0) -> tuple[Any, fp.Measurements]:
    model = load_config(EXAMPLES / "exponential_decay.toml").build_model()
    dt = np.linspace(100.0, 6000.0, n)
    y = 20.0 * np.exp(-5e-4 * dt) + np.random.default_rng(seed).normal(0.0, noise, n)
    return model, fp.Measurements(fp.Experiments(np.ones((n, 1)), np.zeros((n, 0)), dt), y)


@cache
def cylinder(T_1: float = 2.2e-3) -> tuple[fp.DesignProblem, fp.Measurements]:
    """Twelve points of the default cylinder, measured; the model that is fitted has the given T_1."""
    problem = load_config(EXAMPLES / "cylinder.toml").problem()
    design = fp.exchange(
        problem, n_experiments=12, n_candidates=30, max_iterations=5, seed=1, method=fp.ExchangeMethod(references=False)
    )
    data = fp.VirtualRig(problem.model, dict(problem.prior.mean), problem.noise, seed=2).measure(design.points)
    model = fp.HydraulicCylinder(T_1=T_1)
    return fp.DesignProblem(model, problem.prior, None, noise=problem.noise), data
