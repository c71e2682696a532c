"""Files that appear whole or not at all."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path


def write_whole(path: str | Path, text: str) -> None:
    """Write `text` as UTF-8 so that whoever reads `path`, at any moment and after any kill, finds the old file or the new one.

    Raises
    ------
    OSError
        Where the file cannot be written; what was there stays.
    """
    target = Path(os.path.realpath(path))  # of a link its file is replaced, not the link
    if target.exists() and not target.is_file():  # a terminal or a pipe has no whole
        target.write_text(text, encoding="utf-8", newline="")
        return
    try:
        with tempfile.NamedTemporaryFile(
            "w", encoding="utf-8", newline="", dir=target.parent, prefix=f".{target.name}.", suffix=".part", delete=False
        ) as part:
            try:
                part.write(text)
                part.flush()
                os.fsync(part.fileno())
                os.chmod(part.name, target.stat().st_mode & 0o777 if target.exists() else 0o644)
                os.replace(part.name, target)
                _keep_entries(target.parent)
            except BaseException:
                Path(part.name).unlink(missing_ok=True)
                raise
    except OSError as error:
        error.filename, error.filename2 = str(path), None  # what was asked for, not the part
        raise


def _keep_entries(directory: Path) -> None:
    """Bring a directory's new names to the disk too, where the system lets a directory be opened."""
    if os.name == "posix":
        descriptor = os.open(directory, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
