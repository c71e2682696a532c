"""``fisherpoint campaign``: the next batch to measure, and what the measured ones tell."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import fisherpoint as fp
from fisherpoint.basics.extras import needed_for
from fisherpoint.basics.messages import printable

from .asked import shell_line
from .exits import INTERRUPTED
from .importing import importing
from .options import NoPlots, Output, Quiet, Threads

if TYPE_CHECKING:
    from fisherpoint.design.configuration import Config


def campaign(
    file: Annotated[Path, typer.Argument(metavar="FILE.toml", help="Model, prior, sensor noise, region and \\[campaign].")],
    output: Output,
    data: Annotated[
        Path | None,
        typer.Option(
            metavar="MEASURED.csv",
            help="The measured batch: the columns of batch_<k>.csv, and y_<output> for each measured output.",
        ),
    ] = None,
    threads: Threads = None,
    no_plots: NoPlots = False,
    quiet: Quiet = False,
) -> int:
    """Design, measure and estimate in batches of points or of runs, until the relative standard errors are at their targets.

    Starts a campaign or goes on with the one in DIR, takes the measured batch, and writes the next batch to measure. Everything is
    saved at once: after a kill the same command goes on.
    """
    with importing():
        import fisherpoint.campaign.campaign  # noqa: F401  with all that it imports
        from fisherpoint.basics.files import write_whole
        from fisherpoint.design.configuration import ConfigError, load_config

        from .terminal import as_file, make_directory
        from .written import write_shown
    config = load_config(file)
    if not no_plots:
        with importing(), needed_for("pictures"):
            from fisherpoint.campaign import pictures as plots_campaign  # noqa: F401  what can fail for a trivial reason fails before the work
    make_directory(output)
    try:
        run = _opened(config, output, threads)
        lines = [] if data is None else _taken(run, data)
        if not run.done or run.planned is not None:
            run.next()
    except RuntimeError as error:  # another process
        raise ConfigError(str(error)) from error
    except KeyboardInterrupt:
        print("fisherpoint: interrupted before a batch was found; run the same command to continue", file=sys.stderr)
        return INTERRUPTED
    if run.history:
        write_whole(output / "report.txt", as_file(run.report()))
        lines += ["", str(run)]
    written = ["report.txt"] if run.history else []
    written += write_shown(run, output, {} if no_plots else run._plots(), file)
    lines += ["", f"Written to {output}: {', '.join(written)}"]
    if run.planned is not None:
        lines += ["", *_to_do(run, file, output)]
    if not quiet:
        print("\n".join(map(printable, "\n".join(lines).strip("\n").split("\n"))))
    return 0


def _opened(config: Config, directory: Path, threads: int | None) -> fp.Campaign:
    """The campaign in the directory, which must be the file's but for the targets; or a new one."""
    from fisherpoint.information.codec import problem_to_json

    if config.region is None:
        raise config.error("region", "missing; expected a table with bounds of every state, every input and dt")
    settings, table = config.exchange_settings() if config.runs is None else config.run_settings(), config.campaign
    if "time_limit" in settings:
        raise config.error("design.time_limit", "expected none with a campaign, of which each run has to come to the same points")
    settings.pop("n_experiments" if config.runs is None else "n_runs", None)
    if table.batch is not None:
        settings["batch"] = table.batch
    if not fp.Campaign.is_in(directory):
        return fp.Campaign(config.problem(), targets=table.targets, directory=directory, threads=threads, **settings)
    given = fp.Campaign(config.problem(), targets=table.targets, **settings)
    found = fp.Campaign.load(directory, threads=threads)
    here, there = problem_to_json(given.problem), problem_to_json(found.problem)
    other = [name for name in here if name != "derived" and here[name] != there[name]]
    other += [name for name in ("batch", "settings") if getattr(given, name) != getattr(found, name)]
    if other:
        name, was = other[0], f"what the campaign in {directory} was started with"
        if name in ("kinks", "jumps"):  # which the file may leave to a default
            raise config.error(f"design.{name}", f'expected "{there[name]}", {was}, given "{here[name]}"')
        raise config.error(name, f"expected {was}; another needs another directory")
    if found.targets != given.targets:
        found.targets = given.targets
    return found


def _taken(run: fp.Campaign, path: Path) -> list[str]:
    """Take the measured batch, but not twice: a command that was killed is given again."""
    from .terminal import read_data

    data = read_data(path, "measurements", fp.Measurements.from_csv, run.problem.model)
    before = run.told(data)
    if before is not None:
        return [f"{path}: these are the data of batch {before}, which were taken before"]
    run.tell(data)
    return [f"{path}: taken as batch {len(run.history)}"]


def _to_do(run: fp.Campaign, file: Path, output: Path) -> list[str]:
    outputs = ", ".join(f"y_{quantity.name}" for quantity in run.problem.model.outputs)
    k, of_runs = len(run.history) + 1, isinstance(run.planned, fp.Runs)
    what, table = "runs" if of_runs else "points", output / f"batch_{k}.csv"
    return [
        *([f"The time table of the next batch is {output / f'plan_{k}.csv'}."] if of_runs else []),
        f"Measure the {what} of {table}, in a file with these columns and {outputs}, then:",
        f"  {shell_line('fisherpoint', 'campaign', file, '-o', output, '--data', 'MEASURED.csv')}",
    ]
