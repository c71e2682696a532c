"""Files that appear whole or not at all, and are read as what they were."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from .messages import printable, shortened, shown
from .quantity import as_path

Built = TypeVar("Built")

MOST_BYTES = 500_000_000
"""Of a file with data, such as a design, a fit or a table of a million rows."""


def write_whole(path: str | Path, text: str) -> None:
    """Write `text` as UTF-8 so that whoever reads `path`, at any moment and after any kill, finds the old file or the new one.

    Raises
    ------
    OSError
        Where the file cannot be written; what was there stays.
    """
    path = as_path(path, "path")
    target = Path(os.path.realpath(path))  # of a link its file is replaced, not the link
    try:
        if path.exists() and not path.is_file():  # a terminal or a pipe has no whole
            path.write_text(text, encoding="utf-8", newline="")
            return
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


def read_bytes(path: Path, most: int = MOST_BYTES) -> bytes:
    """Return what is in a file of at most so many bytes; a device or a pipe is not read past them.

    Raises
    ------
    OSError
        Where it cannot be read.
    ValueError
        Where it is larger.
    """
    blocks, size = [], 0
    with path.open("rb") as file:
        while size <= most and (block := file.read(1 << 20)):
            blocks.append(block)
            size += len(block)
    if size > most:
        raise ValueError(f"{printable(path)}: expected a file of at most {most / 1e6:g} MB, given a larger one")
    return b"".join(blocks)


def parse_json(path: Path, given: bytes, kind: str, version: int) -> dict[str, Any]:
    """Return what a JSON file of this format says.

    Raises
    ------
    ValueError
        Where it is truncated, or of another format or version.
    """
    try:
        data = json.loads(given.decode())
    except (json.JSONDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise ValueError(f"{printable(path)}: expected a whole JSON file, given one that ends or breaks at: {error}") from error
    if not isinstance(data, dict) or data.get("format") != kind:
        raise ValueError(f"{printable(path)}: expected a file of format {kind!r}, given another")
    if data.get("format_version") != version:
        raise ValueError(f"{printable(path)}: expected format version {version}, given {shown(data.get('format_version'))}")
    return data


def built_from(path: Path, what: str, data: dict[str, Any], build: Callable[[dict[str, Any]], Built]) -> Built:
    """Return what `build` makes of the data of a file; where it cannot, the ValueError names the file."""
    try:
        return build(data)
    except (KeyError, TypeError, AttributeError, IndexError) as error:
        raise ValueError(
            f"{printable(path)}: expected a complete {what}, given one without or with a wrong {shortened(error)}"
        ) from error
    except (ValueError, OverflowError) as error:
        wrong = str(error) if "expected" in str(error) else f"expected a complete {what}, given a wrong value: {error}"
        raise ValueError(printable(f"{path}: {wrong}")) from error
