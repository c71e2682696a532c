"""What a user sees of a fit: estimates, tests, warnings, and what happens at the edges."""

from __future__ import annotations

import re
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.stats import chi2, norm
from scipy.stats import t as student

import fisherpoint as fp
from fisherpoint.design.file.configuration import load_config
from fit_cases import EXAMPLES, cylinder, decay


def test_it_is_the_least_squares_fit_of_numpy() -> None:
    """Gauss-Newton by hand on c_0 exp(-k t), and the textbook's standard errors with n - p."""
    model, data = decay()
    t, y = data.points.dt, data.y[:, 0]
    theta = np.array([20.0, 5e-4])
    for _ in range(50):
        predicted = theta[0] * np.exp(-theta[1] * t)
        jacobian = np.stack([np.exp(-theta[1] * t), -t * predicted], axis=1)
        theta = theta + np.linalg.lstsq(jacobian * [1, 1e-4], y - predicted, rcond=None)[0] * [1, 1e-4]
    variance = np.square(y - theta[0] * np.exp(-theta[1] * t)).sum() / (len(y) - 2)
    covariance = np.linalg.inv(jacobian.T @ jacobian) * variance
    fit = fp.estimate(model, data)
    assert list(fit.estimate.values()) == pytest.approx(theta, rel=1e-8)
    assert list(fit.standard_errors.values()) == pytest.approx(np.sqrt(np.diag(covariance)), rel=1e-5)
    assert fit.covariance == pytest.approx(covariance, rel=1e-5)
    known = fp.estimate(model, data, noise={"c": 0.2})
    assert known.chi_square == pytest.approx(np.square((y - theta[0] * np.exp(-theta[1] * t)) / 0.2).sum(), rel=1e-8)
    assert known.degrees_of_freedom == pytest.approx(len(y) - 2)
    assert known.tests["c"].p_value == pytest.approx(chi2.sf(known.chi_square, len(y) - 2))


def test_the_print_has_what_a_fit_is_judged_by() -> None:
    problem, data = cylinder()
    fit = fp.estimate(problem.model, data, problem.prior, noise=problem.noise)
    text = str(fit)
    for name, quantity in zip(fit.parameters, problem.model.parameters, strict=True):
        line = next(line for line in text.splitlines() if line.strip().startswith(f"{name} "))
        assert quantity.unit in line
        assert "%" in line
    assert "Beside the prior" in text
    assert "chi-square" in text
    assert "residual rms (10)" in text
    assert "starts at this minimum" in text
    assert "Warning" not in text
    assert repr(fit).startswith("Fit(a_tau=")


def test_a_notebook_shows_the_cells_of_the_print() -> None:
    problem, data = cylinder()
    fit = fp.estimate(problem.model, data, problem.prior, noise=problem.noise, bounds={"c_L": (2.9e-9, None)})
    page = ElementTree.fromstring(f"<div>{fit._repr_html_()}</div>")
    tables = page.findall("table")
    assert [table.findtext("caption") for table in tables] == [
        "Estimates",
        "Beside the prior",
        "Outputs",
        "Are the residuals white?",
        "Fit",
    ]
    rows = [["".join(cell.itertext()) for cell in row] for row in tables[0].findall("tr")]
    assert rows[0][:3] == ["parameter", "unit", "estimate"] and [row[0] for row in rows[1:]] == list(fit.parameters)
    lines = {line.split()[0]: re.split(r"  +", line.strip()) for line in str(fit).split("\n\n")[1].splitlines()[1:]}
    assert all(lines[row[0]] == row for row in rows)
    assert [float(row[2]) for row in rows[1:]] == pytest.approx(fit.values, rel=1e-3)
    said = [paragraph.findtext("b") for paragraph in page.findall("p") if "Warning" in "".join(paragraph.itertext())]
    assert len(said) == str(fit).count("Warning: ") >= 1


def test_a_wrong_constant_is_exposed_by_the_output_that_it_rules() -> None:
    problem, data = cylinder(T_1=2.5e-3)
    fit = fp.estimate(problem.model, data, problem.prior, noise=problem.noise)
    per = fit.tests["x_v"].per_degree_of_freedom
    assert per > 10
    wrong = "the model, the noise of this output or the minimum found is wrong"
    assert f"x_v: chi-square per degree of freedom {per:.3g}: {wrong}" in str(fit)


def test_noise_that_is_smaller_than_given_is_told() -> None:
    model, data = decay(n=40, noise=0.01)
    fit = fp.estimate(model, data, noise={"c": 0.2})
    assert "the noise of this output is smaller than given" in str(fit)


def test_fewer_numbers_than_unknowns_is_told() -> None:
    model, data = decay(n=1)
    fit = fp.estimate(model, data, noise={"c": 0.2})
    assert len(fit.null_directions) == 1
    assert "not determined" in str(fit)
    assert np.isinf(fit.standard_errors["k"])
    with pytest.raises(ValueError, match="noise: expected the noise, or more than 2 numbers"):
        fp.estimate(model, data)


def test_as_many_numbers_as_unknowns_leave_nothing_for_the_noise() -> None:
    model, data = decay(n=2)
    with pytest.raises(ValueError, match="noise: expected the noise, or more than 2 numbers"):
        fp.estimate(model, data)
    fit = fp.estimate(model, data, noise={"c": 0.2})
    assert fit.tests["c"].p_value is None
    assert str(fit)


def test_a_bound_is_kept_and_told() -> None:
    model, data = decay()
    fit = fp.estimate(model, data, noise={"c": 0.2}, bounds={"k": (None, 4e-4)})
    assert fit.estimate["k"] == pytest.approx(4e-4, rel=1e-6)
    assert fit.at_bounds == ("k",)
    assert "k is at its bound" in str(fit)


@pytest.mark.parametrize("known", [True, False])
def test_an_unknown_at_its_bound_is_not_free(known: bool) -> None:
    """A line with its slope at most 1, where the data want 2: by hand, the mean of y - u alone is estimated."""
    line = fp.SymbolicModel([], ["a + b*u"], {}, {"u": "1"}, {"a": "1", "b": "1"}, {"y": "1"}, nominal={"a": 0.0, "b": 0.5})
    u, y = np.array([0.0, 1.0, 2.0, 5.0]), np.array([0.1, 1.8, 4.3, 9.8])
    data = fp.Measurements(fp.Experiments(np.empty((4, 0)), u), y)
    fit = fp.estimate(line, data, noise={"y": 0.5} if known else None, bounds={"b": (None, 1.0)})
    residuals = (y - u) - (y - u).mean()
    variance = 0.25 if known else float(residuals @ residuals) / 3  # 4 values less one free unknown
    assert fit.converged and fit.at_bounds == ("b",)
    assert fit.estimate == pytest.approx({"a": (y - u).mean(), "b": 1.0})
    assert fit.degrees_of_freedom == pytest.approx(3)
    assert fit.noise_covariance[0, 0] == pytest.approx(variance)
    assert fit.standard_errors == pytest.approx({"a": np.sqrt(variance / 4), "b": np.inf})
    assert fit.intervals()["a"][1] - fit.estimate["a"] == pytest.approx(
        np.sqrt(variance / 4) * (norm.ppf(0.975) if known else student.ppf(0.975, 3))
    )
    if known:
        assert fit.tests["y"].p_value == pytest.approx(chi2.sf(float(residuals @ residuals) / variance, 3))
    assert fit.null_directions == ()
    (row,) = (line for line in str(fit).splitlines() if line.startswith("  b "))
    assert "at its bound" in row
    assert "b is at its bound: it has no standard error, and those of the others are with b there" in str(fit)
    assert "with 3 degrees of freedom" in str(fit)
    assert fit.to_dict()["parameters"]["b"]["standard_error"] is None
    # Its own interval is that of the likelihood; it ends where the bound is.
    profile = fit.profile("b")
    assert profile.ends == ("converged", "at_bound") and profile.interval[1] == pytest.approx(1.0)
    posterior = fit.posterior()  # of which the spread is that of both, were b free
    free = fp.estimate(line, data, noise={"y": 0.5})
    assert not known or posterior.std["b"] == pytest.approx(free.standard_errors["b"])


def test_a_bound_that_does_not_hold_does_not_count() -> None:
    model, data = decay()
    free, bounded = (fp.estimate(model, data, bounds=bounds) for bounds in (None, {"k": (4e-4, 6e-4)}))
    assert bounded.at_bounds == ()
    assert bounded.values == pytest.approx(free.values, rel=1e-8)
    assert bounded.covariance == pytest.approx(free.covariance, rel=1e-6)


def test_a_logarithm_that_runs_off_is_no_minimum() -> None:
    """k / (1 + k) is below 1, and the data are at 2: k becomes what a double allows."""
    model = fp.SymbolicModel([], ["u*k/(1 + k)"], {}, {"u": "1"}, {"k": "1"}, {"y": "1"}, nominal={"k": 1.0})
    u = np.linspace(1.0, 2.0, 6)
    data = fp.Measurements(fp.Experiments(np.empty((6, 0)), u), 2 * u)
    start = fp.GaussianPrior({"k": 1.0}, {"k": 0.5}, log=["k"])
    fit = fp.estimate(model, data, start=start, noise={"y": 0.1})
    assert not fit.converged and fit.stop_reason.words in str(fit)
    assert fit.message == f"{fit.stop_reason.words}. {fit.stop_reason.advice}"
    assert fp.estimate(model, data, start=start, noise={"y": 0.1}, bounds={"k": (None, 10.0)}).at_bounds == ("k",)


def test_several_sets_of_data_are_one() -> None:
    model, data = decay()
    whole = fp.estimate(model, data, noise={"c": 0.2})
    parts = fp.estimate(model, [data[:5], data[5:]], noise={"c": 0.2})
    assert parts.values == pytest.approx(whole.values, rel=1e-12)
    assert len(parts.data) == 2


def test_a_log_normal_prior_keeps_its_parameter_positive() -> None:
    config = load_config(EXAMPLES / "pharmacokinetics.toml")
    model, prior = config.build_model(), config.build_prior()
    points = fp.Experiments(np.tile([15.0, 0.0], (3, 1)), np.zeros((3, 0)), np.array([1e3, 5e3, 6e4]))
    fit = fp.estimate(model, fp.Measurements(points, [25.0, 20.0, 9.0]), prior, noise={"c": 1.0})
    assert all(low > 0 for low, _ in fit.intervals().values())
    assert all(fit.estimate[name] > 0 for name in fit.parameters)
    error, std = fit.standard_errors["k_a"], fit.prior.std["k_a"]
    assert error < std * fit.estimate["k_a"] / prior.mean["k_a"]


def test_outputs_that_were_not_measured_do_not_count() -> None:
    problem, data = cylinder()
    y = data.y.copy()
    y[:, 3], y[::3, 1] = np.nan, np.nan
    some = fp.Measurements(data.points, y)
    noise = {name: std for name, std in problem.noise.items() if name != "x_v"}
    fit = fp.estimate(problem.model, some, problem.prior, noise=noise)
    assert list(fit.tests) == ["q", "p_A", "p_B"]
    assert fit.tests["p_A"].count == 8
    assert np.isnan(fit.residuals[:, 3]).all()
    estimated = fp.estimate(problem.model, some, problem.prior)
    assert list(estimated.tests) == ["q", "p_A", "p_B"]
    assert np.isfinite(list(estimated.standard_errors.values())).all()
    assert "nan" not in str(estimated)


def test_a_model_without_nominal_values_wants_a_start() -> None:
    model = fp.SymbolicModel([], ["a*s"], states={}, inputs={"s": "1"}, parameters={"a": "1"}, outputs={"y": "1"})
    data = fp.Measurements(fp.Experiments(np.zeros((3, 0)), [[1.0], [2.0], [3.0]], np.ones(3)), [2.0, 4.1, 5.9])
    with pytest.raises(ValueError, match="start: expected a value of 'a'"):
        fp.estimate(model, data)
    fit = fp.estimate(model, data, start={"a": 1.0})
    assert fit.estimate["a"] == pytest.approx((2.0 + 8.2 + 17.7) / 14)
    assert fit.degrees_of_freedom == pytest.approx(2)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"start": {"kk": 1.0}}, "start: expected names of c_0, k; given unknown 'kk'"),
        ({"parameters": ["kk"]}, "parameters: expected names of c_0, k; given unknown 'kk'"),
        ({"noise": {"d": 1.0}}, "noise: expected names of c; given unknown 'd'"),
        ({"noise": {}}, "noise: expected at least one of c; given none"),
        ({"bounds": {"kk": (0, 1)}}, "bounds: expected names of c_0, k; given unknown 'kk'"),
        ({"prior": fp.GaussianPrior({"kk": 1.0}, {"kk": 1.0})}, "prior: expected names of c_0, k; given unknown 'kk'"),
    ],
)
def test_wrong_names_are_told(arguments: dict[str, Any], message: str) -> None:
    model, data = decay()
    with pytest.raises(ValueError, match=message):
        fp.estimate(model, data, **arguments)


def test_a_fit_with_a_perfect_match_and_unknown_noise_stays_finite() -> None:
    model, data = decay(noise=0.0)
    fit = fp.estimate(model, data)
    assert fit.estimate["k"] == pytest.approx(5e-4, rel=1e-6)
    assert np.isfinite(list(fit.standard_errors.values())).all()


def test_a_fit_shows_what_its_outputs_were_expected_to_scatter_by() -> None:
    """A line through the origin: the prior's spread of the slope times u, in the root mean square, beside the noise."""
    line = fp.SymbolicModel([], ["a*u"], {}, {"u": "1"}, {"a": "1"}, {"y": "1"})
    u = np.array([1.0, 2.0, 2.0, 5.0])
    data = fp.Measurements(fp.Experiments(np.empty((4, 0)), u), 1.1 * u)
    prior = fp.GaussianPrior({"a": 1.0}, std={"a": 0.3})
    fit = fp.estimate(line, data, prior=prior, noise={"y": 0.1})
    assert fit.apriori_covariance is not None
    assert fit.apriori_covariance[0, 0] == pytest.approx(0.1**2 + 0.3**2 * np.mean(u**2), rel=1e-9)
    assert "a priori (17)" in str(fit)
    alone = fp.estimate(line, data, start={"a": 1.0}, noise={"y": 0.1})
    assert alone.apriori_covariance is None
    assert "a priori" not in str(alone)


def test_the_information_is_the_sum_of_which_an_evaluation_has_a_share() -> None:
    """With the prior's own, which is one for each of unknowns in its standard deviations."""
    line = fp.SymbolicModel([], ["a + b*u"], {}, {"u": "1"}, {"a": "1", "b": "1"}, {"y": "1"})
    u, prior = np.array([1.0, 2.0, 2.0, 5.0]), fp.GaussianPrior({"a": 1.0, "b": 1.0}, std={"a": 0.3, "b": 0.2})
    points = fp.Experiments(np.empty((4, 0)), u)
    fit = fp.estimate(line, fp.Measurements(points, 1 + 1.1 * u), prior, noise={"y": 0.1})
    rows = np.stack([np.ones(4), u], axis=1) * [0.3, 0.2] / 0.1
    np.testing.assert_allclose(fit.information, rows.T @ rows + np.eye(2), rtol=1e-12)
    evaluation = fp.evaluate(fp.DesignProblem(line, prior, None, noise={"y": 0.1}), points)
    np.testing.assert_allclose(fit.information - np.eye(2), evaluation.information, rtol=1e-9)
    assert fit.to_dict()["information"] == fit.information.tolist()
