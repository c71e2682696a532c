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
    if Path(path).exists() and not Path(path).is_file():  # a terminal or a pipe has no whole
        Path(path).write_text(text, encoding="utf-8", newline="")
        return
    target = Path(os.path.realpath(path))  # of a link its file is replaced, not the link
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
        raise OSError(error.errno, error.strerror, str(path)) from error  # names what was asked for, not the part


def _keep_entries(directory: Path) -> None:
    """Bring a directory's new names to the disk too, where the system lets a directory be opened."""
    if os.name == "posix":
        descriptor = os.open(directory, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
