"""Exact designs of candidates: the best of all designs, and bounds that hold for each of them."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import fisherpoint as fp
from fisherpoint.design.exact.branch_and_bound import BranchAndBound, similar_first
from fisherpoint.design.exact.relaxation import Box, Group, Relaxation
from fisherpoint.design.exact.symmetries import symmetries
from fisherpoint.design.exact.tuning import ExactTuning
from fisherpoint.design.goal.criteria import Criterion
from fisherpoint.design.goal.determinant import Determinant
from fisherpoint.design.goal.eigenvalue_criteria import Scaled, SmallestEigenvalue
from fisherpoint.design.goal.variance import Variance
from test_approximate import COMPARTMENT, GRID, MICHAELIS, QUADRATIC, algebraic, inputs

CUBE = np.array(list(itertools.product((-1.0, 0.0, 1.0), repeat=3)))
GOALS = {
    "D": fp.Goal(),
    "A": fp.Goal("A"),
    "E": fp.Goal("E"),
    "c": fp.Goal("c", of="p3 - p4"),
    "Ds": fp.Goal("Ds", of=("p3", "p4")),
    "I": fp.Goal("I", of="y", conditions=inputs([(0.5, 0.5), (-0.5, 1.0)])),
}


def rows_of_quadratic(x: Any) -> Any:
    k = x.shape[1]
    pairs = [x[:, i] * x[:, j] for i in range(k) for j in range(i + 1, k)]
    return np.column_stack([np.ones(len(x)), x, x * x, *pairs])


def every_design(count: int, n: int) -> Any:
    """The counts of all designs of n measurements, (K, count)."""
    chosen = np.array(list(itertools.combinations_with_replacement(range(count), n)))
    return (chosen[:, :, None] == np.arange(count)).sum(axis=1)


def best_of(matrices: Any, criterion: Criterion, n: int) -> float:
    counts = every_design(len(matrices), n)
    return max(criterion.log_phi(m) for m in np.tensordot(counts.astype(float), matrices, 1))


def test_the_best_designs_of_a_quadratic_are_found_and_proven() -> None:
    weights = fp.approximate_design(QUADRATIC, inputs(GRID))
    matrices = np.einsum("ki,kj->kij", *(2 * [rows_of_quadratic(GRID)]))
    for n, efficiency in ((6, 0.8849), (7, 0.9454), (8, 0.9572)):
        design = fp.exact_design(QUADRATIC, inputs(GRID), n)
        assert design.proven and design.efficiency == pytest.approx(1.0, abs=2e-6)
        counts = every_design(9, n)
        best = np.linalg.slogdet(np.tensordot(counts.astype(float), matrices, 1)[:])[1].max()
        assert design.value == pytest.approx(best, abs=1e-9)
        assert design.of_weights == pytest.approx(efficiency, abs=1e-4)
        assert weights.efficiency_of(design) == pytest.approx(efficiency, abs=1e-4)
        assert design.counts.sum() == len(design.points) == n and len(design.distinct) == len(design.counts)
        np.testing.assert_array_equal(np.repeat(GRID[design.chosen], design.counts, axis=0), design.points.u)


@pytest.mark.long
@pytest.mark.parametrize("n", range(6, 15))
def test_the_gap_of_a_quadratic_in_two_factors_is_closed(n: int) -> None:
    design = fp.exact_design(QUADRATIC, inputs(GRID), n, gap=1e-8)
    assert design.proven and design.nodes <= 60
    single = fp.exchange(QUADRATIC, n, seed=1)  # of all places, which may be better
    on_grid = fp.evaluate(QUADRATIC, fp.Experiments.join([design.points]), output_covariance="noise")
    assert on_grid.log_det <= single.evaluation.log_det + 1e-6


@pytest.mark.long
@pytest.mark.parametrize(("n", "nodes"), [(10, 3000), (11, 500), (12, 500), (14, 200)])
def test_the_gap_of_a_quadratic_in_three_factors_is_closed(n: int, nodes: int) -> None:
    names = {f"p{k}": 1.0 for k in range(10)}
    terms = ["1", "a", "b", "c", "a*a", "a*b", "a*c", "b*b", "b*c", "c*c"]
    problem = algebraic(" + ".join(f"p{k}*{t}" for k, t in enumerate(terms)), names, dict.fromkeys("abc", (-1, 1)))
    design = fp.exact_design(problem, inputs(CUBE), n)
    assert design.proven and design.nodes <= nodes


@pytest.mark.long
@pytest.mark.parametrize("name", GOALS)
@pytest.mark.parametrize("n", [6, 7])
def test_designs_by_every_criterion_are_the_best_of_all(name: str, n: int) -> None:
    design = fp.exact_design(QUADRATIC, inputs(GRID), n, goal=GOALS[name])
    criterion = fp.criterion(QUADRATIC, GOALS[name])
    matrices = np.einsum("ki,kj->kij", *(2 * [rows_of_quadratic(GRID)]))
    best = best_of(matrices, criterion, n)
    assert criterion.log_phi(design.information) <= best + 1e-9
    assert criterion.log_phi(design.information) - np.log(design.efficiency) >= best - 1e-9
    assert design.proven and criterion.log_phi(design.information) >= best - 2e-6
    assert criterion.value(design.information) == pytest.approx(design.value)


def criteria(rng: np.random.Generator, p: int) -> list[Criterion]:
    return [
        Determinant("D", np.eye(p), True),
        Determinant("Ds", np.eye(p)[:, :1], False),
        Variance("A", np.eye(p), True),
        Variance("c", rng.standard_normal((p, 1))),
        SmallestEigenvalue(Scaled(np.eye(p))),
    ]


@given(seed=st.integers(0, 10**6), count=st.integers(3, 6), n=st.integers(2, 5), outputs=st.integers(1, 2), which=st.integers(0, 4))
@settings(max_examples=150, deadline=None)
def test_no_bound_is_below_the_best_of_all_designs(seed: int, count: int, n: int, outputs: int, which: int) -> None:
    rng, p = np.random.default_rng(seed), 2
    rows = rng.standard_normal((count, outputs, p)) * rng.uniform(0.1, 3.0, (count, 1, 1))
    if seed % 3 == 0:
        rows[1] = -rows[0]  # a copy
    matrices, criterion = np.swapaxes(rows, 1, 2) @ rows, criteria(rng, p)[which]
    best = best_of(matrices, criterion, n)
    # Any box, any groups: the bound holds for the designs in it, from wherever the relaxed problem is begun.
    low = rng.integers(0, 2, count)
    box = Box(low, low + rng.integers(0, n, count), (Group(0, 2, int(rng.integers(0, 2)), int(rng.integers(1, n + 1))),))
    counts = every_design(count, n)
    of_group = counts[:, :2].sum(axis=1)
    inside = ((counts >= box.least) & (counts <= box.most)).all(axis=1)
    inside &= (of_group >= box.groups[0].least) & (of_group <= box.groups[0].most)
    closer = box.tightened(n)
    relaxation = Relaxation(matrices, criterion, n)
    if closer is None:
        assert not inside.any()
    elif inside.any():
        assert ((counts[inside] >= closer.least) & (counts[inside] <= closer.most)).all()
        there = max(criterion.log_phi(m) for m in np.tensordot(counts[inside].astype(float), matrices, 1))
        for start in (None, rng.dirichlet(np.ones(count)) * n):
            found = relaxation.bounded(closer, start, -np.inf, 1e-6)
            assert found is None or found.bound >= there - 1e-9
    if np.isfinite(best):
        order, parts = similar_first(matrices)
        worst = counts[np.argmax([criterion.log_phi(m) for m in np.tensordot(counts.astype(float), matrices, 1)])]
        for first in (worst, counts[rng.integers(len(counts))]):
            search = BranchAndBound(Relaxation(matrices[order], criterion, n), parts, np.arange(count)[None], first[order], 1e-7)
            whole = Box(np.zeros(count, dtype=np.int64), np.full(count, n))
            assert search.run(whole, np.inf, 10_000, lambda: False, lambda *_: None) == "proven"
            assert best - 1e-6 <= search.value <= best + 1e-9


@pytest.mark.long
@pytest.mark.parametrize("name", ["D", "A", "E"])
def test_a_bound_is_far_from_a_design_that_is_not_optimal(name: str) -> None:
    """Where the search is stopped at once, what is proven of a bad design is bad."""
    matrices = np.einsum("ki,kj->kij", *(2 * [rows_of_quadratic(GRID)]))
    criterion = fp.criterion(QUADRATIC, name)
    poor = np.array([1, 1, 1, 1, 1, 1, 3, 0, 0])
    search = BranchAndBound(Relaxation(matrices, criterion, 9), similar_first(matrices)[1], np.arange(9)[None], poor, 1e-6)
    box = Box(np.zeros(9, dtype=np.int64), np.full(9, 9))
    true = np.exp(criterion.log_phi(np.tensordot(poor.astype(float), matrices, 1)) - best_of(matrices, criterion, 9))
    search._try = lambda *_: None  # type: ignore[method-assign]  # the design stays
    assert search.run(box, np.inf, 3, lambda: False, lambda *_: None) == "max_nodes"
    assert search.efficiency <= true + 1e-9 < 0.95


@pytest.mark.parametrize("name", GOALS)
def test_symmetries_keep_the_criterion_of_every_design(name: str) -> None:
    rng, rows = np.random.default_rng(0), rows_of_quadratic(GRID)
    criterion = fp.criterion(QUADRATIC, GOALS[name])
    found = symmetries(rows, criterion)
    assert len(np.unique(found, axis=0)) == len(found) == {"D": 8, "A": 8, "E": 8, "Ds": 8, "c": 8, "I": 1}[name]
    for permutation in found:
        counts = rng.integers(1, 4, len(rows))
        here, there = (criterion.log_phi((rows * one[:, None]).T @ rows) for one in (counts, counts[permutation]))
        assert here == pytest.approx(there, abs=1e-8)


def test_symmetries_are_those_of_the_cube_and_random_rows_have_none() -> None:
    assert len(symmetries(rows_of_quadratic(CUBE), Determinant("D", np.eye(10), True))) == 48
    assert len(symmetries(np.random.default_rng(0).standard_normal((8, 3)), Determinant("D", np.eye(3), True))) == 1


@pytest.mark.long
@pytest.mark.parametrize("count", [50, 500, 2000])
@pytest.mark.parametrize("n", [4, 5])
def test_neighbours_on_a_fine_grid_do_not_hold_up_the_proof(count: int, n: int) -> None:
    t = np.linspace(0, 48, count + 1)[1:]
    design = fp.exact_design(COMPARTMENT, inputs(t), n)
    assert design.proven and design.nodes < 200 and design.n_left < count
    better = fp.exact_design(MICHAELIS, inputs(np.linspace(0, 5, count + 1)[1:]), n)
    assert better.proven and better.nodes < 100 and sorted(better.counts) == [n // 2, n - n // 2]


@pytest.mark.parametrize("most", [10**6, 5])
def test_similar_candidates_lie_beside_each_other_in_groups_within_groups(most: int) -> None:
    rng = np.random.default_rng(0)
    centres = np.repeat([0.0, 1.0, 5.0, 5.0], [3, 5, 4, 1])
    x = centres + 1e-3 * rng.standard_normal(13)
    x[-1] = x[-2]  # a copy
    shuffled = rng.permutation(13)
    order, parts = similar_first(x[shuffled, None, None], ExactTuning(most_grouped=most))
    np.testing.assert_array_equal(np.sort(order), np.arange(13))
    groups = {(part.first, part.end) for part in parts}
    assert {(k, k + 1) for k in range(13)} <= groups
    of = [set(range(first, end)) for first, end in groups]
    assert all(not one & other or one <= other or other <= one for one, other in itertools.combinations(of, 2))
    members = {frozenset(np.round(centres[shuffled][order[first:end]]).tolist()) for first, end in groups if end - first > 2}
    assert {frozenset([0.0]), frozenset([1.0]), frozenset([5.0])} <= members


def test_twenty_thousand_candidates_are_no_obstacle() -> None:
    design = fp.exact_design(MICHAELIS, inputs(np.linspace(0, 5, 20_001)[1:]), 5)
    assert design.proven and design.n_left > 3000 and design.nodes < 100
    assert design.of_weights == pytest.approx((6 / 6.25) ** 0.5, abs=1e-4)


def test_one_time_determines_the_highest_concentration() -> None:
    """The information of four measurements at the best time is singular; what is asked lies in its range."""
    peak = float(np.log(4.298 / 0.05884) / (4.298 - 0.05884))
    of = "c*(exp(-a*log(b/a)/(b - a)) - exp(-b*log(b/a)/(b - a)))"
    times = np.sort(np.append(np.linspace(0.2, 40, 60), peak))
    design = fp.exact_design(COMPARTMENT, inputs(times), 4, goal=fp.Goal("c", of=of))
    assert design.proven and design.value == pytest.approx(0.25, rel=1e-6)
    np.testing.assert_allclose(design.points.u[:, 0], peak)
    assert fp.criterion(COMPARTMENT, fp.Goal("c", of=of)).value(design.information) == pytest.approx(0.25, rel=1e-6)


def test_the_prior_is_added_once() -> None:
    problem = QUADRATIC.replace(noise={"y": 3.0})
    design = fp.exact_design(problem, inputs(GRID), 3, goal=fp.Goal(prior_information=True))
    assert design.proven
    rows = rows_of_quadratic(GRID) / 3.0
    every = np.eye(6) + np.einsum("dk,ki,kj->dij", every_design(9, 3).astype(float), rows, rows)
    assert design.value == pytest.approx(np.linalg.slogdet(every)[1].max(), abs=1e-9)
    with pytest.raises(ValueError, match=r"^n_experiments: expected enough to determine criterion 'D', given 3"):
        fp.exact_design(problem, inputs(GRID), 3)


def test_what_stops_the_search_is_told_with_what_is_proven_until_then() -> None:
    stopped = fp.exact_design(QUADRATIC, inputs(GRID), 8, max_nodes=2)
    assert stopped.stop_reason == "max_nodes" and stopped.nodes == 2 and not stopped.proven
    assert 0.95 < stopped.efficiency < 1 - 1e-4 and stopped.efficiency >= stopped.of_weights - 1e-9
    assert "at least" in repr(stopped) and "the limit of nodes" in str(stopped)
    assert "there may be one with up to" in " ".join(str(stopped).split())
    late = fp.exact_design(QUADRATIC, inputs(GRID), 8, time_limit=1e-6)
    assert late.stop_reason == "time_limit" and late.efficiency > 0.9
    done = fp.exact_design(QUADRATIC, inputs(GRID), 8)
    assert "proven D-optimal among 9 candidates, to 1e-6" in repr(done) and "there may be" not in str(done)
    assert fp.exact_design(QUADRATIC, inputs(GRID), 8, gap=0.1).nodes <= 1
    assert "too many" in str(replace(stopped, stop_reason=fp.StopReason.too_many_candidates))

    def interrupt(progress: fp.Progress) -> None:
        if progress.step == 0:
            return
        assert progress.step == 1 and 0 < (progress.value or 0) <= 1 and progress.seconds > 0 and " open" in progress.message
        raise KeyboardInterrupt

    interrupted = fp.exact_design(QUADRATIC, inputs(GRID), 8, progress=interrupt)
    assert interrupted.stop_reason == "interrupted" and 0.9 < interrupted.efficiency < 1
    assert interrupted.value == pytest.approx(done.value)


def test_copies_and_points_that_are_none_are_left_out() -> None:
    square = fp.ExperimentRegion({"a": (-1, 1), "b": (-1, 1)}, ["a + b < 3"])
    twice = np.concatenate([GRID, GRID, [[2.0, 2.0]]])
    design = fp.exact_design(QUADRATIC.replace(region=square), inputs(twice), 7)
    assert design.proven and design.n_candidates == 18 and design.n_left <= 9 and sum(design.left_out.values()) == 1
    assert design.value == pytest.approx(fp.exact_design(QUADRATIC, inputs(GRID), 7).value)


def test_misuse_is_told() -> None:
    grid = inputs(GRID)
    with pytest.raises(ValueError, match=r"^goal: expected one without criterion 'ME' for fisherpoint\.exact"):
        fp.exact_design(QUADRATIC, grid, 6, goal="ME")
    with pytest.raises(ValueError, match=r"^output_covariance: expected 'noise'"):
        fp.exact_design(MICHAELIS.replace(output_covariance="pooled"), inputs([1.0]), 2)
    with pytest.raises(ValueError, match=r"^gap: expected a share between"):
        fp.exact_design(QUADRATIC, grid, 6, gap=0.9)
    with pytest.raises(ValueError, match=r"^candidates: expected valid points, given none"):
        fp.exact_design(QUADRATIC, inputs(np.empty((0, 2))), 6)
    with pytest.raises(TypeError, match=r"^candidates: expected Experiments"):
        fp.exact_design(QUADRATIC, GRID, 6)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"^n_experiments: expected enough"):
        fp.exact_design(QUADRATIC, grid, 5)
