"""The operations that a set of results needs, with signs and products taken into the sums that use them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

from .graph import STAGE, Graph

Value = TypeVar("Value", bound=Hashable)


@dataclass(frozen=True)
class FusedOperation:
    """An operation by name with its operands' nodes."""

    name: str
    operands: tuple[int, ...]


def steps_of(graph: Graph, results: Sequence[int]) -> dict[int, FusedOperation]:
    """Steps by the node that they compute, in an order in which operands come first; leaves and literals have none."""
    steps = {
        node: FusedOperation(graph.names[node], graph.operands[node])
        for node in graph.needed(results)
        if graph.names[node] not in ("leaf", "literal")
    }
    _share_divisions(graph, steps)
    _absorb_signs(graph, steps)
    steps = _alive(steps, results)
    _fuse(graph, steps, results)
    return _alive(steps, results)


def _share_divisions(graph: Graph, steps: dict[int, FusedOperation]) -> None:
    """One division for each divisor: a division takes as long as several products."""
    quotients: dict[int, list[int]] = defaultdict(list)
    for node, step in steps.items():
        if step.name == "div":
            quotients[step.operands[1]].append(node)
    for divisor, nodes in quotients.items():
        if len(nodes) > 1:
            inverse = graph.operation("div", graph.one, divisor)
            steps[inverse] = FusedOperation("div", (graph.one, divisor))
            for node in nodes:
                if node != inverse:
                    steps[node] = FusedOperation("mul", (steps[node].operands[0], inverse))


def _absorb_signs(graph: Graph, steps: dict[int, FusedOperation]) -> None:
    """-(a - b) is b - a, and -(a / b) is (-a) / b where -a is known before the stage."""
    for node, step in list(steps.items()):
        inner = steps.get(step.operands[0]) if step.name == "neg" else None
        if inner is None:
            continue
        if inner.name == "sub":
            steps[node] = FusedOperation("sub", inner.operands[::-1])
        elif inner.name == "div" and graph.levels[inner.operands[0]] < STAGE == graph.levels[node]:
            numerator = graph.neg(inner.operands[0])
            if graph.names[numerator] == "neg":
                steps[numerator] = FusedOperation("neg", graph.operands[numerator])
            steps[node] = FusedOperation("div", (numerator, inner.operands[1]))


def _fuse(graph: Graph, steps: dict[int, FusedOperation], results: Sequence[int]) -> None:
    """Make a product and a sum one operation where all that use the product are sums, so that it need not be formed."""
    users: dict[int, list[int]] = defaultdict(list)
    for node, step in steps.items():
        for operand in step.operands:
            users[operand].append(node)
    kept = set(results)
    products = [node for node, step in steps.items() if step.name == "mul" and node not in kept]
    for product in sorted(products, key=lambda node: len(users[node])):
        level = graph.levels[product]
        fused = {node: _with_product(graph, steps[node], product, steps[product]) for node in users[product]}
        if all(step is not None and graph.levels[node] == level for node, step in fused.items()):
            steps.update({node: step for node, step in fused.items() if step is not None})


def _with_product(graph: Graph, step: FusedOperation, product: int, factors: FusedOperation) -> FusedOperation | None:
    a, b = factors.operands
    if step.name == "neg":
        return FusedOperation("sub_mul", (a, b, graph.zero))
    if step.name == "add" and step.operands.count(product) == 1:
        (other,) = (operand for operand in step.operands if operand != product)
        return FusedOperation("mul_add", (a, b, other))
    if step.name == "sub":
        first, second = step.operands
        return FusedOperation("mul_sub", (a, b, second)) if first == product else FusedOperation("sub_mul", (a, b, first))
    return None


def _alive(steps: dict[int, FusedOperation], results: Sequence[int]) -> dict[int, FusedOperation]:
    """Only the steps that results need, in an order in which operands come first."""
    return {node: steps[node] for node in depth_first({node: step.operands for node, step in steps.items()}, results)}


def depth_first(operands: Mapping[Value, Sequence[Value]], results: Iterable[Value]) -> list[Value]:
    """The values with operands that results need, those that others are computed from before them: by depth first search."""
    ordered: dict[Value, None] = {}
    for result in results:
        open_values = [result]
        while open_values:
            value = open_values[-1]
            if value in ordered or value not in operands:
                open_values.pop()
                continue
            missing = [operand for operand in operands[value] if operand in operands and operand not in ordered]
            if missing:
                open_values += reversed(missing)
            else:
                ordered[value] = None
                open_values.pop()
    return list(ordered)
