"""Records, their files, and trajectories under inputs that are held from sample to sample."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.points.run_files import plan_csv
from record_cases import T, U, motor, piecewise, tanks, valve

TANKS = [0.5, 0.4, 0.3, 0.2, 0.6]
MOTOR = [2.0, 0.05, 0.01, 0.002, 0.5]


def record(**changes: Any) -> fp.Record:
    given = {"t": [0.0, 1.0, 3.0], "u": [1.0, 2.0, 0.0], "y": [0.5, np.nan, 0.7], "x0": {"h1": 0.4}}
    return fp.Record(**(given | changes))


# --- the container ----------------------------------------------------------------------------------------------------------


def test_a_record_holds_what_was_measured() -> None:
    r = record()
    assert len(r) == 3 and r.u.shape == (3, 1) and r.y.shape == (3, 1) and dict(r.x0) == {"h1": 0.4}
    assert repr(r) == "Record(3 samples over 3 s, 1 inputs, 1 outputs, 2 of 3 numbers, known start of h1)"
    with pytest.raises(ValueError, match="read-only"):
        r.t[0] = 1.0
    with pytest.raises(TypeError, match="item assignment"):
        r.x0["h1"] = 2.0  # type: ignore[index]


def test_slices_know_the_start_only_where_they_begin_with_it() -> None:
    r = record()
    assert dict(r[:2].x0) == {"h1": 0.4} and len(r[:2]) == 2
    later = r[1:]
    assert not later.x0 and later.t.tolist() == [1.0, 3.0] and later.u[:, 0].tolist() == [2.0, 0.0]
    with pytest.raises(TypeError, match="expected a slice, given 1"):
        r[1]  # type: ignore[index]
    for bad in (slice(None, None, 2), slice(3, None)):
        with pytest.raises(ValueError, match="consecutive samples"):
            r[bad]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"t": [0, 1, 1]}, "t: expected increasing times in s, given 1 after 1 at sample 2"),
        ({"t": [[0, 1, 2]]}, r"t: expected shape \(N,\)"),
        ({"t": []}, r"t: expected shape \(N,\), at least one"),
        ({"t": [0, np.nan, 2]}, "t: expected finite numbers"),
        ({"u": [1, 2]}, r"u: expected shape \(3, n_u\), given \(2,\)"),
        ({"u": [1, np.nan, 2]}, "u: expected finite numbers"),
        ({"y": [1, 2]}, r"y: expected shape \(3, n_y\)"),
        ({"y": [1, np.inf, 2]}, r"y: expected finite numbers, or NaN for what was not measured; given inf at \(1, 0\)"),
        ({"y": [np.nan] * 3}, "y: expected at least one measured number"),
        ({"y": ["a", 1, 2]}, "y: expected numbers"),
        ({"x0": {"h1": np.nan}}, r"x0\['h1'\]: expected finite"),
    ],
)
def test_misuse_is_named(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        record(**changes)


def test_a_record_of_another_model() -> None:
    with pytest.raises(ValueError, match="x0: expected names of states, h1, h2; given unknown 'h3'"):
        record(x0={"h3": 1.0}).check(tanks)
    with pytest.raises(ValueError, match="u: expected 1 columns, u; given 2"):
        record(u=np.ones((3, 2))).check(tanks)
    with pytest.raises(ValueError, match="y: expected 1 columns, level; given 2"):
        record(y=np.ones((3, 2))).check(tanks)


# --- files ------------------------------------------------------------------------------------------------------------------


def test_a_record_comes_back_from_its_file(tmp_path: Path) -> None:
    path, r = tmp_path / "record.csv", record(t=[0.1, 0.2, 0.7])
    r.to_csv(path, tanks)
    assert path.read_text().splitlines()[0] == "t,u,y_level,x0_h1"
    back = fp.Record.from_table(path, tanks)
    assert np.array_equal(back.t, r.t) and np.array_equal(back.u, r.u) and np.array_equal(back.y, r.y, equal_nan=True)
    assert back.x0 == r.x0 == {"h1": 0.4}
    assert fp.Record.from_table(path, tanks, x0={"h1": 0.5, "h2": 0.1}).x0 == {"h1": 0.5, "h2": 0.1}


@pytest.mark.parametrize(
    ("text", "x0"),
    [
        ("t,u,y_level,x0_h1,x0_h2\n0,1,2,0.4,0.6\n1,1,3,,\n", {"h1": 0.4, "h2": 0.6}),
        ("t,u,y_level,x0_h1,x0_h2\n0,1,2,0.4,\n1,1,3,,\n", {"h1": 0.4}),
        ("t,u,y_level,x0_h2\n0,1,2,0.6\n1,1,3,0.6\n", {"h2": 0.6}),
        ("x0_h1 [dm],t,u,y_level\n4,0,1,2\n,1,1,3\n", {"h1": 0.4}),
        ("x0_h1;t;u;y_level\n0,4;0;1;2\n;1;1;3\n", {"h1": 0.4}),
        ("t,u,y_level,x0_h1\n0,1,2,nan\n1,1,3,\n", {}),
    ],
)
def test_starts_that_a_file_knows(tmp_path: Path, text: str, x0: dict[str, float]) -> None:
    path = tmp_path / "record.csv"
    path.write_text(text)
    assert fp.Record.from_table(path, tanks).x0 == pytest.approx(x0)


CALLED_T = fp.SymbolicModel(["-k*t"], ["t"], {"t": "1"}, {}, {"k": "1/s"}, {"t": "1"})
INPUT_T = fp.SymbolicModel(["-k*x + t"], ["x"], {"x": "1"}, {"t": "1/s", "time": "1"}, {"k": "1/s"}, {"time": "1"})


@pytest.mark.parametrize(
    ("model", "header"), [(CALLED_T, "t,y_t,x0_t"), (INPUT_T, "time_of_sample,t,time,y_time,x0_x")], ids=["state", "input"]
)
def test_states_and_inputs_may_be_called_as_the_time(tmp_path: Path, model: fp.Model, header: str) -> None:
    path = tmp_path / "record.csv"
    r = fp.Record([0.0, 1.0, 3.0], np.ones((3, len(model.inputs))), [0.5, 0.4, 0.1], x0={model.states[0].name: 0.6})
    r.to_csv(path, model)
    assert path.read_text().splitlines()[0] == header
    back = fp.Record.from_table(path, model)
    assert np.array_equal(back.t, r.t) and np.array_equal(back.u, r.u) and np.array_equal(back.y, r.y) and back.x0 == r.x0


def test_outputs_may_be_called_plainly_or_be_missing(tmp_path: Path) -> None:
    path = tmp_path / "record.csv"
    path.write_text("level,t,u\n1,0,5\n,2,6\n\n3,3,7\n")
    assert np.array_equal(fp.Record.from_table(path, tanks).y[:, 0], [1, np.nan, 3], equal_nan=True)
    path.write_text("t,u,y_omega\n0,1,2\n1,1,3\n")  # omega is a state too, and the current was not measured
    y = fp.Record.from_table(path, motor).y
    assert np.array_equal(y[:, 1], [2, 3]) and np.isnan(y[:, 0]).all()


def test_the_plan_of_runs_calls_its_time_otherwise_than_an_input() -> None:
    head = plan_csv(fp.Runs([[0.0]], [[[1.0, 0.0], [2.0, 0.0]]], 0.5), INPUT_T).splitlines()[0].split(",")
    assert [name.split(" ")[0] for name in head] == ["run", "time_of_sample", "t", "time", "measure"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "expected a header and at least one row"),
        ("t,u\n0,1\n", "of outputs those measured, once; .*given t, u$"),
        ("t,y_level\n0,1\n", "expected the columns"),
        ("t,u,y_level,h1\n0,1,2,3\n", "expected the columns"),
        ("t,u,level,y_level\n0,1,2,3\n", "expected the columns"),
        ("t,u,y_level\n", "at least one row"),
        ("t,u,y_level\n0,1\n", "row 1: expected 3 entries, given 2"),
        ("t,u,y_level\n0,1,2\n1,x,2\n", "row 2, column u: expected a number, given 'x'"),
        ("t,u,y_level\n0,,2\n", "row 1, column u: expected a number, given ''"),
        ("t,u,y_level\n0,1,inf\n", "row 1, column y_level: expected a finite number, given 'inf'"),
        ("t,u,y_level,x0_h1\n0,1,2,\n1,1,2,0.4\n", "row 2, column x0_h1: expected the start in the first row, .* given '0.4'"),
        ("t,u,y_level,x0_h1\n0,1,2,0.3\n1,1,2,0.4\n", "row 2, column x0_h1: expected the start in the first row, .* given '0.4'"),
        ("t,u,y_level,x0_h1\n0,1,2,a\n1,1,2,\n", "row 1, column x0_h1: expected a number, given 'a'"),
        ("t,u,y_level,x0_h3\n0,1,2,1\n", "x0_<state>, of h1, h2, for known starts; given t, u, y_level, x0_h3"),
        ("t,u,y_level\n0,1,2\n0,1,2\n", "row 2, column t: expected a time after that of the row before, given '0'"),
    ],
)
def test_a_file_says_what_is_wrong_with_it(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "record.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=message):
        fp.Record.from_table(path, tanks)


# --- trajectories -----------------------------------------------------------------------------------------------------------


def test_tanks_through_their_overflow() -> None:
    done = fp.simulate_record(tanks, T, U, TANKS, [0.4, 0.6], rtol=1e-10)
    expected = piecewise(tanks, TANKS, T, U, [0.4, 0.6])
    assert done.status == fp.Status.ok and done.reached == len(T) - 1
    over = expected[:, 0] > 1.0
    assert (~over[:-1] & over[1:]).any() and (over[:-1] & ~over[1:]).any()  # over the rim and back
    np.testing.assert_allclose(done.x, expected, rtol=0, atol=2e-9)
    np.testing.assert_allclose(done.y[:, 0], np.minimum(expected[:, 1], 1.0), atol=2e-9)


def test_a_motor() -> None:
    t, u = T[:12] / 20, U[:12] - 1
    expected = piecewise(motor, MOTOR, t, u, [0.0, 0.0])
    done = fp.simulate_record(motor, t, u, MOTOR, {"i": 0.0, "omega": 0.0}, rtol=1e-10)
    np.testing.assert_allclose(done.x, expected, rtol=0, atol=1e-8)
    np.testing.assert_allclose(done.y, expected, rtol=0, atol=1e-8)


def test_a_cylinder_whose_pressure_leaves_the_domain() -> None:
    """The valve closes at once while the piston runs, and the pressure falls to the tank's."""
    cylinder = fp.HydraulicCylinder(k_u=1)
    t, u = np.linspace(0.0, 0.08, 81), np.where(np.arange(81) < 40, 0.3, -1.0)
    theta, x0 = list(cylinder.nominal.values()), [0.05, 0.05, 8e6, 12e6, 0.3]
    done = fp.simulate_record(cylinder, t, u, theta, x0, rtol=1e-9)
    assert done.status == fp.Status.left_domain and done.reached == 42
    expected = piecewise(cylinder, theta, t[:43], u[:43], x0)
    scale = np.array([0.1, 0.1, 1e6, 1e6, 1.0])
    np.testing.assert_allclose(done.x[:43] / scale, expected / scale, atol=1e-6)
    assert abs(done.x[-1, 2] - cylinder.nominal["p_t"]) < 100 and (done.x[43:] == done.x[-1]).all()
    as_equations = fp.simulate_record(cylinder.symbolic(), t, u, theta, x0, rtol=1e-9)
    assert as_equations.status == done.status and as_equations.reached == done.reached
    np.testing.assert_allclose(as_equations.x / scale, done.x / scale, atol=1e-8)


def test_a_record_goes_on_behind_a_jump() -> None:
    """The piston stops, where its friction jumps, and reverses."""
    cylinder, t = fp.HydraulicCylinder(), np.linspace(0.0, 2e-3, 21)
    done = fp.simulate_record(cylinder, t, np.zeros(21), cylinder.nominal, [0.1, 0.02, 5e6, 15e6, 0.1])
    assert done.status == fp.Status.ok and done.reached == 20
    assert done.x[0, 1] > 0 > done.x[-1, 1]


def test_a_record_starts_and_rests_on_a_kink() -> None:
    u = np.array([0.0, 0.0, 1.0, -1.0, 0.0, 0.0])
    t = np.array([0.0, 1.0, 2.0, 2.5, 4.0, 30.0])
    done = fp.simulate_record(valve, t, u, [0.4, 2.0], [0.0])
    assert done.status == fp.Status.ok
    np.testing.assert_allclose(done.x, piecewise(valve, [0.4, 2.0], t, u, [0.0]), atol=1e-6)
    assert (done.x[:3] == 0).all()


def test_a_record_that_settles_at_a_kink_goes_on() -> None:
    """Where the level k of the kink is not zero, rounding leaves the state some last bits off it, on either side."""
    lag = fp.SymbolicModel(
        ["(u - x)/T", "max(x - k, 0)"], ["z"], {"x": "1", "z": ("1", 1.0)}, {"u": "1"}, {"T": "s", "k": "1"}, {"z": "1"}
    )
    rng, t = np.random.default_rng(0), np.arange(41.0)
    for _ in range(60):
        k, step = rng.uniform(0.1, 2.0), rng.choice([-1, 1]) * rng.uniform(0.1, 2.0)
        done = fp.simulate_record(lag, t, np.where(t < 30, k, k + step), [0.3, k], [rng.normal(), 0.0])
        assert done.status == fp.Status.ok
        # Behind the 30th second x - k rises as step (1 - exp(-s/T)).
        expected = max(step, 0.0) * (10 - 0.3 * (1 - np.exp(-10 / 0.3)))
        assert abs(done.x[-1, 1] - done.x[30, 1] - expected) < 1e-5


def test_a_start_outside_the_domain_is_a_status() -> None:
    done = fp.simulate_record(tanks, T, U, TANKS, [-0.1, 0.6])
    assert done.status == fp.Status.left_domain and done.reached == 0
    assert np.isfinite(done.y).all()


def test_a_model_without_states() -> None:
    model = fp.SymbolicModel([], ["a*sqrt(u)"], {}, {"u": "1"}, {"a": "1"})
    done = fp.simulate_record(model, [0.0, 1.0, 2.0], [1.0, 4.0, 9.0], [2.0])
    assert done.x.shape == (3, 0) and done.status == fp.Status.ok and done.reached == 2
    np.testing.assert_allclose(done.y[:, 0], [2.0, 4.0, 6.0])
    done = fp.simulate_record(model, [0.0, 1.0, 2.0], [1.0, -4.0, 9.0], [2.0])
    assert done.status == fp.Status.left_domain and done.reached == 0 and np.isfinite(done.y).all()


def test_one_sample_alone() -> None:
    done = fp.simulate_record(tanks, [3.0], [1.0], TANKS, [0.4, 1.6])
    assert done.status == fp.Status.ok and done.reached == 0 and done.y.tolist() == [[1.0]]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"u": np.ones((len(T), 2))}, r"u: expected shape \(60, 1\), given \(60, 2\)"),
        ({"x0": [1.0]}, r"x0: expected shape \(2,\), given \(1,\)"),
        ({"x0": {"h1": 1.0}}, "x0: expected a value for 'h2'"),
        ({"theta": np.ones((2, 5))}, r"theta: expected shape \(5,\)"),
        ({"rtol": 1.0}, "rtol: expected"),
        ({"t": T[::-1]}, "t: expected increasing"),
    ],
)
def test_misuse_of_simulate_record(changes: dict[str, Any], message: str) -> None:
    given = {"theta": TANKS, "t": T, "u": U, "x0": [0.4, 0.6]}
    with pytest.raises(ValueError, match=message):
        fp.simulate_record(tanks, **(given | changes))
