"""Formulas of the table of functions as nodes of a graph."""

from __future__ import annotations

import ast
from collections.abc import Callable
from typing import Any

from ...basics.formulas import Reader
from .graph import Graph
from .kinds import formula


def node_of(graph: Graph, text: str, **names: int) -> int:
    """The node of a formula, whose names stand for nodes."""
    node: int = _Nodes(graph, text, names).term()
    return node


class _Nodes(Reader):
    def __init__(self, graph: Graph, text: str, names: dict[str, int]) -> None:
        super().__init__(formula(text), names)
        self._graph = graph

    def number(self, node: ast.expr, value: float) -> Any:
        return self._graph.literal(value)

    def combined(self, node: ast.expr, how: str, *values: Any) -> Any:
        return _OPERATORS[how](self._graph, *values) if how in _OPERATORS else self._graph.call(how, *values)


_OPERATORS: dict[str, Callable[..., int]] = {
    "+": Graph.add,
    "-": Graph.sub,
    "*": Graph.mul,
    "/": Graph.div,
    "negative": Graph.neg,
    ">": Graph.sub,  # a condition is a node that is positive where it holds
    "where": Graph.select,
}
