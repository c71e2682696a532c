"""What `fisherpoint design` does with a fleet: points or runs for each of its plants."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import fisherpoint as fp
from fisherpoint.basics.files import write_whole
from fisherpoint.design.file.configuration import Config
from fisherpoint.design.fleet.fleet_design import label_of
from fisherpoint.design.fleet.fleet_settings import plant_names
from fisherpoint.show.numbers import counted

from .drawing import Drawers
from .dry_run import Row
from .frame import Frame, Outcome, Task
from .written_results import write_shown


def design_of_fleet(frame: Frame, config: Config, options: dict[str, Any], file: Path) -> int:
    """Search for the points, or runs, of each plant; write design.csv, design.json, report.txt, pictures and report.html."""
    problem, settings = config.problem(), config.fleet_settings() | options
    if problem.noise is None:
        raise config.error("noise", "missing; expected the noise of every output, which fleets are designed for")
    try:
        label = label_of(problem)
    except ValueError as error:
        raise config.error("local", str(error).removeprefix("local: ")) from error

    def plan() -> list[Row]:
        names, kind = plant_names(settings["plants"]), problem.region.kind if problem.region is not None else "point"
        each = "for all alike" if settings.get("alike") else "each"
        return [(f"{label}s", f"{len(names)}: {', '.join(names)}"), (f"{kind}s", f"{counted(settings['size'], kind)} {each}")]

    def compute(_: Drawers) -> Outcome:
        found = fp.design_fleet(problem, **settings, threads=frame.threads, progress=not frame.quiet)

        def write(directory: Path, report: Callable[[], str]) -> list[str]:
            found.save(directory)
            write_whole(directory / "report.txt", report())
            plans = [name for name in ("plan.csv",) if (directory / name).exists()]
            return ["design.csv", *plans, "design.json", "report.txt"]

        draw, interrupted = partial(write_shown, found, file), found.stop_reason == fp.StopReason.interrupted
        return Outcome(report=found.report, write=write, draw=draw, interrupted=interrupted)

    pictures, before = "fisherpoint.design.fleet.share_picture", "a plant was designed"
    return frame.run(Task(problem=problem, files=[file], plan=plan, pictures=pictures, compute=compute, before=before))
