"""Whether parameters make sense to a model."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..basics.values import Array
from ..models import Model


def sensible(model: Model, theta: Array) -> NDArray[np.bool_]:
    """Whether each set of parameters (B, p) makes sense to the model."""
    finite = np.asarray(np.isfinite(theta).all(axis=1))
    if not len(theta) or (finite.all() and _makes_sense(model, theta)):
        return finite
    return np.array([ok and _makes_sense(model, row[None]) for ok, row in zip(finite, theta, strict=True)], dtype=bool)


def _makes_sense(model: Model, theta: Array) -> bool:
    try:
        model._check_theta(theta)
    except ValueError:
        return False
    return True
