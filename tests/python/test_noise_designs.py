"""Designs under noise of every kind: F against whole covariances of what is measured, searches, rigs, files, mistakes."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.special import ndtri

import fisherpoint as fp
from fisherpoint.basics.values import Array
from fisherpoint.design.file.configuration import ConfigError, load_problem
from fisherpoint.information.problem_report import problem_sections
from fisherpoint.noise.sensors import Sensors
from saved_cases import of_runs, problem, tanks

MEMORY = fp.GaussMarkov(0.02, 0.5)
KINDS: dict[str, Any] = {
    "grows": {"y": fp.Noise(0.01, relative=0.1), "z": 0.02},
    "memory": {"y": fp.Noise(0.01, colored=MEMORY), "z": fp.Noise(colored=[MEMORY, fp.GaussMarkov(0.01, 5.0)])},
    "grows and has a memory": {"y": fp.Noise(0.01, relative=0.1, colored=MEMORY), "z": 0.02},
    "correlated": fp.NoiseModel({"y": 0.01, "z": 0.02}, correlation={("y", "z"): 0.6}),
    "correlated and grows": fp.NoiseModel({"y": fp.Noise(0.01, relative=0.05), "z": 0.02}, correlation={("z", "y"): 0.6}),
    "one output": {"y": fp.Noise(0.01, relative=0.05, colored=MEMORY)},
}
OTHERS: dict[str, Any] = {
    "rounded": {"y": fp.Noise(0.01, resolution=0.03), "z": 0.02},
    "limited": {"y": fp.Noise(0.01, limits=(None, 0.9)), "z": fp.Noise(0.02, relative=0.1, resolution=0.01, limits=(0.3, 2.0))},
}
DEVIATIONS: dict[str, dict[str, Any]] = {
    "exact": {},
    "varies": {"varies": {"c": 0.1}},
    "uncertain": {"uncertain": {"c": 0.1}},
    "starts": {"initial_state_std": {"a": 0.02, "b": 0.03}},
}


def runs() -> fp.Runs:
    rng = np.random.default_rng(0)
    dt = rng.uniform(0.05, 0.6, (3, 7))
    dt[2, 5:] = 0.0
    return fp.Runs([[1.0, 0.5]] * 3, rng.uniform(0.0, 2.0, (3, 7, 1)), dt, measured=(rng.random((3, 7)) < 0.7) & (dt > 0))


def points() -> fp.Experiments:
    rng = np.random.default_rng(1)
    return fp.Experiments(rng.uniform(0.6, 1.5, (5, 2)), rng.uniform(0.0, 2.0, (5, 1)), rng.uniform(0.2, 2.0, 5))


def tangents(given: fp.DesignProblem, at: Any) -> tuple[Array, Array, Array, Array]:
    """Outputs, and their derivatives by parameters, by c, and by the start, (K, N, n_y, ...), by differences of simulations."""
    model, theta = given.model.estimate("c").free_start("a", "b"), [1.0, 0.8, 1.0, 0.0, 0.0]

    def y(values: list[float]) -> Array:
        done = fp.simulate(model, at, values, rtol=1e-12).y
        return np.asarray(done if done.ndim == 3 else done[:, None])

    columns = []
    for k in range(5):
        steps = []
        for h in (1e-3, 2e-3):
            up, down = list(theta), list(theta)
            up[k], down[k] = theta[k] + h, theta[k] - h
            steps.append((y(up) - y(down)) / (2 * h))
        columns.append((4 * steps[0] - steps[1]) / 3)
    j = np.stack(columns, axis=3)
    return y(theta), j[..., :2], j[..., 2:3], j[..., 3:]


def expected(given: fp.DesignProblem, at: Any, measured: Any, times: Array, of_deviation: str) -> Array:
    """The standard errors, by J^T R^-1 J + 1/2 tr(R^-1 dR R^-1 dR) of the whole R of each run."""
    assert given.noise is not None
    y, j, by_c, by_start = tangents(given, at)
    sensors, total = Sensors.of(given.noise, ("y", "z")), np.zeros((3, 3))
    columns = np.concatenate([j, by_c if of_deviation == "uncertain" else 0 * by_c], axis=3)
    moved = {"varies": 0.1 * by_c, "starts": by_start * [0.02, 0.03]}.get(of_deviation, 0 * by_c)
    for k in range(len(y)):
        flat = (measured[k][:, None] & sensors.measured).ravel()
        common = moved[k].reshape(flat.size, -1)

        def r(outputs: Array, k: int = k, flat: Any = flat, common: Array = common) -> Array:
            whole = sensors.covariance(times[k][None], outputs[None])[0] + common @ common.T
            return np.asarray(whole[np.ix_(flat, flat)])

        q, h = np.linalg.inv(r(y[k])), 1e-4
        dr = [(r(y[k] + h * columns[k][..., c]) - r(y[k] - h * columns[k][..., c])) / (2 * h) for c in range(3)]
        flat_j = columns[k].reshape(flat.size, 3)[flat]
        total += flat_j.T @ q @ flat_j + np.array([[np.trace(q @ a @ q @ b) / 2 for b in dr] for a in dr])
    if of_deviation == "uncertain":
        total[2, 2] += 1 / 0.1**2
        return np.asarray(np.sqrt(np.diag(np.linalg.inv(total)))[:2])
    return np.asarray(np.sqrt(np.diag(np.linalg.inv(total[:2, :2]))))


@pytest.mark.parametrize("of_deviation", DEVIATIONS)
@pytest.mark.parametrize("noise", KINDS.values(), ids=KINDS.keys())
def test_runs_have_the_information_of_the_whole_covariance(noise: Any, of_deviation: str) -> None:
    given, at = of_runs(noise=noise, rtol=1e-11, **DEVIATIONS[of_deviation]), runs()
    found = fp.evaluate(given, at).standard_errors
    of_whole = expected(given, at, at.measured, np.cumsum(at.dt, axis=1), of_deviation)
    np.testing.assert_allclose(list(found.values()), of_whole, rtol=1e-8)


@pytest.mark.parametrize("of_deviation", DEVIATIONS)
@pytest.mark.parametrize("noise", KINDS.values(), ids=KINDS.keys())
def test_points_have_the_information_of_the_whole_covariance(noise: Any, of_deviation: str) -> None:
    given, at = problem(noise=noise, rtol=1e-11, **DEVIATIONS[of_deviation]), points()
    found = fp.evaluate(given, at).standard_errors
    of_whole = expected(given, at, np.ones((5, 1), dtype=bool), np.zeros((5, 1)), of_deviation)
    np.testing.assert_allclose(list(found.values()), of_whole, rtol=1e-8)


def past(y: Array, spread: Array, std: float, limits: Any) -> Array:
    """What an output past a limit is known by."""
    low, high = (-np.inf if limits[0] is None else limits[0]), (np.inf if limits[1] is None else limits[1])
    far = np.maximum(low - y, y - high)
    return np.where(far > 0, np.square(spread) / (np.square(np.maximum(far, 0)) + std**2), 0.0)


def weight(w: Any, y: Array, spread: Array, limits: Any) -> Array:
    """The information of a reading for searches, by thousands of places of a normal output."""
    if any(limits):
        places = np.linspace(-4, 4, 2001)
        density = np.exp(-np.square(places) / 2) / np.exp(-np.square(places) / 2).sum()
        known = 10 * np.square(spread) * np.array([w(y + place * spread) for place in places])
        known_past = np.array([past(y + place * spread, spread, 0.03, limits) for place in places])
        left = np.tensordot(density, 1 / (1 + known + known_past), axes=1)
        share = (1 / left - 1) / np.tensordot(density, known, axes=1)
        return np.asarray(share * np.tensordot(density, known, axes=1) / (10 * np.square(spread)))
    places = ndtri((np.arange(4000) + 0.5) / 4000)
    return np.asarray(np.mean([w(y + place * spread) for place in places], axis=0))


@pytest.mark.parametrize("limits", [(None, None), (None, 0.9), (0.2, 0.9)])
def test_f_has_the_mean_over_steps_and_what_limits_leave(limits: Any) -> None:
    noise = {"y": fp.Noise(0.03, limits=limits) if any(limits) else fp.Noise(0.01, resolution=0.03), "z": 0.02}
    given, at = of_runs(noise=noise, rtol=1e-11), runs()
    y, j, _, _ = tangents(given, at)
    j = j[at.measured] * np.array(list(given.prior.std.values()))
    of = Sensors.of(noise, ("y", "z"))
    spread = np.sqrt(np.square(j).sum(axis=2))
    w = weight(of.precision, y[at.measured], spread, limits)
    f = np.einsum("si,sia,sib->ab", np.where([True, False], w, 1 / 0.02**2), j, j)
    np.testing.assert_allclose(fp.evaluate(given, at).information, f, rtol=0.01 if any(limits) else 1e-4)


@pytest.mark.long
@pytest.mark.parametrize("noise", OTHERS.values(), ids=OTHERS.keys())
def test_standard_errors_of_rounded_and_limited_sensors_are_means_over_the_prior(noise: Any) -> None:
    """By 20,000 independent draws of the parameters, beside the prior what the mean information does not say."""
    given, at = of_runs(noise=noise, rtol=1e-11), runs()
    y, j, _, _ = tangents(given, at)
    y, j = y[at.measured], j[at.measured] * np.array(list(given.prior.std.values()))
    of, rng, beside = Sensors.of(noise, ("y", "z")), np.random.default_rng(3), np.eye(2)
    spread = np.linalg.norm(j, axis=2)
    f, more = [], []
    for _ in range(20_000):
        there = y + j @ rng.standard_normal(2)
        f.append(np.einsum("si,sia,sib->ab", of.precision(there), j, j))
        known = np.zeros(y.shape)
        for i, name in enumerate(("y", "z")):
            if isinstance(noise[name], fp.Noise):
                wide = np.hypot(noise[name].std, noise[name].resolution / np.sqrt(12))
                known[:, i] = past(there[:, i], spread[:, i], wide, noise[name].limits)
        s, i = np.unravel_index(np.argmax(known), known.shape)
        along = j[s, i] / spread[s, i]
        more.append(np.linalg.inv(f[-1] + beside + known[s, i] * np.outer(along, along)))
    mean = np.mean(f, axis=0)
    expected = np.linalg.inv(mean) + np.mean(more, axis=0) - np.linalg.inv(mean + beside)
    found = fp.evaluate(given, at)
    std = np.array(list(given.prior.std.values()))
    np.testing.assert_allclose(np.array(list(found.standard_errors.values())) / std, np.sqrt(np.diag(expected)), rtol=0.01)
    np.testing.assert_allclose(found.covariance, np.outer(std, std) * expected, rtol=0.03)
    promised = fp.validate(given, at, runs=2).designs["design"].parameters
    for name, error in found.standard_errors.items():
        assert promised[name].promised == pytest.approx(error, rel=1e-6)


def test_replicates_of_a_coarse_reading_are_promised_what_they_can_keep() -> None:
    """All lie at one place of a step: the error is that of a single place, averaged over the step."""
    given = problem(noise={"y": fp.Noise(0.01, resolution=0.06), "z": fp.Noise(0.01, resolution=0.06)})
    one = fp.Experiments([[1.2, 0.8]], [[0.5]], [1.0])
    together = fp.evaluate(given, one[np.zeros(12, dtype=int)])
    of_f = np.sqrt(np.diag(np.linalg.inv(together.information)))
    promise = np.array(list(together.standard_errors.values())) / np.array(list(given.prior.std.values()))
    assert (promise > 1.15 * of_f).all()
    found = fp.validate(given, one[np.zeros(12, dtype=int)], runs=600, seed=2).designs["design"]
    for figures in found.parameters.values():
        assert abs(figures.ratio.value - 1) < 0.05 + 4 * figures.ratio.error


def test_previous_data_without_some_numbers_count_in_order() -> None:
    """A run with missing numbers is one of fewer samples."""
    given, at = of_runs(noise={"y": KINDS["memory"]["y"]}, rtol=1e-11), runs()
    rig = fp.VirtualRig(tanks(), given.theta, {"y": 0.0})
    data = rig.measure(at)
    y = data.y.copy()
    y[0, 1::2] = np.nan
    fewer = np.isfinite(y[..., 0])
    part = fp.Runs(at.x0, at.u, at.dt, measured=fewer)
    more = runs()
    of_data = fp.evaluate(given, more, previous=fp.Measurements(at, y)).log_det
    of_runs_ = fp.evaluate(given, more, previous=part).log_det
    assert of_data == pytest.approx(of_runs_, rel=1e-10)


@pytest.mark.long
@pytest.mark.parametrize("noise", (KINDS | OTHERS).values(), ids=(KINDS | OTHERS).keys())
def test_searches_run_with_noise_of_every_kind(noise: Any) -> None:
    found = fp.exchange(problem(noise=noise), 4, n_candidates=20, max_iterations=3)
    assert found.evaluation.log_det == pytest.approx(fp.evaluate(found.problem, found.points).log_det)
    fp.approximate_design(problem(noise=noise), points())
    driven = fp.design_runs(of_runs(noise=noise), 1, n_starts=1, time_limit=2)
    assert driven.evaluation.log_det == pytest.approx(fp.evaluate(driven.problem, driven.runs).log_det)
    assert "std" in str(driven.report()) and "NaN" not in str(driven.report())


def test_noise_with_a_memory_of_no_time_is_white() -> None:
    at = runs()
    quick = of_runs(noise={"y": fp.Noise(0.03, colored=fp.GaussMarkov(0.04, 1e-6)), "z": 0.02})
    assert fp.evaluate(quick, at).log_det == pytest.approx(fp.evaluate(of_runs(noise={"y": 0.05, "z": 0.02}), at).log_det)
    slow = of_runs(noise={"y": fp.Noise(0.03, colored=fp.GaussMarkov(0.04, 1e9)), "z": 0.02})
    offset = np.sqrt(np.diag(np.linalg.inv(fp.evaluate(slow, at).fisher)))  # one offset for all samples of a run
    assert np.isfinite(offset).all()


def test_a_rig_draws_what_the_noise_says() -> None:
    """Variances and covariances of many runs; rounded to multiples, and within the limits."""
    noise = fp.NoiseModel(
        {"y": fp.Noise(0.3, relative=0.5, colored=[fp.GaussMarkov(0.4, 0.5), fp.GaussMarkov(0.2, 3.0)]), "z": fp.Noise(0.2)},
        correlation={("y", "z"): -0.5},
    )
    at = fp.Runs([[1.0, 0.5]], np.ones((1, 4, 1)), [[0.1, 0.7, 0.2, 1.5]])
    truth = fp.simulate(tanks(), at, [1.0, 0.8]).y
    y = fp.VirtualRig(tanks(), [1.0, 0.8], noise, seed=3).measure(at, repeats=20_000).y - truth
    expected = Sensors.of(noise, ("y", "z")).covariance(np.cumsum(at.dt, axis=1), truth)[0]
    error = np.cov(y.reshape(len(y), -1).T) - expected
    assert np.abs(error).max() < 5 * expected.max() * np.sqrt(2 / 20_000)
    shown = {"y": fp.Noise(0.3, resolution=0.25, limits=(0.5, 1.25)), "z": 0.2}
    plain = fp.VirtualRig(tanks(), [1.0, 0.8], {"y": 0.3, "z": 0.2}, seed=3).measure(at, repeats=50).y
    given = fp.VirtualRig(tanks(), [1.0, 0.8], shown, seed=3).measure(at, repeats=50).y
    assert np.array_equal(given[..., 0], np.clip(np.rint(plain[..., 0] / 0.25) * 0.25, 0.5, 1.25))
    assert np.array_equal(given[..., 1], plain[..., 1])
    colored = fp.VirtualRig(tanks(), [1.0, 0.8], {"y": fp.Noise(0.3, colored=MEMORY), "z": 0.2}, seed=3).measure(at, repeats=50).y
    assert np.array_equal(colored[..., 1], plain[..., 1]) and not (colored[..., 0] == plain[..., 0]).any()


FILE = (
    tanks().to_toml()
    + """
[prior]
k1 = { mean = 1.0, std = 0.2 }
k2 = { mean = 0.8, std = 0.2 }

[noise]
y = { std = 10, unit = "mm", relative = 0.01, colored = { std = 20, correlation_time = 0.5 }, resolution = 1 }
z = 0.02

[noise_correlation]
"y, z" = 0.3
"""
)


def test_files_say_it_and_problems_come_back(tmp_path: Path) -> None:
    path = tmp_path / "problem.toml"
    path.write_text(FILE)
    noise = load_problem(path).noise
    y = fp.Noise(0.01, relative=0.01, colored=fp.GaussMarkov(0.02, 0.5), resolution=0.001)
    assert noise == fp.NoiseModel({"y": y, "z": 0.02}, correlation={("y", "z"): 0.3})
    for one in (noise, {"y": fp.Noise(0.01, limits=(None, 2.0)), "z": 0.02}):
        found = fp.exchange(problem(noise=one), 4, n_candidates=5, max_iterations=1)
        found.save(tmp_path / "found")
        again = fp.Design.load(tmp_path / "found")
        assert again.problem.noise == found.problem.noise and again.evaluation.log_det == found.evaluation.log_det
    text = str(problem_sections(load_problem(path)))
    assert "1 % of its value" in text and "0.02 m correlated over 0.5 s" in text and "correlation of y, z 0.3" in text


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        ("y = { std = 10", "y = { std = -10", "noise.y.std: expected a number >= 0, given -10"),
        ("std = 20,", "", "noise.y.colored"),
        ("resolution = 1 }", "limits = [0, inf] }", "noise.y.limits: expected none beside a colored part, given both"),
        ("resolution = 1 }", "limits = [0] }", "noise.y.limits: expected a pair of numbers or None"),
        ("relative = 0.01", "relative = 2", "noise.y.relative: expected a share of at most 1"),
        ('"y, z" = 0.3', '"y, w" = 0.3', "unknown key noise_correlation.w"),
        ('"y, z" = 0.3', '"y" = 0.3', 'noise_correlation."y": expected two outputs'),
        ('"y, z" = 0.3', '"y, z" = 1', "noise_correlation"),
        ("[noise]", "[noise_std]", "unknown key noise_std"),
    ],
)
def test_mistakes_in_files_name_their_key(old: str, new: str, line: str, tmp_path: Path) -> None:
    path = tmp_path / "problem.toml"
    assert old in FILE
    path.write_text(FILE.replace(old, new))
    with pytest.raises(ConfigError) as caught:
        load_problem(path)
    assert any(line in one for one in caught.value.lines), caught.value.lines


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: fp.Noise(), "std: expected a positive standard deviation, or a colored part, given 0"),
        (lambda: fp.Noise(relative=0.1), "given 0 beside relative: a reading of zero would be exact"),
        (lambda: fp.Noise(resolution=0.1), "std: expected a positive standard deviation"),
        (lambda: fp.Noise(0.1, limits=(1, 0)), "limits: expected the lower one first"),
        (lambda: fp.Noise(0.1, limits=(0, None), colored=MEMORY), "limits: expected none beside a colored part"),
        (lambda: fp.Noise(0.1, colored=[MEMORY] * 3), "colored: expected at most 2 parts, given 3"),
        (lambda: fp.GaussMarkov(0.1, 0.0), "correlation_time: expected a positive time"),
        (lambda: fp.NoiseModel({"y": 0.1}, correlation={("y", "z"): 0.1}), "correlation: expected names of y; given unknown 'z'"),
        (lambda: fp.NoiseModel({"y": fp.Noise(0.1, limits=(0, 1)), "z": 1}, correlation={"y, z": 0.1}), "limits: .* 'y'"),
        (lambda: problem(noise={"y": fp.Noise(0.1, relative=0.1)}, output_covariance="pooled"), "noise: expected white noise"),
        (
            lambda: fp.evaluate(problem(noise=KINDS["correlated"]), points(), output_covariance="region"),
            "noise: expected white noise of constant",
        ),
    ],
)
def test_misuse_is_one_line(make: Any, message: str) -> None:
    with pytest.raises((ValueError, TypeError), match=message):
        make()


@pytest.mark.parametrize("noise", [KINDS["memory"], KINDS["grows and has a memory"]])
def test_samples_are_chosen_by_what_they_inform_together(noise: Any) -> None:
    """Exchanging one of them for another sample improves nothing, for the inputs that were found."""
    region = fp.RunRegion({"a": 1.0, "b": 0.5, "u": (0.0, 2.0), "dt": 0.2}, segments=8, samples=3, levels={"u": [0.0, 2.0]})
    given = problem(noise=noise, region=region)
    found = fp.design_runs(given, 1, n_starts=1, time_limit=3)
    chosen, best = found.runs.measured[0], found.evaluation.log_det
    assert chosen.sum() == 3
    values = []
    for three in combinations(range(8), 3):
        flags = np.zeros((1, 8), dtype=bool)
        flags[0, list(three)] = True
        values.append(fp.evaluate(given, fp.Runs(found.runs.x0, found.runs.u, found.runs.dt, measured=flags)).log_det)
    assert best > max(values) - 0.05
