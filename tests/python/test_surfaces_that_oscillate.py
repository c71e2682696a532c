"""Surfaces that go up and down many times within a step: no pair of crossings may be stepped over."""

from __future__ import annotations

import numpy as np
import pytest

import fisherpoint as fp

pytestmark = pytest.mark.kernels

RATES = ("0.5/(0.1 - x) + max(cos(20*a), sin(x))", "1.06*max(cos(12*a*b) - 0.42, 0) - x")


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("method", ["RK45", "DOP853"])
def test_pairs_of_crossings_are_seen(rate: str, method: str) -> None:
    """An oscillator drives them; of 2000 trajectories one in 200 may miss a pair, and be off by more than 30 tolerances.

    Where steps that end on a crossing were not looked through, it was one in eleven.
    """
    rng, count = np.random.default_rng(5), 2000
    model = fp.SymbolicModel(["3*b", "-3*a", rate], ["x + p"], {"a": "1", "b": "1", "x": "1"}, {}, {"p": "1"})
    starts = np.column_stack([rng.uniform(-1, 1, count), rng.uniform(-1.5, 1.5, count), rng.uniform(1.2, 2, count)])
    points = fp.Experiments(starts, np.empty((count, 0)), rng.uniform(0.3, 2, count))
    truth = fp.simulate(model, points, [1.0], rtol=1e-12, method="RK45")
    assert not truth.status.any()
    for rtol in (1e-4, 1e-5, 1e-6, 1e-7, 1e-8):
        found = fp.simulate(model, points, [1.0], rtol=rtol, method=method)
        assert not found.status.any()
        off = np.abs(found.x - truth.x).max(axis=1) > 30 * rtol
        assert off.mean() < 0.005
