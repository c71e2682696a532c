"""``fisherpoint compare``: designs beside each other."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import fisherpoint as fp

from .frame import Frame, Outcome, Task
from .importing import importing
from .options import Designs, OutputIfAny, framed
from .standard_input import one_from_standard_input
from .workers import opened

if TYPE_CHECKING:
    from .drawing import Drawers
    from .dry_run import Row

DRAWS = 1000
"""Plants on which designs are tried, by default."""


@framed(OutputIfAny, workers=True)
def compare(
    frame: Frame,
    file: Annotated[
        Path, typer.Argument(metavar="FILE.toml", callback=one_from_standard_input, help="Model, prior and sensor noise.")
    ],
    designs: Designs,
    seed: Annotated[int, typer.Option(min=0, metavar="N", help="Of the plants on which the designs are tried.")] = 0,
) -> int:
    """Compare the effort and the worth of designs.

    With -o, writes comparison.csv, report.txt, comparison.png, and report.html, which shows all of it in a browser.
    """
    with importing():
        import fisherpoint.design.compare.compare  # noqa: F401  with all that it imports

        from .dry_run import about, points_row, size_of
        from .heartbeat import alive
        from .runs import read_designs
        from .terminal import read_config
        from .written_results import write_shown, write_tables
    config = read_config(file)
    problem = config.problem()
    if problem.noise is None:
        raise config.error("noise", "missing; expected the noise of every output, as designs are compared by it")
    points = read_designs(designs, problem)

    def plan() -> list[Row]:
        size = sum(map(size_of, points.values())) * DRAWS
        return [*(points_row(name, given) for name, given in points.items()), about(size, f"{DRAWS} plants, seed {seed}")]

    def compute(_: Drawers) -> Outcome:
        with alive("comparing"), opened(frame.workers) as workers:
            found = fp.compare(problem, points, seed=seed, threads=frame.threads, workers=workers)
        write = partial(write_tables, {"comparison.csv": lambda: found.to_pandas().to_csv()}, ["comparison.png"])
        return Outcome(report=found.report, write=write, draw=partial(write_shown, found, file))

    pictures = "fisherpoint.design.compare.compare_picture"
    return frame.run(Task(problem=problem, files=[file, *designs], plan=plan, pictures=pictures, compute=compute))
