"""What a command has written by the time it is interrupted."""

from __future__ import annotations

from collections.abc import Collection
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path

from fisherpoint.basics.messages import listed


@dataclass(frozen=True)
class Writing:
    """A directory that a command writes to, as it was before.

    Attributes
    ----------
    directory : Path
    old : collection of str
        Files that show a result there, which is replaced.
    before : mapping of name to what distinguishes one file from another
    """

    directory: Path
    old: Collection[str]
    before: dict[str, tuple[int, int]]

    def done(self) -> list[str]:
        """The files that were written, in that order."""
        now = _files(self.directory)
        new = [name for name, file in now.items() if self.before.get(name) != file]
        return sorted(new, key=lambda name: (now[name][1], name))


WRITING: ContextVar[Writing | None] = ContextVar("WRITING", default=None)


def begin_writing(directory: Path, old: Collection[str] = ()) -> None:
    """Remember what is in a directory before a command writes to it."""
    WRITING.set(Writing(directory, old, _files(directory)))


def kept() -> str:
    """What to say of files that were written; what is shown of a result that they replace goes."""
    writing = WRITING.get()
    if writing is None or not (done := writing.done()):
        return ""
    for name in writing.old:
        if name not in done:
            (writing.directory / name).unlink(missing_ok=True)
    return f"kept in {writing.directory}: {listed(done)}"


def _files(directory: Path) -> dict[str, tuple[int, int]]:
    # A file that is replaced as a whole is another one.
    paths = directory.iterdir() if directory.is_dir() else ()
    found = {path.name: path.stat() for path in paths if path.is_file() and not path.name.startswith(".")}
    return {name: (stat.st_ino, stat.st_mtime_ns) for name, stat in found.items()}
