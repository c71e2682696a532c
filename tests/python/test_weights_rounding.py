"""The best weights reach the tolerance that is asked for, however their input is rounded."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.basics.values import Array
from fisherpoint.basics.work_clock import OutOfTime
from fisherpoint.design.candidates.candidate_rows import CandidateRows
from fisherpoint.design.goal.averaged_criterion import Averaged, EstimableOver
from fisherpoint.design.goal.criteria import Criterion
from fisherpoint.design.goal.determinant import Determinant
from fisherpoint.design.goal.eigenvalue_criteria import Scaled, SmallestEigenvalue
from fisherpoint.design.goal.estimable_space import estimable
from fisherpoint.design.goal.variance import Variance
from fisherpoint.design.weights.interior import best_weights
from fisherpoint.design.weights.interior_criteria import mean_of
from fisherpoint.design.weights.weights import optimal_weights
from test_over_prior import KINDS, average_of

NAMES = ("D", "Ds", "A", "c", "I", "E")
ROUNDINGS = 6
S = 4


def criterion(name: str, p: int, seed: int) -> Criterion:
    rng = np.random.default_rng(seed)
    scale = np.diag(rng.uniform(0.3, 3.0, p))
    return {
        "D": Determinant("D", np.eye(p), True),
        "Ds": Determinant("Ds", np.eye(p)[:, : p // 2], False),
        "A": Variance("A", scale, True),
        "c": Variance("c", rng.standard_normal((p, 1))),
        "I": Variance("I", rng.standard_normal((p, 3))),
        "E": SmallestEigenvalue(Scaled(scale)),
    }[name]


def rounded(rows: Array, seed: int) -> Array:
    """The same but for the last digit."""
    return np.asarray(rows * (1 + 1e-15 * np.random.default_rng(seed).uniform(-1, 1, rows.shape)))


@pytest.mark.parametrize("shape", [(25, 2, 3), (100, 1, 5), (300, 2, 6)])
@pytest.mark.parametrize("name", NAMES)
def test_the_tolerance_is_reached(name: str, shape: tuple[int, int, int]) -> None:
    for seed in range(ROUNDINGS):
        rows = np.random.default_rng(seed // 2).standard_normal(shape)
        found = optimal_weights(CandidateRows(rounded(rows, seed)), criterion(name, shape[2], seed // 2), tolerance=1e-6)
        assert found.efficiency >= 1 - 1e-6


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", ["D", "Ds", "A", "c"])
def test_the_tolerance_is_reached_over_scenarios(name: str, kind: str) -> None:
    rng, weights = np.random.default_rng(3), np.array([1.0, 2.0, 0.5, 1.5])
    rows = rng.standard_normal((25, 1, 2, 3)) + 0.7 * rng.standard_normal((25, S, 2, 3))
    for seed in range(ROUNDINGS):
        pool = CandidateRows(rounded(rows, seed))
        space = EstimableOver.of([estimable(part.triangle()) for part in pool.parts])
        asked = Averaged([criterion(name, 3, s) for s in range(S)], average_of(kind, weights), [3] * S)
        for tolerance in (1e-5, 1e-7):
            assert optimal_weights(pool, asked, space=space, tolerance=tolerance).efficiency >= 1 - tolerance


def test_polynomials_have_their_known_weights() -> None:
    """E-optimal for a quadratic on [-1, 1]: 0.2, 0.6 and 0.2 at -1, 0 and 1 (Pukelsheim 1993, section 9.6)."""
    for seed in range(ROUNDINGS):
        x = np.linspace(-1, 1, 201)
        found = optimal_weights(
            CandidateRows(rounded(np.vander(x, 3), seed)[:, None]), SmallestEigenvalue(Scaled(np.eye(3))), tolerance=1e-7
        )
        assert found.efficiency >= 1 - 1e-7
        near = np.abs(x[found.chosen][:, None] - [-1.0, 0.0, 1.0]) < 0.02
        np.testing.assert_allclose(found.weights @ near, [0.2, 0.6, 0.2], atol=1e-3)


@pytest.mark.parametrize("name", ["D", "E"])
def test_matrices_that_are_far_larger_than_others(name: str) -> None:
    """No weight is next to nothing before the first step."""
    rng = np.random.default_rng(0)
    rows = rng.standard_normal((60, 3, 4)) * 10.0 ** rng.uniform(-3, 3, (60, 1, 1))
    matrices = np.einsum("knp,knq->kpq", rows, rows)
    weights, slope = best_weights(matrices, criterion(name, 4, 0), 1e-6)
    assert slope.along(matrices).max() <= 1 + 1e-6
    assert slope.log_phi == pytest.approx(criterion(name, 4, 0).log_phi(mean_of(matrices, weights)), abs=1e-9)


def test_what_cannot_be_reached_is_told() -> None:
    """The bound holds, also where the tolerance is beyond double precision."""
    found = optimal_weights(
        CandidateRows(np.vander(np.linspace(-1, 1, 401), 9)[:, None]), SmallestEigenvalue(Scaled(np.eye(9))), tolerance=1e-12
    )
    assert 1 - 1e-3 < found.efficiency < 1 - 1e-12


@pytest.mark.parametrize("options", [{"goal": "E"}, {"goal": "E", "n_candidates": 500}])
def test_designs_for_the_least_eigenvalue_have_their_certificate(options: dict[str, object]) -> None:
    problem = fp.load_problem(Path(__file__).parents[2] / "examples" / "michaelis_menten.toml")
    assert fp.approximate_design(problem, **options).efficiency > 1 - 1e-5  # type: ignore[arg-type]


class Counted:
    """Raises `OutOfTime` at a call."""

    def __init__(self, calls: int) -> None:
        self.left = calls

    def __call__(self) -> None:
        self.left -= 1
        if self.left < 0:
            raise OutOfTime


@pytest.mark.parametrize("name", NAMES)
def test_weights_that_ran_out_of_time_are_bounded_all_the_same(name: str) -> None:
    rows = CandidateRows(np.random.default_rng(2).standard_normal((3000, 1, 6)))
    of = criterion(name, 6, 0)
    best = optimal_weights(rows, of)
    efficiencies = list[float]()
    with pytest.raises(OutOfTime):
        optimal_weights(rows, of, between_steps=Counted(0))
    for calls in (*range(1, 40), 10**9):
        try:
            found = optimal_weights(rows, of, between_steps=Counted(calls))
        except OutOfTime:  # in the first round
            assert not efficiencies
            continue
        efficiencies.append(found.efficiency)
        assert found.weights.min() > 0 and found.weights.sum() == pytest.approx(1)
        assert best.log_phi <= found.log_bound + 1e-9 and found.log_phi <= best.log_bound + 1e-9
        assert found.log_phi == pytest.approx(np.log(found.efficiency) + found.log_bound, abs=1e-9)
    assert efficiencies[0] < 1 - 1e-4 and efficiencies[-1] >= 1 - 1e-6
