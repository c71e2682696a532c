"""What made a file: versions, and the instruction set, on which the last bits may depend."""

from __future__ import annotations

import platform
from importlib.metadata import PackageNotFoundError, version

import numpy as np

from .levels import instruction_set


def versions() -> dict[str, str]:
    """Versions and instruction set by name."""
    try:
        own = version("fisherpoint")
    except PackageNotFoundError:
        own = "unknown"
    return {"fisherpoint": own, "numpy": np.__version__, "python": platform.python_version(), "isa": instruction_set()}
