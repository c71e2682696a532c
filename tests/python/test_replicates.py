"""Points that are nearly equal become copies, where that costs nothing."""

from __future__ import annotations

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.basics.values import Array
from fisherpoint.design.points.replicates import with_copies
from fisherpoint.information.candidates import CandidateSource
from fisherpoint.information.point_information import PointInformation
from test_candidate_archive import at, problem
from test_known_designs import ONE_FACTOR
from test_known_designs import problem as known_problem

NEAR = 0.02


def copied(*x: float, valid: float = 1.0) -> tuple[list[float], float, float]:
    """Points of the quadratic after copies are made, and log det before and then; of others than given ones some are valid."""
    source = CandidateSource(problem(), np.random.default_rng(0), 1)

    def evaluated(table: Array) -> PointInformation:
        return source.survivors(at(*table[np.abs(table[:, 0]) <= valid, 0]))[0]

    def value(design: PointInformation) -> float:
        rows = design.sensitivity[:, 0]
        return float(np.linalg.slogdet(rows.T @ rows)[1])

    design = source.survivors(at(*x))[0]
    found = with_copies(design, np.array([-1.0]), np.array([1.0]), evaluated, value, NEAR, 300)
    return found.experiments.u[:, 0].tolist(), value(design), value(found)


def test_copies_of_the_better_place_are_made() -> None:
    points, before, after = copied(-1.0, -0.9999, 1.0, 0.001, -0.001, 0.9998)
    assert points == [-1.0, -1.0, 1.0, 0.0, 0.0, 1.0] and after > before


def test_points_on_two_sides_of_the_best_place_move_to_their_mean() -> None:
    points, before, after = copied(-1.0, 1.0, 1e-3, -2e-3, 1e-3)
    assert points[2] == points[3] == points[4] == pytest.approx(0.0, abs=1e-15) and after > before
    points, before, after = copied(-1.0, 1.0, 2e-3, 1e-3, 2e-3, valid=-1.0)  # a mean that is not valid is none
    assert points[2:] == [1e-3] * 3 and after > before


def test_a_value_that_would_fall_is_kept() -> None:
    _, before, after = copied(-1.0, 1.0, 0.3, 0.315)
    assert after >= before - 1e-9 * max(1.0, abs(before))
    far = (-1.0, 1.0, 0.0, 2.1 * NEAR)
    assert copied(*far)[0] == list(far)
    needed = (0.5, 0.5 + NEAR, 0.5 + 2 * NEAR)
    assert copied(*needed)[0] == list(needed)  # of fewer places the quadratic cannot be told


def test_a_search_leaves_no_near_copies() -> None:
    model, mean, bounds, _ = ONE_FACTOR["one-compartment with absorption"]
    given = known_problem(model, mean, bounds)
    design = fp.exchange(given, 9, n_candidates=15, method=fp.ExchangeMethod(references=False))
    assert design.distinct_points == 3
    assert design.trace[-1].log_det == pytest.approx(design.evaluation.log_det, abs=1e-9)
    assert design.drawn == design.accepted + sum(design.rejected.values())
