"""From nodes to programs: what is hoisted, in which order operations come, and which registers they use."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from heapq import heappop, heappush

import numpy as np

from .fusion import FusedOperation, steps_of
from .graph import STAGE, Graph
from .program import CODES, Integers, Program

Steps = dict[int, FusedOperation]
Registers = dict[int, int]  # by node
Rows = list[list[int]]


def schedule(graph: Graph, results: Sequence[int]) -> Program:
    """Program that computes the given nodes."""
    steps = steps_of(graph, results)
    setup = {node: step for node, step in steps.items() if graph.levels[node] < STAGE}
    stage = {node: step for node, step in steps.items() if graph.levels[node] == STAGE}
    read = dict.fromkeys(operand for step in steps.values() for operand in step.operands) | dict.fromkeys(results)
    literals = [node for node in read if graph.is_literal(node)]
    registers = {node: register for register, node in enumerate(literals)}
    registers |= {leaf: len(literals) + leaf for leaf in range(graph.leaves.count)}
    first = len(registers)

    hoisted = {operand for step in stage.values() for operand in step.operands} | set(results)
    setup_rows, setup_end = _allocate(setup, hoisted, registers, first)
    stage_rows, end, registers = min(
        (_stage(order, results, registers, setup_end) for order in (stage, _by_pressure(stage, set(results)))),
        key=lambda found: found[1],
    )
    return Program(
        literals=np.array([graph.values[node] for node in literals], dtype=np.float64),
        setup=_array(setup_rows),
        stage=_array(stage_rows),
        outputs=np.array([registers[node] for node in results], dtype=np.int32),
        registers=end,
    )


def _stage(steps: Steps, results: Sequence[int], registers: Registers, first: int) -> tuple[Rows, int, Registers]:
    registers = dict(registers)
    return *_allocate(steps, set(results), registers, first), registers


def _allocate(steps: Steps, kept: Iterable[int], registers: Registers, first: int) -> tuple[Rows, int]:
    """Rows of the steps, and the end of the registers from `first` on that they write; a register is free after its last use."""
    uses = Counter(operand for step in steps.values() for operand in set(step.operands))
    uses.update(kept)  # one use that never comes
    rows, free, end = [], list[int](), first
    for node, step in steps.items():
        operands = [registers[operand] for operand in step.operands]
        for operand in set(step.operands):
            uses[operand] -= 1
            if not uses[operand] and operand in steps:
                free.append(registers[operand])
        if not free:
            free.append(end)
            end += 1
        registers[node] = free.pop()  # the one used last, which is still near
        rows.append([CODES[step.name], registers[node], *operands, *[0] * (3 - len(operands))])
    return rows, end


def _by_pressure(steps: Steps, kept: set[int]) -> Steps:
    """The steps in another order: next is always one that frees the most registers, of these the first in the given order."""
    operands = {node: {operand for operand in step.operands if operand in steps} for node, step in steps.items()}
    users: dict[int, list[int]] = {node: [] for node in steps}
    for node, read in operands.items():
        for operand in read:
            users[operand].append(node)
    uses = {node: len(users[node]) + (node in kept) for node in steps}
    missing = {node: len(read) for node, read in operands.items()}
    place = {node: i for i, node in enumerate(steps)}
    ready: list[tuple[int, int, int]] = []

    def offer(node: int) -> None:  # anew when it frees more; the older offer is passed over
        if not missing[node] and node not in ordered:
            heappush(ready, (-sum(uses[operand] == 1 for operand in operands[node]), place[node], node))

    ordered: Steps = {}
    for node in steps:
        offer(node)
    while ready:
        *_, node = heappop(ready)
        if node in ordered:
            continue
        ordered[node] = steps[node]
        for user in users[node]:
            missing[user] -= 1
            offer(user)
        for operand in operands[node]:
            uses[operand] -= 1
            if uses[operand] == 1:
                for user in users[operand]:
                    offer(user)
    return ordered


def _array(rows: Rows) -> Integers:
    return np.array(rows, dtype=np.int32).reshape(-1, 5)
