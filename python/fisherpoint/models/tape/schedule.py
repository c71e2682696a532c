"""From nodes to programs: what is hoisted, in which order operations come, and which registers they use."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterable, Sequence
from graphlib import TopologicalSorter

import numpy as np

from .fusion import FusedOperation, steps_of
from .graph import STAGE, Graph
from .program import CODES, Integers, Program

Steps = dict[int, FusedOperation]
Registers = dict[int, int]  # by node
Rows = list[list[int]]

_SUM_IN: dict[str, Sequence[int]] = {"mul_add": (2,), "sub_mul": (2,), "add": (0, 1), "sub": (0,)}
"""Operands that may be a sum to which the operation adds a term."""

_BEGINS = frozenset({"add", "sub", "mul", "mul_add", "mul_sub", "sub_mul"})
"""Operations that a sum may begin with."""

_WINDOW = 64
"""The number of operations, or sums, that may change places: their results in 16 lanes are a quarter of the first-level cache."""


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
    stage_rows, end = _allocate(_by_kind(_sums(stage, results)), set(results), registers, setup_end)
    return Program(
        literals=np.array([graph.values[node] for node in literals], dtype=np.float64),
        setup=_array(setup_rows),
        stage=_array(stage_rows),
        outputs=np.array([registers[node] for node in results], dtype=np.int32),
        registers=end,
    )


def _allocate(steps: Steps, kept: Iterable[int], registers: Registers, first: int) -> tuple[Rows, int]:
    """Rows of the steps, and the end of the registers from `first` on that they write; a register is free after its last use.

    A step that adds a term to the sum of the step before writes to the same register.
    """
    uses = Counter(operand for step in steps.values() for operand in set(step.operands))
    uses.update(kept)  # one use that never comes
    rows, free, end = [], list[int](), first
    before = None
    for node, step in steps.items():
        operands = [registers[operand] for operand in step.operands]
        for operand in sorted(set(step.operands), key=lambda operand: operand == before):  # the sum last: its register is taken
            uses[operand] -= 1
            if not uses[operand] and operand in steps:
                free.append(registers[operand])
        if not free:
            free.append(end)
            end += 1
        registers[node] = free.pop()  # the one used last, which is still near
        rows.append([CODES[step.name], registers[node], *operands, *[0] * (3 - len(operands))])
        before = node
    return rows, end


def _sums(steps: Steps, kept: Iterable[int]) -> list[Steps]:
    """The steps in groups, each a sum that grows by a term with every step and is used nowhere else until it is whole.

    The core keeps such a sum at hand instead of storing it. No operand of a group depends on a partial sum of the same group: so
    groups can be ordered as single steps can.
    """
    uses = Counter(operand for step in steps.values() for operand in step.operands)
    uses.update(kept)
    next_of: dict[int, int] = {}  # by a sum, the step that adds a term to it
    written = dict(steps)
    for node, step in steps.items():
        for place in _SUM_IN.get(step.name, ()):
            partial = step.operands[place]
            if partial in steps and uses[partial] == 1 and steps[partial].name in _BEGINS:
                next_of[partial] = node
                if step.name == "add":  # the sum first
                    written[node] = FusedOperation("add", (partial, step.operands[1 - place]))
                break
    groups = []
    later = set(next_of.values())
    for first in [node for node in steps if node not in later]:
        group = [first]
        while group[-1] in next_of:
            group.append(next_of[group[-1]])
        groups.append({node: written[node] for node in group})
    return groups


def _by_kind(groups: list[Steps]) -> Steps:
    """The steps in another order: as many groups of one kind as can be follow each other, so that few kinds have to be decoded.

    Groups change places within windows alone: results are still in the first-level cache when they are used.
    """
    ordered: Steps = {}
    in_order = _depth_first(groups)
    for first in range(0, len(in_order), _WINDOW):
        ordered |= _window_by_kind(in_order[first : first + _WINDOW])
    return ordered


def _depth_first(groups: list[Steps]) -> list[Steps]:
    """The groups in an order in which each comes soon after those whose steps it uses."""
    uses = _uses(groups)
    done: dict[int, Steps] = {}
    stack = sorted(set(range(len(groups))).difference(*uses), reverse=True)  # what no other group uses
    while stack:
        k = stack.pop()
        if k in done:
            continue
        if missing := [other for other in uses[k] if other not in done]:
            stack += (k, *reversed(missing))
        else:
            done[k] = groups[k]
    return list(done.values())


def _uses(groups: list[Steps]) -> list[dict[int, None]]:
    """For each group, the others whose steps it uses."""
    group_of = {node: k for k, group in enumerate(groups) for node in group}
    operands = ((operand for step in group.values() for operand in step.operands) for group in groups)
    found = (dict.fromkeys(group_of.get(operand, k) for operand in many) for k, many in enumerate(operands))
    return [{other: None for other in others if other != k} for k, others in enumerate(found)]


def _window_by_kind(groups: list[Steps]) -> Steps:
    """The steps of one window, kind by kind."""
    kinds = [next(iter(group.values())).name if len(group) == 1 else "sum" for group in groups]
    ready: dict[str, deque[int]] = {kind: deque() for kind in kinds}
    sorter = TopologicalSorter(dict(enumerate(_uses(groups))))
    sorter.prepare()

    def take_ready() -> None:
        for k in sorter.get_ready():
            ready[kinds[k]].append(k)

    take_ready()
    ordered: Steps = {}
    while sorter.is_active():
        kind = max(ready, key=lambda name: len(ready[name]))
        while ready[kind]:
            k = ready[kind].popleft()
            ordered |= groups[k]
            sorter.done(k)
            take_ready()
    return ordered


def _array(rows: Rows) -> Integers:
    return np.array(rows, dtype=np.int32).reshape(-1, 5)
