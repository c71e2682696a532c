"""Plants as the prior has them: draws of parameters and uncertain constants, without those that make no sense to the model."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..basics.quantity import names_of
from ..basics.values import Array
from ..models import Model
from ..points.parameter_checks import sensible
from ..prior.coordinates import cholesky_coordinates
from .problem import DesignProblem

MOST_DRAWS = 100
"""Draws for each plant that is wanted, after which a prior counts as one without physical sense."""


def drawn_from_prior(problem: DesignProblem, count: int, rng: np.random.Generator) -> tuple[Array, int]:
    """Parameters (count, p) whose estimated ones follow the prior, and how many draws without physical sense were left out.

    Raises
    ------
    ValueError
        Where next to no draw makes sense to the model.
    """
    return _sensible_draws(problem.model, count, _of_prior(problem, rng))


def drawn_plants(problem: DesignProblem, count: int, rng: np.random.Generator, wider: float = 1.0) -> tuple[Array, int]:
    """Draw plants with their uncertain constants too: parameters (count, p) of `problem.assumed.model`, if there is one.

    What is drawn anew in each point or run does not deviate. With `wider` all else deviates so many times as far.
    """
    draw, assumed = _of_prior(problem, rng, wider), problem.assumed
    if assumed is None:
        return _sensible_draws(problem.model, count, draw)

    def of_assumed(count: int) -> Array:
        theta = assumed.theta(draw(count))
        theta[:, assumed.nuisance] += wider * assumed.nuisance_std * rng.standard_normal((count, len(assumed.nuisance)))
        return theta

    return _sensible_draws(assumed.model, count, of_assumed)


def _of_prior(problem: DesignProblem, rng: np.random.Generator, wider: float = 1.0) -> Callable[[int], Array]:
    coordinates = cholesky_coordinates(problem.prior, problem.estimated)
    names = names_of(problem.model.parameters)
    columns = [problem.prior.names.index(name) for name in names]
    return lambda count: coordinates.theta(wider * rng.standard_normal((count, len(names))))[:, columns]


def _sensible_draws(model: Model, count: int, draw: Callable[[int], Array]) -> tuple[Array, int]:
    found, drawn = np.empty((0, len(model.parameters))), 0
    while len(found) < count:
        if drawn > MOST_DRAWS * count:
            raise ValueError(f"prior: expected draws that make sense to {model.name}, given {len(found)} in {drawn}")
        theta = draw(count)
        drawn += count
        kept = theta[sensible(model, theta)]
        # Draws behind the last one that is wanted were not needed, and do not count.
        surplus = max(0, len(found) + len(kept) - count)
        drawn -= surplus
        found = np.concatenate([found, kept])[:count]
    return found, drawn - count
