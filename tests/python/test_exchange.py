"""The exchange algorithm: Phi never falls, and the choice is the best one."""

from __future__ import annotations

import itertools
import time
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from conftest import REGION
from defaults import KINDS, MODEL, NAMES, NOISE, OUTPUTS, PRIOR, SMALL, grid, problem, same_bits
from fisherpoint.basics.work_clock import Clock
from fisherpoint.design.points.exchange import designs
from fisherpoint.design.points.tuning import PaperSearchTuning
from fisherpoint.design.results.efficiency import median_of, random_designs
from fisherpoint.information.candidates import CandidateSource
from fisherpoint.information.point_information import PointInformation

QUICK: dict[str, Any] = {
    "n_experiments": 9,
    "n_candidates": 8,
    "max_iterations": 12,
    "method": fp.ExchangeMethod("paper", references=False),
}


# --- Phi ----------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("kind", "noise"), [(k, True) for k in KINDS] + [(k, False) for k in KINDS[1:]])
@pytest.mark.parametrize("seed", [0, 1])
def test_phi_never_falls(kind: str, noise: bool, seed: int) -> None:
    given = problem(output_covariance=kind, noise=NOISE if noise else None)
    if kind == "pointwise" and not noise:  # the three parameters of the rule give a piston that sticks no D of its own
        given = given.replace(jumps="exclude")
    design = fp.exchange(given, **QUICK, seed=seed)
    log_dets = [record.log_det for record in design.trace]
    assert all(b >= a for a, b in itertools.pairwise(log_dets))
    for before, record in itertools.pairwise(design.trace):
        assert record.exchanged == (record.log_det != before.log_det)
    assert any(record.exchanged for record in design.trace)
    assert [record.iteration for record in design.trace] == list(range(13))
    assert not design.trace[0].exchanged
    # The trace is what an evaluation from scratch says of the points; predictive covariances do not depend on the call.
    assert fp.evaluate(given, design.points).log_det == pytest.approx(log_dets[-1], abs=1e-9)
    assert design.evaluation.log_det == pytest.approx(log_dets[-1], abs=1e-9)
    assert len(design.points) == 9 and design.stop_reason == "max_iterations"


@pytest.mark.parametrize("kind", KINDS)
def test_more_iterations_only_continue(kind: str) -> None:
    given = problem(output_covariance=kind)
    short, long = (fp.exchange(given, **QUICK | {"max_iterations": n}) for n in (4, 9))
    values = [[(r.log_det, r.exchanged, r.drawn) for r in design.trace] for design in (short, long)]
    assert values[1][:5] == values[0]


@pytest.mark.parametrize("kind", KINDS)
def test_the_same_seed_gives_the_same_design(kind: str) -> None:
    first, second, other = (fp.exchange(problem(output_covariance=kind), **QUICK, seed=seed) for seed in (5, 5, 6))
    assert same_bits(first.points.table, second.points.table)
    assert first.rejected == second.rejected and first.drawn == second.drawn
    assert not np.array_equal(first.points.table, other.points.table)


def test_every_point_of_a_design_survives_on_the_grid_and_lies_in_the_region() -> None:
    rule = grid(a_tau=3, b_tau=3, E_oil=3, p_t=3)
    region = fp.ExperimentRegion(REGION, constraints=["p_A + p_B < 2.5e7"])
    for kind in KINDS:
        design = fp.exchange(problem(output_covariance=kind, rule=rule, region=region), **QUICK)
        points = design.points
        assert not fp.predictive_covariance(MODEL, points, PRIOR, rule).status.any()
        low, high = np.array(list(REGION.values())).T
        assert np.all((points.table >= low) & (points.table <= high))
        assert np.all(points.x0[:, 2] + points.x0[:, 3] < 2.5e7)


@pytest.mark.parametrize("kind", KINDS)
def test_a_design_beats_random_ones(kind: str) -> None:
    given = problem(output_covariance=kind)
    design = fp.exchange(given, n_experiments=9, n_candidates=20, max_iterations=40, method=fp.ExchangeMethod(references=False))
    source = CandidateSource(given, np.random.default_rng(99), threads=1)
    random = [fp.evaluate(given, source.draw_confirmed(9).points).log_det for _ in range(20)]
    assert design.evaluation.log_det > max(random)


# --- the choice ---------------------------------------------------------------------------------------------------------


def brute_force(given: fp.DesignProblem, seed: int, n_experiments: int, n_candidates: int) -> tuple[fp.Experiments, bool]:
    """One iteration of Algorithm 1, every Phi from scratch by (7) and (17); whether a point was exchanged."""
    pooled = given.output_covariance == "pooled"
    source = CandidateSource(given, np.random.default_rng(seed), threads=1)
    start = source.draw_confirmed(n_experiments).points
    candidates = (source.draw_confirmed if pooled else source.draw)(n_candidates).points
    columns = [NAMES.index(name) for name in given.estimated]
    std = np.array([PRIOR.std[name] for name in given.estimated])
    noise = np.diag([NOISE[name] ** 2 for name in OUTPUTS])

    def phi(points: fp.Experiments) -> float:
        s = fp.sensitivities(MODEL, points, MODEL.nominal).dy_dtheta[:, :, columns] * std
        c = fp.predictive_covariance(MODEL, points, PRIOR, given.rule, parameters=given.estimated).covariance
        d = noise + (c.mean(axis=0) if pooled else 0.0)
        total = sum(s_k.T @ np.linalg.inv(d) @ s_k for s_k in s)
        return float(np.linalg.det(2 / len(points) * total))

    def joined(candidate: fp.Experiments) -> fp.Experiments:
        table = np.vstack([start.table, candidate.table])
        return fp.Experiments(table[:, :5], table[:, 5:6], table[:, 6])

    def survives(candidate: fp.Experiments) -> bool:
        result = fp.predictive_covariance(MODEL, candidate, PRIOR, given.rule, parameters=given.estimated)
        return not result.status.any()

    for m in np.argsort([-phi(joined(candidate)) for candidate in candidates]):
        larger = joined(candidates[m])
        removals = [phi(larger[np.delete(np.arange(n_experiments + 1), k)]) for k in range(n_experiments + 1)]
        leaving = int(np.argmax(removals))
        if leaving == n_experiments:
            return start, False
        if survives(candidates[m]):
            rows = np.arange(n_experiments)
            rows[leaving] = n_experiments
            return larger[rows], True
    return start, False


@pytest.mark.parametrize("kind", ["noise", "pooled"])
def test_one_iteration_is_the_exhaustive_search(kind: str) -> None:
    given = problem(output_covariance=kind, parameters=["a_tau", "E_oil", "B_v"], rule=grid(a_tau=3, E_oil=3, B_v=3))
    outcomes = set()
    for seed in range(25):
        expected, exchanged = brute_force(given, seed, n_experiments=2, n_candidates=3)
        design = fp.exchange(
            given,
            2,
            n_candidates=3,
            max_iterations=1,
            seed=seed,
            method=fp.ExchangeMethod("paper", max_redraws=0, references=False, screen=False, local=0.0),
        )
        np.testing.assert_array_equal(design.points.table, expected.table)
        assert design.trace[-1].exchanged == exchanged
        outcomes.add(exchanged)
    assert outcomes == {True, False}  # both were tried


@pytest.mark.parametrize("kind", ["pooled", "pointwise"])
def test_screening_finds_the_same_design(kind: str) -> None:
    """In a region of which every point is valid on all nodes, so that both ways see the same candidates."""
    calm = dict(q=(0.1, 0.2), v=(0.1, 0.2), p_A=(8e6, 9e6), p_B=(12e6, 13e6), x_v=(0.2, 0.5), u=(-0.5, -0.2), dt=(1e-3, 3e-3))
    given = problem(output_covariance=kind, region=fp.ExperimentRegion(calm))
    screened, whole = (
        fp.exchange(given, 9, n_candidates=30, max_iterations=15, seed=3, method=fp.ExchangeMethod(references=False, screen=screen))
        for screen in (True, False)
    )
    assert not whole.rejected
    assert same_bits(screened.points.table, whole.points.table)
    assert sum(record.exchanged for record in whole.trace) > 5


def test_screening_asks_the_rule_for_the_best_few_only(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []
    confirm = CandidateSource.confirm

    def counted(self: CandidateSource, chosen: PointInformation) -> PointInformation:
        asked.append(len(chosen))
        return confirm(self, chosen)

    monkeypatch.setattr(CandidateSource, "confirm", counted)
    fp.exchange(
        problem(output_covariance="pooled"), 9, n_candidates=40, max_iterations=5, method=fp.ExchangeMethod(references=False)
    )
    shortlist = PaperSearchTuning().shortlist
    start = asked.index(shortlist)
    assert sum(asked[:start]) >= 9 and set(asked[start:]) == {shortlist}


# --- odd problems -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_too_few_points_for_the_parameters_still_give_the_best_that_can_be(kind: str) -> None:
    design = fp.exchange(problem(output_covariance=kind), **QUICK | {"n_experiments": 2, "method": "paper"})
    assert design.evaluation.log_det == -np.inf and design.evaluation.rank == 6
    assert len(design.evaluation.null_directions) == 3
    assert design.evaluation.standard_errors is None
    assert all(record.log_det == -np.inf for record in design.trace)
    assert any(record.exchanged for record in design.trace)
    assert design.efficiency is not None and not design.efficiency.below_random


def test_a_single_point_and_a_single_candidate() -> None:
    design = fp.exchange(
        problem(parameters=["B_v"]), 1, n_candidates=1, max_iterations=10, method=fp.ExchangeMethod(references=False)
    )
    assert len(design.points) == 1 and np.isfinite(design.evaluation.log_det)
    assert design.trace[-1].log_det > design.trace[0].log_det


def test_an_empty_region_is_an_error_that_counts_the_reason() -> None:
    region = fp.ExperimentRegion(REGION, constraints=["v > 1"])
    with pytest.raises(ValueError, match=r"region: expected valid points, given 0 of \d+ drawn \(\d+ constraint\)"):
        fp.exchange(problem(region=region), **QUICK)


@pytest.mark.parametrize("kind", KINDS)
def test_a_region_in_which_nothing_survives_is_an_error_that_counts_the_reasons(kind: str) -> None:
    region = fp.ExperimentRegion(REGION | {"p_A": (20.95e6, 20.99e6), "v": (-0.25, -0.2), "x_v": (0.5, 0.8), "u": (-1, -0.5)})
    started = time.perf_counter()
    with pytest.raises(ValueError, match=r"region: expected valid points, given 0 of \d+ drawn \(\d+ left_domain"):
        fp.exchange(problem(region=region, output_covariance=kind), **QUICK)
    assert time.perf_counter() - started < 10


@pytest.mark.parametrize("kind", KINDS)
def test_a_region_in_which_nothing_survives_on_the_grid_is_an_error(kind: str) -> None:
    region = fp.ExperimentRegion(REGION | {"p_A": (0.55e6, 0.6e6), "v": (-0.25, -0.2), "dt": (1e-5, 2e-5)})
    with pytest.raises(ValueError, match=r"region: expected points that are valid over the prior, given 0 of"):
        fp.exchange(problem(region=region, rule=grid(p_t=3), output_covariance=kind), **QUICK)


@pytest.mark.parametrize("surface", ["v", "x_v"])
def test_a_region_on_a_switching_surface_is_refused_by_name(surface: str) -> None:
    with pytest.raises(ValueError, match=rf"region\['{surface}'\]: expected bounds off .* {surface} = 0, given \(0, 0\)"):
        problem(region=fp.ExperimentRegion(REGION | {surface: (0.0, 0.0)}), kinks="exclude", jumps="exclude")
    rest = problem(region=fp.ExperimentRegion(REGION | {surface: (0.0, 0.0)}))
    assert surface in rest.crossed


def test_a_region_of_one_point_gives_that_point() -> None:
    one = {"q": 0.15, "v": 0.2, "p_A": 6e6, "p_B": 10e6, "x_v": 0.3, "u": -0.3, "dt": 2e-3}
    region = fp.ExperimentRegion({name: (value, value) for name, value in one.items()})
    design = fp.exchange(problem(region=region), 3, n_candidates=2, max_iterations=3, method=fp.ExchangeMethod(references=False))
    np.testing.assert_array_equal(design.points.table, [list(one.values())] * 3)
    assert design.distinct_points == 1 and not any(record.exchanged for record in design.trace)


# --- references ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_efficiencies_are_ratios_of_what_was_found(kind: str) -> None:
    design = fp.exchange(problem(output_covariance=kind), **QUICK | {"method": "paper"})
    e, under_noise = design.efficiency, design.under_noise
    assert e is not None and under_noise is not None
    assert e.under_noise == under_noise.log_det
    assert e.random_median is not None
    assert e.at_most is not None and e.n_candidates > 0
    assert e.at_least == pytest.approx(np.exp((e.under_noise - e.at_most) / 9)) and 0 < e.at_least < 1
    if kind == "noise":  # the design is what such a search finds
        assert e.best_found is e.vs_best is None
    else:
        assert e.best_found is not None and e.under_noise <= e.best_found < e.at_most
        assert e.vs_best == pytest.approx(np.exp((e.under_noise - e.best_found) / 9)) and 0 < e.vs_best <= 1
    assert e.vs_random == pytest.approx(np.exp((e.under_noise - e.random_median) / 9))
    assert e.below_random == (e.vs_random < 1)
    assert e.bound is None and e.vs_bound is None  # not every parameter varies over the nodes
    if kind == "noise":
        assert under_noise.log_det == design.evaluation.log_det


def test_a_design_is_there_before_what_it_is_compared_with() -> None:
    whole = fp.exchange(problem(), **QUICK | {"method": "paper"})
    first, last = designs(problem(), whole.settings)
    assert first.efficiency is None and last.efficiency == whole.efficiency is not None
    assert first.points == last.points == whole.points and first.stop_reason == last.stop_reason == whole.stop_reason
    (alone,) = designs(problem(), replace(whole.settings, method=replace(whole.settings.method, references=False)))
    assert alone.efficiency is None and alone.points == whole.points


def test_a_design_that_is_worse_than_random_is_said_to_be() -> None:
    """No iterations, and the worst of several random starts."""
    settings = QUICK | {"max_iterations": 0, "method": "paper"}
    found = [fp.exchange(problem(), **settings, seed=seed).efficiency for seed in range(6)]
    below = [e.below_random for e in found if e is not None]
    assert any(below)


def test_settings_are_kept() -> None:
    given = problem()
    design = fp.exchange(
        given,
        9,
        n_candidates=4,
        max_iterations=2,
        seed=7,
        method=fp.ExchangeMethod(patience=5, max_redraws=2, references=False, time_limit=60),
    )
    assert vars(design.settings) == {
        "n_experiments": 9,
        "goal": fp.Goal(),
        "method": fp.ExchangeMethod(patience=5, max_redraws=2, references=False, time_limit=60.0),
        "n_candidates": 4,
        "max_iterations": 2,
        "seed": 7,
    }
    assert design.problem is given and given.rule == SMALL
    assert design.seconds >= design.trace[-1].seconds


# --- random designs -----------------------------------------------------------------------------------------------------


def test_the_median_random_design_hardly_hangs_on_the_seed() -> None:
    given = problem(rule=fp.LinearizedRule(), output_covariance="noise")
    medians = np.array([median_of(random_designs(given, 9, seed, 1)) for seed in range(8)], dtype=float)
    assert np.exp(np.ptp(medians) / 9) < 1.1


def test_random_designs_share_no_point() -> None:
    """So that their log dets scatter as if each had been drawn alone."""
    given = problem(rule=fp.LinearizedRule(), output_covariance="noise")
    found = random_designs(given, 9, 0, 1)
    source = CandidateSource(given, np.random.default_rng(5), 1)
    alone = [fp.evaluate(given, source.draw(9).points).log_det for _ in range(200)]
    assert np.std(found) == pytest.approx(np.std(alone), rel=0.2)
    assert np.median(found) == pytest.approx(np.median(alone), abs=9 * 0.1)
    assert len(np.unique(found)) == len(found)


@pytest.mark.parametrize(("share", "median"), [(0.0, True), (0.4, True), (0.5, False), (1.0, True)])
def test_there_is_no_median_where_about_half_are_singular(share: float, median: bool) -> None:
    values = np.where(np.arange(400) < 400 * share, -np.inf, np.linspace(0, 1, 400))
    assert (median_of(values) is not None) is median


def test_the_time_limit_holds_for_random_designs_too() -> None:
    given = problem(rule=fp.LinearizedRule(), output_covariance="noise")
    assert 0 < len(random_designs(given, 9, 0, 1, clock=Clock(0.05))) < len(random_designs(given, 9, 0, 1))


def test_a_singular_start_is_left_for_a_point_that_tells_little_of_what_is_open() -> None:
    """b shows where u > 0.9 alone, by 1e-6 of its prior's information; a shows there by a hundredth of what it does at u = 0.

    det F of the points that tell both is not zero, however small, and that of all others is.
    """
    model = fp.SymbolicModel(
        [], ["a*(1 - u) + b*max(u - 0.9, 0)"], {}, {"u": "1"}, {"a": "1", "b": "1"}, {"y": "1"}, nominal={"a": 1.0, "b": 1.0}
    )
    prior = fp.GaussianPrior({"a": 1.0, "b": 1.0}, {"a": 1.0, "b": 0.01})
    given = fp.DesignProblem(model, prior, fp.ExperimentRegion({"u": (0.0, 1.0)}), noise={"y": 1.0})
    for seed in range(5):
        design = fp.exchange(
            given, n_experiments=2, n_candidates=60, max_iterations=2, seed=seed, method=fp.ExchangeMethod(references=False)
        )
        assert np.isfinite(design.evaluation.log_det)
        started_singular = np.isinf(design.trace[0].log_det)
        if started_singular:
            break
    assert started_singular
