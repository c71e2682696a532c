"""A sign of life on the terminal, where a command takes its time and has no progress bar."""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from time import perf_counter

from .argv import is_quiet

AFTER, EVERY = 0.7, 0.5
"""Seconds from the last sign until one shows, and between changes of it."""

ERASE = "\r\x1b[K"
"""To the start of the line, which is emptied."""


class Sign:
    """A line on standard error that says what is being done, and for how long."""

    last = perf_counter()  # when one was seen, or the program began

    def __init__(self, what: str) -> None:
        self._what, self._begin = what, perf_counter()
        self._done, self._lock, self._shows = threading.Event(), threading.Lock(), False
        self._thread = threading.Thread(target=self._show, daemon=True)
        self._thread.start()

    def end(self) -> None:
        """Take it away."""
        self._done.set()
        self._thread.join()
        if self._shows:
            self._write(ERASE)
            Sign.last = perf_counter()

    def _show(self) -> None:
        wait = max(0.0, AFTER - (perf_counter() - Sign.last))
        while not self._done.wait(wait):
            with self._lock:
                self._write(f"{ERASE}{self._what}, {perf_counter() - self._begin:.0f} s")
                self._shows = True
            wait = EVERY

    @staticmethod
    def _write(text: str) -> None:
        with suppress(OSError, ValueError):
            sys.stderr.write(text)
            sys.stderr.flush()


@contextmanager
def alive(what: str) -> Iterator[None]:
    """Show on standard error, where that is a terminal, what is being done and for how long; nothing where it is done at once."""
    if is_quiet() or not sys.stderr.isatty():
        yield
        return
    sign = Sign(what)
    try:
        yield
    finally:
        sign.end()
