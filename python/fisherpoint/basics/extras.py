"""Packages for pictures and tables, which ``pip install fisherpoint`` leaves out."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from .interrupts import interrupts_wait

EXTRAS = {"distributed": "cluster", "matplotlib": "all", "pandas": "all"}
"""The extra that has each of them."""


@contextmanager
def needed_for(what: str) -> Iterator[None]:
    """Say what to install where an import finds such a package missing.

    Ctrl-C waits until the import is complete: one that is broken off fails in pandas and matplotlib for the rest of the process.
    """
    try:
        with interrupts_wait():
            yield
    except ModuleNotFoundError as missing:
        package = (missing.name or "").partition(".")[0]
        if package not in EXTRAS:
            raise
        message = f"{what}: expected the package {package}, given none: pip install 'fisherpoint[{EXTRAS[package]}]'"
        raise ModuleNotFoundError(message, name=package) from None
