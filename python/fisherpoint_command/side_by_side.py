"""Pieces of work in processes side by side, where the machine and the system allow it."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable, Generator, Sequence
from contextlib import suppress
from multiprocessing.connection import Connection, wait
from multiprocessing.context import ForkProcess
from typing import Any, TypeVar, cast

T = TypeVar("T")


def side_by_side(works: Sequence[Callable[[], T]]) -> Generator[T]:
    """Yield what each returns, in their order; those that take longest are best the last.

    They run in forks of this process, which have all that it has, and of which the last pieces of work begin first. What
    they return is pickled. Where there is one core, no fork, or too little memory for it, they run here. The forks end at once
    where nobody wants more, as after Ctrl-C.
    """
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 1
    left, done = list(range(len(works))), dict[int, tuple[Any, Exception | None]]()
    forks: dict[Connection, ForkProcess] = {}
    try:
        if min(cores, len(works)) > 1:
            with suppress(OSError):  # too little memory for another one
                for _ in range(min(cores, len(works))):
                    connection, process = _fork(works)
                    forks[connection] = process
                    connection.send(left.pop())
        for k in range(len(works)):
            while k not in done and forks:
                for ready in wait(list(forks)):
                    connection = cast(Connection, ready)
                    try:
                        done.update([connection.recv()])
                        connection.send(left.pop() if left else None)
                    except (EOFError, OSError):  # it is gone, and what it had is done below
                        forks.pop(connection).join()
            value, error = done.pop(k) if k in done else (works[k](), None)
            if error is not None:
                raise error
            yield value
    finally:
        # Not asked to end: they may stand in the middle of a picture, or of sending one.
        for process in forks.values():
            process.kill()
        for process in forks.values():
            process.join()


def _fork(works: Sequence[Callable[[], Any]]) -> tuple[Connection, ForkProcess]:
    here, there = multiprocessing.Pipe()
    process = multiprocessing.get_context("fork").Process(target=_work, args=(works, there), daemon=True)
    process.start()
    there.close()  # so that reading here ends where the other process does
    return here, process


def _work(works: Sequence[Callable[[], Any]], connection: Connection) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # an interrupt is for who has begun this
    with suppress(Exception):  # also where what there is cannot be sent: then it is done there
        while (k := connection.recv()) is not None:
            done: tuple[Any, Exception | None]
            try:
                done = works[k](), None
            except Exception as error:
                done = None, error
            connection.send((k, done))
