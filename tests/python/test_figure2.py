"""The paper's figure 2: after the valve has closed, leakage brings the pressures to rest; without it they stay."""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import fisherpoint as fp
from oracle import Floats

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
EXAMPLE = runpy.run_path(str(EXAMPLES / "figure2.py"))
MODEL = fp.load_model(EXAMPLES / "figure2.toml")
FULL, WITHOUT = dict(MODEL.nominal), dict(MODEL.nominal) | {"c_L": 0.0}
LONG = [*EXAMPLE["STEP"][:2], (4.0, 0.0)]
CLOSES = 0.45


def responses(model: fp.Model, step: Any = LONG, sample: float = 5e-3) -> tuple[Floats, Floats, Floats]:
    """Times, and states of the full model and of that without leakage."""
    rest = EXAMPLE["rest_state"](model, FULL, EXAMPLE["Q_START"])
    t, full = EXAMPLE["response"](model, FULL, rest, step, sample)
    return t, full, EXAMPLE["response"](model, WITHOUT, rest, step, sample)[1]


@pytest.fixture(scope="module")
def both() -> tuple[Floats, Floats, Floats]:
    return responses(MODEL)


def test_the_valve_closes_where_the_paper_says(both: tuple[Floats, Floats, Floats]) -> None:
    t, full, without = both
    assert sum(duration for duration, _ in EXAMPLE["STEP"][:2]) == pytest.approx(CLOSES)
    for x in (full, without):
        open_ = (t > 0.15) & (t < CLOSES)
        np.testing.assert_allclose(x[open_, 4], 0.2, atol=1e-6)
        np.testing.assert_allclose(x[t > CLOSES + 0.05, 4], 0.0, atol=1e-6)


def test_the_pressures_of_the_full_model_come_to_rest(both: tuple[Floats, Floats, Floats]) -> None:
    """From a low level to the state in which what leaks in is what the creeping piston takes, found here by bisection of v."""
    t, full, _ = both
    c, a = MODEL.constants, FULL

    def pressure(flow: float) -> float:
        """At which so much leaks into a chamber: c_L (sqrt(p_s - p) - sqrt(p - p_t)) falls with p."""
        low, high = a["p_t"], c["p_s"]
        for _ in range(100):
            p = (low + high) / 2
            low, high = (p, high) if a["c_L"] * (np.sqrt(c["p_s"] - p) - np.sqrt(p - a["p_t"])) > flow else (low, p)
        return p

    slow, fast = 0.0, 4e-3
    for _ in range(100):
        v = (slow + fast) / 2
        p_A, p_B = pressure(v * c["A_A"]), pressure(-v * c["A_B"])
        force = c["A_A"] * p_A - c["A_B"] * p_B - a["a_tau"] * np.tanh(v / 1e-3) - a["b_tau"] * v
        slow, fast = (v, fast) if force > 0 else (slow, v)
    np.testing.assert_allclose(full[-1, 1:4], [v, p_A, p_B], rtol=1e-4)
    np.testing.assert_allclose(full[0, 1:4], [v, p_A, p_B], rtol=1e-6)
    settled = t > CLOSES + 0.1
    for column, rest in ((2, p_A), (3, p_B)):
        assert full[t == t[t < CLOSES][-1], column] < 0.5 * rest  # "from a very low level"
        assert (np.diff(full[settled, column]) > -1.0).all()


def test_without_leakage_everything_stays_where_it_is(both: tuple[Floats, Floats, Floats]) -> None:
    t, full, without = both
    later = without[t > CLOSES + 0.15]
    np.testing.assert_allclose(later[:, 0], later[-1, 0], atol=1e-7)
    np.testing.assert_allclose(later[:, 1], 0.0, atol=1e-6)
    np.testing.assert_allclose(later[:, 2:4], np.tile(later[-1, 2:4], (len(later), 1)), atol=500.0)
    before = without[np.flatnonzero(t < CLOSES)[-1], 2:4]
    assert (np.abs(later[-1, 2:4] - before) < 0.3e6).all()
    assert (full[-1, 2:4] - later[-1, 2:4] > 3e6).all()


def test_the_picture_is_that_of_half_the_width(both: tuple[Floats, Floats, Floats]) -> None:
    half = responses(fp.HydraulicCylinder(smooth={"v": 5e-4, "x_v": 5e-4}), EXAMPLE["STEP"])
    for x, y in zip(both[1:], half[1:], strict=True):
        assert np.abs(x[: len(y), 2:4] - y[:, 2:4]).max() < 0.04e6
        assert np.abs(x[: len(y), 0] - y[:, 0]).max() < 1e-5


def test_the_vibration_is_that_of_an_independent_integrator(both: tuple[Floats, Floats, Floats]) -> None:
    t, _, without = both
    begin, end = (int(np.flatnonzero(np.isclose(t, time))[0]) for time in (CLOSES, CLOSES + 0.1))
    theta = MODEL.theta(WITHOUT)
    scale = np.array([1.0, 1.0, 1e7, 1e7, 1.0])
    found = solve_ivp(
        lambda _, z: MODEL.rhs(z * scale, 0.0, theta) / scale,
        (0, 0.1), without[begin] / scale, "Radau", rtol=1e-8, atol=1e-10, t_eval=[0.02, 0.1],
    )  # fmt: skip
    np.testing.assert_allclose(found.y[:, 1] * scale, without[end], rtol=1e-4, atol=1e-6)


def test_the_sharp_form_meets_the_jump_as_soon_as_the_valve_has_closed(both: tuple[Floats, Floats, Floats]) -> None:
    t, full, _ = both
    start = fp.Experiments(full[np.isclose(t, CLOSES)], [[0.0]], [0.02])
    assert fp.simulate(fp.HydraulicCylinder(), start, FULL, jumps="exclude").status[0] == fp.Status.met_jump
    assert fp.simulate(fp.HydraulicCylinder(), start, FULL).status[0] == fp.Status.ok


def test_the_sharp_form_gives_the_same_picture(both: tuple[Floats, Floats, Floats]) -> None:
    """But for the force that a piston which sticks keeps, and that the smooth one gives up."""
    for smooth, sharp, most in zip(both[1:], responses(fp.HydraulicCylinder(), EXAMPLE["STEP"])[1:], (0.06e6, 0.15e6), strict=True):
        assert np.abs(smooth[: len(sharp), 2:4] - sharp[:, 2:4]).max() < most


def test_the_picture_is_drawn(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    EXAMPLE["main"](tmp_path / "figure2.png")
    said = capsys.readouterr().out
    assert "rest state: v = 1.773 mm/s, p_A = 6.399 MPa, p_B = 12.885 MPa" in said
    assert (tmp_path / "figure2.png").stat().st_size > 30_000
