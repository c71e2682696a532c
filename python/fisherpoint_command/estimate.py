"""``fisherpoint estimate``: parameters from measured data, with report, tables and pictures."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import fisherpoint as fp

from .frame import Frame, Outcome, Task
from .importing import importing
from .options import Columns, NoiseInFits, Output, framed
from .standard_input import from_standard_input, one_from_standard_input
from .workers import opened

if TYPE_CHECKING:
    from fisherpoint.estimation.profile import Profile

    from .drawing import Drawers
    from .dry_run import Row

STARTS, ITERATIONS = 8, 20
"""Starts of an estimate by default, and about how many iterations each takes."""


@framed(Output, workers=True)
def estimate(
    frame: Frame,
    file: Annotated[
        Path, typer.Argument(metavar="FILE.toml", callback=one_from_standard_input, help="Model, prior and sensor noise.")
    ],
    data: Annotated[
        list[Path],
        typer.Argument(
            metavar="DATA.csv...",
            callback=from_standard_input,
            help="Measurements: the columns of a design.csv, or of a file of runs, and y_<output> for each measured output; with a "
            "column t, a record, with columns x0_<state> for known starts.",
        ),
    ],
    column: Columns = None,
    noise: Annotated[
        NoiseInFits | None,
        typer.Option(
            help="Known: \\[noise]; estimated: the smallest that leaves white residuals. Default: known if the file has it."
        ),
    ] = None,
    no_prior: Annotated[
        bool,
        typer.Option(
            "--no-prior", help="Use the prior for starts and for parameters that are not estimated, but not as information."
        ),
    ] = False,
    profiles: Annotated[bool, typer.Option("--profiles", help="Also compute confidence intervals by profile likelihood.")] = False,
    stability: Annotated[bool, typer.Option("--stability", help="Also fit parts of the data against each other.")] = False,
) -> int:
    """Estimate the parameters from measured data, and report how good the fit is.

    Writes estimate.csv, residuals.csv, fit.json, report.txt, pictures, and report.html, which shows all of it in a browser; of
    local parameters local.csv.
    """
    with importing():
        import numpy as np

        import fisherpoint.estimation.estimate  # noqa: F401  with all that it imports
        from fisherpoint.basics.files import write_whole
        from fisherpoint.design.file.configuration import ConfigError
        from fisherpoint.estimation.picture_list import plots_of

        from .dry_run import about
        from .tables import DataFiles
        from .terminal import read_config, read_data
        from .written_results import write_shown
    config = read_config(file)
    problem = config.problem()
    if noise is NoiseInFits.known and problem.noise is None:
        raise config.error("noise", "missing; expected the noise of every measured output with --noise known")
    known = problem.noise is not None and noise is not NoiseInFits.estimated
    for path in (path for k, path in enumerate(data) if path.resolve() in [other.resolve() for other in data[:k]]):
        raise ConfigError(f"DATA.csv: expected each file once, given {path} twice")
    files = DataFiles(config, column, data)
    parts = [read_data(path, "measurements", files.data, problem.model) for path in data]

    def plan() -> list[Row]:
        size = sum(1 if isinstance(part, fp.Record) else int(np.isfinite(part.samples).any(axis=-1).sum()) for part in parts)
        return [
            *((str(path), repr(part)) for path, part in zip(data, parts, strict=True)),
            ("noise in the fit", "as given" if known else "estimated from the residuals"),
            ("prior in the fit", "as a start alone" if no_prior else "as information"),
            about(size * STARTS * ITERATIONS, f"{STARTS} starts"),
        ]

    def compute(_: Drawers) -> Outcome:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "residuals: expected white noise")  # they are in the report
            fit = fp.estimate(
                problem.model,
                parts,
                None if no_prior else problem.prior,
                start=problem.prior if no_prior else None,
                parameters=problem.parameters,
                noise=problem.noise if known else "estimated",
                # Noise that is estimated has what is drawn anew in it.
                deviations=problem.deviations if known else fp.Deviations(uncertain=problem.uncertain, local=problem.local),
                threads=frame.threads,
                progress=not frame.quiet,
            )
        found = list((_profiles(fit, frame) if profiles else {}).values())
        report = fit.report(profiles=found, stability=fit.stability() if stability else None)

        def write(directory: Path, text: Callable[[], str]) -> list[str]:
            written = [path.name for path in fit.save(directory)]
            write_whole(directory / "report.txt", text())
            return [*written, "report.txt"]

        draw = partial(write_shown, fit, file, plots=plots_of(fit, found), report=report)
        return Outcome(report=lambda: report, write=write, draw=draw)

    pictures = "fisherpoint.estimation.pictures"
    return frame.run(Task(problem=problem, files=[file, *data], plan=plan, pictures=pictures, compute=compute))


def _profiles(fit: fp.Fit, frame: Frame) -> dict[str, Profile]:
    from .heartbeat import alive

    with alive("computing profiles"), opened(frame.workers) as workers:
        return fit.profiles(threads=frame.threads, workers=workers)
