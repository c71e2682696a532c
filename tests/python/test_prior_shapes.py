"""Priors with correlations and with log-normal parameters, and their coordinates."""

from __future__ import annotations

import pickle
from math import log, sqrt
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from defaults import NAMES, PRIOR
from fisherpoint.prior.coordinates import cholesky_coordinates, principal_coordinates

MEAN = {"a": 1.0, "b": 2.0, "c": -3.0}
COVARIANCE = np.array([[0.04, 0.03, 0.0], [0.03, 0.09, 0.01], [0.0, 0.01, 0.25]])


def test_a_covariance_gives_std_and_correlation() -> None:
    prior = fp.GaussianPrior(MEAN, covariance=COVARIANCE)
    assert prior.std == pytest.approx({"a": 0.2, "b": 0.3, "c": 0.5})
    np.testing.assert_array_equal(prior.covariance, COVARIANCE)
    np.testing.assert_allclose(prior.correlation, [[1, 0.5, 0], [0.5, 1, 1 / 15], [0, 1 / 15, 1]], rtol=1e-15)
    assert prior.correlated and prior.log == ()


def test_independent_parameters_have_both_too() -> None:
    np.testing.assert_array_equal(PRIOR.correlation, np.eye(9))
    np.testing.assert_array_equal(PRIOR.covariance, np.diag(np.square(list(PRIOR.std.values()))))
    assert not PRIOR.correlated
    assert fp.GaussianPrior(MEAN, covariance=np.diag([0.04, 0.09, 0.25])) == fp.GaussianPrior(
        MEAN, std={"a": sqrt(0.04), "b": sqrt(0.09), "c": 0.5}
    )


def test_equality_hash_pickle_and_text() -> None:
    plain, correlated = fp.GaussianPrior(MEAN, std=dict.fromkeys(MEAN, 0.5)), fp.GaussianPrior(MEAN, covariance=COVARIANCE)
    positive = fp.GaussianPrior(MEAN, covariance=COVARIANCE, log=["b", "a"])
    priors = [plain, correlated, positive, fp.GaussianPrior(MEAN, std=dict.fromkeys(MEAN, 0.5), log=["a"])]
    for i, prior in enumerate(priors):
        copy = pickle.loads(pickle.dumps(prior))
        assert copy == prior and hash(copy) == hash(prior)
        assert eval(repr(prior), vars(fp)) == prior
        assert [prior == other for other in priors] == [i == j for j in range(len(priors))]
    order = ["c", "a", "b"]
    assert correlated.marginal(order) == correlated and hash(correlated.marginal(order)) == hash(correlated)
    assert positive.log == ("a", "b")


def test_a_marginal_keeps_what_belongs_to_its_parameters() -> None:
    prior = fp.GaussianPrior(MEAN, covariance=COVARIANCE, log=["b"]).marginal(["b", "a"])
    assert prior.names == ("b", "a") and prior.log == ("b",)
    np.testing.assert_array_equal(prior.covariance, [[0.09, 0.03], [0.03, 0.04]])


def test_the_logarithms_match_the_moments() -> None:
    prior = fp.GaussianPrior(MEAN, covariance=COVARIANCE, log=["a", "b"])
    std = [sqrt(log(1 + 0.04)), sqrt(log(1 + 0.09 / 4)), 0.5]
    np.testing.assert_allclose(prior.normal_std, std, rtol=1e-14)
    expected = [[1, log(1 + 0.03 / 2) / (std[0] * std[1]), 0], [0, 1, 0.01 / 2 / (std[1] * 0.5)], [0, 0, 1]]
    np.testing.assert_allclose(np.triu(prior.normal_correlation), expected, rtol=1e-13)
    np.testing.assert_array_equal(prior.normal_correlation, prior.normal_correlation.T)
    assert prior.mean == MEAN and prior.std["a"] == 0.2


def test_both_coordinates_have_the_covariance() -> None:
    prior = fp.GaussianPrior(MEAN, covariance=COVARIANCE)
    for coordinates in (cholesky_coordinates(prior, prior.names), principal_coordinates(prior, prior.names)):
        np.testing.assert_allclose(coordinates.matrix @ coordinates.matrix.T, COVARIANCE, rtol=1e-13, atol=1e-16)
        np.testing.assert_array_equal(coordinates.theta(np.zeros((1, 3))), [list(MEAN.values())])
    assert np.array_equal(np.triu(cholesky_coordinates(prior, prior.names).matrix, 1), np.zeros((3, 3)))


def test_coordinates_of_independent_parameters_are_their_own() -> None:
    for coordinates in (cholesky_coordinates(PRIOR, NAMES), principal_coordinates(PRIOR, NAMES)):
        assert coordinates.diagonal
        np.testing.assert_array_equal(coordinates.matrix, np.diag(list(PRIOR.std.values())))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"std": {"a": 1.0}, "covariance": [[1.0]]}, "covariance: expected no std beside it, given both"),
        ({"covariance": [[1.0, 0.0]]}, r"covariance: expected shape \(1, 1\), given \(1, 2\)"),
        ({"covariance": [[-1.0]]}, "covariance: expected a positive variance of 'a', given -1"),
        ({"covariance": [[float("nan")]]}, "covariance: expected finite numbers, given nan"),
        ({"std": {"a": 1.0}, "log": ["b"]}, "log: expected names of a; given unknown 'b'"),
        ({"std": {"a": 1.0}, "log": ["a"], "mean": {"a": -1.0}}, "log: expected a positive mean of 'a', given -1"),
        (
            {"mean": {"a": 1.0, "b": 1.0}, "covariance": [[1.0, 0.2], [0.3, 1.0]]},
            "covariance: expected a symmetric matrix, given 0.2 for 'a' with 'b' and 0.3 for the reverse",
        ),
        (
            {"mean": {"a": 1.0, "b": 1.0}, "covariance": [[1.0, 2.0], [2.0, 1.0]]},
            r"covariance: expected a positive definite matrix, given .*\(smallest eigenvalue of the correlation -1, in a, b\)",
        ),
        (
            {"mean": {"a": 1.0, "b": 1.0}, "covariance": [[4.0, -1.5], [-1.5, 4.0]], "log": ["a", "b"]},
            "log: expected a covariance of 'a' and 'b' above minus the product of their means",
        ),
        (
            {"mean": {"a": 1.0, "b": 1.0}, "covariance": [[4.0, 0.99 * 0.4], [0.99 * 0.4, 0.04]], "log": ["a"]},
            "log: expected parameters whose logarithms can have the given covariance",
        ),
    ],
)
def test_a_wrong_prior_is_refused(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        fp.GaussianPrior(**({"mean": {"a": 1.0}} | arguments))


def test_log_is_a_sequence_of_names() -> None:
    with pytest.raises(TypeError, match="log: expected a sequence of names, given True"):
        fp.GaussianPrior({"a": 1.0}, std={"a": 1.0}, log=True)  # type: ignore[arg-type]
