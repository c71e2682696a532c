"""Campaigns of problems with local parameters: a load for each run, day or plant, from batch to batch."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.campaign.local import as_previous
from local_cases import NOISE, START, cart

PRIOR = fp.GaussianPrior(mean=START, std={"d": 0.3, "c": 0.1, "m_load": 1.0})
REGION = fp.RunRegion({"v": 0.0, "F": (1, 6), "dt": 0.2}, segments=6)
QUICK: dict[str, Any] = {"batch": 2, "targets": 0.05, "n_starts": 1, "n_candidates": 8, "threads": 1}


def problem(by: str | fp.Local, region: fp.RunRegion | fp.ExperimentRegion = REGION, **options: Any) -> fp.DesignProblem:
    return fp.DesignProblem(cart(), PRIOR, region, noise={"y": NOISE}, local={"m_load": by}, **options)


def measured(points: Any, loads: Any, seed: int, **labels: Any) -> fp.Measurements:
    theta = np.column_stack([np.full(len(points), 1.5), np.full(len(points), 0.6), np.broadcast_to(loads, len(points))])
    y = fp.simulate(cart(), points, theta, rtol=1e-10).y
    return fp.Measurements(points, y + NOISE * np.random.default_rng(seed).standard_normal(y.shape), labels=labels)


def run(campaign: fp.Campaign, loads: list[Any], **labels: list[str]) -> fp.Campaign:
    for load in loads:
        k = len(campaign.history)
        campaign.tell(measured(campaign.next(), load, k, **{name: of[k] for name, of in labels.items()}))
    return campaign


@pytest.mark.long
@pytest.mark.parametrize(
    ("by", "loads", "groups"),
    [
        ("run", [[1.5, 3.0], [2.0, 2.5]], ["1", "2", "3", "4"]),
        ("day", [1.5, 3.0], ["batch 1", "batch 2"]),
        ("shift", [1.5, 3.0], ["batch 1", "batch 2"]),
        ("plant", [3.0, 3.0], ["1"]),
        (fp.Local("day", spread=0.7), [1.5, 3.0], ["batch 1", "batch 2"]),
        (fp.Local("run", spread=0.7), [[1.5, 3.0], [2.0, 2.5]], ["1", "2", "3", "4"]),
    ],
)
def test_each_batch_is_a_new_day_of_one_plant(by: str | fp.Local, loads: list[Any], groups: list[str], tmp_path: Path) -> None:
    campaign = run(fp.Campaign(problem(by), directory=tmp_path / "c", **QUICK), loads)
    fit = campaign.fit
    assert fit is not None and tuple(fit.local["m_load"]) == tuple(groups)
    truth = np.ravel(loads) if len(groups) == 4 else loads if len(groups) == 2 else loads[:1]
    for one, load in zip(fit.local["m_load"].values(), truth, strict=True):
        assert abs(one.estimate - load) < 5 * one.standard_error
    assert set(campaign.estimate) == {"d", "c"} and abs(campaign.estimate["d"] - 1.5) < 5 * campaign.standard_errors["d"]
    assert tuple(campaign.history[-1].local) == tuple(f"m_load[{group}]" for group in groups)
    assert all(f"m_load[{group}]" in str(campaign.report()) for group in groups)
    # It is the joint fit of all data with these labels.
    word, parts = campaign.problem.local_parameters["m_load"].by, [one.data for one in campaign.history]
    together = fp.Measurements.join(parts)
    labels = {} if word == "run" else {word: np.repeat(groups, len(together) // len(groups)).tolist()}
    together, deviations = fp.Measurements(together.points, together.y, labels=labels), campaign.problem.deviations
    again = fp.estimate(cart(), together, PRIOR, parameters=["d", "c"], noise={"y": NOISE}, deviations=deviations)
    assert dict(campaign.standard_errors) == pytest.approx({name: again.standard_errors[name] for name in ("d", "c")}, rel=1e-4)
    # A directory goes on to the same.
    loaded = fp.Campaign.load(tmp_path / "c", threads=1)
    assert str(loaded.report()) == str(campaign.report()) and loaded.history[-1].local_errors == campaign.history[-1].local_errors
    if by in ("run", "day", "plant"):
        assert loaded.next() == run(fp.Campaign(problem(by), **QUICK), loads).next()


@pytest.mark.long
def test_labels_say_otherwise(tmp_path: Path) -> None:
    campaign = fp.Campaign(problem("day"), directory=tmp_path / "c", **QUICK)
    run(campaign, [2.0, 2.0, 3.0], day=["Monday", "Monday", "Tuesday"])
    assert campaign.fit is not None and tuple(campaign.fit.local["m_load"]) == ("Monday", "Tuesday")
    loaded = fp.Campaign.load(tmp_path / "c", threads=1)
    assert loaded.data == campaign.data and (tmp_path / "c" / "data_1.csv").read_text().splitlines()[0].endswith("day")
    mixed = run(fp.Campaign(problem("day"), **QUICK), [2.0])
    mixed.tell(measured(mixed.next(), [2.5, 3.0], 1, day=["a", "b"]))
    assert mixed.fit is not None and tuple(mixed.fit.local["m_load"]) == ("batch 1", "a", "b")


def test_the_next_batch_is_for_the_plant_of_the_last() -> None:
    """What is known of a plant's own value counts for its next batch, and for no other plant's."""
    first = measured(fp.Runs(np.zeros((2, 1)), np.array([[1.0, 6, 2, 5, 3, 4], [6, 1, 5, 2, 4, 3]]), np.full((2, 6), 0.2)), 3.5, 0)
    second = measured(fp.Runs(np.zeros((1, 1)), np.array([[2.0, 5, 1, 6, 3, 3]]), np.full((1, 6), 0.2)), 1.5, 1, plant="B")
    campaign = fp.Campaign(problem("plant"), **QUICK)
    campaign.tell(fp.Measurements(first.points, first.y, labels={"plant": "A"}))
    campaign.tell(second)
    fit, planned = campaign.fit, campaign.next()
    assert fit is not None
    values = {**{name: fit.estimate[name] for name in ("d", "c")}, "m_load": fit.local["m_load"]["B"].estimate}
    given, data = campaign.problem.replace(prior=PRIOR.moved_to(values)), campaign.data
    assert data is not None
    found = fp.evaluate(given, planned, previous=as_previous(campaign.problem, data)).standard_errors
    # The whole matrix: d, c, and the loads of A and B; the second runs and the planned ones are of B.
    rows = []
    for runs, column in ((first.points, 2), (second.points, 3), (planned, 3)):
        slopes = fp.sensitivities(cart(), runs, list(values.values())).dy_dtheta.reshape(-1, 3) / NOISE
        own = np.zeros((len(slopes), 4))
        own[:, :2], own[:, column] = slopes[:, :2], slopes[:, 2]
        rows.append(own)
    whole = np.concatenate(rows)
    errors = np.sqrt(np.diag(np.linalg.inv(whole.T @ whole)))[:2]
    assert found is not None and list(found.values()) == pytest.approx(errors, rel=1e-3)


@pytest.mark.long
def test_plants_are_named_in_all_batches_or_in_none() -> None:
    campaign = run(fp.Campaign(problem("plant"), **QUICK), [2.0])
    with pytest.raises(ValueError, match="data: expected no labels 'plant' as in batch 1, given 'A'"):
        campaign.tell(measured(campaign.next(), 2.0, 1, plant="A"))
    campaign = run(fp.Campaign(problem("plant"), **QUICK), [2.0], plant=["A"])
    with pytest.raises(ValueError, match="data: expected labels 'plant' as in batch 1, given none"):
        campaign.tell(measured(campaign.next(), 2.0, 1))
    with pytest.raises(
        ValueError, match=r"local\['m_load'\]: expected 'run', or a label such as 'day', in a campaign, given 'record'"
    ):
        fp.Campaign(problem("record"))


@pytest.mark.long
def test_a_spread_is_estimated_once_there_are_two_values() -> None:
    campaign = run(fp.Campaign(problem(fp.Local("day", spread="estimated")), **QUICK), [2.0])
    assert campaign.fit is not None and not campaign.fit.spread
    run(campaign, [3.0, 2.5, 1.8])
    assert campaign.fit.spread["m_load"].std > 0 and "m_load" in campaign.history[-1].local


def test_points_have_loads_of_a_day_too() -> None:
    region = fp.ExperimentRegion({"v": (0.0, 2.0), "F": (1, 6), "dt": (0.1, 0.5)})
    campaign = fp.Campaign(problem("day", region), batch=6, n_candidates=20, max_iterations=3, threads=1)
    run(campaign, [2.0, 3.0])
    assert campaign.fit is not None and len(campaign.fit.local["m_load"]) == 2
    for name, true in (("d", 1.5), ("c", 0.6)):
        assert abs(campaign.estimate[name] - true) < abs(START[name] - true)


def test_a_value_that_stays_open_does_not_stop_it() -> None:
    campaign = fp.Campaign(problem("run"), **QUICK)
    still = fp.Runs(np.zeros((1, 1)), np.zeros((1, 6)), np.full((1, 6), 0.2))  # a cart at rest has any load
    campaign.tell(fp.Measurements.join([measured(campaign.next(), 2.0, 0), measured(still, 2.0, 1)]))
    assert campaign.fit is not None and campaign.fit.null_directions
    assert len(campaign.next()) == 2
