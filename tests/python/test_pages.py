"""What README and documentation show runs, and what they list is all there is."""

from __future__ import annotations

import ast
import re
import shutil
import subprocess
import sys
import tomllib
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.design.file.configuration import Config, load_config
from fisherpoint_command import cli
from pages import LANGUAGES, ROOT, blocks, commands, is_whole_model, laid_over, pages

DOCS = ROOT / "docs"
PAGES = [path for path in pages() if any(block.language in ("python", "sh", "toml") for block in blocks(path))]

pytestmark = pytest.mark.skipif(not DOCS.exists(), reason="the documentation is not beside the tests")


def name_of(path: Path) -> str:
    return str(path.relative_to(ROOT))


@pytest.fixture
def beside_examples(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A directory to run in that has the examples, with short searches."""
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    for path in (tmp_path / "examples").glob("*.toml"):
        text = re.sub(r"^max_iterations = \d+", "max_iterations = 20", path.read_text(), flags=re.MULTILINE)
        if "\n[runs]\n" in text:
            text = re.sub(r"^n_starts = .*\n|^time_limit = .*\n", "", text, flags=re.MULTILINE)
            text = text.replace("\n[runs]\n", "\n[runs]\nn_starts = 1\n")
            head, _, tail = text.partition("\n[design]\n")
            text = f"{head}\n[design]\ntime_limit = 3\n{tail}"
        path.write_text(text)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.long
@pytest.mark.parametrize("path", PAGES, ids=name_of)
def test_the_blocks_of_a_page_run(path: Path, beside_examples: Path, capsys: pytest.CaptureFixture[str]) -> None:
    names: dict[str, Any] = {"__name__": "page", "example": example}
    before = ""
    for block in (block for block in blocks(path) if block.needs is None):
        printed = capsys.readouterr().out if before == "python" else ""
        if block.language == "text" and block.follows and before == "python":
            assert lines(block.code) == lines(printed)
        before = block.language
        match block.language:
            case "python":
                exec(compile("\n" * block.line + block.code, name_of(path), "exec"), names)
            case "sh":
                for arguments in commands(block.code):
                    with pytest.raises(SystemExit) as ended:
                        cli.main(arguments)
                    assert ended.value.code == 0, (arguments, capsys.readouterr().err)
            case "toml":
                load(block.code, beside_examples)


RECIPES = [block.needs for block in blocks(DOCS / "how_to" / "tables.md") if block.needs] if DOCS.exists() else []


@pytest.mark.parametrize("package", sorted(set(RECIPES)))
def test_a_recipe_reads_what_its_library_writes(package: str, beside_examples: Path) -> None:
    pytest.importorskip(package, reason=f"{package} is not installed")
    path = DOCS / "how_to" / "tables.md"
    names: dict[str, Any] = {"__name__": "page", "example": example}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # those of the libraries
        for block in (block for block in blocks(path) if block.language == "python" and block.needs in (None, package)):
            exec(compile("\n" * block.line + block.code, name_of(path), "exec"), names)
    record, expected = names["record"], names["expected"]
    np.testing.assert_allclose(record.t - record.t[0], expected.t - expected.t[0], rtol=0, atol=1e-9)
    np.testing.assert_allclose(record.u, expected.u, rtol=1e-14)
    np.testing.assert_allclose(record.y, expected.y, rtol=1e-14)


def example(name: str) -> fp.DesignProblem:
    """The problem of an example, for what prepares a page's blocks."""
    return load_config(f"examples/{name}.toml").problem()


def lines(text: str) -> list[str]:
    """Without how many evaluations a search took: that depends on how the processor's linear algebra rounds."""
    text = re.sub(r"\b\d+ evaluations?\b", "some evaluations", text)
    return [line.rstrip() for line in text.strip("\n").splitlines()]


def load(code: str, directory: Path) -> None:
    if is_whole_model(code):
        (directory / "model.toml").write_text(code)
        fp.load_model(directory / "model.toml")
    else:
        base = tomllib.loads((directory / "examples" / "cylinder.toml").read_text())
        Config.model_validate(laid_over(base, tomllib.loads(code))).problem()


@pytest.mark.parametrize("path", pages(), ids=name_of)
def test_every_block_names_its_language(path: Path) -> None:
    assert {block.language for block in blocks(path)} <= set(LANGUAGES)


def test_links_from_outside_the_documentation_lead_somewhere() -> None:
    for path in (ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "CODE_OF_CONDUCT.md", ROOT / "CHANGELOG.md"):
        for link in re.findall(r"\]\(([^)#:]+)[^)]*\)", path.read_text()):
            assert (ROOT / link).exists(), (path.name, link)


@pytest.mark.parametrize("script", ["configuration", "gallery", "tutorials"])
def test_pages_that_are_written_by_a_script_are_up_to_date(script: str) -> None:
    done = subprocess.run(
        [sys.executable, DOCS / "scripts" / f"{script}.py", "--check"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


# --- what is listed -----------------------------------------------------------------------------------------------------


def test_every_public_name_has_one_place_in_the_reference() -> None:
    text = "\n".join(path.read_text() for path in (DOCS / "reference" / "api").glob("*.md"))
    listed = re.findall(r"^::: fisherpoint\.(\w+)$", text, re.MULTILINE)
    assert sorted(listed) == sorted([*fp.__all__, "math"])
    parts = re.findall(r"^::: fisherpoint\.results\.(\w+)$", text, re.MULTILINE)
    assert sorted(parts) == fp.results.__all__


def test_the_guide_says_where_things_are() -> None:
    """Every file that the table of places to add something names is one of the tree."""
    table = (ROOT / "CONTRIBUTING.md").read_text().split("## Where one adds")[1].split("## Conventions")[0]
    named = re.findall(r"`([\w./]+\.(?:py|hpp|md))`", table)
    rooms = (ROOT, ROOT / "python", ROOT / "python" / "fisherpoint", ROOT / "cpp" / "include" / "fisherpoint")
    everywhere = {path.name for path in (ROOT / "python").rglob("*.py")}
    lost = [name for name in named if not (any((room / name).exists() for room in rooms) or name in everywhere)]
    assert len(named) > 40 and not lost


def test_every_function_of_equations_is_in_the_guide() -> None:
    text = (DOCS / "how_to" / "models.md").read_text().split("these functions of `fp.math`:")[1]
    assert sorted(text.split("\n\n")[1].split()) == sorted(fp.math.__all__)
    assert all(callable(getattr(fp.math, name)) for name in fp.math.__all__)


@pytest.mark.parametrize(
    "command",
    ["design", "evaluate", "compare", "sweep", "simulate", "estimate", "validate", "campaign", "init", "open", "info"],
)
def test_the_options_of_a_command_are_those_it_takes(
    command: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "300")
    with pytest.raises(SystemExit):
        cli.main([command, "--help"])
    shown = set(re.findall(r"^\W*(--[a-z-]+)", capsys.readouterr().out, re.MULTILINE)) - {"--help"}
    page = (DOCS / "reference" / "command_line.md").read_text()
    section = page.split(f"\n## {command}\n")[1].split("\n## ")[0]
    table = "\n".join(line.split(" | ")[0] for line in section.splitlines() if line.startswith("| `"))
    assert set(re.findall(r"--[a-z-]+", table)) == shown


def test_every_status_is_explained() -> None:
    page = (DOCS / "reference" / "statuses.md").read_text()
    assert re.findall(r"^\| `(\w+)` \| (\d+) \|", page, re.MULTILINE) == [(status.name, str(status.value)) for status in fp.Status]


def test_every_reason_why_a_search_ended_is_explained() -> None:
    page = (DOCS / "reference" / "statuses.md").read_text().split("## Why a search ended")[1]
    rows = re.findall(r"^\| `(\w+)` \| (.*) \| (.*) \|$", page, re.MULTILINE)
    assert rows == [(reason.name, reason.words, reason.advice) for reason in fp.StopReason]


REPORTING = ("warnings", "_warnings", "_nearby_warnings", "_beside_numerical_error", "residual_findings", "_consequence")
"""The functions that put warnings into reports."""

SOURCES = [ast.parse(path.read_text()) for path in sorted((ROOT / "python" / "fisherpoint").rglob("*.py"))]


def fixed_texts(node: ast.AST) -> list[str]:
    """The constant parts of the texts below a node."""
    return [part.value for part in ast.walk(node) if isinstance(part, ast.Constant) and isinstance(part.value, str)]


def quoted_warnings() -> list[str]:
    """The fixed parts of the warnings that the page quotes."""
    page = (DOCS / "reference" / "warnings.md").read_text()
    quotes = re.findall(r"^\| `([^`]+)` \|", page, re.MULTILINE)
    assert len(quotes) > 20
    return [part.strip(" ,.:;") for quote in quotes for part in quote.split("…") if part.strip(" ,.:;")]


@pytest.mark.long
@pytest.mark.parametrize("part", quoted_warnings() if DOCS.exists() else [])
def test_a_warning_that_is_explained_exists(part: str) -> None:
    assert any(part in text for source in SOURCES for text in fixed_texts(source))


def test_every_warning_of_a_report_is_explained() -> None:
    functions = [
        node for source in SOURCES for node in ast.walk(source) if isinstance(node, ast.FunctionDef) and node.name in REPORTING
    ]
    assert {node.name for node in functions} == set(REPORTING)
    quotes = quoted_warnings()
    for node in (node for function in functions for node in ast.walk(function)):
        text = node.value if isinstance(node, ast.Yield) else None
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "texts.append":
            text = node.args[0]
        if isinstance(text, ast.JoinedStr | ast.Constant):
            assert any(part in fixed for part in quotes for fixed in fixed_texts(text)), ast.unparse(text)


def test_every_python_warning_is_explained() -> None:
    calls = [
        node
        for source in SOURCES
        for node in ast.walk(source)
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "warnings.warn"
    ]
    assert calls
    quotes = quoted_warnings()
    for call in calls:
        texts = fixed_texts(call.args[0])
        # A remark that comes from elsewhere is quoted there.
        assert texts in ([], ["compile: "]) or any(part in text for part in quotes for text in texts), ast.unparse(call)
