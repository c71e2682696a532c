"""Goals: what is checked of one, how a file states it, and what each search refuses."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.basics.options import options_of
from fisherpoint.basics.result_files import decoded, encoded
from fisherpoint.design.file.configuration import ConfigError, load_config
from fisherpoint.design.goal.goal import UNABLE, Goal, goal_of
from fisherpoint.design.results.settings import check_goal

MICHAELIS_MENTEN = Path(__file__).resolve().parents[2] / "examples" / "michaelis_menten.toml"
POINTS = fp.Experiments(np.zeros((2, 0)), np.array([[0.1], [1.0]]))


def test_a_text_is_the_name_of_a_criterion() -> None:
    assert goal_of("A") == Goal("A") and goal_of("D") == Goal()
    with pytest.raises(TypeError, match="goal: expected the name of a criterion or a Goal, given int"):
        goal_of(3)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"criterion: expected 'D', .*, given 'B'"):
        goal_of("B")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"criterion": "c"}, "of: expected a function of the parameters as text for criterion 'c', given none"),
        ({"criterion": "I", "of": "y"}, "conditions: expected the points at which criterion 'I' predicts, given none"),
        ({"of": "a"}, "of: expected none for criterion 'D', given one"),
        ({"criterion": "A", "conditions": POINTS}, "conditions: expected none for criterion 'A', given one"),
        ({"criterion": "c", "of": "a", "scale": {"a": 1.0}}, "scale: expected none for criterion 'c', given one"),
        ({"over": "log"}, "over: expected an OverPrior or None, given str"),
        ({"singular": "raise"}, "singular: expected 'estimable' or 'error', given 'raise'"),
        ({"confidence": 1.0}, "confidence: expected a share of at least 0 and below 1, given 1"),
        ({"prior_information": 1}, "prior_information: expected True or False, given 1"),
    ],
)
def test_what_does_not_fit_is_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises((TypeError, ValueError), match=message):
        Goal(**options)


EXAMPLES = {
    "ME": Goal("ME"),
    "E with over": Goal("E", over=fp.OverPrior("log")),
    "confidence": Goal(confidence=0.9),
    "over": Goal(over=fp.OverPrior("log")),
    "prior_information": Goal(prior_information=True),
}
REFUSED = {"sweep": 1, "approximate_design": 3, "exact_design": 4, "design_pieces": 5}


@pytest.mark.parametrize("search", UNABLE)
def test_searches_refuse_what_they_cannot_have_in_one_way(search: str) -> None:
    refused = 0
    for goal in EXAMPLES.values():
        try:
            assert goal_of(goal, search) is goal
        except ValueError as error:
            assert str(error).startswith("goal: expected one without ") and f"fisherpoint.{search}" in str(error)
            refused += 1
    assert refused == REFUSED[search]


@pytest.mark.parametrize(
    "goal",
    [
        Goal("A", scale={"a": 1.0, "b": 2.0}, singular="error"),
        Goal("I", of="y", conditions=POINTS, prior_information=True),
        Goal("Ds", of=["a", "b"], over=fp.OverPrior("cvar", scenarios=[{}, {"a": 2.0}], share=0.5)),
        Goal("c", of="a / b", over=fp.OverPrior("worst"), confidence=0.9),
    ],
)
def test_files_give_it_back(goal: Goal) -> None:
    for settings in (fp.results.ExchangeSettings(goal=goal), fp.results.RunSettings(goal=goal)):
        data = encoded(settings)
        assert decoded(data, type(settings)) == settings
        ((_, content),) = data.items()
        del content["goal"]["Goal"]["singular"]
        with pytest.raises(ValueError, match=r"goal\.singular: expected an entry, given none"):
            decoded(data, type(settings))


def test_runs_have_a_confidence_unless_the_goal_says_none() -> None:
    assert fp.results.RunSettings().goal.confidence == 0.99
    assert fp.results.RunSettings(goal=Goal(confidence=0.0)).goal.share_of_plants is None
    assert fp.results.ExchangeSettings().goal.share_of_plants is None


GIVEN: dict[str, Any] = {
    "criterion": "A",
    "of": "a",
    "conditions": POINTS,
    "scale": {"a": 1.0},
    "over": fp.OverPrior("log"),
    "prior_information": True,
}


@pytest.mark.parametrize("name", [one.name for one in options_of(Goal) if one.name not in ("singular", "confidence")])
def test_what_a_search_for_log_det_does_not_do_is_refused(name: str) -> None:
    """Each option, also one that is new: neither the search of the paper nor that for pieces may leave it out in silence."""
    goal = Goal()
    object.__setattr__(goal, name, GIVEN[name])
    refused = "criterion 'A'" if name == "criterion" else name
    assert goal.beyond_log_det == (refused,)
    with pytest.raises(ValueError, match=f"goal: expected one without {refused} for fisherpoint.design_pieces"):
        goal_of(goal, "design_pieces")
    problem = load_config(MICHAELIS_MENTEN).problem()
    with pytest.raises(ValueError, match=f'{refused}: expected method = "auto"'):
        check_goal(fp.results.ExchangeSettings(goal=goal, method=fp.ExchangeMethod("paper")), problem)


def test_reports_list_the_options_of_a_goal() -> None:
    problem = load_config(MICHAELIS_MENTEN).problem()
    goal = Goal("A", scale={"V": 2.0, "K": 3.0}, prior_information=True, singular="error")
    points = problem.point_region.draw(problem.model, 20, seed=0)
    one = fp.exchange(problem, 2, goal=goal, n_candidates=5, max_iterations=2)
    many = fp.sweep(problem, [2], goal=goal, n_candidates=5, max_iterations=2)
    weights = fp.approximate_design(problem, points, goal=goal, n_experiments=2)
    exact = fp.exact_design(problem, points, 2, goal=goal)
    for design in (one, many, weights, exact):
        text = " ".join(str(design.report()).split())
        assert "prior information" in text and "counts once beside the data, in the criterion" in text
        assert "where parameters are left open" in text and "error" in text
        assert "2 (V), 3 (K)" in text or "V 2, K 3" in text


def test_words_name_what_is_maximised() -> None:
    assert Goal().maximised == "log det F" and Goal().headline == ""
    assert Goal("c", of="a / b").maximised == "-log(variance of a / b)"
    assert Goal("E").maximised == "log(smallest eigenvalue of F)"
    assert Goal("Ds", of=["a", "b"], over=fp.OverPrior("worst")).maximised == "the smallest log det of the information about a, b"


def test_a_file_states_it_in_a_table_of_its_own(tmp_path: Path) -> None:
    path, text = tmp_path / "problem.toml", MICHAELIS_MENTEN.read_text()
    keys = 'criterion = "Ds"\nof = ["K"]\nover = "cvar"\nscenarios = 4\nshare = 0.5\nprior_information = true\nconfidence = 0.9'
    path.write_text(f"{text}\n[goal]\n{keys}\n")
    over = fp.OverPrior("cvar", scenarios=fp.Sobol(4), share=0.5)
    assert load_config(path).build_goal() == Goal("Ds", of=["K"], over=over, prior_information=True, confidence=0.9)
    path.write_text(f'{text}\n[goal]\ncriterion = "c"\n')
    with pytest.raises(ConfigError, match=r"goal\.of: expected a function"):
        load_config(path)
