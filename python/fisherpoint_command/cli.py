"""The command line: ``fisherpoint design | evaluate | compare | simulate | estimate | validate | campaign | info``."""

from __future__ import annotations

import io
import os
import platform
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from enum import StrEnum
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Annotated, Any

import numpy as np

import fisherpoint as fp
from fisherpoint.basics.extras import needed_for
from fisherpoint.basics.messages import printable

try:
    import typer
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    from fisherpoint.basics.files import write_together, write_whole
    from fisherpoint.design.configuration import ConfigError, load_config
    from fisherpoint.design.evaluated import Evaluated, evaluate_points
    from fisherpoint.design.files import PICTURES
    from fisherpoint.design.frames import parameter_frame, simulation_frame
    from fisherpoint.design.report import evaluation_report, simulation_report

    from .campaign import campaign
    from .compare import compare
    from .estimate import estimate
    from .runs import design_of_runs, evaluate_runs, read_points, read_told, simulate_runs
    from .terminal import (
        INTERRUPTED,
        MISUSE,
        READER_LEFT,
        NoPlots,
        Output,
        Quiet,
        Threads,
        as_file,
        check_file,
        make_directory,
        read_data,
        say,
        show,
    )
    from .validate import validate
except ModuleNotFoundError as missing:
    if (missing.name or "").startswith("fisherpoint"):
        raise
    package = (missing.name or "").partition(".")[0]
    print(f"fisherpoint: the command line needs {package}: pip install 'fisherpoint[all]'", file=sys.stderr)
    raise SystemExit(2) from None

app = typer.Typer(
    help="Which short experiments to run so that the parameters of a nonlinear state space model come out precise.",
    epilog="Example: fisherpoint design examples/cylinder.toml -o run/",
    add_completion=False,
    pretty_exceptions_enable=False,
)

File = Annotated[Path, typer.Argument(metavar="FILE.toml", help="Model, prior, sensor noise and region.")]
Points = Annotated[Path, typer.Argument(metavar="POINTS.csv", help="Points, with the columns of a design.csv.")]


def _version(asked: bool) -> None:
    if asked:
        print(f"fisherpoint {fp.__version__}")
        raise typer.Exit


@app.callback()
def _main(
    show_version: Annotated[bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")] = False,
) -> None:
    """Which short experiments to run so that the parameters of a nonlinear state space model come out precise."""


class Method(StrEnum):
    """How `fisherpoint design` searches for points."""

    paper = "paper"
    auto = "auto"


class Over(StrEnum):
    """What `fisherpoint design` maximises over the prior, in the place of log det F at its mean."""

    log = "log"
    worst = "worst"
    cvar = "cvar"


@app.command(epilog="Example: fisherpoint design examples/cylinder.toml -o run/")
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
    previous: Annotated[
        list[Path] | None,
        typer.Option(metavar="DATA.csv", help="What is already measured, or planned besides: adds to what the design tells."),
    ] = None,
    no_plots: NoPlots = False,
    quiet: Quiet = False,
) -> int:
    """Find the experiment points, or with a table of runs in the file the runs, that determine the parameters best.

    Writes design.csv, design.json, report.txt and pictures. Ctrl-C stops early and keeps the best design so far.
    """
    config = load_config(file)
    if config.region is None:
        raise config.error("region", "missing; expected a table with bounds of every state, every input and dt")
    if config.runs is not None:
        for option, paths in (("--keep", keep), ("--previous", previous)):
            if paths:
                raise ConfigError(f"{option}: expected a file with points to design; {file} has a table [runs]")
        return design_of_runs(config, output, seed, threads, no_plots, quiet)
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
    save_pictures = None if no_plots else _picture_writer(output)
    make_directory(output)

    try:
        found = _exchange(problem, settings, threads, show=not quiet)
    except KeyboardInterrupt:
        _complain("interrupted before a design was found; nothing was saved")
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


@app.command(epilog="Example: fisherpoint evaluate examples/cylinder.toml run/design.csv")
def evaluate(
    file: File,
    points: Points,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="DIR", help="Directory for report, table and pictures.")
    ] = None,
) -> int:
    """Tell what given experiment points are worth: standard errors, correlation, what they do not determine."""
    config = load_config(file)
    problem = config.problem()
    save_pictures = _picture_writer(output) if output else None
    experiments = read_data(points, "points", read_points, config.build_model())
    if output:
        make_directory(output)
    if isinstance(experiments, fp.Runs):
        return evaluate_runs(problem, experiments, output)
    evaluated = evaluate_points(problem, experiments)
    report = evaluation_report(evaluated)
    show(report)
    if output and save_pictures:
        table = parameter_frame(problem, evaluated.under_noise).to_csv()
        write_together(output, {"parameters.csv": table, "report.txt": as_file(report)}, stale=PICTURES[1:])
        save_pictures(evaluated)
    return 0


@app.command(epilog="Example: fisherpoint simulate examples/cylinder.toml run/design.csv -o outputs.csv")
def simulate(
    file: File,
    points: Points,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FILE.csv", help="File for points, outputs and statuses.")
    ] = None,
) -> int:
    """Simulate given experiment points at the prior mean: the outputs after dt, and what went wrong where.

    Kinks and jumps are crossed or not as the file says.
    """
    config = load_config(file)
    model, prior = config.build_model(), config.build_prior()
    experiments = read_data(points, "points", read_points, config.build_model())
    if output:
        check_file(output)
    theta = np.array([prior.mean[quantity.name] for quantity in model.parameters])
    if isinstance(experiments, fp.Runs):
        return simulate_runs(model, experiments, theta, config.crossings(), output)
    done = fp.simulate(model, experiments, theta, **config.crossings())
    show(simulation_report(model, experiments, done.y, done.status))
    if output:
        write_whole(output, simulation_frame(model, experiments, done.y, done.status).to_csv(index=False))
    return 0


app.command(epilog="Example: fisherpoint compare examples/cylinder.toml run/design.csv other/design.csv")(compare)
app.command(epilog="Example: fisherpoint estimate examples/cylinder.toml measured.csv -o fit/")(estimate)
app.command(epilog="Example: fisherpoint validate examples/cylinder.toml run/design.csv -o validated/")(validate)
app.command(epilog="Example: fisherpoint campaign examples/cylinder.toml -o run/ --data measured.csv")(campaign)


@app.command(epilog="Example: fisherpoint info")
def info() -> int:
    """Show versions and the instruction set in use."""
    print(f"fisherpoint      {fp.__version__}")
    print(f"instruction set  {fp.isa()} (available: {', '.join(fp.available_isas())})")
    print(f"processors       {os.cpu_count()}")
    print(f"Python           {platform.python_version()} on {platform.system()} {platform.machine()}")
    for package in ("numpy", "scipy", "sympy", "pydantic", "typer", "rich", "pandas", "matplotlib"):
        try:
            print(f"{package:<15}  {version(package)}")
        except PackageNotFoundError:
            print(f"{package:<15}  not installed")
    return 0


def main(arguments: Sequence[str] | None = None) -> None:
    """Entry point: run a command and exit with its code, with one line on standard error where it fails."""
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal that cannot show a line of a table shows a mark
    code = _run(arguments or ["--help"])
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:
            # It was told; without this Python complains once more when it flushes at exit.
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
    sys.exit(code)


def _run(arguments: list[str]) -> int:
    try:
        command = typer.main.get_command(app)
        with command.make_context("fisherpoint", arguments) as context:  # typer's own way ends without a word at Ctrl-C
            code: int = command.invoke(context) or 0
        sys.stdout.flush()
        return code
    except typer.Exit as left:  # after --help and --version
        return left.exit_code
    except KeyboardInterrupt:
        return _interrupted()
    except typer.TyperException as error:
        return _fail(f"{error.format_message().rstrip('.')}; try fisherpoint --help")
    except ImportError as error:
        if _came_of_an_interrupt(error):
            return _interrupted()
        pictures = error.name == "matplotlib"
        return _fail(f"{error}, or use --no-plots" if pictures else str(error))
    except ConfigError as error:
        return _fail(str(error))
    except BrokenPipeError:  # the reader of a pipe has left
        return READER_LEFT
    except OSError as error:
        return _fail(f"{error.filename or 'output'}: {error.strerror or error}")
    except (ValueError, TypeError) as error:
        return _fail(str(error))


def _interrupted() -> int:
    _complain("interrupted")
    return INTERRUPTED


def _came_of_an_interrupt(error: BaseException | None) -> bool:
    """Whether Ctrl-C is behind an error: modules that are not written in Python fail to import then."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error is not None


def _fail(message: str) -> int:
    _complain(message)
    return MISUSE


def _complain(message: str) -> None:
    with suppress(OSError):
        print(f"fisherpoint: {printable(' '.join(message.split()))}", file=sys.stderr)


def _picture_writer(directory: Path) -> Callable[[Evaluated], list[Path]]:
    """The function that draws all pictures; importing it here keeps matplotlib out of commands without pictures."""
    with needed_for("pictures"):
        from fisherpoint.design.pictures import save_all

    return lambda evaluated: save_all(evaluated, directory)


def _exchange(problem: fp.DesignProblem, settings: dict[str, Any], threads: int | None, show: bool) -> fp.Design:
    """Run the exchange under a progress bar on standard error."""
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


if __name__ == "__main__":
    main()
