"""Calls in a process of their own: for another instruction set, which is chosen at import, and for peak memory."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

_CODE = """
import json, sys
from importlib import import_module
module, function, arguments = json.loads(sys.argv[1])
print(json.dumps(getattr(import_module(module), function)(*arguments)))
"""


def call(module: str, function: str, *arguments: Any, isa: str | None = None) -> Any:
    """Return what `function` of `module` returns for the arguments, all of them JSON values."""
    environment = dict(os.environ) | ({} if isa is None else {"FISHERPOINT_ISA": isa})
    command = [sys.executable, "-c", _CODE, json.dumps([module, function, arguments])]
    root = Path(__file__).resolve().parents[1]
    run = subprocess.run(command, env=environment, cwd=root, stdout=subprocess.PIPE, text=True, check=True)
    return json.loads(run.stdout)
