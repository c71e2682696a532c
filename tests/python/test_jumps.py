"""Trajectories through jumps and along them, and their sensitivities, against SciPy with events and differences over theta."""

from __future__ import annotations

import os
from functools import cache

import numpy as np
import pytest

import fisherpoint as fp
from filippov import NoAnswer, course, derivatives
from jump_cases import CASES, JumpCase
from remembered import remembered

pytestmark = pytest.mark.kernels

COUNT = int(os.environ.get("FISHERPOINT_JUMP_POINTS", "8"))
RTOL = 1e-10


@cache
def case_of(name: str) -> JumpCase:
    return CASES[name]()


def drawn(name: str, count: int, seed: int = 7) -> tuple[fp.Experiments, np.ndarray]:
    x0, u, p, dt = case_of(name).draw(np.random.default_rng(seed), count)
    return fp.Experiments(x0, u, dt), p


def largest_columns(name: str, points: fp.Experiments, p: np.ndarray) -> np.ndarray:
    """Largest size (K, p) of each column on the way, by which its error is measured."""
    case, found = case_of(name), np.zeros(p.shape)
    for share in (0.003, 0.01, 0.03, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0):
        part = fp.Experiments(points.x0, points.u, points.dt * share)
        s = fp.sensitivities(case.model, part, p, rtol=1e-8, jumps="cross").dx_dtheta
        found = np.maximum(found, (np.abs(s) / case.system.size[:, None]).max(axis=1))
    return found


@pytest.mark.long
@pytest.mark.parametrize("name", CASES)
def test_states_and_sensitivities_are_those_of_scipy(name: str) -> None:
    case, (points, p) = case_of(name), drawn(name, COUNT)
    states = fp.simulate(case.model, points, p, rtol=RTOL, jumps="cross")
    done = fp.sensitivities(case.model, points, p, rtol=RTOL, jumps="cross")
    columns, size = largest_columns(name, points, p), case.system.size
    met = 0
    for k in range(COUNT):
        point = points.x0[k], points.u[k], p[k], points.dt[k]
        try:
            beside = remembered(lambda point=point: course(case.system, *point), "course", name, *point)
        except NoAnswer:
            continue
        met += any(m < case.system.jumps for m, _ in beside.met) or (points.x0[k][1] == 0)
        assert states.status[k] == done.status[k] == fp.Status.ok, k
        assert np.max(np.abs(states.x[k] - beside.x) / size) < 1e-8, k
        if k % 2 and COUNT < 20:
            continue
        s, error = remembered(
            lambda point=point, beside=beside: derivatives(case.system, *point, beside), "derivatives", name, *point
        )
        off = np.max((np.abs(done.dx_dtheta[k] - s) - 2 * error) / size[:, None], axis=0)
        assert (off <= 1e-6 * columns[k] + 3e-9 / np.abs(p[k]))[~np.isnan(off)].all(), (k, off, columns[k])
    assert met > 2


@pytest.mark.parametrize("name", ["cylinder", "belt", "sharp_thermostat"])
def test_both_methods_and_all_tolerances_agree(name: str) -> None:
    case, (points, p) = case_of(name), drawn(name, 40)
    fine = fp.sensitivities(case.model, points, p, rtol=1e-11, jumps="cross")
    columns = largest_columns(name, points, p)
    for method in ("RK45", "DOP853"):
        for rtol in (1e-5, 1e-7):
            done = fp.sensitivities(case.model, points, p, rtol=rtol, jumps="cross", method=method)
            both = (done.status == fp.Status.ok) & (fine.status == fp.Status.ok)
            told = (done.status == fine.status) | np.isin(done.status, [fp.Status.on_jump, fp.Status.grazes_jump])
            assert told.all() and np.mean(done.status == fine.status) >= 0.9
            assert np.max(np.abs(done.x - fine.x)[both] / case.system.size) < 10 * rtol
            off = np.max(np.abs(done.dx_dtheta - fine.dx_dtheta) / case.system.size[:, None], axis=1)
            relative = off / (columns + 1e-6)
            assert np.quantile(relative[both], 0.97) < 10 * rtol


def test_a_plan_over_the_prior_crosses_too() -> None:
    """Every node by itself, through jumps and rest, is what the kernel sums."""
    model = fp.HydraulicCylinder()
    prior = fp.GaussianPrior(model.nominal, relative_std=dict.fromkeys(model.nominal, 0.1))
    rule = fp.SparseGaussHermite(2)
    points = fp.Experiments([[0.15, 0.0, 6e6, 1.1e7, 0.0], [0.12, 0.08, 4e6, 1.2e7, 0.4]], [[-0.5], [0.3]], [8e-3, 9e-3])
    done = fp.predictive_covariance(model, points, prior, rule, rtol=1e-9, jumps="cross")
    assert done.status.tolist() == [fp.Status.ok] * 2
    nodes, weights = rule.nodes(prior)
    y = fp.simulate(model, points, model.theta(model.nominal), rtol=1e-10, jumps="cross").y
    for k in range(2):
        every = fp.Experiments(*(np.repeat(of[k : k + 1], len(nodes), axis=0) for of in (points.x0, points.u, points.dt)))
        off = fp.simulate(model, every, nodes, rtol=1e-10, jumps="cross").y - y[k]
        expected = (off.T * weights) @ off / weights.sum()
        scale = np.sqrt(np.diag(expected)) + 1e-7 * np.array([0.5, 1e7, 1e7, 1.0])
        assert np.max(np.abs(done.covariance[k] - expected) / np.outer(scale, scale)) < 1e-5


def test_starts_on_a_jump() -> None:
    """It sticks, breaks away, or is named."""
    cart = fp.SymbolicModel(["v", "a*u - c*sign(v)"], ["s"], {"s": "m", "v": "m/s"}, {"u": "1"}, {"a": "m/s2", "c": "m/s2"})
    points = fp.Experiments([[0.0, 0.0]] * 3, [[0.5], [2.0], [-2.0]], [1.0] * 3)
    done = fp.sensitivities(cart, points, [1.0, 1.0], jumps="cross")
    assert not done.status.any()
    np.testing.assert_allclose(done.y[:, 0], [0.0, 0.5, -0.5], atol=1e-12)
    np.testing.assert_allclose(done.dy_dtheta[:, 0], [[0, 0], [1.0, -0.5], [-1.0, 0.5]], atol=1e-10)
    # Both sides lead away: two trajectories.
    away = fp.SymbolicModel(["sign(x) + 0*p"], ["x"], {"x": "1"}, {"u": "1"}, {"p": "1"})
    one = fp.Experiments([[0.0]], [[0.0]], [1.0])
    assert fp.simulate(away, one, [1.0], jumps="cross").status[0] == fp.Status.on_jump
    with pytest.raises(ValueError, match="expected starts off the switching surface x = 0"):
        fp.simulate(away, one, [1.0], jumps="exclude")


@pytest.mark.filterwarnings("ignore:.* expected its natural size")
def test_what_has_no_derivative_is_named() -> None:
    cart = fp.SymbolicModel(["v", "a*u - c*sign(v)"], ["s"], {"s": "m", "v": "m/s"}, {"u": "1"}, {"a": "m/s2", "c": "m/s2"})
    turns = fp.Experiments([[0.0, 2.0]], [[-1.0]], [0.5])  # at its end
    assert fp.simulate(cart, turns, [3.0, 1.0], jumps="cross").status[0] == fp.Status.ok
    assert fp.sensitivities(cart, turns, [3.0, 1.0], jumps="cross").status[0] == fp.Status.on_jump
    # h = x - t^2 / 2 + t - 1/2 + x0: the parabola touches zero at t = 1.
    grazing = fp.SymbolicModel(["w", "1", "p*heaviside(-x)"], ["z"], dict.fromkeys("xwz", "1"), {"u": "1"}, {"p": "1"})
    start = fp.Experiments([[0.5, -1.0, 0.0]], [[0.0]], [2.0])
    assert fp.simulate(grazing, start, [1.0], jumps="cross").status[0] == fp.Status.grazes_jump
    crossing = fp.Experiments([[0.5 - 1e-12, -1.0, 0.0]], [[0.0]], [2.0])
    assert fp.sensitivities(grazing, crossing, [1.0], jumps="cross").status[0] == fp.Status.grazes_jump
    clear = fp.Experiments([[0.5 + 1e-3, -1.0, 0.0], [0.5 - 1e-3, -1.0, 0.0]], [[0.0]] * 2, [2.0] * 2)
    assert fp.sensitivities(grazing, clear, [1.0], jumps="cross").status.tolist() == [0, 0]
    # The twisting algorithm of sliding mode control: infinitely many crossings by a finite time.
    twist = fp.SymbolicModel(["v", "-p*sign(x) - sign(v)"], ["x"], {"x": "1", "v": "1"}, {"u": "1"}, {"p": "1"})
    done = fp.simulate(twist, fp.Experiments([[1.0, 0.0 + 1e-3]], [[0.0]], [20.0]), [3.0], jumps="cross")
    assert done.status[0] in (fp.Status.chatters, fp.Status.two_jumps, fp.Status.grazes_jump)


def test_switches_at_known_times_are_crossed_in_any_case() -> None:
    """A pulse by a clock: no candidate is lost for it, also where jumps are excluded."""
    pulse = fp.SymbolicModel(["1", "-x/p + where(t < 0.3, u, 0)"], ["x"], {"t": "s", "x": "1"}, {"u": "1"}, {"p": "s"})
    points = fp.Experiments([[0.0, 0.0], [0.0, 0.0]], [[1.0], [2.0]], [1.0, 0.2])
    done = fp.sensitivities(pulse, points, [0.5], rtol=1e-10)
    assert not done.status.any()
    p, rest = 0.5, 0.7
    x = p * (1 - np.exp(-0.3 / p)) * np.exp(-rest / p)
    assert done.x[0, 1] == pytest.approx(x, rel=1e-9)
    slope = ((1 - np.exp(-0.3 / p)) - 0.3 / p * np.exp(-0.3 / p)) * np.exp(-rest / p) + x * rest / p**2
    assert done.dx_dtheta[0, 1, 0] == pytest.approx(slope, rel=1e-8)
    prior = fp.GaussianPrior({"p": 0.5}, std={"p": 0.05})
    assert not fp.predictive_covariance(pulse, points, prior, fp.SparseGaussHermite(2)).status.any()


def test_conditions_that_read_another_condition_are_not_crossed() -> None:
    nested = fp.SymbolicModel(
        ["where(x > 0, 1, 2)*p", "where(y - sign(x) > 0, 1, -1)"], ["y"], {"x": "1", "y": "1"}, {"u": "1"}, {"p": "1"}
    )
    assert set(nested.jumps) - set(nested.crossable) == {"x"}
    done = fp.simulate(nested, fp.Experiments([[-1.0, 0.3]], [[0.0]], [2.0]), [1.0], jumps="cross")
    assert done.status[0] == fp.Status.met_jump


def test_a_record_goes_through_rest() -> None:
    """Piece by piece as in one trajectory where the input is held."""
    model = CASES["motor"]().model
    theta = [1.0, 0.2, 0.7, 0.4, 0.05, 0.1]
    t = np.linspace(0.0, 2.0, 81)
    u = np.where(t < 0.5, 2.0, np.where(t < 1.2, 0.0, -2.0))
    done = fp.simulate_record(model, t, u, theta, [0.0, 0.0], rtol=1e-10)
    assert done.status == fp.Status.ok
    parts = fp.simulate(model, fp.Experiments([[0.0, 0.0]], [[2.0]], [0.5]), theta, rtol=1e-11, jumps="cross").x
    np.testing.assert_allclose(done.x[20], parts[0], atol=1e-8)
    rest = fp.simulate(model, fp.Experiments(parts, [[0.0]], [0.7]), theta, rtol=1e-11, jumps="cross").x
    np.testing.assert_allclose(done.x[48], rest[0], atol=1e-8)
    assert abs(rest[0, 1]) < 1e-10
    back = fp.simulate(model, fp.Experiments(rest * [1, 0], [[-2.0]], [0.8]), theta, rtol=1e-11, jumps="cross").x
    np.testing.assert_allclose(done.x[80], back[0], atol=1e-8)


@pytest.mark.parametrize("name", ["cylinder", "saturated"])
def test_the_bits_do_not_depend_on_threads_and_neighbours(name: str) -> None:
    case, (points, p) = case_of(name), drawn(name, 60)
    once = fp.sensitivities(case.model, points, p, jumps="cross", threads=1)
    for threads in (2, 5):
        again = fp.sensitivities(case.model, points, p, jumps="cross", threads=threads)
        assert all(np.array_equal(a, b) for a, b in zip(once, again, strict=True))
    order = np.random.default_rng(0).permutation(60)
    other = fp.sensitivities(case.model, points[order], p[order], jumps="cross")
    assert all(np.array_equal(a[order], b) for a, b in zip(once, other, strict=True))


def test_the_bits_of_the_built_in_cylinder_do_not_depend_on_neighbours() -> None:
    model, rng, count = fp.HydraulicCylinder(), np.random.default_rng(0), 1000
    lower, upper = np.array([[0.15, -0.06, 7e6, 12e6, -0.3], [0.15, 0.06, 10e6, 19e6, 0.1]])
    points = fp.Experiments(rng.uniform(lower, upper, (count, 5)), rng.uniform(-0.3, 0.5, (count, 1)), np.full(count, 5e-3))
    once, order = fp.sensitivities(model, points, model.nominal), rng.permutation(count)
    assert (once.status == fp.Status.ok).all() and (points.x0[:, 1] * once.x[:, 1] < 0).sum() > 100
    other = fp.sensitivities(model, points[order], model.nominal)
    assert all(np.array_equal(a[order], b) for a, b in zip(once, other, strict=True))
