"""``fisherpoint compare``: designs beside each other."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

import fisherpoint as fp

from .importing import importing
from .options import Check, Designs, Force, NoPlots, OutputIfAny, Quiet, Threads
from .standard_input import one_from_standard_input

DRAWS = 1000
"""Plants on which designs are tried, by default."""


def compare(
    file: Annotated[
        Path, typer.Argument(metavar="FILE.toml", callback=one_from_standard_input, help="Model, prior and sensor noise.")
    ],
    designs: Designs,
    output: OutputIfAny = None,
    seed: Annotated[int, typer.Option(min=0, metavar="N", help="Of the plants on which the designs are tried.")] = 0,
    threads: Threads = None,
    check: Check = False,
    no_plots: NoPlots = False,
    force: Force = False,
    quiet: Quiet = False,
) -> int:
    """Compare the effort and the worth of designs.

    With -o, writes comparison.csv, report.txt, comparison.png, and report.html, which shows all of it in a browser.
    """
    with importing():
        import fisherpoint.design.compare  # noqa: F401  with all that it imports
        from fisherpoint.basics.files import write_together

        from .drawing import drawers
        from .dry_run import about, points_row, show_plan, size_of
        from .heartbeat import alive
        from .results import free_directory, make_directory, remove_old
        from .runs import read_points
        from .terminal import as_file, named_files, read_config, read_data, say, show, warn_of_outside
        from .written import PAGE, write_shown
    config = read_config(file)
    problem = config.problem()
    if problem.noise_std is None:
        raise config.error("noise_std", "missing; expected the noise of every output, as designs are compared by it")
    points = {name: read_data(path, "points", read_points, problem.model) for name, path in named_files(designs).items()}
    for path, given in zip(designs, points.values(), strict=True):
        warn_of_outside(problem, path, given)
    old = free_directory(output, force)
    if check:
        size = sum(map(size_of, points.values())) * DRAWS
        rows = [*(points_row(name, given) for name, given in points.items()), about(size, f"{DRAWS} plants, seed {seed}")]
        return show_plan(problem, [file, *designs], rows, output)
    with drawers(None if output is None or no_plots else "fisherpoint.design.compare_picture") as drawing:
        with alive("comparing"):
            found = fp.compare(problem, points, seed=seed, threads=threads)
        if not quiet:
            show(found.report())
        if output is not None:
            make_directory(output, old)
            contents = {"comparison.csv": found.to_pandas().to_csv(), "report.txt": as_file(found.report())}
            written = [path.name for path in write_together(output, contents, stale=["comparison.png", PAGE])]
            written += write_shown(found, output, drawing, file)
            if not quiet:
                print()
                say(f"Written to {output}: {', '.join(written)}")
            remove_old(output, old, written, quiet)
    return 0
