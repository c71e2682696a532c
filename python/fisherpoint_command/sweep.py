"""``fisherpoint sweep``: designs of several sizes, to choose how many experiments to run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import fisherpoint as fp

from .frame import Frame, Outcome, Task
from .importing import importing
from .options import Columns, Output, Previous, Seed, Starts, framed
from .standard_input import one_from_standard_input
from .workers import opened

if TYPE_CHECKING:
    from .drawing import Drawers
    from .dry_run import Row

MOST_SIZES = 1000
"""Most sizes of one sweep."""


@framed(Output, workers=True)
def sweep(
    frame: Frame,
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE.toml", callback=one_from_standard_input, help="Model, prior, sensor noise, region, and costs."
        ),
    ],
    sizes: Annotated[str, typer.Option("-L", "--sizes", metavar="SIZES", help="Points of the designs, as 9:30 or 6,9,12.")],
    budget: Annotated[
        float | None, typer.Option(metavar="COST", help="What a design may cost, by the file's table of costs.")
    ] = None,
    previous: Previous = None,
    column: Columns = None,
    seed: Seed = None,
    starts: Starts = None,
) -> int:
    """Find designs of several sizes, and report what more experiments add, and cost.

    Writes sweep.csv, sweep.json, report.txt, design_<size>.csv, sweep.png and report.html. Ctrl-C keeps the sizes that are done,
    or of the first one the best design so far.
    """
    with importing():
        import scipy.special  # noqa: F401  not where it is needed, in the middle of the search, which Ctrl-C is to end in order

        import fisherpoint.design.sweep.sweep  # noqa: F401  with all that it imports
        from fisherpoint.basics.files import write_together
        from fisherpoint.design.file.configuration import ConfigError
        from fisherpoint.points.experiments import points_csv

        from .dry_run import search_rows, settings_of
        from .tables import DataFiles
        from .terminal import read_config, read_data
        from .written_results import PAGE, write_shown
    config = read_config(file)
    if config.region is None or config.runs is not None:
        raise config.error("region", "expected bounds of every state, every input and dt, without a table [runs]")
    problem, cost = config.problem(), config.build_cost()
    if problem.noise is None:
        raise config.error("noise", "missing; expected the noise of every output, as sizes are compared by it")
    if budget is not None and not budget >= 0:
        raise ConfigError(f"--budget: expected a cost of at least 0, given {budget:g}")
    if budget is not None and cost is None:
        raise config.error("cost", "missing; expected a table [cost] with --budget")
    settings = {name: value for name, value in config.exchange_settings().items() if name != "n_experiments"}
    if seed is not None:
        settings["seed"] = seed
    if starts is not None:
        settings["method"] = replace(settings["method"], starts=starts)
    counts = _sizes(sizes)
    if counts is None:
        raise ConfigError(f"--sizes: expected whole numbers, at most {MOST_SIZES} of them, as 9:30 or 6,9,12; given {sizes}")
    data = DataFiles(config, column, previous)
    earlier = [read_data(path, "points or measurements", data.previous, problem.model) for path in previous or []]
    planned = settings_of(problem, settings | {"n_experiments": counts[-1]})

    def plan() -> list[Row]:
        *_, method, (_, each) = search_rows(problem, planned)
        return [("sizes", f"{len(counts)}, from {counts[0]} to {counts[-1]} points"), method, ("trajectories of a size", each)]

    def compute(_: Drawers) -> Outcome:
        given: dict[str, Any] = {"cost": cost, "previous": earlier or None, **settings}
        with opened(frame.workers) as workers:
            found = fp.sweep(problem, counts, **given, threads=frame.threads, workers=workers, progress=not frame.quiet)
        tables = {f"design_{len(of.points)}.csv": points_csv(of.points, problem.model) for of in found.designs}

        def write(directory: Path, report: Callable[[], str]) -> list[str]:
            contents = {"sweep.csv": found.to_pandas().to_csv(), **tables, "report.txt": report()}
            stale = [path.name for path in directory.glob("design_*.csv") if path.name not in tables]
            write_together(directory, contents, stale=["sweep.png", PAGE, "sweep.json", *stale])
            found.save(directory / "sweep.json")
            return ["sweep.csv", "sweep.json", "report.txt"]

        return Outcome(
            report=found.report,
            write=write,
            draw=partial(write_shown, found, file),
            interrupted=found.stop_reason in (fp.StopReason.interrupted, fp.StopReason.interrupted_first),
            further=[f"design_<size>.csv of {len(tables)} sizes"],
            notes=[] if budget is None else [_within(found, budget)],
        )

    return frame.run(
        Task(
            problem=problem,
            files=[file, *(previous or [])],
            plan=plan,
            pictures="fisherpoint.design.sweep.sweep_picture",
            compute=compute,
            before="there was a design",
        )
    )


def _within(found: fp.Sweep, budget: float) -> str:
    size = found.within(budget)
    enough = f"the design of {size} points has the most information" if size else "none of these sizes is enough"
    return f"Within a budget of {budget:g}: {enough}."


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
