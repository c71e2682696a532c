"""One process of our own that computes what it is sent, which ends with this one, and is made anew where it is lost."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import resource_tracker
from multiprocessing.context import SpawnContext, SpawnProcess
from types import ModuleType
from typing import Any

PATIENCE = 10.0
"""Seconds for which a killed process is waited for."""


class OwnProcess:
    """An executor of one process, which is begun by the first piece of work."""

    def __init__(self) -> None:
        self._begin()

    def submit(self, function: Callable[..., Any], *given: Any) -> Future[Any]:
        """Have the process call a function."""
        try:
            return self._pool.submit(function, *given)
        except BrokenExecutor:  # it was lost while it was idle
            self.renew()
            return self._pool.submit(function, *given)

    def renew(self) -> str:
        """End the process, whatever it does, and return how it has ended; the next one begins with the next piece."""
        ending = self.end()
        self._begin()
        return ending

    def end(self) -> str:
        """End the process, whatever it does, and return how it has ended."""
        for process in self._context.begun:
            if process.pid is not None:
                process.kill()
        self._pool.shutdown(cancel_futures=True)
        ending = ""
        for process in self._context.begun:
            process.join(PATIENCE)
            code = process.exitcode or 0
            ending = f"by {signal.Signals(-code).name}" if code < 0 else f"with exit code {code}"
        return ending

    def _begin(self) -> None:
        self._context = _Context()
        self._pool = ProcessPoolExecutor(1, mp_context=self._context, initializer=_follow)


class _Process(SpawnProcess):
    """A process that imports nothing of the script which begins it, and which Ctrl-C does not reach."""

    def start(self) -> None:
        resource_tracker.ensure_running()  # which lets signals in again where it is begun
        with _without_main(), _unheard():
            super().start()


class _Context(SpawnContext):
    """Begins such processes, and keeps them."""

    def __init__(self) -> None:
        super().__init__()
        self.begun: list[_Process] = []

    def Process(self, *given: Any, **options: Any) -> _Process:  # type: ignore[override]  # there it is a class
        process = _Process(*given, **options)
        self.begun.append(process)
        return process


@contextmanager
def _without_main() -> Iterator[None]:
    """Hide the script, which a process would run again: what is sent of it is sent as it is."""
    before = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = before


@contextmanager
def _unheard() -> Iterator[None]:
    """Keep Ctrl-C waiting in what is begun meanwhile, for good: it is for who has begun it."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _follow() -> None:
    """End this process where the one that has begun it is gone, however that ended."""

    def watch() -> None:
        parent = multiprocessing.parent_process()
        if parent is not None:
            parent.join()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
