"""The cylinder with tanh in place of sign and Heaviside function: what it is next to the sharp form, and that it is a model."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from defaults import MODEL, NAMES, point, problem
from fisherpoint.design.file.configuration import ConfigError, load_config

WIDTHS = {"v": 1e-3, "x_v": 1e-3}
SMOOTH = fp.HydraulicCylinder(smooth=WIDTHS)
THETA = MODEL.theta(MODEL.nominal)
REST = fp.Experiments([[0.1, 0.0, 6.4e6, 12.9e6, 0.0]], [[-0.2]], [5e-3])
"""A start on both surfaces."""
TURNING = fp.Experiments([[0.1, 0.02, 6e6, 12.9e6, 0.1]], [[0.3]], [6e-3])
"""A trajectory through v = 0 and x_v = 0."""


# --- the equations ------------------------------------------------------------------------------------------------------


def test_it_has_neither_jumps_nor_kinks_and_is_otherwise_the_same() -> None:
    assert SMOOTH.jumps == SMOOTH.kinks == SMOOTH.symbolic().jumps == SMOOTH.symbolic().kinks == ()
    for kind in ("states", "inputs", "outputs", "parameters", "constants", "nominal", "domain", "blocks", "reaches"):
        assert getattr(SMOOTH, kind) == getattr(MODEL, kind)
    assert len(SMOOTH.symbolic().domain) == len(SMOOTH.domain)


def test_what_is_not_named_stays_sharp() -> None:
    friction, valve = (fp.HydraulicCylinder(smooth={name: 1e-3}) for name in ("v", "x_v"))
    for model, jumps, kinks in ((friction, (), ("x_v",)), (valve, ("v",), ())):
        assert (model.jumps, model.kinks) == (model.symbolic().jumps, model.symbolic().kinks) == (jumps, kinks)
    with pytest.raises(ValueError, match="switching surface x_v = 0"):
        fp.simulate(friction, REST, THETA, kinks="exclude")
    assert fp.simulate(valve, TURNING, THETA, jumps="exclude").status[0] == fp.Status.met_jump
    assert fp.HydraulicCylinder(smooth={}) == MODEL


@pytest.mark.parametrize(("v", "x_v"), [(0.3e-3, -0.5e-3), (-2e-3, 1.3e-3), (0.1, -0.4)])
def test_the_widths_are_those_of_the_equations(v: float, x_v: float) -> None:
    x = np.array([0.12, v, 5e6, 11e6, x_v])
    at = dict(zip(NAMES, THETA, strict=True)) | dict(MODEL.constants)
    sharp, smooth = MODEL.rhs(x, 0.1, THETA), SMOOTH.rhs(x, 0.1, THETA)
    friction = -at["a_tau"] * (np.tanh(v / 1e-3) - np.sign(v)) / at["m_q"]
    assert smooth[1] - sharp[1] == pytest.approx(friction, rel=1e-9, abs=1e-9)
    open_A, open_B = (1 + np.tanh(x_v / 1e-3)) / 2, (1 - np.tanh(x_v / 1e-3)) / 2
    for place, p, area, to_supply, to_tank in ((2, 5e6, -at["A_A"], open_A, open_B), (3, 11e6, at["A_B"], -open_B, -open_A)):
        from_supply, from_tank = np.sqrt(at["p_s"] - p), np.sqrt(p - at["p_t"])
        volume = at["A_A"] * 0.12 + at["V_0A"] if place == 2 else at["A_B"] * (0.30 - 0.12) + at["V_0B"]
        flow = at["B_v"] * x_v * (to_supply * from_supply + to_tank * from_tank) + at["c_L"] * (from_supply - from_tank)
        assert smooth[place] == pytest.approx(at["E_oil"] / volume * (flow + area * v), rel=1e-9)


# --- the limit of small widths ------------------------------------------------------------------------------------------


def orders(differences: list[float]) -> Any:
    """Exponents of the width between successive halvings."""
    return np.log2(np.array(differences[:-1]) / differences[1:])


def test_a_trajectory_across_the_kink_comes_near_the_sharp_one_with_the_square_of_the_width() -> None:
    """The flow differs by x_v (1 - tanh)/2 where |x_v| is about w: an area of order w^2."""
    crossing = point(v=0.2, x_v=0.05, u=0.3, dt=2e-3)
    sharp = fp.sensitivities(MODEL, crossing, THETA, rtol=1e-12)
    assert sharp.x[0, 4] < -0.1
    size = np.array([0.1, 0.1, 1e7, 1e7, 1.0])
    found = [
        fp.sensitivities(fp.HydraulicCylinder(smooth={"x_v": width}), crossing, THETA, rtol=1e-12)
        for width in (16e-3, 8e-3, 4e-3, 2e-3)
    ]
    np.testing.assert_allclose(orders([np.abs((one.x - sharp.x) / size).max() for one in found]), 2.0, atol=0.05)
    of_B_v = NAMES.index("B_v")
    changes = [np.abs((one.dx_dtheta - sharp.dx_dtheta)[0, 2:4, of_B_v]).max() for one in found]
    np.testing.assert_allclose(orders(changes), 2.0, atol=0.05)


def test_a_start_near_standstill_comes_near_the_sharp_one_with_the_width() -> None:
    """From v = w/10 on, friction is short by a_tau (1 - tanh(v/w)) until v has grown past w."""
    size, differences = np.array([1e-4, 0.1, 1e7, 1e7, 1.0]), []
    for width in (4e-3, 2e-3, 1e-3, 5e-4):
        start = point(v=width / 10, p_A=10e6, p_B=8e6, x_v=0.3, u=-0.3, dt=1e-3)
        sharp = fp.simulate(MODEL, start, THETA, rtol=1e-12)
        smooth = fp.simulate(fp.HydraulicCylinder(smooth={"v": width}), start, THETA, rtol=1e-12)
        assert sharp.status[0] == smooth.status[0] == fp.Status.ok
        differences.append(float(np.abs((smooth.x - sharp.x) / size).max()))
    assert differences[-1] > 1e-6
    np.testing.assert_allclose(orders(differences), 1.0, atol=0.2)


def test_away_from_the_surfaces_the_two_are_the_same() -> None:
    rng = np.random.default_rng(3)
    low, high = np.array([[0.03, 0.15, 8e6, 8e6, 0.3], [0.27, 0.25, 12e6, 12e6, 0.8]])
    points = fp.Experiments(rng.uniform(low, high, (50, 5)), rng.uniform(-0.8, -0.3, (50, 1)), rng.uniform(1e-3, 2e-3, 50))
    sharp, smooth = (fp.sensitivities(model, points, THETA, rtol=1e-10) for model in (MODEL, SMOOTH))
    assert (sharp.status == fp.Status.ok).sum() > 40
    assert np.array_equal(sharp.status, smooth.status)
    for a, b in ((sharp.y, smooth.y), (sharp.dy_dtheta, smooth.dy_dtheta)):
        assert (np.abs(a - b) <= 1e-8 * np.abs(a).max(axis=0)).all()


# --- on the surfaces ----------------------------------------------------------------------------------------------------


def test_trajectories_start_at_rest_and_turn_round() -> None:
    for points, message in ((REST, "off the switching surface v = 0"), (TURNING, None)):
        if message:
            with pytest.raises(ValueError, match=message):
                fp.simulate(MODEL, points, THETA, jumps="exclude")
        else:
            assert fp.simulate(MODEL, points, THETA, jumps="exclude").status[0] == fp.Status.met_jump
        done = fp.simulate(SMOOTH, points, THETA, rtol=1e-10)
        assert done.status[0] == fp.Status.ok
        methods = [fp.simulate(SMOOTH, points, THETA, rtol=1e-10, method=method).x for method in ("RK45", "DOP853")]
        np.testing.assert_allclose(*methods, rtol=1e-6, atol=1e-9)
    assert done.x[0, 1] < 0 and done.x[0, 4] < 0


def test_a_held_piston_stays_where_the_net_force_is_below_friction() -> None:
    """Without leakage and with the valve closed, oil under pressure holds the piston."""
    closed = fp.Experiments([[0.1, 0.0, 6.4e6, (6.4e6 * 1.9635e-3 - 100) / 9.4562e-4, 0.0]], [[0.0]], [0.5])
    done = fp.simulate(SMOOTH, closed, dict(MODEL.nominal) | {"c_L": 0.0}, rtol=1e-8)
    assert done.status[0] == fp.Status.ok
    assert abs(done.x[0, 0] - 0.1) < 1e-5 and abs(done.x[0, 1]) < 1e-8
    # In the end tanh carries no force at standstill.
    assert abs(1.9635e-3 * done.x[0, 2] - 9.4562e-4 * done.x[0, 3]) < 1e-3


@pytest.mark.parametrize("points", [REST, TURNING])
def test_sensitivities_are_those_of_finite_differences(points: fp.Experiments) -> None:
    found = fp.sensitivities(SMOOTH, points, THETA, rtol=1e-10)
    assert found.status[0] == fp.Status.ok
    for i in range(len(NAMES)):
        step = np.zeros(len(THETA))
        step[i] = 1e-4 * THETA[i]
        ends = [fp.simulate(SMOOTH, points, THETA + sign * step, rtol=1e-13).y[0] for sign in (1, -1)]
        difference = (ends[0] - ends[1]) / 2e-4
        expected = found.dy_dtheta[0, :, i] * THETA[i]
        assert (np.abs(difference - expected) <= 1e-5 * np.abs(expected) + 1e-8 * np.array([1e-2, 1e7, 1e7, 1.0])).all()


def test_the_tolerance_holds_where_trajectories_turn_round() -> None:
    rng = np.random.default_rng(1)
    low, high = np.array([[0.03, -0.03, 5e6, 9e6, -0.3], [0.27, 0.03, 8e6, 13e6, 0.3]])
    points = fp.Experiments(rng.uniform(low, high, (100, 5)), rng.uniform(-0.5, 0.5, (100, 1)), rng.uniform(2e-3, 1e-2, 100))
    found, exact = (fp.sensitivities(SMOOTH, points, THETA, rtol=rtol) for rtol in (1e-6, 1e-11))
    assert not found.status.any() and not exact.status.any()
    turned = np.sign(points.x0[:, 1]) != np.sign(exact.x[:, 1])
    assert turned.sum() > 30
    scale = np.abs(exact.dy_dtheta).max(axis=0)
    error = np.abs(found.dy_dtheta - exact.dy_dtheta)[turned] / np.where(scale > 0, scale, 1)
    assert error.max() < 5e-5


# --- as a model ---------------------------------------------------------------------------------------------------------


def test_it_is_told_apart_shown_and_sent() -> None:
    twin, wider = fp.HydraulicCylinder(smooth=dict(reversed(WIDTHS.items()))), fp.HydraulicCylinder(smooth={"v": 2e-3, "x_v": 1e-3})
    assert twin == SMOOTH and hash(twin) == hash(SMOOTH)
    assert len({SMOOTH, wider, MODEL, fp.HydraulicCylinder(smooth={"v": 1e-3})}) == 4
    assert eval(repr(SMOOTH), {"HydraulicCylinder": fp.HydraulicCylinder}) == SMOOTH
    assert "smooth" not in repr(MODEL)
    sent = pickle.loads(pickle.dumps(SMOOTH))
    assert sent == SMOOTH and sent.smooth == WIDTHS
    np.testing.assert_array_equal(fp.simulate(sent, REST, THETA).x, fp.simulate(SMOOTH, REST, THETA).x)


def test_constants_and_parameters_are_exchanged_in_it() -> None:
    model = SMOOTH.estimate("T_1").fix(p_t=5e5)
    assert model.jumps == model.kinks == ()
    theta = {name: value for name, value in MODEL.nominal.items() if name != "p_t"} | {"T_1": SMOOTH.constants["T_1"]}
    np.testing.assert_allclose(fp.simulate(model, REST, theta).x, fp.simulate(SMOOTH, REST, THETA).x, rtol=1e-8)
    free = SMOOTH.free_start("v")
    by_start = fp.sensitivities(free, REST, dict(free.nominal), rtol=1e-10).dy_dtheta[0, :, -1]
    ends = []
    for v in (1e-6, -1e-6):
        moved = fp.Experiments(REST.x0 + np.array([0, v, 0, 0, 0]), REST.u, REST.dt)
        ends.append(fp.simulate(SMOOTH, moved, THETA, rtol=1e-13).y[0])
    np.testing.assert_allclose(by_start, (ends[0] - ends[1]) / 2e-6, rtol=1e-4, atol=1e-6)


def test_a_toml_file_has_it(tmp_path: Path) -> None:
    path = tmp_path / "model.toml"
    path.write_text(SMOOTH.to_toml())
    assert fp.load_model(path) == SMOOTH
    path.write_text('[model]\nname = "hydraulic_cylinder"\nsmooth = { v = 1e-2 }\n')
    assert fp.load_model(path) == fp.HydraulicCylinder(smooth={"v": 1e-2})
    assert "smooth" not in MODEL.to_toml()


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("smooth = { v = 0.0 }", "model.smooth.v: "),
        ("smooth = { v = -1e-3 }", "model.smooth.v: "),
        ("smooth = 1e-3", "model.smooth: "),
        ("smooth = { w = 1e-3 }", "unknown key model.smooth.w; expected one of v, x_v"),
    ],
)
def test_a_toml_file_with_a_mistake_names_the_key(line: str, expected: str, tmp_path: Path) -> None:
    path = tmp_path / "model.toml"
    path.write_text(f'[model]\nname = "hydraulic_cylinder"\n{line}\n')
    with pytest.raises(ConfigError) as raised:
        fp.load_model(path)
    assert str(raised.value).startswith(f"{path}: {expected}")
    assert "\n" not in str(raised.value)


def test_models_with_equations_have_no_such_key(tmp_path: Path) -> None:
    path = tmp_path / "model.toml"
    equations = '[model.parameters]\nk = "1/s"\n[model.states]\nc = "1"\n[model.outputs]\nc = "1"\n[model.equations]\nc = "-k*c"\n'
    path.write_text(f'[model]\nname = "decay"\nsmooth = {{ v = 1e-3 }}\n{equations}')
    with pytest.raises(ConfigError, match=r"model\.smooth: expected only with a built-in model"):
        fp.load_model(path)


@pytest.mark.parametrize(
    ("smooth", "error", "message"),
    [
        ({"v": 0.0}, ValueError, r"smooth\['v'\]: expected a positive width, given 0"),
        ({"x_v": -1e-3}, ValueError, r"smooth\['x_v'\]: expected a positive width, given -0.001"),
        ({"v": float("nan")}, ValueError, r"smooth\['v'\]: expected finite numbers"),
        ({"v": "narrow"}, ValueError, r"smooth\['v'\]: expected numbers"),
        ({"q": 1e-3}, ValueError, "smooth: expected names of v, x_v; given unknown 'q'"),
        (1e-3, TypeError, "smooth: expected a mapping of names"),
    ],
)
def test_misuse_is_refused(smooth: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        fp.HydraulicCylinder(smooth=smooth)


def test_a_design_is_made_saved_and_loaded(tmp_path: Path) -> None:
    at_rest = {name: (value, value) for name, value in (("v", 0.0), ("p_A", 6.4e6), ("p_B", 12.9e6), ("x_v", 0.0))}
    bounds = {"q": (0.03, 0.27), **at_rest, "u": (-0.3, 0.3), "dt": (1e-3, 3e-2)}
    given = problem(model=SMOOTH, region=fp.ExperimentRegion(bounds), rule=fp.LinearizedRule())
    design = fp.exchange(given, n_experiments=6, n_candidates=10, max_iterations=5, method=fp.ExchangeMethod(references=False))
    assert design.evaluation.rank == len(NAMES)
    design.save(tmp_path)
    loaded = fp.Design.load(tmp_path)
    assert loaded.problem.model == SMOOTH
    assert fp.evaluate(loaded.problem, loaded.points).log_det == pytest.approx(design.evaluation.log_det, abs=1e-12)
    plain = problem(model=MODEL)
    sharp = fp.exchange(plain, n_experiments=6, n_candidates=5, max_iterations=1, method=fp.ExchangeMethod(references=False))
    sharp.save(tmp_path)
    assert fp.Design.load(tmp_path).problem.model == MODEL
    assert "smooth" not in (tmp_path / "design.json").read_text()


def test_it_is_compiled_on_request(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """With no compiler it stays as it is and says so; the kernels themselves are those of every symbolic model."""
    assert not SMOOTH.compiled and MODEL.compiled and MODEL.compile() is MODEL
    monkeypatch.setenv("CXX", str(tmp_path / "none"))
    with pytest.warns(UserWarning, match="the model stays interpreted"):
        same = SMOOTH.compile()
    assert same == SMOOTH and not same.compiled and isinstance(same, fp.HydraulicCylinder)


def test_the_example_starts_at_rest() -> None:
    config = load_config(Path(__file__).parents[2] / "examples" / "figure2.toml")
    assert config.build_model() == SMOOTH
    region = config.problem().region
    assert region is not None and region.bounds["v"] == region.bounds["x_v"] == (0.0, 0.0)
