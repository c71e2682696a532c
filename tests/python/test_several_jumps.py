"""Several jumps at once: in one instant, and sliding along all of them."""

from __future__ import annotations

import os
from collections.abc import Callable

import numpy as np
import pytest

import fisherpoint as fp
from filippov import NoAnswer, derivatives
from filippov_several import course_of_several
from remembered import remembered
from several_cases import CASES, infusions

pytestmark = [pytest.mark.kernels, pytest.mark.filterwarnings("ignore:.* expected its natural size")]

Array = np.ndarray

COUNT = int(os.environ.get("FISHERPOINT_JUMP_POINTS", "0"))
"""Random points of each system; 0 for a few."""


@pytest.mark.long
@pytest.mark.parametrize(("name", "few"), [("axes", 10), ("arm", 10), ("platform", 2)])
def test_joints_and_legs_start_from_rest_and_come_to_rest(name: str, few: int) -> None:
    """Half of the starts are at rest. None is refused."""
    case, count = CASES[name](), COUNT or few
    x0, u, p, dt = case.draw(np.random.default_rng(1), count)
    points = fp.Experiments(x0, u, dt)
    states = fp.simulate(case.model, points, p, rtol=1e-10)
    done = fp.sensitivities(case.model, points, p, rtol=1e-9)
    assert not states.status.any() and not done.status.any()
    changes = several = 0
    for k in range(count):
        point = x0[k], u[k], p[k], dt[k]
        try:
            beside = remembered(lambda point=point: course_of_several(case.system, *point), "course", name, *point)
        except NoAnswer:
            continue
        changes += len(beside.met)
        several += np.count_nonzero(np.abs(case.system.h(done.x[k], u[k], p[k])) < 1e-12) > 1
        assert np.max(np.abs(states.x[k] - beside.x)) < 1e-8, k
        assert np.max(np.abs(done.x[k] - beside.x)) < 1e-8, k
        if name == "platform" and k % 4:
            continue
        s, error = remembered(
            lambda point=point, beside=beside: derivatives(case.system, *point, beside, follow=course_of_several),
            "derivatives", name, *point,
        )  # fmt: skip
        off = np.max(np.abs(done.dx_dtheta[k] - s) - 2 * error, axis=0)
        size = np.max(np.abs(s), axis=0)
        assert (off <= 1e-6 * size + 1e-8)[~np.isnan(off)].all(), (k, off, size)
    assert changes > count / 3 and several >= count / 10


@pytest.mark.parametrize("name", ["arm", "platform"])
def test_what_rests_has_no_sensitivity_of_its_velocity(name: str) -> None:
    """To the last bit, as rounding would look like information."""
    case = CASES[name]()
    x0, _, p, _ = case.draw(np.random.default_rng(2), 4)
    n = len(case.system.size) // 2
    x0[:, n:] = 0.0
    points = fp.Experiments(x0, np.zeros((4, 2)), np.full(4, 0.5))
    p[:, -1] *= 0.1 if name == "platform" else 1.0  # a weak spring
    done = fp.sensitivities(case.model, points, p)
    assert not done.status.any() and not done.dx_dtheta[:, n:].any()
    np.testing.assert_allclose(done.x, x0, atol=1e-15)


def test_the_bits_do_not_depend_on_neighbours() -> None:
    case = CASES["arm"]()
    x0, u, p, dt = case.draw(np.random.default_rng(3), 60)
    order = np.random.default_rng(0).permutation(60)
    once = fp.sensitivities(case.model, fp.Experiments(x0, u, dt), p)
    other = fp.sensitivities(case.model, fp.Experiments(x0[order], u[order], dt[order]), p[order])
    assert all(np.array_equal(a[order], b) for a, b in zip(once, other, strict=True))


def test_axes_that_come_to_rest_in_the_same_instant() -> None:
    axes = fp.SymbolicModel(
        ["v", "w", "-p*sign(v)", "-p*sign(w)"], ["x", "y"], dict.fromkeys(("x", "y", "v", "w"), "1"), {"u": "1"}, {"p": "1"}
    )
    starts = [[0.0, 0.0, 1.0, 1.0], [0.0, 0.0, 1.0, -1.0], [0.0, 0.0, 1.0, 0.5], [0.0, 0.0, 0.0, 0.0]]
    done = fp.sensitivities(axes, fp.Experiments(starts, [[0.0]] * 4, [2.0] * 4), [1.0])
    assert not done.status.any()
    distance = np.array([[0.5, 0.5], [0.5, -0.5], [0.5, 0.125], [0.0, 0.0]])
    np.testing.assert_allclose(done.y, distance, atol=1e-9)
    np.testing.assert_allclose(done.dy_dtheta[:, :, 0], -distance, atol=1e-8)
    assert not done.dx_dtheta[:, 2:].any()


PULSES = "where(clock < T1, R1, 0) + where((clock >= s2) and (clock < s2 + T2), R2, 0) - k*c"


def compartment(*estimated: str) -> fp.SymbolicModel:
    nominal = {"T1": 2.0, "s2": 2.0, "T2": 1.0, "R1": 0.5, "R2": 1.0, "k": 0.3}
    return fp.SymbolicModel(
        ["1", PULSES],
        ["c"],
        {"clock": "s", "c": "1"},
        {},
        dict.fromkeys(estimated, "1"),
        constants={name: (value, "1") for name, value in nominal.items() if name not in estimated},
        check_units=False,
    )


def differences(value: Callable[[Array], float], theta: Array) -> Array:
    step = 1e-5
    return np.array([(value(theta + step * e) - value(theta - step * e)) / (2 * step) for e in np.eye(len(theta))])


def test_infusions_back_to_back_on_a_grid_of_nice_numbers() -> None:
    """The first ends where the second begins, and all of these times are estimated."""
    names = ("T1", "s2", "T2", "R1", "R2", "k")
    model, rng = compartment(*names), np.random.default_rng(0)
    count = COUNT or 30
    T1 = rng.integers(1, 30, count) / 10
    s2 = np.where(np.arange(count) % 3 > 0, T1, rng.integers(1, 30, count) / 10)
    T2 = np.where(np.arange(count) % 5 == 0, np.maximum(T1 - s2, 0.1), rng.integers(1, 20, count) / 10)
    theta = np.column_stack([T1, s2, T2, rng.uniform(0.5, 2, count), rng.uniform(0.5, 2, count), rng.uniform(0.1, 1, count)])
    ends = np.maximum(T1, s2 + T2) + rng.integers(1, 30, count) / 10
    done = fp.sensitivities(model, fp.Experiments(np.zeros((count, 2)), np.empty((count, 0)), ends), theta, rtol=1e-10)
    assert not done.status.any(), done.statuses
    for k in range(count):
        value = lambda row, k=k: infusions(*row, ends[k])  # noqa: E731
        assert done.y[k, 0] == pytest.approx(value(theta[k]), abs=1e-8)
        np.testing.assert_allclose(done.dy_dtheta[k, 0], differences(value, theta[k]), rtol=1e-6, atol=1e-8)


def test_where_the_order_of_two_jumps_matters() -> None:
    """Two thresholds are met at once; behind the first one the way to the second is slower."""
    rates = ["where(x > a, p/2, p)", "where(x > a, p/2, p) + where(y > b, p, 0)"]
    model = fp.SymbolicModel(rates, ["y"], dict.fromkeys("xy", "1"), {"u": "1"}, dict.fromkeys("abp", "1"))
    points = fp.Experiments([[0.0, 0.0]] * 2, [[0.0]] * 2, [4.0] * 2)
    states = fp.simulate(model, points, [[1.0, 1.0, 1.0], [1.0, 1.2, 1.0]], rtol=1e-10)
    np.testing.assert_allclose(states.x, [[2.5, 5.5], [2.5, 1.2 + 1.5 * 2.6]], atol=1e-8)
    done = fp.sensitivities(model, points, [[1.0, 1.0, 1.0], [1.0, 1.2, 1.0]])
    assert done.status.tolist() == [fp.Status.two_jumps, fp.Status.ok]
    # Where neither touches the other's rate the jumps add.
    apart = fp.SymbolicModel(
        ["p", "p", "where(x > a, 1, 0) + where(y > b, 2, 0)"],
        ["z"],
        dict.fromkeys("xyz", "1"),
        {"u": "1"},
        dict.fromkeys("abp", "1"),
    )
    done = fp.sensitivities(apart, fp.Experiments([[0.0] * 3], [[0.0]], [4.0]), [1.0, 1.0, 1.0])
    assert done.status[0] == fp.Status.ok and done.y[0, 0] == pytest.approx(9.0)
    np.testing.assert_allclose(done.dy_dtheta[0, 0], [-1.0, -2.0, 3.0], rtol=1e-9)


def test_one_condition_in_two_forms_that_are_no_multiples() -> None:
    """k*c > k*c_m and c > c_m: met together, whatever k is."""
    model = fp.SymbolicModel(
        ["1", "where(k*c > k*c_m, a, 0) + where(c > c_m, b, 0)"],
        ["x"],
        dict.fromkeys("cx", "1"),
        {"u": "1"},
        dict.fromkeys(("a", "b", "c_m", "k"), "1"),
        check_units=False,
    )
    assert len(model.jumps) == 2
    done = fp.sensitivities(
        model, fp.Experiments([[0.0, 0.0]] * 2, [[0.0]] * 2, [3.0] * 2), [[0.5, 2.0, 1.0, 3.0], [0.5, 2.0, 1.0, -3.0]]
    )
    assert not done.status.any()
    np.testing.assert_allclose(done.y[:, 0], [2.5 * 2.0, 0.5 + 4.0], rtol=1e-9)
    np.testing.assert_allclose(done.dy_dtheta[:, 0], [[2.0, 2.0, -2.5, 0.0], [1.0, 2.0, -1.5, 0.0]], rtol=1e-8, atol=1e-9)


def test_f_that_is_not_one_sum_over_the_sides_has_no_slide_on_several() -> None:
    """Friction of one axis that hangs on the side of the other: on both, f is not known."""
    model = fp.SymbolicModel(["-p*sign(v)*(1 + sign(w)/4)", "-p*sign(w)"], ["v"], {"v": "1", "w": "1"}, {"u": "1"}, {"p": "1"})
    done = fp.simulate(model, fp.Experiments([[1.0, 0.5], [1.0, 3.0]], [[0.0]] * 2, [2.0] * 2), [1.0])
    assert done.status.tolist() == [fp.Status.two_jumps, fp.Status.ok]
    np.testing.assert_allclose(done.x[1], [0.0, 1.0], atol=1e-9)


@pytest.mark.long
@pytest.mark.parametrize("name", ["arm", "platform"])
def test_runs_go_on_from_segment_to_segment(name: str) -> None:
    """What holds goes on to hold, lets go when the input changes, and comes to rest again."""
    case, rng, segments = CASES[name](), np.random.default_rng(4), 4
    count, derivatives = (2, [0, 3]) if name == "arm" else (1, [1])
    x0, _, p, _ = case.draw(rng, count)
    n = len(case.system.size) // 2
    x0[:, n:] = 0.0
    u = rng.uniform(-1.5, 1.5, (count, segments, 2)) * np.array([0.05, 1.0, 0.0, 1.0])[:, None]
    runs = fp.Runs(x0, u, 0.2, np.ones((count, segments), dtype=bool).tolist())

    def end(theta: Array, k: int) -> Array:
        def follow() -> Array:
            x = x0[k]
            for segment in range(segments):
                x = course_of_several(case.system, x, u[k, segment], theta, 0.2).x
            return x

        return remembered(follow, "end", name, x0[k], u[k], theta)

    for k in range(count):
        done = fp.sensitivities(case.model, runs[[k]], p[k], rtol=1e-9)
        assert done.status[0] == fp.Status.ok
        states = fp.simulate(case.model, runs[[k]], p[k], rtol=1e-10)
        np.testing.assert_allclose(states.x[0, -1], end(p[k], k), atol=1e-8)
        np.testing.assert_allclose(done.x[0, -1], end(p[k], k), atol=1e-8)
        for j in derivatives:
            step = 1e-4 * p[k, j] * np.eye(p.shape[1])[j]
            slope = (end(p[k] + step, k) - end(p[k] - step, k)) / (2 * step[j])
            np.testing.assert_allclose(done.dx_dtheta[0, -1, :, j], slope, rtol=1e-5, atol=3e-6)


def test_every_node_of_a_prior_goes_its_own_way() -> None:
    """Some nodes stick in one joint, others in both."""
    case = CASES["arm"]()
    prior = fp.GaussianPrior(dict(zip("abdce", [3.0, 0.4, 0.8, 0.7, 0.25], strict=True)), relative_std=dict.fromkeys("abdce", 0.1))
    rule = fp.SparseGaussHermite(2)
    points = fp.Experiments([[0.2, 0.5, 0.0, 0.0], [0.1, -0.4, 0.5, -0.3]], [[0.75, 0.2], [0.0, 0.0]], [1.0, 1.5])
    done = fp.predictive_covariance(case.model, points, prior, rule, rtol=1e-9)
    assert not done.status.any()
    nodes, weights = rule.nodes(prior)
    y = fp.simulate(case.model, points, prior.mean, rtol=1e-10).y
    for k in range(2):
        every = fp.Experiments(*(np.repeat(of[k : k + 1], len(nodes), axis=0) for of in (points.x0, points.u, points.dt)))
        off = fp.simulate(case.model, every, nodes, rtol=1e-10).y - y[k]
        np.testing.assert_allclose(done.covariance[k], (off.T * weights) @ off / weights.sum(), rtol=1e-5, atol=1e-12)
