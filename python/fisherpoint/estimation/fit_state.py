"""A fit as JSON from which it can be built again, to the last bit of what is in it."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..basics.messages import listed
from ..basics.quantity import names_of
from ..basics.values import Array, FrozenMapping, finite_or_none
from ..data.measurements import Measurements
from ..data.record import Record
from ..models.codec import model_from_json, model_to_json
from ..points.codec import points_from_json, points_to_json, runs_from_json, runs_to_json
from ..points.runs import Runs
from ..points.settings import resolve_threads
from ..prior.codec import prior_from_json, prior_to_json
from .nuisance import Nuisance, known_beforehand
from .observed import Observed
from .run_error import RunError
from .statistics import FitStatistics
from .unknowns import Unknowns, prior_factor
from .weighting import WeightedResiduals

BOUNDS = {"lower": -np.inf, "upper": np.inf}
"""What null stands for in JSON."""

PLAIN = {"noise_known": bool, "converged": bool, "message": str, "evaluations": int, "starts": int, "reached": int}
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
        **{name: getattr(fit, name) for name in PLAIN},
    }


def fit_from_state(data: dict[str, Any]) -> dict[str, Any]:
    """The fields of the fit of which this is the state; its trajectories are computed again."""
    model, parts = model_from_json(data["model"]), tuple(_data_from_json(part) for part in data["data"])
    prior = None if data["prior"] is None else prior_from_json(data["prior"])
    theta, values = _numbers(data["theta"]), _numbers(data["values"])
    nuisance = Nuisance(FrozenMapping(data.get("uncertain", {})), FrozenMapping(data.get("shared_starts", {})))
    joint = nuisance.of(model)
    estimated, full = (*data["estimated"], *joint.nuisance_names), joint.theta(theta)
    observed = Observed(joint.model, parts, estimated, full, data["rtol"], resolve_threads(None))
    of = data["unknowns"]
    lower, upper = (np.array([none if value is None else value for value in of[side]]) for side, none in BOUNDS.items())
    unknowns = Unknowns(observed.names, _numbers(of["center"]), _numbers(of["scale"]), np.array(of["log"], bool), lower, upper)
    if {len(array) for array in (values, unknowns.center, unknowns.scale, unknowns.log, lower, upper)} != {len(observed.names)}:
        raise ValueError(f"values: expected {len(observed.names)} unknowns, {listed(observed.names)}; given another number")
    factor = prior_factor(known_beforehand(prior if data["prior_takes_part"] else None, joint, full), unknowns)
    common = tuple(RunError(error["first"], _numbers(error["moved"])) for error in data.get("common", ()))
    weighted = WeightedResiduals(observed, unknowns, observed.y[None], _numbers(data["weights"]), factor, common)
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
        noise_covariance=_numbers(data["noise_covariance"]),
        weighted=weighted,
        **{name: kind(data[name]) for name, kind in PLAIN.items()},
    )


def _data_to_json(part: Any) -> dict[str, Any]:
    y = finite_or_none(part.y)
    if isinstance(part, Record):
        return {"t": part.t.tolist(), "u": part.u.tolist(), "y": y, "x0": dict(part.x0)}
    return (runs_to_json(part.points) if isinstance(part.points, Runs) else points_to_json(part.points)) | {"y": y}


def _data_from_json(data: dict[str, Any]) -> Measurements | Record:
    y = np.array(data["y"], dtype=np.float64)  # of None it makes NaN
    if "t" in data:
        return Record(_numbers(data["t"]), _numbers(data["u"]).reshape(len(y), -1), y, x0=data["x0"])
    return Measurements(runs_from_json(data) if "measured" in data else points_from_json(data), y)


def _numbers(values: Any) -> Array:
    return np.array(values, dtype=np.float64)
