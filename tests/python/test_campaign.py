"""Campaigns: batches follow from the data so far, nothing counts twice, and a directory goes on as if nothing had happened."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.design.file.configuration import load_config

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
QUICK: dict[str, Any] = {"threads": 1, "n_candidates": 10, "max_iterations": 10}


@pytest.fixture(scope="module")
def problem() -> fp.DesignProblem:
    return load_config(EXAMPLES / "cylinder.toml").problem()


@pytest.fixture(scope="module")
def kinetics() -> fp.DesignProblem:
    """A model without state, with a log-normal parameter."""
    return load_config(EXAMPLES / "michaelis_menten.toml").problem()


def rig(problem: fp.DesignProblem, seed: int) -> fp.VirtualRig:
    return fp.VirtualRig(problem.model, 1.1 * problem.theta, problem.noise or {}, seed=seed)


def run(campaign: fp.Campaign, batches: int) -> fp.Campaign:
    for _ in range(batches):
        campaign.tell(rig(campaign.problem, len(campaign.history)).measure(campaign.next()))
    return campaign


@pytest.fixture(scope="module")
def saved(problem: fp.DesignProblem, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two batches told, the third planned; not to be changed."""
    directory = tmp_path_factory.mktemp("saved") / "campaign"
    run(fp.Campaign(problem, 4, targets={"c_L": 0.5, "E_oil": 1e-9}, seed=7, directory=directory, **QUICK), 2).next()
    return directory


@pytest.fixture
def copy(saved: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(saved, tmp_path / "campaign"))


def test_an_estimate_is_that_of_the_first_prior_and_all_data(problem: fp.DesignProblem) -> None:
    campaign = run(fp.Campaign(problem, 4, **QUICK), 3)
    assert campaign.fit is not None
    data = fp.Measurements.join([batch.data for batch in campaign.history])
    alone = fp.estimate(problem.model, data, problem.prior, start=campaign.estimate, noise=problem.noise, threads=1)
    for name in problem.estimated:
        assert campaign.estimate[name] == pytest.approx(alone.estimate[name], abs=1e-5 * alone.standard_errors[name])
    np.testing.assert_allclose(campaign.fit.covariance, alone.covariance, rtol=1e-6)
    assert campaign.history[-1].rse == campaign.rse
    assert all(batch.converged for batch in campaign.history)


def test_standard_errors_fall_and_the_truth_is_where_they_say(problem: fp.DesignProblem) -> None:
    campaign = run(fp.Campaign(problem, 6, **QUICK), 3)
    errors = [dict(problem.prior.std), *(batch.standard_errors for batch in campaign.history)]
    for name in problem.estimated:
        over_batches = [of_batch[name] for of_batch in errors]
        assert over_batches[0] > over_batches[-1] and over_batches[1] > over_batches[-1]
    truth = 1.1 * problem.theta
    z = [(campaign.estimate[name] - truth[i]) / campaign.standard_errors[name] for i, name in enumerate(problem.estimated)]
    assert np.sum(np.square(z)) < 27.9  # chi-square of nine, 0.1 %


def test_a_batch_is_designed_at_the_estimate_with_what_is_known(problem: fp.DesignProblem) -> None:
    campaign = run(fp.Campaign(problem, 4, seed=2, **QUICK), 1)
    assert campaign.fit is not None
    points = campaign.next()
    at_estimate = problem.replace(prior=campaign.fit.posterior())
    seed = int(np.random.SeedSequence([2, 1]).generate_state(1)[0])
    design = fp.exchange(at_estimate, 4, seed=seed, previous=campaign.data, method=fp.ExchangeMethod(references=False), **QUICK)
    assert points == design.points
    alone = fp.exchange(at_estimate, 4, seed=seed, method=fp.ExchangeMethod(references=False), **QUICK)
    assert points != alone.points


def test_next_returns_the_same_points_until_they_are_told(problem: fp.DesignProblem) -> None:
    campaign = fp.Campaign(problem, 3, **QUICK)
    points = campaign.next()
    assert campaign.next() is points and campaign.planned is points and len(points) == campaign.batch == 3
    campaign.tell(rig(problem, 0).measure(points))
    assert campaign.planned is None
    assert campaign.next() != points


def test_done_is_when_every_target_is_met(problem: fp.DesignProblem) -> None:
    campaign = fp.Campaign(problem, 4, targets={"c_L": 0.29, "m_q": 0.9}, **QUICK)
    assert campaign.met == {"c_L": False, "m_q": True} and not campaign.done
    campaign.targets = {"m_q": 0.9}
    assert not campaign.done, "a prior alone is no campaign"
    campaign.targets = 0.9
    assert list(campaign.targets) == list(problem.estimated)
    run(campaign, 1)
    assert campaign.done
    campaign.targets = {"c_L": 1e-6}
    assert not campaign.done
    campaign.targets = None
    assert not campaign.done


def test_batches_smaller_than_the_number_of_parameters_work(kinetics: fp.DesignProblem) -> None:
    campaign = run(fp.Campaign(kinetics, 1, **QUICK), 3)
    assert campaign.rse["V"] < 0.2 and campaign.rse["K"] < 0.3
    assert "batch 3" in str(campaign)


def test_data_may_come_without_a_design_and_with_gaps(problem: fp.DesignProblem) -> None:
    points = fp.exchange(problem, 5, seed=9, method=fp.ExchangeMethod(references=False), **QUICK).points
    whole = rig(problem, 1).measure(points)
    y = whole.y.copy()
    y[0] = np.nan  # a point of which nothing was measured
    y[1, 2] = np.nan
    campaign = fp.Campaign(problem, 4, **QUICK)
    campaign.tell(fp.Measurements(points, y))
    assert campaign.history[0].planned is None
    assert campaign.data is not None and len(campaign.data) == 4
    assert len(campaign.history[0].data) == 5
    assert len(campaign.next()) == 4


def test_what_is_uncertain_counts_in_estimates(problem: fp.DesignProblem) -> None:
    sure, unsure = fp.Campaign(problem, 4, **QUICK), fp.Campaign(problem.replace(uncertain={"T_1": 2e-4}), 4, **QUICK)
    data = rig(problem, 0).measure(sure.next())
    larger, smaller = unsure.tell(data).standard_errors, sure.tell(data).standard_errors
    ratios = np.array([larger[name] / smaller[name] for name in smaller])
    assert ratios.max() > 1.1 and ratios.min() > 0.99  # which of them, depends on the points


def test_only_chosen_parameters_are_estimated(problem: fp.DesignProblem) -> None:
    chosen = problem.replace(parameters=["m_q", "B_v"])
    campaign = fp.Campaign(chosen, 2, targets=0.5, **QUICK)
    fit = campaign.tell(fp.VirtualRig(problem.model, problem.theta, problem.noise or {}).measure(campaign.next()))
    assert fit.parameters == ("m_q", "B_v") and list(campaign.targets) == ["m_q", "B_v"] and campaign.done


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"batch": 0}, ValueError, "batch: expected a whole number of at least 1, given 0"),
        ({"seed": -1}, ValueError, "seed: expected"),
        ({"targets": {"c_M": 0.1}}, ValueError, "targets: expected names of a_tau, .* given unknown 'c_M'"),
        ({"targets": 0.0}, ValueError, r"targets\['a_tau'\]: expected a positive share"),
        ({"targets": "small"}, ValueError, r"targets\['a_tau'\]: expected numbers"),
        (
            {"time_limit": 1.0},
            TypeError,
            "time_limit: expected as method=fp.ExchangeMethod",
        ),
        ({"n_candidates": 0}, ValueError, "n_candidates: expected"),
        ({"n_candidates": 10**9}, ValueError, "n_candidates: expected a whole number of at most 1000000, given 1000000000"),
        ({"batch": 10**9}, ValueError, "n_experiments: expected a whole number of at most 1000000, given 1000000000"),
    ],
)
def test_misuse_is_told(problem: fp.DesignProblem, change: dict[str, Any], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        fp.Campaign(problem, **change)


def test_wrong_data_are_refused_and_change_nothing(problem: fp.DesignProblem, kinetics: fp.DesignProblem) -> None:
    campaign = fp.Campaign(problem, 4, **QUICK)
    data = rig(problem, 0).measure(campaign.next())
    with pytest.raises(TypeError, match="data: expected Measurements, given ndarray"):
        campaign.tell(data.y)  # type: ignore[arg-type]
    other = rig(kinetics, 0).measure(fp.Campaign(kinetics, 2, **QUICK).next())
    with pytest.raises(ValueError, match=r"data: expected \(5, 1, 4\) states, inputs and outputs"):
        campaign.tell(other)
    assert not campaign.history and campaign.planned is not None
    campaign.tell(data)
    with pytest.raises(ValueError, match="given those of batch 1 again"):
        campaign.tell(fp.Measurements(data.points, data.y))
    more = rig(problem, 1).measure(data.points[:2])
    with pytest.raises(ValueError, match="new measurements only, given those of batch 1 among them"):
        campaign.tell(fp.Measurements.join([data, more]))
    assert len(campaign.history) == 1
    campaign.tell(more)


def test_rows_that_were_told_do_not_count_twice(problem: fp.DesignProblem) -> None:
    campaign = fp.Campaign(problem, 4, **QUICK)
    first = rig(problem, 0).measure(campaign.next())
    gaps = first.y.copy()
    gaps[:, 1] = gaps[0, :] = np.nan
    campaign.tell(fp.Measurements(first.points, gaps))  # of one point nothing was measured
    more = rig(problem, 1).measure(first.points)
    for again in (fp.Measurements(first.points, gaps)[1:3], first[1:], fp.Measurements.join([more, first[2:]])):
        with pytest.raises(ValueError, match=r"expected new .* given (2 of the 3 points|those) of batch 1 among them"):
            campaign.tell(again)
    assert len(campaign.history) == 1
    # What is new at the same points, and one reading that is the same, as of a replicate that a coarse sensor cannot tell apart.
    with pytest.warns(UserWarning, match=r"data: points\[1\] is also in batch 1; it counts as a repeated measurement"):
        campaign.tell(fp.Measurements.join([first[:1], first[1:2], more]))
    assert len(campaign.history) == 2 and campaign.data is not None and len(campaign.data) == 9


def test_no_region_is_no_campaign(problem: fp.DesignProblem) -> None:
    with pytest.raises(ValueError, match="region: expected an ExperimentRegion"):
        fp.Campaign(problem.replace(region=None))


def test_an_interrupted_search_plans_nothing(problem: fp.DesignProblem) -> None:
    def interrupt(_: fp.Progress) -> None:
        raise KeyboardInterrupt

    campaign = fp.Campaign(problem, 4, **QUICK)
    with pytest.raises(KeyboardInterrupt):
        campaign.next(progress=interrupt)
    assert campaign.planned is None
    assert campaign.next() == fp.Campaign(problem, 4, **QUICK).next()


@pytest.mark.parametrize("name", ["cylinder", "michaelis_menten"])
def test_a_loaded_campaign_goes_on_to_the_same_bits(name: str, tmp_path: Path) -> None:
    given = load_config(EXAMPLES / f"{name}.toml").problem()
    whole = fp.Campaign(given, 3, targets=0.01, seed=5, directory=tmp_path / "whole", **QUICK)
    run(whole, 3)
    fp.Campaign(given, 3, targets=0.01, seed=5, directory=tmp_path / "parts", **QUICK)
    for _ in range(3):
        points = fp.Campaign.load(tmp_path / "parts", threads=2).next()
        campaign = fp.Campaign.load(tmp_path / "parts", threads=1)
        assert campaign.next() == points
        run(campaign, 1)
    for path in (tmp_path / "whole").iterdir():
        assert path.read_bytes() == (tmp_path / "parts" / path.name).read_bytes(), path.name
    loaded = fp.Campaign.load(tmp_path / "parts", threads=1)
    assert loaded.fit is not None and whole.fit is not None
    assert dict(loaded.fit.estimate) == dict(whole.fit.estimate) and (loaded.fit.covariance == whole.fit.covariance).all()
    assert str(loaded) == str(whole)
    assert loaded.next() == whole.next()
    without = run(fp.Campaign(given, 3, targets=0.01, seed=5, **QUICK), 3)
    assert dict(without.estimate) == dict(whole.estimate)


def test_the_directory_has_tables_for_people(saved: Path, problem: fp.DesignProblem) -> None:
    names = sorted(path.name for path in saved.iterdir())
    assert names == ["batch_1.csv", "batch_2.csv", "batch_3.csv", "campaign.json", "data_1.csv", "data_2.csv"]
    campaign = fp.Campaign.load(saved)
    assert fp.Experiments.from_csv(saved / "batch_3.csv", problem.model) == campaign.planned
    assert fp.Measurements.from_table(saved / "data_2.csv", problem.model) == campaign.history[1].data
    assert repr(campaign) == "Campaign(hydraulic_cylinder, 2 batches measured, a batch to measure)"


def test_a_new_campaign_does_not_take_the_place_of_another(saved: Path, problem: fp.DesignProblem) -> None:
    assert fp.Campaign.is_in(saved) and not fp.Campaign.is_in(saved.parent)
    with pytest.raises(ValueError, match="directory: expected one without a campaign"):
        fp.Campaign(problem, directory=saved)


def test_files_that_were_damaged_by_hand_are_refused(copy: Path) -> None:
    path = copy / "campaign.json"
    text = path.read_text()
    data = json.loads(text)
    (content,) = data["content"].values()
    estimate = repr(dict(content["batches"][0]["Batch"]["estimate"]["mapping"])["m_q"])
    for damaged in (
        text.replace(estimate, repr(float(estimate) * 1.001)),
        text.replace('"seed": 7', '"seed": 8'),
        json.dumps({**data, "content": {}}),
        json.dumps({name: value for name, value in data.items() if name != "sha256"}),
    ):
        assert damaged != text
        path.write_text(damaged)
        with pytest.raises(ValueError, match=r"campaign.json: expected the file as it was written"):
            fp.Campaign.load(copy)
    for damaged, message in (
        ("", "a whole JSON file"),
        ("[]", "a file of format 'fisherpoint CampaignState'"),
        ('{"format": "fisherpoint Design"}', "a file of format 'fisherpoint CampaignState'"),
        ('{"format": "fisherpoint CampaignState", "format_version": 99}', "format version 1, given 99"),
    ):
        path.write_text(damaged)
        with pytest.raises(ValueError, match=f"campaign.json: expected {message}"):
            fp.Campaign.load(copy)
    path.write_bytes(b"\xff\xfe")
    with pytest.raises(ValueError, match=r"campaign.json: expected a whole JSON file"):
        fp.Campaign.load(copy)
    path.unlink()
    with pytest.raises(FileNotFoundError):
        fp.Campaign.load(copy)


def test_data_that_were_changed_are_refused_and_lost_ones_written_again(copy: Path, saved: Path) -> None:
    path = copy / "data_1.csv"
    path.write_text(path.read_text().replace("0", "1", 1))
    with pytest.raises(ValueError, match=r"data_1.csv: expected the data as they were read, given a file that was changed"):
        fp.Campaign.load(copy)
    path.unlink()
    fp.Campaign.load(copy)
    assert path.read_bytes() == (saved / "data_1.csv").read_bytes()


def test_a_batch_that_was_filled_in_is_left_alone_and_a_lost_one_written_again(copy: Path, saved: Path) -> None:
    path = copy / "batch_3.csv"
    path.write_text("filled in\n")
    campaign = fp.Campaign.load(copy)
    campaign.targets = 0.3
    campaign.next()
    assert path.read_text() == "filled in\n"
    path.unlink()
    campaign.next()
    assert path.read_bytes() == (saved / "batch_3.csv").read_bytes()
    assert fp.Campaign.load(copy).targets == campaign.targets


def test_two_processes_on_one_campaign_are_noticed(copy: Path) -> None:
    one, other = fp.Campaign.load(copy), fp.Campaign.load(copy)
    run(one, 1)
    with pytest.raises(RuntimeError, match="two work on one campaign"):
        run(other, 1)
    assert len(fp.Campaign.load(copy).history) == 3 and len(other.history) == 2


def test_what_cannot_be_saved_is_refused_at_the_start(problem: fp.DesignProblem, tmp_path: Path) -> None:
    assert problem.region is not None
    region = fp.ExperimentRegion(dict(problem.region.bounds), [lambda columns: columns["p_A"] > 3e6])
    with pytest.raises(ValueError, match="constraints: expected text for a campaign in a directory, given a function"):
        fp.Campaign(problem.replace(region=region), directory=tmp_path)
    assert not list(tmp_path.iterdir())
    assert len(fp.Campaign(problem.replace(region=region), 2, **QUICK).next()) == 2


def test_the_report_says_what_is_met_and_what_comes_next(saved: Path) -> None:
    lines = str(fp.Campaign.load(saved)).splitlines()
    assert lines[0] == "Campaign on hydraulic_cylinder: 2 batches, 8 points measured"
    assert lines[3].split() == ["parameter", "unit", "estimate", "prior", "batch", "1", "batch", "2", "target", "met"]
    rows = {line.split()[0]: " ".join(line.split()) for line in lines[4:13]}
    assert rows["c_L"].endswith(" 50 % yes") and rows["E_oil"].endswith(" 1e-7 % no") and " 5.00 % " in rows["m_q"]
    assert lines[-2].strip().startswith("Chi-square ")
    assert lines[-1].strip() == "Batch 3 is to be measured: 4 points; above target: E_oil"


def test_the_picture_has_a_panel_for_each_parameter(saved: Path, tmp_path: Path) -> None:
    plots = pytest.importorskip("fisherpoint.campaign.pictures")
    campaign = fp.Campaign.load(saved)
    figure = plots.plot_campaign(campaign._state.rse, campaign.targets)
    panels = [axes for axes in figure.axes if axes.axison]
    assert [axes.get_title(loc="left") for axes in panels] == list(campaign.problem.estimated)
    rse = [batch.rse["c_L"] for batch in campaign.history]
    drawn = panels[6].lines[0].get_ydata()
    np.testing.assert_allclose(drawn, [0.3, *rse])
    assert panels[6].lines[-1].get_ydata()[0] == 0.5  # the target
    campaign.plot(path=tmp_path / "campaign.png")
    assert (tmp_path / "campaign.png").stat().st_size > 10_000


def test_a_batch_that_does_not_tell_its_noise_meets_no_target(kinetics: fp.DesignProblem) -> None:
    unknown = kinetics.replace(noise=None, output_covariance=None)
    campaign = fp.Campaign(unknown, 2, targets=0.5, **QUICK)
    measuring = fp.VirtualRig(unknown.model, unknown.theta, kinetics.noise or {})
    campaign.tell(measuring.measure(campaign.next()))
    assert not campaign.done and "not converged" in str(campaign)


def test_few_degrees_of_freedom_meet_no_target_by_chance() -> None:
    """With estimated noise, targets are held against standard errors as wide as Student's t makes intervals."""
    decay = load_config(EXAMPLES / "exponential_decay.toml").problem().replace(noise=None, output_covariance="region")
    (output,) = decay.model.outputs
    campaign = fp.Campaign(decay, 4, targets=0.1, seed=1, **QUICK)
    campaign.tell(fp.VirtualRig(decay.model, decay.theta, {output.name: 0.01}).measure(campaign.next()))
    fit = campaign.fit
    assert fit is not None
    for name in campaign.targets:
        low, high = fit.intervals()[name]
        wide = (high - low) / 2 / 1.959963984540054 / abs(fit.estimate[name])
        assert wide > campaign.rse[name]
        between = fp.Campaign(decay, 4, targets=(wide + campaign.rse[name]) / 2, seed=1, **QUICK)
        between.tell(campaign.history[0].data)
        assert not between.met[name]
