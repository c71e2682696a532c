"""States that are set anew where a trajectory also slides, rests, meets several jumps at once, or enters a branch with limits."""

from __future__ import annotations

import numpy as np
import pytest

import fisherpoint as fp

pytestmark = pytest.mark.kernels


def points_of(x0: list[float], u: list[float], *dt: float) -> fp.Experiments:
    return fp.Experiments([x0] * len(dt), np.array([u] * len(dt)).reshape(len(dt), len(u)), list(dt))


def piston() -> fp.SymbolicModel:
    states, parameters = {"x": "m", "v": "m/s"}, {"m": "kg", "e": "1"}
    return fp.SymbolicModel(
        ["v", "F/m"], ["x"], states, {"F": "N"}, parameters, {"x": "m"}, resets={"x < 0 and v < 0": {"v": "-e*v"}}
    )


def test_two_that_are_set_anew_in_one_instant_end_with_a_status() -> None:
    balls = fp.SymbolicModel(
        ["v", "-g", "w", "-g"],
        ["x", "z"],
        {"x": "m", "v": "m/s", "z": "m", "w": "m/s"},
        {},
        {"g": "m/s2", "e": "1"},
        {"x": "m", "z": "m"},
        resets={"x < 0": {"v": "-e*v"}, "z < 0": {"w": "-e*w"}},
    )
    together, apart = points_of([1.0, 0.0, 1.0, 0.0], [], 0.4, 0.6), points_of([1.0, 0.0, 1.01, 0.0], [], 0.4, 0.6)
    for run in (fp.simulate, fp.sensitivities):
        assert run(balls, together, [9.81, 0.8]).status.tolist() == [fp.Status.ok, fp.Status.two_jumps]
        assert run(balls, apart, [9.81, 0.8]).status.tolist() == [fp.Status.ok, fp.Status.ok]


def test_a_jump_in_the_instant_of_a_reset_ends_with_a_status() -> None:
    model = fp.SymbolicModel(
        ["a*where(x > 1, 2, 1)", "a"],
        ["x + z"],
        {"x": "1", "z": "1"},
        {},
        {"a": "1/s"},
        {"y": "1"},
        resets={"z > 1": {"z": "0"}},
    )
    done = fp.sensitivities(model, points_of([0.0, 0.0], [], 0.5, 2.0), [1.0])
    assert done.status.tolist() == [fp.Status.ok, fp.Status.two_jumps]
    done = fp.sensitivities(model, points_of([0.0, 0.5], [], 0.75, 2.0), [1.0], rtol=1e-9)
    assert not done.status.any()
    np.testing.assert_allclose(done.x, [[0.75, 0.25], [3.0, 0.5]], rtol=1e-8)


@pytest.mark.parametrize("start", [0, 1])
def test_a_latch_releases_what_sticks(start: int) -> None:
    """A body sticks until a latch of the heat adds a force that friction does not hold, or takes one off."""
    force = "3*f*latch(T > 1, T < 0)" if start == 0 else "3*f*(1 - latch(T > 1, T < 0))"
    model = fp.SymbolicModel(
        [f"{force} + F - mu*sign(v)", "r"],
        ["v"],
        {"v": "m/s", "T": "1"},
        {"F": "m/s2"},
        {"mu": "m/s2", "f": "m/s2", "r": "1/s"},
        {"v": "m/s"},
        check_units=False,
    )
    done = fp.sensitivities(model, points_of([0.0, 0.0], [0.5], 0.5, 2.5), [1.0, 1.0, 0.8], rtol=1e-9)
    assert not done.status.any()
    if start == 0:  # 1.5 behind 1.25 seconds... v = (3 f + F - mu) (t - 1/r)
        np.testing.assert_allclose(done.x[:, 0], [0.0, 2.5 * 1.25], atol=1e-8)
        np.testing.assert_allclose(done.dx_dtheta[1, 0], [-1.25, 3 * 1.25, 2.5 / 0.8**2], rtol=1e-7)
        np.testing.assert_allclose(done.dx_dtheta[0, 0], 0.0, atol=1e-9)
    else:  # v rises by 2.5 until 1.25 s, then falls by 0.5
        np.testing.assert_allclose(done.x[:, 0], [1.25, 2.5 * 1.25 - 0.5 * 1.25], rtol=1e-8)
        np.testing.assert_allclose(done.dx_dtheta[1, 0], [-2.5, 3.75, -3.0 / 0.8**2], rtol=1e-7)


def test_what_is_used_up_is_filled_again() -> None:
    model = fp.SymbolicModel(
        ["-k*where(x > 0, 1, 0)"],
        ["x"],
        {"x": "1"},
        {},
        {"k": "1/s", "A": "1", "tau": "s"},
        {"x": "1"},
        resets={"t > tau": {"x": "A"}},
    )
    done = fp.sensitivities(model, points_of([1.0], [], 0.5, 1.5, 2.5, 4.0), [1.0, 1.0, 2.0], rtol=1e-9)
    assert not done.status.any()
    np.testing.assert_allclose(done.x[:, 0], [0.5, 0.0, 0.5, 0.0], atol=1e-9)
    np.testing.assert_allclose(done.dx_dtheta[:, 0], [[-0.5, 0, 0], [0, 0, 0], [-0.5, 1, 1], [0, 0, 0]], atol=1e-7)


def test_a_reset_enters_a_branch_with_a_root() -> None:
    model = fp.SymbolicModel(
        ["-k*where(h > c, sqrt(h - c), 0)"],
        ["h"],
        {"h": "m"},
        {},
        {"k": "1", "c": "m"},
        {"h": "m"},
        resets={"t > 1": {"h": "5"}},
        check_units=False,
    )
    done = fp.sensitivities(model, points_of([0.5], [], 0.5, 2.0), [1.0, 1.0], rtol=1e-9)
    assert not done.status.any()
    np.testing.assert_allclose(done.x[:, 0], [0.5, 1.0 + 1.5**2], rtol=1e-8)
    np.testing.assert_allclose(done.dx_dtheta[:, 0], [[0.0, 0.0], [-1.5, 1 - 1.5 / 2]], rtol=1e-7)
    back = fp.SymbolicModel(
        ["-k*where(h > c, sqrt(h - c), 0)"],
        ["h"],
        {"h": "m"},
        {},
        {"k": "1", "c": "m"},
        {"h": "m"},
        resets={"t > 1": {"h": "c/2"}},
        check_units=False,
    )
    done = fp.sensitivities(back, points_of([5.0], [], 0.5, 2.0), [1.0, 1.0], rtol=1e-9)
    assert not done.status.any()
    np.testing.assert_allclose(done.x[:, 0], [1.0 + 1.75**2, 0.5], rtol=1e-8)


def test_a_reset_out_of_the_domain_is_left_domain() -> None:
    model = fp.SymbolicModel(
        ["-k*sqrt(h)"], ["h"], {"h": "m"}, {}, {"k": "1"}, {"h": "m"}, resets={"t > 1": {"h": "h - 2"}}, check_units=False
    )
    done = fp.simulate(model, points_of([4.0], [], 0.5, 2.0), [1.0])
    assert done.status.tolist() == [fp.Status.ok, fp.Status.left_domain]


def test_a_mass_at_rest_on_its_stop_does_not_fall_through() -> None:
    lifted, pushed = points_of([0.0, 0.0], [2.0], 1.0), points_of([0.0, 0.0], [-2.0], 1.0)
    for model in (
        piston(),
        fp.SymbolicModel(
            ["v", "F/m"],
            ["x"],
            {"x": "m", "v": "m/s"},
            {"F": "N"},
            {"m": "kg", "e": "1"},
            {"x": "m"},
            resets={"x < 0": {"v": "-e*v"}},
        ),
    ):
        np.testing.assert_allclose(fp.simulate(model, lifted, [1.0, 0.5], rtol=1e-9).x[0], [1.0, 2.0], rtol=1e-8)
        fallen = fp.simulate(model, pushed, [1.0, 0.5])
        assert fallen.status[0] != fp.Status.ok, fallen.x
        for force, lasts in ((2.0, True), (-2.0, False)):  # after a second without force
            runs = fp.Runs([[0.0, 0.0]], [[[0.0], [force]]], [[1.0, 1.0]])
            done = fp.simulate(model, runs, [1.0, 0.5], rtol=1e-9)
            assert (done.status[0] == fp.Status.ok) == lasts, (force, done.x)
            if lasts:
                np.testing.assert_allclose(done.x[0, -1], [1.0, 2.0], rtol=1e-8)


def test_new_values_are_made_of_the_states_just_before() -> None:
    """Derivatives too, where a state is set to another one, or to a multiple of itself."""
    states, parameters = {"x": "1", "z": "1"}, {"A": "1", "tau": "s", "a": "1/s"}
    model = fp.SymbolicModel(
        ["-a*x", "0.5"], ["x"], states, {}, parameters, {"x": "1"}, resets={"t > tau": {"x": "A*z", "z": "A*x"}}, check_units=False
    )
    done = fp.sensitivities(model, points_of([2.0, 3.0], [], 1.5), [0.3, 1.0, 0.7], rtol=1e-10)
    x, z, lasts = 2 * np.exp(-0.7), 3.5, np.exp(-0.35)
    np.testing.assert_allclose(done.x[0], [0.3 * z * lasts, 0.3 * x + 0.25], rtol=1e-8)
    expected = [
        [z * lasts, 0.3 * lasts * (0.5 + 0.7 * z), -0.3 * z * 0.5 * lasts],
        [x, -0.3 * 0.7 * x - 0.5, -0.3 * x],
    ]
    np.testing.assert_allclose(done.dx_dtheta[0], expected, rtol=1e-7)
