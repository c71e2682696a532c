"""``fisherpoint validate``: whether designs keep what they promise, by virtual experiments."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

import fisherpoint as fp

from .exits import INTERRUPTED
from .importing import importing
from .options import Check, Designs, Force, Noise, NoPlots, Output, Quiet, Threads
from .standard_input import one_from_standard_input

ITERATIONS = 8
"""About how many iterations a fit takes."""


class Truth(StrEnum):
    """Where the true parameters come from."""

    prior = "prior"
    mean = "mean"


def validate(
    file: Annotated[
        Path, typer.Argument(metavar="FILE.toml", callback=one_from_standard_input, help="Model, prior and sensor noise.")
    ],
    designs: Designs,
    output: Output = None,
    runs: Annotated[
        int, typer.Option("-n", "--runs", min=1, max=10**6, metavar="N", help="Virtual experiments with each design.")
    ] = 1000,
    theta: Annotated[Truth, typer.Option(help="True parameters: drawn from the prior for each run, or its mean.")] = Truth.prior,
    noise: Annotated[Noise, typer.Option(help="Whether the fits know \\[noise_std] or estimate it.")] = Noise.known,
    use_prior: Annotated[bool, typer.Option("--use-prior", help="Use the prior in the fits and in the promise.")] = False,
    seed: Annotated[int, typer.Option(min=0, metavar="N", help="The same seed gives the same figures.")] = 0,
    threads: Threads = None,
    check: Check = False,
    no_plots: NoPlots = False,
    force: Force = False,
    quiet: Quiet = False,
) -> int:
    """Measure designs virtually many times, fit each time, and report whether the designs keep their promises.

    Writes validation.csv, report.txt, validation.png, and report.html, which shows all of it in a browser. Ctrl-C stops early
    and keeps what was found by then.
    """
    with importing():
        import rich.progress  # noqa: F401  for the bar

        import fisherpoint.validation.validate  # noqa: F401  with all that it imports
        from fisherpoint.basics.files import write_together

        from .drawing import drawers
        from .dry_run import about, points_row, show_plan, size_of
        from .results import free_directory, make_directory, needed, remove_old
        from .runs import read_points
        from .terminal import as_file, named_files, read_config, read_data, say, show, warn_of_outside
        from .written import PAGE, write_shown
    needed(output, check)
    config = read_config(file)
    problem = config.problem()
    if problem.noise_std is None:
        raise config.error("noise_std", "missing; expected the noise of every output, from which the promise is computed")
    points = {name: read_data(path, "points", read_points, problem.model) for name, path in named_files(designs).items()}
    for path, given in zip(designs, points.values(), strict=True):
        warn_of_outside(problem, path, given)
    old = free_directory(output, force)
    if check:
        rows = [points_row(name, given) for name, given in points.items()]
        rows.append(("virtual experiments", f"{runs} of each, seed {seed}, noise {noise.value} to the fits"))
        size = sum(map(size_of, points.values())) * runs
        return show_plan(
            problem, [file, *designs], [*rows, about(size * ITERATIONS, f"{ITERATIONS} iterations of each fit")], output
        )
    assert output is not None
    with drawers(None if no_plots else "fisherpoint.validation.pictures") as drawing:
        found = fp.validate(
            problem,
            points,
            runs=runs,
            theta=theta.value,
            seed=seed,
            noise=noise.value,
            use_prior=use_prior,
            threads=threads,
            progress=not quiet,
        )
        make_directory(output, old)
        contents = {"validation.csv": found.to_pandas().to_csv(), "report.txt": as_file(found.report())}
        written = [path.name for path in write_together(output, contents, stale=["validation.png", PAGE])]
        written += write_shown(found, output, drawing.unless(found.interrupted), file)
    if not quiet:
        show(found.report())
        print()
        say(f"Written to {output}: {', '.join(written)}")
    remove_old(output, old, written, quiet)
    return INTERRUPTED if found.interrupted else 0
