"""Derivatives of models that are Python functions: complex steps, differences, and when rounding has eaten them."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.models.callable import tangents
from tank_functions import (
    NOMINAL,
    PRIOR,
    REGION,
    rates,
    real_rates,
    tanks,
)


def points(count: int, seed: int = 0) -> fp.Experiments:
    return REGION.draw(tanks(), count, seed=seed)


def kind_of_derivative(f: Any) -> str:
    with pytest.warns(UserWarning, match="CallableModel 'tanks': sensitivities by ") as said:
        fp.sensitivities(tanks(f), points(2), NOMINAL)
    return "complex step" if "complex step:" in str(said[0].message) else "central differences"


def test_complex_step_is_taken_where_the_functions_keep_complex_numbers() -> None:
    def with_abs(x: Any, u: Any, p: Any) -> Any:
        return rates(x, u, p)[0] * np.abs(x.h1) / x.h1, rates(x, u, p)[1]

    def with_float(x: Any, u: Any, p: Any) -> Any:
        return np.asarray(rates(x, u, p)).astype(float).T

    def with_refusal(x: Any, u: Any, p: Any) -> Any:
        if np.iscomplexobj(x):
            raise NotImplementedError
        return rates(x, u, p)

    assert kind_of_derivative(rates) == "complex step"
    for lossy in (with_abs, with_float, with_refusal, real_rates):
        assert kind_of_derivative(lossy) == "central differences"


def test_a_function_that_is_no_complex_one_behind_a_branch_is_found(quiet: None) -> None:
    """np.sign of a complex number is z / |z|, which shows only where z2 is above 1.2: not where the trajectory begins."""
    model = fp.CallableModel(
        lambda x, u, p: [-p.k * x.z1, 1.0 + 0 * x.z2],
        lambda x, u, p: np.sign(x.z1) * np.maximum(x.z2 - 1.2, 0.0),
        {"z1": "1", "z2": "1"},
        {},
        {"k": "1"},
        {"y": "1"},
    )
    done = fp.sensitivities(model, fp.Experiments([[1.9, 1.1]], [[]], [1.0]), [2.0])
    assert done.y[0, 0] == pytest.approx(0.9) and done.dy_dtheta[0, 0, 0] == pytest.approx(0.0, abs=1e-8)
    assert model.core.by_complex_step is False


@pytest.mark.parametrize(
    "root",
    [
        lambda z: np.abs(np.minimum(np.maximum(z - 1, 0), 0.1) - 5),
        lambda z: np.abs(np.where(z > 1, np.where(z < 1.1, z - 6, -4.9), -5.0)),
        lambda z: abs(np.stack([np.clip(z, 1.0, 1.1), z])[0] - 6),
        lambda z: np.linalg.norm(np.stack([np.clip(z, 1.0, 1.1) - 6]), axis=0),
        lambda z: (6 - np.clip(z, 1.0, 1.1)) * np.sign(1.05 - np.clip(z, 1.0, 1.1)) * np.sign(1.05 - np.clip(z, 1.0, 1.1)),
    ],
    ids=["abs", "abs of where", "built in", "norm", "sign"],
)
def test_no_complex_step_is_taken_through_abs_and_sign_of_what_rarely_depends_on_the_state(quiet: None, root: Any) -> None:
    """Found by a random campaign: between 1 and 1.1, where no state had been tried, the derivative of abs was lost."""
    kinks = {"above": lambda x, u, p: x.z - 1, "beyond": lambda x, u, p: x.z - 1.1}
    start = fp.Experiments([[0.6]], [[]], [0.2])
    pieces = fp.SymbolicModel(
        ["k*z**2 + (6 - min(max(z, 1), 1.1))*(2*z - 0.98)"], ["z"], {"z": "1"}, {}, {"k": "1"}, {"y": "1"}, check_units=False
    )
    expected = fp.sensitivities(pieces, start, [0.36], rtol=1e-10).dy_dtheta
    assert expected[0, 0, 0] == pytest.approx(0.420, abs=1e-3)
    model = fp.CallableModel(
        lambda x, u, p: p.k * x.z**2 + root(x.z) * (2 * x.z - 0.98),
        lambda x, u, p: x.z,
        {"z": "1"},
        {},
        {"k": "1"},
        {"y": "1"},
        kinks=kinks,
    )
    np.testing.assert_allclose(fp.sensitivities(model, start, [0.36]).dy_dtheta, expected, rtol=1e-3)
    assert model.core.by_complex_step is False


def test_the_cost_is_said_once() -> None:
    model, given = tanks(), points(2)
    with pytest.warns(UserWarning) as said:
        fp.sensitivities(model, given, NOMINAL)
        fp.sensitivities(model, given, NOMINAL)
        fp.predictive_covariance(model, given, PRIOR, fp.SparseGaussHermite(1))
        fp.predictive_covariance(model, given, PRIOR, fp.SparseGaussHermite(1))
    first, second = (str(one.message) for one in said)
    assert "1 integration of 10 states per point, with 5 rows per evaluation" in first and " ms per point" in first
    assert "predictive covariances: 9 integrations per point" in second
    assert all(one.filename == __file__ for one in said)


def test_a_difference_of_two_infinities_is_no_warning() -> None:
    def huge(x: Any, u: Any, p: Any) -> Any:
        return np.full_like(x, np.inf)

    one = np.ones(1)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        _, derivatives = tangents.tangents(huge, one, np.ones((1, 1)), one, one, one, one, by_complex_step=False)
    assert np.isnan(derivatives).all()  # which the kernels give a status


def test_derivatives_that_overflow_warn_of_nothing() -> None:
    one = np.ones(1)
    rate, slope = tangents.tangents(lambda x, u, p: np.exp(709 * x) * p, one, one[None], one, one, one, one, by_complex_step=True)
    assert np.isfinite(rate).all() and np.isinf(slope).all()


def growing(slope: float, pull: float) -> fp.CallableModel:
    """z' = slope z + pull k: a function that loses complex numbers, of a state that leaves its natural size far behind."""
    return fp.CallableModel(
        lambda x, u, p: np.asarray(slope * x.z + pull * p.k).astype(float)[:, None],
        lambda x, u, p: x.z,
        {"z": ("1", 1.0)},
        {},
        {"k": "1"},
        {"y": "1"},
    )


@pytest.mark.parametrize("dt", [1.0, 10.0, 13.0])
def test_differences_of_a_state_that_has_grown_are_those_of_its_size(quiet: None, dt: float) -> None:
    """Steps of the size with which it began are lost in its rounding at 1e11."""
    done = fp.sensitivities(growing(2.0, -0.7), fp.Experiments([[1.1]], [[]], [dt]), [0.85])
    assert done.status[0] == 0
    np.testing.assert_allclose(done.dy_dtheta[0, 0, 0], -0.7 * np.expm1(2 * dt) / 2, rtol=1e-6)


def test_sensitivities_that_rounding_has_eaten_are_not_ok(quiet: None) -> None:
    """A change of 1e-10 of what f is: differences have six digits of it at first, and none when z has reached 1e11."""
    model, done = growing(2.0, 1e-10), []
    for dt in (0.5, 13.0):
        done.append(fp.sensitivities(model, fp.Experiments([[1.1]], [[]], [dt]), [0.85]))
    assert [fp.Status(one.status[0]).name for one in done] == ["ok", "step_limit"]
    assert done[1].dy_dtheta[0, 0, 0] == 0 and np.isfinite(done[1].y).all()


BESIDE_AN_EDGE = {
    "jump, the value above": (lambda b: np.where(b >= 0.5, 3 * b, 0.0), 3.0),
    "jump, the value below, of complex numbers": (lambda b: np.where(b > 0.5, 3 * b, 1.0), 0.0),
    "jump, the value below": (lambda b: np.heaviside(b - 0.5, 0.0) + b * b, 1.0),
    "a small jump": (lambda b: 1e3 + 1e-3 * np.heaviside(b - 0.5, 0.0), 0.0),
    "floor": (lambda b: np.floor(2 * b) + b, 1.0),
    "infinite slope above": (lambda b: b + np.where(b > 0.5, np.sqrt(np.abs(b - 0.5)), 0.0), 1.0),
    "no value below": (lambda b: np.sqrt(b - 0.5) ** 3 + b, 1.0),
    "square, complex": (lambda b: (b - 0.5) * (b - 0.5), 0.0),
    "square": (lambda b: (b - 0.5) ** 2, 0.0),
    "cube": (lambda b: np.abs(b - 0.5) ** 3, 0.0),
    "sine": (lambda b: np.sin(np.real(b) - 0.5), 1.0),
    "corner": (lambda b: np.abs(b - 0.5), 0.0),
}
NO_DERIVATIVE = {
    "root": lambda b: np.sqrt(b - 0.5),
    "real root": lambda b: np.sqrt(np.maximum(b - 0.5, 0)) - np.sqrt(np.maximum(0.5 - b, 0)),
    "sign": lambda b: np.sign(b - 0.5),
    "one point": lambda b: np.where(b == 0.5, 1.0, 0.0),
}


def model_of(edge: Any, where: str) -> tuple[fp.CallableModel, fp.Experiments]:
    """The function of a parameter of a model without states, or of a state that does not move and starts off by a parameter."""
    if where == "a parameter":
        return fp.CallableModel(None, lambda x, u, p: [edge(p.b) + p.a], None, {}, {"a": "1", "b": "1"}), fp.Experiments(
            [[]], [[]], [1.0]
        )
    if where == "a rate":
        model = fp.CallableModel(
            lambda x, u, p: [edge(p.b) + 0 * x.z], lambda x, u, p: [x.z + p.a], {"z": "1"}, {}, {"a": "1", "b": "1"}
        )
        return model, fp.Experiments([[0.0]], [[]], [1.0])
    model = fp.CallableModel(
        lambda x, u, p: [0 * x.z], lambda x, u, p: [edge(x.z + p.b) + p.a], {"z": "1"}, {}, {"a": "1", "b": "1"}
    )
    return model, fp.Experiments([[0.0]], [[]], [1.0])


@pytest.mark.parametrize("where", ["a parameter", "a rate", "a state and a parameter"])
@pytest.mark.parametrize("edge, expected", BESIDE_AN_EDGE.values(), ids=BESIDE_AN_EDGE)
def test_derivative_beside_a_jump_is_that_of_the_side_of_the_value(quiet: None, edge: Any, expected: float, where: str) -> None:
    model, point = model_of(edge, where)
    done = fp.sensitivities(model, point, [0.7, 0.5])
    assert done.status[0] == 0
    np.testing.assert_allclose(done.dy_dtheta[0, 0], [1.0, expected], rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("where", ["a parameter", "a rate", "a state and a parameter"])
@pytest.mark.parametrize("edge", NO_DERIVATIVE.values(), ids=NO_DERIVATIVE)
def test_function_without_a_derivative_is_not_ok(quiet: None, edge: Any, where: str) -> None:
    model, point = model_of(edge, where)
    assert fp.sensitivities(model, point, [0.7, 0.5]).status[0] == fp.Status.not_finite
