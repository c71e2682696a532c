"""Until when a trajectory could be followed, as the kernels tell it: just before it is ok, just behind it is not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from conftest import random_points
from defaults import MODEL
from fisherpoint.information.pilot_nodes import SHORT, longest

pytestmark = pytest.mark.kernels

Status = fp.Status
LEAVES = fp.SymbolicModel(["-p - u"], ["x"], {"x": "1"}, {"u": "1"}, {"p": "1"}, domain=["x"])


def lasted(model: fp.Model, points: fp.Experiments, **strict: bool) -> tuple[np.ndarray, np.ndarray]:
    """Statuses and times."""
    settings: list[Any] = [1e-6, not strict.get("kinks"), not strict.get("jumps"), "fastest", 2]
    theta = model.theta(model.nominal) if model.nominal else np.ones(1)
    _, _, status, times = model.kernels.simulate(model.core, points.x0, points.u, points.dt, theta, *settings)
    return np.asarray(status), np.asarray(times)


def at(points: fp.Experiments, dt: np.ndarray) -> fp.Experiments:
    return fp.Experiments(points.x0, points.u, dt, columns=points.columns)


@pytest.mark.parametrize(
    ("strict", "reason"),
    [
        ({"jumps": True}, Status.met_jump),
        ({"kinks": True, "jumps": True}, Status.met_kink),
        ({}, Status.left_domain),
    ],
)
def test_just_before_it_ends_a_trajectory_is_ok_and_just_behind_it_is_not(strict: dict[str, bool], reason: Status) -> None:
    points = random_points(np.random.default_rng(3), 4000)
    points = at(points, 4 * points.dt)
    status, times = lasted(MODEL, points, **strict)
    np.testing.assert_allclose(times[status == Status.ok], points.dt[status == Status.ok], rtol=1e-12)
    ended = np.flatnonzero(status == reason)
    assert len(ended) > 50
    points, times = points[ended], times[ended]
    assert (times < points.dt).all() and (times > 0).all()
    before, _ = lasted(MODEL, at(points, SHORT * times), **strict)
    behind, _ = lasted(MODEL, at(points, np.minimum((2 - SHORT) * times, points.dt)), **strict)
    assert (before != Status.ok).mean() < 0.003 and (behind == Status.ok).mean() < 0.003


def test_the_time_at_which_a_straight_line_leaves_the_domain_is_exact() -> None:
    x0, u = np.linspace(0.1, 2.0, 20), np.linspace(0.0, 3.0, 20)
    points = fp.Experiments(x0[:, None], u, np.full(20, 5.0))
    status, times = lasted(LEAVES, points)
    assert (status == Status.left_domain).all()
    np.testing.assert_allclose(times, x0 / (1 + u), rtol=1e-9)


def test_functions_of_python_say_what_is_known() -> None:
    model = fp.CallableModel(
        lambda x, u, p: [-p.p - u.u],
        lambda x, u, p: [x.x],
        {"x": "1"},
        {"u": "1"},
        {"p": "1"},
        domain={"x": lambda x, u, p: x.x},
    )
    points = fp.Experiments([[1.0], [1.0]], [0.0, 0.0], [0.1, 3.0])
    status, times = lasted(model, points)
    assert status[0] == Status.ok and status[1] != Status.ok
    np.testing.assert_array_equal(times, [0.1, 0.0])


def test_the_longest_time_that_enough_nodes_allow() -> None:
    inf = np.inf
    given = np.array([[3.0, 1.0, 2.0], [inf, 1.0, 2.0], [inf, inf, 1.0], [1.0, inf, inf], [inf, inf, inf]])
    weights = np.array([1.0, 0.2, 0.3])
    np.testing.assert_array_equal(longest(given, weights, 0.0), SHORT * np.array([1.0, 1.0, 1.0, 1.0, inf]))
    np.testing.assert_array_equal(longest(given, weights, 0.4), [SHORT * 2.0, SHORT * 2.0, inf, SHORT * 1.0, inf])
    np.testing.assert_array_equal(longest(np.zeros((0, 3)), weights, 0.4), np.zeros(0))
