"""What the virtual experiments of one design gave."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..points.experiments import Experiments
from ..points.runs import Runs
from ..show.numbers import counted
from .figures import ParameterFigures
from .fits import VirtualFits


@dataclass(frozen=True, eq=False)
class DesignValidation:
    """What the virtual experiments of one design gave.

    Attributes
    ----------
    points : Experiments or Runs
    parameters : mapping of parameter name to ParameterFigures
    fits : int
        That did not fail: all figures are of these.
    failures : mapping of reason to int
    null_directions : tuple of str
        Changes of the parameters that the points do not notice at the prior mean.
    per_run : VirtualFits or None
        Truths, estimates and standard errors of every virtual experiment; None where the points determine no parameter, and nothing
        was fitted.
    """

    points: Experiments | Runs
    parameters: Mapping[str, ParameterFigures]
    fits: int
    failures: Mapping[str, int]
    null_directions: tuple[str, ...]
    per_run: VirtualFits | None

    @property
    def size(self) -> str:
        """How many points there are, or runs and samples."""
        if isinstance(self.points, Runs):
            return f"{counted(len(self.points), 'run')} of {counted(int(self.points.measured.sum()), 'sample')}"
        return f"{len(self.points)} points"

    @property
    def rmse(self) -> float:
        """Geometric mean over the parameters of the root mean square error over the prior std; NaN where one has none."""
        return float(np.exp(np.mean(np.log([figures.rmse.value for figures in self.parameters.values()]))))
