"""Pieces of work in processes side by side, which are made ready while something else is being computed."""

from __future__ import annotations

import gc
import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from functools import partial
from multiprocessing.connection import Connection
from multiprocessing.context import ForkProcess
from queue import SimpleQueue
from types import TracebackType
from typing import Any, Self, TypeVar

T = TypeVar("T")

Done = tuple[Any, Exception | None]
"""What a piece of work has returned, or raised."""

LATER = 5
"""By how much nicer than this process its forks are: they make themselves ready while this one works."""


class Helpers:
    """Forks of this process that make themselves ready, and then do what they are asked to.

    Where there is one core, no fork, or too little memory for it, this process does all of it itself.

    Parameters
    ----------
    most : int
        Forks, at most; there are no more than cores.
    prepare : callable
        What each does at once, such as imports.
    """

    def __init__(self, most: int, prepare: Callable[[], object]) -> None:
        cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 1
        self._forks: dict[Connection, ForkProcess] = {}
        self._idle = SimpleQueue[Connection]()
        if cores > 1:
            with suppress(OSError):  # too little memory for another one
                for _ in range(min(cores, most)):
                    self._fork(prepare)
        self._waiting = ThreadPoolExecutor(len(self._forks)) if self._forks else None  # each for one fork
        if not self._forks:
            prepare()

    def begin(self, work: Callable[[], T]) -> Callable[[], T]:
        """Have the next fork do a piece of work, and return what waits for it, and returns what it returns.

        The work is pickled, and so is what it returns. Where it cannot be, or the fork is gone, the work is done here.
        """
        if self._waiting is None:
            return work
        return partial(_waited, self._waiting.submit(self._elsewhere, work), work)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        # Not asked to end: they may stand in the middle of a picture, or of sending one.
        for process in self._forks.values():
            process.kill()
        if self._waiting is not None:
            self._waiting.shutdown(cancel_futures=True)
        for connection, process in self._forks.items():
            process.join()
            connection.close()

    def _elsewhere(self, work: Callable[[], Any]) -> Done:
        connection = self._idle.get()
        try:
            connection.send(work)
            done: Done = connection.recv()
            return done
        finally:
            self._idle.put(connection)

    def _fork(self, prepare: Callable[[], object]) -> None:
        here, there = multiprocessing.Pipe()
        not_its_own = [here, *self._forks]
        process = multiprocessing.get_context("fork").Process(target=_work, args=(prepare, there, not_its_own), daemon=True)
        with _unheard():
            process.start()
        there.close()  # so that reading here ends where the other process does
        self._forks[here] = process
        self._idle.put(here)


def _waited(done: Future[Done], work: Callable[[], T]) -> T:
    try:
        value, error = done.result()
    except Exception:  # of what cannot be pickled, and of a fork that is gone
        return work()
    if error is not None:
        raise error
    result: T = value
    return result


@contextmanager
def _unheard() -> Iterator[None]:
    """Let a fork begin without an interrupt, which is for this process."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _work(prepare: Callable[[], object], connection: Connection, not_its_own: Sequence[Connection]) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # an interrupt is for who has begun this
    for other in not_its_own:  # else this would not end where the other process does
        other.close()
    os.nice(LATER)
    gc.disable()  # this lasts for seconds, and nearly all that there is belongs to the other process
    with suppress(Exception):  # also where what there is cannot be sent: then it is done there
        prepare()
        while True:
            work = connection.recv()
            done: Done
            try:
                done = work(), None
            except Exception as error:
                done = None, error
            connection.send(done)
