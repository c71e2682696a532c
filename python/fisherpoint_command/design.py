"""``fisherpoint design``: the points, or the runs, that tell most."""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import fisherpoint as fp
from fisherpoint.basics.extras import needed_for

from .exits import INTERRUPTED, complain
from .importing import importing
from .options import File, NoPlots, Output, Quiet, Threads

if TYPE_CHECKING:
    from fisherpoint.design.evaluated import Evaluated


class Method(StrEnum):
    """How `fisherpoint design` searches for points."""

    paper = "paper"
    auto = "auto"


def design(
    file: File,
    output: Output,
    threads: Threads = None,
    seed: Annotated[int | None, typer.Option(min=0, metavar="N", help="Overrides the value in the file.")] = None,
    max_iterations: Annotated[int | None, typer.Option(min=1, metavar="N", help="Overrides the value in the file.")] = None,
    method: Annotated[Method | None, typer.Option(help="Overrides the value in the file.")] = None,
    no_plots: NoPlots = False,
    quiet: Quiet = False,
) -> int:
    """Find the experiment points, or with a table of runs in the file the runs, that determine the parameters best.

    Writes design.csv, design.json, report.txt and pictures. Ctrl-C stops early and keeps the best design so far.
    """
    with importing():
        import scipy.special  # noqa: F401  not where it is needed, in the middle of the search, which Ctrl-C is to end in order

        from fisherpoint.basics.files import write_whole
        from fisherpoint.design.configuration import load_config

        from .runs import design_of_runs
        from .terminal import as_file, make_directory, say, show
    config = load_config(file)
    if config.region is None:
        raise config.error("region", "missing; expected a table with bounds of every state, every input and dt")
    if config.runs is not None:
        return design_of_runs(config, output, seed, threads, no_plots, quiet)
    problem, settings = config.problem(), config.exchange_settings()
    chosen = None if method is None else method.value
    for name, value in (("seed", seed), ("max_iterations", max_iterations), ("method", chosen)):
        if value is not None:
            settings[name] = value
    # What can fail for a trivial reason fails before the work, not after it.
    save_pictures = None if no_plots else _picture_writer(output)
    make_directory(output)

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
    written = ["design.csv", "design.json", "report.txt"]
    interrupted = found.stop_reason == "interrupted"
    if save_pictures is not None and not interrupted:  # who interrupts wants an end
        written += [path.name for path in save_pictures(found)]
    if not quiet:
        print()
        say(f"Written to {output}: {', '.join(written)}")
        if interrupted:
            say(f"For pictures: fisherpoint evaluate {file} {output / 'design.csv'} -o {output}")
    return INTERRUPTED if interrupted else 0


def _picture_writer(directory: Path) -> Callable[[Evaluated], list[Path]]:
    """The function that draws all pictures."""
    with importing(), needed_for("pictures"):
        from fisherpoint.design.pictures import save_all

    return lambda evaluated: save_all(evaluated, directory)


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
                state = "comparing with the best design for the sensor noise and with random designs"
            bar.update(task, completed=now.iteration, total=now.max_iterations, state=state)

        return fp.exchange(problem, **settings, threads=threads, progress=progress)
