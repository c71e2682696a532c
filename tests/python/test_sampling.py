"""Samples on their own clock: runs divided at these, their information, slopes and costs; and files of what is held."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from check_sampling import check_sampling
from checks import Bench
from crossing_case import crossing_case
from figures import Figures
from fisherpoint.basics.toml_mistakes import ConfigError
from fisherpoint.design.runs.run_moves import moved_runs
from fisherpoint.design.runs.run_slopes import linear_rows
from fisherpoint.points.outside_region import outside
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
    assert held([0.02] * 3).sampled((5, "ms")) == held([0.02] * 3).sampled("5 ms") == held([0.02] * 3).sampled(0.005)


def test_runs_are_sampled_at_given_instants() -> None:
    sampled = held([[0.02, 0.02, 0.02], [0.02, 0.005, 0.01]]).sampled([0.01, 0.02, 0.05])
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
    longer = fp.Runs(own.x0, np.append(own.u, own.u[:, -1:], axis=1), dt).sampled(1e-3 * np.arange(1, counts + 1))
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


def test_the_samples_of_a_design_are_on_their_clock(tmp_path: Path) -> None:
    """Free durations, a limit that plants keep, and round numbers: what is carried out and what the design says are the same."""
    given = problem(region(5, bounds={"dt": (0.015, 0.025)}), along=["abs(w) < 3"])
    design = fp.design_runs(given, n_starts=1, n_candidates=20)
    sampled = design.runs.t[0][design.runs.measured[0]]
    assert np.allclose(sampled, 1e-3 * np.arange(1, len(sampled) + 1), rtol=0, atol=1e-12) and len(sampled) > 74
    shift = 3 * np.log(len(sampled) / 2)  # log det F of the sum
    assert design.log_det == pytest.approx(design.evaluation.log_det + shift, abs=1e-6) and design.feasible

    design.save(tmp_path)
    again = fp.Runs.from_csv(tmp_path / "design.csv", given.model)
    assert np.allclose(again.dt, design.runs.dt, rtol=0, atol=1e-12) and np.array_equal(again.u, design.runs.u)
    assert np.array_equal(again.measured, design.runs.measured)
    for name in ("design.csv", "plan.csv"):
        assert len((tmp_path / name).read_text().splitlines()) <= 10
    assert list(outside(given.model, given.region, design.runs)) == []
    design.plot("runs", path=tmp_path / "runs.png")
    assert "every 0.001 s" in str(design.report())


def test_files_of_runs_have_holds_and_the_period(tmp_path: Path) -> None:
    sampled, path = held([[0.02] * 5, [0.015] * 5]).sampled(0.001), tmp_path / "runs.csv"
    sampled.to_csv(path, joint())
    rows = path.read_text().splitlines()
    assert rows[0] == "run,segment,q,w,u,dt,measured,sample_every" and len(rows) == 11
    assert fp.Runs.from_csv(path, joint()) == sampled

    mixed = fp.Runs.join([sampled, held([[0.02, 0.03]])])
    mixed.to_csv(path, joint())
    assert fp.Runs.from_csv(path, joint()) == mixed and len(path.read_text().splitlines()) == 13

    path.write_text("run,segment,q,w,u,dt [ms],measured,sample_every [ms]\n1,1,0,0,1.5,20,1,5\n1,2,,,-1.5,30,1,\n")
    by_hand = fp.Runs.from_csv(path, joint())
    assert np.allclose(by_hand.dt, 0.005) and by_hand.measured.sum() == 10


@pytest.mark.parametrize(
    ("rows", "text"),
    [
        (
            "1,1,0,0,1,0.02,1,0.03\n",
            "row 1, column sample_every: expected a period of at most the shortest run, 0.02 s, given 0.03",
        ),
        ("1,1,0,0,1,0.02,1,-1\n", "row 1, column sample_every: expected a positive period"),
        (
            "1,1,0,0,1,0.02,1,0.01\n1,2,,,1,0.02,1,0.01\n",
            "row 2, column sample_every: expected nothing behind the first row of a run",
        ),
        ("1,1,0,0,1,0.02,1,1e-9\n", "column sample_every: expected a period with at most 1000000 samples"),
    ],
)
def test_mistakes_of_files_are_named(rows: str, text: str, tmp_path: Path) -> None:
    path = tmp_path / "runs.csv"
    path.write_text("run,segment,q,w,u,dt,measured,sample_every\n" + rows)
    with pytest.raises(ValueError) as error:
        fp.Runs.from_csv(path, joint())
    assert text in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"sample_every": "1 kg"}, "sample_every: expected a unit of time, given 'kg'"),
        ({"sample_every": 0}, "sample_every: expected a positive period in s"),
        ({"sample_every": 2.0}, "sample_every: expected a period of at most the shortest run, 1 s, given 2"),
        ({"sample_every": 1e-8}, "sample_every: expected a period with at most 1000000 samples in 1 s"),
        ({"sample_every": (1, "kg")}, "sample_every: expected"),
        ({"samples": 3}, "samples: expected none beside sample_every"),
        ({"measured": [False] + [True] * 49}, "measured: expected none beside sample_every"),
    ],
)
def test_mistakes_of_regions_are_named(changes: Any, text: str) -> None:
    with pytest.raises((TypeError, ValueError)) as error:
        region(**changes)
    assert text in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"every": None}, "every: expected"),
        ({"every": 0.05}, "every: expected a period of at most the shortest run, 0.04 s"),
        ({"every": [0.01, 0.01]}, "every: expected a period, or increasing instants above zero"),
        ({"every": [0.01, 0.05]}, "every: expected instants within the runs"),
        ({"every": [10, 50, "ms"]}, "every: expected instants within the runs"),
        ({"every": []}, "every: expected a period, or increasing instants above zero"),
    ],
)
def test_mistakes_of_sampling_are_named(arguments: Any, text: str) -> None:
    with pytest.raises((TypeError, ValueError)) as error:
        held([0.02, 0.02]).sampled(**arguments)
    assert text in str(error.value) and "\n" not in str(error.value)


TOML = """
[model]
name = "joint"
states = { q = "rad", w = "rad/s" }
inputs = { u = "N m", T = "K" }
outputs = { q = "rad" }
parameters = { J = "kg m2", b = "N m s/rad" }
constants = { c = { value = 0.01, unit = "1/K" }, T_0 = { value = 293, unit = "K" } }
equations = { q = "w", w = "(u - b*(1 - c*(T - T_0))*w)/J" }

[prior]
J = { mean = 0.05, relative_std = 0.1 }
b = { mean = 0.1, relative_std = 0.1 }

[noise]
q = 0.001

[region]
q = 0.0
w = 0.0
u = [-2, 2]
dt = 0.02

[runs]
segments = 25
sample_every = { value = 2, unit = "ms" }

[runs.profile.u]
kind = "multisine"
harmonics = [1, 3]
bandwidth = [1, 12]

[runs.profile.T]
kind = "given"
t = [0, 1]
values = [293, 303]
"""


def test_files_of_problems_have_clocks_and_profiles(tmp_path: Path) -> None:
    path = tmp_path / "joint.toml"
    path.write_text(TOML)
    found = fp.load_problem(path).run_region
    assert found.sample_every == pytest.approx(0.002)
    assert found.profile == {"u": fp.Multisine((1, 3), bandwidth=(1, 12)), "T": fp.Given([293, 303], t=[0, 1])}


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("segments = 25", "segments = 25\nlead_in = 2", "runs.lead_in: expected none beside runs.sample_every, given 2"),
        ("segments = 25", "segments = 25\nsamples = 2", "runs.samples: expected none beside sample_every"),
        ('kind = "multisine"', 'kind = "chirp"', 'harmonics: expected only for another kind of profile, given with kind = "chirp"'),
        ('kind = "multisine"\nharmonics = [1, 3]\nbandwidth = [1, 12]', 'kind = "ramps"', 'knots: missing, for kind = "ramps"'),
        ("bandwidth = [1, 12]", "bandwidth = [1, 2]", "runs.profile.u.bandwidth: expected room for harmonics 1 to 3"),
        ("runs.profile.T", "runs.profile.S", "runs.profile"),
        ("values = [293, 303]", "values = [293]", "runs.profile.T.t: expected increasing times"),
        ("value = 2, unit", "value = -2, unit", "runs.sample_every"),
    ],
)
def test_mistakes_of_files_of_problems_are_named(old: str, new: str, text: str, tmp_path: Path) -> None:
    path = tmp_path / "joint.toml"
    path.write_text(TOML.replace(old, new))
    with pytest.raises(ConfigError) as error:
        fp.load_problem(path)
    assert text in str(error.value), str(error.value)


NOISY: dict[str, Any] = {
    "white": {},
    "with a memory": {"noise": {"q": fp.Noise(1e-3, colored=fp.GaussMarkov(1e-3, 0.01))}},
    "starts drawn anew": {"initial_state_std": {"w": 0.05}},
    "uncertain": {"uncertain": {"F": 0.02}, "parameters": ["J", "b"]},
}


@pytest.mark.parametrize("changes", NOISY.values(), ids=NOISY)
def test_slopes_hold_whatever_moves_the_samples(changes: Any) -> None:
    """Where samples share an error, each one that is lost changes the rows of all: so none is, when slopes are taken."""
    given = problem(
        region(5, bounds={"dt": (0.013, 0.021)}), joint(friction="tanh(w/w_s)", constants={"w_s": (0.2, "rad/s")}), **changes
    )
    objective = objective_of(given)
    z = np.random.default_rng(2).uniform(0.2, 0.8, (1, 10))
    z[0, 5:] = 0.5  # 17 ms: the last sample is just at the end
    linear = linear_rows(objective, z, None, True, np.random.default_rng(0))
    assert linear is not None
    counts = objective.coordinates.runs(z).measured.sum(axis=1)

    def f(at: Any) -> Any:
        return objective.judged(objective.tried(at[None], None, counts)).matrices[0, 0]

    base = linear.rows[0, 0]
    assert np.allclose(base.T @ base, f(z[0]), rtol=1e-8)
    for j in range(10):
        step = 1e-3 * np.eye(10)[j]
        wanted, product = (f(z[0] + step) - f(z[0] - step)) / 2e-3, base.T @ linear.row_slopes[0, j, 0]
        assert np.allclose(
            product + product.T, wanted, rtol=0, atol=1e-2 * np.abs(wanted).max() + 1e-4 * np.abs(base.T @ base).max()
        )


@pytest.mark.parametrize("seed", range(3))
def test_random_models_with_jumps_and_kinks_are_the_same_when_sampled(seed: int) -> None:
    figures = Figures()
    bench = Bench(crossing_case(seed, "sampling"), figures)
    check_sampling(bench)
    assert not bench.findings and figures.counts["runs compared with parts between samples"] > 0
    assert figures.counts["F of outputs with instants of their own"] > 0
