"""One number from the log dets of several scenarios: their mean, the smallest, or the mean of the worst share of them.

All are the smallest q-weighted mean over weights q that are at most w / share, with w those of the scenarios: with share = 1 only
q = w is left; with a small share all weight falls on the worst scenario. This is the conditional value at risk (Rockafellar and
Uryasev 2000). It is concave in the log dets, and the q that attains it has its derivatives.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...basics.values import Array

SOFTNESS = 0.02
"""Width of the smoothed form of a minimum, in log det of scenarios or log of eigenvalues: where they take turns, ascents need a
derivative."""


@dataclass(frozen=True, eq=False)
class Average:
    """How the values of S scenarios become one.

    Parameters
    ----------
    weights : ndarray, (S,)
        Positive; 1 in the mean, so that equal ones are exactly 1.
    share : float
        Of the weights, from the worst on, over which is averaged; between 0, the worst scenario alone, and 1.
    """

    weights: Array
    share: float = 1.0

    @staticmethod
    def of_all(count: int) -> Average:
        """The plain mean."""
        return Average(np.ones(count))

    @property
    def is_mean(self) -> bool:
        return self.share == 1.0 or len(self.weights) == 1

    def value(self, values: Array) -> Array:
        """The average of values (S, ...) over the scenarios, (...)."""
        parts = self.parts(values)
        return np.asarray(np.multiply(parts, values, where=parts > 0, out=np.zeros(values.shape)).mean(axis=0))

    def parts(self, values: Array) -> Array:
        """What each of values (S, ...) counts for, 1 in the mean over the scenarios."""
        weights = self.weights.reshape(-1, *[1] * (values.ndim - 1))
        if self.is_mean:
            return weights
        order = np.argsort(values, axis=0, kind="stable")
        sorted_weights = np.broadcast_to(weights, values.shape)
        sorted_weights = np.take_along_axis(sorted_weights, order, axis=0)
        total = self._least_total
        before = np.cumsum(sorted_weights, axis=0) - sorted_weights
        counted = np.clip(total - before, 0.0, sorted_weights)
        result = np.empty_like(counted)
        np.put_along_axis(result, order, counted * (len(weights) / total), axis=0)
        return result

    def softened(self, values: Array, softness: float = SOFTNESS) -> tuple[float, Array]:
        """A smooth bound of the average of values (S,) from above, near to it, and what each of them counts for.

        The relative entropy of q against w, times the softness, is added to what q minimises.
        """
        if self.is_mean:
            return float(self.value(values)), self.weights
        w = self.weights / len(self.weights)
        most = self.most
        inclined = np.log(w) - (values - values.min()) / softness
        full = np.zeros(len(w), dtype=bool)
        while True:  # those that would have more than they may are given what they may, and the others share the rest
            q = np.where(full, most, 0.0)
            rest = np.exp(inclined - inclined[~full].max(initial=-np.inf), where=~full, out=np.zeros(len(w)))
            if not full.all():
                q += rest * ((1.0 - q.sum()) / rest.sum())
            over = ~full & (q > most * (1 + 1e-12))
            if not over.any():
                break
            full |= over
        positive = q > 0
        entropy = float((q[positive] * np.log(q[positive] / w[positive])).sum())
        return float(q @ values) + softness * entropy, q * len(w)

    def ratios(self, log_dets: Array | None, ratios: Sequence[Array]) -> Array:
        """exp of what the average gains (N,) where the determinants are multiplied by ratios (N,) in each scenario.

        `log_dets` (S,) before are needed where the average is not the mean.
        """
        if len(ratios) == 1:
            return ratios[0]
        gained = np.log(np.maximum(np.array(ratios), np.finfo(float).tiny))
        if self.is_mean:
            return np.asarray(np.exp(self.value(gained)))
        assert log_dets is not None
        return np.asarray(np.exp(self.value(log_dets[:, None] + gained) - self.value(log_dets)))

    @property
    def most(self) -> Array:
        """What each q may be, (S,)."""
        w = self.weights / len(self.weights)
        return np.asarray(w * len(w) / self._least_total)

    @property
    def _least_total(self) -> float:
        """The share as a sum of weights, but that of the lightest scenario at least: with less it is the worst one all the same."""
        return float(max(self.share * len(self.weights), self.weights.min()))
