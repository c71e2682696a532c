"""``fisherpoint evaluate`` and ``fisherpoint simulate``: what given points are worth, and what they lead to."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

import fisherpoint as fp
from fisherpoint.basics.extras import needed_for

from .importing import importing
from .options import File, Force, Points


def evaluate(
    file: File,
    points: Points,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="DIR", help="Directory for report, table and pictures.")
    ] = None,
    force: Force = False,
) -> int:
    """Tell what given experiment points are worth: standard errors, correlation, what they do not determine."""
    with importing():
        from fisherpoint.basics.files import write_together
        from fisherpoint.design.configuration import load_config
        from fisherpoint.design.evaluated import evaluate_points
        from fisherpoint.design.files import PICTURES
        from fisherpoint.design.report import evaluation_report
        from fisherpoint.information.problem_report import problem_sections

        from .results import make_free_directory, remove_old
        from .runs import evaluate_runs, read_points
        from .terminal import as_file, read_data, show
        from .written import PAGE, write_page
    config = load_config(file)
    problem = config.problem()
    if output:
        with importing(), needed_for("tables and pictures"):
            from fisherpoint.design.frames import parameter_frame
            from fisherpoint.design.pictures import plots_of
    experiments = read_data(points, "points", read_points, config.build_model())
    old: list[str] = []
    if output:
        old = make_free_directory(output, force)
    if isinstance(experiments, fp.Runs):
        return evaluate_runs(problem, experiments, file, output, old)
    evaluated = evaluate_points(problem, experiments)
    report = evaluation_report(evaluated)
    show(report)
    if output:
        table = parameter_frame(problem, evaluated.under_noise).to_csv()
        write_together(output, {"parameters.csv": table, "report.txt": as_file(report)}, stale=[PAGE, *PICTURES[1:]])
        written = write_page(report, problem_sections(problem), output, plots_of(evaluated), file)
        remove_old(output, old, ["report.txt", *written])
    return 0


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
    with importing():
        import numpy as np

        from fisherpoint.basics.files import write_whole
        from fisherpoint.design.configuration import load_config
        from fisherpoint.design.report import simulation_report

        from .runs import read_points, simulate_runs
        from .terminal import check_file, read_data, show
    if output:
        with importing(), needed_for("tables"):
            from fisherpoint.design.frames import simulation_frame
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
