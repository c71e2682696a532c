"""Misuse of every function is one clear error, which says what was expected, what was given, and the quantity's name."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from conftest import REGION
from defaults import MODEL, NAMES, NOISE, PRIOR, RELATIVE_STD, SMALL, point, problem

NAN, INF = float("nan"), float("inf")
POINTS = point()[[0, 0]]
X, U = [0.15, 0.2, 6e6, 10e6, 0.3], [-0.3]
NOMINAL = MODEL.nominal
Call = Callable[[], Any]


def check(call: Call, name: str) -> None:
    """One line of ValueError or TypeError that starts with the name and holds the words expected and given."""
    with pytest.raises((ValueError, TypeError)) as caught:
        call()
    message = str(caught.value)
    assert re.match(name, message), message
    assert "expected" in message and "given" in message, message
    assert "\n" not in message and len(message) < 400, message
    assert "incompatible function arguments" not in message


def with_theta(**changes: Any) -> dict[str, Any]:
    return dict(NOMINAL) | changes


# --- trajectories -------------------------------------------------------------------------------------------------------

TRAJECTORIES = {"simulate": fp.simulate, "sensitivities": fp.sensitivities}


@pytest.mark.parametrize("function", TRAJECTORIES.values(), ids=TRAJECTORIES)
@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("model", {"model": None}),
        ("model", {"model": "hydraulic_cylinder"}),
        ("points", {"points": [X]}),
        ("points", {"points": None}),
        ("x0", {"points": fp.Experiments([X[:4]], [U], [1e-3])}),
        ("u", {"points": fp.Experiments([X], [[0.1, 0.2]], [1e-3])}),
        ("theta", {"theta": None}),
        ("theta", {"theta": "nominal"}),
        ("theta", {"theta": [1.0, 2.0]}),
        ("theta", {"theta": np.ones((3, 9))}),
        ("theta", {"theta": np.ones((2, 2, 9))}),
        ("theta", {"theta": {"a_tau": 1.0}}),
        ("theta", {"theta": with_theta(colour=1.0)}),
        (r"theta\['m_q'\]", {"theta": with_theta(m_q=NAN)}),
        (r"theta\['m_q'\]", {"theta": with_theta(m_q="heavy")}),
        ("theta", {"theta": [INF] * 9}),
        ("m_q", {"theta": with_theta(m_q=0.0)}),
        ("E_oil", {"theta": with_theta(E_oil=-1.2e9)}),
        ("B_v", {"theta": with_theta(B_v=0.0)}),
        ("V_0A", {"theta": with_theta(V_0A=0.0)}),
        ("V_0B", {"theta": with_theta(V_0B=-1.0)}),
        ("a_tau", {"theta": with_theta(a_tau=-1.0)}),
        ("c_L", {"theta": with_theta(c_L=-1.0)}),
        ("p_t", {"theta": with_theta(p_t=-1.0)}),
        ("p_t", {"theta": with_theta(p_t=21e6)}),
        ("p_t", {"theta": with_theta(p_t=3e7)}),
        ("rtol", {"rtol": 0.0}),
        ("rtol", {"rtol": -1e-6}),
        ("rtol", {"rtol": 1.0}),
        ("rtol", {"rtol": 1e-16}),
        ("rtol", {"rtol": NAN}),
        ("rtol", {"rtol": "fine"}),
        ("rtol", {"rtol": [1e-6]}),
        ("threads", {"threads": 0}),
        ("threads", {"threads": -2}),
        ("threads", {"threads": 1.5}),
        ("threads", {"threads": True}),
        ("threads", {"threads": "all"}),
        ("threads", {"threads": 2**40}),
        ("kinks", {"kinks": "ignore"}),
        ("kinks", {"kinks": None}),
    ],
)
def test_trajectories(function: Any, name: str, changes: dict[str, Any]) -> None:
    arguments: dict[str, Any] = {"model": MODEL, "points": POINTS, "theta": NOMINAL}
    assert not function(**arguments).status.any()
    check(lambda: function(**arguments | changes), name)


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("model", {"model": 3}),
        ("points", {"points": X}),
        ("prior", {"prior": None}),
        ("prior", {"prior": dict(NOMINAL)}),
        ("prior", {"prior": fp.GaussianPrior({"a_tau": 1.0}, std={"a_tau": 1.0})}),
        ("p_t", {"prior": fp.GaussianPrior(with_theta(p_t=3e7), relative_std=RELATIVE_STD)}),
        ("rule", {"rule": 3}),
        ("levels", {"rule": fp.TensorGrid({"a_tau": 3})}),
        ("parameters", {"parameters": ("colour",)}),
        ("parameters", {"parameters": "a_tau"}),
        ("rtol", {"rtol": NAN}),
        ("threads", {"threads": 0}),
        ("kinks", {"kinks": ""}),
    ],
)
def test_predictive_covariance(name: str, changes: dict[str, Any]) -> None:
    arguments: dict[str, Any] = {"model": MODEL, "points": POINTS, "prior": PRIOR, "rule": SMALL}
    assert not fp.predictive_covariance(**arguments).status.any()
    check(lambda: fp.predictive_covariance(**arguments | changes), name)


# --- points -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("x0", {"x0": X}),
        ("x0", {"x0": None}),
        ("x0", {"x0": [[NAN] * 5]}),
        ("x0", {"x0": [[INF] * 5]}),
        ("x0", {"x0": [["a"] * 5]}),
        ("x0", {"x0": [[1j] * 5]}),
        ("x0", {"x0": np.array([[1j] * 5])}),
        ("x0", {"x0": [X, X[:3]]}),
        ("x0", {"x0": [[[1.0]]]}),
        ("u", {"u": [U, U]}),
        ("u", {"u": [0.1, 0.2]}),
        ("u", {"u": [[NAN]]}),
        ("u", {"u": 0.1}),
        ("dt", {"dt": 1e-3}),
        ("dt", {"dt": [[1e-3]]}),
        ("dt", {"dt": [1e-3, 1e-3]}),
        ("dt", {"dt": [0.0]}),
        ("dt", {"dt": [-1e-3]}),
        ("dt", {"dt": [NAN]}),
        ("dt", {"dt": [INF]}),
        ("columns", {"columns": ("q", "v")}),
    ],
)
def test_experiments(name: str, changes: dict[str, Any]) -> None:
    arguments: dict[str, Any] = {"x0": [X], "u": [U], "dt": [1e-3]}
    assert len(fp.Experiments(**arguments)) == 1
    check(lambda: fp.Experiments(**arguments | changes), name)


@pytest.mark.parametrize("index", [2, -3, 10**30])
def test_an_index_past_the_points(index: int) -> None:
    with pytest.raises(IndexError, match=rf"points: expected an index below 2, given {index}"):
        POINTS[index]


def test_indexing() -> None:
    assert len(POINTS[[]]) == 0 and len(POINTS[()]) == 0 and len(POINTS[5:]) == 0
    assert POINTS[-1] == POINTS[1] and POINTS[np.array([True, False])] == POINTS[0]
    assert [len(one) for one in POINTS] == [1, 1]
    with pytest.raises(ValueError, match="read-only"):
        POINTS.x0[0, 0] = 1.0


# --- models -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "constants"),
    [
        ("HydraulicCylinder", {"colour": 1.0}),
        ("A_A", {"A_A": 0.0}),
        ("A_B", {"A_B": -1.0}),
        ("p_s", {"p_s": -21e6}),
        ("T_1", {"T_1": 0.0}),
        ("T_1", {"T_1": NAN}),
        ("T_1", {"T_1": INF}),
        ("T_1", {"T_1": "fast"}),
        ("T_1", {"T_1": [1e-3]}),
        ("T_1", {"T_1": None}),
        ("k_u", {"k_u": NAN}),
        ("q_max", {"q_min": 0.3}),
        ("q_max", {"q_max": -0.1}),
    ],
)
def test_constants(name: str, constants: dict[str, Any]) -> None:
    check(lambda: fp.HydraulicCylinder(**constants), name)


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("x", (X[:4], U, NOMINAL)),
        ("x", ([NAN] * 5, U, NOMINAL)),
        ("x", (None, U, NOMINAL)),
        ("x", ([[X]], U, NOMINAL)),
        ("u", (X, [0.1, 0.2], NOMINAL)),
        ("u", (X, [INF], NOMINAL)),
        ("theta", (X, U, [1.0])),
        ("m_q", (X, U, with_theta(m_q=-1.0))),
        ("x, u, theta", ([X, X], [U, U, U], NOMINAL)),
        ("x: expected p_s - p_A > 0", ([0.15, 0.2, 3e7, 10e6, 0.3], U, NOMINAL)),
        ("x: expected p_B - p_t > 0", ([0.15, 0.2, 6e6, 1e5, 0.3], U, NOMINAL)),
        ("x: expected a state", ([0.15, 1e308, 6e6, 10e6, 0.3], U, NOMINAL)),
    ],
)
def test_right_hand_side(name: str, arguments: tuple[Any, ...]) -> None:
    assert MODEL.rhs(X, U, NOMINAL).shape == (5,)
    check(lambda: MODEL.rhs(*arguments), name)


# --- prior, rule, region ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "call"),
    [
        ("mean", lambda: fp.GaussianPrior([1.0], std={"a": 1.0})),
        ("mean", lambda: fp.GaussianPrior(None, std={"a": 1.0})),
        ("std", lambda: fp.GaussianPrior({"a": 1.0}, std=[1.0])),
        ("relative_std", lambda: fp.GaussianPrior({"a": 1.0}, relative_std=0.1)),
        (r"std\['a'\]", lambda: fp.GaussianPrior({"a": 1.0}, std={"a": -1.0})),
        (r"std\['a'\]", lambda: fp.GaussianPrior({"a": 1.0}, std={"a": None})),
        ("levels", lambda: fp.TensorGrid("3")),
        ("levels", lambda: fp.TensorGrid(True)),
        (r"levels\['a'\]", lambda: fp.TensorGrid({"a": 2.0})),
        ("span", lambda: fp.TensorGrid(3, span="wide")),
        ("span", lambda: fp.TensorGrid(3, span=[1.0])),
        ("region", lambda: fp.ExperimentRegion(list(REGION.items()))),
        ("region", lambda: fp.ExperimentRegion(None)),
        ("constraints", lambda: fp.ExperimentRegion(REGION, [5])),
        ("constraints", lambda: fp.ExperimentRegion(REGION, [None])),
    ],
)
def test_prior_rule_and_region(name: str, call: Call) -> None:
    check(call, name)


# --- problems -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("model", {"model": None}),
        ("prior", {"prior": dict(NOMINAL)}),
        ("prior", {"prior": fp.GaussianPrior({"a_tau": 1.0}, std={"a_tau": 1.0})}),
        ("region", {"region": REGION}),
        ("region", {"region": fp.ExperimentRegion({"q": (0.0, 0.3)})}),
        ("region", {"region": None, "output_covariance": "region"}),
        ("rule", {"rule": 3}),
        ("levels", {"rule": fp.TensorGrid({"a_tau": 3})}),
        ("noise", {"noise": [1.0] * 4}),
        ("noise", {"noise": {}}),
        ("noise", {"noise": NOISE | {"v": 1e-3}}),
        (r"noise\['q'\]", {"noise": NOISE | {"q": -5e-6}}),
        (r"noise\['q'\]", {"noise": NOISE | {"q": 0.0}}),
        (r"noise\['q'\]", {"noise": NOISE | {"q": NAN}}),
        ("noise", {"noise": None, "output_covariance": "noise"}),
        ("output_covariance", {"output_covariance": "best"}),
        ("output_covariance", {"output_covariance": 1}),
        ("parameters", {"parameters": []}),
        ("parameters", {"parameters": ["colour"]}),
        ("parameters", {"parameters": "a_tau"}),
        ("parameters", {"parameters": 3}),
        ("p_t", {"prior": fp.GaussianPrior(with_theta(p_t=2.1e7), relative_std=RELATIVE_STD)}),
        ("p_t", {"model": fp.HydraulicCylinder(p_s=4e5)}),
        ("m_q", {"prior": fp.GaussianPrior(with_theta(m_q=-150.0), relative_std=RELATIVE_STD)}),
        ("kinks", {"kinks": "smooth"}),
        ("rtol", {"rtol": 0.0}),
        ("rtol", {"rtol": NAN}),
    ],
)
def test_problems(name: str, changes: dict[str, Any]) -> None:
    check(lambda: problem(**changes), name)


@pytest.mark.parametrize("chosen", [["b_tau", "a_tau"], ("a_tau", "b_tau"), np.array(["a_tau", "b_tau"]), {"a_tau": 1, "b_tau": 2}])
def test_parameters_may_be_any_collection_of_names(chosen: Any) -> None:
    assert problem(parameters=chosen).estimated == ("a_tau", "b_tau")
    assert problem(parameters=(name for name in chosen)).estimated == ("a_tau", "b_tau")
    assert problem().estimated == NAMES


# --- evaluation and exchange --------------------------------------------------------------------------------------------

TRAPPED = point(v=1e-3, p_A=2e6, p_B=18e6, dt=1e-2)


@pytest.mark.parametrize("given", [{}, {"output_covariance": "noise"}])
@pytest.mark.parametrize(
    ("name", "points"),
    [
        ("points", POINTS[:0]),
        ("points", [X]),
        ("points", None),
        ("points: .*v = 0 in points.0.", point(v=0.0)),
        (r"points: .*points\[0\] \(met_jump\)", TRAPPED),
        ("x0", fp.Experiments([X[:4]], [U], [1e-3])),
    ],
)
def test_evaluations(given: Any, name: str, points: Any) -> None:
    check(lambda: fp.evaluate(problem(jumps="exclude"), points, **given), name)


def test_an_evaluation_wants_a_problem() -> None:
    check(lambda: fp.evaluate(None, POINTS), "problem")  # type: ignore[arg-type]
    check(lambda: fp.evaluate(problem(), POINTS, threads=0), "threads")


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("problem", {"problem": None}),
        ("region", {"problem": problem(region=None)}),
        ("n_experiments", {"n_experiments": 0}),
        ("n_experiments", {"n_experiments": 2.0}),
        ("n_candidates", {"n_candidates": 0}),
        ("max_iterations", {"max_iterations": -1}),
        ("max_iterations", {"max_iterations": INF}),
        ("seed", {"seed": -1}),
        ("seed", {"seed": 0.5}),
        ("seed", {"seed": None}),
        ("threads", {"threads": 0}),
        ("progress", {"progress": 5}),
        ("method", {"method": 3}),
        ("goal", {"goal": 3}),
        ("workers", {"workers": 0}),
        ("workers", {"workers": "two"}),
    ],
)
def test_exchange(name: str, changes: dict[str, Any]) -> None:
    arguments: dict[str, Any] = {"problem": problem(), "n_experiments": 2, "n_candidates": 2, "max_iterations": 1}
    check(lambda: fp.exchange(**arguments | {"method": fp.ExchangeMethod(references=False)} | changes), name)


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("patience", {"patience": 0}),
        ("references", {"references": 1}),
        ("max_redraws", {"max_redraws": -1}),
        ("local", {"local": -0.1}),
        ("local", {"local": 1.5}),
        *(("time_limit", {"time_limit": wrong}) for wrong in (0.0, -1.0, NAN, "soon")),
        *(("starts", {"starts": wrong}) for wrong in (0, 1.5, 10**7)),
    ],
)
def test_exchange_method(name: str, options: dict[str, Any]) -> None:
    check(lambda: fp.ExchangeMethod(**options), name)
