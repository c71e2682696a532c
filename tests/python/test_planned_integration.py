"""Covariances over the grid take planned steps; the adaptive loop, node by node, says what must come out."""

from __future__ import annotations

import numpy as np
import pytest

import fisherpoint as fp
from conftest import random_points
from defaults import MODEL, PRIOR
from oracle import OUTPUT_ROWS, STATE_SCALES

pytestmark = pytest.mark.kernels

RULE = fp.TensorGrid(levels=2, span=1.5)
NODES, WEIGHTS = RULE.nodes(PRIOR)


def over_the_grid(point: fp.Experiments, rtol: float) -> fp.Trajectories:
    return fp.simulate(MODEL, point[np.zeros(len(NODES), dtype=int)], NODES, rtol=rtol)


@pytest.fixture(scope="module")
def points() -> fp.Experiments:
    """A quarter of them would fail already at the mean: these say nothing here."""
    drawn = random_points(np.random.default_rng(20), 400)
    return drawn[fp.simulate(MODEL, drawn, PRIOR.mean).status == fp.Status.ok][:120]


def test_statuses_are_those_of_the_first_node_that_fails(points: fp.Experiments) -> None:
    planned = fp.predictive_covariance(MODEL, points, PRIOR, RULE).status
    for k, point in enumerate(points):
        status = over_the_grid(point, 1e-6).status
        failed = status[status != fp.Status.ok]
        assert planned[k] == (failed[0] if len(failed) else fp.Status.ok)
    assert 20 < np.count_nonzero(planned) < 100


@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-8])
def test_covariances_are_those_of_a_tight_solve(points: fp.Experiments, rtol: float) -> None:
    planned = fp.predictive_covariance(MODEL, points, PRIOR, RULE, rtol=rtol)
    nominal = fp.simulate(MODEL, points, PRIOR.mean, rtol=1e-11).y
    scale = STATE_SCALES[OUTPUT_ROWS]
    errors = []
    for k in np.flatnonzero(planned.status == fp.Status.ok):
        tightly = over_the_grid(points[k], 1e-11)
        assert not tightly.status.any()
        deviation = tightly.y - nominal[k]
        tight = (WEIGHTS[:, None] * deviation).T @ deviation / WEIGHTS.sum()
        spread = np.sqrt(np.diag(tight)) / scale
        # An error e of an output moves its standard deviation by at most e.
        errors.append(np.max(np.abs(np.sqrt(np.diag(planned.covariance[k])) / scale - spread)))
    assert len(errors) > 20
    assert np.max(errors) < rtol
