"""Arguments and options that several commands have."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from .standard_input import from_standard_input, one_from_standard_input

Output = Annotated[
    Path | None,
    typer.Option("-o", "--output", metavar="DIR", help="Directory for what is written; needed but for --check, made where needed."),
]
OutputIfAny = Annotated[
    Path | None, typer.Option("-o", "--output", metavar="DIR", help="Directory for what is written; made where needed.")
]
Threads = Annotated[int | None, typer.Option(min=1, metavar="N", help="Number of threads; does not change the result.")]
Seed = Annotated[int | None, typer.Option(min=0, metavar="N", help="Overrides the value in the file.")]
NoPlots = Annotated[bool, typer.Option("--no-plots", help="Draw no pictures.")]
Force = Annotated[bool, typer.Option("--force", help="Replace a result that is in the directory.")]
Quiet = Annotated[bool, typer.Option("--quiet", help="Print no progress bar and no report.")]
Check = Annotated[
    bool, typer.Option("--check", help="Only look for mistakes in what is given, and say what would be done; write nothing.")
]

Previous = Annotated[
    list[Path] | None,
    typer.Option(
        metavar="DATA.csv",
        callback=from_standard_input,
        help="What is already measured, or planned besides: adds to the information of designs.",
    ),
]

File = Annotated[
    Path,
    typer.Argument(
        metavar="FILE.toml", callback=one_from_standard_input, help="Model, prior, sensor noise and region; - for standard input."
    ),
]
Points = Annotated[
    Path,
    typer.Argument(metavar="POINTS.csv", callback=one_from_standard_input, help="Points, with the columns of a design.csv."),
]
Designs = Annotated[
    list[Path],
    typer.Argument(metavar="DESIGN.csv...", callback=from_standard_input, help="Points or runs, with the columns of a design.csv."),
]


class Noise(StrEnum):
    """Whether the file's [noise_std] counts, or the noise is estimated from the residuals."""

    known = "known"
    estimated = "estimated"
