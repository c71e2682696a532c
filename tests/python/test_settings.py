"""Settings of searches: they have the defaults of the functions that take them, and describe what is done."""

from __future__ import annotations

import re
from dataclasses import MISSING, fields
from inspect import Parameter, signature
from typing import Any

import pytest

import fisherpoint as fp
from fisherpoint.basics.options import options_of
from fisherpoint.design.results.settings import METHODS, MOST_ITERATIONS


@pytest.mark.parametrize(
    ("settings", "search"),
    [(fp.results.ExchangeSettings, fp.exchange), (fp.results.ExchangeSettings, fp.sweep), (fp.results.RunSettings, fp.design_runs)],
)
def test_settings_have_the_defaults_of_their_search(settings: Any, search: Any) -> None:
    arguments = signature(search).parameters
    made = {"goal": fp.Goal, "method": fp.ExchangeMethod}
    for one in fields(settings):
        if search is fp.sweep and one.name == "n_experiments":  # of which there are several
            continue
        default = arguments[one.name].default
        assert one.default == (made[one.name](default) if one.name in made else default)


@pytest.mark.parametrize(
    "search", [fp.exchange, fp.sweep, fp.design_runs, fp.approximate_design, fp.exact_design, fp.design_pieces]
)
def test_searches_take_a_goal_and_few_arguments(search: Any) -> None:
    arguments = signature(search).parameters
    of_their_own = [one for one in arguments.values() if one.kind is not Parameter.VAR_KEYWORD]
    assert arguments["goal"].default == "D" and len(of_their_own) <= 12


@pytest.mark.parametrize("kind", [fp.Goal, fp.ExchangeMethod, fp.results.ExchangeSettings, fp.results.RunSettings])
def test_each_option_has_words_and_a_default(kind: Any) -> None:
    described = {one.name for one in options_of(kind)}
    assert described | {"goal"} == {one.name for one in fields(kind)} | {"goal"}
    assert all(one.default is not MISSING for one in options_of(kind))
    assert all(one.words or one.name == "method" for one in options_of(kind))


@pytest.mark.parametrize("method", METHODS)
def test_iterations_are_those_of_the_method(method: str) -> None:
    chosen = fp.ExchangeMethod(method)
    assert fp.results.ExchangeSettings(method=chosen).max_iterations == MOST_ITERATIONS[method]
    assert fp.results.ExchangeSettings(method=chosen, max_iterations=3).max_iterations == 3


def test_the_docstring_says_how_many_iterations_there_are() -> None:
    text = re.search(
        r"max_iterations : int, optional\s+Default: (\d+), and (\d+) where the search is that of the paper",
        fp.exchange.__doc__ or "",
    )
    assert text and [int(one) for one in text.groups()] == [MOST_ITERATIONS["auto"], MOST_ITERATIONS["paper"]]


@pytest.mark.parametrize(("method", "iterations"), [("auto", 800), ("paper", 200)])
def test_a_search_has_that_many(method: str, iterations: int, decay_problem: fp.DesignProblem) -> None:
    chosen = fp.ExchangeMethod(method, references=False, time_limit=0.5)
    design = fp.exchange(decay_problem, n_experiments=2, n_candidates=2, method=chosen)
    assert design.settings.max_iterations == iterations
