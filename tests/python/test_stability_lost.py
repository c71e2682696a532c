"""Stiff trajectories along what loses its stability, as where an amount is used up: implicit steps would damp what grows."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import fisherpoint as fp

pytestmark = pytest.mark.kernels

RATES = (1e7, 1e8, 1e9, 1e10)


def model_of(rates: dict[str, str], parameters: str, **constants: float) -> fp.SymbolicModel:
    return fp.SymbolicModel(
        f=list(rates.values()),
        g=[next(iter(rates))],
        states=dict.fromkeys(rates, "1"),
        inputs={},
        parameters=dict.fromkeys(parameters.split(), "1"),
        constants=constants,
    )


def points_of(x0: list[float], t: list[float]) -> fp.Experiments:
    return fp.Experiments([x0] * len(t), np.empty((len(t), 0)), t)


DISSOLUTION = {"u": "-k*(s - d/V)*u", "d": "k*(s - d/V)*u - a*d"}
MELTING = {"m": "-k*T*m", "T": "q - 2*k*T*m"}
TITRATION = {"a": "-k*a*b", "b": "F - k*a*b"}


def dissolved(t: float, s: float, a: float) -> float:
    """What is in solution after all is dissolved, at t0 = (1 - V s) / (a V s)."""
    return float(0.1 * s * np.exp(-a * t + (1 - 0.1 * s) / (0.1 * s)))


@pytest.mark.parametrize("rtol", [1e-4, 1e-6])
@pytest.mark.parametrize("rate", RATES)
def test_powder_that_is_dissolved(rate: float, rtol: float) -> None:
    """Right are d and its derivatives, until and after the powder is used up."""
    t, theta = [20.0, 22.0, 25.0], [rate, 0.5, 1.0]
    found = fp.sensitivities(model_of(DISSOLUTION, "k s a", V=0.1), points_of([1.0, 0.0], t), theta, rtol=rtol)
    assert not found.status.any()
    expected = np.array([dissolved(one, 0.5, 1.0) for one in t])
    np.testing.assert_allclose(found.x, np.c_[np.zeros(3), expected], atol=3 * rtol)
    slopes = np.c_[expected / 0.5 * (1 - 1 / 0.05), -expected * t]
    np.testing.assert_allclose(found.dx_dtheta[:, 1, 1:], slopes, rtol=1e-3)


@pytest.mark.parametrize("method", [None, "Radau"])
@pytest.mark.parametrize("rate", RATES)
def test_ice_that_is_melted(rate: float, method: fp.Method | None) -> None:
    """m falls by q/2 per second while T is zero; then T rises by q."""
    t, q = [1.0, 3.0, 20.0], 1.5
    found = fp.simulate(model_of(MELTING, "k q"), points_of([1.0, 0.0], t), [rate, q], rtol=1e-6, method=method)
    right = [[max(1 - q * one / 2, 0.0), max(q * one - 2, 0.0)] for one in t]
    assert not found.status.any()
    np.testing.assert_allclose(found.x, right, atol=2 / np.sqrt(rate) ** 1.5 + 3e-6)


@pytest.mark.parametrize("rtol", [1e-3, 1e-6])
@pytest.mark.parametrize("rate", RATES)
def test_acid_that_is_neutralised(rate: float, rtol: float) -> None:
    t = [0.5, 2.0, 4.0, 30.0]
    found = fp.sensitivities(model_of(TITRATION, "k F"), points_of([1.0, 0.0], t), [rate, 1.0], rtol=rtol)
    assert not found.status.any()
    np.testing.assert_allclose(found.x, [[max(1 - one, 0.0), max(one - 1, 0.0)] for one in t], atol=3 * rtol)
    np.testing.assert_allclose(found.dx_dtheta[1:, :, 1], [[0.0, one] for one in t[1:]], atol=1e-4)


@pytest.mark.parametrize("feed", [1.0, 1.001, 1.3])  # the second is used up at the same time, just before, or well before
@pytest.mark.parametrize("coupling", [0.0, 0.5])
def test_two_amounts_that_are_used_up_by_one_step(coupling: float, feed: float) -> None:
    """Of two modes that have begun to grow the determinant has its sign again, whatever the order of the states."""
    rates = {
        "a": "-k*a*b",
        "b": f"1 - k*a*b + {coupling}*(d - b)",
        "c": "-k*c*d",
        "d": f"G - k*c*d + {coupling}*(b - d)",
    }
    start = {"a": 1.0, "b": 0.0, "c": 1.0, "d": 0.0}
    ends = []
    for order in itertools.permutations(rates):
        model = model_of({name: rates[name] for name in order}, "k G")
        found = fp.simulate(model, points_of([start[name] for name in order], [3.0]), [1e9, feed], rtol=1e-6)
        assert found.status[0] == fp.Status.ok
        ends.append(dict(zip(order, found.x[0], strict=True)))
    for end in ends:
        assert end["a"] == pytest.approx(0.0, abs=3e-6) and end["c"] == pytest.approx(0.0, abs=3e-6)
        assert end["b"] + end["d"] == pytest.approx(3 * (1 + feed) - 2, abs=1e-5)
        if not coupling:
            assert end["b"] == pytest.approx(2.0, abs=1e-5)


@pytest.mark.filterwarnings("ignore:.*natural size:RuntimeWarning")
def test_an_error_in_a_mode_that_has_become_faster_is_seen() -> None:
    """b grows a thousandfold within a step, and with it the rate by which a vanishes: the iteration diverges unseen."""
    rng, count = np.random.default_rng(0), 2000
    x0 = np.c_[10 ** rng.uniform(-12, -6, count), 10 ** rng.uniform(-3, 0, count)]
    t = 10 ** rng.uniform(-2, 1, count)
    model = model_of(TITRATION, "k F")
    for rtol in (1e-4, 1e-6, 1e-8):
        found = fp.simulate(model, fp.Experiments(x0, np.empty((count, 0)), t), [1e8, 1.0], rtol=rtol, method="Radau")
        assert (found.status == fp.Status.ok).mean() > 0.99
        assert np.abs(found.x[:, 0]).max() < rtol


def test_what_is_absent_stays_absent() -> None:
    """A mode that would grow, of a state that nothing moves, costs no steps: no crystal is there to grow."""
    rates = {"p": "k*(c - 1)*p", "c": "-k*(c - 1)*p - a*c + 2*z", "z": "k*(c - z)"}
    found = fp.simulate(model_of(rates, "k a"), points_of([0.0, 2.0, 2.0], [10.0]), [1e7, 1.0], rtol=1e-6, method="Radau")
    assert found.status[0] == fp.Status.ok and found.x[0, 0] == 0.0


def test_growth_that_is_resolved_keeps_its_steps() -> None:
    """x grows by exp(3) beside a fast mode."""
    model = model_of({"x": "p*x", "y": "k*(x - y)"}, "p k")
    found = fp.simulate(model, points_of([1e-3, 0.0], [3.0]), [1.0, 1e6], rtol=1e-8)
    assert found.status[0] == fp.Status.ok
    np.testing.assert_allclose(found.x[0], 1e-3 * np.exp(3.0) * np.array([1.0, 1 / (1 + 1e-6)]), rtol=1e-6)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.filterwarnings("ignore:.*derivative.*:UserWarning")
def test_a_python_function_is_as_right() -> None:
    """By SciPy's Radau, which follows d = V s for all time at this rate and tolerance."""
    model = fp.CallableModel(
        f=lambda x, u, p: [-p.k * (p.s - 10 * x.d) * x.u, p.k * (p.s - 10 * x.d) * x.u - p.a * x.d],
        g=lambda x, u, p: [x.d],
        states={"u": "1", "d": ("1", 0.05)},
        inputs={},
        parameters={"k": "1", "s": "1", "a": "1"},
        outputs={"d": "1"},
    )
    found = fp.simulate(model, points_of([1.0, 0.0], [22.0]), [1e9, 0.5, 1.0], rtol=1e-4, method="Radau")
    assert found.status[0] == fp.Status.ok
    np.testing.assert_allclose(found.x[0], [0.0, dissolved(22.0, 0.5, 1.0)], atol=1e-5)
