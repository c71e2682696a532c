"""Counts of what makes the package hard to carry on, each with the most that is allowed.

    python tests/structure/structure_counts.py

prints them. `tests/python/test_structure.py` holds them: a change may lower a number, and then the limit here, and raises none.
"""

from __future__ import annotations

import ast
import io
import re
import tokenize
from collections import Counter
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

PACKAGES = Path(__file__).resolve().parents[2] / "python"

POINTS = {"Experiments", "Runs", "ExperimentRegion", "RunRegion"}

MOST_ARGUMENTS = 12


@cache
def modules() -> dict[Path, ast.Module]:
    """All modules, parsed."""
    paths = (path for path in sorted(PACKAGES.rglob("*.py")) if "examples" not in path.parts)
    return {path: ast.parse(path.read_text()) for path in paths}


@cache
def all_nodes() -> tuple[ast.AST, ...]:
    return tuple(node for module in modules().values() for node in ast.walk(module))


def nodes(kind: type[ast.AST]) -> Iterator[ast.AST]:
    return (node for node in all_nodes() if isinstance(node, kind))


def functions() -> Iterator[ast.FunctionDef]:
    for node in nodes(ast.FunctionDef):
        assert isinstance(node, ast.FunctionDef)
        yield node


def classes() -> Iterator[ast.ClassDef]:
    for node in nodes(ast.ClassDef):
        assert isinstance(node, ast.ClassDef)
        yield node


def checks_of_points() -> int:
    """`isinstance` of points, runs and their regions."""
    found = 0
    for node in nodes(ast.Call):
        assert isinstance(node, ast.Call)
        if isinstance(node.func, ast.Name) and node.func.id == "isinstance":
            names = {part.id for part in ast.walk(node.args[1]) if isinstance(part, ast.Name)}
            found += bool(names & POINTS)
    return found


def protocols() -> int:
    """Classes that only describe what another class has."""
    return sum(any(isinstance(base, ast.Name) and base.id == "Protocol" for base in one.bases) for one in classes())


def json_functions() -> int:
    """Functions that write an object as JSON, or read it, by hand."""
    return sum(bool(re.search("(to|from)_json$", one.name)) for one in functions())


def arguments_of(function: ast.FunctionDef) -> int:
    given = function.args
    names = [one.arg for one in (*given.posonlyargs, *given.args, *given.kwonlyargs)]
    return len([name for name in names if name not in ("self", "cls")])


def long_signatures() -> int:
    """Functions with more than twelve arguments."""
    return sum(arguments_of(one) > MOST_ARGUMENTS for one in functions())


def shared_class_names() -> int:
    """Names that several classes have."""
    return sum(count > 1 for count in Counter(one.name for one in classes()).values())


def dialect() -> int:
    """Lines with tell, tells, told or asked, but for the method `Campaign.tell`."""
    words = re.compile(r"\b(tell(?!\()|tells|told|asked)\b", re.IGNORECASE)
    return sum(bool(words.search(line)) for path in modules() for line in path.read_text().splitlines())


def hanging_docstrings() -> int:
    """Docstrings that begin with "Of" or "The same": they hang on what stands before."""
    documented = (node for node in all_nodes() if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef))
    return sum((ast.get_docstring(node) or "").startswith(("Of ", "The same")) for node in documented)


def search_constants() -> int:
    """Numbers with a name of their own in the modules of the searches."""
    found = 0
    for path, module in modules().items():
        if "design" not in path.relative_to(PACKAGES).parts:
            continue
        for node in module.body:
            if isinstance(node, ast.Assign | ast.AnnAssign) and node.value is not None and _is_number(node.value):
                target = node.targets[0] if isinstance(node, ast.Assign) else node.target
                found += len(target.elts) if isinstance(target, ast.Tuple) else 1
    return found


def _is_number(value: ast.expr) -> bool:
    parts = list(ast.walk(value))
    allowed = ast.Constant | ast.Tuple | ast.UnaryOp | ast.BinOp | ast.operator | ast.unaryop | ast.expr_context
    return all(isinstance(part, allowed) for part in parts) and any(
        isinstance(part, ast.Constant) and isinstance(part.value, int | float) and not isinstance(part.value, bool)
        for part in parts
    )


def code_lines() -> int:
    """Lines of code, without docstrings, comments and blank lines."""
    skipped = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER}
    found = 0
    for path, module in modules().items():
        lines: set[int] = set()
        for token in tokenize.generate_tokens(io.StringIO(path.read_text()).readline):
            if token.type not in skipped:
                lines.update(range(token.start[0], token.end[0] + 1))
        for node in ast.walk(module):
            if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
                lines.difference_update(range(node.lineno, (node.end_lineno or node.lineno) + 1))
        found += len(lines)
    return found


#: What is counted, and the most that is allowed.
LIMITS: dict[Callable[[], int], int] = {
    checks_of_points: 23,
    protocols: 6,
    json_functions: 2,
    long_signatures: 0,
    shared_class_names: 0,
    dialect: 0,
    hanging_docstrings: 0,
    search_constants: 77,
}


if __name__ == "__main__":
    for count, most in LIMITS.items():
        print(f"{count():7,} of {most:7,}  {(count.__doc__ or '').splitlines()[0]}")
    print(f"{code_lines():7,} {' ' * 10}  {(code_lines.__doc__ or '').splitlines()[0]}")
