"""Constants of the plant that are known roughly have one value in all data: no number of points averages them out."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.information.nuisance import beside_nuisance, marginal_rows
from oracle import Floats

GAIN = fp.SymbolicModel(
    f=[], g=["a*c*u"], states={}, inputs={"u": "1"}, parameters={"a": "1"}, outputs={"y": "1"}, constants={"c": 1.0}
)
DECAY = fp.SymbolicModel(
    f=["b*u - k*c*x"],
    g=["s*x", "x**2"],
    states={"x": "1"},
    inputs={"u": "1"},
    parameters={"b": "1/s", "k": "1/s"},
    outputs={"y": "1", "z": "1"},
    constants={"c": (1.0, "1"), "s": (2.0, "1")},
    nominal={"b": 1.5, "k": 0.8},
)
PRIOR = fp.GaussianPrior(DECAY.nominal, relative_std={"b": 0.2, "k": 0.3})
NOISE = {"y": 0.02, "z": 0.05}
STD = {"c": 0.1, "s": 0.06}
REGION = fp.ExperimentRegion({"x": (0.0, 2.0), "u": (0.0, 1.0), "dt": (0.1, 3.0)})
VALUES = {"b": 1.5, "k": 0.8}


def gain(**changes: Any) -> fp.DesignProblem:
    region = fp.ExperimentRegion({"u": (0.1, 1.0)})
    return fp.DesignProblem(GAIN, fp.GaussianPrior({"a": 1.0}, {"a": 0.2}), region, noise={"y": 1e-3}, **changes)


def decay(**changes: Any) -> fp.DesignProblem:
    return fp.DesignProblem(DECAY, PRIOR, REGION, noise=NOISE, rtol=1e-10, **changes)


def ones(n: int) -> fp.Experiments:
    return fp.Experiments(np.empty((n, 0)), np.ones((n, 1)))


def drawn(n: int, seed: int = 0) -> fp.Experiments:
    return REGION.draw(DECAY, n, seed=seed)


def drawn_runs(n: int, seed: int = 0) -> fp.Runs:
    rng = np.random.default_rng(seed)
    return fp.Runs(rng.uniform(0, 2, (n, 1)), rng.uniform(0, 1, (n, 4, 1)), rng.uniform(0.2, 1, (n, 4)))


def outputs(points: fp.Experiments | fp.Runs, b: float, k: float, c: float, s: float, off: float = 0.0) -> Floats:
    """All samples (N, 2), by the solution of the differential equation."""
    if isinstance(points, fp.Experiments):
        points = fp.Runs.of_points(points)
    rows = []
    for x0, u, dt, measured in zip(points.x0, points.u, points.dt, points.measured, strict=True):
        x = x0[0] + off
        for held, duration, there in zip(u[:, 0], dt, measured, strict=True):
            rest = b * held / (k * c)
            x = rest + (x - rest) * np.exp(-k * c * duration)
            rows += [[s * x, x**2]] * int(there)
    return np.array(rows)


def joint_errors(points: fp.Experiments | fp.Runs, std: dict[str, float], start: float = 0.0) -> Floats:
    """Standard errors of b and k from the dense covariance of all data at once: R + G P G^T, with one G of all samples."""
    at = {"b": 1.5, "k": 0.8, "c": 1.0, "s": 2.0, "off": 0.0}

    def slope(name: str) -> Floats:
        steps = [outputs(points, **{**at, name: at[name] + h}) for h in (1e-5, -1e-5)]
        return ((steps[0] - steps[1]) / 2e-5).ravel()

    j = np.stack([slope("b"), slope("k")], axis=1)
    g = np.stack([slope(name) * size for name, size in std.items()] + [slope("off") * start], axis=1)
    covariance = np.diag(np.tile(np.square(list(NOISE.values())), len(j) // 2)) + g @ g.T
    return np.sqrt(np.diag(np.linalg.inv(j.T @ np.linalg.solve(covariance, j))))


@pytest.mark.parametrize("n", [1, 4, 100])
def test_no_number_of_points_averages_a_constant_out(n: int) -> None:
    """y = a c u: a is known to no better than c."""
    uncertain, anew = (fp.evaluate(gain(**{label: {"c": 0.1}}), ones(n)) for label in ("uncertain", "varies"))
    assert uncertain.standard_errors is not None and anew.standard_errors is not None
    assert uncertain.standard_errors["a"] == pytest.approx(np.sqrt(0.01 + 1e-6 / n), rel=1e-12)
    assert anew.standard_errors["a"] == pytest.approx(np.sqrt((0.01 + 1e-6) / n), rel=1e-12)
    assert uncertain.fisher.shape == (1, 1) and uncertain.log_det == pytest.approx(np.log(2 / n * 0.04 / (0.01 + 1e-6 / n)))


@pytest.mark.parametrize("kind", ["points", "runs", "both"])
def test_the_standard_errors_are_those_of_dense_algebra(kind: str) -> None:
    points = {"points": drawn(7), "runs": drawn_runs(3), "both": drawn(7)}[kind]
    previous = drawn_runs(2, seed=4) if kind == "both" else None
    evaluation = fp.evaluate(decay(uncertain=STD), points, previous=previous)
    assert evaluation.standard_errors is not None
    everything = points if previous is None else fp.Runs.join([fp.Runs.of_points(points), previous])
    np.testing.assert_allclose(list(evaluation.standard_errors.values()), joint_errors(everything, STD), rtol=1e-6)


def test_a_start_that_runs_share_is_one_number() -> None:
    region = fp.RunRegion({"x": (0.0, 2.0), "u": (0.0, 1.0), "dt": (0.1, 1.0)}, segments=4, shared=["x"])
    given = decay(initial_state_std={"x": 0.2}).replace(region=region)
    runs = drawn_runs(5)
    errors = fp.evaluate(given, runs).standard_errors
    assert errors is not None and given.shared_starts == ("x",)
    np.testing.assert_allclose(list(errors.values()), joint_errors(runs, {}, start=0.2), rtol=1e-6)
    anew = fp.evaluate(given.replace(region=None), runs).standard_errors
    assert anew is not None and anew["b"] != pytest.approx(errors["b"], rel=0.01)
    y = outputs(runs, **VALUES, c=1.0, s=2.0, off=0.15).reshape(5, 4, 2)
    fit = fp.estimate(
        DECAY, fp.Measurements(runs, y), noise=NOISE, deviations=fp.Deviations(initial_state_std={"x": 0.2}, shared=["x"])
    )
    assert fit.parameters == ("b", "k", "x_0") and fit.estimate["x_0"] == pytest.approx(0.15, rel=0.02)
    assert fit.standard_errors["k"] == pytest.approx(errors["k"], rel=0.05)


@pytest.mark.parametrize("names", [["c"], ["c", "s"]])
def test_a_fit_is_a_maximum_a_posteriori_over_constants(names: list[str]) -> None:
    """Compared with a search of SciPy's over parameters and constants, of points, runs and a record together."""
    from scipy.optimize import least_squares

    std = {name: STD[name] for name in names}
    points, runs, rng = drawn(6), drawn_runs(2), np.random.default_rng(3)
    noise = np.array(list(NOISE.values()))
    y_points, y_runs = (outputs(of, 1.6, 0.7, 1.07, 2.0) for of in (points, runs))
    y_points, y_runs = (y + noise * rng.standard_normal(y.shape) for y in (y_points, y_runs))
    t = np.linspace(0, 2, 9)
    record = fp.Runs([[1.0]], np.full((1, 8, 1), 0.5), 0.25)
    y_record = np.concatenate([[[2.0, 1.0]], outputs(record, 1.6, 0.7, 1.07, 2.0)]) + noise * rng.standard_normal((9, 2))
    data = [
        fp.Measurements(points, y_points),
        fp.Measurements(runs, y_runs.reshape(2, 4, 2)),
        fp.Record(t, np.full((9, 1), 0.5), y_record, x0={"x": 1.0}),
    ]
    fit = fp.estimate(DECAY, data, start=VALUES, noise=NOISE, deviations=fp.Deviations(uncertain=std))

    def residuals(z: Floats) -> Floats:
        given = {"c": 1.0, "s": 2.0} | dict(zip(names, z[2:], strict=True))
        at = {"b": z[0], "k": z[1], **given}
        first = [[given["s"] * 1.0, 1.0]]
        parts = [outputs(points, **at) - y_points, outputs(runs, **at) - y_runs]
        parts.append(np.concatenate([first, outputs(record, **at)]) - y_record)
        known = [(given[name] - {"c": 1.0, "s": 2.0}[name]) / std[name] for name in names]
        return np.concatenate([*((part / noise).ravel() for part in parts), known])

    own = least_squares(residuals, [1.5, 0.8, *({"c": 1.0, "s": 2.0}[name] for name in names)], xtol=1e-14, ftol=1e-14, gtol=1e-14)
    assert fit.converged and fit.parameters == ("b", "k", *names)
    np.testing.assert_allclose(list(fit.estimate.values()), own.x, rtol=1e-6)
    np.testing.assert_allclose(fit.covariance, np.linalg.inv(own.jac.T @ own.jac), rtol=1e-4, atol=1e-9)
    assert fit.nuisance.uncertain == std
    posterior = fit.posterior()  # of the parameters: the next problem has the same constants
    assert posterior.names == ("b", "k")
    assert posterior.std["b"] == pytest.approx(fit.standard_errors["b"])


def test_a_fit_comes_back_from_its_file(tmp_path: Path) -> None:
    points = drawn(8)
    data = fp.Measurements(points, outputs(points, 1.6, 0.7, 1.05, 2.0))
    fit = fp.estimate(DECAY, data, PRIOR, noise=NOISE, deviations=fp.Deviations(uncertain=STD, varies=None))
    fit.save(tmp_path)
    again = fp.Fit.load(tmp_path)
    assert str(again) == str(fit) and again.estimate == fit.estimate
    assert np.array_equal(again.covariance, fit.covariance)
    assert "uncertain constants, one std beforehand" in str(fit) and "c 0.1, s 0.06" in str(fit)


def test_what_previous_data_say_of_a_constant_is_carried_on() -> None:
    """Of s, which scales y alone, more is known with every sample of z beside y."""
    given = decay(uncertain={"s": 0.5})
    many, few = drawn(400, seed=2), drawn(3, seed=5)
    errors = [fp.evaluate(given, few, previous=previous).standard_errors for previous in (None, many)]
    together = fp.evaluate(given, fp.Experiments.join([many, few])).standard_errors
    assert errors[0] is not None and errors[1] is not None and together is not None
    np.testing.assert_allclose(list(errors[1].values()), list(together.values()), rtol=1e-12)
    np.testing.assert_allclose(list(together.values()), joint_errors(fp.Experiments.join([many, few]), {"s": 0.5}), rtol=1e-6)


def marginal(whole: Floats, p: int = 2) -> Floats:
    """The information about the first p unknowns alone: the inverse of their block of the inverse."""
    return np.linalg.inv(np.linalg.inv(whole)[:p, :p])


CRITERIA: list[tuple[str, Any]] = [("D", None), ("A", None), ("E", None), ("Ds", "k"), ("c", "b / k")]


def dense(points: fp.Experiments) -> Floats:
    """F of b and k in prior std, with the constants unknown too."""
    return fp.evaluate(decay(uncertain=STD), points).information


@pytest.mark.parametrize(("name", "of"), CRITERIA)
def test_searches_maximise_what_is_reported(name: str, of: Any) -> None:
    """A design for uncertain constants is better by its own criterion than one that takes them for exact, and is bounded."""
    quick: dict[str, Any] = {"n_candidates": 10, "max_iterations": 12, "goal": fp.Goal(name, of=of)}
    aware = fp.exchange(decay(uncertain=STD), 5, **quick)
    blind = fp.exchange(decay(), 5, **quick)
    criterion = fp.criterion(decay(), fp.Goal(name, of=of))
    log_phi = {key: criterion.log_phi(dense(design.points)) for key, design in {"aware": aware, "blind": blind}.items()}
    assert log_phi["aware"] >= log_phi["blind"] - 1e-3
    assert aware.efficiency is not None and aware.efficiency.at_least is not None
    assert 0.5 < aware.efficiency.at_least <= 1 + 1e-9
    # The certificate holds for designs of the same size that were found in another way.
    candidates = fp.Experiments.join([drawn(150, seed=7), aware.points])
    weights = fp.approximate_design(decay(uncertain=STD), candidates, goal=fp.Goal(name, of=of), n_experiments=5)
    assert weights.efficiency > 0.999
    share = weights.efficiency_of(aware.points)
    assert 0.5 < share <= 1.0
    expected = np.exp(log_phi["aware"] - np.log(5) - weights.criterion.log_phi(weights.information))
    assert share == pytest.approx(expected * weights.efficiency, rel=1e-6)


def test_the_paper_s_search_maximises_it_too() -> None:
    for kind in ("noise", "region", "pooled", "pointwise"):
        given = decay(uncertain=STD, output_covariance=kind, rule=fp.SparseGaussHermite(2))
        design = fp.exchange(given, 5, method=fp.ExchangeMethod("paper", references=False), n_candidates=20, max_iterations=40)
        assert design.trace[-1].log_det == pytest.approx(design.evaluation.log_det, abs=1e-9)
        assert all(after.log_det >= before.log_det for before, after in zip(design.trace, design.trace[1:], strict=False))


def test_exact_designs_of_candidates_are_the_best_of_all() -> None:
    candidates = drawn(8, seed=11)
    found = fp.exact_design(decay(uncertain=STD), candidates, 3)
    from itertools import combinations_with_replacement

    best = max(np.linalg.slogdet(dense(candidates[list(rows)]))[1] for rows in combinations_with_replacement(range(8), 3))
    assert np.linalg.slogdet(dense(found.points))[1] == pytest.approx(best, abs=1e-6)
    assert found.proven and found.value == pytest.approx(best, abs=1e-6)


def test_runs_are_designed_for_it() -> None:
    region = fp.RunRegion({"x": 0.0, "u": (0.0, 1.0), "dt": 0.5}, segments=6)
    given = decay(uncertain=STD).replace(region=region, rtol=1e-6)
    design = fp.design_runs(given, 2, n_starts=2, n_candidates=40, goal=fp.Goal(confidence=0.0))
    assert design.evaluation.standard_errors is not None
    np.testing.assert_allclose(list(design.evaluation.standard_errors.values()), joint_errors(design.runs, STD), rtol=1e-4)
    n = design.evaluation.n_points
    assert design.log_det == pytest.approx(design.evaluation.log_det + 2 * np.log(n / 2), abs=1e-4)


def test_pieces_of_a_record_are_picked_for_it() -> None:
    """Compared with all choices of three windows."""
    from itertools import combinations

    rng = np.random.default_rng(0)
    u = np.repeat(rng.uniform(0, 1, 12), 4)[:, None]
    run = fp.Runs([[0.5]], u[None, :-1], 0.2)
    y = np.concatenate([[[1.0, 0.25]], outputs(run, **VALUES, c=1.0, s=2.0)])
    record = fp.Record(0.2 * np.arange(48), u, y)
    given = decay(uncertain=STD, initial_state_std={"x": 0.05})
    pieces = fp.pieces(record, DECAY, length=8, states={"x": y[:, 0] / 2})
    found = fp.design_pieces(given, pieces, 3)
    values = []
    for rows in combinations(range(len(pieces)), 3):
        runs, _ = pieces.cut(np.array(rows))
        values.append(fp.evaluate(given, runs).log_det)
    assert found.evaluation.log_det == pytest.approx(max(values), abs=1e-6)
    assert found.bound >= found.log_det - 1e-9


def test_a_singular_design_names_parameters_alone() -> None:
    """b and k enter as their ratio at rest: one combination is open, whatever is known of c."""
    model = fp.SymbolicModel(
        f=[], g=["a*b*c*u"], states={}, inputs={"u": "1"}, parameters={"a": "1", "b": "1"}, outputs={"y": "1"}, constants={"c": 1.0}
    )
    prior = fp.GaussianPrior({"a": 1.0, "b": 2.0}, relative_std={"a": 0.1, "b": 0.2})
    given = fp.DesignProblem(model, prior, fp.ExperimentRegion({"u": (0.1, 1.0)}), noise={"y": 0.01}, uncertain={"c": 0.1})
    design = fp.exchange(given, 3, n_candidates=20)
    assert design.evaluation.rank == 1
    assert [set(direction) for direction in design.evaluation.null_directions] == [{"a", "b"}]
    assert [set(direction) for direction in design.not_estimable] == [{"a", "b"}]
    weights = fp.approximate_design(given, design.points, n_experiments=3)
    assert [set(direction) for direction in weights.null_directions] == [{"a", "b"}]


@pytest.mark.parametrize("name", ["D", "A", "E", "ME", "Ds", "c"])
def test_criteria_beside_nuisance_are_those_of_the_marginal_information(name: str) -> None:
    """Values, slopes by differences, curvature by differences of slopes, and what a search adds; in any coordinates."""
    rng = np.random.default_rng(2)
    rows, more = rng.standard_normal((12, 4)), rng.standard_normal((4, 3, 50))
    whole = rows.T @ rows
    whole[2:, 2:] += np.eye(2)
    given = decay(uncertain=STD)
    of = {"Ds": "k", "c": "b / k"}.get(name)
    own = fp.criterion(given, fp.Goal(name, of=of))
    beside = own.beside_nuisance(2)
    own_information = marginal(whole)
    assert beside.log_phi(whole) == pytest.approx(own.log_phi(own_information), abs=1e-12)
    assert beside.value(whole) == pytest.approx(own.value(own_information), rel=1e-12)
    step, change = 1e-6, np.cov(rng.standard_normal((4, 9)))
    by_difference = (beside.value(whole + step * change) - beside.value(whole - step * change)) / (2 * step)
    assert np.vdot(beside.gradient(whole), change) == pytest.approx(by_difference, rel=1e-6)
    if name != "ME":
        share = 0.05 if name == "E" else 0.0
        slope = beside.slope(whole, share)
        matrices = np.stack([change, np.cov(rng.standard_normal((4, 9)))])
        moved = [beside.slope(whole + side * step * change, share, size=slope.size) for side in (1, -1)]
        scale = [np.exp(0.0) if name == "E" else 1.0] * 2
        by_difference = (scale[0] * moved[0].along(matrices) - scale[1] * moved[1].along(matrices)) / (2 * step)
        np.testing.assert_allclose(slope.curvature(matrices)[0], by_difference, rtol=2e-4, atol=1e-9)
    factor = np.linalg.cholesky(whole + 0.3 * np.eye(4))
    for criterion, inside in ((beside, lambda m: m), (beside.in_coordinates(factor), lambda m: np.linalg.solve(factor, m))):
        here = inside(inside(whole).T)
        added = criterion.added_exactly(here, np.stack([inside(more[:, :, k]) for k in range(50)], axis=2))
        expected = [own.level * own.log_phi(marginal(whole + w @ w.T)) for w in more.transpose(2, 0, 1)]
        np.testing.assert_allclose(np.diff(np.log(added)), np.diff(expected), atol=1e-9)
        value, by_rows = criterion.objective_slope(here, inside(rows.T).T)
        if name != "ME" and name != "E":  # which are smoothed here
            assert value == pytest.approx(own.level * own.log_phi(own_information), abs=1e-9)
        assert by_rows.shape == rows.shape


@pytest.mark.parametrize("n", [1, 4, 100])
def test_the_promise_is_kept(n: int) -> None:
    """Standard errors that many virtual plants achieve, each with a constant of its own."""
    points = ones(n)
    found = fp.validate(gain(uncertain={"c": 0.1}), {"d": points}, runs=1000, theta="mean").designs["d"]
    ratio = found.parameters["a"].ratio
    assert abs(ratio.value - 1) < 4 * ratio.error
    assert abs(found.parameters["a"].coverage.value - 0.95) < 4 * np.sqrt(0.95 * 0.05 / 1000)


@pytest.mark.parametrize("points", [drawn(12), drawn_runs(2, seed=1)], ids=["points", "runs"])
def test_the_promise_is_kept_with_states(points: fp.Experiments | fp.Runs) -> None:
    given = decay(uncertain={"c": 0.02, "s": 0.04}).replace(rtol=1e-6)
    found = fp.validate(given, {"d": points}, runs=400, theta="mean").designs["d"]
    for one in found.parameters.values():
        assert abs(one.ratio.value - 1) < 4 * one.ratio.error
        assert abs(one.coverage.value - 0.95) < 4 * np.sqrt(0.95 * 0.05 / 400)


def test_a_campaign_does_not_average_a_constant_out() -> None:
    given = decay(uncertain={"c": 0.1}).replace(rtol=1e-6)
    campaign = fp.Campaign(given, batch=4, targets=None, n_candidates=10, max_iterations=5)
    rig = fp.VirtualRig(DECAY, VALUES, NOISE, seed=1)
    for _ in range(3):
        fit = campaign.tell(rig.measure(campaign.next()))
    assert fit.parameters == ("b", "k", "c") and campaign.history[-1].estimate.keys() == {"b", "k", "c"}
    together = fp.Experiments.join([batch.data.points for batch in campaign.history])  # type: ignore[list-item]
    assert fit.standard_errors["k"] == pytest.approx(joint_errors(together, {"c": 0.1})[1], rel=0.3)
    assert fit.standard_errors["k"] > 0.8 * 0.1 * 0.8  # k c is what the data tell


def test_marginal_rows_are_those_of_the_marginal_information() -> None:
    rows = np.random.default_rng(0).standard_normal((20, 5))
    expected = marginal(rows.T @ rows, 3)
    found = marginal_rows(rows, 2)
    np.testing.assert_allclose(found.T @ found, expected, rtol=1e-12)
    assert marginal_rows(rows, 0) is rows
    np.testing.assert_allclose(marginal(beside_nuisance(expected, 2), 3), expected)
