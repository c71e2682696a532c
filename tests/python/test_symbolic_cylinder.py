"""The cylinder written in SymPy is the built-in one."""

from __future__ import annotations

import numpy as np
import pytest

import fisherpoint as fp
from conftest import random_points
from defaults import MODEL, NAMES, PRIOR

CYLINDER = MODEL.symbolic()
THETA = MODEL.theta(MODEL.nominal)


def test_its_quantities_surfaces_and_domain_are_found() -> None:
    for kind in ("name", "states", "inputs", "outputs", "parameters", "constants", "nominal", "jumps", "kinks"):
        assert getattr(CYLINDER, kind) == getattr(MODEL, kind), kind
    assert CYLINDER.jumps == ("v",) and CYLINDER.kinks == ("x_v",) and CYLINDER.poles == ()
    assert CYLINDER.domain[:4] == MODEL.domain[:4]
    assert CYLINDER.domain[4:] == ("A_A*(q - q_min) + V_0A", "A_B*(q_max - q) + V_0B")  # V_A and V_B, written out


def test_its_programs_compute_what_the_built_in_one_does() -> None:
    points, programs = random_points(np.random.default_rng(0), 200), CYLINDER.structure.programs
    theta = THETA * np.random.default_rng(1).uniform(0.8, 1.2, (200, 9))
    sides = np.sign(MODEL.switching(points.x0, points.u, theta))
    arguments = (theta, points.u, points.x0, sides, points.x0)
    rates = MODEL.rhs(points.x0, points.u, theta)
    np.testing.assert_allclose(programs.rates.evaluate(*arguments), rates, rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(programs.output.evaluate(*arguments), MODEL.output(points.x0, points.u, theta), rtol=0)
    surfaces = np.hstack([MODEL.switching(points.x0, points.u, theta), MODEL.limits(points.x0, points.u, theta)])
    np.testing.assert_allclose(programs.surfaces.evaluate(*arguments), surfaces, rtol=1e-13)


def test_its_trajectories_are_those_of_the_built_in_one() -> None:
    points = random_points(np.random.default_rng(2), 300)
    ours, built_in = fp.sensitivities(CYLINDER, points, THETA), fp.sensitivities(MODEL, points, THETA)
    assert set(built_in.status.tolist()) >= {fp.Status.ok, fp.Status.met_jump, fp.Status.left_domain}
    np.testing.assert_array_equal(ours.status, built_in.status)
    ok = built_in.status == fp.Status.ok
    np.testing.assert_allclose(ours.y[ok], built_in.y[ok], rtol=1e-10)
    size = np.abs(built_in.dy_dtheta[ok]).max(axis=0)
    assert (np.abs(ours.dy_dtheta[ok] - built_in.dy_dtheta[ok]) <= 1e-6 * size).all()


def test_a_constant_is_estimated_and_a_parameter_fixed() -> None:
    opened = MODEL.estimate("T_1")
    assert [quantity.name for quantity in opened.parameters] == [*NAMES, "T_1"]
    assert opened.nominal["T_1"] == MODEL.constants["T_1"] and "T_1" not in opened.constants
    assert opened.parameters[-1].unit == "s"
    points = random_points(np.random.default_rng(3), 40)
    done, known = fp.sensitivities(opened, points, opened.nominal), fp.simulate(MODEL, points, THETA)
    ok = done.status == fp.Status.ok
    np.testing.assert_allclose(done.y[ok], known.y[ok], rtol=1e-5)
    # x_v(dt) = k_u u + (x_v - k_u u) exp(-dt/T_1), where only T_1 has an influence
    u, x_v, tau = points.u[ok, 0], points.x0[ok, 4], points.dt[ok] / MODEL.constants["T_1"]
    np.testing.assert_allclose(done.dy_dtheta[ok, 3, 9], (x_v + u) * np.exp(-tau) * tau / MODEL.constants["T_1"], rtol=1e-4)
    assert not done.dy_dtheta[ok, 3, :9].any()

    fixed = MODEL.fix(p_t=6e5)
    assert "p_t" not in [quantity.name for quantity in fixed.parameters] and fixed.constants["p_t"] == 6e5
    theta = {name: value for name, value in MODEL.nominal.items() if name != "p_t"}
    expected = MODEL.rhs(points.x0, points.u, dict(MODEL.nominal) | {"p_t": 6e5})
    np.testing.assert_allclose(fixed.rhs(points.x0, points.u, theta), expected, rtol=1e-12)
    assert fixed.estimate("p_t").fix(p_t=6e5) == fixed
    for wrong in (lambda: MODEL.estimate("p_t"), lambda: MODEL.fix(T_1=1.0), lambda: MODEL.estimate("colour")):
        with pytest.raises(ValueError, match=r"expected names of .*; given '(p_t|T_1|colour)'"):
            wrong()


def test_parameters_without_sense_are_refused() -> None:
    for name, value, expected in (("m_q", 0.0, "m_q: expected"), ("p_t", 3e7, "p_s - p_t: expected"), ("V_0A", -1.0, "V_0A: ")):
        with pytest.raises(ValueError, match=expected):
            CYLINDER.theta(dict(PRIOR.mean) | {name: value})
