"""What depends on what in the equations of a model, and which parameters can be identified apart from the others.

This is a statement about structure, made from which symbols stand in which equation. It says nothing about a design, and nothing
about whether the parameters inside a block can be distinguished: that is what `fisherpoint.identifiability` is for.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy
from numpy.typing import NDArray

from ..basics.values import FrozenMapping
from .surfaces.structure import Structure
from .tape.branch import Select
from .tape.defined import value_of
from .tape.parts import parts, symbols_of

Names = tuple[str, ...]


@dataclass(frozen=True)
class Equation:
    """A rate or an output: the states and parameters that it reads, and the states in which it is affine with known slope.

    A branch reads what its condition reads.
    """

    states: frozenset[str]
    parameters: frozenset[str]
    affine: frozenset[str]


class Dependence:
    """Which parameter reaches which output, and the independent blocks of parameters.

    Parameters
    ----------
    structure : Structure
    states, inputs, parameters, outputs : tuple of str
        Names, in the order of the equations.

    Attributes
    ----------
    reaches : mapping of parameter name to tuple of output names
        Outputs that change with the parameter, directly or through states.
    idle : tuple of str
        Parameters that reach no output.
    blocks : tuple of tuple of str
        Parameters, but the idle ones, in groups that can be identified independently of each other; see `blocks_of`.
    shown_states : mapping of state name to output name
        States that are an output as they are, with the first such output.
    direct_inputs : mapping of output name to tuple of input names
        Inputs that stand in the equation of each output.
    """

    def __init__(self, structure: Structure, states: Names, inputs: Names, parameters: Names, outputs: Names) -> None:
        self._parameters, read = parameters, _Reader(structure, states, parameters)
        self._rates = dict(zip(states, map(read, structure.rates), strict=True))
        for reset in structure.resets:  # which move a state as its rate does, at times that hang on their condition
            event = read(reset.condition)
            for x, value in reset.values:
                name, by = states[structure.equations.states.index(x)], read(value)
                old = self._rates[name]
                self._rates[name] = Equation(
                    old.states | by.states | event.states, old.parameters | by.parameters | event.parameters, frozenset()
                )
        for x, value in (pair for update in structure.updates for pair in update.values):
            name, by = states[structure.equations.states.index(x)], read(value)
            old = self._rates[name]
            self._rates[name] = Equation(old.states | by.states, old.parameters | by.parameters, frozenset())
        for name, rate in zip(states, structure.rates, strict=True):  # by the instants in which inputs switch
            taus = frozenset(str(tau) for u, tau in structure.equations.delays if u in read.symbols(rate))
            if taus:
                old = self._rates[name]
                self._rates[name] = Equation(old.states, old.parameters | taus, frozenset())
        self._output = dict(zip(outputs, map(read, structure.output), strict=True))
        late = {outputs[i]: str(tau) for i, tau in structure.equations.late.items()}
        for name, tau in late.items():
            of = self._output[name]
            self._output[name] = Equation(of.states, of.parameters | ({tau} & set(parameters)), of.affine)
        behind = {name: self._states_behind(equation.states) for name, equation in self._output.items()}
        reached = {
            name: equation.parameters.union(*(self._rates[state].parameters for state in behind[name]))
            for name, equation in self._output.items()
        }
        self.reaches: Mapping[str, Names] = FrozenMapping(
            {name: tuple(output for output in outputs if name in reached[output]) for name in self._parameters}
        )
        self.idle: Names = tuple(name for name in self._parameters if not self.reaches[name])
        self._seen = frozenset[str]().union(*behind.values())
        self.blocks: tuple[Names, ...] = blocks_of(self)
        equations = structure.equations
        shown = {value_of(g): name for name, g in reversed(list(zip(outputs, equations.output, strict=True))) if name not in late}
        self.shown_states: Mapping[str, str] = FrozenMapping(
            {name: shown[state] for name, state in zip(states, equations.states, strict=True) if state in shown}
        )
        standing = {name: read.symbols(g) for name, g in zip(outputs, structure.output, strict=True)}
        places = list(zip(equations.inputs, inputs, strict=True))
        self.direct_inputs: Mapping[str, Names] = FrozenMapping(
            {name: tuple(u for place, u in places if place in found) for name, found in standing.items()}
        )

    @property
    def equations(self) -> list[tuple[str | None, Equation]]:
        """Equations that an output hears of: outputs, with None, and the rates of states."""
        rates = [(state, equation) for state, equation in self._rates.items() if state in self._seen]
        return [*((None, equation) for equation in self._output.values()), *rates]

    def known_states(self) -> frozenset[str]:
        """States whose course is known where the outputs are measured, as `blocks_of` says."""
        known: set[str] = set()
        before = -1
        while len(known) > before:
            before = len(known)
            known |= {name for name in self._rates if not self._moving(name, known)}
            for state, equation in self.equations:
                unknown = equation.states - known
                if (state is None or state in known) and not equation.parameters and len(unknown) == 1:
                    known |= unknown & equation.affine
        return frozenset(known)

    def ordered(self, names: Iterable[str]) -> Names:
        """Parameters in the model's order."""
        return tuple(sorted(names, key=self._parameters.index))

    def _moving(self, state: str, known: Collection[str]) -> bool:
        """Whether a parameter moves the state otherwise than through known ones."""
        return any(self._rates[name].parameters for name in self._states_behind({state}, known))

    def _states_behind(self, states: Iterable[str], known: Collection[str] = ()) -> frozenset[str]:
        """States on which these depend, with these, but for those behind known ones."""
        found: set[str] = set()
        waiting = set(states)
        while waiting:
            state = waiting.pop()
            found.add(state)
            waiting |= self._rates[state].states - found - set(known)
        return frozenset(found)


def blocks_of(dependence: Dependence) -> tuple[Names, ...]:
    """Return the blocks of parameters that separate where the outputs are measured without gap or error.

    1. The course of a state is *known* where no parameter moves it, but through known states: its start is given. It is known too
       where an output, or the rate of a known state, reads no parameter and no other state that is not known, and is affine in
       it. So a state that is an output is known, and so are v in q' = v where q is, and q where v is.
    2. The rate of a known state is known too, as its time derivative. Each output, and the rate of each state that reaches one, is
       an equation in parameters and in states that are not known; the rate of such a state is one in this state as well.
    3. Parameters belong together where equations connect them: those in the same equation, and those in equations that share a
       state that is not known.

    Parameters of different blocks never meet in an equation, so each block can be estimated from its own equations alone, with the
    measured signals put in.
    """
    known = dependence.known_states()
    blocks: list[set[str]] = []  # of parameters, and of states marked by a quote
    for state, equation in dependence.equations:
        members = set(equation.parameters) | {f"{name}'" for name in equation.states - known}
        if state is not None and state not in known:
            members.add(f"{state}'")
        joined = [block for block in blocks if block & members]
        blocks = [block for block in blocks if not block & members] + [members.union(*joined)]
    named = [dependence.ordered(name for name in block if not name.endswith("'")) for block in blocks]
    everything = dependence.ordered(name for names in named for name in names)
    return tuple(sorted((names for names in named if names), key=lambda names: everything.index(names[0])))


def states_by_parameters(entries: Iterable[tuple[int, int]], n: int, p: int) -> NDArray[np.bool_]:
    """Which of n states depend on which of p parameters in the end (n, p), by the places (i, k) of the derivatives of f."""
    coupled, reached = np.zeros((n, n), dtype=bool), np.zeros((n, p), dtype=bool)
    for i, k in entries:
        (coupled if k < n else reached)[i, k if k < n else k - n] = True
    while not np.array_equal(more := reached | (coupled @ reached), reached):
        reached = more
    return reached


class _Reader:
    """Reads equations of a model in which branches are symbols for the side of a surface."""

    def __init__(self, structure: Structure, states: Names, parameters: Names) -> None:
        self._sides = {surface.side: surface.expression for surface in structure.surfaces}
        self._states = dict(zip(structure.equations.states, states, strict=True))
        self._parameters = dict(zip(structure.equations.parameters, parameters, strict=True))

    def __call__(self, expression: sympy.Expr) -> Equation:
        symbols = self.symbols(expression)
        states = {symbol for symbol in symbols if symbol in self._states}
        # Used only where a single state is unknown, and then no parameter may stand there.
        parameters = frozenset(self._parameters[symbol] for symbol in symbols if symbol in self._parameters)
        affine = set() if parameters else {state for state in states if self._is_affine(expression, state)}
        return Equation(self._names(states), parameters, self._names(affine))

    def _is_affine(self, expression: sympy.Expr, state: sympy.Symbol) -> bool:
        """Whether the expression is affine in the state, part by part: it is multiplied only with what does not read it."""
        degrees: dict[Any, int] = {}  # 2 for whatever is not affine
        for part in parts(expression):
            below = [degrees[argument] for argument in part.args]
            if not below:
                degrees[part] = 2 * (state in self.symbols(part)) if part != state else 1
            elif isinstance(part, sympy.Add) or (isinstance(part, Select) and not below[0]):
                degrees[part] = max(below)
            else:
                degrees[part] = min(sum(below), 2) if isinstance(part, sympy.Mul) else 2 * any(below)
        return degrees[expression] < 2

    def _names(self, states: Iterable[sympy.Symbol]) -> frozenset[str]:
        return frozenset(self._states[state] for state in states)

    def symbols(self, expression: sympy.Expr) -> set[sympy.Symbol]:
        """Symbols of an expression and of the surfaces on whose side it depends."""
        found: set[sympy.Symbol] = set()
        waiting = symbols_of(expression)
        while waiting:
            symbol = waiting.pop()
            found.add(symbol)
            if symbol in self._sides:
                waiting |= symbols_of(self._sides[symbol]) - found
        return found
