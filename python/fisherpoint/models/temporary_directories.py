"""Directories that are gone when this process is, however it ends: a shell at the other end of a pipe removes them then."""

from __future__ import annotations

import contextlib
import os
import secrets
import signal
import subprocess
import tempfile
from pathlib import Path

# Compilers are still busy for a moment after they were killed: what they make then is removed by the second try.
_REMOVE = 'read _; [ "$2" ] && kill -s KILL -- "-$2"; rm -rf -- "$1" || { sleep 1; rm -rf -- "$1"; }'


class Temporary:
    """A new directory for this user alone.

    Parameters
    ----------
    group : bool
        Whether it has a group of processes, which end before it goes.

    Attributes
    ----------
    path : Path
    group : int or None
        Of the processes.

    Raises
    ------
    OSError
        Where there is no room for it, or no shell.
    """

    def __init__(self, group: bool = False) -> None:
        self.path, self._owner = Path(tempfile.gettempdir()).resolve() / f"fisherpoint-{secrets.token_hex(8)}", os.getpid()
        self._shells: list[subprocess.Popen[bytes]] = []
        self.group: int | None = None
        try:
            if group:  # it lives as long as its first process, which waits
                self._shells.append(_shell("read _"))
                self.group = self._shells[0].pid
            self._shells.append(_shell(_REMOVE, str(self.path), str(self.group or "")))  # before there is something to remove
            self.path.mkdir(mode=0o700)
        except BaseException:
            self.remove()
            raise

    def end_group(self) -> None:
        """End the processes."""
        if self.group is not None:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self.group, signal.SIGKILL)

    def remove(self) -> None:
        """End the processes and remove the directory; nothing in a fork, whose it is not."""
        if os.getpid() != self._owner:
            return
        self.end_group()
        for shell in self._shells:
            shell.communicate()


def _shell(commands: str, *arguments: str) -> subprocess.Popen[bytes]:
    """A shell in a group of its own, whose standard input ends where this process does."""
    return subprocess.Popen(
        ["/bin/sh", "-c", commands, "sh", *arguments],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        process_group=0,
    )
