"""Stiff models: implicit steps where explicit ones would be limited by stability."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import fisherpoint as fp
from bench.stiff_cases import CASES, reference

Method = Literal["Radau"] | None
METHODS: tuple[Method, ...] = (None, "Radau")


@pytest.mark.kernels
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", CASES)
def test_ends_are_the_published_ones(name: str, method: Method) -> None:
    case = CASES[name]
    end = fp.simulate(case.model(), case.points(), case.theta, rtol=1e-8, method=method)
    assert end.status[0] == fp.Status.ok
    np.testing.assert_allclose(end.x[0], reference(name)[0], rtol=1e-6)
    if case.published:
        np.testing.assert_allclose(reference(name)[0], case.published, rtol=3e-9)
        np.testing.assert_allclose(end.x[0], case.published, rtol=1e-6)


@pytest.mark.kernels
@pytest.mark.parametrize(("rtol", "within"), [(1e-5, 1e-4), (1e-6, 1e-5), (1e-8, 1e-6)])
@pytest.mark.parametrize("name", CASES)
def test_sensitivities_are_those_of_scipy(name: str, rtol: float, within: float) -> None:
    case, (_, expected) = CASES[name], reference(name)
    found = fp.sensitivities(case.model(), case.points(), case.theta, rtol=rtol)
    assert found.status[0] == fp.Status.ok
    columns = np.abs(expected).max(axis=0)
    assert (np.abs(found.dx_dtheta[0] - expected) <= within * columns).all()


def test_outputs_alone_have_the_same_sensitivities() -> None:
    case = CASES["hires"]
    problem_points = case.points(3)
    both = fp.sensitivities(case.model(), problem_points, case.theta)
    np.testing.assert_array_equal(both.dy_dtheta, both.dx_dtheta)  # g = x


def test_explicit_methods_stay_explicit() -> None:
    case = CASES["robertson"]
    for method in ("DOP853", "RK45"):
        assert fp.simulate(case.model(), case.points(), case.theta, method=method).status[0] == fp.Status.step_limit


def test_neighbours_and_threads_change_no_bit() -> None:
    """Lanes that turn stiff at different times, beside some that never do."""
    case, rng = CASES["robertson"], np.random.default_rng(3)
    model, count = case.model(), 96
    theta = np.array(list(case.theta.values())) * 10.0 ** rng.uniform(-2, 1, (count, 3))
    points = fp.Experiments([case.x0] * count, [[]] * count, 10.0 ** rng.uniform(-4, 4, count))
    results = [fp.sensitivities(model, points, theta, threads=threads) for threads in (1, 2, 5)]
    assert not results[0].status.any()
    for name in ("status", "x", "dx_dtheta"):
        expected = getattr(results[0], name)
        for other in results[1:]:
            np.testing.assert_array_equal(getattr(other, name), expected)
    for k in range(count):
        alone = fp.sensitivities(model, points[[k]], theta[[k]])
        np.testing.assert_array_equal(alone.x[0], results[0].x[k])
        np.testing.assert_array_equal(alone.dx_dtheta[0], results[0].dx_dtheta[k])


@pytest.mark.long
def test_compiled_models_are_as_right() -> None:
    case = CASES["oregonator"]
    model, expected = case.model().compile(), reference("oregonator")
    found = fp.sensitivities(model, case.points(), case.theta, rtol=1e-8)
    np.testing.assert_allclose(found.x[0], expected[0], rtol=1e-6)
    assert (np.abs(found.dx_dtheta[0] - expected[1]) <= 1e-6 * np.abs(expected[1]).max(axis=0)).all()


# --- surfaces in a stiff stretch ----------------------------------------------------------------------------------------


FAST = 1e5


def follower(rate: str, **arguments: Any) -> fp.Model:
    """A clock c; x that follows it within 1/k; and y' = rate: x = c - (1 - exp(-k c)) / k."""
    return fp.SymbolicModel(
        f=["1", "k*(c - x)", rate],
        g=["y"],
        states={"c": "1", "x": "1", "y": "1"},
        inputs={},
        parameters={"p": "1", "k": "1"},
        **arguments,
    )


def follow(model: fp.Model, **arguments: Any) -> Any:
    points = fp.Experiments([[0.0, 0.0, 0.0]], [[]], [2.0])
    return fp.sensitivities(model, points, [3.0, FAST], rtol=1e-9, **arguments)


@pytest.mark.parametrize("method", METHODS)
def test_a_kink_is_crossed_by_an_implicit_step(method: Method) -> None:
    found = follow(follower("p*max(x - 0.5, 0)"), method=method)
    since = 1.5 - 1 / FAST  # x has been above 0.5
    np.testing.assert_allclose(found.x[0, 2], 1.5 * since**2, rtol=1e-8)
    np.testing.assert_allclose(found.dx_dtheta[0, 2], [since**2 / 2, 3.0 * since / FAST**2], rtol=1e-6)


@pytest.mark.parametrize("method", METHODS)
def test_a_jump_is_crossed_by_an_implicit_step(method: Method) -> None:
    found = follow(follower("p*heaviside(x - 0.5)"), jumps="cross", method=method)
    since = 1.5 - 1 / FAST
    np.testing.assert_allclose(found.x[0, 2], 3.0 * since, rtol=1e-8)
    np.testing.assert_allclose(found.dx_dtheta[0, 2], [since, 3.0 / FAST**2], rtol=1e-6)
    assert follow(follower("p*heaviside(x - 0.5)"), jumps="exclude", method=method).status[0] == fp.Status.met_jump


@pytest.mark.parametrize("method", METHODS)
def test_a_limit_ends_an_implicit_trajectory(method: Method) -> None:
    points = fp.Experiments([[0.0, 0.0, 0.0]] * 2, [[]] * 2, [0.4, 0.6])
    found = fp.simulate(follower("p*sqrt(0.5 - x)"), points, [3.0, FAST], rtol=1e-8, method=method)
    assert list(found.status) == [fp.Status.ok, fp.Status.left_domain]
    exact = 2.0 * ((0.5 + 1 / FAST) ** 1.5 - (0.1 + 1 / FAST) ** 1.5)  # but for the first layer, 2e-10
    np.testing.assert_allclose(found.x[0, 2], exact, rtol=1e-6)


@pytest.mark.parametrize("method", METHODS)
def test_a_pole_is_not_stepped_over(method: Method) -> None:
    points = fp.Experiments([[0.0, 0.0, 0.0]], [[]], [2.0])
    assert fp.simulate(follower("p/(x - 0.5)"), points, [3.0, FAST], method=method).status[0] == fp.Status.left_domain


def test_a_stiff_trajectory_slides_by_explicit_steps() -> None:
    """y' = -p sign(y - x) meets x from above and stays with it."""
    model = follower("-p*sign(y - x)")
    points = fp.Experiments([[0.0, 0.0, 0.2]], [[]], [1.0])
    found = fp.sensitivities(model, points, [3.0, 3e3], rtol=1e-8, jumps="cross")
    assert found.status[0] == fp.Status.ok
    np.testing.assert_allclose(found.x[0, 2], 1.0 - 1 / 3e3, rtol=1e-8)
    np.testing.assert_allclose(found.dx_dtheta[0, 2], [0.0, 1 / 3e3**2], atol=1e-6 / 3e3**2)


# --- what is built on trajectories --------------------------------------------------------------------------------------


def reactor() -> fp.Model:
    """An intermediate b that is consumed a hundred thousand times faster than it is made, with a feed u."""
    return fp.SymbolicModel(
        f=["u - k1*a", "k1*a - k2*b"],
        g=["a", "1e5*b"],
        states={"a": ("1", 1.0), "b": ("1", 1e-5)},
        inputs={"u": "1"},
        parameters={"k1": "1", "k2": "1"},
    )


def test_a_record_of_a_stiff_model() -> None:
    t, theta = np.linspace(0.0, 20.0, 41), [0.7, 1e5]
    u = np.where(t < 7.0, 1.0, 0.2)[:, None]
    states = fp.simulate_record(reactor(), t, u, theta, [0.0, 0.0], rtol=1e-8).x
    a, b, sizes = 0.0, 0.0, np.array([1.0, 1e-5])
    exact = [[a, b]]
    for n in range(40):
        k1, k2, feed = *theta, u[n, 0]
        solution = solve_ivp(
            lambda _, z, feed=feed, k1=k1, k2=k2: [feed - k1 * z[0], k1 * z[0] - k2 * z[1]],
            (t[n], t[n + 1]),
            [a, b],
            "Radau",
            rtol=1e-11,
            atol=1e-13 * sizes,
        )
        a, b = solution.y[:, -1]
        exact.append([a, b])
    np.testing.assert_allclose(states / sizes, exact / sizes, atol=3e-7)


def test_a_covariance_over_a_prior_is_that_of_its_nodes() -> None:
    model = reactor()
    prior = fp.GaussianPrior({"k1": 0.7, "k2": 1e5}, {"k1": 0.1, "k2": 2e4})
    points = fp.Experiments([[1.0, 0.0], [0.3, 0.0]], [[0.5], [1.0]], [10.0, 400.0])
    rule = fp.SparseGaussHermite(2)
    found = fp.predictive_covariance(model, points, prior, rule, rtol=1e-8)
    nodes, weights = rule.nodes(prior)
    for k in range(2):
        each = fp.simulate(model, points[[k] * len(nodes)], nodes, rtol=1e-10)
        deviation = each.y - fp.simulate(model, points[[k]], prior.mean, rtol=1e-10).y
        expected = np.einsum("n,ni,nj->ij", weights, deviation, deviation)
        size = np.sqrt(np.diag(expected))
        np.testing.assert_allclose(found.covariance[k] / np.outer(size, size), expected / np.outer(size, size), atol=1e-5)


@pytest.mark.filterwarnings("ignore:.*derivative.*:UserWarning")
def test_a_stiff_python_function_is_integrated_implicitly() -> None:
    model = fp.CallableModel(
        f=lambda x, u, p: [u.u - p.k1 * x.a, p.k1 * x.a - p.k2 * x.b],
        g=lambda x, u, p: [x.a, 1e5 * x.b],
        states={"a": ("1", 1.0), "b": ("1", 1e-5)},
        inputs={"u": "1"},
        parameters={"k1": "1", "k2": "1"},
        outputs={"a": "1", "b": "1"},
    )
    points, theta = fp.Experiments([[1.0, 0.0]], [[0.5]], [10.0]), [0.7, 1e5]
    assert fp.simulate(model, points, theta, method="DOP853").status[0] == fp.Status.step_limit
    found = fp.simulate(model, points, theta, rtol=1e-6)
    assert found.status[0] == fp.Status.ok
    np.testing.assert_allclose(found.y, fp.simulate(reactor(), points, theta, rtol=1e-10).y, rtol=1e-6)
