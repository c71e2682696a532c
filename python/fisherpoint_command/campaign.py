"""``fisherpoint campaign``: the next batch to measure, and the results of the measured ones."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import fisherpoint as fp
from fisherpoint.basics.messages import printable

from .argv import shell_line
from .exits import INTERRUPTED
from .frame import Frame
from .importing import importing
from .options import Columns, Output, Seed, framed
from .partial_output import begin_writing
from .standard_input import one_from_standard_input

if TYPE_CHECKING:
    from fisherpoint.design.file.configuration import Config


@framed(Output, force=False)
def campaign(
    frame: Frame,
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE.toml",
            callback=one_from_standard_input,
            help="Model, prior, sensor noise, region and \\[campaign].",
        ),
    ],
    data: Annotated[
        Path | None,
        typer.Option(
            metavar="MEASURED.csv",
            callback=one_from_standard_input,
            help="The measured batch: the columns of batch_<k>.csv, and y_<output> for each measured output.",
        ),
    ] = None,
    column: Columns = None,
    size: Annotated[
        int | None,
        typer.Option("-L", "--size", min=1, metavar="N", help="Points, or runs, of a batch; overrides the file."),
    ] = None,
    seed: Seed = None,
) -> int:
    """Design, measure and estimate in batches of points or of runs, until the relative standard errors are at their targets.

    Starts a campaign or goes on with the one in DIR, takes the measured batch, and writes the next batch to measure. Everything is
    saved at once: after a kill the same command goes on.
    """
    with importing():
        import fisherpoint.campaign.campaign  # noqa: F401  with all that it imports
        from fisherpoint.basics.files import write_whole
        from fisherpoint.design.file.configuration import ConfigError

        from .drawing import drawers
        from .results import free_for_campaign
        from .terminal import as_file, read_config
        from .written_results import write_shown
    config, output = read_config(file), frame.output
    settings = _settings(config, size, seed)
    if output is not None:
        free_for_campaign(output, fp.Campaign.is_in)
    if frame.check:
        return _check(config, settings, file, output, data, _read(config, data, column))
    assert output is not None
    with drawers(None if frame.no_plots else "fisherpoint.campaign.pictures") as drawing:
        begin_writing(output)
        try:
            measured = _read(config, data, column)
            run = _opened(config, settings, output, frame.threads)
            lines = [] if data is None or measured is None else _taken(run, data, measured, progress=not frame.quiet)
            if not run.done or run.planned is not None:
                run.next(progress=not frame.quiet)
        except RuntimeError as error:  # another process
            raise ConfigError(str(error)) from error
        except KeyboardInterrupt:
            print("fisherpoint: interrupted before a batch was found; run the same command to continue", file=sys.stderr)
            return INTERRUPTED
        if run.history:
            write_whole(output / "report.txt", as_file(run.report()))
            lines += ["", str(run)]
        written = ["report.txt"] if run.history else []
        written += write_shown(run, file, output, drawing)
    lines += ["", f"Written to {output}: {', '.join(written)}"]
    if run.planned is not None:
        lines += ["", *_to_do(run, file, output)]
    if not frame.quiet:
        print("\n".join(map(printable, "\n".join(lines).strip("\n").split("\n"))))
    return 0


def _settings(config: Config, size: int | None, seed: int | None) -> dict[str, Any]:
    """What a campaign is given beside its problem."""
    if config.region is None:
        raise config.error("region", "missing; expected a table with bounds of every state, every input and dt")
    settings, table = config.exchange_settings() if config.runs is None else config.run_settings(), config.campaign
    if getattr(settings.get("method", ()), "time_limit", settings.get("time_limit")) is not None:
        raise config.error("design.time_limit", "expected none with a campaign, as each run has to come to the same points")
    settings.pop("n_experiments" if config.runs is None else "n_runs", None)
    for name, value in (("batch", table.batch), ("batch", size), ("seed", seed)):
        if value is not None:
            settings[name] = value
    return settings | {"targets": table.targets}


def _check(
    config: Config, settings: dict[str, Any], file: Path, output: Path | None, data: Path | None, measured: fp.Measurements | None
) -> int:
    """Look at the campaign that there is, or would be, and at the data."""
    from fisherpoint.show.numbers import counted, percent

    from .dry_run import run_rows, search_rows, settings_of, show_plan

    rows, files = [("campaign", "a new one")], [file]
    if output is not None and fp.Campaign.is_in(output):
        found = fp.Campaign.load(output)
        _refuse_changes(config, fp.Campaign(config.problem(), **settings), found, output)
        rows = [("campaign", f"the one in {output}, {counted(len(found.history), 'batch', 'batches')} measured")]
    run = fp.Campaign(config.problem(), **settings)
    if data is not None:
        rows.append(("data", repr(measured)))
        files.append(data)
    given = vars(run.settings)
    rows.append(("batch", str(run.batch)))
    if run.targets:
        rows.append(("targets", ", ".join(f"{name} {percent(target)}" for name, target in run.targets.items())))
    if isinstance(run.settings, fp.results.ExchangeSettings):
        rows += search_rows(run.problem, settings_of(run.problem, given))[1:]
    else:
        rows += run_rows(run.problem, given)
    return show_plan(run.problem, files, rows, output)


def _opened(config: Config, settings: dict[str, Any], directory: Path, threads: int | None) -> fp.Campaign:
    """The campaign in the directory, which must be the file's but for the targets; or a new one."""
    if not fp.Campaign.is_in(directory):
        return fp.Campaign(config.problem(), directory=directory, threads=threads, **settings)
    given = fp.Campaign(config.problem(), **settings)
    found = fp.Campaign.load(directory, threads=threads)
    _refuse_changes(config, given, found, directory)
    if found.targets != given.targets:
        found.targets = given.targets
    return found


def _refuse_changes(config: Config, given: fp.Campaign, found: fp.Campaign, directory: Path) -> None:
    from .config_diff import first_difference

    change = first_difference(given, found, directory)
    if change is not None:
        key, text = change
        raise config.error(key, f"{text}; another needs another directory")


def _read(config: Config, path: Path | None, column: list[str] | None) -> fp.Measurements | None:
    from .tables import DataFiles
    from .terminal import read_data

    files = DataFiles(config, column, None if path is None else [path])
    return None if path is None else read_data(path, "measurements", files.measurements, config.build_model())


def _taken(run: fp.Campaign, path: Path, data: fp.Measurements, progress: bool) -> list[str]:
    """Take the measured batch, but not twice: a command that was killed is given again."""
    before = run.known_batch(data)
    if before is not None:
        return [f"{path}: these are the data of batch {before}, which were taken before"]
    run.tell(data, progress=progress)
    return [f"{path}: taken as batch {len(run.history)}"]


def _to_do(run: fp.Campaign, file: Path, output: Path) -> list[str]:
    outputs = ", ".join(f"y_{quantity.name}" for quantity in run.problem.model.outputs)
    k, of_runs = len(run.history) + 1, run.planned is not None and run.planned.kind == "run"
    what, table = "runs" if of_runs else "points", output / f"batch_{k}.csv"
    return [
        *([f"The time table of the next batch is {output / f'plan_{k}.csv'}."] if of_runs else []),
        f"Measure the {what} of {table}, in a file with these columns and {outputs}, then:",
        f"  {shell_line('fisherpoint', 'campaign', file, '-o', output, '--data', 'MEASURED.csv')}",
    ]
