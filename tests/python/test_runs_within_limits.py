"""Designs of runs within limits: short strokes, shares of plants, references that do not beat them, and early ends."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from bench.strokes import arm, cart, rests, tanks
from fisherpoint.basics import work_clock
from fisherpoint.basics.work_clock import Clock, OutOfTime
from fisherpoint.design.file.configuration import load_config
from fisherpoint.design.runs import run_climb
from fisherpoint.design.runs.run_feasibility import RunGuard
from fisherpoint.design.runs.run_objective import RunObjective
from fisherpoint.design.runs.run_profiles import RETURNING
from fisherpoint.design.runs.run_rounding import tidied
from fisherpoint.design.runs.run_search import RunSearch
from fisherpoint.design.runs.run_tables import divided, runs_tables
from fisherpoint.show.section import Report, Section
from fit_cases import EXAMPLES

FEW: dict[str, Any] = {"n_starts": 1, "n_candidates": 40}


def unbeaten(design: fp.RunDesign) -> bool:
    """Whether no classical run says more and can be run by as many plants."""
    share, own = design.feasibility.share, design.log_det
    return not any(value > own and design.classical_shares[name] >= share for name, value in design.classical.items())


@pytest.mark.long
@pytest.mark.parametrize("stroke", [0.05, 0.5])
def test_a_cart_stays_within_a_short_stroke(stroke: float) -> None:
    design = fp.design_runs(cart(stroke, segments=16), **FEW)
    assert design.evaluation.rank == 2 and design.feasible and unbeaten(design)
    done = fp.simulate(design.problem.model, design.runs, design.problem.theta)
    assert np.abs(done.x[..., 0]).max() < stroke
    assert set(design.classical) == {"steps", "pulses", "binary sequences", "ramps", "sines and chirps"}
    if stroke == 0.05:
        assert design.rejected["left_domain: abs(x) < 0.05"] > 0


@pytest.mark.long
@pytest.mark.parametrize(("make", "n_runs"), [(lambda: arm(12), 1), (lambda: tanks(8), 1), (lambda: rests(6), 2)])
def test_limits_of_swings_levels_and_rests_are_kept(make: Callable[[], fp.DesignProblem], n_runs: int) -> None:
    design = fp.design_runs(make(), n_runs, **FEW)
    assert design.evaluation.rank == len(design.evaluation.parameters) and design.feasible and unbeaten(design)


def test_a_limit_that_no_run_keeps_is_named() -> None:
    problem = cart(0.5, segments=6).replace(along=["x > 1"])
    with pytest.raises(ValueError, match=r"none of \d+ drawn \(\d+ left_domain: x > 1 at the start\).*or widen the limits"):
        fp.design_runs(problem, **FEW)


@pytest.mark.long
def test_runs_that_must_go_on_begin_with_the_longest() -> None:
    """No held input keeps both limits: the cart has to be back when the second begins to count."""
    model = fp.SymbolicModel(
        f=["v", "b*u - c*v", "1"], g=["x"], states={"x": "m", "v": "m/s", "s": "s"}, inputs={"u": "1"}, outputs={"y": "m"},
        parameters={"b": "1", "c": "1"},
    )  # fmt: skip
    region = fp.RunRegion({"x": 0.0, "v": 0.0, "s": 0.0, "u": (-1, 1), "dt": 0.5}, 12)
    prior = fp.GaussianPrior({"b": 2.0, "c": 1.0}, relative_std={"b": 0.05, "c": 0.05})
    limits = ["x > 0.3*s - 0.5 - 0.6*max(s - 3, 0)", "x < 0.3*s + 0.5 - 0.6*max(s - 3, 0)"]
    design = fp.design_runs(fp.DesignProblem(model, prior, region, noise={"y": 0.01}, along=limits), **FEW)
    assert design.evaluation.rank == 2 and design.feasible


def test_profiles_that_return_are_balanced() -> None:
    rng = np.random.default_rng(0)
    for profile in RETURNING:
        for n in (2, 4, 16, 48):
            means = [profile(rng, n).mean() for _ in range(50)]
            assert np.allclose(means, 0.5)


@pytest.mark.long
def test_the_share_that_is_asked_decides() -> None:
    problem = cart(1.0, segments=8)
    designs = [fp.design_runs(problem, goal=fp.Goal(confidence=share), n_starts=2, n_candidates=60) for share in (0.5, 0.9, 0.99)]
    shares, values = [design.feasibility.share for design in designs], [design.log_det for design in designs]
    assert all(design.feasible for design in designs)
    assert values[0] > values[1] > values[2] and shares[0] < shares[1] < shares[2]
    assert shares[0] < 0.7 and shares[1] < 0.97


@pytest.mark.long
def test_information_counts_where_too_few_plants_can_run_anything() -> None:
    """Starts deviate so far that a run at rest is left by some plants too: it says nothing, and is no design."""
    design = fp.design_runs(cart(0.5, segments=8).replace(initial_state_std={"x": 0.25}), **FEW)
    assert not design.feasible and design.evaluation.rank == 2
    assert "Only" in str(design)


@pytest.mark.long
def test_threads_do_not_change_a_bit_of_it() -> None:
    problem = cart(0.2, segments=8)
    one, three = (fp.design_runs(problem, threads=threads, seed=2, **FEW) for threads in (1, 3))
    assert one.runs == three.runs and one.log_det == three.log_det and one.classical == three.classical


def test_ctrl_c_before_the_first_start_returns_the_best_of_the_pool(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(RunSearch, "_begin", interrupt)
        design = fp.design_runs(cart(0.5, segments=8), **FEW)
    assert design.stop_reason == "interrupted" and design.ends == () and design.evaluation.rank == 2
    assert "ended early (interrupted)" in str(design)
    calls, judged = [0], RunObjective.judged

    def second(self: RunObjective, runs: fp.Runs) -> Any:
        calls[0] += 1
        if calls[0] == 2:
            raise KeyboardInterrupt
        return judged(self, runs)

    monkeypatch.setattr(RunObjective, "judged", second)
    design = fp.design_runs(cart(2.0, segments=8), **FEW)
    assert design.stop_reason == "interrupted" and 0 < design.drawn < 40


class Seconds:
    """A clock that goes on by some seconds whenever it is looked at."""

    def __init__(self, each: float) -> None:
        self.now, self.each = 0.0, each

    def perf_counter(self) -> float:
        self.now += self.each
        return self.now


@pytest.mark.parametrize("each", [0.02, 0.2, 100.0])
def test_everything_looks_at_the_time(monkeypatch: pytest.MonkeyPatch, each: float) -> None:
    seconds = Seconds(each)
    monkeypatch.setattr(work_clock, "time", seconds)
    design = fp.design_runs(cart(0.5, segments=8), n_candidates=200, time_limit=20.0, n_starts=50)
    assert design.stop_reason == "time_limit" and len(design.runs) == 1
    if each < 1:
        assert seconds.now < 22.0 + 5 * each  # some looks follow the limit
        assert design.feasibility.draws >= 50
    assert design.feasibility.draws > 0


@pytest.mark.parametrize("end", [OutOfTime, KeyboardInterrupt])
def test_what_an_ascent_has_come_to_is_not_lost(monkeypatch: pytest.MonkeyPatch, end: type[BaseException]) -> None:
    """The search ends before plants are tried with it."""
    tried = RunSearch._tried

    def until_the_first_ascent(self: RunSearch, *of: Any) -> Any:
        if any(one.untried for one in self._climbs) and not self.clock.paused:
            raise end
        return tried(self, *of)

    problem, few = arm(12), {"goal": fp.Goal(confidence=0.5), "n_starts": 2, "n_candidates": 40, "time_limit": 1000.0}
    monkeypatch.setattr(RunSearch, "_tried", until_the_first_ascent)
    kept = fp.design_runs(problem, **few)
    assert kept.stop_reason == ("time_limit" if end is OutOfTime else "interrupted") and kept.ends == ()
    monkeypatch.setattr(RunSearch, "_try_last", lambda self: None)
    assert kept.log_det > fp.design_runs(problem, **few).log_det + 0.1


@pytest.mark.long
def test_fewer_starts_are_followed_where_time_is_short(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = cart(0.5, segments=8)
    monkeypatch.setattr(Clock, "affordable", lambda self, kind, share: 400.0)
    design = fp.design_runs(problem, n_starts=6, n_candidates=40, time_limit=1000.0)
    assert 0 < len(design.ends) < 6 and design.evaluation.rank == 2 and design.feasible and unbeaten(design)


def test_the_distance_from_limits_follows_the_first_look_where_time_is_short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where there are few ascents, none leads nearer to limits that too few plants have kept."""
    distances, shares = list[float](), list[float]()
    ascend, judged = run_climb.ascend, RunSearch._judged

    def from_here(objective: RunObjective, *of: Any) -> Any:
        distances.append(objective.kappa)
        return ascend(objective, *of)

    def looked(self: RunSearch, *of: Any) -> Any:
        found = judged(self, *of)
        if len(distances) > len(shares):
            shares.append(found.share)
        return found

    monkeypatch.setattr(run_climb, "ascend", from_here)
    monkeypatch.setattr(RunSearch, "_judged", looked)
    monkeypatch.setattr(RunSearch, "_raced", property(lambda self: 1))
    monkeypatch.setattr(RunGuard, "share", lambda self, runs: 0.95 if len(distances) < 3 else 1.0)
    design = fp.design_runs(arm(12), n_starts=2, n_candidates=40)
    assert shares[:3] == [0.95, 0.95, 1.0]
    assert distances[0] < distances[1] < distances[2]
    assert len(design.runs) == 1


@pytest.mark.long
def test_a_search_without_a_limit_looks_at_no_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = cart(0.5, segments=8)
    slow = fp.design_runs(problem, **FEW)
    monkeypatch.setattr(work_clock, "time", Seconds(1000.0))
    assert fp.design_runs(problem, **FEW).runs == slow.runs


def test_no_example_needs_a_limit_of_time() -> None:
    for path in sorted(Path(EXAMPLES).glob("*.toml")):
        config = load_config(path)
        if config.design is None:
            continue
        settings = config.exchange_settings() if config.runs is None else config.run_settings()
        assert settings.get("time_limit") is None, path.name


@pytest.mark.long
def test_inputs_are_round_and_few() -> None:
    design = fp.design_runs(cart(2.0, segments=10), n_starts=2, n_candidates=60)
    assert np.array_equal(np.round(design.runs.u, 3), design.runs.u)
    assert design.log_det == pytest.approx(np.linalg.slogdet(design.evaluation.information)[1], abs=1e-4)
    assert max(design.ends) - 1e-3 <= design.log_det + 1e-9


def test_rounding_keeps_what_the_region_says() -> None:
    problem = cart(0.5, segments=6)
    region = fp.RunRegion({"x": (0.0, 0.3), "v": 0.0, "u": (-1, 1), "dt": (0.1, 0.7)}, 6, slew={"u": 0.1}, duration=1.5)
    rng = np.random.default_rng(0)
    u = np.cumsum(rng.uniform(-0.1, 0.1, (1, 6, 1)), axis=1)
    runs = fp.Runs([[0.1234567, 0.0]], u, np.full((1, 6), 0.24999))

    def worth(designs: list[fp.Runs]) -> Any:
        return np.array([-np.abs(one.u - u).sum() for one in designs])

    tidy = tidied(runs, region, problem.model, worth, lambda _: True, -0.2)
    assert (np.abs(np.diff(tidy.u, axis=1)) <= 0.1 + 1e-12).all() and tidy.dt.sum() <= 1.5 + 1e-12
    assert worth([tidy])[0] >= -0.2 and len(np.unique(tidy.u)) < 6
    assert len(f"{tidy.x0[0, 0]:.12g}") <= 6
    same = tidied(runs, region, problem.model, worth, lambda _: False, -0.2)
    assert same == runs


@pytest.mark.long
def test_holds_of_inputs_name_their_segments() -> None:
    problem = fp.load_problem(EXAMPLES / "cylinder_runs.toml")
    assert isinstance(problem.region, fp.RunRegion)
    problem = problem.replace(region=fp.RunRegion(problem.region.bounds, 6))
    design = fp.design_runs(problem, goal=fp.Goal(confidence=0.0), **FEW)
    (held,) = (section for section in design.report().sections if section.title == "Inputs that are held")
    assert held.rows[0][1].startswith("1") and sum(int(row[-1]) for row in held.rows) == 6
    widths = [len(line) for section in design.report().sections if section.columns for line in lines_of(section)]
    assert max(widths) <= 80


def lines_of(section: Section) -> list[str]:
    """The table of a section with its title, without its notes."""
    return str(Report("", [replace(section, notes=())])).splitlines()


def test_tables_of_runs_fit_into_a_line() -> None:
    """Seven inputs and twelve states with long names and units, values of any size."""
    inputs = {f"flow_of_the_cooling_water_{i}": "kg m/(m2 s3)" for i in range(7)}
    states = {f"pressure_in_the_chamber_{i}": "N/m2" for i in range(12)}
    model = fp.SymbolicModel(
        f=[f"gain*({'+'.join(inputs)}) - rate*{name}" for name in states], g=["pressure_in_the_chamber_0"], states=states,
        inputs=inputs, outputs={"y": "N/m2"}, parameters={"gain": "1", "rate": "1/s"},
    )  # fmt: skip
    rng = np.random.default_rng(0)
    signed = (rng.standard_normal(shape) * 10.0 ** rng.uniform(-15, 15, shape) for shape in ((3, 12), (3, 30, 7)))
    runs = fp.Runs(*signed, rng.random((3, 30)) * 1e5)
    sections = list(runs_tables(model, runs, 1))
    assert max(len(line) for section in sections for line in lines_of(section)) <= 80
    held = [section for section in sections if section.title.startswith("Inputs that are held")]
    assert len(held) > 3 and all(tuple(section.columns[:2]) == ("run", "segments") for section in held)
    shown = [name for section in sections for name in section.columns]
    assert all(sum(one.startswith(name) for one in shown) == 2 for name in inputs)
    assert all(sum(one.startswith(f"{name} ") for one in shown) == 1 for name in states)


def test_a_wide_table_is_divided() -> None:
    wide = Section("Wide", ["run", *(f"quantity_{i} [m]" for i in range(9))], [[str(i) for i in range(10)]], notes=["a note"])
    parts = list(divided(wide))
    assert len(parts) > 1 and parts[1].title == "Wide, continued" and parts[-1].notes == ["a note"] and parts[0].notes == ()
    assert [name for part in parts for name in part.columns[1:]] == list(wide.columns[1:])
