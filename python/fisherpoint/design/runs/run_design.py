"""A design of runs, as the search returns it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from ...basics.checks import as_path, check_choice
from ...basics.declared import Extents
from ...basics.extras import needed_for
from ...basics.files import write_together
from ...basics.kept import Codec, Kept
from ...basics.stop_reason import StopReason
from ...basics.values import FrozenMapping
from ...information.codec import evaluation_from_json, evaluation_to_json, problem_from_json, problem_to_json
from ...information.evaluation import Evaluation
from ...information.feasibility import Feasibility
from ...information.problem import DesignProblem
from ...information.problem_report import problem_sections
from ...points.codec import points_from_json, points_to_json, runs_from_json
from ...points.experiments import Experiments
from ...points.run_files import plan_csv, runs_csv
from ...points.runs import Runs
from ...show.section import Report, Section
from ...show.shown import Plots, Shown
from ..optimality.criteria import Criterion
from ..optimality.goal import GOAL_CODEC, GOAL_INSIDE
from ..optimality.goal_criterion import criterion_of_design
from ..scenario_values import ScenarioValues, scenario_values_from_json, scenario_values_to_json
from ..settings import RunSettings
from ..settings_section import settings_section
from .run_plots import PICTURES, plots_of
from .run_report import run_report
from .run_tables import segments_table

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False, repr=False)
class RunDesign(Shown, Kept):
    """The runs that `design_runs` found, with what is needed to judge and to repeat them.

    Attributes
    ----------
    problem : DesignProblem
    settings : RunSettings
    runs : Runs
    evaluation : Evaluation
        Of the runs, and of previous points and runs with them, at the prior mean.
    log_det : float
        What was maximised: log det F in its sum form, parameters standardised by the prior, or its average over the scenarios of a
        criterion over the prior. -inf where no runs of the region determine all parameters. With another criterion than "D" log phi
        times its `level` instead of log det F, such as the negative logarithm of the trace of F^-1.
    ends : tuple of float
        The value that each start of the search came to, in the order in which they were followed; some are given up on the way.
    again : int
        How many of them are as good as the best one.
    feasibility : Feasibility
        Which of a thousand plants that the search has not seen can run the whole design, and why others cannot.
    stop_reason : StopReason
    drawn : int
    rejected : mapping of reason to int
        Runs drawn at random for the search, and those of them that do not reach their ends, by status, and of "left_domain" the
        limit.
    seconds : float
    classical : mapping of profile to float
        The same of the best of a hundred random runs of each classical profile, steps for one, whether plants can run them or not.
    classical_shares : mapping of profile to float
        The share that can run these, of the plants of `feasibility`.
    n_kept : int
        The first so many runs were given, and stay.
    scenarios : ScenarioValues or None
        What the runs are worth in the scenarios of a criterion over the prior; None where it is of the prior mean.
    ridge : float
        Share of the prior's information that was added to F where no runs of the region determine all parameters, to compare
        runs; else 0. No figure of the design contains it.
    """

    problem: DesignProblem
    settings: RunSettings
    runs: Runs
    evaluation: Evaluation
    log_det: float
    ends: tuple[float, ...]
    again: int
    feasibility: Feasibility
    stop_reason: StopReason
    drawn: int
    rejected: Mapping[str, int]
    seconds: float
    classical: Mapping[str, float] = FrozenMapping({})
    classical_shares: Mapping[str, float] = FrozenMapping({})
    scenarios: ScenarioValues | None = None
    n_kept: int = 0
    ridge: float = 0.0

    _INSIDE = (StopReason, RunSettings, *GOAL_INSIDE, Feasibility)
    _EXTENTS: ClassVar[Extents] = {
        "runs.x0": ("n", "problem.model.states"),
        "runs.u": ("n", "segments", "problem.model.inputs"),
        "evaluation.parameters": ("problem.estimated",),
        "classical_shares": ("classical",),
        "scenarios.standard_errors": ("problem.estimated",),
    }
    _GONE = ("plants",)
    _CODEC: ClassVar[Codec] = {
        DesignProblem: (problem_to_json, problem_from_json),
        Runs: (points_to_json, runs_from_json),
        Experiments: (points_to_json, points_from_json),
        Evaluation: (evaluation_to_json, lambda data: evaluation_from_json(data, data["n_points"])),
        **GOAL_CODEC,
        ScenarioValues: (scenario_values_to_json, lambda data: scenario_values_from_json(data, tuple(data["standard_errors"]))),
    }

    @cached_property
    def criterion(self) -> Criterion:
        """The criterion as a function of information matrices; where F is singular, "A", "E" and "ME" are of the rest."""
        return criterion_of_design(self.problem, self.settings.goal, self.evaluation)

    def _check_content(self) -> None:
        _ = self.criterion

    @property
    def value(self) -> float:
        """The criterion at the prior mean with all measurements, previous ones too: at `Evaluation.information`."""
        return self.criterion.value(self.evaluation.information)

    @property
    def points(self) -> Runs:
        """The runs, under the name that designs of points have for them."""
        return self.runs

    @property
    def feasible(self) -> bool:
        """Whether at least the required share of the plants can run the design, of those that `feasibility` has tried."""
        return self.feasibility.share >= (self.settings.goal.confidence or 0.0)

    def report(self) -> Report:
        """Runs, parameters, what plants can run them, and the search as tables."""
        return run_report(self)

    def _page_report(self) -> Report:
        report = self.report()
        return replace(report, sections=[*report.sections, segments_table(self.problem.model, self.runs)])

    def _asked(self) -> Sequence[Section]:
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
        write_together(directory, tables | {"design.json": self._file()}, stale=("report.txt", "report.html", *PICTURES))

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
