"""States far below their natural size, which counts as 1 where none is told: no call computes with them without a word."""

from __future__ import annotations

import warnings
from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import fisherpoint as fp

THETA = {"V": 1e-5, "K": 1e-5}
POINTS = fp.Experiments([[5e-6]], np.zeros((1, 0)), [3.0])
PRIOR = fp.GaussianPrior(mean=THETA, relative_std={"V": 0.1, "K": 0.1})

DATA = fp.Measurements(fp.Experiments([[5e-6], [4e-6]], np.zeros((2, 0)), [1.0, 2.0]), [[3e-6], [2e-6]])


def michaelis_menten(unit: object) -> fp.Model:
    return fp.SymbolicModel(["-V * s / (K + s)"], ["s"], {"s": unit}, {}, {"V": "mol/s", "K": "mol"})


CALLS: dict[str, Callable[[fp.Model], object]] = {
    "simulate": lambda model: fp.simulate(model, POINTS, THETA),
    "sensitivities": lambda model: fp.sensitivities(model, POINTS, THETA),
    "predictive_covariance": lambda model: fp.predictive_covariance(model, POINTS, PRIOR, fp.SparseGaussHermite(2)),
    "simulate_record": lambda model: fp.simulate_record(model, [0.0, 1.0, 2.0], np.zeros((3, 0)), THETA, [5e-6]),
    "rig": lambda model: fp.VirtualRig(model, THETA, {"y": 1e-8}).measure(POINTS),
    "estimate": lambda model: fp.estimate(model, DATA, noise={"y": 1e-8}, prior=PRIOR),
    "problem": lambda model: fp.DesignProblem(model, PRIOR, fp.ExperimentRegion({"s": (1e-6, 5e-6), "dt": (0.1, 3.0)})),
}


@pytest.mark.parametrize("name", CALLS)
def test_every_way_to_a_trajectory_warns_of_small_states_without_a_size(name: str) -> None:
    with pytest.warns(RuntimeWarning, match=r"s: expected its natural size, as the .* below .* mol .* write \('mol', "):
        CALLS[name](michaelis_menten("mol"))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        CALLS[name](michaelis_menten(("mol", 5e-6)))


def test_with_its_size_told_a_small_state_has_its_digits() -> None:
    end = fp.simulate(michaelis_menten(("mol", 5e-6)), POINTS, THETA).x[0, 0]
    truth = solve_ivp(lambda _, s: -1e-5 * s / (1e-5 + s), (0, 3.0), [5e-6], rtol=1e-12, atol=1e-22).y[0, -1]
    assert abs(end - truth) < 1e-6 * 5e-6


@pytest.mark.parametrize("start", [0.0, 0.5])
def test_states_at_zero_or_near_one_bring_no_warning(start: float) -> None:
    model = fp.SymbolicModel(["-V * s / (K + s)"], ["s"], {"s": "mol"}, {}, {"V": "mol/s", "K": "mol"})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fp.simulate(model, fp.Experiments([[start]], np.zeros((1, 0)), [1.0]), {"V": 0.1, "K": 1.0})


def test_many_small_states_are_named_together():
    names = [f"x{i}" for i in range(30)]
    model = fp.SymbolicModel([f"-k*{x}" for x in names], ["x0"], dict.fromkeys(names, "mol"), {}, {"k": "1/s"}, {"y": "mol"})
    with pytest.warns(RuntimeWarning) as heard:
        fp.simulate(model, fp.Experiments([[1e-4] * 30], [[]], [0.1]), [1.0])
    assert len(heard) == 4
    assert str(heard[-1].message).startswith("x3, x4, ") and str(heard[-1].message).endswith("expected their natural sizes too")
