"""Trajectories that come to a surface where f takes a root, and stay on it or next to it, beside values of their own."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from balanced_roots import balanced, refilled, settled

pytestmark = [pytest.mark.kernels, pytest.mark.filterwarnings("ignore:.*expected its natural size")]

Right = Callable[..., list[float]]
"""The outputs at the end, of the parameters."""


def model_of(f: list[str], states: str, parameters: str, g: list[str] | None = None) -> fp.SymbolicModel:
    names = states.split()
    outputs = g or [name for name in names if name != "t"]
    return fp.SymbolicModel(
        f, outputs, dict.fromkeys(names, "1"), {}, dict.fromkeys(parameters.split(), "1"),
        {f"y_{n}": "1" for n in range(len(outputs))}, check_units=False,
    )  # fmt: skip


def compare(model: fp.SymbolicModel, x0: list[float], theta: list[float], t: float, right: Right, **options: Any) -> None:
    """States to 1e-8 and sensitivities to 1e-5, by central differences."""
    case = (x0, theta, t)
    points = fp.Experiments([x0], np.empty((1, 0)), [t])
    states = fp.simulate(model, points, theta, rtol=1e-9, **options)
    slopes = fp.sensitivities(model, points, theta, rtol=1e-8, **options)
    assert [str(states.statuses[0]), str(slopes.statuses[0])] == ["ok", "ok"], case
    np.testing.assert_allclose(states.y[0], right(*theta), rtol=0, atol=1e-8, err_msg=str(case))
    np.testing.assert_allclose(slopes.y[0], states.y[0], rtol=0, atol=1e-7, err_msg=str(case))
    expected = []
    for j, value in enumerate(theta):
        h = 1e-4 * abs(value)
        up, down = ([*theta[:j], value + sign * h, *theta[j + 1 :]] for sign in (1, -1))
        expected.append((np.array(right(*up)) - np.array(right(*down))) / (2 * h))
    size = 1 + np.abs(expected).max()
    np.testing.assert_allclose(slopes.dy_dtheta[0], np.array(expected).T, rtol=0, atol=1e-5 * size, err_msg=str(case))


def nice(rng: np.random.Generator, low: float, high: float) -> float:
    value = rng.uniform(low, high)
    return float([round(value, 1), round(4 * value) / 4, value][rng.integers(3)])


def positive(rng: np.random.Generator, low: float, high: float) -> float:
    return max(nice(rng, low, high), 0.1)


SEEDS = range(60)

TWO_TANKS = model_of(["-k/C_1*sign(p - q)*sqrt(abs(p - q))", "k/C_2*sign(p - q)*sqrt(abs(p - q))"], "p q", "k C_1 C_2")


@pytest.mark.parametrize("seed", SEEDS)
def test_two_tanks_settle_at_equal_levels(seed: int) -> None:
    rng = np.random.default_rng([1, seed])
    p, q, k, c1, c2 = nice(rng, 0, 1.5), nice(rng, 0, 1.5), positive(rng, 0.3, 2), positive(rng, 0.3, 2), positive(rng, 0.3, 2)
    if seed % 10 == 0:
        q = p
    t = nice(rng, 0.5, 5.0)

    def right(k: float, c1: float, c2: float) -> list[float]:
        mean, d = (c1 * p + c2 * q) / (c1 + c2), settled(p - q, k * (1 / c1 + 1 / c2), t)
        return [mean + c2 / (c1 + c2) * d, mean - c1 / (c1 + c2) * d]

    compare(TWO_TANKS, [p, q], [k, c1, c2], t, right, **({"method": "Radau"} if seed % 3 == 0 else {}))


THREE_TANKS = model_of(
    [
        "-k/C_1*sign(p - r)*sqrt(abs(p - r))",
        "k/C_2*sign(r - q)*sqrt(abs(r - q))",
        "(k*sign(p - r)*sqrt(abs(p - r)) - k*sign(r - q)*sqrt(abs(r - q)))/C_3",
    ],
    "p q r",
    "k C_1 C_2 C_3",
)


@pytest.mark.parametrize("method", ["RK45", "DOP853", "Radau", None])
@pytest.mark.parametrize("seed", SEEDS[::2])
def test_three_tanks_settle_at_equal_levels(seed: int, method: str | None) -> None:
    """Both levels meet the third in one instant, or one of them so shortly before the other that the tolerance cannot tell."""
    rng = np.random.default_rng([2, seed])
    levels = [nice(rng, 0, 1.5) for _ in range(3)]
    theta = [positive(rng, 0.5, 2) for _ in range(4)]
    if seed % 10 == 0:
        levels = [levels[0]] * 3

    def right(k: float, c1: float, c2: float, c3: float) -> list[float]:
        return [(c1 * levels[0] + c2 * levels[1] + c3 * levels[2]) / (c1 + c2 + c3)] * 3

    compare(THREE_TANKS, levels, theta, 40.0, right, method=method)


PUMPED = model_of(["1", "(a*cos(w*t) - k*sign(p - q)*sqrt(abs(p - q)))/C", "k*sign(p - q)*sqrt(abs(p - q))/C"], "t p q", "a w k C")


@pytest.mark.parametrize("size", [0.1, 0.01, 0.001])
@pytest.mark.parametrize("seed", range(3))
def test_a_pump_that_reverses(seed: int, size: float) -> None:
    """Two tanks that a pump fills and empties, ever more slowly: the levels differ by no more than (a / k)^2."""
    rng = np.random.default_rng([3, seed])
    theta = [size * positive(rng, 0.3, 1), positive(rng, 0.5, 2), positive(rng, 0.5, 2), positive(rng, 0.5, 2)]
    p, t = nice(rng, 0, 1), nice(rng, 1, 8)
    q = p if seed % 2 else nice(rng, 0, 1)

    def right(a: float, w: float, k: float, c: float) -> list[float]:
        reversals = [(n + 0.5) * np.pi / w for n in range(20)]
        d = balanced(lambda s: a * np.cos(w * s) / c, reversals, 2 * k / c, p - q, t)
        mean = (p + q) / 2 + a * np.sin(w * t) / (2 * w * c)
        return [mean + d / 2, mean - d / 2]

    compare(PUMPED, [0.0, p, q], theta, t, right)


FOLLOWING = model_of(["1", "k*sign(a*sin(w*t) - p)*sqrt(abs(a*sin(w*t) - p))"], "t p", "a w k")


@pytest.mark.long
@pytest.mark.parametrize("size", [1.0, 0.1, 0.01, 0.001])
@pytest.mark.parametrize("seed", range(20))
def test_a_pressure_that_follows_another(seed: int, size: float) -> None:
    rng = np.random.default_rng([4, seed])
    theta = [size * positive(rng, 0.3, 1), positive(rng, 0.5, 2), positive(rng, 0.5, 2)]
    p, t = 0.0 if seed % 2 else nice(rng, 0, 1), nice(rng, 1, 8)

    def right(a: float, w: float, k: float) -> list[float]:
        reversals = [(n + 0.5) * np.pi / w for n in range(20)]
        return [a * np.sin(w * t) - balanced(lambda s: a * w * np.cos(w * s), reversals, k, -p, t)]

    compare(FOLLOWING, [0.0, p], theta, t, right)


@pytest.mark.long
@pytest.mark.parametrize("exponent", [0.5, 0.3])
@pytest.mark.parametrize("size", [1.0, 0.1, 0.01])
@pytest.mark.parametrize("seed", range(20))
def test_a_tank_that_is_slowly_filled_again(seed: int, size: float, exponent: float) -> None:
    model = model_of(["1", f"q*max(t - t_f, 0) - k*max(h, 0)**{exponent}"], "t h", "q k t_f")
    rng = np.random.default_rng([5, seed])
    q, k, h = size * positive(rng, 0.3, 1), positive(rng, 0.5, 2), nice(rng, 0, 1)
    start = h ** (1 - exponent) / (1 - exponent) / k + positive(rng, 0.2, 1)
    t = start + positive(rng, 0.3, 3)
    compare(model, [0.0, h], [q, k, start], t, lambda q, k, start: [refilled(exponent, k, h, start, q, t)])


@pytest.mark.parametrize("seed", SEEDS)
def test_a_spool_rests_in_its_dead_zone(seed: int) -> None:
    """A spring without force within a of the centre, and drag: from rest inside it stays, and nothing depends on theta."""
    rng = np.random.default_rng([6, seed])
    spool = model_of(["v", "-k*sign(x)*max(abs(x) - a, 0) - d*sign(v)*sqrt(abs(v))"], "x v", "k a d")
    theta = [positive(rng, 0.5, 2), positive(rng, 0.2, 1), positive(rng, 0.3, 1)]
    x = [0.0, 0.5 * theta[1], rng.uniform(-theta[1], theta[1])][seed % 3]
    done = fp.sensitivities(spool, fp.Experiments([[x, 0.0]], np.empty((1, 0)), [nice(rng, 1, 20)]), theta)
    assert str(done.statuses[0]) == "ok"
    assert (done.y[0] == [x, 0.0]).all() and not done.dy_dtheta.any()
