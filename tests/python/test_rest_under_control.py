"""Rests that a controller holds: states or outputs are given, and the inputs that keep the plant there are found."""

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import root

import fisherpoint as fp
from fisherpoint.basics.result_files import decoded, encoded
from fisherpoint.design.file.configuration import load_config
from fisherpoint.points.rest_starts import starts_of
from fisherpoint.points.run_coordinates import RunCoordinates

LIFT = fp.SymbolicModel(
    f=["v", "(k*i - m*9.81 - d*v)/m", "(u - R*i - k*v)/L"],
    g=["x", "i", "k*i"],
    states={"x": "m", "v": ("m/s", 1.0), "i": "A"},
    inputs={"u": "V", "w": "V"},
    parameters={"k": "N/A", "d": "kg/s", "R": "ohm"},
    constants={"m": (0.5, "kg"), "L": (0.01, "H")},
    outputs={"y": "m", "c": "A", "F": "N"},
    check_units=False,
)
THETA = np.array([2.0, 0.3, 1.5])
HELD = fp.Rest({"w": 0.0}, hold=["x"], solve=["u"])


def lift_runs(rest: fp.Rest = HELD, count: int = 1) -> fp.Runs:
    x0 = np.column_stack([np.linspace(0.2, 0.5, count), np.zeros((count, 2))])
    return fp.Runs(x0, np.tile([[6.0, 0.0], [3.0, 0.0], [5.0, 0.0]], (count, 1, 1)), 0.05, rest=rest)


def test_a_load_is_held_in_its_place() -> None:
    """The weight m g is k i; the run's own inputs are as they are given."""
    done = fp.sensitivities(LIFT, lift_runs(), THETA, rtol=1e-11)
    np.testing.assert_allclose(done.x[0, 0], [0.2, 0.0, 0.5 * 9.81 / 2.0], atol=1e-14)

    def ends(theta: np.ndarray) -> np.ndarray:
        start = [[0.2, 0.0, 0.5 * 9.81 / theta[0]]]
        return np.asarray(fp.simulate(LIFT, fp.Runs(start, lift_runs().u, 0.05), theta, rtol=1e-12).y[0])

    slope = np.stack([(ends(THETA * (1 + h)) - ends(THETA * (1 - h))) / (2 * h @ THETA) for h in 1e-5 * np.eye(3)], axis=-1)
    np.testing.assert_allclose(done.dy_dtheta[0], slope, atol=1e-7 * np.abs(slope).max())
    by_output = fp.simulate(LIFT, lift_runs(fp.Rest({"w": 0.0}, outputs={"y": 0.2}, solve=["u"])), THETA)
    np.testing.assert_allclose(by_output.x[0, 0], done.x[0, 0], atol=1e-13)


def test_an_output_that_depends_on_parameters_may_be_given() -> None:
    """A force of 4 N where rates of the current alone vanish: the load moves."""
    rest = fp.Rest({"w": 0.0}, states=["i"], outputs={"F": 4.0}, solve=["u"])
    done = fp.sensitivities(LIFT, lift_runs(rest), THETA, rtol=1e-11)
    np.testing.assert_allclose(done.x[0, 0], [0.2, 0.0, 2.0], rtol=1e-14)
    start = fp.sensitivities(LIFT, fp.Runs([[0.2, 0.0, 0.0]], [[[0.0, 0.0]]], 1e-9, rest=rest), THETA)
    np.testing.assert_allclose(start.dy_dtheta[0, 0, 1], [-4.0 / 2.0**2, 0, 0], atol=1e-6)


@pytest.mark.parametrize("by", ["hold", "outputs"])
def test_a_cylinder_under_position_control_rests(by: str) -> None:
    """Its position is an integrator, and leakage lets it creep: the valve is a little open, by as much as the parameters say."""
    model = fp.HydraulicCylinder(smooth={"v": 5e-2, "x_v": 0.2})
    theta, size = model.theta(model.nominal), np.array([s.scale or 1.0 for s in model.states])
    rest = fp.Rest(hold=["q"], solve=["u"]) if by == "hold" else fp.Rest(outputs={"q": 0.15}, solve=["u"])
    runs = fp.Runs([[0.15, 0.0, 8e6, 10e6, 0.0]], [[0.5, -0.5, 0.2]], 5e-3, rest=rest)
    done = fp.sensitivities(model, runs, theta, rtol=1e-11)
    assert done.statuses == (fp.Status.ok,)

    def start(theta: np.ndarray) -> np.ndarray:
        def rates(z: np.ndarray) -> np.ndarray:
            x = np.array([0.15, 0.0, *(z[:2] * 1e7), z[2]])
            return np.asarray(model.rhs(x, z[3], theta)[1:]) / [1.0, 1e9, 1e9, 1.0]

        z = np.array([0.8, 1.0, 0.0, 0.0])
        for _ in range(4):  # again from where it stopped
            z = root(rates, z, method="hybr", options={"xtol": 1e-15}).x
        return np.array([0.15, 0.0, *(z[:2] * 1e7), z[2]])

    np.testing.assert_allclose(done.x[0, 0] / size, start(theta) / size, rtol=0, atol=1e-11)
    assert 1e-3 < abs(done.x[0, 0, 4]) < 0.05

    def ends(theta: np.ndarray) -> np.ndarray:
        return np.asarray(fp.simulate(model, fp.Runs([start(theta)], runs.u, 5e-3), theta, rtol=1e-12).y[0])

    slope = np.stack([(ends(theta * (1 + h)) - ends(theta * (1 - h))) / 2e-4 for h in 1e-4 * np.eye(9)], axis=-1)
    largest = np.abs(slope).max(axis=(0, 2))[:, None]
    assert np.abs((done.dy_dtheta[0] * theta - slope) / largest).max() < 1e-5


def test_whether_the_plant_would_stay_does_not_matter() -> None:
    """An inverted pendulum does not, without its controller."""
    model = fp.SymbolicModel(["w", "g*a + u"], ["a"], {"a": "1", "w": "1"}, {"u": "1"}, {"g": "1"}, check_units=False)
    runs = fp.Runs([[0.3, 0.1]], [[0.0, 0.0]], 0.1, rest=fp.Rest(hold=["a"], solve=["u"]))
    assert fp.simulate(model, runs, [9.81]).x[0, 0].tolist() == [0.3, 0.0]
    with pytest.raises(ValueError, match="at which the plant stays"):
        fp.simulate(model, fp.Runs(runs.x0, runs.u, 0.1, rest=fp.Rest({"u": 0.0})), [9.81])


def test_dry_friction_leaves_the_input_open() -> None:
    """A whole range of valve positions holds a piston that sticks."""
    model = fp.HydraulicCylinder()
    runs = fp.Runs([[0.15, 0.0, 8e6, 10e6, 0.0]], [[0.5, -0.5]], 5e-3, rest=fp.Rest(hold=["q"], solve=["u"]))
    with pytest.raises(ValueError, match=r"given one on the jump v = 0 of runs\[0\]: a whole range of inputs keeps the plant"):
        fp.simulate(model, runs, model.nominal)


def start_of(model: Any, x0: list[float], rest: fp.Rest, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The start (n_x,) at a rest, and its derivative (n_x, p)."""
    found = starts_of(model, fp.Runs([x0], np.zeros((1, 1, len(model.inputs))), 1e-6, rest=rest), theta)
    assert found.status.tolist() == [0]
    return found.x0[0], found.s[0]


def test_speeds_that_are_held_take_dry_friction_off() -> None:
    """A gantry with a weight: at speed 0 friction is none, so the currents carry the load alone; axes stay where they are."""
    gantry = fp.SymbolicModel(
        f=[
            "v", "(k*i - F_c*sign(v))/(m + M)", "w", "(k*j - F_c*sign(w) - d*w)/m - 9.81",
            "(a - R*i - k*v)/L", "(b - R*j - k*w)/L",
        ],
        g=["x", "z"],
        states={"x": "m", "v": "m/s", "z": "m", "w": "m/s", "i": "A", "j": "A"},
        inputs={"a": "V", "b": "V"},
        parameters={"k": "N/A", "F_c": "N", "m": "kg", "R": "ohm"},
        constants={"L": (1e-3, "H"), "M": (40.0, "kg"), "d": (3.0, "kg/s")},
        outputs={"y": "m", "h": "m"},
        check_units=False,
    )  # fmt: skip
    theta, x0 = np.array([20.0, 30.0, 12.0, 0.8]), [0.4, 0.0, 1.3, 0.0, 1.0, 1.0]
    rest = fp.Rest(states=["v", "w", "i", "j"], hold=["v", "w"], solve=["a", "b"])
    start, slope = start_of(gantry, x0, rest, theta)
    k, _, m, _ = theta
    np.testing.assert_allclose(start, [0.4, 0.0, 1.3, 0.0, 0.0, m * 9.81 / k], atol=1e-14)
    np.testing.assert_allclose(slope[5], [-m * 9.81 / k**2, 0.0, 9.81 / k, 0.0], atol=1e-14)
    assert not slope[:5].any()
    run = fp.Runs([x0], [[[0.0, 0.8 * m * 9.81 / k]] * 5], 0.02, rest=rest)
    stuck = fp.sensitivities(gantry, run, theta)
    assert stuck.status.tolist() == [0] and not stuck.dy_dtheta.any(), "it sticks where it stands"
    with pytest.raises(ValueError, match=r"on the jump . = 0 .* hold speeds in the place of positions"):
        start_of_runs = fp.Runs([x0], run.u, 0.02, rest=fp.Rest(hold=["x", "z"], solve=["a", "b"]))
        fp.simulate(gantry, start_of_runs, theta)


def test_a_cylinder_stands_without_load_on_its_dry_friction() -> None:
    """As one with friction that is smooth, which is zero at rest, for any oil, volume and friction."""
    theta, x0 = fp.HydraulicCylinder().theta(fp.HydraulicCylinder().nominal), [0.15, 0.0, 8e6, 10e6, -0.01]
    rest = fp.Rest(states=["v", "p_A", "p_B", "x_v"], hold=["v"], solve=["u"])
    start, slope = start_of(fp.HydraulicCylinder(), x0, rest, theta)
    smooth = fp.Rest(hold=["q"], solve=["u"])
    other, of_other = start_of(fp.HydraulicCylinder(smooth={"v": 5e-2}), x0, smooth, theta)
    np.testing.assert_allclose(start, other, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(slope * theta, of_other * theta, rtol=1e-9, atol=1e-6)  # of Pa
    assert np.abs(slope * theta).max(axis=1)[2] > 1e5


def test_a_guess_on_a_kink_does() -> None:
    """As the valve is closed there, slopes by its spool are those of neither side."""
    model, rest = fp.HydraulicCylinder(), fp.Rest(states=["v", "p_A", "p_B", "x_v"], hold=["v"], solve=["u"])
    theta = model.theta(model.nominal)
    starts = [start_of(model, [0.15, 0.0, 8e6, 10e6, spool], rest, theta) for spool in (0.0, -0.01, 0.01)]
    for start, slope in starts[1:]:
        np.testing.assert_allclose(start, starts[0][0], rtol=1e-12)
        np.testing.assert_allclose(slope * theta, starts[0][1] * theta, rtol=1e-9, atol=1e-6)


def test_a_reactor_at_a_given_temperature() -> None:
    """Its jacket's temperature is found; how much is left of what flows in depends on the rate of the reaction."""
    rate = "k*exp(-E/T)*c"
    reactor = fp.SymbolicModel(
        f=[f"q*(c_0 - c) - {rate}", f"q*(T_0 - T) + H*{rate} - U*(T - T_j)"],
        g=["c"],
        states={"c": ("mol/L", 1.0), "T": ("K", 300.0)},
        inputs={"T_j": "K", "c_0": "mol/L"},
        parameters={"k": "1/s", "E": "K", "U": "1/s"},
        constants={"q": (0.01, "1/s"), "T_0": (290.0, "K"), "H": (40.0, "K L/mol")},
        outputs={"y": "mol/L"},
        check_units=False,
    )
    theta = np.array([2e6, 6000.0, 0.02])
    rest = fp.Rest({"c_0": 2.0, "T_j": 300.0}, hold=["T"], solve=["T_j"])
    start, slope = start_of(reactor, [1.0, 340.0], rest, theta)
    reaction = theta[0] * np.exp(-theta[1] / 340.0)
    left = 2.0 * 0.01 / (0.01 + reaction)
    np.testing.assert_allclose(start, [left, 340.0], rtol=1e-13)
    by_rate = -left / (0.01 + reaction)
    np.testing.assert_allclose(slope, [[by_rate * reaction / theta[0], -by_rate * reaction / 340.0, 0.0], [0, 0, 0]], rtol=1e-10)


def problem(region: fp.RunRegion | None = None, **more: Any) -> fp.DesignProblem:
    prior = fp.GaussianPrior(dict(zip(("k", "d", "R"), THETA, strict=True)), std={"k": 0.2, "d": 0.1, "R": 0.2})
    return fp.DesignProblem(LIFT, prior, region, noise={"y": 1e-3, "c": 0.02, "F": 0.1}, output_covariance="noise", **more)


REGION = {"x": (0.1, 0.4), "v": 0.0, "i": (0.0, 5.0), "u": (0.0, 12.0), "w": 0.0, "dt": 0.05}


@pytest.mark.long
def test_designs_estimates_and_rigs_start_there() -> None:
    region = fp.RunRegion(REGION, 6, rest=HELD)
    design = fp.design_runs(problem(region), 2, n_starts=1, n_candidates=20, threads=1)
    assert len(RunCoordinates(region, LIFT)) == 1 + 6, "the current is found, the place is not"
    assert ((design.runs.x0[:, 0] >= 0.1) & (design.runs.x0[:, 0] <= 0.4)).all() and design.runs.rest == (HELD, HELD)
    x = fp.simulate(LIFT, design.runs, THETA).x[:, 0]
    np.testing.assert_allclose(x[:, 2], 0.5 * 9.81 / 2.0, rtol=1e-13)
    data = fp.VirtualRig(LIFT, THETA, {"y": 1e-5, "c": 1e-5, "F": 1e-5}, seed=3).measure(design.runs)
    fit = fp.estimate(LIFT, data, start={"k": 1.8, "d": 0.2, "R": 1.3}, noise={"y": 1e-5, "c": 1e-5, "F": 1e-5})
    np.testing.assert_allclose(list(fit.estimate.values()), THETA, rtol=1e-2)
    share = fp.feasibility(problem(), design.runs, draws=50, threads=1)
    assert share.share == 1.0


RESTS = [
    HELD,
    fp.Rest({"w": 0.5, "u": 1.0}, states=["v", "i", "x"], outputs={"y": 0.25}, solve=["u"]),
    None,
    fp.Rest({"u": 1.0, "w": 0.0}),
]


def test_files_keep_what_a_controller_holds(tmp_path: Path) -> None:
    runs = fp.Runs.join([lift_runs(rest) for rest in RESTS[:3]])
    runs.to_csv(tmp_path / "runs.csv", LIFT)
    head, first, *_ = (tmp_path / "runs.csv").read_text().splitlines()
    assert head == "run,segment,x,v,i,u,w,dt,measured,rest,rest_u,rest_w,rest_hold,rest_solve,rest_y_y"
    assert first.endswith(",all,0.0,0.0,x,u,")
    read = fp.Runs.from_csv(tmp_path / "runs.csv", LIFT)
    assert np.array_equal(fp.simulate(LIFT, read[:2], THETA).x, fp.simulate(LIFT, runs[:2], THETA).x)
    read.to_csv(tmp_path / "again.csv", LIFT)
    assert fp.Runs.from_csv(tmp_path / "again.csv", LIFT) == read
    plain = lift_runs(RESTS[3])
    plain.to_csv(tmp_path / "plain.csv", LIFT)
    assert "rest_hold" not in (tmp_path / "plain.csv").read_text() and fp.Runs.from_csv(tmp_path / "plain.csv", LIFT) == plain
    assert decoded(encoded(runs), fp.Runs) == runs and pickle.loads(pickle.dumps(runs)) == runs
    data = fp.Measurements(read, np.tile(np.linspace(0.2, 0.3, 3)[:, None], (3, 1, 3)))
    data.to_csv(tmp_path / "data.csv", LIFT)
    assert fp.Measurements.from_table(tmp_path / "data.csv", LIFT) == data


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ("all,0,0,z,u,", "row 1, column rest_hold: expected names among x, v, i; given 'z'"),
        ("all,0,0,x,u w,", "row 1, column rest: rest.solve: expected as many inputs as states in hold and outputs are given, 1"),
        ("all,,,x,u,", "row 1, column rest_w: expected the held input"),
        (",,,,,0.3", "row 1, column rest_y_y: expected nothing where no run starts at rest"),
    ],
)
def test_files_that_are_none_are_refused(row: str, said: str, tmp_path: Path) -> None:
    head = "run,segment,x,v,i,u,w,dt,measured,rest,rest_u,rest_w,rest_hold,rest_solve,rest_y_y\n"
    (tmp_path / "runs.csv").write_text(head + "1,1,0.2,0,0,1,0,0.1,1," + row + "\n")
    with pytest.raises(ValueError, match=said):
        fp.Runs.from_csv(tmp_path / "runs.csv", LIFT)


@pytest.mark.parametrize(
    ("given", "error", "said"),
    [
        ({"solve": ["u"]}, ValueError, "rest.solve: expected as many inputs as states in hold and outputs are given, 0; given u"),
        ({"hold": ["x"]}, ValueError, "rest.solve: expected as many inputs as .*, 1; given none"),
        ({"hold": ["x"], "solve": ["z"]}, ValueError, "rest.solve: expected names of inputs, u, w; given unknown 'z'"),
        ({"hold": ["z"], "solve": ["u"]}, ValueError, "rest.hold: expected names of states, x, v, i; given unknown 'z'"),
        (
            {"outputs": {"z": 1.0}, "solve": ["u"]},
            ValueError,
            "rest.outputs: expected names of outputs, y, c, F; given",
        ),
        ({"hold": ["x"], "states": ["i"], "solve": ["u"]}, ValueError, "rest.hold: expected states at rest, i; given 'x'"),
        ({"hold": ["x"], "solve": ["w"], "u": {"u": 1.0}}, ValueError, "rest: expected an equilibrium of v, i, w"),
        ({"hold": ["x"], "solve": ["u"], "u": {}}, ValueError, "rest.u: expected a value for 'w', given none"),
        ({"outputs": 1.0, "solve": ["u"]}, TypeError, "rest.outputs"),
        ({"hold": {"x": 0.1}, "solve": ["u"]}, TypeError, "rest.hold: expected a sequence of names"),
    ],
)
def test_misuse_is_told(given: dict[str, Any], error: type[Exception], said: str) -> None:
    with pytest.raises(error, match=said):
        fp.simulate(LIFT, lift_runs(fp.Rest(**({"u": {"w": 0.0}} | given))), THETA)


CONFIG = """
[model]
name = "lift"
states = { x = "m", v = "m/s", i = "A" }
inputs = { u = "V" }
parameters = { k = "N/A", R = "ohm" }
outputs = { x = "m", i = "A" }
equations = { x = "v", v = "(k*i - 4.9 - 0.3*v)/0.5", i = "(u - R*i - k*v)/0.01" }
check_units = false

[prior]
k = { mean = 2.0, std = 0.2 }
R = { mean = 1.5, std = 0.2 }

[noise]
x = 1e-3
i = 0.02

[region]
x = [0.1, 0.4]
v = [0.0, 0.0]
i = [0.0, 5.0]
u = [0.0, 12.0]
dt = [0.05, 0.05]

[runs]
segments = 6
"""


def test_a_file_says_how_runs_rest(tmp_path: Path) -> None:
    for text, rest in (
        ("hold = ['x']\nsolve = ['u']", fp.Rest(hold=["x"], solve=["u"])),
        ("u = { u = { value = 2000, unit = 'mV' } }\nstates = ['i']", fp.Rest({"u": 2.0}, states=["i"])),
        (
            "u = { u = 1 }\noutputs = { x = { value = 250, unit = 'mm' } }\nsolve = ['u']",
            fp.Rest({"u": 1.0}, outputs={"x": 0.25}, solve=["u"]),
        ),
    ):  # fmt: skip
        (tmp_path / "lift.toml").write_text(CONFIG + "[runs.rest]\n" + text)
        given = load_config(tmp_path / "lift.toml").problem().region
        assert isinstance(given, fp.RunRegion) and given.rest == rest
    for text, said in (
        ("hold = ['x']", "runs.rest.solve: expected as many inputs"),
        ("u = { u = 1 }\nstates = ['z']", "runs.rest.states: expected names of states"),
        ("", "runs.rest.u.u: missing"),
        ("held = ['x']", "unknown key runs.rest.held; expected .*hold"),
        ("u = { u = { value = 1, unit = 'm' } }", "runs"),
    ):
        (tmp_path / "lift.toml").write_text(CONFIG + "[runs.rest]\n" + text)
        with pytest.raises(ValueError, match=said):
            load_config(tmp_path / "lift.toml").problem()
