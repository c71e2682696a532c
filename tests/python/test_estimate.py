"""Estimates with known answers: models that are linear in the parameters have closed forms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.stats import t as student

import fisherpoint as fp
from fisherpoint.basics.values import Array

LINE = fp.SymbolicModel([], ["a + b*u"], {}, {"u": "1"}, {"a": "1", "b": "1"}, {"y": "1"}, nominal={"a": 1.0, "b": 1.0})
PAIR = fp.SymbolicModel(
    [],
    ["a + b*u", "b - c*u"],
    {},
    {"u": "1"},
    {"a": "1", "b": "1", "c": "1"},
    {"y": "1", "w": "1"},
    nominal={"a": 1, "b": 1, "c": 1},
)
U = np.linspace(-1.0, 2.0, 9)
POINTS = fp.Experiments(np.empty((len(U), 0)), U[:, None])
LINE_MATRIX = np.stack([np.ones_like(U), U], axis=1)
PRIOR = fp.GaussianPrior({"a": 0.5, "b": -0.5}, covariance=[[0.09, 0.02], [0.02, 0.04]])


def line_data(seed: int = 0, std: float = 0.1) -> Array:
    return np.asarray(2.0 - 0.7 * U + std * np.random.default_rng(seed).standard_normal(len(U)))


def pair_data(std: tuple[float, float] = (0.1, 0.3), seed: int = 0) -> Array:
    noise = np.random.default_rng(seed).standard_normal((len(U), 2)) * std
    return np.stack([2.0 - 0.7 * U, -0.7 - 0.4 * U], axis=1) + noise


def values(mapping: Any) -> Array:
    return np.array(list(mapping.values()))


def test_known_noise_is_weighted_least_squares() -> None:
    y, std = pair_data(), np.array([0.1, 0.3])
    matrix = np.zeros((len(U), 2, 3))
    matrix[:, 0, 0], matrix[:, 0, 1], matrix[:, 1, 1], matrix[:, 1, 2] = 1.0, U, 1.0, -U
    white = (matrix / std[:, None]).reshape(-1, 3)
    covariance = np.linalg.inv(white.T @ white)
    fit = fp.estimate(PAIR, fp.Measurements(POINTS, y), noise={"y": 0.1, "w": 0.3})
    np.testing.assert_allclose(values(fit.estimate), covariance @ white.T @ (y / std).ravel(), rtol=1e-9)
    np.testing.assert_allclose(fit.covariance, covariance, rtol=1e-9)
    np.testing.assert_allclose(values(fit.standard_errors), np.sqrt(np.diag(covariance)), rtol=1e-9)
    low, high = fit.intervals()["a"]
    assert (high - low) / 2 == pytest.approx(1.959964 * fit.standard_errors["a"], rel=1e-6)
    assert fit.converged


def test_outputs_that_were_not_measured_do_not_count() -> None:
    y = pair_data()
    y[2, 0] = y[5:, 1] = np.nan
    some = np.isfinite(y)
    matrix = np.zeros((len(U), 2, 3))
    matrix[:, 0, 0], matrix[:, 0, 1], matrix[:, 1, 1], matrix[:, 1, 2] = 1.0, U, 1.0, -U
    white, data = (matrix / np.array([[0.1], [0.3]]))[some], (y / [0.1, 0.3])[some]
    fit = fp.estimate(PAIR, fp.Measurements(POINTS, y), noise={"y": 0.1, "w": 0.3})
    np.testing.assert_allclose(values(fit.estimate), np.linalg.lstsq(white, data)[0], rtol=1e-9)
    np.testing.assert_allclose(fit.covariance, np.linalg.inv(white.T @ white), rtol=1e-9)
    assert fit.degrees_of_freedom == pytest.approx(some.sum() - 3)


def test_prior_gives_the_maximum_a_posteriori() -> None:
    y, inverse = line_data(), np.linalg.inv(PRIOR.covariance)
    covariance = np.linalg.inv(LINE_MATRIX.T @ LINE_MATRIX / 0.01 + inverse)
    mean = covariance @ (LINE_MATRIX.T @ y / 0.01 + inverse @ [0.5, -0.5])
    fit = fp.estimate(LINE, fp.Measurements(POINTS, y), PRIOR, noise={"y": 0.1})
    np.testing.assert_allclose(values(fit.estimate), mean, rtol=1e-8)
    np.testing.assert_allclose(fit.covariance, covariance, rtol=1e-8)
    posterior = fit.posterior()
    np.testing.assert_allclose(posterior.covariance, covariance, rtol=1e-8)


def test_two_batches_one_after_the_other_are_both_at_once() -> None:
    y = line_data()
    first = fp.estimate(LINE, fp.Measurements(POINTS[:4], y[:4]), PRIOR, noise={"y": 0.1})
    second = fp.estimate(LINE, fp.Measurements(POINTS[4:], y[4:]), first.posterior(), noise={"y": 0.1})
    both = fp.estimate(LINE, fp.Measurements(POINTS, y), PRIOR, noise={"y": 0.1})
    np.testing.assert_allclose(values(second.estimate), values(both.estimate), rtol=1e-8)
    np.testing.assert_allclose(second.covariance, both.covariance, rtol=1e-8)


def test_unknown_noise_of_one_output_is_ordinary_least_squares() -> None:
    y = line_data()
    coefficients, squares, *_ = np.linalg.lstsq(LINE_MATRIX, y)
    variance = squares[0] / (len(U) - 2)
    fit = fp.estimate(LINE, fp.Measurements(POINTS, y))
    np.testing.assert_allclose(values(fit.estimate), coefficients, rtol=1e-8)
    np.testing.assert_allclose(fit.covariance, variance * np.linalg.inv(LINE_MATRIX.T @ LINE_MATRIX), rtol=1e-6)
    np.testing.assert_allclose(fit.noise_covariance, variance, rtol=1e-6)
    np.testing.assert_allclose(values(fit.quantile_degrees_of_freedom), len(U) - 2, rtol=1e-6)
    low, high = fit.intervals(0.9)["b"]
    assert (high - low) / 2 == pytest.approx(student.ppf(0.95, len(U) - 2) * fit.standard_errors["b"], rel=1e-6)


def test_unknown_noise_minimises_log_det_of_the_residual_covariance() -> None:
    y = pair_data()
    fit = fp.estimate(PAIR, fp.Measurements(POINTS, y))

    def log_det(theta: Array) -> float:
        e = y - np.stack([theta[0] + theta[1] * U, theta[1] - theta[2] * U], axis=1)
        return float(np.linalg.slogdet(e.T @ e / len(U) if full else np.diag(np.diag(e.T @ e / len(U))))[1])

    full = len(U) > 3 + 2 * 2
    best = values(fit.estimate)
    for j in range(3):
        step = 1e-4 * np.eye(3)[j]
        assert abs(log_det(best + step) - log_det(best - step)) / 2e-4 < 1e-5 * np.sqrt(len(U)) / fit.standard_errors["abc"[j]]


def test_an_output_that_was_never_measured_does_not_disturb_unknown_noise() -> None:
    y = pair_data()
    y[:, 0] = np.nan
    alone = fp.SymbolicModel([], ["b - c*u"], {}, {"u": "1"}, {"b": "1", "c": "1"}, {"w": "1"}, nominal={"b": 1, "c": 1})
    fit = fp.estimate(PAIR, fp.Measurements(POINTS, y), parameters=("b", "c"))
    other = fp.estimate(alone, fp.Measurements(POINTS, y[:, 1:]))
    np.testing.assert_allclose(values(fit.estimate), values(other.estimate), rtol=1e-8)
    np.testing.assert_allclose(fit.covariance, other.covariance, rtol=1e-5)
    np.testing.assert_allclose(values(fit.quantile_degrees_of_freedom), len(U) - 2, rtol=1e-5)


def test_log_normal_posterior_is_the_same_normal_distribution_of_logarithms() -> None:
    decay = fp.SymbolicModel([], ["exp(-k*u)"], {}, {"u": "1"}, {"k": "1"}, {"y": "1"}, nominal={"k": 1.0})
    prior = fp.GaussianPrior({"k": 1.0}, relative_std={"k": 0.5}, log=["k"])
    points = fp.Experiments(np.empty((5, 0)), np.linspace(0.2, 2, 5)[:, None])
    y = np.exp(-1.3 * points.u)
    fit = fp.estimate(decay, fp.Measurements(points, y), prior, noise={"y": 0.05})
    posterior = fit.posterior()
    assert posterior.log == ("k",)
    spread = np.sqrt(fit.precision.covariance[0, 0]) * prior.normal_std[0]
    assert posterior.normal_std[0] == pytest.approx(spread, rel=1e-9)
    median = posterior.mean["k"] * np.exp(-(posterior.normal_std[0] ** 2) / 2)
    assert median == pytest.approx(fit.estimate["k"], rel=1e-9)
    low, high = fit.intervals()["k"]
    assert low * high == pytest.approx(fit.estimate["k"] ** 2, rel=1e-9)  # symmetric in the logarithm
    # The posterior as a prior with no further information stays what it is.
    again = fp.estimate(decay, fp.Measurements(points[:1], np.exp(-fit.estimate["k"] * points.u[:1])), posterior, noise={"y": 1e3})
    assert again.estimate["k"] == pytest.approx(fit.estimate["k"], rel=1e-4)
    assert again.posterior().normal_std[0] == pytest.approx(posterior.normal_std[0], rel=1e-4)


def test_what_the_data_leave_open_is_named() -> None:
    point = fp.Experiments(np.empty((3, 0)), np.ones((3, 1)))
    fit = fp.estimate(LINE, fp.Measurements(point, np.array([1.0, 1.1, 0.9])), noise={"y": 0.1})
    assert len(fit.null_directions) == 1
    assert "a" in fit.null_directions[0] and "b" in fit.null_directions[0]
    assert np.isinf(values(fit.standard_errors)).all()
    with pytest.raises(ValueError, match="posterior: expected data that determine every parameter"):
        fit.posterior()


def test_points_of_which_nothing_was_measured_are_left_out() -> None:
    model = fp.HydraulicCylinder()
    theta = np.array(list(model.nominal.values()))
    x0 = [[0.1, 0.1, 8e6, 6e6, 0.2], [0.1, 0.1, 4e5, 6e6, 0.2]]  # the second one starts below tank pressure
    points = fp.Experiments(x0, [[0.5], [0.5]], [2e-3, 2e-3])
    assert fp.simulate(model, points, theta).status.tolist() == [fp.Status.ok, fp.Status.left_domain]
    y = fp.simulate(model, points, theta, rtol=1e-9).y
    noise = {"q": 5e-6, "p_A": 2e4, "p_B": 2e4, "x_v": 1e-3}
    data = fp.Measurements(points, np.where([[True], [False]], y, np.nan))
    fit = fp.estimate(model, data, start={**model.nominal, "E_oil": 1.1e9}, parameters=["E_oil"], noise=noise)
    assert fit.estimate["E_oil"] == pytest.approx(1.2e9, rel=1e-8)
    assert fit.residuals.shape == (1, 4)


def test_what_is_estimated_is_not_uncertain_too() -> None:
    with pytest.raises(
        ValueError, match=r"^uncertain: expected constants or parameters that are not estimated, given 'a', which is"
    ):
        fp.estimate(LINE, fp.Measurements(POINTS, line_data()), noise={"y": 0.1}, deviations=fp.Deviations(uncertain={"a": 0.1}))


@pytest.mark.parametrize("use", ["prior", "start"])
def test_a_prior_of_known_parameters_alone_only_fixes_them(use: str) -> None:
    data, others = fp.Measurements(POINTS, line_data()), fp.GaussianPrior({"b": -0.7}, {"b": 0.1})
    expected = fp.estimate(LINE, data, start={"b": -0.7}, parameters=["a"], noise={"y": 0.1})
    prior, start = (others, None) if use == "prior" else (None, others)
    fit = fp.estimate(LINE, data, prior, start=start, parameters=["a"], noise={"y": 0.1})
    np.testing.assert_allclose(fit.values, expected.values, rtol=1e-12)
    np.testing.assert_allclose(fit.covariance, expected.covariance, rtol=1e-12)
    assert "weighted least squares" in str(fit) and "Beside the prior" not in str(fit)


def test_starts_of_records_that_would_share_a_name_are_refused() -> None:
    model = fp.SymbolicModel(["-k*x", "-k*x_2"], ["x"], {"x": "1", "x_2": "1"}, {}, {"k": "1/s"}, {"y": "1"}, nominal={"k": 1.0})
    record = fp.Record([0.0, 1.0, 2.0], np.empty((3, 0)), [1.0, 0.4, 0.1])
    fp.estimate(model, record, noise={"y": 0.1})
    with pytest.raises(ValueError, match=r"^states: expected different names for the starts .* given two called 'x0_x_2'"):
        fp.estimate(model, [record, record], noise={"y": 0.1})


def test_starts_of_every_record_are_searched_in_their_natural_size() -> None:
    model = fp.SymbolicModel(["-k*x"], ["x"], {"x": ("1", 1e-6)}, {}, {"k": "1/s"}, {"x": "1"}, nominal={"k": 1.0})
    record = fp.Record([0.0, 1.0, 2.0], np.empty((3, 0)), [0.0, 4e-7, 1e-7])
    fit = fp.estimate(model, [record, record], noise={"x": 1e-7})
    np.testing.assert_allclose(fit.weighted.unknowns.scale, [1.0, 1e-6, 1e-6])


def test_what_is_assumed_is_weighed_where_trajectories_are_ok() -> None:
    """At the prior's mean the tank runs empty, which other starts do not."""
    tank = fp.SymbolicModel(["-k*sqrt(h)"], ["h"], {"h": "1"}, {}, {"k": "1/s"}, {"h": "1"}, nominal={"k": 1.0})
    points = fp.Experiments(np.ones((5, 1)), np.empty((5, 0)), np.linspace(0.2, 1.9, 5))
    data = fp.VirtualRig(tank, {"k": 0.5}, {"h": 0.01}, initial_state_std={"h": 0.02}).measure(points)
    assert fp.simulate(tank, points, {"k": 3.0}).status.any()
    prior = fp.GaussianPrior({"k": 3.0}, {"k": 2.0})
    fit, near = (
        fp.estimate(tank, data, prior, start=start, noise={"h": 0.01}, deviations=fp.Deviations(initial_state_std={"h": 0.02}))
        for start in (None, {"k": 0.5})
    )
    assert fit.estimate["k"] == pytest.approx(near.estimate["k"], abs=1e-3 * near.standard_errors["k"])


@pytest.mark.parametrize(("w", "v"), [(1.6, 4.2), (1.6, 7.8), (4.4, 4.2), (4.4, 7.8)])
def test_starts_go_further_out_where_those_of_the_prior_end_in_wrong_minima(w: float, v: float) -> None:
    """Two frequencies, both two prior standard deviations off: from eight starts three of the four were missed by far."""
    units = {"w": "rad/s", "v": "rad/s", "a": "1"}
    waves = fp.SymbolicModel([], ["sin(w*u) + a*cos(v*u)"], {}, {"u": "s"}, units, {"y": "1"})
    u = np.linspace(0.0, 6.0, 25)
    y = np.sin(w * u) + np.cos(v * u) + 0.05 * np.random.default_rng(1).standard_normal(25)
    data = fp.Measurements(fp.Experiments(np.empty((25, 0)), u[:, None]), y)
    around = fp.GaussianPrior({"w": 3.0, "v": 6.0, "a": 0.8}, {"w": 0.7, "v": 0.9, "a": 0.2})
    fit = fp.estimate(waves, data, start=around, noise={"y": 0.05})
    assert fit.converged and not fit.unexplained and fit.starts == 24
    assert [fit.estimate["w"], fit.estimate["v"]] == pytest.approx([w, v], abs=0.03)


def test_starts_that_agree_are_enough() -> None:
    fit = fp.estimate(LINE, fp.Measurements(POINTS, line_data()), start=PRIOR, noise={"y": 0.1})
    assert (fit.reached, fit.starts) == (8, 8)


def test_data_that_no_start_explains_are_called_so() -> None:
    fit = fp.estimate(LINE, fp.Measurements(POINTS, line_data() + U**2), start=PRIOR, noise={"y": 0.01})
    assert fit.unexplained == ("y",) and (fit.reached, fit.starts) == (24, 24)
    assert "the model, the noise of this output or the minimum found is wrong" in str(fit)


def test_noise_of_an_output_that_can_be_fitted_exactly_is_not_told() -> None:
    """Two values for two unknowns: the likelihood grows without end as the noise vanishes, also with a prior."""
    data, prior = fp.Measurements(POINTS, line_data()), fp.GaussianPrior({"a": 2.0, "b": -0.7}, {"a": 1.0, "b": 1.0})
    few, enough = (fp.estimate(LINE, data[:count], prior) for count in (2, 9))
    assert few.noise_not_estimable == ("y",)
    assert not few.converged and few.stop_reason == "no_maximum"
    assert "not converged: the likelihood has no maximum" in str(few)
    assert enough.converged and not enough.noise_not_estimable


@pytest.mark.parametrize("label", ["varies", "initial_state_std"])
def test_what_is_assumed_is_not_for_records(label: str) -> None:
    decay = fp.SymbolicModel(["-k*x"], ["x"], {"x": "1"}, {}, {"k": "1/s", "g": "1"}, {"x": "1"}, nominal={"k": 1.0, "g": 1.0})
    record = fp.Record([0.0, 1.0, 2.0], np.empty((3, 0)), [1.0, 0.4, 0.1])
    assumed = {"g": 0.1} if label == "varies" else {"x": 0.1}
    with pytest.raises(ValueError, match=f"^{label}: expected measurements of points or runs, given a record"):
        fp.estimate(decay, record, parameters=["k"], noise={"x": 0.1}, deviations=fp.Deviations(**{label: assumed}))
