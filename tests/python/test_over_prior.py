"""Criteria over the prior: averages of log det F, the search with one scenario, known robust designs, files and misuse."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize, minimize_scalar

import fisherpoint as fp
from defaults import MODEL, NOISE, problem, same_bits
from fisherpoint.design.goal.criteria import Criterion
from fisherpoint.design.goal.determinant import Determinant
from fisherpoint.design.goal.scenario_average import SOFTNESS, Average
from fisherpoint.design.points.bound_over_prior import over_bound
from fisherpoint.design.points.pool_exchange import PoolExchange, greedy
from fisherpoint.design.points.tuning import ArchiveTuning
from fisherpoint.design.runs.linear_rows import LinearRows

QUICK: dict[str, Any] = {"n_experiments": 9, "n_candidates": 8, "max_iterations": 24, "method": fp.ExchangeMethod(references=False)}
KINDS = ("log", "worst", "cvar")


def log_det(p: int) -> Criterion:
    return Determinant("D", np.eye(p), True)


def average_of(kind: str, weights: np.ndarray, share: float = 0.4) -> Average:
    return Average(weights / weights.mean(), {"log": 1.0, "worst": 0.0, "cvar": share}[kind])


def worst_share(values: np.ndarray, weights: np.ndarray, share: float) -> float:
    """The mean over the lower `share` of a distribution, by its quantile function on a fine grid."""
    order = np.argsort(values)
    levels = np.cumsum(weights[order]) / weights.sum()
    u = (np.arange(200_000) + 0.5) / 200_000 * share
    return float(values[order][np.searchsorted(levels, u)].mean())


# --- averages -----------------------------------------------------------------------------------------------------------


def test_averages_are_those_of_the_distribution() -> None:
    rng = np.random.default_rng(0)
    for _ in range(20):
        values, weights = rng.standard_normal(6), rng.uniform(0.2, 2.0, 6)
        assert average_of("log", weights).value(values) == pytest.approx(np.average(values, weights=weights))
        assert average_of("worst", weights).value(values) == pytest.approx(values.min())
        for share in (0.3, 0.6, 0.95):
            found = average_of("cvar", weights, share).value(values)
            least = max(share, weights.min() / weights.sum())
            assert found == pytest.approx(worst_share(values, weights, least), abs=1e-4)


@pytest.mark.parametrize("kind", KINDS)
def test_the_smoothed_average_is_near_and_has_the_derivatives_that_it_says(kind: str) -> None:
    rng = np.random.default_rng(1)
    for spread in (1.0, 0.02, 1e-3):
        values, average = spread * rng.standard_normal(5), average_of(kind, rng.uniform(0.2, 2.0, 5))
        value, parts = average.softened(values)
        assert -1e-12 <= value - average.value(values) < SOFTNESS * np.log(5 / 0.1)
        step = 1e-6
        for k in range(5):
            more, less = values.copy(), values.copy()
            more[k], less[k] = values[k] + step, values[k] - step
            slope = (average.softened(more)[0] - average.softened(less)[0]) / (2 * step)
            assert parts[k] / 5 == pytest.approx(slope, abs=1e-5)


def test_a_scenario_in_which_nothing_is_determined_is_the_worst() -> None:
    values = np.array([1.0, -np.inf, -np.inf, 2.0])
    for kind in KINDS:
        assert average_of(kind, np.ones(4)).value(values) == -np.inf


@pytest.mark.parametrize("kind", KINDS)
def test_an_exchange_ends_where_no_single_one_gains(kind: str) -> None:
    """And gains are those of the average of log det F itself, computed anew."""
    rng, p, size, known = np.random.default_rng(3), 3, 5, np.zeros((4, 3, 3))
    w = rng.standard_normal((4, p, 1, 20)) * 10.0 ** np.arange(p)[:, None, None]
    average = average_of(kind, np.array([1.0, 2.0, 0.5, 1.0]))

    def value(chosen: np.ndarray) -> float:
        own = w[:, :, 0][:, :, chosen]
        return float(average.value(np.linalg.slogdet(own @ own.swapaxes(1, 2))[1]))

    criteria = [log_det(p)] * 4
    exchange = PoolExchange(w, greedy(w, size, known, average, criteria), known, average, criteria)
    before = value(exchange.chosen)
    exchange.run(np.arange(20), lambda: False)
    assert value(exchange.chosen) >= before and not len(exchange.promising(np.arange(20), 5))
    best = -np.inf
    for place, other in itertools.product(range(size), range(20)):
        changed = exchange.chosen.copy()
        changed[place] = other
        best = max(best, value(changed))
    assert best <= value(exchange.chosen) + 1e-5


@pytest.mark.parametrize("kind", KINDS)
def test_the_ascents_gradient_is_a_difference(kind: str) -> None:
    rng, points, d, plants, p = np.random.default_rng(5), 4, 2, 3, 2
    linear = LinearRows(
        rng.standard_normal((plants, points, 1, p)),
        rng.standard_normal((points, d, plants, 1, p)),
        np.zeros((plants, points, 0)),
        np.zeros((points, d, plants, 0)),
        np.zeros((plants, p, p)),
        average_of(kind, np.array([1.0, 2.0, 0.7])),
        0.0,
        np.arange(points * d).reshape(points, d),
    )
    at, step = 0.1 * rng.standard_normal(points * d), 1e-6
    _, gradient = linear.value_and_gradient(at)
    for k in range(points * d):
        move = step * np.eye(points * d)[k]
        slope = (linear.value_and_gradient(at + move)[0] - linear.value_and_gradient(at - move)[0]) / (2 * step)
        assert gradient[k] == pytest.approx(slope, rel=1e-5, abs=1e-6)


# --- known designs ------------------------------------------------------------------------------------------------------


DECAY = fp.SymbolicModel([], ["exp(-theta*t)"], {}, {"t": "s"}, {"theta": "1/s"}, {"y": "1"})
HUMP = fp.SymbolicModel([], ["(theta**2 - 3*theta)*t*exp(-theta*t)"], {}, {"t": "1"}, {"theta": "1"}, {"y": "1"})


def of_one(model: fp.SymbolicModel, upper: float = 6.0) -> fp.DesignProblem:
    prior = fp.GaussianPrior({"theta": 1.0}, std={"theta": 0.5})
    return fp.DesignProblem(model, prior, fp.ExperimentRegion({"t": (0.0, upper)}), noise={"y": 0.1})


def slopes_of(model: fp.SymbolicModel, t: float, theta: float) -> float:
    """dy/dtheta, by a complex step."""
    at = theta + 1e-30j
    y = np.exp(-at * t) if model is DECAY else (at**2 - 3 * at) * t * np.exp(-at * t)
    return float(np.imag(y) / 1e-30)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("model", [DECAY, HUMP])
def test_the_best_time_is_that_of_scalar_optimisation(model: fp.SymbolicModel, kind: str) -> None:
    """Of the decay it is 1 / mean(theta) for "log" and 1 / 2 for "worst"; of the hump two scenarios tie at the best of these."""
    thetas, weights, share = np.array([0.5, 2.0, 2.5]), np.ones(3), 0.6
    average = average_of(kind, weights, share)

    def value(t: float) -> float:
        return float(average.value(np.log([slopes_of(model, t, theta) ** 2 for theta in thetas])))

    grid = np.linspace(0.01, 5.99, 600)
    start = grid[np.argmax([value(t) for t in grid])]
    best = minimize_scalar(lambda t: -value(t), bounds=(start - 0.02, start + 0.02), method="bounded", options={"xatol": 1e-9})
    over = fp.OverPrior(kind, scenarios=[{"theta": theta} for theta in thetas], share=share)
    design = fp.exchange(
        of_one(model), 1, n_candidates=20, max_iterations=60, method=fp.ExchangeMethod(references=False), goal=fp.Goal(over=over)
    )
    found = float(design.points.u[0, 0])
    assert value(found) > -best.fun - 1e-4
    assert found == pytest.approx(best.x, abs=0.02)
    if model is DECAY and kind != "cvar":
        assert best.x == pytest.approx(1 / np.mean(thetas) if kind == "log" else 1 / thetas.max(), abs=1e-5)
    scale = np.log(2) + 2 * np.log(0.5 / 0.1)
    assert design.scenarios is not None
    assert design.scenarios.value == pytest.approx(value(found) + scale, abs=1e-9)
    assert design.scenarios.log_dets == pytest.approx([np.log(slopes_of(model, found, x) ** 2) + scale for x in thetas], abs=1e-9)


# --- the bound of the candidates -------------------------------------------------------------------------------------------


def everywhere(places: np.ndarray) -> np.ndarray:
    return np.ones(len(places), dtype=bool)


@pytest.mark.parametrize("kind", KINDS)
def test_the_bound_is_the_best_that_weights_reach(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """By a general optimiser over the weights of all candidates; designs are below. Of scenarios in groups it is larger."""
    rng, p, count = np.random.default_rng(11), 2, 12
    rows = rng.standard_normal((3, count, 1, p)) * np.array([1.0, 2.0, 0.5])[:, None, None, None]
    average, known = average_of(kind, np.array([1.0, 2.0, 1.5])), 0.1 * np.broadcast_to(np.eye(p), (3, p, p))
    bound = over_bound(rows, known, average, 3, everywhere, [log_det(p)] * 3)

    def value(weights: np.ndarray) -> float:
        return float(average.value(np.linalg.slogdet(np.einsum("k,sknp,sknq->spq", weights, rows, rows) + known)[1]))

    def loss(z: np.ndarray) -> float:
        return -value(z**2 / (z**2).sum())

    best = max(-minimize(loss, rng.uniform(0.2, 1.0, count), method="Powell", options={"maxiter": 50}).fun for _ in range(4))
    assert bound is not None and best - 1e-9 <= bound < best + p * ArchiveTuning().tolerance_over_prior + 1e-3
    for chosen in itertools.combinations_with_replacement(range(count), 4):
        assert value(np.bincount(chosen, minlength=count) / 4) <= bound
    for most in (2, 1):  # scenarios of a group
        monkeypatch.setattr("fisherpoint.design.points.bound_over_prior.MOST_OF_ALL", most * p)
        grouped = over_bound(rows, known, average, 3, everywhere, [log_det(p)] * 3)
        assert grouped is not None and bound - p * ArchiveTuning().tolerance_over_prior <= grouped < bound + 4


def test_the_bound_leaves_out_what_may_not_have_a_weight() -> None:
    rows = np.array([1.0, 2.0, 5.0, 3.0])[None, :, None, None]
    nothing, mean = np.zeros((1, 1, 1)), Average.of_all(1)
    criteria = [log_det(1)]
    assert over_bound(rows, nothing, mean, 1, everywhere, criteria) == pytest.approx(np.log(25), abs=0.011)
    assert over_bound(rows, nothing, mean, 1, lambda places: places != 2, criteria) == pytest.approx(np.log(9), abs=0.011)
    assert over_bound(0 * rows, nothing, mean, 1, everywhere, criteria) is None


def test_with_one_scenario_the_bound_is_that_of_the_mean() -> None:
    settings: dict[str, Any] = QUICK | {"method": fp.ExchangeMethod(references=True), "max_iterations": 8}
    plain, one = (
        fp.exchange(problem(), **settings, goal=fp.Goal(over=over)) for over in (None, fp.OverPrior("log", scenarios=[{}]))
    )
    assert plain.efficiency is not None and one.efficiency is not None
    assert plain.efficiency.n_candidates == one.efficiency.n_candidates
    assert one.efficiency.at_most == pytest.approx(plain.efficiency.at_most, abs=9 * 0.011)
    assert one.efficiency.at_least == pytest.approx(plain.efficiency.at_least, abs=0.012)


@pytest.mark.parametrize("kind", KINDS)
def test_the_bound_of_a_design_is_of_what_is_maximised(kind: str) -> None:
    """The best design of the decay is one time, which is at the bound of all candidates."""
    over = fp.OverPrior(kind, scenarios=[{"theta": 0.5}, {"theta": 2.0}])
    design = fp.exchange(of_one(DECAY), 2, n_candidates=20, max_iterations=60, goal=fp.Goal(over=over))
    assert design.efficiency is not None and design.scenarios is not None and design.efficiency.at_most is not None
    assert design.scenarios.value <= design.efficiency.at_most + 1e-9
    assert design.efficiency.at_least is not None and design.efficiency.at_least > (0.9 if kind == "log" else 0.95)


# --- what every search promises -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_one_scenario_at_the_mean_is_the_search_without(kind: str) -> None:
    plain = fp.exchange(problem(), **QUICK)
    one = fp.exchange(problem(), **QUICK, goal=fp.Goal(over=fp.OverPrior(kind, scenarios=[{}])))
    assert same_bits(plain.points.table, one.points.table) and plain.rejected == one.rejected
    assert [record.log_det for record in plain.trace] == [record.log_det for record in one.trace]
    assert plain.scenarios is None and one.scenarios is not None
    assert one.scenarios.log_dets == pytest.approx([plain.evaluation.log_det], abs=1e-9)


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
def test_it_is_better_over_the_scenarios_than_the_design_for_the_mean(kind: str) -> None:
    over = fp.OverPrior(kind, scenarios=fp.Sobol(4))
    given = problem()
    plain, design = (fp.exchange(given, **QUICK | {"max_iterations": 60}, goal=fp.Goal(over=one)) for one in (None, over))
    log_dets = [record.log_det for record in design.trace]
    assert all(b >= a for a, b in itertools.pairwise(log_dets)) and log_dets[-1] > log_dets[0]
    values = design.scenarios
    assert values is not None and values.value == pytest.approx(log_dets[-1], abs=1e-9)
    theta, _ = over.nodes(given)

    def by_hand(points: fp.Experiments) -> np.ndarray:
        """From sensitivities; a point of the design for the mean that has no trajectory in a scenario tells nothing there."""
        found = []
        for row in theta:
            slopes = fp.sensitivities(MODEL, points, row).dy_dtheta * np.array(list(given.prior.std.values()))
            white = (slopes / np.array(list(NOISE.values()))[:, None]).reshape(-1, len(row))
            found.append(np.linalg.slogdet(2 / len(points) * white.T @ white)[1])
        return np.array(found)

    assert by_hand(design.points) == pytest.approx(values.log_dets, abs=1e-3)  # of other steps within the tolerance
    average = average_of(kind, np.ones(4), over.share)
    assert average.value(by_hand(design.points)) > average.value(by_hand(plain.points)) + 0.1
    assert design.drawn == design.accepted + sum(design.rejected.values())
    assert design.evaluation.log_det == pytest.approx(fp.evaluate(given, design.points).log_det, abs=1e-9)


def test_points_are_valid_in_every_scenario() -> None:
    """x' = p x^2 explodes at 1 / p: the later the sample the more it tells, up to the explosion in the worst scenario."""
    model = fp.SymbolicModel(["p*x**2"], ["x"], {"x": "1"}, {}, {"p": "1"}, {"y": "1"})
    region = fp.ExperimentRegion({"x": (1.0, 1.0), "dt": (0.1, 0.95)})
    prior = fp.GaussianPrior({"p": 1.0}, std={"p": 0.01})
    given = fp.DesignProblem(model, prior, region, noise={"y": 0.1})
    design = fp.exchange(
        given, 1, n_candidates=8, max_iterations=24, goal=fp.Goal(over=fp.OverPrior("log", scenarios=[{}, {"p": 1.25}]))
    )
    assert 0.6 < design.points.dt[0] < 0.8


def test_the_same_bits_for_any_number_of_threads() -> None:
    over = fp.OverPrior("cvar", scenarios=fp.Sobol(4))
    one, three = (fp.exchange(problem(), **QUICK, threads=n, goal=fp.Goal(over=over)) for n in (1, 3))
    assert same_bits(one.points.table, three.points.table)
    assert [r.log_det for r in one.trace] == [r.log_det for r in three.trace] and one.rejected == three.rejected


def test_previous_and_kept_points_count_in_every_scenario() -> None:
    """A previous time at which little is told leaves the best new one; a kept one is the design's first."""
    thetas = np.array([0.5, 2.0])
    given, over = of_one(DECAY), fp.OverPrior("log", scenarios=[{"theta": theta} for theta in thetas])
    known = fp.Experiments(np.zeros((2, 0)), np.array([[0.2], [3.0]]))
    settings: dict[str, Any] = {
        "n_candidates": 20,
        "max_iterations": 60,
        "method": fp.ExchangeMethod(references=False),
        "goal": fp.Goal(over=over),
    }
    beside = fp.exchange(given, 1, previous=known, **settings)
    kept = fp.exchange(given, 3, keep=known, **settings)

    def value(t: float) -> float:
        squares = [[slopes_of(DECAY, s, theta) ** 2 for s in (0.2, 3.0, t)] for theta in thetas]
        return float(np.log(np.sum(squares, axis=1)).mean())

    best = minimize_scalar(lambda t: -value(t), bounds=(0.01, 3.0), method="bounded", options={"xatol": 1e-9})
    for design in (beside, kept):
        assert design.points.u[-1, 0] == pytest.approx(best.x, abs=1e-3)
        assert design.scenarios is not None
        assert design.scenarios.value == pytest.approx(-best.fun + np.log(2 / 3) + 2 * np.log(5), abs=1e-6)
    assert same_bits(kept.points.u[:2], known.u) and beside.n_previous == 2


def test_a_campaign_keeps_its_criterion(tmp_path: Path) -> None:
    over = fp.OverPrior("log", scenarios=fp.Sobol(2))
    campaign = fp.Campaign(
        problem(),
        batch=9,
        directory=tmp_path,
        n_candidates=8,
        max_iterations=2,
        method=fp.ExchangeMethod(references=False),
        goal=fp.Goal(over=over),
    )
    first = campaign.next()
    again = fp.Campaign.load(tmp_path)
    assert again.settings == campaign.settings and again.settings.goal.over == over
    assert same_bits(again.next().table, first.table)


def test_scenarios_with_what_is_uncertain() -> None:
    given = problem(uncertain={"T_1": 2e-4}, initial_state_std={"v": 1e-3})
    over = fp.OverPrior("log", scenarios=[{}, {"c_L": 4e-9}])
    design = fp.exchange(given, **QUICK | {"max_iterations": 8}, goal=fp.Goal(over=over))
    moved = given.replace(prior=fp.GaussianPrior(dict(given.prior.mean) | {"c_L": 4e-9}, dict(given.prior.std)))
    expected = [fp.evaluate(one, design.points).log_det for one in (given, moved)]
    assert design.scenarios is not None and design.scenarios.log_dets == pytest.approx(expected, abs=1e-9)


# --- results and misuse ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("scenarios", [fp.Sobol(4), [{}, {"c_L": 4e-9}]])
def test_a_design_is_saved_and_read(tmp_path: Path, scenarios: Any) -> None:
    over = fp.OverPrior("cvar", scenarios=scenarios, share=0.5)
    design = fp.exchange(
        problem(), **QUICK | {"max_iterations": 3, "method": fp.ExchangeMethod(references=True)}, goal=fp.Goal(over=over)
    )
    design.save(tmp_path)
    read = fp.Design.load(tmp_path)
    assert read.settings == design.settings and read.settings.goal.over == over and read.scenarios == design.scenarios
    report = str(read.report())
    assert "the mean log det F of the worst 50 %" in report and "geometric mean" in report
    assert report == str(design.report())


def test_what_the_values_say() -> None:
    over = fp.OverPrior("worst", scenarios=[{"theta": 0.5}, {"theta": 2.0}])
    values = fp.exchange(of_one(DECAY), 1, n_candidates=8, max_iterations=8, goal=fp.Goal(over=over)).scenarios
    assert values is not None and values.parameters == ({"theta": 0.5}, {"theta": 2.0})
    errors = values.standard_errors["theta"]
    assert values.expected_errors["theta"] == pytest.approx(np.sqrt(errors[0] * errors[1]))
    assert values.largest_errors["theta"] == max(errors) and values.mean == pytest.approx(np.mean(values.log_dets))
    assert values.value == min(values.log_dets) and values.weights == (0.5, 0.5)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: fp.OverPrior("best"), "kind: expected"),
        (
            lambda: fp.OverPrior("log", scenarios=fp.SparseGaussHermite(2)),
            "scenarios: expected a rule whose nodes have positive weights",
        ),
        (
            lambda: fp.OverPrior("log", scenarios=fp.LinearizedRule()),
            "scenarios: expected a rule whose nodes have positive weights",
        ),
        (lambda: fp.OverPrior("log", scenarios=[]), "scenarios: expected a rule, or at least one"),
        (lambda: fp.OverPrior("log", scenarios=8), "scenarios: expected a sequence of mappings of parameters, or a rule, given 8"),
        (lambda: fp.OverPrior("log", scenarios=[1.0]), r"scenarios\[0\]: expected"),
        (lambda: fp.OverPrior("cvar", share=0.0), "share: expected a share above 0"),
        (lambda: fp.exchange(problem(), goal=fp.Goal(over="log")), "over: expected an OverPrior or None, given str"),
        (
            lambda: fp.exchange(problem(), goal=fp.Goal(over=fp.OverPrior("log", scenarios=[{"x": 1.0}]))),
            "scenarios: expected names",
        ),
        (
            lambda: fp.exchange(problem(), goal=fp.Goal(over=fp.OverPrior("log", scenarios=fp.Sobol(2048)))),
            "scenarios: expected at most 1024, given 2048",
        ),
        (lambda: fp.exchange(problem(), goal=fp.Goal(over=fp.OverPrior("log", scenarios=[{"m_q": -1.0}]))), "m_q"),
        (lambda: fp.exchange(problem(), goal=fp.Goal(over=fp.OverPrior("log")), method="paper"), 'over: expected method = "auto"'),
        (
            lambda: fp.exchange(problem(output_covariance="region"), goal=fp.Goal(over=fp.OverPrior("log"))),
            'over: expected method = "auto"',
        ),
    ],
)
def test_misuse_is_told(make: Any, message: str) -> None:
    with pytest.raises((TypeError, ValueError), match=message) as told:
        make()
    assert "\n" not in str(told.value)


def test_kept_points_must_be_valid_in_every_scenario() -> None:
    model = fp.SymbolicModel(["p*x**2"], ["x"], {"x": "1"}, {}, {"p": "1"}, {"y": "1"})
    prior = fp.GaussianPrior({"p": 1.0}, std={"p": 0.01})
    given = fp.DesignProblem(model, prior, fp.ExperimentRegion({"x": (1.0, 1.0), "dt": (0.1, 0.95)}), noise={"y": 0.1})
    late = fp.Experiments(np.ones((1, 1)), np.zeros((1, 0)), np.array([0.9]))
    with pytest.raises(ValueError, match=r"keep: expected valid points, given points\[0\]"):
        fp.exchange(given, 2, keep=late, goal=fp.Goal(over=fp.OverPrior("log", scenarios=[{"p": 1.3}])))


def test_nodes_are_those_of_the_rule() -> None:
    theta, weights = fp.OverPrior("log", scenarios=fp.GaussHermite(1)).nodes(problem())
    assert theta == pytest.approx(np.array([list(MODEL.nominal.values())])) and weights == pytest.approx([1.0])
