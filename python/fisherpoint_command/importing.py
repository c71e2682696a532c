"""What a command imports for its work, when it is to work: help and the version are shown without."""

from __future__ import annotations

import gc
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from .exits import leave
from .heartbeat import alive


@contextmanager
def importing() -> Iterator[None]:
    """Let Ctrl-C end the program at once: nothing is to be saved yet, and not every import stands an exception."""
    here = threading.current_thread() is threading.main_thread()
    heard = here and signal.getsignal(signal.SIGINT) is signal.default_int_handler  # else it is ignored, as in the background
    if heard:
        signal.signal(signal.SIGINT, leave)
    gc.disable()  # what is imported is no garbage, and to search it for some takes a tenth of the time
    try:
        with alive("starting"):
            yield
    finally:
        gc.enable()
        if heard:
            signal.signal(signal.SIGINT, signal.default_int_handler)
