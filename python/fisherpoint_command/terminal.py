"""What all commands share: printing reports, and the directory that their files go to."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from rich.console import Console

import fisherpoint as fp
from fisherpoint.basics.files import check_writable
from fisherpoint.basics.messages import listed, printable
from fisherpoint.design.file.configuration import Config, ConfigError, load_config
from fisherpoint.points.outside_region import few, outside
from fisherpoint.show.console import to_rich
from fisherpoint.show.section import Report, to_text

from .exits import complain
from .heartbeat import alive

Read = TypeVar("Read")

WIDTH = 100
"""Characters of a line of ``report.txt`` and of a report that is piped."""


def as_file(report: Report) -> str:
    """A report as the text of a file."""
    return to_text(report, WIDTH) + "\n"


def show(report: Report) -> None:
    """Print on standard output: in the terminal's width and colours, or as plain text where it is piped."""
    if sys.stdout.isatty():
        Console(highlight=False).print(to_rich(report))
    else:
        print(as_file(report), end="", flush=True)


def say(line: str) -> None:
    """Print a line with names of files, which may contain control characters."""
    print(printable(line), flush=True)


def check_file(path: Path, force: bool) -> None:
    """Make sure, before the work, that a command can write its file."""
    try:
        if path.is_dir():
            raise ConfigError(f"--output: expected a file, given the directory {path}")
        if path.is_file() and not force:
            raise ConfigError(f"--output: expected a file that is not there yet, given {path}; --force replaces it")
        if path.is_file() or not path.exists():  # a terminal or a pipe is written as it is
            check_writable(Path(os.path.realpath(path)).parent)
    except OSError as error:
        raise ConfigError(f"--output: expected a file in a directory to write to, given {path}: {error.strerror}") from None


def warn_of_outside(problem: fp.DesignProblem, path: Path, points: fp.Experiments | fp.Runs) -> None:
    """Say on standard error which points are outside of the region, if any are."""
    if places := list(outside(problem.model, problem.region, points)):
        complain(f"warning: {path}: outside of the region: {few(places)}")


def read_config(path: Path) -> Config:
    """The configuration in a file; equations take a while to be read."""
    with alive(f"reading {printable(path)}"):
        return load_config(path)


def read_data(path: Path, what: str, read: Callable[[Path, fp.Model], Read], model: fp.Model) -> Read:
    """What `read` finds in a file, with errors that name the file."""
    try:
        return read(path, model)
    except FileNotFoundError:
        raise ConfigError(f"{path}: expected a CSV file of {what}, found no such file") from None
    except IsADirectoryError:
        raise ConfigError(f"{path}: expected a CSV file of {what}, given a directory") from None
    except OSError as error:
        raise ConfigError(f"{path}: expected a readable CSV file of {what}, given: {error.strerror}") from None
    except (ValueError, TypeError) as error:
        message = str(error)
        raise ConfigError(message if printable(path) in message else f"{path}: {message}") from error


def named_files(paths: list[Path]) -> dict[str, Path]:
    """Paths by the shortest names that distinguish them: file names, or with the directories."""
    for name in (lambda path: path.stem, lambda path: f"{path.parent.name}/{path.stem}", str):
        named = {printable(name(path)): path for path in paths}
        if len(named) == len(paths):
            return named
    raise ConfigError(f"DESIGN.csv: expected different files, given {listed(paths)}")
