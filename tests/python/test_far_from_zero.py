"""Estimates that are many standard errors from zero: the rounding of the unknowns does not keep a search from its end."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import least_squares

import fisherpoint as fp
from fisherpoint.basics.values import Array
from fisherpoint.estimation.unknowns import unknowns_of

NOISE = {"y": 1e-3}
Z = np.linspace(-2, 2, 41)
PLACES = ((0.0, 1.0), (1e6, 1.0), (1e8, 1.0), (1.7e9, 1.0), (1e10, 1.0), (5e9, 1e4), (-1.7e9, 3600.0))


def static(output: str, *parameters: str) -> fp.SymbolicModel:
    return fp.SymbolicModel([], [output], {}, {"u": "1"}, dict.fromkeys(parameters, "1"), {"y": "1"})


PEAK = static("A*exp(-((u - c)/w)**2/2)", "A", "c", "w")
PEAKS = static("A*exp(-((u - c)/w)**2/2) + B*exp(-((u - d)/w)**2/2)", "A", "c", "w", "B", "d")


def measured(place: float, width: float, y: Array) -> fp.Measurements:
    return fp.Measurements(fp.Experiments(np.empty((len(Z), 0)), (place + width * Z)[:, None]), y[:, None])


def data(seed: int) -> Array:
    return np.asarray(np.exp(-(Z**2) / 2) + NOISE["y"] * np.random.default_rng(seed).standard_normal(len(Z)))


def alone(y: Array) -> Array:
    """The estimate beside which everything is moved and stretched."""

    def residuals(p: Array) -> Array:
        return np.asarray((p[0] * np.exp(-(((Z - p[1]) / p[2]) ** 2) / 2) - y) / NOISE["y"])

    return np.asarray(least_squares(residuals, [0.9, 0.2, 1.2], xtol=1e-15, ftol=1e-15, gtol=1e-15).x)


@pytest.mark.parametrize("noise", [NOISE, None])
@pytest.mark.parametrize(("place", "width"), PLACES)
def test_a_peak_far_from_zero(place: float, width: float, noise: dict[str, float] | None) -> None:
    for seed in range(3):
        y = data(seed)
        start = {"A": 0.9, "c": place + 0.2 * width, "w": 1.2 * width}
        fit = fp.estimate(PEAK, measured(place, width, y), start=start, noise=noise)
        assert fit.converged, fit.stop_reason
        best, digits = alone(y), 4 * np.spacing(abs(place)) / width
        assert fit.estimate["A"] == pytest.approx(best[0], abs=1e-8 + digits)
        assert (fit.estimate["c"] - place) / width == pytest.approx(best[1], abs=1e-9 + digits)
        assert fit.estimate["w"] / width == pytest.approx(best[2], abs=1e-8 + digits)


@pytest.mark.parametrize("noise", [NOISE, None])
@pytest.mark.parametrize(("place", "width"), PLACES[1:])
def test_several_unknowns_far_from_zero(place: float, width: float, noise: dict[str, float] | None) -> None:
    y = data(0) + 0.5 * np.exp(-((Z - 1.5) ** 2) / 2)
    start = {"A": 0.9, "c": place + 0.1 * width, "w": 1.1 * width, "B": 0.6, "d": place + 1.4 * width}
    fit = fp.estimate(PEAKS, measured(place, width, y), start=start, noise=noise)
    assert fit.converged, fit.stop_reason
    off = np.array([fit.estimate["c"] - place, fit.estimate["d"] - place - 1.5 * width])
    assert np.abs(off / [fit.standard_errors["c"], fit.standard_errors["d"]]).max() < 4


@pytest.mark.parametrize(("place", "width"), PLACES[1:])
def test_profiles_far_from_zero(place: float, width: float) -> None:
    """Ends that are closer than a share of 1e-12 of the unknown are told apart."""
    y = data(0)
    near, far = (
        fp.estimate(PEAK, measured(at, size, y), start={"A": 0.9, "c": at + 0.2 * size, "w": size}, noise=NOISE)
        for at, size in ((0.0, 1.0), (place, width))
    )
    expected, found = near.profile("c"), far.profile("c")
    assert found.ends == expected.ends and found.converged.all() and not found.better
    error = near.standard_errors["c"]
    moved = (np.array(found.interval) - place) / width
    np.testing.assert_allclose(moved, expected.interval, atol=1e-4 * error + 4 * np.spacing(abs(place)) / width)


def test_a_bound_that_is_close_is_not_where_the_estimate_is() -> None:
    """Of an unknown of 1e8 with a standard error of 3e-4, 1e-3 is no rounding."""
    place = 1e8
    start = {"A": 0.9, "c": place + 0.2, "w": 1.0}
    fit = fp.estimate(PEAK, measured(place, 1.0, data(0)), start=start, noise=NOISE, bounds={"c": (place - 1e-3, None)})
    assert fit.converged and not fit.at_bounds and np.isfinite(fit.standard_errors["c"])


LEVEL = fp.SymbolicModel(
    ["-k*(x - e) + b*u"],
    ["x + o", "10*x"],
    {"x": "1"},
    {"u": "1"},
    {"k": "1/s", "e": "1", "b": "1/s", "o": "1"},
    {"y": "1", "z": "1"},
)


@pytest.mark.parametrize("noise", [{"y": 1e-3, "z": 1e-2}, None])
@pytest.mark.parametrize("place", [1e4, 1e8, 1.7e9, 1e10])
def test_trajectories_beside_an_offset(place: float, noise: dict[str, float] | None) -> None:
    """Points and runs; their tolerance, as a share of what is measured, would be far more than the noise."""
    rng = np.random.default_rng(2)
    true, start = {"k": 1.3, "e": 0.4, "b": 0.7, "o": place}, {"k": 1.0, "e": 0.3, "b": 0.6, "o": place + 1.0}
    points = fp.Experiments(rng.uniform(-1, 1, (20, 1)), rng.uniform(-1, 1, (20, 1)), rng.uniform(0.2, 2, 20))
    runs = fp.Runs(np.zeros((2, 1)), np.repeat(rng.uniform(-1, 1, (2, 8)), 4, axis=1), 0.1)
    for design in (points, runs):
        given = fp.VirtualRig(LEVEL, true, {"y": 1e-3, "z": 1e-2}, seed=1).measure(design)
        fit = fp.estimate(LEVEL, given, start=start, noise=noise)
        assert fit.converged, fit.stop_reason
        assert all(abs(fit.estimate[name] - true[name]) < 5 * fit.standard_errors[name] for name in true)


@pytest.mark.filterwarnings("ignore:residuals. expected white noise")  # by chance, of this seed
@pytest.mark.parametrize("noise", [NOISE, None])
@pytest.mark.parametrize("place", [1e4, 1.7e9])
def test_a_record_with_a_clock(place: float, noise: dict[str, float] | None) -> None:
    """Seconds since 1970 as a state; the peak comes at 2.5 s."""
    model = fp.SymbolicModel(
        ["1"], ["A*exp(-((c - t0)/w)**2/2) + 0*v"], {"c": "s"}, {"v": "1"}, {"A": "1", "t0": "s", "w": "s"}, {"y": "1"}
    )
    t = np.arange(50) * 0.1
    y = np.exp(-(((t - 2.5) / 0.7) ** 2) / 2) + 1e-3 * np.random.default_rng(0).standard_normal(50)
    record = fp.Record(t, np.zeros((50, 1)), y[:, None], x0={"c": place})
    fit = fp.estimate(model, record, start={"A": 0.9, "t0": place + 2.3, "w": 0.8}, noise=noise)
    assert fit.converged, fit.stop_reason
    assert abs(fit.estimate["t0"] - place - 2.5) < 4 * fit.standard_errors["t0"]


@pytest.mark.long
@pytest.mark.parametrize("seed", range(3))
def test_a_tolerance_that_is_coarser_than_the_noise_is_told(seed: int) -> None:
    """Residuals of a hundred times the noise are no minimum because the trajectories' tolerance is as large."""
    model = fp.SymbolicModel(["-k*(x - e) + b*u"], ["x"], {"x": "1"}, {"u": "1"}, {"k": "1/s", "e": "1", "b": "1/s"}, {"y": "1"})
    place, rng = 1e8, np.random.default_rng(seed)
    runs = fp.Runs(np.full((2, 1), place), np.repeat(rng.uniform(-1, 1, (2, 8)), 4, axis=1), 0.1)
    given = fp.VirtualRig(model, {"k": 1.3, "e": place, "b": 0.7}, NOISE, seed=seed).measure(runs)
    fit = fp.estimate(model, given, start={"k": 1.0, "e": place + 0.1, "b": 0.6}, noise=NOISE)
    assert not fit.converged or abs(fit.estimate["e"] - place) < 5 * fit.standard_errors["e"]
    assert fit.converged or fit.stop_reason == "rounding"


@pytest.mark.parametrize("settings", [{}, {"noise_known": False}, {"use_prior": True}])
@pytest.mark.parametrize("place", [1e4, 1.7e9, 1e10])
def test_virtual_experiments_far_from_zero(place: float, settings: dict[str, Any]) -> None:
    prior = fp.GaussianPrior({"A": 1.0, "c": place, "w": 1.0}, {"A": 0.1, "c": 0.2, "w": 0.1})
    problem = fp.DesignProblem(PEAK, prior, None, noise=NOISE)
    points = fp.Experiments(np.empty((15, 0)), place + np.linspace(-2, 2, 15)[:, None])
    assert fp.validate(problem, points, runs=40, **settings).designs["design"].failed == 0


def test_the_spacing_of_unknowns_is_that_of_their_values() -> None:
    prior = fp.GaussianPrior({"a": 1e8, "b": 2.0}, {"a": 1.0, "b": 0.2}, log=("b",))
    unknowns = unknowns_of({"a": 1e8, "b": 2.0, "c": -3e5}, prior, {}, {})
    z = unknowns.coordinates(np.array([[1e8 + 0.3, 2.1, -3e5]]))
    for factor, same in ((0.2, True), (4.0, False)):
        near = unknowns.values(z + factor * unknowns.spacing(z) * [1, 0, 0])
        assert (near[0, 0] == unknowns.values(z)[0, 0]) == same
    values = unknowns.values(z)
    share = unknowns.spacing(z) * np.abs(unknowns.slopes(values)) / np.spacing(np.abs(values))
    assert ((share >= 0.5) & (share <= 4)).all()
