"""What `validate` found: per design and parameter, as a table and a picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

from ..basics.extras import needed_for
from ..basics.kept import Codec, Kept
from ..basics.values import FrozenMapping
from ..information.codec import problem_from_json, problem_to_json
from ..information.problem import DesignProblem
from ..information.problem_report import problem_sections
from ..models import Model
from ..models.codec import model_from_json, model_to_json
from ..points.codec import points_from_json, points_to_json, runs_from_json
from ..points.experiments import Experiments
from ..points.runs import Runs
from ..show.section import Report, Section
from ..show.shown import Plots, Shown
from .design_validation import DesignValidation
from .figures import Figure, ParameterFigures
from .fits import VirtualFits
from .report import validation_report
from .truths import truths_of
from .validated import ValidatedDesigns
from .verdict import ParameterVerdict, verdicts_of

SHARES = ("coverage", "too_low", "too_high")

if TYPE_CHECKING:
    import matplotlib.figure
    import pandas as pd


@dataclass(frozen=True, eq=False, repr=False)
class Validation(ValidatedDesigns, Shown, Kept):
    """What `validate` found; it shows itself as a table; `ValidatedDesigns` has its attributes."""

    FORMAT_VERSION = 3
    _RENAMED: ClassVar[Mapping[str, str]] = {"Runs": "VirtualFits"}
    _INSIDE = (DesignValidation, ParameterFigures, Figure, VirtualFits)
    _CODEC: ClassVar[Codec] = {
        DesignProblem: (problem_to_json, problem_from_json),
        Experiments: (points_to_json, points_from_json),
        Runs: (points_to_json, runs_from_json),
        Model: (model_to_json, model_from_json),
    }

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read what `save` wrote.

        Figures are taken anew of what each virtual experiment gave: in files of earlier versions, coverage left out what failed.

        Raises
        ------
        OSError
            Where the file cannot be read.
        ValueError
            Where it is truncated, was changed, or is of another format.
        """
        found = super().load(path)
        return replace(found, designs=FrozenMapping({name: design.again() for name, design in found.designs.items()}))

    def _check_content(self) -> None:
        truths_of(self.problem, self.theta, 1, 0)

    @property
    def verdicts(self) -> dict[str, dict[str, ParameterVerdict]]:
        """By design and parameter, whether the promise holds, is broken in which direction, or so few runs cannot decide."""
        return verdicts_of(self.designs)

    def to_pandas(self) -> pd.DataFrame:
        """All figures, one row per design and parameter; columns that end in "_mc" are Monte Carlo standard errors. SI units."""
        with needed_for("to_pandas"):
            import pandas as pd

        rows, verdicts = [], self.verdicts
        for name, design in self.designs.items():
            for parameter, of in design.parameters.items():
                row: dict[str, Any] = {"design": name, "parameter": parameter, "prior_std": of.prior_std, "promised": of.promised}
                for label in ("achieved", "ratio", "typical", "typical_ratio", "bias", "rmse", "claimed", *SHARES):
                    figure: Figure = getattr(of, label)
                    row |= {label: figure.value, f"{label}_mc": figure.error}
                counts = {"without_interval": of.without_interval, "at_bound": of.at_bound, "fits": design.fits}
                failed = {"failed": design.failed, "wrong_minima": design.wrong_minima}
                verdict = verdicts[name].get(parameter)
                rows.append(row | counts | failed | {"verdict": "not determined" if verdict is None else verdict.outcome})
        return pd.DataFrame(rows).set_index(["design", "parameter"])

    def plot(self, *, path: str | Path | None = None) -> matplotlib.figure.Figure:
        """Draw promised against achieved standard errors, and the coverage of the intervals, of every design; needs matplotlib.

        Parameters
        ----------
        path : path, optional
            Where the picture is also written; the ending says the format, PNG where there is none.

        Returns
        -------
        matplotlib.figure.Figure
        """
        with needed_for("plot"):
            from ..show.style import drawn
            from .pictures import plot_validation

        return drawn(plot_validation(self.designs), path)

    def _asked(self) -> Sequence[Section]:
        return problem_sections(self.problem)

    def _plots(self) -> Plots:
        return {"validation": self.plot}

    def report(self) -> Report:
        """Whether the promise holds, and one table per design."""
        return validation_report(self)
