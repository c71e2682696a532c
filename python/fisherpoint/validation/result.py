"""What `validate` found: per design and parameter, as a table and a picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..basics.extras import needed_for
from ..basics.result_files import Kept
from ..information.problem_report import problem_sections
from ..show.display import Plots, Shown
from ..show.section import Report, Section
from .figures import Figure
from .report import validation_report
from .truths import truths_of
from .validation_record import ValidatedDesigns
from .verdict import ParameterVerdict, verdicts_of

SHARES = ("coverage", "too_low", "too_high")

if TYPE_CHECKING:
    import matplotlib.figure
    import pandas as pd


@dataclass(frozen=True, eq=False, repr=False)
class Validation(ValidatedDesigns, Shown, Kept):
    """What `validate` found, shown as a table; `ValidatedDesigns` has its attributes."""

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
            for parameter, of in design.figures.items():
                row: dict[str, Any] = {"design": name, "parameter": parameter, "prior_std": of.prior_std, "promised": of.promised}
                for label in ("achieved", "ratio", "typical", "typical_ratio", "bias", "rmse", "claimed", *SHARES):
                    figure: Figure = getattr(of, label)
                    row |= {label: figure.value, f"{label}_mc": figure.error}
                counts = {"without_interval": of.without_interval, "at_bound": of.at_bound, "fits": design.fits}
                failed = {"failed": design.failed, "wrong_minima": design.wrong_minima}
                verdict, other = verdicts[name].get(parameter), "local" if parameter in design.local else "not determined"
                rows.append(row | counts | failed | {"verdict": other if verdict is None else verdict.outcome})
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

    def _problem_sections(self) -> Sequence[Section]:
        return problem_sections(self.problem)

    def _plots(self) -> Plots:
        return {"validation": self.plot}

    def report(self) -> Report:
        """Whether the promise holds, and one table per design."""
        return validation_report(self)
