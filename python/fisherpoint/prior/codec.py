"""A prior and a rule as what JSON can hold, and back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from ..basics.messages import shown
from .gaussian import GaussianPrior
from .rules import RULES, Rule


def prior_to_json(prior: GaussianPrior) -> dict[str, Any]:
    return {
        "mean": dict(prior.mean),
        "std": dict(prior.std),
        "covariance": prior.covariance.tolist() if prior.correlated else None,
        "log": list(prior.log),
    }


def prior_from_json(data: dict[str, Any]) -> GaussianPrior:
    covariance = data.get("covariance")
    return GaussianPrior(data["mean"], data["std"] if covariance is None else None, covariance=covariance, log=data.get("log", ()))


def rule_to_json(rule: Rule) -> dict[str, Any]:
    kind = next(name for name, of_kind in RULES.items() if type(rule) is of_kind)
    given = {field.name: getattr(rule, field.name) for field in fields(rule)}
    return {"kind": kind} | {name: dict(value) if isinstance(value, Mapping) else value for name, value in given.items()}


def rule_from_json(data: dict[str, Any]) -> Rule:
    arguments = dict(data)
    kind = arguments.pop("kind", "tensor_grid")  # the only one that there was when files did not say which
    if kind not in RULES:
        raise ValueError(f"rule: expected one of {', '.join(RULES)}, given {shown(kind)}")
    return RULES[kind](**arguments)
