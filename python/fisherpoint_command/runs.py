"""What the commands do with runs of several segments: the search, and points or runs from a file."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import fisherpoint as fp
from fisherpoint.basics.csv_file import csv_text
from fisherpoint.basics.files import write_whole
from fisherpoint.basics.table import DataTable
from fisherpoint.design.file.configuration import Config
from fisherpoint.points.run_files import RUN, SEGMENT

from .drawing import Drawers
from .dry_run import run_rows
from .frame import Frame, Outcome, Task
from .terminal import named_files, read_data, warn_of_outside
from .workers import opened
from .written_results import write_shown

RUN_PICTURES = "fisherpoint.design.runs.run_pictures"
"""The module of pictures of runs."""


def design_of_runs(frame: Frame, config: Config, settings: dict[str, Any], file: Path) -> int:
    """Search for runs; write design.csv, plan.csv, design.json, report.txt, pictures and report.html."""
    problem = config.problem()
    if problem.noise is None:
        raise config.error("noise", "missing; expected the noise of every output, which runs are designed for")

    def compute(_: Drawers) -> Outcome:
        with opened(frame.workers) as workers:
            found = fp.design_runs(problem, **settings, threads=frame.threads, workers=workers, progress=not frame.quiet)

        def write(directory: Path, report: Callable[[], str]) -> list[str]:
            found.save(directory)
            write_whole(directory / "report.txt", report())
            return ["design.csv", "plan.csv", "design.json", "report.txt"]

        draw, interrupted = partial(write_shown, found, file), found.stop_reason == fp.StopReason.interrupted
        return Outcome(report=found.report, write=write, draw=draw, interrupted=interrupted)

    return frame.run(
        Task(
            problem=problem,
            files=[file],
            plan=lambda: run_rows(problem, settings),
            pictures=RUN_PICTURES,
            compute=compute,
            before="a first start was followed",
        )
    )


def run_report(runs: fp.Runs, done: fp.Trajectories) -> str:
    """How many runs reach their ends."""
    failed = int((done.status != fp.Status.ok).sum())
    return f"{len(runs)} runs, {failed} of which do not reach their ends"


def run_simulation_csv(model: fp.Model, runs: fp.Runs, done: fp.Trajectories) -> str:
    """The outputs at the end of each segment, as a table."""
    run, segment = np.nonzero(runs.dt)
    reached = segment < done.reached[run]
    names = [f"y_{quantity.name}" for quantity in model.outputs]
    y = np.where(reached[:, None], done.y[run, segment], np.nan)
    states = [fp.Status(int(done.status[k])).name if n >= done.reached[k] else "ok" for k, n in zip(run, segment, strict=True)]
    rows: list[list[str | float]] = [
        [str(k + 1), str(n + 1), t, *values, state]
        for k, n, t, values, state in zip(run, segment, runs.t[run, segment].tolist(), y.tolist(), states, strict=True)
    ]
    return csv_text((RUN.name, SEGMENT.name, "t", *names, "status"), rows)


def read_designs(
    paths: list[Path], problem: fp.DesignProblem, read: Callable[[Path, fp.Model], Any] | None = None
) -> dict[str, Any]:
    """Points or runs of files by the shortest names that distinguish these; a warning names points outside of the region."""
    points = {name: read_data(path, "points", read or read_points, problem.model) for name, path in named_files(paths).items()}
    for path, given in zip(paths, points.values(), strict=True):
        warn_of_outside(problem, path, given.points if isinstance(given, fp.Measurements) else given)
    return points


def read_points(path: Path, model: fp.Model) -> fp.Experiments | fp.Runs:
    """Points, or runs where the file has a row for every segment of one."""
    names = DataTable(path).names
    if RUN.name in names and SEGMENT.name in names:
        return fp.Runs.from_csv(path, model)
    return fp.Experiments.from_csv(path, model)
