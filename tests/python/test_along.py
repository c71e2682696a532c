"""Limits along the way, against SciPy's events, and the share of plants that can run a design, against shares known exactly."""

from __future__ import annotations

import pickle
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.stats import binomtest, norm

import fisherpoint as fp
from fisherpoint.basics.result_files import decoded, encoded
from fisherpoint.models import symbolic

pytestmark = pytest.mark.kernels

X, STATES = {"x": ("m", 1.0)}, {"x": ("m", 1.0), "v": ("m/s", 1.0)}
LIMITS = [
    "max(x, v) - min(x, v) < 2.1",
    "abs(x) < 1.1",
    "-1.5 < v <= 1.4",
    "max(x + v, 2*v) < 1.9",
    "min(x, v) > -1.3",
    "x**2 + v**2 < a*3",
]


def swing(**options: Any) -> fp.SymbolicModel:
    return fp.SymbolicModel(
        ["v", "u - a * x - 0.1 * v"], ["x"], STATES, {"u": "m/s2"}, {"a": "1/s2"}, {"x": "m"}, name="swing", **options
    )


def integrator() -> fp.SymbolicModel:
    """x = x0 + p c u t: which plants keep a limit is known exactly."""
    return fp.SymbolicModel(
        ["c * p * u"], ["x"], X, {"u": "1"}, {"p": "m/s"}, {"x": "m"}, constants={"c": (1.0, "1")}, name="integrator"
    )


def known(share: float, **options: Any) -> fp.DesignProblem:
    """A problem of which this share of plants keeps x(1 s) from 0 below its limit, with u = 1."""
    limit = float(norm.ppf(share, 1.0, 0.1))
    prior = fp.GaussianPrior({"p": 1.0}, {"p": 0.1})
    return fp.DesignProblem(integrator(), prior, None, noise={"x": 0.1}, **{"along": [f"x < {limit!r}"], **options})


ONCE = fp.Runs([[0.0]], [[1.0, -1.0]], [[1.0, 1.0]])
"""The limit is touched where the input turns, and x is back at the end."""


# --- Limits along the way ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("limit", LIMITS)
def test_limits_end_trajectories_where_scipy_sees_them(limit: str) -> None:
    """From random starts: just before the first time at which SciPy's states break it all is ok, just behind not."""
    rng, model = np.random.default_rng(4), swing().within(limit)
    holds = fp.ExperimentRegion({"x": (-9, 9), "v": (-9, 9), "a": (0, 9)}, [limit.replace("a*3", "2.4")])._holds[0]
    broken = 0
    for x0, v0, u in rng.uniform([-1, -1.2, -1.5], [1, 1.2, 1.5], (25, 3)):
        done = solve_ivp(
            lambda _, x, u=u: [x[1], u - 0.8 * x[0] - 0.1 * x[1]], (0, 6), [x0, v0], "DOP853", rtol=1e-10, max_step=0.02
        )
        first = ~holds({"x": done.y[0], "v": done.y[1], "a": np.full(len(done.t), 0.8)})
        if first[0]:
            assert fp.broken_limits(model, fp.Experiments([[x0, v0]], [u], [1.0]), [0.8]) == (f"{limit} at the start",)
            continue
        place = int(np.argmax(first)) if first.any() else -1
        times = [6.0] if place < 0 else [t for t in (done.t[place - 1] - 1e-3, done.t[place] + 1e-3) if t > 1e-3]
        points = fp.Experiments([[x0, v0]] * len(times), [u] * len(times), times)
        expected = ["ok"] if place < 0 else ["ok", "left_domain"][-len(times) :]
        assert [fp.Status(s).name for s in fp.simulate(model, points, [0.8], rtol=1e-9).status] == expected
        told = fp.broken_limits(model, points, [0.8], rtol=1e-9)
        assert told == tuple(limit if status == "left_domain" else None for status in expected)
        broken += place > 0
    assert broken > 3


def test_a_limit_touched_between_two_samples_is_seen() -> None:
    turn = np.pi  # x = sin(t) without damping and input, from (0, 1), is back at zero
    undamped = fp.SymbolicModel(["v", "u - a * x"], ["x"], STATES, {"u": "m/s2"}, {"a": "1/s2"}, {"x": "m"})
    for limit, status in ((0.99, fp.Status.left_domain), (0.9999999, fp.Status.left_domain), (1.0000001, fp.Status.ok)):
        model = undamped.within(f"x < {limit}")
        point = fp.Experiments([[0.0, 1.0]], [0.0], [turn])
        run = fp.Runs([[0.0, 1.0]], [[0.0, 0.0]], turn / 1.0, [[False, True]])
        assert fp.simulate(undamped, point, [1.0]).x[0, 0] < 1e-5
        assert fp.simulate(model, point, [1.0], rtol=1e-9).status.tolist() == [status]
        for done in (fp.simulate(model, run, [1.0], rtol=1e-9), fp.sensitivities(model, run, [1.0], rtol=1e-9)):
            assert done.status.tolist() == [status]


def test_the_first_of_several_limits_is_told_also_of_inputs_that_switch() -> None:
    model = swing().within("x < 0.5", "v < 0.8", "u < 2")
    starts = [[0.45, 0.7], [-1.0, 0.75], [0.0, 0.0], [0.6, 0.0], [0.0, 0.0]]
    inputs = [[0.0, 0.0], [1.5, 0.0], [0.1, 2.5], [0.0, 0.0], [0.1, 0.1]]
    told = fp.broken_limits(model, fp.Runs(starts, inputs, 0.3), [0.8])
    assert told == ("x < 0.5", "v < 0.8", "u < 2", "x < 0.5 at the start", None)
    roots = fp.SymbolicModel(["-a*sqrt(h)"], ["h"], {"h": "m"}, {}, {"a": "1"})
    points = fp.Experiments([[1.0]] * 2, np.empty((2, 0)), [0.5, 5.0])
    assert fp.broken_limits(roots, points, [1.0]) == (None, "h > 0")


def test_limits_are_those_of_the_states_of_every_form_of_a_model(monkeypatch: pytest.MonkeyPatch) -> None:
    model = swing().within("x < 1").within("0 < a*v")
    assert model.along == ("x < 1", "0 < a*v") and set(model.along) <= set(model.domain)
    assert model != swing() and model == swing().within("x < 1").within("0 < a*v") == pickle.loads(pickle.dumps(model))
    off = model.free_start("x")
    point = fp.Experiments([[0.9, 0.5]], [0.0], [0.05])
    assert fp.simulate(off, point, [0.8, 0.0]).status.tolist() == [0]
    assert fp.broken_limits(off, point, [0.8, 0.2]) == fp.broken_limits(pickle.loads(pickle.dumps(off)), point, [0.8, 0.2])
    assert fp.broken_limits(off, point, [0.8, 0.2]) == ("x < 1 at the start",)
    more = swing(constants={"w": (0.8, "1")}).within("x < w").estimate("w")
    assert fp.broken_limits(more, point, [0.8, 0.8]) == ("x < w at the start",) and more.along == ("x < w",)
    monkeypatch.setattr(symbolic, "compiled_model", lambda model, states, programs, tape: tape)
    assert swing().compile().within("x < 1").compiled and not swing().within("x < 1").compiled
    cylinder = fp.HydraulicCylinder().within("p_A < 19e6", "abs(v) < 0.4")
    assert cylinder.along == ("p_A < 19e6", "abs(v) < 0.4") and cylinder.crossable == ("v",)


@pytest.mark.parametrize(
    ("limit", "said"),
    [
        ("x", r"along\[0\]: column 1: expected a comparison with <, <=, > or >=; given 'x'"),
        ("y < 1", r"along\[0\]: column 1: expected the names x, v, u, a; given 'y < 1'"),
        ("a < 1", r"along\[0\]: expected a limit of states or inputs, given 'a < 1'"),
        ("1 < 2", r"along\[0\]: column 1: expected comparisons that may hold or not; given '1 < 2'"),
        ("x < 1 or v < 1", r"along\[0\]: column 1: expected a comparison"),
        (3, r"along\[0\]: expected a formula as text, given 3"),
    ],
)
def test_what_is_no_limit_is_refused(limit: Any, said: str) -> None:
    prior = fp.GaussianPrior({"a": 1.0}, {"a": 0.1})
    with pytest.raises(ValueError, match=said):
        swing().within(limit)
    with pytest.raises(ValueError, match=said):
        fp.DesignProblem(swing(), prior, None, along=[limit])


# --- Problems ------------------------------------------------------------------------------------------------------------


def test_designs_keep_the_limits_at_the_prior_mean() -> None:
    problem = known(0.98, along=["x < 0.95", "u > -2"])
    told = ["runs[0] (left_domain: x < 0.95)", "runs[2] (left_domain: x < 0.95 at the start)", "runs[3] (left_domain: u > -2)."]
    said = re.escape(f"given {', '.join(told)}")
    runs = fp.Runs([[0.0], [-0.1], [1.0], [-1.0]], [[1.0, -1.0]] * 3 + [[1.0, -3.0]], 1.0)
    with pytest.raises(ValueError, match=said):
        fp.evaluate(problem, runs)
    with pytest.raises(ValueError, match=r"points: .* given points\[0\] \(left_domain: x < 0.95\)\. The state reached a limit"):
        fp.evaluate(problem, fp.Experiments([[0.0]], [1.0], [1.0]))
    fp.evaluate(problem, runs[1])
    past = fp.Runs([[0.0]], [[1.0, -1.0]], 1.0)
    assert fp.evaluate(problem, runs[1], previous=past).n_points == 4, "what was measured was possible"
    for copy in (decoded(encoded(problem), fp.DesignProblem), pickle.loads(pickle.dumps(problem)), problem.replace(rtol=1e-7)):
        assert copy.along == ("x < 0.95", "u > -2") and copy.limited == problem.limited
    assert problem.model.along == () and problem.replace(along=None).limited is problem.model


def test_a_search_finds_points_within_the_limits() -> None:
    region = fp.ExperimentRegion({"x": (-1.0, 1.0), "v": (-1.0, 1.0), "u": (-1.5, 1.5), "dt": (0.1, 3.0)})
    problem = fp.DesignProblem(
        swing(), fp.GaussianPrior({"a": 0.8}, {"a": 0.1}), region, noise={"x": 0.01}, along=["abs(v) < 0.9"],
        initial_state_std={"v": 0.01},
    )  # fmt: skip
    settings: dict[str, Any] = {
        "n_experiments": 4,
        "n_candidates": 20,
        "max_iterations": 10,
        "method": fp.ExchangeMethod(references=False),
    }
    design, free = (fp.exchange(one, **settings) for one in (problem, problem.replace(along=None)))

    def fastest(points: fp.Experiments) -> float:
        times = [solve_ivp(lambda _, x, u=u: [x[1], u - 0.8 * x[0] - 0.1 * x[1]], (0, dt), x0, "DOP853", max_step=0.01).y[1]
                 for x0, u, dt in zip(points.x0, points.u[:, 0], points.dt, strict=True)]  # fmt: skip
        return max(float(np.abs(v).max()) for v in times)

    assert fastest(design.points) < 0.9 < fastest(free.points)
    assert design.rejected["left_domain"] > 0 and design.rejected["starts near abs(v) < 0.9"] > 0


# --- Feasibility ---------------------------------------------------------------------------------------------------------


def test_a_share_that_is_known_is_refused_and_accepted() -> None:
    found = fp.feasibility(known(0.98), ONCE, draws=2000)
    assert not found.holds(0.99) and found.holds(0.95)
    assert found.interval[0] < 0.98 < found.interval[1] and abs(found.share - 0.98) < 0.01
    limit = known(0.98).along[0]  # type: ignore[index]
    assert dict(found.reasons) == {f"left_domain: {limit}": found.draws - found.able}


def test_the_interval_holds_what_it_says() -> None:
    """In 60 repetitions the interval of 95 % misses the known share as often as it may; it is that of SciPy."""
    missed = 0
    for seed in range(60):
        found = fp.feasibility(known(0.9), ONCE, draws=200, seed=seed)
        ends = binomtest(found.able, found.draws).proportion_ci(0.95, "exact")
        assert found.interval == pytest.approx((ends.low, ends.high), rel=1e-9)
        missed += not found.interval[0] <= 0.9 <= found.interval[1]
    assert missed <= 7  # more in one of a thousand cases
    assert fp.feasibility(known(0.9, along=None), ONCE, draws=100).interval[1] == 1.0
    assert fp.feasibility(known(0.9, along=["x < 0.1"]), ONCE, draws=100).interval[0] == 0.0


@pytest.mark.parametrize("kind", ["runs", "points"])
def test_what_is_uncertain_counts_too(kind: str) -> None:
    """c moves all runs of a plant at once, a start each of its own: the shares are known from both."""
    points = fp.Experiments([[0.0], [-0.1], [-5.0]], [1.0] * 3, [1.0] * 3)
    given = fp.Runs.of_points(points) if kind == "points" else fp.Runs(points.x0, [[1.0, -1.0]] * 3, 1.0)
    of_kind = points if kind == "points" else given
    problem = known(0.5, along=["x < 1.2"], uncertain={"c": 0.05}, initial_state_std={"x": 0.15})
    found = fp.feasibility(problem, of_kind, draws=20_000)
    rng = np.random.default_rng(0)
    slope = rng.normal(1, 0.1, 10**6) * rng.normal(1, 0.05, 10**6)
    ends = slope[:, None] + [0.0, -0.1] + rng.normal(0, 0.15, (10**6, 2))
    each, whole = (ends < 1.2).mean(axis=0), (ends < 1.2).all(axis=1).mean()
    np.testing.assert_allclose(found.shares, [*each, 1.0], rtol=0, atol=4 * 0.5 / np.sqrt(20_000))
    assert abs(found.share - whole) < 4 * 0.5 / np.sqrt(20_000) and found.kind == kind[:-1]
    frame = found.to_pandas()
    assert frame.index.name == kind[:-1] and frame.share.tolist() == found.shares.tolist()
    assert (frame.lower <= frame.share).all() and (frame.share <= frame.upper).all()
    (where,) = [section for section in found.report().sections if section.title == "Where"]
    assert sorted(row[0] for row in where.rows) == ["1", "2"] and {row[2] for row in where.rows} == {"left_domain: x < 1.2"}


def test_what_makes_no_sense_is_drawn_anew() -> None:
    """Half of the plants would have a negative mass; of the others the share is that of a half normal distribution."""
    model = fp.SymbolicModel(
        ["c * u * sqrt(m)"], ["x"], X, {"u": "1"}, {"m": "kg"}, {"x": "m"}, constants={"c": (1.0, "1")}, domain=["m", "c"]
    )
    prior = fp.GaussianPrior({"m": 0.01}, {"m": 1.0})
    problem = fp.DesignProblem(model, prior, None, noise={"x": 0.1}, along=["x < 1"], uncertain={"c": 1e-9})
    found = fp.feasibility(problem, ONCE, draws=4000)
    assert 0.4 < found.left_out / (found.left_out + 4000) < 0.6
    assert abs(found.share - (norm.cdf(0.99) - norm.cdf(-0.01)) / norm.cdf(0.01)) < 0.03
    assert "drawn anew" in str(found)
    of_constants = fp.feasibility(problem.replace(uncertain={"c": 1.0}, parameters=["m"]), ONCE, draws=500)
    assert of_constants.left_out > found.left_out * 500 / 4000


def test_runs_from_rest_and_other_reasons_are_counted() -> None:
    model = fp.SymbolicModel(["a + x**2 + u"], ["x"], X, {"u": "m/s2"}, {"a": "1"}, {"x": "m"}, check_units=False)
    problem = fp.DesignProblem(model, fp.GaussianPrior({"a": -1.0}, {"a": 0.8}), None, noise={"x": 0.1}, along=["x > -1.5"])
    runs = fp.Runs([[-1.0]], [[-0.1, 0.0]], 0.1, rest=fp.Rest({"u": 0.0}))
    found = fp.feasibility(problem, runs, draws=4000)
    assert set(found.reasons) == {"no_rest", "left_domain: x > -1.5", "left_domain: x > -1.5 at the start"}
    assert abs(found.reasons["no_rest"] / 4000 - norm.sf(1.25)) < 0.02
    assert abs(found.reasons["left_domain: x > -1.5 at the start"] / 4000 - norm.cdf(-1.25 / 0.8)) < 0.015


def test_the_result_depends_on_the_seed_alone_and_is_kept(tmp_path: Path) -> None:
    problem = known(0.9, initial_state_std={"x": 0.05})
    runs = fp.Runs.join([ONCE, fp.Runs([[0.0]], [[1.0]], 0.7)])
    one, two, other = (
        fp.feasibility(problem, runs, draws=500, seed=seed, threads=threads) for seed, threads in ((0, 1), (0, 2), (1, 1))
    )
    assert one.failures == two.failures and one.reasons == two.reasons and one.failures != other.failures
    one.save(tmp_path / "feasibility.json")
    again = fp.results.Feasibility.load(tmp_path / "feasibility.json")
    assert again.reasons == one.reasons and again.failures == one.failures and str(again) == str(one)
    one.print()


def test_misuse_is_told() -> None:
    with pytest.raises(TypeError, match="points: expected Experiments or Runs, given int"):
        fp.feasibility(known(0.9), 3)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="draws: expected a whole number of at least 1, given 0"):
        fp.feasibility(known(0.9), ONCE, draws=0)
    with pytest.raises(ValueError, match="share: expected a probability between 0 and 1"):
        fp.feasibility(known(0.9), ONCE, draws=10).holds(95)
    with pytest.raises(ValueError, match=r"rest: expected an equilibrium of x"):
        fp.feasibility(known(0.9), fp.Runs([[0.0]], [[1.0]], 1.0, rest=fp.Rest({"u": 1.0})))


def test_files_have_limits_too(tmp_path: Path) -> None:
    decay = (Path(__file__).parents[2] / "examples" / "exponential_decay.toml").read_text()
    (tmp_path / "decay.toml").write_text(decay.replace("[design]\n", '[design]\nalong = ["share > -1"]\n', 1))
    assert fp.load_problem(tmp_path / "decay.toml").along == ("share > -1",)
    (tmp_path / "decay.toml").write_text(decay.replace("[design]\n", '[design]\nalong = ["x > 0.1"]\n', 1))
    with pytest.raises(ValueError, match=r"decay.toml: design: along\[0\]: column 1: expected the names share, .*; given 'x"):
        fp.load_problem(tmp_path / "decay.toml")


@pytest.mark.parametrize("runs", [False, True])
def test_plants_that_pass_close_to_a_jump_can_run(runs: bool) -> None:
    """v = 5e-7 + (t - 1)^2, with a jump at v = 0: at a tolerance of 1e-6 it touches, and at 1e-9 it passes beside."""
    model = fp.SymbolicModel(
        f=["2*(c - 1)", "1", "0.3*heaviside(-v) + p"],
        g=["x"],
        states={"v": "1", "c": "1", "x": "1"},
        inputs={},
        parameters={"p": "1"},
    )
    prior = fp.GaussianPrior({"p": 1.0}, {"p": 0.1})
    problem = fp.DesignProblem(model, prior, None, noise={"y": 0.1})
    points = fp.Experiments([[1 + 5e-7, 0.0, 0.0]], [[]], [2.0])
    assert fp.simulate(model, points, [1.0]).status[0] == fp.Status.grazes_jump
    given = fp.Runs(points.x0, np.empty((1, 2, 0)), np.array([[1.0, 1.0]])) if runs else points
    assert fp.feasibility(problem, given, draws=20).share == 1.0
    touching = fp.Experiments([[1.0, 0.0, 0.0]], [[]], [2.0])
    assert fp.feasibility(problem, touching, draws=20).share == 0.0
