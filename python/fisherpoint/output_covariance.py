"""The output covariance D of (7): which of its four forms, which outputs take part, and what makes it singular."""

from __future__ import annotations

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from . import _core
from .candidates import CandidateSource
from .information import PointInformation
from .problem import DesignProblem
from .quantity import Array, names_of

REGION_SAMPLE = 64
"""Points of the region over which "region" takes the mean predictive covariance."""

SINGULAR = 1e-9
"""Smallest eigenvalue of D, scaled to unit diagonal, below which it counts as singular."""

_region_means: WeakKeyDictionary[DesignProblem, Array] = WeakKeyDictionary()


@dataclass(frozen=True, eq=False)
class Criterion:
    """log det F as a function of points, for one form of D.

    D = `given`, plus the mean predictive covariance of the points where `pooled`. For "pointwise" every point is whitened
    with its own D when it is prepared, and `given` is the identity.
    """

    kind: str
    used: NDArray[np.bool_]  # outputs that take part
    names: tuple[str, ...]  # theirs
    given: Array
    pooled: bool
    noise: Array  # R of the outputs that take part

    def prepare(self, information: PointInformation) -> PointInformation:
        """The points as `accumulate` takes them."""
        reduced = information.of_outputs(self.used)
        if self.kind != "pointwise":
            return reduced
        d = self.noise + reduced.covariance
        if not self.noise.any():
            check_regular(d, self.names, self.kind)
        factors = np.linalg.cholesky(d)
        return PointInformation(reduced.points, np.linalg.solve(factors, reduced.sensitivity), np.zeros_like(reduced.covariance))

    def accumulate(self, prepared: PointInformation) -> _core.FisherAccumulator:
        _, n_y, p = prepared.sensitivity.shape
        accumulator = _core.FisherAccumulator(n_y, p)
        accumulator.add(prepared.sensitivity, prepared.covariance)
        return accumulator

    def output_covariance(self, prepared: PointInformation) -> Array:
        """D (n, n) of the accumulator; the identity for "pointwise"."""
        d: Array = self.accumulate(prepared).output_covariance(self.given, self.pooled)
        return d


def needs_covariances(kind: str) -> bool:
    """Whether D needs the predictive covariance of every point."""
    return kind in ("pooled", "pointwise")


def criterion(problem: DesignProblem, sample: PointInformation, threads: int | None, kind: str | None = None) -> Criterion:
    """Choose D for a problem.

    Parameters
    ----------
    problem : DesignProblem
    sample : PointInformation
        Points from which is seen, where no noise is known, which outputs neither vary nor depend on a parameter.
    threads : int or None
    kind : str, optional
        Another form than the problem's.

    Raises
    ------
    ValueError
        Where D is singular for another reason than outputs that carry nothing; the outputs are named.
    """
    kind = kind or str(problem.output_covariance)
    noise = problem.noise_covariance
    given = noise + (region_mean(problem, threads) if kind == "region" else 0.0)
    varies = (sample.sensitivity != 0).any(axis=(0, 2)) | (np.diagonal(sample.covariance, axis1=1, axis2=2) > 0).any(axis=0)
    used = (np.diag(noise) > 0) | varies
    if not used.any():
        raise ValueError("output_covariance: expected an output that depends on a parameter, given none")
    given, noise = given[np.ix_(used, used)], noise[np.ix_(used, used)]
    names = tuple(name for name, taken in zip(names_of(problem.model.outputs), used, strict=True) if taken)
    if kind in ("noise", "region"):
        check_regular(given, names, kind)
    elif kind == "pooled":
        mean = sample.covariance.mean(axis=0)[np.ix_(used, used)]
        check_regular(given + mean, names, kind)
    else:
        check_regular(noise + sample.of_outputs(used).covariance, names, kind)
        given = np.eye(len(names))
    return Criterion(kind, used, names, given, kind == "pooled", noise)


def check_regular(d: Array, names: tuple[str, ...], kind: str) -> None:
    """Raise where D (n, n), or one of a stack of them, is not positive definite to working precision, naming the outputs."""
    stack = d.reshape(-1, len(names), len(names))
    scale = np.sqrt(np.maximum(np.diagonal(stack, axis1=1, axis2=2), 0))
    flat = [name for name, s in zip(names, scale.min(axis=0), strict=True) if not s > 0]
    if flat:
        raise ValueError(
            f"output_covariance {kind!r}: expected a regular D, given no variance of {', '.join(flat)}: give noise_std"
        )
    values, vectors = np.linalg.eigh(stack / (scale[:, :, None] * scale[:, None, :]))
    worst = int(np.argmin(values[:, 0]))
    if not values[worst, 0] > SINGULAR:
        involved = [name for name, v in zip(names, vectors[worst, :, 0], strict=True) if abs(v) > 0.1]
        raise ValueError(
            f"output_covariance {kind!r}: expected a regular D, given one that is singular in {', '.join(involved)}: "
            "give noise_std, or more points or levels"
        )


def region_mean(problem: DesignProblem, threads: int | None) -> Array:
    """Mean predictive covariance (n_y, n_y) over a fixed sample of the region, the same for every design of the problem."""
    if problem not in _region_means:
        source = CandidateSource(problem, np.random.default_rng(0), threads)
        _region_means[problem] = source.draw_confirmed(REGION_SAMPLE).covariance.mean(axis=0)
    return _region_means[problem]
