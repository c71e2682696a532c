"""Predictive covariances by every rule: what they agree on, negative weights, lost nodes, and the comparison of rules."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import fisherpoint as fp
from conftest import random_points
from defaults import MODEL, NAMES, NOISE, PRIOR, RELATIVE_STD, point, problem, same_bits, valid_points
from fisherpoint.engine import _core
from fisherpoint.engine.levels import kernels
from fisherpoint.points.predictive import nearest_semidefinite, rounding_of_outputs
from fisherpoint.points.settings import checked_arguments
from fisherpoint.prior.rules import MAX_LOST_WEIGHT, RULES
from oracle import OUTPUT_ROWS, STATE_SCALES, Floats

pytestmark = pytest.mark.kernels

POSITIVE = [fp.TensorGrid(2, span=1.0), fp.GaussHermite(2), fp.Sobol(64)]
ALL = [*POSITIVE, fp.SparseGaussHermite(1), fp.SparseGaussHermite(2), fp.Unscented(), fp.LinearizedRule()]


def scaled_error(actual: Floats, expected: Floats) -> Floats:
    """Relative Frobenius error of covariances (K, n_y, n_y), outputs scaled by their std; x_v varies nowhere."""
    std = np.sqrt(np.diagonal(expected, axis1=1, axis2=2))[:, :3]
    scale = std[:, :, None] * std[:, None, :]
    difference, size = (actual - expected)[:, :3, :3] / scale, expected[:, :3, :3] / scale
    return np.linalg.norm(difference, axis=(1, 2)) / np.linalg.norm(size, axis=(1, 2))


# --- what rules agree on ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("correlated", [False, True])
@pytest.mark.parametrize("log", [(), ("c_L", "E_oil")])
def test_where_outputs_are_linear_every_rule_gives_the_linearized_covariance(correlated: bool, log: tuple[str, ...]) -> None:
    """A prior so narrow that the outputs are linear over it: only the second moments of the nodes count."""
    std = {name: 1e-4 * value for name, value in MODEL.nominal.items()}
    covariance = np.diag(np.square(list(std.values())))
    if correlated:
        for i, j, r in ((0, 1, 0.5), (3, 7, -0.7), (7, 8, 0.3)):
            covariance[i, j] = covariance[j, i] = r * np.sqrt(covariance[i, i] * covariance[j, j])
    prior = fp.GaussianPrior(MODEL.nominal, covariance=covariance, log=log)
    points = valid_points(6, seed=3)
    expected = fp.predictive_covariance(MODEL, points, prior, fp.LinearizedRule(), rtol=1e-10)
    assert not expected.status.any()
    for rule in (fp.GaussHermite(2), fp.SparseGaussHermite(1), fp.SparseGaussHermite(2), fp.Unscented()):
        result = fp.predictive_covariance(MODEL, points, prior, rule, rtol=1e-12)
        assert not result.status.any() and not result.projection.any() and not result.lost_weight.any()
        assert np.max(scaled_error(result.covariance, expected.covariance)) < 2e-3


def test_linearized_is_the_product_of_sensitivities_and_covariance() -> None:
    points = random_points(np.random.default_rng(2), 30)
    covariance = np.diag(np.square(list(PRIOR.std.values())))
    covariance[7, 8] = covariance[8, 7] = 0.5 * np.sqrt(covariance[7, 7] * covariance[8, 8])
    prior = fp.GaussianPrior(MODEL.nominal, covariance=covariance)
    result = fp.predictive_covariance(MODEL, points, prior, fp.LinearizedRule())
    sensitivities = fp.sensitivities(MODEL, points, MODEL.nominal)
    np.testing.assert_array_equal(result.status, sensitivities.status)
    ok = result.status == fp.Status.ok
    expected = np.einsum("kip,pq,kjq->kij", sensitivities.dy_dtheta, covariance, sensitivities.dy_dtheta)
    np.testing.assert_allclose(result.covariance[ok], expected[ok], rtol=1e-9, atol=1e-12 * np.abs(expected[ok]).max(axis=0).max())
    assert not result.covariance[~ok].any() and 0 < ok.sum() < 30
    np.testing.assert_array_equal(result.lost_weight, ~ok)


def test_a_problem_with_the_linearized_rule_reuses_its_sensitivities() -> None:
    points = valid_points(12, seed=4)
    for names in (NAMES, ("a_tau", "E_oil", "B_v")):
        linear = problem(rule=fp.LinearizedRule(), output_covariance="pooled", parameters=names)
        d = fp.evaluate(linear, points).output_covariance
        covariance = fp.predictive_covariance(MODEL, points, PRIOR, fp.LinearizedRule(), parameters=names).covariance
        np.testing.assert_allclose(d, np.diag(np.square(list(NOISE.values()))) + covariance.mean(axis=0), rtol=1e-12)


def test_the_kernels_sum_is_the_sum_over_the_nodes() -> None:
    """For rules of every kind over a correlated prior with log-normal parameters, trajectory by trajectory."""
    covariance = np.diag(np.square(list(PRIOR.std.values())))
    for i, j, r in ((3, 6, 0.4), (6, 7, -0.3), (7, 8, 0.6)):
        covariance[i, j] = covariance[j, i] = r * np.sqrt(covariance[i, i] * covariance[j, j])
    prior = fp.GaussianPrior(MODEL.nominal, covariance=covariance, log=["c_L", "a_tau"])
    one, nominal = point(), fp.simulate(MODEL, point(), MODEL.nominal, rtol=1e-11).y
    for rule in (fp.TensorGrid(2, span=1.0), fp.GaussHermite(2), fp.SparseGaussHermite(2), fp.Sobol(256), fp.Unscented()):
        theta, weights = rule.nodes(prior)
        y = fp.simulate(MODEL, one[np.zeros(len(theta), dtype=int)], theta, rtol=1e-11).y - nominal
        expected = (weights[:, None] * y).T @ y / weights.sum()
        result = fp.predictive_covariance(MODEL, one, prior, rule, rtol=1e-10)
        assert scaled_error(result.covariance, expected[None])[0] < 1e-6


def test_rules_come_close_to_a_converged_one_in_the_known_order() -> None:
    """Of the rules, by how far they are off at the median: linearized, unscented, sparse of level 2, sparse of level 3."""
    points = valid_points(12, seed=8, rule=fp.TensorGrid(2))
    converged = fp.predictive_covariance(MODEL, points, PRIOR, fp.Sobol(2**15))
    points = points[converged.status == 0]
    errors = []
    for rule in (fp.LinearizedRule(), fp.Unscented(), fp.SparseGaussHermite(2), fp.SparseGaussHermite(3)):
        result = fp.predictive_covariance(MODEL, points, PRIOR, rule)
        errors.append(np.median(scaled_error(result.covariance, converged.covariance[converged.status == 0])[result.status == 0]))
    assert errors[0] > errors[1] > 5 * errors[2] and errors[2] < 0.01 and errors[3] < 0.005


def test_steps_planned_for_stored_nodes_reach_the_tolerance(workload: dict[str, Floats]) -> None:
    """The 96 candidates of the workload: 99 % below the tolerance, none above ten times that."""
    table = workload["candidates"]
    points = fp.Experiments(table[:, :5], table[:, 5:6], table[:, 6])
    model = fp.HydraulicCylinder(A_A=1.96e-3, A_B=1.00e-3, q_min=0.0, q_max=0.5, p_s=21e6, T_1=3e-3, k_u=-1.0)
    mean = dict(zip(NAMES, [300, 1500, 150, 1.4e9, 0.5e6, 8.9e-7, 5e-9, 1e-4, 1.2e-4], strict=True))
    prior = fp.GaussianPrior(mean, relative_std=RELATIVE_STD)
    for rule in (fp.Unscented(), fp.SparseGaussHermite(2)):
        nodes = rule.core_nodes(prior)
        theta = nodes.nodes()[0]
        arguments = (model.core, points.x0, points.u, points.dt, model.theta(mean), nodes, 1e-6, True, False, "fastest", 2)
        y = kernels.predictive_covariance(*arguments, max_lost=1.0, keep_outputs=True)[3]
        rows = np.repeat(np.arange(len(points)), len(theta))
        tight = fp.simulate(model, points[rows], np.tile(theta, (len(points), 1)), rtol=1e-12, jumps="exclude")
        scale = np.maximum(np.abs(tight.y), STATE_SCALES[OUTPUT_ROWS])
        error = np.max(np.abs(y.reshape(tight.y.shape) - tight.y) / scale, axis=1)[tight.status == 0]
        assert np.mean(error < 1e-6) >= 0.99 and np.max(error) < 1e-5


# --- negative weights ---------------------------------------------------------------------------------------------------------


def test_the_projection_by_hand() -> None:
    """[[1, 2], [2, 1]] has the eigenvalues 3 and -1: what remains is 1.5 everywhere, at a distance of 1 of sqrt(10)."""
    projected, size = nearest_semidefinite(np.array([[[1.0, 2.0], [2.0, 1.0]]]))
    np.testing.assert_allclose(projected[0], 1.5, rtol=1e-14)
    assert size[0] == pytest.approx(1 / np.sqrt(10))
    units = np.diag([1e-5, 1e6])  # whatever the outputs are measured in
    projected, size = nearest_semidefinite((units @ [[1.0, 2.0], [2.0, 1.0]] @ units)[None])
    np.testing.assert_allclose(projected[0], units @ np.full((2, 2), 1.5) @ units, rtol=1e-14)
    assert size[0] == pytest.approx(1 / np.sqrt(10))


@given(st.integers(0, 2**32), st.integers(1, 5))
@settings(deadline=None, max_examples=50)
def test_no_semidefinite_matrix_is_nearer_than_the_projection(seed: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    given_matrix = rng.normal(size=(n, n))
    given_matrix = given_matrix + given_matrix.T
    given_matrix /= np.sqrt(np.outer(*[np.abs(np.diag(given_matrix))] * 2))
    projected, size = nearest_semidefinite(given_matrix[None])
    distance = np.linalg.norm(projected[0] - given_matrix)
    assert np.linalg.eigvalsh(projected[0]).min() > -1e-12 * max(1.0, np.abs(projected).max())
    assert size[0] * np.linalg.norm(given_matrix) == pytest.approx(distance, rel=1e-9, abs=1e-9 * np.linalg.norm(given_matrix))
    for _ in range(20):
        other = projected[0] + 0.3 * distance * rng.normal(size=(n, n)) / n
        values, vectors = np.linalg.eigh((other + other.T) / 2)
        other = (vectors * np.maximum(values, 0)) @ vectors.T
        assert np.linalg.norm(other - given_matrix) >= distance * (1 - 1e-9)


def test_outputs_that_are_held_at_zero_spoil_no_others() -> None:
    """Both masses have come to rest: their velocities are rounding, of which weights of both signs make any matrix."""
    mean, std = {"k": 2.5, "c": 0.75, "d": 0.58}, {"k": 0.05, "c": 0.015, "d": 0.0116}
    rates = ["2*(u - r)", "v", "w", "2*r - k*(y - z) - 0.2*v - c*sign(v)", "k*(y - z) - 0.2*w - d*sign(w)"]
    units = dict.fromkeys(("r", "y", "z", "v", "w"), "1")
    model = fp.SymbolicModel(rates, ["y", "z", "v", "w"], units, {"u": "1"}, dict.fromkeys("kcd", "1"), check_units=False)
    rule, prior = fp.SparseGaussHermite(2), fp.GaussianPrior(mean, std)
    starts = np.random.default_rng(0).uniform(-1, 1, (40, 5))
    points = fp.Experiments(starts, np.full((40, 1), -0.0115), np.full(40, 8.0))
    given = fp.predictive_covariance(model, points, prior, rule, rtol=1e-9)
    theta, weights = rule.nodes(prior)
    nodes = np.vstack([model.theta(mean), theta])
    y = fp.simulate(model, points[np.repeat(np.arange(40), len(nodes))], np.tile(nodes, (40, 1)), rtol=1e-9).y
    y = y.reshape(40, len(nodes), 4)
    rests = np.flatnonzero((np.abs(y[:, :, 2:]) < 1e-12).all(axis=(1, 2)) & (given.status == 0))
    assert len(rests) > 20
    off = y[:, 1:, :2] - y[:, :1, :2]
    expected = np.einsum("r,kri,krj->kij", weights, off, off)
    regular = [k for k in rests if np.linalg.eigvalsh(expected[k])[0] > 1e-6 * np.trace(expected[k])]
    assert len(regular) > 10
    for k in regular:
        np.testing.assert_allclose(given.covariance[k, :2, :2], expected[k], rtol=1e-6, atol=1e-7 * expected[k].max())


def test_spreads_that_are_rounding_of_a_model_in_python() -> None:
    units = {"x": ("1", 1e-3), "z": ("1", 10.0)}
    model = fp.CallableModel(
        lambda x, u, p: [-p.k * x.x, 0 * x.z], lambda x, u, p: [x.x, 2 * x.z], units, {"u": "1"}, {"k": "1"}, {"y": "1", "q": "1"}
    )
    points = fp.Experiments([[1.0, 1.0]] * 3, [[0.0]] * 3, [1.0] * 3)
    settings = checked_arguments(model, points, np.array([1.0]), 1e-6, 1, "cross", "cross", None)
    np.testing.assert_allclose(rounding_of_outputs(model, points, np.array([1.0]), settings), [[1e-16, 2e-12]] * 3, rtol=1e-3)


def test_semidefinite_matrices_are_not_touched() -> None:
    rng = np.random.default_rng(0)
    half = rng.normal(size=(20, 4, 2))
    half[:, 3] = 0.0
    matrices = half @ half.transpose(0, 2, 1)  # of rank 2, with an output that does not vary
    projected, size = nearest_semidefinite(matrices)
    assert same_bits(projected, matrices) and not size.any()
    matrices[0, 0, 0] *= -1  # an output without spread keeps none
    projected, size = nearest_semidefinite(matrices)
    assert size[0] > 0.1 and not size[1:].any() and not projected[:, 3].any() and not projected[:, :, 3].any()
    assert same_bits(projected[1:], matrices[1:])


def test_covariances_of_rules_with_negative_weights_are_semidefinite_and_say_how_they_became_so() -> None:
    """A prior so wide that the sparse rules' sums are none."""
    wide = fp.GaussianPrior(MODEL.nominal, relative_std=dict.fromkeys(NAMES, 0.35))
    points = random_points(np.random.default_rng(11), 300)
    result = fp.predictive_covariance(
        MODEL, points, wide, fp.SparseGaussHermite(3), parameters=("a_tau", "b_tau", "m_q"), jumps="exclude"
    )
    ok = result.status == fp.Status.ok
    assert ok.sum() > 10 and 1e-4 < result.projection[ok].max() < 0.1
    varying = result.covariance[ok][:, :3, :3]
    std = np.sqrt(np.diagonal(varying, axis1=1, axis2=2))
    values = np.linalg.eigvalsh(varying / (std[:, :, None] * std[:, None, :]))
    assert values.min() > -1e-12
    assert np.isfinite(result.covariance).all() and (result.projection[~ok] == 0).all()


@pytest.mark.parametrize("rule", POSITIVE, ids=repr)
def test_rules_with_positive_weights_are_as_the_kernel_sums_them(rule: fp.Rule) -> None:
    points = valid_points(10, seed=5)
    result = fp.predictive_covariance(MODEL, points, PRIOR, rule, threads=1)
    arguments = (
        points.x0,
        points.u,
        points.dt,
        MODEL.theta(MODEL.nominal),
        rule.core_nodes(PRIOR),
        1e-6,
        True,
        True,
        "fastest",
        1,
    )
    plain = kernels.predictive_covariance(MODEL.core, *arguments, max_lost=rule.max_lost_weight)[0]
    assert same_bits(result.covariance, plain) and not result.projection.any()


# --- lost nodes ---------------------------------------------------------------------------------------------------------------


def spread_of_friction(weak: float, strong: float, weight: float) -> _core.NodeTable:
    """The mean; friction that is a little weaker or stronger; and with `weight` friction that stops the piston."""
    theta = np.tile(MODEL.theta(MODEL.nominal), (4, 1))
    theta[:, 0] = [400.0, weak, 2 * 400 - weak, strong]
    weights = np.array([0.5, 0.25, 0.25, weight])
    return _core.NodeTable(theta, weights, theta[1:3])


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_lost_node_excludes_its_point_only_above_the_share(sign: float) -> None:
    slow = point(v=5e-3, p_A=8e6, p_B=1.62e7, x_v=-0.3, u=-0.5, dt=1e-3)
    arguments = (slow.x0, slow.u, slow.dt, MODEL.theta(MODEL.nominal))
    nodes = spread_of_friction(350.0, 6000.0, sign * 0.01)
    share = 0.01 / 1.01
    covariance, status, _, _, lost = kernels.predictive_covariance(
        MODEL.core, *arguments, nodes, 1e-6, True, False, "fastest", 1, max_lost=share * 1.01
    )
    assert status[0] == fp.Status.ok and lost[0] == pytest.approx(share, rel=1e-12)
    without = spread_of_friction(350.0, 400.0, 0.0)
    np.testing.assert_allclose(
        covariance, kernels.predictive_covariance(MODEL.core, *arguments, without, 1e-6, True, False, "fastest", 1)[0], rtol=1e-9
    )
    covariance, status, _, _, lost = kernels.predictive_covariance(
        MODEL.core, *arguments, nodes, 1e-6, True, False, "fastest", 1, max_lost=share * 0.99
    )
    assert status[0] == fp.Status.met_jump and lost[0] == pytest.approx(share, rel=1e-12) and not covariance.any()
    covariance, status, _, _, lost = kernels.predictive_covariance(MODEL.core, *arguments, nodes, 1e-6, True, False, "fastest", 1)
    assert status[0] == fp.Status.met_jump and lost[0] == 1.0 and not covariance.any()


def test_statuses_follow_from_the_lost_share() -> None:
    drawn = random_points(np.random.default_rng(20), 300)
    points = drawn[fp.simulate(MODEL, drawn, PRIOR.mean).status == fp.Status.ok]
    rule = fp.Sobol(4096)
    theta, _ = rule.nodes(PRIOR)
    theta = np.abs(theta)
    result = fp.predictive_covariance(MODEL, points, PRIOR, rule)
    seen = set()
    for k in range(len(points)):
        status = fp.simulate(MODEL, points[np.full(len(theta), k)], theta).status
        lost = np.mean(status != fp.Status.ok)
        assert result.lost_weight[k] == pytest.approx(lost, abs=2 / 4096)  # the sign of a far node's parameter
        if abs(lost - MAX_LOST_WEIGHT) > 2 / 4096:
            assert (result.status[k] == fp.Status.ok) == (lost < MAX_LOST_WEIGHT)
        if result.status[k]:
            assert result.status[k] == status[status != fp.Status.ok][0]
        seen.add((result.status[k] == 0, lost > 0))
    assert seen == {(True, False), (True, True), (False, True)}


def test_the_grid_of_the_paper_loses_none() -> None:
    points = random_points(np.random.default_rng(21), 200)
    result = fp.predictive_covariance(MODEL, points, PRIOR, fp.TensorGrid(2))
    np.testing.assert_array_equal(result.lost_weight, result.status != 0)
    assert fp.TensorGrid().max_lost_weight == 0.0 and fp.GaussHermite().max_lost_weight == MAX_LOST_WEIGHT == 1e-3


def test_weights_that_underflow_are_a_status_and_no_nan() -> None:
    far = fp.TensorGrid(edges=[20.0, 20.5])  # each of the nine has a probability, their product has none
    result = fp.predictive_covariance(MODEL, point(), fp.GaussianPrior(MODEL.nominal, relative_std=dict.fromkeys(NAMES, 1e-3)), far)
    assert result.status[0] == fp.Status.not_finite and not result.covariance.any() and result.lost_weight[0] == 0.0


# --- the result ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("rule", [*ALL, fp.Sobol(4096)], ids=repr)
def test_threads_do_not_change_the_result(rule: fp.Rule) -> None:
    covariance = np.diag(np.square(list(PRIOR.std.values())))
    covariance[7, 8] = covariance[8, 7] = 0.5 * np.sqrt(covariance[7, 7] * covariance[8, 8])
    prior = fp.GaussianPrior(MODEL.nominal, covariance=covariance, log=["c_L"])
    points = random_points(np.random.default_rng(7), 40)
    results = [fp.predictive_covariance(MODEL, points, prior, rule, threads=n) for n in (1, 2, 5)]
    for other in results[1:]:
        for name in ("covariance", "status", "projection", "lost_weight"):
            assert same_bits(getattr(results[0], name), getattr(other, name))
    alone = fp.predictive_covariance(MODEL, points[[3]], prior, rule)
    assert same_bits(alone.covariance[0], results[0].covariance[3])


def test_the_result_unpacks_to_covariance_and_status_and_can_be_sent() -> None:
    result = fp.predictive_covariance(MODEL, point(), PRIOR, fp.Unscented())
    covariance, status = result
    assert covariance is result.covariance and status is result.status and len(result) == 2
    copy = pickle.loads(pickle.dumps(result))
    assert isinstance(copy, fp.PredictiveCovariance)
    for name in ("covariance", "status", "projection", "lost_weight"):
        assert same_bits(getattr(copy, name), getattr(result, name))


def test_what_is_no_rule_is_refused() -> None:
    for wrong in (None, 3, fp.TensorGrid, "sobol"):
        with pytest.raises(TypeError, match=r"rule: expected a rule such as fisherpoint.SparseGaussHermite\(2\), given"):
            fp.predictive_covariance(MODEL, point(), PRIOR, wrong)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="parameters: expected at least one name, given none"):
        fp.predictive_covariance(MODEL, point(), PRIOR, fp.Unscented(), parameters=())


@pytest.mark.parametrize("rule", ALL, ids=repr)
def test_every_rule_takes_a_subset_of_the_parameters(rule: fp.Rule) -> None:
    some = fp.predictive_covariance(MODEL, point(), PRIOR, rule, parameters=("E_oil", "a_tau"))
    narrow = fp.GaussianPrior(
        MODEL.nominal, std={name: PRIOR.std[name] * (1 if name in ("E_oil", "a_tau") else 1e-9) for name in NAMES}
    )
    if isinstance(rule, fp.LinearizedRule | fp.TensorGrid | fp.GaussHermite | fp.Unscented):
        wide = fp.predictive_covariance(MODEL, point(), narrow, rule, rtol=1e-10)
        assert scaled_error(some.covariance, wide.covariance)[0] < 1e-5
    assert some.status[0] == 0 and some.covariance[0, 1, 1] > 0


# --- designs ------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("rule", [fp.SparseGaussHermite(2), fp.LinearizedRule(), fp.GaussHermite(2)], ids=repr)
def test_the_bound_of_the_pooled_form_takes_the_covariance_of_the_nodes(rule: fp.Rule) -> None:
    """log det(M F) <= p log(2 n_y / p) with M the second moments that the nodes have; narrow, so that outputs are linear."""
    covariance = np.diag(np.square([1e-3 * MODEL.nominal[name] for name in NAMES]))
    covariance[7, 8] = covariance[8, 7] = 0.8 * np.sqrt(covariance[7, 7] * covariance[8, 8])
    narrow = fp.GaussianPrior(MODEL.nominal, covariance=covariance)
    names = ("E_oil", "V_0A", "V_0B")
    settings_ = {"n_experiments": 6, "n_candidates": 10, "max_iterations": 5}
    pooled = problem(prior=narrow, noise=None, rule=rule, output_covariance="pooled", parameters=names, rtol=1e-9)
    efficiency = fp.exchange(pooled, **settings_).efficiency
    assert efficiency is not None and efficiency.bound is not None
    assert efficiency.bound == pytest.approx(3 * np.log(2 * 3 / 3) - np.log(1 - 0.8**2), abs=1e-6)
    assert efficiency.vs_bound is not None and efficiency.vs_bound < 1.01


# --- the comparison -----------------------------------------------------------------------------------------------------------


def test_a_comparison_of_rules() -> None:
    points = valid_points(3, seed=6)
    rules = [fp.LinearizedRule(), fp.SparseGaussHermite(1), fp.SparseGaussHermite(2), fp.TensorGrid(2)]
    comparison = fp.compare_rules(problem(rule=fp.Unscented()), points, rules)
    assert [row.rule for row in comparison.rows] == rules and comparison.points == 3
    assert [row.nodes for row in comparison.rows] == [1, 19, 199, 512]
    errors = [row.errors for row in comparison.rows]
    assert all(e is not None and 0 < e.median <= e.most <= e.worst for e in errors)
    assert errors[0].median > errors[2].median  # type: ignore[union-attr]
    assert comparison.converged.errors is not None and comparison.converged.errors.median < 1e-3
    assert all(row.seconds > 0 and row.excluded <= 3 for row in comparison.rows)
    text = str(comparison)
    assert all(repr(rule) in text for rule in (*rules, comparison.converged.rule, comparison.next_lower))
    enough = comparison.cheapest(within=10.0)
    assert enough is not None and enough.seconds == min(row.seconds for row in comparison.rows)
    assert comparison.cheapest(within=0.0) is None


def test_a_comparison_by_default_takes_every_kind_and_the_problems_own() -> None:
    own = fp.Sobol(32, seed=5)
    comparison = fp.compare_rules(problem(rule=own, parameters=("E_oil", "B_v")), valid_points(2, seed=6))
    rules = [row.rule for row in comparison.rows]
    assert rules[-1] == own and {type(rule) for rule in rules} == set(RULES.values())
    assert comparison.rows[rules.index(fp.TensorGrid())].nodes == 9


def test_a_comparison_that_cannot_be_is_refused() -> None:
    with pytest.raises(TypeError, match="problem: expected DesignProblem, given int"):
        fp.compare_rules(3, point())  # type: ignore[arg-type]
    with pytest.raises(TypeError, match=r"rules: expected rules such as .*, given int"):
        fp.compare_rules(problem(), point(), [3])  # type: ignore[list-item]
    with pytest.raises(ValueError, match="points: expected at least one that is ok under Sobol"):
        fp.compare_rules(problem(jumps="exclude"), point(v=2e-3, p_A=8e6, p_B=1.62e7, x_v=-0.3, u=-0.5, dt=1e-3))


@pytest.mark.parametrize(
    ("rule", "dt"), [(fp.SparseGaussHermite(2), 0.8), (fp.SparseGaussHermite(2), 0.9), (fp.TensorGrid(2, span=1.0), 0.93)]
)
def test_nodes_past_a_pole_in_time_exclude_their_point(rule: fp.TensorGrid | fp.SparseGaussHermite, dt: float) -> None:
    """x' = p x^2 has its pole at t = 1 / (p x0); the nodes with a larger p are past it, the mean is not."""
    model = fp.SymbolicModel(["p * x**2"], ["x"], {"x": "1"}, {}, {"p": "1/s"})
    prior = fp.GaussianPrior(mean={"p": 1.0}, std={"p": 0.1})
    result = fp.predictive_covariance(model, fp.Experiments([[1.0]], np.zeros((1, 0)), [dt]), prior, rule)
    assert result.status[0] != fp.Status.ok
    assert result.covariance[0, 0, 0] == 0.0


def test_covariances_near_a_pole_in_time_are_those_of_the_nodes() -> None:
    """Every point that is ok has the covariance of its nodes in closed form; beyond the pole of any node no point is ok."""
    model = fp.SymbolicModel(["p * x**2"], ["x"], {"x": "1"}, {}, {"p": "1/s"})
    prior = fp.GaussianPrior(mean={"p": 1.0}, std={"p": 0.1})
    for rule in (fp.SparseGaussHermite(2), fp.GaussHermite(4), fp.TensorGrid(3, span=1.5)):
        nodes, weights = rule.nodes(prior)
        dt = np.linspace(0.5, 0.99, 50)
        result = fp.predictive_covariance(model, fp.Experiments(np.ones((50, 1)), np.zeros((50, 0)), dt), prior, rule)
        for k, ended in enumerate(result.status):
            alive = 1 - nodes[:, 0] * dt[k] > 0
            assert (ended == fp.Status.ok) <= bool(alive.all())
            if ended == fp.Status.ok:
                deviation = 1 / (1 - nodes[:, 0] * dt[k]) - 1 / (1 - dt[k])
                truth = (weights * deviation**2).sum() / weights.sum()
                np.testing.assert_allclose(result.covariance[k, 0, 0], truth, rtol=1e-3)


@pytest.mark.parametrize("dt", [0.5, 1.0])
def test_growth_that_overflows_at_some_nodes_excludes_the_point(dt: float) -> None:
    model = fp.SymbolicModel(["-p * x"], ["x"], {"x": "1"}, {}, {"p": "1/s"})
    prior = fp.GaussianPrior(mean={"p": 1.0}, std={"p": 1000.0})
    result = fp.predictive_covariance(model, fp.Experiments([[1.0]], np.zeros((1, 0)), [dt]), prior, fp.SparseGaussHermite(2))
    assert result.status[0] != fp.Status.ok
