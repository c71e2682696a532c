"""C++ programs of the bench: compiled with g++ when they are first asked for, into a folder of the user's cache."""

from __future__ import annotations

import hashlib
import os
import resource
import shutil
import subprocess
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

COMPILER = "g++"


@dataclass(frozen=True)
class Program:
    """A program or library, and the processor time that its compilation took, s."""

    path: Path
    seconds: float


def missing(headers: dict[str, str], options: Sequence[str] = ()) -> str | None:
    """Return what the compilation lacks: the compiler, or the first of the headers, by what holds it."""
    if shutil.which(COMPILER) is None:
        return "a C++ compiler: apt-get install g++"
    test = [COMPILER, "-std=c++20", *options, "-x", "c++", "-fsyntax-only", "-"]
    for header, holder in headers.items():
        if subprocess.run(test, input=f"#include <{header}>\n".encode(), capture_output=True).returncode:
            return holder
    return None


@cache
def version() -> str:
    """Return the compiler's."""
    return subprocess.run([COMPILER, "-dumpfullversion"], capture_output=True, text=True, check=True).stdout.strip()


def compiled(name: str, main: Path, options: Sequence[str], sources: Iterable[Path], machine: str = "") -> Program:
    """Compile `main`, unless that was done before with the same sources and options, and for the same machine where it counts."""
    contents = b"".join(path.read_bytes() for path in sorted(sources))
    key = hashlib.sha256(contents + repr((options, version(), machine)).encode()).hexdigest()[:16]
    cache_home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    built = cache_home / "fisherpoint-bench" / f"{name}-{key}"
    took = built.with_suffix(".seconds")
    if not built.exists() or not took.exists():
        built.parent.mkdir(parents=True, exist_ok=True)
        unfinished = built.with_suffix(f".{os.getpid()}")
        begin = _children_seconds()
        subprocess.run([COMPILER, *options, str(main), "-o", str(unfinished)], check=True)
        took.write_text(f"{_children_seconds() - begin:.1f}\n")
        unfinished.replace(built)
    return Program(built, float(took.read_text()))


def _children_seconds() -> float:
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime
