"""Candidates near the points of a design: where they are drawn, and what the search gains by them."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import fisherpoint as fp
from conftest import REGION, random_points
from defaults import KINDS, MODEL, problem, same_bits
from fisherpoint.region import NEAREST

LOW, HIGH = np.array(list(REGION.values())).T


def test_candidates_near_a_point_are_near_it_on_every_scale_and_stay_in_the_box() -> None:
    region, start = fp.ExperimentRegion(REGION), random_points(np.random.default_rng(0), 1)
    near = region.draw_near(MODEL, start[[0] * 20_000], np.random.default_rng(1)).table
    assert np.all((near >= LOW) & (near <= HIGH))
    distance = np.abs(near - start.table) / (HIGH - LOW)
    moved = distance > 0
    assert moved.any(axis=1).all()
    # Each coordinate is moved in 1/7 of the draws because one must, and in half of the others.
    np.testing.assert_allclose(moved.mean(axis=0), 1 / 7 + (6 / 7) / 2, atol=0.02)
    # Every order of magnitude is drawn alike.
    inside = distance[moved & (near > LOW) & (near < HIGH)]
    counts = np.histogram(np.log10(inside), np.log10([1 / NEAREST, 1e-3, 1e-2, 1e-1]))[0]
    assert counts.min() > 0.8 * counts.max()


def test_candidates_near_a_point_reach_the_bounds_themselves() -> None:
    region, start = fp.ExperimentRegion(REGION), fp.Experiments([HIGH[:5]], [HIGH[5:6]], HIGH[6:])
    near = region.draw_near(MODEL, start[[0] * 500], np.random.default_rng(1)).table
    for column, bound in enumerate(HIGH):
        share = np.mean(near[:, column] == bound)
        assert 0.5 < share < 0.95  # not moved, or moved past the bound


def test_what_the_region_fixes_is_not_moved() -> None:
    region = fp.ExperimentRegion(REGION | {"u": (0.5, 0.5), "q": (0.1, 0.1)})
    start = region.draw(MODEL, 200, np.random.default_rng(0))
    near = region.draw_near(MODEL, start, np.random.default_rng(1))
    assert np.all(near.u == 0.5) and np.all(near.x0[:, 0] == 0.1)
    assert np.all((near.table != start.table).any(axis=1))
    fixed = fp.ExperimentRegion({name: (value, value) for name, value in zip(REGION, start.table[0], strict=True)})
    assert same_bits(fixed.draw_near(MODEL, start[[0, 0]], np.random.default_rng(1)).table, start[[0, 0]].table)


@pytest.mark.parametrize("kind", KINDS)
def test_moving_points_raises_phi(kind: str) -> None:
    """By more than twice as many random candidates do."""
    without, more, local = (
        fp.exchange(problem(output_covariance=kind), 9, n, 30, seed=2, references=False, local=share)
        for n, share in ((10, 0.0), (20, 0.0), (10, 1.0))
    )
    assert local.evaluation.log_det > max(without.evaluation.log_det, more.evaluation.log_det)
    log_dets = [record.log_det for record in local.trace]
    assert all(b >= a for a, b in itertools.pairwise(log_dets))
    assert local.drawn == local.accepted + sum(local.rejected.values())


@pytest.mark.parametrize("kind", KINDS)
def test_the_result_does_not_depend_on_the_number_of_threads(kind: str) -> None:
    given = problem(output_covariance=kind)
    one, three = (fp.exchange(given, 9, 10, 10, references=False, local=1.0, threads=n) for n in (1, 3))
    assert same_bits(one.points.table, three.points.table)
    assert one.trace[-1].log_det == three.trace[-1].log_det and one.rejected == three.rejected


def test_moved_points_obey_constraints_and_survive_on_all_nodes() -> None:
    region = fp.ExperimentRegion(REGION, constraints=["p_A + p_B < 1.5e7"])
    given = problem(region=region)
    design = fp.exchange(given, 9, 20, 20, references=False, local=1.0)
    assert design.rejected["constraint"] > 0
    assert np.all(design.points.x0[:, 2] + design.points.x0[:, 3] < 1.5e7)
    assert not fp.predictive_covariance(MODEL, design.points, given.prior, given.rule).status.any()


def test_patience_ends_a_search_that_has_come_to_its_optimum() -> None:
    """Points are not moved for ever by gains that nobody sees."""

    @fp.model(states={"x": "1"}, parameters={"k": "1/s"}, outputs={"x": "1"})
    def decay(x, u, p):  # type: ignore[no-untyped-def]
        return [-p.k * x.x], [x.x]

    prior = fp.GaussianPrior(mean={"k": 1.0}, std={"k": 0.1})
    region = fp.ExperimentRegion({"x": (1.0, 1.0), "dt": (0.1, 5.0)})
    given = fp.DesignProblem(decay, prior, region, noise_std={"x": 1.0})
    design = fp.exchange(given, 1, 20, 5000, patience=50, references=False)
    assert design.stop_reason == "patience" and design.trace[-1].iteration < 1000
    assert design.points.dt[0] == pytest.approx(1.0, abs=2e-3)
