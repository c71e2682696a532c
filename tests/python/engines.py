"""Who may compute pieces of work: every kind of worker, by a name, where it is installed."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any

import pytest


class Backwards(Executor):
    """Computes only when enough wait, the last first."""

    _max_workers = 3

    def __init__(self) -> None:
        self._waiting: list[tuple[Future[Any], Callable[[], Any]]] = []

    def submit(self, function: Callable[..., Any], /, *given: Any, **named: Any) -> Future[Any]:
        future: Future[Any] = Future()
        self._waiting.append((future, lambda: function(*given, **named)))
        future.add_done_callback(lambda _: None)
        if len(self._waiting) == self._max_workers:
            self.flush()
        return future

    def flush(self) -> None:
        while self._waiting:
            future, work = self._waiting.pop()
            try:
                future.set_result(work())
            except Exception as error:
                future.set_exception(error)


@contextmanager
def backwards() -> Iterator[Backwards]:
    from threading import Event, Thread

    executor, ended = Backwards(), Event()

    def flush() -> None:  # what is left over when no more comes
        while not ended.wait(0.05):
            executor.flush()

    thread = Thread(target=flush, daemon=True)
    thread.start()
    try:
        yield executor
    finally:
        ended.set()
        thread.join()


@contextmanager
def loky() -> Iterator[Any]:
    module = pytest.importorskip("loky", reason="loky is not installed")
    executor = module.ProcessPoolExecutor(2)
    try:
        yield executor
    finally:
        executor.shutdown(kill_workers=True)


@contextmanager
def dask() -> Iterator[Any]:
    distributed = pytest.importorskip("distributed", reason="distributed is not installed")
    options = dict(n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=60)
    with distributed.LocalCluster(**options) as cluster, distributed.Client(cluster, set_as_default=False) as client:
        yield client


@contextmanager
def number(count: int) -> Iterator[int]:
    yield count


ENGINES: dict[str, Callable[[], Any]] = {
    "1 process": lambda: number(1),
    "2 processes": lambda: number(2),
    "5 processes": lambda: number(5),
    "threads": lambda: ThreadPoolExecutor(2),
    "backwards": backwards,
    "loky": loky,
    "dask": dask,
}
