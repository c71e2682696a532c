"""How a trajectory ended."""

from __future__ import annotations

from collections import Counter
from enum import IntEnum

import numpy as np

from ..basics.values import Array, IntArray


class NoTrajectory(ValueError):
    """Points or runs one of whose trajectories at the prior mean is not ok; the message says which, and why."""


class Status(IntEnum):
    """How a trajectory ended, with what it means and what helps, in one sentence."""

    advice: str

    def __new__(cls, code: int, advice: str = "") -> Status:
        status = int.__new__(cls, code)
        status._value_, status.advice = code, advice
        return status

    ok = 0, "The trajectory reached its end."
    met_jump = (
        1,
        "The right-hand side jumps on the way, and jumps='exclude' or the kind of jump (see model.crossable) forbids to cross it: "
        "start further off or sample earlier.",
    )
    left_domain = (
        2,
        "The state reached a limit beyond which the model has no value, or a limit along the way: start further inside or sample"
        " earlier.",
    )
    step_limit = 3, "The tolerance requires more or smaller steps than allowed: increase rtol or sample earlier."
    not_finite = (
        4,
        "A rate, an output or what depends on it overflowed: check constants, parameters and standard deviations.",
    )
    met_kink = 5, "The trajectory crosses one of the model's kinks, which kinks='exclude' forbids."
    grazes_jump = (
        6,
        "The trajectory touches a jump along its tangent, and has no derivative: change the start or the duration.",
    )
    on_jump = (
        7,
        "The trajectory starts, rests or ends on a jump, where it has no derivative: change the start, the input or the duration.",
    )
    two_jumps = (
        8,
        "The trajectory meets several jumps at once, and their order matters: change the start, or sample earlier.",
    )
    chatters = 9, "The trajectory meets jumps again and again in ever shorter times: sample earlier."
    no_rest = (
        10,
        "The run is to start at rest, and there is no rest at these parameters: none, an unstable one, or a whole range of them.",
    )

    def __str__(self) -> str:
        return self.name

    def __format__(self, spec: str) -> str:
        return format(self.name, spec)


def named(status: IntArray) -> tuple[Status, ...]:
    """Statuses as what they are, which shows their names."""
    return tuple(Status(int(code)) for code in status)


def failures_of(status: IntArray) -> Counter[str]:
    """How many trajectories ended otherwise than ok, by the names of their statuses."""
    counts = np.bincount(status, minlength=len(Status))
    return Counter({Status(value).name: int(n) for value, n in enumerate(counts) if n and value != Status.ok})


def only_finite(status: IntArray, *results: Array) -> IntArray:
    """Statuses (K,) with `Status.not_finite` where an ok row of a result (K, ...) is not finite; such rows become zero."""
    finite = np.all([np.isfinite(result).all(axis=tuple(range(1, result.ndim))) for result in results], axis=0)
    if finite.all():
        return status
    for result in results:
        result[~finite] = 0.0
    return np.where((status == Status.ok) & ~finite, Status.not_finite, status).astype(np.int32)
