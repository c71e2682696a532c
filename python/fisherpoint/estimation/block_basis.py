"""An orthonormal basis of the columns of a bordered Jacobian, with the same zeros: of each block its own, and of what is left."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..basics.values import Array
from .bordered import Bordered
from .tangent_space import unit_columns

RANK = 1e-8
"""Share of the largest singular value below which a derivative is one of others."""


class BlockBasis(NamedTuple):
    """A basis of r vectors.

    Attributes
    ----------
    columns : ndarray, (M, c + w)
        Entries as the layout stores them.
    layout : Bordered
    rank : int
        r.
    """

    columns: Array
    layout: Bordered
    rank: int


def basis_of(jacobian: Array) -> Array:
    """An orthonormal basis (M, r) of the columns of a Jacobian (M, P)."""
    length = np.linalg.norm(jacobian, axis=0)
    left, sizes, _ = np.linalg.svd(jacobian[:, length > 0] / length[length > 0], full_matrices=False)
    basis: Array = left[:, sizes > RANK * max(sizes.max(initial=0.0), 1e-300)]
    return basis


def block_basis(jacobian: Array, layout: Bordered) -> BlockBasis:
    """The basis of a Jacobian (M, C + w) that is stored by the layout."""
    count, common = len(jacobian), layout.common
    length = np.linalg.norm(jacobian[:, :common], axis=0)
    border = jacobian[:, :common] / np.where(length > 0, length, 1.0)
    width = max((blocks.unknowns.shape[1] for blocks in layout.blocks), default=0)
    own, places, first = np.zeros((count + 1, width)), np.full((count + 1, width), -1, dtype=np.intp), 0
    padded = np.concatenate([jacobian[:, common:], np.zeros((1, jacobian.shape[1] - common))])
    left = np.concatenate([border, np.zeros((1, common))])
    for blocks in layout.blocks:
        (groups, m), q = blocks.rows.shape, blocks.unknowns.shape[1]
        whole = np.zeros((groups, m, q + 1))
        np.put_along_axis(whole, blocks.columns, padded[blocks.rows], axis=2)
        vectors, sizes, _ = np.linalg.svd(unit_columns(whole[..., :q])[0], full_matrices=False)
        kept = sizes > RANK * np.maximum(sizes.max(axis=1, initial=0.0, keepdims=True), 1e-300)
        vectors = vectors * kept[:, None, :]
        rows = left[blocks.rows]
        for _ in range(2):
            rows = rows - vectors @ (vectors.swapaxes(1, 2) @ rows)
        left[blocks.rows], own[blocks.rows, :q] = rows, vectors
        number = np.where(kept, first + np.cumsum(kept).reshape(kept.shape) - 1, -1)
        places[blocks.rows, :q], first = number[:, None, :], first + int(kept.sum())
    vectors, sizes, _ = np.linalg.svd(left[:-1], full_matrices=False)
    rest = vectors[:, sizes > RANK * max(sizes.max(initial=0.0), 1.0)]
    found = Bordered(places[:-1], rest.shape[1], first)
    return BlockBasis(np.column_stack([rest, own[:-1]]), found, first + int(rest.shape[1]))
