"""A design for each plant of a fleet, and what they determine together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from ...basics.csv_file import csv_text
from ...basics.files import write_whole
from ...data.measurements import Measurements
from ...data.plans import planned
from ...information.evaluate import evaluate
from ...information.evaluation import Evaluation
from ...information.problem import DesignProblem
from ...information.problem_report import local_in_words
from ...points.experiments import columns_of
from ...points.run_files import runs_csv
from ...points.runs import Points, as_runs
from ...show.numbers import counted
from ...show.section import Report, Section
from ...show.table_preview import InNotebooks


@dataclass(frozen=True, eq=False)
class FleetDesign(InNotebooks):
    """The designs of a fleet's plants.

    Attributes
    ----------
    problem : DesignProblem
    label : str
        What the plants are called in files: "plant", or the other word by which parameters are local.
    points : mapping of plant to Experiments or Runs
    evaluation : Evaluation
        What all of them together say of the parameters that the plants share, each plant's own values eliminated.
    """

    problem: DesignProblem
    label: str
    points: Mapping[str, Points]
    evaluation: Evaluation

    @property
    def alike(self) -> bool:
        """Whether all plants have the same points or runs."""
        first, *others = self.points.values()
        return all(one == first for one in others)

    def to_csv(self, path: str | Path) -> None:
        """Write the points, or runs, of all plants, with a column for the plant's label.

        With columns of outputs behind, it is what `Measurements.from_table` reads.
        """
        model = self.problem.model
        kinds = list(self.points.values())
        if all(as_runs(one).points is not None for one in kinds):
            names = columns_of(model)
            rows = [
                [*row[: len(names) + 1], plant] for plant, one in self.points.items() for row in as_runs(one).starts.table.tolist()
            ]
            write_whole(path, csv_text((*names, "dt", self.label), rows))
            return
        together = labelled(self.points, self.label, len(model.outputs))
        write_whole(path, runs_csv(together.runs, model, labels=together.labels))

    def report(self) -> Report:
        """The precision of what the plants share, and what each plant does."""
        rows = [
            (plant, str(len(one)), str(int(as_runs(one).measured.sum())), f"{as_runs(one).dt.sum():.4g}")
            for plant, one in self.points.items()
        ]
        kind = next(iter(self.points.values())).kind
        notes = ["All have the same."] if self.alike else []
        table = Section("Plants", (self.label, f"{kind}s", "samples", "duration [s]"), rows, notes=notes)
        known = Section("Fleet", (), [("local parameters", local_in_words(self.problem.local_parameters))])
        return Report(repr(self), [*self.evaluation.report().sections, table, known])

    def _in_notebook(self) -> Report:
        return self.report()

    def __str__(self) -> str:
        return str(self.report())

    def __repr__(self) -> str:
        of_each = counted(len(next(iter(self.points.values()))), next(iter(self.points.values())).kind)
        return f"FleetDesign({counted(len(self.points), self.label)}, {of_each} each, rank {self.evaluation.rank})"


def labelled(points: Mapping[str, Points], label: str, outputs: int) -> Measurements:
    """The points of plants as if all of it was measured, with their labels."""
    return Measurements.join([planned(one, outputs, {label: plant}) for plant, one in points.items()])


def evaluated(problem: DesignProblem, label: str, points: Mapping[str, Points], threads: int | None) -> Evaluation:
    """What the points of all plants say together."""
    *others, last = points
    previous = labelled({plant: points[plant] for plant in others}, label, len(problem.model.outputs)) if others else None
    return evaluate(problem, points[last], previous=previous, threads=threads)
