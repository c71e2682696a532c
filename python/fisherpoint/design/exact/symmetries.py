"""Permutations of candidates under which the criterion of sum_i n_i F_i does not change, found where every F_i has rank one.

With rows j_i and M = sum_i F_i = J^T J, J = Q R, a linear map that takes each j_i to plus or minus another one maps M to itself,
so that in the coordinates R^-T j_i, the rows of Q, it is orthogonal: it keeps the table of products, but for signs. Every
permutation that is returned has been checked for that; that there are no others is not claimed. det F is the same under all of
them. With j_s(i) = +-T^T j_i and M' = T^T M T, a criterion of K^T M^-1 K is where T^T K K^T T = K K^T, and one of the eigenvalues
of K^T M K where T K K^T T^T is.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...basics.values import Array
from ..goal.criteria import Criterion
from ..goal.determinant import Determinant
from ..goal.eigenvalue_criteria import SmallestEigenvalue
from ..goal.variance import Variance
from .tuning import ExactTuning

Permutations = NDArray[np.intp]

ALIKE = 1e-8


def symmetries(rows: Array, criterion: Criterion, tuning: ExactTuning = ExactTuning()) -> Permutations:
    """Permutations (G, K) of rows (K, p), the identity among them."""
    count = len(rows)
    identity = np.arange(count)[None]
    if not 1 < count <= tuning.most_symmetric_candidates or np.linalg.matrix_rank(rows) < rows.shape[1]:
        return identity
    whitened = np.linalg.qr(rows)[0]  # where rows are nearly dependent, M has lost too many digits to be factored
    products = whitened @ whitened.T
    sizes = np.abs(products)
    base = _base(sizes)
    if base is None:
        return identity
    search = _Images(products, sizes, base, tuning)
    search.extend([])
    kept = [one for one, signs in search.found if _keeps(criterion, rows, signs[:, None] * rows[one])]
    return np.array(kept) if kept else identity


def _keeps(criterion: Criterion, rows: Array, images: Array) -> bool:
    """Whether the linear map of rows to their images leaves the criterion as it is."""
    if isinstance(criterion, Determinant) and criterion.whole:
        return True
    if not isinstance(criterion, Determinant | Variance | SmallestEigenvalue):
        return False
    t = np.linalg.lstsq(rows, images, rcond=None)[0]
    direct = isinstance(criterion, SmallestEigenvalue) and not criterion.scaled.marginal
    moved = (t if direct else t.T) @ criterion.k
    square = criterion.k @ criterion.k.T
    return bool(np.abs(moved @ moved.T - square).max() < ALIKE * np.abs(square).max())


def _base(sizes: Array) -> list[int] | None:
    """A few rows whose products with all rows distinguish these; None where there are none such."""
    keys = _numbered(np.diag(sizes)[:, None])
    base: list[int] = []
    while keys.max() + 1 < len(sizes):
        parted = [int(_numbered(np.column_stack([keys, sizes[:, j]])).max()) for j in range(len(sizes))]
        best = int(np.argmax(parted))
        if parted[best] == keys.max():
            return None
        base.append(best)
        keys = _numbered(np.column_stack([keys, sizes[:, best]]))
    return base


def _numbered(columns: Array) -> NDArray[np.intp]:
    return np.asarray(np.unique(np.round(columns / (10 * ALIKE)), axis=0, return_inverse=True)[1]).ravel()


class _Images:
    """Images of the base, one row after the other, which say where all others go."""

    def __init__(self, products: Array, sizes: Array, base: list[int], tuning: ExactTuning) -> None:
        self.tuning = tuning
        self.products, self.sizes, self.base = products, sizes, base
        self.found: list[tuple[NDArray[np.intp], Array]] = []
        self.tries = 0

    def extend(self, images: list[int]) -> None:
        if len(self.found) >= self.tuning.most_permutations or self.tries >= self.tuning.most_symmetry_tries:
            return
        self.tries += 1
        if len(images) == len(self.base):
            self._complete(images)
            return
        own, own_size = self.base[len(images)], np.diag(self.sizes)
        fits = np.abs(own_size - own_size[own]) < ALIKE
        for before, image in zip(self.base, images, strict=False):
            fits &= np.abs(self.sizes[:, image] - self.sizes[own, before]) < ALIKE
        for image in np.flatnonzero(fits).tolist():
            if image not in images:
                self.extend([*images, image])

    def _complete(self, images: list[int]) -> None:
        own = np.diag(self.sizes)
        here = np.column_stack([own, self.sizes[:, self.base]])
        there = np.column_stack([own, self.sizes[:, images]])
        distance = np.abs(here[:, None] - there[None]).max(axis=2)
        permutation = distance.argmin(axis=1)
        if distance.min(axis=1).max() > ALIKE or len(np.unique(permutation)) < len(own):
            return
        moved = self.products[np.ix_(permutation, permutation)]
        signs = self._signs(moved)
        if np.abs(moved - np.outer(signs, signs) * self.products).max() < ALIKE:
            self.found.append((permutation, signs))

    def _signs(self, moved: Array) -> Array:
        """Signs of the rows with which products keep their own signs, where that is possible."""
        signs = np.zeros(len(moved))
        for first in range(len(moved)):
            if signs[first]:
                continue
            signs[first], waiting = 1.0, [first]
            while waiting:
                one = waiting.pop()
                others = np.flatnonzero((self.sizes[one] > ALIKE) & (signs == 0))
                signs[others] = signs[one] * np.sign(self.products[one, others]) * np.sign(moved[one, others])
                waiting += others.tolist()
        return signs
