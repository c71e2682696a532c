"""An independent, slow implementation of the paper's cylinder, eq. (19), to check the product against.

It shares nothing with the product: NumPy formulas as printed (with the readings of the misprints), SciPy's DOP853 at
rtol 1e-11 restarted where the spool passes its centre, Jacobians by complex step, and SciPy's normal distribution for the
cell probabilities. Parameters are ordered as in (20), states q, v, p_A, p_B, x_v, outputs q, p_A, p_B, x_v; SI units.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.special import ndtr

Floats = NDArray[np.float64]
Numbers = NDArray[Any]  # float or complex: complex steps go through the same formulas

STATES = ("q", "v", "p_A", "p_B", "x_v")
PARAMETERS = ("a_tau", "b_tau", "m_q", "E_oil", "p_t", "B_v", "c_L", "V_0A", "V_0B")
OUTPUT_ROWS = np.array([0, 2, 3, 4])  # (19b): everything but the velocity
STATE_SCALES = np.array([0.5, 1.0, 1e7, 1e7, 1.0])  # m, m/s, Pa, Pa, 1: the sizes that errors are measured by

RTOL, ATOL = 1e-11, 1e-13  # of states and sensitivities that are scaled to the order of one
COMPLEX_STEP = 1e-30  # relative; no cancellation, so it can be as small as one likes
LOOKS_PER_STEP = 16  # at the dense output, to see a velocity that crosses zero and returns


class NotAPoint(Exception):
    """The trajectory meets v = 0 or leaves the domain of the square roots; the message is the product's status."""


@dataclass(frozen=True)
class Branch:
    """Which side of v = 0 and of x_v = 0 a smooth piece of trajectory lies on."""

    v: float
    x_v: float


@dataclass(frozen=True)
class Cylinder:
    """Eq. (19) with its known constants."""

    A_A: float
    A_B: float
    q_min: float
    q_max: float
    p_s: float
    T_1: float
    k_u: float

    @property
    def inner_stroke(self) -> tuple[float, float]:
        """The stroke without a tenth of it at either end."""
        edge = 0.1 * (self.q_max - self.q_min)
        return self.q_min + edge, self.q_max - edge

    def rhs(self, x: Numbers, u: float, theta: Numbers, branch: Branch | None = None) -> Numbers:
        """Eq. (19a) for x (5, ...) and theta (9, ...), real or complex; the branch is the point's own unless given."""
        q, v, p_A, p_B, x_v = x
        a_tau, b_tau, m_q, E_oil, p_t, B_v, c_L, V_0A, V_0B = theta
        positive = branch.x_v > 0 if branch else x_v.real > 0
        sign_v = branch.v if branch else np.sign(v.real)

        tau_f = a_tau * sign_v + b_tau * v
        Q_A = x_v * B_v * np.sqrt(np.where(positive, self.p_s - p_A, p_A - p_t))
        Q_B = -x_v * B_v * np.sqrt(np.where(positive, p_B - p_t, self.p_s - p_B))
        Q_LA = c_L * (np.sqrt(self.p_s - p_A) - np.sqrt(p_A - p_t))
        Q_LB = c_L * (np.sqrt(self.p_s - p_B) - np.sqrt(p_B - p_t))
        V_A = self.A_A * (q - self.q_min) + V_0A
        V_B = self.A_B * (self.q_max - q) + V_0B

        rows = (
            v,
            (self.A_A * p_A - self.A_B * p_B - tau_f) / m_q,
            E_oil / V_A * (-v * self.A_A + Q_A + Q_LA),
            E_oil / V_B * (v * self.A_B + Q_B + Q_LB),
            (self.k_u * u - x_v) / self.T_1,
        )
        return np.stack(np.broadcast_arrays(*rows))

    def spool_crossing(self, x_v0: float, u: float, dt: float) -> float | None:
        """When x_v(t) = k_u u + (x_v0 - k_u u) exp(-t/T_1) passes zero inside (0, dt), if it does."""
        target = self.k_u * u
        if x_v0 * target >= 0:
            return None
        time = self.T_1 * math.log((x_v0 - target) / -target)
        return time if time < dt else None

    def pieces(self, x0: Sequence[float] | Floats, u: float, dt: float) -> list[tuple[float, float, Branch]]:
        """Start, end and branch of each smooth piece of the trajectory from x0."""
        v, x_v = math.copysign(1.0, x0[1]), math.copysign(1.0, x0[4])
        crossing = self.spool_crossing(x0[4], u, dt)
        if crossing is None:
            return [(0.0, dt, Branch(v, x_v))]
        return [(0.0, crossing, Branch(v, x_v)), (crossing, dt, Branch(v, -x_v))]

    def simulate(self, x0: Sequence[float] | Floats, u: float, dt: float, theta: Floats) -> Floats:
        """x(dt) for theta (9,) -> (5,) or, all in one system, theta (R, 9) -> (R, 5); raises NotAPoint."""
        nodes = np.atleast_2d(theta).T
        shape = (5, nodes.shape[1])
        start = np.broadcast_to(np.asarray(x0, float)[:, None], shape) / STATE_SCALES[:, None]

        def dynamics(_: float, z: Floats, branch: Branch) -> Floats:
            x = z.reshape(shape) * STATE_SCALES[:, None]
            return (self.rhs(x, u, nodes, branch) / STATE_SCALES[:, None]).ravel()

        end = self._integrate(dynamics, start.ravel(), x0, u, dt, shape[1])
        x_end = (end.reshape(shape) * STATE_SCALES[:, None]).T
        return x_end[0] if np.ndim(theta) == 1 else x_end

    def sensitivities(self, x0: Sequence[float] | Floats, u: float, dt: float, theta: Floats) -> tuple[Floats, Floats]:
        """x(dt) (5,) and dx/dtheta (5, 9) per unit of theta by eq. (9); raises NotAPoint.

        The right-hand side is continuous in x_v = 0 and the time of crossing does not depend on theta, so the
        sensitivities are continuous there too.
        """
        theta = np.asarray(theta, float)

        def dynamics(_: float, z: Floats, branch: Branch) -> Floats:
            x, S = z[:5] * STATE_SCALES, z[5:].reshape(5, 9) * STATE_SCALES[:, None]  # S per relative change of theta
            f, f_x, f_theta = self.jacobians(x, u, theta, branch)
            S_dot = f_x @ S + f_theta * theta
            return np.concatenate([f / STATE_SCALES, (S_dot / STATE_SCALES[:, None]).ravel()])

        start = np.concatenate([np.asarray(x0, float) / STATE_SCALES, np.zeros(45)])
        end = self._integrate(dynamics, start, x0, u, dt, 1)
        return end[:5] * STATE_SCALES, end[5:].reshape(5, 9) * STATE_SCALES[:, None] / theta

    def jacobians(self, x: Floats, u: float, theta: Floats, branch: Branch | None = None) -> tuple[Floats, Floats, Floats]:
        """f (5,), f_x (5, 5) and f_theta (5, 9) by complex step, all columns at once."""
        steps = COMPLEX_STEP * np.concatenate([STATE_SCALES, theta])
        columns = np.concatenate([x, theta])[:, None] + 1j * np.diag(steps)
        f = self.rhs(columns[:5], u, columns[5:], branch)
        slopes = f.imag / steps
        return f[:, 0].real, slopes[:, :5], slopes[:, 5:]

    def _integrate(self, dynamics: Any, start: Floats, x0: Sequence[float] | Floats, u: float, dt: float, lanes: int) -> Floats:
        """Piece after piece; the first 5 * lanes entries are the scaled states, state by state."""
        z = start
        for begin, end, branch in self.pieces(x0, u, dt):
            with np.errstate(invalid="ignore"):  # a square root that has no value fails the step; see below
                solution = solve_ivp(dynamics, (begin, end), z, "DOP853", rtol=RTOL, atol=ATOL, args=(branch,), dense_output=True)
            times = np.concatenate(
                [np.linspace(a, b, LOOKS_PER_STEP) for a, b in zip(solution.t, solution.t[1:], strict=False)] or [np.array([begin])]
            )
            velocity = solution.sol(times)[lanes : 2 * lanes] if len(solution.t) > 1 else z[lanes : 2 * lanes]
            if np.any(velocity * branch.v <= 0):
                raise NotAPoint("met_jump")
            if not solution.success:
                raise NotAPoint("left_domain")
            z = solution.y[:, -1]
        return z


def random_cylinder(rng: np.random.Generator) -> tuple[Cylinder, Floats, Floats]:
    """Constants, mean and std (9,) about the default cylinder's, far enough to see each of them in the results."""
    q_min, stroke = rng.uniform(-0.1, 0.2), rng.uniform(0.2, 0.6)
    cylinder = Cylinder(
        A_A=rng.uniform(1e-3, 4e-3),
        A_B=rng.uniform(5e-4, 3e-3),
        q_min=q_min,
        q_max=q_min + stroke,
        p_s=rng.uniform(14e6, 32e6),
        T_1=rng.uniform(1e-3, 8e-3),
        k_u=float(rng.choice([-1.0, 1.0, 0.8])),
    )
    nominal = np.array([400.0, 1500.0, 150.0, 1.2e9, 0.5e6, 1.782e-7, 2.5e-9, 5e-5, 4e-5])
    mean = nominal * rng.uniform(0.6, 1.6, 9)
    return cylinder, mean, mean * rng.uniform(0.05, 0.3, 9)


def named(values: Mapping[str, float]) -> Floats:
    """A mapping by parameter name as an array in (20)'s order."""
    return np.array([values[name] for name in PARAMETERS])


def cell_probabilities(mean: float, std: float, levels: int, span: float) -> tuple[Floats, Floats]:
    """Cell centres and eq. (13) for one axis; true to about 1e-14, also far in the tails."""
    if levels == 1:
        return np.array([mean]), np.array([1.0])
    z = np.linspace(-span, span, levels)
    half = span / (levels - 1)
    # By symmetry every cell is taken on the side below the mean, where the distribution function keeps its digits.
    mirrored = -np.abs(z)
    return mean + std * z, np.asarray(ndtr(mirrored + half) - ndtr(mirrored - half))


def tensor_grid(mean: Floats, std: Floats, levels: Sequence[int], span: float) -> tuple[Floats, Floats]:
    """Nodes (R, p), last parameter fastest, and the unnormalised cell probabilities (R,)."""
    axes = [cell_probabilities(m, s, n, span) for m, s, n in zip(mean, std, levels, strict=True)]
    theta = np.stack(np.meshgrid(*(points for points, _ in axes), indexing="ij"), axis=-1).reshape(-1, len(axes))
    weights = np.ones(1)
    for _, probabilities in axes:
        weights = np.outer(weights, probabilities).ravel()
    return theta, weights


def predictive_covariance(
    cylinder: Cylinder,
    x0: Sequence[float] | Floats,
    u: float,
    dt: float,
    mean: Floats,
    std: Floats,
    levels: Sequence[int],
    span: float,
) -> Floats:
    """Eqs. (14)-(16) for one point, (4, 4), divided by the sum of the weights."""
    theta, weights = tensor_grid(mean, std, levels, span)
    y = cylinder.simulate(x0, u, dt, theta)[:, OUTPUT_ROWS]
    deviation = y - cylinder.simulate(x0, u, dt, mean)[OUTPUT_ROWS]
    return np.asarray(np.einsum("r,ri,rj->ij", weights, deviation, deviation) / weights.sum())


def standardised_fisher(dy_dtheta: Floats, std: Floats, output_covariance: Floats) -> Floats:
    """Eq. (7) times std_i std_j for dy_dtheta (L, 4, 9)."""
    root = np.linalg.cholesky(output_covariance)
    whitened = np.linalg.solve(root, dy_dtheta * std)
    return np.asarray(2 / len(dy_dtheta) * np.einsum("kni,knj->ij", whitened, whitened))
