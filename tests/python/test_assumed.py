"""What is drawn anew in each point: its tangents by a second route, its share of D, and where it keeps points away from."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from defaults import KINDS, MODEL, NAMES, NOISE, PRIOR, SMALL, point, problem, same_bits, valid_points
from fisherpoint.information.assumed import MARGIN, assumed_covariance, starts_near
from fisherpoint.information.output_covariance import region_mean
from oracle import Floats
from test_callable_model import tanks as callable_tanks

THETA = MODEL.theta(MODEL.nominal)
POINTS = valid_points(12, seed=3, jumps="exclude")
UNCERTAIN = {"T_1": 2.2e-4, "A_A": 2e-6, "p_s": 1e5}
STARTS = {"q": 1e-5, "v": 2e-3, "p_A": 3e4}
QUICK: dict[str, Any] = {"n_experiments": 9, "n_candidates": 10, "max_iterations": 6, "method": fp.ExchangeMethod(references=False)}
TIGHT = 1e-11


def moved(points: fp.Experiments, place: int, by: float) -> fp.Experiments:
    x0 = points.x0.copy()
    x0[:, place] += by
    return fp.Experiments(x0, points.u, points.dt)


def central(outputs: Any, step: float) -> Floats:
    """Derivative of outputs(step) by the step, of fourth order."""
    near, far = outputs(step) - outputs(-step), outputs(2 * step) - outputs(-2 * step)
    return (8 * near - far) / (12 * step)


def cylinder_tangents(points: fp.Experiments) -> Floats:
    """dy/d(A_A, p_s, T_1, q, v, p_A), (K, n_y, 6), from trajectories of other cylinders and of other starts."""

    def with_constant(name: str) -> Any:
        def outputs(by: float) -> Floats:
            other = fp.HydraulicCylinder(**{name: MODEL.constants[name] + by})
            return fp.simulate(other, points, THETA, rtol=TIGHT).y

        return outputs

    def with_start(place: int) -> Any:
        return lambda by: fp.simulate(MODEL, moved(points, place, by), THETA, rtol=TIGHT).y

    steps = {"A_A": 2e-6, "p_s": 2e4, "T_1": 2e-6}
    by_constant = [central(with_constant(name), step) for name, step in steps.items()]
    by_start = [central(with_start(place), step) for place, step in ((0, 1e-4), (1, 1e-4), (2, 1e4))]
    return np.stack([*by_constant, *by_start], axis=2)


def share(tangents: Floats, std: list[float]) -> Floats:
    g = tangents * std
    return g @ g.transpose(0, 2, 1)


def close(actual: Floats, expected: Floats, rtol: float) -> None:
    """Covariances (K, n, n) up to a share of the standard deviations of each output over all points."""
    size = np.sqrt(np.diagonal(expected, axis1=1, axis2=2).max(axis=0))
    size = np.maximum(size, 1e-8)  # what is zero is rounding in differences
    np.testing.assert_allclose(actual / np.outer(size, size), expected / np.outer(size, size), rtol=0, atol=rtol)


@pytest.mark.parametrize("chosen", ["A_A", "p_s", "T_1", "q", "v", "p_A", "all"])
def test_tangents_of_the_cylinder_are_those_of_other_cylinders_and_starts(chosen: str) -> None:
    everything = UNCERTAIN | STARTS
    order = ["A_A", "p_s", "T_1", "q", "v", "p_A"]
    names = order if chosen == "all" else [chosen]
    constants, starts = ({name: of[name] for name in names if name in of} for of in (UNCERTAIN, STARTS))
    actual = assumed_covariance(MODEL, POINTS, THETA, varies=constants, initial_state_std=starts, rtol=TIGHT)
    assert not actual.status.any()
    tangents = cylinder_tangents(POINTS)[:, :, [order.index(name) for name in names]]
    close(actual.covariance, share(tangents, [everything[name] for name in names]), 1e-6)
    assert same_bits(actual.covariance, np.ascontiguousarray(actual.covariance.transpose(0, 2, 1)))


@fp.model(
    states={"h1": ("m", 0.5), "h2": ("m", 0.5)},
    inputs={"u": "V"},
    parameters=dict.fromkeys(("k1", "k2", "k3"), "1"),
    outputs={"y": "m", "w": "m"},
    constants={"area": (1.3, "m2"), "gain": (0.2, "1")},
    nominal={"k1": 0.5, "k2": 0.4, "k3": 0.3},
)
def tanks(x: Any, u: Any, p: Any) -> Any:
    flow = p.k1 * fp.math.sqrt(x.h1)
    rates = [(p.gain * u.u - flow) / p.area, (p.k2 * fp.math.sqrt(x.h1) - p.k3 * fp.math.sqrt(x.h2)) / p.area]
    return rates, [x.h2, x.h1 * x.h1 + p.gain * x.h2]


TANK_THETA = np.array([0.5, 0.4, 0.3])
TANK_POINTS = fp.Experiments([[0.5, 0.6], [0.9, 0.4], [0.3, 0.3]], [1.0, 2.5, 0.4], [0.5, 1.5, 2.0])


def test_tangents_of_a_python_model() -> None:
    """Constants, a parameter that is not estimated, and starts, also where the output reads them directly."""

    def outputs(name: str) -> Any:
        def at(by: float) -> Floats:
            other, theta = tanks, TANK_THETA.copy()
            if name == "k3":
                theta[2] += by
            else:  # a constant becomes a parameter and takes another value
                other, theta = tanks.estimate(name), np.append(theta, tanks.constants[name] + by)
            return fp.simulate(other, TANK_POINTS, theta, rtol=TIGHT).y

        return at

    def started(place: int) -> Any:
        return lambda by: fp.simulate(tanks, moved(TANK_POINTS, place, by), TANK_THETA, rtol=TIGHT).y

    uncertain, starts = {"gain": 0.01, "k3": 0.02, "area": 0.05}, {"h1": 0.01, "h2": 0.003}
    tangents = [central(outputs(name), 1e-3) for name in uncertain] + [central(started(place), 1e-3) for place in (0, 1)]
    actual = assumed_covariance(tanks, TANK_POINTS, TANK_THETA, varies=uncertain, initial_state_std=starts, rtol=TIGHT)
    close(actual.covariance, share(np.stack(tangents, axis=2), [*uncertain.values(), *starts.values()]), 1e-6)


def test_without_a_standard_deviation_there_is_no_share() -> None:
    for stds in ({}, None, {"T_1": 0.0}):
        assert not assumed_covariance(MODEL, POINTS, THETA, varies=stds, initial_state_std=None).covariance.any()
    assert not assumed_covariance(MODEL, POINTS, THETA, varies=None, initial_state_std={"q": 0.0}).covariance.any()


def test_a_point_whose_tangents_fail_has_a_status_and_zeros() -> None:
    points = fp.Experiments.join([point(), point(v=1e-4, p_A=15e6, p_B=3e6, dt=5e-3), point(v=-1e-3, p_A=15e6, p_B=3e6)])
    result = assumed_covariance(MODEL, points, THETA, varies=UNCERTAIN, initial_state_std=STARTS, jumps="exclude")
    expected = fp.simulate(MODEL, points, THETA, jumps="exclude").status
    assert expected.any() and not expected.all()
    np.testing.assert_array_equal(result.status, expected)
    failed = result.status != fp.Status.ok
    assert not result.covariance[failed].any() and result.covariance[~failed].any()


# --- in D ----------------------------------------------------------------------------------------------------------------


def expected_d(given: fp.DesignProblem, points: fp.Experiments) -> Floats:
    """D_k (K, n_y, n_y), by hand."""
    r = np.diag(np.square(list(NOISE.values())))
    own = share(cylinder_tangents(points), [UNCERTAIN[name] for name in ("A_A", "p_s", "T_1")] + list(STARTS.values()))
    predictive = fp.predictive_covariance(MODEL, points, PRIOR, SMALL).covariance
    kind = given.output_covariance
    if kind == "pooled":
        return np.broadcast_to(r + (own + predictive).mean(axis=0), own.shape)
    return r + own + (predictive if kind == "pointwise" else region_mean(given, 1) if kind == "region" else 0.0)


@pytest.mark.parametrize("kind", KINDS)
def test_each_point_is_weighed_with_its_own_covariance(kind: str) -> None:
    given = problem(output_covariance=kind, varies=UNCERTAIN, initial_state_std=STARTS)
    evaluation = fp.evaluate(given, POINTS)
    d = expected_d(given, POINTS)
    size = np.sqrt(np.diagonal(d, axis1=1, axis2=2).max(axis=0))
    actual = np.broadcast_to(evaluation.output_covariance, d.shape)
    assert evaluation.output_covariance.ndim == (2 if kind == "pooled" else 3)
    np.testing.assert_allclose(actual / np.outer(size, size), d / np.outer(size, size), atol=1e-5)
    s = fp.sensitivities(MODEL, POINTS, THETA).dy_dtheta * np.array(list(PRIOR.std.values()))
    fisher = 2 / len(s) * sum(one.T @ np.linalg.inv(d_k) @ one for one, d_k in zip(s, d, strict=True))
    np.testing.assert_allclose(evaluation.fisher, fisher, rtol=1e-3, atol=1e-3 * np.abs(fisher).max())
    assert evaluation.log_det == pytest.approx(np.linalg.slogdet(fisher)[1], abs=1e-3)


def test_what_is_uncertain_makes_no_point_better() -> None:
    exact, uncertain = (fp.evaluate(problem(varies=of), POINTS) for of in (None, UNCERTAIN))
    assert exact.standard_errors is not None and uncertain.standard_errors is not None
    assert all(uncertain.standard_errors[name] > exact.standard_errors[name] for name in NAMES)


@pytest.mark.long
def test_a_design_that_knows_what_is_uncertain_hangs_on_it_less() -> None:
    """What docs/how_to/assumptions.md states of T_1, with a shorter search."""
    exact, stated = (problem(varies=of, rule=fp.SparseGaussHermite(2)) for of in (None, {"T_1": 2.2e-4}))
    blind, aware = (
        fp.exchange(of, 12, n_candidates=50, max_iterations=80, method=fp.ExchangeMethod(references=False)).points
        for of in (exact, stated)
    )
    log_dets = {
        name: [fp.evaluate(of, points).log_det for of in (exact, stated)]
        for name, points in {"blind": blind, "aware": aware}.items()
    }
    lost = {name: (known - uncertain) / 9 for name, (known, uncertain) in log_dets.items()}  # log of squared standard errors
    assert log_dets["aware"][1] > log_dets["blind"][1]
    assert 2 * lost["aware"] < lost["blind"]


@pytest.mark.parametrize("kind", KINDS)
def test_nothing_uncertain_is_the_same_to_the_last_bit(kind: str) -> None:
    without = fp.exchange(problem(output_covariance=kind), **QUICK)
    given = problem(output_covariance=kind, varies={}, initial_state_std={})
    assert (given.varies, given.initial_state_std, given.assumed) == (None, None, None)
    empty = fp.exchange(given, **QUICK)
    assert same_bits(empty.points.table, without.points.table)
    assert same_bits(empty.evaluation.fisher, without.evaluation.fisher)
    assert empty.rejected == without.rejected


def test_a_parameter_that_is_not_estimated_may_be_uncertain() -> None:
    chosen = [name for name in NAMES if name != "c_L"]
    known = fp.evaluate(problem(parameters=chosen), POINTS)
    uncertain = fp.evaluate(problem(parameters=chosen, varies={"c_L": PRIOR.std["c_L"]}), POINTS)
    s = fp.sensitivities(MODEL, POINTS, THETA).dy_dtheta
    g = s[:, :, [NAMES.index("c_L")]] * PRIOR.std["c_L"]
    r = np.diag(np.square(list(NOISE.values())))
    np.testing.assert_allclose(uncertain.output_covariance, r + g @ g.transpose(0, 2, 1), rtol=1e-6)  # both to the tolerance
    assert uncertain.log_det < known.log_det


def test_the_predictive_form_is_16_over_what_is_uncertain() -> None:
    rule = fp.TensorGrid(3, span=1.5)
    given = problem(varies={"T_1": 6e-4}, assumed_covariance="predictive", rule=rule, jumps="exclude")
    points = POINTS[[k for k in range(12) if k != 9]]  # which meets the jump at one of the three values of T_1
    with pytest.raises(ValueError, match=r"points\[9\] \(met_jump\)"):
        fp.evaluate(given, POINTS)
    values, weights = rule.nodes(fp.GaussianPrior({"T_1": MODEL.constants["T_1"]}, std={"T_1": 6e-4}))
    y = [fp.simulate(fp.HydraulicCylinder(T_1=value), points, THETA).y for value in values[:, 0]]
    off = np.array(y) - fp.simulate(MODEL, points, THETA).y
    expected = np.einsum("r,rki,rkj->kij", weights / weights.sum(), off, off)
    actual = fp.evaluate(given, points).output_covariance - np.diag(np.square(list(NOISE.values())))
    close(actual, expected, 1e-4)
    tangents = assumed_covariance(MODEL, points, THETA, varies={"T_1": 6e-4}).covariance
    with pytest.raises(AssertionError):  # T_1 is far enough from linear here
        close(tangents, expected, 1e-2)
    linear = fp.evaluate(given.replace(rule=fp.LinearizedRule()), points).output_covariance
    close(linear - np.diag(np.square(list(NOISE.values()))), tangents, 1e-6)


def test_estimates_take_either_form() -> None:
    """With one parameter, the standard error is that of the covariances that the form gives."""
    points = POINTS[[k for k in range(12) if k != 9]]
    data = fp.Measurements(points, fp.simulate(MODEL, points, THETA, rtol=1e-9).y)
    names, uncertain = ["E_oil"], {"T_1": 6e-4}
    for rule in (None, fp.TensorGrid(3, span=1.5)):
        fit = fp.estimate(
            MODEL, data, start=PRIOR.mean, parameters=names, noise=NOISE, deviations=fp.Deviations(varies=uncertain, rule=rule)
        )
        share = assumed_covariance(MODEL, points, THETA, varies=uncertain, rtol=1e-9, rule=rule).covariance
        s = fp.sensitivities(MODEL, points, THETA, rtol=1e-9).dy_dtheta[:, :, NAMES.index("E_oil")]
        d = np.diag(np.square(list(NOISE.values()))) + share
        information = np.einsum("ki,ki->", s, np.linalg.solve(d, s[:, :, None])[:, :, 0])
        assert fit.standard_errors["E_oil"] == pytest.approx(information**-0.5, rel=1e-4)


def test_both_forms_agree_where_deviations_are_small() -> None:
    chosen = [name for name in NAMES if name != "c_L"]
    small: dict[str, Any] = {"varies": {"T_1": 2e-6, "c_L": 2e-12}, "initial_state_std": {"q": 1e-6, "v": 1e-5, "p_A": 100.0}}
    tangents = problem(parameters=chosen, rule=fp.SparseGaussHermite(2), **small)
    shares = [
        fp.evaluate(given, POINTS).output_covariance - given.noise_covariance
        for given in (tangents, tangents.replace(assumed_covariance="predictive", rtol=1e-10))
    ]
    close(shares[1], shares[0], 1e-3)


# --- starts --------------------------------------------------------------------------------------------------------------


def test_starts_near_a_jump_or_limit_are_told() -> None:
    near, far = MARGIN * STARTS["v"] * 0.99, MARGIN * STARTS["v"] * 1.01
    points = fp.Experiments.join(
        [point(), point(v=near), point(v=far), point(v=-near), point(p_A=0.5e6 + 8.9e4), point(p_A=0.5e6 + 9.1e4), point(p_A=1e5)]
    )
    found = starts_near(MODEL, points, THETA, STARTS, kinks=False)
    assert {name: rows.tolist() for name, rows in found.items()} == {"v": [1, 3], "p_A - p_t": [4]}
    assert starts_near(MODEL, points, THETA, {"q": 1e-9}, kinks=False) == {}
    # A kink may be crossed, unless the reading is the strict one.
    edge = point(x_v=1e-4)
    assert starts_near(MODEL, edge, THETA, {"x_v": 1e-3}, kinks=False) == {}
    assert list(starts_near(MODEL, edge, THETA, {"x_v": 1e-3}, kinks=True)) == ["x_v"]


def test_distances_count_in_standard_deviations_of_the_surface() -> None:
    """A surface that hangs on two states, one of them squared: |s| against the norm of its gradient times the deviations."""
    model = fp.SymbolicModel(
        ["-k*sign(a - b**2)", "-k*b"], ["a", "b"], {"a": ("1", 1.0), "b": ("1", 1.0)}, {}, {"k": "1"}, {"a": "1", "b": "1"}
    )
    rng = np.random.default_rng(0)
    points = fp.Experiments(rng.uniform(-1, 1, (400, 2)), np.empty((400, 0)), np.full(400, 0.1))
    a, b = points.x0.T
    distance = np.abs(a - b**2) / np.hypot(0.05, 2 * b * 0.02)
    (found,) = starts_near(model, points, np.array([0.1]), {"a": 0.05, "b": 0.02}, kinks=False).values()
    np.testing.assert_array_equal(found, np.flatnonzero(distance < MARGIN))
    assert 20 < len(found) < 200


def test_candidates_near_a_jump_are_rejected_and_counted() -> None:
    given = problem(initial_state_std={"v": 0.02})
    design = fp.exchange(given, 9, n_candidates=20, max_iterations=30, method=fp.ExchangeMethod(references=False))
    assert np.abs(design.points.x0[:, 1]).min() >= MARGIN * 0.02
    assert design.rejected["starts near v = 0"] > 0
    assert design.drawn == design.accepted + sum(design.rejected.values())
    assert "starts near v = 0" not in fp.exchange(problem(varies=UNCERTAIN), **QUICK).rejected
    # What was measured there counts all the same.
    assert np.isfinite(fp.evaluate(given, POINTS).log_det)


# --- misuse --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "error", "expected"),
    [
        ({"uncertain": {"T1": 1e-4}}, ValueError, r"uncertain: expected names of A_A, A_B.*; given unknown 'T1'"),
        ({"uncertain": {"T_1": 0.0}}, ValueError, r"uncertain\['T_1'\]: expected a positive standard deviation, given 0"),
        (
            {"uncertain": {"T_1": -1e-4}},
            ValueError,
            r"uncertain\['T_1'\]: expected a positive standard deviation, given -0.0001",
        ),
        ({"uncertain": {"T_1": np.nan}}, ValueError, r"uncertain\['T_1'\]: expected finite numbers"),
        (
            {"uncertain": {"c_L": 1e-9}},
            ValueError,
            r"uncertain: expected constants or parameters that are not estimated, given 'c_L'",
        ),
        ({"varies": {"c_L": 1e-9}}, ValueError, r"varies: expected constants or parameters that are not estimated, given 'c_L'"),
        ({"varies": {"T1": 1e-4}}, ValueError, r"varies: expected names of A_A, A_B.*; given unknown 'T1'"),
        ({"uncertain": {"T_1": 1e-4}, "varies": {"T_1": 1e-4}}, ValueError, r"varies: expected names that are not among uncertain"),
        ({"uncertain": ["T_1"]}, TypeError, r"uncertain: expected a mapping of names to numbers, given list"),
        (
            {"initial_state_std": {"u": 1e-3}},
            ValueError,
            r"initial_state_std: expected names of q, v, p_A, p_B, x_v; given unknown",
        ),
        ({"initial_state_std": {"q": "a"}}, ValueError, r"initial_state_std\['q'\]: expected numbers"),
        ({"assumed_covariance": "exact"}, ValueError, r"assumed_covariance: expected 'tangents' or 'predictive', given 'exact'"),
        (
            {"varies": {"T_1": 1e-4}, "assumed_covariance": "predictive"},
            ValueError,
            r"rule: expected one without names of parameters for assumed_covariance='predictive'",
        ),
    ],
)
def test_mistakes(changes: dict[str, Any], error: type[Exception], expected: str) -> None:
    with pytest.raises(error, match=expected):
        problem(**changes)


def test_a_model_without_equations_has_no_uncertain_constants() -> None:
    model = callable_tanks(constants={"gain": (1.0, "1")})
    theta = model.theta(model.nominal)
    with pytest.raises(TypeError, match=r"varies: expected a model with equations .*, given a CallableModel"):
        assumed_covariance(model, TANK_POINTS, theta, varies={"gain": 0.1})
    prior = fp.GaussianPrior(model.nominal, relative_std=dict.fromkeys(model.nominal, 0.1))
    for label in ("uncertain", "varies"):
        with pytest.raises(TypeError, match=rf"{label}: expected a model with equations"):
            fp.DesignProblem(model, prior, None, noise={"y": 0.01}, **{label: {"gain": 0.1}})


@pytest.mark.filterwarnings("ignore:.*:UserWarning")
def test_its_starts_and_its_parameters_may_be_uncertain() -> None:
    model = callable_tanks()
    theta = model.theta(model.nominal)

    def started(by: float) -> Floats:
        return fp.simulate(model, moved(TANK_POINTS, 0, by), theta, rtol=1e-10).y

    def other_theta(by: float) -> Floats:
        return fp.simulate(model, TANK_POINTS, theta + by * np.eye(4)[2], rtol=1e-10).y

    tangents = np.stack([central(other_theta, 1e-3), central(started, 1e-3)], axis=2)
    actual = assumed_covariance(model, TANK_POINTS, theta, varies={"k3": 0.02}, initial_state_std={"h1": 0.01}, rtol=1e-8)
    close(actual.covariance, share(tangents, [0.02, 0.01]), 1e-5)
