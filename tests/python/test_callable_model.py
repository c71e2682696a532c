"""Models that are Python functions: the same results as from equations, on a slow path that says what it costs."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from conftest import random_points
from defaults import MODEL
from fisherpoint.models.callable import integration
from tank_functions import (
    INPUTS,
    NOMINAL,
    OUTPUTS,
    PARAMETERS,
    PRIOR,
    REGION,
    STATES,
    rates,
    real_rates,
    tanks,
)


@pytest.fixture(scope="module")
def equations() -> fp.SymbolicModel:
    f = ["-k1*sqrt(h1) + k4*u", "k2*sqrt(h1) - k3*sqrt(h2)"]
    return fp.SymbolicModel(f, ["h2"], STATES, INPUTS, PARAMETERS, OUTPUTS, name="tanks", nominal=NOMINAL)


def points(count: int, seed: int = 0) -> fp.Experiments:
    return REGION.draw(tanks(), count, seed=seed)


# --- the same as equations --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("f", "within"), [(rates, 1e-8), (real_rates, 1e-6)])
@pytest.mark.parametrize("method", ["RK45", "DOP853"])
def test_trajectories_and_sensitivities_are_those_of_the_equations(
    quiet: None, equations: fp.SymbolicModel, f: Any, within: float, method: str
) -> None:
    given = points(12)
    theta = np.array([0.5, 0.4, 0.3, 0.2]) * np.random.default_rng(1).uniform(0.8, 1.2, (12, 4))
    expected = fp.sensitivities(equations, given, theta, rtol=1e-12)
    found = fp.sensitivities(tanks(f), given, theta, rtol=1e-9, method=method)
    alone = fp.simulate(tanks(f), given, theta, rtol=1e-9, method=method)
    assert not found.status.any() and not alone.status.any()
    for a, b in ((alone.x, expected.x), (alone.y, expected.y), (found.x, expected.x), (found.y, expected.y)):
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-8)
    np.testing.assert_allclose(found.dx_dtheta, expected.dx_dtheta, rtol=0, atol=within)
    np.testing.assert_allclose(found.dy_dtheta, expected.dy_dtheta, rtol=0, atol=within)
    assert np.abs(expected.dy_dtheta).max() > 0.1


@pytest.mark.parametrize("rtol", [1e-4, 1e-7, 1e-10])
def test_the_tolerance_is_kept(quiet: None, equations: fp.SymbolicModel, rtol: float) -> None:
    given = points(10, seed=2)
    exact, found = fp.simulate(equations, given, NOMINAL, rtol=1e-13).x, fp.simulate(tanks(), given, NOMINAL, rtol=rtol).x
    assert np.abs(found - exact).max() < rtol


def cylinder_rates(x: Any, u: Any, p: Any) -> Any:
    opening, closing = np.where(x.x_v > 0, x.x_v, 0), np.where(x.x_v < 0, -x.x_v, 0)
    s_A, t_A, s_B, t_B = (np.sqrt(a) for a in (p.p_s - x.p_A, x.p_A - p.p_t, p.p_s - x.p_B, x.p_B - p.p_t))
    friction = p.a_tau * np.where(x.v > 0, 1, -1) + p.b_tau * x.v
    V_A, V_B = p.A_A * (x.q - p.q_min) + p.V_0A, p.A_B * (p.q_max - x.q) + p.V_0B
    Q_A = p.B_v * (opening * s_A - closing * t_A) + p.c_L * (s_A - t_A)
    Q_B = p.B_v * (closing * s_B - opening * t_B) + p.c_L * (s_B - t_B)
    return [
        x.v,
        (p.A_A * x.p_A - p.A_B * x.p_B - friction) / p.m_q,
        p.E_oil / V_A * (Q_A - x.v * p.A_A),
        p.E_oil / V_B * (Q_B + x.v * p.A_B),
        (p.k_u * u.u - x.x_v) / p.T_1,
    ]


def cylinder() -> fp.CallableModel:
    return fp.CallableModel(
        cylinder_rates,
        lambda x, u, p: [x.q, x.p_A, x.p_B, x.x_v],
        MODEL.states,
        MODEL.inputs,
        MODEL.parameters,
        MODEL.outputs,
        constants={quantity.name: (MODEL.constants[quantity.name], quantity) for quantity in MODEL.constant_quantities},
        domain={
            "p_A - p_t": lambda x, u, p: x.p_A - p.p_t,
            "p_s - p_A": lambda x, u, p: p.p_s - x.p_A,
            "p_B - p_t": lambda x, u, p: x.p_B - p.p_t,
            "p_s - p_B": lambda x, u, p: p.p_s - x.p_B,
        },
        jumps={"v": lambda x, u, p: x.v},
        kinks={"x_v": lambda x, u, p: x.x_v},
    )


def test_the_cylinder_meets_what_it_meets_and_crosses_its_kink(quiet: None) -> None:
    """Its jumps end trajectories whatever is asked, as nothing tells how to cross them."""
    drawn = random_points(np.random.default_rng(0), 60)
    every = fp.sensitivities(MODEL, drawn, MODEL.nominal, rtol=1e-10, jumps="exclude")
    crossed = every.x[:, 4] * drawn.x0[:, 4] < 0
    rows = [*np.flatnonzero(every.status == 0)[:8], *np.flatnonzero(every.status == 1)[:4], *np.flatnonzero(every.status == 2)[:4]]
    assert crossed[rows[:8]].sum() >= 3
    expected = [array[rows] for array in every]
    found = fp.sensitivities(cylinder(), drawn[rows], MODEL.nominal)
    assert found.status.tolist() == expected[4].tolist() == [0] * 8 + [1] * 4 + [2] * 4
    scale = np.array([quantity.scale or 1.0 for quantity in MODEL.states])
    assert np.abs((found.x - expected[0]) / scale)[:8].max() < 1e-6
    assert (np.abs(found.dy_dtheta - expected[3]) / (np.abs(expected[3]).max(axis=0) + 1e-300)).max() < 1e-5
    strict = fp.simulate(cylinder(), drawn[rows[:8]], MODEL.nominal, kinks="exclude")
    assert (strict.status == fp.Status.met_kink).tolist() == crossed[rows[:8]].tolist()
    with pytest.raises(ValueError, match=r"switching surface v = 0"):
        fp.simulate(cylinder(), fp.Experiments([[0.1, 0.0, 6e6, 6e6, 0.1]], [[0.1]], [1e-3]), MODEL.nominal)


def spring(x: Any, u: Any, p: Any) -> Any:
    """An oscillator whose spring is stiffer on one side."""
    return [x.b, -np.where(x.a > 0, p.k, p.m) * x.a]


def side(x: Any, u: Any, p: Any) -> Any:
    return x.a


def springs() -> tuple[fp.Model, fp.Model]:
    """The oscillator by functions and by equations."""
    states, parameters = {"a": "1", "b": "1"}, {"k": "1", "m": "1"}
    by_equations = fp.SymbolicModel(["b", "-where(a > 0, k, m)*a"], ["a"], states, {}, parameters)
    return fp.CallableModel(spring, side, states, {}, parameters, kinks={"a": side}), by_equations


def test_a_kink_is_crossed_again_and_again(quiet: None) -> None:
    """Five half turns."""
    given = fp.Experiments([[1.0, 0.2], [-0.5, 0.1]], np.empty((2, 0)), [12.0, 11.0])
    found, expected = (fp.sensitivities(one, given, [4.0, 1.0], rtol=1e-9) for one in springs())
    np.testing.assert_allclose(found.x, expected.x, rtol=0, atol=1e-8)
    np.testing.assert_allclose(found.dx_dtheta, expected.dx_dtheta, rtol=0, atol=1e-7)


def test_no_step_reaches_past_a_kink() -> None:
    """One that did would be off by 3e-5 here, and by 3e-3 with the looser tolerance."""
    rng = np.random.default_rng(0)
    given = fp.Experiments(rng.uniform(0.2, 1, (20, 2)) * [1, -1], np.empty((20, 0)), rng.uniform(0.5, 2, 20))
    functions, equations = springs()
    exact = fp.simulate(equations, given, [400.0, 1.0], rtol=1e-12).x
    for rtol in (1e-3, 1e-6):
        assert np.abs(fp.simulate(functions, given, [400.0, 1.0], rtol=rtol).x - exact).max() < rtol


def level_b(x: Any, u: Any, p: Any) -> Any:
    return x.b


def bump(x: Any) -> Any:
    """Of a clock: zero but for an eleventh of the time from 0 to 16."""
    return np.maximum(0.5 - (x.a - 5) ** 2, 0)


@pytest.mark.parametrize("method", ["RK45", "DOP853"])
@pytest.mark.parametrize("rtol", [1e-3, 1e-6, 1e-9])
@pytest.mark.parametrize("kinks", [{}, {"bump": lambda x, u, p: 0.5 - (x.a - 5) ** 2}])
def test_no_step_goes_over_a_bump(quiet: None, method: str, rtol: float, kinks: Any) -> None:
    """Before and behind it the rates are constant, so that errors ask for no short steps. Its area is sqrt(2)/3 times p."""
    model = fp.CallableModel(
        lambda x, u, p: [1 + 0 * x.a, p.p * bump(x)], level_b, {"a": "1", "b": "1"}, {}, {"p": "1"}, kinks=kinks
    )
    found = fp.sensitivities(model, fp.Experiments([[0.0, 0.0]], [[]], [16.0]), [3.0], rtol=rtol, method=method)
    alone = fp.simulate(model, fp.Experiments([[0.0, 0.0]], [[]], [16.0]), [3.0], rtol=rtol, method=method)
    area = np.sqrt(2) / 3
    allowed = 10 * rtol if kinks else 100 * rtol
    assert found.dy_dtheta[0, 0, 0] == pytest.approx(area, abs=allowed)
    assert found.y[0, 0] == pytest.approx(3 * area, abs=allowed) and alone.y[0, 0] == pytest.approx(3 * area, abs=allowed)


def test_no_step_goes_over_the_end_of_the_domain(quiet: None) -> None:
    """A limit that f does not read, and that is met for a moment only."""
    given = fp.Experiments([[0.0, 0.0]], [[]], [16.0])
    arguments: Any = (lambda x, u, p: [1 + 0 * x.a, p.p + 0 * x.a], level_b, {"a": "1", "b": "1"}, {}, {"p": "1"})
    inside = fp.CallableModel(*arguments, domain={"room": lambda x, u, p: 0.6 - bump(x)})
    outside = fp.CallableModel(*arguments, domain={"room": lambda x, u, p: 0.3 - bump(x)})
    assert [int(fp.simulate(model, given, [1.0]).status[0]) for model in (inside, outside)] == [fp.Status.ok, fp.Status.left_domain]


@pytest.mark.parametrize(("rule", "k"), [(fp.TensorGrid(levels=3), 2), (fp.SparseGaussHermite(2), 3)])
def test_predictive_covariances_are_those_of_the_equations(quiet: None, equations: fp.SymbolicModel, rule: fp.Rule, k: int) -> None:
    found, expected = (fp.predictive_covariance(model, points(k), PRIOR, rule, rtol=1e-9) for model in (tanks(), equations))
    assert not found.status.any()
    np.testing.assert_allclose(found.covariance, expected.covariance, rtol=1e-6)
    np.testing.assert_array_equal(found.lost_weight, expected.lost_weight)


def test_nodes_that_leave_the_domain_are_lost(quiet: None, equations: fp.SymbolicModel) -> None:
    """A prior so wide that the tank runs dry at its edge: the cells lose the point, another rule some weight."""
    given = fp.Experiments([[0.31, 0.5], [0.33, 0.5], [0.9, 0.9]], [0.0, 0.0, 1.0], [2.0, 2.0, 1.0])
    wide = fp.GaussianPrior(NOMINAL, relative_std={"k1": 0.3, "k2": 0.1, "k3": 0.1, "k4": 0.1})
    for rule in (fp.TensorGrid(levels=3), fp.Sobol(64), fp.SparseGaussHermite(2)):
        found, expected = (fp.predictive_covariance(model, given, wide, rule) for model in (tanks(), equations))
        np.testing.assert_array_equal(found.status, expected.status)
        np.testing.assert_allclose(found.lost_weight, expected.lost_weight)
        np.testing.assert_allclose(found.covariance, expected.covariance, rtol=1e-4, atol=1e-12)
        assert expected.status[0] == fp.Status.left_domain and expected.status[2] == fp.Status.ok


@pytest.mark.long
@pytest.mark.parametrize("kind", ["noise", "region"])
def test_the_exchange_finds_the_same_design(quiet: None, equations: fp.SymbolicModel, kind: str) -> None:
    def design(model: fp.Model) -> fp.Design:
        problem = fp.DesignProblem(
            model, PRIOR, REGION, noise={"y": 0.01}, rule=fp.LinearizedRule(), output_covariance=kind, rtol=1e-8
        )
        return fp.exchange(problem, 5, n_candidates=5, max_iterations=3, method=fp.ExchangeMethod("paper", references=False))

    found, expected = design(tanks()), design(equations)
    np.testing.assert_allclose(found.points.table, expected.points.table, rtol=1e-12)
    assert found.evaluation.log_det == pytest.approx(expected.evaluation.log_det, abs=1e-5)


def test_identifiability_is_told_of_functions_too(quiet: None) -> None:
    found = fp.identifiability(tanks(), region=REGION, unknown_start=["h1"], n_points=6, n_theta=2)
    assert found.null_directions == (
        "k1 up 1 %, k2 down 1 %, k4 up 2 %, the start of h1 up 2 %: no output changes; only k1*k2 and k4/k1**2 can be identified",
    )
    assert found.blocks == () and found.idle == ()


def test_a_static_model_has_no_trajectory(quiet: None) -> None:
    def dose(x: Any, u: Any, p: Any) -> Any:
        return p.E * u.d / (p.C + u.d)

    model = fp.CallableModel(None, dose, {}, {"d": "1"}, {"E": "1", "C": "1"}, domain={"d": lambda x, u, p: u.d})
    given, (E, C) = fp.Experiments(np.empty((3, 0)), [1.0, 4.0, -1.0]), (2.0, 3.0)
    found = fp.sensitivities(model, given, [E, C])
    assert found.status.tolist() == [0, 0, 2] and found.x.shape == (3, 0)
    d = np.array([1.0, 4.0])
    np.testing.assert_allclose(found.dy_dtheta[:2, 0], np.column_stack([d / (C + d), -E * d / (C + d) ** 2]), rtol=1e-14)
    assert not found.dy_dtheta[2].any()


# --- statuses ---------------------------------------------------------------------------------------------------------------


def scalar(f: Any, **changes: Any) -> fp.CallableModel:
    return fp.CallableModel(f, lambda x, u, p: x.c, {"c": "1"}, {}, {"k": "1"}, **changes)


def end(model: fp.CallableModel, c: float, dt: float, k: float = 1.0) -> fp.Trajectories:
    return fp.simulate(model, fp.Experiments([[c]], np.empty((1, 0)), [dt]), [k])


def test_a_root_that_runs_dry_has_left_the_domain() -> None:
    model = scalar(lambda x, u, p: -p.k * np.sqrt(x.c), domain={"c": lambda x, u, p: x.c})
    assert end(model, 1.0, 1.9).status == [fp.Status.ok] and end(model, 1.0, 1.9).x[0, 0] == pytest.approx(0.05**2, rel=1e-4)
    ended = end(model, 1.0, 2.1)
    assert ended.status == [fp.Status.left_domain] and abs(ended.x[0, 0]) < 1e-3
    assert end(model, -1.0, 1.0).status == [fp.Status.left_domain]


def test_a_jump_ends_the_trajectory() -> None:
    model = scalar(lambda x, u, p: -p.k * np.where(x.c > 0, 1, -1), jumps={"c": lambda x, u, p: x.c})
    assert end(model, 1.0, 0.9).status == [fp.Status.ok]
    ended = end(model, 1.0, 1.1)
    assert ended.status == [fp.Status.met_jump] and abs(ended.x[0, 0]) < 1e-6


def test_trouble_is_a_status_and_never_nan(monkeypatch: pytest.MonkeyPatch) -> None:
    blown = end(scalar(lambda x, u, p: p.k * x.c**2), 1.0, 2.0)
    assert blown.status[0] in (fp.Status.step_limit, fp.Status.not_finite) and np.isfinite(blown.x).all()
    nowhere = end(scalar(lambda x, u, p: np.sqrt(x.c)), -1.0, 1.0)
    assert nowhere.status == [fp.Status.not_finite] and np.isfinite(nowhere.x).all() and np.isfinite(nowhere.y).all()
    nothing = fp.CallableModel(lambda x, u, p: -p.k * x.c, lambda x, u, p: np.log(x.c), {"c": "1"}, {}, {"k": "1"})
    assert end(nothing, -1.0, 1.0).status == [fp.Status.not_finite] and end(nothing, -1.0, 1.0).y.tolist() == [[0.0]]
    monkeypatch.setattr(integration, "MAX_EVALUATIONS", 50)
    assert end(scalar(lambda x, u, p: -1e3 * p.k * (x.c - 1)), 2.0, 1.0).status == [fp.Status.step_limit]


# --- the model as an object -------------------------------------------------------------------------------------------------


def test_columns_are_read_by_name_before_anything_else() -> None:
    """T and size are names of arrays' own attributes."""

    def f(x: Any, u: Any, p: Any) -> Any:
        assert x.T.shape == (len(x),) and p.size == 3.0 and x[:, 0].shape == x.T.shape and u.shape == (len(x), 1)
        return [p.size * x.T + p.mean * u.u]

    model = fp.CallableModel(f, f, {"T": "K"}, {"u": "1"}, {"mean": "1"}, {"y": "K"}, constants={"size": (3.0, "1")})
    assert model.rhs([2.0], [1.0], [5.0]).tolist() == [11.0] and model.constants["size"] == 3.0


def test_it_is_pickled_compared_and_shown() -> None:
    model = tanks()
    again = pickle.loads(pickle.dumps(model))
    assert again == model and hash(again) == hash(model) and again != tanks(real_rates)
    assert again != tanks(nominal={}) and model != tanks(domain={})
    assert repr(model) == "CallableModel('tanks', 2 states, 1 input, 4 parameters, 1 output)"
    for refused in (model.to_toml, model.symbolic, lambda: model.blocks, lambda: model.fix(k1=1.0)):
        with pytest.raises(TypeError, match=r"tanks: expected a model with equations, given CallableModel"):
            refused()


def test_a_free_start_shifts_every_function() -> None:
    free = tanks(kinks={"h1 - k1": lambda x, u, p: x.h1 - p.k1}).free_start("h1")
    theta = [*NOMINAL.values(), 0.25]
    assert free.rhs([0.24, 0.5], [1.0], theta) == pytest.approx(tanks().rhs([0.49, 0.5], [1.0], NOMINAL))
    assert free.limits([[0.24, 0.5]], [[1.0]], theta).tolist() == [[0.49, 0.5]]
    assert free.switching([[0.24, 0.5]], [[1.0]], theta)[0, 0] == pytest.approx(-0.01)
    assert free.parameters[-1].name == "h1_0" and free.nominal["h1_0"] == 0.0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"f": lambda x, u, p: [x.h1]}, r"f: expected 2 entries, given 1"),
        ({"f": lambda x, u, p: np.ones((2, 3))}, r"f: expected shape \(2, 2\) for 2 rows, given \(2, 3\)"),
        ({"f": lambda x, u, p: x.h3}, r"f: .* given one that raises AttributeError: expected one of h1, h2; given unknown 'h3'"),
        ({"f": lambda x: x}, r"f: expected a function of x, u, p, given one that raises TypeError"),
        ({"f": 3}, r"f: expected a function of x, u, p, given int"),
        ({"f": None}, r"f: expected a function, given None"),
        ({"kinks": {"edge": lambda x, u, p: [x.h1, x.h2]}}, r"edge: expected 1 entries, given 2"),
        ({"nominal": {"k9": 1.0}}, r"nominal: expected names of k1, k2, k3, k4; given unknown 'k9'"),
        ({"constants": {"k1": (1.0, "1")}}, r"constants.k1: expected a name of its own"),
    ],
)
def test_misuse_is_named(changes: dict[str, Any], message: str) -> None:
    with pytest.raises((TypeError, ValueError), match=message):
        tanks(**changes)


def test_the_search_of_functions_is_that_of_the_paper(quiet: None) -> None:
    """That of "auto" would take hundreds of thousands of trajectories."""
    problem = fp.DesignProblem(tanks(), PRIOR, REGION, noise={"y": 0.01}, rule=fp.LinearizedRule())
    auto, paper = (
        fp.exchange(problem, 5, n_candidates=5, max_iterations=2, method=fp.ExchangeMethod(m, references=False))
        for m in ("auto", "paper")
    )
    np.testing.assert_array_equal(auto.points.table, paper.points.table)


@pytest.mark.parametrize("method", ["fastest", "RK45"])
def test_a_surface_with_a_double_root_is_crossed(quiet: None, method: str) -> None:
    """SciPy's search for the root of |z - 1| (z - 1) gives up after a hundred steps."""

    def square(x: Any, u: Any, p: Any) -> Any:
        return np.abs(x.z - 1) * (x.z - 1)

    states, rates = (
        {"s": "1", "c": "1", "z": "1", "w": "1"},
        ["3*c", "-3*s", "-k*z + s", "-100*(w - cos(s)) + max(s - 0.02, abs(z - 1)*(z - 1), 0)"],
    )
    model = fp.CallableModel(
        lambda x, u, p: [
            3 * x.c,
            -3 * x.s,
            -p.k * x.z + x.s,
            -100 * (x.w - np.cos(x.s)) + np.maximum(np.maximum(x.s - 0.02, square(x, u, p)), 0),
        ],
        lambda x, u, p: x.w,
        states,
        {},
        {"k": "1"},
        {"y": "1"},
        kinks={
            "s": lambda x, u, p: x.s - 0.02 - square(x, u, p),
            "z": square,
            "s0": lambda x, u, p: x.s - 0.02,
        },
    )
    equations = fp.SymbolicModel(rates, ["w"], states=states, inputs={}, parameters={"k": "1"}, outputs={"y": "1"})
    starts = np.array([-0.6389, -0.8601, 1.257, 1.565]) + 0.02 * np.random.default_rng(0).standard_normal((12, 4))
    points = fp.Experiments(starts, np.zeros((12, 0)), np.full(12, 2.478))
    done = fp.simulate(model, points, [0.7565], method=None if method == "fastest" else method)
    assert not done.status.any()
    np.testing.assert_allclose(done.x, fp.simulate(equations, points, [0.7565], rtol=1e-10).x, atol=1e-5)
