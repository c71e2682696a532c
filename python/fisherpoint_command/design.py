"""``fisherpoint design``: the most informative points, or runs."""

from __future__ import annotations

from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

import fisherpoint as fp

from .argv import shell_line
from .exits import INTERRUPTED, complain
from .importing import importing
from .options import Check, File, Force, NoPlots, Output, Previous, Quiet, Seed, Threads
from .standard_input import one_from_standard_input


class Method(StrEnum):
    """How `fisherpoint design` searches for points."""

    paper = "paper"
    auto = "auto"


class Over(StrEnum):
    """What `fisherpoint design` maximises over the prior, instead of log det F at its mean."""

    log = "log"
    worst = "worst"
    cvar = "cvar"


def design(
    file: File,
    output: Output = None,
    size: Annotated[
        int | None, typer.Option("-L", "--size", min=1, metavar="N", help="Points, or runs; overrides the value in the file.")
    ] = None,
    seed: Seed = None,
    max_iterations: Annotated[int | None, typer.Option(min=1, metavar="N", help="Overrides the value in the file.")] = None,
    method: Annotated[Method | None, typer.Option(help="Overrides the value in the file.")] = None,
    over: Annotated[
        Over | None, typer.Option(help="A criterion over the prior, not at its mean alone; overrides the value in the file.")
    ] = None,
    keep: Annotated[
        Path | None,
        typer.Option(
            metavar="POINTS.csv",
            callback=one_from_standard_input,
            help="Points that the design must have; they count as its first.",
        ),
    ] = None,
    previous: Previous = None,
    threads: Threads = None,
    check: Check = False,
    no_plots: NoPlots = False,
    force: Force = False,
    quiet: Quiet = False,
) -> int:
    """Find the experiment points, or with a table of runs in the file the runs, that determine the parameters best.

    Writes design.csv, design.json, report.txt, pictures, and report.html, which shows all of it in a browser. Ctrl-C stops
    early and keeps the best design so far.
    """
    with importing():
        import rich.progress  # noqa: F401  for the bar

        from fisherpoint.basics.files import write_whole
        from fisherpoint.design.configuration import ConfigError
        from fisherpoint.design.exchange import designs
        from fisherpoint.design.plots import plots_of
        from fisherpoint.points.outside import few, outside

        from .drawing import drawers
        from .dry_run import points_row, search_rows, settings_of, show_plan
        from .results import free_directory, make_directory, needed, remove_old
        from .runs import design_of_runs, read_previous
        from .terminal import as_file, read_config, read_data, say, show
        from .written import write_shown
    needed(output, check)
    config = read_config(file)
    if config.region is None:
        raise config.error("region", "missing; expected a table with bounds of every state, every input and dt")
    if config.runs is not None:
        of_points = {"--keep": keep, "--previous": previous, "--method": method, "--max-iterations": max_iterations}
        for option in (option for option, given in of_points.items() if given):
            raise ConfigError(f"{option}: expected a file with points to design; {file} has a table [runs]")
        settings = _with_over(config.run_settings(), over)
        return design_of_runs(config, settings, file, output, size, seed, threads, check, no_plots, force, quiet)
    problem, settings = config.problem(), _with_over(config.exchange_settings(), over)
    chosen = None if method is None else replace(settings["method"], name=method.value)
    for name, value in (("n_experiments", size), ("seed", seed), ("max_iterations", max_iterations), ("method", chosen)):
        if value is not None:
            settings[name] = value
    files = [file]
    if keep is not None:
        kept = settings["keep"] = read_data(keep, "points", fp.Experiments.from_csv, problem.model)
        if places := list(outside(problem.model, problem.region, kept)):
            raise ConfigError(f"{keep}: expected points of the region, given {few(places)}")
        files.append(keep)
    if previous:
        settings["previous"] = [read_data(path, "points or measurements", read_previous, problem.model) for path in previous]
        files += previous
    planned = settings_of(problem, settings)
    if keep is not None and not len(kept) < planned.n_experiments:
        raise ConfigError(f"{keep}: expected fewer points than the design has, {planned.n_experiments}; given {len(kept)}")
    old = [] if output is None else free_directory(output, force)
    if check:
        given = [points_row(f"kept, of {keep}", kept)] if keep is not None else []
        return show_plan(problem, files, [*given, *search_rows(problem, planned)], output)
    assert output is not None
    if planned.goal.share_of_plants is not None or isinstance(problem.rule, fp.Sobol):
        with importing():
            import scipy.special  # noqa: F401  not where it is needed, in the middle of the search, which Ctrl-C is to end in order
    with drawers(None if no_plots else "fisherpoint.design.pictures") as drawing:
        found, earlier = None, {name: settings.get(name) for name in ("previous", "keep")}
        try:
            for found in designs(problem, planned, **earlier, threads=threads, progress=not quiet):
                drawing.begin(plots_of(found))  # but for the criterion's, which shows what is compared in the end
        except KeyboardInterrupt:
            if found is None:
                complain("interrupted before a design was found; nothing was saved")
                return INTERRUPTED
            found = replace(found, stop_reason=fp.StopReason.interrupted)
        assert found is not None
        make_directory(output, old)
        found.save(output)
        report = found.report()
        write_whole(output / "report.txt", as_file(report))
        if not quiet:
            show(report)
        interrupted = found.stop_reason == fp.StopReason.interrupted
        shown = write_shown(found, output, drawing.unless(interrupted), file)
    written = ["design.csv", "design.json", "report.txt", *shown]
    if not quiet:
        print()
        say(f"Written to {output}: {', '.join(written)}")
        if interrupted:
            again = shell_line("fisherpoint", "evaluate", file, output / "design.csv", "-o", output / "evaluated")
            say(f"For pictures: {again}")
    remove_old(output, old, written, quiet)
    return INTERRUPTED if interrupted else 0


def _with_over(settings: dict[str, Any], over: Over | None) -> dict[str, Any]:
    if over is None:
        return settings
    goal: fp.Goal = settings["goal"]
    in_file = fp.OverPrior(over.value) if goal.over is None else replace(goal.over, kind=over.value)
    return settings | {"goal": replace(goal, over=in_file)}
