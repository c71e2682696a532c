"""Pieces of work in processes side by side, where the machine and the system allow it."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from typing import Any, TypeVar

T = TypeVar("T")


def side_by_side(works: Sequence[Callable[[], T]]) -> Iterator[T]:
    """Yield what each returns, in their order; those that take longest are best the last.

    They run in forks of this process, which have all that it has, and of which the last pieces of work begin first. What
    they return is pickled. Where there is one core, no fork, or too little memory for it, they run here.
    """
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 1
    done: dict[int, T] = {}
    if min(cores, len(works)) > 1:
        with suppress(OSError, BrokenProcessPool):  # what is not done then is done below
            context = multiprocessing.get_context("fork")
            pool = ProcessPoolExecutor(min(cores, len(works)), context, _begin, (works,))
            try:
                asked = {k: pool.submit(_run, k) for k in reversed(range(len(works)))}
                for k in range(len(works)):
                    done[k] = asked[k].result()
                    yield done[k]
            finally:
                pool.shutdown(cancel_futures=True)
    for k in range(len(done), len(works)):
        yield works[k]()


_works: Sequence[Callable[[], Any]] = ()


def _begin(works: Sequence[Callable[[], Any]]) -> None:
    global _works
    _works = works
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # an interrupt is for who has begun them


def _run(k: int) -> Any:
    return _works[k]()
