"""Limits of time: blocks whose size follows from what they cost, and searches that end in time whatever a candidate costs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from bench.strokes import cart
from defaults import problem, same_bits
from fisherpoint.basics import work_clock
from fisherpoint.basics.work_clock import BLOCK_SECONDS, BLOCK_SHARE, LANES, Clock, OutOfTime
from fisherpoint.information.validity import Validity


class Seconds:
    """A clock that stands still but for what is added."""

    def __init__(self) -> None:
        self.now = 0.0

    def perf_counter(self) -> float:
        return self.now


@pytest.fixture
def seconds(monkeypatch: pytest.MonkeyPatch) -> Seconds:
    """What the time is for every clock of a work."""
    found = Seconds()
    monkeypatch.setattr(work_clock, "time", found)
    return found


def test_everything_is_one_block_where_nobody_waits(seconds: Seconds) -> None:
    assert list(Clock().blocks("any", 1000)) == [slice(0, 1000)] and list(Clock().blocks("any", 0)) == [slice(0, 0)]


@pytest.mark.parametrize("cost", [1e-6, 1e-3, 0.1, 30.0])
def test_blocks_are_a_small_share_of_the_limit_or_a_pack(seconds: Seconds, cost: float) -> None:
    limit, clock = 100.0, Clock(100.0)
    sizes = []
    try:
        for some in clock.blocks("any", 100_000):
            sizes.append(some.stop - some.start)
            seconds.now += cost * sizes[-1]
    except OutOfTime:
        assert seconds.now > limit - max(BLOCK_SHARE * limit, LANES * cost) - 1e-9
    assert sizes[0] == LANES  # nothing is known yet
    most = max(LANES, min(BLOCK_SECONDS, BLOCK_SHARE * limit) / cost)
    assert max(sizes) <= most and (sum(sizes) == 100_000 or clock.seconds + cost * sizes[-1] > limit)
    assert seconds.now <= max(limit, LANES * cost)


def test_a_part_ends_and_what_follows_goes_on(seconds: Seconds) -> None:
    clock, done = Clock(10.0), 0
    with clock.part(0.3):
        for some in clock.blocks("any", 10_000):
            done += some.stop - some.start
            seconds.now += 0.01 * (some.stop - some.start)
    assert 0 < done < 10_000 and 2.0 < clock.seconds <= 3.0 and not clock.late()
    with pytest.raises(OutOfTime), clock.part(0.5):
        seconds.now = 11.0
        clock.check()
    with clock.pause():
        clock.check()
    clock.reserve = 1000.0  # no more than a share of the limit is kept
    seconds.now = 6.9
    assert not clock.late() and clock.late(ahead=0.2)


def test_a_work_reports_that_it_goes_on(seconds: Seconds) -> None:
    clock, beats = Clock(), list[float]()
    clock.beat = lambda: beats.append(seconds.now)
    for some in clock.blocks("any", 2000):
        seconds.now += 0.01 * (some.stop - some.start)
    assert beats and beats[0] <= 2.0 and max(np.diff(beats)) <= 2.0


def test_a_long_limit_changes_nothing() -> None:
    quick: dict[str, Any] = dict(n_candidates=4, max_iterations=40)
    given = problem(output_covariance="noise")
    free = fp.exchange(given, 9, **quick)
    limited = fp.exchange(given, 9, **quick, time_limit=1000.0)
    followed = fp.exchange(given, 9, **quick, progress=lambda _: None)
    for other in (limited, followed):
        assert same_bits(other.points.table, free.points.table) and other.left_out == ()
        assert other.evaluation.log_det == free.evaluation.log_det and other.efficiency == free.efficiency


def test_what_a_limit_leaves_out_is_named() -> None:
    given = problem(output_covariance="noise")
    found = fp.exchange(given, 9, time_limit=1e-6)
    assert found.stop_reason == "time_limit" and "standard errors away from the prior mean" in found.left_out
    assert np.isfinite(found.evaluation.log_det) and found.evaluation.nearby is None
    assert "left out for lack of time" in str(found.report())
    again = fp.evaluate(given, found.points)
    assert again.log_det == pytest.approx(found.evaluation.log_det, rel=1e-12)  # what it claims was computed


def test_plants_stand_for_the_nodes_where_these_take_too_long(seconds: Seconds) -> None:
    given = problem(output_covariance="noise", rule=fp.SparseGaussHermite(2))
    points = given.point_region.draw(given.model, 20, seed=0)
    free = Validity(given, 1, False)
    assert free.plants is None and Validity(given, 1, False, Clock(1000.0), 200).plants is None
    limited = Validity(given, 1, False, Clock(1000.0), 200)
    limited._clock.measured("nodes", 1000, 40.0)
    status = limited.statuses(points)
    assert limited.plants is not None and LANES <= limited.plants < given.rule.size(given.prior)
    assert status.shape == (20,) and (status == free.statuses(points)).mean() > 0.5


def test_what_a_limit_leaves_out_of_runs_is_named() -> None:
    given = cart(0.5, segments=8)
    found = fp.design_runs(given, n_candidates=40, n_starts=2, time_limit=1e-6)
    assert found.stop_reason == "time_limit" and "classical runs to compare with" in found.left_out
    assert ("standard errors away from the prior mean" in found.left_out) == (found.evaluation.nearby is None)
    (line,) = (line for line in str(found.report()).splitlines() if "left out for lack of time" in line)
    assert line.endswith(f"  {'; '.join(found.left_out)}")
    free = fp.design_runs(given, n_candidates=40, n_starts=2)
    assert free.left_out == () and free.classical and "lack of time" not in str(free.report())
