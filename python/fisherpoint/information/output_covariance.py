"""The output covariance D of (7): which of its four forms, which outputs take part, and what makes it singular."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from ..basics.messages import listed
from ..basics.quantity import names_of
from ..basics.values import Array
from ..engine import _core
from .candidates import CandidateSource
from .point_information import PointInformation
from .problem import DesignProblem

REGION_SAMPLE = 64
"""Points of the region over which "region" takes the mean predictive covariance."""

SINGULAR = 1e-9
"""Smallest eigenvalue of D, scaled to unit diagonal, below which it counts as singular."""

_region_means: WeakKeyDictionary[DesignProblem, Array] = WeakKeyDictionary()


@dataclass(frozen=True, eq=False)
class OutputCovariance:
    """D of (7) in one of its forms, and the sums over points that F is made of.

    D = `base`, plus the mean predictive covariance of the points where `pooled`. Where each point has its `own` D_k, it is whitened
    with that when it is prepared, and `given`, the D of what is accumulated, is the identity.
    """

    kind: str
    used: NDArray[np.bool_]  # outputs that take part
    names: tuple[str, ...]  # theirs
    base: Array  # R, and for "region" the mean over the region, of the outputs that take part
    own: bool

    @property
    def pooled(self) -> bool:
        return self.kind == "pooled"

    @cached_property
    def given(self) -> Array:
        return np.eye(len(self.names)) if self.own else self.base

    def prepare(self, information: PointInformation) -> PointInformation:
        """The points as `accumulate` takes them; an output that is not measured has no weight."""
        reduced = information.of_outputs(self.used)
        sensitivity, measured = reduced.sensitivity, reduced.measured
        if measured is not None:
            sensitivity = np.where(measured[:, :, None], sensitivity, 0.0)
        if self.own:
            d = self.own_covariances(reduced)
            if not self.base.any():
                check_regular(d, self.names, self.kind)
            if measured is not None:  # D_k of the measured outputs alone, with ones in the places of the others
                d = np.where(measured[:, :, None] & measured[:, None, :], d, np.eye(len(self.names)))
            white = whitened(cholesky_factor(d, self.names, self.kind), sensitivity)
            return PointInformation(reduced.points, white, np.zeros_like(reduced.covariance))
        if reduced.assumed is None and measured is None:
            return reduced
        covariance = reduced.covariance if reduced.assumed is None else reduced.covariance + reduced.assumed
        return PointInformation(reduced.points, sensitivity, covariance)

    def own_covariances(self, reduced: PointInformation) -> Array:
        """D_k (K, n, n) of points reduced to the outputs that take part."""
        d = self.base + (reduced.covariance if self.kind == "pointwise" else 0.0)
        if reduced.assumed is not None:
            d = d + reduced.assumed
        return d if d.ndim == 3 else np.broadcast_to(d, reduced.covariance.shape).copy()

    def accumulate(self, prepared: PointInformation) -> _core.FisherAccumulator:
        _, n_y, p = prepared.sensitivity.shape
        accumulator = _core.FisherAccumulator(n_y, p)
        accumulator.add(prepared.sensitivity, prepared.covariance)
        return accumulator


def needs_covariances(kind: str) -> bool:
    """Whether D needs the predictive covariance of every point."""
    return kind in ("pooled", "pointwise")


def output_covariance(
    problem: DesignProblem, sample: PointInformation, threads: int | None, kind: str | None = None
) -> OutputCovariance:
    """Choose D for a problem.

    Parameters
    ----------
    problem : DesignProblem
    sample : PointInformation
        Points that show, where no noise is known, which outputs neither vary nor depend on a parameter. Where it is known,
        the outputs with known noise take part.
    threads : int or None
    kind : str, optional
        Another form than the problem's.

    Raises
    ------
    ValueError
        Where D is singular for another reason than outputs that carry nothing; the outputs are named. And where "pooled" meets
        outputs that are not measured: one D for all points has no value for them.
    """
    kind = kind or str(problem.output_covariance)
    problem.check_weighs(kind)
    noise = problem.noise_covariance
    base = noise + (region_mean(problem, threads) if kind == "region" else 0.0)
    varies = (sample.sensitivity != 0).any(axis=(0, 2)) | (np.diagonal(sample.covariance, axis1=1, axis2=2) > 0).any(axis=0)
    used = varies if problem.noise is None else problem.measured
    if not used.any():
        raise ValueError("output_covariance: expected an output that depends on a parameter, given none")
    base = base[np.ix_(used, used)]
    names = tuple(name for name, taken in zip(names_of(problem.model.outputs), used, strict=True) if taken)
    partly = sample.measured is not None
    if kind == "pooled" and partly:
        raise ValueError("previous: expected all outputs measured for output_covariance 'pooled', given some that are not")
    # R alone is diagonal: what is not measured drops out of it without a D of the point's own.
    own = kind == "pointwise" or (kind != "pooled" and sample.assumed is not None) or (kind == "region" and partly)
    d = OutputCovariance(kind, used, names, base, own)
    if kind == "pooled":
        check_regular(base + d.prepare(sample).covariance.mean(axis=0), names, kind)
    else:
        check_regular(d.own_covariances(sample.of_outputs(used)) if kind == "pointwise" else base, names, kind)
    return d


def check_regular(d: Array, names: tuple[str, ...], kind: str) -> None:
    """Raise where D (n, n), or one of a stack of them, is not positive definite to working precision, naming the outputs."""
    if not np.isfinite(d).all():
        raise ValueError(f"output_covariance {kind!r}: expected a finite D, given one that overflows: check standard deviations")
    stack = d.reshape(-1, len(names), len(names))
    scale = np.sqrt(np.maximum(np.diagonal(stack, axis1=1, axis2=2), 0))
    flat = [name for name, s in zip(names, scale.min(axis=0), strict=True) if not s > 0]
    if flat:
        raise ValueError(f"output_covariance {kind!r}: expected a regular D, given no variance of {listed(flat)}: give noise")
    values, vectors = np.linalg.eigh(stack / (scale[:, :, None] * scale[:, None, :]))
    worst = int(np.argmin(values[:, 0]))
    if not values[worst, 0] > SINGULAR:
        involved = np.abs(vectors[worst, :, 0]) > 0.1
        sums = vectors[worst, :, 0] / scale[worst]  # the sum of outputs that does not vary
        terms = [(name, value) for name, value, takes_part in zip(names, sums, involved, strict=True) if takes_part]
        raise ValueError(
            f"output_covariance {kind!r}: expected a regular D, given one that is singular in {listed(name for name, _ in terms)}: "
            f"{_sum_of(terms)} hardly varies over the prior, as where a mass balance holds; give noise, leave one of these "
            "outputs out, or take more points or levels"
        )


def _sum_of(terms: list[tuple[str, float]]) -> str:
    """Multiples of outputs, the largest once, as a sum."""
    largest = max((value for _, value in terms), key=abs)
    text = ""
    for name, value in terms:
        share = value / largest
        factor = "" if f"{abs(share):.3g}" == "1" else f"{abs(share):.3g} "
        text += f" {'-' if share < 0 else '+'} {factor}{name}"
    return text.removeprefix(" + ").removeprefix(" ")


def cholesky_factor(d: Array, names: tuple[str, ...], kind: str) -> Array:
    """L of D = L L^T (..., n, n); raise as `check_regular` where there is none."""
    try:
        return np.asarray(np.linalg.cholesky(d), dtype=np.float64)
    except np.linalg.LinAlgError:
        check_regular(d, names, kind)
        raise ValueError(f"output_covariance {kind!r}: expected a regular D, given one that is not: give noise") from None


def whitened(factor: Array, sensitivity: Array) -> Array:
    """L^-1 dy/dtheta (K, n, p), for one L (n, n), or one of each point."""
    if factor.ndim == 3:
        return np.asarray(np.linalg.solve(factor, sensitivity), dtype=np.float64)
    diagonal = np.diagonal(factor)
    if np.count_nonzero(factor) == len(factor):  # independent sensors, as nearly always: a search asks a thousand times
        return np.asarray(sensitivity / diagonal[:, None], dtype=np.float64)
    rows = sensitivity.swapaxes(0, 1)  # side by side, as else L would be factored for each point
    found = np.linalg.solve(factor, rows.reshape(len(factor), -1)).reshape(rows.shape)
    return np.ascontiguousarray(found.swapaxes(0, 1))


def region_mean(problem: DesignProblem, threads: int | None) -> Array:
    """Mean predictive covariance (n_y, n_y) over a fixed sample of the region, the same for every design of the problem."""
    if problem not in _region_means:
        source = CandidateSource(problem, np.random.default_rng(0), threads)
        _region_means[problem] = source.draw_confirmed(REGION_SAMPLE).covariance.mean(axis=0)
    return _region_means[problem]
