"""``fisherpoint design``: the points, or the runs, that tell most."""

from __future__ import annotations

from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

import fisherpoint as fp
from fisherpoint.basics.extras import needed_for

from .asked import shell_line
from .exits import INTERRUPTED, complain
from .importing import importing
from .options import File, Force, NoPlots, Output, Previous, Quiet, Threads


class Method(StrEnum):
    """How `fisherpoint design` searches for points."""

    paper = "paper"
    auto = "auto"


class Over(StrEnum):
    """What `fisherpoint design` maximises over the prior, in the place of log det F at its mean."""

    log = "log"
    worst = "worst"
    cvar = "cvar"


def design(
    file: File,
    output: Output,
    threads: Threads = None,
    seed: Annotated[int | None, typer.Option(min=0, metavar="N", help="Overrides the value in the file.")] = None,
    max_iterations: Annotated[int | None, typer.Option(min=1, metavar="N", help="Overrides the value in the file.")] = None,
    method: Annotated[Method | None, typer.Option(help="Overrides the value in the file.")] = None,
    over: Annotated[
        Over | None, typer.Option(help="A criterion over the prior, not at its mean alone; overrides the value in the file.")
    ] = None,
    keep: Annotated[
        Path | None, typer.Option(metavar="POINTS.csv", help="Points that the design must have; they count as its first.")
    ] = None,
    previous: Previous = None,
    no_plots: NoPlots = False,
    force: Force = False,
    quiet: Quiet = False,
) -> int:
    """Find the experiment points, or with a table of runs in the file the runs, that determine the parameters best.

    Writes design.csv, design.json, report.txt, pictures, and report.html, which shows all of it in a browser. Ctrl-C stops
    early and keeps the best design so far.
    """
    with importing():
        import scipy.special  # noqa: F401  not where it is needed, in the middle of the search, which Ctrl-C is to end in order

        import fisherpoint.design.exchange  # noqa: F401  with all that it imports
        from fisherpoint.basics.files import write_whole
        from fisherpoint.design.configuration import ConfigError, load_config

        from .results import make_free_directory, remove_old
        from .runs import design_of_runs, read_told
        from .terminal import as_file, read_data, say, show
        from .written import write_shown
    config = load_config(file)
    if config.region is None:
        raise config.error("region", "missing; expected a table with bounds of every state, every input and dt")
    if config.runs is not None:
        for option, paths in (("--keep", keep), ("--previous", previous)):
            if paths:
                raise ConfigError(f"{option}: expected a file with points to design; {file} has a table [runs]")
        return design_of_runs(config, file, output, seed, threads, no_plots, force, quiet)
    problem, settings = config.problem(), config.exchange_settings()
    chosen = None if method is None else method.value
    for name, value in (("seed", seed), ("max_iterations", max_iterations), ("method", chosen)):
        if value is not None:
            settings[name] = value
    if over is not None:
        in_file = settings.get("over")
        settings["over"] = fp.OverPrior(over.value) if in_file is None else replace(in_file, kind=over.value)
    if keep is not None:
        settings["keep"] = read_data(keep, "points", fp.Experiments.from_csv, problem.model)
    if previous:
        settings["previous"] = [read_data(path, "points or measurements", read_told, problem.model) for path in previous]
    # What can fail for a trivial reason fails before the work, not after it.
    if not no_plots:
        with importing(), needed_for("pictures"):
            from fisherpoint.design.pictures import plots_of
    old = make_free_directory(output, force)

    try:
        found = _exchange(problem, settings, threads, show=not quiet)
    except KeyboardInterrupt:
        complain("interrupted before a design was found; nothing was saved")
        return INTERRUPTED
    found.save(output)
    report = found.report()
    write_whole(output / "report.txt", as_file(report))
    if not quiet:
        show(report)
    interrupted = found.stop_reason == "interrupted"
    plots = {} if no_plots or interrupted else plots_of(found)  # who interrupts wants an end
    written = ["design.csv", "design.json", "report.txt", *write_shown(found, output, plots, file)]
    if not quiet:
        print()
        say(f"Written to {output}: {', '.join(written)}")
        if interrupted:
            again = shell_line("fisherpoint", "evaluate", file, output / "design.csv", "-o", output / "evaluated")
            say(f"For pictures: {again}")
    remove_old(output, old, written, quiet)
    return INTERRUPTED if interrupted else 0


def _exchange(problem: fp.DesignProblem, settings: dict[str, Any], threads: int | None, show: bool) -> fp.Design:
    """Run the exchange under a progress bar on standard error."""
    with importing():
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    console = Console(stderr=True)
    bar = Progress(
        TextColumn("iteration"),
        MofNCompleteColumn(),
        BarColumn(bar_width=20),
        TextColumn("{task.fields[state]}"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=console,
        transient=True,
        disable=not (show and console.is_terminal),
    )
    with bar:
        task = bar.add_task("design", total=None, state="drawing the first points")

        def progress(now: fp.Progress) -> None:
            rate = now.drawn / now.seconds if now.seconds > 0 else 0.0
            rejected = now.rejected / now.drawn if now.drawn else 0.0
            state = f"log det {now.log_det:.3f}, {now.exchanges} exchanges, {rate:.0f} candidates/s, {rejected:.0%} rejected"
            if now.iteration == now.max_iterations:
                state = "proving how good it is, and comparing with random designs"
            bar.update(task, completed=now.iteration, total=now.max_iterations, state=state)

        return fp.exchange(problem, **settings, threads=threads, progress=progress)
