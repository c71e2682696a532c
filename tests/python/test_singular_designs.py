"""Designs that do not determine all parameters: what can be estimated, what is left open, and what was added to F on the way."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.design.file.configuration import load_config
from fisherpoint.design.goal.determinant import Determinant
from fisherpoint.design.goal.estimability import RUNS, restricted_criteria
from fisherpoint.design.goal.variance import Variance
from fisherpoint.information.combinations import combination
from fisherpoint.information.null_space import null_directions
from test_exact_criteria import blind

QUICK: dict[str, Any] = {"n_candidates": 10, "max_iterations": 30}
SPAN = np.array([[1.0, 2.0, 0.0], [0.0, 0.0, 1.0]]).T / np.array([np.sqrt(5.0), 1.0])
"""What points of `blind` determine: a + b, and c, in units of the prior std 1, 2 and 1/2."""


def by_hand(points: fp.Experiments) -> float:
    """log det of F over what is determined, (7)."""
    rows = points.u @ np.array([[1.0, 2.0, 0.0], [0.0, 0.0, 0.5]])
    return float(np.linalg.slogdet(2 / len(points) * SPAN.T @ rows.T @ rows @ SPAN)[1])


def words(shown: object) -> str:
    return " ".join(str(shown).split())


# --- what no point tells about --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", ("auto", "paper"))
def test_a_design_of_an_unidentifiable_model_is_for_the_rest(method: str, tmp_path: Path) -> None:
    design = fp.exchange(blind(), 6, method=method, **QUICK)
    efficiency, evaluation = design.efficiency, design.evaluation
    assert evaluation.log_det == -np.inf and evaluation.rank == 2 and not design.too_few
    assert evaluation.log_det_estimable == pytest.approx(by_hand(design.points), abs=1e-9)
    assert design.value == pytest.approx(by_hand(design.points) + 2 * np.log(3), abs=1e-9)
    (null,) = design.not_estimable
    assert null == pytest.approx({"a": 1.0, "b": -0.5})
    # On the circle with half of the points' squares along u: det of diag(5 sum u^2, sum v^2 / 4) / 3
    best = np.log(5 * 3 / 3) + np.log(3 / 4 / 3)
    assert efficiency is not None and efficiency.under_noise == pytest.approx(by_hand(design.points), abs=1e-9)
    assert efficiency.at_most == pytest.approx(best, abs=0.02) and efficiency.at_most > by_hand(design.points) - 1e-9
    assert efficiency.at_least is not None and (0.99 if method == "auto" else 0.9) < efficiency.at_least <= 1 + 1e-9
    assert efficiency.at_least == pytest.approx(np.exp((by_hand(design.points) - efficiency.at_most) / 2), rel=1e-9)
    assert efficiency.vs_random is not None and efficiency.vs_random > 1
    told = words(design)
    assert "No point of the region was found with information on 1.00 a - 0.50 b (in prior std)" in told
    assert "log det F of the rest" in told and "docs/how_to/singular.md" in told
    assert design.ridge == (0.0 if method == "auto" else 1e-9) and ("added to F while singular" in told) == bool(design.ridge)
    design.save(tmp_path)
    back = fp.Design.load(tmp_path)
    assert back.not_estimable == design.not_estimable and back.ridge == design.ridge and str(back) == str(design)
    assert back.evaluation.log_det_estimable == evaluation.log_det_estimable


def test_without_references_it_is_named_too() -> None:
    for method in ("auto", "paper"):
        design = fp.exchange(blind(), 6, method=fp.ExchangeMethod(method, references=False), **QUICK)
        assert len(design.not_estimable) == 1 and "information on 1.00 a - 0.50 b" in words(design)


def test_over_the_prior_what_is_determined_is_of_each_scenario() -> None:
    """Only a b can be told, so that what is left open is another direction in each scenario."""
    model = fp.SymbolicModel([], ["a*b*u + c*v"], {}, dict.fromkeys("uv", "1"), dict.fromkeys("abc", "1"), {"y": "1"})
    prior = fp.GaussianPrior(mean=dict.fromkeys("abc", 1.0), std=dict.fromkeys("abc", 0.5))
    region = fp.ExperimentRegion({"u": (-1, 1), "v": (-1, 1)}, constraints=["u**2 + v**2 < 1"])
    given = fp.DesignProblem(model, prior, region, noise={"y": 1.0})
    scenarios = [{"a": 1.0}, {"a": 2.0}, {"b": 0.5}]
    design = fp.exchange(given, 4, goal=fp.Goal(over=fp.OverPrior("log", scenarios=scenarios)), **QUICK)
    values = []
    for one in scenarios:
        a, b = one.get("a", 1.0), one.get("b", 1.0)
        u, v = design.points.u.T
        rows = np.stack([u * np.hypot(a, b), v], axis=1) * 0.5
        values.append(np.linalg.slogdet(rows.T @ rows / 2)[1])
    assert design.scenarios is not None and design.scenarios.value == pytest.approx(np.mean(values), abs=1e-6)
    assert design.efficiency is not None and design.efficiency.at_least is not None
    assert 0.95 < design.efficiency.at_least <= 1 + 1e-9


def test_nothing_at_all_is_an_error() -> None:
    model = fp.SymbolicModel([], ["a*u"], {}, {"u": "1"}, {"a": "1"}, {"y": "1"})
    prior = fp.GaussianPrior(mean={"a": 1.0}, std={"a": 1.0})
    given = fp.DesignProblem(model, prior, fp.ExperimentRegion({"u": (0, 0)}), noise={"y": 1.0})
    with pytest.raises(ValueError, match=r"^region: expected points that determine criterion 'D'.* on 1.00 a"):
        fp.exchange(given, 2, **QUICK)


# --- too few points -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", ("auto", "paper"))
def test_of_too_few_points_no_efficiency_is_claimed(method: str, tmp_path: Path) -> None:
    design = fp.exchange(blind(), 1, method=method, **QUICK)
    assert design.too_few and len(design.not_estimable) == 1 and len(design.evaluation.null_directions) == 2
    assert design.efficiency is not None and design.efficiency.at_least is None and design.efficiency.at_most is None
    assert not design.efficiency.below_random and design.ridge == 1e-9
    told = words(design)
    assert "1 point with 1 output are too few for the 2 that points of the region can determine" in told
    assert "no efficiency is claimed" in told and "at least" not in told.split("Plants")[0]
    assert "1e-9 of the prior's information" in told and "no figure here contains it" in told
    # u tells most: by 5 times u^2 against a quarter of v^2
    u, v = design.points.u[0]
    assert abs(u) > (0.9 if method == "auto" else 0.6)
    assert design.evaluation.log_det_estimable == pytest.approx(np.log(2 * (5 * u**2 + v**2 / 4)))
    design.save(tmp_path)
    assert str(fp.Design.load(tmp_path)) == str(design)


def test_previous_points_close_what_few_points_leave_open() -> None:
    before = fp.Experiments(np.zeros((1, 0)), np.array([[0.0, 0.9]]))
    design = fp.exchange(blind(), 1, previous=before, goal=fp.Goal(singular="estimable"), **QUICK)
    assert not design.too_few and abs(design.points.u[0, 0]) > 0.99
    assert design.efficiency is not None and design.efficiency.at_least == pytest.approx(1, abs=0.01)


# --- an error in its place ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", ("auto", "paper"))
def test_one_error_says_what_is_open_and_what_helps(method: str) -> None:
    asked: dict[str, Any] = QUICK | {"method": fp.ExchangeMethod(method, references=False), "goal": fp.Goal(singular="error")}
    with pytest.raises(
        ValueError, match=r"^region: .*'error'.* information on 1.00 a - 0.50 b, in prior std: estimate fewer.*outputs"
    ):
        fp.exchange(blind(), 6, **asked)
    identified = blind().replace(parameters=["a", "c"])
    with pytest.raises(ValueError, match=r"^n_experiments: .*2 parameters.*given 1, which leave some.*take more points"):
        fp.exchange(identified, 1, **asked)
    assert np.isfinite(fp.exchange(identified, 2, **asked).evaluation.log_det)
    assert fp.exchange(blind(), 4, goal=fp.Goal("c", of="a + b", singular="error"), **QUICK).settings.goal.singular == "error"
    with pytest.raises(ValueError, match=r"^singular: expected 'estimable' or 'error', given 'ridge'"):
        fp.exchange(blind(), 6, goal=fp.Goal(singular="ridge"))


def test_approximate_designs_and_sweeps_raise_it_too() -> None:
    with pytest.raises(ValueError, match=r"^candidates: .*'error'.* information on 1.00 a - 0.50 b, in prior std"):
        fp.approximate_design(blind(), n_candidates=50, starts=5, goal=fp.Goal(singular="error"))
    for method in ("auto", "paper"):
        with pytest.raises(ValueError, match=r"^region: .*'error'.* information on 1.00 a - 0.50 b"):
            fp.sweep(blind(), (4, 6), goal=fp.Goal(singular="error"), method=method, **QUICK)
    with pytest.raises(ValueError, match=r"^region: .*'error'.* information on 1.00 a - 0.50 b"):
        fp.Campaign(blind(), 4, goal=fp.Goal(singular="error"), **QUICK).next()


def test_a_file_says_it(tmp_path: Path) -> None:
    path = tmp_path / "one.toml"
    text = Path("examples/michaelis_menten.toml").read_text(encoding="utf-8")
    path.write_text(text.replace("[design]", '[goal]\nsingular = "error"\n\n[design]', 1), encoding="utf-8")
    assert load_config(path).exchange_settings()["goal"].singular == "error"


# --- several sizes --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", ("auto", "paper"))
def test_a_sweep_is_of_what_can_be_estimated(method: str, tmp_path: Path) -> None:
    found = fp.sweep(blind(), range(1, 6), method=method, **QUICK)
    assert [null == pytest.approx({"a": 1.0, "b": -0.5}) for null in found.not_estimable] == [True]
    assert found[1].information == -np.inf and found[1].at_least is None and found[1].level == 2
    for size in range(2, 6):
        assert found[size].information == pytest.approx(by_hand(found[size].points) + 2 * np.log(size / 2), abs=1e-9)
        assert found[size].mean_error == pytest.approx(np.exp(-found[size].information / 4))
        at_least = found[size].at_least
        assert at_least is not None and (0.85 if method == "auto" else 0.5) < at_least <= 1 + 1e-9
    assert found.knee is not None and found.n_candidates > 100
    told = words(found)
    assert "rank 1 of 2 that are possible" in told and "information on 1.00 a - 0.50 b (in prior std)" in told and "-inf" in told
    found.save(tmp_path / "sweep.json")
    assert str(fp.Sweep.load(tmp_path / "sweep.json")) == str(found)


# --- what it is made of ---------------------------------------------------------------------------------------------------------


def test_the_objective_of_what_is_determined_is_log_det_in_any_coordinates() -> None:
    rng = np.random.default_rng(0)
    span = np.linalg.qr(rng.standard_normal((4, 3)))[0]
    rows = rng.standard_normal((9, 3)) @ span.T
    fisher, columns = rows[:5].T @ rows[:5], rows[5:, :, None].transpose(1, 2, 0)
    criterion = Determinant("D", np.eye(4), True).restricted(span)
    assert criterion.of_all and not criterion.plain and criterion.level == 3

    def value(matrix: np.ndarray) -> float:
        return float(np.linalg.slogdet(span.T @ matrix @ span)[1])

    assert criterion.objective(fisher) == pytest.approx(value(fisher))
    factor = np.linalg.cholesky(fisher + np.eye(4))
    inside = criterion.in_coordinates(factor)
    moved = np.linalg.solve(factor, np.linalg.solve(factor, fisher).T)
    there = np.linalg.solve(factor, columns[:, 0])[:, None]
    for one, f, w in ((criterion, fisher, columns), (inside, moved, there)):
        expected = [value(fisher + columns[:, :, k] @ columns[:, :, k].T) for k in range(4)]
        np.testing.assert_allclose(np.log(one.added(f, w)) + one.offset(f, factor), expected, rtol=1e-9)
    found, slope = criterion.objective_slope(fisher, rows)
    step = 1e-6 * np.outer(rows[7], rows[7])
    assert found == pytest.approx(value(fisher))
    assert slope[7] @ rows[7] == pytest.approx((value(fisher + step) - value(fisher - step)) / 2e-6, rel=1e-6)


def test_directions_are_told_in_full() -> None:
    assert combination({"a": 1.0, "b": -0.02, "c": 0.5, "d": 1e-3}) == "1.00 a + 0.50 c - 0.02 b (and less than 1 % of d)"
    assert combination({"a": -1.0, "b": -0.0123}) == "1.00 a + 0.012 b"
    names, length = ("a", "b", "c", "d"), np.ones(4)
    mixed = np.linalg.qr(np.random.default_rng(0).standard_normal((2, 2)))[0] @ np.array([[0.6, -0.8, 0, 0], [0, 0, 0, 1.0]])
    assert sorted(map(combination, null_directions(mixed, length, names))) == ["1.00 b - 0.75 a", "1.00 d"]


@pytest.mark.parametrize("size", (1e-6, 1e6))
def test_what_can_be_estimated_does_not_depend_on_sizes(size: float) -> None:
    """c is told by little or much; beside it, only a + b shows."""
    given, points = blind(), fp.Experiments(np.zeros((4, 0)), np.array([[1.0, 0.0], [0.6, 0.7], [0.1, 0.9], [0.3, -0.9]]))
    prior = fp.GaussianPrior(mean=dict(given.prior.mean), std={"a": 1.0, "b": 2.0, "c": 0.5 * size})
    other = given.replace(prior=prior)
    told, there = (fp.evaluate(one, points).log_det_estimable for one in (given, other))
    assert told is not None and there == pytest.approx(told + 2 * np.log(size), abs=1e-6)
    design = fp.exchange(other, 6, **QUICK)
    assert design.efficiency is not None and design.efficiency.at_least is not None
    assert 0.98 < design.efficiency.at_least <= 1 + 1e-9 and design.ridge == 0.0
    found = fp.evaluate(given, design.points).log_det_estimable
    assert found is not None and found > np.log(5 / 4) - 0.02


# --- how much few points can determine -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("among", (1, 1000))
def test_one_candidate_among_many_may_tell_more(among: int) -> None:
    """Two of them can determine three parameters, as one tells of two: that is no error."""
    rows = np.zeros((1, among + 2, 2, 3))
    rows[0, :, 0, 2] = 1.0
    rows[0, 1, :, :2] = np.eye(2)
    asked = Variance("A", np.eye(3), True)
    criteria, _ = restricted_criteria(blind(), [asked], rows, np.zeros((1, 3, 3)), 2, "error", RUNS)
    assert criteria[0].name == "A"
    with pytest.raises(ValueError, match="as singular = 'error' requires, given 1, which leave some"):
        restricted_criteria(blind(), [asked], rows, np.zeros((1, 3, 3)), 1, "error", RUNS)


def test_what_is_known_counts_however_well_it_is_known() -> None:
    rows = np.zeros((1, 5, 1, 3))
    rows[0, :, 0, 2] = 1.0
    known = np.diag([1e22, 1.0, 0.0])[None]
    criteria, spaces = restricted_criteria(blind(), [Variance("A", np.eye(3), True)], rows, known, 1, "error", RUNS)
    assert criteria[0].name == "A" and spaces[0].rank == 3
