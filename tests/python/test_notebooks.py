"""The lessons as notebooks, as the site offers them: all that their pages say, in cells that run."""

from __future__ import annotations

import importlib.util
import json
import re
from pathlib import Path
from types import ModuleType

import pytest

pytest.importorskip("jupytext", reason="needs the group docs")
pytest.importorskip("mkdocs", reason="needs the group docs")

ROOT = Path(__file__).resolve().parents[2]
LESSONS = [path for path in sorted((ROOT / "docs" / "tutorial").glob("*.md")) if path.stem != "index"]


def hook() -> ModuleType:
    spec = importlib.util.spec_from_file_location("notebooks", ROOT / "docs" / "scripts" / "notebooks.py")
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("page", LESSONS, ids=lambda page: page.stem)
def test_a_notebook_has_the_code_of_its_page(page: Path) -> None:
    notebooks = hook()
    cells = json.loads(notebooks.notebook(notebooks.sources()[page.stem]))["cells"]
    code = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    assert code == [block.strip() for block in re.findall(r"```python\n(.*?)```", page.read_text(), re.DOTALL)]
    text = "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "markdown")
    assert text.startswith("# ") and "<!--" not in text
    for code_block in code:
        compile(code_block, page.stem, "exec")
