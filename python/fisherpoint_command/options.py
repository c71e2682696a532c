"""Arguments and options that several commands have."""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import Annotated, Any

import typer

from .frame import Frame
from .importing import importing
from .standard_input import from_standard_input, one_from_standard_input
from .workers import check_workers

Output = Annotated[
    Path | None,
    typer.Option("-o", "--output", metavar="DIR", help="Directory for what is written; needed but for --check, made where needed."),
]
OutputIfAny = Annotated[
    Path | None, typer.Option("-o", "--output", metavar="DIR", help="Directory for what is written; made where needed.")
]
Threads = Annotated[int | None, typer.Option(min=1, metavar="N", help="Number of threads; does not change the result.")]
Workers = Annotated[
    str | None,
    typer.Option(
        metavar="N|ADDRESS",
        callback=check_workers,
        help="Processes that share the work and the threads, or the address of a Dask scheduler; does not change the result.",
    ),
]
Seed = Annotated[int | None, typer.Option(min=0, metavar="N", help="Overrides the value in the file.")]
Starts = Annotated[
    int | None, typer.Option(min=1, max=10**6, metavar="N", help="Whole searches; the best one counts; overrides the file.")
]
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
Columns = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME=COLUMN",
        help="What a column is called in the data, as u='Spannung \\[mV]'; others are left out. Adds to the file's \\[data].",
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


class NoiseInFits(StrEnum):
    """Whether the file's [noise] counts, or the noise is estimated from the residuals."""

    known = "known"
    estimated = "estimated"


def framed(output: Any, *, force: bool = True, workers: bool = False) -> Callable[[Callable[..., int]], Callable[..., int]]:
    """Make a command of a function that takes a `Frame` first, and whose own arguments follow.

    The options of the frame come with it: `output`, of this type, behind what is needed, and the others at the end, without `force`
    where no result is ever replaced, and with `workers` where these can share the work.
    """
    behind: dict[str, tuple[Any, Any]] = {"threads": (Threads, None)} | ({"workers": (Workers, None)} if workers else {})
    behind |= {"check": (Check, False), "no_plots": (NoPlots, False)}
    behind |= ({"force": (Force, False)} if force else {}) | {"quiet": (Quiet, False)}

    def command_of(function: Callable[..., int]) -> Callable[..., int]:
        _, *own = signature(function, eval_str=True).parameters.values()
        keyword = Parameter.KEYWORD_ONLY
        needed = [one.replace(kind=keyword) for one in own if one.default is Parameter.empty]
        others = [one.replace(kind=keyword) for one in own if one.default is not Parameter.empty]
        further = [Parameter(name, keyword, default=default, annotation=of) for name, (of, default) in behind.items()]
        first = Parameter("output", keyword, default=None, annotation=output)

        def command(**given: Any) -> int:
            with importing():
                import rich.progress  # noqa: F401  for the bar

                from .results import check_output
            frame = Frame(**{name: given.pop(name) for name in ("output", *behind)})
            if output is Output:
                check_output(frame.output, frame.check)
            return function(frame, **given)

        command.__signature__ = Signature([*needed, first, *others, *further])  # type: ignore[attr-defined]
        command.__name__, command.__doc__ = function.__name__, function.__doc__
        command.__annotations__ = {}
        return command

    return command_of
