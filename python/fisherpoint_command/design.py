"""``fisherpoint design``: the most informative points, or runs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import fisherpoint as fp

from .argv import shell_line
from .frame import Frame, Outcome, Task
from .importing import importing
from .options import Columns, File, Output, Previous, Seed, Starts, framed
from .standard_input import one_from_standard_input
from .workers import opened

if TYPE_CHECKING:
    from .drawing import Drawers
    from .dry_run import Row


class Method(StrEnum):
    """How `fisherpoint design` searches for points."""

    paper = "paper"
    auto = "auto"


class Over(StrEnum):
    """What `fisherpoint design` maximises over the prior, instead of log det F at its mean."""

    log = "log"
    worst = "worst"
    cvar = "cvar"


@framed(Output, workers=True)
def design(
    frame: Frame,
    file: File,
    size: Annotated[
        int | None, typer.Option("-L", "--size", min=1, metavar="N", help="Points, or runs; overrides the value in the file.")
    ] = None,
    seed: Seed = None,
    max_iterations: Annotated[int | None, typer.Option(min=1, metavar="N", help="Overrides the value in the file.")] = None,
    starts: Starts = None,
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
    column: Columns = None,
) -> int:
    """Find the experiment points, or with a table of runs in the file the runs, that determine the parameters best.

    With a table of a fleet those of each plant.

    Writes design.csv, design.json, report.txt, pictures, and report.html, which shows all of it in a browser. Ctrl-C stops
    early and keeps the best design so far.
    """
    with importing():
        from fisherpoint.design.file.configuration import ConfigError
        from fisherpoint.design.points.exchange import designs
        from fisherpoint.design.results.picture_list import plots_of
        from fisherpoint.points.outside_region import few, outside

        from .dry_run import points_row, search_rows, settings_of
        from .fleets import design_of_fleet
        from .runs import design_of_runs
        from .tables import DataFiles
        from .terminal import read_config, read_data
        from .written_results import write_shown
    config = read_config(file)
    no_fleets: dict[str, Any] = {"--keep": keep, "--previous": previous, "--column": column, "--method": method, "--over": over}
    no_fleets["--workers"] = frame.workers
    if config.region is None:
        raise config.error("region", "missing; expected a table with bounds of every state, every input and dt")
    if config.fleet is not None:
        for option in (option for option, given in no_fleets.items() if given):
            raise ConfigError(f"{option}: expected a file without a table [fleet]; {file} has one")
        given = {"size": size, "seed": seed, "starts": starts, "max_iterations": max_iterations}
        return design_of_fleet(frame, config, {name: value for name, value in given.items() if value is not None}, file)
    if config.runs is not None:
        of_points = {
            "--keep": keep,
            "--previous": previous,
            "--column": column,
            "--method": method,
            "--starts": starts,
            "--max-iterations": max_iterations,
        }
        for option in (option for option, given in of_points.items() if given):
            raise ConfigError(f"{option}: expected a file with points to design; {file} has a table [runs]")
        settings = _with_over(config.run_settings(), over)
        for name, value in (("n_runs", size), ("seed", seed)):
            if value is not None:
                settings[name] = value
        return design_of_runs(frame, config, settings, file)
    problem, settings = config.problem(), _with_over(config.exchange_settings(), over)
    chosen = settings["method"] if method is None else replace(settings["method"], name=method.value)
    chosen = chosen if starts is None else replace(chosen, starts=starts)
    for name, value in (("n_experiments", size), ("seed", seed), ("max_iterations", max_iterations), ("method", chosen)):
        if value is not None:
            settings[name] = value
    files = [file]
    if keep is not None:
        kept = settings["keep"] = read_data(keep, "points", fp.Experiments.from_csv, problem.model)
        if places := list(outside(problem.model, problem.region, kept)):
            raise ConfigError(f"{keep}: expected points of the region, given {few(places)}")
        files.append(keep)
    data = DataFiles(config, column, previous)
    if previous:
        settings["previous"] = [read_data(path, "points or measurements", data.previous, problem.model) for path in previous]
        files += previous
    planned = settings_of(problem, settings)
    if keep is not None and not len(kept) < planned.n_experiments:
        raise ConfigError(f"{keep}: expected fewer points than the design has, {planned.n_experiments}; given {len(kept)}")
    if not frame.check and (planned.goal.share_of_plants is not None or isinstance(problem.rule, fp.Sobol)):
        with importing():
            import scipy.special  # noqa: F401  not where it is needed, in the middle of the search, which Ctrl-C is to end in order

    def plan() -> list[Row]:
        given = [points_row(f"kept, of {keep}", kept)] if keep is not None else []
        return [*given, *search_rows(problem, planned)]

    def compute(drawing: Drawers) -> Outcome:
        found, earlier = None, {name: settings.get(name) for name in ("previous", "keep")}
        try:
            with opened(frame.workers) as workers:
                computed_by: dict[str, Any] = {"threads": frame.threads, "workers": workers}
                for found in designs(problem, planned, **earlier, **computed_by, progress=not frame.quiet):
                    drawing.begin(plots_of(found))  # but for the criterion's, which shows what is compared in the end
        except KeyboardInterrupt:
            if found is None:
                raise
            found = replace(found, stop_reason=fp.StopReason.interrupted)
        assert found is not None
        interrupted = found.stop_reason == fp.StopReason.interrupted
        return Outcome(
            report=found.report,
            write=partial(_write, found),
            draw=partial(write_shown, found, file),
            interrupted=interrupted,
            advice=_advice(file, frame.output) if interrupted and frame.output is not None else (),
        )

    pictures, before = "fisherpoint.design.results.pictures", "a design was found"
    return frame.run(Task(problem=problem, files=files, plan=plan, pictures=pictures, compute=compute, before=before))


def _write(found: fp.Design, directory: Path, report: Callable[[], str]) -> list[str]:
    from fisherpoint.basics.files import write_whole

    found.save(directory)
    write_whole(directory / "report.txt", report())
    return ["design.csv", "design.json", "report.txt"]


def _advice(file: Path, output: Path) -> list[str]:
    return [f"For pictures: {shell_line('fisherpoint', 'evaluate', file, output / 'design.csv', '-o', output / 'evaluated')}"]


def _with_over(settings: dict[str, Any], over: Over | None) -> dict[str, Any]:
    if over is None:
        return settings
    goal: fp.Goal = settings["goal"]
    in_file = fp.OverPrior(over.value) if goal.over is None else replace(goal.over, kind=over.value)
    return settings | {"goal": replace(goal, over=in_file)}
