"""Outputs that are measured at instants of their own: which these are, their information, searches, and estimates."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import least_squares

import fisherpoint as fp
from fisherpoint.design.runs.run_moves import moved_runs
from fisherpoint.design.runs.run_slopes import linear_rows
from fisherpoint.information.fewer_samples import with_fewer_samples
from output_clock_cases import CLOCKS, NOISE, held, information, instants, model, problem, region
from sampling_cases import THETA, objective_of

# --- Which outputs are measured when ---


@pytest.mark.parametrize("every", CLOCKS.values(), ids=CLOCKS)
def test_each_output_is_measured_at_its_own_multiples(every: Any) -> None:
    own = model()
    runs = held(own)
    sampled = runs.sampled(every, model=own)
    assert sampled.by_output is not None and np.array_equal(sampled.by_output.any(axis=2), sampled.measured)
    for j, name in enumerate(("q", "s")):
        alone = runs.sampled(every[name])
        for k in range(len(runs)):
            assert np.allclose(instants(sampled, k, j), alone.t[k, alone.measured[k]], rtol=0, atol=1e-12)
    assert np.allclose(sampled.dt.sum(axis=1), runs.dt.sum(axis=1), rtol=0, atol=1e-12)


def test_tables_of_times_and_periods_go_together() -> None:
    own = model()
    runs = held(own)
    sampled = runs.sampled({"q": 0.01, "s": [5, 20, 90, "ms"]}, model=own)
    assert np.allclose(instants(sampled, 0, 1), [0.005, 0.02, 0.09]) and np.allclose(instants(sampled, 1, 1), [0.005, 0.02])
    assert np.allclose(instants(sampled, 1, 0), 0.01 * np.arange(1, 7)) and sampled.measured.sum() == 11 + 7
    tables = runs.sampled({"q": 0.01 * np.arange(1, 11), "s": [0.005, 0.02, 0.09]}, model=own)
    assert np.array_equal(tables.by_output, sampled.by_output) and np.allclose(tables.dt, sampled.dt, rtol=0, atol=1e-15)


def test_outputs_that_are_not_named_are_not_measured() -> None:
    own = model()
    sampled = held(own).sampled({"s": 0.01}, model=own)
    assert not sampled.readings[:, :, 0].any() and np.array_equal(sampled.readings[:, :, 1], sampled.measured)
    data = fp.VirtualRig(own, THETA, {"q": 1e-3, "s": 1e-2}).measure(sampled)
    assert np.isnan(data.y[..., 0]).all() and np.array_equal(np.isfinite(data.y[..., 1]), sampled.measured)


@pytest.mark.parametrize("kind", ["plain", "late", "updates"])
def test_the_same_times_give_the_bits_of_one_clock(kind: str) -> None:
    own = model(kind)
    one, each = held(own).sampled(1e-3), held(own).sampled({"s": (1, "ms"), "q": "1 ms"}, model=own)
    assert each.by_output is None and one == each and one.dt.tobytes() == each.dt.tobytes()
    of = problem(own, {"q": 1e-3, "s": 1e-2})
    assert fp.evaluate(of, one).fisher.tobytes() == fp.evaluate(of, each).fisher.tobytes()
    coarse = held(own).sampled(CLOCKS["multiples"], model=own)  # multiples of a finer one divide nothing further
    assert coarse.dt.tobytes() == one.dt.tobytes() and np.array_equal(coarse.measured, one.measured)


def test_a_search_on_the_same_clocks_finds_the_bits_of_one() -> None:
    designs = []
    for every in (0.004, {"q": 0.004, "s": 0.004}):
        of = problem(model(), {"q": 1e-3, "s": 1e-2}, region(every), rtol=1e-6)
        designs.append(fp.design_runs(of, n_starts=1, n_candidates=10))
    assert designs[0].runs == designs[1].runs and designs[0].log_det == designs[1].log_det


def test_runs_keep_what_is_measured_through_all_that_is_done_with_them() -> None:
    own = model()
    both, one = held(own).sampled(CLOCKS["others"], model=own), held(own, 1).sampled(0.01)
    assert both.by_output is not None
    for again in (pickle.loads(pickle.dumps(both)), both[[0, 1]], fp.Runs.join([both[0], both[1]]), fp.Runs(**both._arguments())):
        assert again == both and again.by_output is not None
    joined = fp.Runs.join([one, both])
    assert joined[0] == one[0] and joined[[0, 1]] == one and joined[[2, 3]] == both and joined[0].by_output is None
    assert both != both.measuring(both.measured) or both.measuring(both.measured).by_output is not None
    fewer = both.measuring(both.measured & (np.arange(both.dt.shape[1]) % 2 == 0))
    assert fewer.by_output is not None and np.array_equal(fewer.by_output.any(axis=2), fewer.measured)
    halves = both.divided([0.5, 1.0])
    assert np.array_equal(halves.readings[:, 1::2], both.readings) and not halves.readings[:, ::2].any()
    first = both.distinct()[0]
    assert len(first) == 2 and len(fp.Runs.join([both, fp.Runs(both.x0, both.u, both.dt, both.measured)]).distinct()[0]) == 4
    assert f"{both.measured.sum()} samples of {both.readings[..., 0].sum()} and {both.readings[..., 1].sum()} readings" in repr(
        both
    )
    single = fp.Runs([[0.0, 0.0]], [[1.0]], 0.1, np.array([[[True, False]]]))
    assert single.points is None and single.measured.all()


# --- Information ---


@pytest.mark.long
@pytest.mark.parametrize("kind", ["plain", "late", "updates"])
@pytest.mark.parametrize("noise", NOISE.values(), ids=NOISE)
@pytest.mark.parametrize("every", CLOCKS.values(), ids=CLOCKS)
def test_information_is_that_of_each_output_on_its_clock(kind: str, noise: Any, every: Any) -> None:
    """Readings of different outputs are independent here, so what they inform adds up."""
    own = model(kind)
    found = information(problem(own, noise), held(own).sampled(every, model=own))
    apart = [information(problem(own, {name: noise[name]}), held(own).sampled(every[name])) for name in ("q", "s")]
    assert np.allclose(found, sum(apart), rtol=0, atol=1e-7 * np.abs(found).max())
    assert np.linalg.norm(found - apart[0]) > 1e-3 * np.linalg.norm(found)


def dense(own: fp.SymbolicModel, runs: fp.Runs, noise: Any, start_std: float = 0.0) -> Any:
    """J^T R^-1 J over the entries that are measured, run after run, with R written out; standardised by the prior."""
    freed = own.free_start("w") if start_std else own
    theta = [*THETA.values(), *([0.0] if start_std else [])]
    plain = fp.Runs(runs.x0, runs.u, runs.dt)  # all outputs at all ends
    j = fp.sensitivities(freed, plain, theta, rtol=1e-9).dy_dtheta
    outputs = noise.outputs if isinstance(noise, fp.NoiseModel) else noise
    each = [one if isinstance(one, fp.Noise) else fp.Noise(one) for one in (outputs["q"], outputs["s"])]
    rho = dict(noise.correlation).get("q, s", 0.0) if isinstance(noise, fp.NoiseModel) else 0.0
    f = np.zeros((3, 3))
    for k in range(len(runs)):
        n, i = np.nonzero(runs.readings[k])
        t = runs.t[k]
        r = np.zeros((len(n), len(n)))
        for a in range(len(n)):
            for b in range(len(n)):
                white = each[i[a]].std * each[i[b]].std * (1.0 if i[a] == i[b] else rho)
                r[a, b] = white * (n[a] == n[b])
                for part in each[i[a]].parts if i[a] == i[b] else ():
                    r[a, b] += part.std**2 * np.exp(-abs(t[n[a]] - t[n[b]]) / part.correlation_time)
        rows = j[k, n, i]
        if start_std:
            moved = start_std * rows[:, 3]
            r += np.outer(moved, moved)
        rows = rows[:, :3] * 0.2 * np.array(list(THETA.values()))
        f += rows.T @ np.linalg.solve(r, rows)
    return f


DENSE: dict[str, tuple[Any, dict[str, Any]]] = {
    "correlated": (fp.NoiseModel({"q": 1e-3, "s": 1e-2}, correlation={("q", "s"): 0.7}), {}),
    "correlated, with a memory": (fp.NoiseModel(NOISE["memory"], correlation={("q", "s"): -0.5}), {}),
    "starts drawn anew": (NOISE["white"], {"initial_state_std": {"w": 0.05}}),
    "starts drawn anew, with a memory": (NOISE["memory"], {"initial_state_std": {"w": 0.05}}),
}


@pytest.mark.parametrize(("noise", "changes"), DENSE.values(), ids=DENSE)
@pytest.mark.parametrize("every", [{"q": 0.01, "s": 0.02}, {"q": (7, "ms"), "s": 0.01}])
def test_information_is_that_of_the_whole_covariance(noise: Any, changes: Any, every: Any) -> None:
    own = model()
    runs = held(own).sampled(every, model=own)
    found = information(problem(own, noise, **changes), runs)
    wanted = dense(own, runs, noise, changes.get("initial_state_std", {}).get("w", 0.0))
    assert np.allclose(found, wanted, rtol=0, atol=1e-6 * np.abs(wanted).max())


def test_data_that_were_measured_count_as_the_runs_that_were_planned() -> None:
    own = model()
    runs = held(own).sampled(CLOCKS["others"], model=own)
    of = problem(own, NOISE["white"])
    data = fp.VirtualRig(own, THETA, NOISE["white"]).measure(runs)
    without = fp.Measurements(fp.Runs(runs.x0, runs.u, runs.dt, runs.measured), data.y)  # NaN alone says what is missing
    found = [fp.evaluate(of, runs, previous=one).fisher for one in (runs, data, without)]
    assert np.allclose(found[0], found[1], rtol=1e-12) and np.allclose(found[0], found[2], rtol=1e-12)


FREE = {"bounds": {"dt": (0.013, 0.021)}}


@pytest.mark.parametrize("changes", [{}, FREE, FREE | {"duration": 0.085}])
@pytest.mark.parametrize("noise", ["white", "memory"])
def test_slopes_are_those_of_readings_that_stay(changes: Any, noise: str) -> None:
    given = problem(model(), NOISE[noise], region({"q": 0.002, "s": 0.005}, **changes))
    objective = objective_of(given)
    z = np.random.default_rng(2).uniform(0.2, 0.8, (1, len(objective.coordinates)))
    linear = linear_rows(objective, z, None, True, np.random.default_rng(0))
    assert linear is not None
    counts = objective.coordinates.runs(z).measured.sum(axis=1)

    def f(at: Any) -> Any:
        return objective.judged(objective.tried(at[None], None, counts)).matrices[0, 0]

    base = linear.rows[0, 0]
    assert np.allclose(base.T @ base, f(z[0]), rtol=1e-8)
    for j in range(z.shape[1]):
        step = 1e-3 * np.eye(z.shape[1])[j]
        wanted, product = (f(z[0] + step) - f(z[0] - step)) / 2e-3, base.T @ linear.row_slopes[0, j, 0]
        scale = 1e-2 * np.abs(wanted).max() + 1e-4 * np.abs(base.T @ base).max()
        assert np.allclose(product + product.T, wanted, rtol=0, atol=scale)


@pytest.mark.parametrize("kind", ["plain", "late"])
def test_changed_runs_are_worth_the_same_from_where_they_differ(kind: str) -> None:
    objective = objective_of(problem(model(kind), NOISE["white"], region({"q": 0.002, "s": 0.005}, **FREE)), 2)
    rng = np.random.default_rng(0)
    z = rng.uniform(0.2, 0.8, len(objective.coordinates))
    base = objective.tangents(objective.tried(z[None], None).runs, outputs_alone=False)
    runs = objective.tried(moved_runs(objective.coordinates, z, rng)[:30], None)
    whole, beside = objective.judged(runs), objective.judged_beside(base, runs)
    assert whole.ok.all() and np.array_equal(whole.ok, beside.ok)
    assert np.allclose(whole.matrices, beside.matrices, rtol=1e-5, atol=1e-6 * np.abs(whole.matrices).max())


# --- Searches ---


@pytest.mark.parametrize("every", [{"q": 0.0004, "s": 0.004}, {"q": 0.0004, "s": 0.0011}, {"q": 0.0004, "s": (0.31, 0.7)}])
def test_a_search_by_fewer_readings_sees_nearly_the_same_information(every: Any) -> None:
    own = model()
    whole = problem(own, NOISE["white"], region(every, segments=20, bounds={"dt": 0.05}))
    fewer, coarse = with_fewer_samples(whole, whole.run_region)
    assert coarse.sample_every["q"] == pytest.approx(0.002) and coarse.sample_every["s"] >= every["s"]
    runs = held(own, shapes=((0.05,) * 20,))
    both = [information(of, runs.sampled(of.run_region.sample_every, model=own)) for of in (whole, fewer)]
    logs = [np.linalg.slogdet(f)[1] for f in both]
    assert logs[0] == pytest.approx(logs[1], abs=0.02) and logs[0] != logs[1]


@pytest.mark.long
def test_a_design_reads_each_output_on_its_clock(tmp_path: Path) -> None:
    """Free durations and a limit: what is carried out, what the design promises, its files and its virtual experiments agree."""
    own = model()
    every = {"q": "2 ms", "s": (9, "ms")}
    of = problem(own, NOISE["white"], region(every, bounds={"dt": (0.015, 0.025)}), along=["abs(w) < 3"], rtol=1e-6)
    design = fp.design_runs(of, n_starts=1, n_candidates=20)
    for j, period in enumerate((0.002, 0.009)):
        times = instants(design.runs, 0, j)
        assert np.allclose(times, period * np.arange(1, len(times) + 1), rtol=0, atol=1e-12)
        assert len(times) == int(design.runs.dt.sum() / period + 1e-9)
    assert design.log_det == pytest.approx(np.linalg.slogdet(information(of, design.runs))[1], abs=1e-6)
    design.save(tmp_path)
    again = type(design).load(tmp_path)
    assert again.runs == design.runs and again.problem.region == of.region
    read = fp.Runs.from_csv(tmp_path / "design.csv", own)
    assert np.array_equal(read.by_output, design.runs.by_output) and np.allclose(read.dt, design.runs.dt, rtol=0, atol=1e-12)
    text = str(design.report())
    assert "Outputs are measured at samples of their own: q at" in text
    figure = design.plot("runs", path=tmp_path / "runs.png")
    dots = [len(line.get_xdata()) for axes in figure.axes for line in axes.lines if line.get_marker() == "o"]
    assert dots == design.runs.readings.sum(axis=(0, 1)).tolist()
    design.plot("information", path=tmp_path / "information.png")
    promise = fp.validate(of, design.runs, runs=100)
    (figures,) = promise.designs.values()
    assert all(0.7 < figure.ratio.value < 1.4 for figure in figures.figures.values()) and not figures.failures


# --- Data ---


@pytest.mark.parametrize("kind", ["plain", "late", "updates"])
@pytest.mark.parametrize("noise", ["white", "memory"])
def test_estimates_are_those_of_least_squares_over_what_was_measured(kind: str, noise: str) -> None:
    own = model(kind)
    runs = held(own).sampled({"q": 0.004, "s": 0.01}, model=own)
    data = fp.VirtualRig(own, THETA, NOISE[noise], seed=3).measure(runs)
    assert np.array_equal(np.isfinite(data.y), np.broadcast_to(runs.readings, data.y.shape))
    fit = fp.estimate(own, data, start=THETA, noise=NOISE[noise], rtol=1e-9)
    plain, factors = fp.Runs(runs.x0, runs.u, runs.dt), []
    for k in range(len(runs)):
        n, i = np.nonzero(runs.readings[k])
        r = np.diag(np.array([1e-3, 1e-2])[i] ** 2)
        for j, one in enumerate(NOISE["memory"].values() if noise == "memory" else ()):
            (part,) = one.parts
            lag = np.abs(runs.t[k, n][:, None] - runs.t[k, n])
            r += np.where((i[:, None] == j) & (i == j), part.std**2 * np.exp(-lag / part.correlation_time), 0.0)
        factors.append((n, i, np.linalg.cholesky(r)))

    def residuals(theta: Any) -> Any:
        y = fp.simulate(own, plain, theta * np.array(list(THETA.values())), rtol=1e-10).y
        return np.concatenate([np.linalg.solve(c, y[k, n, i] - data.y[k, n, i]) for k, (n, i, c) in enumerate(factors)])

    wanted = least_squares(residuals, np.ones(3), x_scale=0.1, xtol=1e-12, ftol=1e-14, gtol=1e-14, diff_step=1e-5)
    errors = np.sqrt(np.diag(np.linalg.inv(wanted.jac.T @ wanted.jac)))
    found = np.array([fit.estimate[name] / THETA[name] for name in THETA])
    assert np.abs((found - wanted.x) / errors).max() < 1e-3
    relative = [fit.standard_errors[name] / THETA[name] for name in THETA]
    assert np.allclose(relative, errors, rtol=1e-3)


@pytest.mark.long
def test_residuals_of_each_output_are_judged_along_its_own_samples() -> None:
    """Lags count the readings of an output: a memory of the slow one over its own steps is found, and the fast one is white."""
    own = model()
    runs = held(own, shapes=((0.05,) * 40,)).sampled({"q": 0.001, "s": 0.01}, model=own)
    noise = {"q": 1e-3, "s": fp.Noise(1e-4, colored=fp.GaussMarkov(2e-2, 0.05))}
    data = fp.VirtualRig(own, THETA, noise, seed=1).measure(runs)
    with pytest.warns(RuntimeWarning, match="not white"):
        fit = fp.estimate(own, data, start=THETA)
    checks = fit.residual_checks
    assert checks["q"].white and not checks["s"].white and (checks["q"].count, checks["s"].count) == (2000, 200)
    assert checks["s"].memory is not None and 2 < checks["s"].memory.samples < 12  # 5 of its steps
    found = fp.estimate(own, data, start=THETA, noise="estimated")
    assert found.noise_estimate is not None
    of_q, of_s = (found.noise_estimate[name] for name in ("q", "s"))
    assert of_q.form == "white" and of_q.values["std"] == pytest.approx(1e-3, rel=0.1)
    assert of_s.form == "memory" and of_s.values["correlation time"] == pytest.approx(0.05, rel=0.6)
    fit.plot("time")


@pytest.mark.parametrize("every", [(0.03, 0.07, 0.1), {"q": 0.02, "s": (0.03, 0.07, 0.1)}])
def test_designs_keep_to_tables_of_instants(every: Any) -> None:
    """Free durations: instants behind the end of a run are left out."""
    of = problem(model(), NOISE["white"], region(every, bounds={"dt": (0.015, 0.025)}), rtol=1e-6)
    design = fp.design_runs(of, n_starts=1, n_candidates=20)
    times = design.runs.t[0][np.broadcast_to(design.runs.readings, (*design.runs.dt.shape, 2))[0, :, 1]]
    wanted = np.array([t for t in (0.03, 0.07, 0.1) if t < design.runs.dt.sum() + 1e-9])
    assert np.allclose(times, wanted, rtol=0, atol=1e-12)
    assert design.log_det == pytest.approx(np.linalg.slogdet(information(of, design.runs))[1], abs=1e-6)
    assert str(every["s"] if isinstance(every, dict) else every) in repr(of.region)


def test_a_campaign_designs_and_measures_on_clocks_of_outputs() -> None:
    own = model()
    of = problem(own, NOISE["white"], region({"q": 0.005, "s": 0.02}), rtol=1e-6)
    campaign = fp.Campaign(of, batch=1, targets=1e-4, n_starts=1, n_candidates=10)
    rig = fp.VirtualRig(own, THETA, NOISE["white"], seed=2)
    for _ in range(2):
        planned = campaign.next()
        campaign.tell(rig.measure(planned))
    assert planned.by_output is not None and planned.by_output.sum(axis=(0, 1)).tolist() == [20, 5]
    assert set(campaign.standard_errors) == set(THETA)
