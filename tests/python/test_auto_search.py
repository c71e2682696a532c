"""Method "auto": it finds optimal designs that are known, keeps what every search promises, and is never worse than its starts."""

from __future__ import annotations

import itertools
import os
import signal
import threading
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from conftest import REGION
from defaults import MODEL, problem, same_bits
from fisherpoint.design.candidates.rank_updates import gains
from fisherpoint.design.goal.determinant import Determinant
from fisherpoint.design.goal.scenario_average import Average
from fisherpoint.design.points.auto_search import AutoSearch
from fisherpoint.design.points.pool import best_of_each, far_apart
from fisherpoint.design.points.pool_exchange import PoolExchange, greedy
from fisherpoint.design.points.tuning import PointSearchTuning
from fisherpoint.design.results.settings import ExchangeSettings
from fisherpoint.engine.levels import kernels
from fisherpoint.information.candidates import CandidateSource
from fit_cases import EXAMPLES
from test_known_designs import CASES, ONE_FACTOR, SOON, SQUARE, ZERO, linear, log_det_m, quadratic
from test_known_designs import problem as known_problem

QUICK: dict[str, Any] = {"method": fp.ExchangeMethod(references=False), "n_experiments": 9, "n_candidates": 8, "max_iterations": 24}

SETTINGS: dict[str, Any] = {
    "n_experiments": 9,
    "n_candidates": 8,
    "max_iterations": 0,
    "seed": 0,
    "method": fp.ExchangeMethod(patience=None, max_redraws=1, references=False),
}


# --- exchange over a pool ----------------------------------------------------------------------------------------------


def columns(rng: np.random.Generator, p: int, n: int, count: int) -> np.ndarray:
    scales = 10.0 ** np.arange(p)
    return rng.standard_normal((p, n, count)) * scales[:, None, None]


@pytest.mark.parametrize(("p", "n", "count"), [(3, 1, 40), (4, 3, 60), (2, 5, 30), (3, 2, 8000)])
def test_gains_are_ratios_of_determinants(p: int, n: int, count: int) -> None:
    rng = np.random.default_rng(p)
    w = columns(rng, p, n, count)
    fisher = np.einsum("pnk,qnk->pq", w[:, :, :6], w[:, :, :6])
    found, some = gains(fisher, w), [0, 7, count - 1]
    expected = [np.linalg.slogdet(fisher + w[:, :, k] @ w[:, :, k].T)[1] - np.linalg.slogdet(fisher)[1] for k in some]
    np.testing.assert_allclose(np.log(found[some]), expected, rtol=1e-8, atol=1e-10)
    factor = np.linalg.cholesky(fisher)
    np.testing.assert_allclose(np.tensordot(factor, kernels.divided(factor, w), 1), w, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("fixed", [0.0, 2.0])
@pytest.mark.parametrize("size", [3, 4])
def test_an_exchange_ends_where_no_single_one_gains(size: int, fixed: float) -> None:
    """Also with as few points as parameters, where F is singular without any of them."""
    rng, p = np.random.default_rng(size), 3
    w = columns(rng, p, 1, 25)
    known = fixed * np.diag(10.0 ** np.arange(p)) ** 2

    def value(chosen: np.ndarray) -> float:
        own = w[:, 0, chosen]
        return float(np.linalg.slogdet(own @ own.T + known)[1])

    criteria = [Determinant("D", np.eye(p), True)]
    for start in (np.arange(size), greedy(w[None], size, known[None], Average.of_all(1), criteria)):
        exchange = PoolExchange(w[None], start, known[None], Average.of_all(1), criteria)
        exchange.run(np.arange(25), lambda: False)
        assert value(exchange.chosen) >= value(start)
        assert not len(exchange.promising(np.arange(25), 5))
        for place, other in itertools.product(range(size), range(25)):
            changed = exchange.chosen.copy()
            changed[place] = other
            assert value(changed) <= value(exchange.chosen) + 1e-5
    best = max(value(np.array(chosen)) for chosen in itertools.combinations_with_replacement(range(25), size))
    assert value(exchange.chosen) > best - 0.5


@pytest.mark.parametrize("share", [1.0, 0.5])
def test_what_candidates_gain_beside_a_design(share: float) -> None:
    """In two scenarios, of which the mean counts or the worse one."""
    rng = np.random.default_rng(3)
    w = np.stack([columns(rng, 3, 2, 30) for _ in range(2)])
    known, criteria = np.zeros((2, 3, 3)), [Determinant("D", np.eye(3), True)] * 2
    exchange = PoolExchange(w, np.arange(5), known, Average(np.ones(2), share), criteria)

    def value(k: int | None) -> float:
        chosen = [*range(5), *([] if k is None else [k])]
        own = [one[:, :, chosen].reshape(3, -1) for one in w]
        log_dets = [np.linalg.slogdet(f @ f.T)[1] for f in own]
        return float(np.mean(log_dets) if share == 1.0 else min(log_dets))

    found = np.log(exchange.gains(np.arange(30)))
    np.testing.assert_allclose(found, [value(k) - value(None) for k in range(30)], rtol=1e-7, atol=1e-9)


# --- candidates that climb ------------------------------------------------------------------------------------------------


def test_peaks_are_the_best_that_are_far_apart() -> None:
    rng, apart = np.random.default_rng(0), 0.2
    table, gains, width = rng.random((500, 3)) * [1.0, 10.0, 0.0], rng.random(500), np.array([1.0, 10.0, 0.0])
    chosen = far_apart(table, width, gains, 500, apart)
    assert chosen[0] == np.argmax(gains) and (np.diff(gains[chosen]) <= 0).all()

    def near(k: int, other: np.ndarray) -> np.ndarray:
        return (np.abs((table[other] - table[k])[:, :2] / width[:2]) <= apart).all(axis=1)

    for place, k in enumerate(chosen):
        assert near(k, chosen).sum() == 1
        # Whatever gains more than the next one is near to one that was chosen before.
        before = np.flatnonzero(gains > gains[k])
        assert all(near(other, chosen[:place]).any() for other in before)
    np.testing.assert_array_equal(far_apart(table, width, gains, 3, apart), chosen[:3])


def test_the_best_of_each() -> None:
    gains, of = np.array([3.0, 5.0, 4.0, 1.0, 2.0, 9.0]), np.array([0, 0, 0, 1, 1, 2])
    least = np.array([3.0, 0.0, 9.0])
    assert sorted(best_of_each(gains, of, least, 1)) == [1, 4]
    assert sorted(best_of_each(gains, of, least, 2)) == [1, 2, 3, 4]
    assert sorted(best_of_each(gains, of, 0 * least, 9)) == [0, 1, 2, 3, 4, 5]


def test_candidates_climb_and_stay_valid() -> None:
    given = problem(region=fp.ExperimentRegion(REGION, constraints=["p_A + p_B < 1.5e7"]), jumps="exclude")

    def climbed(rounds: int) -> tuple[np.ndarray, fp.Experiments]:
        """Gains and points of what is valid after so many rounds."""
        tuning = replace(PointSearchTuning(), climb=replace(PointSearchTuning().climb, rounds=rounds))
        search = AutoSearch(given, ExchangeSettings(**SETTINGS), 1, tuning=tuning)
        design, pool = search.best.information, search._pool(search.source.draw_at_edges(1000))
        climbing = search._climbed(design, pool)
        for _ in range(rounds):
            next(climbing)
        with pytest.raises(StopIteration) as end:
            next(climbing)
        peaks = end.value.value
        assert len(peaks) <= tuning.climbing_candidates * SETTINGS["n_candidates"]
        peaks = peaks[np.flatnonzero(peaks.valid == 1)]
        return search._gains(design, peaks.columns), peaks.information.experiments

    before, _ = climbed(0)
    after, points = climbed(3 * PointSearchTuning().unchecked_rounds)
    assert len(after) >= len(before) > 5 and np.sort(after)[-5:].mean() > 2 * np.sort(before)[-5:].mean()
    assert np.all(points.x0[:, 2] + points.x0[:, 3] < 1.5e7)
    assert not fp.predictive_covariance(MODEL, points, given.prior, given.rule, jumps="exclude").status.any()


# --- known designs ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("copies", [1, 3])
@pytest.mark.parametrize("name", ONE_FACTOR)
def test_designs_in_one_variable(name: str, copies: int) -> None:
    model, mean, bounds, count = ONE_FACTOR[name]
    given = known_problem(model, mean, bounds)
    design = fp.exchange(given, copies * count, n_candidates=20, max_iterations=60, method=fp.ExchangeMethod(references=False))
    assert log_det_m(given, design.evaluation) == pytest.approx(CASES[name]["log_det_M"], abs=1e-5)


def test_a_linear_state_space_model() -> None:
    given = known_problem(linear, {"a": 1, "b": 1}, {"x": (-1, 1), "u": (-1, 1), "dt": (SOON, 5)})
    for seed in range(3):
        design = fp.exchange(given, 4, n_candidates=20, max_iterations=60, seed=seed, method=fp.ExchangeMethod(references=False))
        assert log_det_m(given, design.evaluation) == pytest.approx(CASES["linear state space"]["log_det_M"], abs=1e-5)


@pytest.mark.parametrize("count", [6, 7, 8])
def test_exact_designs_of_a_quadratic_in_two_factors(count: int) -> None:
    """The best of all designs, by enumeration, from every seed."""
    best = CASES["full quadratic in two factors on the 3 x 3 grid, continuous"]["log_det_M"]
    expected = CASES["same, exact by exhaustive search"]["D_efficiency"][str(count)]
    given = known_problem(quadratic, ZERO, SQUARE)
    for seed in range(3):
        design = fp.exchange(
            given, count, n_candidates=20, max_iterations=30, seed=seed, method=fp.ExchangeMethod(references=False)
        )
        assert np.exp((log_det_m(given, design.evaluation) - best) / 6) == pytest.approx(expected, abs=1e-4)


# --- what every search promises -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["noise", "region"])
def test_the_best_never_gets_worse_and_is_what_it_says(kind: str) -> None:
    given = problem(output_covariance=kind)
    design = fp.exchange(given, **QUICK)
    log_dets = [record.log_det for record in design.trace]
    assert all(b >= a for a, b in itertools.pairwise(log_dets)) and log_dets[-1] > log_dets[0]
    for before, record in itertools.pairwise(design.trace):
        assert record.exchanged == (record.log_det != before.log_det)
    assert fp.evaluate(given, design.points).log_det == pytest.approx(log_dets[-1], abs=1e-9)
    assert design.drawn == design.accepted + sum(design.rejected.values())


@pytest.mark.long
@pytest.mark.parametrize("kind", ["noise", "region"])
def test_it_finds_more_than_the_method_of_the_paper(kind: str) -> None:
    """As the defaults are, where its iterations are more work; here they have fewer candidates."""
    given = problem(output_covariance=kind)
    for seed in range(2):
        auto = fp.exchange(given, 9, method=fp.ExchangeMethod(references=False), n_candidates=20, max_iterations=100, seed=seed)
        paper = fp.exchange(given, 9, method=fp.ExchangeMethod("paper", references=False), seed=seed)
        assert auto.evaluation.log_det > paper.evaluation.log_det + 0.2


@pytest.mark.parametrize("kind", ["noise", "region"])
def test_the_same_bits_for_a_seed_and_any_number_of_threads(kind: str) -> None:
    given = problem(output_covariance=kind)
    one, three, other = (fp.exchange(given, **QUICK, threads=n, seed=s) for n, s in ((1, 5), (3, 5), (1, 6)))
    assert same_bits(one.points.table, three.points.table)
    assert [r.log_det for r in one.trace] == [r.log_det for r in three.trace] and one.rejected == three.rejected
    assert not np.array_equal(one.points.table, other.points.table)


@pytest.mark.parametrize("kind", ["pooled", "pointwise"])
def test_where_covariances_are_needed_it_is_the_search_of_the_paper(kind: str) -> None:
    given, settings = problem(output_covariance=kind), QUICK | {"max_iterations": 4}
    auto, paper = (fp.exchange(given, **settings | {"method": method}) for method in ("auto", "paper"))
    assert same_bits(auto.points.table, paper.points.table) and auto.settings.method.name == "auto"


@pytest.mark.parametrize("jumps", ["cross", "exclude"])
def test_points_obey_constraints_and_survive_on_all_nodes(jumps: str) -> None:
    """Also after rounds and an ascent, as with so few iterations there is one start alone."""
    region = fp.ExperimentRegion(REGION, constraints=["p_A + p_B < 1.5e7"])
    given = problem(region=region, jumps=jumps)
    design = fp.exchange(given, **QUICK)
    low, high = np.array(list(REGION.values())).T
    assert np.all((design.points.table >= low) & (design.points.table <= high))
    assert np.all(design.points.x0[:, 2] + design.points.x0[:, 3] < 1.5e7)
    assert not fp.predictive_covariance(MODEL, design.points, given.prior, given.rule, jumps=jumps).status.any()
    assert design.rejected["constraint"] > 0


@pytest.mark.long
def test_candidates_that_plants_cannot_run_are_sampled_earlier(monkeypatch: pytest.MonkeyPatch) -> None:
    """The best points start at edges of the region and lie where some plants just can run them; few of what is drawn does."""
    given = fp.load_problem(EXAMPLES / "cylinder.toml").replace(jumps="exclude")

    def found(tuning: PointSearchTuning) -> float:
        values = []
        for seed in range(1, 4):
            settings = ExchangeSettings(n_experiments=12, seed=seed, n_candidates=50, max_iterations=80)
            search = AutoSearch(given, settings, 2, tuning=tuning)
            search.run(None)
            values.append(search.best.log_det)
        return float(np.mean(values))

    usual = PointSearchTuning()
    earlier = found(usual)
    monkeypatch.setattr(CandidateSource, "draw_at_edges", CandidateSource.draw)
    assert earlier > found(replace(usual, climb=replace(usual.climb, shortened_per_point=0))) + 0.1


def test_an_ascent_moves_points_and_keeps_them_valid() -> None:
    given = problem(region=fp.ExperimentRegion(REGION, constraints=["p_A + p_B < 1.5e7"]))
    search = AutoSearch(given, ExchangeSettings(**SETTINGS), 1)
    points = search._ascended(search.best.information).experiments
    assert fp.evaluate(given, points).log_det > search.best.log_det + 1
    assert np.all(points.x0[:, 2] + points.x0[:, 3] < 1.5e7)
    assert not fp.predictive_covariance(MODEL, points, given.prior, given.rule).status.any()


def test_previous_points_are_counted() -> None:
    """One more point beside those of a growth curve is at the end of the interval; alone it would be elsewhere."""
    model, mean, _, _ = ONE_FACTOR["saturating growth"]
    given = known_problem(model, mean, {"y": (0, 0), "dt": (SOON, 10)}, sigma=0.1)
    times = np.array([1, 2, 3, 4, 5, 7.0])
    previous = fp.Experiments(np.zeros((6, 1)), np.zeros((6, 0)), times)
    design = fp.exchange(
        given, 1, method=fp.ExchangeMethod(references=False), n_candidates=20, max_iterations=40, previous=previous
    )
    assert design.points.dt[0] == pytest.approx(10.0, abs=1e-6) and design.n_previous == 6
    beside = fp.Experiments.join([previous, design.points])
    assert design.evaluation.log_det == pytest.approx(fp.evaluate(given, beside).log_det, abs=1e-9)


def test_a_singular_design_determines_what_it_can() -> None:
    model = fp.SymbolicModel([], ["a*u + b*v/100 + c*w"], {}, dict.fromkeys("uvw", "1"), dict.fromkeys("abc", "1"), {"y": "1"})
    prior = fp.GaussianPrior(mean=dict.fromkeys("abc", 1.0), std=dict.fromkeys("abc", 1.0))
    region = fp.ExperimentRegion({"u": (0, 1), "v": (0, 1), "w": (0, 0)}, constraints=["u + v < 1"])
    given = fp.DesignProblem(model, prior, region, noise={"y": 1.0})
    design = fp.exchange(given, 2, method=fp.ExchangeMethod(references=False), n_candidates=20, max_iterations=40)
    assert design.evaluation.rank == 2 and design.evaluation.log_det == -np.inf
    u, v = design.points.u[np.argsort(design.points.u[:, 0]), :2].T
    assert v[0] > 0.9 and u[1] > 0.9


# --- how it ends --------------------------------------------------------------------------------------------------------


def test_an_interrupt_returns_the_best_so_far() -> None:
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs start with Ctrl-C ignored
    seen: list[float] = []

    def progress(now: fp.Progress) -> None:
        seen.append(now.value or 0.0)
        if now.step == 5:
            os.kill(os.getpid(), signal.SIGINT)
            threading.Event().wait(0.1)

    try:
        design = fp.exchange(problem(), **QUICK, progress=progress)
    finally:
        signal.signal(signal.SIGINT, before)
    assert design.stop_reason == "interrupted" and len(seen) == 5
    assert design.evaluation.log_det == pytest.approx(seen[-1], abs=1e-9)


def test_it_ends_when_nothing_gains_any_more() -> None:
    model, mean, bounds, count = ONE_FACTOR["Michaelis-Menten"]
    design = fp.exchange(known_problem(model, mean, bounds), count, n_candidates=8, method=fp.ExchangeMethod(references=False))
    assert design.stop_reason == "converged" and design.trace[-1].iteration < 200
    assert design.stop_reason.advice in " ".join(str(design.report()).split())


def test_limits_are_kept() -> None:
    none = fp.exchange(problem(), **QUICK | {"max_iterations": 0})
    assert none.trace[-1].iteration == 0 and none.stop_reason == "max_iterations"
    soon = fp.exchange(problem(), **QUICK | {"method": fp.ExchangeMethod(references=False, time_limit=1e-6)})
    assert soon.stop_reason == "time_limit" and soon.trace[-1].iteration == 1
    model, mean, bounds, count = ONE_FACTOR["Michaelis-Menten"]
    patient = fp.exchange(
        known_problem(model, mean, bounds), count, n_candidates=8, method=fp.ExchangeMethod(references=False, patience=2)
    )
    assert patient.stop_reason == "patience"


def test_misuse_of_the_method_is_told() -> None:
    with pytest.raises(ValueError, match="method: expected"):
        fp.exchange(problem(), method="best")  # type: ignore[arg-type]
    with pytest.raises((TypeError, ValueError), match="method: expected"):
        fp.exchange(problem(), method=3)  # type: ignore[arg-type]


def test_a_design_is_saved_and_read_with_its_method(tmp_path: Path) -> None:
    design = fp.exchange(problem(), **QUICK | {"max_iterations": 3, "method": fp.ExchangeMethod(references=True)})
    design.save(tmp_path)
    read = fp.Design.load(tmp_path)
    assert read.settings.method.name == "auto" and same_bits(read.points.table, design.points.table)
    assert "optimum" not in str(read.report())
