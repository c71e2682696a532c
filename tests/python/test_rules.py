"""Rules by themselves: exactness in closed form, node counts, weights, and what they refuse."""

from __future__ import annotations

import pickle
from itertools import product
from math import erf, exp, factorial, log, prod, sqrt
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from defaults import NAMES, PRIOR
from fisherpoint.prior.rules import DEFAULT_RULE, RULES

ONE = fp.GaussianPrior({"a": 0.0}, std={"a": 1.0})
THREE = fp.GaussianPrior({"a": 0.0, "b": 0.0, "c": 0.0}, std={"a": 1.0, "b": 1.0, "c": 1.0})
COVARIANCE = np.array([[4.0, 1.2, 0.0], [1.2, 1.0, -0.3], [0.0, -0.3, 0.25]])
CORRELATED = fp.GaussianPrior({"a": 10.0, "b": -5.0, "c": 2.0}, covariance=COVARIANCE)
EVERY_RULE = [
    fp.TensorGrid(),
    fp.TensorGrid(edges=(-2.0, -0.5, 0.5, 2.0)),
    fp.GaussHermite(3),
    fp.SparseGaussHermite(2),
    fp.Sobol(64, seed=3),
    fp.Unscented(),
    fp.LinearizedRule(),
]


def normal_moment(n: int) -> float:
    """E z^n: 1 * 3 * 5 * ... (n - 1) for even n."""
    return 0.0 if n % 2 else factorial(n) / (2 ** (n // 2) * factorial(n // 2))


def expectation(rule: fp.Rule, prior: fp.GaussianPrior, function: Any) -> Any:
    theta, weights = rule.nodes(prior)
    return np.tensordot(weights, function(theta), axes=1) / weights.sum()


# --- exactness ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("levels", [1, 2, 3, 5, 8])
def test_gauss_hermite_is_exact_up_to_its_degree_and_not_beyond(levels: int) -> None:
    z, weights = fp.GaussHermite(levels).nodes(ONE)
    for n in range(2 * levels):
        assert weights @ z[:, 0] ** n == pytest.approx(normal_moment(n), rel=1e-12, abs=1e-14 * normal_moment(2 * levels))
    assert abs(weights @ z[:, 0] ** (2 * levels) - normal_moment(2 * levels)) > 0.1


@pytest.mark.parametrize("level", [1, 2, 3, 4])
def test_the_sparse_rule_is_exact_up_to_its_total_degree_and_not_beyond(level: int) -> None:
    z, weights = fp.SparseGaussHermite(level).nodes(THREE)
    misses = []
    for powers in product(range(2 * level + 3), repeat=3):
        exact = prod(map(normal_moment, powers))
        error = abs(weights @ np.prod(z**powers, axis=1) - exact)
        if sum(powers) <= 2 * level + 1:
            assert error < 1e-11 * max(1.0, exact)
        elif sum(powers) == 2 * level + 2:
            misses.append(error)
    # Squares of more coordinates than the level has, and with fewer coordinates only powers that are higher still.
    assert (max(misses) > 0.1) == (level < 3)


@pytest.mark.parametrize("rule", [fp.GaussHermite(2), fp.SparseGaussHermite(1), fp.Unscented()], ids=repr)
def test_rules_have_the_moments_of_a_correlated_prior(rule: fp.Rule) -> None:
    mean = np.array([10.0, -5.0, 2.0])
    np.testing.assert_allclose(expectation(rule, CORRELATED, lambda t: t), mean, rtol=1e-13)
    second = expectation(rule, CORRELATED, lambda t: (t - mean)[:, :, None] * (t - mean)[:, None, :])
    np.testing.assert_allclose(second, COVARIANCE, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(rule.second_moments(CORRELATED), CORRELATED.correlation, rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(list(rule.variances(CORRELATED).values()), 1.0, rtol=1e-12)


def test_fourth_moments_of_a_correlated_prior() -> None:
    """Isserlis: E d_i d_j d_k d_l = C_ij C_kl + C_ik C_jl + C_il C_jk, of degree 4."""
    d = [CORRELATED.mean[name] for name in "abc"]
    for rule in (fp.GaussHermite(3), fp.SparseGaussHermite(2)):
        for i, j, k, m in product(range(3), repeat=4):
            c = COVARIANCE
            exact = c[i, j] * c[k, m] + c[i, k] * c[j, m] + c[i, m] * c[j, k]
            found = expectation(rule, CORRELATED, lambda t, rows=(i, j, k, m): np.prod([t[:, r] - d[r] for r in rows], axis=0))
            assert found == pytest.approx(exact, rel=1e-11, abs=1e-11)


def test_rules_have_the_moments_of_a_log_normal_prior() -> None:
    """Mean and covariance are those of the parameters themselves, and no node is negative, however wide the prior."""
    covariance = [[0.8**2, 0.3, 0.05], [0.3, 1.0, -0.1], [0.05, -0.1, 0.04]]
    prior = fp.GaussianPrior({"a": 1.0, "b": 3.0, "c": 0.5}, covariance=covariance, log=["a", "c"])
    for rule, tolerance in ((fp.GaussHermite(20), 1e-9), (fp.SparseGaussHermite(7), 1e-4), (fp.Sobol(2**16, seed=1), 5e-3)):
        theta, _ = rule.nodes(prior)
        assert (theta[:, [0, 2]] > 0).all()
        np.testing.assert_allclose(expectation(rule, prior, lambda t: t), [1.0, 3.0, 0.5], rtol=tolerance)
        std = np.sqrt(np.diag(covariance))
        moments = rule.second_moments(prior) * np.outer(std, std)
        np.testing.assert_allclose(moments, covariance, atol=10 * tolerance * np.outer(std, std).max())


def test_log_normal_moments_by_hand() -> None:
    prior = fp.GaussianPrior({"a": 2.0}, relative_std={"a": 0.5}, log=["a"])
    sigma = sqrt(log(1.25))
    theta, _ = fp.GaussHermite(3).nodes(prior)
    expected = [2.0 * exp(-(sigma**2) / 2 + z * sigma) for z in (-sqrt(3), 0.0, sqrt(3))]
    np.testing.assert_allclose(theta[:, 0], expected, rtol=1e-14)
    theta, _ = fp.TensorGrid(3, span=1.5).nodes(prior)
    np.testing.assert_allclose(theta[:, 0], [2.0 * exp(-(sigma**2) / 2 + z * sigma) for z in (-1.5, 0.0, 1.5)], rtol=1e-14)


# --- counts and weights -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("level", "nodes"), [(1, 19), (2, 199), (3, 1501), (4, 9061)])
def test_node_counts_for_nine_parameters(level: int, nodes: int) -> None:
    rule = fp.SparseGaussHermite(level)
    theta, weights = rule.nodes(PRIOR)
    assert rule.size(PRIOR) == len(theta) == len(weights) == nodes
    assert weights.sum() == pytest.approx(1.0, abs=1e-11) and weights.min() < 0
    assert len(np.unique(theta, axis=0)) == nodes
    np.testing.assert_array_equal(theta[0], list(PRIOR.mean.values()))


@pytest.mark.parametrize("rule", EVERY_RULE, ids=repr)
def test_every_rule_has_its_nodes(rule: fp.Rule) -> None:
    theta, weights = rule.nodes(THREE)
    assert theta.shape == (rule.size(THREE), 3) and weights.shape == (rule.size(THREE),)
    assert 0 < weights.sum() < 1 + 1e-12
    assert list(rule.variances(THREE)) == ["a", "b", "c"]


@pytest.mark.parametrize("p", [1, 2, 5])
def test_the_unscented_points_are_the_sparse_rule_of_level_1(p: int) -> None:
    names = list(NAMES[:p])
    prior = PRIOR.marginal(names)
    one, other = (
        sorted(zip(*map(np.ndarray.tolist, rule.nodes(prior)), strict=True)) for rule in (fp.Unscented(), fp.SparseGaussHermite(1))
    )
    np.testing.assert_allclose([node for node, _ in one], [node for node, _ in other], rtol=1e-14)
    np.testing.assert_allclose([w for _, w in one], [w for _, w in other], rtol=1e-13, atol=1e-15)


def test_sobol_points_repeat_by_seed_and_have_the_moments() -> None:
    first, again, other = (fp.Sobol(4096, seed=seed).nodes(CORRELATED)[0] for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)
    np.testing.assert_allclose(first.mean(axis=0), [10.0, -5.0, 2.0], atol=2e-3)
    np.testing.assert_allclose(fp.Sobol(4096).second_moments(CORRELATED), CORRELATED.correlation, atol=5e-3)


# --- cells ------------------------------------------------------------------------------------------------------------------


def test_cells_between_edges_by_hand() -> None:
    z, weights = fp.TensorGrid(edges=[-3.0, -1.0, 0.0, 0.5]).nodes(ONE)
    np.testing.assert_allclose(z[:, 0], [-2.0, -0.5, 0.25], rtol=1e-15)
    phi = [0.5 * (1 + erf(edge / sqrt(2))) for edge in (-3.0, -1.0, 0.0, 0.5)]
    np.testing.assert_allclose(weights, np.diff(phi), rtol=1e-13)


@pytest.mark.parametrize(("levels", "span"), [(2, 1.0), (3, 1.5), (5, 2.0)])
def test_equidistant_edges_are_the_equidistant_grid(levels: int, span: float) -> None:
    half = span / (levels - 1)
    edges = np.linspace(-span - half, span + half, levels + 1)
    for prior in (PRIOR.marginal(NAMES[:3]), CORRELATED):
        grid, cells = fp.TensorGrid(levels, span=span).nodes(prior), fp.TensorGrid(edges=edges.tolist()).nodes(prior)
        np.testing.assert_allclose(cells[0], grid[0], rtol=1e-13)
        np.testing.assert_allclose(cells[1], grid[1], rtol=1e-13)


def test_edges_by_name() -> None:
    rule = fp.TensorGrid(edges={"b": [-1.0, 1.0], "a": [-2.0, 0.0, 2.0], "c": [0.0, 1.0, 2.0, 3.0]})
    assert rule.levels_of(THREE) == {"a": 2, "b": 1, "c": 3} and rule.size(THREE) == 6
    assert sorted(set(rule.nodes(THREE)[0][:, 2])) == [0.5, 1.5, 2.5]


def test_the_cells_of_two_correlated_parameters_lie_along_their_principal_axes() -> None:
    """Correlation r: axes (1, 1)/sqrt(2) and (1, -1)/sqrt(2) with variances 1 + r and 1 - r."""
    r = 0.6
    prior = fp.GaussianPrior({"a": 1.0, "b": 2.0}, covariance=[[0.04, r * 0.06], [r * 0.06, 0.09]])
    theta, weights = fp.TensorGrid(3, span=1.5).nodes(prior)
    z = (theta - [1.0, 2.0]) / [0.2, 0.3]
    one, other = np.array([1.0, 1.0]) / sqrt(2), np.array([1.0, -1.0]) / sqrt(2)
    expected = [i * sqrt(1 + r) * one + j * sqrt(1 - r) * other for i in (-1.5, 0, 1.5) for j in (-1.5, 0, 1.5)]
    # The second axis may point either way.
    np.testing.assert_allclose(np.sort(z.round(12), axis=0), np.sort(np.round(expected, 12), axis=0), atol=1e-11)
    np.testing.assert_allclose(weights, fp.TensorGrid(3, span=1.5).nodes(THREE.marginal(["a", "b"]))[1], rtol=1e-15)
    assert abs(fp.TensorGrid(41, span=6.0).second_moments(prior)[0, 1] - r) < 0.02


def test_parameters_without_correlation_keep_their_own_axes() -> None:
    covariance = np.diag([4.0, 9.0, 1.0])
    covariance[0, 2] = covariance[2, 0] = 0.8
    prior = fp.GaussianPrior({"a": 0.0, "b": 0.0, "c": 0.0}, covariance=covariance)
    rule = fp.TensorGrid({"a": 2, "b": 5, "c": 2}, span=1.0)
    theta, _ = rule.nodes(prior)
    assert sorted(set(theta[:, 1].tolist())) == [-3.0, -1.5, 0.0, 1.5, 3.0]
    with pytest.raises(ValueError, match="levels: expected the same cells for the correlated a, c"):
        fp.TensorGrid({"a": 2, "b": 5, "c": 3}).nodes(prior)


def test_parameters_that_do_not_vary_leave_the_marginal_of_the_others() -> None:
    for rule in EVERY_RULE:
        moments = rule.second_moments(CORRELATED, ("b", "c"))
        assert not moments[0].any() and not moments[:, 0].any()
        alone = rule.second_moments(CORRELATED.marginal(["b", "c"]))
        np.testing.assert_allclose(moments[1:, 1:], alone, rtol=1e-10, atol=1e-12)


def test_one_level_is_the_mean_also_of_a_log_normal_parameter() -> None:
    prior = fp.GaussianPrior({"a": 2.0, "b": 1.0}, relative_std={"a": 0.5, "b": 0.1}, log=["a"])
    for rule in (fp.TensorGrid({"a": 1, "b": 2}), fp.GaussHermite({"a": 1, "b": 2})):
        assert (rule.nodes(prior)[0][:, 0] == 2.0).all()


# --- what they are as objects -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("rule", [*EVERY_RULE, fp.TensorGrid({"a": 2}, span=1.0), fp.TensorGrid(edges={"a": [0, 1]})], ids=repr)
def test_rules_can_be_compared_hashed_sent_and_rebuilt_from_their_text(rule: fp.Rule) -> None:
    copy = pickle.loads(pickle.dumps(rule))
    assert copy == rule and hash(copy) == hash(rule) and copy in {rule}
    assert eval(repr(rule), vars(fp)) == rule
    with pytest.raises(AttributeError):
        rule.level = 3  # type: ignore[attr-defined]
    assert type(rule) in RULES.values()


def test_the_default_is_the_sparse_rule_of_level_2() -> None:
    assert fp.SparseGaussHermite() == fp.SparseGaussHermite(2) == DEFAULT_RULE
    assert (
        fp.DesignProblem(fp.HydraulicCylinder(), PRIOR, None, noise=dict.fromkeys(["q", "p_A", "p_B", "x_v"], 1.0)).rule
        == DEFAULT_RULE
    )


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: fp.GaussHermite(0), "levels: expected a whole number of at least 1, given 0"),
        (lambda: fp.GaussHermite({"a": 101}), "levels.*: expected a whole number of at most 100, given 101"),
        (lambda: fp.GaussHermite({"a": 3}).nodes(THREE), "levels: expected a value for 'b', given none"),
        (lambda: fp.GaussHermite(100).nodes(PRIOR.marginal(NAMES)), "levels: expected a grid of at most"),
        (lambda: fp.SparseGaussHermite(0), "level: expected a whole number of at least 1, given 0"),
        (lambda: fp.SparseGaussHermite(9), "level: expected a whole number of at most 8, given 9"),
        (lambda: fp.SparseGaussHermite(8).nodes(PRIOR), "level: expected a rule of at most 1048576 nodes, given 8 with"),
        (lambda: fp.Sobol(1000), "n: expected a power of two of at most 1048576, given 1000"),
        (lambda: fp.Sobol(2**21), "n: expected a power of two of at most"),
        (lambda: fp.Sobol(4, seed=-1), "seed: expected a whole number of at least 0, given -1"),
        (lambda: fp.TensorGrid(edges=[1.0]), "edges: expected at least two ascending numbers"),
        (lambda: fp.TensorGrid(edges=[1.0, 1.0]), "edges: expected at least two ascending numbers"),
        (lambda: fp.TensorGrid(edges={"a": [0.0, float("inf")]}), r"edges\['a'\]: expected finite numbers, given inf"),
        (lambda: fp.TensorGrid(edges=[40.0, 41.0]), "edges: expected cells with a probability above zero"),
        (lambda: fp.TensorGrid(3, edges=[0.0, 1.0]), "levels: expected none together with edges, given 3"),
        (lambda: fp.TensorGrid(span=1.0, edges=[0.0, 1.0]), "span: expected none together with edges, given 1.0"),
        (lambda: fp.TensorGrid(edges={"a": [0.0, 1.0]}).nodes(THREE), "edges: expected a value for 'b', given none"),
    ],
)
def test_a_wrong_rule_is_refused(make: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()
