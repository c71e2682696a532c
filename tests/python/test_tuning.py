"""The numbers that steer the searches: each has a sentence, is read somewhere, and those that the benchmark changes exist."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

import fisherpoint
from bench.tuning import OTHERS, changed
from fisherpoint.design.points.tuning import PointSearchTuning

DESIGN = Path(fisherpoint.__file__).parent / "design"
MODULES = sorted(DESIGN.rglob("tuning.py"))


def fields(module: Path) -> list[tuple[str, ast.stmt | None]]:
    """Names of all fields of a module's classes, and the statement that follows each."""
    found = []
    for node in ast.walk(ast.parse(module.read_text())):
        if isinstance(node, ast.ClassDef):
            for statement, following in zip(node.body, [*node.body[1:], None], strict=True):
                if isinstance(statement, ast.AnnAssign) and isinstance(statement.target, ast.Name):
                    found.append((statement.target.id, following))
    return found


@pytest.mark.parametrize("module", MODULES, ids=lambda module: module.parent.name)
def test_each_number_has_a_sentence_and_is_read(module: Path) -> None:
    source = "\n".join(path.read_text() for path in DESIGN.rglob("*.py"))
    assert fields(module)
    for name, following in fields(module):
        assert re.search(rf"\.{name}\b", source), f"{name} is read nowhere"
        nested = name in ("exchange", "climb", "ascent", "plants", "archive", "paper", "limit")
        sentence = following.value.value if isinstance(following, ast.Expr) and isinstance(following.value, ast.Constant) else ""
        assert nested or str(sentence).rstrip().endswith("."), f"{name} has no sentence"


@pytest.mark.parametrize(("path", "value"), [(path, value) for path, values in OTHERS.items() for value in values])
def test_the_benchmark_changes_one_number(path: str, value: object) -> None:
    assert changed(path, value) != PointSearchTuning()
