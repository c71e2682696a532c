"""The prior and its grid: cell probabilities to their last digits, the nodes' order, and memory that does not grow."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import norm

import fisherpoint as fp
from defaults import MODEL, NAMES, PRIOR, point
from fisherpoint.engine import _core


def axis(levels: int, span: float) -> tuple[np.ndarray, np.ndarray]:
    """Standardised values and probabilities of one parameter, through the public interface."""
    prior = fp.GaussianPrior({"a": 0.0}, std={"a": 1.0})
    nodes, weights = fp.TensorGrid(levels, span=span).nodes(prior)
    return nodes[:, 0], weights


# --- cells --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("levels", "span"), [(2, 0.5), (2, 1.0), (3, 1.5), (5, 2.0), (7, 3.0), (9, 4.0), (101, 5.0)])
def test_cell_probabilities_are_differences_of_the_normal_distribution_function(levels: int, span: float) -> None:
    z, probability = axis(levels, span)
    np.testing.assert_allclose(z, np.linspace(-span, span, levels), rtol=1e-15, atol=1e-15)
    half = span / (levels - 1)
    upper = np.abs(z)  # by symmetry on the side where both values are small
    expected = norm.sf(upper - half) - norm.sf(upper + half)
    # Both values carry a few ulp, also of their difference's neighbours: cells here are no narrower than a tenth of a std.
    np.testing.assert_allclose(probability, expected, rtol=1e-13, atol=0.0)


def density_integral(a: Fraction, b: Fraction) -> Fraction:
    """Integral of exp(-z^2/2) over (a, b), exact to 40 digits: the Taylor series about the middle, times its value there."""
    middle, half = (a + b) / 2, (b - a) / 2
    # g(t) = exp(-middle t - t^2/2) satisfies g' = -(middle + t) g, a recursion for its coefficients.
    coefficients = [Fraction(1), -middle]
    for n in range(1, 120):
        coefficients.append(-(middle * coefficients[n] + coefficients[n - 1]) / (n + 1))
    return sum((2 * c * half ** (n + 1) / (n + 1) for n, c in enumerate(coefficients) if n % 2 == 0), Fraction(0))


@pytest.mark.parametrize(("levels", "span"), [(3, 8.0), (9, 8.0), (17, 16.0), (31, 30.0), (61, 30.0)])
def test_cells_far_out_keep_their_digits(levels: int, span: float) -> None:
    z, probability = axis(levels, span)
    assert np.all(probability > 0)
    for value, found in zip(z, probability, strict=True):
        middle, half = Fraction(float(value)), Fraction(span) / (levels - 1)
        if half > 2:
            continue  # the series wants narrow cells
        series = float(density_integral(middle - half, middle + half))
        expected = series * math.exp(-(float(value) ** 2) / 2) / math.sqrt(2 * math.pi)
        # exp(-z^2/2) loses about z^2/2 ulp through the rounding of its argument, erfc as much: 1e-13 at z = 8 and 2e-13 at 30.
        assert found == pytest.approx(expected, rel=2.3e-16 * (float(value) ** 2 + 60), abs=0.0)


@pytest.mark.parametrize(("levels", "span"), [(2, 1.0), (3, 1.5), (4, 12.0), (5, 2.0), (31, 30.0), (100, 37.0)])
def test_cells_are_symmetric_and_sum_to_what_they_cover(levels: int, span: float) -> None:
    z, probability = axis(levels, span)
    np.testing.assert_array_equal(probability, probability[::-1])  # to the last bit: both sides are the same computation
    np.testing.assert_array_equal(z, -z[::-1])
    edge = span + span / (levels - 1)
    assert probability.sum() == pytest.approx(math.erf(edge / math.sqrt(2)), rel=1e-14)
    half = probability[levels // 2 :]
    assert np.all(np.diff(half) < 0)  # falls to both sides


def test_probabilities_that_underflow_are_zero_and_not_nan() -> None:
    _, probability = axis(3, 100.0)
    assert np.isfinite(probability).all() and np.all(probability >= 0)
    assert probability[1] == 1.0


@given(st.integers(2, 60), st.floats(0.01, 36.0))
@settings(deadline=None, max_examples=100)
def test_every_cell_is_a_positive_probability(levels: int, span: float) -> None:
    z, probability = axis(levels, span)
    assert np.all((probability > 0) & (probability <= 1)) and probability.sum() <= 1 + 1e-14
    assert np.all(np.diff(z) > 0)


def test_one_level_is_the_mean_with_weight_one() -> None:
    nodes, weights = fp.TensorGrid(1, span=2.7).nodes(PRIOR)
    np.testing.assert_array_equal(nodes, [list(PRIOR.mean.values())])
    np.testing.assert_array_equal(weights, [1.0])


# --- nodes --------------------------------------------------------------------------------------------------------------


def test_the_last_parameter_runs_fastest() -> None:
    prior = fp.GaussianPrior({"a": 10.0, "b": 20.0, "c": 30.0}, std={"a": 1.0, "b": 2.0, "c": 3.0})
    rule = fp.TensorGrid({"a": 2, "b": 1, "c": 3}, span=1.0)
    nodes, weights = rule.nodes(prior)
    np.testing.assert_array_equal(nodes, [[9, 20, 27], [9, 20, 30], [9, 20, 33], [11, 20, 27], [11, 20, 30], [11, 20, 33]])
    a, c = axis(2, 1.0)[1], axis(3, 1.0)[1]
    np.testing.assert_allclose(weights, np.outer(a, c).ravel(), rtol=1e-15)
    assert rule.size(prior) == 6


def test_levels_by_name_follow_the_priors_order() -> None:
    prior = fp.GaussianPrior({"b": 1.0, "a": 2.0}, std={"a": 0.1, "b": 0.1})
    assert fp.TensorGrid({"a": 2, "b": 5}).levels_of(prior) == {"b": 5, "a": 2}
    nodes, _ = fp.TensorGrid({"a": 2, "b": 5}).nodes(prior)
    assert len(np.unique(nodes[:, 0])) == 5 and len(np.unique(nodes[:, 1])) == 2


def test_the_variances_that_the_nodes_have() -> None:
    rule = fp.TensorGrid(dict.fromkeys(NAMES, 1) | {"a_tau": 3, "E_oil": 4}, span=1.3)
    nodes, weights = rule.nodes(PRIOR)
    deviation = (nodes - list(PRIOR.mean.values())) / list(PRIOR.std.values())
    expected = weights @ deviation**2 / weights.sum()
    np.testing.assert_allclose(list(rule.variances(PRIOR).values()), expected, rtol=1e-12, atol=1e-30)


def test_a_fine_wide_grid_has_the_priors_variance() -> None:
    # Second-order moments of cells of width h carry Sheppard's correction h^2/12 times -1; here h = 0.1.
    share = fp.TensorGrid(121, span=6.0).variances(fp.GaussianPrior({"a": 1.0}, std={"a": 0.1}))["a"]
    assert share == pytest.approx(1.0 + 0.1**2 / 12, abs=1e-6)


# --- prior --------------------------------------------------------------------------------------------------------------


def test_relative_and_absolute_std_are_the_same_prior() -> None:
    absolute = fp.GaussianPrior({"a": -4.0, "b": 2.0}, std={"a": 1.0, "b": 1.0})
    relative = fp.GaussianPrior({"a": -4.0, "b": 2.0}, relative_std={"a": 0.25, "b": 0.5})
    assert absolute == relative and hash(absolute) == hash(relative)
    assert relative.names == ("a", "b") and relative.std == {"a": 1.0, "b": 1.0}


def test_a_prior_cannot_be_changed() -> None:
    with pytest.raises(TypeError):
        PRIOR.mean["a_tau"] = 1.0  # type: ignore[index]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"mean": {"a": 1.0}}, "GaussianPrior: expected either std or relative_std, given neither"),
        ({"mean": {"a": 1.0}, "std": {"a": 1.0}, "relative_std": {"a": 1.0}}, "given both"),
        ({"mean": {}, "std": {}}, "mean: expected at least one parameter, given none"),
        ({"mean": {"a": 1.0}, "std": {"b": 1.0}}, "std: expected the names a; given unknown 'b'"),
        ({"mean": {"a": 1.0, "b": 1.0}, "std": {"a": 1.0}}, "std: expected a value for 'b', given none"),
        ({"mean": {"a": 1.0}, "std": {"a": -1.0}}, r"std\['a'\]: expected a positive standard deviation, given -1"),
        ({"mean": {"a": 1.0}, "std": {"a": 0.0}}, r"std\['a'\]: expected a positive standard deviation, given 0"),
        (
            {"mean": {"a": 1.0}, "relative_std": {"a": 40}},
            r"relative_std\['a'\]: expected a share of at most 3, such as 0.4 for 40 %, given 40",
        ),
        (
            {"mean": {"a": 0.0}, "relative_std": {"a": 0.1}},
            r"relative_std\['a'\]: expected std in its place, as the mean is 0; given 0.1",
        ),
        ({"mean": {"a": math.nan}, "std": {"a": 1.0}}, r"mean\['a'\]: expected finite numbers, given nan"),
        ({"mean": {"a": 1.0}, "std": {"a": math.inf}}, r"std\['a'\]: expected finite numbers, given inf"),
    ],
)
def test_a_wrong_prior_is_refused(arguments: dict[str, dict[str, float]], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        fp.GaussianPrior(**arguments)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"levels": 0}, "levels: expected a whole number of at least 1, given 0"),
        ({"levels": 2.5}, "levels: expected a whole number of at least 1, given 2.5"),
        ({"levels": {"a_tau": -1}}, r"levels\['a_tau'\]: expected a whole number of at least 1, given -1"),
        ({"span": 0.0}, "span: expected a positive number of standard deviations, given 0"),
        ({"span": -1.0}, "span: expected a positive number"),
        ({"span": math.nan}, "span: expected finite numbers, given nan"),
    ],
)
def test_a_wrong_grid_is_refused(arguments: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        fp.TensorGrid(**arguments)  # type: ignore[arg-type]


def test_levels_must_name_the_priors_parameters() -> None:
    with pytest.raises(ValueError, match="levels: expected a value for 'b_tau', given none"):
        fp.TensorGrid({"a_tau": 3}).nodes(PRIOR)
    with pytest.raises(ValueError, match=r"levels: .*given unknown 'mass'"):
        fp.TensorGrid(dict.fromkeys(NAMES, 1) | {"mass": 3}).nodes(PRIOR)


@pytest.mark.parametrize("levels", [256, 1000, 2**31 - 1, 2**40])
def test_a_grid_that_no_machine_can_walk_over_is_refused(levels: int) -> None:
    """256^9 nodes are 2^72: past 64 bits their number wraps round. In a process of its own, which may not crash."""
    program = (
        "import fisherpoint as fp\n"
        "m = fp.HydraulicCylinder()\n"
        "prior = fp.GaussianPrior(m.nominal, relative_std=dict.fromkeys(m.nominal, 0.1))\n"
        "points = fp.Experiments([[0.15, 0.2, 6e6, 1e7, 0.3]], [[-0.3]], [1e-4])\n"
        "try:\n"
        f"    fp.predictive_covariance(m, points, prior, fp.TensorGrid({levels}))\n"
        "except ValueError as error:\n"
        "    print(error)\n"
    )
    environment = os.environ | {"PYTHONPATH": str(Path(fp.__file__).parents[1])}
    done = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, timeout=30)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("levels: expected") and "given" in done.stdout


# --- memory -------------------------------------------------------------------------------------------------------------

PEAK = """
import resource, sys
import fisherpoint as fp
m = fp.HydraulicCylinder()
relative = dict(a_tau=.3, b_tau=.2, m_q=.05, E_oil=.2, p_t=.2, B_v=.1, c_L=.3, V_0A=.1, V_0B=.1)
prior = fp.GaussianPrior(m.nominal, relative_std=relative)
levels = dict(zip(prior.names, map(int, sys.argv[1].split(","))))
rule = fp.TensorGrid(levels)
points = fp.Experiments([[0.15, 0.2, 6e6, 1e7, 0.3]] * 2, [[-0.3]] * 2, [1e-3, 2e-3])
result = fp.predictive_covariance(m, points, prior, rule, rtol=1e-4)
assert not result.status.any(), result.status
print(rule.size(prior), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


def peak(levels: list[int]) -> tuple[int, float]:
    """Number of nodes, and the largest resident size in MB of a process that works through them."""
    environment = os.environ | {"PYTHONPATH": str(Path(fp.__file__).parents[1])}
    done = subprocess.run(
        [sys.executable, "-c", PEAK, ",".join(map(str, levels))], env=environment, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    nodes, kilobytes = map(int, done.stdout.split())
    return nodes, kilobytes / 1024


def test_memory_does_not_grow_with_the_grid() -> None:
    few, small = peak([3, 3, 3, 3, 3, 3, 3, 1, 1])
    many, large = peak([5] * 9)
    assert few == 3**7 and many == 5**9  # 2187 and 1953125; storing the second's nodes alone would take 140 MB
    assert abs(large - small) < 20


def test_the_grid_is_made_of_axes() -> None:
    with pytest.raises(ValueError, match="axis values: expected at least one, given none"):
        _core.PriorGrid([(np.array([]), np.array([]))])
    with pytest.raises(ValueError, match="axis probabilities: expected shape"):
        _core.PriorGrid([(np.array([1.0, 2.0]), np.array([1.0]))])
    grid = _core.PriorGrid([(np.array([1.0, 2.0]), np.array([0.25, 0.5])), (np.array([3.0]), np.array([1.0]))])
    nodes, weights = grid.nodes()
    assert len(grid) == 2 and nodes.tolist() == [[1, 3], [2, 3]] and weights.tolist() == [0.25, 0.5]


def test_parameters_that_do_not_vary_stay_at_the_mean() -> None:
    rule = fp.TensorGrid(3)
    alone = fp.predictive_covariance(MODEL, point(), PRIOR, rule, parameters=("E_oil",))
    levels = fp.TensorGrid(dict.fromkeys(NAMES, 1) | {"E_oil": 3})
    np.testing.assert_array_equal(alone.covariance, fp.predictive_covariance(MODEL, point(), PRIOR, levels).covariance)
