"""Criteria, weights of candidates and their certificates: derivatives, efficiencies and bounds on random problems."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest

from fisherpoint.design.candidates.candidate_rows import CandidateRows
from fisherpoint.design.goal.criteria import Criterion
from fisherpoint.design.goal.determinant import Determinant
from fisherpoint.design.goal.eigenvalue_criteria import ConditionNumber, Scaled, SmallestEigenvalue
from fisherpoint.design.goal.estimable_space import estimable
from fisherpoint.design.goal.functions_of_parameters import gradient_of
from fisherpoint.design.goal.variance import Variance
from fisherpoint.design.weights.rounding import efficient_rounding
from fisherpoint.design.weights.weights import least_sensitivity, optimal_weights

P = 4


def criteria(rng: np.random.Generator) -> dict[str, Criterion]:
    return {
        "D": Determinant("D", np.eye(P), True),
        "Ds": Determinant("Ds", np.eye(P)[:, :2], False),
        "A": Variance("A", np.diag([1.0, 2.0, 0.5, 1.0]), True),
        "c": Variance("c", rng.standard_normal((P, 1))),
        "I": Variance("I", rng.standard_normal((P, 3))),
        "E": SmallestEigenvalue(Scaled(np.diag([1.0, 2.0, 0.5, 1.0]))),
        "ME": ConditionNumber(Scaled(np.eye(P))),
    }


NAMES = ("D", "Ds", "A", "c", "I", "E", "ME")
CONVEX = NAMES[:-1]


def of_random_rows(seed: int, count: int = 60, outputs: int = 2) -> tuple[CandidateRows, np.random.Generator]:
    rng = np.random.default_rng(seed)
    return CandidateRows(rng.standard_normal((count, outputs, P)) * rng.uniform(0.1, 3.0, (count, 1, 1))), rng


def mixture(candidates: CandidateRows, weights: Any) -> Any:
    return candidates.information(np.arange(len(candidates)), np.asarray(weights))


@pytest.mark.parametrize("name", NAMES)
def test_the_gradient_is_that_of_finite_differences(name: str) -> None:
    candidates, rng = of_random_rows(1)
    m = mixture(candidates, np.full(60, 1 / 60))
    one = criteria(rng)[name]
    for _ in range(5):
        step = rng.standard_normal((P, P))
        step = step + step.T
        h = 1e-5
        numeric = (one.value(m + h * step) - one.value(m - h * step)) / (2 * h)
        assert float((one.gradient(m) * step).sum()) == pytest.approx(numeric, rel=1e-6, abs=1e-8)


@pytest.mark.parametrize("name", CONVEX)
def test_curvature_and_slope_along_weights_are_those_of_finite_differences(name: str) -> None:
    candidates, rng = of_random_rows(2, 6)
    one, share = criteria(rng)[name], 0.05
    f = candidates.matrices(np.arange(6), np.eye(P))
    w, direction = rng.dirichlet(np.ones(6)), rng.standard_normal(6)
    size = one.slope(np.tensordot(w, f, 1), share).size

    def slope(shift: float) -> Any:
        return one.slope(np.tensordot(w + shift * direction, f, 1), share, size)

    h = 1e-5
    numeric = (slope(h).along(f) - slope(-h).along(f)) / (2 * h)
    np.testing.assert_allclose(slope(0.0).curvature(f) @ direction, numeric, rtol=1e-5, atol=1e-6 * np.abs(numeric).max())
    value = (lambda s: s.smooth) if name == "E" else (lambda s: s.log_phi)
    rate = (value(slope(h)) - value(slope(-h))) / (2 * h)
    assert float(slope(0.0).along(f) @ direction) == pytest.approx(rate, rel=1e-6)


def test_the_values_are_what_their_names_say() -> None:
    candidates, rng = of_random_rows(3)
    m = mixture(candidates, rng.dirichlet(np.ones(60)))
    c, inverse, scale = criteria(rng), np.linalg.solve(m, np.eye(P)), np.diag([1.0, 2.0, 0.5, 1.0])
    assert c["D"].value(m) == pytest.approx(np.linalg.slogdet(m)[1])
    assert c["Ds"].value(m) == pytest.approx(-np.linalg.slogdet(inverse[:2, :2])[1])
    assert c["A"].value(m) == pytest.approx(np.trace(scale @ inverse @ scale))
    k = c["I"].k  # type: ignore[attr-defined]
    assert c["I"].value(m) == pytest.approx(np.trace(k.T @ inverse @ k))
    assert c["E"].value(m) == pytest.approx(np.linalg.eigvalsh(scale @ m @ scale)[0])
    assert c["ME"].value(m) == pytest.approx(np.linalg.cond(m))
    np.testing.assert_allclose([one.efficiency(3.0 * m, m) for one in c.values()], [3.0] * 6 + [1.0])


@pytest.mark.parametrize("name", CONVEX)
@pytest.mark.parametrize("seed", range(4))
def test_no_design_is_better_than_the_bound_and_the_weights_come_near(name: str, seed: int) -> None:
    candidates, rng = of_random_rows(seed)
    one = criteria(rng)[name]
    found = optimal_weights(candidates, one)
    m = candidates.information(found.chosen, found.weights)
    best = one.log_phi(m) - np.log(found.efficiency)
    assert found.weights.sum() == pytest.approx(1) and (found.weights > 0).all()
    assert 1 - 1e-6 <= found.efficiency <= 1
    others = np.concatenate([rng.dirichlet(np.full(60, 0.1), 200), np.eye(60)[found.chosen]])
    assert all(one.log_phi(mixture(candidates, w)) <= best + 1e-9 for w in others)
    # Weights in place of the last part of an optimum are not better either: the bound is near, not just valid.
    moved = 0.999 * np.bincount(found.chosen, found.weights, 60) + 0.001 / 60
    assert one.efficiency(mixture(candidates, moved), m) <= 1 + 1e-4


@pytest.mark.parametrize("name", CONVEX)
def test_the_certificate_fails_where_a_design_is_not_optimal(name: str) -> None:
    candidates, rng = of_random_rows(5)
    one = criteria(rng)[name]
    worse = mixture(candidates, np.full(60, 1 / 60))
    largest = candidates.along(one.slope(worse, 1e-6).half).max()
    true = one.efficiency(worse, candidates.information(*_best(candidates, one)))
    assert largest > 1.05 and true < 0.95  # what the equivalence theorem says of a design that is not optimal
    assert true >= 1 / largest - 1e-6  # and the bound that follows


def _best(candidates: CandidateRows, one: Criterion) -> tuple[Any, Any]:
    found = optimal_weights(candidates, one)
    return found.chosen, found.weights


def test_what_is_deleted_has_no_weight_in_the_optimum() -> None:
    for seed in range(10):
        candidates, rng = of_random_rows(seed, 40, outputs=1 + seed % 3)
        one = criteria(rng)["D"]
        exact = optimal_weights(candidates, one, tolerance=1e-9)
        in_optimum = exact.chosen[exact.weights > 1e-6]
        for _ in range(20):
            share = rng.uniform(0, 1)
            w = (1 - share) * np.bincount(exact.chosen, exact.weights, 40) + share * rng.dirichlet(np.ones(40))
            along = candidates.along(one.slope(mixture(candidates, w)).half)
            least = least_sensitivity(along.max() - 1.0, P)
            assert (along[in_optimum] >= least - 1e-6).all()
    assert 0.5 < least_sensitivity(0.01, 9) < 1 and least_sensitivity(0.0, 9) == 1.0


def test_a_constant_is_part_of_every_candidate() -> None:
    candidates, rng = of_random_rows(6)
    constant = np.diag([5.0, 0.1, 0.1, 0.1])
    with_it = CandidateRows(candidates.rows, constant)
    found = optimal_weights(with_it, criteria(rng)["D"])
    m = candidates.information(found.chosen, found.weights) + constant
    value = np.linalg.slogdet(m)[1]
    gain = [np.trace(np.linalg.solve(m, candidates.matrices(np.array([k]), np.eye(P))[0] + constant)) for k in range(60)]
    assert max(gain) <= P * (1 + 2e-6)
    others = rng.dirichlet(np.full(60, 0.1), 200)
    assert all(np.linalg.slogdet(mixture(candidates, w) + constant)[1] <= value for w in others)


def test_what_no_candidate_tells_is_left_out() -> None:
    candidates, rng = of_random_rows(7)
    direction = np.array([1.0, -1.0, 0.0, 0.0]) / np.sqrt(2)
    rows = candidates.rows - (candidates.rows @ direction)[..., None] * direction
    blind = CandidateRows(rows)
    space = estimable(blind.triangle())
    assert (
        space.rank == 3
        and abs(abs(space.null[0] / space.length @ direction) / np.linalg.norm(space.null[0] / space.length) - 1) < 1e-8
    )
    found = optimal_weights(blind, criteria(rng)["D"])
    basis = np.linalg.qr(np.column_stack([direction, np.eye(P)]))[0][:, 1:]
    m = basis.T @ blind.information(found.chosen, found.weights) @ basis
    gains = [np.trace(np.linalg.solve(m, basis.T @ f @ basis)) for f in blind.matrices(np.arange(60), np.eye(P))]
    assert max(gains) <= 3 * (1 + 2e-6)
    for name in ("A", "E"):  # of what is estimable alone
        one = {"A": Variance("A", np.eye(P), True), "E": SmallestEigenvalue(Scaled(np.eye(P)))}[name]
        best = optimal_weights(blind, one)
        values = np.linalg.eigvalsh(blind.information(best.chosen, best.weights))[1:]
        value = (1 / values).sum() if name == "A" else values[0]
        inner = one.within(space.orthonormal)
        assert inner.value(space.span.T @ blind.information(best.chosen, best.weights) @ space.span) == pytest.approx(value)
        assert best.efficiency > 0.999
    assert Variance("c", direction[:, None]).outside(space) == pytest.approx(1)
    assert Variance("c", basis[:, :1]).outside(space) < 1e-8


def test_rounding_keeps_every_point_and_the_total() -> None:
    rng = np.random.default_rng(8)
    for m, extra in itertools.product((1, 3, 7), (0, 1, 5, 40)):
        w = rng.dirichlet(np.ones(m))
        counts = efficient_rounding(w, m + extra)
        assert counts.sum() == m + extra and counts.min() >= 1
        # of all roundings, none has a smaller largest of (n_i - 1) / w_i
        assert ((counts - 1) / w).max() <= (counts / w).min() * (1 + 1e-12) or counts.max() == 1 or extra == 0
    np.testing.assert_array_equal(efficient_rounding(np.array([0.5, 0.5]), 6), [3, 3])


def test_functions_have_their_derivatives() -> None:
    theta = {"a": 1.3, "b": 0.4}
    for text in ("a / b", "log(b / a) / (b - a)", "sqrt(a) * exp(-b) + a**b", "atan2(a, b) - tanh(a * b) + sin(a)**2", "2*a - b"):
        _, gradient = gradient_of(text, theta, "of")
        for k, name in enumerate(theta):
            h = 1e-6
            sides = [gradient_of(text, theta | {name: theta[name] + s * h}, "of")[0] for s in (1, -1)]
            assert gradient[k] == pytest.approx((sides[0] - sides[1]) / (2 * h), rel=1e-7, abs=1e-8)
    for wrong in ("a +", "q", "max(a, b)", "log(-a)", "1 / (a - a)"):
        with pytest.raises(ValueError, match=r"^of: "):
            gradient_of(wrong, theta, "of")


@pytest.mark.parametrize("criterion", [Determinant("D", np.eye(4), True), Variance("A", np.eye(4), True)])
def test_weights_of_matrices_of_very_different_sizes_are_found(criterion: Any) -> None:
    """Newton steps from equal weights stopped at half of the optimum."""
    random = np.random.default_rng(3)
    rows = random.standard_normal((20_000, 1, 4)) * np.exp(random.standard_normal((20_000, 1, 1)))
    for seed in range(4):
        assert optimal_weights(CandidateRows(rows), criterion, tolerance=1e-6, seed=seed).efficiency > 1 - 2e-6


@pytest.mark.long
@pytest.mark.parametrize("name", ["A", "c"])
def test_steps_that_are_small_but_go_on_are_no_standstill(name: str) -> None:
    """On a few of such sets the gap falls by less than a tenth in each step."""
    for seed in range(12):
        rng = np.random.default_rng(seed)
        axes = np.linalg.qr(rng.standard_normal((6, 6)))[0]
        rows = rng.standard_normal((300, 1 + seed % 2, 6)) * np.logspace(0, -5, 6) @ axes
        criterion = Variance("A", np.eye(6), True) if name == "A" else Variance("c", axes[:2].sum(axis=0)[:, None])
        assert optimal_weights(CandidateRows(rows), criterion, tolerance=1e-6).efficiency > 1 - 2e-6


def test_copies_of_candidates_do_not_hold_up_the_weights() -> None:
    """27 settings in 20,000 candidates that repeat them: with hundreds of copies in a working set, 300 rounds proved 0.9985."""
    rng = np.random.default_rng(9)
    grid = np.array(list(itertools.product((-1.0, 0.0, 1.0), repeat=3)))
    products = [grid[:, i] * grid[:, j] for i in range(3) for j in range(i, 3)]
    settings = np.column_stack([np.ones(27), grid, *products])[:, None, :]
    determinant, copies = Determinant("D", np.eye(10), True), rng.integers(27, size=20_000)
    alone = optimal_weights(CandidateRows(settings), determinant)
    for rows in (settings[copies], -settings[copies]):
        found = optimal_weights(CandidateRows(rows), determinant, first=np.arange(60))
        assert found.efficiency > 1 - 2e-6 and found.rounds <= 20 and len(found.chosen) <= 27
        of_settings = np.bincount(copies[found.chosen], found.weights, 27)
        np.testing.assert_allclose(of_settings, np.bincount(alone.chosen, alone.weights, 27), atol=2e-3)


@pytest.mark.parametrize("seed", range(3))
def test_candidates_that_are_almost_copies_are_taken_for_one_as_long_as_that_costs_little(seed: int) -> None:
    rng = np.random.default_rng(seed)
    centres = rng.standard_normal((30, 4))
    rows = (centres[rng.integers(30, size=20_000)] + 1e-5 * rng.standard_normal((20_000, 4)))[:, None, :]
    found = optimal_weights(CandidateRows(rows), Determinant("D", np.eye(4), True))
    assert found.efficiency > 1 - 2e-6 and found.rounds <= 15
