"""The accuracy of fits to virtual data: that of `estimate`, and less for large models, where a fit takes seconds."""

from __future__ import annotations

from typing import NamedTuple

from ..estimation.least_squares import TOLERANCE
from ..models import Model

LARGE = 400
"""Derivatives of states by parameters from which on a model is large, as in the engine (stepwise_columns.hpp)."""


class FitAccuracy(NamedTuple):
    """How accurate fits are.

    Attributes
    ----------
    rtol : float
        Tolerance of the trajectories.
    solved : float
        Distance to the minimum, in standard errors, from which on a fit counts as solved.
    """

    rtol: float
    solved: float


EXACT = FitAccuracy(1e-9, TOLERANCE)

ENOUGH = FitAccuracy(1e-7, 1e-4)
"""The accuracy of fits of large models. The scatter of some hundred fits is known to a few hundredths of a standard
error. A fit takes half the time so: trajectories 40 % less, and it needs a sixth fewer of them."""


def accuracy_of(model: Model, unknowns: int) -> FitAccuracy:
    """The accuracy of fits of so many unknowns."""
    return ENOUGH if len(model.states) * unknowns >= LARGE else EXACT
