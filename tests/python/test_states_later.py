"""Sensitivities of points whose dx/dtheta is computed when it is read: all else of the result is as if it had been there."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.points import simulate

# a brakes to a stop, b decays; the output is b alone, beside four parameters, so that a row is cheaper than columns.
FEW_OUTPUTS = fp.SymbolicModel(
    ["-c*sign(a)", "-k*b + p + q*b**2"], ["b"], dict.fromkeys("ab", ("1", 1.0)), {}, dict.fromkeys("ckpq", "1")
)
EVERY_OUTPUT = fp.SymbolicModel(
    ["-c*sign(a)", "-k*b + p + q*b**2"],
    ["a", "b"],
    dict.fromkeys("ab", ("1", 1.0)),
    {},
    dict.fromkeys("ck", "1") | {"p": "1", "q": "1"},
)
THETA = np.array([1.0, 0.7, 0.2, 0.1])
MODELS = [FEW_OUTPUTS, EVERY_OUTPUT]


def points(*durations: float) -> fp.Experiments:
    return fp.Experiments(np.tile([1.0, 0.5], (len(durations), 1)), np.empty((len(durations), 0)), durations)


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The numbers of points that were computed, one for each time."""
    counts: list[int] = []
    compute: Any = simulate.checked_run_sensitivities

    def counting(model: Any, runs: Any, *given: Any, **options: Any) -> Any:
        counts.append(len(runs))
        return compute(model, runs, *given, **options)

    monkeypatch.setattr(simulate, "checked_run_sensitivities", counting)
    return counts


def test_states_are_computed_when_they_are_read_and_once(calls: list[int]) -> None:
    done = fp.sensitivities(FEW_OUTPUTS, points(0.3, 0.9, 1.0), THETA)
    assert repr(done) == "Sensitivities(3 points, 2 states, 1 output by 4 parameters; status: 2 ok, 1 on_jump)"
    assert len(done) == 6 and done[0] is done.x and done[-1] is done.reached
    assert calls == [3]
    dx = done.dx_dtheta
    assert calls == [3, 2]  # without the point that ends on the jump
    assert done[2] is dx and done[-4] is dx and done[1:4][1] is dx and list(done)[2] is dx
    assert calls == [3, 2]


def test_states_are_there_at_once_where_they_take_no_longer(calls: list[int]) -> None:
    done = fp.sensitivities(EVERY_OUTPUT, points(0.3, 0.9), THETA)
    assert done.dx_dtheta.shape == (2, 2, 4) and calls == [2]


def test_a_point_that_is_ok_has_all_derivatives() -> None:
    """Ends on a jump are judged by the states too: those of b alone would have one."""
    ends = points(0.3, 0.9, 1.0, 1.5)
    done, every = (fp.sensitivities(model, ends, THETA, rtol=1e-9) for model in MODELS)
    assert done.status.tolist() == every.status.tolist() == [0, 0, fp.Status.on_jump, 0]
    settings = 1e-9, True, True, "fastest", 1
    given = FEW_OUTPUTS.core, ends.x0, ends.u, ends.dt, THETA, *settings
    assert FEW_OUTPUTS.kernels.sensitivities(*given, outputs_alone=True)[-1].tolist() == [0, 0, 0, 0]
    np.testing.assert_allclose(done.dx_dtheta, every.dx_dtheta, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(done.dy_dtheta[:, 0], done.dx_dtheta[:, 1], rtol=1e-7, atol=1e-9)
    assert not done.dx_dtheta[2].any() and done.dx_dtheta[[0, 1, 3], 1].all(axis=0)[1:].all()


def test_states_are_those_of_the_arguments_of_the_call() -> None:
    theta = np.tile(THETA, (2, 1))
    done = fp.sensitivities(FEW_OUTPUTS, points(0.3, 0.9), theta)
    theta += 1.0
    np.testing.assert_array_equal(done.dx_dtheta, fp.sensitivities(FEW_OUTPUTS, points(0.3, 0.9), THETA).dx_dtheta)


@pytest.mark.parametrize("model", MODELS)
def test_a_copy_has_them(model: fp.Model) -> None:
    done = fp.sensitivities(model, points(0.3, 0.9, 1.0), THETA)
    for other in (pickle.loads(pickle.dumps(done)), copy.copy(done), copy.deepcopy(done), done._replace(reached=done.reached)):
        assert type(other) is fp.Sensitivities and repr(other) == repr(done)
        for name in done._fields:
            np.testing.assert_array_equal(getattr(other, name), getattr(done, name))
    assert done._replace(dx_dtheta=np.zeros(3)).dx_dtheta.shape == (3,)


def test_states_that_cannot_be_computed_are_told_of(monkeypatch: pytest.MonkeyPatch) -> None:
    compute: Any = simulate.checked_run_sensitivities

    def failing(*given: Any, states_later: bool = False) -> Any:
        done = compute(*given, states_later=states_later)
        if not states_later:
            done.status[0], done.dx_dtheta[0] = fp.Status.step_limit, 0.0
        return done

    monkeypatch.setattr(simulate, "checked_run_sensitivities", failing)
    done = fp.sensitivities(FEW_OUTPUTS, points(0.3, 0.9), THETA)
    with pytest.warns(RuntimeWarning, match="dx_dtheta: expected derivatives .* computed: 1 ok, 1 step_limit") as caught:
        assert not done.dx_dtheta[0].any() and done.dx_dtheta[1].any()
    assert caught[0].filename == __file__
