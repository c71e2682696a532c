"""``fisherpoint validate``: whether designs keep what they promise, by virtual experiments."""

from __future__ import annotations

from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import fisherpoint as fp
from fisherpoint.basics.messages import listed

from .frame import Frame, Outcome, Task
from .importing import importing
from .options import Designs, NoiseInFits, Output, framed
from .standard_input import one_from_standard_input
from .workers import opened

if TYPE_CHECKING:
    from .drawing import Drawers
    from .dry_run import Row

ITERATIONS = 8
"""About how many iterations a fit takes."""


class Truth(StrEnum):
    """Where the true parameters come from."""

    prior = "prior"
    mean = "mean"


@framed(Output, workers=True)
def validate(
    frame: Frame,
    file: Annotated[
        Path, typer.Argument(metavar="FILE.toml", callback=one_from_standard_input, help="Model, prior and sensor noise.")
    ],
    designs: Designs,
    runs: Annotated[
        int, typer.Option("-n", "--runs", min=1, max=10**6, metavar="N", help="Virtual experiments with each design.")
    ] = 1000,
    theta: Annotated[Truth, typer.Option(help="True parameters: drawn from the prior for each run, or its mean.")] = Truth.prior,
    noise: Annotated[NoiseInFits, typer.Option(help="Whether the fits know \\[noise] or estimate it.")] = NoiseInFits.known,
    use_prior: Annotated[bool, typer.Option("--use-prior", help="Use the prior in the fits and in the promise.")] = False,
    spread: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=STD", help="By how much a local parameter spreads in the data, where not as the file says; SI."),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, metavar="N", help="The same seed gives the same figures.")] = 0,
) -> int:
    """Measure designs virtually many times, fit each time, and report whether the designs keep their promises.

    Writes validation.csv, report.txt, validation.png, and report.html, which shows all of it in a browser. Ctrl-C stops early
    and keeps what was found by then.
    """
    with importing():
        import fisherpoint.validation.validate  # noqa: F401  with all that it imports
        from fisherpoint.data.plans import read_plan

        from .dry_run import about, points_row, size_of
        from .runs import read_designs
        from .terminal import read_config
        from .written_results import write_shown, write_tables
    config = read_config(file)
    problem = config.problem()
    if problem.noise is None:
        raise config.error("noise", "missing; expected the noise of every output, from which the promise is computed")
    given = read_designs(designs, problem, partial(read_plan, labels=config.labels))
    points = {name: one.points if isinstance(one, fp.Measurements) else one for name, one in given.items()}
    spreads = _spreads(spread or [], problem)

    def plan() -> list[Row]:
        size = sum(map(size_of, points.values())) * runs
        return [
            *(points_row(name, of) for name, of in points.items()),
            ("virtual experiments", f"{runs} of each, seed {seed}, noise {noise.value} to the fits"),
            about(size * ITERATIONS, f"{ITERATIONS} iterations of each fit"),
        ]

    def compute(_: Drawers) -> Outcome:
        with opened(frame.workers) as workers:
            found = fp.validate(
                problem,
                given,
                runs=runs,
                truth=spreads or None,
                theta=theta.value,
                seed=seed,
                noise_known=noise is NoiseInFits.known,
                use_prior=use_prior,
                threads=frame.threads,
                workers=workers,
                progress=not frame.quiet,
            )
        return Outcome(
            report=found.report,
            write=partial(write_tables, {"validation.csv": lambda: found.to_pandas().to_csv()}, ["validation.png"]),
            draw=partial(write_shown, found, file),
            interrupted=found.interrupted,
        )

    pictures = "fisherpoint.validation.pictures"
    return frame.run(Task(problem=problem, files=[file, *designs], plan=plan, pictures=pictures, compute=compute))


def _spreads(given: list[str], problem: fp.DesignProblem) -> dict[str, fp.Local]:
    """Local parameters with the standard deviations that options give."""
    from fisherpoint.design.file.configuration import ConfigError

    found, local = dict[str, fp.Local](), problem.local_parameters
    for text in given:
        name, _, std = (part.strip() for part in text.partition("="))
        if name not in local:
            raise ConfigError(f"--spread: expected NAME=STD of a local parameter, one of {listed(local, 'none')}; given {text}")
        try:
            found[name] = fp.Local(local[name].by, spread=float(std))
        except ValueError:
            raise ConfigError(f"--spread: expected a positive standard deviation, given {text}") from None
    return found
