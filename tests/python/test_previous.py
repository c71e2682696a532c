"""Information that is already collected: it is added to F, stays, and says no more than what was measured."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from defaults import KINDS, MODEL, NOISE, PRIOR, point, problem, same_bits, valid_points
from fisherpoint.data import Measurements
from fisherpoint.design.results.efficiency import random_designs
from fisherpoint.information.output_covariance import region_mean
from fisherpoint.information.previous import previous_information
from oracle import Floats

THETA = MODEL.theta(MODEL.nominal)
POINTS = valid_points(16, seed=5, jumps="exclude")
FIRST, SECOND = POINTS[:10], POINTS[10:]
QUICK: dict[str, Any] = {"n_candidates": 10, "max_iterations": 8, "seed": 1}
SOME = {"T_1": 1e-4, "A_A": 4e-6}
JUMPS = point(v=-1e-3, p_A=15e6, p_B=3e6)


def measured(points: fp.Experiments, *missing: tuple[int, int]) -> Measurements:
    """Exact outputs, but for those that are missing."""
    y = fp.simulate(MODEL, points, THETA).y.copy()
    for row, column in missing:
        y[row, column] = np.nan
    return Measurements(points, y)


def standardised(points: fp.Experiments) -> Floats:
    s: Floats = fp.sensitivities(MODEL, points, THETA).dy_dtheta * np.array(list(PRIOR.std.values()))
    return s


def same_information(a: fp.Evaluation, b: fp.Evaluation, rtol: float = 1e-9) -> None:
    size = np.sqrt(np.outer(np.diag(b.fisher), np.diag(b.fisher)))
    np.testing.assert_allclose(a.fisher / size, b.fisher / size, rtol=0, atol=rtol)
    assert a.log_det == pytest.approx(b.log_det, rel=1e-9)


@pytest.mark.parametrize("varies", [None, SOME], ids=["exact", "varies"])
@pytest.mark.parametrize("kind", KINDS)
def test_previous_points_count_as_all_others(kind: str, varies: dict[str, float] | None) -> None:
    given = problem(output_covariance=kind, varies=varies)
    together = fp.evaluate(given, POINTS)
    for previous in (FIRST, measured(FIRST), [FIRST[:4], measured(FIRST[4:])], (FIRST,)):
        evaluation = fp.evaluate(given, SECOND, previous=previous)
        same_information(evaluation, together)
        assert evaluation.standard_errors == pytest.approx(together.standard_errors, rel=1e-6)
        np.testing.assert_allclose(evaluation.output_covariance, together.output_covariance, rtol=1e-9)


def test_nothing_previous_is_the_same_to_the_last_bit() -> None:
    alone = fp.evaluate(problem(), POINTS)
    for nothing in (None, [], (), POINTS[:0]):
        assert same_bits(fp.evaluate(problem(), POINTS, previous=nothing).fisher, alone.fisher)
    design, other = (fp.exchange(problem(), 9, **QUICK, previous=nothing) for nothing in (None, []))
    assert same_bits(design.points.table, other.points.table) and same_bits(design.evaluation.fisher, other.evaluation.fisher)
    assert (other.n_previous, other.previous_left_out) == (0, {})


MISSING = ((0, 1), (2, 0), (2, 3), (5, 0), (5, 1), (5, 2))


@pytest.mark.parametrize("varies", [None, SOME], ids=["exact", "varies"])
@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "pooled"])
def test_what_was_not_measured_says_nothing(kind: str, varies: dict[str, float] | None) -> None:
    """F is the sum over what was measured, with the rows and columns of D_k that belong to it."""
    given = problem(output_covariance=kind, varies=varies)
    data = measured(FIRST, *MISSING)
    evaluation = fp.evaluate(given, SECOND, previous=data)
    r = np.diag(np.square(list(NOISE.values())))
    d = np.broadcast_to(r, (len(POINTS), 4, 4)).copy()
    if kind == "region":
        d += region_mean(given, 1)
    if kind == "pointwise":
        d += fp.predictive_covariance(MODEL, POINTS, PRIOR, given.rule).covariance
    if varies:
        d += fp.assumed_covariance(MODEL, POINTS, THETA, varies=varies).covariance
    there = np.concatenate([np.isfinite(data.y), np.ones((len(SECOND), 4), dtype=bool)])
    fisher = np.zeros((9, 9))
    for s_k, d_k, of_k in zip(standardised(POINTS), d, there, strict=True):
        fisher += 2 / len(POINTS) * s_k[of_k].T @ np.linalg.inv(d_k[np.ix_(of_k, of_k)]) @ s_k[of_k]
    size = np.sqrt(np.outer(np.diag(fisher), np.diag(fisher)))
    np.testing.assert_allclose(evaluation.fisher / size, fisher / size, rtol=0, atol=1e-6)
    assert evaluation.log_det == pytest.approx(np.linalg.slogdet(fisher)[1], abs=1e-4)
    assert evaluation.log_det < fp.evaluate(given, SECOND, previous=FIRST).log_det


def test_one_covariance_for_all_points_needs_all_outputs() -> None:
    with pytest.raises(ValueError, match=r"previous: expected all outputs measured for output_covariance 'pooled', given some"):
        fp.evaluate(problem(output_covariance="pooled"), SECOND, previous=measured(FIRST, *MISSING))


@pytest.mark.parametrize("kind", KINDS)
def test_the_search_never_removes_them(kind: str) -> None:
    given = problem(output_covariance=kind, varies=SOME)
    design = fp.exchange(given, 6, **QUICK, previous=measured(FIRST[:6]))
    assert (len(design.points), design.n_previous, design.previous_left_out) == (6, 6, {})
    assert not {row.tobytes() for row in FIRST.table} & {row.tobytes() for row in design.points.table}
    again = fp.evaluate(given, design.points, previous=FIRST[:6])
    same_information(design.evaluation, again)
    assert design.trace[-1].log_det == design.evaluation.log_det
    assert all(b.log_det >= a.log_det for a, b in zip(design.trace, design.trace[1:], strict=False))
    under_noise = fp.evaluate(given, design.points, previous=FIRST[:6], output_covariance="noise")
    assert design.under_noise is not None and under_noise is not None
    same_information(design.under_noise, under_noise)


def test_six_after_others_are_better_than_random_ones_after_the_same() -> None:
    given = problem()
    hydraulic = problem(parameters=("E_oil", "p_t", "B_v", "c_L"))
    known = fp.exchange(hydraulic, 6, n_candidates=50, max_iterations=60, method=fp.ExchangeMethod(references=False)).points[
        [*range(6)] * 4
    ]
    design = fp.exchange(given, 6, n_candidates=50, max_iterations=60, previous=known)
    rivals = random_designs(given, 6, 7, 1, previous_information(given, known, 1)[0])
    assert design.evaluation.log_det > rivals.max()
    assert design.efficiency is not None and design.efficiency.random_median is not None
    assert design.efficiency.random_median == pytest.approx(np.median(rivals), abs=1.0)
    assert design.efficiency.at_most is not None and design.efficiency.at_most > design.evaluation.log_det
    # Of those that know nothing of the others.
    blind = fp.exchange(given, 6, n_candidates=50, max_iterations=60, method=fp.ExchangeMethod(references=False))
    assert design.evaluation.log_det > fp.evaluate(given, blind.points, previous=known).log_det


def test_they_may_determine_what_too_few_new_points_cannot() -> None:
    design = fp.exchange(problem(), 1, **QUICK, method=fp.ExchangeMethod(references=False), previous=FIRST)
    assert design.evaluation.standard_errors is not None
    before = fp.evaluate(problem(), FIRST).standard_errors
    assert before is not None
    assert all(design.evaluation.standard_errors[name] < before[name] for name in before)


def test_a_search_after_points_of_which_an_output_was_never_measured() -> None:
    blind = measured(FIRST, *((k, 1) for k in range(len(FIRST))))
    design = fp.exchange(problem(), 3, **QUICK, method=fp.ExchangeMethod(references=False), previous=blind)
    same_information(design.evaluation, fp.evaluate(problem(), design.points, previous=blind))


def test_previous_points_that_are_none_are_counted() -> None:
    jumping, surface = fp.Experiments.join([JUMPS, FIRST]), point(v=0.0)
    given = problem(jumps="exclude")
    design = fp.exchange(given, 3, **QUICK, method=fp.ExchangeMethod(references=False), previous=[jumping, surface, JUMPS])
    assert design.previous_left_out == {"met_jump": 2, "starts on v = 0": 1}
    assert design.n_previous == len(FIRST)
    same_information(design.evaluation, fp.evaluate(given, design.points, previous=FIRST))
    with pytest.warns(UserWarning, match=r"previous: expected points that are valid at the prior mean, left out 1 met_jump"):
        fp.evaluate(given, SECOND, previous=jumping)
    text = " ".join(str(design).split())
    assert "3 experiment points beside 10 previous ones" in text
    assert "previous points left out 2 met_jump, 1 starts on v = 0" in text


def test_a_design_is_its_points_and_remembers_how_many_were_before(tmp_path: Path) -> None:
    given = problem(jumps="exclude")
    first = fp.exchange(given, 6, **QUICK, method=fp.ExchangeMethod(references=False))
    second = fp.exchange(given, 5, **QUICK, method=fp.ExchangeMethod(references=False), previous=[first, JUMPS])
    assert second.n_previous == 6
    same_information(second.evaluation, fp.evaluate(given, fp.Experiments.join([first.points, second.points])))
    second.save(tmp_path)
    loaded = fp.Design.load(tmp_path)
    assert (loaded.n_previous, loaded.previous_left_out) == (6, {"met_jump": 1})
    assert same_bits(loaded.evaluation.fisher, second.evaluation.fisher)
    third = fp.exchange(given, 4, **QUICK, method=fp.ExchangeMethod(references=False), previous=[first, loaded])
    assert third.n_previous == 11


@pytest.mark.parametrize(
    ("previous", "error", "expected"),
    [
        (3, TypeError, r"previous: expected Measurements, Experiments, Runs, a Design or a sequence of these, given int"),
        ([FIRST, "data.csv"], TypeError, r"previous: .* given str"),
        (fp.Experiments([[1.0]], [1.0], [1.0]), ValueError, r"previous: expected points of 5 states and 1 inputs, given 1 and 1"),
        (Measurements(FIRST, np.ones((10, 3))), ValueError, r"previous: expected measurements of 4 outputs, given 3"),
    ],
)
def test_mistakes(previous: Any, error: type[Exception], expected: str) -> None:
    with pytest.raises(error, match=expected):
        fp.exchange(problem(), 3, **QUICK, previous=previous)
    with pytest.raises(error, match=expected):
        fp.evaluate(problem(), SECOND, previous=previous)


@pytest.mark.parametrize("criterion", ["A", "D", "E"])
@pytest.mark.parametrize("text", ["a*b*u", "a*u + a*b*u"])
def test_a_search_beside_points_that_leave_the_same_open(text: str, criterion: str) -> None:
    """Information that is known in one direction alone must not become indefinite by rounding in the coordinates of a search."""
    model = fp.SymbolicModel([], [text], {}, dict.fromkeys("uv", "1"), dict.fromkeys("ab", "1"), {"y": "1"})
    for seed in range(6):
        rng = np.random.default_rng(seed)
        mean = {name: float(rng.uniform(0.5, 2.0)) for name in "ab"}
        region = fp.ExperimentRegion({name: (0.1, float(rng.uniform(0.5, 3.0))) for name in "uv"})
        prior = fp.GaussianPrior(mean, relative_std=dict.fromkeys("ab", 0.2))
        problem = fp.DesignProblem(model, prior, region, noise={"y": float(10 ** rng.uniform(-3, 0))})
        before = region.draw(model, 3, seed=rng)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            design = fp.exchange(
                problem,
                1 + seed,
                n_candidates=4,
                max_iterations=6,
                goal=fp.Goal(criterion),
                previous=before,  # type: ignore[arg-type]
            )
        assert design.evaluation.rank == 1
