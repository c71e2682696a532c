"""Sensitivities beside edges of power 1.5, where f is smooth enough but f_x rises like a root."""

from __future__ import annotations

import numpy as np
import pytest

import fisherpoint as fp

pytestmark = pytest.mark.kernels


@pytest.mark.parametrize(
    ("method", "most"), [("RK45", 300), ("DOP853", 100)]
)  # RK45's embedded error vanishes more often by chance
@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-8])
def test_columns_keep_their_tolerance(rtol: float, method: str, most: float) -> None:
    """An oscillator enters the edge and leaves it; its columns against those at rtol 1e-11."""
    model = fp.SymbolicModel(
        f=["p*cos(1.3*c)", "1", "q*max(s - a, 0)**1.5 - 0.2*y"],
        g=["y"],
        states={"s": "1", "c": "1", "y": "1"},
        inputs={},
        parameters={"p": "1", "q": "1", "a": "1"},
    )
    rng, count = np.random.default_rng(0), 1000
    starts = np.column_stack([rng.uniform(-0.5, 1, count), rng.uniform(0, 5, count), rng.normal(size=count)])
    points, theta = fp.Experiments(starts, np.empty((count, 0)), rng.uniform(0.5, 6, count)), [1.1, 0.9, 0.3]
    truth = fp.sensitivities(model, points, theta, rtol=1e-11)
    found = fp.sensitivities(model, points, theta, rtol=rtol, method=method)
    assert not truth.status.any() and not found.status.any()
    columns = np.abs(truth.dx_dtheta).max(axis=1, keepdims=True) + 1e-300
    error = (np.abs(found.dx_dtheta - truth.dx_dtheta) / columns).max(axis=(1, 2)) / rtol
    assert np.quantile(error, 0.99) < 20
    assert error.max() < most


def test_a_case_in_closed_form() -> None:
    """y' = q (t - a)^1.5 from t = a on: dy/da = -q (T - a)^1.5."""
    model = fp.SymbolicModel(["1", "q*max(t - a, 0)**1.5"], ["y"], {"t": "1", "y": "1"}, {}, {"q": "1", "a": "1"})
    duration = np.linspace(0.6, 3.0, 50)
    points = fp.Experiments(np.zeros((50, 2)), np.empty((50, 0)), duration)
    for rtol in (1e-4, 1e-6, 1e-8):
        found = fp.sensitivities(model, points, [1.3, 0.5], rtol=rtol)
        since = duration - 0.5
        np.testing.assert_allclose(found.dy_dtheta[:, 0, 0], 0.4 * since**2.5, rtol=20 * rtol, atol=20 * rtol)
        np.testing.assert_allclose(found.dy_dtheta[:, 0, 1], -1.3 * since**1.5, rtol=20 * rtol)
