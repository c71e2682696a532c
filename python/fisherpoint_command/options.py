"""Arguments and options that several commands have."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

Output = Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="Directory for what is written; made where needed.")]
Threads = Annotated[int | None, typer.Option(min=1, metavar="N", help="Number of threads; does not change the result.")]
NoPlots = Annotated[bool, typer.Option("--no-plots", help="Draw no pictures.")]
Force = Annotated[bool, typer.Option("--force", help="Replace a result that is in the directory.")]
Quiet = Annotated[bool, typer.Option("--quiet", help="Print no progress bar and no report.")]

Previous = Annotated[
    list[Path] | None,
    typer.Option(metavar="DATA.csv", help="What is already measured, or planned besides: adds to what designs tell."),
]

File = Annotated[Path, typer.Argument(metavar="FILE.toml", help="Model, prior, sensor noise and region.")]
Points = Annotated[Path, typer.Argument(metavar="POINTS.csv", help="Points, with the columns of a design.csv.")]


class Noise(StrEnum):
    """Whether the file's [noise_std] counts, or the residuals tell the noise."""

    known = "known"
    estimated = "estimated"
