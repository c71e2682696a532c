"""The comparison of methods: its trials of the case that is fastest, and its table."""

from __future__ import annotations

from bench import algorithms
from bench.algorithm_cases import CASES


def test_methods_find_the_same_optimum_where_the_problem_is_easy() -> None:
    (case,) = (case for case in CASES if case.name == "Michaelis-Menten")
    trials: list[algorithms.Trial] = []
    for method in ("paper", "auto", "paper, as long"):
        trials.append(algorithms.trial(case, method, 0, 1, trials))
    assert (algorithms.efficiencies(trials, trials) > 1 - 1e-5).all()
    assert trials[1].drawn > trials[0].drawn
    assert [line.count("|") for line in algorithms.table(trials).splitlines()] == [11] * 5
