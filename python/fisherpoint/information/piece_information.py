"""The Fisher matrices of all windows of a record, packed, and what the windows together do not determine."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..basics.values import Array, FrozenMapping
from ..data.measured_outputs import runs_with_outputs
from ..data.pieces import Pieces
from ..noise.models import Noise, nominal_std, outputs_of
from ..points.settings import on_surface
from ..points.status import failures_of
from .assumed import starts_near
from .point_information import PointInformation
from .problem import DesignProblem
from .run_information import MOST_SEGMENTS, checked_problem, run_rows

Places = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class PieceInformation:
    """M of K windows in its sum form, of the n unknowns standardised by their prior: nuisance parameters first, then the others.

    Attributes
    ----------
    rows : ndarray of int, (K,)
        Which of the pieces they are: those whose trajectories are ok.
    packed : ndarray, (K, n (n + 1) / 2)
        The lower triangles of M, row after row.
    factor : ndarray, (n, n)
        Upper triangular C with C^T C = sum of M over all windows, and what is known of nuisance parameters beforehand; made without
        the squares, so that small values keep their digits.
    known : ndarray, (n (n + 1) / 2,)
        What is known beforehand, packed: 1 for each nuisance parameter.
    left_out : mapping of reason to int
        Windows that are none at the prior mean.
    """

    rows: Places
    packed: Array
    factor: Array
    known: Array
    left_out: Mapping[str, int]


def piece_problem(problem: DesignProblem, pieces: Pieces) -> DesignProblem:
    """The problem with the standard deviations of the measured starts: those of the sensors where outputs measure the starts.

    Limits along the way are left out: what was measured has been possible.

    Raises
    ------
    ValueError
        Where the problem is of another model, weighs outputs otherwise than by the sensor noise, or does not say how well the
        column of a state is known.
    """
    if problem.model != pieces.model:
        raise ValueError(f"problem: expected one of the model of the pieces, {pieces.model.name}; given {problem.model.name}")
    checked_problem(problem)
    if problem.local_parameters:
        raise ValueError(f"local: expected no local parameters for pieces of a record, given {', '.join(problem.local_parameters)}")
    given, noise = problem.initial_state_std or {}, {} if problem.noise is None else outputs_of(problem.noise)
    std: dict[str, float] = {}
    for state, output in pieces.measured_by.items():
        if state not in given and output is None:
            raise ValueError(f"initial_state_std: expected a standard deviation of {state!r}, which no output measures; given none")
        if state not in given and output not in noise:
            raise ValueError(f"initial_state_std: expected a standard deviation of {state!r}, as noise has none of {output!r}")
        if state not in given and isinstance(noise[str(output)], Noise):
            raise ValueError(f"initial_state_std: expected a standard deviation of {state!r}, as that of {output!r} is not white")
        std[state] = given[state] if state in given else nominal_std(problem.noise)[str(output)]
    return checked_problem(problem.replace(initial_state_std=std, along=None))


def piece_information(problem: DesignProblem, pieces: Pieces, threads: int | None) -> PieceInformation:
    """Compute M of all windows at the prior mean; `problem` is that of `piece_problem`."""
    p, nuisance, each = problem.n_unknowns, problem.n_nuisance, max(1, MOST_SEGMENTS // (pieces.length - 1))
    lower = np.tril_indices(p)
    packed, kept = np.empty((len(pieces), len(lower[0]))), np.zeros(len(pieces), dtype=bool)
    beforehand = np.diag((np.arange(p) < nuisance).astype(np.float64))
    factor, lost = beforehand.copy(), Counter[str]()
    for first in range(0, len(pieces), each):
        rows, white = _white_rows(problem, pieces, np.arange(first, min(first + each, len(pieces))), threads, lost)
        if len(rows):
            white = np.roll(white, nuisance, axis=2)
            factor = np.asarray(np.linalg.qr(np.concatenate([factor, white.reshape(-1, p)]), mode="r"))
            packed[rows], kept[rows] = (white.transpose(0, 2, 1) @ white)[:, *lower], True
    rows = np.flatnonzero(kept)
    packed = packed if kept.all() else packed[rows]
    return PieceInformation(rows, packed, factor, beforehand[lower], FrozenMapping(dict(+lost)))


def _white_rows(
    problem: DesignProblem, pieces: Pieces, rows: Places, threads: int | None, lost: Counter[str]
) -> tuple[Places, Array]:
    """Those of some windows that are ok, and dy/dtheta of them (K, M, p) in units of the noise; the others are counted."""
    runs, y = runs_with_outputs(*pieces.cut(rows))  # every window has a number
    kept = np.ones(len(rows), dtype=bool)
    on = on_surface(problem.model, runs.starts, problem.theta, problem.crossed)
    near = starts_near(problem.model, runs.starts, problem.theta, problem.initial_state_std or {}, problem.kinks == "exclude")
    for word, surfaces in (("on", on), ("near", near)):  # there the tangents by the start are those of one side alone
        for surface, starts in surfaces.items():
            lost[f"starts {word} {surface} = 0"] += int(kept[starts].sum())
            kept[starts] = False
    rows, runs, y = rows[kept], runs[kept], y[kept]
    if not len(rows):
        return rows, np.empty((0, 1, problem.n_unknowns))
    found = run_rows(problem, runs, problem.theta, problem.integration(threads), np.isfinite(y))
    lost.update(failures_of(found.status))
    ok = found.status == 0
    white = found.sensitivity[ok] / np.sqrt(np.diag(problem.noise_covariance))[:, None]
    return rows[ok], white.reshape(len(white), white.shape[1] * white.shape[2], white.shape[3])


def picked_information(problem: DesignProblem, pieces: Pieces, rows: Places, threads: int | None) -> PointInformation:
    """Information of windows that are ok, a sample after the other."""
    runs, y = runs_with_outputs(*pieces.cut(rows))
    measured = np.isfinite(y)
    samples, _ = run_rows(problem, runs, problem.theta, problem.integration(threads), measured).samples(runs)
    n_y = samples.shape[1]
    return PointInformation(runs, samples, np.zeros((len(samples), n_y, n_y)), measured=measured[runs.measured])
