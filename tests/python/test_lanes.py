"""Packs that are not full, and lanes that fail: neither changes a bit of what the others give.

Every test here runs on every instruction set that the machine has: a pack is 2, 4 or 8 lanes wide.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from defaults import MODEL, NAMES, PRIOR, grid, point, same_bits, valid_points
from fisherpoint.engine import _core
from fisherpoint.engine.levels import kernels
from oracle import OUTPUT_ROWS, STATE_SCALES, Floats

pytestmark = pytest.mark.kernels

Status = fp.Status
NOMINAL = MODEL.theta(MODEL.nominal)
REMAINDERS = {
    1: grid(),
    7: grid(a_tau=7),
    8: grid(a_tau=2, E_oil=2, c_L=2),
    9: grid(E_oil=3, B_v=3),
    19683: fp.TensorGrid(3, span=1.5),
}
TROUBLE = {
    Status.met_jump: ("a_tau", 1e3),  # friction that stops the piston at once
    Status.left_domain: ("E_oil", 1e9),
    Status.step_limit: ("b_tau", 1e200),
    Status.not_finite: ("c_L", 1e300),
}
"""What a parameter is multiplied by so that a trajectory ends with the status."""


def troubled(status: Status, count: int = 1) -> Floats:
    name, factor = TROUBLE[status]
    theta = np.tile(NOMINAL, (count, 1))
    theta[:, NAMES.index(name)] *= factor
    return theta


def near_theta(count: int, seed: int) -> Floats:
    return NOMINAL * np.random.default_rng(seed).uniform(0.95, 1.05, (count, 9))


# --- remainders ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("count", REMAINDERS)
def test_a_covariance_is_the_sum_over_its_nodes_and_the_same_for_any_threads(count: int) -> None:
    rule, points, rtol = REMAINDERS[count], valid_points(3, seed=5, rule=fp.TensorGrid(3, span=1.5)), 1e-10
    theta, weights = rule.nodes(PRIOR)
    assert len(theta) == count
    results = [fp.predictive_covariance(MODEL, points, PRIOR, rule, rtol=rtol, threads=n) for n in (1, 2, 5)]
    for other in results[1:]:
        assert all(same_bits(a, b) for a, b in zip(results[0], other, strict=True))
    nominal = fp.simulate(MODEL, points, MODEL.nominal, rtol=rtol).y
    scale = STATE_SCALES[OUTPUT_ROWS]
    for k in range(len(points)):
        y = fp.simulate(MODEL, points[np.full(count, k)], theta, rtol=rtol).y - nominal[k]
        expected = (weights[:, None] * y).T @ y / weights.sum()
        # Errors e of the outputs, at most rtol of their scales on either side, move a covariance by at most e std.
        std = np.sqrt(np.diag(expected)) + 2 * rtol * scale
        tolerance = 2 * rtol * (scale[:, None] * std + std[:, None] * scale)
        assert np.all(np.abs(results[0].covariance[k] - expected) <= tolerance)


@pytest.mark.parametrize("count", [1, 3, 8, 9, 50])
@pytest.mark.parametrize("function", [fp.simulate, fp.sensitivities])
def test_a_point_is_the_same_alone(function: Any, count: int) -> None:
    points, theta = valid_points(count, seed=6), near_theta(count, 7)
    together = [function(MODEL, points, theta, threads=n) for n in (1, 2, 5)]
    assert not together[0].status.any()
    alone = [function(MODEL, points[[k]], theta[[k]]) for k in range(count)]
    for at, array in enumerate(together[0]):
        assert same_bits(np.concatenate([result[at] for result in alone]), array)
        assert all(same_bits(array, other[at]) for other in together[1:])


# --- lanes that fail ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("function", [fp.simulate, fp.sensitivities])
@pytest.mark.parametrize("status", [*TROUBLE, None], ids=lambda status: status.name if status else "all of them")
def test_points_that_fail_leave_the_others_alone(function: Any, status: Status | None) -> None:
    """In every pattern of two, four and eight lanes by chance: 24 draws of which lanes fail."""
    rng, count = np.random.default_rng(8), 24
    theta = near_theta(count, 9)
    x0 = np.tile(point().x0, (count, 1))
    x0[:, 4] = rng.uniform(0.1, 0.4, count)
    u = rng.choice([-0.3, 0.5], (count, 1))  # with 0.5 the spool passes its centre, each at its own time
    points = fp.Experiments(x0, u, np.linspace(1e-3, 2e-3, count))  # in order of duration: neighbours share a pack
    passes = fp.simulate(MODEL, points, theta, kinks="exclude").status == Status.met_kink
    assert 5 < passes.sum() < count - 5
    expected = function(MODEL, points, theta, jumps="exclude")
    assert not expected.status.any()
    for _ in range(24):
        fails = rng.random(count) < rng.uniform(0.1, 0.9)
        kinds = rng.choice(list(TROUBLE), count) if status is None else np.full(count, status)
        mixed = theta.copy()
        for k in np.flatnonzero(fails):
            mixed[k] = troubled(Status(int(kinds[k])))
        given = function(MODEL, points, mixed, jumps="exclude")
        np.testing.assert_array_equal(given.status, np.where(fails, kinds, 0))
        for a, b in zip(given, expected, strict=True):
            assert same_bits(a[~fails], b[~fails])


def over_table(theta: Floats, weights: Floats, threads: int) -> tuple[Any, ...]:
    """Covariance, status, redone nodes, outputs and lost weight of one point; steps are planned on three nodes near the mean."""
    nodes = _core.NodeTable(theta, weights, near_theta(3, 10))
    one = point(x_v=0.2, u=0.5)  # passes x_v = 0
    settings = (1e-6, True, False, "fastest", threads)
    return kernels.predictive_covariance(
        MODEL.core, one.x0, one.u, one.dt, NOMINAL, nodes, *settings, max_lost=1.0, keep_outputs=True
    )


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_nodes_that_fail_or_are_redone_leave_the_others_alone(threads: int) -> None:
    """Nodes of both kinds stand in the place of others, which had no weight: not even the sum may change."""
    rng, count = np.random.default_rng(11), 2500  # three chunks
    theta = near_theta(count, 12)
    far = rng.random(count) < 0.2
    theta[far] = NOMINAL * rng.uniform(0.5, 2.0, (int(far.sum()), 9))  # the plan does not do for many of these
    fails = rng.random(count) < 0.3
    weights = np.where(fails, 0.0, rng.uniform(-0.2, 1.0, count))
    covariance, status, redone, y, lost = over_table(theta, weights, threads)
    assert status[0] == Status.ok and 20 < redone[0] < 500 and covariance[0, 0, 0] > 0

    mixed = theta.copy()
    kinds = rng.choice(list(TROUBLE), count)
    for k in np.flatnonzero(fails):
        mixed[k] = troubled(Status(int(kinds[k])))
    found = over_table(mixed, weights, threads)
    assert found[1][0] == Status.ok and found[2][0] > redone[0] + 100
    assert same_bits(found[3][0, ~fails], y[0, ~fails])
    assert same_bits(found[0], covariance) and found[4][0] == lost[0] == 0.0

    # With weights of their own they are lost, and the sum is still that of the others.
    lost_weight = np.where(fails, 1.0, weights)
    found = over_table(mixed, lost_weight, threads)
    assert same_bits(found[3][0, ~fails], y[0, ~fails]) and same_bits(found[0], covariance)
    assert found[4][0] == pytest.approx(fails.sum() / np.abs(lost_weight).sum(), rel=1e-12)
