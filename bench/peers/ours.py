"""fisherpoint: predictive covariances over the whole grid, and sensitivities of single pairs, on one thread.

The sensitivities are dy/dtheta alone, as designs and fits ask the kernels for them.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

import fisherpoint as fp
from fisherpoint.points.run_trajectories import checked_sensitivities
from fisherpoint.points.settings import Integration

from ..covariances import covariances, grid_outputs
from ..workload import MODEL, PRIOR, RULE, Array, Pairs, candidates
from .peer import Block, Peer, Solution, blocks


class Fisherpoint(Peer):
    """Outputs are those that the predictive covariances are made of; the time is that of the covariances, on every node."""

    name = "fisherpoint"

    def outputs(self, pairs: Pairs, rtol: float) -> Solution:
        def of_block(block: Block) -> Array:
            point = fp.Experiments(block.x0[None], [[block.u]], [block.dt])
            return np.asarray(grid_outputs(point, rtol)[0, pairs.nodes[block.rows]])

        return Solution(np.concatenate([of_block(block) for block in blocks(pairs)]))

    def sensitivities(self, pairs: Pairs, rtol: float) -> Solution:
        theta = np.ascontiguousarray(pairs.theta)
        result = checked_sensitivities(MODEL, pairs.points, theta, Integration(rtol, cross_jumps=False), outputs_alone=True)
        return Solution(result.y, result.dy_dtheta)

    def states_task(self, pairs: Pairs, rtol: float) -> tuple[int, Callable[[], object]]:
        points = candidates()
        return len(points) * RULE.size(PRIOR), partial(covariances, points, 1, rtol)


PEERS: list[Peer] = [Fisherpoint()]
