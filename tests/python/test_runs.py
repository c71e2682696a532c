"""Runs of several segments, against SciPy from segment to segment with central differences and dense algebra."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import fisherpoint as fp

pytestmark = pytest.mark.kernels

NOISE = {"y": 0.02, "z": 0.05}
THETA = np.array([1.3, 0.7, 0.4])


def mixer() -> fp.SymbolicModel:
    """Two tanks in a row with a valve that has a corner, and outputs that read the input."""
    return fp.SymbolicModel(
        f=["c * u - k1 * sqrt(a) - m * max(a - b, 0)", "k1 * sqrt(a) - k2 * sqrt(b) + m * max(a - b, 0)"],
        g=["b", "a + u * b"],
        states={"a": "m", "b": "m"},
        inputs={"u": "1"},
        outputs={"y": "m", "z": "m"},
        parameters={"k1": "1", "k2": "1", "m": "1"},
        constants={"c": (1.1, "1")},
    )


def rates(x: np.ndarray, u: float, theta: np.ndarray, c: float) -> list[float]:
    a, b = x
    k1, k2, m = theta
    over = m * max(a - b, 0.0)
    return [c * u - k1 * np.sqrt(a) - over, k1 * np.sqrt(a) - k2 * np.sqrt(b) + over]


def outputs(runs: fp.Runs, k: int, theta: np.ndarray, c: float = 1.1, off: np.ndarray | None = None) -> np.ndarray:
    """y (N, n_y) of run k by SciPy; steps end where a - b changes its sign."""
    x, found = runs.x0[k] + (0.0 if off is None else off), []
    for n in range(int(runs.segments[k])):
        u, t = float(runs.u[k, n, 0]), 0.0

        def corner(_: float, x: np.ndarray) -> float:
            return float(x[0] - x[1])

        corner.terminal = True  # type: ignore[attr-defined]
        while t < runs.dt[k, n]:
            done = solve_ivp(
                lambda _, x, u=u: rates(x, u, theta, c), (t, runs.dt[k, n]), x, "DOP853", events=corner, rtol=1e-12, atol=1e-13
            )
            t, x = float(done.t[-1]), done.y[:, -1]
            if done.status == 1:  # a little on, past the corner
                step = min(1e-9, runs.dt[k, n] - t)
                x, t = x + step * np.array(rates(x, u, theta, c)), t + step
        found.append([x[1], x[0] + u * x[1]])
    return np.array(found)


def slopes(runs: fp.Runs, k: int, by: str, h: float = 1e-3) -> np.ndarray:
    """dy (N, n_y, q) by theta, the constant c, or the start; extrapolated central differences."""

    def at(step: np.ndarray) -> np.ndarray:
        if by == "theta":
            return outputs(runs, k, THETA + step)
        return outputs(runs, k, THETA, 1.1 + step[0]) if by == "c" else outputs(runs, k, THETA, off=step)

    def difference(h: float) -> np.ndarray:
        units = np.eye({"theta": 3, "c": 1, "start": 2}[by])
        return np.stack([(at(h * e) - at(-h * e)) / (2 * h) for e in units], axis=-1)

    return np.asarray((4 * difference(h / 2) - difference(h)) / 3)


def drawn(count: int = 4, segments: int = 6, seed: int = 3) -> fp.Runs:
    rng = np.random.default_rng(seed)
    measured = rng.random((count, segments)) < 0.8
    measured[:, -1] = True
    return fp.Runs(
        rng.uniform(0.5, 1.5, (count, 2)),
        rng.choice([0.05, 2.0], (count, segments)),
        rng.uniform(0.1, 0.6, (count, segments)),
        measured,
    )


def test_states_and_sensitivities_are_those_of_scipy() -> None:
    model, runs = mixer(), drawn()
    crossed = 0
    done = fp.sensitivities(model, runs, THETA, rtol=1e-11)
    states = fp.simulate(model, runs, THETA, rtol=1e-11)
    for k in range(len(runs)):
        y, s = outputs(runs, k, THETA), slopes(runs, k, "theta")
        np.testing.assert_allclose(done.y[k], y, rtol=0, atol=1e-9)
        np.testing.assert_allclose(states.y[k], y, rtol=0, atol=1e-9)
        np.testing.assert_allclose(done.dy_dtheta[k], s, rtol=0, atol=1e-6 * np.abs(s).max(axis=(0, 1)).max())
        crossed += int((np.diff(np.sign(done.x[k, :, 0] - done.x[k, :, 1])) != 0).sum())
    assert (done.status == fp.Status.ok).all() and (done.reached == 6).all()
    assert crossed > 1


@pytest.mark.parametrize("uncertain", [None, {"c": 0.05}])
@pytest.mark.parametrize("start", [None, {"a": 0.1, "b": 0.02}])
def test_the_information_of_a_run_is_that_of_dense_algebra(
    uncertain: dict[str, float] | None, start: dict[str, float] | None
) -> None:
    runs, std = drawn(), np.array([0.1, 0.2, 0.1])
    problem = fp.DesignProblem(
        mixer(),
        fp.GaussianPrior(dict(zip(("k1", "k2", "m"), THETA, strict=True)), dict(zip(("k1", "k2", "m"), std, strict=True))),
        None,
        noise=NOISE,
        varies=uncertain,
        initial_state_std=start,
        rtol=1e-11,
    )
    total = np.zeros((3, 3))
    for k in range(len(runs)):
        at = runs.measured[k]
        j = slopes(runs, k, "theta")[at].reshape(-1, 3) * std
        r = np.kron(np.eye(at.sum()), np.diag(np.square(list(NOISE.values()))))
        if uncertain:
            g = slopes(runs, k, "c")[at].reshape(-1, 1) * 0.05
            r = r + g @ g.T
        if start:
            g = slopes(runs, k, "start")[at].reshape(-1, 2) * [0.1, 0.02]
            r = r + g @ g.T
        total += j.T @ np.linalg.solve(r, j)
    evaluation = fp.evaluate(problem, runs)
    np.testing.assert_allclose(evaluation.information, total, rtol=1e-6, atol=1e-6 * np.abs(total).max())
    samples = int(runs.measured.sum())
    assert evaluation.n_points == samples
    assert evaluation.log_det == pytest.approx(np.linalg.slogdet(2 / samples * total)[1], abs=1e-6)
    errors = np.sqrt(np.diag(np.linalg.inv(total))) * std
    np.testing.assert_allclose(list((evaluation.standard_errors or {}).values()), errors, rtol=1e-6)


@pytest.mark.parametrize("share", [1 - 1e-15, 1.0, 1 + 1e-15, 1 + 1e-9])
def test_a_sample_may_be_just_where_a_kink_is_crossed(share: float) -> None:
    """a = p t, and x' = q max(a - 1, 0): with the first sample at a = 1, the others behind; everything is known exactly."""
    model = fp.SymbolicModel(
        f=["p", "q*max(a - 1, 0)"], g=["a + x"], states=dict.fromkeys("ax", "1"), inputs={}, outputs={"y": "1"},
        parameters=dict.fromkeys("pq", "1"), constants={},
    )  # fmt: skip
    p, q, noise = 1.3, 0.7, 0.01
    ends = np.array([share / p, 1.2, 2.5])
    runs = fp.Runs(np.zeros((1, 2)), np.empty((1, 3, 0)), np.diff(ends, prepend=0.0)[None])
    prior = fp.GaussianPrior({"p": p, "q": q}, {"p": 0.1, "q": 0.2})
    over = np.maximum(p * ends - 1, 0.0)
    by_p, by_q = ends + q * (over * ends / p - over**2 / (2 * p**2)), over**2 / (2 * p)
    j = np.column_stack([0.1 * by_p, 0.2 * by_q]) / noise
    evaluation = fp.evaluate(fp.DesignProblem(model, prior, None, noise={"y": noise}, rtol=1e-9), runs)
    np.testing.assert_allclose(evaluation.information, j.T @ j, rtol=1e-6)


def test_a_run_of_one_segment_is_a_point_to_the_last_bit() -> None:
    model, rng = fp.HydraulicCylinder(), np.random.default_rng(0)
    lower, upper = np.array([[0.1, -0.1, 5e6, 5e6, -0.3], [0.2, 0.1, 10e6, 10e6, 0.3]])
    points = fp.Experiments(rng.uniform(lower, upper, (40, 5)), rng.uniform(-1, 1, (40, 1)), rng.uniform(1e-3, 1e-2, 40))
    runs = fp.Runs.of_points(points)
    a, b = fp.sensitivities(model, points, model.nominal), fp.sensitivities(model, runs, model.nominal)
    for of_point, of_run in (
        (a.x, b.x[:, 1]),
        (a.y, b.y[:, 0]),
        (a.dx_dtheta, b.dx_dtheta[:, 0]),
        (a.dy_dtheta, b.dy_dtheta[:, 0]),
    ):
        assert np.array_equal(of_point, of_run)
    assert np.array_equal(a.status, b.status)
    c, d = fp.simulate(model, points, model.nominal), fp.simulate(model, runs, model.nominal)
    assert np.array_equal(c.x, d.x[:, 1]) and np.array_equal(c.y, d.y[:, 0])
    fine = a.status == fp.Status.ok
    std = {name: 0.1 * value for name, value in model.nominal.items()}
    noise = {"q": 1e-4, "p_A": 2e4, "p_B": 2e4, "x_v": 1e-2}
    problem = fp.DesignProblem(model, fp.GaussianPrior(dict(model.nominal), std), None, noise=noise)
    one, other = fp.evaluate(problem, points[fine]), fp.evaluate(problem, runs[fine])
    assert np.array_equal(one.fisher, other.fisher) and one.log_det == other.log_det
    assert one.standard_errors == other.standard_errors and one.nearby == other.nearby


def test_nothing_of_a_run_depends_on_others_and_threads() -> None:
    model, rng = fp.HydraulicCylinder(), np.random.default_rng(0)
    count, segments = 70, 12
    x0 = np.tile([0.15, 0.05, 8e6, 10e6, 0.1], (count, 1))
    u = rng.uniform(-0.3, 0.3, (count, 1)) + rng.uniform(-0.2, 0.2, (count, segments))
    runs = fp.Runs(x0, u, 5e-3)
    once = fp.sensitivities(model, runs, model.nominal, threads=1)
    assert (once.status == fp.Status.ok).sum() > 40
    for threads in (2, 5):
        again = fp.sensitivities(model, runs, model.nominal, threads=threads)
        assert all(np.array_equal(a, b) for a, b in zip(once, again, strict=True))
    order = rng.permutation(count)
    other = fp.sensitivities(model, runs[order], model.nominal)
    assert all(np.array_equal(a[order], b) for a, b in zip(once, other, strict=True))


def test_runs_of_different_lengths_stay_what_they_are() -> None:
    model, runs = mixer(), drawn()
    both = fp.Runs.join([runs, fp.Runs([[1.0, 1.0]], [[0.5, 1.5]], 0.3)])
    assert both.segments.tolist() == [6, 6, 6, 6, 2]
    done, alone = fp.sensitivities(model, both, THETA), fp.sensitivities(model, runs, THETA)
    assert done.reached.tolist() == [6, 6, 6, 6, 2]
    assert np.array_equal(done.dy_dtheta[:4], alone.dy_dtheta)
    assert (done.dy_dtheta[4, 2:] == 0).all() and np.array_equal(done.x[4, 2], done.x[4, 5])
    short = fp.simulate(model, fp.Runs([[1.0, 1.0]], [[0.5, 1.5]], 0.3), THETA)
    assert np.array_equal(fp.simulate(model, both, THETA).x[4, :3], short.x[0])


def test_a_failure_ends_its_run_alone() -> None:
    model = mixer()
    runs = fp.Runs([[1.0, 1.0], [1.0, 1.0]], [[1.0, 1.0, 1.0], [1.0, -3.0, 1.0]], 0.4)
    for done in (fp.simulate(model, runs, THETA), fp.sensitivities(model, runs, THETA)):
        assert done.status.tolist() == [fp.Status.ok, fp.Status.left_domain]
        assert done.reached.tolist() == [3, 1]
        assert (done.y[1, 2] == 0).all()


def test_python_functions_run_too() -> None:
    def f(x: Any, u: Any, p: Any) -> list[Any]:
        return [u.u - p.p * x.a, p.p * x.a - p.q * x.b]

    def g(x: Any, u: Any, p: Any) -> list[Any]:
        return [x.b + u.u]

    slow = fp.CallableModel(
        f, g, states={"a": "1", "b": "1"}, inputs={"u": "1"}, outputs={"y": "1"}, parameters={"p": "1", "q": "1"}
    )
    quick = fp.SymbolicModel(["u - p * a", "p * a - q * b"], ["b + u"], {"a": "1", "b": "1"}, {"u": "1"}, {"p": "1", "q": "1"})
    runs = drawn(3)
    runs = fp.Runs.join([runs, fp.Runs([[1.0, 1.0]], [[0.5, 1.5]], 0.3)])
    with pytest.warns(UserWarning, match="a thousand times faster"):
        a = fp.sensitivities(slow, runs, [1.0, 0.5], rtol=1e-10)
    b = fp.sensitivities(quick, runs, [1.0, 0.5], rtol=1e-10)
    for one, other in zip(a, b, strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-7)


def test_files_keep_runs(tmp_path: Path) -> None:
    model = mixer()
    runs = fp.Runs.join([drawn(), fp.Runs([[1.0, 1.0]], [[0.5, 1.5]], 0.3, [[False, True]])])
    runs.to_csv(tmp_path / "runs.csv", model)
    text = (tmp_path / "runs.csv").read_text().splitlines()
    assert text[0] == "run,segment,a,b,u,dt,measured" and text[-1].split(",")[:4] == ["5", "2", "", ""]
    assert fp.Runs.from_csv(tmp_path / "runs.csv", model) == runs


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ("1,1,1,1,0.5,0.1,1\n1,3,,,0.5,0.1,1\n", "row 2, column segment: expected the segments of a run in order"),
        ("1,1,1,1,0.5,0.1,1\n3,1,1,1,0.5,0.1,1\n", "row 2, column run: expected runs in order"),
        ("1,1,1,,0.5,0.1,1\n", "row 1, column b: expected the start in the first row"),
        ("1,1,1,1,0.5,0.1,1\n1,2,1,,0.5,0.1,1\n", "row 2, column a: expected nothing behind the first row"),
        ("1,1,1,1,0.5,0,1\n", "row 1, column dt: expected a positive duration"),
        ("1,1,1,1,0.5,0.1,2\n", "row 1, column measured: expected 1 or 0"),
        ("1,1,1,1,0.5,0.1,0\n", r"runs\[0\]"),
        ("1,1,1,1,0.5,0.1\n", "row 1: expected 7 entries, given 6"),
    ],
)
def test_files_that_are_none_are_refused(rows: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "runs.csv").write_text("run,segment,a,b,u,dt,measured\n" + rows)
    with pytest.raises(ValueError, match=said):
        fp.Runs.from_csv(tmp_path / "runs.csv", mixer())


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"measured": [[False, False]]}, r"at least one measured segment in each, given none in runs\[0\]"),
        ({"u": np.zeros((1, 0))}, "at least one segment, given none"),
        ({"dt": [[0.1, -0.1]]}, r"no negative ones, given -0.1 in segment 1 of runs\[0\]"),
        ({"dt": [[0.0, 0.1]]}, "none of zero before others"),
        ({"dt": [[0.1, 0.1, 0.1]]}, r"dt: expected shape \(1, 2\), given \(1, 3\)"),
        ({"measured": [[1, 0]]}, "measured: expected flags"),
        ({"x0": [1.0]}, r"x0: expected shape \(K, n_x\)"),
    ],
)
def test_misuse_is_told(given: dict[str, object], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        fp.Runs(**{"x0": [[1.0, 1.0]], "u": [[1.0, 1.0]], "dt": 0.1, **given})  # type: ignore[arg-type]
