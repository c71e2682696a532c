"""Forward differentiation of a graph, operation by operation, into the same graph."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import reduce

from ...basics.function_table import FUNCTIONS
from .graph import STAGE, Graph
from .node_of import node_of

Tangent = dict[int, tuple[int, int]]
"""A node's derivatives by variable. A derivative is a product scale * seed that is not yet formed: what follows multiplies the
scale, and variables that came the same way have one scale, so what is done to all of them costs as much as for one of them.
The scale bears no sign."""


def derivatives(graph: Graph, roots: Sequence[int], seeds: Mapping[int, Mapping[int, int]]) -> list[dict[int, int]]:
    """Derivatives of the roots as nodes, only those that are not zero by structure.

    Parameters
    ----------
    graph : Graph
    roots : sequence of int
        Nodes to differentiate.
    seeds : mapping
        For each leaf that moves its derivative by each variable, a node. Variables are any numbers.

    Returns
    -------
    list of dict, one for each root
        The node of the derivative by each variable, in ascending order of variables.
    """
    moving = reduce(lambda bits, leaf: bits | 1 << leaf, seeds, 0)
    tangents: dict[int, Tangent] = {}
    for node in graph.needed(roots):
        if not graph.reads[node] & moving:
            continue
        if node in seeds:
            tangents[node] = {variable: _term(graph, graph.one, seed) for variable, seed in seeds[node].items()}
        elif node in graph.half_powers:
            tangents[node] = _half_power(graph, tangents, *graph.half_powers[node])
        else:
            parts = [tangents.get(operand, {}) for operand in graph.operands[node]]
            tangent = _RULES[graph.names[node]](graph, node, parts)
            tangents[node] = {variable: term for variable, term in tangent.items() if graph.zero not in term}
    return [{variable: graph.mul(*term) for variable, term in sorted(tangents.get(root, {}).items())} for root in roots]


def gradient(graph: Graph, roots: Sequence[int], leaves: Iterable[int]) -> list[dict[int, int]]:
    """Partial derivatives of the roots by leaves; the variable is the leaf."""
    return derivatives(graph, roots, {leaf: {leaf: graph.one} for leaf in leaves})


def rates_along(graph: Graph, roots: Sequence[int]) -> list[int]:
    """Rates of change of the roots where the state moves at the rate dx."""
    leaves = graph.leaves
    along = derivatives(graph, roots, {x: {0: dx} for x, dx in zip(leaves.x, leaves.dx, strict=True)})
    return [found.get(0, graph.zero) for found in along]


def _term(graph: Graph, scale: int, seed: int) -> tuple[int, int]:
    negative, scale = graph.unsigned(scale)
    return scale, graph.signed(negative, seed)


def _scale(graph: Graph, tangent: Tangent, factor: int) -> Tangent:
    """Multiply derivatives by a factor. Scales that no two variables share become seeds, so that these variables share the next."""
    alone = Counter(scale for scale, _ in tangent.values())
    terms = {
        variable: (graph.one, graph.mul(scale, seed)) if alone[scale] == 1 and _is_unit(graph, seed) else (scale, seed)
        for variable, (scale, seed) in tangent.items()
    }
    if len(terms) == 1:
        ((variable, (scale, seed)),) = terms.items()
        if scale == graph.one and _is_unit(graph, seed):
            return {variable: (scale, graph.mul(seed, factor))}
    return {variable: _term(graph, graph.mul(scale, factor), seed) for variable, (scale, seed) in terms.items()}


def _is_unit(graph: Graph, seed: int) -> bool:
    return graph.unsigned(seed)[1] == graph.one


def _sum(graph: Graph, a: Tangent, b: Tangent) -> Tangent:
    result = a | b
    for variable in a.keys() & b.keys():
        (scale_a, seed_a), (scale_b, seed_b) = a[variable], b[variable]
        (minus_a, size_a), (minus_b, size_b) = graph.unsigned(seed_a), graph.unsigned(seed_b)
        if scale_a == scale_b:
            result[variable] = scale_a, graph.add(seed_a, seed_b)
        elif size_a == size_b and size_a != graph.one:
            scale = (graph.add if minus_a == minus_b else graph.sub)(scale_a, scale_b)
            result[variable] = _term(graph, scale, seed_a)
        else:
            result[variable] = graph.one, graph.add(graph.mul(scale_a, seed_a), graph.mul(scale_b, seed_b))
    return result


def _select(graph: Graph, condition: int, a: Tangent, b: Tangent) -> Tangent:
    """Each variable's derivative by the branch that is taken; nothing of the other is let into a product."""

    def alone(seed: int, first: bool) -> int:
        """The seed of one branch where it may multiply what is chosen by the condition, else one that changes at every stage."""
        return graph.select(condition, *((seed, graph.zero) if first else (graph.zero, seed))) if graph.partial[seed] else seed

    none = graph.one, graph.zero
    result: Tangent = {}
    for variable in a.keys() | b.keys():
        (scale_a, seed_a), (scale_b, seed_b) = a.get(variable, none), b.get(variable, none)
        if seed_b == graph.zero and graph.levels[seed := alone(seed_a, True)] < STAGE:
            result[variable] = graph.select(condition, scale_a, graph.zero), seed
        elif seed_a == graph.zero and graph.levels[seed := alone(seed_b, False)] < STAGE:
            result[variable] = graph.select(condition, graph.zero, scale_b), seed
        elif seed_a == seed_b:
            result[variable] = _term(graph, graph.select(condition, scale_a, scale_b), seed_a)
        else:
            branches = graph.mul(scale_a, seed_a), graph.mul(scale_b, seed_b)
            result[variable] = graph.one, graph.select(condition, *branches)
    return result


# Rules: the tangent of a node from those of its operands.

Rule = Callable[[Graph, int, list[Tangent]], Tangent]


def _negated(graph: Graph, tangent: Tangent) -> Tangent:
    return {variable: (scale, graph.neg(seed)) for variable, (scale, seed) in tangent.items()}


def _mul(graph: Graph, node: int, parts: list[Tangent]) -> Tangent:
    a, b = graph.operands[node]
    return _sum(graph, _scale(graph, parts[0], b), _scale(graph, parts[1], a))


def _div(graph: Graph, node: int, parts: list[Tangent]) -> Tangent:
    a, b = graph.operands[node]
    if graph.is_literal(a):  # no need of 1 / b
        return _scale(graph, parts[1], graph.neg(graph.mul(graph.div(graph.one, a), graph.mul(node, node))))
    inverse = graph.div(graph.one, b)
    return _sum(graph, _scale(graph, parts[0], inverse), _scale(graph, parts[1], graph.neg(graph.mul(node, inverse))))


def _pow(graph: Graph, node: int, parts: list[Tangent]) -> Tangent:
    a, b = graph.operands[node]
    tangent: Tangent = {}
    if parts[0]:  # not through a**b / a, which has no value at 0
        tangent = _scale(graph, parts[0], graph.mul(b, graph.pow(a, graph.sub(b, graph.one))))
    if parts[1]:  # a**b log(a) tends to 0 where a**b does
        product = graph.mul(node, graph.call("log", a))
        limited = graph.select(graph.call("abs", node), product, graph.zero)
        tangent = _sum(graph, tangent, _scale(graph, parts[1], limited))
    return tangent


def _half_power(graph: Graph, tangents: Mapping[int, Tangent], negative: bool, base: int, exponent: float) -> Tangent:
    """Slope of base**exponent or minus that as a product with a root: the usual rule makes it 0 times infinity at a base of 0."""
    slope = graph.mul(graph.literal(exponent), graph.pow(base, graph.literal(exponent - 1.0)))
    return _scale(graph, tangents.get(base, {}), graph.signed(negative, slope))


def _by_slope(slope: str) -> Rule:
    """Rule of a function of one argument with a slope, a formula of its argument x and its value y."""
    if not slope:
        return lambda *_: {}
    return lambda graph, node, parts: _scale(graph, parts[0], node_of(graph, slope, x=graph.operands[node][0], y=node))


_RULES: dict[str, Rule] = {
    "add": lambda graph, _, parts: _sum(graph, *parts),
    "sub": lambda graph, _, parts: _sum(graph, parts[0], _negated(graph, parts[1])),
    "mul": _mul,
    "div": _div,
    "neg": lambda graph, _, parts: _negated(graph, parts[0]),
    **{function.name: _by_slope(function.slope) for function in FUNCTIONS if not function.built},
    "pow": _pow,
    "min": lambda graph, node, parts: _select(graph, graph.sub(*graph.operands[node][::-1]), *parts),
    "max": lambda graph, node, parts: _select(graph, graph.sub(*graph.operands[node]), *parts),
    "select": lambda graph, node, parts: _select(graph, graph.operands[node][0], *parts[1:]),
}
