"""How far a work is, for a function of the user's, or for a bar on the terminal and in notebooks.

A bar only shows: where that fails, the work goes on without it. What a function of the user's raises is passed on.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from time import perf_counter
from typing import Any, NamedTuple, Protocol

import numpy as np

from ..basics.interrupts import interrupts_wait

WIDTH = 80
"""Characters in a notebook, which has no width of its own."""


class Progress(NamedTuple):
    """How far a function is; what it counts, and what its value is, stands with its argument `progress`.

    Attributes
    ----------
    step : int
        How many are done.
    total : int or None
        How many there are, at most; None where that is not known.
    value : float or None
        The number that is improved, at the best so far; None where there is none.
    message : str
        What a bar shows: what is being done, and how good it is.
    seconds : float
        Since the start.
    """

    step: int
    total: int | None
    value: float | None
    message: str
    seconds: float


def check_progress(progress: object) -> None:
    """Raise where `progress` is unsuitable, and import what shows a bar: before the work, not in it."""
    if progress is None or callable(progress):
        return
    if not isinstance(progress, bool | np.bool_):
        raise TypeError(f"progress: expected True, False or a function, given {type(progress).__name__}")
    if progress:
        with interrupts_wait():
            import rich.progress  # noqa: F401  with all that it imports


@contextmanager
def following(
    progress: bool | Callable[[Progress], None] | None, what: str, first: str = "", *, counted: bool = True
) -> Iterator[Callable[[Progress], None] | None]:
    """Function to call with the progress of a work: the given one, one that moves a bar, or None.

    Parameters
    ----------
    progress : bool, callable or None
        As `check_progress` takes it.
    what : str
        What is counted, or done.
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
    shown = _Shown(_display(what, first, counted))
    try:
        yield shown.update
    finally:
        shown.end()


class _Display(Protocol):
    def update(self, now: Progress) -> None: ...
    def end(self) -> None: ...


class _Shown:
    """A display until it fails: then nothing, as the work counts."""

    def __init__(self, display: _Display | None) -> None:
        self._display = display

    def update(self, now: Progress) -> None:
        if self._display is not None:
            try:
                self._display.update(now)
            except Exception:  # of a stream that is closed, or of a library that draws
                self._display = None

    def end(self) -> None:
        if self._display is not None:
            with suppress(Exception):
                self._display.end()


def _display(what: str, first: str, counted: bool) -> _Display | None:
    """A bar, or a line of text in a notebook without widgets; None where none can be begun."""
    from rich.console import Console

    try:
        console = Console(stderr=True)
        console.on_broken_pipe = _raise_again  # type: ignore[method-assign]  # it would end the process, with an empty output
        if console.is_jupyter and find_spec("ipywidgets") is None:
            return _Line(what)
        if console.is_jupyter:
            console.width = WIDTH
        return _Bar(console, what, first, counted)
    except Exception:
        return None


def _raise_again() -> None:
    raise  # what the console is handling


class _Bar:
    """A bar of rich."""

    def __init__(self, console: Any, what: str, first: str, counted: bool) -> None:
        from rich.progress import BarColumn, MofNCompleteColumn, ProgressColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
        from rich.progress import Progress as Bar

        columns: list[ProgressColumn] = [TextColumn("{task.description}"), *([MofNCompleteColumn()] if counted else [])]
        columns += [BarColumn(bar_width=12), TextColumn("{task.fields[message]}", markup=False), TimeElapsedColumn()]
        columns += [TimeRemainingColumn()] if counted else []
        # Nothing stays: the result shows what there is to know.
        self._bar = Bar(*columns, console=console, transient=True, disable=not (console.is_terminal or console.is_jupyter))
        self._task = self._bar.add_task(what, total=None, message=first)
        self._bar.start()

    def update(self, now: Progress) -> None:
        self._bar.update(self._task, completed=now.step, total=now.total, message=now.message)

    def end(self) -> None:
        self._bar.stop()


class _Line:
    """A line of text that is written over, at most once a second."""

    def __init__(self, what: str) -> None:
        self._what, self._last = what, -np.inf

    def update(self, now: Progress) -> None:
        if perf_counter() - self._last >= 1:
            self._last = perf_counter()
            far = "" if now.total is None else f" {now.step}/{now.total}"
            self._write(f"{self._what}{far} {now.message}")

    def end(self) -> None:
        self._write("")

    @staticmethod
    def _write(text: str) -> None:
        print(f"\r{text[:WIDTH]:<{WIDTH}}", end="\r", file=sys.stderr, flush=True)
