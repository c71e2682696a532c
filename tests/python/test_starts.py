"""Several starts, candidates in blocks, and many plants: the best of all, the same from whoever computes them."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from engines import backwards
from fisherpoint.design.approximate import blocks as of_blocks
from fisherpoint.design.approximate.blocks import Blocks, blocks_of, drawn
from fisherpoint.design.approximate.tuning import BlockTuning
from fisherpoint.design.candidates.candidate_rows import CandidateRows
from fisherpoint.design.candidates.point_rows import PointRows
from fisherpoint.design.goal.estimable_space import estimable
from fisherpoint.design.goal.goal import Goal
from fisherpoint.design.goal.goal_criterion import criterion_of
from fisherpoint.design.results.settings import RunSettings, seeds_of
from fisherpoint.design.weights.weights import optimal_weights
from fisherpoint.engine.workers import distributed_over
from tests.bits.digest import parts as digests

MODEL = fp.SymbolicModel(
    [], ["a*exp(-b*u)"], {}, {"u": "1"}, {"a": "1", "b": "1"}, {"y": "1"}, nominal={"a": 1.0, "b": 1.0}, name="decay"
)
PRIOR = fp.GaussianPrior({"a": 1.0, "b": 1.0}, relative_std={"a": 0.3, "b": 0.4}, log=["a", "b"])
PROBLEM = fp.DesignProblem(MODEL, PRIOR, fp.ExperimentRegion({"u": (0.0, 3.0)}), noise={"y": 0.1})
SMALL: dict[str, Any] = {"n_candidates": 3, "max_iterations": 6}


def started(starts: int, seed: int = 4, workers: Any = None) -> fp.Design:
    return fp.exchange(PROBLEM, 4, method=fp.ExchangeMethod("paper", starts=starts), seed=seed, workers=workers, **SMALL)


def test_the_best_start_counts_and_each_is_a_search_of_its_own() -> None:
    found, seeds = started(4), seeds_of(4, 4)
    assert seeds[0] == 4 and list(seeds_of(4, 6)[:4]) == list(seeds) and len(set(seeds)) == 4
    alone = [started(1, seed) for seed in seeds]
    values = [one.trace[-1].log_det for one in alone]
    assert found.ends == tuple(values)
    best = alone[int(np.argmax(values))]
    assert found.points == best.points and found.settings.seed == 4
    assert found.drawn == sum(one.drawn for one in alone) and found.accepted == sum(one.accepted for one in alone)
    assert found.efficiency is not None and best.efficiency is not None
    assert found.efficiency.n_candidates > best.efficiency.n_candidates  # those of all starts bound it
    assert found.again == sum(value >= max(values) - 6e-4 for value in values)
    assert f"as good in {found.again} of 4" in str(found)
    assert "as good in" not in str(alone[0])


def test_workers_do_not_change_what_starts_find() -> None:
    here = dict(digests(started(3)))
    with backwards() as executor:
        there = dict(digests(started(3, workers=executor)))
    trace = {place for place in here if ".trace" in place and place.endswith("seconds")}
    assert {**there, **dict.fromkeys(trace)} == {**here, **dict.fromkeys(trace)}


def test_starts_that_are_interrupted_leave_the_best_of_those_that_ended() -> None:
    def stop(now: fp.Progress) -> None:
        if now.step == 2:
            raise KeyboardInterrupt

    method = fp.ExchangeMethod("paper", starts=4)
    with ThreadPoolExecutor(2) as executor:
        found = fp.exchange(PROBLEM, 4, method=method, seed=4, workers=executor, progress=stop, **SMALL)
    assert found.stop_reason == "interrupted" and found.ends == started(4).ends[:2]


def test_a_saved_design_keeps_what_its_starts_came_to(tmp_path: Path) -> None:
    found = started(3)
    found.save(tmp_path)
    again = fp.Design.load(tmp_path)
    assert (again.ends, again.again, again.settings) == (found.ends, found.again, found.settings)


def test_each_size_of_a_sweep_has_its_starts() -> None:
    method = fp.ExchangeMethod(starts=2)
    one, other = (fp.sweep(PROBLEM, [3, 4], method=kind, **SMALL) for kind in (fp.ExchangeMethod(), method))
    assert all(other[size].log_det >= one[3].log_det for size in (3, 4)) and other[3].log_det >= one[3].log_det
    with ThreadPoolExecutor(2) as executor:
        there = fp.sweep(PROBLEM, [3, 4], method=method, workers=executor, **SMALL)
    assert [dict(digests(there[size])) for size in (3, 4)] == [dict(digests(other[size])) for size in (3, 4)]


def test_many_starts_of_runs_are_several_searches(monkeypatch: pytest.MonkeyPatch) -> None:
    tank = fp.SymbolicModel(
        ["q*u - k*h"], ["h"], {"h": ("m", 1.0)}, {"u": "1"}, {"q": "m/s", "k": "1/s"}, nominal={"q": 1.0, "k": 1.0}, name="tank"
    )
    prior = fp.GaussianPrior(tank.nominal, relative_std={"q": 0.1, "k": 0.1})
    region = fp.RunRegion({"h": 0.5, "u": (0.0, 1.0), "dt": 0.5}, segments=4)
    problem = fp.DesignProblem(tank, prior, region, noise={"y": 0.01})
    monkeypatch.setattr(RunSettings, "RACING", 2)
    here = fp.design_runs(problem, n_starts=3, n_candidates=10)
    assert len(here.ends) == 3 and here.log_det >= max(here.ends) - 1e-3
    with ThreadPoolExecutor(2) as executor:
        there = fp.design_runs(problem, n_starts=3, n_candidates=10, workers=executor)
    assert dict(digests(there)) == dict(digests(here))


# --- Candidates in blocks ----------------------------------------------------------------------------------------------


def test_blocks_have_the_weights_of_all_their_candidates_in_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(of_blocks, "BlockTuning", lambda: BlockTuning(candidates=100, kept=40, least_kept=5))
    count, criterion = 2050, criterion_of(PROBLEM, Goal())
    sizes = [block.size for block in blocks_of(7, count)]
    assert sum(sizes) == count - 100 and set(sizes) == {100, 50}
    first = drawn(PROBLEM, 100, np.random.default_rng(7))
    everything = [first, *(drawn(PROBLEM, one.size, np.random.default_rng([7, one.number])) for one in blocks_of(7, count))]
    source = PointRows(PROBLEM, 1)
    pools = []
    for points in (first, fp.Experiments.join(everything)):
        rows, places = source.valid(points)
        pools.append((points[places], CandidateRows(rows)))
    (points, pool), (_, whole) = pools
    space = estimable(pool.triangle())
    weights = [optimal_weights(one, criterion, tolerance=1e-9, space=space) for _, one in pools]
    assert weights[0].log_phi < weights[1].log_phi - 1e-7  # the first block alone is not enough
    solved = []
    for engine in (None, 1):
        with ThreadPoolExecutor(2) as executor, distributed_over(executor if engine else None, 1) as distributor:
            blocks = Blocks(source, (), 7, count, None, distributor, lambda *_: None)
            solved.append(blocks.solved(points, pool, weights[0], criterion, space, 1e-9))
            assert blocks.tried == count - 100 and len(solved[-1][1]) < 400
    for _, _, found in solved:
        assert found.log_phi == pytest.approx(weights[1].log_phi, abs=2e-9)
        assert CandidateRows(whole.rows).along(found.half).max() <= 1 + 2e-9
    assert solved[0][2].weights.tobytes() == solved[1][2].weights.tobytes()


# --- Many plants -------------------------------------------------------------------------------------------------------

PLANTS = {name: PROBLEM for name in ("A", "B", "C")}
RIGS = {name: fp.VirtualRig(MODEL, {"a": 1.0 + 0.1 * k, "b": 1.1}, {"y": 0.1}, seed=k) for k, name in enumerate(PLANTS)}
OPTIONS: dict[str, Any] = {"batch": 3, "targets": 0.2, "batches": 3, **SMALL, "method": "paper"}


def table(found: Any) -> list[Any]:
    return list(found.to_pandas().reset_index().itertuples(index=False))


def test_campaigns_of_many_plants_are_those_of_each_and_go_on_where_they_were(tmp_path: Path) -> None:
    whole = fp.campaigns(PLANTS, tmp_path / "whole", rigs=RIGS, **OPTIONS)
    assert list(whole.plants) == ["A", "B", "C"] and not whole.failed and whole.stop_reason == "completed"
    for name, plant in whole.plants.items():
        campaign = fp.Campaign.load(tmp_path / "whole" / name)
        assert campaign.standard_errors == plant.state.standard_errors and (plant.done or len(campaign.history) == 3)
    with ThreadPoolExecutor(2) as executor:
        fp.campaigns(PLANTS, tmp_path / "parts", rigs=RIGS, workers=executor, **OPTIONS | {"batches": 1})
        parts = fp.campaigns(PLANTS, tmp_path / "parts", rigs=RIGS, workers=executor, **OPTIONS)
    assert table(parts) == table(whole) and str(parts) == str(whole)
    written = [(tmp_path / place / "plants.csv").read_text() for place in ("whole", "parts")]
    assert written[0] == written[1] and written[0].startswith("plant,parameter,batches,estimate")


def test_measured_data_of_plants_are_added_once_and_the_next_batch_is_designed(tmp_path: Path) -> None:
    begun = fp.campaigns(PLANTS, tmp_path, **OPTIONS)
    planned = begun.plants["B"].state.planned
    assert planned is not None and all(plant.words == "to be measured" for plant in begun.plants.values())
    data = {"B": RIGS["B"].measure(planned)}
    for _ in range(2):
        found = fp.campaigns(PLANTS, tmp_path, data=data, **OPTIONS)
        assert [len(plant.state.batches) for plant in found.plants.values()] == [0, 1, 0]


def test_a_plant_that_fails_does_not_end_the_others(tmp_path: Path) -> None:
    fp.campaigns({"A": PROBLEM}, tmp_path, **OPTIONS)
    changed = PROBLEM.replace(noise={"y": 0.2})
    found = fp.campaigns({"A": changed, "B": PROBLEM}, tmp_path, **OPTIONS)
    assert list(found.plants) == ["B"] and "expected that of the campaign in" in found.failed["A"]
    assert "A: problems['A']" in str(found)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"problems": {}}, "problems: expected at least one plant"),
        ({"problems": {"a/b": PROBLEM}}, "problems: expected names that directories may have"),
        ({"problems": {"a": MODEL}}, r"problems\['a'\]: expected"),
        ({"rigs": {"Z": RIGS["A"]}}, "rigs: expected names of problems, given 'Z'"),
        ({"data": {"A": 3}}, r"data\['A'\]: expected"),
        ({"batches": 0}, "batches: expected"),
        ({"sead": 1}, "sead|settings"),
        ({"targets": 3.0}, "targets"),
    ],
)
def test_misuse_is_named(given: dict[str, Any], message: str, tmp_path: Path) -> None:
    with pytest.raises((TypeError, ValueError), match=message):
        fp.campaigns(**{"problems": PLANTS, "directory": tmp_path, **given})
