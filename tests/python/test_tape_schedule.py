"""Programs of random graphs: the same values as the graph's, whatever is fused, hoisted and put into a register used before."""

from __future__ import annotations

import pickle
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fisherpoint.models.tape.graph import STAGE, Graph, Leaves
from fisherpoint.models.tape.program import CODES, OPERATIONS, TABLE, Program
from fisherpoint.models.tape.schedule import schedule
from oracle import Floats
from tape_cases import small_graph, written

LEAVES = Leaves(parameters=3, inputs=1, states=2, sides=1)
SAFE = ["add", "sub", "mul", "neg", "sin", "atan", "abs", "min", "max", "select"]  # bounded growth, no poles


@st.composite
def graphs(draw: st.DrawFn) -> tuple[Graph, list[int]]:
    """A graph of operations as they are drawn, without simplification, and some of its nodes."""
    graph = Graph(LEAVES)
    nodes = [*range(LEAVES.count), graph.literal(2.0), graph.literal(-0.5), graph.zero]
    for _ in range(draw(st.integers(1, 60))):
        name = draw(st.sampled_from(SAFE))
        operands = [draw(st.sampled_from(nodes)) for _ in range(OPERATIONS[name].operands)]
        nodes.append(graph.operation(name, *operands))
    return graph, draw(st.lists(st.sampled_from(nodes), min_size=1, max_size=12))


def values_of(graph: Graph, leaves: Floats, results: list[int]) -> Floats:
    """Values (K, m) of nodes for leaves (K, n), node by node."""
    values: dict[int, np.ndarray] = {}
    for node in graph.needed(results):
        name = graph.names[node]
        if name == "leaf":
            values[node] = leaves[:, node]
        elif name == "literal":
            values[node] = np.full(len(leaves), graph.values[node])
        else:
            values[node] = OPERATIONS[name].compute(*(values[operand] for operand in graph.operands[node]))
    return np.stack([values[node] for node in results], axis=1)


def run(program: Program, leaves: Floats) -> Floats:
    areas = np.split(leaves, [LEAVES.u.start, LEAVES.x.start, LEAVES.side.start, LEAVES.dx.start], axis=1)
    return program.evaluate(*areas)


@settings(deadline=None)
@given(graphs(), st.integers(0, 2**32 - 1), st.sampled_from([1, 2, 7, 64]))
def test_a_program_computes_what_its_graph_does(case: tuple[Graph, list[int]], seed: int, window: int) -> None:
    """To the last bit, as products in sums are rounded here as outside of them."""
    graph, results = case
    leaves = np.random.default_rng(seed).uniform(-2, 2, (5, LEAVES.count))
    with np.errstate(all="ignore"):
        expected = values_of(graph, leaves, results)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("fisherpoint.models.tape.schedule._WINDOW", window)
        assert np.array_equal(run(schedule(graph, results), leaves), expected, equal_nan=True)


@settings(deadline=None)
@given(graphs())
def test_setup_reads_nothing_that_moves_and_is_not_overwritten(case: tuple[Graph, list[int]]) -> None:
    graph, results = case
    program = schedule(graph, results)
    fixed = len(program.literals) + LEAVES.x.start
    known = set(range(fixed))
    for code, result, *operands in program.setup.tolist():
        assert set(operands[: TABLE[code].operands]) <= known
        known.add(result)
    assert not written(program.setup) & written(program.stage)
    area = range(len(program.literals) + LEAVES.count, program.registers)
    assert written(program.setup) | written(program.stage) <= set(area)
    assert len(program.outputs) == len(results) and (program.outputs < program.registers).all()


@settings(deadline=None)
@given(graphs())
def test_the_stage_does_only_what_moves(case: tuple[Graph, list[int]]) -> None:
    graph, results = case
    moving = sum(graph.levels[n] == STAGE and graph.names[n] != "leaf" for n in graph.needed(results))
    assert len(schedule(graph, results).stage) <= moving


def test_products_become_part_of_sums() -> None:
    graph, a, b = small_graph()
    product = graph.mul(a, b)
    sums = [graph.add(product, a), graph.sub(product, b), graph.sub(a, product), graph.neg(product)]
    names = [TABLE[code].name for code in schedule(graph, sums).stage[:, 0]]
    assert sorted(names) == ["mul_add", "mul_sub", "sub_mul", "sub_mul"]
    assert len(schedule(graph, [*sums, product]).stage) == 5  # the product is wanted itself


def test_divisors_are_divided_by_once() -> None:
    graph, a, b = small_graph()
    program = schedule(graph, [graph.div(a, b), graph.div(graph.call("sin", a), b), graph.div(graph.one, b)])
    assert (program.stage[:, 0] == CODES["div"]).sum() == 1


def test_operations_one_after_the_other_take_few_registers() -> None:
    graph, a, b = small_graph()
    node = a
    for _ in range(100):
        node = graph.mul(graph.call("sin", node), graph.call("cos", graph.add(node, b)))
    program = schedule(graph, [node])
    assert program.registers <= len(program.literals) + graph.leaves.count + 3


def test_what_a_large_program_computes_is_used_soon() -> None:
    """Of 300 neighbours in a ring, each pulled by both beside it."""
    leaves = Leaves(parameters=1, inputs=0, states=300, sides=0)
    graph = Graph(leaves)
    x = [*leaves.x]
    pulls = [graph.mul(0, graph.sub(a, b)) for a, b in pairwise([*x, x[0]])]
    program = schedule(graph, [graph.sub(a, graph.call("tanh", b)) for a, b in pairwise([pulls[-1], *pulls])])
    temporaries = program.registers - len(program.literals) - leaves.count - len(program.outputs)
    assert temporaries <= 64
    kinds = program.stage[:, 0]
    assert (kinds[1:] != kinds[:-1]).sum() < len(kinds) / 10  # runs of one kind, which are decoded together


def test_programs_are_equal_by_content() -> None:
    def program(value: float) -> Program:
        graph, a, b = small_graph()
        return schedule(graph, [graph.add(graph.mul(graph.literal(value), a), b)])

    assert program(2.0) == program(2.0) == pickle.loads(pickle.dumps(program(2.0)))
    assert hash(program(2.0)) == hash(program(2.0))
    assert program(2.0) != program(3.0)


def test_results_may_be_leaves_and_literals() -> None:
    graph, a, b = small_graph()
    program = schedule(graph, [b, graph.literal(4.0), a, b])
    assert program.evaluate((0, 0), (0,), [[1, 2], [3, 5]], (1,), (0, 0)).tolist() == [[2, 4, 1, 2], [5, 4, 3, 5]]


@pytest.mark.parametrize("rows", [1, 7])
def test_one_row_serves_all(rows: int) -> None:
    graph, a, b = small_graph()
    program = schedule(graph, [graph.mul(graph.leaves.theta[0], graph.add(a, b))])
    x = np.arange(2.0 * rows).reshape(rows, 2)
    assert program.evaluate((3.0, 0.0), (0.0,), x, (1.0,), (0.0, 0.0))[:, 0].tolist() == (3 * x.sum(axis=1)).tolist()


def test_a_sum_that_nothing_else_reads_grows_in_one_register() -> None:
    """In the order that the core looks for: see mark_sums in program.hpp."""
    graph = Graph(LEAVES)
    k, d, _, _, x, y = range(6)
    difference = graph.sub(x, y)
    total = graph.mul(k, difference)
    for term in (graph.mul(d, graph.call("sin", x)), graph.call("sin", y), graph.neg(graph.mul(k, graph.call("cos", y)))):
        total = graph.add(term, total)
    read_twice = graph.add(graph.mul(difference, difference), y)
    results = [total, graph.add(graph.mul(read_twice, read_twice), x)]
    rows = schedule(graph, results).stage.tolist()
    names = {code: name for name, code in CODES.items()}
    at = {"mul_add": 4, "sub_mul": 4, "add": 2, "sub": 2}  # where the sum stands in a row
    going_on = [
        names[row[0]] for before, row in pairwise(rows) if names[row[0]] in at and row[1] == before[1] == row[at[names[row[0]]]]
    ]
    assert sorted(going_on) == ["add", "mul_add", "sub_mul"]
