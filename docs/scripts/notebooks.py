"""A hook of mkdocs, by which the site has the lessons as notebooks to download: jupytext makes them of the scripts and pages."""

from __future__ import annotations

import re
from pathlib import Path

import jupytext
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

LESSONS = Path(__file__).resolve().parents[1] / "tutorial"
_TITLE = re.compile(r"\A# .*\n")
_SCRIPT = re.compile(r"\*As a script with cells: \[")
_COMMENT = re.compile(r"<!--.*?-->\s*", re.DOTALL)


def sources() -> dict[str, Path]:
    """What each lesson is written as, by its name: a script with cells, or a page."""
    pages = {path.stem: path for path in sorted(LESSONS.glob("*.md")) if path.stem != "index"}
    return {name: path.with_suffix(".py") if path.with_suffix(".py").exists() else path for name, path in pages.items()}


def notebook(source: Path) -> str:
    """A lesson as a notebook, in JSON."""
    text = _COMMENT.sub("", source.read_text(encoding="utf-8")).replace("```sh\n", "```console\n")  # `sh` would be a cell
    lesson = jupytext.reads(text, fmt="py:percent" if source.suffix == ".py" else "md")
    lesson.metadata = {"kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"}}
    return str(jupytext.writes(lesson, fmt="ipynb"))


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the notebooks to what the site has."""
    for name, source in sources().items():
        files.append(File.generated(config, f"tutorial/{name}.ipynb", content=notebook(source)))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Let a lesson's page name its notebook, which the page as it stands in the repository has not beside it."""
    path = Path(page.file.src_uri)
    if path.parent.name != "tutorial" or path.stem not in sources():
        return markdown
    link = f"[notebook]({path.stem}.ipynb)"
    if _SCRIPT.search(markdown):
        return _SCRIPT.sub(f"*As a {link}, or as a script with cells: [", markdown, count=1)
    return _TITLE.sub(rf"\g<0>\n*As a {link}.*\n", markdown, count=1)
