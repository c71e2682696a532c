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
from typing import Any, NoReturn, Self, TypeVar

T = TypeVar("T")

Done = tuple[Any, Exception | None]
"""What a piece of work has returned, or raised."""

LATER = 5
"""By how much nicer than this process its forks are: they make themselves ready while this one works."""


class Helpers:
    """Forks of this process that make themselves ready, and then do the work that they are given.

    Where there is one core, no fork, or too little memory for it, this process does all of it itself.

    Parameters
    ----------
    most : int
        Forks, at most; there are fewer than cores, as this process is at work too, and each takes time of its own.
    prepare : callable
        What is done at once, such as imports; by one, from which the others are forked then.
    """

    def __init__(self, most: int, prepare: Callable[[], object]) -> None:
        cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 1
        self._idle = SimpleQueue[Connection]()
        self._waiting = ThreadPoolExecutor(most)  # each for one fork
        self._first: ForkProcess | None = None
        if cores > 1:
            with suppress(OSError):  # too little memory for another one
                self._first = self._fork(prepare, min(cores - 1, most))
        if self._first is None:
            prepare()

    def begin(self, work: Callable[[], T]) -> Callable[[], T]:
        """Have the next fork do a piece of work, and return what waits for it, and returns what it returns.

        The work is pickled, and so is what it returns. Where it cannot be, or the fork is gone, the work is done here.
        """
        if self._first is None:
            return work
        return partial(_waited, self._waiting.submit(self._elsewhere, work), work)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if self._first is not None:  # by a signal: they may stand in the middle of their work, or of sending what came of it
            self._first.terminate()
        self._waiting.shutdown(cancel_futures=True)
        if self._first is not None:
            self._first.join()
        while not self._idle.empty():
            self._idle.get().close()

    def _elsewhere(self, work: Callable[[], Any]) -> Done:
        connection = self._idle.get()
        try:
            connection.send(work)
            done: Done = connection.recv()
            return done
        finally:
            self._idle.put(connection)

    def _fork(self, prepare: Callable[[], object], count: int) -> ForkProcess:
        pipes = [multiprocessing.Pipe() for _ in range(count)]
        process = multiprocessing.get_context("fork").Process(target=_work, args=(prepare, pipes), daemon=True)
        with _unheard(signal.SIGINT):  # an interrupt is for this process
            process.start()
        for here, there in pipes:
            there.close()  # so that reading here ends where the other process does
            self._idle.put(here)
        return process


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
def _unheard(number: signal.Signals) -> Iterator[None]:
    """Keep a signal waiting while a process is forked."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {number})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _work(prepare: Callable[[], object], pipes: Sequence[tuple[Connection, Connection]]) -> None:
    """What the first fork does: it prepares for all, forks the others, and does its own part of the work."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # an interrupt is for who has begun this
    for here, _ in pipes:  # else this would not end where the other process does
        here.close()
    os.nice(LATER)
    gc.disable()  # this lasts for seconds, and nearly all that there is belongs to the other process
    forks: list[int] = []
    signal.signal(signal.SIGTERM, lambda *_: _end(forks))
    with suppress(Exception):  # also where what there is cannot be sent: then it is done there
        prepare()
        mine, *others = [there for _, there in pipes]
        for other in others:
            if _forked(forks):
                mine = other
                break
        for _, there in pipes:
            if there is not mine:
                there.close()
        _serve(mine)
    _end(forks)


def _forked(forks: list[int]) -> bool:
    """Fork this process, and return whether this is the new one, which has no forks; else it is one of them now."""
    with _unheard(signal.SIGTERM):  # or one of them would not be ended
        if fork := os.fork():
            forks.append(fork)
        else:
            forks.clear()
    return not fork


def _serve(connection: Connection) -> NoReturn:
    """Do what comes along a connection, and send what comes of it."""
    while True:
        work = connection.recv()
        done: Done
        try:
            done = work(), None
        except Exception as error:
            done = None, error
        connection.send(done)


def _end(forks: Sequence[int]) -> NoReturn:
    for fork in forks:
        os.kill(fork, signal.SIGKILL)
        os.waitpid(fork, 0)
    os._exit(0)
