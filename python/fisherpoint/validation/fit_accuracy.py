"""How accurate the fits of virtual experiments are: as those of `estimate`, but for large models, of which each takes seconds."""

from __future__ import annotations

from typing import NamedTuple

from ..estimation.least_squares import TOLERANCE
from ..models import Model

LARGE = 400
"""Derivatives of states by parameters, from which on a model is large."""


class FitAccuracy(NamedTuple):
    """Tolerance of the trajectories, and distance to the minimum, in standard errors, from which on a fit is solved."""

    rtol: float
    solved: float


EXACT = FitAccuracy(1e-9, TOLERANCE)

ENOUGH = FitAccuracy(1e-7, 1e-4)
"""The accuracy of fits of large models. The scatter of some hundred fits is known to a few hundredths of a standard
error. A fit takes half the time so: trajectories 40 % less, and it needs a sixth fewer of them."""


def accuracy_of(model: Model, unknowns: int) -> FitAccuracy:
    """The accuracy of fits of so many unknowns."""
    return ENOUGH if len(model.states) * unknowns >= LARGE else EXACT
