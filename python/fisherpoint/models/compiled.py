"""Compiles a model's programs into a shared object of the core's own kernels, once: a cache keeps it by what it was made from."""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
import shutil
import subprocess
import sys
import threading
import warnings
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from typing import Any, NamedTuple

from ..basics.messages import printable
from ..basics.quantity import Quantity
from ..engine import _core
from ..engine.levels import instruction_set
from .base import Model
from .cpp_source import cpp_model
from .library_cache import LibraryCache
from .tape.programs import Programs
from .temporary_directories import Temporary

_NAME = "CompiledModel"
_MODEL = "model.hpp"
_EXPORTS = "exports.map"

_INTEGRATORS = "".join(
    f"template class Integrator<CompiledEquation<{_NAME}>, {method}>;\n" for method in ("DormandPrince", "DormandPrince853")
)
_LONG = {
    "predictive_covariance": (f"template FisherpointPredictiveCovariance predictive_covariance_request<{_NAME}>;\n",),
    "sensitivities": (
        f"template FisherpointSensitivities sensitivities_request<{_NAME}>;\n",
        f"template FisherpointRunSensitivities run_sensitivities_request<{_NAME}>;\n",
    ),
}
_LIBRARY = f"""
extern "C" __attribute__((visibility("default"))) const FisherpointKernels* fisherpoint_kernels() {{
  return &kernels_of<{_NAME}>;
}}
"""
# Built side by side, the longest first; the integrators are built once.
_SOURCES = {
    **{name: _INTEGRATORS.replace("template", "extern template") + "".join(kernels) for name, kernels in _LONG.items()},
    "library": _INTEGRATORS + "".join(f"extern {kernel}" for kernels in _LONG.values() for kernel in kernels) + _LIBRARY,
}
_FLAGS = ("-std=c++20", "-O3", "-fPIC", "-fvisibility=hidden", "-ffp-contract=fast", "-fno-math-errno", "-w")

# g++ copies states through 16-byte moves, on which loads of whole vectors then wait. With 64-byte vectors nothing was gained.
_WHOLE_MOVES = (
    *("--param", "sra-max-scalarization-size-Ospeed=4096", "--param", "sra-max-propagations=100000"),
    *("-mmove-max=256", "-mstore-max=256"),
)

# Nothing but the kernels' table leaves the library.
_ENTRY_ALONE = "-Wl,-exported_symbol,_fisherpoint_kernels" if sys.platform == "darwin" else f"-Wl,--version-script={_EXPORTS}"

LAST_LINES = 3
"""Number of last lines of a compiler's output that are shown beside its first error."""


class CompiledCore(NamedTuple):
    """A model with kernels of its own, and the key of all that decides how they compute."""

    core: Any
    key: str


def compiled_model(model: Model, states: Sequence[Quantity], programs: Programs, tape: Any) -> CompiledCore | None:
    """Return `programs`, which `tape` has as the core interprets them, with kernels of their own, built where no cache has them.

    None, with a warning that says why, where there is no C++ compiler, or where it cannot build the model.
    """
    compiler, include = find_compiler(), _include_directory()
    if compiler is None:
        _stays_interpreted("expected a C++ compiler (g++ or clang++, or one named by CXX), found none")
        return None
    if include is None:
        _stays_interpreted("expected the core's headers beside the package, found none")
        return None
    flags = [
        *_FLAGS,
        *([] if instruction_set() == "generic" else [f"-march=x86-64-{instruction_set()}"]),
        *_whole_moves(compiler),
        f"-I{include}",
    ]
    sources = {_MODEL: cpp_model(model, states, programs, _NAME)}
    sources[_EXPORTS] = "{ global: fisherpoint_kernels; local: *; };\n"
    includes = f'#include "{_MODEL}"\n#include "fisherpoint/compiled/c_kernels.hpp"\n\n'
    for name, content in _SOURCES.items():
        sources[f"{name}.cpp"] = f"{includes}namespace fisherpoint {{\n\n{content}\n}}  // namespace fisherpoint\n"

    cache = LibraryCache()
    try:
        key = _key(compiler, flags, sources, include)
        found = _loaded(tape, cache, key)
        if found is None:
            found = _core.CompiledModel(tape, str(cache.keep(key, _build(compiler, flags, sources))))
    except (OSError, RuntimeError) as error:
        _stays_interpreted(f"expected {compiler} to build the model, given: {error}")
        return None
    for remark in cache.remarks:
        warnings.warn(f"compile: {printable(remark)}", stacklevel=3)
    return CompiledCore(found, key)


def _loaded(tape: Any, cache: LibraryCache, key: str) -> Any | None:
    """The model with the kernels that the cache has; None where it has none, or they do not load."""
    library = cache.find(key)
    if library is None:
        return None
    try:
        return _core.CompiledModel(tape, str(library))
    except RuntimeError as error:
        cache.discard(library, str(error))
        return None


def _stays_interpreted(reason: str) -> None:
    warnings.warn(f"compile: {printable(reason)}; the model stays interpreted", stacklevel=4)


def find_compiler() -> str | None:
    """Return the C++ compiler: the one that the environment variable CXX names, or the first of g++, clang++ and c++."""
    candidates = [os.environ["CXX"]] if os.environ.get("CXX") else ["g++", "clang++", "c++"]
    return next((found for candidate in candidates if (found := shutil.which(candidate))), None)


def _whole_moves(compiler: str) -> tuple[str, ...]:
    """Return `_WHOLE_MOVES` where they pay and the compiler takes them, as g++ does from version 12 on."""
    if instruction_set() not in ("v2", "v3"):
        return ()
    with contextlib.suppress(OSError):
        answer = subprocess.run([compiler, "--version"], stdin=subprocess.DEVNULL, capture_output=True, check=False)
        version = re.match(rb"(?:\S*-)?(?:g|c)\+\+\S* \(.*?\) (\d+)\.", answer.stdout)
        if version and int(version[1]) >= 12 and b"Free Software Foundation" in answer.stdout:
            return _WHOLE_MOVES
    return ()


def _include_directory() -> Path | None:
    package = Path(__file__).resolve().parents[1]
    for directory in (package / "engine" / "include", package.parents[1] / "cpp" / "include"):  # installed, or in a source tree
        if (directory / "fisherpoint" / "compiled" / "c_kernels.hpp").exists():
            return directory
    return None


def _key(compiler: str, flags: list[str], sources: dict[str, str], include: Path) -> str:
    """Key of all that decides what is built: compiler, flags with the instruction set, sources, and the core's headers."""
    answer = subprocess.run([compiler, "--version"], stdin=subprocess.DEVNULL, capture_output=True, check=False)
    if answer.returncode != 0:
        raise RuntimeError(f"exit status {answer.returncode} of --version")
    content = hashlib.sha256(repr((compiler, answer.stdout, flags, sorted(sources.items()))).encode())
    for header in sorted((include / "fisherpoint").rglob("*.hpp")):
        content.update(f"{header.relative_to(include)}\0{header.stat().st_size}\0".encode())
        content.update(header.read_bytes())
    return content.hexdigest()[:32]


def _build(compiler: str, flags: list[str], sources: dict[str, str]) -> bytes:
    """Return the library.

    Raises
    ------
    OSError
        Where the compiler cannot be run or there is no room for its files.
    RuntimeError
        Where it fails; with its first complaint and its last lines.
    """
    temporary = Temporary(group=True)
    try:
        for name, text in sources.items():
            (temporary.path / name).write_text(text, encoding="utf-8")
        _run([[compiler, *flags, "-c", f"{name}.cpp"] for name in _SOURCES], temporary)
        objects = [f"{name}.o" for name in _SOURCES]
        _run([[compiler, "-shared", "-pthread", _ENTRY_ALONE, "-o", "library.so", *objects]], temporary)
        return (temporary.path / "library.so").read_bytes()
    finally:
        temporary.remove()


def _run(commands: Sequence[Sequence[str]], temporary: Temporary) -> None:
    """Run commands side by side; where one fails, or this process is interrupted or ended, the others end too."""
    stop = threading.Event()

    def run(command: Sequence[str]) -> None:
        if stop.is_set():
            return
        process = subprocess.Popen(
            command,
            cwd=temporary.path,
            env={**os.environ, "LC_ALL": "C", "TMPDIR": str(temporary.path)},  # a compiler that is killed leaves its own files
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            process_group=temporary.group,
        )
        if stop.is_set():
            temporary.end_group()
        complaints = process.communicate()[1].decode(errors="replace")
        if process.returncode != 0:
            raise RuntimeError(_shortened(complaints) or f"exit status {process.returncode}")

    with ThreadPoolExecutor(max_workers=os.cpu_count()) as pool:
        try:
            for done in as_completed([pool.submit(run, command) for command in commands]):
                done.result()
        except BaseException:
            stop.set()
            temporary.end_group()
            raise


def _shortened(complaints: str) -> str:
    """The first error and the last lines of what a compiler says, as one line."""
    lines = [" ".join(line.split()) for line in complaints.splitlines() if line.strip()]
    first = next((k for k, line in enumerate(lines) if "error" in line), len(lines))
    chosen = dict.fromkeys([*lines[first : first + 1], *lines[max(first + 1, len(lines) - LAST_LINES) :]] or lines[-LAST_LINES:])
    return "; ".join(f"{line:.200}" for line in chosen)
