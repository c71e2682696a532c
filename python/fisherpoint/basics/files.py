"""Files that appear whole or not at all, and are read as what they were.

Files of one run belong together: `write_together` has the last of them stand only beside others of the same run.
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any, TypeVar

from .checks import as_path
from .messages import printable, shortened, shown
from .standard_input import held

Given = TypeVar("Given")
Built = TypeVar("Built")

MOST_BYTES = 500_000_000
"""Maximum size of a file with data, such as a design, a fit or a table of a million rows."""

REPORTS = ("report.txt", "report.html")
"""What commands write beside a result for people; whoever writes another result there removes them."""


def write_whole(path: str | Path, content: str | bytes) -> None:
    """Write a file, text as UTF-8, so that whoever reads `path`, at any moment and after any kill, finds the old one or the new.

    Raises
    ------
    OSError
        Where the file cannot be written; what was there stays.
    """
    path = as_path(path, "path")
    with _names(path):
        if path.exists() and not path.is_file():  # a terminal or a pipe has no whole
            path.write_bytes(_bytes(content))
            return
        target = _target(path)
        part = _part(target, content)
        try:
            _put(part, target)
        except BaseException:
            part.unlink(missing_ok=True)
            raise


def write_together(directory: Path, contents: Mapping[str, str | bytes], stale: Iterable[str] = ()) -> list[Path]:
    """Write files; the last, wherever it stands and after any kill, says that those beside it are of the same run.

    All are on the disk before the first is put in its place, so that a full one leaves everything as it was. Then the old last one
    goes, and comes last. Where it stood, the `stale` files, which were made from it, go before it.
    """
    *_, last = contents
    targets = {name: _target(directory / name) for name in contents}
    parts: dict[str, Path] = {}
    try:
        for name, content in contents.items():
            with _names(directory / name):
                if targets[name].exists() and not targets[name].is_file():
                    error = errno.EISDIR if targets[name].is_dir() else errno.EINVAL  # a device has no whole
                    raise OSError(error, os.strerror(error))
                parts[name] = _part(targets[name], content)
        if targets[last].exists():
            for path in (*(directory / name for name in stale), targets[last]):
                path.unlink(missing_ok=True)
            _keep_entries(targets[last].parent)
        for name, part in parts.items():
            with _names(directory / name):
                _put(part, targets[name])
    except BaseException:
        for part in parts.values():
            part.unlink(missing_ok=True)
        raise
    return [directory / name for name in contents]


def check_writable(directory: Path) -> None:
    """Raise an OSError where no file can be made in a directory: better before the work than after it."""
    with tempfile.NamedTemporaryFile(dir=directory, prefix=".", suffix=".part"):
        pass


@contextmanager
def _names(path: Path) -> Iterator[None]:
    """Have errors name the requested file, not a part of it."""
    try:
        yield
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error


def _target(path: Path) -> Path:
    """Path of the file behind a link: the file is replaced, not the link."""
    return Path(os.path.realpath(path))


def _bytes(content: str | bytes) -> bytes:
    return content.encode() if isinstance(content, str) else content


def _part(target: Path, content: str | bytes) -> Path:
    """Bring what a file is to have to the disk, beside it."""
    with tempfile.NamedTemporaryFile(dir=target.parent, prefix=f".{target.name}.", suffix=".part", delete=False) as part:
        try:
            part.write(_bytes(content))
            part.flush()
            os.fsync(part.fileno())
            os.chmod(part.name, target.stat().st_mode & 0o777 if target.exists() else 0o644)
        except BaseException:
            Path(part.name).unlink(missing_ok=True)
            raise
    return Path(part.name)


def _put(part: Path, target: Path) -> None:
    os.replace(part, target)
    _keep_entries(target.parent)


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
    given = held(path)
    with path.open("rb") if given is None else BytesIO(given) as file:
        while size <= most and (block := file.read(1 << 20)):
            blocks.append(block)
            size += len(block)
    if size > most:
        raise ValueError(f"{printable(path)}: expected a file of at most {most / 1e6:g} MB, given a larger one")
    return b"".join(blocks)


def sealed_json(data: dict[str, Any]) -> str:
    """Return `data` as a JSON file's text with its SHA-256, by which `parse_json` sees whether anything was changed."""
    return json.dumps(data | {"sha256": _sha256(data)}, indent=1, allow_nan=False) + "\n"


def _sha256(data: Any) -> str:
    return hashlib.sha256(json.dumps(data, separators=(",", ":")).encode()).hexdigest()


def parse_json(path: Path, given: bytes, kind: str, version: int) -> dict[str, Any]:
    """Return what a JSON file of this format and version says.

    Raises
    ------
    ValueError
        Where it is truncated, of another format or version, or not as it was written.
    """
    try:
        data = json.loads(given.decode())
        seal = data.pop("sha256", None) if isinstance(data, dict) else None
        sha256 = _sha256(data)
    except (ValueError, RecursionError) as error:
        raise ValueError(
            f"{printable(path)}: expected a whole JSON file, given one that is cut off or malformed at: {error}"
        ) from error
    if not isinstance(data, dict) or data.get("format") != kind:
        raise ValueError(f"{printable(path)}: expected a file of format {kind!r}, given another")
    given_version = data.get("format_version")
    if type(given_version) is not int or given_version != version:
        raise ValueError(f"{printable(path)}: expected format version {version}, given {shown(given_version)}")
    if seal != sha256:
        given_seal = "one that was changed (its SHA-256 differs)" if seal is not None else "one without its SHA-256"
        raise ValueError(f"{printable(path)}: expected the file as it was written, given {given_seal}")
    return data


def built_from(path: Path, what: str, data: Given, build: Callable[[Given], Built]) -> Built:
    """Return what `build` makes of the data of a file; where it cannot, the ValueError names the file."""
    try:
        return build(data)
    except WRONG as error:
        raise ValueError(f"{printable(path)}: {_complaint(error, what)}") from error


@contextmanager
def entry(name: str) -> Iterator[None]:
    """Have the ValueError about what cannot be built name the entry of the file from which it is built."""
    try:
        yield
    except WRONG as error:
        raise ValueError(f"{name}: {_complaint(error, 'entry')}") from error


WRONG = (LookupError, TypeError, AttributeError, ValueError, ArithmeticError, RecursionError, StopIteration, MemoryError)
"""Errors of building from data of other kinds and sizes than were written."""


def _complaint(error: Exception, what: str) -> str:
    """What is wrong with the data, with the word "expected"."""
    if isinstance(error, RecursionError):
        return f"expected a complete {what}, given one that is nested too deep"
    text = str(error)
    if isinstance(error, ValueError | TypeError) and "expected" in text and "argument" not in text:
        return printable(text)
    if isinstance(error, ValueError | ArithmeticError):
        return f"expected a complete {what}, given a wrong value: {shortened(text, 200)}"
    return f"expected a complete {what}, given one without or with a wrong {shortened(text)}"
