"""Expressions as a graph of operations in which equal subexpressions are one node."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from .program import COMMUTATIVE, EVEN, ODD, OPERATIONS, PARTIAL

LITERAL, TRAJECTORY, STAGE = range(3)
"""How often a node's value changes: never, with theta and u from trajectory to trajectory, with every evaluation."""

MAX_POWER = 1024  # larger integer powers are left to `pow`


@dataclass(frozen=True)
class Leaves:
    """Leaves that an expression can read, in the order of a program's registers: theta, u, x, side and dx."""

    parameters: int
    inputs: int
    states: int
    sides: int

    def _range(self, start: int, size: int) -> range:
        return range(start, start + size)

    @property
    def theta(self) -> range:
        return range(self.parameters)

    @property
    def u(self) -> range:
        return self._range(self.theta.stop, self.inputs)

    @property
    def x(self) -> range:
        return self._range(self.u.stop, self.states)

    @property
    def side(self) -> range:
        return self._range(self.x.stop, self.sides)

    @property
    def dx(self) -> range:
        return self._range(self.side.stop, self.states)

    @property
    def count(self) -> int:
        return self.dx.stop


class Graph:
    """A graph of operations; nodes are numbers, operands come before what uses them, and leaves come first.

    `names[n]` is the operation of node n, or "leaf" or "literal"; `operands[n]` are its operands, `values[n]` is the value of a
    literal, `reads[n]` a set of bits, one for every leaf that its value depends on, `levels[n]` says how often that changes, and
    `partial[n]` whether it is made of what has no finite value everywhere, such as a root or a quotient. `half_powers[n]` says of
    products with a root that they are base**exponent, or minus that: (negative, base, exponent).

    The methods named after operations simplify what is exact but for rounding: they fold literals, drop neutral elements, and pull
    signs outwards, where sums absorb them, and factors that the state does not enter, where they meet others of their kind.
    """

    def __init__(self, leaves: Leaves) -> None:
        self.leaves = leaves
        self.names: list[str] = []
        self.operands: list[tuple[int, ...]] = []
        self.values: list[float] = []
        self.reads: list[int] = []
        self.levels: list[int] = []
        self.partial: list[bool] = []
        self.half_powers: dict[int, tuple[bool, int, float]] = {}
        self._nodes: dict[tuple[object, ...], int] = {}
        for leaf in range(leaves.count):
            self._append("leaf", (), math.nan, 1 << leaf, STAGE if leaf >= leaves.x.start else TRAJECTORY)
        self.zero, self.one = self.literal(0.0), self.literal(1.0)

    def _append(self, name: str, operands: tuple[int, ...], value: float, reads: int, level: int) -> int:
        self.names.append(name)
        self.operands.append(operands)
        self.values.append(value)
        self.reads.append(reads)
        self.levels.append(level)
        self.partial.append(name in PARTIAL or any(self.partial[operand] for operand in operands))
        return len(self.names) - 1

    def literal(self, value: float) -> int:
        """Node of a number; all NaN are one."""
        value = math.nan if math.isnan(value) else float(value) + 0.0  # no negative zero
        key = ("literal", "nan" if math.isnan(value) else value)
        if key not in self._nodes:
            self._nodes[key] = self._append("literal", (), value, 0, LITERAL)
        return self._nodes[key]

    def is_literal(self, node: int) -> bool:
        return self.names[node] == "literal"

    def find(self, name: str, *operands: int) -> int | None:
        """Return the node of this very operation, if there is one."""
        return self._nodes.get((name, *(sorted(operands) if name in COMMUTATIVE else operands)))

    def operation(self, name: str, *operands: int) -> int:
        """Node of an operation as it is: literals are folded, equal nodes shared, nothing else."""
        if all(map(self.is_literal, operands)):
            with np.errstate(all="ignore"):
                return self.literal(float(OPERATIONS[name].compute(*(np.float64(self.values[n]) for n in operands))))
        if name in COMMUTATIVE:
            operands = tuple(sorted(operands))
        key = (name, *operands)
        if key not in self._nodes:
            reads = 0
            for operand in operands:
                reads |= self.reads[operand]
            self._nodes[key] = self._append(name, operands, math.nan, reads, max(self.levels[n] for n in operands))
        return self._nodes[key]

    def unsigned(self, node: int) -> tuple[bool, int]:
        """Whether a node is negated, and what is."""
        if self.names[node] == "neg":
            return True, self.operands[node][0]
        if self.is_literal(node) and self.values[node] < 0:
            return True, self.literal(-self.values[node])
        return False, node

    def neg(self, a: int) -> int:
        if self.is_literal(a):
            return self.literal(-self.values[a])
        return self.operands[a][0] if self.names[a] == "neg" else self.operation("neg", a)

    def signed(self, negative: bool, a: int) -> int:
        return self.neg(a) if negative else a

    def add(self, a: int, b: int) -> int:
        if self.is_literal(a) and self.is_literal(b):
            return self.operation("add", a, b)
        if a == self.zero or b == self.zero:
            return a if b == self.zero else b
        if a == b:
            return self.mul(self.literal(2.0), a)
        (minus_a, p), (minus_b, q) = self.unsigned(a), self.unsigned(b)
        if minus_a and minus_b:
            return self.neg(self.add(p, q))
        if minus_a or minus_b:
            return self.sub(b, p) if minus_a else self.sub(a, q)
        return self.operation("add", a, b)

    def sub(self, a: int, b: int) -> int:
        if self.is_literal(a) and self.is_literal(b):
            return self.operation("sub", a, b)
        if a == b:
            return self.zero
        if a == self.zero or b == self.zero:
            return a if b == self.zero else self.neg(b)
        (minus_a, p), (minus_b, q) = self.unsigned(a), self.unsigned(b)
        if minus_b:
            return self.sub(q, p) if minus_a else self.add(a, q)
        if minus_a and not self.is_literal(a):
            return self.neg(self.add(p, b))
        reverse = self.find("sub", b, a)
        return self.operation("sub", a, b) if reverse is None else self.neg(reverse)

    def mul(self, a: int, b: int) -> int:
        if self.is_literal(a) and self.is_literal(b):
            return self.operation("mul", a, b)
        (minus_a, a), (minus_b, b) = self.unsigned(a), self.unsigned(b)
        if minus_a or minus_b:
            return self.signed(minus_a != minus_b, self.mul(a, b))
        if self.levels[b] < self.levels[a] or self.is_literal(b):
            a, b = b, a
        if a == self.zero:
            return a
        if a == self.one:
            return b
        for factor, switch in ((a, b), (b, a)):
            if self.names[switch] == "select" and set(self.operands[switch][1:]) == {self.zero, self.one}:
                condition, first, _ = self.operands[switch]
                return self.select(condition, *((factor, self.zero) if first == self.one else (self.zero, factor)))
        (h, p), (k, q) = self._coefficient(a), self._coefficient(b)
        if self.levels[a] < self.levels[b] and k != self.one and (self.levels[b] == STAGE or self.is_literal(k)):
            return self.mul(self.mul(a, k), q)
        if h != self.one and k != self.one:
            return self.mul(self.mul(h, k), self.mul(p, q))
        return self.operation("mul", a, b)

    def _coefficient(self, node: int) -> tuple[int, int]:
        """Split a product into a factor of a lower level, or 1, and the rest."""
        if self.names[node] == "mul":
            a, b = self.operands[node]
            if self.levels[a] != self.levels[b]:
                return (a, b) if self.levels[a] < self.levels[b] else (b, a)
        return self.one, node

    def div(self, a: int, b: int) -> int:
        if self.is_literal(a) and self.is_literal(b):
            return self.operation("div", a, b)
        if a == self.zero or b == self.one:
            return a
        if a == b:
            return self.one
        (minus_a, a), (minus_b, b) = self.unsigned(a), self.unsigned(b)
        if minus_a or minus_b:
            return self.signed(minus_a != minus_b, self.div(a, b))
        if self.levels[b] < self.levels[a] or self.is_literal(b):
            return self.mul(a, self.div(self.one, b))
        if self.names[b] == "div":
            return self.mul(a, self.div(self.operands[b][1], self.operands[b][0]))
        k, q = self._coefficient(b)
        if k != self.one and self.levels[a] < self.levels[b]:
            return self.div(self.div(a, k), q)
        return self.operation("div", a, b)

    def pow(self, a: int, b: int) -> int:
        """a**b: by products for integers, with a root for half integers, by exp for a literal base."""
        if self.is_literal(b) and not self.is_literal(a):
            exponent = self.values[b]
            if exponent < 0 and (2 * exponent).is_integer():
                return self.div(self.one, self.pow(a, self.literal(-exponent)))
            if exponent.is_integer() and exponent <= MAX_POWER:
                return self._integer_power(a, int(exponent))
            # The derivative of a root times a power is 0 times infinity where the base is 0; that of a power is not.
            touches = exponent > 1 and self.names[a] == "abs"
            if (2 * exponent).is_integer() and exponent <= MAX_POWER and not touches:
                power = self.mul(self._integer_power(a, int(exponent)), self.call("sqrt", a))
                negative, product = self.unsigned(power)
                if exponent > 1:
                    self.half_powers[product] = negative, a, exponent
                return power
        if self.is_literal(a) and not self.is_literal(b) and self.values[a] > 0:
            return self.call("exp", self.mul(self.literal(math.log(self.values[a])), b))
        return self.operation("pow", a, b)

    def _integer_power(self, a: int, exponent: int) -> int:
        result = self.one
        while exponent:
            if exponent & 1:
                result = self.mul(result, a)
            exponent >>= 1
            if exponent:
                a = self.mul(a, a)
        return result

    def call(self, name: str, a: int) -> int:
        """Node of a function of one argument; sin(-a) = -sin(a), cos(-a) = cos(a) and the like."""
        negative, argument = self.unsigned(a)
        if name in EVEN:
            return self.operation(name, argument)
        return self.signed(negative, self.operation(name, argument)) if name in ODD else self.operation(name, a)

    def min(self, a: int, b: int) -> int:
        return a if a == b else self.operation("min", a, b)

    def max(self, a: int, b: int) -> int:
        return a if a == b else self.operation("max", a, b)

    def select(self, condition: int, a: int, b: int) -> int:
        """a where the condition is positive, else b."""
        if self.is_literal(condition):
            return a if self.values[condition] > 0 else b
        negative, side = self.unsigned(condition)
        if side in self.leaves.side:  # it is 1 or -1, never 0
            a, b = (b, a) if negative else (a, b)
            condition = side
            if self.is_literal(a) and self.values[a] == 1 and self.is_literal(b) and self.values[b] == -1:
                return side
            if self.is_literal(a) and self.values[a] == -1 and b == self.one:
                return self.neg(side)
        if self.names[a] == "select" and self.operands[a][0] == condition:
            a = self.operands[a][1]
        if self.names[b] == "select" and self.operands[b][0] == condition:
            b = self.operands[b][2]
        return a if a == b else self.operation("select", condition, a, b)

    def needed(self, roots: Iterable[int]) -> list[int]:
        """Return the nodes that the roots are made of, themselves included, operands first."""
        seen, open_nodes = set(roots), list(set(roots))
        while open_nodes:
            for operand in self.operands[open_nodes.pop()]:
                if operand not in seen:
                    seen.add(operand)
                    open_nodes.append(operand)
        return sorted(seen)
