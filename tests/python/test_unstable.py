"""Trajectories that nearly anything changes are told of."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import fisherpoint as fp

LORENZ = fp.SymbolicModel(
    ["s*(y - x)", "x*(r - z) - y", "x*y - b*z"],
    ["x"],
    dict.fromkeys("xyz", ("1", 10.0)),
    {},
    dict.fromkeys("srb", "1"),
)
THETA = [10.0, 28.0, 8 / 3]


def test_a_chaotic_trajectory_is_told_of_where_its_errors_are_as_large_as_itself() -> None:
    start = np.array([[1.0, 1.0, 20.0]])
    for duration, told in ((1.0, False), (5.0, False), (30.0, True)):
        points = fp.Experiments(start, np.zeros((1, 0)), [duration])
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            fp.sensitivities(LORENZ, points, THETA)
        assert any("expected trajectories that small changes leave" in str(one.message) for one in caught) == told
        assert all(one.filename == __file__ for one in caught)
    with pytest.warns(RuntimeWarning, match="[xyz]: expected trajectories .* times as much as [srb]: rtol holds for each step"):
        fp.sensitivities(LORENZ, fp.Runs(start, np.zeros((1, 6, 0)), 5.0), THETA)


def test_growth_alone_is_no_chaos() -> None:
    """x' = k x grows by 1e8 in 20 s, and changes by 20 times as much as k; a stable model with large numbers does not either."""
    growing = fp.SymbolicModel(["k*x"], ["x"], {"x": "1"}, {}, {"k": "1/s"})
    pressure = fp.SymbolicModel(["k*(u - p)"], ["p"], {"p": "Pa"}, {"u": "Pa"}, {"k": "1/s"})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fp.sensitivities(growing, fp.Experiments([[1.0]], np.zeros((1, 0)), [20.0]), [1.0])
        fp.sensitivities(pressure, fp.Experiments([[1e5]], [[1e9]], [1.0]), [1e-3])
