"""Which points are valid on all nodes of a rule: what is remembered, and what few nodes tell."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.information.pilot_nodes import AT_FIRST, FEW, LEARNT, REMEMBERED
from fisherpoint.information.point_information import PointInformation, point_sensitivities, with_covariance
from fisherpoint.information.validity import Validity
from fisherpoint.points.status import Status
from fit_cases import EXAMPLES


@pytest.fixture(scope="module")
def problem() -> fp.DesignProblem:
    return fp.load_problem(EXAMPLES / "cylinder.toml")


def candidates(problem: fp.DesignProblem, count: int, seed: int) -> PointInformation:
    """Points that are valid at the prior mean; of this region half are not valid on all nodes."""
    assert isinstance(problem.region, fp.ExperimentRegion)
    points, status = point_sensitivities(problem, problem.region.draw(problem.model, count, seed=seed), None)
    return points[np.flatnonzero(status == 0)]


def test_few_nodes_tell_nearly_all_that_fail_and_hardly_any_other(problem: fp.DesignProblem) -> None:
    validity = Validity(problem, None)
    for seed in range(12):
        validity.tried(candidates(problem, 3 * LEARNT, seed))
    sieve = validity._sieve
    assert 0 < len(sieve._chosen) <= FEW
    new = candidates(problem, 2000, 7)
    told = sieve.statuses(new.experiments)
    information, status = with_covariance(problem, new, None)
    assert (status != 0).mean() > 0.05
    assert (told[status != 0] != 0).mean() > 0.8
    assert (told[status == 0] == 0).mean() > 0.99
    found, found_status = validity.tried(new)
    ok = (found_status == 0) & (status == 0)
    assert (found_status[status != 0] != 0).all() and ok.sum() > 0.99 * (status == 0).sum()
    np.testing.assert_array_equal(found.covariance[ok], information.covariance[ok])
    assert not found.covariance[found_status != 0].any()
    np.testing.assert_array_equal(found.sensitivity, new.sensitivity)


def test_what_was_tried_is_not_tried_again(problem: fp.DesignProblem, monkeypatch: pytest.MonkeyPatch) -> None:
    validity, given, count = Validity(problem, None), candidates(problem, 200, 1), 0
    _, status = validity.tried(given[:100])
    other = Validity(problem, None)
    other.tried(given[100:120])
    validity.include(other)
    statuses = Validity.statuses

    def counted(self: Validity, points: fp.Experiments) -> Any:
        nonlocal count
        count += len(points)
        return statuses(self, points)

    monkeypatch.setattr(Validity, "statuses", counted)
    valid = validity.of(given.experiments)
    assert count == len(given) - 120
    np.testing.assert_array_equal(valid[:100], status == 0)
    np.testing.assert_array_equal(valid, with_covariance(problem, given, None)[1] == 0)


@pytest.mark.parametrize("rule", [fp.TensorGrid(3), fp.LinearizedRule(), fp.Unscented()])
def test_rules_of_many_or_few_nodes_are_asked_as_they_are(problem: fp.DesignProblem, rule: fp.Rule) -> None:
    other = problem.replace(rule=rule)
    validity, given = Validity(other, None), candidates(other, 30, 2)
    found, status = validity.tried(given)
    information, expected = with_covariance(other, given, None)
    np.testing.assert_array_equal(status, expected)
    np.testing.assert_array_equal(found.covariance, information.covariance)
    assert validity._sieve._theta is None


def test_what_is_lost_is_sampled_as_late_as_the_nodes_allow(problem: fp.DesignProblem) -> None:
    validity, shortest = Validity(problem, None), 1e-3
    new = candidates(problem, 1000, 7).experiments
    cut, places, status = validity.cut_short(new, shortest)
    assert not len(cut) and not len(places) and not status.any()  # nothing is known of the nodes yet
    for seed in range(12):
        validity.tried(candidates(problem, 3 * LEARNT, seed))
    sieve = validity._sieve
    cut, places, status = validity.cut_short(new, shortest)
    np.testing.assert_array_equal(status, sieve.statuses(new))
    assert status.any() and set(places) <= set(np.flatnonzero(status)) and len(places) > 0.7 * (status != 0).sum()
    np.testing.assert_array_equal(cut.table[:, :-1], new.table[places, :-1])
    assert (sieve.statuses(cut) != 0).mean() < 0.003 and (cut.dt < new.dt[places]).all() and (cut.dt >= shortest).all()
    longer = np.minimum(cut.dt + 0.012 * (new.dt[places] - shortest), new.dt[places])
    assert (sieve.statuses(fp.Experiments(cut.x0, cut.u, longer)) != 0).mean() > 0.99


def test_roughly_only_the_nodes_that_tell_most_are_asked(problem: fp.DesignProblem, monkeypatch: pytest.MonkeyPatch) -> None:
    validity = Validity(problem, None)
    for seed in range(12):
        validity.tried(candidates(problem, 3 * LEARNT, seed))
    sieve, asked = validity._sieve, list[int]()
    assert len(sieve._chosen) > AT_FIRST
    new = candidates(problem, 1000, 7).experiments
    _, whole, by_all = validity.cut_short(new, 1e-3)
    on_nodes = sieve._on_nodes
    monkeypatch.setattr(sieve, "_on_nodes", lambda some, nodes: asked.extend(nodes.tolist()) or on_nodes(some, nodes))
    cut, places, by_few = validity.cut_short(new, 1e-3, roughly=True)
    assert asked == sieve._chosen[:AT_FIRST].tolist()
    assert not by_few[by_all == 0].any() and 0.5 < (by_few != 0).sum() / (by_all != 0).sum() < 1
    assert set(places) < set(whole) | set(np.flatnonzero(by_few)) and (cut.dt < new.dt[places]).all()


def test_nodes_on_which_nothing_fails_any_more_give_way(problem: fp.DesignProblem, monkeypatch: pytest.MonkeyPatch) -> None:
    assert isinstance(problem.region, fp.ExperimentRegion)
    sieve, points = Validity(problem, None)._sieve, problem.region.draw(problem.model, LEARNT + REMEMBERED, seed=1)
    early = {row.tobytes() for row in points.table[:LEARNT]}

    def on_nodes(some: fp.Experiments, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The first points fail below node 20, what comes later above it."""
        below = np.array([row.tobytes() in early for row in some.table])
        return np.where(below[:, None] == (nodes < 20), Status.left_domain, Status.ok), np.zeros((len(some), len(nodes)))

    monkeypatch.setattr(sieve, "_on_nodes", on_nodes)
    sieve.learn(points[: LEARNT - 1])
    assert not len(sieve._chosen)
    sieve.learn(points[LEARNT - 1 : LEARNT])
    assert len(sieve._chosen) and (sieve._chosen < 20).all()
    for k in range(LEARNT, len(points), LEARNT):
        sieve.learn(points[k : k + LEARNT])
    assert (sieve._chosen >= 20).all()


def test_what_the_mean_cannot_run_is_sampled_earlier(problem: fp.DesignProblem) -> None:
    """With nothing known of the nodes."""
    other, shortest = problem.replace(jumps="exclude"), 1e-3
    assert isinstance(other.region, fp.ExperimentRegion)
    given = other.region.draw(other.model, 1000, seed=3)
    cut, places, status = Validity(other, None).cut_short(given, shortest)
    _, expected = point_sensitivities(other, given, None)
    np.testing.assert_array_equal(status != 0, expected != 0)
    assert (expected[places] != 0).all() and len(places) > 0.5 * (expected != 0).sum()
    _, after = point_sensitivities(other, cut, None)
    assert (after != 0).mean() < 0.003
    longer = np.minimum(cut.dt + 0.012 * (given.dt[places] - shortest), given.dt[places])
    _, beyond = point_sensitivities(other, fp.Experiments(cut.x0, cut.u, longer), None)
    assert (beyond != 0).mean() > 0.99
    assert not len(Validity(other, None).cut_short(given[:0], shortest)[0])


def test_what_was_learnt_stays_learnt(problem: fp.DesignProblem, monkeypatch: pytest.MonkeyPatch) -> None:
    """What fails later has passed the nodes that were chosen before; nodes for it alone would let pass what failed first."""
    assert isinstance(problem.region, fp.ExperimentRegion)
    sieve, points = Validity(problem, None)._sieve, problem.region.draw(problem.model, 6 * LEARNT, seed=1)
    first, later = (np.flatnonzero((points.x0[:, 1] < 0) == side) for side in (True, False))

    def on_nodes(some: fp.Experiments, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Some fail on nodes up to 40, the others beyond."""
        status = np.where((some.x0[:, 1] < 0)[:, None] == (nodes <= 40), Status.left_domain, Status.ok)
        return status, np.zeros(status.shape)

    monkeypatch.setattr(sieve, "_on_nodes", on_nodes)
    sieve.learn(points[first[:LEARNT]])
    assert (sieve.statuses(points[first]) != 0).all() and not sieve.statuses(points[later]).any()
    sieve.learn(points[np.tile(later, 2)])
    assert (sieve.statuses(points) != 0).all()
