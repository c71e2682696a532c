"""What the commands do with runs of several segments: the search, and points or runs from a file."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

import fisherpoint as fp
from fisherpoint.basics.csv_table import CsvTable, csv_text
from fisherpoint.basics.extras import needed_for
from fisherpoint.basics.files import write_together, write_whole
from fisherpoint.basics.values import Array
from fisherpoint.design.configuration import Config
from fisherpoint.information.problem_report import problem_sections
from fisherpoint.points.run_files import RUN, SEGMENT

from .exits import INTERRUPTED
from .results import make_free_directory, remove_old
from .terminal import as_file, say, show
from .written import PAGE, write_page, write_shown


def design_of_runs(
    config: Config, file: Path, output: Path, seed: int | None, threads: int | None, no_plots: bool, force: bool, quiet: bool
) -> int:
    """Search for runs; write design.csv, plan.csv, design.json, report.txt, pictures and report.html."""
    problem, settings = config.problem(), config.run_settings()
    if problem.noise_std is None:
        raise config.error("noise_std", "missing; expected the noise of every output, which runs are designed for")
    if seed is not None:
        settings["seed"] = seed
    if not no_plots:
        with needed_for("pictures"):
            from fisherpoint.design.runs.run_pictures import plots_of  # what can fail for a trivial reason fails before the work
    old = make_free_directory(output, force)

    console = Console(stderr=True)

    def progress(now: fp.RunProgress) -> None:
        if not quiet and console.is_terminal:
            found = f"log det {now.log_det:.3f}, best {now.best:.3f}"
            console.print(f"start {now.start} of {now.n_starts}: {found}, {now.seconds:.0f} s", highlight=False)

    found = fp.design_runs(problem, **settings, threads=threads, progress=progress)
    found.save(output)
    report = found.report()
    write_whole(output / "report.txt", as_file(report))
    interrupted = found.stop_reason == "interrupted"
    plots = {} if no_plots or interrupted else plots_of(found)
    shown = write_shown(found, output, plots, file)
    written = ["design.csv", "plan.csv", "design.json", "report.txt", *shown]
    if not quiet:
        show(report)
        print()
        say(f"Written to {output}: {', '.join(written)}")
    remove_old(output, old, written, quiet)
    return INTERRUPTED if interrupted else 0


def evaluate_runs(problem: fp.DesignProblem, runs: fp.Runs, file: Path, output: Path | None, old: Collection[str]) -> int:
    """Tell what given runs are worth; write report.txt, parameters.csv and report.html."""
    evaluation = fp.evaluate_design(problem, runs)
    report = evaluation.report()
    show(report)
    if output:
        write_together(output, {"parameters.csv": evaluation.to_pandas().to_csv(), "report.txt": as_file(report)}, stale=[PAGE])
        written = write_page(report, problem_sections(problem), output, {}, file)
        remove_old(output, old, ["report.txt", *written])
    return 0


def simulate_runs(model: fp.Model, runs: fp.Runs, theta: Array, crossings: dict[str, Any], output: Path | None) -> int:
    """Simulate given runs: the outputs at the end of each segment."""
    done = fp.simulate(model, runs, theta, **crossings)
    run, segment = np.nonzero(runs.dt)
    reached = segment < done.reached[run]
    names = [f"y_{quantity.name}" for quantity in model.outputs]
    y = np.where(reached[:, None], done.y[run, segment], np.nan)
    states = [fp.Status(int(done.status[k])).name if n >= done.reached[k] else "ok" for k, n in zip(run, segment, strict=True)]
    rows: list[list[str | float]] = [
        [str(k + 1), str(n + 1), t, *values, state]
        for k, n, t, values, state in zip(run, segment, runs.t[run, segment].tolist(), y.tolist(), states, strict=True)
    ]
    text = csv_text((RUN.name, SEGMENT.name, "t", *names, "status"), rows)
    failed = int((done.status != fp.Status.ok).sum())
    say(f"{len(runs)} runs, {failed} of which do not reach their ends")
    if output:
        write_whole(output, text)
    else:
        print(text, end="")
    return 0


def read_told(path: Path, model: fp.Model) -> fp.Experiments | fp.Runs | fp.Measurements:
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
