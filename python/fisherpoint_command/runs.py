"""What the commands do with runs of several segments: the search, and points or runs from a file."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np

import fisherpoint as fp
from fisherpoint.basics.csv_table import CsvTable, csv_text
from fisherpoint.basics.files import write_together, write_whole
from fisherpoint.design.configuration import Config
from fisherpoint.design.runs.run_plots import PICTURES, plots_of
from fisherpoint.information.problem_report import problem_sections
from fisherpoint.points.run_files import RUN, SEGMENT
from fisherpoint.show.section import Report

from .drawing import Drawers, drawers
from .dry_run import run_rows, show_plan
from .exits import INTERRUPTED, complain
from .results import free_directory, make_directory, remove_old
from .terminal import as_file, say, show
from .written import PAGE, write_page, write_shown

RUN_PICTURES = "fisherpoint.design.runs.run_pictures"
"""The module of pictures of runs."""


def design_of_runs(
    config: Config,
    settings: dict[str, Any],
    file: Path,
    output: Path | None,
    size: int | None,
    seed: int | None,
    threads: int | None,
    check: bool,
    no_plots: bool,
    force: bool,
    quiet: bool,
) -> int:
    """Search for runs; write design.csv, plan.csv, design.json, report.txt, pictures and report.html."""
    problem = config.problem()
    if problem.noise_std is None:
        raise config.error("noise_std", "missing; expected the noise of every output, which runs are designed for")
    for name, value in (("n_runs", size), ("seed", seed)):
        if value is not None:
            settings[name] = value
    old = [] if output is None else free_directory(output, force)
    if check:
        return show_plan(problem, [file], run_rows(problem, settings), output)
    assert output is not None
    with drawers(None if no_plots else RUN_PICTURES) as drawing:
        try:
            found = fp.design_runs(problem, **settings, threads=threads, progress=not quiet)
        except KeyboardInterrupt:
            complain("interrupted before a first start was followed; nothing was saved")
            return INTERRUPTED
        make_directory(output, old)
        found.save(output)
        report = found.report()
        write_whole(output / "report.txt", as_file(report))
        interrupted = found.stop_reason == fp.StopReason.interrupted
        shown = write_shown(found, output, drawing.unless(interrupted), file)
    written = ["design.csv", "plan.csv", "design.json", "report.txt", *shown]
    if not quiet:
        show(report)
        print()
        say(f"Written to {output}: {', '.join(written)}")
    remove_old(output, old, written, quiet)
    return INTERRUPTED if interrupted else 0


def evaluate_runs(
    problem: fp.DesignProblem,
    runs: fp.Runs,
    evaluation: fp.Evaluation,
    report: Report,
    file: Path,
    output: Path,
    old: Collection[str],
    drawing: Drawers,
    quiet: bool,
) -> int:
    """Write what given runs are worth: report.txt, parameters.csv, pictures and report.html."""
    tables = {"parameters.csv": evaluation.to_pandas().to_csv(), "report.txt": as_file(report)}
    write_together(output, tables, stale=[PAGE, *PICTURES])
    plots = plots_of(problem, runs, evaluation)
    written = ["report.txt", *write_page(report, problem_sections(problem), output, drawing, plots, file)]
    if not quiet:
        print()
        say(f"Written to {output}: {', '.join(['parameters.csv', *written])}")
    remove_old(output, old, written, quiet)
    return 0


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


def read_previous(path: Path, model: fp.Model) -> fp.Experiments | fp.Runs | fp.Measurements:
    """Measurements where the file has a column of an output, else points or runs that are planned."""
    if any(name.startswith("y_") for name in CsvTable(path).names):
        return fp.Measurements.from_csv(path, model)
    return read_points(path, model)


def read_points(path: Path, model: fp.Model) -> fp.Experiments | fp.Runs:
    """Points, or runs where the file has a row for every segment of one."""
    names = CsvTable(path).names
    if RUN.name in names and SEGMENT.name in names:
        return fp.Runs.from_csv(path, model)
    return fp.Experiments.from_csv(path, model)
