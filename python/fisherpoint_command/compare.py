"""``fisherpoint compare``: designs beside each other."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

import fisherpoint as fp
from fisherpoint.basics.extras import needed_for

from .importing import importing
from .options import Force, NoPlots, Threads


def compare(
    file: Annotated[Path, typer.Argument(metavar="FILE.toml", help="Model, prior and sensor noise.")],
    designs: Annotated[
        list[Path], typer.Argument(metavar="DESIGN.csv...", help="Points or runs, with the columns of a design.csv.")
    ],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="DIR", help="Directory for report, table and picture.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, metavar="N", help="Of the plants on which the designs are tried.")] = 0,
    threads: Threads = None,
    no_plots: NoPlots = False,
    force: Force = False,
) -> int:
    """Tell what designs take and what they are worth, beside each other.

    With -o, writes comparison.csv, report.txt, comparison.png, and report.html, which shows all of it in a browser.
    """
    with importing():
        import fisherpoint.design.compare  # noqa: F401  with all that it imports
        from fisherpoint.basics.files import write_together
        from fisherpoint.design.configuration import load_config

        from .results import make_free_directory, remove_old
        from .runs import read_points
        from .terminal import as_file, named_files, read_data, say, show
        from .written import PAGE, write_shown
    config = load_config(file)
    problem = config.problem()
    if problem.noise_std is None:
        raise config.error("noise_std", "missing; expected the noise of every output, by which designs are compared")
    points = {name: read_data(path, "points", read_points, problem.model) for name, path in named_files(designs).items()}
    if output is not None:
        if not no_plots:
            with importing(), needed_for("pictures"):
                from fisherpoint.design import compare_picture  # noqa: F401  what can fail for a trivial reason fails before the work
        old = make_free_directory(output, force)
    found = fp.compare(problem, points, seed=seed, threads=threads)
    show(found.report())
    if output is not None:
        contents = {"comparison.csv": found.to_pandas().to_csv(), "report.txt": as_file(found.report())}
        written = [path.name for path in write_together(output, contents, stale=["comparison.png", PAGE])]
        written += write_shown(found, output, {} if no_plots else found._plots(), file)
        print()
        say(f"Written to {output}: {', '.join(written)}")
        remove_old(output, old, written)
    return 0
