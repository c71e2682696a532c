"""The prior's information beside that of measurements: evaluations, searches for points and runs, their bounds, and files."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.campaign.settings import batch_seed
from fisherpoint.design.file.configuration import load_config
from test_known_designs import SQUARE, quadratic

GRID = np.array(list(itertools.product((-1.0, 0.0, 1.0), repeat=2)))
QUICK: dict[str, Any] = {"n_candidates": 20, "max_iterations": 40}


def correlated() -> np.ndarray:
    """Standard deviations 1 to 6, neighbours correlated."""
    std = np.arange(1.0, 7.0)
    return np.asarray((np.eye(6) + 0.4 * (np.eye(6, k=1) + np.eye(6, k=-1))) * np.outer(std, std))


def problem(parameters: list[str] | None = None) -> fp.DesignProblem:
    """A quadratic in two factors with noise 1."""
    names = [quantity.name for quantity in quadratic.parameters]
    prior = fp.GaussianPrior(dict.fromkeys(names, 0.0), covariance=correlated())
    return fp.DesignProblem(quadratic, prior, fp.ExperimentRegion(SQUARE), noise={"y": 1.0}, parameters=parameters)


def rows(table: np.ndarray) -> np.ndarray:
    """Derivatives by the parameters in their own units."""
    a, b = table.T
    return np.column_stack([np.ones(len(a)), a, b, a * a, b * b, a * b])


def at(table: np.ndarray) -> fp.Experiments:
    return fp.Experiments(np.zeros((len(table), 0)), table)


# --- evaluations --------------------------------------------------------------------------------------------------------------


def test_it_counts_once_beside_the_sum_over_the_points() -> None:
    table = GRID[[0, 2, 4, 7]]
    found = fp.evaluate(problem(), at(table), prior_information=True)
    own, std = rows(table), np.sqrt(np.diag(correlated()))
    precision = own.T @ own + np.linalg.solve(correlated(), np.eye(6))
    assert found.information == pytest.approx(precision * np.outer(std, std), rel=1e-10)
    assert found.log_det == pytest.approx(np.linalg.slogdet(2 / 4 * precision * np.outer(std, std))[1], abs=1e-10)
    errors = np.sqrt(np.diag(np.linalg.solve(precision, np.eye(6))))
    assert list(found.standard_errors.values()) == pytest.approx(errors.tolist(), rel=1e-9)
    assert found.rank == 6 and not found.null_directions  # four points for six parameters
    assert found.n_points == 4


def test_the_errors_of_the_data_alone_stand_beside_them() -> None:
    enough = fp.evaluate(problem(), at(GRID), prior_information=True)
    alone = fp.evaluate(problem(), at(GRID))
    assert alone.without_prior is None
    assert dict(enough.without_prior) == pytest.approx(dict(alone.standard_errors), rel=1e-9)
    line = at(GRID[GRID[:, 1] == 0.0])  # c_0, and of the first factor, can be known there; what has b in it cannot
    some = fp.evaluate(problem(), line, prior_information=True)
    names = list(problem().estimated)
    open_ = [name for name in names if np.isinf(some.without_prior[name])]
    assert open_ == [names[k] for k in (2, 4, 5)]
    assert np.isfinite(list(some.standard_errors.values())).all()
    assert "without the prior" in str(some.report())


def test_of_some_parameters_it_is_that_of_their_own_covariance() -> None:
    """As the estimate takes it: the others are at their means, and nothing is known better for that."""
    given = problem(["c_1", "c_2"])
    found = fp.evaluate(given, at(GRID[:1]), prior_information=True)
    own, part = rows(GRID[:1])[:, 1:3], correlated()[1:3, 1:3]
    errors = np.sqrt(np.diag(np.linalg.solve(own.T @ own + np.linalg.solve(part, np.eye(2)), np.eye(2))))
    assert list(found.standard_errors.values()) == pytest.approx(errors.tolist(), rel=1e-10)
    fit = fp.estimate(
        quadratic,
        fp.Measurements(at(GRID[:1]), np.zeros((1, 1))),
        given.prior,
        parameters=["c_1", "c_2"],
        noise={"y": 1.0},
        starts=1,
    )
    assert [fit.standard_errors[name] for name in ("c_1", "c_2")] == pytest.approx(errors.tolist(), rel=1e-6)


def test_it_is_only_for_the_sensor_noise() -> None:
    with pytest.raises(ValueError, match=r"prior_information: expected output_covariance 'noise', .* given 'pooled'"):
        fp.evaluate(problem().replace(output_covariance="pooled"), at(GRID), prior_information=True)
    for changed, options in (({"output_covariance": "pooled"}, {}), ({}, {"method": "paper"})):
        with pytest.raises(ValueError, match='prior_information: expected method = "auto"'):
            fp.exchange(problem().replace(**changed), 4, goal=fp.Goal(prior_information=True), **options)


# --- searches -----------------------------------------------------------------------------------------------------------------


@pytest.mark.long
@pytest.mark.parametrize(("count", "name"), [(3, "D"), (5, "D"), (3, "A"), (7, "D"), (4, "E")])
def test_designs_are_the_best_of_all(count: int, name: str) -> None:
    """Of all multisets of nine settings, also with fewer points than parameters, and nothing better is possible there."""
    std = np.sqrt(np.diag(correlated()))
    known = np.linalg.solve(correlated() / np.outer(std, std), np.eye(6))
    scaled, best = rows(GRID) * std, -np.inf
    criterion = fp.criterion(problem(), name)
    for chosen in itertools.combinations_with_replacement(range(9), count):
        own = scaled[list(chosen)]
        best = max(best, criterion.log_phi(own.T @ own + known))
    design = fp.exchange(problem(), count, goal=fp.Goal(name, prior_information=True), n_candidates=20)
    assert criterion.log_phi(design.evaluation.information) >= best - 1e-6
    assert design.value == pytest.approx(criterion.value(design.evaluation.information))
    bound = design.efficiency
    assert bound is not None and bound.at_most is not None and bound.at_least is not None
    assert 0.3 < bound.at_least <= 1 + 1e-9  # three points fall far short of weights
    in_total = bound.at_most / criterion.level + np.log(count / 2)  # of F as in (7)
    assert best <= in_total + 1e-9
    assert design.trace[-1].log_det == pytest.approx(criterion.level * (criterion.log_phi(design.evaluation.fisher)), abs=1e-9)
    assert "counts once beside the data" in str(design.report())


def test_the_bound_is_that_of_the_best_weights() -> None:
    design = fp.exchange(problem(), 4, goal=fp.Goal(prior_information=True), **QUICK)
    weights = fp.approximate_design(problem(), at(GRID), goal=fp.Goal(prior_information=True), n_experiments=4)
    assert design.efficiency.at_least == pytest.approx(weights.efficiency_of(design), abs=4e-3)


def test_a_poor_design_is_not_said_to_be_good() -> None:
    poor = fp.exchange(problem(), 6, goal=fp.Goal(prior_information=True), n_candidates=20, max_iterations=0, seed=3)
    good = fp.exchange(problem(), 6, goal=fp.Goal(prior_information=True), seed=3, **QUICK)
    assert poor.efficiency.at_least < 0.95
    assert poor.efficiency.at_least <= np.exp((poor.evaluation.log_det - good.evaluation.log_det) / 6) + 1e-6


def test_what_is_known_already_need_not_be_measured() -> None:
    """y = a + b u of a known offset: one point tells most at the end of the range, and of a known slope anywhere is as good."""
    line = fp.SymbolicModel(f=[], g=["a + b*u"], states={}, inputs={"u": "1"}, parameters={"a": "1", "b": "1"}, outputs={"y": "1"})
    region = fp.ExperimentRegion({"u": (-1, 1)})
    for std, expected in (({"a": 1e-3, "b": 10.0}, 1.0), ({"a": 10.0, "b": 1e-3}, None)):
        given = fp.DesignProblem(line, fp.GaussianPrior({"a": 0.0, "b": 0.0}, std), region, noise={"y": 0.1})
        design = fp.exchange(given, 1, goal=fp.Goal(prior_information=True), **QUICK)
        if expected is not None:
            assert abs(design.points.u[0, 0]) == pytest.approx(expected)
        u = float(design.points.u[0, 0])
        alone = np.log(4 * (1 + 100 * (std["a"] ** 2 + u * u * std["b"] ** 2)))  # det(2 (I + v v^T)), the determinant lemma
        assert design.evaluation.log_det == pytest.approx(alone, abs=1e-9)


def test_beside_previous_points_and_over_scenarios() -> None:
    before, scenarios = at(GRID[:2]), [{}, {"c_3": 2.0}]
    over = fp.OverPrior("worst", scenarios=scenarios)
    design = fp.exchange(problem(), 3, goal=fp.Goal(prior_information=True, over=over), previous=before, **QUICK)
    together = fp.evaluate(problem(), design.points, previous=before, prior_information=True)
    assert design.evaluation.log_det == pytest.approx(together.log_det, abs=1e-12)
    assert design.evaluation.n_points == 5
    assert design.scenarios.value == pytest.approx(together.log_det, abs=1e-9)  # the model is linear: all scenarios are the same
    assert design.scenarios.value <= design.efficiency.at_most + 1e-9


# --- files --------------------------------------------------------------------------------------------------------------------


def test_files_keep_it_and_repeat(tmp_path: Path) -> None:
    design = fp.exchange(problem(), 3, goal=fp.Goal(prior_information=True), **QUICK)
    design.save(tmp_path)
    loaded = fp.Design.load(tmp_path)
    assert loaded.settings == design.settings and loaded.settings.goal.prior_information
    assert loaded.evaluation.without_prior == design.evaluation.without_prior
    assert str(loaded.report()) == str(design.report())
    again = fp.exchange(loaded.problem, **vars(loaded.settings))
    assert np.array_equal(again.points.table, design.points.table)
    design.evaluation.save(tmp_path / "evaluation.json")
    assert fp.Evaluation.load(tmp_path / "evaluation.json").without_prior == design.evaluation.without_prior


MICHAELIS_MENTEN = Path(__file__).parents[2] / "examples" / "michaelis_menten.toml"


def test_a_toml_file_may_ask_for_it(tmp_path: Path) -> None:
    path = tmp_path / "with.toml"
    path.write_text(MICHAELIS_MENTEN.read_text().replace("[design]", "[goal]\nprior_information = true\n\n[design]", 1))
    assert load_config(path).exchange_settings()["goal"].prior_information is True


def test_a_campaign_counts_its_data_once() -> None:
    """From the second batch on the prior is the posterior, which has the data in it."""
    given = fp.load_problem(MICHAELIS_MENTEN)
    campaign = fp.Campaign(given, batch=2, goal=fp.Goal(prior_information=True), **QUICK)
    first = campaign.next()
    campaign.tell(fp.Measurements(first, fp.simulate(given.model, first, given.prior.mean).y))
    assert campaign.fit is not None
    posterior = given.replace(prior=campaign.fit.posterior())
    settings = vars(campaign.settings) | {"seed": batch_seed(campaign.settings.seed, 1)}
    assert np.array_equal(campaign.next().table, fp.exchange(posterior, **settings).points.table)
