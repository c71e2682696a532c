"""Boost.odeint in C++: Cash-Karp 5(4) with controlled steps, scalar and on packs of `<experimental/simd>`.

The programs are in `odeint/`; they are compiled for this machine when they are first asked for, with g++ and Boost's headers from
the system, into a folder of the user's cache. Both are given hand-written derivatives for the sensitivities; on packs these are of
experiments side by side.
"""

from __future__ import annotations

import ctypes
import os
import subprocess
from functools import cache
from pathlib import Path

import numpy as np

import fisherpoint as fp

from .. import compiled, machine
from ..workload import MODEL, STATE_SCALES, Array, Pairs
from .peer import Peer, Solution, sensitivity_scales, table

SOURCES = Path(__file__).parent / "odeint"
# -ffast-math would lose the tests for failed steps; these two only let square roots be plain instructions.
# Held to the level that fisherpoint is held to.
ARCHITECTURE = f"x86-64-{fp.instruction_set()}" if "FISHERPOINT_ISA" in os.environ else "native"
OPTIONS = [
    "-std=c++20",
    "-O3",
    f"-march={ARCHITECTURE}",
    "-mtune=native",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-shared",
    "-fPIC",
]
CONSTANTS = ("A_A", "A_B", "q_min", "q_max", "p_s", "T_1", "k_u")


@cache
def missing() -> str | None:
    """Return what the compilation lacks."""
    boost = "Boost's headers: apt-get install libboost-dev"
    return compiled.missing({"boost/version.hpp": boost, "experimental/simd": boost})


def versions() -> dict[str, str]:
    """Return those of Boost and of the compiler."""
    command = [compiled.COMPILER, "-x", "c++", "-E", "-P", "-"]
    source = "#include <boost/version.hpp>\nBOOST_LIB_VERSION\n"
    printed = subprocess.run(command, input=source, capture_output=True, text=True, check=True).stdout
    return {"Boost": printed.split("\n")[-2].strip('"').replace("_", "."), compiled.COMPILER: compiled.version()}


@cache
def library() -> ctypes.CDLL:
    """Compile the programs for this machine, unless that was done before, and load them."""
    processor = machine.describe()["processor"]
    return ctypes.CDLL(str(compiled.compiled("odeint", SOURCES / "odeint.cpp", OPTIONS, SOURCES.iterdir(), processor).path))


class Odeint(Peer):
    """One of the two; `variant` is the ending of its functions' names."""

    def __init__(self, name: str, variant: str) -> None:
        self.name, self.variant = name, variant

    def outputs(self, pairs: Pairs, rtol: float) -> Solution:
        x, steps = _solve(f"states_{self.variant}", pairs, rtol, STATE_SCALES)
        return Solution.of_states(x, steps)

    def sensitivities(self, pairs: Pairs, rtol: float) -> Solution:
        scales = np.concatenate([STATE_SCALES, sensitivity_scales()[:4].ravel()])
        ends, steps = _solve(f"sensitivities_{self.variant}", pairs, rtol, scales)
        dx_dtheta = np.zeros((len(pairs), 5, 9))  # the spool's stay zero
        dx_dtheta[:, :4] = ends[:, 5:].reshape(-1, 4, 9)
        return Solution.of_states(ends[:, :5], steps, dx_dtheta)


def _solve(function: str, pairs: Pairs, rtol: float, scales: Array) -> tuple[Array, float]:
    constants = np.array([MODEL.constants[name] for name in CONSTANTS])
    ends = np.empty((len(pairs), len(scales)))
    floats = np.ctypeslib.ndpointer(np.float64, flags="C_CONTIGUOUS")
    call = getattr(library(), function)
    call.restype = ctypes.c_long
    call.argtypes = [floats, ctypes.c_long, floats, floats, ctypes.c_double, floats, floats]
    steps = call(constants, len(pairs), table(pairs), np.ascontiguousarray(pairs.theta), rtol, scales, ends)
    return ends, steps / len(pairs)


PEERS: list[Peer] = [
    Odeint("Boost.odeint", "scalar"),
    Odeint("Boost.odeint on packs", "packs"),
]
