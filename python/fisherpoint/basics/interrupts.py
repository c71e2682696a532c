"""Work that is broken off: what Ctrl-C must not fall into, as other libraries leave it half done, and workers that are lost."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def interrupts_wait() -> Iterator[None]:
    """Have Ctrl-C wait for the end of the block; it is heard there, whatever else the block raises."""
    here = threading.current_thread() is threading.main_thread()  # signals reach no other thread
    heard = signal.getsignal(signal.SIGINT) if here else None
    if not callable(heard):  # it is ignored, or ends the process
        yield
        return
    came: list[tuple[int, FrameType | None]] = []
    signal.signal(signal.SIGINT, lambda number, frame: came.append((number, frame)))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, heard)
        if came:
            heard(*came[-1])


class WorkersLost(RuntimeError):
    """Raised where processes end again and again with the same piece, and where somebody else's executor breaks."""
