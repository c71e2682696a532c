"""``fisherpoint evaluate`` and ``fisherpoint simulate``: what given points are worth, and what they lead to."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

import fisherpoint as fp
from fisherpoint.basics.extras import needed_for

from .importing import importing
from .options import Check, File, Force, NoPlots, OutputIfAny, Points, Quiet, Threads


def evaluate(
    file: File,
    points: Points,
    output: OutputIfAny = None,
    threads: Threads = None,
    check: Check = False,
    no_plots: NoPlots = False,
    force: Force = False,
    quiet: Quiet = False,
) -> int:
    """Report what given experiment points are worth: standard errors, correlation, what they do not determine.

    With -o, writes parameters.csv, report.txt, pictures, and report.html, which shows all of it in a browser.
    """
    with importing():
        from fisherpoint.basics.files import write_together
        from fisherpoint.design.evaluated import evaluate_points
        from fisherpoint.design.plots import PICTURES, plots_of
        from fisherpoint.design.report import evaluation_report
        from fisherpoint.information.problem_report import problem_sections
        from fisherpoint.points.outside import few, outside
        from fisherpoint.points.runs import as_runs

        from .drawing import drawers
        from .dry_run import about, points_row, show_plan, size_of
        from .heartbeat import alive
        from .results import free_directory, make_directory, remove_old
        from .runs import RUN_PICTURES, evaluate_runs, read_points
        from .terminal import as_file, read_config, read_data, say, show
        from .written import PAGE, write_page
    config = read_config(file)
    problem = config.problem()
    experiments = read_data(points, "points", read_points, problem.model)
    old = free_directory(output, force)
    if check:
        nodes = problem.rule.size(problem.prior)
        trajectories = about(size_of(experiments) * (2 + nodes), f"{nodes} nodes of the prior, and the mean")
        return show_plan(problem, [file, points], [points_row("points", experiments), trajectories], output)
    if output:
        with importing(), needed_for("tables and pictures"):
            from fisherpoint.design.frames import parameter_frame
    runs = as_runs(experiments)
    pictures = RUN_PICTURES if experiments is runs else "fisherpoint.design.pictures"
    with drawers(None if output is None or no_plots else pictures) as drawing:
        with alive("evaluating"):
            if experiments is runs:
                evaluation = fp.evaluate_design(problem, runs, threads=threads)
                report = evaluation.report()
                if places := list(outside(problem.model, problem.region, runs)):
                    report = replace(report, warnings=[*report.warnings, f"Outside of the region: {few(places, 10)}."])
            else:
                evaluated = evaluate_points(problem, runs.starts, threads)
                report = evaluation_report(evaluated)
        if not quiet:
            show(report)
        if output:
            make_directory(output, old)
            if experiments is runs:
                return evaluate_runs(problem, runs, evaluation, report, file, output, old, drawing, quiet)
            table = parameter_frame(problem, evaluated.under_noise).to_csv()
            write_together(output, {"parameters.csv": table, "report.txt": as_file(report)}, stale=[PAGE, *PICTURES[1:]])
            written = write_page(report, problem_sections(problem), output, drawing, plots_of(evaluated), file)
            if not quiet:
                print()
                say(f"Written to {output}: {', '.join(['parameters.csv', 'report.txt', *written])}")
            remove_old(output, old, ["report.txt", *written], quiet)
    return 0


def simulate(
    file: File,
    points: Points,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="FILE.csv", help="File for points, outputs and statuses; - for standard output."),
    ] = None,
    noise: Annotated[
        bool,
        typer.Option("--noise", help="Virtual data, which estimate reads: with noise by \\[noise_std] and \\[initial_state_std]."),
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
        from fisherpoint.design.configuration import ConfigError
        from fisherpoint.design.report import simulation_report
        from fisherpoint.points.runs import as_runs

        from .dry_run import about, points_row, show_plan, size_of
        from .heartbeat import alive
        from .runs import read_points, run_report, run_simulation_csv
        from .terminal import check_file, read_config, read_data, show
        from .virtual import measured
    if output:
        with importing(), needed_for("tables"):
            from fisherpoint.design.frames import simulation_frame
    if seed is not None and not noise:
        raise ConfigError(f"--seed: expected only with --noise, whose random numbers it gives; given {seed} without")
    config = read_config(file)
    problem = config.problem()
    if noise and problem.noise_std is None:
        raise config.error("noise_std", "missing; expected the noise of every output with --noise")
    model = problem.model
    experiments = read_data(points, "points", read_points, model)
    to_standard_output = output is not None and str(output) == "-"
    if output is not None and not to_standard_output:
        check_file(output, force)
    if check:
        virtual = [("noise", f"by [noise_std], seed {seed or 0}")] if noise else []
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
