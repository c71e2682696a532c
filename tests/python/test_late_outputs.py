"""Outputs that show the states as they were before: the language, runs, points and records, designs, and what is refused."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from check_late import check_late, with_ends
from checks import Bench
from crossing_case import crossing_case
from figures import Figures
from fisherpoint.data.pieces import pieces
from fisherpoint.estimation.response import RecordResponse
from fisherpoint.information.run_tangents import run_tangents, tangents_from
from fisherpoint.models.toml_to_model import model_from_toml
from fisherpoint.points.settings import Integration
from oracle import Floats
from test_dead_time import JOINT, THETA, one_sided

pytestmark = pytest.mark.kernels

LATE = ("delay(q, tau)", "w", "delay(w, tau)*delay(q, tau) + c")


def joint(g: tuple[str, ...] = LATE, u: str = "u", **changes: Any) -> fp.SymbolicModel:
    """A robot joint with gravity and sharp friction, at which it sticks, and a kink."""
    given = JOINT | {"outputs": {"q": "rad", "w": "rad/s", "z": "1"}} | changes
    return fp.SymbolicModel(["w", f"({u} - c*sign(w) - d*w - g*sin(q) - 0.2*abs(q))/J"], list(g), **given)


def torques(count: int = 3, segments: int = 12, before: list[float] | None = None) -> fp.Runs:
    u = 1.5 * np.random.default_rng(0).standard_normal((count, segments, 1))
    return fp.Runs(np.zeros((count, 2)), u, np.full(segments, 0.02), before=before)


def assert_derivatives(model: fp.Model, runs: fp.Points, theta: Floats, share: float = 1e-6, step: float = 1e-6) -> Floats:
    """Compare with differences towards larger parameters, each column in its size; these."""
    done, expected = fp.sensitivities(model, runs, theta, rtol=1e-9), one_sided(model, runs, theta, step)
    assert not done.status.any()
    size = np.abs(expected).max(axis=tuple(range(expected.ndim - 1))) + 1e-3
    error = np.abs(done.dy_dtheta - expected).max(axis=tuple(range(expected.ndim - 1)))
    np.testing.assert_array_less(error / size, share)
    return size


# --- runs --------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("tau", [0.0, 0.02, 0.04, 0.033, 0.007, 0.1, 0.24, 5.0, 0.04 + 1e-10])
def test_outputs_and_derivatives_are_exact_also_at_nice_numbers(tau: float) -> None:
    theta, runs, plain = np.append(THETA[:4], tau), torques(), joint(("q", "w", "w*q + c"))
    done = fp.simulate(joint(), runs, theta, rtol=1e-12)
    for k in range(len(runs)):
        shown = runs.t[k] - tau
        divided = with_ends(runs[k], shown)
        fine = fp.simulate(plain, divided, theta, rtol=1e-12)
        at = [int(np.argmin(abs(np.append(0.0, divided.t[0]) - t))) for t in shown]
        q, w = fine.x[0, at].T
        expected = np.column_stack([q, done.x[k, 1:, 1], w * q + theta[1]])
        np.testing.assert_allclose(done.y[k], expected, rtol=0, atol=1e-10)
    size = assert_derivatives(joint(), runs, theta)
    assert (size[4] > 1) == (tau < 0.2)


def test_threads_and_neighbours_change_no_bit() -> None:
    runs = torques(count=9)
    one, two = (fp.sensitivities(joint(), runs, THETA, threads=threads) for threads in (1, 2))
    alone = fp.sensitivities(joint(), runs[4], THETA)
    for name in ("x", "y", "dx_dtheta", "dy_dtheta"):
        assert (getattr(one, name) == getattr(two, name)).all()
        assert (getattr(one, name)[4] == getattr(alone, name)[0]).all()


def test_each_run_has_its_own_delay_and_its_own_length() -> None:
    runs = torques(count=3)
    dt = runs.dt.copy()
    dt[1, 7:] = 0.0
    runs = fp.Runs(runs.x0, runs.u, dt)
    theta = np.tile(THETA, (3, 1))
    theta[:, 4] = 0.0, 0.05, 0.033
    together = fp.sensitivities(joint(), runs, theta)
    for k in range(3):
        alone = fp.sensitivities(joint(), runs[k], theta[k])
        for one, other in zip(together, alone, strict=True):
            assert (one[k] == other[0]).all()
    assert together.reached.tolist() == [12, 7, 12] and not together.dy_dtheta[1, 7:].any()


@pytest.mark.parametrize("tau", [0.0, 0.033, 0.04])
@pytest.mark.parametrize("g", [LATE, ("delay(q, 0.011)", "delay(w, tau)", "delay(q, c)"), ("delay(q, tau)", "w + u", "q")])
def test_inputs_may_be_late_by_the_same_time(g: tuple[str, ...], tau: float) -> None:
    """The bus of the sensor is that of the actuator, or sensors have delays of their own."""
    own = tuple(text.replace("u", "delay(u, tau)") if text == "w + u" else text for text in g)
    assert_derivatives(joint(own, u="delay(u, tau)"), torques(before=[0.4]), np.append(THETA[:4], tau))


@pytest.mark.parametrize("tau", [0.0, 0.1, 0.13, 0.25])
@pytest.mark.parametrize(
    ("rates", "resets"),
    [
        (["v", "u - k"], {"x < 0": {"v": "-a*v"}}),  # a ball that bounces
        (["v", "-k*x + u*latch(x < a, x > 0.8)"], {}),
        (["v", "-k*x - v + latch(x > 0.5, x < 0.2) + a*v"], {}),
        (["v", "-k*x - 2*sign(v) + u"], {}),
        (["v - a*x", "-k*x - max(v - u, 0) - abs(v)*v"], {}),
        (["v", "-k*x - v*cos(7*t)"], {}),
        (["v", "-k*x + 0*u"], {"each segment": {"v": "v + a"}, "every 70 ms": {"x": "0.7*x + 0.1*k"}}),
        (["v", "-k*x + u"], {"at 50 ms, 400 ms": {"v": "a*x"}}),
    ],
)
def test_outputs_are_late_through_resets_relays_updates_and_time(rates: list[str], resets: dict[str, Any], tau: float) -> None:
    model = fp.SymbolicModel(
        rates,
        ["delay(x, tau)", "delay(v, tau)*cos(5*delay(t, tau))", "x"],
        {"x": "1", "v": "1"},
        {"u": "1"},
        dict.fromkeys(("k", "a", "tau"), "1"),
        {"x": "1", "z": "1", "y": "1"},
        resets=resets,
        check_units=False,
    )
    runs = fp.Runs([[0.6, 0.4]], np.random.default_rng(5).normal(0, 1.5, (1, 8, 1)), np.full(8, 0.1))
    assert_derivatives(model, runs, np.array([3.0, 0.7, tau]), 1e-5)


def test_a_joint_that_sticks_shows_no_slope() -> None:
    """Friction holds it, where the equations alone do not say on which side of the jump it is."""
    runs = fp.Runs([[0.3, 2.0]], [[[0.0]] * 10], np.full(10, 0.03))
    theta = np.array([0.05, 0.6, 0.1, 0.0, 0.034])
    done = fp.sensitivities(joint(("delay(q, tau)", "delay(w, tau)", "delay(w, tau)")), runs, theta)
    assert (abs(done.x[0, 5:, 1]) < 1e-12).all()
    assert (np.abs(done.dy_dtheta[0, 7:, :, 4]) < 1e-8).all() and (np.abs(done.dy_dtheta[0, 1:3, 1, 4]) > 5).all()


@pytest.mark.long
@pytest.mark.parametrize("seed", range(6))
def test_random_models_with_jumps_and_kinks(seed: int) -> None:
    figures = Figures()
    bench = Bench(crossing_case(seed, "late"), figures)
    check_late(bench)
    assert not bench.findings and figures.counts["runs compared with states by hand"] > 0


def test_up_to_the_delay_outputs_show_the_start_as_it_is_given() -> None:
    """Before updates of the start; its derivative is that of the start, zero but where that is at rest, or free."""
    rates, outputs = ["k*u - x"], ["delay(x, tau) + k"]
    given: Any = {"states": {"x": "1"}, "inputs": {"u": "1"}, "parameters": {"k": "1", "tau": "1"}, "check_units": False}
    updated = fp.SymbolicModel(rates, outputs, **given, resets={"at 0 s": {"x": "x + 5"}})
    runs, theta = fp.Runs([[1.0]], [[[2.0], [2.0]]], [0.1, 0.1]), np.array([2.0, 0.1])
    done = fp.sensitivities(updated, runs, theta)
    assert done.y[0, 0].tolist() == [3.0] and done.dy_dtheta[0, 0].tolist() == [[1.0, 0.0]] and done.y[0, 1, 0] > 7
    resting = fp.Runs([[0.0]], [[[2.0], [2.0], [3.0]]], [0.1] * 3, rest=fp.Rest({"u": 0.5}))
    plain = fp.SymbolicModel(rates, outputs, **given)
    done = fp.sensitivities(plain, resting, theta)
    assert done.y[0, 0].tolist() == [3.0] and done.dy_dtheta[0, 0].tolist() == [[1.5, 0.0]]
    assert_derivatives(plain, resting, np.array([2.0, 0.13]))
    free = plain.free_start("x")
    assert fp.sensitivities(free, runs, [2.0, 0.1, 0.0]).dy_dtheta[0, 0].tolist() == [[1.0, 0.0, 1.0]]
    assert_derivatives(free, runs, np.array([2.0, 0.13, 0.1]))


def test_points_are_late_too() -> None:
    point = fp.Experiments([[0.1, 0.5], [0.2, 1.0]], [[1.0], [2.0]], [0.1, 0.02])
    assert_derivatives(joint(), point, THETA)
    done = fp.simulate(joint(), point, THETA)
    assert done.y.shape == (2, 3) and done.y[1, 0] == 0.2
    np.testing.assert_allclose(
        done.y[0, 0], fp.simulate(joint(), point, [*THETA[:4], 0.0]).y[0, 0] - 0.033 * done.x[0, 1], atol=0.02
    )


def test_limits_are_named_and_outputs_end_with_the_run() -> None:
    model = joint().within("abs(w) < 0.2")
    runs = fp.Runs([[0.0, 0.0]], [[[0.0], [0.0], [2.0]]], [0.02] * 3)
    done = fp.simulate(model, runs, THETA)
    assert done.status[0] == fp.Status.left_domain and done.reached[0] == 2 and not done.y[0, 2].any()
    assert fp.broken_limits(model, runs, THETA) == ("abs(w) < 0.2",)


@pytest.mark.parametrize("method", ["RK45", "DOP853", "Radau"])
def test_every_method_has_late_outputs(method: str) -> None:
    runs = torques(count=1).sampled(0.005)
    one, other = (fp.sensitivities(joint(), runs, THETA, rtol=1e-8, method=way) for way in (method, None))
    np.testing.assert_allclose(one.dy_dtheta, other.dy_dtheta, atol=2e-5 * np.abs(other.dy_dtheta).max())


# --- designs and rigs --------------------------------------------------------------------------------------------------------


def problem(model: fp.Model) -> fp.DesignProblem:
    names = JOINT["parameters"]
    prior = fp.GaussianPrior(dict(zip(names, THETA.tolist(), strict=True)), relative_std=dict.fromkeys(names, 0.1))
    region = fp.RunRegion({"q": 0, "w": 0, "u": (-3, 3), "dt": 0.02}, segments=12)
    return fp.DesignProblem(model, prior, region, noise={"q": 1e-3, "w": 1e-2, "z": 0.1})


@pytest.mark.parametrize("alone", [True, False])
def test_tangents_from_the_middle_of_a_run_are_those_of_the_whole(alone: bool) -> None:
    of, settings = problem(joint(u="delay(u, tau)")), Integration(1e-8)
    runs, theta = torques(count=3, before=[0.2]), np.tile(of.theta, (3, 1))
    base = run_tangents(of, runs, theta, settings)
    u, dt = runs.u.copy(), runs.dt.copy()
    u[0, 6] += 0.5
    u[1, 1] -= 1.0  # before any late output
    dt[2, 8] *= 1.3
    changed = fp.Runs(runs.x0, u, dt, before=runs.before)
    found = tangents_from(of, base, np.arange(3), changed, theta, settings, outputs_alone=alone)
    whole = run_tangents(of, changed, theta, settings, outputs_alone=alone)
    for name in ("x", "y", "dx", "dy")[:: 3 if alone else 1]:
        one, other = getattr(found, name), getattr(whole, name)
        np.testing.assert_allclose(one, other, atol=1e-6 * np.abs(other).max())
    assert (found.dy[0, :6] == base.dy[0, :6]).all() and not (found.dy[0, 6:] == base.dy[0, 6:]).all()


@pytest.mark.long
def test_a_rig_shows_its_outputs_late_and_a_design_finds_the_delay() -> None:
    of = problem(joint())
    design = fp.design_runs(of, n_starts=1, n_candidates=30, seed=0)
    assert design.evaluation.standard_errors["tau"] < 5e-4
    runs = torques()
    measured = fp.VirtualRig(joint(), THETA, {"q": 0.0}).measure(runs)
    np.testing.assert_allclose(measured.y[..., 0], fp.simulate(joint(), runs, THETA).y[..., 0], rtol=0, atol=1e-8)
    noisy = fp.VirtualRig(joint(), THETA, {"q": 1e-4}).measure(runs)
    fit = fp.estimate(joint(), noisy, start=dict(zip(JOINT["parameters"], THETA * [1.1, 0.9, 1, 1, 0.5], strict=True)))
    assert abs(fit.estimate["tau"] - 0.033) < 4 * fit.standard_errors["tau"] < 4e-3


# --- records -----------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("tau", [0.0, 0.033, 0.04, 0.5])
@pytest.mark.parametrize("u", ["u", "delay(u, tau)", "u + latch(q > 0.05, q < -0.05)"])
def test_records_are_runs(u: str, tau: float) -> None:
    model, theta = joint((*LATE[:2], "delay(q, tau) + sin(delay(t, tau))"), u=u), np.append(THETA[:4], tau)
    t, torque = 0.02 * np.arange(40), 1.5 * np.random.default_rng(2).standard_normal((40, 1))
    done = fp.simulate_record(model, t, torque, theta, [0.01, 0.1], rtol=1e-9)
    runs = fp.Runs([[0.01, 0.1]], torque[None, :-1], np.diff(t))
    other = fp.sensitivities(model, runs, theta, rtol=1e-9)
    np.testing.assert_allclose(done.y[1:], other.y[0], rtol=0, atol=1e-12)
    assert done.y[0, 0] == 0.01
    record = fp.Record(t, torque, done.y, x0={"q": 0.01})
    response = RecordResponse(model, record, range(5), 1e-9)(theta[None], np.array([[0.01, 0.1]]))
    np.testing.assert_allclose(response.y[0], done.y, rtol=0, atol=1e-12)
    np.testing.assert_allclose(response.dy[0, 1:, :, :5], other.dy_dtheta[0], atol=1e-9 * np.abs(other.dy_dtheta).max())
    free = fp.sensitivities(model.free_start("w"), runs, [*theta, 0.0], rtol=1e-9)
    np.testing.assert_allclose(response.dy[0, 1:, :, 5], free.dy_dtheta[0, :, :, 5], atol=1e-7)


def test_parts_of_records_show_their_start_up_to_the_delay_and_fits_are_kept(tmp_path: Any) -> None:
    model, theta = joint(u="delay(u, tau)"), np.append(THETA[:4], 0.05)
    t, torque = 0.02 * np.arange(40), 1.5 * np.random.default_rng(2).standard_normal((40, 1))
    done = fp.simulate_record(model, t, torque, theta, [0.0, 0.0], rtol=1e-9)
    record = fp.Record(t, torque, done.y, x0={"q": 0.0, "w": 0.0})
    found = RecordResponse(model, record[9:30], range(5), 1e-9)(theta[None], done.x[9:10])
    np.testing.assert_allclose(found.y[0, 3:], done.y[12:30], atol=1e-9)
    np.testing.assert_allclose(found.y[0, :3, 0], done.x[9, 0], atol=1e-12)
    record.to_csv(tmp_path / "record.csv", model)
    again = fp.Record.from_csv(tmp_path / "record.csv", model)
    start = dict(zip(JOINT["parameters"], theta, strict=True)) | {"tau": 0.045}
    fit = fp.estimate(model, again, start=start, noise={"q": 1e-3, "w": 1e-2, "z": 1e-2})
    assert fit.estimate["tau"] == pytest.approx(0.05, abs=1e-5)
    fit.save(tmp_path / "fit")
    assert fp.Fit.load(tmp_path / "fit").model == model


def test_the_delay_of_a_sensor_is_found_to_a_tenth_of_a_sample() -> None:
    rng, samples, model = np.random.default_rng(1), 1500, joint()
    t = 1e-3 * np.arange(samples)
    u = 1.2 * np.sin(2 * np.pi * (0.8 + 0.8 * t) * t) + 0.6 * np.sign(np.sin(2 * np.pi * 2.3 * t))
    q = fp.simulate_record(model, t, u, [*THETA[:4], 0.005], [0.0, 0.0], rtol=1e-8).y[:, :1]
    y = np.column_stack([q + 1e-4 * rng.standard_normal(q.shape), np.full((samples, 2), np.nan)])
    start = {"J": 0.06, "c": 0.5, "d": 0.12, "g": 0.35, "tau": 0.002}
    fit = fp.estimate(model, fp.Record(t, u, y, x0={"q": 0.0, "w": 0.0}), start=start)
    error = abs(fit.estimate["tau"] - 0.005)
    assert error < 1e-4 and error < 4 * fit.standard_errors["tau"] < 4e-5


# --- the language ------------------------------------------------------------------------------------------------------------


def test_models_keep_their_late_outputs() -> None:
    model = joint(nominal={"tau": 0.005})
    assert model.late_outputs == {"q": "tau", "z": "tau"} and not model.delays and "delay(q, tau)" in str(model)
    for other in (model_from_toml(model.to_toml()), pickle.loads(pickle.dumps(model)), model.fix(J=1.0).estimate("J").symbolic()):
        assert other.late_outputs == model.late_outputs
    assert model_from_toml(model.to_toml()) == model == pickle.loads(pickle.dumps(model))
    assert model != joint(("q", "w", "w*q + c"), nominal={"tau": 0.005})
    assert model.fix(tau=0.01).late_outputs == model.late_outputs and "delay" in model._repr_latex_()
    for other in (model.free_start("q"), model.within("abs(q) < 1"), model.free_start("q").fix(c=0.0)):
        assert other.late_outputs == model.late_outputs and "delay(w, tau)" in other.to_toml()
    assert model.least["tau"] == 0.0 and model.reaches["tau"] == ("q", "z") and not model.idle and model.shown_states == {"w": "w"}
    assert joint(("delay(q, 0.01)", "w", "q")).late_outputs == {"q": 0.01}


def test_functions_of_python_have_late_outputs_too() -> None:
    @fp.model(states={"x": "1"}, inputs={"u": "1"}, parameters={"k": "1/s", "tau": "s"}, outputs={"y": "1"}, check_units=False)
    def late(x: Any, u: Any, p: Any) -> Any:
        return [u.u - p.k * x.x], [2 * fp.math.delay(x.x, p.tau)]

    assert late.late_outputs == {"y": "tau"}


@pytest.mark.parametrize(
    ("f", "g", "message"),
    [
        ("delay(x, tau)", "x", r"equations\.x: expected an input in delay\(\), given the state x: states are delayed in outputs"),
        ("delay(t, tau)", "x", r"equations\.x: expected an input in delay\(\), given the time t: states are delayed in outputs"),
        ("u", "delay(x, tau) + u", r"equations\.y: expected no input in an output that is late, given u"),
        ("u", "delay(x, tau) + delay(u, tau)", r"equations\.y: expected no input in an output that is late, given u"),
        ("u", "delay(x, tau) + x", r"equations\.y: expected delay\(x, tau\) in an output that is late, given x alone"),
        ("u", "delay(x, tau) + t", r"equations\.y: expected delay\(t, tau\) in an output that is late, given t alone"),
        ("u", "delay(x, tau)*delay(x, k)", r"equations\.y: expected one delay of all states of an output, given k and tau"),
        ("u", "delay(x, past)", r"equations\.y: expected a dead time of x of at least 0 s, given -1"),
        ("u", "delay(x, u)", r"equations\.y: expected a parameter, a known constant or a number as dead time of x, given 'u'"),
        ("u", "delay(k, tau)", r"equations\.y: expected an input in delay\(\), u; given 'k'"),
    ],
)
def test_what_cannot_be_late_is_refused(f: str, g: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        fp.SymbolicModel([f], [g], {"x": "1"}, {"u": "1"}, {"k": "1", "tau": "1"}, {"y": "1"}, constants={"past": (-1.0, "1")})


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"domain": ["delay(x, tau) + 1"]}, r"domain: expected an input in delay\(\), given the state x"),
        ({"resets": {"delay(x, tau) > 1": {"x": "0"}}}, r"resets: expected an input in delay\(\), given the state x"),
        ({"resets": {"x > 1": {"x": "delay(x, tau)"}}}, r"resets: expected an input in delay\(\), given the state x"),
        ({"resets": {"every 1 s": {"x": "delay(x, tau)"}}}, r"resets: expected an input in delay\(\), given the state x"),
    ],
)
def test_delayed_states_stand_in_outputs_alone(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        fp.SymbolicModel(["u"], ["x"], {"x": "1"}, {"u": "1"}, {"tau": "1"}, {"y": "1"}, check_units=False, **changes)
    with pytest.raises(ValueError, match=r"along: expected an input in delay\(\), given the state q"):
        joint().within("delay(q, tau) < 1")


def test_what_knows_no_past_refuses_late_outputs() -> None:
    t = 0.02 * np.arange(20)
    record = fp.Record(t, np.ones((20, 1)), np.zeros((20, 3)), x0={"q": 0.0, "w": 0.0})
    with pytest.raises(ValueError, match=r"model: expected one without late outputs, as windows do not know the states before"):
        pieces(record, joint(), length=5)
    of = problem(joint())
    region = fp.ExperimentRegion({"q": (0, 1), "w": (0, 1), "u": (-3, 3), "dt": (0.01, 0.1)})
    with pytest.raises(ValueError, match=r"region: expected a RunRegion for a model with late outputs, given one of points for"):
        fp.DesignProblem(joint(), of.prior, region, noise={"q": 1e-3, "w": 1e-2, "z": 0.1})
    point = fp.Experiments([[0.1, 0.5]], [[1.0]], [0.1])
    with pytest.raises(ValueError, match=r"rule: expected LinearizedRule\(\) for a model with late outputs, given GaussHermite"):
        fp.predictive_covariance(joint(), point, of.prior, fp.GaussHermite(3))
    assert fp.predictive_covariance(joint(), point, of.prior, fp.LinearizedRule()).covariance[0, 0, 0] > 0


def test_units_of_delays_are_those_of_a_time() -> None:
    with pytest.warns(UserWarning, match=r"tau in m, which is no time"):
        fp.SymbolicModel(["u"], ["delay(x, tau)"], {"x": "m"}, {"u": "m/s"}, {"tau": "m"}, {"x": "m"})


def test_delays_below_zero_have_no_value() -> None:
    theta = np.append(THETA[:4], -0.001)
    with pytest.raises(ValueError, match=r"tau: expected a dead time of at least 0 s, given -0\.001"):
        fp.simulate(joint(), torques(), theta)
    record = fp.Record(0.02 * np.arange(20), np.ones((20, 1)), np.zeros((20, 3)), x0={"q": 0.0, "w": 0.0})
    assert RecordResponse(joint(), record, range(5))(theta[None], np.zeros((1, 2))).status[0] == fp.Status.left_domain
