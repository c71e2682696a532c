"""Windows of a record that were picked, as the search finds them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from ...basics.field_checks import Extents
from ...basics.stop_reason import StopReason
from ...basics.values import Array
from ...information.evaluation import Evaluation
from ...information.problem import DesignProblem
from ...points.runs import Runs
from ..results.efficiency import d_efficiency
from .disjoint import Places

CHOICES = {
    "all": "all windows side by side",
    "first": "as many at the beginning",
    "spread": "as many evenly spread",
    "random": "as many at random, median",
}
"""Other choices that the picked ones are compared with."""


@dataclass(frozen=True, eq=False, repr=False)
class PickedWindows:
    """The windows that `design_pieces` picked, with what is needed to judge them and to estimate from them.

    Attributes
    ----------
    problem : DesignProblem
        With the standard deviations of the measured starts in `initial_state_std`, as `estimate` needs them.
    length, every : int
        Samples in a window, and from the first sample of a window to that of the next, in the record.
    windows : ndarray of int, (n,)
        Which of the pieces were picked, in the order of the record.
    first : ndarray of int, (n,)
        The record's sample at which each begins.
    t : ndarray, (n,)
        Its time, s.
    runs : Runs
        The windows as runs.
    y : ndarray, (n, length - 1, n_y)
        What was measured in them, SI units; NaN where nothing was.
    shares : ndarray, (n,)
        tr(F^-1 F_k) / p: the share of each window in what is known; NaN where F is singular.
    evaluation : Evaluation
        Of the windows together, at the prior mean.
    log_det : float
        What was maximised: log det F in its sum form, parameters standardised by the prior; -inf where F is singular.
    bound : float
        What log det F of no choice of as many windows that share no sample exceeds, to the accuracy of the trajectories.
    references : mapping of str to float
        log det F of other choices: "all" windows side by side, each next one that shares no sample with those before; of these the
        "first" as many, as many that are evenly "spread", and the median of "random" ones.
    n_windows, n_disjoint, n_samples : int
        Windows to choose from, how many of them share no sample and have a trajectory, and samples of the record.
    left_out : mapping of reason to int
        Windows that are none.
    exchanges : int
    stop_reason : StopReason
    seconds : float
    ridge : float
        Share of the information in all windows that was added while the picked ones left F singular, to compare choices; 0 where
        they did not. No figure of the design contains it.
    """

    problem: DesignProblem
    length: int
    every: int
    windows: Places
    first: Places
    t: Array
    runs: Runs
    y: Array
    shares: Array
    evaluation: Evaluation
    log_det: float
    bound: float
    references: Mapping[str, float]
    n_windows: int
    n_disjoint: int
    n_samples: int
    left_out: Mapping[str, int]
    exchanges: int
    stop_reason: StopReason
    seconds: float
    ridge: float = field(default=0.0, kw_only=True)

    _EXTENTS: ClassVar[Extents] = {
        "runs.x0": ("n", "problem.model.states"),
        "runs.u": ("n", "segments", "problem.model.inputs"),
        "windows": ("n",),
        "first": ("n",),
        "t": ("n",),
        "y": ("n", "segments", "problem.model.outputs"),
        "shares": ("n",),
        "references": ("_REFERENCES",),
        "evaluation.parameters": ("problem.estimated",),
    }
    _REFERENCES = tuple(CHOICES)
    _POSITIVE = ("length", "every", "n_windows", "n_samples")

    @property
    def efficiency(self) -> float | None:
        """A lower bound of the D-efficiency against the best choice of as many windows; None where F is singular."""
        if not np.isfinite(self.log_det):
            return None
        return d_efficiency(min(self.log_det, self.bound), self.bound, len(self.evaluation.parameters))

    def versus(self, reference: str) -> float | None:
        """D-efficiency against one of the `references`; None where that does not exist.

        (det ratio)^(1/p): so many times the information about each parameter. Against "all" it is the share of the record's, and
        may exceed 1, as the windows that are side by side begin elsewhere.
        """
        return d_efficiency(self.log_det, self.references[reference], len(self.evaluation.parameters))
