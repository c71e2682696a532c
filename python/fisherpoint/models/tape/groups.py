"""Sums and products of many nodes, grouped so that few operations are left for every evaluation.

What literals, then theta and u alone enter is combined first, so it can be hoisted; of the rest, what is known already is taken.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from .graph import STAGE, Graph

MANY = 12
"""Maximum number of terms or factors whose pairs are looked up."""


def sum_of(graph: Graph, terms: Iterable[int]) -> int:
    """Node of a sum."""
    by_level: tuple[list[int], ...] = ([], [], [])
    for term in terms:
        by_level[graph.levels[term]].append(term)
    total = graph.zero
    for group in by_level:
        total = _add_all(graph, total, _share(graph, group, "add"))
    return total


def _add_all(graph: Graph, total: int, terms: list[int]) -> int:
    # A total that is there first lets every product become part of one operation with its sum; so does a term that is no product.
    signed = [(*graph.unsigned(term), term) for term in terms]
    signed.sort(key=lambda item: (graph.names[item[1]] == "mul", item[0], item[1]))
    if total == graph.zero:
        start = next((item for item in signed if not item[0]), None)
        if start is None:
            return graph.neg(_add_all(graph, total, [node for _, node, _ in signed])) if signed else total
        signed.remove(start)
        total = start[2]
    for *_, term in signed:
        total = graph.add(total, term)
    return total


def product_of(graph: Graph, factors: Iterable[int]) -> int:
    """Node of a product; factors 1/d share one division."""
    numerators: tuple[list[int], ...] = ([], [], [])
    denominators: tuple[list[int], ...] = ([], [], [])
    for factor in factors:
        if graph.names[factor] == "div" and graph.operands[factor][0] == graph.one:
            denominators[graph.levels[factor]].append(graph.operands[factor][1])
        else:
            numerators[graph.levels[factor]].append(factor)
    known = graph.one
    for level in range(STAGE):
        known = graph.div(_multiply_all(graph, [known, *numerators[level]]), _multiply_all(graph, denominators[level]))
    numerator, denominator = _multiply_all(graph, numerators[STAGE]), _multiply_all(graph, denominators[STAGE])
    if numerator == graph.one:
        return graph.div(known, denominator)
    return graph.mul(known, graph.div(numerator, denominator))


def _multiply_all(graph: Graph, factors: list[int]) -> int:
    product = graph.one
    # What switches a factor off comes first: it then costs one operation with the next, not one with each of the others.
    for factor in sorted(_share(graph, factors, "mul"), key=lambda node: (graph.names[node] != "select", node)):
        product = graph.mul(product, factor)
    return product


def _share(graph: Graph, items: list[int], name: str) -> list[int]:
    """Replace pairs whose sum or product is a node already by that node."""
    items = list(items)
    if len(items) > MANY:
        return items
    while pair := next(_known_pairs(graph, items, name), None):
        i, j, node = pair
        items = [item for k, item in enumerate(items) if k not in (i, j)] + [node]
    return items


def _known_pairs(graph: Graph, items: list[int], name: str) -> Iterator[tuple[int, int, int]]:
    for j, b in enumerate(items):
        for i, a in enumerate(items[:j]):
            node = _known(graph, name, a, b)
            if node is not None:
                yield i, j, node


def _known(graph: Graph, name: str, a: int, b: int) -> int | None:
    if name == "mul":
        return graph.find("mul", a, b)
    (minus_a, p), (minus_b, q) = graph.unsigned(a), graph.unsigned(b)
    if minus_a == minus_b:
        node = graph.find("add", p, q)
        return node if node is None else graph.signed(minus_a, node)
    for negative, node in ((minus_a, graph.find("sub", p, q)), (minus_b, graph.find("sub", q, p))):
        if node is not None:
            return graph.signed(negative, node)
    return None
