"""How trajectories end: every reason is met, named and counted, and numerical trouble never reaches an array."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import fisherpoint as fp
from conftest import REGION, random_points
from defaults import MODEL, NAMES, PRIOR, SMALL, grid, point, problem
from fisherpoint.information.candidates import CandidateSource

pytestmark = pytest.mark.kernels

Status = fp.Status
HUGE = {
    "q": (-1e6, 1e6),
    "v": (-1e9, 1e9),
    "p_A": (-1e15, 1e15),
    "p_B": (-1e15, 1e15),
    "x_v": (-1e12, 1e12),
    "u": (-1e15, 1e15),
    "dt": (1e-15, 1e9),
}
INSIDE_THE_DOMAIN = HUGE | {"q": (0.0, 0.3), "p_A": (0.6e6, 20.9e6), "p_B": (0.6e6, 20.9e6)}
LONG = REGION | {"v": (-5.0, 5.0), "x_v": (-3.0, 3.0), "u": (-3.0, 3.0), "dt": (1e-9, 1.0)}


def status_of(points: fp.Experiments, **arguments: Any) -> Status:
    return Status(int(fp.simulate(MODEL, points, MODEL.nominal, **arguments).status[0]))


# --- starts -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("surface", ["v", "x_v"])
@pytest.mark.parametrize("zero", [0.0, -0.0])
def test_a_start_on_a_switching_surface_is_refused_by_name(surface: str, zero: float) -> None:
    bad = point(**{surface: zero})
    good = point()
    table = np.vstack([good.table, bad.table, good.table, bad.table])
    points = fp.Experiments(table[:, :5], table[:, 5:6], table[:, 6])
    message = rf"surface {surface} = 0.*given {surface} = 0 in points.1., points.3."
    strict: dict[str, Any] = {"kinks": "exclude", "jumps": "exclude"}
    with pytest.raises(ValueError, match=message):
        fp.simulate(MODEL, points, MODEL.nominal, **strict)
    with pytest.raises(ValueError, match=message):
        fp.sensitivities(MODEL, points, MODEL.nominal, **strict)
    with pytest.raises(ValueError, match=message):
        fp.predictive_covariance(MODEL, points, PRIOR, SMALL, **strict)
    with pytest.raises(ValueError, match=message):
        fp.evaluate(problem(**strict), points)
    assert not fp.sensitivities(MODEL, points, MODEL.nominal).status.any()


@pytest.mark.parametrize("tiny", [1e-300, -1e-300, 1e-20, -1e-20, 1e-12, -1e-12])
@pytest.mark.parametrize("u", [-0.3, 0.3])
def test_a_start_next_to_a_switching_surface_is_a_point(tiny: float, u: float) -> None:
    result = fp.sensitivities(MODEL, point(x_v=tiny, u=u), MODEL.nominal)  # moves away or crosses at once
    assert result.status[0] == Status.ok
    assert fp.simulate(MODEL, point(x_v=tiny, u=u), MODEL.nominal).status[0] == Status.ok
    on_the_other_side = fp.sensitivities(MODEL, point(x_v=-tiny, u=u), MODEL.nominal)
    np.testing.assert_allclose(result.dx_dtheta, on_the_other_side.dx_dtheta, rtol=1e-5, atol=1e-30)  # rtol of the run, x 10
    # At v = 0 the acceleration decides: p_A A_A - p_B A_B is positive here.
    expected = Status.ok if tiny > 0 else Status.met_jump
    assert fp.simulate(MODEL, point(v=tiny), MODEL.nominal, jumps="exclude").status[0] == expected
    assert fp.simulate(MODEL, point(v=tiny), MODEL.nominal).status[0] == Status.ok


@pytest.mark.parametrize("chamber", ["p_A", "p_B"])
@pytest.mark.parametrize("pressure", [21e6, 25e6, 0.5e6, 0.1e6, 0.0, -1e6, 1e300])
def test_a_start_at_or_past_tank_or_supply_pressure_is_outside_the_domain(chamber: str, pressure: float) -> None:
    points = point(**{chamber: pressure})
    simulated = fp.simulate(MODEL, points, MODEL.nominal)
    assert simulated.status[0] == Status.left_domain
    assert fp.sensitivities(MODEL, points, MODEL.nominal).status[0] == Status.left_domain
    assert fp.predictive_covariance(MODEL, points, PRIOR, SMALL).status[0] == Status.left_domain
    np.testing.assert_array_equal(simulated.x, points.x0)  # the last state that was reached


def test_a_start_past_the_end_of_the_stroke_is_outside_the_domain() -> None:
    assert status_of(point(q=-0.1)) == Status.left_domain  # V_A = A_A (q - q_min) + V_0A < 0
    assert status_of(point(q=0.4)) == Status.left_domain  # V_B < 0


# --- on the way ---------------------------------------------------------------------------------------------------------

LEAVING = {
    "p_A reaches p_s": point(v=-0.25, p_A=20.6e6, p_B=18e6, x_v=0.8, u=-0.8, dt=2e-3),
    "p_B reaches p_s": point(v=0.25, p_B=20.6e6, p_A=18e6, x_v=-0.8, u=0.8, dt=2e-3),
    "p_A falls to p_t": point(v=0.25, p_A=0.8e6, p_B=3e6, x_v=-0.8, u=0.8, dt=2e-3),
    "p_B falls to p_t": point(v=-0.25, p_B=0.8e6, p_A=3e6, x_v=0.8, u=-0.8, dt=2e-3),
}


@pytest.mark.parametrize("which", LEAVING)
def test_a_pressure_that_reaches_a_limit_leaves_the_domain(which: str) -> None:
    points = LEAVING[which]
    result = fp.simulate(MODEL, points, MODEL.nominal)
    assert result.status[0] == Status.left_domain
    assert fp.sensitivities(MODEL, points, MODEL.nominal).status[0] == Status.left_domain
    assert fp.predictive_covariance(MODEL, points, PRIOR, SMALL).status[0] == Status.left_domain
    p_t = MODEL.nominal["p_t"]
    assert np.all((result.x[0, 2:4] > p_t) & (result.x[0, 2:4] < 21e6))
    pressure, limit = which.split()[0], which.split()[-1]
    difference = f"p_s - {pressure}" if limit == "p_s" else f"{pressure} - p_t"
    with pytest.raises(ValueError, match=rf"points\[0\] \(left_domain: {difference} > 0\)"):
        fp.evaluate(problem(), points)


def test_a_node_may_leave_the_domain_where_the_mean_does_not() -> None:
    points = point(p_A=0.6e6, v=-0.2, p_B=3e6, dt=1e-4)  # p_t is 0.5e6 at the mean and 0.65e6 at its upper node
    assert status_of(points) == Status.ok
    result = fp.predictive_covariance(MODEL, points, PRIOR, grid(p_t=3))
    assert result.status[0] == Status.left_domain
    np.testing.assert_array_equal(result.covariance, 0.0)
    assert fp.predictive_covariance(MODEL, points, PRIOR, grid(E_oil=3)).status[0] == Status.ok


def velocity_ends_at(points: fp.Experiments, theta: NDArray[Any]) -> float | None:
    """Time of the first zero of v by an independent integrator, None where there is none."""

    def crossing(_t: float, x: NDArray[Any]) -> float:
        return float(x[1])

    crossing.terminal = True  # type: ignore[attr-defined]
    solution = solve_ivp(
        lambda _t, x: MODEL.rhs(x, points.u[0], theta),
        (0.0, points.dt[0]),
        points.x0[0],
        events=crossing,
        rtol=1e-9,
        atol=[1e-12, 1e-10, 1.0, 1.0, 1e-10],
    )
    return float(solution.t_events[0][0]) if len(solution.t_events[0]) else None


def test_nodes_whose_velocity_crosses_zero_exclude_a_point_that_is_fine_at_the_mean() -> None:
    drawn = random_points(np.random.default_rng(1), 1000, REGION | {"v": (-0.1, 0.1), "dt": (5e-4, 3e-3)})
    rule = grid(a_tau=3, b_tau=3, m_q=3, E_oil=3)
    theta, _ = rule.nodes(PRIOR)
    nominal = fp.simulate(MODEL, drawn, MODEL.nominal, jumps="exclude").status
    whole = fp.predictive_covariance(MODEL, drawn, PRIOR, rule, jumps="exclude").status
    hidden = np.flatnonzero((nominal == Status.ok) & (whole == Status.met_jump))
    assert len(hidden) >= 5
    for k in hidden[:5]:
        at_nodes = fp.simulate(MODEL, drawn[np.full(len(theta), k)], theta, jumps="exclude").status
        first = int(np.flatnonzero(at_nodes)[0])
        assert at_nodes[first] == Status.met_jump
        assert velocity_ends_at(drawn[int(k)], theta[first]) is not None
        assert velocity_ends_at(drawn[int(k)], np.array(list(MODEL.nominal.values()))) is None


@pytest.mark.parametrize("jumps", ["cross", "exclude"])
def test_the_grid_accepts_a_point_exactly_where_every_node_is_ok(jumps: str) -> None:
    drawn = random_points(np.random.default_rng(2), 150)
    rule = grid(a_tau=3, E_oil=3, p_t=2)
    theta, _ = rule.nodes(PRIOR)
    whole = fp.predictive_covariance(MODEL, drawn, PRIOR, rule, jumps=jumps)
    nominal = fp.simulate(MODEL, drawn, MODEL.nominal, jumps=jumps).status
    nodes = np.array([fp.simulate(MODEL, drawn[np.full(len(theta), k)], theta, jumps=jumps).status for k in range(len(drawn))])
    first = np.array([row[row != 0][0] if row.any() else 0 for row in nodes])
    np.testing.assert_array_equal(whole.status, np.where(nominal != 0, nominal, first))
    assert set(whole.status) >= {Status.ok, Status.left_domain} and (Status.met_jump in whole.status) == (jumps == "exclude")
    np.testing.assert_array_equal(whole.covariance[whole.status != 0], 0.0)


def without_coulomb_friction() -> dict[str, float]:
    """Friction that does not jump, so that the trajectory past v = 0 is known; v = 0 counts as a jump all the same."""
    return dict(MODEL.nominal) | {"a_tau": 0.0}


def swing(v: float) -> tuple[fp.Experiments, float, float]:
    """A point whose velocity falls and comes back within dt, with its least and its last velocity."""
    points = point(v=v, p_A=6e6, p_B=15e6, x_v=0.2, u=-0.2, dt=12e-3)
    theta = np.array(list(without_coulomb_friction().values()))
    solution = solve_ivp(
        lambda _t, x: MODEL.rhs(x, points.u[0], theta),
        (0.0, points.dt[0]),
        points.x0[0],
        method="DOP853",
        rtol=1e-10,
        atol=1e-10,
        dense_output=True,
    )
    velocity = solution.sol(np.linspace(0.0, points.dt[0], 4001))[1]
    return points, float(velocity.min()), float(velocity[-1])


@pytest.mark.parametrize("rtol", [1e-3, 1e-4, 1e-6])
@pytest.mark.parametrize("side", ["through", "short of"])
def test_a_velocity_that_dips_through_zero_and_comes_back_is_seen(rtol: float, side: str) -> None:
    # The dip is ten times as deep as the tolerance of v (rtol times 1 m/s), so that it is certain at that tolerance.
    wanted = -10 * rtol if side == "through" else 10 * rtol
    v = brentq(lambda v: swing(v)[1] - wanted, 0.15, 0.22, xtol=rtol)
    points, least, last = swing(v)
    assert abs(least - wanted) < 2 * rtol
    assert points.x0[0, 1] > 0.05 and last > 0.05  # positive at both ends: only the inside tells
    expected = Status.met_jump if side == "through" else Status.ok
    theta = without_coulomb_friction()
    assert fp.simulate(MODEL, points, theta, rtol=rtol, jumps="exclude").status[0] == expected
    assert fp.sensitivities(MODEL, points, theta, rtol=rtol, jumps="exclude").status[0] == expected


def test_a_crossing_at_the_very_end_is_decided_by_the_sign() -> None:
    drawn = random_points(np.random.default_rng(3), 40, REGION | {"v": (0.005, 0.02), "p_A": (2e6, 4e6), "p_B": (8e6, 15e6)})
    theta = np.array(list(MODEL.nominal.values()))
    checked = 0
    for k in range(len(drawn)):
        crossing = velocity_ends_at(drawn[k], theta)
        if crossing is None or crossing < 1e-5:
            continue
        for share, expected in ((0.999, Status.ok), (1.001, Status.met_jump)):
            points = fp.Experiments(drawn.x0[k : k + 1], drawn.u[k : k + 1], [crossing * share])
            assert fp.simulate(MODEL, points, theta, rtol=1e-9, jumps="exclude").status[0] == expected
            assert fp.sensitivities(MODEL, points, theta, rtol=1e-6, jumps="exclude").status[0] == expected
        checked += 1
    assert checked >= 10


# --- kinks --------------------------------------------------------------------------------------------------------------


def test_a_kink_is_crossed_or_excludes() -> None:
    crossing, staying = point(x_v=0.1, u=1.0, dt=1e-3), point(x_v=0.1, u=-1.0, dt=1e-3)  # k_u = -1: u > 0 closes
    for function in (fp.simulate, fp.sensitivities):
        assert function(MODEL, crossing, MODEL.nominal).status[0] == Status.ok
        assert function(MODEL, crossing, MODEL.nominal, kinks="exclude").status[0] == Status.met_kink
        assert function(MODEL, staying, MODEL.nominal, kinks="exclude").status[0] == Status.ok
    assert fp.predictive_covariance(MODEL, crossing, PRIOR, SMALL).status[0] == Status.ok
    excluded = fp.predictive_covariance(MODEL, crossing, PRIOR, SMALL, kinks="exclude")
    assert excluded.status[0] == Status.met_kink
    with pytest.raises(ValueError, match=r"met_kink.*kinks='exclude'"):
        fp.evaluate(problem(kinks="exclude"), crossing)


def test_kinks_are_excluded_exactly_where_the_valve_passes_its_centre() -> None:
    drawn = random_points(np.random.default_rng(4), 500)
    crossed = fp.simulate(MODEL, drawn, MODEL.nominal)
    excluded = fp.simulate(MODEL, drawn, MODEL.nominal, kinks="exclude").status
    ok = crossed.status == Status.ok
    target = -drawn.u[:, 0]  # x_v' = (k_u u - x_v) / T_1 is solved by hand
    end = target + (drawn.x0[:, 4] - target) * np.exp(-drawn.dt / 2.2e-3)
    passes = np.sign(end) != np.sign(drawn.x0[:, 4])
    np.testing.assert_array_equal(excluded[ok] == Status.met_kink, passes[ok])
    assert passes[ok].sum() > 20 and (~passes[ok]).sum() > 20


def test_a_design_without_kinks_has_none() -> None:
    design = fp.exchange(
        problem(kinks="exclude"), n_experiments=9, n_candidates=5, max_iterations=3, method=fp.ExchangeMethod(references=False)
    )
    assert design.rejected["met_kink"] > 0
    assert not fp.simulate(MODEL, design.points, MODEL.nominal, kinks="exclude").status.any()


# --- trouble ------------------------------------------------------------------------------------------------------------


def test_too_many_steps_are_a_status() -> None:
    stiff = fp.HydraulicCylinder(T_1=1e-9)  # explicit steps of about 3 T_1: ten million of them
    points = point(v=0.2, x_v=0.3, u=-0.3001, dt=5e-2)
    for work in (fp.simulate, fp.sensitivities):
        result = work(stiff, points, MODEL.nominal, method="DOP853")
        assert result.status[0] == Status.step_limit
        assert all(np.isfinite(array).all() for array in result)


def test_an_overflowing_right_hand_side_is_a_status() -> None:
    fast = fp.HydraulicCylinder(T_1=1e-300)
    points = point(u=-1e200)
    for result in (fp.simulate(fast, points, MODEL.nominal), fp.sensitivities(fast, points, MODEL.nominal)):
        assert result.status[0] == Status.not_finite
        assert all(np.isfinite(array).all() for array in result)


@pytest.mark.parametrize("jumps", ["cross", "exclude"])
@pytest.mark.parametrize("bounds", [HUGE, INSIDE_THE_DOMAIN, LONG], ids=["huge", "inside", "long"])
def test_no_nan_and_no_infinity_ever_leaves(bounds: dict[str, tuple[float, float]], jumps: str) -> None:
    points = random_points(np.random.default_rng(5), 5000, bounds)
    allowed = {int(status) for status in Status}
    simulated = fp.simulate(MODEL, points, MODEL.nominal, jumps=jumps)
    sensitive = fp.sensitivities(MODEL, points, MODEL.nominal, jumps=jumps)
    spread = fp.predictive_covariance(MODEL, points[:1000], PRIOR, grid(a_tau=2, B_v=2), jumps=jumps)
    for result in (simulated, sensitive, spread):
        assert all(np.isfinite(array).all() for array in result)
        assert set(result.status) <= allowed
    assert (simulated.status != Status.ok).any()
    ok = simulated.status == Status.ok
    if jumps == "exclude":  # no ok trajectory passed v = 0
        np.testing.assert_array_equal(np.sign(simulated.x[ok, 1]), np.sign(points.x0[ok, 1]))
    for chamber in (2, 3):
        assert np.all((simulated.x[ok, chamber] > 0.5e6) & (simulated.x[ok, chamber] < 21e6))
    np.testing.assert_array_equal(spread.covariance[spread.status != Status.ok], 0.0)


def test_no_nan_for_extreme_constants_and_parameters() -> None:
    rng = np.random.default_rng(6)
    points = random_points(rng, 40)
    for _ in range(25):
        constants = {"A_A": 10.0 ** rng.uniform(-12, 6), "A_B": 10.0 ** rng.uniform(-12, 6), "T_1": 10.0 ** rng.uniform(-9, 6)}
        theta = np.array(list(MODEL.nominal.values())) * 10.0 ** rng.uniform(-12, 12, (40, 9))
        theta[:, NAMES.index("p_t")] = rng.uniform(0, 1e6, 40)
        result = fp.sensitivities(fp.HydraulicCylinder(**constants), points, theta)
        assert all(np.isfinite(array).all() for array in result)


# --- counting -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("local", [0.0, 0.5])
@pytest.mark.parametrize(("kinks", "jumps"), [("cross", "cross"), ("cross", "exclude"), ("exclude", "exclude")])
def test_the_counts_of_a_design_are_those_of_its_draws(
    kinks: str, jumps: str, local: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[fp.Experiments] = []

    def record(name: str) -> None:
        original = getattr(fp.ExperimentRegion, name)

        def recorded(self: fp.ExperimentRegion, *arguments: Any, **options: Any) -> fp.Experiments:
            drawn.append(original(self, *arguments, **options))
            return drawn[-1]

        monkeypatch.setattr(fp.ExperimentRegion, name, recorded)

    record("draw")
    record("draw_near")
    sources: list[CandidateSource] = []
    original = CandidateSource.__init__
    monkeypatch.setattr(CandidateSource, "__init__", lambda self, *given: (sources.append(self), original(self, *given))[1])
    region = fp.ExperimentRegion(REGION | {"p_A": (0.5e6, 21e6)}, constraints=["p_A + p_B < 3e7", lambda x: abs(x["v"]) > 0.02])
    rule = grid(a_tau=3, p_t=3, E_oil=2)
    design = fp.exchange(
        problem(output_covariance="pooled", region=region, kinks=kinks, jumps=jumps, rule=rule),
        n_experiments=6,
        n_candidates=8,
        max_iterations=10,
        method=fp.ExchangeMethod(references=False, local=local),
    )
    (source,) = sources
    spare = set() if source._spare is None else {row.tobytes() for row in source._spare.points.table}
    expected: Counter[str] = Counter()
    for points in drawn:
        inside = (points.x0[:, 2] + points.x0[:, 3] < 3e7) & (np.abs(points.x0[:, 1]) > 0.02)
        expected["constraint"] += int((~inside).sum())
        nominal = fp.simulate(MODEL, points[inside], MODEL.nominal, kinks=kinks, jumps=jumps).status
        whole = fp.predictive_covariance(MODEL, points[inside], PRIOR, rule, kinks=kinks, jumps=jumps).status
        whole[[row.tobytes() in spare for row in points[inside].table]] = Status.ok  # drawn, but never asked for
        for status in np.where(nominal != 0, nominal, whole):
            expected[Status(int(status)).name] += 1
    accepted = expected.pop("ok")
    if local:  # of candidates near the points, only those that are worth it are tried on all nodes
        assert Counter(design.rejected) <= expected
        assert design.accepted > accepted
    else:
        assert dict(design.rejected) == dict(expected)
        assert design.accepted == accepted
    assert design.drawn == sum(map(len, drawn))
    assert design.drawn == design.accepted + sum(design.rejected.values())
    assert {"constraint", "left_domain"} <= set(design.rejected)
    assert ("met_jump" in design.rejected) == (jumps == "exclude")
    assert ("met_kink" in design.rejected) == (kinks == "exclude")
    assert [record.drawn for record in design.trace] == sorted(record.drawn for record in design.trace)
    assert design.trace[-1].drawn == design.drawn


def test_draws_on_a_surface_are_counted_by_its_name(monkeypatch: pytest.MonkeyPatch) -> None:
    original = fp.ExperimentRegion.draw

    def some_on_surfaces(self: fp.ExperimentRegion, *arguments: Any, **options: Any) -> fp.Experiments:
        points = original(self, *arguments, **options)
        x0 = points.x0.copy()
        x0[0, 1], x0[1, 4] = 0.0, 0.0
        x0[2, [1, 4]] = 0.0  # on both: counted once
        return fp.Experiments(x0, points.u, points.dt, columns=points.columns)

    monkeypatch.setattr(fp.ExperimentRegion, "draw", some_on_surfaces)
    design = fp.exchange(
        problem(output_covariance="pooled", kinks="exclude", jumps="exclude"),
        n_experiments=3,
        n_candidates=4,
        max_iterations=2,
        method=fp.ExchangeMethod(references=False),
    )
    assert design.rejected["starts on v = 0"] == 2 * design.rejected["starts on x_v = 0"] > 0
    assert design.drawn == design.accepted + sum(design.rejected.values())
    assert np.all(design.points.x0[:, [1, 4]] != 0)


@pytest.mark.parametrize("kinks", ["cross", "exclude"])
def test_a_region_may_reach_past_where_a_surface_has_a_value(kinks: str) -> None:
    """|sqrt(x - 1) - 0.5| has its kink where the root is 0.5; a candidate with x < 1 is one that leaves the domain."""
    rates, parameters = ["c*abs(sqrt(x - 1) - 0.5) - k*x + u"], {"k": "1/s", "c": "1/s"}
    model = fp.SymbolicModel(rates, ["x"], {"x": "1"}, {"u": "1/s"}, parameters)
    region = fp.ExperimentRegion({"x": (0.2, 3.0), "u": (0.0, 2.0), "dt": (0.1, 2.0)})
    prior = fp.GaussianPrior(mean={"k": 0.3, "c": 0.5}, relative_std={"k": 0.1, "c": 0.1})
    of = fp.DesignProblem(model, prior, region, noise={"y": 0.01}, kinks=kinks)
    design = fp.exchange(of, n_experiments=4, max_iterations=20, method=fp.ExchangeMethod(references=False))
    assert design.rejected["left_domain"] > 0 and (design.points.x0 > 1).all()
    outside = fp.Experiments([[0.5], [2.0]], [[0.0], [0.0]], [0.1, 0.1])
    status = fp.simulate(model, outside, [0.3, 0.5], kinks=kinks).status
    assert [Status(int(one)) for one in status] == [Status.left_domain, Status.ok]


def test_every_status_has_advice() -> None:
    reasons = ["met_jump", "left_domain", "step_limit", "not_finite", "met_kink", "grazes_jump", "on_jump", "two_jumps"]
    assert [status.name for status in Status] == ["ok", *reasons, "chatters", "no_rest"]
    assert len({status.advice for status in Status}) == len(Status)
    assert all(status.advice.endswith(".") for status in Status)
