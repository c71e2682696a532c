"""Where identifiability is looked at by default: parameters near their mean, and a region in natural sizes."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress

import numpy as np

from ..basics.checks import check_names
from ..basics.quantity import names_of
from ..basics.values import Array
from ..models import Model
from ..points.region import ExperimentRegion
from ..prior.gaussian import GaussianPrior


def draw_theta(model: Model, prior: GaussianPrior | None, count: int, rng: np.random.Generator) -> Array:
    """Parameters (count, p): the mean, and others within one standard deviation of it; of nominal values, within 40 %.

    Raises
    ------
    ValueError
        Where there is neither prior nor nominal value, or hardly any draw makes sense to the model.
    """
    names = names_of(model.parameters)
    if prior is not None:
        check_names(prior.names, names, "prior")
        mean, std = (np.array([values[name] for name in names]) for values in (prior.mean, prior.std))
        log = np.array([name in prior.log for name in names])
    else:
        for name in names:
            if name not in model.nominal:
                raise ValueError(f"prior: expected a GaussianPrior, or nominal values of all parameters; given none of {name}")
        mean = np.array([model.nominal[name] for name in names])
        std, log = np.where(mean != 0, 0.4 * np.abs(mean), 1.0), np.zeros(len(names), dtype=bool)
    found, drawn, end = [model.theta(mean)], 0, 100 * count
    while len(found) < count:
        if drawn == end:
            raise ValueError(f"prior: expected parameters near the mean that {model.name} takes, given {len(found)} of {end} drawn")
        drawn += 1
        step = rng.uniform(-1, 1, len(names)) * std
        with suppress(ValueError):  # outside what the model takes
            found.append(model.theta(np.where(log, mean * np.exp(step / np.where(mean != 0, mean, 1.0)), mean + step)))
    return np.array(found)


def default_region(model: Model, theta: Array) -> ExperimentRegion:
    """A box in natural sizes: states and inputs of either sign where the model takes that, and durations to match.

    In its durations states change by about their natural size.
    """
    size = {q.name: q.scale or 1.0 for q in (*model.states, *model.inputs)}
    bounds = {name: (0.1 * one, one) for name, one in size.items()}
    both = [name for name, (low, high) in bounds.items() if len(_rates(model, bounds | {name: (-high, -low)}, theta))]
    bounds |= {name: (-size[name], size[name]) for name in both}
    if not model.states:
        return ExperimentRegion(bounds)
    fastest = np.abs(_rates(model, bounds, theta) / [size[q.name] for q in model.states]).max(axis=1)
    duration = 1 / float(np.median(fastest[fastest > 0])) if fastest.any() else 1.0
    return ExperimentRegion(bounds | {"dt": (0.1 * duration, duration)})


def _rates(model: Model, bounds: Mapping[str, tuple[float, float]], theta: Array) -> Array:
    """f (n, n_x) at those of 200 random points at which the model has a value."""
    dt = {"dt": (1.0, 1.0)} if model.states else {}
    sample = ExperimentRegion({**bounds, **dt}).draw(model, 200, seed=0)
    arguments = (sample.x0, sample.u, np.tile(theta, (len(sample), 1)))
    rates, output, limits = (function(*arguments) for function in (model.core.rhs, model.core.output, model.core.limits))
    inside = np.isfinite(rates).all(axis=1) & np.isfinite(output).all(axis=1) & (limits[:, len(model.poles) :] > 0).all(axis=1)
    return np.asarray(rates[inside], dtype=np.float64)
