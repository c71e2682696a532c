"""Pictures of a fit; each imports what it needs when it is drawn."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

from ..data.record import Record
from ..show.display import Plots

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .profile_curve import ProfileCurve
    from .statistics import FitStatistics

KINDS = ("parity", "residuals", "time", "autocorrelation", "correlation", "ellipses", "local", "profiles")

PICTURES = tuple(f"{kind}.png" for kind in KINDS)
"""Pictures of a fit that the command line may draw."""


def plots_of(fit: FitStatistics, profiles: Sequence[ProfileCurve] = ()) -> Plots:
    """The pictures that have something to show, with the profile likelihoods that were computed."""
    names = ["parity", "residuals"]
    if any(isinstance(part, Record) or part.points.kind == "run" for part in fit.data):
        names.append("time")
    if any(len(check.autocorrelation.values) for check in fit.residual_checks.values()):
        names.append("autocorrelation")
    if len(fit.common) > 1:
        names += ["correlation", "ellipses"]
    if fit.local:
        names.append("local")
    plots = {name: partial(_drawn, name, fit) for name in names}
    return {**plots, "profiles": partial(_profiles, profiles)} if profiles else plots


def _drawn(name: str, fit: FitStatistics) -> Figure:
    from .pictures import PLOTS

    return PLOTS[name](fit)


def _profiles(profiles: Sequence[ProfileCurve]) -> Figure:
    from .pictures import plot_profiles

    return plot_profiles(profiles)
