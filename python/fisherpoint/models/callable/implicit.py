"""SciPy's Radau with a look at what has become of f_x at the end of each step, as the compiled kernels have it."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...basics.values import Array
from .core import CallableCore
from .tangents import COMPLEX_STEP, DIFFERENCE, sizes

REAL = 3.637834252744496
"""Real eigenvalue of the stages' matrix: modes that grow by more than this over a step are damped."""


def radau_in_sight(model: CallableCore, u: Array, theta: Array) -> Any:
    """SciPy's Radau, whose steps are halved where they are too long for a mode that grows, or end off f.

    The method damps a mode that grows where a step is long for it. It would follow what has lost its stability, as an amount that
    is used up. And its iteration, with an f_x from before, does not see an error in a mode that has become much faster.
    """
    import scipy.integrate

    base: Any = scipy.integrate.Radau

    class RadauInSight(base):  # type: ignore[misc]
        growth = -np.inf  # per second, of the fastest mode that grows at the step's start

        def step(self) -> str | None:
            before = dict(self.__dict__)
            while True:
                message: str | None = super().step()
                if message is not None:
                    return message
                growth, off = self._end(before["y"])
                length = self.t - before["t"]
                if off <= 1 and max(growth, self.growth) * length <= REAL:
                    self.growth = growth
                    return None
                self.__dict__.update(before, h_abs=0.5 * length, LU_real=None, LU_complex=None)

        def _end(self, start: Array) -> tuple[float, float]:
            """How fast a mode grows at the step's end, and by how many tolerances the end is off the solution of the stages."""
            n, x, length = model.n_x, self.y[: model.n_x], self.t - self.t_old
            f_x = state_jacobian(model, x, u, theta)
            if not np.isfinite(f_x).all():
                return -np.inf, 0.0
            slope = self.sol.Q[:n] @ np.arange(1.0, self.sol.Q.shape[1] + 1) / length
            off = np.linalg.solve(REAL / length * np.eye(n) - f_x, self.f[:n] - slope)
            moves = (x != start[:n]) | (f_x - np.diag(np.diag(f_x)) != 0).any(axis=1)  # what does not rests, whatever it would do
            growth = np.max(np.linalg.eigvals(f_x[np.ix_(moves, moves)]).real, initial=-np.inf)
            return float(growth), float(np.max(np.abs(off) / (self.atol[:n] + np.abs(x) * self.rtol)))

    return RadauInSight


def state_jacobian(model: CallableCore, x: Array, u: Array, theta: Array) -> Array:
    """f_x (n_x, n_x), by complex step or central differences."""
    n, rows = model.n_x, np.eye(model.n_x)

    def rates(at: Any) -> Any:
        return model.rhs(at, np.broadcast_to(u, (len(at), len(u))), np.broadcast_to(theta, (len(at), len(theta))))

    if model.takes_complex(x[None], u[None], theta[None]):
        return np.asarray(np.imag(rates(x + 1j * COMPLEX_STEP * rows)).T / COMPLEX_STEP)
    step = DIFFERENCE * sizes(x, model.scale)
    values = np.real(rates(np.vstack([x + step[:, None] * rows, x - step[:, None] * rows])))
    return np.asarray((values[:n] - values[n:]).T / (2 * step))
