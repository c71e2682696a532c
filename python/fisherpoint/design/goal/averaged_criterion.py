"""A criterion over scenarios as one of a larger matrix, so that all that holds of criteria holds of it.

The information in S scenarios is one block-diagonal matrix M = diag(M_1, ..., M_S). With the information functions phi_s of a
criterion and an average as in average.py,

    log phi(M) = average(log phi_s(M_s)) = min_q sum_s q_s log phi_s(M_s),

is one too: geometric means of concave, homogeneous and increasing functions are all three, and so is the smallest of them. For the
mean over the scenarios q is their weights, and phi has derivatives. Otherwise it has kinks where scenarios take turns;
smoothed it is

    min_q sum_s q_s log phi_s(M_s) + tau sum_s q_s log(q_s / w_s),

and what bounds mixtures by it bounds them without the entropy, which is not negative.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...basics.values import Array
from .criteria import Criterion, Slope
from .determinant import Determinant
from .estimable_space import Estimable
from .scenario_average import Average

MOST_OF_ALL = 320
"""Scenarios times parameters: matrices of this size are made of every candidate that is weighed."""

LEAST_SOFTNESS = 1e-12
"""Smoothing of the average where none is required."""


@dataclass(frozen=True, eq=False)
class EstimableOver(Estimable):
    """What is estimable in each scenario, and all of it as blocks."""

    parts: tuple[Estimable, ...] = ()

    @staticmethod
    def of(parts: Sequence[Estimable]) -> EstimableOver:
        into, span, null = (joined([getattr(part, name) for part in parts]) for name in ("into", "span", "null"))
        return EstimableOver(into, span, null, np.concatenate([part.length for part in parts]), tuple(parts))

    @property
    def orthonormal(self) -> EstimableOver:
        return EstimableOver.of([part.orthonormal for part in self.parts])


def joined(blocks: Sequence[Array]) -> Array:
    """The matrix with these blocks on its diagonal and zeros elsewhere."""
    result, row, column = np.zeros(np.sum([block.shape for block in blocks], axis=0)), 0, 0
    for block in blocks:
        result[row : row + block.shape[0], column : column + block.shape[1]] = block
        row, column = row + block.shape[0], column + block.shape[1]
    return result


def parted(matrix: Array, count: int) -> Array:
    """The equal blocks (S, p, p) on the diagonal of a matrix."""
    p = len(matrix) // count
    return np.stack([matrix[s * p : (s + 1) * p, s * p : (s + 1) * p] for s in range(count)])


@dataclass(frozen=True, eq=False)
class AveragedSlope(Slope):
    """Slopes of all scenarios, what each of them counts for, and the smoothing."""

    parts: tuple[Slope, ...] = ()
    counted: tuple[float, ...] = ()


class Averaged(Criterion):
    """The average of log phi over scenarios, of block-diagonal matrices.

    Parameters
    ----------
    criteria : sequence of Criterion
        In each scenario; without kinks of their own.
    average : Average
    sizes : sequence of int
        Of the blocks.
    offsets : ndarray, (S,), optional
        What is added to log phi in each scenario, as coordinates of what is estimable change a determinant.
    """

    def __init__(self, criteria: Sequence[Criterion], average: Average, sizes: Sequence[int], offsets: Array | None = None) -> None:
        self.criteria, self.average = tuple(criteria), average
        self.offsets = np.zeros(len(criteria)) if offsets is None else offsets
        self.name, self.level, self.degree = criteria[0].name, criteria[0].level, criteria[0].degree
        self.kinked = not average.is_mean
        ends = np.cumsum(sizes)
        self._places = [slice(int(end - size), int(end)) for end, size in zip(ends, sizes, strict=True)]

    def blocks(self, matrices: Array) -> list[Array]:
        """Those (..., p, p) of matrices, in each scenario."""
        return [matrices[..., place, place] for place in self._places]

    def log_phis_there(self, information: Array) -> Array:
        """log phi (S,) in each scenario."""
        blocks = self.blocks(information)
        return self.offsets + [criterion.log_phi(block) for criterion, block in zip(self.criteria, blocks, strict=True)]

    def log_phi(self, information: Array) -> float:
        return float(self.average.value(self.log_phis_there(information)))

    def slope(self, information: Array, share: float = 0.0, size: float | None = None) -> AveragedSlope:
        parts = tuple(criterion.slope(block) for criterion, block in zip(self.criteria, self.blocks(information), strict=True))
        values, softness = self.offsets + [part.log_phi for part in parts], max(share, LEAST_SOFTNESS)
        exact = float(self.average.value(values))
        smooth, counts = self.average.softened(values, softness)
        q, unit = counts / len(values), exact if size is None else float(np.log(size))
        factor = float(np.exp(smooth - unit)) if self.kinked else 1.0  # of the derivative of the smoothed phi, in units of `size`
        half = joined([np.sqrt(factor * one) * part.half for one, part in zip(q, parts, strict=True)])
        own = tuple((factor * q).tolist())
        return AveragedSlope(self, half, exact, np.zeros(0), softness, factor, float(np.exp(unit)), parts=parts, counted=own)

    def _curvature(self, slope: Slope, matrices: Array) -> Array:
        assert isinstance(slope, AveragedSlope) and not self.kinked  # what counts moves there: see `inner.OfScenarios`
        each = zip(slope.counted, slope.parts, self.blocks(matrices), strict=True)
        return np.asarray(sum(one * part.curvature(block) for one, part, block in each))

    def within(self, estimable: Estimable) -> Averaged:
        assert isinstance(estimable, EstimableOver)
        inner = [criterion.within(part) for criterion, part in zip(self.criteria, estimable.parts, strict=True)]
        offsets = self.offsets.copy()
        for s, (criterion, part) in enumerate(zip(self.criteria, estimable.parts, strict=True)):
            if isinstance(criterion, Determinant) and criterion.whole:
                offsets[s] -= 2 * float(np.linalg.slogdet(part.span.T @ part.into)[1]) / part.rank
        return Averaged(inner, self.average, [part.rank for part in estimable.parts], offsets)

    def outside(self, estimable: Estimable) -> float:
        assert isinstance(estimable, EstimableOver)
        return max(criterion.outside(part) for criterion, part in zip(self.criteria, estimable.parts, strict=True))
