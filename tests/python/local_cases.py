"""Carts with loads of their own, and the joint fit of all of it by SciPy."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from scipy.optimize import least_squares

import fisherpoint as fp

NOISE, START = 0.01, {"d": 1.0, "c": 0.3, "m_load": 2.0}


@cache
def cart() -> fp.Model:
    """A cart with one friction law, and a load that differs from run to run."""

    @fp.model(states={"v": "m/s"}, inputs={"F": "N"}, parameters={"d": "N s/m", "c": "N", "m_load": "kg"}, outputs={"y": "m/s"})
    def cart(x: Any, u: Any, p: Any) -> Any:
        return [(u.F - p.d * x.v - p.c * fp.math.tanh(x.v / 0.05)) / (2.0 + p.m_load)], [x.v]

    return cart


def measured(
    count: int = 20, samples: int = 15, seed: int = 1, loads: tuple[float, float] = (1, 4), each: int = 1, **options: Any
) -> fp.Measurements:
    """Runs from rest, each so many with the same load."""
    rng = np.random.default_rng(seed)
    of_runs = fp.Runs(np.zeros((count, 1)), rng.uniform(1, 6, (count, samples)), np.full((count, samples), 0.2))
    of_each = np.repeat(rng.uniform(*loads, count // each), each)
    theta = np.column_stack([np.full(count, 1.5), np.full(count, 0.6), of_each])
    y = fp.simulate(cart(), of_runs, theta, rtol=1e-11).y
    return fp.Measurements(of_runs, y + NOISE * np.random.default_rng(seed + 1).standard_normal(y.shape), **options)


def joint_fit(data: fp.Measurements, of_run: np.ndarray, spread: float | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Estimates (2 + G,) and their standard errors by SciPy, of friction and of the load of each of G groups."""
    groups = int(of_run.max()) + 1

    def residuals(values: np.ndarray) -> np.ndarray:
        theta = np.column_stack([np.tile(values[:2], (len(data), 1)), values[2 + of_run]])
        found = ((fp.simulate(cart(), data.points, theta, rtol=1e-12).y - data.y) / NOISE).ravel()
        return found if spread is None else np.append(found, (values[2:] - START["m_load"]) / spread)

    tolerances = dict.fromkeys(("xtol", "ftol", "gtol"), 1e-15)
    start = np.append([START["d"], START["c"]], np.full(groups, START["m_load"]))
    found = least_squares(residuals, start, jac="3-point", x_scale="jac", **tolerances)
    _, triangle = np.linalg.qr(found.jac)
    return found.x, np.linalg.norm(np.linalg.inv(triangle), axis=1)
