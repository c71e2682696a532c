"""Predicted outputs of records with their derivatives, against differences and for many sets of unknowns at once."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.estimation.response import RecordResponse
from oracle import Floats
from record_cases import T, U, motor, piecewise, tanks, valve

TANKS = np.array([0.5, 0.4, 0.3, 0.2, 0.6])
MOTOR = np.array([2.0, 0.05, 0.01, 0.002, 0.5])


def record(model: fp.Model, t: Floats = T, u: Floats = U, **known: float) -> fp.Record:
    return fp.Record(t, u, np.ones((len(t), len(model.outputs))), x0=known)


def differences(response: RecordResponse, theta: Floats, x0: Floats) -> Floats:
    """dy by central differences of responses to many sets at once, in the order of the unknowns."""
    steps, starts = 1e-5 * np.abs(theta[response.columns]), 1e-5 * np.maximum(np.abs(x0), 0.1)
    free = [[q.name for q in response.model.states].index(name) for name in response.starts]
    columns = [*[(0, j, h) for j, h in zip(response.columns, steps, strict=True)], *[(1, i, starts[i]) for i in free]]
    sets: tuple[list[Floats], list[Floats]] = ([], [])
    for which, place, h in columns:
        for sign in (1, -1):
            both = theta.copy(), x0.copy()
            both[which][place] += sign * h
            for of, value in zip(sets, both, strict=True):
                of.append(value)
    y, _, status = response(np.array(sets[0]), np.array(sets[1]))
    assert not status.any()
    return np.stack([(y[2 * k] - y[2 * k + 1]) / (2 * h) for k, (_, _, h) in enumerate(columns)], axis=-1)


def check(response: RecordResponse, theta: Floats, x0: Floats, within: float = 1e-6) -> None:
    y, dy, status = response(theta[None], x0[None])
    assert not status.any() and dy.shape == (*y.shape, len(response.columns) + len(response.starts))
    expected = differences(response, theta, x0)
    largest = np.abs(expected).max(axis=(0, 1))
    assert (largest > 0).all()
    assert (np.abs(dy[0] - expected).max(axis=(0, 1)) < within * largest).all()


def test_outputs_are_those_of_the_trajectory() -> None:
    response = RecordResponse(tanks, record(tanks, h1=0.4), [0, 3], 1e-10)
    assert response.starts == ("h2",)
    y, _, status = response(TANKS[None], np.array([[0.4, 0.6]]))
    assert not status.any()
    np.testing.assert_allclose(y[0, :, 0], np.minimum(piecewise(tanks, TANKS, T, U, [0.4, 0.6])[:, 1], 1.0), atol=2e-9)


def test_tanks_through_the_rim_by_parameters_and_starts() -> None:
    check(RecordResponse(tanks, record(tanks), range(5), 1e-10), TANKS, np.array([0.4, 0.6]), 1e-5)


def test_chosen_columns_and_a_known_start() -> None:
    response = RecordResponse(tanks, record(tanks, h2=0.6), [3, 0], 1e-10)
    everything = RecordResponse(tanks, record(tanks), range(5), 1e-10)
    x0 = np.array([[0.4, 0.6]])
    np.testing.assert_array_equal(response(TANKS[None], x0).dy, everything(TANKS[None], x0).dy[..., [3, 0, 5]])


def test_a_motor_whose_outputs_are_its_states() -> None:
    check(RecordResponse(motor, record(motor, T / 10, U - 1), range(5), 1e-11), MOTOR, np.array([0.2, -1.0]))


def test_a_cylinder_with_its_own_kernels() -> None:
    """The piston moves one way all along; the valve opens and closes through its kink."""
    cylinder = fp.HydraulicCylinder(k_u=1)
    t = np.linspace(0.0, 0.04, 21)
    u = np.where(np.arange(21) < 10, 0.5, 0.3)
    theta, x0 = np.array(list(cylinder.nominal.values())), np.array([0.05, 0.1, 8e6, 9e6, -0.02])
    check(RecordResponse(cylinder, record(cylinder, t, u, q=0.05), range(9), 1e-11), theta, x0, 1e-5)


def test_an_output_that_reads_state_input_and_parameter_from_rest_on_a_kink() -> None:
    t, u = np.array([0.0, 0.7, 1.0, 1.1, 2.0, 4.0]), np.array([1.0, 0.5, 2.0, -1.0, 0.0, 0.3])
    check(RecordResponse(valve, record(valve, t, u, s=0.0), [0, 1], 1e-11), np.array([0.4, 2.0]), np.zeros(1))


def test_a_record_at_rest_on_a_kink_is_no_error() -> None:
    response = RecordResponse(valve, record(valve, np.arange(4.0), np.zeros(4)), [0, 1])
    y, dy, status = response(np.array([[0.4, 2.0]]), np.zeros((1, 1)))
    assert not status.any() and not y.any() and np.isfinite(dy).all() and dy[0, 0, 0, 2] == 1.0


def test_rows_do_not_see_each_other(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(0)
    theta, x0 = TANKS * rng.uniform(0.8, 1.2, (5, 5)), rng.uniform(0.3, 0.9, (5, 2))
    response = RecordResponse(tanks, record(tanks), range(5))
    together = response(theta, x0)
    assert not together.status.any()
    for threads in (1, 3):
        response = RecordResponse(tanks, record(tanks), range(5), threads=threads)
        for b in range(5):
            alone = response(theta[b : b + 1], x0[b : b + 1])
            np.testing.assert_array_equal(alone.y[0], together.y[b])
            np.testing.assert_array_equal(alone.dy[0], together.dy[b])
    monkeypatch.setattr("fisherpoint.estimation.response._BLOCK", 35)  # 7 pieces at a time
    np.testing.assert_array_equal(response(theta, x0).dy, together.dy)


def test_bad_rows_beside_good_ones() -> None:
    good = RecordResponse(tanks, record(tanks), range(5))(TANKS[None], np.array([[0.4, 0.6]]))
    theta, x0 = np.tile(TANKS, (5, 1)), np.tile([0.4, 0.6], (5, 1))
    theta[1, 0], x0[2, 1], theta[4, 3] = np.nan, -1.0, -0.2  # the last one empties the tank
    y, dy, status = RecordResponse(tanks, record(tanks), range(5))(theta, x0)
    assert status.tolist() == [0, fp.Status.not_finite, fp.Status.left_domain, 0, fp.Status.left_domain]
    for b in (0, 3):
        np.testing.assert_array_equal(y[b], good.y[0])
        np.testing.assert_array_equal(dy[b], good.dy[0])
    assert not y[[1, 2, 4]].any() and not dy[[1, 2, 4]].any()


def test_a_theta_without_sense_is_a_status() -> None:
    cylinder = fp.HydraulicCylinder()
    theta = np.array([list(cylinder.nominal.values())] * 2)
    theta[0, 2] = -1.0  # a mass
    response = RecordResponse(cylinder, record(cylinder, np.array([0.0, 1e-3]), np.zeros(2)), [0])
    y, _, status = response(theta, np.array([[0.1, 0.1, 9e6, 9e6, 0.2]] * 2))
    assert status.tolist() == [fp.Status.left_domain, fp.Status.ok] and not y[0].any()


def test_a_record_starts_at_rest() -> None:
    cylinder = fp.HydraulicCylinder()
    response = RecordResponse(cylinder, record(cylinder, np.array([0.0, 1e-3]), np.zeros(2)), [0])
    theta = np.array([list(cylinder.nominal.values())])
    assert response(theta, np.array([[0.1, 0.0, 9e6, 9e6, 0.2]])).status.tolist() == [fp.Status.ok]


def test_a_model_without_states() -> None:
    model = fp.SymbolicModel(
        [], ["a*exp(-b*u)", "sqrt(u - c)"], {}, {"u": "1"}, {"a": "1", "b": "1", "c": "1"}, {"y": "1", "z": "1"}
    )
    u = np.array([1.0, 2.0, 3.0])
    response = RecordResponse(model, record(model, np.arange(3.0), u), [1, 0])
    y, dy, status = response(np.array([[2.0, 0.5, 0.5], [2.0, 0.5, 1.5]]), np.empty((2, 0)))
    assert status.tolist() == [fp.Status.ok, fp.Status.left_domain] and response.starts == ()
    np.testing.assert_allclose(y[0], np.column_stack([2 * np.exp(-u / 2), np.sqrt(u - 0.5)]))
    np.testing.assert_allclose(dy[0, :, 0], np.column_stack([-2 * u * np.exp(-u / 2), np.exp(-u / 2)]))
    assert not dy[0, :, 1].any() and not y[1].any()


def test_one_sample() -> None:
    response = RecordResponse(motor, record(motor, np.array([2.0]), np.array([1.0])), [0])
    y, dy, status = response(MOTOR[None], np.array([[0.3, 4.0]]))
    assert not status.any() and y.tolist() == [[[0.3, 4.0]]]
    assert dy[0, 0].tolist() == [[0, 1, 0], [0, 0, 1]]


@pytest.mark.filterwarnings("ignore:CallableModel")
def test_functions_do_what_equations_do() -> None:
    names = {"states": {"s": "1"}, "inputs": {"u": "1"}, "parameters": {"T": "s", "a": "1"}, "outputs": {"flow": "1"}}
    functions = fp.CallableModel(
        lambda x, u, p: [(u.u - x.s - p.a * x.s * (np.real(x.s) > 0)) / p.T],
        lambda x, u, p: x.s + p.a * x.s * u.u,
        kinks={"s": lambda x, u, p: x.s},
        **names,  # type: ignore[arg-type]
    )
    t, u = np.array([0.0, 0.7, 1.0, 1.1, 2.0, 4.0, 5.0]), np.array([0.0, 0.5, 2.0, -1.0, 0.0, 0.3, 0.0])
    theta, x0 = np.array([[0.4, 2.0], [0.3, 1.0]]), np.array([[0.1], [-0.5]])
    one, other = (RecordResponse(model, record(model, t, u), [0, 1], 1e-8)(theta, x0) for model in (valve, functions))
    assert not one.status.any() and not other.status.any()
    np.testing.assert_allclose(other.y, one.y, atol=1e-6)
    np.testing.assert_allclose(other.dy, one.dy, atol=1e-5)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: RecordResponse(tanks, record(tanks, h3=1.0), [0]), "x0: expected names of states"),
        (lambda: RecordResponse(tanks, record(motor), [0]), "y: expected 1 columns"),
        (lambda: RecordResponse(tanks, record(tanks), [5]), "columns: expected different indices below 5"),
        (lambda: RecordResponse(tanks, record(tanks), [1, 1]), "columns: expected different indices"),
        (lambda: RecordResponse(tanks, record(tanks), [0], rtol=2.0), "rtol: expected"),
        (lambda: RecordResponse(tanks, record(tanks), [0])(TANKS[None], np.zeros((2, 2))), r"x0: expected shape \(1, 2\)"),
        (lambda: RecordResponse(tanks, record(tanks), [0])(np.zeros((1, 4)), np.zeros((1, 2))), r"theta: expected shape \(1, 5\)"),
    ],
)
def test_misuse(call: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        call()


def test_a_record_is_asked_for() -> None:
    with pytest.raises(TypeError, match="record: expected Record, given dict"):
        RecordResponse(tanks, {}, [0])  # type: ignore[arg-type]
