"""Cache of compiled models: files that only this user can have written, and that are still what was built.

Loading a library runs what is in it. So an entry counts only where it and the directories above it belong to this user or to root
and nobody else can write to them; and where its content has the SHA-256 that its name says, as a file that was cut off ends the
process. Where the user's cache cannot be trusted or written, a directory that lasts as long as the process takes its place.
"""

from __future__ import annotations

import atexit
import contextlib
import hashlib
import os
import stat
import tempfile
from pathlib import Path

from .temporary_directories import Temporary


class LibraryCache:
    """The cache as it is now.

    Attributes
    ----------
    remarks : list of str
        What the user should know: why a library was not taken from the cache, or is not kept there.
    """

    def __init__(self) -> None:
        self.remarks: list[str] = []
        self._user: Path | None = None
        try:
            directory = cache_directory()
            complaint = distrust(directory) if directory.is_dir() else None
        except (OSError, RuntimeError) as error:  # a path that leads through a file; no home
            complaint = _reason(error)
        if complaint is None:
            self._user = directory
        else:
            self._not_kept(complaint)

    def find(self, key: str) -> Path | None:
        """The library of this key; entries that are not what they should be are deleted."""
        for directory in (self._user, _private):
            for path in [] if directory is None else sorted(directory.glob(f"{key}.*.so")):
                try:
                    complaint = distrust(path) or _damage(path)
                except OSError as error:
                    complaint = f"{path}: {_reason(error)}"
                if complaint is None:
                    return path
                self.discard(path, complaint)
        return None

    def discard(self, path: Path, complaint: str) -> None:
        """Delete an entry that is not what it should be."""
        self.remarks.append(f"expected a library as it was built, given {complaint}; it is built again")
        with contextlib.suppress(OSError):
            path.unlink()

    def keep(self, key: str, content: bytes) -> Path:
        """Write a library, whole or not at all, and return where.

        Raises
        ------
        OSError
            Where not even a directory of the process can take it.
        """
        name = f"{key}.{hashlib.sha256(content).hexdigest()}.so"
        if self._user is not None:
            try:
                _make_directory(self._user)
                complaint = distrust(self._user)
                if complaint is None:
                    return _written(self._user / name, content)
            except OSError as error:
                complaint = f"{self._user}: {_reason(error)}"
            self._not_kept(complaint)
        directory = _private_directory()
        complaint = distrust(directory)
        if complaint is not None:
            raise OSError(f"expected a temporary directory to which nobody else can write, given {complaint}")
        return _written(directory / name, content)

    def _not_kept(self, complaint: str) -> None:
        self.remarks.append(
            f"expected a cache to which this user alone can write, given {complaint}; compiled models last as long as this "
            "process; FISHERPOINT_CACHE can name another directory"
        )


def cache_directory() -> Path:
    """Return where compiled models are kept: ``FISHERPOINT_CACHE``, or fisherpoint in the user's cache directory.

    Raises
    ------
    OSError, RuntimeError
        Where the path leads nowhere, or neither is named and the user has no home.
    """
    given = os.environ.get("FISHERPOINT_CACHE")
    if given:
        return Path(given).resolve()
    return (Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "fisherpoint").resolve()


def distrust(path: Path) -> str | None:
    """Why somebody else may have written a file or into a directory; None where only this user and root could."""
    for place in (path, *path.parents):
        found = place.lstat()
        if stat.S_ISLNK(found.st_mode):
            return f"{place}, which is a link"
        if found.st_uid not in (0, os.geteuid()):
            return f"{place}, which belongs to user {found.st_uid}"
        # Where the sticky bit is set, as for /tmp, others cannot rename what is not theirs.
        sticky = place != path and found.st_mode & stat.S_ISVTX
        if found.st_mode & (stat.S_IWGRP | stat.S_IWOTH) and not sticky:
            return f"{place}, which others can write to (mode {stat.S_IMODE(found.st_mode):o}, which chmod go-w ends)"
    return None


def _damage(path: Path) -> str | None:
    whole = hashlib.sha256(path.read_bytes()).hexdigest() == path.name.split(".")[1]
    return None if whole else f"{path}, which was cut off or changed"


def _make_directory(path: Path) -> None:
    """Make a directory and those above it for this user alone, whatever the umask."""
    for place in (*reversed(path.parents), path):
        if not place.exists():
            place.mkdir(mode=0o700, exist_ok=True)


def _written(path: Path, content: bytes) -> Path:
    descriptor, part = tempfile.mkstemp(dir=path.parent, prefix=".", suffix=".part")  # for this user alone
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(content)
        os.replace(part, path)
    except BaseException:
        Path(part).unlink(missing_ok=True)
        raise
    return path


_private: Path | None = None


def _private_directory() -> Path:
    global _private
    if _private is None or not _private.is_dir():
        temporary = Temporary()
        _private = temporary.path
        atexit.register(temporary.remove)
    return _private


def _reason(error: Exception) -> str:
    return (isinstance(error, OSError) and error.strerror) or str(error)
