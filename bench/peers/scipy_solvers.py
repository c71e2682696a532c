"""SciPy's `solve_ivp`, one trajectory at a time, restarted at x_v = 0: RK45, and LSODA for the states.

The right-hand sides are those of `bench.scipy_peer`. atol is rtol times the scale of each state and each sensitivity.
"""

from __future__ import annotations

import numpy as np

from ..scipy_peer import Method, solve, state_equation, variational_equation
from ..workload import STATE_SCALES, Pairs
from .peer import Peer, Solution, sensitivity_scales


class SolveIvp(Peer):
    """`solve_ivp` with one of its methods."""

    compiled = False

    def __init__(self, method: Method, evaluations_per_step: int | None) -> None:
        self.name, self.method, self.evaluations_per_step = f"SciPy solve_ivp {method}", method, evaluations_per_step
        self.has_sensitivities = method == "RK45"

    def outputs(self, pairs: Pairs, rtol: float) -> Solution:
        x, evaluations = solve(state_equation, pairs, rtol, STATE_SCALES, True, self.method)
        return Solution.of_states(x, self._steps(evaluations, pairs))

    def sensitivities(self, pairs: Pairs, rtol: float) -> Solution:
        scales = np.concatenate([STATE_SCALES, sensitivity_scales().ravel()])
        ends, evaluations = solve(variational_equation, pairs, rtol, scales, True, self.method)
        return Solution.of_states(ends[:, :5], self._steps(evaluations, pairs), ends[:, 5:].reshape(-1, 5, 9))

    def _steps(self, evaluations: int, pairs: Pairs) -> float | None:
        return None if self.evaluations_per_step is None else evaluations / self.evaluations_per_step / len(pairs)


PEERS: list[Peer] = [SolveIvp("RK45", 6), SolveIvp("LSODA", None)]
