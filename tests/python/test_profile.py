"""Profile-likelihood intervals against brute-force grids of formulas in NumPy alone."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy
from scipy.stats import chi2, f

import fisherpoint as fp
from fisherpoint.design.file.configuration import load_config
from fisherpoint.estimation import profile as profiles
from fisherpoint.estimation.least_squares import minimise

EXAMPLES = Path(__file__).parents[2] / "examples"

Formula = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


def michaelis_menten(s: np.ndarray, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    return first * s / (second + s)


def box_lucas(t: np.ndarray, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """The intermediate product of A -> B -> C, with its limit where both rates are the same."""
    difference = first - second
    near = np.abs(difference) < 1e-7
    safe = np.where(near, 1.0, difference)
    return np.where(near, first * t * np.exp(-first * t), first * (np.exp(-second * t) - np.exp(-first * t)) / safe)


MICHAELIS_MENTEN = (
    "michaelis_menten",
    michaelis_menten,
    [0.02, 0.02, 0.06, 0.06, 0.11, 0.11, 0.22, 0.22],
    21.0,
    (90, 600),
    (0.004, 0.6),
)
BOX_LUCAS = ("box_lucas", box_lucas, [0.8, 1.6, 3.0, 5.0, 8.0, 12.0], 0.06, (0.15, 4.0), (0.02, 0.9))
CASES = [pytest.param(*MICHAELIS_MENTEN, id="michaelis_menten"), pytest.param(*BOX_LUCAS, id="box_lucas")]


def data_of(name: str, formula: Formula, at: list[float], std: float, seed: int) -> tuple[Any, fp.Measurements, np.ndarray]:
    model = load_config(EXAMPLES / f"{name}.toml").build_model()
    where, count = np.array(at), len(at)
    truth = list(model.nominal.values())
    y = formula(where, *truth) + np.random.default_rng(seed).normal(0.0, std, count)
    if model.states:
        points = fp.Experiments(np.tile([1.0, 0.0], (count, 1)), np.zeros((count, 0)), where)
    else:
        points = fp.Experiments(np.zeros((count, 0)), where[:, None], np.ones(count))
    return model, fp.Measurements(points, y), y


def brute_force(
    formula: Formula, at: list[float], y: np.ndarray, limits: list[tuple[float, float]], rise: Callable[[float], float]
) -> list[tuple[float, float]]:
    """Intervals of both parameters: where the least sum of squares over the other one is below its minimum by `rise` of it.

    For each value of one parameter, five grids of the other one, each around the best of the one before, find the least sum.
    """
    where = np.array(at)

    def sums(first: np.ndarray, second: np.ndarray) -> np.ndarray:
        return np.square(formula(where[:, None], first[None], second[None]) - y[:, None]).sum(axis=0)

    intervals, lowest, curves = [], np.inf, []
    for mine in (0, 1):
        values = np.geomspace(*limits[mine], 1001)
        least = np.empty(len(values))
        for k, value in enumerate(values):
            low, high = np.log(limits[1 - mine])
            for _ in range(5):  # each round narrows the other one around its best
                other = np.exp(np.linspace(low, high, 101))
                fixed = np.full(len(other), value)
                found = sums(fixed, other) if mine == 0 else sums(other, fixed)
                best, width = np.log(other[np.argmin(found)]), (high - low) / 15
                low, high = best - width, best + width
            least[k] = found.min()
        curves.append((values, least))
        lowest = min(lowest, least.min())
    for values, least in curves:
        inside = np.flatnonzero(least <= lowest + rise(lowest))
        first, last = inside[0], inside[-1]
        assert first > 0
        assert last < len(values) - 1
        crossings = []
        for a, b in ((first - 1, first), (last, last + 1)):
            share = (lowest + rise(lowest) - least[a]) / (least[b] - least[a])
            crossings.append(float(values[a] + share * (values[b] - values[a])))
        intervals.append((crossings[0], crossings[1]))
    return intervals


@pytest.mark.parametrize(("name", "formula", "at", "std", "first", "second"), CASES)
@pytest.mark.parametrize("known", [True, False], ids=["known", "estimated"])
def test_intervals_are_those_of_a_brute_force_grid(
    name: str, formula: Formula, at: list[float], std: float, first: Any, second: Any, known: bool
) -> None:
    model, data, y = data_of(name, formula, at, std, seed=9)
    output = model.outputs[0].name
    fit = fp.estimate(model, data, noise={output: std} if known else None)
    n, p = len(y), 2

    def rise(lowest: float) -> float:
        return float(std**2 * chi2.ppf(0.95, 1)) if known else float(lowest / (n - p) * f.ppf(0.95, 1, n - p))

    expected = brute_force(formula, at, y, [first, second], rise)
    differences = []
    for parameter, interval in zip(fit.parameters, expected, strict=True):
        profile = fit.profile(parameter)
        width = interval[1] - interval[0]
        assert profile.ends == ("converged", "converged")
        assert profile.interval == pytest.approx(interval, abs=0.01 * width)
        assert profile.interval == pytest.approx(interval, rel=0.01)
        assert profile.linear_interval == pytest.approx(fit.intervals()[parameter])
        differences.append(max(abs(a - b) for a, b in zip(profile.linear_interval, interval, strict=True)) / width)
    assert max(differences) > 0.05  # the linear ones are others


def straight_line(n: int = 8, noise: float = 0.3) -> tuple[Any, fp.Measurements]:
    a, b, s = sympy.symbols("a b s")
    names = {kind: dict.fromkeys(given, "1") for kind, given in {"inputs": "s", "parameters": "ab", "outputs": "yz"}.items()}
    model = fp.SymbolicModel([], [a + b * s, a - 2 * b * s], states={}, **names)
    at = np.linspace(0.0, 2.0, n)
    points = fp.Experiments(np.zeros((n, 0)), at[:, None], np.ones(n))
    rng = np.random.default_rng(3)
    y = np.stack([1 + 2 * at, 1 - 4 * at], axis=1) + rng.normal(size=(n, 2)) * [noise, 3 * noise]
    return model, fp.Measurements(points, y)


def test_of_a_linear_model_it_is_the_linear_interval() -> None:
    model, data = straight_line()
    known = fp.estimate(model, data, start={"a": 0.0, "b": 1.0}, noise={"y": 0.3, "z": 0.9})
    one = fp.Measurements(data.points, data.y * [1.0, np.nan])
    estimated = fp.estimate(model, one, start={"a": 0.0, "b": 1.0})
    for fit in (known, estimated):
        for name in ("a", "b"):
            profile = fit.profile(name, level=0.9)
            assert profile.interval == pytest.approx(profile.linear_interval, rel=1e-6)
            assert profile.interval == pytest.approx(fit.intervals(0.9)[name], rel=1e-6)
            if fit is known:
                slope = np.sqrt(profile.threshold) / (profile.interval[1] - profile.estimate)
                assert profile.signed_root == pytest.approx(slope * (profile.values - profile.estimate), rel=1e-5, abs=1e-5)


def test_threads_do_not_change_it() -> None:
    model, data = straight_line()
    fit = fp.estimate(model, data, start={"a": 0.0, "b": 1.0}, noise={"y": 0.3, "z": 0.9})
    one, two, given = (fit.profile("a", threads=threads) for threads in (1, 2, None))
    assert one.interval == two.interval == given.interval and np.array_equal(one.unknowns, two.unknowns)
    assert fit.weighted.observed.with_threads(3)._given[-1] == 3
    with pytest.raises(ValueError, match="threads: expected a whole number of at least 1, given 0"):
        fit.profile("a", threads=0)


def test_of_two_outputs_with_unknown_noise_it_is_close_to_the_interval_by_student() -> None:
    model, data = straight_line(n=40)
    fit = fp.estimate(model, data, start={"a": 0.0, "b": 1.0})
    for name in ("a", "b"):
        profile = fit.profile(name)
        assert profile.ends == ("converged", "converged")
        width = profile.linear_interval[1] - profile.linear_interval[0]
        assert profile.interval == pytest.approx(profile.linear_interval, abs=0.05 * width)
        assert profile.deviance.min() > -1e-6


def test_an_end_that_does_not_exist_is_told() -> None:
    """Far below saturation, V/K is told and V is not."""
    model, data, _ = data_of("michaelis_menten", michaelis_menten, [0.002, 0.003, 0.004, 0.005, 0.006], 1.0, seed=1)
    profile = fp.estimate(model, data, noise={"rate": 1.0}).profile("V")
    assert profile.interval[1] == np.inf
    assert profile.ends == ("converged", "not_bounded")
    assert np.isfinite(profile.interval[0])
    assert profile.deviance[-1] < profile.threshold
    assert "upper end: not bounded" in str(profile)
    assert np.isfinite(profile.values).all()
    assert np.isfinite(profile.deviance).all()


def test_an_end_at_a_bound_is_told() -> None:
    model, data, _ = data_of("michaelis_menten", michaelis_menten, [0.02, 0.06, 0.11, 0.22], 20.0, seed=1)
    fit = fp.estimate(model, data, noise={"rate": 20.0}, bounds={"V": (100, 230)})
    profile = fit.profile("V")
    assert profile.interval[1] == pytest.approx(230)
    assert profile.ends[1] == "at_bound"


def test_a_positive_unknown_stays_positive_and_a_prior_takes_part() -> None:
    config = load_config(EXAMPLES / "michaelis_menten.toml")
    model, data, _ = data_of("michaelis_menten", michaelis_menten, [0.9, 1.0, 1.1], 20.0, seed=1)
    prior = config.build_prior()
    fit = fp.estimate(model, data, prior, noise={"rate": 20.0})
    low, high = fit.profile("K").interval
    assert 0 < low < fit.estimate["K"] < high < 0.3
    alone = fp.estimate(model, data, start=prior, noise={"rate": 20.0}).profile("K")
    assert alone.interval[0] == 0.0
    assert alone.ends[0] in ("at_bound", "not_bounded")


def test_a_single_parameter() -> None:
    config = load_config(EXAMPLES / "exponential_decay.toml")
    model = config.build_model()
    points = fp.Experiments(np.ones((3, 1)), np.zeros((3, 0)), np.array([1e3, 2e3, 3e3]))
    y = 20.0 * np.exp(-5e-4 * points.dt) + np.array([0.3, -0.2, 0.1])
    fit = fp.estimate(model, fp.Measurements(points, y), parameters=["k"], noise={"c": 0.5})
    low, high = fit.profile("k").interval
    for end in (low, high):
        rise = (np.square(20 * np.exp(-end * points.dt) - y) - np.square(20 * np.exp(-fit.estimate["k"] * points.dt) - y)).sum()
        assert rise / 0.5**2 == pytest.approx(chi2.ppf(0.95, 1), rel=1e-5)


def test_a_better_minimum_on_the_way_is_told() -> None:
    """p is measured roughly and its square well: from -1 the search ends near -1, and the profile comes past +1."""
    names = {kind: dict.fromkeys(given, "1") for kind, given in {"inputs": "s", "parameters": "p", "outputs": "yz"}.items()}
    model = fp.SymbolicModel([], ["s*p**2", "s*p"], states={}, **names)
    data = fp.Measurements(fp.Experiments(np.zeros((1, 0)), [[1.0]], [1.0]), [[1.0, 1.0]])
    fit = fp.estimate(model, data, start={"p": -1.0}, noise={"y": 0.8, "z": 3.0})
    assert fit.estimate["p"] < 0
    profile = fit.profile("p")
    assert profile.better
    assert "a better estimate was found on the way" in str(profile)
    again = fp.estimate(model, data, start={"p": float(profile.values[np.argmin(profile.deviance)])}, noise={"y": 0.8, "z": 3.0})
    assert again.estimate["p"] == pytest.approx(1.0, abs=1e-6)
    assert not again.profile("p").better


def test_misuse_names_the_quantity() -> None:
    model, data = straight_line()
    fit = fp.estimate(model, data, start={"a": 0.0, "b": 1.0}, noise={"y": 0.3, "z": 0.9})
    with pytest.raises(ValueError, match="name: expected one of a, b; given unknown 'c'"):
        fit.profile("c")
    with pytest.raises(ValueError, match="level: expected a probability"):
        fit.profile("a", level=95)


@pytest.mark.parametrize("known", [True, False])
def test_values_at_which_the_others_were_not_found_are_told(known: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """There the deviance is too large, and the interval may be too narrow."""
    model, data, _ = data_of(*BOX_LUCAS[:4], seed=1)
    fit = fp.estimate(model, data, noise={"product": 0.06} if known else None)
    profile = fit.profile(fit.parameters[0])
    assert profile.converged.all() and "did not converge" not in str(profile)
    monkeypatch.setattr(profiles, "minimise", lambda *given, **named: minimise(*given[:4], 1, **named))
    monkeypatch.setattr(profiles, "MAX_ROUNDS", 1)
    poor = fit.profile(fit.parameters[0])
    assert not poor.converged.all() and len(poor.converged) == len(poor.values)
    missed = int((~poor.converged).sum())
    assert f"at {missed} of {len(poor.values)} values the others' search did not converge: the interval may be wider" in str(poor)
