"""A design as the search returns it."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...basics.checks import as_path
from ...basics.extras import needed_for
from ...basics.files import REPORTS, write_together
from ...basics.messages import printable
from ...basics.quantity import names_of
from ...basics.result_files import Kept
from ...basics.table import DataTable
from ...engine.versions import versions
from ...information.problem_report import problem_sections
from ...points.experiments import points_csv
from ...show.display import Plots, Shown
from ...show.section import Report, Section
from .found_design import FoundDesign
from .picture_list import PICTURES, plots_of
from .report import ROWS_OF_PAGES, design_report
from .settings_section import settings_section

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False, repr=False)
class Design(FoundDesign, Shown, Kept):
    """The points that `exchange` found, with everything needed to judge and to repeat them; `FoundDesign` has its attributes."""

    def _check_content(self) -> None:
        if self.drawn != self.accepted + sum(self.rejected.values()):
            raise ValueError(f"drawn: expected the sum of accepted and rejected, given {self.drawn}")
        if self.n_kept > len(self.points):
            raise ValueError(f"n_kept: expected at most {len(self.points)} points, given {self.n_kept}")
        _ = self.criterion  # raises where the settings of the criterion do not fit

    def report(self) -> Report:
        """Points, parameters, criterion, efficiency and search as tables."""
        return design_report(self)

    def _page_report(self) -> Report:
        return design_report(self, ROWS_OF_PAGES)

    def _problem_sections(self) -> Sequence[Section]:
        return [*problem_sections(self.problem), settings_section(self.settings)]

    def _plots(self) -> Plots:
        return {"criterion": partial(self.plot, "criterion"), **plots_of(self)}

    def plot(self, kind: str = "points", *, path: str | Path | None = None) -> Figure:
        """Draw the points, how they were found, or what they are worth; needs matplotlib.

        Parameters
        ----------
        kind : {"points", "criterion", "standard_errors", "correlation", "trajectories"}
            The points; log det F over the iterations; standard errors under the sensor noise next to the prior's; the correlation
            of the estimates; the outputs over time with their spread over the prior.
        path : path, optional
            Where the picture is also written; the ending says the format, PNG where there is none.

        Returns
        -------
        matplotlib.figure.Figure

        Raises
        ------
        ValueError
            For another kind, "standard_errors" where the sensor noise is not known, "trajectories" of a model without states, or
            the ending of no format of pictures.
        """
        with needed_for("plot"):
            from ...show.style import drawn
            from .pictures import plot_of

        return drawn(plot_of(self, kind), path)

    def to_pandas(self) -> pd.DataFrame:
        """One row per parameter: unit, mean, prior_std, and under the sensor noise standard_error, rse and of_prior."""
        with needed_for("to_pandas"):
            from .frames import parameter_frame

        return parameter_frame(self.problem, self.under_noise)

    def save(self, directory: str | Path) -> None:
        """Write design.csv and design.json into `directory`, which is made where needed.

        Each appears whole or not at all, and design.json last: where it stands, what is beside it belongs to it. Of a design that
        was there before, the command line's report and pictures go.
        """
        directory = as_path(directory, "directory")
        contents = {"design.csv": points_csv(self.points, self.problem.model), "design.json": self._file(versions=versions())}
        directory.mkdir(parents=True, exist_ok=True)
        write_together(directory, contents, stale=(*REPORTS, *PICTURES))

    @classmethod
    def load(cls, directory: str | Path) -> Design:
        """Read a design that `save` wrote, from its design.json; warn where design.csv beside it has other points.

        Raises
        ------
        OSError
            Where design.json cannot be read.
        ValueError
            Where it is truncated, was changed, or is not a design of this format.
        """
        path = as_path(directory, "directory") / "design.json"
        design = super().load(path)
        table = path.with_name("design.csv")
        if table.exists() and not _has_points_of(design, table):
            warnings.warn(
                f"{printable(table)}: expected the points of design.json, given others: it was changed since or is of another run; "
                "the points of design.json count",
                stacklevel=2,
            )
        return design


def _has_points_of(design: FoundDesign, path: Path) -> bool:
    """Whether a table has a design's points, whatever columns were filled in and to as many digits as spreadsheets keep."""
    axes = design.problem.model.axes
    try:
        table = DataTable(path)
        table.read_decimal_commas(names_of(axes))
        points = np.column_stack([table.complete(quantity) for quantity in axes])
    except (OSError, ValueError, KeyError):
        return False
    own = design.points.table[:, : len(axes)]
    return points.shape == own.shape and np.allclose(points, own, rtol=1e-12, atol=0.0)
