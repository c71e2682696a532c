"""Mappings are equal in whatever order, arrays are not: what is kept for one order must not serve another."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.basics.result_files import encoded

POINTS = fp.Experiments(np.empty((3, 0)), [[0.3], [1.0], [2.0]])
COVARIANCE = {("a", "a"): 0.25, ("b", "b"): 0.25, ("c", "c"): 0.25, ("a", "b"): 0.2, ("a", "c"): 0.0, ("b", "c"): 0.05}


def prior(names: Sequence[str]) -> fp.GaussianPrior:
    """The same distribution in any order, of which some diagonals are equal so that only the order tells."""
    rows = [[COVARIANCE.get((a, b), COVARIANCE.get((b, a))) for b in names] for a in names]
    return fp.GaussianPrior(dict.fromkeys(names, 1.0), covariance=rows)  # type: ignore[arg-type]


def problem(names: Sequence[str], rule: fp.Rule, of_prior: Sequence[str] = ("a", "b", "c")) -> fp.DesignProblem:
    model = fp.SymbolicModel([], ["a*u + b*u**2 + c*u**3"], {}, {"u": "1"}, dict.fromkeys(names, "1"))
    region = fp.ExperimentRegion({"u": (0.1, 2.0)})
    return fp.DesignProblem(
        model, prior(of_prior), region, noise={"y": 0.1}, rule=rule, output_covariance="pooled", parameters=["a"]
    )


RULES = (fp.LinearizedRule(), fp.SparseGaussHermite(2), fp.TensorGrid(), fp.Unscented())


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: type(rule).__name__)
def test_the_order_of_a_models_parameters_changes_no_output_covariance(rule: fp.Rule) -> None:
    """One after the other in one process, which keeps moments and nodes."""
    expected = fp.evaluate(problem(("a", "b", "c"), rule), POINTS).output_covariance
    spread = np.square(POINTS.u[:, 0]).mean() * rule.variances(prior(("a", "b", "c")).marginal(["a"]))["a"] * 0.25
    np.testing.assert_allclose(expected, [[0.1**2 + spread]], rtol=1e-9)  # the output is linear in a
    for names in itertools.permutations("abc"):
        for of_prior in itertools.permutations("abc"):
            found = fp.evaluate(problem(names, rule, of_prior), POINTS).output_covariance
            np.testing.assert_allclose(found, expected, rtol=1e-9, err_msg=f"{names} {of_prior}")


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: type(rule).__name__)
def test_the_order_of_a_prior_changes_no_bit(rule: fp.Rule) -> None:
    """Coordinates of correlated parameters follow an order: it is the model's."""
    results = [fp.evaluate(problem("abc", rule, names), POINTS) for names in itertools.permutations("abc")]
    assert len({(result.log_det, result.output_covariance.tobytes()) for result in results}) == 1
    assert problem("abc", rule, "cab").prior.names == ("a", "b", "c")


def test_a_saved_problem_tells_priors_apart_and_not_their_order() -> None:
    given = encoded(problem("abc", RULES[0]))
    for names in itertools.permutations("abc"):
        assert encoded(problem("abc", RULES[0], names)) == given
    other = fp.GaussianPrior(dict.fromkeys("cba", 1.0), covariance=prior("abc").covariance)  # c with b instead of a with b
    assert other != prior("abc")
    assert encoded(problem("abc", RULES[0]).replace(prior=other)) != given


def test_equal_regions_have_equal_hashes() -> None:
    bounds = {"x": (0.0, 1.0), "u": (0.0, 2.0), "dt": (0.1, 1.0)}
    one, other = fp.ExperimentRegion(bounds), fp.ExperimentRegion(dict(reversed(bounds.items())))
    assert one == other and hash(one) == hash(other)


def test_functions_in_another_order_are_another_model() -> None:
    """A surface's number is its place."""

    def model(*jumps: str) -> fp.CallableModel:
        return fp.CallableModel(rate, output, {"x": "1"}, {}, {"p": "1"}, jumps={name: SURFACES[name] for name in jumps})

    assert model("low", "high") == model("low", "high") != model("high", "low")


def rate(x, u, p):  # type: ignore[no-untyped-def]
    return [-p.p * x.x]


def output(x, u, p):  # type: ignore[no-untyped-def]
    return [x.x]


SURFACES = {"low": lambda x, u, p: x.x - 1, "high": lambda x, u, p: x.x - 2}
