"""Sensitivities of trajectories that start next to where f takes the root of zero: f_x changes by far within a step there."""

from __future__ import annotations

import numpy as np
import pytest

import fisherpoint as fp

pytestmark = pytest.mark.kernels

RATES = {
    "the root of what is cut off": "1 + sqrt(max(p*x - 1.7, 0))",
    "a root alone": "1 + sqrt(p*x - 1.7)",
    "towards the root of a distance": "q - sqrt(abs(p*x - 1.7))",
    "a power of what is cut off": "q - max(p*x - 1.7, 0)**1.5",
}


def model_of(rate: str) -> fp.SymbolicModel:
    return fp.SymbolicModel([rate], ["x"], {"x": "1"}, {}, {"p": "1", "q": "1"})


@pytest.mark.parametrize("name", RATES)
@pytest.mark.parametrize("method", ["RK45", "DOP853"])
@pytest.mark.parametrize("rtol", [1e-4, 1e-6])
def test_columns_keep_their_tolerance(name: str, rtol: float, method: str) -> None:
    """From distances of 1e-4 to 0.5, over times of 0.01 to 2, against columns at rtol 1e-12."""
    rng, count = np.random.default_rng(3), 1000
    starts = 1.7 / 2.12 + 10 ** rng.uniform(-4, -0.3, count)
    points = fp.Experiments(starts[:, None], np.empty((count, 0)), 10 ** rng.uniform(-2, 0.3, count))
    model = model_of(RATES[name])
    truth = fp.sensitivities(model, points, [2.12, 1.3], rtol=1e-12)
    found = fp.sensitivities(model, points, [2.12, 1.3], rtol=rtol, method=method)
    assert not truth.status.any() and not found.status.any()
    size = np.abs(truth.dx_dtheta).max(axis=2, keepdims=True)
    assert (np.abs(found.dx_dtheta - truth.dx_dtheta) / size).max() < 30 * rtol


def test_a_case_of_two_steps() -> None:
    """DOP853 needs so few steps for x that both estimates of the column's error vanish: it was 7e-4 at 1e-6, called ok."""
    model = model_of(RATES["the root of what is cut off"])
    points = fp.Experiments([[0.807]], [[]], [0.2484])
    for rtol in (1e-4, 1e-5, 1e-6, 1e-7):
        found = fp.sensitivities(model, points, [2.12, 3.0], rtol=rtol, method="DOP853")
        assert found.dx_dtheta[0, 0, 0] == pytest.approx(0.3204194614, rel=10 * rtol)


def test_where_roots_are_zero_is_read_off_the_equations() -> None:
    def rough(rate: str) -> tuple[bool, ...]:
        return model_of(rate).structure.programs.rough

    assert [rough(rate) for rate in RATES.values()] == [(True,), (), (True,), (True,)]
    assert rough("max(x - p, 0) + q*abs(x - 1)") == (False, False)
    assert rough("max(x - p, 0) + sqrt(q*abs(x - 1))") == (True, False)  # that of the root comes first
    assert rough("sqrt(1 + max(x - p, 0))") == (True,)
    assert rough("sign(x - p)*sqrt(abs(x - p)) + abs(x)") == (True, False)


@pytest.mark.long
def test_compiled_models_are_as_right() -> None:
    model = model_of(RATES["the root of what is cut off"])
    points = fp.Experiments([[0.807]], [[]], [0.2484])
    found = fp.sensitivities(model.compile(), points, [2.12, 3.0], rtol=1e-5, method="DOP853")
    assert found.dx_dtheta[0, 0, 0] == pytest.approx(0.3204194614, rel=1e-4)
