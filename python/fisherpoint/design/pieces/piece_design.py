"""Windows of a record that were picked, as the search returns them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...basics.extras import needed_for
from ...basics.result_files import Kept
from ...data.measurements import Measurements
from ...information.problem_report import problem_sections
from ...points.runs import Runs
from ...show.display import Plots, Shown
from ...show.section import Report, Section
from .picked_windows import PickedWindows
from .piece_report import piece_report

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False, repr=False)
class PieceDesign(PickedWindows, Shown, Kept):
    """The windows that `design_pieces` picked, to judge them and to estimate from them; `PickedWindows` has its attributes."""

    @property
    def points(self) -> Runs:
        """The runs, under the name that designs of points have for them."""
        return self.runs

    @property
    def measurements(self) -> Measurements:
        """The windows with what was measured, as `estimate` takes them."""
        return Measurements(self.runs, self.y)

    def _problem_sections(self) -> Sequence[Section]:
        return problem_sections(self.problem)

    def report(self) -> Report:
        """Windows, parameters, how they compare with other choices, and the search as tables."""
        return piece_report(self)

    def _plots(self) -> Plots:
        return {"windows": self.plot}

    def plot(self, *, path: str | Path | None = None) -> Figure:
        """Draw what was measured in the windows over time, and the share of each in what is known; needs matplotlib.

        Parameters
        ----------
        path : path, optional
            Where the picture is also written; the ending says the format, PNG where there is none.
        """
        with needed_for("plot"):
            from ...show.style import drawn
            from .piece_pictures import plot_windows

        return drawn(plot_windows(self.t, self.runs, self.y, self.shares, self.problem.model.outputs, self.report().headline), path)

    def to_pandas(self) -> pd.DataFrame:
        """One row per window: its first sample, time, numbers that were measured, and share."""
        with needed_for("to_pandas"):
            import pandas as pd

        numbers = np.isfinite(self.y).sum(axis=(1, 2))
        columns = {"first": self.first, "t": self.t, "numbers": numbers, "share": self.shares}
        return pd.DataFrame(columns, index=pd.Index(self.windows, name="window"))
