"""Chooses the compiled kernels for this machine, once, at import.

The kernels exist once per instruction-set level, each a module of its own (``_kernels_v2``, ``_kernels_v3``, ``_kernels_v4`` on
x86-64, ``_kernels_generic`` elsewhere). The best level that the machine has is taken; the environment variable ``FISHERPOINT_ISA``
overrides the choice.
"""

from __future__ import annotations

import os
from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, Protocol

from ..basics.messages import shown
from . import _core

if TYPE_CHECKING:
    from . import _kernels as kernels  # the stub that all levels share


class Kernels(Protocol):
    """What runs models: the compiled kernels do, and what stands in for them where a model is not made of operations.

    The settings are rtol, whether kinks and jumps are crossed, the method and the number of threads; `_kernels.pyi` has all
    arguments.
    """

    def simulate(self, model: Any, x0: Any, u: Any, dt: Any, theta: Any, *settings: Any, **options: Any) -> tuple[Any, ...]:
        """x, y, status."""

    def sensitivities(self, model: Any, x0: Any, u: Any, dt: Any, theta: Any, *settings: Any, **options: Any) -> tuple[Any, ...]:
        """x, y, dx_dtheta, dy_dtheta, status.

        With the option `whole_first` dt is the first step that is tried; with `outputs_alone` there is no dx_dtheta, (0, n_x, p),
        which may take less time. With `states_later` there is none where that does take less time, and a point that ends on a jump
        that its states feel has no derivative, as with dx_dtheta.
        """

    def simulate_runs(self, model: Any, x0: Any, u: Any, dt: Any, theta: Any, *settings: Any, **options: Any) -> tuple[Any, ...]:
        """x (K, N + 1, n_x), status, reached of runs; u (K, N, n_u) and dt (K, N) are of their segments, or of those of all."""

    def run_sensitivities(
        self, model: Any, x0: Any, u: Any, dt: Any, theta: Any, *settings: Any, **options: Any
    ) -> tuple[Any, ...]:
        """x (K, N + 1, n_x), y, dx_dtheta and dy_dtheta (K, N, ...), status, reached; with the options `measured`,
        the flags of the ends, `s`, dx_dtheta at the starts or empty, `outputs_alone`, and `doubts`, by which entries of
        dx_dtheta are NaN that hang on whether a jump is met before an end or behind it; `moved` (K, N, E) are the columns of
        parameters that move the switch at a segment's start, -1 for none, and `moved_u` (K, N, E, n_u) the inputs before."""

    def predictive_covariance(
        self, model: Any, x0: Any, u: Any, dt: Any, theta: Any, nodes: _core.PriorNodes, *settings: Any, **options: Any
    ) -> tuple[Any, ...]:
        """covariance, status, nodes that were redone, outputs where kept, lost weight; `max_lost` of it is no failure."""


LEVELS = ("v2", "v3", "v4", "generic")


def _module(level: str) -> str:
    return f"{__package__}._kernels_{level}"


def instruction_sets() -> tuple[str, ...]:
    """Return the instruction-set levels that this machine has and that are installed, the best last."""
    return tuple(level for level in _core.supported_isas() if find_spec(_module(level)))


def _choose() -> str:
    available = instruction_sets()
    if not available:
        raise ImportError(f"expected kernels for one of {_core.supported_isas()}, given none: reinstall fisherpoint")
    wanted = os.environ.get("FISHERPOINT_ISA")
    if wanted is None:
        return available[-1]
    if wanted not in available:
        why = ", which is not installed" if wanted in _core.supported_isas() else ""
        why = why or (", which this machine does not have" if wanted in LEVELS else "")
        raise ImportError(f"FISHERPOINT_ISA: expected one of {', '.join(available)}, given {shown(wanted)}{why}")
    return wanted


__all__ = ["Kernels", "instruction_set", "instruction_sets", "kernels"]

_ISA = _choose()
if not TYPE_CHECKING:
    kernels = import_module(_module(_ISA))


def instruction_set() -> str:
    """Return the instruction-set level in use."""
    return _ISA
