"""A model as what JSON can hold, and back."""

from __future__ import annotations

from typing import Any

from ..basics.messages import shown
from .base import Model
from .hydraulic_cylinder import MODELS, HydraulicCylinder


def model_to_json(model: Model) -> dict[str, Any]:
    data: dict[str, Any] = {"name": model.name, "constants": dict(model.constants)}
    if not isinstance(model, HydraulicCylinder):
        return data | {"toml": model.to_toml()}
    return data | ({"smooth": dict(model.smooth)} if model.smooth else {})


def model_from_json(data: dict[str, Any]) -> Model:
    if "toml" in data:
        from .toml_to_model import model_from_toml

        return model_from_toml(data["toml"])
    if data["name"] not in MODELS:
        raise ValueError(f"model: expected one of {', '.join(MODELS)}, given {shown(data['name'])}")
    return MODELS[data["name"]](smooth=data.get("smooth"), **data["constants"])
