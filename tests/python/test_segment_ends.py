"""Jumps that a run or record meets just where a segment ends, as it does on nice numbers: rounding must not decide what S is."""

from __future__ import annotations

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.estimation.response import RecordResponse

pytestmark = [pytest.mark.kernels, pytest.mark.filterwarnings("ignore:.* expected its natural size")]

Array = np.ndarray

ONE = ("level", "count")


def counter(rate: str = "-r") -> fp.SymbolicModel:
    """It counts once the level has fallen to zero."""
    return fp.SymbolicModel(
        [rate, "where(level <= 0, b*u, 0)"],
        ["count"],
        dict.fromkeys(ONE, "1"),
        {"u": "1"},
        dict.fromkeys("rb", "1/s"),
    )


def shifted(value: float, ulps: int) -> float:
    for _ in range(abs(ulps)):
        value = float(np.nextafter(value, np.copysign(np.inf, ulps)))
    return value


def along_run(model: fp.Model, x0: list[float], u: Array, dt: float, theta: Array, measured: list[int]) -> tuple[Array, Array]:
    """dy/dtheta at the ends, and the status."""
    flags = np.isin(np.arange(len(u)), np.array(measured) % len(u))
    done = fp.sensitivities(model, fp.Runs([x0], u[None, :, None], dt, [flags.tolist()]), theta)
    return done.dy_dtheta[0], done.status[0]


def along_record(model: fp.Model, x0: list[float], u: Array, dt: float, theta: Array) -> tuple[Array, Array]:
    names = [q.name for q in model.states]
    y = np.zeros((len(u) + 1, len(model.outputs)))
    record = fp.Record(np.arange(len(u) + 1) * dt, np.append(u, u[-1]), y, x0=dict(zip(names, x0, strict=True)))
    done = RecordResponse(model, record, range(len(theta)))(theta[None], np.array([x0]))
    return done.dy[0, 1:], done.status[0]


GRIDS = [(30, 0.1, 2.0), (2, 0.25, 3.0), (7, 0.05, 3.0), (3, 0.1, 1.0), (12, 0.1, 0.7), (9, 0.2, 0.1), (17, 0.01, 1.5)]


@pytest.mark.parametrize(("n", "dt", "r"), GRIDS)
@pytest.mark.parametrize("ulps", [-2, -1, 0, 1, 2])
def test_an_event_at_the_end_of_a_segment_keeps_its_jump(n: int, dt: float, r: float, ulps: int) -> None:
    model, theta, start = counter(), np.array([r, 1.0]), shifted(r * n * dt, ulps)
    u, end = np.ones(n + 5), (n + 5) * dt
    right = [start / r**2, end - start / r]
    dy, status = along_run(model, [start, 0.0], u, dt, theta, [-1])
    assert status == fp.Status.ok
    np.testing.assert_allclose(dy[-1, 0], right, rtol=1e-6)
    dy, status = along_record(model, [start, 0.0], u, dt, theta)
    assert status == fp.Status.ok
    np.testing.assert_allclose(dy[-1, 0], right, rtol=1e-6)


@pytest.mark.parametrize("ulps", [-1, 0, 1])
def test_of_an_input_that_changes_then_the_order_matters_where_f_reads_it(ulps: int) -> None:
    n, dt, r = 8, 0.25, 1.5
    start = shifted(r * n * dt, ulps)
    u = np.where(np.arange(n + 4) < n, 1.0, 2.0)
    # The counter runs at another speed behind that instant than before: earlier or later is not the same.
    assert along_run(counter(), [start, 0.0], u, dt, np.array([r, 1.0]), [-1])[1] == fp.Status.on_jump
    assert along_record(counter(), [start, 0.0], u, dt, np.array([r, 1.0]))[1] == fp.Status.on_jump
    # Where the input acts on what neither counts nor empties, it is the same.
    other = fp.SymbolicModel(
        ["-r", "where(level <= 0, b, 0)", "u - z"],
        ["count", "z"],
        dict.fromkeys((*ONE, "z"), "1"),
        {"u": "1"},
        dict.fromkeys("rb", "1/s"),
    )
    for dy, status in (
        along_run(other, [start, 0.0, 0.0], u, dt, np.array([r, 1.0]), [-1]),
        along_record(other, [start, 0.0, 0.0], u, dt, np.array([r, 1.0])),
    ):
        assert status == fp.Status.ok
        np.testing.assert_allclose(dy[-1, 0], [start / r**2, (n + 4) * dt - start / r], rtol=1e-6)


@pytest.mark.parametrize("ulps", [-1, 0, 1])
def test_a_sample_at_a_jump_has_derivatives_unless_its_outputs_feel_it(ulps: int) -> None:
    n, dt, r = 6, 0.5, 2.0
    start, theta = shifted(r * n * dt, ulps), np.array([r, 1.0])
    dy, status = along_run(counter(), [start, 0.0], np.ones(n + 2), dt, theta, [n - 1, -1])
    assert status == fp.Status.ok and not dy[n - 1].any()  # which has no derivative
    np.testing.assert_allclose(dy[-1, 0], [start / r**2, (n + 2) * dt - start / r], rtol=1e-6)
    level = fp.SymbolicModel(
        ["-r", "where(level <= 0, b*u, 0)"], ["level"], dict.fromkeys(ONE, "1"), {"u": "1"}, dict.fromkeys("rb", "1/s")
    )
    dy, status = along_run(level, [start, 0.0], np.ones(n + 2), dt, theta, [n - 1, -1])
    assert status == fp.Status.ok
    np.testing.assert_allclose(dy[[n - 1, -1], 0], [[-n * dt, 0.0], [-(n + 2) * dt, 0.0]], rtol=1e-9, atol=1e-12)


def cart() -> fp.SymbolicModel:
    return fp.SymbolicModel(["v", "a*u - c*sign(v)"], ["s", "v"], {"s": "m", "v": "m/s"}, {"u": "1"}, {"a": "m/s2", "c": "m/s2"})


@pytest.mark.parametrize(("n", "dt", "c"), [(3, 0.1, 1.0), (7, 0.05, 3.0), (4, 0.25, 0.5), (11, 0.1, 0.7)])
@pytest.mark.parametrize("ulps", [-1, 0, 1])
def test_a_mass_comes_to_rest_at_the_end_of_a_segment(n: int, dt: float, c: float, ulps: int) -> None:
    v0, theta = shifted(c * n * dt, ulps), np.array([2.0, c])
    u = np.zeros(n + 6)
    stays = [[0.0, -(v0**2) / (2 * c**2)], [0.0, 0.0]]
    for dy, status in (
        along_run(cart(), [0.0, v0], u, dt, theta, [-1]),
        along_record(cart(), [0.0, v0], u, dt, theta),
    ):
        assert status == fp.Status.ok
        np.testing.assert_allclose(dy[-1], stays, rtol=1e-6, atol=1e-12)
        assert not dy[-1, 1].any()  # exactly
    # Pushed on some segments later: by then it rests whatever c is.
    u[n + 2 :] = (c + 1.0) / 2.0
    rest = 4 * dt
    moves = [[rest**2 / 2 * u[-1], stays[0][1] - rest**2 / 2], [rest * u[-1], -rest]]
    for dy, status in (
        along_run(cart(), [0.0, v0], u, dt, theta, [-1]),
        along_record(cart(), [0.0, v0], u, dt, theta),
    ):
        assert status == fp.Status.ok
        np.testing.assert_allclose(dy[-1], moves, rtol=1e-6, atol=1e-12)
    # Pushed on in the very instant: with less friction it is still moving then.
    u[n:] = (c + 1.0) / 2.0
    assert along_run(cart(), [0.0, v0], u, dt, theta, [-1])[1] == fp.Status.on_jump
    assert along_record(cart(), [0.0, v0], u, dt, theta)[1] == fp.Status.on_jump
    # Pushed with less than the friction it rests in any case.
    u[n:] = c / 4.0
    dy, status = along_run(cart(), [0.0, v0], u, dt, theta, [-1])
    assert status == fp.Status.ok
    np.testing.assert_allclose(dy[-1], stays, rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize("ulps", [-1, 0, 1])
def test_of_a_threshold_that_an_input_moves(ulps: int) -> None:
    """The level is at the old threshold when that is moved: the next segment has another one."""
    model = fp.SymbolicModel(["r", "where(x > u, b, 0)"], ["y"], dict.fromkeys("xy", "1"), {"u": "1"}, dict.fromkeys("rb", "1/s"))
    n, dt, r = 5, 0.2, 1.0
    u = np.full(n + 5, shifted(r * n * dt, ulps))
    theta, end = np.array([r, 1.0]), (n + 5) * dt
    dy, status = along_run(model, [0.0, 0.0], u, dt, theta, [-1])
    assert status == fp.Status.ok
    np.testing.assert_allclose(dy[-1, 0], [u[0] / r**2, end - u[0] / r], rtol=1e-6)
    u[n:] = 1.5
    assert along_run(model, [0.0, 0.0], u, dt, theta, [-1])[1] == fp.Status.on_jump
    u[n:] = u[0]
    u[:2] = 3.0  # earlier it makes no difference
    dy, status = along_run(model, [0.0, 0.0], u, dt, theta, [-1])
    assert status == fp.Status.ok
    np.testing.assert_allclose(dy[-1, 0], [u[-1] / r**2, end - u[-1] / r], rtol=1e-6)


@pytest.mark.parametrize(("n", "dt", "r"), [(30, 0.1, 2.0), (2, 0.25, 3.0), (7, 0.05, 3.0)])
@pytest.mark.filterwarnings("ignore")
def test_what_python_functions_jump_at_is_refused(n: int, dt: float, r: float) -> None:
    """Jumps of a CallableModel are not crossed, wherever they are met."""
    model = fp.CallableModel(
        lambda x, u, p: [-p.r + 0 * x.level, np.where(x.level.real <= 0, p.b, 0) + 0 * x.count],
        lambda x, u, p: [x.count],
        dict.fromkeys(ONE, "1"),
        {"u": "1"},
        dict.fromkeys("rb", "1/s"),
        jumps={"level": lambda x, u, p: x.level},
    )
    done = fp.sensitivities(model, fp.Runs([[r * n * dt, 0.0]], np.ones((1, n + 2, 1)), dt), [r, 1.0])
    assert done.status[0] == fp.Status.met_jump and done.reached[0] <= n
