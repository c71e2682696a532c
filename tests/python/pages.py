"""The blocks of code in a page of the documentation, as they are found and run.

A page is Markdown. A block is fenced and names its language:

- ``python`` is executed. The blocks of a page share their names and run in order.
- ``sh``: lines that begin with ``fisherpoint`` are run as commands, other lines are not.
- ``toml`` is loaded: as a model where it has equations and nothing else, otherwise laid over ``examples/cylinder.toml``.
- ``text`` directly after ``python`` is what that prints; other ``text``, and ``csv``, is shown only.

Comments of HTML, which no reader sees, prepare a block or keep it from being run; ``example("cylinder")`` is the problem of that
example there::

    <!-- setup
    data = ...
    -->

    <!-- not run: why -->

A setup for which a package has to be installed, ``<!-- setup, needs h5py``, and the Python directly after it are a recipe.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parents[2]
LANGUAGES = ("python", "sh", "toml", "csv", "text")

_BLOCK = re.compile(
    r"^<!-- setup(?:, needs (?P<needs>\w+))?\n(?P<setup>.*?)^-->$"
    r"|^<!-- not run: (?P<reason>.*?) -->\n+```.*?^```$"
    r"|^```(?P<language>\S*)[^\n]*\n(?P<code>.*?)^```$",
    re.DOTALL | re.MULTILINE,
)


class Block(NamedTuple):
    """A block, or a setup as a block of Python: the number of the line before its first one, whether only blank lines part it from
    the block before, and the package that it needs where it belongs to a recipe."""

    language: str
    code: str
    line: int
    follows: bool
    needs: str | None = None


def pages() -> list[Path]:
    """README and every page of the documentation; none where they do not lie beside the tests."""
    found = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
    return [path for path in found if path.exists()]


def blocks(path: Path) -> Iterator[Block]:
    """The blocks of a page that are to be run or loaded, in order."""
    text, end, needs = path.read_text(), 0, None
    for match in _BLOCK.finditer(text):
        if match["reason"] is not None:
            continue
        kind, group = ("python", "setup") if match["setup"] is not None else (match["language"], "code")
        follows = not text[end : match.start()].strip()
        needs = match["needs"] or (needs if follows and match["setup"] is None else None)
        yield Block(kind, match[group], text.count("\n", 0, match.start(group)), follows, needs)
        end = match.end()


def commands(code: str) -> Iterator[list[str]]:
    """The arguments of each ``fisherpoint`` command in a block of a shell."""
    for line in code.splitlines():
        words = line.partition(" # ")[0].split()
        if words[:1] == ["fisherpoint"]:
            yield words[1:]


def is_whole_model(code: str) -> bool:
    """Whether a block of TOML is a model's file by itself."""
    data = tomllib.loads(code)
    return list(data) == ["model"] and "equations" in data["model"]


def laid_over(base: Mapping[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """A configuration in which what is given takes the place of what was there, key by key."""
    both = dict(base)
    for key, value in given.items():
        inside = base.get(key)
        both[key] = laid_over(inside, value) if isinstance(value, Mapping) and isinstance(inside, Mapping) else value
    return both
