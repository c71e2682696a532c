"""A fit as JSON from which it can be built again, to the last bit of what is in it."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..basics.checks import (
    as_floats,
    as_floats_of_shape,
    as_numbers,
    as_positive,
    as_std,
    by_name,
    check_flag,
    check_positive_int,
    check_type,
    names_among,
)
from ..basics.files import entry
from ..basics.messages import listed, shown
from ..basics.quantity import names_of
from ..basics.stop_reason import StopReason
from ..basics.values import Array, finite_or_none
from ..data.measurements import Measurements
from ..data.record import Record
from ..models import Model
from ..models.codec import model_from_json, model_to_json
from ..points.codec import points_or_runs_from_json, points_to_json
from ..points.settings import resolve_threads
from ..prior.codec import prior_from_json, prior_to_json
from .nuisance import Nuisance, known_beforehand
from .observed import Observed, check_outputs
from .run_error import RunError
from .statistics import FitStatistics
from .unknowns import Unknowns, prior_factor
from .weighting import WeightedResiduals

BOUNDS = {"lower": -np.inf, "upper": np.inf}
"""Meaning of null in JSON."""

PLAIN = {"noise_known": bool, "evaluations": int, "starts": int, "reached": int}
"""Fields of a fit that JSON has as they are."""


def fit_state(fit: FitStatistics) -> dict[str, Any]:
    """All that is not computed from the rest; a TypeError for a model of functions, which no file can hold."""
    unknowns, names = fit.weighted.unknowns, names_of(fit.model.parameters)
    return {
        "model": model_to_json(fit.model),
        "data": [_data_to_json(part) for part in fit.data],
        "prior": None if fit.prior is None else prior_to_json(fit.prior),
        "prior_takes_part": fit.prior is not None and fit.weighted.prior_factor is not None,
        "uncertain": dict(fit.nuisance.uncertain),
        "shared_starts": dict(fit.nuisance.starts),
        "estimated": [name for name in unknowns.names if name in names and name not in fit.nuisance.uncertain],
        "theta": fit.theta.tolist(),
        "values": fit.values.tolist(),
        "rtol": fit.weighted.observed.rtol,
        "unknowns": {
            "center": unknowns.center.tolist(),
            "scale": unknowns.scale.tolist(),
            "log": unknowns.log.tolist(),
            **{side: finite_or_none(getattr(unknowns, side)) for side in BOUNDS},
        },
        "weights": fit.weighted.covariance.tolist(),
        "common": [{"first": error.first, "moved": error.moved.tolist()} for error in fit.weighted.common],
        "noise_covariance": fit.noise_covariance.tolist(),
        "stop_reason": fit.stop_reason,
        **{name: getattr(fit, name) for name in PLAIN},
    }


def fit_from_state(data: dict[str, Any]) -> dict[str, Any]:
    """Fields of the fit with this state; its trajectories are computed again."""
    with entry("model"):
        model = model_from_json(data["model"])
    with entry("data"):
        parts = tuple(_data_from_json(part) for part in data["data"])
        for part in parts:
            check_outputs(part, model)
    with entry("prior"):
        prior = None if data["prior"] is None else prior_from_json(data["prior"])
    n_y, names = len(model.outputs), names_of(model.parameters)
    theta = as_floats_of_shape(data["theta"], (len(names),), "theta")
    estimated = names_among(data["estimated"], names, "estimated")
    nuisance = _nuisance_from_json(data, model)
    joint = nuisance.of(model)
    unknown, full = (*estimated, *joint.nuisance_names), joint.theta(theta)
    observed = Observed(joint.model, parts, unknown, full, as_positive(data["rtol"], "rtol"), resolve_threads(None))
    values = as_floats(data["values"], "values")
    if values.shape != (len(observed.names),):
        raise ValueError(f"values: expected {len(observed.names)} unknowns, {listed(observed.names)}; given shape {values.shape}")
    unknowns = _unknowns_from_json(data["unknowns"], observed.names)
    with_prior = check_flag(data["prior_takes_part"], "prior_takes_part")
    factor = prior_factor(known_beforehand(prior if with_prior else None, joint, full), unknowns)
    common = tuple(_error_from_json(error, observed.y) for error in data.get("common", ()))
    weights = _covariances(data["weights"], "weights", n_y)
    if np.broadcast_shapes(weights.shape, (1, len(observed.y), n_y, n_y)) != (1, len(observed.y), n_y, n_y):
        raise ValueError(f"weights: expected covariances of {len(observed.y)} samples, given shape {weights.shape}")
    weighted = WeightedResiduals(observed, unknowns, observed.y[None], weights, factor, common)
    for name, kind in PLAIN.items():
        check_type(data[name], kind, name)
    response = observed.respond(values[None])
    return dict(
        model=model,
        data=parts,
        prior=prior,
        nuisance=nuisance,
        theta=theta,
        values=values,
        predicted=response.y[0],
        residuals=observed.y - response.y[0],
        noise_covariance=as_floats_of_shape(data["noise_covariance"], (n_y, n_y), "noise_covariance"),
        weighted=weighted,
        stop_reason=StopReason(data["stop_reason"]),
        **{name: data[name] for name in PLAIN},
    )


def _nuisance_from_json(data: dict[str, Any], model: Model) -> Nuisance:
    constants, parameters, states = map(names_of, (model.constant_quantities, model.parameters, model.states))
    return Nuisance(
        by_name(data["uncertain"], (*constants, *parameters), "uncertain", as_std),
        by_name(data["shared_starts"], states, "shared_starts", as_std),
    )


def _unknowns_from_json(of: dict[str, Any], names: tuple[str, ...]) -> Unknowns:
    count = (len(names),)
    center, scale = (as_floats_of_shape(of[name], count, f"unknowns: {name}") for name in ("center", "scale"))
    if not (scale > 0).all():
        raise ValueError(f"unknowns: scale: expected positive numbers, given {shown(of['scale'])}")
    log = np.array([check_flag(flag, "unknowns: log") for flag in of["log"]], dtype=bool)
    sides = {side: as_numbers(of[side], f"unknowns: {side}") for side in BOUNDS}  # of None it makes NaN
    for name, array in {"log": log, **sides}.items():
        if array.shape != count:
            raise ValueError(f"unknowns: {name}: expected {count[0]} entries, given shape {array.shape}")
    lower, upper = (np.where(np.isnan(sides[side]), none, sides[side]) for side, none in BOUNDS.items())
    return Unknowns(names, center, scale, log, lower, upper)


def _error_from_json(error: dict[str, Any], y: Array) -> RunError:
    moved = as_floats(error["moved"], "common: moved")
    first = check_positive_int(error["first"], "common: first", 0, len(y) - 1)
    if moved.ndim != 3 or moved.shape[1] != y.shape[1] or first + len(moved) > len(y):
        raise ValueError(f"common: moved: expected a part of {len(y)} samples of {y.shape[1]} outputs, given shape {moved.shape}")
    return RunError(first, moved)


def _covariances(given: Any, name: str, n_y: int) -> Array:
    """Covariances (..., n_y, n_y) of outputs, whose inverses exist."""
    covariance = as_floats(given, name)
    if covariance.shape[-2:] != (n_y, n_y) or covariance.ndim > 4:
        raise ValueError(f"{name}: expected shape (..., {n_y}, {n_y}), given {covariance.shape}")
    np.linalg.cholesky(covariance)
    return covariance


def _data_to_json(part: Any) -> dict[str, Any]:
    y = finite_or_none(part.y)
    if isinstance(part, Record):
        return {"t": part.t.tolist(), "u": part.u.tolist(), "y": y, "x0": dict(part.x0), "begin": part.begin}
    return points_to_json(part.points) | {"y": y}


def _data_from_json(data: dict[str, Any]) -> Measurements | Record:
    y = np.array(data["y"], dtype=np.float64)  # of None it makes NaN
    if "t" in data:
        return Record(_numbers(data["t"]), _numbers(data["u"]).reshape(len(y), -1), y, x0=data["x0"], begin=data["begin"])
    return Measurements(points_or_runs_from_json(data), y)


def _numbers(values: Any) -> Array:
    return np.array(values, dtype=np.float64)
