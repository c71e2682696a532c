"""End states and statuses against the tightest tolerance, and against SciPy's route.

Where an error is above what is allowed (checks.py) it is still looked at whether anything but the integrator can be the reason:
rounding that decides about a condition, an estimate that vanishes by chance, rates that turn faster than steps of the tolerance
see, or a pair of crossings that SciPy has missed. What passes so is counted.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate import solve_ivp

import fisherpoint as fp
from checks import ALLOWED, CLOSE, OK, TIGHT, Bench, magnification, state_error
from reading import Floats, Reading, side_of
from scipy_route import Course, End, course

TOLERANCES = (1e-4, 1e-6, 1e-9)
METHODS = ("RK45", "DOP853", "Radau")
LOOKED_AROUND, TURNS = 301, 8  # places around a state, and signs of its rate that change there
NEXT_TO = 0.02  # of a state's size
CHANCE = "states off by a chance of the error's estimate"
LOOSE = 1e-4
CHANCES = 5e-5  # of all trajectories, the share of which that may be true
COURSES = 4  # of them that SciPy integrates


def check_states(bench: Bench) -> None:
    """Every tolerance and method against the tightest, and against SciPy where statuses differ and for a few others."""
    if not bench.case.rates or not len(bench.points):
        return
    results = {(rtol, method): bench.simulate(bench.points, bench.theta, rtol, method) for rtol in TOLERANCES for method in METHODS}
    suspects: list[int] = []
    for (rtol, method), done in results.items():
        for status in fp.Status:
            bench.figures.count(f"status {status.name}", int((done.status == status).sum()))
        both = (done.status == OK) & (bench.tight.status == OK)
        error = np.where(both, state_error(bench, done.x, bench.tight.x), 0.0)
        bench.figures.count("trajectories compared with rtol 1e-12", int(both.sum()))
        for k in np.flatnonzero(error > 3 * ALLOWED * rtol)[:2].tolist():
            error[k] /= magnification(bench, k, rtol)
            suspects += [k] * bool(error[k] > ALLOWED * rtol)
        error[error > 3 * ALLOWED * rtol] = 0.0  # where the first two are right, so may these be
        bench.figures.ratio(f"states against rtol {TIGHT:g}, {method} {rtol:g}", float(np.max(error / rtol, initial=0.0)))
    statuses = np.array([done.status for done in results.values()] + [bench.tight.status])
    suspects += np.flatnonzero((statuses != statuses[0]).any(axis=0)).tolist()
    others = {int(status): int(k) for k, status in reversed(list(enumerate(bench.tight.status)))}
    chosen = list(dict.fromkeys([*suspects, *sorted(others.values()), *range(len(bench.points))]))[:COURSES]
    for k in chosen:
        for (rtol, method), done in results.items():
            judge(
                bench,
                k,
                int(done.status[k]),
                done.x[k],
                rtol,
                f"fp.simulate(model, points, theta, rtol={rtol:g}, method={method!r}, jumps='exclude')",
                method,
            )


def judge(bench: Bench, k: int, status: int, x: Floats, rtol: float, call: str, method: str | None = None) -> None:
    """Compare one result with SciPy's."""
    true, name = bench.course(k), fp.Status(status).name
    bench.figures.count("judged by SciPy")
    if true.end is End.unknown:
        return
    if status == OK and true.end is End.ok:
        judge_state(bench, k, true, x, rtol, call, method)
    elif status == OK:
        judge_ok(bench, k, true, rtol, call)
    elif true.end is End.ok:
        judge_exclusion(bench, k, true, name, rtol, call)


def judge_state(bench: Bench, k: int, true: Course, x: Floats, rtol: float, call: str, method: str | None) -> None:
    """A trajectory that gets to its end, here and there."""
    if true.stiff and rtol < 1e-6:
        return
    error, growth = float(state_error(bench, x, true.x)), 1.0
    if error > ALLOWED * rtol:
        growth = magnification(bench, k, rtol)
        error /= growth
    if error > ALLOWED * rtol and bench.undecided(k):
        bench.figures.count("conditions that rounding decides about")
        return
    if error > ALLOWED * rtol and by_chance(bench, k, true, rtol, growth, method):
        bench.figures.count(CHANCE)
        return
    if error > ALLOWED * rtol and turns_within(bench, k, true, rtol):
        bench.figures.count("rates that change their sign again and again within what is allowed")
        return
    if error > ALLOWED * rtol and missed_by_a_peer(bench, k, true, rtol, method):
        bench.figures.count("rates that turn faster than steps of the tolerance see, by SciPy's pair too")
        return
    if error > ALLOWED * rtol and state_error(bench, x, bench.close_course(k).x) <= ALLOWED * rtol * growth:
        bench.figures.count("pairs of crossings that SciPy missed in steps of dt / 25")
        return
    bench.figures.ratio("states against SciPy", error / rtol)
    if error > ALLOWED * rtol:
        bench.report("wrong ok: states", error / (ALLOWED * rtol), k, call, f"x = {true.x.tolist()} by SciPy")


def by_chance(bench: Bench, k: int, true: Course, rtol: float, growth: float, method: str | None) -> bool:
    """Whether a smooth trajectory is right at other tolerances next to this, or from other starts next to its own: so it is where
    the estimate of one step's error happens to vanish, of which the documentation says that no rule sees it, and how rare it is
    (`CHANCES`). A first step may be the same at many tolerances. A pair of kinks may be missed in a long step whose interpolant
    does not show it, as the documentation says: so it is where a loose tolerance alone is wrong."""
    point, theta = bench.points[k], bench.theta[k : k + 1]

    def right(of: fp.Experiments, end: Floats, at: float) -> bool:
        one = bench.simulate(of, theta, at, method)
        return bool(one.status[0] == OK and state_error(bench, one.x[0], end) <= ALLOWED * at * growth)

    if true.stiff:
        return False
    if true.crossed:
        return rtol >= LOOSE and all(right(point, true.x, share * rtol) for share in (0.2, 0.05, 0.01))
    if all(right(point, true.x, share * rtol) for share in (0.5, 0.8, 1.25, 2.0)):
        return True
    for share in (-0.02, -0.01, 0.01, 0.02):
        x0 = point.x0[0] + share * bench.case.sizes
        beside = course(bench.reading, x0, point.u[0], bench.theta[k], float(point.dt[0]), bench.case.sizes)
        if beside.end is not End.ok or not right(fp.Experiments(x0[None], point.u, point.dt), beside.x, rtol):
            return False
    return True


def missed_by_a_peer(bench: Bench, k: int, true: Course, rtol: float, method: str | None) -> bool:
    """Whether SciPy's pair of the same order is off as much on a smooth trajectory, at the same tolerance and at one next to it: f
    then turns faster than steps of that size see, as sin(1 / (x - 2)) next to 2 does."""
    if true.crossed or true.stiff:
        return False
    x0, u, p = bench.points.x0[k], tuple(bench.points.u[k].tolist()), tuple(bench.theta[k].tolist())
    size, dt = bench.case.sizes, float(bench.points.dt[k])
    sides = [side_of(height) for height in bench.reading.heights(x0.tolist(), u, p)]

    def rates(_: float, z: Floats) -> Floats:
        f = bench.reading.held((z * size).tolist(), u, p, sides)
        return np.full(len(z), np.nan) if f is None else np.array(f) * dt / size

    for share in (1.0, 0.9, 1.1):
        done = solve_ivp(
            rates, (0.0, 1.0), x0 / size, "RK45" if method == "RK45" else "DOP853", rtol=share * rtol, atol=share * rtol
        )
        if done.status == 0 and state_error(bench, done.y[:, -1] * size, true.x) > ALLOWED * rtol:
            return True
    return False


def turns_within(bench: Bench, k: int, true: Course, rtol: float) -> bool:
    """Whether a rate changes its sign many times within what is allowed of its state, as sin(tan(x)) next to a pole of tan.

    Where it is stiff, next to the state: from one rest to the next it is no more than what a step is off that sees few of them, and
    SciPy's methods go astray as often.
    """
    u, p = bench.points.u[k].tolist(), bench.theta[k].tolist()
    for x in (bench.points.x0[k], true.x):
        sides = [side_of(height) for height in bench.reading.heights(x.tolist(), u, p)]
        for i, size in enumerate(bench.case.sizes):
            around = np.tile(x, (LOOKED_AROUND, 1))
            around[:, i] += max(ALLOWED * rtol, NEXT_TO if true.stiff else 0.0) * size * np.linspace(-1, 1, LOOKED_AROUND)
            rates = [bench.reading.held(near, u, p, sides) for near in around.tolist()]
            signs = np.sign([rate[i] for rate in rates if rate is not None])
            if np.count_nonzero(np.diff(signs)) >= TURNS:
                return True
    return False


def judge_ok(bench: Bench, k: int, true: Course, rtol: float, call: str) -> None:
    """A trajectory that is said to be ok and, says SciPy, is none."""
    dt = float(bench.points.dt[k])
    remark = f"{true.end.value}: {true.end.name} at t = {true.at:.6g} of {dt:g}, x = {true.x.tolist()}"
    if true.surface is not None:
        remark += f", where {surface_name(bench.reading, true)} = 0"
    if true.end is End.jump and not all(bench.moving_jumps):
        bench.figures.count("jumps that may be at times that depend on no parameter")
        return
    clear = true.depth > CLOSE * rtol and (true.end is End.jump or true.at < 0.99 * dt)
    if true.end is End.domain and true.at == 0:
        clear = True
    if clear and not (true.at > 0 and stays_beside(bench, k, rtol)):
        bench.report(f"wrong ok: {true.end.name}", true.depth / (CLOSE * rtol), k, call, remark)
    else:
        bench.figures.count("too close to tell")


def stays_beside(bench: Bench, k: int, rtol: float) -> bool:
    """Whether a trajectory is ok whose start is moved by what its states may be off: so one that touches a surface is told from one
    that goes through."""
    x0, size, theta = bench.points.x0[k], bench.case.sizes, bench.theta[k]
    moves = [sign * ALLOWED * rtol * row for row in np.diag(size) for sign in (1.0, -1.0)]
    u, dt = bench.points.u[k], float(bench.points.dt[k])
    return any(course(bench.reading, x0 + move, u, theta, dt, size).end is End.ok for move in moves)


def surface_name(reading: Reading, true: Course) -> str:
    assert true.surface is not None
    return reading.surfaces[true.surface] if true.end is End.jump else reading.limits[true.surface].text


def judge_exclusion(bench: Bench, k: int, true: Course, name: str, rtol: float, call: str) -> None:
    """A trajectory that is excluded and, says SciPy, is one."""
    kind = "limit" if name == "left_domain" else "surface"
    nearest = min((value for (of, _), value in true.clearance.items() if of == kind), default=math.inf)
    if name == "met_jump" and passes(bench, k, bench.model.jumps, true):
        bench.figures.count("exclusions at a surface where f does not jump just there")
        return
    if name in ("step_limit", "not_finite"):
        hard = true.stiff or float(np.max(true.largest / bench.case.sizes)) * 1e-13 > rtol
    else:
        hard = (name == "left_domain" and true.output_lost) or nearest < CLOSE * rtol
    if hard:
        bench.figures.count(f"exclusions with a reason: {name}")
        return
    bench.figures.count(f"exclusions without a reason: {name}")
    bench.excluded_wrongly(
        name, k, call, f"ok, x = {true.x.tolist()} by SciPy in {true.steps} steps, nearest surface {nearest:.3g}"
    )


def passes(bench: Bench, k: int, names: tuple[str, ...], true: Course) -> bool:
    """Whether the trajectory passes one of the model's surfaces, by their names."""
    case = bench.case
    values = Reading((), names, case.states, case.inputs, case.parameters, dict(case.constants))
    u, p = bench.points.u[k].tolist(), bench.theta[k].tolist()
    signs = {tuple(map(side_of, values.output(x, u, p) or ())) for x in true.way}
    return len(signs) > 1
