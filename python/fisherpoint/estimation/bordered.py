"""Jacobians whose rows depend on the common unknowns and on few local ones: bordered block-diagonal matrices.

    [ L_1          C_1 ]        [ R_1          T_1 ]
    [      L_2     C_2 ]  = Q   [      R_2     T_2 ]
    [          ..  ..  ]        [          ..  ..  ]
    [              C_0 ]        [              R_0 ]

A block's rows are turned by the QR of [L_g C_g]; what is left of its columns C_g stands together with that of all others, and a
last QR makes R_0 of it. That is the QR of the whole matrix, without its zeros: no inverse, and no squares. A block has all local
unknowns that stand in one row with each other: a run's own, or those of a plant and of all of its runs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ..basics.values import Array
from .tangent_space import CLEAR, DampedSteps, Layout, TangentSpace, length_along, unit_columns

Places = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class BlocksOfShape:
    """G blocks of one shape: m rows, and q local unknowns.

    Attributes
    ----------
    rows : ndarray of int, (G, m)
        Rows of the Jacobian; behind the last one where a block has fewer.
    unknowns : ndarray of int, (G, q)
        Places among the local unknowns.
    columns : ndarray of int, (G, m, w)
        Of each stored column, the one of the block that it is; q for none.
    """

    rows: Places
    unknowns: Places
    columns: Places


class Bordered(Layout):
    """Stores of each row the derivatives by the C common unknowns, and by w local ones: (B, M, C + w) instead of (B, M, C + n).

    Parameters
    ----------
    places : ndarray of int, (M, w)
        Which of the n local unknowns a stored column is of; -1 for none.
    common, local : int
        C and n.

    Attributes
    ----------
    blocks : list of BlocksOfShape
    """

    def __init__(self, places: Places, common: int, local: int) -> None:
        self.places, self.common, self.local = places, common, local
        self._stored = np.where(places >= 0, places, local)
        block = _components(places, local)
        of_row = np.append(block, -1)[self._stored.min(axis=1)]
        self.border = np.flatnonzero(of_row < 0)
        count = int(block.max(initial=-1)) + 1
        rows = _members(of_row, count)
        unknowns = _members(block, count)
        at = np.zeros(local + 1, dtype=np.intp)  # a local unknown's column in its block
        for own in unknowns:
            at[own] = np.arange(len(own))
        shapes: dict[tuple[int, int], list[int]] = {}
        for g in range(count):
            m, q = len(rows[g]), len(unknowns[g])
            shapes.setdefault((max(q, 1 << (max(m, 1) - 1).bit_length()), q), []).append(g)
        self.blocks: list[BlocksOfShape] = []
        for (m, q), some in shapes.items():
            own = np.array([np.pad(rows[g], (0, m - len(rows[g])), constant_values=len(places)) for g in some], dtype=np.intp)
            stored = np.concatenate([self._stored, np.full((1, places.shape[1]), local)])[own]
            self.blocks.append(BlocksOfShape(own, np.array([unknowns[g] for g in some]), np.where(stored < local, at[stored], q)))

    def dense(self, jacobian: Array) -> Array:
        count, rows = jacobian.shape[:2]
        local = np.zeros((count, rows, self.local + 1))
        np.put_along_axis(local, np.broadcast_to(self._stored, (count, *self._stored.shape)), jacobian[..., self.common :], axis=2)
        return np.concatenate([jacobian[..., : self.common], local[..., : self.local]], axis=2)

    def effect(self, jacobian: Array, step: Array) -> Array:
        own = np.pad(step[:, self.common :], ((0, 0), (0, 1)))[:, self._stored]
        along: Array = (jacobian[..., : self.common] @ step[:, : self.common, None])[:, :, 0]
        return np.asarray(along + (jacobian[..., self.common :] * own).sum(axis=2))

    def tangent(self, r: Array, jacobian: Array) -> BorderedTangent:
        count = len(jacobian)
        border, of_common, blank_common = unit_columns(jacobian[..., : self.common])
        size, blank = np.empty((count, self.common + self.local)), np.empty((count, self.common + self.local), dtype=bool)
        size[:, : self.common], blank[:, : self.common] = of_common, blank_common
        parts = []
        for blocks in self.blocks:
            groups, m, q = *blocks.rows.shape, blocks.unknowns.shape[1]
            own = np.zeros((count, groups, m, q + 1))
            stored = self._gathered(jacobian[..., self.common :], blocks)
            np.put_along_axis(own, np.broadcast_to(blocks.columns, stored.shape), stored, axis=3)
            unit, lengths, nothing = unit_columns(own[..., :q].reshape(-1, m, q))
            places = self.common + blocks.unknowns
            size[:, places], blank[:, places] = lengths.reshape(count, groups, q), nothing.reshape(count, groups, q)
            parts.append((unit.reshape(count, groups, m, q), self._gathered(border, blocks)))
        factor = BlockFactor.of(parts, border[:, self.border])
        tangent = BorderedTangent(size, np.empty((count, 0)), blank, self, factor)
        return BorderedTangent(size, tangent.projected(r), blank, self, factor)

    def _gathered(self, rows: Array, blocks: BlocksOfShape) -> Array:
        """Rows (B, M, ...) of blocks, (B, G, m, ...), zero where there are none."""
        ends = [(0, 0), (0, 1), *[(0, 0)] * (rows.ndim - 2)]
        gathered: Array = np.pad(rows, ends)[:, blocks.rows]
        return gathered

    def split(self, r: Array) -> tuple[list[Array], Array]:
        """Rows (B, M) as those of blocks, and of the border."""
        return [self._gathered(r, blocks) for blocks in self.blocks], r[:, self.border]

    def of_unknowns(self, given: Array) -> tuple[list[Array], Array]:
        """Numbers of the unknowns (B, P) as those of blocks (B, G, q), and of the common ones (B, C)."""
        return [given[:, self.common + blocks.unknowns] for blocks in self.blocks], given[:, : self.common]

    def together(self, own: Sequence[Array], common: Array) -> Array:
        """Put numbers together that `of_unknowns` takes apart."""
        found = np.empty((len(common), self.common + self.local))
        found[:, : self.common] = common
        for blocks, values in zip(self.blocks, own, strict=True):
            found[:, self.common + blocks.unknowns] = values
        return found

    def inverse(self, factor: BlockFactor) -> Array:
        """R^-1 (B, P, P), with rows and columns as `triangle` has them."""
        c = self.common
        corner = np.linalg.inv(factor.corner)
        whole = np.zeros((len(corner), c + self.local, c + self.local))
        whole[:, :c, :c] = corner
        for blocks, top in zip(self.blocks, factor.tops, strict=True):
            rows, q = c + blocks.unknowns, blocks.unknowns.shape[1]
            own = np.linalg.inv(top[..., :q])
            whole[:, rows[:, :, None], rows[:, None, :]] = own
            whole[:, rows, :c] = -own @ top[..., q:] @ corner[:, None]
        return whole

    def triangle(self, factor: BlockFactor) -> Array:
        """R (B, P, P) as a whole; a row has the place of the unknown of its pivot."""
        c = self.common
        whole = np.zeros((len(factor.corner), c + self.local, c + self.local))
        whole[:, :c, :c] = factor.corner
        for blocks, top in zip(self.blocks, factor.tops, strict=True):
            rows, q = c + blocks.unknowns, blocks.unknowns.shape[1]
            whole[:, rows[:, :, None], rows[:, None, :]] = top[..., :q]
            whole[:, rows, :c] = top[..., q:]
        return whole


@dataclass(frozen=True, eq=False)
class BlockFactor:
    """The factors of B bordered matrices.

    Attributes
    ----------
    bases : tuple of ndarray, (B, G, m, k)
        Q of each block [L_g C_g].
    tops : tuple of ndarray, (B, G, q, q + C)
        [R_g T_g].
    basis, corner : ndarray, (B, n, C) and (B, C, C)
        Q and R_0 of what is left of the columns C.
    """

    bases: tuple[Array, ...]
    tops: tuple[Array, ...]
    basis: Array
    corner: Array

    @classmethod
    def of(cls, blocks: Sequence[tuple[Array, Array]], border: Array) -> BlockFactor:
        """Factor blocks L (B, G, m, q) and C (B, G, m, C), with m at least q, above further rows (B, n, C)."""
        bases, tops, left = [], [], list[Array]()
        count, _, c = border.shape
        for own, common in blocks:
            q = own.shape[3]
            basis, triangle = np.linalg.qr(np.concatenate([own, common], axis=3))
            bases.append(basis)
            tops.append(triangle[:, :, :q])
            left.append(triangle[:, :, q:, q:].reshape(count, -1, c))
        rows = np.concatenate([*left, border], axis=1)
        rows = np.pad(rows, ((0, 0), (0, max(0, c - rows.shape[1])), (0, 0)))
        basis, corner = np.linalg.qr(rows)
        return cls(tuple(bases), tuple(tops), basis, corner)

    def some(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> BlockFactor:
        bases, tops = (tuple(one[rows] for one in many) for many in (self.bases, self.tops))
        return BlockFactor(bases, tops, self.basis[rows], self.corner[rows])

    def put(self, rows: NDArray[np.intp], other: BlockFactor) -> None:
        pairs = [*zip(self.bases, other.bases, strict=True), *zip(self.tops, other.tops, strict=True)]
        for part, new in (*pairs, (self.basis, other.basis), (self.corner, other.corner)):
            part[rows] = new

    def pivots(self) -> Array:
        """Absolute values (B, P) of the pivots of R."""
        found = [np.einsum("bgqq->bgq", top[..., : top.shape[2]]).reshape(len(top), -1) for top in self.tops]
        return np.asarray(np.abs(np.concatenate([*found, np.einsum("bcc->bc", self.corner)], axis=1)))

    def projected(self, own: Sequence[Array], border: Array) -> tuple[list[Array], Array]:
        """Q^T of rows of blocks (B, G, m), and of the border (B, n)."""
        tops, left = [], list[Array]()
        for basis, top, rows in zip(self.bases, self.tops, own, strict=True):
            turned = (basis.swapaxes(2, 3) @ rows[..., None])[..., 0]
            tops.append(turned[..., : top.shape[2]])
            left.append(turned[..., top.shape[2] :].reshape(len(rows), -1))
        rest = np.concatenate([*left, border], axis=1)
        rest = np.pad(rest, ((0, 0), (0, self.basis.shape[1] - rest.shape[1])))
        return tops, np.asarray((self.basis.transpose(0, 2, 1) @ rest[:, :, None])[:, :, 0])

    def rows(self) -> tuple[list[tuple[Array, Array]], Array]:
        """Rows of Q: of blocks the columns of common unknowns (B, G, m, C) and its own (B, G, m, q); of the border (B, n, C)."""
        found, first = [], 0
        for basis, top in zip(self.bases, self.tops, strict=True):
            q, (count, groups, _, k) = top.shape[2], basis.shape
            of_common = self.basis[:, first : first + groups * (k - q)].reshape(count, groups, k - q, -1)
            found.append((np.asarray(basis[..., q:] @ of_common), basis[..., :q]))
            first += groups * (k - q)
        return found, self.basis[:, first:]

    def leverages(self) -> list[Array]:
        """Sum of squares of each row of Q, of blocks (B, G, m)."""
        return [np.square(common).sum(axis=3) + np.square(own).sum(axis=3) for common, own in self.rows()[0]]

    def solved(self, own: Sequence[Array], common: Array) -> tuple[list[Array], Array]:
        """R^-1 of what `projected` gives."""
        of_common = np.linalg.solve(self.corner, common[..., None])
        found = list[Array]()
        for top, rows in zip(self.tops, own, strict=True):
            q = top.shape[2]
            left = rows[..., None] - top[..., q:] @ of_common[:, None]
            found.append(np.asarray(np.linalg.solve(top[..., :q], left)[..., 0], dtype=np.float64))
        return found, np.asarray(of_common[..., 0], dtype=np.float64)


@dataclass(frozen=True, eq=False)
class BorderedTangent(TangentSpace):
    """The tangent space of bordered Jacobians, whose columns have length 1 in the factors; K is P."""

    layout: Bordered
    factor: BlockFactor

    def some(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> Self:
        return type(self)(self.size[rows], self.along[rows], self.blank[rows], self.layout, self.factor.some(rows))

    def put(self, rows: NDArray[np.intp], other: Self) -> None:
        self.size[rows], self.along[rows], self.blank[rows] = other.size, other.along, other.blank
        self.factor.put(rows, other.factor)

    @property
    def gradient(self) -> Array:
        own, common = self.layout.of_unknowns(self.along)
        of_common = (self.factor.corner.transpose(0, 2, 1) @ common[..., None])[..., 0]
        found = []
        for top, along in zip(self.factor.tops, own, strict=True):
            turned = (top.swapaxes(2, 3) @ along[..., None])[..., 0]
            found.append(turned[..., : top.shape[2]])
            of_common = of_common + turned[..., top.shape[2] :].sum(axis=1)
        return self.size * self.layout.together(found, of_common)

    def projected(self, r: Array) -> Array:
        return self.layout.together(*self.factor.projected(*self.layout.split(r)))

    def length(self, free: NDArray[np.bool_], negligible: float) -> Array:
        some = np.flatnonzero(~free.all(axis=1) | (self.factor.pivots().min(axis=1) < CLEAR))
        return length_along(self.along, some, self.layout.triangle(self.factor.some(some)), free, negligible)

    def shares(self) -> tuple[Array, NDArray[np.intp]]:
        """Q of the first problem, (M, C + k), with the k columns of each block in one place, and the block of each row (M,)."""
        layout, (of_blocks, border) = self.layout, self.factor.rows()
        width = max((own.shape[3] for _, own in of_blocks), default=0)
        found = np.zeros((len(layout.places) + 1, layout.common + width))
        number, first = np.full(len(found), -1, dtype=np.intp), 0
        for blocks, (common, own) in zip(layout.blocks, of_blocks, strict=True):
            found[blocks.rows, : layout.common], found[blocks.rows, layout.common : layout.common + own.shape[3]] = (
                common[0],
                own[0],
            )
            number[blocks.rows] = first + np.arange(len(blocks.rows))[:, None]
            first += len(blocks.rows)
        found[layout.border, : layout.common] = border[0][: len(layout.border)]
        return found[:-1], number[:-1]

    def damped(self, free: NDArray[np.bool_], units: Array, damping: Array) -> BorderedSteps:
        own, common = self.layout.of_unknowns(np.where(free, self.size / units, 0.0))
        root = np.sqrt(damping)
        parts = []
        for top, weight in zip(self.factor.tops, own, strict=True):
            count, groups, q, _ = top.shape
            below = np.broadcast_to(root[:, None, None, None] * np.eye(q), (count, groups, q, q))
            border = top[..., q:] * common[:, None, None, :]
            blocks = np.concatenate([top[..., :q] * weight[:, :, None, :], below], axis=2)
            parts.append((blocks, np.concatenate([border, np.zeros_like(border)], axis=2)))
        border = np.concatenate([root[:, None, None] * np.eye(common.shape[1]), self.factor.corner * common[:, None, :]], axis=1)
        return BorderedSteps(units, self.layout, BlockFactor.of(parts, border))


@dataclass(frozen=True, eq=False)
class BorderedSteps(DampedSteps):
    """Damped steps of `BorderedTangent`."""

    units: Array
    layout: Bordered
    factor: BlockFactor

    def step(self, along: Array) -> Array:
        own, common = self.layout.of_unknowns(along)
        padded = [np.pad(-rows, ((0, 0), (0, 0), (0, rows.shape[2]))) for rows in own]
        border = np.concatenate([np.zeros_like(common), -common], axis=1)
        return self.layout.together(*self.factor.solved(*self.factor.projected(padded, border))) / self.units


def _components(places: Places, local: int) -> Places:
    """The number (n,) of the block of each local unknown: those that stand in one row have the same."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    pairs = np.unique(np.sort(places, axis=1), axis=0) if places.shape[1] else np.zeros((0, 1), dtype=np.intp)
    first, second = pairs[:, :-1].ravel(), pairs[:, 1:].ravel()
    both = first >= 0
    graph = coo_array((np.ones(both.sum()), (first[both], second[both])), shape=(local, local))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.intp)


def _members(of: Places, count: int) -> list[Places]:
    """The places of each of `count` numbers."""
    order = np.argsort(of, kind="stable")
    return np.split(order, np.searchsorted(of[order], np.arange(count + 1)))[1:-1] if count else []
