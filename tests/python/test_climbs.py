"""Points that climb at random come on where a limit bends, and stay where plants can run them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import fisherpoint as fp
from bench.algorithm_cases import example
from fisherpoint.design.approximate.ascents import ascend
from fisherpoint.design.points.random_climbs import Climbs
from fisherpoint.design.points.tuning import RegionClimbTuning
from fisherpoint.information.candidates import CandidateSource
from fisherpoint.information.point_information import PointInformation

BAND = fp.ExperimentRegion({"u": (0, 1), "v": (0, 1)}, constraints=["u**2 + v**2 < 1.002", "u**2 + v**2 > 0.998"])


def in_the_band() -> fp.DesignProblem:
    """Points between two circles, of which those at the edges of the square are far from the middle."""
    model = fp.SymbolicModel([], ["a*u + b*v"], {}, dict.fromkeys("uv", "1"), dict.fromkeys("ab", "1"), {"y": "1"})
    prior = fp.GaussianPrior(mean=dict.fromkeys("ab", 1.0), std=dict.fromkeys("ab", 0.1))
    return fp.DesignProblem(model, prior, BAND, noise={"y": 0.1})


def middle(u: np.ndarray) -> np.ndarray:
    """Of points (K, 2): 0 at the ends of the band, about 1 halfway."""
    return 2 * np.asarray(u[:, 0] * u[:, 1])


def height(points: PointInformation) -> np.ndarray:
    return middle(points.experiments.u)


def test_points_climb_along_a_limit_that_bends_where_ascents_end() -> None:
    given = in_the_band()
    start = fp.Experiments(np.empty((2, 0)), [[1.0, 0.02], [0.02, 1.0]])

    def valid(z: np.ndarray) -> np.ndarray:
        inside = BAND.satisfied(given.model, fp.Experiments(np.empty((len(z), 0)), z))
        return np.where(inside, middle(z), -np.inf)

    _, ascended = ascend(valid, start.u, 1e-5, 60)
    search = Climbs(given, np.random.default_rng(0), 1)
    once = search.run(height, start)
    assert BAND.satisfied(given.model, once).all()
    assert middle(once.u).max() > 0.99 > 2 * ascended.max()
    # What has climbed goes on the next time.
    assert middle(search.run(height, start).u).max() >= middle(once.u).max()


def test_points_that_climb_are_valid_on_all_nodes_and_no_lower_than_where_they_began() -> None:
    usual = RegionClimbTuning()
    tuning = replace(usual, edge_candidates=500, climb=replace(usual.climb, rounds=5))
    given = example("cylinder", "noise", "exclude")()

    def told(points: PointInformation) -> np.ndarray:
        return np.asarray(np.square(points.sensitivity).sum(axis=(1, 2)))

    source = CandidateSource(given, np.random.default_rng(1), 2)
    beside = source.draw_confirmed(5)
    reached = Climbs(given, np.random.default_rng(2), 2, tuning=tuning).run(told, beside.experiments)
    again = CandidateSource(given, np.random.default_rng(3), 2)
    valid = again.confirm(again.survivors(reached)[0])
    assert len(valid) == len(reached) > 5
    assert told(valid).max() > 2 * told(beside).max()
