"""Starts at rest, against equilibria that scipy.optimize finds at moved parameters and SciPy's integration from there."""

from __future__ import annotations

import pickle
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import root

import fisherpoint as fp
from fisherpoint.design.runs.run_tables import runs_tables

pytestmark = pytest.mark.kernels

NOISE = {"y": 0.02, "z": 0.05}
THETA = np.array([1.3, 0.7, 0.4])
STD = np.array([0.1, 0.2, 0.1])
REST = {"all": fp.Rest({"u": 0.6}), "b": fp.Rest({"u": 0.6}, states=["b"])}


def tanks() -> fp.SymbolicModel:
    """Two tanks in a row of which the levels at rest depend on every parameter and the constant."""
    return fp.SymbolicModel(
        f=["c * u - k1 * sqrt(a) - m * a", "k1 * sqrt(a) - k2 * sqrt(b) + m * a - 0.1 * b * k1"],
        g=["b", "a + u * b"],
        states={"a": "m", "b": "m"},
        inputs={"u": "1"},
        outputs={"y": "m", "z": "m"},
        parameters={"k1": "1", "k2": "1", "m": "1"},
        constants={"c": (1.1, "1")},
    )


def rates(x: Any, u: float, theta: Any) -> np.ndarray:
    a, b = x
    k1, k2, m, c = theta
    return np.array([c * u - k1 * np.sqrt(a) - m * a, k1 * np.sqrt(a) - k2 * np.sqrt(b) + m * a - 0.1 * b * k1])


def settled(f: Callable[[np.ndarray], np.ndarray], x0: np.ndarray, places: list[int], size: np.ndarray) -> np.ndarray:
    """x0 with the states in `places` where their rates are zero, by scipy.optimize; in natural sizes."""

    def of(z: np.ndarray) -> np.ndarray:
        x = x0.copy()
        x[places] = z * size[places]
        return np.asarray(f(x)[places])

    scaled = of(x0[places] / size[places])
    unit = np.where(np.abs(scaled) > 0, np.abs(scaled), 1.0)
    z = x0[places] / size[places]
    for _ in range(3):  # again from where it stopped
        z = root(lambda z: of(z) / unit, z, method="hybr", options={"xtol": 1e-15}).x
    x = x0.copy()
    x[places] = z * size[places]
    return x


def outputs(runs: fp.Runs, k: int, theta: np.ndarray, off: np.ndarray) -> np.ndarray:
    """y (N, n_y) of run k at the parameters k1, k2, m, c, from rest and off by a deviation."""
    rest, x = runs.rest[k], runs.x0[k]
    if rest is not None:
        places = [0, 1] if rest.states is None else [1]
        x = settled(lambda x: rates(x, rest.u["u"], theta), x, places, np.ones(2))
    x, found = x + off, []
    for n in range(int(runs.segments[k])):
        u = float(runs.u[k, n, 0])
        done = solve_ivp(lambda _, x, u=u: rates(x, u, theta), (0, runs.dt[k, n]), x, "DOP853", rtol=1e-12, atol=1e-13)
        x = done.y[:, -1]
        found.append([x[1], x[0] + u * x[1]])
    return np.array(found)


def slopes(runs: fp.Runs, k: int, h: float = 1e-3) -> np.ndarray:
    """dy (N, n_y, 6) by k1, k2, m, c and the deviations of a and b; extrapolated central differences."""

    def at(step: np.ndarray) -> np.ndarray:
        return outputs(runs, k, np.array([*THETA, 1.1]) + step[:4], step[4:])

    def difference(h: float) -> np.ndarray:
        return np.stack([(at(h * e) - at(-h * e)) / (2 * h) for e in np.eye(6)], axis=-1)

    return np.asarray((4 * difference(h / 2) - difference(h)) / 3)


def drawn(rest: fp.Rest | None, segments: int = 5, seed: int = 3) -> fp.Runs:
    rng = np.random.default_rng(seed)
    u, dt = rng.choice([0.2, 1.5], (3, segments)), rng.uniform(0.1, 0.6, (3, segments))
    measured = rng.random((3, segments)) < 0.8
    measured[:, -1] = True
    return fp.Runs(rng.uniform(0.1, 0.5, (3, 2)), u, dt, measured, rest=rest)


def both() -> fp.Runs:
    """Runs from rest, from rest in part, and from given starts."""
    return fp.Runs.join([drawn(REST["all"]), drawn(REST["b"], 4, 5), drawn(None, 1, 6), drawn(REST["all"], 1, 7)])


def problem(model: fp.Model, **options: Any) -> fp.DesignProblem:
    prior = fp.GaussianPrior(dict(zip(("k1", "k2", "m"), THETA, strict=True)), dict(zip(("k1", "k2", "m"), STD, strict=True)))
    return fp.DesignProblem(model, prior, None, noise=NOISE, rtol=1e-11, **options)


def test_states_and_sensitivities_are_those_of_scipy() -> None:
    runs = both()
    done, states = (of(tanks(), runs, THETA, rtol=1e-11) for of in (fp.sensitivities, fp.simulate))
    assert (done.status == fp.Status.ok).all()
    for k in range(len(runs)):
        own = int(runs.segments[k])
        y, s = outputs(runs, k, np.array([*THETA, 1.1]), np.zeros(2)), slopes(runs, k)[..., :3]
        np.testing.assert_allclose(done.y[k, :own], y, rtol=0, atol=1e-9)
        np.testing.assert_allclose(states.y[k, :own], y, rtol=0, atol=1e-9)
        np.testing.assert_allclose(done.dy_dtheta[k, :own], s, rtol=0, atol=1e-6 * np.abs(s).max())


@pytest.mark.long
@pytest.mark.parametrize("uncertain", [None, {"c": 0.05}])
@pytest.mark.parametrize("start", [None, {"a": 0.1, "b": 0.02}])
def test_the_information_is_that_of_dense_algebra(uncertain: dict[str, float] | None, start: dict[str, float] | None) -> None:
    """The rest moves with an uncertain constant too, and a start that is off is so from the rest."""
    runs, std = both(), np.array([*STD, 0.05, 0.1, 0.02])
    total = np.zeros((3, 3))
    for k in range(len(runs)):
        at = runs.measured[k, : int(runs.segments[k])]
        moved = slopes(runs, k)[at].reshape(-1, 6) * std
        g = moved[:, [*([3] if uncertain else []), *([4, 5] if start else [])]]
        r = np.kron(np.eye(at.sum()), np.diag(np.square(list(NOISE.values())))) + g @ g.T
        total += moved[:, :3].T @ np.linalg.solve(r, moved[:, :3])
    evaluation = fp.evaluate(problem(tanks(), varies=uncertain, initial_state_std=start), runs)
    np.testing.assert_allclose(evaluation.information, total, rtol=1e-6, atol=1e-6 * np.abs(total).max())


def test_the_rest_matters() -> None:
    """What the tests above compare would differ by far if the start did not move."""
    fixed = fp.simulate(tanks(), both(), THETA).x[:, 0]
    runs = both()
    held = fp.Runs(fixed, runs.u, runs.dt, runs.measured)
    moving, still = (fp.evaluate(problem(tanks()), some).information for some in (runs, held))
    assert np.abs(moving / still - 1).max() > 0.1


@pytest.mark.long
@pytest.mark.parametrize("states", [("v", "p_A", "p_B"), ("x_v", "p_B", "p_A", "v")])
def test_a_smooth_cylinder_creeps_from_its_rest(states: tuple[str, ...]) -> None:
    model = fp.HydraulicCylinder(smooth={"v": 5e-2, "x_v": 0.2})
    theta, size = model.theta(model.nominal), np.array([s.scale or 1.0 for s in model.states])
    places = sorted([q.name for q in model.states].index(name) for name in states)
    x0 = np.array([0.15, 0.01, 8e6, 10e6, 0.05])
    runs = fp.Runs([x0], [[0.1, -0.2, 0.3]], 5e-3, rest=fp.Rest({"u": 0.02}, states=states))
    done = fp.sensitivities(model, runs, theta, rtol=1e-11)
    assert done.status.tolist() == [fp.Status.ok] and abs(done.x[0, 0, 1]) > 1e-3
    np.testing.assert_allclose(model.rhs(done.x[0, 0], 0.02, theta)[places] * 1e-3 / size[places], 0, atol=1e-12)

    def at(theta: np.ndarray) -> np.ndarray:
        x, found = settled(lambda x: model.rhs(x, 0.02, theta), x0, places, size), []
        for n in range(3):
            u = runs.u[0, n]
            done = solve_ivp(
                lambda _, z, u=u: model.rhs(z * size, u, theta) / size, (0, 5e-3), x / size, "DOP853", rtol=1e-12, atol=1e-14
            )
            x = done.y[:, -1] * size
            found.append(x)
        return np.array(found)

    def difference(h: float) -> np.ndarray:
        return np.stack([(at(theta * (1 + h * e)) - at(theta * (1 - h * e))) / (2 * h) for e in np.eye(9)], axis=-1)

    slope = (4 * difference(5e-4) - difference(1e-3)) / 3
    found = done.dx_dtheta[0] * theta
    largest = np.maximum(np.abs(slope).max(axis=(0, 2)), 1e-6 * size)[:, None]  # nothing moves the valve
    assert np.abs((found - slope) / largest).max() < 1e-6


def test_the_rest_of_a_sharp_cylinder_is_that_of_its_equations() -> None:
    """At creeping speed neither jump nor kink is near; on the kink of a closed valve, nothing moves the valve."""
    sharp, runs = fp.HydraulicCylinder(), fp.Runs([[0.15, 0.01, 8e6, 10e6, 0.0]], [[0.5, 0.2]], 2e-3)
    rest = fp.Rest({"u": 0.0}, states=("v", "p_A", "p_B", "x_v"))
    runs = fp.Runs(runs.x0, runs.u, runs.dt, rest=rest)
    a, b = (fp.sensitivities(model, runs, sharp.nominal, rtol=1e-9) for model in (sharp, sharp.symbolic()))
    assert a.status.tolist() == b.status.tolist() == [fp.Status.ok]
    assert a.x[0, 0, 4] == 0 and abs(sharp.rhs(a.x[0, 0], 0.0, sharp.theta(sharp.nominal))[1]) < 1e-9
    np.testing.assert_allclose(a.dx_dtheta, b.dx_dtheta, rtol=1e-5)


def test_a_piston_may_start_stuck_while_the_pressures_are_at_rest() -> None:
    """What holds the piston is a range of states, of which x0 says v = 0; the pressures still depend on the parameters."""
    model = fp.HydraulicCylinder(A_B=1.9635e-3 - 2e-5)
    theta, rest = model.theta(model.nominal), fp.Rest({"u": 0.0}, states=("p_A", "p_B", "x_v"))
    runs = fp.Runs([[0.15, 0.0, 9e6, 12e6, 0.0]], [[0.5, -0.5, 0.2]], 5e-3, rest=rest)
    done = fp.sensitivities(model, runs, theta, rtol=1e-11)
    assert done.status.tolist() == [fp.Status.ok] and done.x[0, 0, 1] == 0
    held = float(done.x[0, 0, 2] * 1.9635e-3 - done.x[0, 0, 3] * (1.9635e-3 - 2e-5))
    assert 0 < held < 400, "friction holds it"

    def at(theta: np.ndarray) -> np.ndarray:
        return np.asarray(fp.simulate(model, runs, theta, rtol=1e-12).y[0, :, :3])

    slope = np.stack([(at(theta * (1 + 1e-5 * e)) - at(theta * (1 - 1e-5 * e))) / 2e-5 for e in np.eye(9)], axis=-1)
    largest = np.abs(slope).max(axis=(0, 2))[:, None]
    assert np.abs((done.dy_dtheta[0, :, :3] * theta - slope) / largest).max() < 1e-6


def test_one_segment_from_rest_is_no_point() -> None:
    runs = drawn(REST["all"], 1)
    assert runs.points is None
    start = fp.simulate(tanks(), runs, THETA).x[:, 0]
    np.testing.assert_allclose(rates(start[0], 0.6, [*THETA, 1.1]), 0, atol=1e-14)
    assert np.array_equal(start, np.tile(start[0], (3, 1))) or np.ptp(start, axis=0).max() < 1e-14


def test_other_parameters_have_other_starts_and_those_without_a_rest_a_status() -> None:
    model = fp.SymbolicModel(["a + x**2 + u"], ["x"], {"x": "1"}, {"u": "1"}, {"a": "1"})
    runs = fp.Runs([[-1.0]] * 4, [[-1.0, -2.0]] * 4, 0.3, rest=[fp.Rest({"u": 0.0})] * 3 + [None])
    theta = [[1.0], [-1.0], [-2.0], [1.0]]
    for done in (fp.simulate(model, runs, theta), fp.sensitivities(model, runs, theta)):
        assert done.status.tolist() == [fp.Status.no_rest, 0, 0, 0] and done.reached.tolist() == [0, 2, 2, 2]
        np.testing.assert_allclose(done.x[:, 0, 0], [-1, -1, -np.sqrt(2), -1], rtol=1e-14)
        assert (done.y[0] == 0).all()
    alone = fp.sensitivities(model, runs[[1, 3]], [[-1.0], [1.0]])
    whole = fp.sensitivities(model, runs, theta)
    assert all(np.array_equal(a, b[[1, 3]]) for a, b in zip(alone, whole, strict=True))
    none = fp.sensitivities(model, runs[:1], [[1.0]])
    assert none.status.tolist() == [fp.Status.no_rest] and none.dy_dtheta.shape == (1, 2, 1, 1)


def test_a_deviation_of_the_start_comes_on_top_of_the_rest() -> None:
    runs = both()
    off, own = tanks().free_start("a", "b"), tanks()
    moved = fp.simulate(off, runs, [*THETA, 0.1, -0.02], rtol=1e-11)
    starts = fp.simulate(own, runs, THETA).x[:, 0]
    np.testing.assert_allclose(moved.x[:, 0], starts, rtol=1e-12)
    plain = fp.simulate(own, fp.Runs(starts + np.array([0.1, -0.02]), runs.u, runs.dt, runs.measured), THETA, rtol=1e-11)
    np.testing.assert_allclose(moved.y, plain.y, rtol=0, atol=1e-9)


def test_a_virtual_rig_starts_at_its_own_rest() -> None:
    """And not at the guess; a deviation comes on top."""
    runs, exact = both(), {"y": 0.0, "z": 0.0}
    data = fp.VirtualRig(tanks(), THETA, exact).measure(runs)
    expected = np.where(runs.measured[:, :, None], fp.simulate(tanks(), runs, THETA, rtol=1e-10).y, np.nan)
    np.testing.assert_allclose(data.y, expected, rtol=1e-9)
    assert data.points == runs
    off = fp.VirtualRig(tanks(), THETA, exact, initial_state_std={"b": 0.05}).measure(runs)
    assert np.nanmax(np.abs(off.y - data.y)) > 1e-3
    fit = fp.estimate(tanks(), data, start={"k1": 1.2, "k2": 0.75, "m": 0.5}, noise=NOISE)
    np.testing.assert_allclose(list(fit.estimate.values()), THETA, rtol=1e-5)


def of_one(f: list[str], **more: Any) -> Callable[..., fp.Trajectories]:
    states = {name: "1" for name in ("x", "v")[: len(f)]}
    model = fp.SymbolicModel(f, ["x"], states, {"u": "1"}, {"a": "1", "k": "1"}, **more)

    def at(x0: list[float], u: float = 0.0, states: Any = None, theta: Any = (1.0, 1.0)) -> fp.Trajectories:
        return fp.simulate(model, fp.Runs([x0], [[0.3, 0.2]], 0.1, rest=fp.Rest({"u": u}, states=states)), theta)

    return at


@pytest.mark.parametrize(
    ("f", "x0", "u", "said"),
    [
        (["a*k + x**2 + u"], [1.0], 0.0, r"rest: expected an equilibrium of x, found none from x0 of runs\[0\]"),
        (["-a*x*v*k + 0*u", "a*x*v*k*(1 + x)"], [0.1, 1.0], 0.0, r"given rates that leave [xv] free in runs\[0\]: f_x is singular"),
        (["v - a*x + 0*u", "k*x - v"], [1.0, 1.0], 0.0, "leave (x, v|v, x) free"),  # kept for a = k alone
        (["a*k*u"], [1.0], 1.0, "found none"),
        (["v", "u*k - a*v"], [1.0, 0.0], 1.0, "found none"),
        (["v", "u - k*x - a*sign(v) - v"], [1.0, 0.0], 0.5, "on the jump v = 0 of .*: a whole range of states rests there, as"),
        (["v", "u - k*x - a*sign(v) - v"], [1.0, 0.2], 0.5, "on the jump v = 0"),
        (["u - k*x - a*sign(x)"], [0.3], 0.5, "on the jump x = 0"),
        (["a*k*x + u"], [0.1], 0.0, "at which the plant stays, found an unstable one"),
        (["u*a - k*x - max(x - 0.5, 0)"], [0.3], 0.5, "off kinks, given one on the kink"),
        (["(x - 1)*(x + 0.05)*a*k + 0*u"], [0.05], 0.0, "found none|found an unstable one"),
        (["1 + 0*u"], [0.3], 0.0, "rest.states: expected states whose rates may vanish, given 'x'"),
    ],
)  # fmt: skip
def test_what_has_no_rest_is_refused_by_name(f: list[str], x0: list[float], u: float, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        of_one(f, domain=["x"] if x0 == [0.05] else ())(x0, u)


def test_a_kink_that_stays_where_it_is_does_no_harm() -> None:
    done = of_one(["u - k*x - a*max(x, 0)"])([0.3])
    assert abs(done.x[0, 0, 0]) < 1e-15 and done.status.tolist() == [0]
    moving = of_one(["u - k*(x - a) - max(x - a, 0)"])([0.3])  # both stay together
    assert moving.x[0, 0, 0] == pytest.approx(1.0, abs=1e-12) and moving.status.tolist() == [0]


@pytest.mark.parametrize(("x0", "there"), [(0.9, 1.0), (-0.2, -1.0)])
def test_another_rest_is_told_and_the_start_decides(x0: float, there: float) -> None:
    with pytest.warns(UserWarning, match=rf"another one than that of runs\[0\]: x = {-there:g} instead of {there:g}"):
        done = of_one(["a*k*x - x**3 + u"])([x0])
    assert done.x[0, 0, 0] == pytest.approx(there, rel=1e-14)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        of_one(["a*k*x - x**3 + u"])([0.5], 1.0)  # the other one is outside: one real root
        of_one(["a*k*x - x**3 + u"], domain=["x"])([0.5])
        fp.simulate(tanks(), both(), THETA)


def test_far_guesses_go_the_way_of_the_plant() -> None:
    """Newton's method alone leaves the domain, or finds the unstable rest at zero."""
    assert of_one(["u - k*x*exp(a*x)"])([30.0], 1.0).x[0, 0, 0] == pytest.approx(0.567143290409784, rel=1e-13)
    with pytest.warns(UserWarning, match="another one"):
        assert of_one(["a*k*tanh(3*x) - x + u"])([0.1], 0.1).x[0, 0, 0] > 1
    stiff = of_one(["1e6*(v - x)", "u - k*v - a*sqrt(v)"])([5.0, 40.0], 2.0)
    np.testing.assert_allclose(stiff.x[0, 0], [1.0, 1.0], rtol=1e-13)


def test_a_model_without_equations_has_no_rest() -> None:
    model = fp.CallableModel(lambda x, u, p: [-p.a * x.x], lambda x, u, p: [x.x], {"x": "1"}, {"u": "1"}, {"a": "1"})
    with pytest.raises(TypeError, match="rest: expected a model with equations, given a CallableModel"):
        fp.simulate(model, fp.Runs([[1.0]], [[0.1]], 0.1, rest=fp.Rest({"u": 0.0})), [1.0])


def test_runs_keep_their_rests(tmp_path: Path) -> None:
    model, runs = tanks(), both()
    assert repr(runs) == "Runs(12 of up to 5 segments, 28 samples, 1 inputs, 9 from rest)"
    assert repr(drawn(REST["b"])).endswith("all from rest)") and "rest" not in repr(drawn(None))
    assert pickle.loads(pickle.dumps(runs)) == runs
    assert runs[3:5].rest == (REST["b"], REST["b"]) and runs[6:9].rest == (None, None, None)
    assert runs[:3] == drawn(REST["all"])
    assert drawn(REST["all"]) != drawn(None) and drawn(REST["all"]) != drawn(REST["b"])
    assert all(one.rest == (rest,) for one, rest in zip(runs, runs.rest, strict=True))
    runs.to_csv(tmp_path / "runs.csv", model)
    text = (tmp_path / "runs.csv").read_text().splitlines()
    assert text[0] == "run,segment,a,b,u,dt,measured,rest,rest_u"
    assert text[1].endswith(",all,0.6") and text[2].endswith(",,")
    assert fp.Runs.from_csv(tmp_path / "runs.csv", model) == runs
    assert np.array_equal(fp.simulate(model, runs, THETA).x, fp.simulate(model, fp.Runs.join(list(runs)), THETA).x)


def test_tables_tell_guesses_from_starts() -> None:
    def notes(runs: fp.Runs) -> list[str]:
        (starts,) = (one for one in runs_tables(tanks(), runs, 0) if one.title == "Starts")
        return list(starts.notes)

    assert notes(drawn(None)) == []
    assert notes(drawn(REST["b"])) == ["Guesses of b: each plant starts at its own rest."]
    assert notes(both())[0].startswith("Guesses of a, b:")


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ("1,1,1,1,0.5,0.1,1,a c,0.1\n", "row 1, column rest: expected 'all' or names of states, a, b; given 'c'"),
        ("1,1,1,1,0.5,0.1,1,a,\n", "row 1, column rest_u: expected the held input"),
        ("1,1,1,1,0.5,0.1,1,,0.3\n", "row 1, column rest_u: expected nothing where no run starts at rest"),
        ("1,1,1,1,0.5,0.1,1,a,0.2\n1,2,,,0.5,0.1,1,a,0.2\n", "row 2, column rest: expected nothing behind the first row"),
    ],
)
def test_files_that_are_none_are_refused(rows: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "runs.csv").write_text("run,segment,a,b,u,dt,measured,rest,rest_u\n" + rows)
    with pytest.raises(ValueError, match=said):
        fp.Runs.from_csv(tmp_path / "runs.csv", tanks())
    (tmp_path / "runs.csv").write_text("run,segment,a,b,u,dt,measured,rest\n1,1,1,1,0.5,0.1,1,a\n")
    with pytest.raises(ValueError, match="expected the column rest_u beside rest"):
        fp.Runs.from_csv(tmp_path / "runs.csv", tanks())


@pytest.mark.parametrize(
    ("rest", "error", "said"),
    [
        (fp.Rest({"u": 0.0}, states=["c"]), ValueError, "rest.states: expected names of states, a, b; given unknown 'c'"),
        (fp.Rest(), ValueError, "rest.u: expected a value for 'u', given none"),
        (fp.Rest({"w": 0.0}), ValueError, "rest.u: expected the names u; given unknown 'w'"),
        ([fp.Rest({"u": 0.0})], ValueError, "rest: expected one for each of 2 runs, given 1"),
        ("steady", TypeError, "rest: expected a sequence of Rests"),
        ([1, 2], TypeError, r"rest\[0\]: expected Rest, given int"),
    ],
)
def test_misuse_is_told(rest: Any, error: type[Exception], said: str) -> None:
    with pytest.raises(error, match=said):
        fp.simulate(tanks(), fp.Runs([[1.0, 1.0]] * 2, [[0.5, 0.2]] * 2, 0.1, rest=rest), THETA)
    with pytest.raises(ValueError, match=r"rest.states: expected names of states, each once, given none"):
        fp.Rest({"u": 0.0}, states=[])
