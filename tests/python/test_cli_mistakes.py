"""Deliberate mistakes at the command line: one clear line each, exit code 2, and nothing written or overwritten."""

from __future__ import annotations

import io
import re
import shlex
import sys
from pathlib import Path

import pytest

from cli_files import FILES
from cli_mistakes import MISTAKES
from fisherpoint_command import cli


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The directory in which commands are typed."""
    for name, content in FILES.items():
        write(tmp_path / name, content)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def write(path: Path, content: str | bytes) -> None:
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(content.encode() if isinstance(content, str) else content)


def everything(directory: Path) -> dict[str, bytes | None]:
    """All that is in a directory, with the content of files."""
    return {
        str(path.relative_to(directory)): path.read_bytes() if path.is_file() else None for path in sorted(directory.rglob("*"))
    }


def test_there_are_enough() -> None:
    assert len(MISTAKES) >= 60
    assert len({(mistake.typed, str(mistake.files), mistake.stdin) for mistake in MISTAKES.values()}) == len(MISTAKES)


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_is_one_clear_line(
    name: str, place: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    mistake = MISTAKES[name]
    for file, content in mistake.files.items():
        write(place / file, content)
    if mistake.stdin is not None:
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(mistake.stdin.encode())))
    before = everything(place)
    capsys.readouterr()
    with pytest.raises(SystemExit) as caught:
        cli.main(shlex.split(mistake.typed))
    told = capsys.readouterr()
    assert (caught.value.code, told.out) == (2, "")
    assert told.err.startswith("fisherpoint: ") and told.err.endswith("\n") and told.err.count("\n") == 1, told.err
    line = told.err.removeprefix("fisherpoint: ").rstrip("\n")
    assert re.search(r"expected|missing|unknown key|not valid TOML", line), line
    assert not re.search(r"Traceback|Error\b|<class|\bNone\b|pydantic", line), line
    assert "nan" not in line.lower().split() or "nan" in mistake.typed + str(mistake.files), line
    assert len(line) < 400
    at = 0
    for part in mistake.says:
        assert part in line[at:], f"{part!r} in {line!r}"
        at += line[at:].index(part) + len(part)
    assert everything(place) == before
