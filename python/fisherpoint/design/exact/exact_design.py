"""Whole numbers of measurements of candidates, with the proof of how good they are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ...basics.extras import needed_for
from ...basics.result_files import Kept
from ...information.problem_report import problem_sections
from ...show.display import Shown
from ...show.section import Report, Section
from .exact_counts import ExactCounts
from .exact_report import exact_report

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False, repr=False)
class ExactDesign(ExactCounts, Shown, Kept):
    """How often each of some candidates is measured, with the proof of how good that is; `ExactCounts` has its attributes."""

    def _check_content(self) -> None:
        _ = self.criterion

    def to_pandas(self) -> pd.DataFrame:
        """One row per point: its coordinates, SI units, and how often it is measured."""
        with needed_for("to_pandas"):
            from ..results.frames import points_frame

        return points_frame(self.problem.model, self.distinct).assign(count=self.counts)

    def _problem_sections(self) -> Sequence[Section]:
        return problem_sections(self.problem)

    def report(self) -> Report:
        """The points, the value, and what is proven about it."""
        return exact_report(self)
