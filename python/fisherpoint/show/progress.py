"""A bar for what takes its time, on the terminal and in notebooks."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from typing import Any, NamedTuple, TypeVar, cast

import numpy as np

from ..basics.extras import needed_for

F = TypeVar("F", bound=Callable[..., None])

WIDTH = 80
"""Characters in a notebook, which has no width of its own."""


class Step(NamedTuple):
    """How far a work is: `done` of `total`, where these are known, and what it does."""

    done: int = 0
    total: int | None = None
    state: str = ""


def check_progress(progress: object) -> None:
    """Raise where this is no answer to how progress is told, or where what shows a bar is missing: before the work, not in it."""
    if progress is None or callable(progress):
        return
    if not isinstance(progress, bool | np.bool_):
        raise TypeError(f"progress: expected True, False or a function, given {type(progress).__name__}")
    if progress:
        _console()


@contextmanager
def following(
    progress: bool | F | None, what: str, step: Callable[..., Step], first: str = "", *, counted: bool = True
) -> Iterator[F | None]:
    """What a work is to call with its progress: the function that was given, one that moves a bar, or nothing.

    Parameters
    ----------
    progress : bool, callable or None
        As `check_progress` takes it.
    what : str
        What is counted, or done.
    step : callable
        From what the work tells to what the bar shows.
    first : str
        What it does at first.
    counted : bool
        Whether it is known how far the work is.
    """
    if callable(progress):
        yield progress
        return
    if not progress:
        yield None
        return
    console = _console()
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        ProgressColumn,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns: list[ProgressColumn] = [TextColumn("{task.description}"), *([MofNCompleteColumn()] if counted else [])]
    columns += [BarColumn(bar_width=12), TextColumn("{task.fields[state]}", markup=False), TimeElapsedColumn()]
    columns += [TimeRemainingColumn()] if counted else []
    # Nothing stays: the result tells what there is to know.
    bar = Progress(*columns, console=console, transient=True, disable=not (console.is_terminal or console.is_jupyter))
    with bar:
        task = bar.add_task(what, total=None, state=first)

        def show(*told: Any) -> None:
            now = step(*told)
            bar.update(task, completed=now.done, total=now.total, state=now.state)

        yield cast(F, show)


def _console() -> Any:
    with needed_for("progress"):
        from rich.console import Console
        from rich.progress import Progress  # noqa: F401  with all that it imports

    console = Console(stderr=True)
    if console.is_jupyter:
        console.width = WIDTH
        if find_spec("ipywidgets") is None:
            raise ModuleNotFoundError(
                "progress: expected the package ipywidgets, by which notebooks show a bar, given none: pip install ipywidgets",
                name="ipywidgets",
            )
    return console
