"""The core's headers: a folder includes those before it alone, and no header itself in the end."""

import re
from graphlib import TopologicalSorter
from pathlib import Path

CORE = Path(__file__).parents[2] / "cpp" / "include" / "fisherpoint"
FOLDERS = ("numbers", "models", "equations", "prior", "integration", "kernels", "compiled")  # as CONTRIBUTING.md has them


def test_headers_include_one_way() -> None:
    included = {
        str(header.relative_to(CORE)): re.findall(r'#include "(?:fisherpoint/)?(.*)"', header.read_text())
        for header in CORE.rglob("*.hpp")
    }
    assert {name.split("/")[0] for name in included} == set(FOLDERS)
    assert not {other for others in included.values() for other in others} - set(included)
    for name, others in included.items():
        for other in others:
            assert FOLDERS.index(other.split("/")[0]) <= FOLDERS.index(name.split("/")[0]), f"{name} includes {other}"
    TopologicalSorter(included).prepare()  # raises CycleError
