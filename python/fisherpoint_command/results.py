"""Results that stand in a directory: none is replaced unless it is asked for, and nothing of it stays beside the new one."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from fisherpoint.basics.messages import listed
from fisherpoint.design.configuration import ConfigError
from fisherpoint.design.files import PICTURES as OF_POINTS
from fisherpoint.design.runs.run_design import PICTURES as OF_RUNS
from fisherpoint.estimation.fit_files import PICTURES as OF_A_FIT

from .terminal import make_directory, say
from .written import PAGE

MAIN = ("design.json", "fit.json", "campaign.json", "report.txt")
"""Files of which one stands wherever there is a result."""

SHOWN = dict.fromkeys(
    ("report.txt", PAGE, *OF_POINTS, *OF_RUNS, *OF_A_FIT, "validation.png", "comparison.png", "campaign.png", "sweep.png")
)
"""What is made of a result for people."""


def make_free_directory(path: Path, force: bool) -> list[str]:
    """Make a directory for a result, and return what is shown there of another one, which `remove_old` is to remove."""
    make_directory(path)
    there = [name for name in MAIN if (path / name).exists()]
    if there and not force:
        given = f"{path}, which has {listed(there)}"
        raise ConfigError(f"--output: expected a directory without a result, given {given}; --force replaces it")
    return [name for name in SHOWN if there and (path / name).exists()]


def remove_old(path: Path, old: Collection[str], written: Collection[str], quiet: bool = False) -> None:
    """Remove, and name, what is shown of the result that was replaced."""
    removed = [name for name in old if name not in written]
    for name in removed:
        (path / name).unlink(missing_ok=True)  # most went before the new result came
    if removed and not quiet:
        say(f"Removed from {path}, of the result before: {', '.join(removed)}")
