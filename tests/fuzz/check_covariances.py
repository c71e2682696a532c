"""Predictive covariances against brute force: every node simulated by itself, and the weighted sum in NumPy.

A node's output may be off by what its state may be off (checks.py), times how the output reacts; or by ten times what the same
node's own trajectory at this tolerance is off. What that does to the sum bounds the covariance's error.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

import fisherpoint as fp
from check_sensitivities import largest_column
from checks import ALLOWED, CLOSE, OK, Bench
from reading import Floats
from room import output_room, output_slopes, slope_room

RTOL, TIGHT = 1e-6, 1e-11
ROWS = 2  # points of a case


def check_covariance(bench: Bench, method: str | None = None) -> None:
    """The case's prior and rule, at the first points that are ok."""
    case = bench.case
    try:
        prior = case.prior()
    except ValueError:
        bench.figures.count("priors refused")
        return
    rule = case.rule_of()
    rows = np.flatnonzero(bench.tight.status == OK)[:ROWS]
    if not len(rows):
        rows = np.arange(len(bench.points))[:1]
    points = bench.points[rows]
    try:
        given = fp.predictive_covariance(bench.model, points, prior, rule, rtol=RTOL, threads=1, method=method, jumps="exclude")
    except ValueError:  # as a mean that starts on a surface
        bench.figures.count("covariances refused")
        return
    bench.figures.count("calls")
    bench.figures.count("covariances", len(rows))
    bench.figures.count("trajectories", len(rows) * rule.size(prior))
    call = f"fp.predictive_covariance(model, points, prior, rule, rtol={RTOL:g}, method={method!r}, jumps='exclude')"
    for row, k in enumerate(rows.tolist()):
        one = fp.PredictiveCovariance(*(of[row : row + 1] for of in (*given, given.projection, given.lost_weight)))
        if not np.isfinite(one.covariance).all():
            bench.report(
                "not finite covariance", math.inf, k, call, f"given {one.covariance[0].tolist()}, {one.status[0]}", theta=False
            )
        elif isinstance(rule, fp.LinearizedRule):
            check_linearized(bench, k, prior, one, call)
        else:
            check_nodes(bench, k, prior, rule, one, method, call)


def check_linearized(bench: Bench, k: int, prior: fp.GaussianPrior, given: fp.PredictiveCovariance, call: str) -> None:
    """S Sigma S^T of sensitivities that are checked by themselves."""
    done = fp.sensitivities(bench.model, bench.points[k], bench.case.mean, rtol=1e-9, threads=1, jumps="exclude")
    if given.status[0] != OK or done.status[0] != OK:
        return
    S, sizes = done.dy_dtheta[0], bench.case.sizes
    expected = S @ prior.covariance @ S.T
    std = np.sqrt(np.diag(prior.covariance))
    x, u, p = done.x[0].tolist(), bench.points.u[k].tolist(), bench.case.mean.tolist()
    columns = [largest_column(bench, k, j, 0.0, bench.case.mean) for j in range(len(p))] if len(sizes) else np.zeros(len(p))
    size = np.abs(S) @ std
    off = ALLOWED * RTOL * sizes
    room = slope_room(bench.reading, done.x[0], u, p, off, done.dx_dtheta[0], np.outer(off, columns))
    more = size * (1 + ALLOWED * RTOL) + room @ std
    bench.figures.count("covariances compared")
    allowed = np.outer(more, more) - np.outer(size, size) + 1e-14 * np.outer(size, size)
    # At rest on a kink, rounding decides of which side the sensitivities are.
    compare(bench, k, given.covariance[0], expected, allowed, call, lambda: sides_in_doubt(bench, x, u, p))


def deviations_room(bench: Bench, k: int, x: list[float]) -> Floats:
    """How far a point's deviations of the outputs (n_y,), by the prior from those of the mean, may be off at the tolerance."""
    case, u, p = bench.case, bench.points.u[k].tolist(), bench.case.mean.tolist()
    off, at = RTOL * case.sizes, np.array(x)
    if not isinstance(case.rule_of(), fp.LinearizedRule):
        return 2 * output_room(bench.reading, at, u, p, off)  # of a node and of the mean
    done = fp.sensitivities(bench.model, bench.points[k], case.mean, rtol=RTOL, threads=1, jumps="exclude")
    largest = [largest_column(bench, k, j, 0.0, case.mean) for j in range(len(p))]
    room = slope_room(bench.reading, at, u, p, off, done.dx_dtheta[0], np.outer(off, largest))
    return room @ np.sqrt(np.diag(case.prior().covariance))


def sides_in_doubt(bench: Bench, x: list[float], u: list[float], p: list[float]) -> bool:
    """Whether a state is so near to a surface that what it may be off by decides about its side."""
    moves = [sign * ALLOWED * RTOL * row for row in np.diag(bench.case.sizes) for sign in (1.0, -1.0)]
    return len({tuple(bench.reading.sides((np.array(x) + move).tolist(), u, p)) for move in moves}) > 1


def check_nodes(
    bench: Bench, k: int, prior: fp.GaussianPrior, rule: fp.Rule, given: fp.PredictiveCovariance, method: str | None, call: str
) -> None:
    theta, weights = rule.nodes(prior)
    everything = np.vstack([bench.case.mean, theta])
    points = bench.points[np.full(len(everything), k)]
    try:
        rough = bench.simulate(points, everything, RTOL, method)
        tight = bench.simulate(points, everything, TIGHT)
    except ValueError:  # a node that the model refuses, as a negative mass
        bench.figures.count("covariances with nodes that are refused")
        return
    lost, lost_tightly = rough.status[1:] != OK, tight.status[1:] != OK
    if (lost != lost_tightly).any() or (rough.status[0] == OK) != (tight.status[0] == OK):
        bench.figures.count("covariances whose lost nodes are too close to tell")
        return
    share = float(np.abs(weights[lost]).sum() / np.abs(weights).sum())
    strict, failed = rule.max_lost_weight == 0, given.status[0] != OK
    left = weights[~lost].sum()
    expected_failure = tight.status[0] != OK or (lost.any() if strict else share > rule.max_lost_weight) or not left > 0
    bench.figures.count("covariances with lost nodes", bool(lost.any()))
    earlier = fp.Experiments(points.x0, points.u, points.dt * (1 - CLOSE * RTOL))
    if failed != expected_failure and (lost_tightly != (bench.simulate(earlier, everything, TIGHT).status[1:] != OK)).any():
        bench.figures.count("covariances whose lost nodes are too close to tell")
        return
    if failed and not expected_failure and lost_at_others(bench, points, everything, method):
        bench.figures.count("covariances excluded by a node that is lost at other tolerances")
        return
    deviation = np.where(lost[:, None], 0.0, tight.y[1:] - tight.y[0])
    with np.errstate(all="ignore"):
        w = np.where(lost, 0.0, weights) / left
        expected = np.einsum("r,ri,rj->ij", w, deviation, deviation)
    if given.status[0] == fp.Status.not_finite and not np.isfinite(expected).all():
        bench.figures.count("covariances that overflow")
        return
    if failed != expected_failure:
        remark = f"given status {given.status[0]}; of the nodes' own trajectories {share:.3g} of the weight are not ok"
        kind = "covariance excluded wrongly" if failed else "wrong ok: covariance with lost nodes"
        bench.report(kind, 1.0, k, call, remark, theta=False)
        return
    if failed:
        return
    if abs(given.lost_weight[0] - share) > 1e-9:
        bench.report(
            "lost weight", 1.0, k, call + ".lost_weight", f"expected {share:.6g}, given {given.lost_weight[0]:.6g}", theta=False
        )
    if not np.isfinite(expected).all():
        bench.figures.count("covariances that overflow")
        return
    if rule.signed and np.linalg.eigvalsh(_scaled(expected))[0] < -1e-9:
        bench.figures.count("covariances that are projected")
        if np.linalg.eigvalsh(_scaled(given.covariance[0]))[0] < -1e-7:
            bench.report("covariance that is none", 1.0, k, call, f"given {given.covariance[0].tolist()}", theta=False)
        return
    d = np.abs(deviation)

    def allowed(thorough: bool) -> Floats:
        room = nodes_room(bench, k, everything, rough, tight, thorough)
        error = np.where(lost[:, None], 0.0, room[1:] + room[0])
        # Sums of both signs cancel.
        rounding = 1e-12 * np.einsum("r,ri,rj->ij", np.abs(w), d, d)
        return np.einsum("r,ri,rj->ij", np.abs(w), d + error, d + error) - np.einsum("r,ri,rj->ij", np.abs(w), d, d) + rounding

    def excuse() -> bool:
        within = (np.abs(given.covariance[0] - expected) <= allowed(thorough=True)).all()
        return bool(within) or near_a_branch(bench, k, everything, tight)

    bench.figures.count("covariances compared")
    compare(bench, k, given.covariance[0], expected, allowed(thorough=False), call, excuse)


def lost_at_others(bench: Bench, points: fp.Experiments, theta: Floats, method: str | None) -> bool:
    """Whether any node is excluded at larger tolerances: then one of the steps that lead there may be taken at this one too, as a
    sum over the prior does not begin each node with the same step as a trajectory alone."""
    return any(bench.simulate(points, theta, share * RTOL, method).status.any() for share in (3, 10, 30, 100))


def near_a_branch(bench: Bench, k: int, theta: Floats, tight: fp.Trajectories) -> bool:
    """Whether any node's output would take another branch if its state were off by what it may be off."""
    u = bench.points.u[k].tolist()
    room = ALLOWED * RTOL * bench.case.sizes
    moves = [sign * room * row for row in np.eye(len(room)) for sign in (1.0, -1.0)]
    for r in np.flatnonzero(tight.status == OK):
        p = theta[r].tolist()
        if len({tuple(bench.reading.output_branches((tight.x[r] + move).tolist(), u, p)) for move in moves}) > 1:
            return True
    return False


def nodes_room(bench: Bench, k: int, theta: Floats, rough: fp.Trajectories, tight: fp.Trajectories, thorough: bool) -> Floats:
    """How far every node's outputs may be off, (R, n_y), by the output's slopes at the states; thorough: and about them."""
    u = bench.points.u[k].tolist()
    room = np.zeros_like(tight.y)
    for r in np.flatnonzero(tight.status == OK):
        x, p = tight.x[r], theta[r].tolist()
        allowed = ALLOWED * RTOL * bench.case.sizes + 1e-12 * np.abs(x)
        if thorough:
            room[r] = output_room(bench.reading, x, u, p, allowed)
        else:
            room[r] = np.abs(np.nan_to_num(output_slopes(bench.reading, x.tolist(), u, p)[:, : len(x)])) @ allowed
        room[r] += 10 * np.abs(rough.y[r] - tight.y[r]) + 1e-12 * np.abs(tight.y[r])
    return room


def compare(
    bench: Bench,
    k: int,
    given: Floats,
    expected: Floats,
    allowed: Floats,
    call: str,
    excuse: Callable[[], bool] = lambda: False,
) -> None:
    error: Any = np.abs(given - expected)
    ratio = np.max(np.where(error > allowed, error / np.maximum(allowed, 1e-300), 0.0))
    bench.figures.ratio(
        "covariances against brute force, as a share of what is allowed", float(np.max(error / np.maximum(allowed, 1e-300)))
    )
    if ratio > 1 and (error <= RTOL * np.sqrt(np.outer(np.diag(expected), np.diag(expected)).clip(0))).all():
        bench.figures.count("covariances good to the relative tolerance alone")  # of states far above their natural size
    elif ratio > 1 and excuse():
        bench.figures.count("covariances of outputs that are steep, or close to a branch, next to the states")
    elif ratio > 1:
        remark = f"expected {expected.tolist()} by brute force, given {given.tolist()}"
        bench.report("wrong ok: covariance", float(ratio), k, call, remark, theta=False)


def _scaled(matrix: Floats) -> Floats:
    scale = np.sqrt(np.maximum(np.abs(np.diag(matrix)), 1e-300))
    return matrix / np.outer(scale, scale)
