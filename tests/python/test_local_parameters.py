"""Local parameters in fits: against joint fits of all unknowns by other programs, and what is refused."""

from __future__ import annotations

import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar

import fisherpoint as fp
from fisherpoint.estimation.bordered import Bordered
from fisherpoint.estimation.precision import Precision
from fisherpoint.estimation.tangent_space import DENSE, Tangent
from fisherpoint.estimation.whiteness import autocorrelation, spectrum
from local_cases import NOISE, START, cart, joint_fit, measured


def fit_of(data: Any, local: Any, **options: Any) -> fp.Fit:
    given = {"start": START, "noise": {"y": NOISE}} | options
    return fp.estimate(cart(), data, deviations=fp.Deviations(local=local), **given)


@pytest.mark.parametrize("spread", [None, 0.8])
def test_twenty_loads_and_one_friction_law_are_the_joint_fit(spread: float | None) -> None:
    data = measured()
    fit = fit_of(data, {"m_load": fp.Local("run", spread=spread)})
    estimates, errors = joint_fit(data, np.arange(20), spread)
    assert fit.converged and fit.common == ("d", "c")
    assert np.abs((fit.values - estimates) / errors).max() < 1e-7  # of a standard error: both searches end about here
    assert list(fit.standard_errors.values()) == pytest.approx(errors, rel=1e-8)
    assert fit.values == pytest.approx(estimates, rel=1e-8)
    third = fit.local["m_load"]["3"]
    assert (third.by, third.estimate, third.standard_error) == ("run", fit.values[4], pytest.approx(errors[4], rel=1e-8))


def test_labels_group_runs() -> None:
    of_run = np.arange(20) // 4
    data = measured(each=4, labels={"plant": [f"P{k}" for k in of_run]})
    fit = fit_of(data, {"m_load": "plant"})
    estimates, errors = joint_fit(data, of_run)
    assert fit.values == pytest.approx(estimates, rel=1e-8)
    assert list(fit.standard_errors.values()) == pytest.approx(errors, rel=1e-8)
    assert list(fit.local["m_load"]) == ["P0", "P1", "P2", "P3", "P4"]


def test_records_have_values_of_their_own() -> None:
    runs = measured(4, 30)
    records = [
        fp.Record(np.arange(31) * 0.2, np.append(runs.points.u[k, :, 0], 0.0), np.append(np.nan, runs.y[k, :, 0]), x0={"v": 0.0})
        for k in range(4)
    ]
    of_records, of_runs = fit_of(records, {"m_load": "record"}), fit_of(runs, {"m_load": "run"})
    assert of_records.values == pytest.approx(of_runs.values, rel=1e-7)
    assert list(of_records.standard_errors.values()) == pytest.approx(list(of_runs.standard_errors.values()), rel=1e-5)
    both = fit_of([runs[:2], *records[2:]], {"m_load": "run"})
    assert both.values == pytest.approx(of_runs.values, rel=1e-7)


def test_a_known_spread_is_what_varies() -> None:
    """The common parameters' standard errors are those of a fit in which the load is drawn anew: the marginal form."""
    data = measured(8, loads=(2.0, 2.0))
    local = fit_of(data, {"m_load": fp.Local("run", spread=1e-3)})
    varies = fp.estimate(
        cart(),
        data,
        start=START,
        parameters=["d", "c"],
        noise={"y": NOISE},
        deviations=fp.Deviations(varies={"m_load": 1e-3}),
    )
    for name in ("d", "c"):
        assert local.standard_errors[name] == pytest.approx(varies.standard_errors[name], rel=2e-3)  # tangents elsewhere


def test_runs_within_plants_are_one_block_each() -> None:
    """Statistics from blocks are those of the whole Jacobian."""

    @fp.model(
        states={"v": "m/s"},
        inputs={"F": "N"},
        parameters={"d": "N s/m", "c": "N", "m_load": "kg", "off": "m/s"},
        outputs={"y": "m/s"},
    )
    def with_offset(x: Any, u: Any, p: Any) -> Any:
        return [(u.F - p.d * x.v - p.c * fp.math.tanh(x.v / 0.05)) / (2.0 + p.m_load)], [x.v + p.off]

    data = measured(12, labels={"plant": [k // 3 for k in range(12)]})
    local = fp.Deviations(local={"m_load": "run", "off": "plant"})
    fit = fp.estimate(with_offset, data, start=START | {"off": 0.0}, noise={"y": NOISE}, deviations=local)
    whole = Precision.of(fit.jacobian)
    assert fit.converged and len(fit.parameters) == 2 + 12 + 4
    assert fit.precision.covariance == pytest.approx(whole.covariance, rel=1e-9)
    assert fit.precision.information == pytest.approx(whole.information, rel=1e-9, abs=1e-9 * whole.information.max())
    assert fit.degrees_of_freedom == pytest.approx(180 - 18, abs=1e-8)
    share = fit.jacobian @ np.linalg.cholesky(whole.covariance)
    series = np.repeat(np.arange(12), 15)
    expected, found = autocorrelation(fit.whitened[:, 0], share, series), fit.residual_checks["y"].autocorrelation
    assert found.expected == pytest.approx(expected.expected, rel=1e-8)
    assert found.covariance == pytest.approx(expected.covariance, rel=1e-8, abs=1e-12)
    assert fit.residual_checks["y"].spectrum.expected == pytest.approx(
        spectrum(fit.whitened[:, 0], share, series).expected, rel=1e-8
    )
    again = pickle.loads(pickle.dumps(fit))
    assert again.standard_errors == fit.standard_errors


def test_noise_with_a_memory_goes_with_it() -> None:
    data, memory = measured(8), fp.GaussMarkov(NOISE, 0.5)
    fit = fit_of(data, {"m_load": "run"}, noise={"y": fp.Noise(NOISE, colored=memory)})
    t = np.arange(1, 16) * 0.2
    covariance = NOISE**2 * (np.eye(15) + np.exp(-np.abs(t[:, None] - t) / 0.5))
    white = np.kron(np.eye(8), np.linalg.inv(np.linalg.cholesky(covariance)))

    def outputs(values: np.ndarray) -> np.ndarray:
        theta = np.column_stack([np.tile(values[:2], (8, 1)), values[2:]])
        return fp.simulate(cart(), data.points, theta, rtol=1e-12).y.ravel()

    steps = 1e-5 * np.eye(10)
    j = white @ np.column_stack([(outputs(fit.values + h) - outputs(fit.values - h)) / 2e-5 for h in steps])
    errors = np.sqrt(np.diag(np.linalg.inv(j.T @ j)))
    assert list(fit.standard_errors.values()) == pytest.approx(errors, rel=1e-7)


def test_blocks_are_a_dense_qr() -> None:
    """Runs within plants, which have values too, rows of one plant alone, and rows that no local unknown moves."""
    rng, common = np.random.default_rng(0), 3
    run = rng.integers(0, 9, 60)
    places = np.concatenate([np.column_stack([run, 9 + run // 3]), [[-1, -1], [-1, -1], [-1, 10], [5, -1]]])
    stored = rng.standard_normal((3, 64, common + 2))
    stored[:, :, common:][:, places < 0] = 0.0
    layout, r = Bordered(places, common, 12), rng.standard_normal((3, 64))
    whole = layout.dense(stored)
    found, expected = layout.tangent(r, stored), Tangent.of(r, whole)
    assert found.gradient == pytest.approx(expected.gradient, rel=1e-12, abs=1e-12)
    free, units = np.ones((3, 15), dtype=bool), rng.uniform(0.5, 2.0, (3, 15))
    free[1, [2, 7]] = False
    assert found.length(free, 1e-13) == pytest.approx(expected.length(free, 1e-13), rel=1e-12)
    damping = np.array([1e-2, 1e-6, 1e-20])
    step = found.damped(free, units, damping).step(found.along)
    assert step == pytest.approx(expected.damped(free, units, damping).step(expected.along), rel=1e-9, abs=1e-12)
    assert layout.effect(stored, step) == pytest.approx(DENSE.effect(whole, step), rel=1e-12, abs=1e-12)


def test_a_hundred_runs_are_small_blocks() -> None:
    """No array of the search grows with runs times runs: its Jacobian has a column for each parameter."""
    data = measured(100, 6)
    fit = fit_of(data, {"m_load": "run"})
    stored = fit.weighted.stored(fit.z[None], np.zeros(1, dtype=np.intp))[1]
    assert stored.shape == (1, 600, 3) and len(fit.parameters) == 102
    assert fit.converged and fit.degrees_of_freedom == pytest.approx(600 - 102, abs=1e-6)


# The spread between groups


def line() -> fp.Model:
    @fp.model(states={}, inputs={"x": "1"}, parameters={"b": "1", "a": "1"}, outputs={"y": "1"})
    def line(x: Any, u: Any, p: Any) -> Any:
        return [], [p.a + p.b * u.x]

    return line


def levels(spread: float, seed: int = 3) -> tuple[fp.Measurements, np.ndarray, np.ndarray]:
    """Lines of one slope whose levels spread between 12 plants with different numbers of points."""
    rng = np.random.default_rng(seed)
    of = np.repeat(np.arange(12), rng.integers(1, 6, 12))
    x = rng.uniform(-1, 1, len(of))
    y = 5 + spread * rng.standard_normal(12)[of] + 2 * x + 0.3 * rng.standard_normal(len(of))
    return fp.Measurements(fp.Experiments(np.zeros((len(of), 0)), x), y, labels={"plant": of.tolist()}), x, of


def test_an_estimated_spread_is_that_of_restricted_likelihood() -> None:
    """Against REML with the whole covariance of the data, by formulas of mixed models."""
    data, x, of = levels(0.7)
    fit = fp.estimate(
        line(),
        data,
        start={"a": 4.0, "b": 1.0},
        noise={"y": 0.3},
        deviations=fp.Deviations(local={"a": fp.Local("plant", spread="estimated")}),
    )
    design, same = np.column_stack([x, np.ones(len(x))]), of[:, None] == of
    y = data.y[:, 0]

    def restricted(log: float) -> tuple[float, np.ndarray, np.ndarray]:
        covariance = same * np.exp(2 * log) + 0.09 * np.eye(len(x))
        inverse = np.linalg.inv(covariance)
        information = design.T @ inverse @ design
        values = np.linalg.solve(information, design.T @ inverse @ y)
        rest = y - design @ values
        value = np.linalg.slogdet(covariance)[1] + np.linalg.slogdet(information)[1] + rest @ inverse @ rest
        return float(value), values, np.sqrt(np.diag(np.linalg.inv(information)))

    best = minimize_scalar(lambda log: restricted(log)[0], bracket=(-1, 0), tol=1e-10).x
    least, values, errors = restricted(best)
    ends = [np.exp(brentq(lambda log: restricted(log)[0] - least - 3.841459, *pair)) for pair in ((-4, best), (best, 2))]
    spread = fit.spread["a"]
    assert spread.std == pytest.approx(np.exp(best), rel=1e-6) and spread.interval == pytest.approx(ends, rel=1e-6)
    curvature = (restricted(best + 1e-3)[0] - 2 * least + restricted(best - 1e-3)[0]) / 1e-6
    assert spread.standard_error == pytest.approx(spread.std * np.sqrt(2 / curvature), rel=1e-4)
    assert [fit.estimate[name] for name in ("b", "a")] == pytest.approx(values, rel=1e-7)
    assert [fit.standard_errors[name] for name in ("b", "a")] == pytest.approx(errors, rel=1e-7)


def test_no_spread_is_a_finding() -> None:
    data, *_ = levels(0.0)
    fit = fp.estimate(
        line(),
        data,
        start={"a": 4.0, "b": 1.0},
        noise={"y": 0.3},
        deviations=fp.Deviations(local={"a": fp.Local("plant", spread="estimated")}),
    )
    spread = fit.spread["a"]
    assert spread.interval is not None and spread.interval[0] == 0 < spread.interval[1] < 1 and spread.std < spread.interval[1]
    assert "a: no spread between the plants is found, at most" in str(fit.report())
    assert np.isfinite(list(fit.standard_errors.values())).all()


# Reports and files


def test_reports_and_files_have_both(tmp_path: Path) -> None:
    fit = fit_of(measured(6), {"m_load": fp.Local("run", spread=0.8)})
    text = str(fit.report())
    assert "2 unknowns and 6 local ones" in text and "m_load of each run, kg" in text and "Spread of local parameters" in text
    assert "given" in text and "m_load[3]" not in text
    names = [path.name for path in fit.save(tmp_path)]
    assert "local.csv" in names
    rows = (tmp_path / "local.csv").read_text().splitlines()
    assert rows[0].startswith("parameter,by,group,unit,estimate") and rows[3].startswith("m_load,run,3,kg,") and len(rows) == 7
    assert fit.to_dict()["local"][2]["group"] == "3" and fit.to_dict()["spread"]["m_load"]["std"] == 0.8
    again = fp.Fit.load(tmp_path)
    assert again.values == pytest.approx(fit.values, rel=0) and again.standard_errors == fit.standard_errors
    assert again.local == fit.local and again.spread == fit.spread
    assert set(fit.profiles()) == {"d", "c"}
    assert fit.profile("m_load[3]").interval == pytest.approx(fit.intervals()["m_load[3]"], rel=0.05)
    fit_of(measured(1), None).save(tmp_path)
    assert not (tmp_path / "local.csv").exists()


def test_a_group_with_too_few_numbers_says_so() -> None:
    data = measured(5)
    y = data.y.copy()
    y[2, 1:] = np.nan
    few = replace(data, y=y)
    fit = fit_of(few, {"m_load": "run", "c": "run"})
    assert any("m_load[3]" in direction and "c[3]" in direction for direction in fit.null_directions)
    assert np.isinf(fit.standard_errors["m_load[3]"]) and np.isfinite(fit.standard_errors["d"])
    assert np.isfinite(fit.values).all() and "not determined" in str(fit.report())


def test_unknown_noise_has_fewer_degrees_of_freedom() -> None:
    data = measured(10)
    fit = fit_of(data, {"m_load": "run"}, noise=None)
    known = fit_of(data, {"m_load": "run"})
    assert fit.degrees_of_freedom == pytest.approx(150 - 12, abs=1e-6)
    assert fit.values == pytest.approx(known.values, rel=1e-6)
    scale = np.sqrt(known.chi_square / 138)
    assert list(fit.standard_errors.values()) == pytest.approx(scale * np.array(list(known.standard_errors.values())), rel=1e-5)


def test_posterior_leaves_local_parameters_alone() -> None:
    prior = fp.GaussianPrior(mean=START, std={"d": 1.0, "c": 0.5, "m_load": 1.5})
    fit = fit_of(measured(6), {"m_load": fp.Local("run", spread=0.8)}, prior=prior, start=None)
    posterior = fit.posterior()
    assert posterior.mean["m_load"] == 2.0 and posterior.std["m_load"] == 1.5
    assert posterior.std["d"] == pytest.approx(fit.standard_errors["d"])


# Misuse


@pytest.mark.parametrize(
    ("local", "options", "message"),
    [
        ({"mass": "run"}, {}, "local: expected names of d, c, m_load; given unknown 'mass'"),
        ({"m_load": "rig"}, {}, r"local\['m_load'\]: expected labels 'rig', given none in the data"),
        ({"m_load": fp.Local("plant", spread="estimated")}, {}, "expected at least 2 groups to estimate their spread, given 1"),
        ({"m_load": "record"}, {}, r"local\['m_load'\]: expected records, given measurements of runs in the data"),
        ({"m_load": "run"}, {"parameters": ["d", "m_load"]}, "parameters: expected those that all data share, given 'm_load'"),
        ({"m_load": "run", "d": "run", "c": "run"}, {}, "expected at least one name"),
        (
            {"m_load": fp.Local("run", spread=1.0)},
            {"noise": "estimated"},
            "expected the sensor noise together with the spread of local parameters, given 'estimated'",
        ),
        ({"m_load": fp.Local("run", spread=1.0)}, {"noise": None}, "noise: expected the sensor noise together with the spread"),
    ],
)
def test_misuse_is_one_line(local: Any, options: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message) as caught:
        fit_of(measured(3, labels={"plant": "A"}), local, **options)
    assert "\n" not in str(caught.value)


def test_local_and_something_else_is_refused() -> None:
    for label in ("uncertain", "varies"):
        deviations = fp.Deviations(local={"m_load": "run"}, **{label: {"m_load": 0.1}})
        with pytest.raises(ValueError, match=f"local: expected parameters that are not in {label}, given 'm_load', which is"):
            fp.estimate(cart(), measured(3), start=START, noise={"y": NOISE}, deviations=deviations)
    with pytest.raises(TypeError, match=r"local: expected as deviations=fp.Deviations\(local=...\)"):
        fp.estimate(cart(), measured(3), start=START, local={"m_load": "run"})  # type: ignore[call-arg]
    with pytest.raises(TypeError, match='expected "run", "record", a name of labels, or a Local, given float'):
        fp.Deviations(local={"m_load": 1.0})  # type: ignore[dict-item]
    with pytest.raises(ValueError, match="spread: expected a standard deviation, 'estimated' or None, given 'unknown'"):
        fp.Local("run", spread="unknown")
