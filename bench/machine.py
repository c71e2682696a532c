"""What the figures were taken on."""

from __future__ import annotations

import os
import platform
from importlib.metadata import version
from pathlib import Path

import fisherpoint as fp
from fisherpoint.points.settings import resolve_threads


def describe() -> dict[str, str]:
    """Return processor, cores, instruction set, versions, and how busy the machine was with other work."""
    return {
        "processor": _processor(),
        "cores": str(resolve_threads(None)),
        "instruction set": f"{fp.instruction_set()} of {', '.join(fp.instruction_sets())}",
        "system": platform.platform(),
        "fisherpoint": fp.__version__,
        "python": platform.python_version(),
        "numpy": version("numpy"),
        "scipy": version("scipy"),
        "load at the start": ", ".join(f"{load:.1f}" for load in os.getloadavg()),
    }


def _processor() -> str:
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        for line in cpuinfo.read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()
