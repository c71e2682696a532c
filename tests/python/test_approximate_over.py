"""Approximate designs for criteria over the prior: the averaged criterion, its certificate, and the best weights by SciPy."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize

import fisherpoint as fp
from fisherpoint.design.candidates.candidate_rows import CandidateRows
from fisherpoint.design.goal.averaged_criterion import Averaged, EstimableOver, joined
from fisherpoint.design.goal.criteria import Criterion
from fisherpoint.design.goal.determinant import Determinant
from fisherpoint.design.goal.estimable_space import estimable
from fisherpoint.design.goal.scenario_average import Average
from fisherpoint.design.goal.variance import Variance
from fisherpoint.design.weights.interior_criteria import mean_of
from fisherpoint.design.weights.weights import optimal_weights
from test_over_prior import KINDS, average_of

S, P, K = 4, 3, 25
NAMES = ("D", "Ds", "A", "c")
WEIGHTS = np.array([1.0, 2.0, 0.5, 1.5])


def criteria(name: str) -> list[Criterion]:
    rng = np.random.default_rng(7)
    if name == "D":
        return [Determinant("D", np.eye(P), True)] * S
    if name == "Ds":
        return [Determinant("Ds", np.eye(P)[:, :2], False)] * S
    if name == "A":
        return [Variance("A", np.diag([1.0, 2.0, 0.5]), True)] * S
    return [Variance("c", rng.standard_normal((P, 1))) for _ in range(S)]


def rows(seed: int = 0) -> np.ndarray:
    """Of candidates that tell other things in other scenarios."""
    rng = np.random.default_rng(seed)
    return np.asarray(rng.standard_normal((K, 1, 2, P)) + 0.7 * rng.standard_normal((K, S, 2, P)))


def averaged(name: str, kind: str) -> Averaged:
    return Averaged(criteria(name), average_of(kind, WEIGHTS), [P] * S)


def log_phi(name: str, kind: str, weights: np.ndarray, given: np.ndarray) -> float:
    """The average from its definition, over matrices that are made here."""
    there = [np.einsum("k,knp,knq->pq", weights, given[:, s], given[:, s]) for s in range(S)]
    values = np.array([one.log_phi(matrix) for one, matrix in zip(criteria(name), there, strict=True)])
    return float(average_of(kind, WEIGHTS).value(values))


# --- the averaged criterion ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", NAMES)
def test_derivatives_are_differences(name: str, kind: str) -> None:
    matrices = CandidateRows(rows()).matrices(np.arange(6), np.eye(S * P))
    asked, w, step = averaged(name, kind), np.random.default_rng(1).uniform(0.1, 0.3, 6), 1e-6
    for share in (0.5, 0.03):
        at = asked.slope(mean_of(matrices, w), share)

        def smooth(changed: np.ndarray, share: float = share, size: float = at.size) -> float:
            found = asked.slope(mean_of(matrices, changed), share, size)
            return found.smooth if asked.kinked else found.log_phi

        gradient, hessian = at.along(matrices), None if asked.kinked else at.curvature(matrices)
        for k in range(6):
            more, less = w + step * np.eye(6)[k], w - step * np.eye(6)[k]
            assert gradient[k] == pytest.approx((smooth(more) - smooth(less)) / (2 * step), rel=1e-5, abs=1e-6)
            if hessian is None:
                continue
            slopes = [asked.slope(mean_of(matrices, one), share, at.size).along(matrices) for one in (more, less)]
            np.testing.assert_allclose(
                hessian[k], (slopes[0] - slopes[1]) / (2 * step), rtol=2e-4, atol=2e-4 * np.abs(hessian).max()
            )


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", NAMES)
def test_its_slope_bounds_all_mixtures(name: str, kind: str) -> None:
    """Also smoothed, and also that of a poor design: the bound is then far above."""
    given, rng = rows(), np.random.default_rng(2)
    matrices, asked = CandidateRows(given).matrices(np.arange(K), np.eye(S * P)), averaged(name, kind)
    for share in (0.0, 0.1):
        slope = asked.slope(mean_of(matrices, rng.dirichlet(np.ones(K))), share)
        bound = slope.log_phi + np.log(slope.along(matrices).max())
        for _ in range(50):
            assert log_phi(name, kind, rng.dirichlet(0.2 * np.ones(K)), given) <= bound + 1e-9


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", NAMES)
def test_weights_are_those_of_another_optimiser(name: str, kind: str) -> None:
    given, average = rows(3), average_of(kind, WEIGHTS)
    pool = CandidateRows(given)
    space = EstimableOver.of([estimable(part.triangle()) for part in pool.parts])
    found = optimal_weights(pool, averaged(name, kind), space=space, tolerance=1e-5)
    own = np.zeros(K)
    own[found.chosen] = found.weights
    value = log_phi(name, kind, own, given)
    assert found.efficiency >= 1 - 1e-5

    def slack(z: np.ndarray) -> np.ndarray:
        """log phi in each scenario."""
        there = [np.einsum("k,knp,knq->pq", z, given[:, s], given[:, s]) for s in range(S)]
        return np.array([one.log_phi(matrix) for one, matrix in zip(criteria(name), there, strict=True)])

    # max t - sum_s q_s (t - v_s)^+ over weights and t is the mean over the worst share (Rockafellar and Uryasev), here with slacks.
    start, share = np.full(K, 1 / K), {"log": 1.0, "worst": 1e-9, "cvar": 0.4}[kind]
    rest = {"type": "eq", "fun": lambda z: z[:K].sum() - 1}
    if kind == "log":
        best = minimize(lambda z: -average.value(slack(z)), start, bounds=[(1e-9, 1)] * K, constraints=[rest], tol=1e-12).fun
    elif kind == "worst":
        above = {"type": "ineq", "fun": lambda z: slack(z[:K]) - z[K]}
        first = np.append(start, slack(start).min())
        bounds = [(1e-9, 1)] * K + [(None, None)]
        best = minimize(lambda z: -z[K], first, bounds=bounds, constraints=[rest, above], tol=1e-12, options={"maxiter": 500}).fun
    else:
        above = {"type": "ineq", "fun": lambda z: slack(z[:K]) - z[K] + z[K + 1 :]}
        first = np.concatenate([start, [slack(start).min()], np.zeros(S)])
        bounds = [(1e-9, 1)] * K + [(None, None)] + [(0, None)] * S
        of_each = WEIGHTS / WEIGHTS.sum() / share
        best = minimize(
            lambda z: -z[K] + of_each @ z[K + 1 :],
            first,
            bounds=bounds,
            constraints=[rest, above],
            tol=1e-12,
            options={"maxiter": 500},
        ).fun
    assert value == pytest.approx(-best, abs=2e-5)


def test_a_determinant_may_be_much_larger_in_one_scenario() -> None:
    """Coordinates in which each scenario has about the identity do not change which is the worst."""
    given = rows(5) * np.array([1e-3, 1.0, 30.0, 1e3])[:, None, None]
    pool, asked = CandidateRows(given), averaged("D", "worst")
    space = EstimableOver.of([estimable(part.triangle()) for part in pool.parts])
    found = optimal_weights(pool, asked, space=space, tolerance=1e-6)
    alone = optimal_weights(CandidateRows(given[:, 0]), Determinant("D", np.eye(P), True), tolerance=1e-6)
    assert log_phi("D", "worst", _spread(found), given) == pytest.approx(log_phi("D", "worst", _spread(alone), given), abs=1e-5)


def _spread(found: Any) -> np.ndarray:
    weights = np.zeros(K)
    weights[found.chosen] = found.weights
    return weights


# --- designs ------------------------------------------------------------------------------------------------------------------

PROBLEM = fp.load_problem(Path(__file__).parents[2] / "examples" / "michaelis_menten.toml")
GRID = fp.Experiments(np.zeros((56, 0)), np.linspace(0.02, 1.1, 56)[:, None])


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
def test_no_exact_design_is_better_and_the_proofs_agree(kind: str) -> None:
    """The bound of an exact design comes from another algorithm, the multiplicative one."""
    over = fp.OverPrior(kind, scenarios=[{}, {"K": 0.04}, {"K": 0.2}, {"V": 400.0}], share=0.5)
    for goal in (fp.Goal(over=over), fp.Goal("c", of="V / K", over=over))[: 1 + (kind == "log")]:
        design = fp.approximate_design(PROBLEM, goal=goal, n_candidates=300, starts=100)
        exact = fp.exchange(PROBLEM, 10, goal=goal, n_candidates=20)
        assert design.efficiency > 1 - 1e-5 and design.starts >= 100
        assert 0.98 < design.efficiency_of(exact) <= 1.0
        assert exact.scenarios is not None and exact.efficiency is not None
        bound = exact.efficiency.at_most - design.level * np.log(2)  # of one experiment
        assert design.value == pytest.approx(bound, abs=0.012 * design.level)
        assert exact.scenarios.value - design.level * np.log(2) <= design.value + 1e-6
        assert design.sensitivity(GRID).max() <= design.level * (1 + 1e-3)


def test_the_certificate_fails_where_weights_are_not_the_best() -> None:
    """The sensitivity function of the design for the mean exceeds its level over the scenarios."""
    over = fp.OverPrior("log", scenarios=[{"K": 0.02}, {"K": 0.3}])
    mean, robust = fp.approximate_design(PROBLEM, GRID), fp.approximate_design(PROBLEM, GRID, goal=fp.Goal(over=over))
    exact = mean.rounded(2)
    assert robust.efficiency_of(exact) < 0.95
    assert fp.approximate_design(PROBLEM, exact, goal=fp.Goal(over=over)).sensitivity(GRID).max() > 2 * 1.1
    assert robust.sensitivity(GRID).max() <= 2 * (1 + 1e-5)


def test_one_scenario_at_the_mean_is_the_design_without() -> None:
    one, usual = (
        fp.approximate_design(PROBLEM, GRID, goal=fp.Goal(over=over)) for over in (fp.OverPrior("worst", scenarios=[{}]), None)
    )
    assert one.value == pytest.approx(usual.value, abs=1e-6)
    assert np.array_equal(one.points.u, usual.points.u) and one.weights == pytest.approx(usual.weights, abs=1e-4)


def test_the_prior_counts_in_every_scenario() -> None:
    over = fp.OverPrior("log", scenarios=[{}, {"K": 0.2}])
    design = fp.approximate_design(PROBLEM, GRID[:3], goal=fp.Goal(over=over, prior_information=True), n_experiments=2)
    for matrix, changed in zip(design.information, ({}, {"K": 0.2}), strict=True):
        there = PROBLEM.replace(prior=fp.GaussianPrior(dict(PROBLEM.prior.mean) | changed, dict(PROBLEM.prior.std)))
        each = [fp.evaluate(there, design.points[[k]]).information for k in range(len(design.points))]
        assert matrix == pytest.approx(np.tensordot(design.weights, each, axes=1) + np.eye(2) / 2, rel=1e-9)
    own = [np.linalg.slogdet(matrix)[1] for matrix in design.information]
    assert design.value == pytest.approx(np.mean(own)) and design.scenario_values == pytest.approx(own)


def test_files_and_reports(tmp_path: Path) -> None:
    design = fp.approximate_design(
        PROBLEM, GRID, goal=fp.Goal("A", over=fp.OverPrior("cvar", scenarios=[{}, {"K": 0.2}], share=0.5))
    )
    design.save(tmp_path / "design.json")
    loaded = fp.ApproximateDesign.load(tmp_path / "design.json")
    assert loaded.goal == design.goal and loaded.scenario_values == design.scenario_values
    assert str(loaded.report()) == str(design.report())
    assert np.array_equal(loaded.sensitivity(GRID), design.sensitivity(GRID))
    assert "the mean -log(trace of F^-1) of the worst 50 % over 2 scenarios" in str(design.report())


def test_mistakes() -> None:
    for goal, expected in (
        (
            fp.Goal("E", over=fp.OverPrior("log")),
            "goal: expected one without criterion 'E' with over for fisherpoint.approximate_design",
        ),
        (
            fp.Goal(over=fp.OverPrior("log", scenarios=fp.Sobol(256))),
            "over: expected at most 160 scenarios of 2 .*, given 256",
        ),
    ):
        with pytest.raises(ValueError, match=expected):
            fp.approximate_design(PROBLEM, GRID, goal=goal)


def test_blocks_are_joined() -> None:
    assert np.array_equal(joined([np.ones((1, 2)), np.zeros((0, 1)), 2 * np.ones((2, 1))])[:, [0, 3]], [[1, 0], [0, 2], [0, 2]])
    assert Average.of_all(3).most == pytest.approx(1 / 3)
