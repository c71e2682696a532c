"""Samples on their own clock: runs divided at these, their information, slopes and costs; and files of what is held."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.design.runs.run_moves import moved_runs
from fisherpoint.design.runs.run_slopes import linear_rows
from fisherpoint.points.run_coordinates import RunCoordinates
from sampling_cases import joint, objective_of, problem, region

FREE = {"bounds": {"dt": (0.013, 0.021)}}
"""Durations whose switching instants lie between samples, or pass them."""


def held(dt: Any, seed: int = 0) -> fp.Runs:
    dt = np.atleast_2d(dt)
    return fp.Runs(np.zeros((len(dt), 2)), np.random.default_rng(seed).uniform(-2, 2, dt.shape), dt)


@pytest.mark.parametrize("seed", range(30))
def test_runs_are_sampled_at_all_multiples_up_to_their_ends(seed: int) -> None:
    rng = np.random.default_rng(seed)
    dt = rng.choice([0.01, 0.02, 0.03, 0.013, 0.0171, 0.1], (3, rng.integers(1, 6)))
    every = float(rng.choice([0.001, 0.01, 0.007, 0.003]))
    runs = held(dt, seed)
    sampled = runs.sampled(every)
    for k, total in enumerate(dt.sum(axis=1)):
        t, there = sampled.t[k], sampled.dt[k] > 0
        assert np.allclose(t[sampled.measured[k]], every * np.arange(1, int(total / every + 1e-9) + 1), rtol=0, atol=1e-12)
        assert abs(t[-1] - total) < 1e-12 and sampled.dt[k, there].min() > 1e-6
        segment = np.searchsorted(np.cumsum(dt[k]), (t - sampled.dt[k] / 2)[there])
        assert np.array_equal(sampled.u[k, there], runs.u[k, segment])
    assert np.array_equal(sampled.x0, runs.x0)


def test_instants_that_are_ends_but_for_rounding_are_these() -> None:
    sampled = held([0.1, 0.1, 0.1]).sampled(0.1 / 3)
    assert sampled.dt.shape == (1, 9) and sampled.measured.all()
    assert held([0.02] * 3).sampled(0.02) == held([0.02] * 3)
    assert held([0.02] * 3).sampled((5, "ms")) == held([0.02] * 3).sampled(0.005)


def test_runs_are_sampled_at_given_instants() -> None:
    sampled = held([[0.02, 0.02, 0.02], [0.02, 0.005, 0.01]]).sampled(at=[0.01, 0.02, 0.05])
    assert np.allclose(sampled.t[0], [0.01, 0.02, 0.04, 0.05, 0.06]) and sampled.measured[0].tolist() == [
        True,
        True,
        False,
        True,
        False,
    ]
    assert np.allclose(sampled.t[1], [0.01, 0.02, 0.025, 0.035, 0.035]) and sampled.measured[1].sum() == 2


def test_f_is_that_of_fine_segments() -> None:
    given = problem(region())
    coordinates = RunCoordinates(given.run_region, given.model)
    z = np.random.default_rng(0).random((2, len(coordinates)))
    fine = fp.Runs(np.zeros((2, 2)), np.repeat(coordinates.held(z).u, 20, axis=1), 1e-3)
    f, other = (fp.evaluate(given, runs).fisher for runs in (coordinates.runs(z), fine))
    assert np.allclose(f, other, rtol=1e-12, atol=0)


def test_f_is_continuous_where_switches_pass_samples() -> None:
    """Behind a switch the state is smooth: F on both sides of a sample, and at it, differs by no more than the step."""
    given = problem(region(4, bounds={"dt": (0.01, 0.03)}))
    objective = objective_of(given)
    z = np.array([0.9, 0.2, 0.7, 0.1, 0.5, 0.5, 0.5, 0.5])
    steps = np.array([-1e-3, -1e-6, -1e-12, 0.0, 1e-12, 1e-6, 1e-3])
    moved = np.tile(z, (7, 1))
    moved[:, 5] += steps  # 20 us, and less, around the sample at 40 ms
    moved[:, 7] -= steps - 0.01  # and the end stays
    f = objective.judged(objective.tried(moved, None)).matrices[:, 0]
    assert np.allclose(f, f[3], rtol=0, atol=2e-2 * np.abs(f[3]).max())
    assert np.allclose(f[1:6], f[3], rtol=0, atol=2e-5 * np.abs(f[3]).max())
    assert np.allclose(f[2:5], f[3], rtol=0, atol=1e-8 * np.abs(f[3]).max())


def rows_at(objective: Any, z: Any, counts: Any) -> Any:
    """Whitened rows (m, p) of the first samples of a run, by a run whose last input goes on."""
    own = objective.coordinates.held(z[None])
    dt = np.append(own.dt, [[1.0]], axis=1)
    longer = fp.Runs(own.x0, np.append(own.u, own.u[:, -1:], axis=1), dt).sampled(at=1e-3 * np.arange(1, counts + 1))
    rows = objective.tangents(longer).rows(objective.problem).sensitivity[0][longer.measured[0]]
    return rows.reshape(-1, rows.shape[-1]) / 1e-3


@pytest.mark.parametrize("changes", [{}, FREE, FREE | {"duration": 0.09}, {"bounds": {"dt": (0.015, 0.025)}, "constant": ("dt",)}])
@pytest.mark.parametrize("few", [False, True])
def test_slopes_are_those_of_samples_that_stay(changes: Any, few: bool) -> None:
    """Switches move, samples stay; by many times the step between samples the number of fine segments differs, too."""
    objective = objective_of(problem(region(5, **changes)))
    objective.tuning = replace(objective.tuning, many_samples=2.0 if few else np.inf)
    z = np.random.default_rng(3).uniform(0.2, 0.8, (1, len(objective.coordinates)))
    z[:, -1] = 0.5
    linear = linear_rows(objective, z, None, True, np.random.default_rng(0))
    assert linear is not None
    counts = int(objective.coordinates.runs(z).measured.sum())
    base = rows_at(objective, z[0], counts)
    for j in range(z.shape[1]):
        step = 1e-3 * np.eye(z.shape[1])[j]
        slope = (rows_at(objective, z[0] + step, counts) - rows_at(objective, z[0] - step, counts)) / 2e-3
        wanted, found = base.T @ slope, linear.rows[0, 0].T @ linear.row_slopes[0, j, 0]
        assert np.allclose(found, wanted, rtol=2e-2, atol=2e-3 * np.abs(base.T @ base).max())
        wanted, found = slope.T @ slope, linear.row_slopes[0, j, 0].T @ linear.row_slopes[0, j, 0]
        assert np.allclose(found, wanted, rtol=5e-2, atol=1e-3 * np.abs(wanted).max())


@pytest.mark.parametrize("changes", [{}, FREE, FREE | {"duration": 0.1}])
@pytest.mark.parametrize("kappa", [0.0, 5.0])
@pytest.mark.parametrize("late", [False, True])
def test_changed_runs_are_worth_the_same_from_where_they_differ(changes: Any, kappa: float, late: bool) -> None:
    own = joint("delay(u, tau)", constants={"tau": (0.0077, "s")}) if late else joint()
    of = problem(region(6, **changes), own, along=["abs(w) < 0.4"])
    objective = objective_of(of, 2)
    objective.kappa = kappa
    rng = np.random.default_rng(0)
    z = rng.uniform(0.2, 0.8, (20, len(objective.coordinates)))
    z = z[objective.lasted(z).ok][0]
    base = objective.tangents(objective.tried(z[None], None).runs, outputs_alone=False)
    moved = moved_runs(objective.coordinates, z, rng)
    runs = objective.tried(moved[rng.permutation(len(moved))[:60]], None)
    whole, beside = objective.judged(runs), objective.judged_beside(base, runs)
    assert whole.ok.any() and np.array_equal(whole.ok, beside.ok)
    assert np.allclose(whole.matrices, beside.matrices, rtol=1e-5, atol=1e-6 * np.abs(whole.matrices).max())
    there, again = whole.costs[whole.ok], beside.costs[whole.ok]
    assert np.allclose(there, again, rtol=1e-4, atol=1e-6) and (there > 0).any() == (kappa > 0)


def test_costs_do_not_grow_with_the_number_of_samples() -> None:
    """Distances to limits are taken as often in each held segment, however many samples there are."""
    costs = []
    for every in (0.02, 0.001):
        objective = objective_of(problem(region(20, sample_every=every), along=["abs(w) < 0.9"]))
        objective.kappa = 5.0
        z = np.random.default_rng(1).uniform(0.2, 0.8, (8, len(objective.coordinates)))
        judged = objective.judged(objective.tried(z, None))
        costs.append(judged.costs[judged.ok])
    assert costs[0].sum() > 0 and np.allclose(*costs, rtol=1e-3)
