"""Results that stand in a directory: none is replaced without --force, and nothing of it stays beside the new one."""

from __future__ import annotations

from collections.abc import Callable, Collection
from pathlib import Path

from fisherpoint.basics.files import REPORTS, check_writable
from fisherpoint.basics.messages import listed
from fisherpoint.design.file.configuration import ConfigError
from fisherpoint.design.fleet.picture_list import PICTURES as OF_FLEETS
from fisherpoint.design.results.picture_list import PICTURES as OF_POINTS
from fisherpoint.design.runs.run_picture_list import PICTURES as OF_RUNS
from fisherpoint.estimation.picture_list import PICTURES as OF_A_FIT

from .partial_output import begin_writing
from .terminal import say

CAMPAIGN = "campaign.json"

MAIN = ("design.json", "fit.json", CAMPAIGN, "report.txt")
"""Files that mark a result: one of them is wherever there is one."""

SHOWN = dict.fromkeys(
    (*REPORTS, *OF_POINTS, *OF_RUNS, *OF_FLEETS, *OF_A_FIT, "validation.png", "comparison.png", "campaign.png", "sweep.png")
)
"""What is made of a result for people."""


def check_output(output: Path | None, check: bool) -> None:
    """Raise where there is no directory for a result, unless nothing is to be written."""
    if output is None and not check:
        raise ConfigError("--output: missing; expected a directory for what is written, as -o run/")


def free_directory(path: Path | None, force: bool) -> list[str]:
    """Make sure that a result can be written to a directory, and return what `remove_old` is to remove of another one there.

    Nothing is made yet: what fails later is to leave nothing behind. A campaign is never replaced: what was measured cannot be
    computed anew, and what was made for people of the other result would be replaced by the next batch.
    """
    if path is None:
        return []
    check_directory(path)
    there = results_in(path)
    if CAMPAIGN in there:
        raise ConfigError(
            f"--output: expected a directory without a campaign, given {path}, which has {CAMPAIGN}; take another one, "
            "as a campaign holds what was measured, which --force does not replace"
        )
    if there and not force:
        raise _taken(path, there, "--force replaces it")
    return [name for name in SHOWN if there and (path / name).exists()]


def free_for_campaign(path: Path, goes_on: Callable[[Path], bool]) -> None:
    """Make sure that a campaign can be in a directory: it goes on with its own, and replaces no other result."""
    check_directory(path)
    if not goes_on(path) and (there := results_in(path)):
        raise _taken(path, there, "a campaign needs one of its own")


def results_in(path: Path) -> list[str]:
    """The main files of results that are in a directory."""
    return [name for name in MAIN if (path / name).exists()]


def _taken(path: Path, there: list[str], otherwise: str) -> ConfigError:
    return ConfigError(f"--output: expected a directory without a result, given {path}, which has {listed(there)}; {otherwise}")


def check_directory(path: Path) -> None:
    """Raise where files cannot be made in a directory, or in the one in which it would be made: before the work, not after it."""
    if str(path) == "-":
        raise ConfigError("--output: expected a directory, given -, which is standard output")
    try:
        above = path
        while not above.exists() and not above.is_symlink() and above != above.parent:
            above = above.parent
        if not above.is_dir():
            raise ConfigError(f"--output: expected a directory, given {path}, which is or lies under a file")
        check_writable(above)
    except NotADirectoryError:
        raise ConfigError(f"--output: expected a directory, given {path}, which is or lies under a file") from None
    except OSError as error:
        raise ConfigError(f"--output: expected a directory to write to, given {path}: {error.strerror}") from None


def make_directory(path: Path, old: Collection[str]) -> None:
    """Make a directory that `free_directory` has found to be free, with those above it, and remember what is there."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(f"--output: expected a directory to write to, given {path}: {error.strerror}") from None
    begin_writing(path, old)


def remove_old(path: Path, old: Collection[str], written: Collection[str], quiet: bool = False) -> None:
    """Remove, and name, what is shown of the result that was replaced."""
    removed = [name for name in old if name not in written]
    for name in removed:
        (path / name).unlink(missing_ok=True)  # most went before the new result came
    if removed and not quiet:
        say(f"Removed from {path}, of the result before: {', '.join(removed)}")
