"""`fp.validate`: what is known of linear models, what is promised on the cylinder, and what goes wrong."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import least_squares

import fisherpoint as fp
from defaults import NOISE, problem, valid_points
from fisherpoint.basics.values import Array
from fisherpoint.estimation.least_squares import CONVERGED, minimise
from fisherpoint.estimation.precision import covariances
from fisherpoint.estimation.small_samples import inflated
from fisherpoint.validation import fits
from fisherpoint.validation.figures import OneParameter, mean, parameter_figures, share, standard_deviation, typical_size
from fisherpoint.validation.fits import Estimator
from fisherpoint.validation.truths import Rig, Streams, truths_of
from fisherpoint_command.cli import main

MODEL = {"inputs": {"u": "1"}, "parameters": {"a": "1", "b": "1"}, "outputs": {"y": "1"}}
LINE = fp.SymbolicModel([], ["a + b*u"], {}, **MODEL, nominal={"a": 1.0, "b": 1.0})
BENT = fp.SymbolicModel([], ["a + b*u + 0.3*u*u"], {}, **MODEL, nominal={"a": 1.0, "b": 1.0}, name="bent")
DECAY = fp.SymbolicModel([], ["a*exp(-b*u)"], {}, **MODEL, nominal={"a": 1.0, "b": 1.0})
PRIOR = fp.GaussianPrior({"a": 1.0, "b": 1.0}, covariance=[[0.09, 0.03], [0.03, 0.04]])
LOG = fp.GaussianPrior({"a": 1.0, "b": 1.0}, relative_std={"a": 0.3, "b": 0.4}, log=["a", "b"])


def at(*u: float) -> fp.Experiments:
    return fp.Experiments(np.empty((len(u), 0)), np.array(u)[:, None])


def line(model: fp.Model = LINE, prior: fp.GaussianPrior = PRIOR, **changes: Any) -> fp.DesignProblem:
    return fp.DesignProblem(model, prior, None, noise={"y": 0.1}, **changes)


SPREAD = at(-1.0, -0.3, 0.4, 1.0, 2.0)


def sigmas(figure: Any, expected: float) -> float:
    return abs(figure.value - expected) / figure.error


@pytest.fixture(scope="module")
def cylinder() -> tuple[fp.DesignProblem, fp.Experiments]:
    return problem(), valid_points(14)


def test_a_linear_model_keeps_its_promise() -> None:
    found = fp.validate(line(), {"spread": SPREAD, "narrow": at(0.9, 1.0, 1.1, 1.2)}, runs=2000)
    for name, points in (("spread", SPREAD), ("narrow", at(0.9, 1.0, 1.1, 1.2))):
        design = found.designs[name]
        promised = fp.evaluate(line(), points, output_covariance="noise")
        assert promised is not None and promised.standard_errors is not None
        assert design.fits == 2000 and not design.failures
        for parameter, of in design.parameters.items():
            assert of.promised == pytest.approx(promised.standard_errors[parameter], rel=1e-9)
            assert of.claimed.value == pytest.approx(of.promised, rel=1e-6)
            assert sigmas(of.ratio, 1) < 4 and sigmas(of.typical_ratio, 1) < 4
            assert sigmas(of.bias, 0) < 4 and sigmas(of.coverage, 0.95) < 4
            assert of.rmse.value == pytest.approx(of.achieved.value / of.prior_std, rel=1e-3)


def test_the_error_bars_are_those_of_repetition() -> None:
    values = [fp.validate(line(), {"d": SPREAD}, runs=100, seed=seed).designs["d"].parameters["b"] for seed in range(40)]
    for label in ("bias", "achieved", "typical", "rmse", "coverage"):
        figures = [getattr(of, label) for of in values]
        spread = np.std([figure.value for figure in figures], ddof=1)
        assert 0.7 < spread / np.mean([figure.error for figure in figures]) < 1.5, label


def test_the_prior_takes_part_where_it_is_asked_to() -> None:
    found = fp.validate(line(), {"d": at(0.1, 0.2)}, runs=1500, use_prior=True).designs["d"]
    matrix = np.stack([np.ones(2), [0.1, 0.2]], axis=1)
    expected = np.sqrt(np.diag(np.linalg.inv(matrix.T @ matrix / 0.01 + np.linalg.inv(PRIOR.covariance))))
    for of, error in zip(found.parameters.values(), expected, strict=True):
        assert of.promised == pytest.approx(error, rel=1e-9)
        assert sigmas(of.ratio, 1) < 4 and sigmas(of.coverage, 0.95) < 4  # truths follow that prior


def test_a_wrong_model_shows_as_bias_and_lost_coverage() -> None:
    found = fp.validate(line(), {"d": SPREAD}, runs=400, truth=BENT).designs["d"].parameters["b"]
    u = SPREAD.u[:, 0]
    expected = np.linalg.lstsq(np.stack([np.ones(5), u], axis=1), 0.3 * u**2)[0][1]
    assert sigmas(found.bias, float(expected)) < 4
    assert found.coverage.value < 0.6


def test_estimated_noise_of_one_output_gives_students_intervals() -> None:
    found = fp.validate(line(), {"d": SPREAD}, runs=1500, noise_known=False).designs["d"]
    for of in found.parameters.values():
        assert sigmas(of.coverage, 0.95) < 4
        # E s = sigma sqrt(2/nu) Gamma((nu+1)/2)/Gamma(nu/2), nu = 3.
        assert of.claimed.value / of.promised == pytest.approx(0.9213, abs=4 * of.claimed.error / of.promised)


def test_weights_that_are_estimated_count() -> None:
    """Two outputs that say the same of one parameter: the classical common mean, for N = 6 samples each."""
    jacobian = np.zeros((1, 6, 2, 1))
    jacobian[0, :, :, 0] = 1.0
    found = inflated(jacobian, np.array([[[1 / 12]]]), np.array([6, 6]), False)
    # By hand: A_i = 6, X = 1/12, so E g_i g_j = +-3, feedback +-0.5/5.5 and noise of the variances 2 (6 - 1 + 1/4, 1/4)/5.5^2.
    feedback = 2 * np.array([[3, -3], [-3, 3]]) / 12 / 5.5
    noise = 2 * (np.diag([5.0, 5.0]) + 0.25) / 5.5**2
    turn = np.linalg.inv(np.eye(2) - feedback)
    weights = turn @ noise @ turn.T
    added = (weights * np.array([[3, -3], [-3, 3]])).sum() / 144
    np.testing.assert_allclose(found.covariance, 1 / 12 + 2 * added, rtol=1e-12)
    share_of_each = np.array([6, 6]) / 144
    np.testing.assert_allclose(found.degrees_of_freedom, 2 / 144 / (share_of_each @ weights @ share_of_each), rtol=1e-12)


def test_correlated_weights_do_not_change_with_the_axes() -> None:
    """With a full covariance nothing depends on the coordinates of the whitened outputs."""
    jacobian = np.random.default_rng(0).standard_normal((2, 20, 3, 4))
    covariance = np.linalg.inv(np.einsum("bkip,bkiq->bpq", jacobian, jacobian))
    turn = np.linalg.qr(np.random.default_rng(1).standard_normal((3, 3)))[0]
    counts = np.array([20, 20, 20])
    one, other = (inflated(j, covariance, counts, True) for j in (jacobian, np.einsum("ij,bkjp->bkip", turn, jacobian)))
    np.testing.assert_allclose(one.covariance, other.covariance, rtol=2e-2)  # degrees of freedom are counted by output
    assert (np.einsum("bpp->bp", one.covariance) > np.einsum("bpp->bp", covariance)).all()


def test_log_normal_truths_stay_positive_and_are_recovered() -> None:
    found = fp.validate(line(DECAY, LOG), {"d": at(0.2, 0.5, 1.0, 1.5, 2.0, 3.0)}, runs=500)
    design = found.designs["d"]
    assert design.per_run is not None and (design.per_run.truth > 0).all() and found.redrawn == 0
    logs = np.log(design.per_run.truth)
    assert logs.std(axis=0) == pytest.approx(LOG.normal_std, rel=0.15)
    assert sum(design.failures.values()) <= 10
    for of in design.parameters.values():
        assert abs(of.coverage.value - 0.95) < 0.04


def test_correlated_truths_follow_the_prior() -> None:
    truths, redrawn = truths_of(line(), "prior", 20_000, 0)
    assert redrawn == 0
    np.testing.assert_allclose(np.cov(truths.T), PRIOR.covariance, rtol=0.06)


def test_parameters_that_are_not_estimated_stay_at_their_mean() -> None:
    found = fp.validate(line(parameters=["b"]), {"d": SPREAD}, runs=50).designs["d"]
    assert list(found.parameters) == ["b"]
    truths, _ = truths_of(line(parameters=["b"]), "prior", 50, 0)
    assert (truths[:, 0] == 1.0).all() and truths[:, 1].std() > 0.1


def test_draws_without_sense_are_left_out_and_counted() -> None:
    wide = fp.GaussianPrior(fp.HydraulicCylinder().nominal, relative_std=dict.fromkeys(fp.HydraulicCylinder().nominal, 0.5))
    truths, redrawn = truths_of(problem(prior=wide), "prior", 500, 0)
    assert len(truths) == 500 and redrawn > 50
    assert (truths[:, 2] > 0).all()  # the mass
    again, _ = truths_of(problem(prior=wide), "prior", 500, 0)
    np.testing.assert_array_equal(truths, again)


def test_too_few_points_are_told_and_not_fitted() -> None:
    found = fp.validate(line(), {"one": at(1.0, 1.0), "two": SPREAD}, runs=50)
    assert found.designs["one"].per_run is None and found.designs["one"].null_directions
    text = str(found)
    assert "not determined" in text and "nan" not in text.lower()
    assert found.to_pandas().loc["one"].ratio.isna().all() and found.to_pandas().loc["two"].ratio.notna().all()


def test_too_few_fits_for_figures_are_told() -> None:
    assert "no figures of errors: expected at least 10 fits" in str(fp.validate(line(), {"d": SPREAD}, runs=9))
    assert "no figures" not in str(fp.validate(line(), {"d": SPREAD}, runs=10))


def test_estimated_weights_never_make_a_fit_more_precise() -> None:
    """Nor where rounding is larger than what they add, as with twelve numbers that hardly tell nine unknowns."""
    rng = np.random.default_rng(0)
    jacobian = rng.standard_normal((50, 3, 4, 9))
    jacobian[..., 1] = jacobian[..., 0] + 1e-7 * jacobian[..., 1]
    covariance, determined = covariances(jacobian.reshape(50, 12, 9))
    grown = np.einsum("bpp->bp", inflated(jacobian, covariance, np.full(4, 3), False).covariance)
    assert determined.all() and (grown >= np.einsum("bpp->bp", covariance)).all()


def test_what_is_determined_is_shown_beside_what_is_not() -> None:
    model = fp.SymbolicModel(
        [], ["a", "b*c*u"], {}, {"u": "1"}, {"a": "1", "b": "1", "c": "1"}, {"y": "1", "w": "1"}, nominal={"a": 1, "b": 1, "c": 1}
    )
    prior = fp.GaussianPrior({"a": 1, "b": 1, "c": 1}, relative_std={"a": 0.2, "b": 0.2, "c": 0.2})
    found = fp.validate(fp.DesignProblem(model, prior, None, noise={"y": 0.1, "w": 0.1}), {"d": SPREAD}, runs=800).designs["d"]
    assert sigmas(found.parameters["a"].ratio, 1) < 4
    assert np.isnan(found.parameters["b"].ratio.value) and np.isnan(found.parameters["c"].promised)


def test_outputs_without_noise_are_not_measured(cylinder: tuple[fp.DesignProblem, fp.Experiments]) -> None:
    given, points = cylinder
    pressures = {name: NOISE[name] for name in ("p_A", "p_B")}
    some, all_of = (fp.validate(given, {"d": points}, noise=std, runs=60, theta="mean").designs["d"] for std in (pressures, NOISE))
    assert some.parameters["m_q"].promised > all_of.parameters["m_q"].promised
    assert some.fits == 60


def test_the_cylinder_keeps_its_promise_at_the_mean(cylinder: tuple[fp.DesignProblem, fp.Experiments]) -> None:
    given, points = cylinder
    found = fp.validate(given, {"d": points}, runs=400, theta="mean").designs["d"]
    promised = fp.evaluate(given, points, output_covariance="noise")
    assert promised is not None and promised.standard_errors is not None
    good = [of for of in found.parameters.values() if of.well_determined]
    assert len(good) >= 5
    for of in good:
        assert of.promised == pytest.approx(promised.standard_errors[of.parameter], rel=1e-4)
        assert sigmas(of.ratio, 1) < 4 and sigmas(of.coverage, 0.95) < 4


def test_fits_do_not_depend_on_chunks_threads_or_neighbours(
    cylinder: tuple[fp.DesignProblem, fp.Experiments], monkeypatch: pytest.MonkeyPatch
) -> None:
    given, points = cylinder
    whole = fp.validate(given, {"d": points}, runs=30, threads=2).to_pandas()
    monkeypatch.setattr(fits, "MOST_NUMBERS", 7 * 14 * 4 * 9)
    parts = fp.validate(given, {"other": points[:9], "d": points}, runs=30, threads=1).to_pandas()
    assert parts.loc["d", "verdict"].equals(whole.loc["d", "verdict"])
    np.testing.assert_allclose(*(of.loc["d"].drop(columns="verdict").astype(float) for of in (parts, whole)), rtol=1e-6)


def test_the_fits_are_those_of_least_squares(cylinder: tuple[fp.DesignProblem, fp.Experiments]) -> None:
    """SciPy stops where rounding hides whether its cost still falls; a Gauss-Newton step of its own leads from there to ours."""
    given, points = cylinder
    estimator = Estimator.of(given, points, NOISE, True, False, 1e-9, 1)
    theta, _ = truths_of(given, "prior", 12, 0)
    y, status, _ = Rig.of(given, None, NOISE).measure(points, theta, Streams.of(0, 2), 1)
    residuals = fits.replace(estimator.residuals, y=y[status == 0])
    lower, upper = estimator.unknowns.lower, estimator.unknowns.upper
    minima = minimise(residuals, np.tile(estimator.start, (len(residuals.y), 1)), lower, upper)
    assert (minima.end == CONVERGED).all()
    for row, z in enumerate(minima.z):

        def one(z: Array, row: int = row) -> tuple[Array, Array]:
            r, jacobian, ok = residuals(z[None], np.array([row]))
            return (r[0] if ok[0] else np.full(r.shape[1], 1e6)), jacobian[0]

        tight = {"ftol": 1e-15, "xtol": 1e-15, "gtol": 1e-15}
        found = least_squares(lambda z: one(z)[0], estimator.start, lambda z: one(z)[1], (lower, upper), x_scale="jac", **tight)
        r, jacobian = one(found.x)
        assert np.linalg.norm(jacobian @ (found.x - z)) < 3e-5
        stepped = found.x - np.linalg.lstsq(jacobian, r)[0]
        assert np.linalg.norm(jacobian @ (stepped - z)) < 1e-6


def test_starts_that_deviate_are_part_of_the_promise(cylinder: tuple[fp.DesignProblem, fp.Experiments]) -> None:
    given, points = cylinder
    deviating = given.replace(initial_state_std={"p_A": 4e4, "v": 1e-4})
    exact, found = (fp.validate(one, {"d": points}, runs=200, theta="mean").designs["d"] for one in (given, deviating))
    for name, of in found.parameters.items():
        assert of.promised > exact.parameters[name].promised
        if of.well_determined:
            assert sigmas(of.ratio, 1) < 4.5


def test_the_headline_says_what_deviates() -> None:
    model = fp.SymbolicModel([], ["a + b*u + c"], {}, **MODEL, constants={"c": 0.0}, nominal={"a": 1.0, "b": 1.0})
    said = str(fp.validate(line(model, uncertain={"c": 0.1}), {"d": SPREAD}, runs=10))
    assert "c off by an error that all points of an experiment share" in said and "starts off" not in said
    assert " off by" not in str(fp.validate(line(model), {"d": SPREAD}, runs=10))


def test_truths_whose_trajectories_fail_are_counted_by_status() -> None:
    tank = fp.SymbolicModel(
        ["-k*sqrt(h)"], ["h"], {"h": "m"}, {}, {"k": "1"}, {"h_m": "m"}, nominal={"k": 0.5}, domain=["h - 0.05"]
    )
    prior = fp.GaussianPrior({"k": 0.5}, std={"k": 0.25})
    points = fp.Experiments([[1.0], [0.8]], np.empty((2, 0)), [2.0, 1.0])
    found = fp.validate(fp.DesignProblem(tank, prior, None, noise={"h_m": 0.01}), {"d": points}, runs=200).designs["d"]
    assert found.failures["the true trajectory: left_domain"] > 5
    assert found.fits + sum(found.failures.values()) == 200
    of, lost = found.parameters["k"], found.without_data / 200  # who gave no data has no interval
    assert abs(of.coverage.value / (1 - lost) - 0.95) < 0.05
    assert of.coverage.value + of.too_low.value + of.too_high.value + lost == pytest.approx(1.0)


def test_figures() -> None:
    rng = np.random.default_rng(0)
    normal = rng.standard_normal(5000)
    wild = np.where(np.arange(5000) % 500 == 0, 1e6, normal)
    assert abs(typical_size(wild).value - 1) < 0.05 and standard_deviation(wild, 0).value > 1e4
    for figure, expected in ((mean(normal), 0), (standard_deviation(normal, 0), 1), (typical_size(normal), 1)):
        assert sigmas(figure, expected) < 4
    assert share(np.ones(100, dtype=bool)).error > 0.004


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"designs": {}}, "designs: expected at least one, given none"),
        ({"designs": {"d": 3}}, r"designs\['d'\]: expected Experiments, Runs or a Design, given int"),
        ({"theta": "true"}, "theta: expected 'prior', 'mean' or a mapping"),
        ({"theta": {"z": 1.0}}, "theta: expected names of a, b; given unknown 'z'"),
        ({"noise": {"z": 1.0}}, "noise: expected names of y; given unknown 'z'"),
        ({"noise": {"y": 0.0}}, "noise.*expected a positive standard deviation"),
        ({"problem": line(DECAY, LOG), "theta": {"a": -1.0}}, r"theta\['a'\]: expected a positive value of a log-normal"),
        ({"noise_known": False, "designs": {"d": SPREAD[:2]}}, r"designs\['d'\]: noise: .* more than 2 numbers .* given 2"),
        ({"noise_known": "both"}, "noise_known: expected True or False, given 'both'"),
        ({"runs": 0}, "runs: expected"),
        ({"truth": fp.HydraulicCylinder()}, "truth: expected the states"),
        ({"problem": fp.HydraulicCylinder()}, "problem: expected DesignProblem"),
    ],
)
def test_misuse_is_named(changes: dict[str, Any], message: str) -> None:
    arguments: dict[str, Any] = {"designs": {"d": SPREAD}, "problem": line(), "runs": 10}
    with pytest.raises((TypeError, ValueError), match=message):
        fp.validate(**(arguments | changes))


def test_the_command_writes_table_report_and_picture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    points = tmp_path / "points.csv"
    valid_points(10).to_csv(points, fp.HydraulicCylinder())
    example = Path(__file__).parents[2] / "examples" / "cylinder.toml"
    command = ["validate", str(example), str(points), "-o", str(tmp_path / "out"), "-n", "20", "--seed", "3", "--theta", "mean"]
    with pytest.raises(SystemExit) as end:
        main(command)
    assert end.value.code == 0
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"validation.csv", "report.txt", "validation.png", "report.html"}
    said = capsys.readouterr().out
    assert "20 virtual experiments each, true parameters at the prior mean" in said and "seed 3" in said
    with pytest.raises(SystemExit) as end:
        main([*command[:2], str(tmp_path / "none.csv"), *command[3:]])
    assert end.value.code == 2
    assert "none.csv: expected a CSV file of points, found no such file" in capsys.readouterr().err


@pytest.mark.parametrize("known", [True, False])
def test_a_fit_at_a_bound_has_the_precision_of_the_others_alone(known: bool) -> None:
    """b is at least 1, and the truth is there: half of the fits end at the bound, and know a as if b were given."""
    estimator = Estimator.of(line(), SPREAD, {"y": 0.1}, known, False, 1e-9, 1)
    unknowns = estimator.unknowns
    bounded = replace(unknowns, lower=np.where([False, True], unknowns.coordinates(np.array([[1.0, 1.0]]))[0], -np.inf))
    estimator = replace(estimator, residuals=replace(estimator.residuals, unknowns=bounded))
    u, random = SPREAD.u[:, 0], np.random.default_rng(4)
    y = 1.0 + u + 0.1 * random.standard_normal((200, len(u)))
    runs = estimator.fit(y[:, :, None], np.ones((200, 2)))
    held = runs.at_bound[:, 1]
    assert not runs.at_bound[:, 0].any() and 70 < held.sum() < 130 and (runs.failure == "").all()
    np.testing.assert_allclose(runs.estimate[held], np.stack([(y - u)[held].mean(axis=1), np.ones(held.sum())], axis=1))
    residuals = y - u - (y - u).mean(axis=1, keepdims=True)
    variance = np.full(200, 0.01) if known else np.square(residuals).sum(axis=1) / 4  # five values less one free unknown
    np.testing.assert_allclose(runs.standard_error[held, 0], np.sqrt(variance / 5)[held], rtol=1e-6)
    assert np.isinf(runs.standard_error[held, 1]).all() and np.isfinite(runs.standard_error[~held]).all()
    figures = parameter_figures("b", 0.2, 0.04, OneParameter(*(part[:, 1] for part in runs[:5]), runs.failure == ""))
    assert figures.at_bound == figures.without_interval == held.sum()
    assert figures.coverage.value == pytest.approx(runs.covered[~held, 1].sum() / 200)
