"""What all commands with a result do around their work: look at the directory, show the plan, write, and say what was written."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from .exits import INTERRUPTED, complain
from .importing import importing

if TYPE_CHECKING:
    import fisherpoint as fp
    from fisherpoint.show.section import Report

    from .drawing import Drawers
    from .dry_run import Row


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What has come of the work of a command.

    Attributes
    ----------
    report : callable
        The report, which is shown and written.
    write : callable
        Writes the result and its report, whose text it is given as a function, to a directory, and returns the files' names.
    draw : callable
        Writes pictures and page to a directory, and returns their names.
    interrupted : bool
        Whether Ctrl-C ended the work early: no pictures are drawn then.
    further : sequence of str
        What else was written, in words.
    notes : sequence of str
        Lines that follow the report.
    advice : sequence of str
        Lines at the end.
    """

    report: Callable[[], Report]
    write: Callable[[Path, Callable[[], str]], Sequence[str]]
    draw: Callable[[Path, Drawers], Sequence[str]]
    interrupted: bool = False
    further: Sequence[str] = ()
    notes: Sequence[str] = ()
    advice: Sequence[str] = ()


@dataclass(frozen=True, kw_only=True)
class Task:
    """What a command is to do with what it has read.

    Attributes
    ----------
    problem : DesignProblem
    files : sequence of Path
        What was read.
    plan : callable
        Rows of what would be done.
    pictures : str
        The module that draws.
    compute : callable
        Does the work; pictures may be begun in it.
    before : str
        What an interrupt comes before where the work is lost by it; empty where it is an error as any other.
    """

    problem: fp.DesignProblem
    files: Sequence[Path]
    plan: Callable[[], Iterable[Row]]
    pictures: str
    compute: Callable[[Drawers], Outcome]
    before: str = ""


@dataclass(frozen=True, kw_only=True)
class Frame:
    """The options that all commands with a result have; see `options` for their words."""

    output: Path | None
    threads: int | None
    workers: str | None = None
    check: bool
    no_plots: bool
    quiet: bool
    force: bool = False

    def run(self, task: Task) -> int:
        """Do the work of a command, or say what it would do, and return the exit code."""
        with importing():
            from .drawing import drawers
            from .dry_run import show_plan
            from .results import free_directory, make_directory, remove_old
            from .terminal import as_file, say, show
        output = self.output
        old = free_directory(output, self.force)
        if self.check:
            return show_plan(task.problem, task.files, task.plan(), output)
        with drawers(None if output is None or self.no_plots else task.pictures) as drawing:
            try:
                done = task.compute(drawing)
            except KeyboardInterrupt:
                if not task.before:
                    raise
                complain(f"interrupted before {task.before}; nothing was saved")
                return INTERRUPTED
            report = cache(done.report)
            written: list[str] = []
            if output is not None:
                make_directory(output, old)
                written += done.write(output, lambda: as_file(report()))
            if not self.quiet:
                show(report())
            if output is not None:
                written += done.draw(output, drawing.unless(done.interrupted))
        if output is not None:
            if not self.quiet:
                print()
                for line in (*done.notes, f"Written to {output}: {', '.join([*written, *done.further])}", *done.advice):
                    say(line)
            remove_old(output, old, written, self.quiet)
        return INTERRUPTED if done.interrupted else 0
