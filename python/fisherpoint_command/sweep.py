"""``fisherpoint sweep``: designs of several sizes, to choose how many experiments to run."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

import fisherpoint as fp

from .exits import INTERRUPTED, complain
from .importing import importing
from .options import Check, Force, NoPlots, Output, Previous, Quiet, Seed, Threads
from .standard_input import one_from_standard_input

MOST_SIZES = 1000
"""Most sizes of one sweep."""


def sweep(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE.toml", callback=one_from_standard_input, help="Model, prior, sensor noise, region, and costs."
        ),
    ],
    sizes: Annotated[str, typer.Option("-L", "--sizes", metavar="SIZES", help="Points of the designs, as 9:30 or 6,9,12.")],
    output: Output = None,
    budget: Annotated[
        float | None, typer.Option(metavar="COST", help="What a design may cost, by the file's table of costs.")
    ] = None,
    previous: Previous = None,
    seed: Seed = None,
    threads: Threads = None,
    check: Check = False,
    no_plots: NoPlots = False,
    force: Force = False,
    quiet: Quiet = False,
) -> int:
    """Find designs of several sizes, and report what more experiments add, and cost.

    Writes sweep.csv, sweep.json, report.txt, design_<size>.csv, sweep.png and report.html. Ctrl-C keeps the sizes that are done,
    or of the first one the best design so far.
    """
    with importing():
        import rich.progress  # noqa: F401  for the bar
        import scipy.special  # noqa: F401  not where it is needed, in the middle of the search, which Ctrl-C is to end in order

        import fisherpoint.design.sweep  # noqa: F401  with all that it imports
        from fisherpoint.basics.files import write_together
        from fisherpoint.design.configuration import ConfigError
        from fisherpoint.points.experiments import points_csv

        from .drawing import drawers
        from .dry_run import search_rows, settings_of, show_plan
        from .results import free_directory, make_directory, needed, remove_old
        from .runs import read_previous
        from .terminal import as_file, read_config, read_data, say, show
        from .written import PAGE, write_shown
    needed(output, check)
    config = read_config(file)
    if config.region is None or config.runs is not None:
        raise config.error("region", "expected bounds of every state, every input and dt, without a table [runs]")
    problem, cost = config.problem(), config.build_cost()
    if problem.noise_std is None:
        raise config.error("noise_std", "missing; expected the noise of every output, as sizes are compared by it")
    if budget is not None and not budget >= 0:
        raise ConfigError(f"--budget: expected a cost of at least 0, given {budget:g}")
    if budget is not None and cost is None:
        raise config.error("cost", "missing; expected a table [cost] with --budget")
    settings = {name: value for name, value in config.exchange_settings().items() if name != "n_experiments"}
    if seed is not None:
        settings["seed"] = seed
    counts = _sizes(sizes)
    if counts is None:
        raise ConfigError(f"--sizes: expected whole numbers, at most {MOST_SIZES} of them, as 9:30 or 6,9,12; given {sizes}")
    earlier = [read_data(path, "points or measurements", read_previous, problem.model) for path in previous or []]
    planned = settings_of(problem, settings | {"n_experiments": counts[-1]})
    old = free_directory(output, force)
    if check:
        *_, method, (_, each) = search_rows(problem, planned)
        rows = [("sizes", f"{len(counts)}, from {counts[0]} to {counts[-1]} points"), method, ("trajectories of a size", each)]
        return show_plan(problem, [file, *(previous or [])], rows, output)
    assert output is not None
    with drawers(None if no_plots else "fisherpoint.design.sweep_picture") as drawing:
        try:
            found = fp.sweep(problem, counts, cost=cost, threads=threads, progress=not quiet, previous=earlier or None, **settings)
        except KeyboardInterrupt:
            complain("interrupted before there was a design; nothing was saved")
            return INTERRUPTED
        make_directory(output, old)
        report = found.report()
        tables = {f"design_{len(of.points)}.csv": points_csv(of.points, problem.model) for of in found.designs}
        contents = {"sweep.csv": found.to_pandas().to_csv(), **tables, "report.txt": as_file(report)}
        stale = [path.name for path in output.glob("design_*.csv") if path.name not in tables]
        write_together(output, contents, stale=["sweep.png", PAGE, "sweep.json", *stale])
        found.save(output / "sweep.json")
        interrupted = found.stop_reason in (fp.StopReason.interrupted, fp.StopReason.interrupted_first)
        shown = write_shown(found, output, drawing.unless(interrupted), file)
    tables_told = f"design_<size>.csv of {len(tables)} sizes"
    written = ["sweep.csv", "sweep.json", "report.txt", *shown]
    if not quiet:
        show(report)
        print()
        if budget is not None:
            size = found.within(budget)
            enough = f"the design of {size} points has the most information" if size else "none of these sizes is enough"
            say(f"Within a budget of {budget:g}: {enough}.")
        say(f"Written to {output}: {', '.join([*written, tables_told])}")
    remove_old(output, old, written, quiet)
    return INTERRUPTED if interrupted else 0


def _sizes(text: str) -> list[int] | None:
    sizes: Sequence[int]
    try:
        if ":" in text:
            first, last = map(int, text.split(":"))
            sizes = range(first, last + 1)
        else:
            sizes = sorted({int(size) for size in text.split(",")})
    except ValueError:
        return None
    return list(sizes) if 0 < len(sizes) <= MOST_SIZES and sizes[0] >= 1 else None
