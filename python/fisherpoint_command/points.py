"""``fisherpoint evaluate`` and ``fisherpoint simulate``: what given points are worth, and what they lead to."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import fisherpoint as fp
from fisherpoint.basics.extras import needed_for

from .frame import Frame, Outcome, Task
from .importing import importing
from .options import Check, File, OutputIfAny, Points, Quiet, Threads, framed

if TYPE_CHECKING:
    from fisherpoint.show.display import Plots
    from fisherpoint.show.section import Report

    from .drawing import Drawers
    from .dry_run import Row


def measured(problem: fp.DesignProblem, points: fp.Experiments | fp.Runs, seed: int) -> tuple[str, str]:
    """The text of a file of measurements, and in a line what was done."""
    from fisherpoint.data.measurement_files import measurements_csv
    from fisherpoint.show.numbers import counted

    starts = problem.initial_state_std
    rig = fp.VirtualRig(problem.model, problem.prior.mean, problem.noise or {}, initial_state_std=starts, seed=seed)
    data = rig.measure(points)
    what = counted(len(points), points.kind)
    return measurements_csv(data.points, data.y, problem.model), f"{what} measured virtually at the prior mean, seed {seed}"


@framed(OutputIfAny)
def evaluate(frame: Frame, file: File, points: Points) -> int:
    """Report what given experiment points are worth: standard errors, correlation, what they do not determine.

    With -o, writes parameters.csv, report.txt, pictures, and report.html, which shows all of it in a browser.
    """
    with importing():
        from fisherpoint.design.results.evaluated_points import evaluate_points
        from fisherpoint.design.results.picture_list import PICTURES, plots_of
        from fisherpoint.design.results.report import evaluation_report
        from fisherpoint.design.runs import run_picture_list as run_plots
        from fisherpoint.points.outside_region import few, outside
        from fisherpoint.points.points_or_runs import as_runs

        from .dry_run import about, points_row, size_of
        from .heartbeat import alive
        from .runs import RUN_PICTURES, read_points
        from .terminal import read_config, read_data
    config = read_config(file)
    problem = config.problem()
    experiments = read_data(points, "points", read_points, problem.model)
    runs = as_runs(experiments)
    if frame.output and not frame.check:
        with importing(), needed_for("tables and pictures"):
            from fisherpoint.design.results.frames import parameter_frame

    def plan() -> list[Row]:
        nodes = problem.rule.size(problem.prior)
        trajectories = about(size_of(experiments) * (2 + nodes), f"{nodes} nodes of the prior, and the mean")
        return [points_row("points", experiments), trajectories]

    def compute_points(_: Drawers) -> Outcome:
        with alive("evaluating"):
            evaluated = evaluate_points(problem, runs.starts, frame.threads)
            report = evaluation_report(evaluated)

        def table() -> str:
            return parameter_frame(problem, evaluated.under_noise).to_csv()

        return _outcome(problem, file, report, table, plots_of(evaluated), PICTURES[1:])

    def compute_runs(_: Drawers) -> Outcome:
        with alive("evaluating"):
            evaluation = fp.evaluate(problem, runs, threads=frame.threads)
            report = evaluation.report()
            if places := list(outside(problem.model, problem.region, runs)):
                report = replace(report, warnings=[*report.warnings, f"Outside of the region: {few(places, 10)}."])
        plots = run_plots.plots_of(problem, runs, evaluation)
        return _outcome(problem, file, report, lambda: evaluation.to_pandas().to_csv(), plots, run_plots.PICTURES)

    of_runs = experiments is runs
    return frame.run(
        Task(
            problem=problem,
            files=[file, points],
            plan=plan,
            pictures=RUN_PICTURES if of_runs else "fisherpoint.design.results.pictures",
            compute=compute_runs if of_runs else compute_points,
        )
    )


def _outcome(
    problem: fp.DesignProblem, file: Path, report: Report, table: Callable[[], str], plots: Plots, pictures: Sequence[str]
) -> Outcome:
    """What came of an evaluation; `pictures` are the names of all that there may be."""
    from fisherpoint.information.problem_report import problem_sections

    from .written_results import write_page, write_tables

    return Outcome(
        report=lambda: report,
        write=partial(write_tables, {"parameters.csv": table}, pictures),
        draw=partial(write_page, report, problem_sections(problem), plots, file),
    )


def simulate(
    file: File,
    points: Points,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="FILE.csv", help="File for points, outputs and statuses; - for standard output."),
    ] = None,
    noise: Annotated[
        bool,
        typer.Option("--noise", help="Virtual data, which estimate reads: with noise by \\[noise] and \\[initial_state_std]."),
    ] = False,
    seed: Annotated[int | None, typer.Option(min=0, metavar="N", help="Of the noise; default 0.")] = None,
    threads: Threads = None,
    check: Check = False,
    force: Annotated[bool, typer.Option("--force", help="Replace a file that is there.")] = False,
    quiet: Quiet = False,
) -> int:
    """Simulate given experiment points at the prior mean: the outputs after dt, and what went wrong where.

    Kinks and jumps are crossed or not as the file says. With --noise, these are virtual measurements: they cross all that can be
    crossed, and a point that does not reach its end has no outputs.
    """
    with importing():
        from fisherpoint.basics.files import write_whole
        from fisherpoint.design.file.configuration import ConfigError
        from fisherpoint.design.results.report import simulation_report
        from fisherpoint.points.points_or_runs import as_runs

        from .dry_run import about, points_row, show_plan, size_of
        from .heartbeat import alive
        from .points import measured
        from .runs import read_points, run_report, run_simulation_csv
        from .terminal import check_file, read_config, read_data, show
    if output:
        with importing(), needed_for("tables"):
            from fisherpoint.design.results.frames import simulation_frame
    if seed is not None and not noise:
        raise ConfigError(f"--seed: expected only with --noise, whose random numbers it gives; given {seed} without")
    config = read_config(file)
    problem = config.problem()
    if noise and problem.noise is None:
        raise config.error("noise", "missing; expected the noise of every output with --noise")
    model = problem.model
    experiments = read_data(points, "points", read_points, model)
    to_standard_output = output is not None and str(output) == "-"
    if output is not None and not to_standard_output:
        check_file(output, force)
    if check:
        virtual = [("noise", f"by [noise], seed {seed or 0}")] if noise else []
        return show_plan(
            problem, [file, points], [points_row("points", experiments), *virtual, about(size_of(experiments))], output
        )
    if noise:
        text, headline = measured(problem, experiments, seed or 0)
        if not quiet and not to_standard_output and output is not None:
            print(headline)
        if output is None and not quiet:
            print(text, end="")
    else:
        crossings = config.crossings()
        with alive("simulating"):
            done = fp.simulate(model, experiments, problem.theta, threads=threads, **crossings)
        runs = as_runs(experiments)
        if experiments is runs:
            text = run_simulation_csv(model, runs, done)
            if not quiet and not to_standard_output:
                print(run_report(runs, done))
                if output is None:
                    print(text, end="")
        else:
            if not quiet and not to_standard_output:
                show(simulation_report(model, runs.starts, done.y, done.status))
            text = simulation_frame(model, runs.starts, done.y, done.status).to_csv(index=False) if output else ""
    if to_standard_output:
        print(text, end="")
    elif output:
        write_whole(output, text)
    return 0
