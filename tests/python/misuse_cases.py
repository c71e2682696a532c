"""Public functions with good arguments, and the kinds of clumsy ones that each may take."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import fisherpoint as fp
from misuse_case import Case
from misuse_designs import design_cases
from misuse_estimates import estimate_cases
from misuse_examples import NOISE, THETA, data, files, model, points, prior, problem, region
from misuse_models import model_cases
from misuse_points import point_cases


@cache
def cases() -> dict[str, Case]:
    """By name, as messages and the choice by a seed need it."""
    return point_cases() | model_cases() | design_cases() | estimate_cases()


SWAPPED: dict[str, Callable[[], Any]] = {
    "simulate": lambda: fp.simulate(points(), model(), THETA),  # type: ignore[arg-type]
    "simulate, theta first": lambda: fp.simulate(THETA, points(), model()),  # type: ignore[arg-type]
    "simulate, theta second": lambda: fp.simulate(model(), THETA, points()),  # type: ignore[arg-type]
    "predictive_covariance": lambda: fp.predictive_covariance(model(), prior(), points(), fp.Sobol(8)),  # type: ignore[arg-type]
    "rule and prior": lambda: fp.predictive_covariance(model(), points(), fp.Sobol(8), prior()),  # type: ignore[arg-type]
    "DesignProblem": lambda: fp.DesignProblem(prior(), model(), region()),  # type: ignore[arg-type]
    "region and prior": lambda: fp.DesignProblem(model(), region(), prior()),  # type: ignore[arg-type]
    "evaluate": lambda: fp.evaluate(points(), problem()),  # type: ignore[arg-type]
    "estimate": lambda: fp.estimate(data(), model()),  # type: ignore[arg-type]
    "estimate, prior second": lambda: fp.estimate(model(), prior(), data()),  # type: ignore[arg-type]
    "validate": lambda: fp.validate({"one": points()}, problem()),  # type: ignore[arg-type]
    "Measurements": lambda: fp.Measurements([0.1, 0.2, 0.3], points()),  # type: ignore[arg-type]
    "Experiments": lambda: fp.Experiments([0.1, 0.2], [[1.0], [2.0]], [0.1, 0.2]),
    "simulate_record": lambda: fp.simulate_record(THETA, [0.0, 1.0], [0.1, 0.1], model(), {"h": 1.0}),  # type: ignore[arg-type]
    "to_csv": lambda: data().to_csv(model(), files() / "x.csv"),  # type: ignore[arg-type]
    "from_csv": lambda: fp.Experiments.from_csv(model(), files() / "points.csv"),  # type: ignore[arg-type]
    "VirtualRig": lambda: fp.VirtualRig(THETA, model(), NOISE),  # type: ignore[arg-type]
    "identifiability": lambda: fp.identifiability(prior(), model()),  # type: ignore[arg-type]
    "exchange": lambda: fp.exchange(12, problem()),  # type: ignore[arg-type]
}
"""Calls with two arguments in each other's place."""
