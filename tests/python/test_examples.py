"""Every example runs; those with measured records come near them; what the documentation says of them holds."""

from __future__ import annotations

import re
import runpy
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.signal import savgol_filter

import fisherpoint as fp
from fisherpoint.design.file.configuration import load_config
from fisherpoint_command import cli
from oracle import Floats

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
RUNS = ["battery", "cylinder_runs", "reactor", "robot_joint", "tclab"]
"""Examples of runs: `test_cli_runs.py` and `test_design_runs.py` look at these."""

FILES = sorted(path for path in EXAMPLES.glob("*.toml") if path.stem not in RUNS)
DATA = EXAMPLES.parents[1] / "shared" / "data"

NEW = [
    "alpha_pinene",
    "box_lucas",
    "cascaded_tanks",
    "dc_motor",
    "exponential_decay",
    "fed_batch",
    "michaelis_menten",
    "pharmacokinetics",
    "positioning_axis",
]


def record(name: str) -> Any:
    """A measured record as columns by name; they lie beside the project and are no part of it."""
    path = DATA / name
    if not path.exists():
        pytest.skip(f"{path} is not beside the project")
    return np.genfromtxt(path, delimiter=",", names=True)


def test_every_example_is_known_here() -> None:
    assert sorted(path.stem for path in FILES) == sorted([*NEW, "cylinder", "figure2", "paper"])


def quickly(name: str, directory: Path) -> Path:
    """The example with few iterations; the paper's grid with two levels."""
    text = (EXAMPLES / f"{name}.toml").read_text()
    lines = ["max_iterations = 3" if line.startswith("max_iterations") else line for line in text.splitlines()]
    lines = ["levels = 2" if line.startswith("levels") else line for line in lines]
    assert "max_iterations = 3" in lines
    path = directory / f"{name}.toml"
    path.write_text("\n".join(lines))
    return path


@pytest.mark.long
@pytest.mark.parametrize("name", [path.stem for path in FILES])
def test_an_example_runs_from_the_command_line(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        cli.main(["design", str(quickly(name, tmp_path)), "-o", str(tmp_path / "run")])
    assert ended.value.code == 0, capsys.readouterr().err
    pictures = {path.stem for path in (tmp_path / "run").glob("*.png")}
    expected = {"criterion", "points", "standard_errors", "correlation", "trajectories"}
    design = fp.Design.load(tmp_path / "run")
    missing = set() if design.problem.model.states else {"trajectories"}
    missing |= set() if design.problem.noise else {"standard_errors"}
    assert pictures == expected - missing
    assert design.points.table.shape[0] == design.settings.n_experiments
    assert design.evaluation.covariance is not None


@pytest.mark.parametrize("name", NEW)
def test_an_example_names_its_source_and_its_quantities(name: str) -> None:
    text = (EXAMPLES / f"{name}.toml").read_text()
    assert f"fisherpoint design examples/{name}.toml" in text
    model = load_config(EXAMPLES / f"{name}.toml").build_model()
    assert all(quantity.description for quantity in (*model.states, *model.inputs, *model.parameters, *model.constant_quantities))
    assert set(model.nominal) == {quantity.name for quantity in model.parameters}


# --- what is said of them -----------------------------------------------------------------------------------------------


def designed(name: str, **settings: Any) -> fp.Design:
    config = load_config(EXAMPLES / f"{name}.toml")
    given = config.exchange_settings()
    quick = {"method": replace(given["method"], references=False)}
    return fp.exchange(config.problem(), **given | quick | settings)


@pytest.mark.parametrize(
    ("name", "places"),
    [
        ("exponential_decay", [1e-3, 2000.0]),
        ("michaelis_menten", [0.0641 * 1.1 / (2 * 0.0641 + 1.1), 1.1]),
        ("box_lucas", [1.22947, 6.85769]),
        ("pharmacokinetics", [0.22877 * 3600, 1.38859 * 3600, 18.41684 * 3600]),
    ],
)
def test_where_the_answer_is_known(name: str, places: list[float]) -> None:
    design = designed(name)
    column = design.points.table[:, 0] if name == "michaelis_menten" else design.points.dt
    expected = np.repeat(places, len(column) // len(places))
    np.testing.assert_allclose(np.sort(column), expected, rtol=0.02)


def test_the_fed_batch_reactor_never_overflows() -> None:
    points = designed("fed_batch", max_iterations=20).points
    assert np.all(points.x0[:, 2] + points.u[:, 0] * points.dt <= 3e-3)


def test_the_drive_gain_of_the_axis_cannot_be_known() -> None:
    problem = load_config(EXAMPLES / "positioning_axis.toml").problem()
    points = designed("positioning_axis", max_iterations=20).points
    mean = dict(problem.prior.mean) | {"g": 35.15}
    std = {name: 0.1 * abs(value) for name, value in mean.items()}
    prior = fp.GaussianPrior(mean=mean, std=std)
    given = fp.DesignProblem(problem.model.estimate("g"), prior, None, noise=problem.noise)
    evaluation = fp.evaluate(given, points)
    assert evaluation.rank == 4
    (direction,) = evaluation.null_directions  # in prior std, which are in proportion to the means
    shares = [direction[name] * np.sign(mean[name]) for name in mean]
    np.testing.assert_allclose(np.array(shares) / shares[0], 1.0, rtol=1e-3)


def test_the_cylinder_in_python_has_the_design_of_the_built_in_one() -> None:
    cylinder = runpy.run_path(str(EXAMPLES / "cylinder_in_python.py"))["cylinder"]
    problem = load_config(EXAMPLES / "cylinder.toml").problem()
    assert dict(cylinder.constants) == dict(problem.model.constants)
    settings: dict[str, Any] = {
        "n_experiments": 12,
        "max_iterations": 40,
        "seed": 1,
        "method": fp.ExchangeMethod("paper", references=False),
    }
    built_in, written = (fp.exchange(given, **settings) for given in (problem, problem.replace(model=cylinder)))
    np.testing.assert_array_equal(written.points.table, built_in.points.table)
    assert written.evaluation.log_det == pytest.approx(built_in.evaluation.log_det, abs=1e-6)
    assert sum(r.exchanged for r in written.trace) > 10


@pytest.mark.parametrize("script", ["positioning_axis.py"])
def test_a_script_runs(script: str, capsys: pytest.CaptureFixture[str]) -> None:
    runpy.run_path(str(EXAMPLES / script), run_name="__main__")
    assert "rank 4 of 5" in capsys.readouterr().out


def test_a_dead_time_that_is_left_out_is_seen_in_residuals_and_in_the_inertia(capsys: pytest.CaptureFixture[str]) -> None:
    runpy.run_path(str(EXAMPLES / "joint_dead_time.py"), run_name="__main__")
    without, late = capsys.readouterr().out.split("with delay(u, tau)")
    (inertia, *_), found = (re.findall(r"([+-][\d.]+) standard errors off", part) for part in (without, late))
    assert "not white" in without and abs(float(inertia)) > 10
    assert "not white" not in late and len(found) == 5 and all(abs(float(off)) < 4 for off in found)


def test_what_is_written_on_models_runs(tmp_path: Path) -> None:
    text = (EXAMPLES.parent / "docs" / "how_to" / "models.md").read_text()
    python, toml = (re.findall(rf"```{kind}\n(.*?)```", text, re.DOTALL) for kind in ("python", "toml"))
    names: dict[str, Any] = {}
    for code in python:
        exec(code, names)
    assert names["tanks"].kinks == ("h1 - h_max",) and names["tanks"].domain == ("h1", "h2")
    (tmp_path / "tank.toml").write_text(toml[0])
    tank = fp.load_model(tmp_path / "tank.toml")
    assert tank.equations.rates == names["tank"].equations.rates


@pytest.mark.parametrize("name", NEW)
def test_an_example_has_its_page_and_its_picture(name: str) -> None:
    page = (EXAMPLES.parent / "docs" / "how_to" / "examples.md").read_text()
    assert f"images/examples/{name}.png" in page
    assert (EXAMPLES.parent / "docs" / "images" / "examples" / f"{name}.png").exists()


# --- measured records ---------------------------------------------------------------------------------------------------


def simulated_levels(model: fp.Model, theta: Floats, u: Floats, start: tuple[float, float]) -> Floats:
    """The output at the beginning of every 4 s in which the input is held."""
    state, levels = np.array([start]), []
    for voltage in u:
        levels.append(float(model.output(state, [[voltage]], theta)[0, 0]))
        done = fp.simulate(model, fp.Experiments(state, [[voltage]], [4.0]), theta, threads=1)
        assert done.status[0] == fp.Status.ok
        state = done.x
    return np.array(levels)


@pytest.mark.parametrize(("which", "start", "error"), [("est", (4.89, 5.22), 0.49), ("val", (4.82, 5.31), 0.53)])
def test_the_tanks_follow_the_measured_record(which: str, start: tuple[float, float], error: float) -> None:
    """The starts are fitted, as they were not measured; without an overflow that falls into the lower tank the error doubles."""
    data = record("cascaded_tanks/cascaded_tanks.csv")
    problem = load_config(EXAMPLES / "cascaded_tanks.toml").problem()
    levels = simulated_levels(problem.model, problem.theta, data[f"u_{which}_V"], start)
    assert np.sqrt(np.mean((levels - data[f"y_{which}_V"]) ** 2)) < error
    dry = problem.theta * [1, 1, 1, 1, 0]
    without = simulated_levels(problem.model, dry, data[f"u_{which}_V"], start)
    assert np.sqrt(np.mean((without - data[f"y_{which}_V"]) ** 2)) > 1.2 * error


def test_the_axis_follows_the_measured_record() -> None:
    """The model's acceleration at the measured velocity and voltage, against the measured one, both smoothed alike."""
    data = record("emps/emps_estimation.csv")
    problem = load_config(EXAMPLES / "positioning_axis.toml").problem()
    q, u, dt, window = data["q_meas_m"], data["v_drive_V"], 1e-3, 61
    v, a = (savgol_filter(q, window, 3, deriv=order, delta=dt) for order in (1, 2))
    moving = np.abs(v) > 0.01
    x = np.column_stack([q, v])
    modelled = savgol_filter(problem.model.rhs(x, u[:, None], problem.theta)[:, 1], window, 3)
    inside = moving & (np.convolve(moving, np.ones(window), "same") > window - 0.5)
    assert inside.sum() > 10_000
    mass, gain = problem.prior.mean["M"], problem.model.constants["g"]
    force = gain * savgol_filter(u, window, 3)[inside]
    error = mass * (modelled - a)[inside]
    assert np.linalg.norm(error) < 0.07 * np.linalg.norm(force)
