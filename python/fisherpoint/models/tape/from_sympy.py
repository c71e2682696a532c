"""From SymPy expressions to nodes of a graph."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial, reduce
from typing import Any, NamedTuple

import sympy
from sympy.logic.boolalg import BooleanFalse, BooleanTrue

from ...basics.function_table import Function
from .branch import Select
from .graph import Graph
from .groups import product_of, sum_of
from .kinds import KINDS
from .node_of import node_of


def nodes_of(graph: Graph, expressions: Sequence[Any], symbols: Mapping[Any, int]) -> list[int]:
    """Nodes of SymPy expressions.

    Parameters
    ----------
    graph : Graph
    expressions : sequence of sympy.Expr
    symbols : mapping from sympy.Symbol to node
        What the symbols stand for: leaves, or literals for known constants.

    Raises
    ------
    ValueError
        For a symbol that is not in `symbols`, a function that is not in the list, or a number that is not real and finite.
    """
    known = _Known({}, {})
    return [_node_of(graph, sympy.sympify(expression), symbols, known) for expression in expressions]


class _Known(NamedTuple):
    """Nodes of parts, by identity, as deep expressions are slow to compare; with the first of equal ones.

    SymPy may have made equal parts twice. A node that is made later may be another, as it takes of sums what is there already.
    """

    nodes: dict[int, tuple[Any, Any, int]]
    same: dict[Any, Any]

    def first(self, part: Any) -> Any:
        """The first part that is equal to this one, all of whose operands are known."""
        key = (part.func, *(id(self.nodes[id(operand)][1]) for operand in _operands(part))) if part.args else part
        return self.same.setdefault(key, part)


def _node_of(graph: Graph, expression: Any, symbols: Mapping[Any, int], known: _Known) -> int:
    open_parts, nodes = [expression], known.nodes  # a stack of our own: depth does not matter
    while open_parts:
        part = open_parts[-1]
        if id(part) not in nodes:
            builder, operands = _builder(part, symbols), _operands(part)
            if missing := [operand for operand in operands if id(operand) not in nodes]:
                open_parts += missing
                continue
            first = known.first(part)
            node = builder(graph, *(nodes[id(operand)][2] for operand in operands)) if first is part else nodes[id(first)][2]
            nodes[id(part)] = part, first, node  # kept, so that identities are
        open_parts.pop()
    return nodes[id(expression)][2]


def _operands(part: Any) -> tuple[Any, ...]:
    if isinstance(part, sympy.Piecewise):
        return tuple(operand for pair in part.args for operand in pair.args)
    return tuple(part.args)


def _builder(part: Any, symbols: Mapping[Any, int]) -> Callable[..., int]:
    """What makes the node of a part from those of its operands."""
    if isinstance(part, sympy.Symbol):
        if part not in symbols:
            raise ValueError(f"symbol: expected one of {', '.join(map(str, symbols))}; given {part}")
        return lambda _: symbols[part]
    if isinstance(part, sympy.Number | sympy.NumberSymbol):
        value = float(part)
        if not math.isfinite(value):
            raise ValueError(f"number: expected a finite number, given {part}")
        return lambda graph: graph.literal(value)
    if part.func not in _BUILDERS:
        names = ", ".join(kind.__name__ for kind in _BUILDERS)
        raise ValueError(f"function: expected one of {names}; given {part.func.__name__}")
    return _BUILDERS[part.func]


def _atan2(graph: Graph, y: int, x: int) -> int:
    """The angle of (x, y) by the arc tangent of whichever quotient is at most 1 in size; 0 at the origin."""
    pi, half = graph.literal(math.pi), graph.literal(math.pi / 2)
    flat = graph.sub(graph.call("abs", x), graph.call("abs", y))
    below, left = graph.neg(y), graph.neg(x)
    numerator, denominator = graph.select(flat, y, left), graph.select(flat, x, y)
    behind = graph.select(below, graph.neg(pi), pi)
    turn = graph.select(flat, graph.select(left, behind, graph.zero), graph.select(below, graph.neg(half), half))
    angle = graph.add(turn, graph.call("atan", graph.div(numerator, denominator)))
    return graph.select(graph.call("abs", denominator), angle, graph.zero)


def _piecewise(graph: Graph, *operands: int) -> int:
    value = graph.literal(math.nan)  # where no condition holds
    for expression, condition in reversed(list(zip(operands[::2], operands[1::2], strict=True))):
        value = graph.select(condition, expression, value)
    return value


# A condition is a node that is positive where the condition holds.


def _unequal(graph: Graph, a: int, b: int) -> int:
    return graph.call("abs", graph.sub(a, b))


def _all_in_turn(operation: Callable[[Graph, int, int], int]) -> Callable[..., int]:
    return lambda graph, *operands: reduce(partial(operation, graph), operands)


def _function(function: Function) -> Callable[..., int]:
    """What makes the node of a function; SymPy's step has a second argument, its value at zero."""
    if function.built:
        return lambda graph, a, *_: node_of(graph, function.built, x=a)
    return lambda graph, a: graph.call(function.name, a)


_BUILDERS: dict[Any, Callable[..., int]] = {
    sympy.Add: lambda graph, *terms: sum_of(graph, terms),
    sympy.Mul: lambda graph, *factors: product_of(graph, factors),
    sympy.Pow: Graph.pow,
    **{kind: _function(function) for kind, function in KINDS.items()},
    sympy.atan2: _atan2,
    sympy.Min: _all_in_turn(Graph.min),
    sympy.Max: _all_in_turn(Graph.max),
    Select: Graph.select,
    sympy.Piecewise: _piecewise,
    sympy.StrictGreaterThan: Graph.sub,
    sympy.GreaterThan: Graph.sub,
    sympy.StrictLessThan: lambda graph, a, b: graph.sub(b, a),
    sympy.LessThan: lambda graph, a, b: graph.sub(b, a),
    sympy.Equality: lambda graph, a, b: graph.sub(graph.one, graph.call("sign", _unequal(graph, a, b))),
    sympy.Unequality: _unequal,
    sympy.And: _all_in_turn(Graph.min),
    sympy.Or: _all_in_turn(Graph.max),
    sympy.Not: Graph.neg,
    BooleanTrue: lambda graph: graph.one,
    BooleanFalse: lambda graph: graph.neg(graph.one),
}
