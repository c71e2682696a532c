"""Criteria of optimality as functions of an information matrix: what searches maximise, and what optima are recognised by.

Every criterion but "ME" is given by an information function phi: positively homogeneous, concave and increasing in the information
matrix (Pukelsheim, Optimal Design of Experiments, 1993, ch. 5). With G the derivative of log phi at any M, tr(G M) = 1, and

    phi(N) <= phi(M) tr(G N)    for every N,

so that of all mixtures of matrices F_i none has more than phi(M) max_i tr(G F_i). M itself is optimal if and only if that maximum
is 1: the equivalence theorem. It holds for matrices of any rank.

Searches maximise the objective, `level` log phi(F), which is log det F for "D", with the level p. So what a search gains means the
same for all criteria: log phi by 1e-4 is one measurement in ten thousand.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from ...basics.values import Array
from ...show.section import Report, Section
from ...show.table_preview import InNotebooks
from .criterion_table import CRITERIA
from .estimable_space import Estimable


@dataclass(frozen=True, eq=False)
class Slope:
    """The derivatives of log phi at M, along information matrices F (m, p, p).

    Attributes
    ----------
    half : ndarray, (p, q)
        Y of the gradient G = Y Y^T.
    log_phi : float
    """

    criterion: Criterion
    half: Array
    log_phi: float
    factor: Array  # Cholesky factor L of M; for "E" the eigenvalues of N
    share: float  # for "E", the smoothing
    smooth: float = 0.0  # for "E", the smoothed value in units of `size`
    size: float = 1.0
    across: Array = field(default_factory=lambda: np.zeros((0, 0)))  # for "E", what bends A beside nuisance parameters

    @property
    def gradient(self) -> Array:
        """G (p, p)."""
        return self.half @ self.half.T

    def along(self, matrices: Array) -> Array:
        """tr(G F_i), (m,)."""
        return np.asarray(np.einsum("ijk,jk->i", matrices, self.gradient))

    def curvature(self, matrices: Array) -> Array:
        """The second derivatives (m, m) of log phi by the weights of F_i."""
        return self.criterion._curvature(self, matrices)


class Criterion(InNotebooks):
    """One number that says how good an information matrix is.

    Attributes
    ----------
    name : str
    level : int
        What the sensitivity function is multiplied by, so that it is tr(M^-1 F_i) <= p for "D"; 1 where that is not the custom.
    """

    name: str
    k: Array
    level: int = 1
    kinked: bool = False
    degree: int = 1  # of phi: 0 where it does not matter how much is measured
    plain: bool = False  # log det F itself, whatever the coordinates
    of_all: bool = False  # log det of the information about all parameters, or about all of them that are estimable
    bounded: bool = False  # `added` are upper bounds; `added_exactly` has the values
    # Multiples of the identity that are added to an F of about the identity where a point leaves it, and where it is singular:
    # neither they nor rounding matter in differences of variances.
    least: float = 1e-8
    small: float = 1e-8

    def value(self, information: Array) -> float:
        """The criterion at a matrix (p, p), in its own units: infinitely bad where the matrix does not determine it."""
        return self.of_log_phi(self.log_phi(information))

    def of_log_phi(self, log_phi: float) -> float:
        """The criterion in the units of `value`, from log phi: a logarithm, as of a determinant, unless a criterion has others."""
        return self.level * log_phi

    def gradient(self, information: Array) -> Array:
        """Derivative (p, p) of `value` by the information matrix, which must be regular."""
        return self.level * self.slope(information).gradient

    @abstractmethod
    def log_phi(self, information: Array) -> float:
        """log phi; -inf where the matrix does not determine the criterion."""

    def log_phis(self, matrices: Array) -> Array:
        """log phi of many matrices (m, p, p), (m,)."""
        return np.array([self.log_phi(matrix) for matrix in matrices])

    def __repr__(self) -> str:
        return f"<Criterion {self.name}: {CRITERIA[self.name].meaning}>"

    def _in_notebook(self) -> Report:
        facts = [
            ("what is maximised or minimised", CRITERIA[self.name].meaning),
            ("level of the sensitivity function", str(self.level)),
        ]
        return Report(f"Criterion {self.name}", [Section("", (), facts)])

    def efficiency(self, information: Array, reference: Array) -> float:
        """phi of a matrix as a share of that of another: so many times fewer measurements would do with the other."""
        value, other = self.log_phi(information), self.log_phi(reference)
        if not np.isfinite(other):
            raise ValueError(f"reference: expected information that determines criterion {self.name!r}, given none")
        return float(np.exp(value - other))

    def _of_regular(self, matrices: Array, of_solved: Callable[[Array], Array]) -> Array:
        """log phi of many matrices from L^-1 K (m, p, s), side by side where these are regular; of the others one by one."""
        scale = np.sqrt(np.maximum(np.diagonal(matrices, axis1=1, axis2=2), 0.0))
        scale = np.where(scale > 0, scale, 1.0)
        scaled = matrices / (scale[:, :, None] * scale[:, None, :])
        values = np.linalg.eigvalsh(scaled)
        regular = values[:, 0] > SINGULAR * values.shape[1] * values[:, -1]
        result = np.full(len(matrices), -np.inf)
        if regular.any():
            rows = self.k / scale[regular][:, :, None]
            result[regular] = of_solved(np.linalg.solve(np.linalg.cholesky(scaled[regular]), rows))
        result[~regular] = [self.log_phi(matrix) for matrix in matrices[~regular]]
        return result

    def slope(self, information: Array, share: float = 0.0, size: float | None = None) -> Slope:
        """Derivatives of log phi at a regular matrix; `share` of `size` smooths what has kinks ("E")."""
        raise NotImplementedError

    def _curvature(self, slope: Slope, matrices: Array) -> Array:
        raise NotImplementedError

    def within(self, estimable: Estimable) -> Criterion:
        """Return the criterion as a function of matrices in the coordinates of what is estimable."""
        raise NotImplementedError

    def restricted(self, span: Array) -> Criterion:
        """Return the criterion of what is estimable, with an orthonormal basis (p, r); itself where it is of certain functions."""
        return self

    def outside(self, estimable: Estimable) -> float:
        """The share of the criterion's functions that is not estimable; 0 for criteria of all that is."""
        return 0.0

    def beside_nuisance(self, nuisance: int) -> Criterion:
        """Return the criterion of the parameters as a function of information that has `nuisance` more rows, behind them."""
        raise NotImplementedError

    def restricted_to(self, space: Estimable) -> Criterion:
        """Return the criterion of what is estimable; itself where that is everything, or where it is of certain functions."""
        found = self.restricted(space.span)
        return found if len(space.null) else self

    # --- What searches maximise ------------------------------------------------------------------------------------------

    def objective(self, fisher: Array) -> float:
        """`level` log phi(F); -inf where F does not determine the criterion."""
        return self.level * self.log_phi(fisher)

    def objectives(self, fishers: Array) -> Array:
        """`objective` of many F (..., p, p), (...)."""
        flat = fishers.reshape(-1, *fishers.shape[-2:])
        return np.asarray(self.level * self.log_phis(flat).reshape(fishers.shape[:-2]))

    def added(self, fisher: Array, columns: Array) -> Array:
        """exp of the objective at F + W W^T (N,) less `offset`, of columns (p, n, N)."""
        raise NotImplementedError

    def added_exactly(self, fisher: Array, columns: Array) -> Array:
        """Exact values where those of `added` are bounds."""
        return self.added(fisher, columns)

    def offset(self, fisher: Array, factor: Array) -> float:
        """Objective less the logarithm of `added`; `factor` is L of the coordinates."""
        return 0.0

    def in_coordinates(self, factor: Array) -> Criterion:
        """Return the criterion as a function of matrices L^-1 F L^-T."""
        raise NotImplementedError

    def objective_slope(self, fisher: Array, rows: Array) -> tuple[float, Array]:
        """The objective, or what is near to it and smooth, and its derivative by F times rows (k, p)."""
        diagonal = np.diag(fisher)
        slope = self.slope(fisher + TINY * np.diag(np.maximum(diagonal, TINY * diagonal.max())))
        return self.level * slope.log_phi, self.level * (rows @ slope.half) @ slope.half.T


TINY = 1e-12
"""Relative addition of ascents to the diagonal of F, which may be singular where a criterion is not of all parameters."""

SINGULAR = 1e-14
"""Share of the largest eigenvalue below which the smallest is rounding."""


def half_solved(information: Array, k: Array) -> Array | None:
    """Some H with H^T H = K^T M^- K; None where K is not in the range of M."""
    scale = np.sqrt(np.maximum(np.diag(information), 0.0))
    scale = np.where(scale > 0, scale, 1.0)
    scaled = information / np.outer(scale, scale)
    rows = k / scale[:, None]
    values, vectors = np.linalg.eigh(scaled)
    kept = values > SINGULAR * len(values) * values[-1]
    if kept.all():
        return np.asarray(np.linalg.solve(np.linalg.cholesky(scaled), rows))
    inside = vectors[:, kept]
    if np.linalg.norm(rows - inside @ (inside.T @ rows)) > 1e-7 * np.linalg.norm(rows):
        return None
    return np.asarray((inside.T @ rows) / np.sqrt(values[kept])[:, None])


def across(slope: Slope, matrices: Array) -> Array:
    """L^-1 F_i Y as rows (m, p q): products of two are tr(G F_i M^-1 F_j)."""
    p, q = slope.half.shape
    columns = np.moveaxis(matrices @ slope.half, 0, 1).reshape(p, -1)
    solved = np.linalg.solve(slope.factor, columns)
    return np.asarray(np.moveaxis(solved.reshape(p, len(matrices), q), 1, 0).reshape(len(matrices), -1))


def padded(k: Array, nuisance: int) -> Array:
    """K with rows of zeros for the nuisance parameters."""
    return np.concatenate([k, np.zeros((nuisance, k.shape[1]))])


def solved(factor: Array, k: Array) -> Array:
    """L^-1 K."""
    return np.asarray(np.linalg.solve(factor, k), dtype=np.float64)
