"""Candidates near the points of a design: where they are drawn, and what the search gains by them."""

from __future__ import annotations

import functools
import itertools
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from conftest import REGION, random_points
from defaults import KINDS, MODEL, problem, same_bits
from fisherpoint.design.points.exchange_search import ExchangeSearch
from fisherpoint.design.points.past_moves import Lineage
from fisherpoint.information.candidates import CandidateSource
from fisherpoint.points.region import NEAREST

paper = functools.partial(fp.exchange, method="paper")
LOW, HIGH = np.array(list(REGION.values())).T


def test_candidates_near_a_point_are_near_it_on_every_scale_and_stay_in_the_box() -> None:
    region, start = fp.ExperimentRegion(REGION), random_points(np.random.default_rng(0), 1)
    near = region.draw_near(MODEL, start[[0] * 20_000], seed=1).table
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
    near = region.draw_near(MODEL, start[[0] * 500], seed=1).table
    for column, bound in enumerate(HIGH):
        share = np.mean(near[:, column] == bound)
        assert 0.5 < share < 0.95  # not moved, or moved past the bound


def test_what_the_region_fixes_is_not_moved() -> None:
    region = fp.ExperimentRegion(REGION | {"u": (0.5, 0.5), "q": (0.1, 0.1)})
    start = region.draw(MODEL, 200, seed=0)
    near = region.draw_near(MODEL, start, seed=1)
    assert np.all(near.u == 0.5) and np.all(near.x0[:, 0] == 0.1)
    assert np.all((near.table != start.table).any(axis=1))
    fixed = fp.ExperimentRegion({name: (value, value) for name, value in zip(REGION, start.table[0], strict=True)})
    assert same_bits(fixed.draw_near(MODEL, start[[0, 0]], seed=1).table, start[[0, 0]].table)


def test_candidates_go_on_in_about_the_direction_of_a_step() -> None:
    region, middle = (
        fp.ExperimentRegion(REGION),
        fp.Experiments([(LOW + HIGH)[:5] / 2], [(LOW + HIGH)[5:6] / 2], (LOW + HIGH)[6:] / 2),
    )
    step = 0.01 * (HIGH - LOW) * np.array([1.0, -1.0, 0.5, 0.0, 0.0, 1.0, -0.5])
    near = region.draw_near(MODEL, middle[[0] * 5000], np.tile(step, (5000, 1)), seed=1).table
    change, direction = (near - middle.table) / (HIGH - LOW), step / (HIGH - LOW) / np.linalg.norm(step / (HIGH - LOW))
    far = change @ direction / np.linalg.norm(step / (HIGH - LOW))
    assert 0.9 < np.median(far) < 1.1 and np.mean(far > 0) > 0.99
    cosine = change @ direction / np.linalg.norm(change, axis=1)
    assert np.median(cosine) > 0.9 and cosine.std() > 0.01
    # Where there is no step, as without any.
    none = np.zeros((5000, 7))
    assert region.draw_near(MODEL, middle[[0] * 5000], none, seed=1) == region.draw_near(MODEL, middle[[0] * 5000], seed=1)


def test_a_lineage_has_the_steps_from_its_ancestors_the_nearest_first() -> None:
    generations = 6
    lineage, way = Lineage(generations), np.cumsum(np.random.default_rng(0).random((generations + 3, 2)), axis=0)
    lineage.add(way[1:], way[:-1])
    found = lineage.steps(np.array([way[-1], way[2], way[0]]))
    np.testing.assert_array_equal(found[0], way[-1] - way[-2 : -2 - generations : -1])
    np.testing.assert_array_equal(found[1], [way[2] - way[1], way[2] - way[0], *np.zeros((generations - 2, 2))])
    assert not found[2].any()


def test_an_ancestor_comes_from_where_it_came_from_last() -> None:
    lineage, (a, b, c, d) = Lineage(6), np.eye(4)
    lineage.add(np.array([b, c]), np.array([a, b]))
    lineage.add(b[None], d[None])
    np.testing.assert_array_equal(lineage.steps(c[None])[0, :3], [c - b, c - d, np.zeros(4)])


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
def test_moving_points_raises_phi(kind: str) -> None:
    """By more than twice as many random candidates do, in the mean over some searches."""
    given = problem(output_covariance=kind)
    without, more, local = (
        [
            paper(
                given,
                9,
                n_candidates=n,
                max_iterations=30,
                seed=seed,
                method=fp.ExchangeMethod("paper", references=False, local=share),
            )
            for seed in range(4)
        ]
        for n, share in ((10, 0.0), (20, 0.0), (10, 1.0))
    )
    reached = [np.mean([design.evaluation.log_det for design in designs]) for designs in (without, more, local)]
    assert reached[2] > max(reached[:2])
    for design in local:
        log_dets = [record.log_det for record in design.trace]
        assert all(b >= a for a, b in itertools.pairwise(log_dets))
        assert design.drawn == design.accepted + sum(design.rejected.values())


@pytest.mark.parametrize("kind", KINDS)
def test_the_result_does_not_depend_on_the_number_of_threads(kind: str) -> None:
    given = problem(output_covariance=kind)
    one, three = (
        paper(
            given, 9, n_candidates=10, max_iterations=10, method=fp.ExchangeMethod("paper", references=False, local=1.0), threads=n
        )
        for n in (1, 3)
    )
    assert same_bits(one.points.table, three.points.table)
    assert one.trace[-1].log_det == three.trace[-1].log_det and one.rejected == three.rejected


def test_moved_points_obey_constraints_and_survive_on_all_nodes() -> None:
    region = fp.ExperimentRegion(REGION, constraints=["p_A + p_B < 1.5e7"])
    given = problem(region=region)
    design = paper(given, 9, n_candidates=20, max_iterations=20, method=fp.ExchangeMethod("paper", references=False, local=1.0))
    assert design.rejected["constraint"] > 0
    assert np.all(design.points.x0[:, 2] + design.points.x0[:, 3] < 1.5e7)
    assert not fp.predictive_covariance(MODEL, design.points, given.prior, given.rule).status.any()


def decay(bounds: tuple[float, float] = (0.1, 5.0)) -> fp.DesignProblem:
    """x' = -k x from x = 1: k is told best by a point at dt = 1 / k = 1."""
    model = fp.SymbolicModel(["-k*x"], ["x"], {"x": "1"}, {}, {"k": "1/s"}, {"x": "1"})
    prior = fp.GaussianPrior(mean={"k": 1.0}, std={"k": 0.1})
    return fp.DesignProblem(model, prior, fp.ExperimentRegion({"x": (1.0, 1.0), "dt": bounds}), noise={"x": 1.0})


def test_patience_ends_a_search_that_has_come_to_its_optimum() -> None:
    """Points are not moved for ever by gains that nobody sees."""
    design = paper(
        decay(), 1, n_candidates=20, max_iterations=5000, method=fp.ExchangeMethod("paper", patience=50, references=False)
    )
    assert design.stop_reason == "patience" and design.trace[-1].iteration < 1000
    assert design.points.dt[0] == pytest.approx(1.0, abs=2e-3)


@pytest.mark.parametrize("seed", range(3))
def test_points_are_moved_for_what_is_worth_it_only(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """However near the optimum a point is, candidates near it are better, by the square of less and less."""
    monkeypatch.setattr(ExchangeSearch, "_iterate", lambda _: False)  # no random candidates, which any gain lets in
    design = paper(
        decay(), 1, n_candidates=20, max_iterations=400, seed=seed, method=fp.ExchangeMethod("paper", references=False, local=1.0)
    )
    gains = [after.log_det - before.log_det for before, after in itertools.pairwise(design.trace) if after.exchanged]
    assert min(gains) > 1e-6
    assert design.points.dt[0] == pytest.approx(1.0, abs=2e-3)


@pytest.mark.parametrize(("points", "share", "each"), [(2, 0.5, 10), (2, 1.0, 20), (3, 0.5, 7), (40, 0.1, 1), (2, 0.0, None)])
def test_local_candidates_come_every_fourth_time_as_many_as_their_share(
    points: int, share: float, each: int | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    done, drawn, draw_near = [0], [], CandidateSource.draw_near

    def counted(source: CandidateSource, near: fp.Experiments, count: int) -> Any:
        drawn.append((done[-1] + 1, len(near), count))
        return draw_near(source, near, count)

    monkeypatch.setattr(CandidateSource, "draw_near", counted)
    paper(
        decay(),
        points,
        n_candidates=10,
        max_iterations=13,
        method=fp.ExchangeMethod("paper", references=False, local=share),
        progress=lambda progress: done.append(progress.step),
    )
    assert drawn == ([] if each is None else [(iteration, points, each) for iteration in (4, 8, 12)])


@pytest.mark.parametrize("seed", range(3))
def test_a_design_that_stays_singular_determines_what_it_can(seed: int) -> None:
    """c has no influence, so F is singular. Two points at u = 1 say most of a; one of them says all that can be said of b."""
    model = fp.SymbolicModel(
        [], ["a*u + b*v/100 + c*w"], {}, {"u": "1", "v": "1", "w": "1"}, {"a": "1", "b": "1", "c": "1"}, {"y": "1"}
    )
    prior = fp.GaussianPrior(mean=dict.fromkeys("abc", 1.0), std=dict.fromkeys("abc", 1.0))
    region = fp.ExperimentRegion({"u": (0, 1), "v": (0, 1), "w": (0, 0)}, constraints=["u + v < 1"])
    design = paper(
        fp.DesignProblem(model, prior, region, noise={"y": 1.0}),
        2,
        n_candidates=50,
        max_iterations=60,
        seed=seed,
        method=fp.ExchangeMethod("paper", references=False),
    )
    assert design.evaluation.rank == 2 and design.evaluation.log_det == -np.inf
    u, v = design.points.u[np.argsort(design.points.u[:, 0]), :2].T
    assert v[0] > 0.7 and u[1] > 0.7
