"""The command ``fisherpoint``: what surrounds it, so that it ends with one line also before `fisherpoint` is imported.

This is a package of its own because a package is imported before any of its modules: in `fisherpoint` itself it would be too late.
"""

from __future__ import annotations

import os
import signal
import sys

from .exits import MISUSE, leave, why_not_imported


def main() -> None:
    """Run the command line of this process and exit with its code."""
    heard = signal.getsignal(signal.SIGINT) is signal.default_int_handler  # else it is ignored, as in the background
    try:
        if heard:
            signal.signal(signal.SIGINT, leave)
        _open_streams()
        # Matrices are small: threads of a linear algebra library would stand in the way of the kernels'.
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
        try:
            from .cli import main as run
        except ImportError as error:
            print(f"fisherpoint: {why_not_imported(error)}", file=sys.stderr)
            sys.exit(MISUSE)
        if heard:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        run()
    except KeyboardInterrupt:  # between two of these lines, or once more while the first one is reported
        leave()
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # all is done


def _open_streams() -> None:
    """Let what is written to a stream that the caller has closed go nowhere: the next file that is opened would take its place."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            os.open(os.devnull, os.O_RDWR)  # the least number that is free, which is this one
            setattr(sys, name, os.fdopen(number, "w" if number else "r"))
