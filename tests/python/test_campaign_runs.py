"""Campaigns of runs: batches follow from the data so far, no run counts twice, and a directory goes on to the same bits."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.design.runs.run_search import RunSearch

QUICK: dict[str, Any] = {"threads": 1, "n_starts": 2, "n_candidates": 20}
TRUTH, NOISE = {"k": 1.15, "b": 0.45}, {"x": 0.01, "z": 0.05}
MODEL = fp.SymbolicModel(
    f=["b*u - k*x"],
    g=["x", "u*x"],
    states={"x": "m"},
    inputs={"u": "V"},
    parameters={"k": "1/s", "b": "m/(s V)"},
    outputs={"x": "m", "z": "V m"},
    name="level",
)
BOUNDS = {"x": (0.0, 2.0), "u": (0.1, 1.0), "dt": (0.1, 1.0)}
PRIOR = fp.GaussianPrior({"k": 1.0, "b": 0.5}, {"k": 0.2, "b": 0.1})


def level(**changes: Any) -> fp.DesignProblem:
    region = fp.RunRegion(BOUNDS, 3, measured=[False, True, True], rest=changes.pop("rest", None))
    return fp.DesignProblem(MODEL, PRIOR, region, **({"noise": NOISE} | changes))


def measured(runs: fp.Runs | fp.Experiments, seed: int = 0) -> fp.Measurements:
    return fp.VirtualRig(MODEL, TRUTH, NOISE, seed=seed).measure(runs)


def drawn(count: int, seed: int = 0, segments: int = 4) -> fp.Runs:
    rng = np.random.default_rng(seed)
    shape = count, segments
    return fp.Runs(rng.uniform(0.5, 2.0, (count, 1)), rng.uniform(0.1, 1.0, shape), rng.uniform(0.1, 1.0, shape))


def run(campaign: fp.Campaign, batches: int) -> fp.Campaign:
    for _ in range(batches):
        campaign.tell(measured(campaign.next(), len(campaign.history)))
    return campaign


# --- Batches -------------------------------------------------------------------------------------------------------------


def test_a_campaign_comes_to_its_targets_and_to_the_truth() -> None:
    campaign = fp.Campaign(level(), targets=0.02, **QUICK)
    while not campaign.done and len(campaign.history) < 10:
        run(campaign, 1)
    assert campaign.done and len(campaign.history) > 1 and campaign.batch == 1
    assert max(campaign.rse.values()) <= 0.02 < max(campaign.history[-2].rse.values())
    assert campaign.fit is not None
    off = np.array([campaign.estimate[name] - TRUTH[name] for name in TRUTH])
    assert off @ np.linalg.solve(campaign.fit.covariance, off) < 13.8  # chi-square of two, 0.1 %
    data = fp.Measurements.join([batch.data for batch in campaign.history])
    alone = fp.estimate(MODEL, data, PRIOR, start=campaign.estimate, noise=NOISE, threads=1)
    for name in TRUTH:
        assert campaign.estimate[name] == pytest.approx(alone.estimate[name], abs=1e-5 * alone.standard_errors[name])
    np.testing.assert_allclose(campaign.fit.covariance, alone.covariance, rtol=1e-6)


def test_a_batch_is_designed_at_the_estimate_with_what_is_known() -> None:
    campaign = run(fp.Campaign(level(), 2, seed=2, goal=fp.Goal(confidence=0.0), **QUICK), 1)
    assert campaign.fit is not None and campaign.batch == 2
    runs = campaign.next()
    assert isinstance(runs, fp.Runs) and len(runs) == 2 and campaign.next() is runs and campaign.planned is runs
    at_estimate = level().replace(prior=campaign.fit.posterior())
    given: dict[str, Any] = {
        "seed": int(np.random.SeedSequence([2, 1]).generate_state(1)[0]),
        "goal": fp.Goal(confidence=0.0),
        **QUICK,
    }
    assert runs == fp.design_runs(at_estimate, 2, previous=campaign.data, **given).runs
    assert runs != fp.design_runs(at_estimate, 2, **given).runs
    assert runs != fp.design_runs(level(), 2, previous=campaign.data, **given).runs


@pytest.mark.long
def test_runs_start_at_rest_in_campaigns_too(tmp_path: Path) -> None:
    rest = fp.Rest({"u": 0.5})
    campaign = run(fp.Campaign(level(rest=rest), directory=tmp_path, **QUICK), 2)
    runs = fp.Campaign.load(tmp_path).history[1].planned
    assert isinstance(runs, fp.Runs) and runs.rest == (rest,) and runs == campaign.history[1].planned
    for name, true in TRUTH.items():
        assert abs(campaign.estimate[name] - true) < 4 * campaign.standard_errors[name]


def test_data_may_come_without_a_design_and_with_gaps() -> None:
    runs = drawn(4)
    y = measured(runs).y.copy()
    y[0] = np.nan  # a run of which nothing was measured
    y[1, 2:] = np.nan  # one that stopped
    y[2, :, 0] = np.nan
    campaign = fp.Campaign(level(), **QUICK)
    campaign.tell(fp.Measurements(runs, y))
    assert campaign.history[0].planned is None and len(campaign.history[0].data) == 4
    assert campaign.data is not None and campaign.data.points.dt.shape == (3, 4)
    assert campaign.data.samples.shape == (2 + 4 + 4, 2)
    assert len(campaign.next()) == 1
    run(campaign, 1)
    assert campaign.data.points.dt.shape == (4, 4), "runs of different numbers of segments"


def test_an_interrupted_search_plans_nothing(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Neither before a first start has been followed, nor after it, where `design_runs` returns what it has."""

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    campaign = fp.Campaign(level(), directory=tmp_path, **QUICK)
    with pytest.raises(KeyboardInterrupt):
        campaign.next(progress=interrupt)
    with monkeypatch.context() as patch:
        patch.setattr(RunSearch, "_climb", interrupt)
        with pytest.raises(KeyboardInterrupt):
            campaign.next()
    assert campaign.planned is None and [path.name for path in tmp_path.iterdir()] == ["campaign.json"]
    assert campaign.next() == fp.Campaign(level(), **QUICK).next()


def test_a_batch_that_many_plants_cannot_run_is_told() -> None:
    """The level must not be reached that the input leads to in one plant of seven."""
    region = fp.RunRegion({"x": 0.5, "u": (1.0, 1.0), "dt": (3.0, 3.1)}, 2)
    problem = fp.DesignProblem(MODEL, PRIOR, region, noise=NOISE, along=["x < 0.75"])
    campaign = fp.Campaign(problem, **QUICK)
    with pytest.warns(
        UserWarning, match=r"confidence: expected a batch that 99\.0 % of the plants can run, found one that \d\d\.\d % can"
    ):
        campaign.next()
    assert len(fp.Campaign(problem, goal=fp.Goal(confidence=0.0), **QUICK).next()) == 1


# --- Misuse --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"time_limit": 1.0}, TypeError, "settings: expected names of goal, n_starts, n_candidates; given 'time_limit'"),
        ({"max_iterations": 5}, TypeError, "settings: expected names of goal, n_starts, n_candidates; given 'max_iterations'"),
        ({"n_runs": 2}, TypeError, "settings: expected names of goal, n_starts, n_candidates; given 'n_runs'"),
        ({"n_starts": 0}, ValueError, "n_starts: expected a whole number of at least 1, given 0"),
        ({"goal": "B"}, ValueError, "criterion: expected 'D', "),
        ({"confidence": 0.9}, TypeError, r"confidence: expected as goal=fp\.Goal\(confidence=...\), given to fp\.Campaign"),
        ({"batch": 0}, ValueError, "batch: expected a whole number of at least 1, given 0"),
        ({"batch": 10**6}, ValueError, "n_runs: expected a whole number of at most 1000, given 1000000"),
    ],
)
def test_misuse_is_told(change: dict[str, Any], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        fp.Campaign(level(), **change)


def test_a_problem_that_is_none_of_runs_is_told_at_the_start() -> None:
    with pytest.raises(ValueError, match="noise: expected the sensor noise"):
        level(noise=None)
    with pytest.raises(ValueError, match="output_covariance: expected 'noise' for runs, given 'pooled'"):
        fp.Campaign(level(output_covariance="pooled"))
    with pytest.raises(ValueError, match="assumed_covariance: expected 'tangents' for runs, given 'predictive'"):
        fp.Campaign(level(initial_state_std={"x": 0.1}, assumed_covariance="predictive"))
    with pytest.raises(ValueError, match="region: expected an ExperimentRegion or a RunRegion to design in, given None"):
        fp.Campaign(level().replace(region=None))


def test_points_and_runs_may_be_told_in_one_campaign(tmp_path: Path) -> None:
    of_runs, of_points = fp.Campaign(level(), **QUICK), fp.Campaign(level().replace(region=fp.ExperimentRegion(BOUNDS)))
    runs = drawn(2)
    with pytest.raises(ValueError, match=r"data: expected \(1, 1, 2\) states, inputs and outputs of level, given \(1, 1, 1\)"):
        of_runs.tell(fp.Measurements(runs, measured(runs).y[:, :, :1]))
    assert not of_runs.history and not of_points.history
    for campaign in (of_runs, of_points):
        campaign.tell(measured(runs.starts))
        campaign.tell(measured(runs, seed=1))
        with pytest.raises(ValueError, match="given those of batch 1 among them"):
            campaign.tell(measured(fp.Runs.of_points(runs.starts)))
        assert "2 points and 2 runs measured" in str(campaign)
        campaign.save(tmp_path / campaign.next().kind)
        again = fp.Campaign.load(tmp_path / campaign.next().kind)
        assert again.next() == campaign.next() and again.data == campaign.data
    pooled = fp.Campaign(level(output_covariance="pooled").replace(region=fp.ExperimentRegion(BOUNDS)))
    with pytest.raises(ValueError, match="output_covariance: expected 'noise' for runs, given 'pooled'"):
        pooled.tell(measured(runs))


# --- Telling twice -------------------------------------------------------------------------------------------------------


@pytest.fixture
def told() -> fp.Campaign:
    """A campaign that was told of three runs of four samples."""
    campaign = fp.Campaign(level(), **QUICK)
    campaign.tell(measured(drawn(3)))
    return campaign


def some_again(data: fp.Measurements, seed: int, share: float) -> fp.Measurements:
    """Other data of the same runs, of which a share of the samples reads as before."""
    other, count = measured(data.points, seed).y.copy(), round(share * data.y.shape[1])
    other[:, :count] = data.y[:, :count]
    return fp.Measurements(data.points, other)


def test_a_run_that_was_told_is_refused(told: fp.Campaign) -> None:
    data = told.history[0].data
    new = measured(drawn(2, seed=5))
    with pytest.raises(ValueError, match="data: expected new measurements, given those of batch 1 again"):
        told.tell(fp.Measurements(data.points, data.y))
    for again, said in (
        (data[1], "1 of the 3 runs"),
        (fp.Measurements.join([new, data[1:]]), "2 of the 3 runs"),
        (fp.Measurements.join([data, new]), "those"),
    ):
        with pytest.raises(ValueError, match=f"^data: expected new measurements only, given {said} of batch 1 among them"):
            told.tell(again)
    assert len(told.history) == 1
    told.tell(measured(data.points, seed=9))  # the same runs, made once more
    assert len(told.history) == 2


def test_a_run_that_goes_on_behind_what_was_told_is_refused(told: fp.Campaign) -> None:
    """As in a file that has grown; and so is a part of one, also where an output is missing."""
    runs = told.history[0].data.points
    assert isinstance(runs, fp.Runs)
    y = told.history[0].data.y
    shorter = fp.Runs(runs.x0, runs.u[:, :2], runs.dt[:, :2])
    lost = y.copy()
    lost[:, :, 1] = lost[:, 3:] = np.nan
    longer = fp.Runs(runs.x0, np.pad(runs.u, ((0, 0), (0, 2), (0, 0)), mode="edge"), np.pad(runs.dt, ((0, 0), (0, 2)), mode="edge"))
    grown = measured(longer).y.copy()
    grown[:, :4] = y
    for again in (fp.Measurements(shorter, y[:, :2]), fp.Measurements(runs, lost), fp.Measurements(longer, grown)):
        with pytest.raises(ValueError, match="given those of batch 1 among them"):
            told.tell(again)
        with pytest.raises(ValueError, match="given 1 of the 3 runs of batch 1 among them"):
            told.tell(again[2])
    u = longer.u.copy()
    u[:, 3] += 0.01  # before the end of what was told: another run
    told.tell(fp.Measurements(fp.Runs(longer.x0, u, longer.dt), grown))
    assert len(told.history) == 2


def test_a_single_sample_that_is_known_may_be_a_replicate(told: fp.Campaign) -> None:
    runs = drawn(2, seed=7, segments=1)
    first = measured(runs)
    told.tell(first)
    with pytest.raises(ValueError, match="given those of batch 2 among them"):
        told.tell(first[[1, 0]])
    with pytest.warns(UserWarning, match=r"^data: runs\[1\] is also in batch 2; it counts as a repeated measurement"):
        told.tell(fp.Measurements.join([measured(drawn(1, seed=8)), first[1]]))
    assert told.data is not None and len(told.data) == 3 + 2 + 2


def test_a_run_of_which_some_samples_are_known_counts_but_is_told_of(told: fp.Campaign) -> None:
    """As with a coarse sensor, or after one number of a file was changed."""
    data = told.history[0].data
    few = some_again(data[0], 11, 0.25)
    told.tell(few)
    with pytest.warns(UserWarning, match=r"^data: runs\[0\] is also in batch 1, in 3 of 4 samples; it counts as a repeated"):
        told.tell(some_again(data[0], 12, 0.75))
    assert len(told.history) == 3


# --- Directories ---------------------------------------------------------------------------------------------------------


@pytest.mark.long
@pytest.mark.parametrize("batch", [1, 2])
def test_a_loaded_campaign_goes_on_to_the_same_bits(batch: int, tmp_path: Path) -> None:
    given: dict[str, Any] = {"targets": 0.01, "seed": 5, **QUICK}
    whole = run(fp.Campaign(level(), batch, directory=tmp_path / "whole", **given), 3)
    fp.Campaign(level(), batch, directory=tmp_path / "parts", **given)
    for _ in range(3):
        runs = fp.Campaign.load(tmp_path / "parts", threads=2).next()
        campaign = fp.Campaign.load(tmp_path / "parts", threads=1)
        assert campaign.next() == runs
        run(campaign, 1)
    names = {path.name for path in (tmp_path / "whole").iterdir()}
    assert names == {"campaign.json", *(f"{kind}_{k}.csv" for kind in ("batch", "plan", "data") for k in (1, 2, 3))}
    for name in names:
        assert (tmp_path / "whole" / name).read_bytes() == (tmp_path / "parts" / name).read_bytes(), name
    loaded = fp.Campaign.load(tmp_path / "parts", threads=1)
    assert loaded.fit is not None and whole.fit is not None
    assert dict(loaded.fit.estimate) == dict(whole.fit.estimate) and (loaded.fit.covariance == whole.fit.covariance).all()
    assert str(loaded) == str(whole) and loaded.problem.region == whole.problem.region
    assert loaded.next() == whole.next()
    without = run(fp.Campaign(level(), batch, **given), 3)
    assert dict(without.estimate) == dict(whole.estimate)


def test_the_directory_has_tables_for_people(tmp_path: Path) -> None:
    campaign = run(fp.Campaign(level(), 2, directory=tmp_path, **QUICK), 1)
    campaign.next()
    assert fp.Runs.from_csv(tmp_path / "batch_2.csv", MODEL) == campaign.planned
    assert fp.Measurements.from_table(tmp_path / "data_1.csv", MODEL) == campaign.history[0].data
    plan = (tmp_path / "plan_2.csv").read_text().splitlines()
    assert plan[0] == "run,t [s],u [V],measure" and len(plan) == 1 + 2 * (3 + 1)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    (tmp_path / "batch_2.csv").write_text("filled in\n")
    (tmp_path / "plan_2.csv").unlink()
    (tmp_path / "data_1.csv").unlink()
    fp.Campaign.load(tmp_path).next()
    assert (tmp_path / "batch_2.csv").read_text() == "filled in\n"
    for name in ("plan_2.csv", "data_1.csv", "campaign.json"):
        assert (tmp_path / name).read_bytes() == before[name]
    changed = (tmp_path / "data_1.csv").read_text().replace("0", "1", 1)
    (tmp_path / "data_1.csv").write_text(changed)
    with pytest.raises(ValueError, match=r"data_1.csv: expected the data as they were read, given a file that was changed"):
        fp.Campaign.load(tmp_path)


def test_a_campaign_of_runs_shows_itself_pickles_and_is_saved(tmp_path: Path) -> None:
    campaign = run(fp.Campaign(level(), 2, targets={"k": 1e-6}, **QUICK), 1)
    campaign.next()
    again = pickle.loads(pickle.dumps(campaign))
    again.save(tmp_path / "kept")
    for one in (again, fp.Campaign.load(tmp_path / "kept")):
        assert str(one) == str(campaign) and one.planned == campaign.planned and one.settings == campaign.settings
        assert one.history[0].data == campaign.history[0].data
    lines = str(campaign).splitlines()
    assert lines[0] == "Campaign on level: 1 batch, 2 runs measured"
    assert lines[-1].strip() == "Batch 2 is to be measured: 2 runs; above target: k"
    assert repr(campaign) == "Campaign(level, 1 batches measured, a batch to measure)"
    assert list(campaign.to_pandas().columns) == ["prior", "batch 1"]
    campaign.plot(path=tmp_path / "campaign.png")
    assert (tmp_path / "campaign.png").stat().st_size > 10_000
