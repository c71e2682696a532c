"""Certificates fail on designs that are known not to be the best, and no efficiency exceeds 1: on random problems."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given as drawn_from
from hypothesis import settings as examples
from hypothesis import strategies as st

import fisherpoint as fp
from fisherpoint.design.approximate import continuous
from fisherpoint.design.candidates.candidate_rows import CandidateRows
from fisherpoint.design.goal.determinant import Determinant
from fisherpoint.design.goal.eigenvalue_criteria import SmallestEigenvalue
from fisherpoint.design.goal.estimable_space import estimable
from fisherpoint.design.points.bound_over_prior import over_bound
from fisherpoint.design.points.candidate_archive import CandidateArchive
from fisherpoint.design.weights.weights import optimal_weights
from fisherpoint.information.candidates import CandidateSource
from fisherpoint.information.evaluation import evaluate_information
from fisherpoint.information.output_covariance import output_covariance
from fisherpoint.information.point_information import PointInformation
from test_candidate_archive import at, information, problem
from test_optimality import CONVEX, P, criteria, mixture, of_random_rows
from test_over_prior import KINDS, average_of, log_det

ROUNDING = 1e-9
SEEDS = st.integers(0, 2**32 - 1)
RANDOM_DESIGNS = 40


def everywhere(places: np.ndarray) -> np.ndarray:
    return np.ones(len(places), dtype=bool)


# --- they fail where a design is known not to be the best ---------------------------------------------------------------------


@pytest.mark.parametrize("name", CONVEX)
@pytest.mark.parametrize("seed", range(3))
def test_the_sensitivity_function_exceeds_its_level_by_what_is_missing(name: str, seed: int) -> None:
    """Of weights that are moved away from the best ones: the further, the more; and the bound holds of the best."""
    candidates, rng = of_random_rows(10 + seed)
    one = criteria(rng)[name]
    best = optimal_weights(candidates, one, tolerance=1e-5)
    w = np.zeros(len(candidates))
    w[best.chosen] = best.weights
    away, before = rng.dirichlet(np.ones(len(candidates))), 1.0
    for share in (0.2, 0.5, 1.0):
        moved = mixture(candidates, (1 - share) * w + share * away)
        largest = float(candidates.along(one.slope(moved).half).max())
        efficiency = one.efficiency(moved, mixture(candidates, w))
        assert largest > 1.01 and 1 / largest <= efficiency < 0.999
        if not isinstance(one, SmallestEigenvalue):  # whose slope jumps
            assert largest > before
        before = largest


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(3))
def test_the_bound_over_the_prior_shows_a_bad_design(kind: str, seed: int) -> None:
    """The worst of the candidates by each other's measure, and of the best ones a part alone."""
    rng = np.random.default_rng(seed)
    rows = rng.standard_normal((3, 80, 2, 3)) * rng.uniform(0.2, 3.0, (1, 80, 1, 1))
    average, nothing = average_of(kind, rng.uniform(0.5, 2.0, 3)), np.zeros((3, 3, 3))
    small = np.argsort(np.square(rows).sum(axis=(0, 2, 3)))[:4]
    order = np.concatenate([small, np.setdiff1d(np.arange(80), small)])
    bound = over_bound(rows[:, order], nothing, average, 4, everywhere, [log_det(3)] * 3)
    assert bound is not None
    assert np.exp((_over(rows, average, small) - bound) / 3) < 0.5
    best = max((_over(rows, average, rng.choice(80, 6)) for _ in range(200)), default=-np.inf)
    assert best <= bound + ROUNDING


def _over(rows: np.ndarray, average: Any, chosen: np.ndarray) -> float:
    """The average of log det of the mean information of some candidates, in each scenario."""
    matrices = np.einsum("sknp,sknq->spq", rows[:, chosen], rows[:, chosen]) / len(chosen)
    return float(average.value(np.linalg.slogdet(matrices)[1]))


def test_the_efficiency_of_a_bad_exact_design_is_what_it_is() -> None:
    """Three points of the quadratic within |x| <= a have a^6 of the determinant, and (a^2)-times the D-efficiency."""
    given = problem()
    seen = CandidateArchive(given, 1)
    seen.add(information(given, *np.linspace(-1, 1, 41)))
    for a in (0.3, 0.6, 0.9):
        found = seen.bound(information(given, -a, 0.0, a), None)
        value = fp.evaluate(given, at(-a, 0.0, a)).log_det
        assert found is not None and np.exp((value - found.log_det) / 3) == pytest.approx(a**2, rel=2e-3)


def test_the_certificate_of_a_region_fails_where_the_support_is_kept_from_the_best(monkeypatch: pytest.MonkeyPatch) -> None:
    """Candidates within |x| <= 1/2, to which nothing may be added: D-efficiency 1/4, and the ascents tell so."""
    monkeypatch.setattr(continuous._Refining, "add_new", lambda self, z, value: False)
    monkeypatch.setattr(continuous._Refining, "merged", lambda self, tolerance: _own(self))
    monkeypatch.setattr("fisherpoint.design.approximate.approximate.drawn", lambda *_: at(*np.linspace(-0.5, 0.5, 21)))
    monkeypatch.setattr("fisherpoint.design.approximate.approximate._searched", lambda *_: [])
    design = fp.approximate_design(problem(), starts=100)
    assert np.abs(design.points.u).max() <= 0.5
    # F at the ends, with thirds of the weight at -1/2, 0 and 1/2: sum of squares of Lagrange polynomials, times 3
    assert design.largest * 3 == pytest.approx(3 * (1 + 9 + 9), rel=1e-3)
    assert design.efficiency == pytest.approx(1 / 19, rel=1e-3) and design.efficiency <= 1 / 4
    assert "proven to be at least" in str(design)
    honest = fp.approximate_design(problem(), at(*np.linspace(-0.5, 0.5, 21)))
    assert honest.efficiency > 1 - 1e-5 and honest.sensitivity(at(-1.0, 1.0)).min() > 10  # of its candidates, not of the region


def _own(work: Any) -> Any:
    chosen = work.weights.chosen
    points, rows = work.points[chosen], work.pool.rows[chosen]
    alone = optimal_weights(CandidateRows(rows), work.criterion, tolerance=1e-7, space=work.space)
    return continuous._Support(points, rows, alone)


# --- nothing exceeds 1 ----------------------------------------------------------------------------------------------------------


@examples(max_examples=60, deadline=None)
@drawn_from(SEEDS, st.sampled_from(CONVEX), st.integers(4, 80), st.integers(1, 3), st.booleans(), st.integers(-6, 6))
def test_no_random_design_exceeds_the_bound(seed: int, name: str, count: int, outputs: int, known: bool, decade: int) -> None:
    rng = np.random.default_rng(seed)
    scales = 10.0 ** (decade * rng.random(P))
    rows = rng.standard_normal((count, outputs, P)) * scales
    constant = None
    if known:
        before = rng.standard_normal((P, P)) * scales
        constant = before.T @ before
    candidates, one = CandidateRows(rows, constant), criteria(rng)[name]
    space = estimable(candidates.triangle())
    if space.rank < P:
        return
    best = optimal_weights(candidates, one, tolerance=1e-3)
    assert 0 < best.efficiency <= 1 + ROUNDING
    bound = one.log_phi(candidates.information(best.chosen, best.weights)) - np.log(best.efficiency)
    for _ in range(RANDOM_DESIGNS):
        size = int(rng.integers(1, 12))
        design = candidates.information(rng.integers(count, size=size), np.full(size, 1 / size))
        assert one.log_phi(design) <= bound + 1e-6  # of variances in a badly scaled matrix six digits are left


@examples(max_examples=25, deadline=None)
@drawn_from(SEEDS, st.sampled_from(KINDS), st.integers(1, 4), st.booleans())
def test_no_random_design_exceeds_the_bound_over_the_prior(seed: int, kind: str, scenarios: int, known: bool) -> None:
    rng = np.random.default_rng(seed)
    rows = rng.standard_normal((scenarios, 40, 2, 3)) * 10.0 ** rng.uniform(-2, 2, 3)
    before = rng.standard_normal((scenarios, 3, 3)) if known else np.zeros((scenarios, 3, 3))
    constant = np.einsum("spq,srq->spr", before, before)
    average = average_of(kind, rng.uniform(0.2, 2.0, scenarios))
    bound = over_bound(rows, constant, average, 4, everywhere, [log_det(3)] * scenarios)
    assert bound is not None
    for _ in range(RANDOM_DESIGNS):
        chosen = rng.integers(40, size=int(rng.integers(1, 9)))
        own = np.einsum("sknp,sknq->spq", rows[:, chosen], rows[:, chosen]) / len(chosen) + constant
        sign, values = np.linalg.slogdet(own)
        assert average.value(np.where(sign > 0, values, -np.inf)) <= bound + 1e-6


TERMS = ("a*u", "b*v", "c*u*v", "a*exp(-b*u)", "c*v**2", "a*u/(b + u)", "b*exp(-c*v)", "c", "sin(a*u)*v", "a*b*u", "b*c*v")


@st.composite
def problems(draw: st.DrawFn) -> tuple[fp.DesignProblem, np.random.Generator]:
    """A model of one or two outputs, each a sum of terms; some parameters may be left open."""
    outputs = draw(st.lists(st.lists(st.sampled_from(TERMS), min_size=1, max_size=4, unique=True), min_size=1, max_size=2))
    names = ["y", "z"][: len(outputs)]
    texts = [" + ".join(terms) for terms in outputs]
    used = [name for name in "abc" if any(name in text.replace("exp", "").replace("sin", "") for text in texts)]
    model = fp.SymbolicModel([], texts, {}, dict.fromkeys("uv", "1"), dict.fromkeys(used, "1"), dict.fromkeys(names, "1"))
    rng = np.random.default_rng(draw(SEEDS))
    mean = {name: float(rng.uniform(0.5, 2.0)) for name in used}
    prior = fp.GaussianPrior(mean=mean, std={name: 0.2 * value for name, value in mean.items()})
    region = fp.ExperimentRegion({"u": (0.1, float(rng.uniform(0.5, 3.0))), "v": (0.1, float(rng.uniform(0.5, 3.0)))})
    noise = {name: float(10.0 ** rng.uniform(-3, 0)) for name in names}
    return fp.DesignProblem(model, prior, region, noise=noise), rng


def points_of(given: fp.DesignProblem, count: int, rng: np.random.Generator) -> fp.Experiments:
    assert isinstance(given.region, fp.ExperimentRegion)
    return given.region.draw(given.model, count, seed=rng)


@examples(max_examples=15, deadline=None)
@drawn_from(problems(), st.sampled_from(("D", "A", "E")), st.integers(1, 8), st.booleans(), st.sampled_from((None, *KINDS)))
def test_no_efficiency_of_a_search_exceeds_one(
    drawn: tuple[fp.DesignProblem, np.random.Generator], name: str, size: int, previous: bool, kind: str | None
) -> None:
    given, rng = drawn
    options: dict[str, Any] = {"n_candidates": 4, "max_iterations": 6, "goal": fp.Goal(name)}
    if previous:
        options["previous"] = points_of(given, 3, rng)
    if kind is not None:
        scenarios = [{}, {given.estimated[0]: given.prior.mean[given.estimated[0]] * 1.2}]
        options["goal"] = fp.Goal(name, over=fp.OverPrior(kind, scenarios=scenarios))  # type: ignore[arg-type]
    design = fp.exchange(given, size, **options)
    efficiency = design.efficiency
    assert efficiency is not None
    if efficiency.at_least is None:
        assert design.too_few or efficiency.at_most is None
        return
    assert 0 < efficiency.at_least <= 1 + ROUNDING


@examples(max_examples=25, deadline=None)
@drawn_from(problems(), st.integers(2, 8), st.integers(0, 3))
def test_no_random_design_of_the_candidates_exceeds_their_bound(
    drawn: tuple[fp.DesignProblem, np.random.Generator], size: int, n_previous: int
) -> None:
    """Also beside previous points, and where some parameters are left open: log det F is of the others then."""
    given, rng = drawn
    source = CandidateSource(given, rng, 1)
    pool, previous = source.draw(30), source.draw(n_previous) if n_previous else None
    everything = evaluated(given, pool if previous is None else PointInformation.join([previous, pool]))
    whole = Determinant("D", np.eye(len(given.estimated)), True)
    criterion = whole
    if everything.null_directions:
        nulls = np.array([[null.get(name, 0.0) for name in given.estimated] for null in everything.null_directions]).T
        span = np.linalg.qr(nulls, mode="complete")[0][:, nulls.shape[1] :]
        criterion = Determinant("D", span, True)
    seen = CandidateArchive(given, 1, [criterion])
    seen.add(pool)
    found = seen.bound(pool[rng.integers(30, size=size)], previous)
    assert found is not None
    for _ in range(RANDOM_DESIGNS):
        own = pool[rng.integers(30, size=size)]
        there = evaluated(given, own if previous is None else PointInformation.join([previous, own]))
        if there.rank == everything.rank:
            assert there.log_det_estimable is not None and there.log_det_estimable <= found.log_det + 1e-6


def evaluated(given: fp.DesignProblem, information: PointInformation) -> fp.Evaluation:
    return evaluate_information(given, information, output_covariance(given, information, 1), 1)


@examples(max_examples=15, deadline=None)
@drawn_from(problems(), st.sampled_from(("D", "A")), st.integers(20, 60))
def test_no_efficiency_against_the_best_weights_exceeds_one(
    drawn: tuple[fp.DesignProblem, np.random.Generator], name: str, count: int
) -> None:
    given, rng = drawn
    candidates = points_of(given, count, rng)
    best = fp.approximate_design(given, candidates, goal=name, tolerance=1e-4)
    assert 0 < best.efficiency <= 1 and best.largest > 1 - 1e-3
    assert best.sensitivity(candidates).max() <= best.level * (best.largest + 1e-9)
    for _ in range(RANDOM_DESIGNS):
        chosen = rng.integers(count, size=int(rng.integers(1, 10)))
        assert 0 <= best.efficiency_of(candidates[chosen]) <= 1
