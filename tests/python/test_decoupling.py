"""The two sub-problems of section IV-B: when they are blocks of the whole, and what couples them where they are not."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import eigvalsh

import fisherpoint as fp
from conftest import random_points
from defaults import KINDS, MODEL, NAMES, NOISE, OUTPUTS, PRIOR, RELATIVE_STD, grid, problem, same_bits, valid_points

Floats = NDArray[np.float64]
MECHANICAL, HYDRAULIC = NAMES[:3], NAMES[3:]
GROUPS = {"mechanical": MECHANICAL, "hydraulic": HYDRAULIC}
STD = np.array([PRIOR.std[name] for name in NAMES])
FULL = fp.TensorGrid()  # 3^9 nodes
THIN = grid(a_tau=3, b_tau=3, E_oil=3, p_t=3, B_v=3)
TIGHT = 1e-12
both = pytest.mark.parametrize("group", GROUPS)


def columns(group: str) -> list[int]:
    return [NAMES.index(name) for name in GROUPS[group]]


def block(matrix: Floats, group: str) -> Floats:
    """The group's diagonal block of a matrix over all parameters."""
    return matrix[np.ix_(columns(group), columns(group))]


@cache
def on_grid(kind: str, names: tuple[str, ...], rule: fp.TensorGrid = FULL) -> fp.DesignProblem:
    """One problem each, so that the region's covariance is computed once."""
    return problem(output_covariance=kind, parameters=names, rule=rule, jumps="exclude")


@cache
def twelve(seed: int, rule: fp.TensorGrid = FULL) -> fp.Experiments:
    return valid_points(12, seed=seed, rule=rule, jumps="exclude")


@cache
def evaluation(kind: str, names: tuple[str, ...], seed: int, rule: fp.TensorGrid = FULL) -> fp.Evaluation:
    return fp.evaluate(on_grid(kind, names, rule), twelve(seed, rule))


def relative_eigenvalues(a: Floats, b: Floats) -> Floats:
    """Generalised eigenvalues of A v = lambda B v, of one matrix or all of a stack, with b scaled to unit diagonal."""
    n = a.shape[-1]
    found = []
    for x, y in zip(a.reshape(-1, n, n), b.reshape(-1, n, n), strict=True):
        scale = np.sqrt(np.diag(y))
        found.append(eigvalsh(x / np.outer(scale, scale), y / np.outer(scale, scale)))
    return np.concatenate(found)


def canonical_correlations(fisher: Floats) -> Floats:
    """Between the two groups, largest first: 0 where the problems are decoupled, 1 where one hides the other."""
    roots = [np.linalg.cholesky(block(fisher, group)) for group in GROUPS]
    cross = np.linalg.solve(roots[1], fisher[3:, :3])
    return np.linalg.svd(np.linalg.solve(roots[0], cross.T), compute_uv=False)


# --- D = R: blocks of the whole -------------------------------------------------------------------------------------------


@both
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_with_noise_alone_a_sub_problem_is_a_block_of_the_whole(group: str, seed: int) -> None:
    points = valid_points(12, seed=seed)
    whole, part = fp.evaluate(problem(), points), fp.evaluate(problem(parameters=GROUPS[group]), points)
    assert part.parameters == GROUPS[group]
    expected = block(whole.fisher, group)
    size = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(part.fisher / np.outer(size, size), expected / np.outer(size, size), rtol=0, atol=1e-13)
    assert part.log_det == pytest.approx(np.linalg.slogdet(expected)[1], abs=1e-9)


@both
@pytest.mark.parametrize("kind", KINDS)
def test_what_is_known_does_not_matter(group: str, kind: str) -> None:
    """However uncertain the other group is said to be: in the sub-problem it is known."""
    points = twelve(0, THIN)
    other = {name: share * (1.0 if name in GROUPS[group] else 1.7) for name, share in RELATIVE_STD.items()}
    changed = problem(
        output_covariance=kind,
        parameters=GROUPS[group],
        rule=THIN,
        prior=fp.GaussianPrior(MODEL.nominal, relative_std=other),
        jumps="exclude",
    )
    expected, actual = evaluation(kind, GROUPS[group], 0, THIN), fp.evaluate(changed, points)
    assert same_bits(actual.fisher, expected.fisher)
    assert same_bits(actual.output_covariance, expected.output_covariance)


# --- the coupling through D -----------------------------------------------------------------------------------------------


@both
@pytest.mark.parametrize("kind", ["region", "pooled", "pointwise"])
def test_nothing_but_D_makes_the_blocks_differ(group: str, kind: str) -> None:
    points = twelve(0)
    s = fp.sensitivities(MODEL, points, MODEL.nominal).dy_dtheta * STD
    part, whole = evaluation(kind, GROUPS[group], 0), evaluation(kind, NAMES, 0)
    assert part.outputs == whole.outputs == OUTPUTS

    def fisher(d: Floats) -> Floats:
        """(7) of the group for one D or one each."""
        chosen, each = s[:, :, columns(group)], np.broadcast_to(d, (len(points), 4, 4))
        return 2 / len(points) * sum(s_k.T @ np.linalg.solve(d_k, s_k) for s_k, d_k in zip(chosen, each, strict=True))

    for d, expected in ((part.output_covariance, part.fisher), (whole.output_covariance, block(whole.fisher, group))):
        size = np.sqrt(np.diag(expected))
        np.testing.assert_allclose(fisher(d) / np.outer(size, size), expected / np.outer(size, size), rtol=0, atol=1e-9)


# What docs/explanation/output_covariance.md states: the D-efficiency of the whole's block against the sub-problem's Fisher matrix.
MEASURED = {
    ("pooled", "mechanical"): (0.02, 0.20),
    ("region", "mechanical"): (0.03, 0.10),
    ("pointwise", "mechanical"): (0.20, 0.50),
    ("pooled", "hydraulic"): (0.85, 0.99),
    ("region", "hydraulic"): (0.90, 0.99),
    ("pointwise", "hydraulic"): (0.55, 0.95),
}


@pytest.mark.parametrize(("kind", "group"), MEASURED)
@pytest.mark.parametrize("seed", [0, 1])
def test_the_block_differs_by_no_more_than_D_does(kind: str, group: str, seed: int) -> None:
    """F_sub / lambda_max <= F_block <= F_sub / lambda_min, lambda those of the whole's D relative to the sub-problem's."""
    part, whole = evaluation(kind, GROUPS[group], seed), evaluation(kind, NAMES, seed)
    of_D = relative_eigenvalues(whole.output_covariance, part.output_covariance)
    of_F = relative_eigenvalues(block(whole.fisher, group), part.fisher)
    assert 1 / of_D.max() - 1e-9 <= of_F.min() and of_F.max() <= 1 / of_D.min() + 1e-9
    low, high = MEASURED[kind, group]
    assert low < np.exp(np.mean(np.log(of_F))) < high
    # The same points: the sub-problem's D is the smaller one but for terms of second order. The region's samples differ.
    assert of_D.min() > (0.9 if kind == "region" else 0.995)


def additivity_error(share: float, rule: fp.TensorGrid, points: fp.Experiments) -> Floats:
    """How far the two groups' predictive covariances are from adding up to the whole's, for a prior that is so much narrower."""
    prior = fp.GaussianPrior(MODEL.nominal, relative_std={name: share * value for name, value in RELATIVE_STD.items()})
    whole, *parts = (
        fp.predictive_covariance(MODEL, points, prior, rule, rtol=1e-11, parameters=names).covariance[:, :3, :3]
        for names in (NAMES, *GROUPS.values())
    )
    std = np.sqrt(np.diagonal(whole, axis1=1, axis2=2))
    scale = std[:, :, None] * std[:, None, :]
    return np.linalg.norm((sum(parts) - whole) / scale, axis=(1, 2)) / np.linalg.norm(whole / scale, axis=(1, 2))


def test_the_spreads_of_the_two_groups_add_up() -> None:
    """D_whole = D_mechanical + D_hydraulic - R, but for terms that fall with the square of the prior's width."""
    points = twelve(0)
    error = additivity_error(1.0, FULL, points)
    assert np.median(error) < 0.01 and np.max(error) < 0.05
    wide, narrow = (additivity_error(share, THIN, twelve(0, THIN)) for share in (1.0, 0.1))
    assert 70 < np.median(wide) / np.median(narrow) < 130


def test_a_sub_problem_admits_more_points() -> None:
    """With odd levels its nodes are nodes of the whole's grid, so it loses none of the whole's points."""
    points = random_points(np.random.default_rng(0), 2000)
    ok = {
        names: fp.predictive_covariance(MODEL, points, PRIOR, THIN, parameters=names).status == fp.Status.ok
        for names in (NAMES, MECHANICAL, HYDRAULIC)
    }
    for names in GROUPS.values():
        assert np.all(ok[names][ok[NAMES]])
        assert np.count_nonzero(ok[names]) > np.count_nonzero(ok[NAMES])


# --- the coupling through the states --------------------------------------------------------------------------------------


def test_at_short_times_friction_shows_in_the_pressures_as_in_the_position() -> None:
    """dp_A = -E_oil A_A / V_A dq and dp_B = E_oil A_B / V_B dq for the mechanical parameters, both of order dt^2."""
    points = valid_points(50, seed=3, rule=grid())
    short = fp.Experiments(points.x0, points.u, np.full(len(points), 1e-6))
    x = fp.sensitivities(MODEL, short, MODEL.nominal, rtol=TIGHT).dx_dtheta * STD
    c, nominal, q = MODEL.constants, MODEL.nominal, points.x0[:, 0]
    stiffness_A = nominal["E_oil"] * c["A_A"] / (c["A_A"] * (q - c["q_min"]) + nominal["V_0A"])
    stiffness_B = nominal["E_oil"] * c["A_B"] / (c["A_B"] * (c["q_max"] - q) + nominal["V_0B"])
    mechanical = x[:, :, :3]
    np.testing.assert_allclose(mechanical[:, 2], -stiffness_A[:, None] * mechanical[:, 0], rtol=2e-3)
    np.testing.assert_allclose(mechanical[:, 3], stiffness_B[:, None] * mechanical[:, 0], rtol=2e-3)
    # the hydraulic parameters reach the position one order later than the mechanical ones do
    longer = fp.Experiments(points.x0, points.u, np.full(len(points), 2e-6))
    grown = fp.sensitivities(MODEL, longer, MODEL.nominal, rtol=TIGHT).dx_dtheta * STD
    for names, order in ((slice(0, 3), 2), (slice(3, 9), 3)):
        slope = np.log2(np.linalg.norm(grown[:, 0, names], axis=1) / np.linalg.norm(x[:, 0, names], axis=1))
        np.testing.assert_allclose(slope, order, atol=0.02)


@pytest.mark.parametrize("seed", [0, 1])
def test_the_off_diagonal_block_vanishes_with_a_precise_position_and_short_times_only(seed: int) -> None:
    points = valid_points(24, seed=seed, rule=grid())

    def largest(time: float, q_noise: float) -> float:
        given = problem(noise=NOISE | {"q": q_noise * NOISE["q"]}, rtol=TIGHT)
        fisher = fp.evaluate(given, fp.Experiments(points.x0, points.u, time * points.dt)).fisher
        return float(canonical_correlations(fisher)[0])

    assert largest(1.0, 1.0) > 0.5
    assert largest(1e-2, 1.0) > 0.85  # short times alone do not decouple
    assert largest(1.0, 1e-2) > 0.95  # nor does a precise position alone
    assert 0.2 < largest(1e-2, 1e-1) < 0.5
    assert largest(1e-2, 1e-2) < 0.06


@both
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_not_knowing_the_other_group_costs_what_the_canonical_correlation_says(group: str, seed: int) -> None:
    points = valid_points(12, seed=seed)
    whole, part = fp.evaluate(problem(), points), fp.evaluate(problem(parameters=GROUPS[group]), points)
    assert whole.standard_errors is not None and part.standard_errors is not None
    ratio = np.array([whole.standard_errors[name] / part.standard_errors[name] for name in GROUPS[group]])
    worst = 1 / np.sqrt(1 - canonical_correlations(whole.fisher)[0] ** 2)
    assert np.all(ratio >= 1 - 1e-7) and np.all(ratio <= worst * (1 + 1e-7))
    assert ratio.max() > 1.05  # what is left is not small


# --- designing the two ----------------------------------------------------------------------------------------------------


def test_the_two_problems_are_designed_separately() -> None:
    problems = {group: problem(parameters=names) for group, names in GROUPS.items()}
    designs = {
        group: fp.exchange(given, n_experiments=6, n_candidates=20, max_iterations=40, method=fp.ExchangeMethod(references=False))
        for group, given in problems.items()
    }
    for group, design in designs.items():
        found = design.evaluation
        assert found.parameters == GROUPS[group] and found.rank == len(GROUPS[group])
        assert found.standard_errors is not None and found.rse is not None
        assert tuple(found.standard_errors) == tuple(found.rse) == tuple(found.prior_std) == GROUPS[group]
        assert all(0 < error < PRIOR.std[name] for name, error in found.standard_errors.items())
        # and it is the block of the whole's Fisher matrix for these points
        expected = block(fp.evaluate(problem(), design.points).fisher, group)
        size = np.sqrt(np.diag(expected))
        np.testing.assert_allclose(found.fisher / np.outer(size, size), expected / np.outer(size, size), rtol=0, atol=1e-13)

    rows = {group: {row.tobytes() for row in design.points.table} for group, design in designs.items()}
    assert rows["mechanical"] != rows["hydraulic"]
    for group, other in (("mechanical", "hydraulic"), ("hydraulic", "mechanical")):
        foreign = fp.evaluate(problems[group], designs[other].points)
        assert designs[group].evaluation.log_det > foreign.log_det + 1  # each design is made for its own parameters


@both
@pytest.mark.parametrize("kind", ["region", "pooled", "pointwise"])
def test_a_sub_problem_is_designed_with_its_own_spread(group: str, kind: str) -> None:
    given = on_grid(kind, GROUPS[group], THIN)
    design = fp.exchange(given, n_experiments=6, n_candidates=10, max_iterations=10, method=fp.ExchangeMethod(references=False))
    assert design.evaluation.parameters == GROUPS[group] and np.isfinite(design.evaluation.log_det)
    assert design.evaluation.log_det == pytest.approx(fp.evaluate(given, design.points).log_det, abs=1e-9)
