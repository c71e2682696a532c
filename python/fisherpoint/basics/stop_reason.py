"""Why a search ended."""

from __future__ import annotations

from enum import StrEnum, auto

from .messages import shown


class StopReason(StrEnum):
    """Why a search ended: a text, which is its name, with `words` for a table and a sentence of `advice`."""

    converged = auto()
    completed = auto()
    proven = auto()
    patience = auto()
    max_iterations = auto()
    max_evaluations = auto()
    max_nodes = auto()
    too_many_candidates = auto()
    time_limit = auto()
    interrupted = auto()
    interrupted_first = auto()
    stalled = auto()
    not_evaluable = auto()
    no_effect = auto()
    rounding = auto()
    weights_changed = auto()
    diverged = auto()
    no_maximum = auto()
    at_bound = auto()
    not_bounded = auto()

    @classmethod
    def _missing_(cls, value: object) -> StopReason:
        raise ValueError(f"stop_reason: expected one of {', '.join(cls)}, given {shown(value)}")

    @property
    def words(self) -> str:
        """What has happened, as part of a sentence."""
        return _WORDS[self][0]

    @property
    def advice(self) -> str:
        """What it means and what helps, in one sentence."""
        return _WORDS[self][1]

    @property
    def complete(self) -> bool:
        """Whether the search did all its work: more time, iterations or nodes would change nothing."""
        return self in (StopReason.converged, StopReason.completed, StopReason.proven)


_WORDS = {
    StopReason.converged: ("converged", "Nothing gains any more; whether there is a better result elsewhere is not known."),
    StopReason.completed: ("all work done", "Every start, or every size, was searched; a better result may exist all the same."),
    StopReason.proven: ("the gap is closed", "No other design of the candidates is better by more than `gap`."),
    StopReason.patience: ("no exchange for too long", "There was no exchange for `patience` iterations: more patience may help."),
    StopReason.max_iterations: ("all iterations done", "The largest number of iterations was reached: more of them may help."),
    StopReason.max_evaluations: (
        "no minimum within the allowed evaluations",
        "The search is in a long curved valley, or the minimum is at infinity: another start helps.",
    ),
    StopReason.max_nodes: ("the limit of nodes", "The efficiency is what is proven until then: more nodes may prove more."),
    StopReason.too_many_candidates: (
        "too many candidates are left for branch and bound",
        "The efficiency is what is proven without: fewer candidates, or a larger gap, may help.",
    ),
    StopReason.time_limit: ("the time limit", "More time may give a better result; the same search may stop elsewhere next time."),
    StopReason.interrupted: ("interrupted", "Ctrl-C was pressed: this is the best result until then."),
    StopReason.interrupted_first: (
        "interrupted in the first size",
        "Ctrl-C was pressed before the first size was done: this is its best design until then.",
    ),
    StopReason.stalled: (
        "no further step lowers the residuals by more than a trace, and their gradient is not zero",
        "The search is stuck, mostly at the border of where trajectories exist, or creeps to where there is no minimum.",
    ),
    StopReason.not_evaluable: (
        "a trajectory is not ok",
        "There is no value of the likelihood: at the start of a fit, or beyond this end of a profile.",
    ),
    StopReason.no_effect: (
        "some unknown does not change any measured output there, so its gradient is zero",
        "The search has reached a plateau, or the data do not depend on this unknown: another start, or other data, may help.",
    ),
    StopReason.rounding: (
        "rounding, or the tolerance of the trajectories, keeps the gradient from zero",
        "Double precision, or the tolerance, has no more: of a fit, residuals hardly exceed numerical errors, or it is a saddle.",
    ),
    StopReason.weights_changed: (
        "the weights, which depend on the estimate, do not converge",
        "The noise, or the covariance of what is drawn anew, is different at each new estimate: another start may help.",
    ),
    StopReason.diverged: (
        "an unknown diverged to values at which trajectories have no meaning",
        "A logarithm reached a factor of 1e13: bounds, a prior or other data may help.",
    ),
    StopReason.no_maximum: (
        "the likelihood has no maximum",
        "The residuals of an output can be fitted exactly: give its noise, or more data.",
    ),
    StopReason.at_bound: ("at its bound", "The unknown reached its bound before the deviance reached its threshold."),
    StopReason.not_bounded: (
        "not bounded",
        "The deviance stays below its threshold as far as was searched: the interval has no end on this side.",
    ),
}
