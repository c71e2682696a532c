"""Points that the asked share of the plants can run: counted on plants that the search has not seen."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.special import ndtr

import fisherpoint as fp
from fisherpoint.design.file.configuration import load_config
from fisherpoint.design.points.point_margins import Away
from fisherpoint.information.draws import drawn_plants
from fisherpoint.information.validity import Validity

CYLINDER = fp.load_problem(Path(__file__).parents[2] / "examples" / "cylinder.toml").replace(jumps="exclude")
GROWTH = fp.DesignProblem(
    fp.SymbolicModel(["p*x + c*u"], ["x"], {"x": "1"}, {"u": "1"}, {"p": "1/s", "c": "1/s"}, {"x": "1"}),
    fp.GaussianPrior({"p": 1.0, "c": 1.0}, {"p": 0.1, "c": 0.1}),
    fp.ExperimentRegion({"x": (0.1, 1.0), "u": (0.0, 1.0), "dt": (0.1, 3.0)}),
    noise={"x": 0.01},
    along=["x < 3"],
)
"""What grows tells more the longer it does, up to a limit."""


def share(problem: fp.DesignProblem, design: fp.Design) -> float:
    return fp.feasibility(problem, design.points, draws=10_000, seed=77).share


@pytest.mark.long
@pytest.mark.parametrize(("asked", "seed"), [(0.99, 0), (0.99, 1), (0.9, 2)])
def test_what_grows_stays_below_its_limit_on_as_many_plants_as_asked(asked: float, seed: int) -> None:
    free = fp.exchange(GROWTH, 6, n_candidates=20, method=fp.ExchangeMethod(references=False), seed=seed)
    kept = fp.exchange(
        GROWTH, 6, n_candidates=20, method=fp.ExchangeMethod(references=False), seed=seed, goal=fp.Goal(confidence=asked)
    )
    assert free.feasible and share(GROWTH, free) < 0.9
    assert kept.feasible and share(GROWTH, kept) >= asked
    assert kept.evaluation.log_det < free.evaluation.log_det


@pytest.mark.long
def test_a_smaller_share_costs_less() -> None:
    """And no more plants are left in reserve than the share asks for."""
    designs = [
        fp.exchange(GROWTH, 6, n_candidates=20, method=fp.ExchangeMethod(references=False), goal=fp.Goal(confidence=asked))
        for asked in (0.8, 0.9, 0.99)
    ]
    values = [design.evaluation.log_det for design in designs]
    assert values[0] > values[1] + 0.1 and values[1] > values[2] + 0.3
    assert share(GROWTH, designs[0]) < 0.95 and share(GROWTH, designs[1]) < 0.98


@pytest.mark.long
def test_the_cylinder_can_be_asked_for_a_share() -> None:
    free, kept = (
        fp.exchange(CYLINDER, 12, n_candidates=20, method=fp.ExchangeMethod(references=False), goal=fp.Goal(confidence=asked))
        for asked in (None, 0.97)
    )
    assert share(CYLINDER, free) < 0.95
    assert share(CYLINDER, kept) >= 0.97
    assert "required" in str(kept) and "required" not in str(free)


@pytest.mark.long
def test_uncertain_constants_are_of_the_plants() -> None:
    region = fp.ExperimentRegion({"x": (0.1, 1.0), "u": (0.9, 1.0), "dt": (0.1, 3.0)})
    problem = GROWTH.replace(parameters=["p"], uncertain={"c": 0.4}, region=region)
    kept = fp.exchange(problem, 4, n_candidates=20, method=fp.ExchangeMethod(references=False), goal=fp.Goal(confidence=0.98))
    assert share(problem, kept) >= 0.98
    # The same points where c is known: more plants than asked can run them, so that it was c that kept them away.
    certain = fp.exchange(
        problem.replace(uncertain={}), 4, n_candidates=20, method=fp.ExchangeMethod(references=False), goal=fp.Goal(confidence=0.98)
    )
    assert share(problem, certain) < 0.98


def test_points_are_cut_where_all_plants_that_are_asked_run_them() -> None:
    plants, _ = drawn_plants(CYLINDER, 64, np.random.default_rng(0), 1.5)
    validity = Validity(CYLINDER, 1)
    validity.ask(plants)
    region = CYLINDER.region
    assert isinstance(region, fp.ExperimentRegion)
    points = region.draw_at_edges(CYLINDER.model, 300, seed=1)
    cut, found = validity.cut_for_plants(points, region.bounds["dt"][0])
    before = np.flatnonzero(found)
    assert 10 < len(cut) == len(before) and (cut.dt <= points.dt[before]).all() and (cut.dt < points.dt[before]).any()
    every = cut[np.repeat(np.arange(len(cut)), len(plants))]
    status = fp.simulate(CYLINDER.model, every, np.tile(plants, (len(cut), 1)), rtol=CYLINDER.rtol, jumps="exclude").status
    assert not np.isin(status, [fp.Status.left_domain, fp.Status.met_jump, fp.Status.not_finite]).any()
    # And not much earlier than needed: a little later some plant cannot.
    short = np.flatnonzero(cut.dt < points.dt[before])
    later = fp.Experiments(cut.x0[short], cut.u[short], np.minimum(1.02 * cut.dt[short] + 2e-4, points.dt[before][short]))
    every = later[np.repeat(np.arange(len(later)), len(plants))]
    status = fp.simulate(CYLINDER.model, every, np.tile(plants, (len(later), 1)), rtol=CYLINDER.rtol, jumps="exclude").status
    assert (status.reshape(len(later), -1) != fp.Status.ok).any(axis=1).mean() > 0.9


def test_wider_plants_deviate_so_many_times_as_far() -> None:
    near, _ = drawn_plants(GROWTH, 50, np.random.default_rng(3))
    far, _ = drawn_plants(GROWTH, 50, np.random.default_rng(3), 1.3)
    np.testing.assert_allclose(far - GROWTH.theta, 1.3 * (near - GROWTH.theta), rtol=1e-9)


def test_plants_deviate_further_until_not_too_many_are_lost() -> None:
    """A stand-in for a search: what it loses falls as plants deviate further, as the tail of a normal distribution."""
    settings = fp.exchange(
        GROWTH, 6, max_iterations=0, method=fp.ExchangeMethod(references=False), goal=fp.Goal(confidence=0.99)
    ).settings
    late, early = (fp.Experiments([[1.0]], [[0.0]], [dt]) for dt in (0.95, 0.8))  # x reaches 3 at p = 1.16, or 1.37
    for needed in (0.8, 1.0, 1.3, 1.7):
        away = Away(GROWTH, settings, Validity(GROWTH, 1))
        assert not away.enough(away.lost(late)) and away.enough(away.lost(early))
        tried = []
        while True:
            lost = float(ndtr(-2.5 * away.wider / needed))
            tried.append((away.enough(lost), lost))
            if not away.change(lost):
                break
        assert tried[-1][0] or any(enough for enough, _ in tried)
        assert 0.003 <= min((lost for enough, lost in tried if enough), key=lambda lost: abs(lost - 0.005)) <= 0.006
        assert len(tried) <= 6


def test_a_share_is_of_method_auto_alone() -> None:
    for problem, method in ((GROWTH, "paper"), (GROWTH.replace(output_covariance="pooled"), "auto")):
        with pytest.raises(ValueError, match=r"^confidence: expected method = \"auto\""):
            fp.exchange(problem, 6, method=method, goal=fp.Goal(confidence=0.9))
    for wrong in (-0.1, 1.0, 99.0):
        with pytest.raises(ValueError, match=r"^confidence: expected"):
            fp.exchange(GROWTH, 6, goal=fp.Goal(confidence=wrong))


def test_where_the_share_is_missed_the_first_warning_says_so() -> None:
    found = fp.exchange(GROWTH, 3, n_candidates=20, method=fp.ExchangeMethod(references=False))
    missed = fp.Design(**{**vars(found), "settings": replace(found.settings, goal=fp.Goal(confidence=0.99))})
    assert not missed.feasible
    assert "where 99.0 % was required" in str(missed)


def test_the_share_is_in_files(tmp_path: Path) -> None:
    design = fp.exchange(
        GROWTH, 4, n_candidates=20, max_iterations=30, method=fp.ExchangeMethod(references=False), goal=fp.Goal(confidence=0.9)
    )
    design.save(tmp_path)
    back = fp.Design.load(tmp_path)
    assert back.settings.goal.confidence == 0.9 and back.feasible == design.feasible
    text = (Path(__file__).parents[2] / "examples" / "cylinder.toml").read_text(encoding="utf-8")
    path = tmp_path / "cylinder.toml"
    path.write_text(text.replace("[design]", "[goal]\nconfidence = 0.95\n\n[design]", 1), encoding="utf-8")
    assert load_config(path).exchange_settings()["goal"].confidence == 0.95


def test_of_runs_the_share_is_the_same_key(tmp_path: Path) -> None:
    text = (Path(__file__).parents[2] / "examples" / "robot_joint.toml").read_text(encoding="utf-8")
    path = tmp_path / "joint.toml"
    path.write_text(text.replace("[design]", "[goal]\nconfidence = 0.95\n\n[design]", 1), encoding="utf-8")
    assert load_config(path).run_settings()["goal"].confidence == 0.95


def test_a_campaign_keeps_the_share() -> None:
    campaign = fp.Campaign(GROWTH, batch=4, targets=0.02, n_candidates=20, max_iterations=60, goal=fp.Goal(confidence=0.95))
    assert fp.feasibility(GROWTH, campaign.next(), draws=4000, seed=5).share >= 0.95
