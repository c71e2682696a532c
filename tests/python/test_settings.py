"""Settings of searches: they have the defaults of the functions that take them, and describe what is done."""

from __future__ import annotations

import re
from dataclasses import MISSING, fields
from inspect import signature
from typing import Any

import pytest

import fisherpoint as fp
from fisherpoint.design.settings import METHODS, MOST_ITERATIONS, RunSettings


@pytest.mark.parametrize(
    ("settings", "search"), [(fp.ExchangeSettings, fp.exchange), (fp.ExchangeSettings, fp.sweep), (RunSettings, fp.design_runs)]
)
def test_settings_have_the_defaults_of_their_search(settings: Any, search: Any) -> None:
    arguments = signature(search).parameters
    defaults = {one.name: one.default for one in fields(settings) if one.default is not MISSING and one.name in arguments}
    if search is fp.sweep:
        del defaults["n_experiments"]  # of which there are several
    assert defaults == {name: arguments[name].default for name in defaults} and len(defaults) > 5


def test_settings_without_arguments_are_those_of_a_search_without() -> None:
    arguments = signature(fp.exchange).parameters
    settings = fp.ExchangeSettings()
    for name in (one.name for one in fields(settings) if one.name != "max_iterations"):
        assert getattr(settings, name) == arguments[name].default


@pytest.mark.parametrize("method", METHODS)
def test_iterations_are_those_of_the_method(method: str) -> None:
    assert fp.ExchangeSettings(method=method).max_iterations == MOST_ITERATIONS[method]
    assert fp.ExchangeSettings(method=method, max_iterations=3).max_iterations == 3


def test_the_docstring_says_how_many_iterations_there_are() -> None:
    text = re.search(
        r"max_iterations : int, optional\s+Default: (\d+), and (\d+) where the search is that of the paper",
        fp.exchange.__doc__ or "",
    )
    assert text and [int(one) for one in text.groups()] == [MOST_ITERATIONS["auto"], MOST_ITERATIONS["paper"]]


@pytest.mark.parametrize(("method", "iterations"), [("auto", 800), ("paper", 200)])
def test_a_search_has_that_many(method: str, iterations: int, decay_problem: fp.DesignProblem) -> None:
    design = fp.exchange(decay_problem, n_experiments=2, n_candidates=2, method=method, references=False, time_limit=0.5)
    assert design.settings.max_iterations == iterations
