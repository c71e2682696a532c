"""States that get new values at known times: boluses, discrete controllers, discrete-time models."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

import fisherpoint as fp
from check_updates import check_updates
from checks import Bench
from crossing_case import crossing_case
from figures import Figures
from fisherpoint.models.toml_to_model import model_from_toml

pytestmark = pytest.mark.kernels


def doses(**options: Any) -> fp.SymbolicModel:
    return fp.SymbolicModel(
        ["-ka*d", "ka*d - ke*c"],
        ["c/V"],
        {"d": "mg", "c": "mg"},
        {"dose": "mg"},
        {"ka": "1/s", "ke": "1/s", "V": "L"},
        {"y": "mg/L"},
        nominal={"ka": 1.0, "ke": 0.3, "V": 5.0},
        name="doses",
        **({"resets": {"each segment": {"d": "d + dose"}}} | options),
    )


DRIVE = {"J1": 0.01, "J2": 0.02, "kc": 20.0, "b": 0.05, "kp": 0.8}
PERIOD, INTEGRAL, MOST = 0.005, 2.0, 3.0


def drive() -> fp.SymbolicModel:
    """Two masses in the loop of a discrete PI controller at 200 Hz, whose torque is limited."""
    return fp.SymbolicModel(
        ["w1", "(tau - kc*(q1 - q2) - b*w1)/J1", "w2", "kc*(q1 - q2)/J2", "0", "0"],
        ["q1", "w2", "tau"],
        {"q1": ("rad", 0.01), "w1": "rad/s", "q2": ("rad", 0.01), "w2": "rad/s", "z": "N m", "tau": "N m"},
        {"r": "rad/s"},
        {"J1": "kg m2", "J2": "kg m2", "kc": "N m/rad", "b": "N m s/rad", "kp": "N m s/rad"},
        {"q1": "rad", "w2": "rad/s", "u": "N m"},
        resets={
            "every 5 ms": {"z": f"z + {PERIOD * INTEGRAL}*(r - w1)", "tau": f"min(max(kp*(r - w1) + z, -{MOST}), {MOST})"},
        },
        check_units=False,
        nominal=DRIVE,
        name="drive",
    )


def by_hand(theta: np.ndarray, r: np.ndarray, steps: int) -> np.ndarray:
    """Outputs (N, 3) at the ends of N segments of so many periods, by the exponential of the matrix."""
    j1, j2, kc, b, kp = theta
    a = np.zeros((5, 5))
    a[0, 1], a[2, 3], a[3, 0], a[3, 2] = 1.0, 1.0, kc / j2, -kc / j2
    a[1, :] = [-kc / j1, -b / j1, kc / j1, 0.0, 1 / j1]
    whole, x, z, tau, found = expm(a * PERIOD), np.zeros(4), 0.0, 0.0, []
    for wanted in r:
        for _ in range(steps):
            off = wanted - x[1]
            z, tau = z + PERIOD * INTEGRAL * off, min(max(kp * off + z, -MOST), MOST)
            x = (whole @ np.append(x, tau))[:4]
        found.append([x[0], x[3], tau])
    return np.array(found)


def slopes(of: Any, theta: np.ndarray, share: float = 1e-5) -> np.ndarray:
    """By central differences of two steps."""
    columns = []
    for j, size in enumerate(theta):
        ends = [
            (of(theta + h * size * np.eye(len(theta))[j]) - of(theta - h * size * np.eye(len(theta))[j])) / (2 * h * size)
            for h in (share, 2 * share)
        ]
        columns.append((4 * ends[0] - ends[1]) / 3)
    return np.stack(columns, axis=-1)


def test_doses_at_each_segment_are_those_of_the_closed_form() -> None:
    model, dt = doses(), 2.0
    runs = fp.Runs([[0.0, 0.0], [1.0, 2.0]], [[[5.0], [0.0], [3.0], [3.0]], [[1.0], [1.0], [0.0], [1.0]]], dt)
    theta = np.array([1.0, 0.3, 5.0])

    def closed(values: np.ndarray, k: int) -> np.ndarray:
        ka, ke, volume = values
        (d, c), found = runs.x0[k], []
        for dose in runs.u[k, :, 0]:
            d = d + dose
            c = c * np.exp(-ke * dt) + d * ka / (ka - ke) * (np.exp(-ke * dt) - np.exp(-ka * dt))
            d = d * np.exp(-ka * dt)
            found.append(c / volume)
        return np.array(found)

    done = fp.sensitivities(model, runs, theta, rtol=1e-11)
    for k in range(2):
        np.testing.assert_allclose(done.y[k, :, 0], closed(theta, k), rtol=1e-10)
        np.testing.assert_allclose(done.dy_dtheta[k, :, 0], slopes(lambda values, k=k: closed(values, k), theta), atol=1e-8)


def test_a_discrete_controller_around_two_masses_is_its_own_loop() -> None:
    model, rng = drive(), np.random.default_rng(0)
    r = np.append(rng.uniform(-5, 5, 19), 40.0)  # the last reaches the limit of the torque
    theta = np.array(list(DRIVE.values()))
    runs = fp.Runs([[0.0] * 6], r[None, :, None], 10 * PERIOD)
    expected = by_hand(theta, r, 10)
    assert abs(expected[-1, 2]) == MOST
    np.testing.assert_allclose(fp.simulate(model, runs, theta, rtol=1e-11).y[0], expected, atol=1e-10)
    done = fp.sensitivities(model, runs, theta, rtol=1e-11)
    np.testing.assert_allclose(done.y[0], expected, atol=1e-10)
    found = slopes(lambda values: by_hand(values, r, 10), theta)
    assert np.max(np.abs(done.dy_dtheta[0] - found) / np.abs(found).max(axis=(0, 1))) < 1e-7


def test_samples_between_the_instants_of_a_controller() -> None:
    model, r = drive(), np.array([1.0, -2.0])
    theta = np.array(list(DRIVE.values()))
    ends = fp.Runs([[0.0] * 6], r[None, :, None], 4 * PERIOD)
    fine = fp.Runs([[0.0] * 6], np.repeat(r, 16)[None, :, None], PERIOD / 4)
    shifted = fp.Runs([[0.0] * 6], np.repeat(r, 20)[None, :, None], PERIOD / 5)
    for other, every in ((fine, 16), (shifted, 20)):
        np.testing.assert_allclose(
            fp.simulate(model, other, theta, rtol=1e-10).y[:, every - 1 :: every],
            fp.simulate(model, ends, theta, rtol=1e-10).y,
            atol=1e-9,
        )


def test_a_model_in_discrete_time_is_one_without_a_flow() -> None:
    model = fp.SymbolicModel(
        ["0"], ["x"], {"x": "1"}, {"u": "1"}, {"a": "1", "b": "1"}, {"x": "1"}, resets={"every 1 s": {"x": "a*x + b*u"}}
    )
    u, (a, b) = np.array([1.0, -1.0, 0.5, 0.0, 2.0]), (0.7, 0.3)
    done = fp.sensitivities(model, fp.Runs([[2.0]], u[None, :, None], 1.0), [a, b])
    x, s, found = 2.0, np.zeros(2), []
    for held in u:
        s = a * s + [x, held]
        x = a * x + b * held
        found.append([x, *s])
    np.testing.assert_allclose(done.y[0, :, 0], np.array(found)[:, 0], rtol=1e-14)
    np.testing.assert_allclose(done.dy_dtheta[0, :, 0], np.array(found)[:, 1:], rtol=1e-14)


@pytest.mark.parametrize(
    ("when", "times"),
    [
        ("every 0.3 s", [0.0, 0.3, 0.6, 0.9, 1.2]),  # 3*0.1 is not 0.3
        ("every 300 ms from 200 ms", [0.2, 0.5, 0.8, 1.1]),
        ("at 0.2 s, 1.0 s, 7 s", [0.2, 1.0]),
        ("at 0 s", [0.0]),
        ("every 1.4 s", [0.0]),  # at the end it does not act
        ("every 5 s from 2 s", []),
        ("each segment", list(0.1 * np.arange(14))),
    ],
)
def test_times_of_updates(when: str, times: list[float]) -> None:
    """x counts; a sample in the instant of an update is taken before it."""
    model = fp.SymbolicModel(["0*k"], ["x + 0*k"], {"x": "1"}, {}, {"k": "1"}, {"y": "1"}, resets={when: {"x": "x + 1"}})
    runs = fp.Runs([[0.0]], np.empty((1, 14, 0)), 0.1)
    ends = 0.1 * np.arange(1, 15)
    expected = [sum(t < end - 1e-9 for t in times) for end in ends]
    np.testing.assert_array_equal(fp.simulate(model, runs, [1.0]).y[0, :, 0], expected)
    np.testing.assert_array_equal(fp.sensitivities(model, runs, [1.0]).y[0, :, 0], expected)
    whole = fp.simulate(model, fp.Experiments([[0.0]], np.empty((1, 0)), [1.4]), [1.0])
    assert whole.y[0, 0] == (1 if when == "each segment" else expected[-1])


def test_all_updates_of_an_instant_read_the_states_before() -> None:
    model = fp.SymbolicModel(
        ["0*k", "0"],
        ["x", "z"],
        {"x": "1", "z": "1"},
        {},
        {"k": "1"},
        {"a": "1", "b": "1"},
        resets={"every 1 s": {"x": "z"}, "every 2 s": {"z": "x"}},
    )
    done = fp.simulate(model, fp.Runs([[1.0, 2.0]], np.empty((1, 3, 0)), 1.0), [1.0])
    np.testing.assert_array_equal(done.x[0], [[1, 2], [2, 1], [1, 1], [1, 1]])


def test_a_condition_that_an_update_makes_true_sets_states_anew() -> None:
    model = fp.SymbolicModel(
        ["-k", "0"],
        ["x", "n"],
        {"x": "1", "n": "1"},
        {"u": "1"},
        {"k": "1"},
        {"x": "1", "n": "1"},
        resets={"x < 0": {"n": "n + 1", "x": "1.5"}, "each segment": {"x": "x - u"}},
    )
    runs = fp.Runs([[2.5, 0.0]], [[[0.0], [2.0], [0.0]]], 1.0)
    np.testing.assert_allclose(fp.simulate(model, runs, [1.0]).x[0, :, 1], [0, 0, 1, 2], atol=0)


@pytest.mark.parametrize("seed", range(4))
def test_random_models_with_jumps_and_kinks(seed: int) -> None:
    figures = Figures()
    bench = Bench(crossing_case(seed, "updates"), figures)
    check_updates(bench)
    assert not bench.findings and figures.counts["runs compared with updates by hand"] > 0


def test_updates_go_along_with_a_dead_time() -> None:
    """The reference comes late, by a parameter, to a controller of period 0.1; x' = p."""
    model = fp.SymbolicModel(
        ["p*k*delay(u, tau)", "0"],
        ["x"],
        {"x": "1", "p": "1"},
        {"u": "1"},
        {"k": "1", "tau": "1"},
        {"x": "1"},
        resets={"every 0.1 s": {"p": "2 - x"}},
        check_units=False,
    )
    runs = fp.Runs([[0.0, 0.0]], [[[1.0], [-1.0], [2.0]]], 0.2)
    theta = np.array([1.3, 0.13])
    done = fp.sensitivities(model, runs, theta, rtol=1e-11)
    found = slopes(lambda values: fp.simulate(model, runs, values, rtol=1e-12).y[0], theta)
    np.testing.assert_allclose(done.dy_dtheta[0], found, atol=1e-7)


def test_a_record_is_followed_and_estimated_through_updates() -> None:
    model, rng = drive(), np.random.default_rng(1)
    t, r = np.arange(400) * 0.002, np.repeat(rng.uniform(-4, 4, 20), 20)
    theta = np.array(list(DRIVE.values()))
    done = fp.simulate_record(model, t, r, theta, [0.0] * 6)
    runs = fp.Runs([[0.0] * 6], r[None, :-1, None], 0.002)
    np.testing.assert_allclose(done.x, fp.simulate(model, runs, theta).x[0], atol=1e-6)
    y = done.y[:, :2] + rng.normal(scale=1e-3, size=(400, 2))
    record = fp.Record(
        t, r, np.column_stack([y, np.full(400, np.nan)]), x0=dict.fromkeys(("q1", "w1", "q2", "w2", "z", "tau"), 0.0)
    )
    start = {name: 1.1 * value for name, value in DRIVE.items()}
    fit = fp.estimate(model, record, start=start, noise={"q1": 1e-3, "w2": 1e-3})
    off = [(fit.estimate[name] - value) / fit.standard_errors[name] for name, value in DRIVE.items()]
    assert fit.converged and np.max(np.abs(off)) < 4
    part = record[200:]
    later = fp.simulate_record(model, part.t, part.u, theta, done.x[200])
    np.testing.assert_allclose(later.x[-1], done.x[-1], atol=1e-5)


def test_models_keep_their_updates() -> None:
    model = doses()
    assert "each segment: d = d + dose" in str(model)
    runs = fp.Runs([[0.0, 0.0]], [[[5.0], [1.0]]], 1.0)
    theta = np.array([1.0, 0.3, 5.0])
    expected = fp.simulate(model, runs, theta).y
    for other in (pickle.loads(pickle.dumps(model)), model_from_toml(model.to_toml()), model.within("c < 100")):
        np.testing.assert_array_equal(fp.simulate(other, runs, theta).y, expected)
    assert pickle.loads(pickle.dumps(model)) == model != doses(resets={"each segment": {"d": "d + 2*dose"}})
    np.testing.assert_allclose(fp.simulate(model.fix(V=5.0), runs, theta[:2]).y, expected, rtol=1e-14)
    freed = model.free_start("d")
    moved = fp.sensitivities(freed, runs, [*theta, 0.0], rtol=1e-10)
    above, below = (fp.simulate(freed, runs, [*theta, by], rtol=1e-12).y for by in (1e-4, -1e-4))
    np.testing.assert_allclose(moved.dy_dtheta[..., 3], (above - below) / 2e-4, atol=1e-8)
    started = fp.simulate(model, fp.Runs([[0.5, 0.0]], runs.u, 1.0), theta, rtol=1e-10).y
    np.testing.assert_allclose(fp.simulate(freed, runs, [*theta, 0.5], rtol=1e-10).y, started, atol=1e-8)


def test_doses_are_designed() -> None:
    model = doses()
    prior = fp.GaussianPrior({"ka": 1.0, "ke": 0.3, "V": 5.0}, relative_std={"ka": 0.2, "ke": 0.2, "V": 0.2})
    region = fp.RunRegion({"d": (0, 0), "c": (0, 0), "dose": (0, 4), "dt": (0.3, 4)}, segments=4)
    problem = fp.DesignProblem(model, prior, region, noise={"y": 0.02})
    design = fp.design_runs(problem, 1, n_starts=2, n_candidates=60)
    by_runs = fp.evaluate(problem, fp.Runs([[0.0, 0.0]], [[[4.0], [0.0], [0.0], [0.0]]], 1.0)).log_det
    assert design.log_det > by_runs


@pytest.mark.parametrize(
    ("resets", "message"),
    [
        ({"each segment": {"q": "1"}}, r"resets\.'each segment': expected names of states, d, c; given unknown 'q'"),
        ({"each segment": {"d": "d + dos"}}, r"resets\.'each segment'\.d: .*given 'dos'"),
        ({"every now": {"d": "0"}}, r"resets\.'every now': expected a time with its unit, as 5 ms, given 'now'"),
        ({"every 5": {"d": "0"}}, r"resets\.'every 5': expected a time with its unit, as 5 ms, given '5'"),
        ({"every 5 kg": {"d": "0"}}, r"resets\.'every 5 kg': expected a unit of time, given 'kg'"),
        ({"every 0 s": {"d": "0"}}, r"resets\.'every 0 s': expected a period of more than 0 s, given 0"),
        ({"at noon": {"d": "0"}}, r"resets\.'at noon': expected a time with its unit, as 5 ms, given 'noon'"),
        ({"each segment": {}}, r"resets: expected a condition or times with the states that it sets"),
        ([("each segment", 3)], r"resets: expected a condition or times with the states that it sets"),
        ({5.0: {"d": "0"}}, r"resets\.5\.0: expected a condition such as x < 0, given 5\.0"),
        ({"each segment": {"d": "latch(c > 1, c < 0.5)"}}, r"resets\.'each segment'\.d: expected no latch"),
    ],
)
def test_mistakes_in_updates(resets: Any, message: str) -> None:
    with pytest.raises((ValueError, TypeError), match=message):
        doses(resets=resets)


def test_what_has_no_updates_refuses_them() -> None:
    model, prior = doses(), fp.GaussianPrior({"ka": 1.0, "ke": 0.3, "V": 5.0}, relative_std={"ka": 0.2, "ke": 0.2, "V": 0.2})
    with pytest.raises(ValueError, match="region: expected a RunRegion for a model with updates"):
        fp.DesignProblem(
            model, prior, fp.ExperimentRegion({"d": (0, 1), "c": (0, 1), "dose": (0, 1), "dt": (1, 2)}), noise={"y": 1.0}
        )
    with pytest.raises(ValueError, match="rest: expected a model without updates"):
        fp.RunRegion({"d": (0, 1), "c": (0, 1), "dose": (0, 1), "dt": (1, 2)}, segments=2, rest=fp.Rest({"dose": 0.0})).check(model)
