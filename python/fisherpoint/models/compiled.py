"""Compiles a model's programs into a shared object, once: a cache keeps it by what it was made from.

It has the core's own kernels for a small model, and of any other functions that the kernels of interpreted models call.
"""

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
from collections.abc import Callable, Sequence
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
from .straight_source import straight_sources
from .tape.programs import Programs
from .temporary_directories import Temporary

MOST_OF_KERNELS = 11
"""The most states of a model with kernels of its own.

Straight functions serve trajectories as well, but kernels of tapes do not know patterns as types: sensitivities of chains of 4, 8
and 16 states with as many parameters take 1.9, 2.1 and 1.6 times as long by them. Kernels of these take 25, 40 and 90 s to build,
straight functions 1 s; and they have no order of elimination, without which implicit steps of 20 states take twice as long.
"""

MOST_BITS = 64
"""The most states and parameters together of such a model: they are bits of one word to the compiler."""

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
_FLAGS = ("-std=c++20", "-fPIC", "-fvisibility=hidden", "-fno-math-errno", "-w")
_KERNEL_FLAGS = ("-O3", "-ffp-contract=fast")
_STRAIGHT_FLAGS = ("-O1", "-ffp-contract=off")

# g++ copies states through 16-byte moves, on which loads of whole vectors then wait. With 64-byte vectors nothing was gained.
_WHOLE_MOVES = (
    *("--param", "sra-max-scalarization-size-Ospeed=4096", "--param", "sra-max-propagations=100000"),
    *("-mmove-max=256", "-mstore-max=256"),
)

LAST_LINES = 3
"""Number of last lines of a compiler's output that are shown beside its first error."""


class CompiledCore(NamedTuple):
    """A model with kernels of its own, and the key of all that decides how they compute."""

    core: Any
    key: str


class _Form(NamedTuple):
    """What is built: files, those in C++ in the order in which they are compiled; flags; what loads it, and its only entry."""

    sources: dict[str, str]
    flags: tuple[str, ...]
    load: Callable[[Any, str], Any]
    entry: str


def compiled_model(model: Model, states: Sequence[Quantity], programs: Programs, tape: Any) -> CompiledCore | None:
    """Return `programs`, which `tape` has as the core interprets them, compiled, where no cache has that.

    None, with a warning that says why, where there is no C++ compiler, or where it cannot build the model.
    """
    compiler, include = find_compiler(), _include_directory()
    if compiler is None:
        _stays_interpreted("expected a C++ compiler (g++ or clang++, or one named by CXX), found none")
        return None
    if include is None:
        _stays_interpreted("expected the core's headers beside the package, found none")
        return None
    small = len(states) <= MOST_OF_KERNELS and len(states) + len(model.parameters) <= MOST_BITS
    small = small and not programs.reset_count and not programs.update_count
    form = _kernels(model, states, programs, compiler) if small else _straight_functions(model, states, programs)
    flags = [
        *_FLAGS,
        *form.flags,
        *([] if instruction_set() == "generic" else [f"-march=x86-64-{instruction_set()}"]),
        f"-I{include}",
    ]
    form.sources[_EXPORTS] = f"{{ global: {form.entry}; local: *; }};\n"

    cache = LibraryCache()
    try:
        key = _key(compiler, flags, form.sources, include)
        found = _loaded(tape, cache, key, form)
        if found is None:
            found = form.load(tape, str(cache.keep(key, _build(compiler, flags, form))))
    except (OSError, RuntimeError) as error:
        _stays_interpreted(f"expected {compiler} to build the model, given: {error}")
        return None
    for remark in cache.remarks:
        warnings.warn(f"compile: {printable(remark)}", stacklevel=3)
    return CompiledCore(found, key)


def _kernels(model: Model, states: Sequence[Quantity], programs: Programs, compiler: str) -> _Form:
    """All kernels, with the model's equations inlined."""
    sources = {_MODEL: cpp_model(model, states, programs, _NAME)}
    includes = f'#include "{_MODEL}"\n#include "fisherpoint/compiled/c_kernels.hpp"\n\n'
    for name, content in _SOURCES.items():
        sources[f"{name}.cpp"] = f"{includes}namespace fisherpoint {{\n\n{content}\n}}  // namespace fisherpoint\n"
    return _Form(sources, (*_KERNEL_FLAGS, *_whole_moves(compiler)), _core.CompiledModel, "fisherpoint_kernels")


def _straight_functions(model: Model, states: Sequence[Quantity], programs: Programs) -> _Form:
    """Functions that compute what the interpreted programs do, to the last bit."""
    sides = len(model.jumps) + len(model.kinks)
    sources = straight_sources(programs, len(model.parameters), len(model.inputs), len(states), sides)
    files = {f"{name}.cpp": text for name, text in sources.items()}
    return _Form(files, _STRAIGHT_FLAGS, _core.StraightModel, "fisherpoint_programs")


def _loaded(tape: Any, cache: LibraryCache, key: str, form: _Form) -> Any | None:
    """The model with what the cache has; None where it has nothing, or that does not load."""
    library = cache.find(key)
    if library is None:
        return None
    try:
        return form.load(tape, str(library))
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


def _build(compiler: str, flags: list[str], form: _Form) -> bytes:
    """Return the library.

    Raises
    ------
    OSError
        Where the compiler cannot be run or there is no room for its files.
    RuntimeError
        Where it fails; with its first complaint and its last lines.
    """
    # Nothing but the entry leaves the library.
    alone = f"-exported_symbol,_{form.entry}" if sys.platform == "darwin" else f"--version-script={_EXPORTS}"
    temporary = Temporary(group=True)
    try:
        for name, text in form.sources.items():
            (temporary.path / name).write_text(text, encoding="utf-8")
        names = [name.removesuffix(".cpp") for name in form.sources if name.endswith(".cpp")]
        _run([[compiler, *flags, "-c", f"{name}.cpp"] for name in names], temporary)
        objects = [f"{name}.o" for name in names]
        _run([[compiler, "-shared", "-pthread", f"-Wl,{alone}", "-o", "library.so", *objects]], temporary)
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
