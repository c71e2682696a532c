"""From nodes to programs: what is hoisted, in which order operations come, and which registers they use."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterable, Sequence

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
    stage_rows, end = _allocate(_by_kind(stage), set(results), registers, setup_end)
    return Program(
        literals=np.array([graph.values[node] for node in literals], dtype=np.float64),
        setup=_array(setup_rows),
        stage=_array(stage_rows),
        outputs=np.array([registers[node] for node in results], dtype=np.int32),
        registers=end,
    )


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


def _by_kind(steps: Steps) -> Steps:
    """The steps in another order: as many of one kind as can be follow each other, so that few kinds have to be decoded."""
    missing = {node: 0 for node in steps}
    users: dict[int, list[int]] = {node: [] for node in steps}
    for node, step in steps.items():
        for operand in set(step.operands) & steps.keys():
            users[operand].append(node)
            missing[node] += 1
    ready: dict[str, deque[int]] = {step.name: deque() for step in steps.values()}
    for node, step in steps.items():
        if not missing[node]:
            ready[step.name].append(node)
    ordered: Steps = {}
    while len(ordered) < len(steps):
        kind = max(ready, key=lambda name: len(ready[name]))
        while ready[kind]:
            node = ready[kind].popleft()
            ordered[node] = steps[node]
            for user in users[node]:
                missing[user] -= 1
                if not missing[user]:
                    ready[steps[user].name].append(user)
    return ordered


def _array(rows: Rows) -> Integers:
    return np.array(rows, dtype=np.int32).reshape(-1, 5)
