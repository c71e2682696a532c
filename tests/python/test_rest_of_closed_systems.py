"""Closed systems at rest: the totals of the guess are kept, against rates and totals written down by hand."""

import warnings
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import pytest

import fisherpoint as fp


class Case(NamedTuple):
    """A model, its parameters, the guess and held inputs, and the totals that are kept as functions of states and parameters."""

    f: list[str]
    x0: dict[str, float]
    theta: dict[str, float]
    totals: Callable[..., list[float]]
    u: Mapping[str, float] = MappingProxyType({})

    def model(self, outputs: list[str] | None = None) -> fp.SymbolicModel:
        given = {kind: dict.fromkeys(of, "1") for kind, of in (("states", self.x0), ("inputs", self.u), ("parameters", self.theta))}
        return fp.SymbolicModel(self.f, outputs or list(self.x0), **given, check_units=False)

    def runs(self, **more: Any) -> fp.Runs:
        u = np.tile(list(self.u.values()), (1, 2, 1))
        return fp.Runs([list(self.x0.values())], u, 1.0, rest=fp.Rest(self.u, **more))

    def settled(self, theta: Any, x0: Any = None) -> np.ndarray:
        """Where rates vanish and the totals are those of x0, by Newton's method with differences."""
        model, start = self.model(), np.array(list(self.x0.values()) if x0 is None else x0)
        u, size = np.array(list(self.u.values())), np.abs(start).max()
        rates = np.abs(np.ravel(model.rhs(start + 0.1 * size, u, theta))) + 1e-3 * size

        def left(x: np.ndarray) -> np.ndarray:
            totals = np.subtract(self.totals(theta, *x), self.totals(theta, *start))
            return np.concatenate([np.ravel(model.rhs(x, u, theta)) / rates, totals / size])

        x = start
        for _ in range(30):
            columns = [(left(x + h) - left(x - h)) / (2e-4 * size) for h in 1e-4 * size * np.eye(len(x))]
            x = x - np.linalg.lstsq(np.transpose(columns), left(x), rcond=1e-14)[0]
        return x


CASES = {
    "two states": Case(["-k1*a + k2*b", "k1*a - k2*b"], {"a": 1.0, "b": 0.0}, {"k1": 1.0, "k2": 0.5}, lambda _, a, b: [a + b]),
    "volumes of compartments": Case(
        ["q*(c2 - c1)/V1", "(q*(c1 - c2) + r*(c3 - c2))/V2", "r*(c2 - c3)/V3"],
        {"c1": 1.0, "c2": 0.0, "c3": 0.2},
        {"q": 1.0, "r": 0.5, "V1": 1.3, "V2": 0.7, "V3": 2.0},
        lambda theta, *c: [np.dot(theta[2:], c)],
    ),
    "A + B <-> C": Case(
        ["-k*a*b + m*c", "-k*a*b + m*c", "k*a*b - m*c"],
        {"a": 1.0, "b": 0.6, "c": 0.0},
        {"k": 3.0, "m": 0.5},
        lambda _, a, b, c: [a + c, b + c],
    ),
    "two totals and a state that is driven": Case(
        ["-k1*a + k2*b", "k1*a - k2*b", "-k2*c + k1*d", "k2*c - k1*d", "u - k1*e + a*c"],
        {"a": 1.0, "b": 0.6, "c": 0.3, "d": 2.0, "e": 0.0},
        {"k1": 3.0, "k2": 0.5},
        lambda _, a, b, c, d, e: [a + b, c + d],
        {"u": 0.5},
    ),
    "fast and slow": Case(
        ["1e6*(k2*b - k1*a)", "1e6*(k1*a - k2*b) + 1e-3*(k3*c - k1*b)", "1e-3*(k1*b - k3*c)"],
        {"a": 1.0, "b": 0.6, "c": 0.3},
        {"k1": 3.0, "k2": 0.5, "k3": 0.7},
        lambda _, a, b, c: [a + b + c],
    ),
    "a pump between tanks": Case(
        ["k*sqrt(i) - u*w", "u*w - k*sqrt(i)", "m*(0.5 - w)"],
        {"h": 1.0, "i": 0.4, "w": 0.3},
        {"k": 0.3, "m": 1.0},
        lambda _, h, i, w: [h + i],
        {"u": 0.3},
    ),
    "a sink, and a state that stays": Case(
        ["-(k0 + k1)*a/V", "u*0.1", "k0*a - k2*c", "k1*a + k2*c"],
        {"a": 0.3, "b": 0.3, "c": 1.0, "d": 0.0},
        {"k0": 1.5, "k1": 4.0, "k2": 0.26, "V": 1.7},
        lambda theta, a, b, c, d: [theta[3] * a + c + d, b],
        {"u": 0.0},
    ),
    "an integrator without input": Case(
        ["v", "u - k*v"], {"x": 0.3, "v": 0.2}, {"k": 2.0}, lambda theta, x, v: [theta[0] * x + v], {"u": 0.0}
    ),
    "a dimer of little substance": Case(
        ["2*m*b - 2*k*a*a", "k*a*a - m*b"], {"a": 1e-3, "b": 0.0}, {"k": 3.0, "m": 0.05}, lambda _, a, b: [a + 2 * b]
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_a_closed_system_rests_where_it_settles(name: str) -> None:
    case = CASES[name]
    theta = np.array(list(case.theta.values()))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of natural sizes
        done = fp.sensitivities(case.model(), case.runs(), theta, rtol=1e-10)
    assert done.statuses == (fp.Status.ok,)
    rest, size = case.settled(theta), np.abs(list(case.x0.values())).max()
    np.testing.assert_allclose(done.x[0, 0], rest, rtol=0, atol=1e-9 * size)
    slope = np.empty((len(rest), len(theta)))
    for j, step in enumerate(np.diag(1e-3 * theta)):
        near, far = (case.settled(theta + h * step) - case.settled(theta - h * step) for h in (1, 2))
        slope[:, j] = (8 * near - far) / 12 / step[j]
    np.testing.assert_allclose(done.dy_dtheta[0, 0] * theta, slope * theta, rtol=0, atol=1e-7 * size)
    np.testing.assert_allclose(done.dy_dtheta[0, 1] * theta, slope * theta, rtol=0, atol=1e-7 * size)  # stays


def test_the_rest_depends_on_the_totals_of_the_guess_alone() -> None:
    case = CASES["A + B <-> C"]
    one, other = (fp.Runs([x0], np.empty((1, 2, 0)), 1.0, rest=fp.Rest()) for x0 in ([1.0, 0.6, 0.0], [0.55, 0.15, 0.45]))
    starts = [fp.simulate(case.model(), runs, case.theta).x[0, 0] for runs in (one, other)]
    np.testing.assert_allclose(*starts, rtol=1e-13)


def test_a_total_may_be_an_output_that_tells_nothing() -> None:
    case = CASES["two states"]
    done = fp.sensitivities(case.model(["a + b", "a"]), case.runs(), case.theta)
    np.testing.assert_allclose(done.y[0, :, 0], 1.0, rtol=1e-15)
    np.testing.assert_allclose(done.dy_dtheta[0, :, 0], 0.0, atol=1e-15)
    assert np.abs(done.dy_dtheta[0, :, 1]).min() > 0.1


@pytest.mark.parametrize("name", ["two states", "volumes of compartments", "A + B <-> C", "two totals and a state that is driven"])
def test_what_start_deviates_by_moves_the_total(name: str) -> None:
    """A state that is no part of a total starts beside its rest; what is beside the rest of a total is only another rest."""
    case = CASES[name]
    theta, x0, states = np.array(list(case.theta.values())), np.array(list(case.x0.values())), list(case.x0)
    free, p = case.model().free_start(*states), len(case.theta)
    deviation = 0.05 * np.arange(1, len(states) + 1)
    part = np.array([name != "e" for name in states])
    expected = case.settled(theta, x0 + part * deviation) + ~part * deviation
    whole = [*theta, *deviation]
    done = fp.sensitivities(free, case.runs(), whole, rtol=1e-11)
    np.testing.assert_allclose(done.x[0, 0] + deviation, expected, atol=1e-9)
    slope = np.empty((len(states), len(states)))
    for j, step in enumerate(np.diag(np.full(len(states), 1e-3))):
        ends = [case.settled(theta, x0 + part * (deviation + h * step)) + ~part * (deviation + h * step) for h in (1, -1, 2, -2)]
        slope[:, j] = (8 * (ends[0] - ends[1]) - (ends[2] - ends[3])) / 12e-3
    start = done.dx_dtheta[0, 0, :, p:]
    later = fp.sensitivities(free, fp.Runs(case.runs().x0, case.runs().u, 1e-9, rest=case.runs().rest[0]), whole, rtol=1e-11)
    np.testing.assert_allclose(later.dy_dtheta[0, 0, :, p:], slope, atol=1e-7)
    assert start.shape == slope.shape


def test_uncertain_starts_of_a_closed_system_are_uncertain_totals() -> None:
    """Both in the covariance that a design is judged by, and on a virtual rig."""
    case = CASES["two states"]
    model, noise = case.model(["a"]), 0.01
    prior = fp.GaussianPrior(case.theta, std={"k1": 0.1, "k2": 0.1})
    given = {"noise": {"y": noise}, "output_covariance": "noise", "initial_state_std": {"a": 0.1, "b": 0.2}}
    evaluation = fp.evaluate(fp.DesignProblem(model, prior, None, **given), case.runs())
    moved = np.full((2, 1), 1 / 3) * [0.1, 0.2]  # a rests at a third of the total
    covariance = noise**2 * np.eye(2) + moved @ moved.T
    slope = 0.1 * np.array([[-0.5 / 2.25, 1 / 2.25]] * 2)
    np.testing.assert_allclose(evaluation.information, slope.T @ np.linalg.solve(covariance, slope), rtol=1e-6)
    many = case.runs()[np.zeros(4000, dtype=int)]
    rig = fp.VirtualRig(model, case.theta, {"y": 0.0}, initial_state_std={"a": 0.1, "b": 0.2}, rtol=1e-8)
    y = rig.measure(many).y[:, :, 0]
    np.testing.assert_allclose(y[:, 0], y[:, 1], atol=1e-6)  # it stays
    assert y.mean() == pytest.approx(1 / 3, abs=0.006) and y[:, 0].std() == pytest.approx(np.hypot(0.1, 0.2) / 3, rel=0.05)


def test_runs_side_by_side_keep_their_own_totals_to_the_last_bit() -> None:
    """Some closed under their held input, some not."""
    model = fp.SymbolicModel(
        ["u - k1*a + k2*b", "k1*a - k2*b - u*b"],
        ["a", "b"],
        {"a": "1", "b": "1"},
        {"u": "1"},
        {"k1": "1", "k2": "1"},
        check_units=False,
    )
    x0 = np.random.default_rng(0).uniform(0.1, 2.0, (9, 2))
    rests = [fp.Rest({"u": 0.5 * (k % 3)}) for k in range(9)]
    runs = fp.Runs(x0, np.full((9, 3), 0.2), 0.3, rest=rests)
    whole = fp.sensitivities(model, runs, [1.0, 0.5])
    np.testing.assert_allclose(whole.x[::3, 0].sum(axis=1), x0[::3].sum(axis=1), rtol=1e-14)
    for k in range(9):
        alone = fp.sensitivities(model, runs[[k]], [1.0, 0.5])
        assert all(np.array_equal(a[0], b[k]) for a, b in zip(alone, whole, strict=True))


def test_estimates_and_designs_take_closed_systems_at_rest() -> None:
    case = CASES["A + B <-> C"]
    model = case.model(["c", "a"])
    runs = fp.Runs.join([fp.Runs([[a, 0.6, c]], np.empty((1, 2, 0)), 1.0, rest=fp.Rest()) for a, c in ((1.0, 0.0), (0.3, 0.1))])
    data = fp.VirtualRig(model, case.theta, {"y_1": 1e-4, "y_2": 1e-4}).measure(runs)
    fit = fp.estimate(model.fix(m=0.5), data, start={"k": 1.5}, noise={"y_1": 1e-4, "y_2": 1e-4})
    assert fit.estimate["k"] == pytest.approx(3.0, rel=1e-2) and fit.converged


@pytest.mark.parametrize(
    ("f", "said"),
    [
        (["-a*x*v*k", "a*x*v*k*(1 + x)"], "leave [xv] free"),  # v + x + x**2/2 is kept
        (["v - a*x", "k*x - v"], "leave .*x.* free"),  # kept at a = k alone
    ],
)
def test_what_is_no_total_of_all_parameters_is_still_refused(f: list[str], said: str) -> None:
    model = fp.SymbolicModel(f, ["x"], {"x": "1", "v": "1"}, {}, {"a": "1", "k": "1"}, check_units=False)
    runs = fp.Runs([[0.1, 1.0]], np.empty((1, 2, 0)), 0.1, rest=fp.Rest())
    with pytest.raises(ValueError, match=said):
        fp.simulate(model, runs, [1.0, 1.0])
