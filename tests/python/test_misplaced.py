"""Keys of a file and keywords of a function that belong elsewhere: the message says where."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.basics.options import Options
from fisherpoint.design.file.configuration import ConfigError, load_config

EXAMPLE = (Path(__file__).parents[2] / "examples" / "michaelis_menten.toml").read_text()

MODEL = fp.SymbolicModel([], ["a + b*u"], {}, {"u": "1"}, {"a": "1", "b": "1"}, {"y": "1"}, nominal={"a": 1.0, "b": 1.0})
PROBLEM = fp.DesignProblem(MODEL, fp.GaussianPrior({"a": 1.0, "b": 1.0}, std={"a": 1.0, "b": 1.0}), None, noise={"y": 1.0})
POINTS = fp.Experiments(np.empty((2, 0)), [[0.0], [1.0]])

SEARCHES: dict[str, Callable[..., Any]] = {
    "exchange": lambda **given: fp.exchange(PROBLEM, 2, **given),
    "design_runs": lambda **given: fp.design_runs(PROBLEM, 2, **given),
    "sweep": lambda **given: fp.sweep(PROBLEM, [2], **given),
    "approximate_design": lambda **given: fp.approximate_design(PROBLEM, POINTS, **given),
    "exact_design": lambda **given: fp.exact_design(PROBLEM, POINTS, 2, **given),
    "design_pieces": lambda **given: fp.design_pieces(PROBLEM, None, 2, **given),  # type: ignore[arg-type]
    "criterion": lambda **given: fp.criterion(PROBLEM, **given),
}


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[design]", '[design]\ncriterion = "A"', "unknown key design.criterion; criterion belongs to the table [goal]"),
        ("[design]", "[design]\nbatch = 3", "unknown key design.batch; batch belongs to the table [campaign]"),
        ("[design]", "[design]\nhold = []", "unknown key design.hold; hold belongs to the table [runs.rest]"),
        ("[design]", "[design]\nconstraints = []", "unknown key design.constraints; constraints belongs to the table [region]"),
        ("[design]", "[goal]\nseed = 1\n[design]", "unknown key goal.seed; seed belongs to the table [rule] or [design]"),
        ("[design]", "[design]\nnoise = 1", "unknown key design.noise; noise is a table of its own, [noise]"),
        ("[design]", "[targets]\na = 1\n[design]", "unknown key targets; targets belongs to the table [campaign]"),
        ("[model]", 'criterion = "A"\n[model]', "unknown key criterion; criterion belongs to the table [goal]"),
        ("[design]", "[design]\nsead = 1", "unknown key design.sead; expected one of output_covariance, "),
    ],
)
def test_a_key_of_another_table_is_named_with_it(old: str, new: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "run.toml"
    path.write_text(EXAMPLE.replace(old, new, 1))
    with pytest.raises(ConfigError) as caught:
        load_config(path)
    assert message in str(caught.value)


@pytest.mark.parametrize("name", SEARCHES)
@pytest.mark.parametrize("option", ["criterion", "of", "over", "prior_information", "confidence"])
def test_a_part_of_the_goal_is_named_with_it(name: str, option: str) -> None:
    with pytest.raises(TypeError, match=rf"^{option}: expected as goal=fp\.Goal\({option}=...\), given to fp\.{name} itself$"):
        SEARCHES[name](**{option: None})


@pytest.mark.parametrize("name", SEARCHES)
def test_what_is_inside_the_goal_is_named_too(name: str) -> None:
    with pytest.raises(TypeError, match=r"^scenarios: expected as goal=fp\.Goal\(over=fp\.OverPrior\(scenarios=...\)\), given to"):
        SEARCHES[name](scenarios=8)


@pytest.mark.parametrize("name", ["exchange", "sweep"])
def test_options_of_a_method_are_named_with_it(name: str) -> None:
    with pytest.raises(TypeError, match=r"^patience: expected as method=fp\.ExchangeMethod\(patience=...\), given to"):
        SEARCHES[name](patience=3)


def test_deviations_are_named_of_an_estimate() -> None:
    data = fp.VirtualRig(MODEL, {"a": 1.0, "b": 1.0}, {"y": 0.1}).measure(POINTS)
    with pytest.raises(
        TypeError, match=r"^varies: expected as deviations=fp\.Deviations\(varies=...\), given to fp\.estimate itself"
    ):
        fp.estimate(MODEL, data, varies={"a": 0.1})  # type: ignore[call-arg]


def test_a_campaign_names_them_as_its_searches_do() -> None:
    region = fp.ExperimentRegion({"u": (0.0, 1.0)})
    for given, inside in (({"criterion": "A"}, "goal=fp.Goal"), ({"patience": 2}, "method=fp.ExchangeMethod")):
        (name,) = given
        with pytest.raises(TypeError, match=rf"^{name}: expected as {inside}\({name}=...\), given to fp\.Campaign itself$"):
            fp.Campaign(PROBLEM.replace(region=region), 2, **given)


@pytest.mark.parametrize("name", SEARCHES)
def test_another_keyword_is_that_of_python(name: str) -> None:
    with pytest.raises(TypeError, match=rf"{name}\(\) got an unexpected keyword argument 'colour'"):
        SEARCHES[name](colour="red")


def test_every_function_that_takes_options_names_them() -> None:
    """The first option of each class of options, for each public function with an argument of that class."""
    kinds = {kind.__name__: kind for kind in vars(fp).values() if isinstance(kind, type) and issubclass(kind, Options)}
    kinds |= {name: getattr(fp, name) for name in ("Goal", "ExchangeMethod", "Deviations")}
    for function in (getattr(fp, name) for name in fp.__all__):
        if inspect.isfunction(function):
            for argument, one in inspect.signature(function).parameters.items():
                for kind in (kind for name, kind in kinds.items() if name in str(one.annotation).split(" | ")):
                    field = next(iter(kind.__dataclass_fields__))  # type: ignore[attr-defined]
                    field = {"name": "patience"}.get(field, field)
                    with pytest.raises(TypeError, match=rf"^{field}: expected as {argument}=fp\.{kind.__name__}\("):
                        function(**{field: None})


def test_starts_and_time_limit_may_be_given_directly() -> None:
    problem = fp.DesignProblem(MODEL, PROBLEM.prior, fp.ExperimentRegion({"u": (0.0, 1.0)}), noise={"y": 1.0})
    direct = fp.exchange(problem, 2, method="paper", max_iterations=3, starts=2, time_limit=60.0)
    inside = fp.exchange(problem, 2, method=fp.ExchangeMethod("paper", starts=2, time_limit=60.0), max_iterations=3)
    assert direct.settings == inside.settings and direct.points == inside.points
    for name in ("exchange", "sweep"):
        with pytest.raises(ValueError, match="starts: expected a whole number of at least 1, given 0"):
            SEARCHES[name](starts=0)
        with pytest.raises(ValueError, match="time_limit: expected a positive number of seconds, given -1"):
            SEARCHES[name](time_limit=-1)
