"""What depends on what in the equations of a model: which symbols stand in which equation."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import sympy
from numpy.typing import NDArray

from ..basics.values import FrozenMapping
from .blocks import Names, Row, Separation
from .instants import RandomInstants
from .surfaces.structure import Structure
from .tape.defined import value_of
from .tape.parts import symbols_of


@dataclass(frozen=True)
class Equation:
    """A rate or an output: the states and parameters that it reads, and whether it holds at every instant as it is written.

    A branch reads what its condition reads. A rate reads too what sets its state anew, and a dead time that is a parameter.
    """

    states: frozenset[str]
    parameters: frozenset[str]
    plain: bool = True


class Dependence:
    """Which parameter reaches which output, and the independent blocks of parameters.

    Parameters
    ----------
    structure : Structure
    states, inputs, parameters, outputs : tuple of str
        Names, in the order of the equations.
    sizes : mapping of name to float
        Usual sizes of states, inputs and parameters; 1 for others.

    Attributes
    ----------
    reaches : mapping of parameter name to tuple of output names
        Outputs that change with the parameter, directly or through states.
    idle : tuple of str
        Parameters that reach no output.
    shown_states : mapping of state name to output name
        States that are an output as they are, with the first such output.
    direct_inputs : mapping of output name to tuple of input names
        Inputs that stand in the equation of each output.
    """

    def __init__(
        self,
        structure: Structure,
        states: Names,
        inputs: Names,
        parameters: Names,
        outputs: Names,
        sizes: Mapping[str, float],
    ) -> None:
        self._equations, self._names = structure.equations, (states, inputs, parameters)
        self._sizes, read = sizes, _Reader(structure, states, parameters)
        self._rates = dict(zip(states, map(read, structure.rates), strict=True))
        for reset in structure.resets:  # which move a state as its rate does, at times that hang on their condition
            event = read(reset.condition)
            for x, value in reset.values:
                name, by = states[structure.equations.states.index(x)], read(value)
                old = self._rates[name]
                self._rates[name] = Equation(
                    old.states | by.states | event.states, old.parameters | by.parameters | event.parameters, plain=False
                )
        for x, value in (pair for update in structure.updates for pair in update.values):
            name, by = states[structure.equations.states.index(x)], read(value)
            old = self._rates[name]
            self._rates[name] = Equation(old.states | by.states, old.parameters | by.parameters, plain=False)
        self._output = dict(zip(outputs, map(read, structure.output), strict=True))
        written = (states, structure.rates, self._rates), (outputs, structure.output, self._output)
        for own, name, expression in ((own, *pair) for names, given, own in written for pair in zip(names, given, strict=True)):
            taus = frozenset(str(tau) for u, tau in structure.equations.delays if u in read.symbols(expression))
            if taus:  # by the instants in which inputs switch
                own[name] = Equation(own[name].states, own[name].parameters | taus, plain=False)
        late = {outputs[i]: str(tau) for i, tau in structure.equations.late.items()}
        for name, tau in late.items():
            of = self._output[name]
            if tau in parameters:
                self._output[name] = Equation(of.states, of.parameters | {tau}, plain=False)
        behind = {name: self._states_behind(equation.states) for name, equation in self._output.items()}
        reached = {
            name: equation.parameters.union(*(self._rates[state].parameters for state in behind[name]))
            for name, equation in self._output.items()
        }
        self.reaches: Mapping[str, Names] = FrozenMapping(
            {name: tuple(output for output in outputs if name in reached[output]) for name in parameters}
        )
        self.idle: Names = tuple(name for name in parameters if not self.reaches[name])
        self._seen = frozenset[str]().union(*behind.values())
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

    @cached_property
    def blocks(self) -> tuple[Names, ...]:
        """Parameters, but the idle ones, in groups that are identified apart from each other: see `fisherpoint.models.blocks`."""
        states, inputs, parameters = self._names
        equations = self._equations
        names = dict(zip((*equations.states, *equations.parameters), (*states, *parameters), strict=True))
        sizes = {
            symbol: self._sizes.get(name, 1.0) for symbol, name in (*names.items(), *zip(equations.inputs, inputs, strict=True))
        }
        instants = RandomInstants(equations, names, sizes)
        rates, outputs = self._rates.items(), self._output.values()
        rows = [
            Row(i, name, rate.states | rate.parameters, rate.plain) for i, (name, rate) in enumerate(rates) if name in self._seen
        ]
        rows += [Row(i, None, of.states | of.parameters, of.plain) for i, of in enumerate(outputs, len(rates))]
        return Separation(rows, self._unmoved, instants).of(parameters)

    def _unmoved(self, known: frozenset[str]) -> frozenset[str]:
        """States that no parameter moves but through known states, or that is known itself: they follow from their start."""
        return frozenset(
            name
            for name in self._rates
            if not any(self._rates[behind].parameters - known for behind in self._states_behind({name}, known))
        )

    def _states_behind(self, states: Iterable[str], known: Collection[str] = ()) -> frozenset[str]:
        """States on which these depend, with these, but for those behind known ones."""
        found: set[str] = set()
        waiting = set(states)
        while waiting:
            state = waiting.pop()
            found.add(state)
            waiting |= self._rates[state].states - found - set(known)
        return frozenset(found)


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
        parameters = frozenset(self._parameters[symbol] for symbol in symbols if symbol in self._parameters)
        return Equation(frozenset(self._states[symbol] for symbol in symbols if symbol in self._states), parameters)

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
