"""States that are set anew where conditions become true, and conditions that latch, against SciPy and closed forms."""

from __future__ import annotations

import os
import pickle

import numpy as np
import pytest

import fisherpoint as fp
from hybrid import PilesUpError
from reset_cases import CASES

pytestmark = pytest.mark.kernels

POINTS = int(os.environ.get("FISHERPOINT_JUMP_POINTS", "25"))


def points_of(x0: list[float], u: list[float], *dt: float) -> fp.Experiments:
    return fp.Experiments([x0] * len(dt), np.array([u] * len(dt)).reshape(len(dt), len(u)), list(dt))


def ball(**further: object) -> fp.SymbolicModel:
    states, parameters = {"x": "m", "v": "m/s"}, {"g": "m/s2", "e": "1"}
    resets = {"x < 0": {"v": "-e*v"}}
    return fp.SymbolicModel(["v", "-g"], ["x"], states, {}, parameters, {"x": "m"}, **{"resets": resets, **further})


def thermostat(start: int = 0) -> fp.SymbolicModel:
    rate = f"k*(T_a - T) + P*latch(T < low, T > high, start={start})"
    parameters = {"k": "1/s", "P": "K/s", "low": "K", "high": "K"}
    return fp.SymbolicModel([rate], ["T"], {"T": "K"}, {"T_a": "K"}, parameters, {"T": "K"})


HEAT = [0.05, 1.5, 20.0, 22.0]


@pytest.mark.parametrize("name", CASES)
def test_states_and_sensitivities_are_those_of_scipy(name: str) -> None:
    case = CASES[name]()
    points, theta = case.drawn(POINTS, seed=3)
    done = fp.sensitivities(case.model, points, theta, rtol=1e-10)
    events = 0
    for k in range(len(points)):
        try:
            x, s, count = case.reference(points.x0[k], points.u[k], points.dt[k], theta[k])
        except PilesUpError:
            assert done.status[k] == fp.Status.chatters
            continue
        assert done.status[k] == fp.Status.ok, (k, done.statuses[k])
        np.testing.assert_allclose(done.x[k], x, rtol=1e-8, atol=1e-8)
        np.testing.assert_allclose(done.dx_dtheta[k], s, atol=1e-6 * np.abs(s).max())
        events += count
    assert events > POINTS / 2


@pytest.mark.parametrize("method", ["RK45", "DOP853", "Radau"])
def test_all_methods_agree(method: str) -> None:
    for model, points, theta in (
        (ball(), points_of([1.0, 0.3], [], 0.3, 0.8, 2.5), [9.81, 0.8]),
        (thermostat(), points_of([21.0], [5.0], 7.0, 40.0), HEAT),
    ):
        best = fp.sensitivities(model, points, theta, rtol=1e-11)
        done = fp.sensitivities(model, points, theta, rtol=1e-7, method=method)
        assert not done.status.any()
        np.testing.assert_allclose(done.x, best.x, atol=1e-5)
        np.testing.assert_allclose(done.dx_dtheta, best.dx_dtheta, atol=1e-4 * np.abs(best.dx_dtheta).max())


def test_a_run_is_one_trajectory() -> None:
    """Segments go on from each other with what latches remember, and so do states and sensitivities."""
    for model, x0, u, theta in ((ball(), [1.0, 0.3], [], [9.81, 0.8]), (thermostat(), [21.0], [5.0], HEAT)):
        length = 2.5 if len(x0) == 2 else 40.0
        t = np.linspace(0.0, length, 24)
        runs = fp.Runs([x0], np.array([[u] * 23]).reshape(1, 23, len(u)), np.diff(t)[None])
        done = fp.sensitivities(model, runs, theta, rtol=1e-10)
        whole = fp.sensitivities(model, points_of(x0, u, *t[1:]), theta, rtol=1e-10)
        assert not done.status.any() and not whole.status.any()
        np.testing.assert_allclose(done.x[0, 1:], whole.x, atol=1e-8)
        np.testing.assert_allclose(done.dx_dtheta[0], whole.dx_dtheta, atol=1e-7 * np.abs(whole.dx_dtheta).max())
        record = fp.simulate_record(model, t, np.tile(u, (24, 1)), theta, x0, rtol=1e-10)
        np.testing.assert_allclose(record.x[1:], whole.x, atol=1e-8)
        np.testing.assert_allclose(record.y, record.x[:, :1])


def test_the_bits_do_not_depend_on_neighbours_and_threads() -> None:
    for name in CASES:
        case = CASES[name]()
        points, theta = case.drawn(70, seed=5)
        done = fp.sensitivities(case.model, points, theta, threads=1)
        two = fp.sensitivities(case.model, points, theta, threads=2)
        np.testing.assert_array_equal(done.dx_dtheta, two.dx_dtheta)
        for k in range(0, 70, 9):
            alone = fp.sensitivities(case.model, points[[k]], theta[k])
            np.testing.assert_array_equal(alone.x[0], done.x[k])
            np.testing.assert_array_equal(alone.dx_dtheta[0], done.dx_dtheta[k])


def test_over_a_prior_every_node_has_its_own_events() -> None:
    for model, points, theta in (
        (ball(), points_of([1.0, 0.3], [], 0.8, 1.3), {"g": 9.81, "e": 0.8}),
        (thermostat(), points_of([21.0], [5.0], 7.0, 30.0), dict(zip(("k", "P", "low", "high"), HEAT, strict=True))),
    ):
        prior = fp.GaussianPrior(theta, std={name: 0.01 * value for name, value in theta.items()})
        nodes, weights = fp.SparseGaussHermite(3).nodes(prior)
        done = fp.predictive_covariance(model, points, prior, fp.SparseGaussHermite(3), rtol=1e-9)
        assert not done.status.any()
        for k in range(len(points)):
            each = fp.simulate(
                model,
                fp.Experiments(*(np.repeat(of[[k]], len(nodes), axis=0) for of in (points.x0, points.u, points.dt))),
                nodes,
                rtol=1e-9,
            )
            mean = fp.simulate(model, points[[k]], theta, rtol=1e-9).y[0]
            spread = each.y - mean
            np.testing.assert_allclose(done.covariance[k], (spread.T * weights) @ spread / weights.sum(), rtol=1e-6)


def test_a_latch_of_the_input_holds_over_the_samples() -> None:
    t, u = np.arange(7.0), np.array([0.5, 2.0, 0.5, 0.5, -1.0, 0.5, 0.5])[:, None]
    for start, expected in ((0, [0, 0, 1, 2, 3, 3, 3]), (1, [0, 1, 2, 3, 4, 4, 4])):
        model = fp.SymbolicModel([f"p*latch(u > 1, u < 0, start={start})"], ["x"], {"x": "1"}, {"u": "1"}, {"p": "1/s"}, {"x": "1"})
        done = fp.simulate_record(model, t, u, [1.0], [0.0])
        np.testing.assert_allclose(done.x[:, 0], expected, atol=1e-12)


def test_a_latch_of_the_time_goes_once() -> None:
    """Its time is estimated: the trajectory before and behind it is known."""
    model = fp.SymbolicModel(["where(latch(t > tau, t < 0), -k*x, 0)"], ["x"], {"x": "1"}, {}, {"tau": "s", "k": "1/s"}, {"x": "1"})
    done = fp.sensitivities(model, points_of([1.0], [], 3.0), [1.3, 0.5], rtol=1e-10)
    x = np.exp(-0.5 * 1.7)
    np.testing.assert_allclose(done.x, [[x]], rtol=1e-9)
    np.testing.assert_allclose(done.dx_dtheta[0], [[0.5 * x, -1.7 * x]], rtol=1e-8)


def test_off_wins_where_both_hold() -> None:
    done = fp.simulate(thermostat(), points_of([21.0], [5.0], 10.0), [0.05, 1.5, 22.0, 20.0])  # low above high
    off = 5.0 + 16.0 * np.exp(-0.05 * 20 * np.log(16 / 15))  # off as long as T > 20
    at = np.log(16 / 15) / 0.05
    assert done.status[0] in (fp.Status.ok, fp.Status.chatters)
    assert at < 10.0 and off > 0


def test_a_state_of_the_model_is_a_mode_that_outputs_read() -> None:
    model = fp.SymbolicModel(
        ["k*(T_a - T) + P*on", "0"],
        ["T", "P*on"],
        {"T": "K", "on": "1"},
        {"T_a": "K"},
        {"k": "1/s", "P": "K/s", "low": "K", "high": "K"},
        {"T": "K", "power": "K/s"},
        resets={"T < low": {"on": "1"}, "T > high": {"on": "0"}},
    )
    done = fp.sensitivities(model, points_of([21.0, 0.0], [5.0], 8.0, 40.0), HEAT, rtol=1e-9)
    latched = fp.sensitivities(thermostat(), points_of([21.0], [5.0], 8.0, 40.0), HEAT, rtol=1e-9)
    np.testing.assert_allclose(done.x[:, 0], latched.x[:, 0], rtol=1e-9)
    np.testing.assert_allclose(done.dx_dtheta[:, 0], latched.dx_dtheta[:, 0], atol=1e-6)
    np.testing.assert_allclose(done.y[:, 1], done.x[:, 1] * 1.5)


def test_a_counter_goes_back_with_what_it_counts() -> None:
    """x' = a that falls back by h, and to zero, at h: both forms say the same."""
    for value in ("x - h", "0"):
        model = fp.SymbolicModel(["a"], ["x"], {"x": "1"}, {}, {"a": "1/s", "h": "1"}, {"x": "1"}, resets={"x > h": {"x": value}})
        done = fp.sensitivities(model, points_of([0.0], [], 3.35), [1.0, 1.0], rtol=1e-10)
        np.testing.assert_allclose(done.x, [[0.35]], atol=1e-10)
        np.testing.assert_allclose(done.dx_dtheta[0], [[3.35, -3.0]], rtol=1e-8)


def test_resets_that_pile_up_end_with_a_status() -> None:
    """A ball comes to rest by a finite time, after bounces without end; a plastic impact rests at once, and would fall on."""
    done = fp.simulate(ball(), points_of([1.0, 0.0], [], 3.0, 6.0), [9.81, 0.8])
    assert done.status.tolist() == [fp.Status.ok, fp.Status.chatters]
    plastic = ball(resets={"x < 0": {"v": "0"}})
    done = fp.simulate(plastic, points_of([1.0, 0.0], [], 0.3, 2.0), [9.81, 0.8])
    assert done.status.tolist() == [fp.Status.ok, fp.Status.chatters]
    # Two conditions that undo each other at once.
    loop = fp.SymbolicModel(
        ["a", "0"],
        ["x"],
        {"x": "1", "m": "1"},
        {},
        {"a": "1/s"},
        {"x": "1"},
        resets={"x > 1 and m < 0.5": {"m": "1"}, "m > 0.5": {"m": "0"}},
    )
    assert fp.simulate(loop, points_of([0.0, 0.0], [], 2.0), [1.0]).status[0] in (fp.Status.ok, fp.Status.chatters)


def test_starts_on_the_stop() -> None:
    done = fp.sensitivities(ball(), points_of([0.0, 3.0], [], 0.2), [9.81, 0.5], rtol=1e-10)
    np.testing.assert_allclose(done.x[0], [0.6 - 0.02 * 9.81, 3.0 - 0.2 * 9.81], rtol=1e-9)
    np.testing.assert_allclose(done.dx_dtheta[0], [[-0.02, 0.0], [-0.2, 0.0]], atol=1e-9)
    done = fp.sensitivities(ball(), points_of([0.0, -3.0], [], 0.2), [9.81, 0.5], rtol=1e-10)  # onto the floor at once
    np.testing.assert_allclose(done.x[0], [0.3 - 0.02 * 9.81, 1.5 - 0.2 * 9.81], rtol=1e-9)
    np.testing.assert_allclose(done.dx_dtheta[0], [[-0.02, 0.6], [-0.2, 3.0]], atol=1e-8)


def test_excluded_jumps_are_not_crossed() -> None:
    done = fp.simulate(ball(), points_of([1.0, 0.0], [], 0.3, 0.6), [9.81, 0.8], jumps="exclude")
    assert done.status.tolist() == [fp.Status.ok, fp.Status.met_jump]


def test_a_sample_at_an_impact_has_no_derivative() -> None:
    time = np.sqrt(2.0 / 9.81)
    done = fp.sensitivities(ball(), points_of([1.0, 0.0], [], time, 0.9 * time, 1.1 * time), [9.81, 0.8])
    assert done.status.tolist() == [fp.Status.on_jump, fp.Status.ok, fp.Status.ok]
    # In a run it makes no sample, and the run goes on.
    dt = np.array([[time, 0.3]])
    runs = fp.Runs([[1.0, 0.0]], np.zeros((1, 2, 0)), dt, measured=[[False, True]])
    one = fp.sensitivities(ball(), points_of([1.0, 0.0], [], time + 0.3), [9.81, 0.8], rtol=1e-9)
    done_run = fp.sensitivities(ball(), runs, [9.81, 0.8], rtol=1e-9)
    assert not done_run.status.any()
    np.testing.assert_allclose(done_run.dx_dtheta[0, -1], one.dx_dtheta[0], atol=1e-6)


def test_parameters_of_a_record_are_estimated() -> None:
    """The coefficient of restitution, and the thresholds of a relay, from noisy records."""
    rng = np.random.default_rng(0)
    for model, x0, u, truth, length, std in (
        (ball(), {"x": 1.0, "v": 0.3}, [], np.array([9.81, 0.8]), 2.0, 1e-3),
        (thermostat(), {"T": 21.0}, [5.0], np.array(HEAT), 60.0, 0.05),
    ):
        t, inputs = np.linspace(0.0, length, 61), np.tile(u, (61, 1))
        clean = fp.simulate_record(model, t, inputs, truth, list(x0.values()), rtol=1e-9)
        record = fp.Record(t, inputs, clean.y + std * rng.normal(size=clean.y.shape), x0=x0)
        start = dict(zip([q.name for q in model.parameters], 1.01 * truth, strict=True))
        found = fp.estimate(model, record, start=start, noise={model.outputs[0].name: std})
        np.testing.assert_allclose(found.theta, truth, rtol=0.02)


def test_files_copies_and_changes_keep_it(tmp_path: object) -> None:
    for model, points, theta in (
        (ball(), points_of([1.0, 0.3], [], 0.8), [9.81, 0.8]),
        (thermostat(start=1), points_of([21.0], [5.0], 40.0), HEAT),
    ):
        from fisherpoint.models.toml_to_model import model_from_toml

        done = fp.sensitivities(model, points, theta)
        for copy in (pickle.loads(pickle.dumps(model)), model_from_toml(model.to_toml())):
            assert copy == model and hash(copy) == hash(model)
            np.testing.assert_array_equal(fp.sensitivities(copy, points, theta).dx_dtheta, done.dx_dtheta)
        last = model.parameters[-1].name
        fixed = fp.sensitivities(model.fix(**{last: theta[-1]}), points, theta[:-1])
        np.testing.assert_allclose(fixed.dx_dtheta, done.dx_dtheta[..., :-1], rtol=1e-9, atol=1e-9)
        freed = model.free_start(model.states[0].name)
        moved = fp.sensitivities(freed, points, [*theta, 0.0], rtol=1e-10)
        assert not moved.status.any()
        h = 1e-5
        start = points.x0 + np.eye(len(model.states))[0] * h, points.x0 - np.eye(len(model.states))[0] * h
        two = [fp.simulate(model, fp.Experiments(x0, points.u, points.dt), theta, rtol=1e-11).y for x0 in start]
        np.testing.assert_allclose(moved.dy_dtheta[0, :, -1], (two[0] - two[1])[0] / (2 * h), rtol=1e-5, atol=1e-6)


def test_a_decorated_model_has_both() -> None:
    @fp.model(
        states={"T": "K"}, inputs={"T_a": "K"}, parameters={"k": "1/s", "P": "K/s", "low": "K", "high": "K"}, outputs={"T": "K"}
    )
    def room(x, u, p):  # type: ignore[no-untyped-def]
        on = fp.math.latch(p.low > x.T, p.high < x.T)
        return [p.k * (u.T_a - x.T) + fp.math.where(on, p.P, 0)], [x.T]

    points = points_of([21.0], [5.0], 40.0)
    np.testing.assert_array_equal(fp.simulate(room, points, HEAT).x, fp.simulate(thermostat(), points, HEAT).x)
    assert "where(latch(low > T, high < T), P, 0)" in str(room)

    @fp.model(
        states={"x": "m", "v": "m/s"}, parameters={"g": "m/s2", "e": "1"}, outputs={"x": "m"}, resets={"x < 0": {"v": "-e*v"}}
    )
    def falling(x, u, p):  # type: ignore[no-untyped-def]
        return [x.v, -p.g], [x.x]

    points = points_of([1.0, 0.0], [], 0.8)
    np.testing.assert_array_equal(fp.simulate(falling, points, [9.81, 0.8]).x, fp.simulate(ball(), points, [9.81, 0.8]).x)


def test_what_resets_move_is_reached() -> None:
    assert ball().reaches == {"g": ("x",), "e": ("x",)}
    assert ball().idle == () and thermostat().idle == ()
    assert ball().jumps == ball().crossable == ("x",)


def test_mistakes_are_named() -> None:
    for resets, text in (
        ({"x < 0": {"w": "1"}}, "names of states, x, v; given unknown 'w'"),
        ({"x < 0": {"v": "-e*w"}}, "given 'w'"),
        ({"x": {"v": "1"}}, "expected a condition such as h > 0"),
        ({"g < 0": {"v": "1"}}, "expected a condition of states, inputs or the time"),
    ):
        with pytest.raises(ValueError, match=text.replace("(", r"\(")):
            ball(resets=resets)
    with pytest.raises(TypeError, match="resets: expected a condition or times with the states that it sets"):
        ball(resets={"x < 0": "v"})
    with pytest.raises(ValueError, match=r"outputs.T: expected no latch\(\)|expected no latch"):
        fp.SymbolicModel(["-k*T"], ["T*latch(T > 1, T < 0)"], {"T": "K"}, {}, {"k": "1/s"}, {"y": "K"})
    for text in ("latch(T > 1)", "latch(T, T < 0)", "latch(T > 1, T < 0, start=2)", "latch(T > 1, 1 < 0)"):
        with pytest.raises(ValueError, match=r"latch|condition"):
            fp.SymbolicModel([f"-k*T + {text}"], ["T"], {"T": "K"}, {}, {"k": "1/s"}, {"T": "K"})
    with pytest.raises(TypeError, match="latch: on: expected a condition of equations"):
        fp.math.latch(3.0, 2.0)
