"""A problem with some arguments changed: what was not told follows anew, what was told stays or is refused."""

from __future__ import annotations

import pickle
from typing import Any

import pytest

import fisherpoint as fp
from defaults import MODEL, NOISE, problem
from fisherpoint.basics.result_files import decoded, encoded


def copies(given: fp.DesignProblem) -> list[fp.DesignProblem]:
    """The problem, and what files and other processes make of it."""
    return [given, decoded(encoded(given), fp.DesignProblem), pickle.loads(pickle.dumps(given)), given.replace(rtol=1e-7)]


def test_an_output_covariance_that_was_not_told_follows_the_noise() -> None:
    for blind in copies(problem(noise=None)):
        assert blind.output_covariance == "region"
        for known in copies(blind.replace(noise=NOISE)):
            assert known.output_covariance == "noise"
            assert known.replace(noise=None).output_covariance == "region"


@pytest.mark.parametrize("kind", ["region", "pooled", "pointwise"])
def test_one_that_was_told_stays(kind: str) -> None:
    for given in copies(problem(noise=None, output_covariance=kind)):
        for known in copies(given.replace(noise=NOISE)):
            assert known.output_covariance == kind
            assert known.replace(output_covariance=None).output_covariance == "noise"


def test_one_that_was_given_is_refused_where_it_does_not_fit() -> None:
    for given in copies(problem(output_covariance="noise")):
        with pytest.raises(ValueError, match="noise: expected the sensor noise for output_covariance='noise', given none"):
            given.replace(noise=None)
    for given in copies(problem(output_covariance="region")):
        with pytest.raises(ValueError, match="region: expected a region of points for output_covariance='region', given None"):
            given.replace(region=None)


def test_parameters_that_were_not_given_are_all_of_the_model() -> None:
    more = MODEL.estimate("T_1")
    prior = fp.GaussianPrior(more.nominal, relative_std=dict.fromkeys(more.nominal, 0.1))
    change: dict[str, Any] = {"model": more, "prior": prior, "rule": fp.LinearizedRule()}
    for given in copies(problem(rule=fp.LinearizedRule())):
        assert given.replace(**change).estimated == (*given.estimated, "T_1")
    for given in copies(problem(rule=fp.LinearizedRule(), parameters=["m_q", "B_v"])):
        assert given.replace(**change).estimated == ("m_q", "B_v")


@pytest.mark.parametrize("name", ["colour", "derived"])
def test_what_a_problem_does_not_have_is_told(name: str) -> None:
    with pytest.raises(TypeError, match=f"replace: expected names of model, prior, .*; given unknown '{name}'"):
        problem().replace(**{name: ()})
