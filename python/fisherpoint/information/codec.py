"""A design problem, and what points are worth for it, as what JSON can hold, and back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import numpy as np

from ..basics.checks import as_float, by_name, check_positive_int, names_among
from ..basics.quantity import Quantity
from ..basics.values import FrozenMapping
from ..models.codec import model_from_json, model_to_json
from ..points.codec import region_from_json, region_to_json
from ..points.status import Status
from ..prior.codec import prior_from_json, prior_to_json, rule_from_json, rule_to_json
from .evaluation import Evaluation
from .nearby import Nearby
from .problem import DERIVED, DesignProblem


def problem_to_json(problem: DesignProblem) -> dict[str, Any]:
    """A problem as JSON has it; functions among the constraints are not kept."""
    return {
        "model": model_to_json(problem.model),
        "prior": prior_to_json(problem.prior),
        "region": region_to_json(problem.region),
        "noise_std": None if problem.noise_std is None else dict(problem.noise_std),
        "rule": rule_to_json(problem.rule),
        "output_covariance": problem.output_covariance,
        "parameters": list(problem.estimated),
        "kinks": problem.kinks,
        "jumps": problem.jumps,
        "rtol": problem.rtol,
        "uncertain": None if problem.uncertain is None else dict(problem.uncertain),
        "varies": None if problem.varies is None else dict(problem.varies),
        "initial_state_std": None if problem.initial_state_std is None else dict(problem.initial_state_std),
        "assumed_covariance": problem.assumed_covariance,
        "along": None if problem.along is None else list(problem.along),
        "derived": list(problem.derived),
    }


def problem_from_json(data: dict[str, Any]) -> DesignProblem:
    """The problem with this JSON, to the last bit."""
    problem = DesignProblem(
        model_from_json(data["model"]),
        prior_from_json(data["prior"]),
        region_from_json(data["region"]),
        noise_std=data["noise_std"],
        rule=rule_from_json(data["rule"]),
        output_covariance=data["output_covariance"],
        parameters=data["parameters"],
        kinks=data["kinks"],
        jumps=data.get("jumps", "exclude"),  # as every problem was before files said it
        rtol=data["rtol"],
        uncertain=data.get("uncertain"),  # older files have none of these
        varies=data.get("varies"),
        initial_state_std=data.get("initial_state_std"),
        assumed_covariance=data.get("assumed_covariance", "tangents"),
        along=data.get("along"),
    )
    # Not derived anew here: a later version might do so in another way.
    object.__setattr__(problem, "derived", names_among(data.get("derived", ()), DERIVED, "derived"))
    return problem


def evaluation_to_json(evaluation: Evaluation | None) -> dict[str, Any] | None:
    if evaluation is None:
        return None
    data: dict[str, Any] = {}
    for field in fields(evaluation):
        value = getattr(evaluation, field.name)
        if isinstance(value, np.ndarray):
            value = value.tolist()
        elif field.name in ("without_prior", "rse") and value is not None:
            value = {name: number_to_json(error) for name, error in value.items()}
        elif isinstance(value, Mapping):
            value = dict(value)
        elif isinstance(value, Nearby):
            value = _nearby_to_json(value)
        elif field.name == "null_directions":
            value = [dict(direction) for direction in value]
        data[field.name] = number_to_json(value) if field.name == "log_det" else value
    return data


def evaluation_from_json(data: dict[str, Any] | None, n_points: int) -> Evaluation | None:
    """The evaluation with this JSON; older files lack some of its entries."""
    if data is None:
        return None
    data = {"n_points": n_points, "nearby": None, "units": {}, "log_det_estimable": None, "without_prior": None} | data
    values = {field.name: data[field.name] for field in fields(Evaluation)}
    values["n_points"] = check_positive_int(values["n_points"], "n_points")
    for name in ("parameters", "outputs", "outputs_left_out"):
        values[name] = tuple(values[name])
    for name in ("fisher", "output_covariance", "covariance", "correlation"):
        values[name] = None if values[name] is None else np.array(values[name], dtype=np.float64)
    for name in ("standard_errors", "prior_std"):
        values[name] = None if values[name] is None else FrozenMapping(dict(values[name]))
    for name in ("without_prior", "rse"):
        if values[name] is not None:
            errors = {one: np.inf if error is None else error for one, error in values[name].items()}
            values[name] = by_name(errors, values["parameters"], name, _error, complete=True)
    values["units"] = FrozenMapping({name: Quantity(name, unit).unit for name, unit in dict(values["units"]).items()})
    values["null_directions"] = tuple(FrozenMapping(dict(direction)) for direction in values["null_directions"])
    values["log_det"] = log_det_from_json(values["log_det"])
    values["nearby"] = values["nearby"] and _nearby_from_json(values["nearby"], values["parameters"], values["n_points"])
    return Evaluation(**values)


def _nearby_to_json(nearby: Nearby) -> dict[str, Any]:
    return {
        "growth": {name: number_to_json(growth) for name, growth in nearby.growth.items()},
        "parameters": dict(nearby.parameters),
        "points": list(nearby.points),
        "lost": dict(nearby.lost),
    }


def _nearby_from_json(data: dict[str, Any], parameters: tuple[str, ...], n_points: int) -> Nearby:
    growth = {name: np.inf if value is None else value for name, value in data["growth"].items()}
    return Nearby(
        by_name(growth, parameters, "growth", _error, complete=True),
        by_name(data["parameters"], parameters, "parameters", as_float, complete=True),
        tuple(check_positive_int(k, "points", 0, most=n_points - 1) for k in data["points"]),
        by_name(data["lost"], Status.__members__, "lost", check_positive_int),
    )


def _error(value: Any, name: str) -> float:
    return value if value == np.inf else as_float(value, name)


def number_to_json(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def log_det_from_json(value: float | None) -> float:
    return -np.inf if value is None else float(value)
