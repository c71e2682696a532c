"""What `fisherpoint` offers: its names, what they need, which arguments may be positional, and that types are known."""

from __future__ import annotations

import ast
import inspect
import re
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

import pytest

import fisherpoint as fp
from fisherpoint.basics.formulas import ARGUMENTS

ROOT = Path(__file__).parents[2]
ALIASES = {*ARGUMENTS, "latch", "delay"}  # of equations as text

OPTIONAL_AND_POSITIONAL = {
    "approximate_design": ["candidates"],
    "ExchangeMethod": ["name"],
    "Goal": ["criterion"],
    "criterion": ["goal"],
    "Campaign": ["batch"],
    "Chirp": ["bandwidth"],
    "Experiments": ["dt"],
    "ExperimentRegion": ["constraints"],
    "GaussHermite": ["levels"],
    "GaussianPrior": ["std"],
    "Multisine": ["harmonics"],
    "Noise": ["std"],
    "PRBS": ["order"],
    "Quantity": ["description"],
    "Rest": ["u"],
    "Runs": ["measured"],
    "Sobol": ["n"],
    "SparseGaussHermite": ["level"],
    "SymbolicModel": ["outputs"],
    "CallableModel": ["outputs"],
    "TensorGrid": ["levels"],
    "compare_rules": ["rules"],
    "estimate": ["prior"],
    "design_runs": ["n_runs"],
    "exchange": ["n_experiments"],
    "identifiability": ["prior", "region"],
    "simulate_record": ["x0"],
}
"""Arguments that may be left out and are still clear without their names; all others have them."""

RESULTS = (
    "Design",
    "Evaluation",
    "RunDesign",
    "Status",
    "StopReason",
    "Validation",
)
"""What functions return, and nobody else makes."""


def in_order(names: Iterable[str]) -> list[str]:
    """Names as linters sort them: those in capitals first."""
    return sorted(names, key=lambda name: (not name.isupper(), name))


def test_every_public_name_is_there_and_shown() -> None:
    assert fp.__all__ == in_order(fp.__all__) and len(set(fp.__all__)) == len(fp.__all__)
    assert all(hasattr(fp, name) for name in fp.__all__)
    assert {*fp.__all__, "math", "results", "__version__"} == set(dir(fp))
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        _ = fp.nothing  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("name", "now"),
    [
        *fp._RENAMED.items(),
        ("sqrt", "math.sqrt"),
        ("latch", "math.latch"),
        *((name, f"results.{name}") for name in fp.results.__all__),
    ],
)
def test_a_name_that_is_elsewhere_is_named(name: str, now: str) -> None:
    with pytest.raises(AttributeError, match=re.escape(f"it is fisherpoint.{now}")):
        getattr(fp, name)
    place = fp
    for part in now.partition("(")[0].split("."):
        place = getattr(place, part)


def test_what_tools_read_is_what_python_imports() -> None:
    """The imports of `fisherpoint` for types, and where it finds its names."""
    tree = ast.parse(Path(fp.__file__).read_text())
    block = next(node for node in tree.body if isinstance(node, ast.If))
    imports = [(f".{node.module or ''}", one.name) for node in block.body if isinstance(node, ast.ImportFrom) for one in node.names]
    places = [(place, name) for place, names in fp._PLACES.items() for name in names]
    assert sorted(imports) == sorted([*places, (".models", "math"), (".", "results")])
    assert in_order(name for _, name in places) == fp.__all__


def test_functions_of_equations_hide_nothing() -> None:
    pytest.importorskip("sympy")
    assert set(fp.math.__all__) == ALIASES and not ALIASES & set(dir(fp)) and "math" not in fp.__all__
    assert all(inspect.getdoc(getattr(fp.math, name)) for name in ALIASES)
    code = "from fisherpoint import *; import math; assert max is __builtins__.max and math.pi; exchange, model, SymbolicModel"
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize("call", ["", "fisherpoint.nothing", "hasattr(fisherpoint, 'nothing')", "dir(fisherpoint)"])
def test_slow_packages_are_imported_only_where_they_are_needed(call: str) -> None:
    code = f"""
import sys, fisherpoint
try:
    {call or "pass"}
except AttributeError:
    pass
assert not {{"sympy", "pandas", "matplotlib", "pydantic", "rich", "typer"}} & set(sys.modules)
"""
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize("name", [name for name in fp.__all__ if name != "Constraint"])
def test_options_have_names(name: str) -> None:
    pytest.importorskip("sympy")
    public = getattr(fp, name)
    if name in RESULTS or (isinstance(public, type) and issubclass(public, tuple)):
        return
    parameters = inspect.signature(public).parameters.values()
    positional = [one for one in parameters if one.kind is inspect.Parameter.POSITIONAL_OR_KEYWORD]
    optional = [one.name for one in positional if one.default is not inspect.Parameter.empty]
    assert optional == OPTIONAL_AND_POSITIONAL.get(name, [])


def test_types_are_known(tmp_path: Path) -> None:
    """Of the names too that are imported when they are asked for."""
    pytest.importorskip("mypy")
    program = tmp_path / "program.py"
    program.write_text("""
from pathlib import Path
from typing import Any, assert_type
import fisherpoint as fp

@fp.model(states={"c": "mol/L"}, parameters={"k": "1/s"}, outputs={"c": "mol/L"})
def decay(x: Any, u: Any, p: Any) -> Any:
    return [-p.k * fp.math.sqrt(x.c)], [fp.math.sqrt(x.c)]

assert_type(decay, fp.SymbolicModel)
assert_type(fp.load_model(Path("model.toml")), fp.Model)
model: fp.Model = decay.compile()
other: type[fp.Model] = fp.CallableModel
fp.math.sqrt(1, 2)  # wrong
fp.nothing  # wrong
""")
    # A process of its own: mypy lets Python recurse more deeply.
    command = [sys.executable, "-m", "mypy", "--config-file", "pyproject.toml", "--strict", "--warn-unused-ignores", str(program)]
    out = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False).stdout
    errors = [line.split(": ", 1)[0].rpartition(":")[2] for line in out.splitlines() if ": error: " in line]
    assert errors == ["14", "15"], out
