"""A design for each plant of a fleet, and what they determine together."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from ...basics.checks import as_path, check_choice
from ...basics.csv_file import csv_text
from ...basics.extras import needed_for
from ...basics.field_checks import Extents
from ...basics.files import REPORTS, write_together, write_whole
from ...basics.messages import listed, shown
from ...basics.result_files import Kept
from ...basics.stop_reason import StopReason
from ...basics.values import FrozenMapping
from ...data.measurements import Measurements
from ...data.plans import planned
from ...engine.versions import versions
from ...information.evaluate import evaluate
from ...information.evaluation import Evaluation
from ...information.local import RECORD, RUN
from ...information.problem import DesignProblem
from ...information.problem_report import local_in_words, problem_sections
from ...points.experiments import columns_of
from ...points.points_or_runs import Points, as_runs, joined
from ...points.run_files import plan_csv, runs_csv
from ...show.display import Plots, Shown
from ...show.numbers import counted, percent
from ...show.section import Report, Section
from ..results.report import points_section
from ..results.settings_section import option_facts
from ..runs.run_tables import segments_table
from .fleet_settings import FleetSettings
from .picture_list import PICTURES

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False, repr=False)
class FleetDesign(Shown, Kept):
    """The designs of a fleet's plants.

    Attributes
    ----------
    problem : DesignProblem
    label : str
        What the plants are called in files: "plant", or the other word by which parameters are local.
    points : mapping of plant to Experiments or Runs
    evaluation : Evaluation
        What all of them together say of the parameters that the plants share, each plant's own values eliminated.
    settings : FleetSettings
    stop_reason : StopReason
        Whether the search was completed, or interrupted.
    """

    problem: DesignProblem
    label: str
    points: Mapping[str, Points]
    evaluation: Evaluation
    settings: FleetSettings
    stop_reason: StopReason

    _EXTENTS: ClassVar[Extents] = {"points": ("+",)}

    def _check_content(self) -> None:
        if self.label != label_of(self.problem):
            raise ValueError(f"label: expected {label_of(self.problem)!r}, given {shown(self.label)}")
        if len({one.kind for one in self.points.values()}) > 1:
            raise ValueError("points: expected points of all plants, or runs of all; given both")
        labelled(self.points, self.label, len(self.problem.model.outputs))

    @property
    def alike(self) -> bool:
        """Whether all plants have the same points or runs."""
        first, *others = self.points.values()
        return all(one == first for one in others)

    @cached_property
    def shares(self) -> Mapping[str, Mapping[str, float]]:
        """Share of each plant in what is known of each parameter; they add up to 1. None where F is singular.

        With F as the sum of what the plants say, F^-1 is that of F^-1 F_k F^-1. None either where they share what is uncertain.
        """
        if self.evaluation.covariance is None or self.problem.common != self.problem.estimated:
            return FrozenMapping({})
        each = np.array([evaluate(self.problem, one).information for one in self.points.values()])
        inverse = np.linalg.inv(each.sum(axis=0))
        shares = np.einsum("pq,kqr,rp->kp", inverse, each, inverse) / np.diag(inverse)
        names = self.evaluation.parameters
        of_plants = [FrozenMapping(dict(zip(names, of.tolist(), strict=True))) for of in shares]
        return FrozenMapping(dict(zip(self.points, of_plants, strict=True)))

    def to_csv(self, path: str | Path) -> None:
        """Write the points, or runs, of all plants, with a column for the plant's label.

        With columns of outputs behind, it is what `Measurements.from_table` reads.
        """
        write_whole(path, self._csv())

    def _csv(self) -> str:
        model, together = self.problem.model, labelled(self.points, self.label, len(self.problem.model.outputs))
        if together.points.kind == "point":
            names = [*columns_of(model), "dt"] if model.states else list(columns_of(model))
            rows = zip(together.runs.starts.table.tolist(), together.labels[self.label], strict=True)
            return csv_text((*names, self.label), [[*row[: len(names)], plant] for row, plant in rows])
        return runs_csv(together.runs, model, labels=together.labels)

    def save(self, directory: str | Path) -> None:
        """Write design.csv, with a column for the plant's label, and design.json into `directory`, which is made where needed.

        Of runs plan.csv too, their time table. Of a design that was there before, the command line's report and pictures go.
        """
        directory, tables = as_path(directory, "directory"), {"design.csv": self._csv()}
        points = joined(list(self.points.values()))
        if points.kind == "run":
            tables["plan.csv"] = plan_csv(as_runs(points), self.problem.model)
        directory.mkdir(parents=True, exist_ok=True)
        stale = (*REPORTS, *PICTURES, *({"plan.csv"} - set(tables)))
        write_together(directory, tables | {"design.json": self._file(versions=versions())}, stale=stale)

    @classmethod
    def load(cls, directory: str | Path) -> FleetDesign:
        """Read a design that `save` wrote.

        Raises
        ------
        OSError
            Where design.json cannot be read.
        ValueError
            Where it is truncated, was changed, or is not a design of a fleet.
        """
        return super().load(as_path(directory, "directory") / "design.json")

    def report(self) -> Report:
        """The precision of what the plants share, and what each plant does."""
        inner, names = self.evaluation.report(), self.evaluation.parameters if self.shares else ()
        rows = [
            (
                plant,
                *(str(len(one)), str(int(as_runs(one).measured.sum())), f"{as_runs(one).dt.sum():.4g}"),
                *(percent(self.shares[plant][name]) for name in names),
            )
            for plant, one in self.points.items()
        ]
        kind = next(iter(self.points.values())).kind
        notes = ["All have the same."] * (self.alike and len(self.points) > 1)
        notes += ["Of each parameter: the share of the plant in what is known of it."] * bool(names)
        columns = (self.label, f"{kind}s", "samples", "duration [s]", *names)
        too = Section("Estimated too", (), [("local parameters", local_in_words(self.problem.local_parameters))])
        sections = [Section("Plants", columns, rows, notes=notes), *inner.sections, too]
        interrupted = [self.stop_reason.advice] * (self.stop_reason == StopReason.interrupted)
        return Report(self._headline, sections, [*interrupted, *inner.warnings])

    @property
    def _headline(self) -> str:
        first = next(iter(self.points.values()))
        to_estimate = counted(len(self.evaluation.parameters), "common parameter")
        name = self.problem.model.name
        return f"{counted(len(self.points), self.label)} with {counted(len(first), first.kind)} each for {name}, {to_estimate}"

    def _page_report(self) -> Report:
        report, model, tables = self.report(), self.problem.model, []
        for plant, one in list(self.points.items())[: 1 if self.alike else None]:
            title = f"{one.kind.capitalize()}s of {self.label} {plant}" if not self.alike else f"{one.kind.capitalize()}s"
            runs = as_runs(one)
            tables.append(segments_table(model, runs, title) if one is runs else points_section(title, model, runs.starts))
        return replace(report, sections=[*report.sections, *tables])

    def _problem_sections(self) -> Sequence[Section]:
        return [*problem_sections(self.problem), Section("Search", (), list(option_facts(self.settings)))]

    def _plots(self) -> Plots:
        found: dict[str, Callable[[], Figure]] = {"plants": self._drawn_shares} if self.shares else {}
        return found | dict(self.evaluation._plots())

    def _drawn_shares(self) -> Figure:
        from .share_picture import plot_shares

        return plot_shares(self.shares, self.label)

    def plot(self, kind: str = "plants", *, path: str | Path | None = None) -> Figure:
        """Draw the shares of the plants in what is known of each parameter; needs matplotlib.

        Parameters
        ----------
        kind : {"plants", "standard_errors", "correlation"}
            The last two are those of `Evaluation.plot`.
        path : path, optional
            Where the picture is also written; the ending says the format, PNG where there is none.

        Raises
        ------
        ValueError
            For another kind, and "plants" where the parameters are not determined.
        """
        with needed_for("plot"):
            from ...show.style import drawn

        plots = self._plots()
        return drawn(plots[check_choice(kind, tuple(plots), "kind")](), path)


def labelled(points: Mapping[str, Points], label: str, outputs: int) -> Measurements:
    """The points of plants as if all of it was measured, with their labels."""
    return Measurements.join([planned(one, outputs, {label: plant}) for plant, one in points.items()])


def evaluated(problem: DesignProblem, label: str, points: Mapping[str, Points], threads: int | None) -> Evaluation:
    """What the points of all plants say together."""
    *others, last = points
    previous = labelled({plant: points[plant] for plant in others}, label, len(problem.model.outputs)) if others else None
    return evaluate(problem, points[last], previous=previous, threads=threads)


def label_of(problem: DesignProblem) -> str:
    """The word by which parameters are local to plants."""
    labels = dict.fromkeys(one.by for one in problem.local_parameters.values() if one.by not in (RUN, RECORD))
    if len(labels) != 1:
        given = listed(labels, "none")
        raise ValueError(f'local: expected parameters that are local to a plant, as {{"k": "plant"}}, given labels {given}')
    return next(iter(labels))
