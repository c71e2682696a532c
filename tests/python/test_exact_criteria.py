"""Exact designs for criteria other than log det F: against enumeration, what is proven, and the rest of the library."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.design.file.configuration import ConfigError, load_config
from test_known_designs import ONE_FACTOR, SOON, SQUARE, ZERO, absorption, quadratic
from test_known_designs import problem as known_problem

MICHAELIS_MENTEN = Path(__file__).parents[2] / "examples" / "michaelis_menten.toml"
QUICK: dict[str, Any] = {"n_candidates": 20, "max_iterations": 40}


# --- known designs ------------------------------------------------------------------------------------------------------------

GRID = np.array(list(itertools.product((-1.0, 0.0, 1.0), repeat=2)))


def of_quadratic(name: str) -> fp.Goal:
    goals = {
        "Ds": fp.Goal("Ds", of=["c_3", "c_4", "c_5"]),
        "c": fp.Goal("c", of="c_0 + c_1 + 2*c_3"),
        "I": fp.Goal("I", of="y", conditions=fp.Experiments(np.zeros((9, 0)), GRID)),
    }
    return goals.get(name) or fp.Goal(name)


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "count"), [("A", 6), ("A", 7), ("A", 8), ("A", 9), *((name, 7) for name in ("Ds", "c", "I", "E", "ME"))]
)
def test_designs_of_a_quadratic_in_two_factors_are_the_best_of_all(name: str, count: int) -> None:
    """Of all multisets of the nine settings, whose criteria come from matrices that are made here."""
    given = known_problem(quadratic, ZERO, SQUARE)
    a, b = GRID.T
    rows = np.column_stack([np.ones(9), a, b, a * a, b * b, a * b]) * given.std
    criterion = fp.criterion(given, of_quadratic(name))
    best = -np.inf
    for chosen in itertools.combinations_with_replacement(range(9), count):
        own = rows[list(chosen)]
        f = own.T @ own
        if name in ("A", "E", "ME"):
            if np.linalg.matrix_rank(own) < 6:
                continue
            if name == "A":
                value = -np.log(np.trace(np.linalg.solve(f, np.eye(6))))
            else:
                low, *_, high = np.linalg.eigvalsh(f)
                value = np.log(low) if name == "E" else np.log(low / high)
        else:
            value = criterion.log_phi(f)
        best = max(best, value)
    design = fp.exchange(given, count, goal=of_quadratic(name), n_candidates=20, max_iterations=60)
    found = criterion.log_phi(design.evaluation.information)
    assert found == pytest.approx(best, abs=1e-6)
    assert design.value == pytest.approx(criterion.value(design.evaluation.information))
    assert design.efficiency is not None
    if name == "ME":
        assert design.efficiency.at_most is None and design.efficiency.at_least is None
    else:
        assert design.efficiency.at_least is not None and 0.3 < design.efficiency.at_least <= 1 + 1e-9


def test_the_time_of_the_largest_concentration() -> None:
    """c-optimal weights are .606 and .394 (Atkinson et al. 1993); of five samples three and two are best."""
    model, mean, bounds, _ = ONE_FACTOR["one-compartment with absorption"]
    assert model is absorption
    design = fp.exchange(known_problem(model, mean, bounds), 5, goal=fp.Goal("c", of="log(k_a / k_e) / (k_a - k_e)"), **QUICK)
    assert 5 * design.value == pytest.approx(0.02813, rel=2e-3)  # the variance with five is not less than a fifth of the optimum's
    assert 5 * design.value > 0.02813 * (1 - 1e-3)
    early = design.points.dt < 1
    assert early.sum() == 3 and design.points.dt[early] == pytest.approx(0.1793, abs=0.01)
    assert design.points.dt[~early].mean() == pytest.approx(3.5671, abs=0.3)  # the later ones matter little one by one
    assert design.efficiency is not None and design.efficiency.at_least is not None
    assert 0.99 < design.efficiency.at_least <= 1 + 1e-6


def test_all_parameters_as_a_subset_are_log_det() -> None:
    model, mean, bounds, _ = ONE_FACTOR["Box-Lucas"]
    given = known_problem(model, mean, bounds)
    one, other, default = (
        fp.exchange(given, 4, method=fp.ExchangeMethod(references=False), **QUICK, **asked)
        for asked in ({"goal": "D"}, {"goal": fp.Goal("Ds", of=["k_1", "k_2"])}, {})
    )
    assert np.array_equal(one.points.table, other.points.table) and np.array_equal(one.points.table, default.points.table)
    assert one.value == pytest.approx(one.evaluation.log_det + 2 * np.log(4 / 2))


# --- what is proven -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ("Ds", "A", "c", "I", "E"))
def test_a_poor_design_is_not_said_to_be_good(name: str) -> None:
    """Random points: what is proven of them is clearly less than one, and no more than what holds against a better design."""
    given, goal = known_problem(quadratic, ZERO, SQUARE), of_quadratic(name)
    poor = fp.exchange(given, 12, goal=goal, n_candidates=20, max_iterations=0, seed=3)
    good = fp.exchange(given, 12, goal=goal, n_candidates=20, max_iterations=60, seed=3)
    assert poor.efficiency is not None and poor.efficiency.at_least is not None
    assert poor.efficiency.at_least < 0.95
    against = good.criterion.efficiency(poor.evaluation.information, good.evaluation.information)
    assert poor.efficiency.at_least <= against + 1e-6 and against < 0.97


@pytest.mark.parametrize("name", ("Ds", "A", "c", "I", "E"))
def test_the_bound_is_that_of_the_best_weights(name: str) -> None:
    """Of the nine settings, which `fp.approximate_design` finds by another program."""
    given, goal = known_problem(quadratic, ZERO, SQUARE), of_quadratic(name)
    design = fp.exchange(given, 9, goal=goal, **QUICK)
    weights = fp.approximate_design(given, fp.Experiments(np.zeros((9, 0)), GRID), goal=goal)
    assert design.efficiency is not None and design.efficiency.at_least is not None
    assert design.efficiency.at_least == pytest.approx(weights.efficiency_of(design), abs=4e-3)


@pytest.mark.parametrize("name", ("A", "c"))
def test_over_the_prior_it_is_the_mean_of_the_logarithms(name: str) -> None:
    model, mean, bounds, _ = ONE_FACTOR["Box-Lucas"]
    given = known_problem(model, mean, bounds)
    scenarios = [{}, {"k_1": 0.5}, {"k_2": 0.3}]
    over = fp.OverPrior("log", scenarios=scenarios)
    goal = fp.Goal(name, of="k_1 / k_2" if name == "c" else None, over=over)
    design = fp.exchange(given, 4, goal=goal, **QUICK)
    values = []
    for one in scenarios:
        there = given.replace(prior=fp.GaussianPrior(mean | one, std=dict(given.prior.std)))
        f = fp.evaluate(there, design.points).fisher
        values.append(fp.criterion(there, goal).log_phi(f))
    assert design.scenarios is not None and design.efficiency is not None
    assert design.scenarios.value == pytest.approx(np.mean(values), abs=1e-9)
    assert design.efficiency.at_most is not None and design.scenarios.value <= design.efficiency.at_most + 1e-9
    assert design.efficiency.at_least is not None and 0.8 < design.efficiency.at_least <= 1 + 1e-9
    assert "over 3 scenarios" in str(design.report())


# --- where not everything is determined ---------------------------------------------------------------------------------------

BLIND = fp.SymbolicModel([], ["(a + b)*u + c*v"], {}, dict.fromkeys("uv", "1"), dict.fromkeys("abc", "1"), {"y": "1"})
"""Only a + b can be told."""


def blind() -> fp.DesignProblem:
    prior = fp.GaussianPrior(mean=dict.fromkeys("abc", 1.0), std={"a": 1.0, "b": 2.0, "c": 0.5})
    region = fp.ExperimentRegion({"u": (-1, 1), "v": (-1, 1)}, constraints=["u**2 + v**2 < 1"])
    return fp.DesignProblem(BLIND, prior, region, noise={"y": 1.0})


@pytest.mark.parametrize("name", ("A", "E", "ME"))
def test_criteria_of_all_parameters_ask_for_what_is_estimable(name: str) -> None:
    """By hand: in units of the prior the rows are u (1, 2, 0) + v (0, 0, 1/2), and the information has two eigenvalues."""
    design = fp.exchange(blind(), 6, goal=name, **QUICK)
    rows = design.points.u @ np.array([[1.0, 2.0, 0.0], [0.0, 0.0, 0.5]])
    _, low, high = np.linalg.eigvalsh(rows.T @ rows)
    value = {"A": 1 / low + 1 / high, "E": low, "ME": high / low}[name]
    assert design.value == pytest.approx(value, rel=1e-6)
    assert design.evaluation.rank == 2 and len(design.evaluation.null_directions) == 1
    # all on the rim of the circle: with shares w and 1 - w of u^2 and v^2 A is 1/(5 w) + 4/(1 - w), E the smaller of 5 w, (1 - w)/4
    w = {"A": 1 / (1 + np.sqrt(20)), "E": 1 / 21, "ME": 1 / 21}[name]
    best = {"A": 1 / (5 * w) + 4 / (1 - w), "E": 5 * w, "ME": 1.0}[name] * {"A": 1 / 6, "E": 6, "ME": 1}[name]
    assert design.value == pytest.approx(best, rel=0.02)
    report = str(design.report())
    assert "information on 1.00 a - 0.50 b (in prior std)" in " ".join(report.split()) and "not determined (in prior std)" in report
    if name != "ME":
        assert design.efficiency is not None and design.efficiency.at_least is not None
        assert 0.97 < design.efficiency.at_least <= 1 + 1e-9


def test_a_function_of_what_is_estimable_has_its_design_and_another_one_error() -> None:
    given = blind()
    design = fp.exchange(given, 4, goal=fp.Goal("c", of="a + b"), **QUICK | {"max_iterations": 80})
    assert design.value == pytest.approx(1 / (design.points.u[:, 0] ** 2).sum(), rel=1e-3)
    assert design.value == pytest.approx(1 / 4, rel=0.01)
    assert design.efficiency is not None and design.efficiency.at_least == pytest.approx(1, abs=0.01)
    with pytest.raises(ValueError, match=r"^region: .*criterion 'c', given none with information on 1.00 a - 0.50 b"):
        fp.exchange(given, 4, goal=fp.Goal("c", of="a - b"), **QUICK)
    with pytest.raises(ValueError, match=r"^region: .*criterion 'Ds'"):
        fp.exchange(given, 4, goal=fp.Goal("Ds", of=["a", "c"]), **QUICK)


@pytest.mark.parametrize("name", ("A", "E", "ME"))
def test_too_few_points_for_criteria_of_all_parameters_are_chosen_by_log_det(name: str) -> None:
    design, by_log_det = (fp.exchange(blind(), 1, goal=of, **QUICK) for of in (name, "D"))
    np.testing.assert_array_equal(design.points.table, by_log_det.points.table)
    assert design.evaluation.rank == 1 and design.too_few and design.efficiency is not None
    assert design.efficiency.at_least is None and design.efficiency.at_most is None
    assert f"enough for criterion {name}, points are chosen by log det F" in " ".join(str(design).split())
    with pytest.raises(ValueError, match=r"^region: .*singular = 'error'.* information on 1.00 a - 0.50 b"):
        fp.exchange(blind(), 6, goal=fp.Goal(name, singular="error"), **QUICK)


def test_too_few_points_for_certain_functions_are_an_error() -> None:
    with pytest.raises(ValueError, match=r"^n_experiments: .*'I', given 1"):
        fp.exchange(blind(), 1, goal=fp.Goal("I", of="y", conditions=fp.Experiments(np.zeros((2, 0)), np.eye(2))), **QUICK)


# --- beside the rest of the library -------------------------------------------------------------------------------------------


def growth(**changes: Any) -> fp.DesignProblem:
    model, mean, _, _ = ONE_FACTOR["saturating growth"]
    return known_problem(model, mean, {"y": (0, 0), "dt": (SOON, 10)}, sigma=0.1, **changes)


def at(*times: float) -> fp.Experiments:
    return fp.Experiments(np.zeros((len(times), 1)), np.zeros((len(times), 0)), np.array(times))


def test_previous_and_kept_points_count() -> None:
    """The best next point for the trace, by a scan over the interval."""
    given, before = growth(), at(1, 2, 3, 4, 5, 7.0)

    def trace(t: float) -> float:
        f = fp.evaluate(given, fp.Experiments.join([before, at(t)])).information
        return float(np.trace(np.linalg.solve(f, np.eye(2))))

    best = min(trace(t) for t in np.linspace(0.01, 10, 500))
    for asked in ({"n_experiments": 1, "previous": before}, {"n_experiments": 7, "keep": before}):
        design = fp.exchange(given, goal="A", **asked, **QUICK)
        assert design.value == pytest.approx(best, rel=1e-4)
        assert design.efficiency is not None and design.efficiency.at_least is not None
        assert 0.9 < design.efficiency.at_least <= 1 + 1e-9


def test_the_same_bits_for_any_number_of_threads() -> None:
    given = growth()
    one, three = (fp.exchange(given, 4, goal="E", threads=n, **QUICK) for n in (1, 3))
    assert np.array_equal(one.points.table, three.points.table)


def test_a_design_is_kept_with_what_was_asked(tmp_path: Path) -> None:
    given = growth()
    goals = [
        fp.Goal("A", scale={"a": 1.0, "b": 0.1}),
        fp.Goal("I", of="y", conditions=at(2.0, 9.0)),
        fp.Goal("Ds", of=["b"]),
    ]
    for number, goal in enumerate(goals):
        design = fp.exchange(given, 3, goal=goal, **QUICK)
        design.save(tmp_path / str(number))
        again = fp.Design.load(tmp_path / str(number))
        assert again.value == design.value and again.settings.goal == goal
        assert str(again.report()) == str(design.report())
        assert f"chosen by criterion {goal.criterion}" in str(design.report())
        assert f"{goal.criterion}-efficiency" in str(design.report())
        assert "log det at most" not in str(design.report())
        assert design.plot("criterion").axes[0].get_ylabel().startswith(("-log(", "log det of the information about b"))


def test_scales_say_which_errors_count() -> None:
    given = growth()
    of_b = fp.exchange(given, 6, goal=fp.Goal("A", scale={"a": 1e6, "b": 1.0}), method=fp.ExchangeMethod(references=False), **QUICK)
    alone = fp.exchange(given, 6, goal=fp.Goal("c", of="b"), method=fp.ExchangeMethod(references=False), **QUICK)
    assert of_b.value == pytest.approx(alone.value, rel=1e-3)  # the variance of b in its own unit


MISUSE: list[tuple[dict[str, Any], str]] = [
    ({"goal": "G"}, "criterion: expected "),
    ({"goal": "c"}, "of: expected "),
    ({"goal": fp.Goal("c", of="q")}, "of: "),
    ({"goal": fp.Goal("Ds", of=[])}, "of: expected "),
    ({"goal": fp.Goal("A", scale={"a": 1.0})}, "scale: expected |scale.b|b: "),
    ({"goal": "A", "method": "paper"}, "criterion 'A': expected method"),
]


@pytest.mark.parametrize(("options", "message"), MISUSE)
def test_misuse_is_one_clear_error(options: dict[str, Any], message: str) -> None:
    with pytest.raises((ValueError, TypeError), match=message):
        fp.exchange(growth(), 4, **options, **QUICK)


@pytest.mark.parametrize("kind", ("region", "pooled", "pointwise"))
def test_other_output_covariances_are_refused(kind: str) -> None:
    with pytest.raises(ValueError, match=rf"^criterion 'E': expected .* output_covariance '{kind}'"):
        fp.exchange(growth(output_covariance=kind), 4, goal="E", **QUICK)


SIZE = "n_experiments = 4\nmax_iterations = 10"
WHERE = fp.Experiments(np.zeros((2, 0)), np.array([[0.1], [1.0]]))


def _with_keys(keys: str, directory: Path) -> Path:
    """The example with a goal, and few candidates."""
    path = directory / "problem.toml"
    path.write_text(f"{MICHAELIS_MENTEN.read_text().split('[design]')[0]}[design]\n{SIZE}\n\n[goal]\n{keys}\n")
    return path


@pytest.mark.parametrize(
    ("keys", "goal"),
    [
        ('criterion = "c"\nof = "V / K"', fp.Goal("c", of="V / K")),
        ('criterion = "Ds"\nof = ["K"]', fp.Goal("Ds", of=["K"])),
        ('criterion = "A"\nscale = {V = 100.0, K = 0.01}', fp.Goal("A", scale={"V": 100.0, "K": 0.01})),
        ('criterion = "I"\nof = "rate"\nconditions = "where.csv"', fp.Goal("I", of="rate", conditions=WHERE)),
    ],
)
def test_keys_of_a_file_are_the_arguments(keys: str, goal: fp.Goal, tmp_path: Path) -> None:
    path = _with_keys(keys, tmp_path)
    (tmp_path / "where.csv").write_text("s\n0.1\n1.0\n")
    config = load_config(path)
    design = fp.exchange(config.problem(), **config.exchange_settings())
    same = fp.exchange(config.problem(), 4, max_iterations=10, goal=goal)
    assert np.array_equal(design.points.table, same.points.table) and design.value == same.value


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ('criterion = "B"', "goal.criterion: expected"),
        ('criterion = "I"\nof = "rate"\nconditions = "nowhere.csv"', "goal.conditions: expected a file of points"),
        ('criterion = "A"\nscale = {V = -1.0, K = 0.01}', "goal.scale.V: expected"),
    ],
)
def test_mistakes_in_a_file_are_named(keys: str, message: str, tmp_path: Path) -> None:
    path = _with_keys(keys, tmp_path)
    with pytest.raises(ConfigError, match=message):
        load_config(path).exchange_settings()


def test_a_campaign_designs_its_batches_by_the_criterion() -> None:
    given = fp.load_problem(MICHAELIS_MENTEN)
    campaign = fp.Campaign(given, batch=3, goal=fp.Goal("c", of="V / K"), max_iterations=10, n_candidates=20)
    batch = campaign.next()
    alone = fp.exchange(given, 3, goal=fp.Goal("c", of="V / K"), max_iterations=200, method=fp.ExchangeMethod(references=False))
    value = fp.criterion(given, fp.Goal("c", of="V / K")).value
    assert value(fp.evaluate(given, batch).information) < 1.1 * alone.value
