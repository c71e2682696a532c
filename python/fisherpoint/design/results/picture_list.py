"""Which pictures of evaluated points there are; each imports what it needs when it is drawn."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from ...show.display import Plots
from .evaluated_points import EvaluatedPoints

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PICTURES = ("criterion.png", "points.png", "standard_errors.png", "correlation.png", "trajectories.png")
"""What the command line may draw of a design; of points that are evaluated, all but the first."""


def plots_of(design: EvaluatedPoints) -> Plots:
    """The pictures of evaluated points that have something to show."""
    names = ["points"]
    if design.under_noise is not None:
        names.append("standard_errors")
    names.append("correlation")
    if design.problem.model.states:  # else nothing moves
        names.append("trajectories")
    return {name: partial(_drawn, name, design) for name in names}


def _drawn(name: str, design: EvaluatedPoints) -> Figure:
    from .pictures import PLOTS

    return PLOTS[name](design)
