"""Inputs with a dead time: the language, states and derivatives of runs and records, and what is refused."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from check_delay import by_hand, check_delay
from checks import Bench
from crossing_case import crossing_case
from figures import Figures
from fisherpoint.data.pieces import pieces
from fisherpoint.estimation.response import RecordResponse
from fisherpoint.information.run_tangents import run_tangents, tangents_from
from fisherpoint.models.toml_to_model import model_from_toml
from fisherpoint.points.settings import Integration
from oracle import Floats

pytestmark = pytest.mark.kernels

JOINT = {
    "states": {"q": ("rad", 1.0), "w": ("rad/s", 1.0)},
    "inputs": {"u": "N m"},
    "parameters": {"J": "kg m2", "c": "N m", "d": "N m s", "g": "N m", "tau": "s"},
    "outputs": {"q": "rad", "w": "rad/s"},
    "check_units": False,
}
THETA = np.array([0.05, 0.6, 0.1, 0.3, 0.033])


def joint(u: str = "delay(u, tau)", **changes: Any) -> fp.SymbolicModel:
    """A robot joint with gravity and sharp friction, at which it sticks, and a kink."""
    return fp.SymbolicModel(["w", f"({u} - c*sign(w) - d*w - g*sin(q) - 0.2*abs(q))/J"], ["q", "w"], **(JOINT | changes))


def torques(count: int = 3, segments: int = 12, seed: int = 0) -> fp.Runs:
    rng = np.random.default_rng(seed)
    u = 1.5 * rng.standard_normal((count, segments, 1))
    return fp.Runs(np.zeros((count, 2)), u, np.full(segments, 0.02), before=[0.4])


def one_sided(model: fp.Model, runs: fp.Runs, theta: Floats, step: float = 1e-6) -> Floats:
    """dy/dtheta (K, N, n_y, p) towards larger parameters, up to the third order in the step."""

    def y(by: Floats) -> Floats:
        return fp.simulate(model, runs, theta + by, rtol=1e-12).y

    steps = step * np.diag(np.maximum(np.abs(theta), 0.1))
    return np.stack([(-3 * y(0 * e) + 4 * y(e) - y(2 * e)) / (2 * e.sum()) for e in steps], axis=-1)


# --- runs --------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("tau", [0.0, 0.02, 0.04, 0.06, 0.033, 0.007, 0.1, 0.24, 5.0])
def test_states_and_derivatives_are_exact_also_at_nice_numbers(tau: float) -> None:
    theta, runs = np.append(THETA[:4], tau), torques()
    if tau == 0.0:
        runs = fp.Runs(runs.x0, runs.u, runs.dt)  # else friction lets go in the very start, where there is no derivative
    done, plain = fp.simulate(joint(), runs, theta, rtol=1e-12), joint("u")
    for k in range(len(runs)):
        one = fp.Runs(runs.x0[[k]], runs.u[[k]], runs.dt[[k]], before=runs.u[k, :1] if runs.before is None else runs.before[[k]])
        divided = by_hand(one, tau)
        expected = fp.simulate(plain, divided, theta, rtol=1e-12)
        ends = [int(np.argmin(np.abs(divided.t[0] - t))) for t in runs.t[k]]
        np.testing.assert_allclose(done.x[k, 1:], expected.x[0, 1:][ends], rtol=0, atol=1e-10)
    slopes = fp.sensitivities(joint(), runs, theta, rtol=1e-9)
    assert not slopes.status.any()
    expected_slopes = one_sided(joint(), runs, theta)
    size = np.abs(expected_slopes).max(axis=(0, 1, 2)) + 1e-4
    np.testing.assert_array_less(np.abs(slopes.dy_dtheta - expected_slopes).max(axis=(0, 1, 2)) / size, 1e-6)
    if 0 < tau < 0.2:
        assert size[4] > 1


def test_threads_and_neighbours_change_no_bit() -> None:
    runs = torques(count=9)
    one, two = (fp.sensitivities(joint(), runs, THETA, threads=threads) for threads in (1, 2))
    alone = fp.sensitivities(joint(), runs[4], THETA)
    for name in ("x", "y", "dx_dtheta", "dy_dtheta"):
        assert (getattr(one, name) == getattr(two, name)).all()
        assert (getattr(one, name)[4] == getattr(alone, name)[0]).all()


def test_each_run_has_its_own_dead_time_and_its_own_length() -> None:
    runs = torques(count=3)
    dt = runs.dt.copy()
    dt[1, 7:] = 0.0
    runs = fp.Runs(runs.x0, runs.u, dt, before=runs.before)
    theta = np.tile(THETA, (3, 1))
    theta[:, 4] = 0.0, 0.05, 0.04
    together = fp.sensitivities(joint(), runs, theta)
    for k in range(3):
        alone = fp.sensitivities(joint(), runs[k], theta[k])
        for one, other in zip(together, alone, strict=True):
            assert (one[k] == other[0]).all()
    assert together.reached.tolist() == [12, 7, 12] and not together.dy_dtheta[1, 7:].any()


@pytest.mark.parametrize("taus", [(0.1, 0.1), (0.2, 0.1), (0.05, 0.15), (0.0, 0.0), (0.13, 0.07)])
def test_switches_that_come_together_have_the_derivative_of_the_later_one(taus: tuple[float, float]) -> None:
    """Two inputs by one dead time, one by another, and one without, in products: the order counts."""
    rate = "-k*x*delay(a, tau)*delay(b, sigma) + w*delay(a, tau) - delay(c, tau)*w"
    quantities = dict.fromkeys(("k", "tau", "sigma"), "1")
    model = fp.SymbolicModel([rate], ["x"], {"x": "1"}, dict.fromkeys("abcw", "1"), quantities, {"x": "1"}, check_units=False)
    rng, theta = np.random.default_rng(1), np.array([1.0, *taus])
    runs = fp.Runs([[1.0]], rng.standard_normal((1, 8, 4)), np.full(8, 0.1), before=rng.standard_normal(4))
    done, expected = fp.sensitivities(model, runs, theta, rtol=1e-10), one_sided(model, runs, theta)
    np.testing.assert_allclose(done.dy_dtheta, expected, atol=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize("tau", [0.0, 0.1, 0.13, 0.25])
@pytest.mark.parametrize(
    ("rates", "resets"),
    [
        (["v", "-k*x"], {"{u} > 0.5": {"x": "a*x"}}),  # set anew by the switch itself
        (["v", "{u} - k"], {"x < 0": {"v": "-a*v"}}),  # a ball that bounces
        (["v", "-k*x + {u}*latch(x < a, x > 0.8)"], {}),
        (["v", "-k*x - v + latch({u} > 1, {u} < -0.5) + a*v"], {}),
        (["v", "-k*x + where({u} > x, 1, a)"], {}),
        (["v - a*x", "-k*x - max(v - {u}, 0) - abs(v)*v"], {}),
    ],
)
def test_resets_relays_and_branches_switch_late_too(rates: list[str], resets: dict[str, Any], tau: float) -> None:
    late = "delay(u, tau)"
    model = fp.SymbolicModel(
        [rate.format(u=late) for rate in rates],
        ["x", "v"],
        {"x": "1", "v": "1"},
        {"u": "1"},
        dict.fromkeys(("k", "a", "tau"), "1"),
        {"x": "1", "v": "1"},
        resets={when.format(u=late): values for when, values in resets.items()},
        check_units=False,
    )
    runs = fp.Runs([[0.6, 0.4]], np.random.default_rng(5).normal(0, 1.5, (1, 8, 1)), np.full(8, 0.1), before=[0.1])
    theta = np.array([3.0, 0.7, tau])
    done, expected = fp.sensitivities(model, runs, theta, rtol=1e-9), one_sided(model, runs, theta)
    assert done.status[0] == fp.Status.ok
    size = np.abs(expected).max(axis=(0, 1, 2)) + 1e-3
    np.testing.assert_array_less(np.abs(done.dy_dtheta - expected).max(axis=(0, 1, 2)) / size, 1e-5)


@pytest.mark.parametrize("seed", range(6))
def test_random_models_with_jumps_and_kinks(seed: int) -> None:
    figures = Figures()
    bench = Bench(crossing_case(seed, "delay"), figures)
    check_delay(bench)
    assert not bench.findings and figures.counts["runs compared with segments by hand"] > 0


def test_a_start_at_rest_is_that_of_the_input_before() -> None:
    model = fp.SymbolicModel(
        ["k*delay(u, tau) - x"], ["x"], {"x": "1"}, {"u": "1"}, {"k": "1", "tau": "1"}, {"x": "1"}, check_units=False
    )
    runs = fp.Runs([[0.0]], [[[2.0], [2.0]]], [0.1, 0.1], rest=fp.Rest({"u": 0.5}))
    done = fp.simulate(model, runs, [2.0, 0.15], rtol=1e-10)
    np.testing.assert_allclose(done.x[0, :, 0], [1.0, 1.0, 4.0 - 3.0 * np.exp(-0.05)], rtol=1e-9)
    measured = fp.VirtualRig(model, [2.0, 0.15], {"x": 0.0}, initial_state_std={"x": 1e-12}).measure(runs)
    np.testing.assert_allclose(measured.y[0, :, 0], done.y[0, :, 0], rtol=1e-7)
    controlled = fp.Runs([[1.0]], [[[2.0], [2.0]]], [0.1, 0.1], rest=fp.Rest(hold=["x"], solve=["u"]))
    with pytest.raises(ValueError, match=r"rest\.solve: expected inputs without a dead time, given 'u'"):
        fp.simulate(model, controlled, [2.0, 0.15])


def test_points_feel_no_dead_time_but_runs_of_one_segment_do_where_the_input_before_is_given() -> None:
    point = fp.Experiments([[0.1, 0.5]], [[1.0]], [0.1])
    plain = fp.sensitivities(joint("u"), point, THETA)
    late = fp.sensitivities(joint(), point, THETA)
    np.testing.assert_allclose(late.x, plain.x, rtol=1e-6)
    assert not late.dy_dtheta[..., 4].any()
    runs = fp.Runs(point.x0, [[[1.0]]], [0.1], before=[0.0])
    assert abs(fp.sensitivities(joint(), runs, THETA).dy_dtheta[..., 4]).max() > 0.1


def test_limits_are_named_where_late_inputs_break_them() -> None:
    model = joint().within("abs(w) < 0.2")
    runs = fp.Runs([[0.0, 0.0]], [[[2.0], [0.0], [0.0]]], [0.02] * 3, before=[0.0])
    done = fp.simulate(model, runs, THETA)
    assert done.status[0] == fp.Status.left_domain and done.reached[0] == 2
    assert fp.broken_limits(model, runs, THETA) == ("abs(w) < 0.2",)


# --- designs -----------------------------------------------------------------------------------------------------------------


def test_tangents_from_the_middle_of_a_run_are_those_of_the_whole() -> None:
    prior = fp.GaussianPrior(
        dict(zip(JOINT["parameters"], THETA.tolist(), strict=True)), relative_std=dict.fromkeys(JOINT["parameters"], 0.1)
    )
    region = fp.RunRegion({"q": 0, "w": 0, "u": (-3, 3), "dt": 0.02}, segments=12)
    problem = fp.DesignProblem(joint(), prior, region, noise={"q": 1e-3, "w": 1e-2})
    runs, settings = torques(count=2), Integration(1e-8)
    theta = np.tile(problem.theta, (2, 1))
    base = run_tangents(problem, runs, theta, settings)
    u = runs.u.copy()
    u[:, 6] += 0.5
    changed = fp.Runs(runs.x0, u, runs.dt, before=runs.before)
    found = tangents_from(problem, base, np.arange(2), changed, theta, settings)
    whole = run_tangents(problem, changed, theta, settings, outputs_alone=True)
    np.testing.assert_allclose(found.dy, whole.dy, atol=1e-6 * np.abs(whole.dy).max())
    np.testing.assert_allclose(found.x, whole.x, atol=1e-7)
    assert not (found.dy[:, 6:] == base.dy[:, 6:]).all() and (found.dy[:, :6] == base.dy[:, :6]).all()


def test_runs_of_other_lengths_go_on_from_their_middle_too() -> None:
    prior = fp.GaussianPrior(
        dict(zip(JOINT["parameters"], THETA.tolist(), strict=True)), relative_std=dict.fromkeys(JOINT["parameters"], 0.1)
    )
    region = fp.RunRegion({"q": 0, "w": 0, "u": (-3, 3), "dt": 0.02}, segments=12)
    problem = fp.DesignProblem(joint(), prior, region, noise={"q": 1e-3, "w": 1e-2})
    runs, settings, theta = torques(count=2), Integration(1e-8), np.tile(problem.theta, (2, 1))
    dt = runs.dt.copy()
    dt[1, 9:] = 0.0
    runs = fp.Runs(runs.x0, runs.u, dt, before=runs.before)
    u = runs.u.copy()
    u[0, 3], u[1, 7] = 1.0, -1.0
    changed = fp.Runs(runs.x0, u, dt, before=runs.before)
    base = run_tangents(problem, runs, theta, settings)
    found = tangents_from(problem, base, np.arange(2), changed, theta, settings, outputs_alone=False)
    whole = run_tangents(problem, changed, theta, settings)
    for name in ("x", "y", "dx", "dy"):
        one, other = getattr(found, name), getattr(whole, name)
        np.testing.assert_allclose(one, other, atol=1e-6 * np.abs(other).max())


# --- records -----------------------------------------------------------------------------------------------------------------


def record(tau: float, samples: int = 40) -> tuple[fp.Record, Floats]:
    """A record without noise, and its states."""
    rng = np.random.default_rng(2)
    t, u = 0.02 * np.arange(samples), 1.5 * rng.standard_normal((samples, 1))
    theta = np.append(THETA[:4], tau)
    done = fp.simulate_record(joint(), t, u, theta, [0.0, 0.0], before={"u": 0.4}, rtol=1e-9)
    return fp.Record(t, u, done.y, x0={"q": 0.0, "w": 0.0}, before=[0.4]), done.x


@pytest.mark.parametrize("tau", [0.0, 0.033, 0.04, 0.5])
def test_records_are_runs_and_parts_of_them_know_what_came_before(tau: float) -> None:
    one, x = record(tau)
    theta = np.append(THETA[:4], tau)[None]
    runs = fp.Runs([[0.0, 0.0]], one.u[None, :-1], np.diff(one.t), before=[0.4])
    done = fp.sensitivities(joint(), runs, theta[0], rtol=1e-9)
    np.testing.assert_allclose(x[1:], done.x[0, 1:], atol=1e-12)
    response = RecordResponse(joint(), one, range(5), 1e-9)(theta, np.zeros((1, 2)))
    if done.status[0] == fp.Status.ok:  # not where friction lets go in the very start
        np.testing.assert_allclose(response.dy[0, 1:], done.dy_dtheta[0], atol=1e-12)
    for part, first in ((one[9:30], 9), (one[4:][5:26], 9), (one[:5], 0)):
        found = RecordResponse(joint(), part, range(5), 1e-9)(theta, x[first : first + 1])
        np.testing.assert_allclose(found.y[0], one.y[first : first + len(part)], atol=1e-9)


def test_outputs_read_the_input_that_has_come_at_their_sample() -> None:
    quantities: dict[str, Any] = {"parameters": {"k": "1/s", "tau": "s"}, "outputs": {"y": "1"}, "check_units": False}
    model = fp.SymbolicModel(["-k*x"], ["x + delay(u, tau)"], {"x": "1"}, {"u": "1"}, **quantities)
    done = fp.simulate_record(model, [0, 0.1, 0.2, 0.3], [1.0, 2.0, 3.0, 4.0], [1.0, 0.1], [0.0], before=[9.0])
    assert done.y[:, 0].tolist() == [9.0, 1.0, 2.0, 3.0]


def test_the_dead_time_of_a_joint_is_found_to_a_tenth_of_a_sample() -> None:
    rng, samples = np.random.default_rng(1), 1500
    model = joint()
    t = 1e-3 * np.arange(samples)
    u = 1.2 * np.sin(2 * np.pi * (0.8 + 0.8 * t) * t) + 0.6 * np.sign(np.sin(2 * np.pi * 2.3 * t))
    true = [*THETA[:4], 0.005]
    q = fp.simulate_record(model, t, u, true, [0.0, 0.0], rtol=1e-8).y[:, :1]
    y = np.column_stack([q + 1e-4 * rng.standard_normal(q.shape), np.full(samples, np.nan)])
    start = {"J": 0.06, "c": 0.5, "d": 0.12, "g": 0.35, "tau": 0.002}
    fit = fp.estimate(model, fp.Record(t, u, y, x0={"q": 0.0, "w": 0.0}), start=start)
    error = abs(fit.estimate["tau"] - 0.005)
    assert error < 1e-4 and error < 4 * fit.standard_errors["tau"] < 4e-5


# --- the language ------------------------------------------------------------------------------------------------------------


def test_models_keep_their_dead_times() -> None:
    model = joint(nominal={"tau": 0.005})
    assert model.delays == {"u": "tau"} and "delay(u, tau)" in str(model) and "delay" in model._repr_latex_()
    for other in (model_from_toml(model.to_toml()), pickle.loads(pickle.dumps(model)), model.fix(J=1.0).estimate("J").symbolic()):
        assert other.delays == model.delays
    assert model_from_toml(model.to_toml()) == model == pickle.loads(pickle.dumps(model)) != joint("u", nominal={"tau": 0.005})
    assert model.fix(tau=0.01).delays == {"u": "tau"} and joint("delay(u, 0.01)").delays == {"u": 0.01}
    for other in (model.free_start("q"), model.within("abs(q) < 1"), model.free_start("q").fix(c=0.0)):
        assert other.delays == {"u": "tau"} and "delay(u, tau)" in other.to_toml()
    assert model.least["tau"] == 0.0 and "tau" in model.reaches and model.reaches["tau"] == ("q", "w") and not model.idle


def test_functions_of_python_delay_inputs_too() -> None:
    @fp.model(
        states={"x": "1"}, inputs={"u": "1", "w": "1"}, parameters={"k": "1/s", "tau": "s"}, outputs={"x": "1"}, check_units=False
    )
    def late(x: Any, u: Any, p: Any) -> Any:
        return [fp.math.delay(u.u, p.tau) - p.k * x.x + fp.math.delay(u.w, 0.1)], [x.x]

    assert late.delays == {"u": "tau", "w": 0.1}


@pytest.mark.parametrize(
    ("f", "g", "message"),
    [
        (
            "delay(x, tau)",
            "x",
            r"equations\.x: expected an input in delay\(\), given the state x: states are delayed in outputs",
        ),
        ("delay(2*u, tau)", "x", r"equations\.x: column 1: expected delay\(u, tau\) with an input and a parameter"),
        ("delay(u, -1)", "x", r"expected delay\(u, tau\) with an input"),
        ("delay(u, k*tau)", "x", r"expected delay\(u, tau\) with an input"),
        ("delay(u)", "x", r"expected delay\(u, tau\) with an input"),
        ("delay(u, past)", "x", r"equations\.x: expected a dead time of u of at least 0 s, given -1"),
        ("delay(u, tau) + u", "x", r"equations\.x: expected delay\(u, tau\) wherever u stands, given u alone: declare a second"),
        ("delay(u, tau)", "x + u", r"equations\.y: expected delay\(u, tau\) wherever u stands, given u alone"),
        ("delay(u, tau)", "x + delay(u, k)", r"equations\.y: expected one dead time of u, given tau and k: declare a second"),
        ("delay(k, tau)", "x", r"equations\.x: expected an input in delay\(\), u; given 'k'"),
        ("delay(u, x)", "x", r"equations\.x: expected a parameter, a known constant or a number as dead time of u, given 'x'"),
    ],
)
def test_what_cannot_be_delayed_is_refused(f: str, g: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        fp.SymbolicModel([f], [g], {"x": "1"}, {"u": "1"}, {"k": "1", "tau": "1"}, {"y": "1"}, constants={"past": (-1.0, "1")})


def test_what_knows_no_past_refuses_dead_times() -> None:
    with pytest.raises(ValueError, match=r"equations\.y: expected no delay\(\) in a model without states"):
        fp.SymbolicModel([], ["k*delay(u, tau)"], {}, {"u": "1"}, {"k": "1", "tau": "1"}, {"y": "1"})
    with pytest.raises(ValueError, match=r"model: expected one without delay\(\), as windows do not know the inputs before"):
        pieces(record(0.04)[0], joint(), length=5)
    with pytest.raises(ValueError, match=r"delay: expected an input alone"):

        @fp.model(states={"x": "1"}, inputs={"u": "1"}, parameters={"tau": "s"})
        def late(x: Any, u: Any, p: Any) -> Any:
            return [fp.math.delay(2 * u.u, p.tau)], [x.x]


def test_units_of_dead_times_are_those_of_a_time() -> None:
    with pytest.warns(UserWarning, match=r"tau in m, which is no time"):
        fp.SymbolicModel(["delay(u, tau)"], ["x"], {"x": "m"}, {"u": "m/s"}, {"tau": "m"}, {"x": "m"})


def test_dead_times_below_zero_have_no_value() -> None:
    theta = np.append(THETA[:4], -0.001)
    with pytest.raises(ValueError, match=r"tau: expected a dead time of at least 0 s, given -0\.001"):
        fp.simulate(joint(), torques(), theta)
    one, _ = record(0.04)
    response = RecordResponse(joint(), one, range(5))(theta[None], np.zeros((1, 2)))
    assert response.status[0] == fp.Status.left_domain


# --- files -------------------------------------------------------------------------------------------------------------------


def test_files_keep_the_inputs_before(tmp_path: Any) -> None:
    runs = fp.Runs.join([torques(count=2), fp.Runs([[0.0, 0.0]], [[1.0, 2.0]], 0.1)])
    runs.to_csv(tmp_path / "runs.csv", joint())
    assert fp.Runs.from_csv(tmp_path / "runs.csv", joint()) == runs != fp.Runs(runs.x0, runs.u, runs.dt, runs.measured)
    assert pickle.loads(pickle.dumps(runs)) == runs and runs[2].before is not None
    data = fp.Measurements(runs, np.where(runs.measured[..., None], 0.5, np.nan) * np.ones(2))
    data.to_csv(tmp_path / "measured.csv", joint())
    assert fp.Measurements.from_csv(tmp_path / "measured.csv", joint()).points == runs
    one, _ = record(0.04)
    one.to_csv(tmp_path / "record.csv", joint())
    part = one[9:30]
    part.to_csv(tmp_path / "part.csv", joint("u"))
    with pytest.raises(ValueError, match=r"before: expected one input before the record, given several"):
        part.to_csv(tmp_path / "part.csv", joint())
    fit = fp.estimate(
        joint().fix(J=0.05, c=0.6, d=0.1, g=0.3), part, start={"tau": 0.04, "x0_q": 0.0, "x0_w": 0.0}, noise={"q": 1e-3, "w": 1e-2}
    )
    fit.save(tmp_path / "fit")
    kept = fp.Fit.load(tmp_path / "fit").data[0]
    assert isinstance(kept, fp.Record) and kept.before is not None and (kept.before == part.before).all()
    again = fp.Record.from_csv(tmp_path / "record.csv", joint())
    assert again.before is not None and again.before.tolist() == [0.4] and again.x0 == one.x0


@pytest.mark.parametrize("before", [[1.0, 2.0], [[0.0, 1.0]], [[-1.0, 1.0], [-2.0, 1.0]], [np.nan], []])
def test_inputs_before_a_record_have_times_before_it(before: Any) -> None:
    with pytest.raises(ValueError, match=r"before: expected"):
        fp.Record([0.0, 1.0], [1.0, 1.0], [[1.0, 1.0]] * 2, before=before)


@pytest.mark.parametrize("before", [[1.0, 2.0], "u", [np.inf], {"u": 1.0}])
def test_inputs_before_are_one_for_each(before: Any) -> None:
    with pytest.raises(ValueError, match=r"before: expected finite inputs of shape \(1, 1\), or rows of NaN"):
        fp.Runs([[0.0, 0.0]], [[1.0]], 0.1, before=before)
