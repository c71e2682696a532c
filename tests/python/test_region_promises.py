"""Whatever a region says of points, runs and windows holds for what is drawn from it, and for what searches return.

Regions are random, of numbers as people write them: equal bounds, zeros, levels at the bounds, one level, one segment, a duration
that leaves nothing to choose.
"""

import warnings
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.design.candidates.point_rows import PointRows
from fisherpoint.points.run_coordinates import RunCoordinates

MODEL = fp.SymbolicModel(
    f=["v", "k*u - d*v + 0.2*w - 0.1*x"],
    g=["x", "v + 0.1*u"],
    states={"x": "1", "v": "1"},
    inputs={"u": "1", "w": "1"},
    parameters={"k": "1", "d": "1"},
    outputs={"y": "1", "z": "1"},
)
PRIOR = fp.GaussianPrior({"k": 1.0, "d": 0.5}, std={"k": 0.1, "d": 0.05})
NOISE = {"y": 0.01, "z": 0.02}
NICE = np.array([-2.0, -1.0, -0.5, -0.1, 0.0, 0.1, 0.2, 0.3, 0.5, 1.0, 2.0])
BETWEEN = 1e-9
"""Share by which rounding may exceed a promise."""


def bounds_of(rng: np.random.Generator, fixed: float = 0.2) -> tuple[float, float] | float:
    lower, upper = np.sort(rng.choice(NICE, 2)).tolist()
    if rng.random() < fixed:
        return float(lower) if rng.random() < 0.5 else (lower, lower)
    return lower, upper


def within(bounds: Any, name: str) -> tuple[float, float]:
    given = bounds[name]
    return (given, given) if np.ndim(given) == 0 else given


def run_region(rng: np.random.Generator) -> fp.RunRegion:
    segments = int(rng.choice([1, 1, 2, 3, 5, 8, 12]))
    bounds: dict[str, Any] = {name: bounds_of(rng) for name in ("x", "v", "u", "w")}
    shortest = float(rng.choice([0.01, 0.1, 0.2, 0.5]))
    bounds["dt"] = shortest if rng.random() < 0.2 else (shortest, shortest * float(rng.choice([1.0, 2.0, 10.0, 100.0])))
    options: dict[str, Any] = {}
    constant = [name for name in ("u", "w", "dt") if rng.random() < 0.25]
    shared = [name for name in ("x", "v", *constant) if rng.random() < 0.25]
    levels, slew = {}, {}
    for name in ("u", "w"):
        lower, upper = within(bounds, name)
        if rng.random() < 0.4:
            inside = [lower, upper, *NICE[(lower <= NICE) & (upper >= NICE)].tolist()]
            levels[name] = rng.choice(inside, int(rng.integers(1, 6))).tolist()
        if rng.random() < 0.4:
            slew[name] = float(rng.choice([0.1, 0.2, 0.5, 1.0, 3.0]))
    if rng.random() < 0.6:
        longest = segments * within(bounds, "dt")[1]
        options["duration"] = segments * shortest + float(rng.choice([0.0, 0.1, 0.5, 1.0])) * (longest - segments * shortest)
    if rng.random() < 0.4:
        measured = rng.random(segments) < 0.6
        measured[rng.integers(segments)] = True
        options["measured"] = measured
        options["samples"] = int(rng.integers(1, measured.sum() + 1)) if rng.random() < 0.6 else None
    return fp.RunRegion(bounds, segments, constant=constant, shared=shared, levels=levels, slew=slew, **options)


def check_runs(region: fp.RunRegion, runs: fp.Runs, whole_design: bool = False) -> None:
    values = {"x": runs.x0[:, :1], "v": runs.x0[:, 1:], "u": runs.u[:, :, 0], "w": runs.u[:, :, 1], "dt": runs.dt}
    assert runs.dt.shape[1] == region.segments and (runs.segments == region.segments).all()
    for name, (lower, upper) in region.bounds.items():
        assert lower <= values[name].min() and values[name].max() <= upper, name
        if lower == upper:
            assert (values[name] == lower).all(), name
    for name in region.constant:
        assert (values[name] == values[name][:, :1]).all(), name
    for name in region.shared if whole_design else ():
        assert (values[name] == values[name][:1]).all(), name
    for name, levels in region.levels.items():
        assert np.isin(values[name], levels).all(), name
    for name, most in region.slew.items():
        assert np.abs(np.diff(values[name], axis=1)).max(initial=0.0) <= most * (1 + BETWEEN), name
    if region.duration is not None:
        assert runs.dt.sum(axis=1).max() <= region.duration * (1 + 1e-12)
    assert (runs.measured <= np.array(region.measured)).all()
    if region.samples is not None and whole_design:
        assert (runs.measured.sum(axis=1) == region.samples).all()
    elif region.samples is None:
        assert (runs.measured == np.array(region.measured)).all()


@pytest.mark.parametrize("seed", range(5))
def test_runs_that_are_drawn_keep_what_their_region_says(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(60):
        region = run_region(rng)
        coordinates = RunCoordinates(region, MODEL)
        shape = (20, len(coordinates))
        z = np.where(rng.random(shape) < 0.4, rng.choice([0.0, 0.5, 1.0], shape), rng.random(shape))
        check_runs(region, coordinates.runs(z))


def test_a_duration_takes_from_what_is_above_the_shortest_segments() -> None:
    region = fp.RunRegion({"x": 0.0, "v": 0.0, "u": 0.0, "w": 0.0, "dt": (0.1, 0.9)}, 3, duration=0.7)
    dt = RunCoordinates(region, MODEL).runs(np.array([[1.0, 0.0, 0.25], [0.1, 0.2, 0.05], [1.0, 1.0, 1.0]])).dt
    np.testing.assert_allclose(dt, [[0.42, 0.1, 0.18], [0.18, 0.26, 0.14], [0.7 / 3] * 3], rtol=1e-14)


def test_an_input_with_a_slew_goes_to_the_nearest_level_that_it_can_reach() -> None:
    given = {"x": 0.0, "v": 0.0, "u": (0.0, 1.0), "w": 0.0, "dt": 0.1}
    levels = [0.0, 0.1, 0.2, 0.3, 0.7, 1.0]
    region = fp.RunRegion(given, 6, levels={"u": levels}, slew={"u": 0.4})
    z = (np.array([[0, 5, 5, 5, 0, 0]]) + 0.5) / 6
    assert RunCoordinates(region, MODEL).runs(z).u[0, :, 0].tolist() == [0.0, 0.3, 0.7, 1.0, 0.7, 0.3]
    finer = fp.RunRegion(given, 4, levels={"u": levels[:4]}, slew={"u": 0.1})  # 0.3 - 0.2 < 0.1 < 0.2 - 0.1 in doubles, or about
    z = (np.array([[0, 3, 3, 3], [3, 0, 0, 0]]) + 0.5) / 4
    assert RunCoordinates(finer, MODEL).runs(z).u[:, :, 0].tolist() == [[0.0, 0.1, 0.2, 0.3], [0.3, 0.2, 0.1, 0.0]]
    stays = fp.RunRegion(given, 2, levels={"u": [0.0, 1.0]}, slew={"u": 0.5})
    assert RunCoordinates(stays, MODEL).runs((np.array([[1, 0]]) + 0.5) / 2).u[0, :, 0].tolist() == [1.0, 1.0]


def test_a_level_may_be_a_bound_in_another_unit() -> None:
    """4.2 mm are 0.004200000000000001 m."""
    model = fp.SymbolicModel(["k*(u - x)"], ["x"], {"x": "m"}, {"u": "m"}, {"k": "1/s"}, {"x": "m"})
    given = {"x": 0.0, "dt": 0.1, "u": (4.2, 6.9, "mm")}
    region = fp.RunRegion(given, 2, levels={"u": [0.0042, 0.005, 0.0069]}).in_units_of(model)
    lower, upper = region.bounds["u"]
    assert lower > 0.0042 and upper > 0.0069
    u = RunCoordinates(region, model).runs(np.array([[0.0, 0.5], [1.0, 1.0]])).u
    assert u[:, :, 0].tolist() == [[lower, 0.005], [0.0069, 0.0069]]
    with pytest.raises(ValueError, match=r"levels\['u'\]: expected values within 0.0042 and 0.0069"):
        fp.RunRegion(given, 2, levels={"u": [0.0042, 0.00691]}).in_units_of(model)


def test_no_points_have_no_rows() -> None:
    """As where an ascent finds no valid point in a narrow region."""
    rows = PointRows(problem(fp.ExperimentRegion({"x": (0, 1), "v": (0, 1), "u": (0, 1), "w": (0, 1), "dt": (0.1, 1)})), 1)
    none = fp.Experiments(np.empty((0, 2)), np.empty((0, 2)), np.empty(0))
    for there, places in (rows.at_mean(none), rows.valid(none)):
        assert there.shape == (0, 2, 2) and places.shape == (0,)


def problem(region: Any) -> fp.DesignProblem:
    return fp.DesignProblem(MODEL, PRIOR, region, noise=NOISE, output_covariance="noise")


@pytest.mark.long
@pytest.mark.parametrize("seed", range(10))
def test_designs_of_runs_keep_what_their_region_says(seed: int) -> None:
    rng = np.random.default_rng([seed, 1])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # some regions tell little
        region = run_region(rng)
        count = int(rng.integers(1, 4))
        confidence = float(rng.choice([0.5, 0.99])) if rng.random() < 0.5 else None
        design = fp.design_runs(
            problem(region),
            count,
            n_starts=2,
            n_candidates=20,
            seed=seed,
            goal=fp.Goal(confidence=confidence),
            time_limit=60.0,
            threads=1,
        )
    assert len(design.runs) == count
    check_runs(region, design.runs, whole_design=True)


CONSTRAINTS = ("x + v <= 1", "u >= w", "abs(u*dt) < 1.5", "x**2 + v**2 <= 4")


def point_region(rng: np.random.Generator) -> fp.ExperimentRegion:
    bounds = {name: within({name: bounds_of(rng)}, name) for name in ("x", "v", "u", "w")}
    shortest = float(rng.choice([0.01, 0.1, 0.5]))
    bounds["dt"] = shortest, shortest * float(rng.choice([1.0, 2.0, 100.0]))
    region = fp.ExperimentRegion(bounds, [text for text in CONSTRAINTS if rng.random() < 0.4])
    drawn = region.draw(MODEL, 500, seed=1)
    return region if region.satisfied(MODEL, drawn).mean() > 0.05 else point_region(rng)


@pytest.mark.long
@pytest.mark.parametrize("seed", range(10))
def test_designs_of_points_keep_what_their_region_says(seed: int) -> None:
    rng = np.random.default_rng([seed, 2])
    region, count = point_region(rng), int(rng.integers(2, 7))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        options = {"goal": fp.Goal(confidence=0.9)} if seed % 3 == 0 else {"method": ("auto", "paper")[seed % 2]}
        design = fp.exchange(problem(region), count, n_candidates=40, max_iterations=40, seed=seed, threads=1, **options)
        weights = fp.approximate_design(problem(region), seed=seed, threads=1, starts=50, n_candidates=300)
    for points in (design.points, weights.points, region.draw(MODEL, 50, seed=seed, decades=True)):
        table = dict(zip(region.bounds, points.table.T, strict=True))
        for name, (lower, upper) in region.bounds.items():
            assert lower <= table[name].min() and table[name].max() <= upper, name
    assert len(design.points) == count
    assert region.satisfied(MODEL, design.points).all() and region.satisfied(MODEL, weights.points).all()


@pytest.mark.parametrize("seed", range(5))
def test_windows_of_a_record_keep_what_was_asked_for(seed: int) -> None:
    rng = np.random.default_rng([seed, 3])
    length, every, size = int(rng.integers(2, 12)), int(rng.integers(1, 7)), int(rng.integers(80, 200))
    model = fp.SymbolicModel(
        ["v", "k*u - d*v - 0.1*x"], ["x", "v"], {"x": "1", "v": "1"}, {"u": "1"}, {"k": "1", "d": "1"}, {"y": "1", "z": "1"}
    )
    u = np.repeat(rng.choice([-1.0, 0.0, 1.0], size), 4)[:size]
    whole = fp.simulate(model, fp.Runs([[0.0, 0.0]], u[None, :-1], 0.1), {"k": 1.0, "d": 0.5})
    y = np.concatenate([[[0.0, 0.0]], whole.y[0]]) + rng.normal(0, 0.01, (size, 2))
    y[rng.random(size) < 0.2, 0] = np.nan
    record = fp.Record(0.1 * np.arange(size), u, y)
    pieces = fp.pieces(record, model, length=length, every=every)
    count = int(rng.integers(1, min(6, size // (2 * max(length, every)))))
    given = fp.DesignProblem(model, PRIOR, None, noise=NOISE, output_covariance="noise")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        design = fp.design_pieces(given, pieces, count, threads=1)
    first = np.sort(design.first)
    assert len(first) == count and (np.diff(first) >= length).all() and (first % every == 0).all() and first[-1] + length <= size
    assert len(design.runs) == count and design.runs.dt.shape[1] == length - 1
    np.testing.assert_array_equal(design.runs.x0, y[design.first])
    for k, row in enumerate(design.first.tolist()):
        np.testing.assert_array_equal(design.runs.u[k, :, 0], u[row : row + length - 1])
        assert (design.runs.measured[k] == np.isfinite(y[row + 1 : row + length]).any(axis=1)).all()
