"""The race of starts, and the single changes that they make."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from bench.strokes import cart, rests
from fisherpoint.basics.work_clock import Clock
from fisherpoint.design.goal.scenario_average import Average
from fisherpoint.design.runs.run_moves import moved_runs
from fisherpoint.design.runs.run_objective import RunObjective
from fisherpoint.design.runs.run_profiles import draw_runs
from fisherpoint.design.runs.run_race import race
from fisherpoint.design.runs.tuning import RunSearchTuning
from fisherpoint.points.run_coordinates import RunCoordinates


class Runner:
    """Takes `each` segments for a step, by which it gains less and less, up to a `height`; it ends after so many steps."""

    def __init__(self, objective: Any, height: float, each: int, steps: int) -> None:
        self.objective, self.height, self.each, self.left = objective, height, each, steps
        self.done, self.ended = 0, False
        self.last: Runner | None = None

    @property
    def worth(self) -> tuple[bool, float]:
        return True, self.height * (1 - 0.5**self.done)

    def step(self) -> None:
        assert not self.ended
        self.objective.work += self.each
        self.done, self.last, self.ended = self.done + 1, self, self.done + 1 == self.left


def raced(heights: list[float], each: int, steps: int) -> tuple[list[Any], int]:
    objective = SimpleNamespace(work=0, clock=Clock(None), tuning=RunSearchTuning())
    runners: list[Any] = [Runner(objective, height, each, steps) for height in heights]
    race(objective, runners, lambda one: None)  # type: ignore[arg-type]
    return runners, objective.work


def test_where_there_is_little_to_do_all_starts_end() -> None:
    runners, _ = raced([1.0, 2.0, 3.0, 4.0], each=100, steps=7)
    assert all(one.ended and one.done == 7 for one in runners)


def test_the_best_third_goes_on_with_as_much_work() -> None:
    rung, survivors = RunSearchTuning().rung_segments, RunSearchTuning().rung_survivors
    heights = [3.0, 9.0, 1.0, 8.0, 2.0, 4.0, 7.0, 5.0, 6.0]
    runners, work = raced(heights, each=rung // 90, steps=1000)
    steps = {height: one.done for height, one in zip(heights, runners, strict=True)}
    assert {height for height in heights if steps[height] > steps[1.0]} == {7.0, 8.0, 9.0}
    assert steps[9.0] > steps[8.0] == steps[7.0] and len(set(steps.values())) == 3
    rungs = 1 + np.ceil(np.log(len(heights)) / np.log(survivors))
    assert work <= rungs * rung * 1.1


def test_a_start_makes_a_step_whatever_that_takes() -> None:
    runners, _ = raced([1.0, 2.0, 3.0], each=2 * RunSearchTuning().rung_segments, steps=5)
    assert [one.done for one in runners][:2] == [1, 1] and runners[2].done == 2


def objective_of(problem: fp.DesignProblem) -> RunObjective:
    region = problem.region
    assert isinstance(region, fp.RunRegion)
    p = problem.n_unknowns
    theta, there = problem.theta[None], np.zeros((1, p, p))
    coordinates = RunCoordinates(region, problem.model)
    return RunObjective(problem, coordinates, theta, Average.of_all(1), there, [], problem.integration(2))


@pytest.mark.parametrize("make", [lambda: cart(2.0, segments=8), lambda: rests(6)])
@pytest.mark.parametrize("kappa", [0.0, 2.0])
def test_changed_runs_are_worth_the_same_from_where_they_differ(make: Any, kappa: float) -> None:
    objective = objective_of(make())
    objective.kappa = kappa
    z = draw_runs(objective.coordinates, 40, np.random.default_rng(0))
    z = z[objective.lasted(z).ok][0]
    base = objective.tangents(objective.tried(z[None], None).runs, outputs_alone=False)
    runs = objective.tried(moved_runs(objective.coordinates, z, np.random.default_rng(1)), None)
    whole, beside = objective.judged(runs), objective.judged_beside(base, runs)
    assert whole.ok.any() and np.array_equal(whole.ok, beside.ok)
    assert np.allclose(whole.matrices, beside.matrices, rtol=1e-5, atol=1e-6 * np.abs(whole.matrices).max())
    assert np.allclose(whole.costs, beside.costs, rtol=1e-4, atol=1e-6)


def test_a_hold_can_take_the_value_beside_it() -> None:
    region = fp.RunRegion({"x": 0.0, "v": 0.0, "u": (-1, 1), "dt": 0.5}, 6)
    coordinates = RunCoordinates(region, cart(1.0).model)
    (_, where), z = coordinates.inputs[0], np.zeros(len(coordinates))
    z[where] = [0.123, 0.123, 0.456, 0.456, 0.789, 0.789]
    moved = moved_runs(coordinates, z, np.random.default_rng(0))[:, where]
    for hold in ([0.456, 0.456, 0.456, 0.456, 0.789, 0.789], [0.123, 0.123, 0.456, 0.456, 0.456, 0.456]):
        assert (moved == hold).all(axis=1).any()
