"""The design-quality study: its averaged exchange, its figures, and that its fits are those of `fp.validate`."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

import fisherpoint as fp
from bench import design_quality, quality_designs, quality_tables


def mean_log_det(rows: np.ndarray, chosen: list[int]) -> float:
    fisher = np.einsum("rkip,rkiq->rpq", rows[:, chosen], rows[:, chosen])
    return float(np.linalg.slogdet(fisher)[1].mean())


@pytest.mark.parametrize("seed", range(3))
def test_the_best_candidate_in_any_place_raises_the_mean_no_more(seed: int) -> None:
    rows = np.random.default_rng(seed).standard_normal((4, 30, 2, 3))
    begin = [0, 1, 2, 3]
    found = quality_designs.best_exchanges(rows, begin)
    best = mean_log_det(rows, found)
    assert best > mean_log_det(rows, begin) and len(found) == 4
    # The best candidate enters first, then the point that is missed least leaves: no other point in its place is better.
    grown = [[*found, j] for j in range(30)]
    enters = max(grown, key=lambda points: mean_log_det(rows, points))
    assert all(mean_log_det(rows, [*enters[:i], *enters[i + 1 :]]) <= best + 1e-12 for i in range(5))


def test_the_summary_leaves_failed_fits_to_the_median() -> None:
    errors = np.tile([[0.1, 0.4]], (20, 1))
    errors[3] = 50.0
    run = {
        "squares": (errors**2).tolist(),
        "failed_rows": [3],
        "promised": [0.1, 0.4],
        "own": [0.2, 0.8],
        "coverage": [0.9, 1.0],
        "chi_square": [1.0],
        "t_1": None,
        "rigs": 25,
    }
    found = quality_tables.summary([run, run])
    assert found.rmse == pytest.approx(0.2) and found.error == pytest.approx(0.0, abs=1e-12)
    assert found.promised == pytest.approx(0.2) and found.own == pytest.approx(0.4)
    assert found.typical == pytest.approx(0.2 / 0.6744897501960817)
    assert found.failed == pytest.approx(1 / 20) and found.cannot_run == pytest.approx(0.2)


def test_the_study_fits_as_validate_does() -> None:
    candidate = quality_designs.corners(1.0, 0)
    assert isinstance(candidate.data, fp.Experiments)
    found = design_quality.study(candidate, design_quality.CASES["right"], 1.0, 25)
    expected = fp.validate(quality_designs.problem(), {"corners": candidate.data}, runs=25, seed=design_quality.SEED).designs[
        "corners"
    ]
    names, std = quality_designs.PRIOR.names, quality_designs.PRIOR.std
    assert not found["failed"] and expected.fits == len(found["squares"])
    np.testing.assert_allclose(found["promised"], [expected.parameters[name].promised / std[name] for name in names], rtol=1e-9)
    rmse = np.sqrt(np.mean(found["squares"], axis=0))
    np.testing.assert_allclose(rmse, [expected.parameters[name].rmse.value for name in names], rtol=1e-4)
    np.testing.assert_allclose(found["coverage"], [expected.parameters[name].coverage.value for name in names])


def test_corners_are_corners() -> None:
    candidate = quality_designs.corners(1.0, 1)
    assert isinstance(candidate.data, fp.Experiments)
    allowed = set(product(*quality_designs.REGION.bounds.values()))
    rows = [tuple(row) for row in candidate.data.table[:, :7].tolist()]
    assert len(set(rows)) == quality_designs.N and set(rows) <= allowed
