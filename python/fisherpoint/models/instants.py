"""Slopes of a model's equations at random instants: what one instant of a measured course shows of states and parameters.

A rank at random points is the generic one, which holds at all points but for those on some surfaces. Points are complex: a root and
a logarithm have values there wherever they are, and functions that are smooth on a side of all branches have the same rank.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import reduce
from typing import Any, TypeAlias

import numpy as np

from ..basics.values import Array
from .surfaces.branches import Branches
from .surfaces.powers import Powers
from .surfaces.structure import Equations
from .tape.defined import value_of
from .tape.differentiate import gradient
from .tape.from_sympy import nodes_of
from .tape.graph import Graph, Leaves
from .tape.parts import symbols_of
from .tape.program import OPERATIONS

SMOOTH_INSTANTS, INSTANTS = 16, 32
"""Random instants of equations without branches, and of others, which are on random sides of each."""

ROUNDING = 1e-12
"""Share of itself by which every operation is off in the second calculation: far more than rounding."""

NEVER_ZERO = frozenset({"exp", "mul", "div", "pow"})
"""Operations whose results are other than zero where their operands are."""

Pair: TypeAlias = tuple[Array, Array]
"""The same numbers twice: as they are, and calculated with operations that are off."""


class RandomInstants:
    """Slopes of rates and outputs by states and parameters at random instants, on random sides of all branches.

    Parameters
    ----------
    equations : Equations
    names : mapping of symbol to str
        Of states and parameters.
    sizes : mapping of symbol to float
        About which states, inputs and parameters are drawn; 1 for others.

    Attributes
    ----------
    conditions : list of frozenset of str
        For each rate, then each output, the states and parameters that its branches are decided by.
    """

    def __init__(self, equations: Equations, names: Mapping[Any, str], sizes: Mapping[Any, float]) -> None:
        branches = Branches((*equations.states, *equations.inputs, *equations.parameters), by_side=True, most=math.inf)
        written = [branches.rewrite(one) for one in (*equations.rates, *equations.output)]
        powers = Powers(branches.surfaces)
        whole = [value_of(powers.rewrite(branches.merged(one))) for one in written]
        sides = {one.side: symbols_of(branches.merged(one.expression)) for one in branches.surfaces}
        self.conditions = [_decided_by(expression, sides, names) for expression in whole]
        self._count = INSTANTS if sides else SMOOTH_INSTANTS

        leaves = Leaves(len(equations.parameters), len(equations.inputs), len(equations.states), len(sides))
        graph, rng = Graph(leaves), np.random.default_rng(0)
        symbols = (*equations.parameters, *equations.inputs, *equations.states)
        nodes = {symbol: leaf for leaf, symbol in enumerate((*symbols, *sides))}
        nodes |= {symbol: graph.literal(value) for symbol, value in equations.constants.items()}
        slopes = gradient(graph, nodes_of(graph, whole, nodes), [*leaves.theta, *leaves.x])
        drawn = [sizes.get(symbol, 1.0) * _around_one(self._count, rng) for symbol in symbols]
        drawn += [rng.choice([-1.0, 1.0], self._count) for _ in sides]
        roots = sorted({node for of in slopes for node in of.values()})
        exact, off = (dict(zip(roots, _values(graph, roots, drawn, by), strict=True)) for by in (None, rng))
        self._slopes = [  # each entry is off by itself, also where two are one node
            {names[symbols[leaf]]: (exact[node], off[node] * _nearly_one(off[node].shape, rng)) for leaf, node in of.items()}
            for of in slopes
        ]

    def matrix(self, rows: Sequence[int], columns: Sequence[str]) -> Pair:
        """Slopes (K, n, m) of these equations by these states and parameters, at the K instants; not all need be finite."""
        found = np.zeros((2, self._count, len(rows), len(columns)), complex)
        places = {name: j for j, name in enumerate(columns)}
        for i, row in enumerate(rows):
            for name, pair in self._slopes[row].items():
                if name in places:
                    found[:, :, i, places[name]] = pair
        return found[0], found[1]


def _decided_by(expression: Any, sides: Mapping[Any, set[Any]], names: Mapping[Any, str]) -> frozenset[str]:
    """States and parameters that the branches of an expression are decided by."""
    found: set[Any] = set()
    waiting = symbols_of(expression) & sides.keys()
    while waiting:
        read = sides[waiting.pop()] - found
        found |= read
        waiting |= read & sides.keys()
    return frozenset(names[symbol] for symbol in found if symbol in names)


def _around_one(count: int, rng: np.random.Generator) -> Array:
    """Complex numbers up to twice one in size: in turn from a tenth on, and from 1e-3, where what saturates does not."""
    least = np.where(np.arange(count) % 2, -3.0, -1.0)
    return np.asarray(10.0 ** rng.uniform(least, 0.3) * np.exp(1j * rng.uniform(-np.pi, np.pi, count)))


def _nearly_one(shape: tuple[int, ...], rng: np.random.Generator) -> Array:
    return np.asarray(1.0 + ROUNDING * (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)))


@np.errstate(all="ignore")
def _values(graph: Graph, roots: Iterable[int], leaves: Sequence[Array], rng: np.random.Generator | None) -> list[Array]:
    """Values (K,) of nodes where leaves have these; with a generator every operation is off by `ROUNDING`."""
    shape, roots = leaves[0].shape if leaves else (1,), list(roots)
    found: dict[int, Any] = {}
    for node in graph.needed(roots):
        name = graph.names[node]
        if name == "leaf":
            found[node] = leaves[node]
        elif name == "literal":
            found[node] = graph.values[node]
        else:
            operands = [found[operand] for operand in graph.operands[node]]
            value = _COMPUTE[name](*operands)
            if name in NEVER_ZERO and not np.all(value):  # an underflow is no zero
                lost = reduce(lambda so_far, operand: so_far & (operand != 0), operands, value == 0)
                value = np.where(lost, np.nan, value)
            found[node] = value if rng is None else value * _nearly_one(shape, rng)
    return [np.broadcast_to(np.asarray(found[node], complex), shape) for node in roots]


def _smaller(a: Any, b: Any) -> Any:
    return np.where(np.real(a) <= np.real(b), a, b)


_COMPUTE: Mapping[str, Callable[..., Any]] = {name: operation.compute for name, operation in OPERATIONS.items()} | {
    # What branches goes by the real part; powers are of complex numbers, also where what is raised is a number.
    "abs": lambda a: a * np.sign(np.real(a)),
    "sign": lambda a: np.sign(np.real(a)),
    "min": _smaller,
    "max": lambda a, b: -_smaller(-a, -b),
    "select": lambda condition, a, b: np.where(np.real(condition) > 0, a, b),
    "pow": lambda a, b: np.power(np.asarray(a, complex), b),
}
