"""Writes the lessons docs/tutorial/NAME.md from the scripts NAME.py beside them, which are in the percent format of notebooks.

A cell ``# %% [markdown]`` is text, any other code. Jupyter opens such scripts as notebooks with jupytext; editors run their cells.
With ``--check`` nothing is written, and the exit code says whether the pages are up to date.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

LESSONS = Path(__file__).resolve().parents[1] / "tutorial"

NOTE = "<!-- Written by docs/scripts/tutorials.py from {name}: change that. -->"


def cells(script: str) -> Iterator[tuple[bool, str]]:
    """Whether each cell of a script is text, and what stands in it."""
    for cell in script.split("# %%")[1:]:
        head, _, body = cell.partition("\n")
        if head.strip() == "[markdown]":
            lines = [line.removeprefix("#").removeprefix(" ") for line in body.splitlines() if line.startswith("#")]
            yield True, "\n".join(lines).strip()
        else:
            yield False, body.strip()


def page(path: Path) -> str:
    """A script as Markdown."""
    (_, first), *others = cells(path.read_text())
    title, _, text = first.partition("\n")
    parts = [title, NOTE.format(name=path.name), f"*As a script with cells: [{path.name}]({path.name}).*", text.strip()]
    parts += [text if is_text else f"```python\n{text}\n```" for is_text, text in others]
    return "\n\n".join(parts) + "\n"


def main(arguments: list[str]) -> int:
    """Write the pages, or only say which are not those of their scripts."""
    stale = [path for path in sorted(LESSONS.glob("*.py")) if not _is_page(path)]
    if "--check" in arguments:
        for path in stale:
            print(f"stale: {path.with_suffix('.md')}; run python docs/scripts/tutorials.py", file=sys.stderr)
        return int(bool(stale))
    for path in stale:
        path.with_suffix(".md").write_text(page(path))
    return 0


def _is_page(path: Path) -> bool:
    written = path.with_suffix(".md")
    return written.exists() and written.read_text() == page(path)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
