"""Which points are valid on all nodes of a rule: what is remembered, and what few nodes tell."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.information.node_sieve import FEW, LEARNT
from fisherpoint.information.point_information import PointInformation, point_sensitivities, with_covariance
from fisherpoint.information.validity import Validity
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
    tried = Validity.tried

    def counted(self: Validity, points: PointInformation) -> Any:
        nonlocal count
        count += len(points)
        return tried(self, points)

    monkeypatch.setattr(Validity, "tried", counted)
    valid = validity.of(given)
    assert count == len(given) - 120
    np.testing.assert_array_equal(valid[:100], status == 0)
    np.testing.assert_array_equal(valid, with_covariance(problem, given, None)[1] == 0)


@pytest.mark.parametrize("rule", [fp.TensorGrid(3), fp.Linearized(), fp.Unscented()])
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
    assert not sieve.statuses(cut).any() and (cut.dt < new.dt[places]).all() and (cut.dt >= shortest).all()
    # A third less cut off is too little, but for what is lost by less than can be told.
    less = new.dt[places] - (new.dt[places] - cut.dt) / 1.4
    assert (sieve.statuses(fp.Experiments(cut.x0, cut.u, less)) != 0).mean() > 0.95
