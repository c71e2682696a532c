"""Trajectories that nearly any error changes: for these a tolerance means little."""

from __future__ import annotations

import warnings

import numpy as np

from ..basics.values import Array
from ..models import Model

GROWN = 1e6
"""Relative change of a state over that of a parameter, from which on errors of 1e-6 grow as large as the state."""


def warn_of_unstable(model: Model, theta: Array, x: Array, dx_dtheta: Array, stacklevel: int = 2) -> None:
    """Warn of the state that changes most with a parameter, where that is too much for tolerances to mean something.

    Parameters
    ----------
    model : Model
    theta : (p,) or (K, p)
    x : (K, ..., n_x)
    dx_dtheta : (K, ..., n_x, p)
    """
    if not dx_dtheta.size:
        return
    scales = np.array([quantity.scale or 1.0 for quantity in model.states])
    size = np.maximum(scales, np.abs(x).reshape(-1, len(scales)).max(axis=0))
    changes = np.atleast_2d(theta).reshape(-1, *(1,) * (dx_dtheta.ndim - 2), dx_dtheta.shape[-1])
    with np.errstate(over="ignore"):
        grown = (np.abs(dx_dtheta * changes) / size[:, np.newaxis]).reshape(-1, *dx_dtheta.shape[-2:]).max(axis=0)
    i, j = np.unravel_index(int(grown.argmax()), grown.shape)
    if grown[i, j] > GROWN:
        state, parameter = model.states[int(i)].name, model.parameters[int(j)].name
        warnings.warn(
            f"{state}: expected trajectories that small changes leave nearly as they are, found one that changes"
            f" {grown[i, j]:.1g} times as much as {parameter}: rtol holds for each step, and such errors grow until the end."
            " Shorter durations are more informative",
            RuntimeWarning,
            stacklevel=stacklevel + 1,
        )
