"""A design of runs, as the search returns it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from ...basics.checks import as_path, check_choice
from ...basics.extras import needed_for
from ...basics.files import REPORTS, write_together
from ...basics.result_files import Kept
from ...engine.versions import versions
from ...information.problem_report import problem_sections
from ...points.run_files import plan_csv, runs_csv
from ...show.display import Plots, Shown
from ...show.section import Report, Section
from ..results.found_runs import FoundRuns
from ..results.settings_section import settings_section
from .run_picture_list import PICTURES, plots_of
from .run_report import run_report
from .run_tables import segments_table

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False, repr=False)
class RunDesign(FoundRuns, Shown, Kept):
    """The runs that `design_runs` found, with what is needed to judge and to repeat them; `FoundRuns` has its attributes."""

    def _check_content(self) -> None:
        _ = self.criterion

    def report(self) -> Report:
        """Runs, parameters, what plants can run them, and the search as tables."""
        return run_report(self)

    def _page_report(self) -> Report:
        report = self.report()
        return replace(report, sections=[*report.sections, segments_table(self.problem.model, self.runs)])

    def _problem_sections(self) -> Sequence[Section]:
        return [*problem_sections(self.problem), settings_section(self.settings)]

    def _plots(self) -> Plots:
        return plots_of(self.problem, self.runs, self.evaluation)

    def to_pandas(self) -> pd.DataFrame:
        """One row per parameter, as `Evaluation.to_pandas`."""
        return self.evaluation.to_pandas()

    def plot(self, kind: str = "runs", *, path: str | Path | None = None) -> Figure:
        """Draw the runs, or the information of each sample on each parameter; needs matplotlib.

        Parameters
        ----------
        kind : {"runs", "information", "standard_errors", "correlation"}
            Inputs, and outputs with their spread over the prior and their samples; the share of each sample in what is known of
            each parameter; and what `Evaluation.plot` draws.
        path : path, optional
            Where the picture is also written; the ending says the format, PNG where there is none.

        Raises
        ------
        ValueError
            For another kind, or the ending of no format of pictures.
        """
        with needed_for("plot"):
            from ...show.style import drawn

        plots = self._plots()
        return drawn(plots[check_choice(kind, tuple(plots), "kind")](), path)

    def save(self, directory: str | Path) -> None:
        """Write design.csv, plan.csv and design.json into `directory`, which is made where needed; design.json last.

        Of a design that was there before, the command line's report and pictures go.
        """
        directory, model = as_path(directory, "directory"), self.problem.model
        tables = {"design.csv": runs_csv(self.runs, model), "plan.csv": plan_csv(self.runs, model)}
        directory.mkdir(parents=True, exist_ok=True)
        write_together(directory, tables | {"design.json": self._file(versions=versions())}, stale=(*REPORTS, *PICTURES))

    @classmethod
    def load(cls, directory: str | Path) -> RunDesign:
        """Read a design that `save` wrote.

        Raises
        ------
        OSError
            Where design.json cannot be read.
        ValueError
            Where it is truncated, was changed, or is not a design of runs.
        """
        return super().load(as_path(directory, "directory") / "design.json")
