"""What ``--workers`` names: processes of this machine, or the scheduler of a Dask cluster."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from fisherpoint.basics.extras import needed_for

if TYPE_CHECKING:
    from fisherpoint.engine.workers import Workers

SECONDS = 10
"""Seconds in which a scheduler has to answer."""

MOST = 4096


def check_workers(given: str | None) -> str | None:
    """Return the option, where it names workers.

    Raises
    ------
    typer.BadParameter
        Where it does not.
    """
    import typer

    if given is None or "://" in given or (given.isdecimal() and 0 < int(given) <= MOST):
        return given
    raise typer.BadParameter(f"expected a number from 1 to {MOST}, or the address of a Dask scheduler, as tcp://head:8786")


@contextmanager
def opened(given: str | None) -> Iterator[Workers | None]:
    """What a function takes as its workers; a connection to a cluster is closed at the end."""
    if given is None or given.isdecimal():
        yield None if given is None else int(given)
        return
    logging.getLogger("distributed").setLevel(logging.CRITICAL + 1)  # it reports whatever Ctrl-C ends, line by line
    with needed_for("--workers"):
        from distributed import Client
    try:
        client = Client(given, timeout=SECONDS, set_as_default=False)
    except (OSError, ValueError) as error:
        raise ValueError(f"--workers: expected a Dask scheduler that answers, given {given}: {error}") from error
    with client:
        yield client
