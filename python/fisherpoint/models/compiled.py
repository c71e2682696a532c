"""Compiles a model's programs into a shared object of the core's own kernels, once: a cache keeps it by its content."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import tempfile
import warnings
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING

from ..kernels import isa
from ..tape.cpp import cpp_model

if TYPE_CHECKING:
    from .symbolic import SymbolicModel

_NAME = "CompiledModel"
_MODEL = "model.hpp"

# Built side by side, as each takes its time.
_SOURCES = {
    "simulate": "FisherpointOutcome fisherpoint_simulate(const FisherpointRequest* r, double* x, double* y, std::int32_t* status)"
    " {{ return simulate_request<{name}>(r, x, y, status); }}",
    "sensitivities": "FisherpointOutcome fisherpoint_sensitivities(const FisherpointRequest* r, double* x, double* y, double* dx,"
    " double* dy, std::int32_t* status) {{ return sensitivities_request<{name}>(r, x, y, dx, dy, status); }}",
    "chain": "FisherpointOutcome fisherpoint_chain(const FisherpointRequest* r, std::int64_t pieces, double* x,"
    " std::int32_t* status, std::int64_t* reached) {{ return chain_request<{name}>(r, pieces, x, status, reached); }}",
    "predictive_covariance": "FisherpointOutcome fisherpoint_predictive_covariance(const FisherpointRequest* r,"
    " const fisherpoint::PriorNodes* nodes, double max_lost, double* covariance, std::int32_t* status, std::int64_t* redone,"
    " double* lost, double* y) {{ return predictive_covariance_request<{name}>(r, nodes, max_lost, covariance, status, redone,"
    " lost, y); }}",
}
_FLAGS = ("-std=c++20", "-O3", "-fPIC", "-fvisibility=hidden", "-ffp-contract=fast", "-fno-math-errno", "-w")


def compiled_library(model: SymbolicModel) -> Path | None:
    """Return the shared object for a model, built if the cache does not have it.

    None, with a warning that says why, where there is no C++ compiler, or where it cannot build the model.
    """
    compiler, include = find_compiler(), _include_directory()
    if compiler is None:
        _stays_interpreted("expected a C++ compiler (g++ or clang++, or one named by CXX), found none")
        return None
    if include is None:
        _stays_interpreted("expected the core's headers beside the package, found none")
        return None
    flags = [*_FLAGS, *([] if isa() == "generic" else [f"-march=x86-64-{isa()}"]), f"-I{include}"]
    sources = {_MODEL: cpp_model(model, model.structure.programs, _NAME)}
    for kernel, function in _SOURCES.items():
        includes = f'#include "{_MODEL}"\n#include "fisherpoint/c_kernels.hpp"\n\nusing namespace fisherpoint;\n\n'
        visible = 'extern "C" __attribute__((visibility("default")))\n'
        sources[f"{kernel}.cpp"] = includes + visible + function.format(name=_NAME) + "\n"
    library = cache_directory() / f"{_key(compiler, flags, sources, include)}.so"
    if not library.exists():
        error = _build(compiler, flags, sources, library)
        if error is not None:
            _stays_interpreted(f"expected {compiler} to build the model, given: {error}")
            return None
    return library


def _stays_interpreted(reason: str) -> None:
    warnings.warn(f"compile: {reason}; the model stays interpreted", stacklevel=4)


def find_compiler() -> str | None:
    """Return the C++ compiler: the one that the environment variable CXX names, or the first of g++, clang++ and c++."""
    candidates = [os.environ["CXX"]] if os.environ.get("CXX") else ["g++", "clang++", "c++"]
    return next((found for candidate in candidates if (found := shutil.which(candidate))), None)


def cache_directory() -> Path:
    """Return where compiled models are kept: ``FISHERPOINT_CACHE``, or fisherpoint in the user's cache directory."""
    given = os.environ.get("FISHERPOINT_CACHE")
    if given:
        return Path(given)
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "fisherpoint"


def _include_directory() -> Path | None:
    package = Path(__file__).resolve().parents[1]
    for directory in (package / "include", package.parents[1] / "cpp" / "include"):  # installed, or in a source tree
        if (directory / "fisherpoint" / "c_kernels.hpp").exists():
            return directory
    return None


def _key(compiler: str, flags: list[str], sources: dict[str, str], include: Path) -> str:
    version = subprocess.run([compiler, "--version"], capture_output=True, text=True, check=False).stdout
    content = hashlib.sha256(repr((version, flags, sorted(sources.items()))).encode())
    for header in sorted((include / "fisherpoint").glob("*.hpp")):
        content.update(header.read_bytes())
    return content.hexdigest()[:32]


def _build(compiler: str, flags: list[str], sources: dict[str, str], library: Path) -> str | None:
    """Build the library; return the compiler's first complaint where that fails."""
    library.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=library.parent) as directory:
        for name, text in sources.items():
            (Path(directory) / name).write_text(text, encoding="utf-8")

        def run(*arguments: str) -> str | None:
            done = subprocess.run([compiler, *arguments], cwd=directory, capture_output=True, text=True, check=False)
            if done.returncode == 0:
                return None
            complaints = [line for line in done.stderr.splitlines() if "error" in line] or done.stderr.splitlines()
            return complaints[0].strip() if complaints else f"exit status {done.returncode}"

        with ThreadPoolExecutor(max_workers=os.cpu_count()) as pool:
            for complaint in pool.map(lambda kernel: run(*flags, "-c", f"{kernel}.cpp"), _SOURCES):
                if complaint is not None:
                    return complaint
        complaint = run("-shared", "-pthread", "-o", "library.so", *(f"{kernel}.o" for kernel in _SOURCES))
        if complaint is None:
            os.replace(Path(directory) / "library.so", library)  # at once, for whoever else builds the same
        return complaint
