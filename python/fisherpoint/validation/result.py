"""What `validate` found: per design and parameter, as a table and a picture."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..experiments import Experiments
from ..extras import needed_for
from ..models import Model
from ..problem import DesignProblem
from .figures import Figure, ParameterFigures
from .fits import Runs

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False)
class DesignValidation:
    """What the runs of one design gave.

    Attributes
    ----------
    points : Experiments
    parameters : mapping of parameter name to ParameterFigures
    fits : int
        That did not fail: all figures are of these.
    failures : mapping of reason to int
    null_directions : tuple of str
        Changes of the parameters that the points do not notice at the prior mean.
    runs : Runs or None
        Truths, estimates and standard errors of every run; None where the points determine no parameter, and nothing was fitted.
    """

    points: Experiments
    parameters: Mapping[str, ParameterFigures]
    fits: int
    failures: Mapping[str, int]
    null_directions: tuple[str, ...]
    runs: Runs | None

    @property
    def rmse(self) -> float:
        """Geometric mean over the parameters of the root mean square error over the prior std; NaN where one has none."""
        return float(np.exp(np.mean(np.log([figures.rmse.value for figures in self.parameters.values()]))))


@dataclass(frozen=True, eq=False, repr=False)
class Validation:
    """What `validate` found; it shows itself as a table.

    Attributes
    ----------
    problem : DesignProblem
    designs : mapping of name to DesignValidation
    noise_std : mapping of output name to float
        Of the outputs that were measured.
    n : int
        Runs of each design.
    theta : "prior", "mean" or mapping of parameter name to float
    seed : int
    redrawn : int
        Draws from the prior that were left out because they make no sense to the model.
    truth : Model or None
        That made the data in the place of the problem's model.
    noise : {"known", "estimated"}
    use_prior : bool
    seconds : float
    """

    problem: DesignProblem
    designs: Mapping[str, DesignValidation]
    noise_std: Mapping[str, float]
    n: int
    theta: str | Mapping[str, float]
    seed: int
    redrawn: int
    truth: Model | None
    noise: str
    use_prior: bool
    seconds: float

    def frame(self) -> pd.DataFrame:
        """All figures, one row per design and parameter; columns that end in "_mc" are Monte Carlo standard errors. SI units."""
        with needed_for("frame"):
            import pandas as pd

        rows = []
        for name, design in self.designs.items():
            for parameter, of in design.parameters.items():
                row: dict[str, Any] = {"design": name, "parameter": parameter, "prior_std": of.prior_std, "promised": of.promised}
                for label in ("achieved", "ratio", "typical", "typical_ratio", "bias", "rmse", "claimed", "coverage"):
                    figure: Figure = getattr(of, label)
                    row |= {label: figure.value, f"{label}_mc": figure.error}
                rows.append(row | {"at_bound": of.at_bound, "fits": design.fits, "failed": sum(design.failures.values())})
        return pd.DataFrame(rows).set_index(["design", "parameter"])

    def plot(self, path: str | Path) -> None:
        """Draw promised against achieved standard errors and the coverage of every design; the ending says the format."""
        with needed_for("plot"):
            from ..plot_style import save_figure
            from ..plots_validation import plot_validation

        save_figure(plot_validation(self), path)

    def __str__(self) -> str:
        from .table import text

        return text(self)

    __repr__ = __str__
