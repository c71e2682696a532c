"""Evaluations against (7), (16) and (17) written out in NumPy, and what is said of designs that tell too little."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import fisherpoint as fp
from defaults import KINDS, MODEL, NAMES, NOISE, OUTPUTS, PRIOR, SMALL, grid, point, problem, valid_points
from fisherpoint.information.candidates import CandidateSource
from fisherpoint.information.output_covariance import REGION_SAMPLE

Floats = NDArray[np.float64]
RTOL = 1e-10
STD = np.array([PRIOR.std[name] for name in NAMES])
MEAN = np.array([PRIOR.mean[name] for name in NAMES])
R = np.diag([NOISE[name] ** 2 for name in OUTPUTS])


def predictive(points: fp.Experiments, rule: fp.TensorGrid, prior: fp.GaussianPrior = PRIOR) -> Floats:
    """(16), its weights divided by their sum, node by node."""
    theta, weights = rule.nodes(prior)
    result = np.zeros((len(points), len(OUTPUTS), len(OUTPUTS)))
    nominal = fp.simulate(MODEL, points, prior.mean, rtol=RTOL).y
    for values, weight in zip(theta, weights, strict=True):
        deviation = fp.simulate(MODEL, points, values, rtol=RTOL).y - nominal
        result += weight * deviation[:, :, None] * deviation[:, None, :]
    return result / weights.sum()


def sensitivities(points: fp.Experiments, prior: fp.GaussianPrior = PRIOR) -> Floats:
    std = np.array([prior.std[name] for name in NAMES])
    return fp.sensitivities(MODEL, points, prior.mean, rtol=RTOL).dy_dtheta * std


def fisher(s: Floats, d: Floats) -> Floats:
    """(7) for one D or one each."""
    each = np.broadcast_to(d, (len(s), *d.shape[-2:]))
    return 2 / len(s) * sum(s_k.T @ np.linalg.solve(d_k, s_k) for s_k, d_k in zip(s, each, strict=True))


def direct(kind: str, noise: bool, points: fp.Experiments, rule: fp.TensorGrid) -> tuple[Floats, Floats, list[int]]:
    """D, F and the outputs that take part."""
    used = [0, 1, 2, 3] if noise else [0, 1, 2]
    r = (R if noise else 0 * R)[np.ix_(used, used)]
    if kind == "noise":
        d = r
    elif kind == "region":
        whole = problem(output_covariance="region", noise=NOISE if noise else None, rule=rule, rtol=RTOL)
        sample = CandidateSource(whole, np.random.default_rng(0), threads=1).draw_confirmed(REGION_SAMPLE).points
        d = r + predictive(sample, rule).mean(axis=0)[np.ix_(used, used)]
    else:
        spread = predictive(points, rule)[:, used][:, :, used]
        d = r + (spread if kind == "pointwise" else spread.mean(axis=0))
    return d, fisher(sensitivities(points)[:, used], d), used


CASES = [(kind, True) for kind in KINDS] + [("region", False), ("pooled", False), ("pointwise", False)]


@pytest.mark.parametrize(("kind", "noise"), CASES)
def test_an_evaluation_is_the_papers_equations(kind: str, noise: bool) -> None:
    rule = grid(a_tau=2, E_oil=3, B_v=2, p_t=2)
    points = valid_points(9, seed=1, rule=rule)
    given = problem(output_covariance=kind, noise=NOISE if noise else None, rule=rule, rtol=RTOL)
    evaluation = fp.evaluate(given, points)
    d, f, used = direct(kind, noise, points, rule)

    assert evaluation.output_covariance_kind == kind
    assert evaluation.outputs == tuple(OUTPUTS[i] for i in used)
    assert evaluation.outputs_left_out == (() if noise else ("x_v",))
    # Both sides integrate to 1e-10 of the states' scales, by different steps; spreads are 1e-4 of the scales and more.
    size = np.sqrt(np.max(np.diagonal(d, axis1=-2, axis2=-1).reshape(-1, len(used)), axis=0))
    np.testing.assert_allclose(evaluation.output_covariance / np.outer(size, size), d / np.outer(size, size), atol=1e-5)
    size = np.sqrt(np.diag(f))
    np.testing.assert_allclose(evaluation.fisher / np.outer(size, size), f / np.outer(size, size), atol=1e-5)
    assert evaluation.log_det == pytest.approx(np.linalg.slogdet(f)[1], abs=2e-4)
    assert evaluation.rank == 9 and evaluation.null_directions == ()


@pytest.mark.parametrize("kind", KINDS)
def test_standard_errors_come_from_the_sum_form(kind: str) -> None:
    points = valid_points(12, seed=2)
    evaluation = fp.evaluate(problem(output_covariance=kind), points)
    total = evaluation.information
    np.testing.assert_allclose(total, evaluation.fisher * len(points) / 2, rtol=1e-12)  # (7)'s 2/L taken off
    scale = np.sqrt(np.diag(total))
    covariance = np.linalg.inv(total / np.outer(scale, scale)) / np.outer(scale, scale) * np.outer(STD, STD)
    assert evaluation.covariance is not None and evaluation.standard_errors is not None and evaluation.rse is not None
    # the inverse of the squared system loses the square of the condition number, the product's form does not
    np.testing.assert_allclose(np.sqrt(np.diag(evaluation.covariance)), np.sqrt(np.diag(covariance)), rtol=1e-5)
    errors = np.sqrt(np.diag(evaluation.covariance))
    np.testing.assert_allclose(list(evaluation.standard_errors.values()), errors, rtol=1e-12)
    np.testing.assert_allclose(list(evaluation.rse.values()), errors / MEAN, rtol=1e-12)
    assert tuple(evaluation.standard_errors) == tuple(evaluation.rse) == evaluation.parameters == NAMES
    assert dict(evaluation.prior_std) == dict(PRIOR.std)
    assert evaluation.correlation is not None
    np.testing.assert_allclose(evaluation.correlation * np.outer(errors, errors), evaluation.covariance, rtol=1e-10)
    np.testing.assert_allclose(np.diag(evaluation.correlation), 1.0, rtol=1e-12)
    weak = [name for name in NAMES if evaluation.standard_errors[name] > PRIOR.std[name] / 2]
    assert list(evaluation.weak_parameters) == weak


def test_repeating_every_point_halves_the_covariance_and_keeps_fisher() -> None:
    points = valid_points(10, seed=3)
    twice = points[list(range(10)) * 2]
    once, doubled = (fp.evaluate(problem(), given) for given in (points, twice))
    np.testing.assert_allclose(doubled.fisher, once.fisher, rtol=1e-10, atol=1e-10 * np.abs(once.fisher).max())
    assert once.covariance is not None and doubled.covariance is not None
    errors = np.sqrt(np.diag(once.covariance))
    np.testing.assert_allclose(np.sqrt(np.diag(doubled.covariance)), errors / np.sqrt(2), rtol=1e-7)


def test_evaluation_under_noise() -> None:
    points = valid_points(10, seed=4)
    pooled = problem(output_covariance="pooled")
    under_noise = fp.evaluate(pooled, points, output_covariance="noise")
    assert under_noise.output_covariance_kind == "noise"
    assert under_noise.log_det == fp.evaluate(problem(output_covariance="noise"), points).log_det
    with pytest.raises(ValueError, match="noise"):
        fp.evaluate(problem(noise=None), points, output_covariance="noise")


@pytest.mark.parametrize("chosen", [("a_tau", "b_tau", "m_q"), ("B_v",), NAMES[3:], NAMES[::-1]])
def test_a_part_of_the_parameters_is_a_block(chosen: tuple[str, ...]) -> None:
    points = valid_points(10, seed=5)
    whole = fp.evaluate(problem(), points)
    part = fp.evaluate(problem(parameters=chosen), points)
    columns = [k for k, name in enumerate(NAMES) if name in chosen]
    assert part.parameters == tuple(NAMES[k] for k in columns)
    block = whole.fisher[np.ix_(columns, columns)]
    np.testing.assert_allclose(part.fisher, block, rtol=1e-10, atol=1e-12 * np.abs(block).max())


def test_known_parameters_do_not_spread_the_outputs() -> None:
    points = valid_points(9, seed=6)
    rule = grid(a_tau=3, E_oil=3, B_v=3)
    part = fp.evaluate(problem(output_covariance="pooled", parameters=["E_oil", "m_q"], rule=rule, rtol=RTOL), points)
    expected = R + predictive(points, grid(E_oil=3)).mean(axis=0)
    size = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(part.output_covariance / np.outer(size, size), expected / np.outer(size, size), atol=1e-5)


# --- too little ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("count", [1, 2])
def test_fewer_points_than_parameters(kind: str, count: int) -> None:
    points = valid_points(count, seed=7)
    evaluation = fp.evaluate(problem(output_covariance=kind), points)
    assert evaluation.rank == 3 * count  # x_v depends on no parameter
    assert evaluation.log_det == -np.inf
    assert evaluation.standard_errors is evaluation.rse is evaluation.covariance is evaluation.correlation is None
    assert evaluation.weak_parameters == NAMES
    assert len(evaluation.null_directions) == 9 - evaluation.rank
    s = fp.sensitivities(MODEL, points, MODEL.nominal).dy_dtheta * STD
    noise = np.array([NOISE[name] for name in OUTPUTS])[:, None]
    size = np.linalg.norm(s / noise)
    for direction in evaluation.null_directions:
        assert set(direction) <= set(NAMES)
        assert max(direction.values()) == 1.0 and min(direction.values()) >= -1.0
        combination = np.array([direction.get(name, 0.0) for name in NAMES])
        # entries below 1e-6 are not listed, which the outputs feel as much
        assert np.linalg.norm(s / noise @ combination) < 1e-5 * size


def test_three_points_of_three_outputs_may_be_enough() -> None:
    evaluation = fp.evaluate(problem(), valid_points(3, seed=8))
    assert evaluation.rank == 9 and np.isfinite(evaluation.log_det) and evaluation.standard_errors is not None


def test_a_parameter_without_influence_is_named() -> None:
    # Of a reaction that sets in above a concentration that no point reaches.
    states, parameters = {"c": "mol/L"}, {"k": "1/s", "b": "1/s", "n": "1"}
    model = fp.SymbolicModel(["-k*c - b*n*max(c - 100, 0)"], ["c"], states, {}, parameters, states)
    prior = fp.GaussianPrior({"k": 0.5, "b": 1.0, "n": 2.0}, relative_std={"k": 0.1, "b": 0.1, "n": 0.1})
    points = fp.Experiments([[1.0], [2.0], [3.0]], np.empty((3, 0)), [0.5, 1.0, 2.0])
    evaluation = fp.evaluate(fp.DesignProblem(model, prior, None, noise={"c": 0.01}), points)
    assert evaluation.log_det == -np.inf and evaluation.standard_errors is None
    found = {name for direction in evaluation.null_directions for name in direction}
    assert found == {"b", "n"} and evaluation.rank == 1


def test_repeated_points_add_no_rank() -> None:
    one = valid_points(1, seed=10)
    evaluation = fp.evaluate(problem(), one[[0] * 12])
    assert evaluation.rank == 3 and evaluation.log_det == -np.inf and len(evaluation.null_directions) == 6


def test_rank_log_det_and_standard_errors_agree() -> None:
    """Ever more similar points run through all conditions from regular to singular; the three must never contradict each other."""
    seen = set()
    base, rng = point().table[0], np.random.default_rng(11)
    for decade in np.linspace(-12, -0.7, 60):
        table = base * (1 + 10.0**decade * rng.uniform(-1, 1, (12, 7)))
        points = fp.Experiments(table[:, :5], table[:, 5:6], table[:, 6])
        evaluation = fp.evaluate(problem(), points)
        regular = evaluation.standard_errors is not None
        seen.add(regular)
        assert regular == bool(np.isfinite(evaluation.log_det)) == (evaluation.rank == 9) == (not evaluation.null_directions)
        if evaluation.standard_errors is not None:
            assert all(0 < value < np.inf for value in evaluation.standard_errors.values())
    assert seen == {True, False}


# --- singular D ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["region", "pooled", "pointwise"])
def test_without_noise_the_valve_position_is_left_out_by_name(kind: str) -> None:
    evaluation = fp.evaluate(problem(noise=None, output_covariance=kind), valid_points(9, seed=12))
    assert evaluation.outputs == ("q", "p_A", "p_B") and evaluation.outputs_left_out == ("x_v",)
    assert evaluation.output_covariance.shape[-2:] == (3, 3)


@pytest.mark.parametrize("kind", ["region", "pooled", "pointwise"])
def test_a_grid_of_one_node_leaves_no_variance_and_the_error_names_the_outputs(kind: str) -> None:
    given = problem(noise=None, output_covariance=kind, rule=grid())
    with pytest.raises(ValueError, match=r"expected a regular D, given no variance of q, p_A, p_B.*noise"):
        fp.evaluate(given.replace(jumps="exclude"), valid_points(9, seed=13, jumps="exclude"))
    # A crossing is computed node by node, which leaves roundings of a variance.
    with pytest.raises(ValueError, match=r"expected a regular D, given (no variance of q|one that is singular in).*noise"):
        fp.evaluate(given, valid_points(9, seed=13))


@pytest.mark.parametrize(("kind", "count"), [("pooled", 1), ("pointwise", 9)])
def test_too_few_levels_for_the_outputs_are_an_error_that_names_them(kind: str, count: int) -> None:
    given = problem(noise=None, output_covariance=kind, rule=grid(B_v=2))  # two nodes: rank two at most
    with pytest.raises(ValueError, match=r"expected a regular D, given one that is singular in .*(q|p_A|p_B).*noise") as caught:
        fp.evaluate(given, valid_points(count, seed=14, rule=grid(B_v=2)))
    assert "x_v" not in str(caught.value)


# --- the closed bound ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", [15, 16, 17])
def test_to_first_order_every_pooled_design_without_noise_has_the_same_trace(seed: int) -> None:
    """tr(Sigma_theta F) = 2 n_y, where Sigma_theta is the covariance of the nodes."""
    small = 1e-4
    prior = fp.GaussianPrior(MODEL.nominal, relative_std={name: small for name in NAMES})
    rule = fp.TensorGrid(2, span=1.0)  # 512 nodes
    given = problem(prior=prior, noise=None, output_covariance="pooled", rule=rule, rtol=1e-11)
    points = valid_points(12, seed=seed)
    evaluation = fp.evaluate(given, points)
    shares = np.array(list(rule.variances(prior).values()))
    # Terms of second order are as small as the prior; the integrator adds 1e-11 to deviations of about 1e-4 of 1e-2.
    assert shares @ np.diag(evaluation.fisher) == pytest.approx(2 * 3, rel=20 * small)
    scaled_log_det = evaluation.log_det + np.log(shares).sum()
    assert scaled_log_det < 9 * np.log(2 * 3 / 9) + 20 * small


def test_the_bound_of_a_design_is_the_closed_one() -> None:
    rule = fp.TensorGrid(2, span=1.0)
    given = problem(noise=None, output_covariance="pooled", rule=rule)
    efficiency = fp.exchange(given, n_experiments=9, n_candidates=5, max_iterations=3).efficiency
    assert efficiency is not None
    shares = np.array(list(rule.variances(PRIOR).values()))
    assert efficiency.bound == pytest.approx(9 * np.log(2 * 3 / 9) - np.log(shares).sum(), rel=1e-12)
    assert efficiency.vs_bound is not None and 0 < efficiency.vs_bound < 1.1
    assert efficiency.under_noise is efficiency.at_most is efficiency.best_found is efficiency.random_median is None


@pytest.mark.parametrize("factor", (0.1, 1.0, 10.0))
def test_with_noise_the_closed_bound_is_an_inequality(factor: float) -> None:
    """D is larger than the mean predictive covariance, so that tr(Sigma F) is below 2 n_y; the more noise, the further."""
    rule = fp.TensorGrid(2, span=1.0)
    noise = {name: factor * std for name, std in NOISE.items()}
    given = problem(noise=noise, output_covariance="pooled", rule=rule)
    design = fp.exchange(given, n_experiments=9, n_candidates=5, max_iterations=3)
    efficiency, shares = design.efficiency, np.array(list(rule.variances(PRIOR).values()))
    assert efficiency is not None and efficiency.vs_bound is not None
    assert shares @ np.diag(design.evaluation.fisher) < 2 * len(design.evaluation.outputs)
    assert efficiency.bound == pytest.approx(9 * np.log(2 * 4 / 9) - np.log(shares).sum(), rel=1e-12)
    assert design.evaluation.log_det < efficiency.bound and 0 < efficiency.vs_bound < 1
    for seed in range(3):
        random = fp.exchange(
            given, n_experiments=9, n_candidates=5, max_iterations=0, seed=seed, method=fp.ExchangeMethod(references=False)
        )
        assert random.evaluation.log_det < efficiency.bound


def test_a_regionless_problem_can_be_evaluated() -> None:
    for kind in ("noise", "pooled", "pointwise"):
        given = problem(output_covariance=kind)
        points = valid_points(9, seed=18)
        expected = fp.evaluate(given, points).log_det
        assert fp.evaluate(given.replace(region=None), points).log_det == expected


def test_the_region_covariance_does_not_depend_on_the_design() -> None:
    a, b = (fp.evaluate(problem(output_covariance="region"), valid_points(9, seed=s)) for s in (19, 20))
    np.testing.assert_array_equal(a.output_covariance, b.output_covariance)


def test_an_evaluation_of_one_point_with_all_noise() -> None:
    evaluation: Any = fp.evaluate(problem(), point())
    np.testing.assert_allclose(evaluation.output_covariance, R, rtol=1e-15)
    assert SMALL.size(PRIOR) == 27


QUADRATIC = fp.SymbolicModel([], ["a + b*u + c*u**2"], {}, {"u": "1"}, {"a": "1", "b": "1", "c": "1"})


@pytest.mark.parametrize("place", [0.0, 1e2, 1e3, 3e3])
def test_a_polynomial_far_from_zero_has_the_determinant_that_it_has_there(place: float) -> None:
    """A shift of u is a change of parameters with determinant 1; the singular values fall as the square of the place."""
    prior = fp.GaussianPrior({"a": 1.0, "b": 2.0, "c": 3.0}, std=dict.fromkeys("abc", 0.1))
    given = fp.DesignProblem(QUADRATIC, prior, None, noise={"y": 0.1})
    near, far = (fp.evaluate(given, fp.Experiments(np.empty((5, 0)), np.linspace(u, u + 1, 5)[:, None])) for u in (0.0, place))
    assert far.log_det == pytest.approx(near.log_det, abs=1e-4) and far.rank == 3
    assert near.standard_errors is not None and far.standard_errors is not None
    assert far.standard_errors["c"] == pytest.approx(near.standard_errors["c"], rel=1e-4)


def test_a_null_direction_has_all_that_the_outputs_feel() -> None:
    """a alone does change them: what does not is a, b and c together, in shares of 1, 1e-6 and 1e-12."""
    prior = fp.GaussianPrior({"a": 1.0, "b": 2.0, "c": 3.0}, std=dict.fromkeys("abc", 0.1))
    points = fp.Experiments(np.empty((5, 0)), np.linspace(1e6, 1e6 + 1, 5)[:, None])
    evaluation = fp.evaluate(fp.DesignProblem(QUADRATIC, prior, None, noise={"y": 0.1}), points)
    assert evaluation.rank == 2 and evaluation.log_det == -np.inf
    (direction,) = evaluation.null_directions
    change = np.array([direction[name] for name in "abc"])  # all are listed
    alone = np.abs(change * points.u ** np.arange(3)).max()
    assert np.abs((change * points.u ** np.arange(3)).sum(axis=1)).max() < 1e-6 * alone


def test_units_stand_in_the_report_and_are_kept(tmp_path: Path) -> None:
    evaluation = fp.evaluate(problem(), valid_points(12))
    assert evaluation.units == {quantity.name: quantity.unit for quantity in MODEL.parameters}
    assert [(row[0], row[1]) for row in evaluation.report().sections[0].rows][:2] == [("a_tau", "N"), ("b_tau", "N s/m")]
    evaluation.save(tmp_path / "evaluation.json")
    assert fp.Evaluation.load(tmp_path / "evaluation.json").units == evaluation.units


def test_of_a_parameter_at_zero_the_relative_error_is_infinite_everywhere(tmp_path: Path) -> None:
    model = fp.SymbolicModel(["-k*h + b*u"], ["h"], {"h": "m"}, {"u": "1"}, {"k": "1/s", "b": "m/s"}, {"y": "m"})
    region = fp.ExperimentRegion({"h": (0.5, 2.0), "u": (0.0, 2.0), "dt": (0.1, 2.0)})
    prior = fp.GaussianPrior({"k": 1.0, "b": 0.0}, {"k": 0.2, "b": 0.3})
    problem = fp.DesignProblem(model, prior, region, noise={"y": 0.01})
    design = fp.exchange(problem, 3, n_candidates=5, max_iterations=1)
    assert design.evaluation.rse is not None and design.under_noise is not None
    assert design.evaluation.rse["b"] == np.inf > design.evaluation.rse["k"]
    design.save(tmp_path)
    assert str(fp.Design.load(tmp_path)) == str(design)
    design.evaluation.save(tmp_path / "evaluation.json")
    assert fp.Evaluation.load(tmp_path / "evaluation.json").rse == design.evaluation.rse
    campaign = fp.Campaign(problem, batch=3, n_candidates=5, max_iterations=1)
    assert campaign.rse["b"] == np.inf
    for shown in (design, design.evaluation, campaign):
        (row,) = (line.split() for line in str(shown).splitlines() if line.split()[:2] == ["b", "m/s"])
        assert "inf" in row
    exact = fp.Measurements(design.points, fp.simulate(model, design.points, {"k": 1.0, "b": 0.0}).y)
    fit = fp.estimate(model, exact, prior, noise={"y": 0.01})
    assert set(fit.rse) == {"k", "b"} and fit.to_pandas().rse.notna().all()
