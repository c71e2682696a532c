"""What the equations of a model imply: where f switches, where f and g have a value, and the programs that the core runs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain, repeat
from typing import Any

import numpy as np
import sympy

from ...basics.values import Array
from ..tape.defined import Defined, value_of, values_of
from ..tape.parts import parts, reads, symbols_of
from ..tape.programs import Programs, Surfaces, build_programs
from ..tape.reset import Reset
from ..tape.update import Update
from .branches import Branches, Surface
from .domain import Domain, Limit
from .evaluate import Evaluator, evaluate
from .jumps import classified
from .memory import Memory, remembered
from .powers import Powers
from .zeros import normal_form


@dataclass(frozen=True)
class Equations:
    """f, g, the conditions that must stay positive, and limits along the way (text, what must stay positive), in symbols."""

    rates: tuple[Any, ...]
    output: tuple[Any, ...]
    conditions: tuple[Any, ...]
    states: tuple[Any, ...]
    inputs: tuple[Any, ...]
    parameters: tuple[Any, ...]
    constants: Mapping[Any, float]
    along: tuple[tuple[str, Any], ...] = ()
    resets: tuple[Reset, ...] = ()
    latches: tuple[tuple[Any, int], ...] = ()
    """States, among the others, that are what latches remember, with their values at first."""
    updates: tuple[Update, ...] = ()
    delays: tuple[tuple[Any, Any], ...] = ()
    """Inputs whose dead times are parameters, and these."""
    late: Mapping[int, Any] = field(default_factory=dict)
    """Delays of late outputs, by their places: symbols, or numbers."""

    def changed(self, change: Callable[[Any, str], Any], rates: Sequence[str] = (), output: Sequence[str] = ()) -> Equations:
        """The equations with every expression changed; `change` is given its place too, where it is known."""

        def each(expressions: Iterable[Any], places: Iterable[str]) -> tuple[Any, ...]:
            return tuple(change(one, place) for one, place in zip(expressions, chain(places, repeat("equations")), strict=False))

        def values(of: Iterable[tuple[Any, Any]]) -> tuple[tuple[Any, Any], ...]:
            return tuple((x, change(value, f"resets.{x.name}")) for x, value in of)

        return replace(
            self,
            rates=each(self.rates, rates),
            output=each(self.output, output),
            conditions=each(self.conditions, (f"domain[{i}]" for i in range(len(self.conditions)))),
            along=tuple((text, change(one, "along")) for text, one in self.along),
            resets=tuple(replace(one, condition=change(one.condition, "resets"), values=values(one.values)) for one in self.resets),
            updates=tuple(replace(one, values=values(one.values)) for one in self.updates),
        )

    def values_anew(self) -> Iterator[Any]:
        """Conditions of resets, and what states are set to."""
        yield from (reset.condition for reset in self.resets)
        yield from (
            value for values in (*(one.values for one in self.resets), *(one.values for one in self.updates)) for _, value in values
        )


def followed(equations: Equations, clock: Any = None) -> Equations:
    """The equations as the core follows them, with further states: one for every latch, then a clock where there is one."""
    memory = Memory()
    rates = tuple(memory.without_latches(rate) for rate in equations.rates)
    resets = remembered(equations.resets, memory)
    hidden, rates_of_hidden = tuple(memory.starts), (sympy.S.Zero,) * len(memory.starts)
    if clock is not None:
        hidden, rates_of_hidden = (*hidden, clock), (*rates_of_hidden, sympy.S.One)
    states = (*equations.states, *hidden)
    latches = tuple(memory.starts.items())
    return replace(equations, rates=(*rates, *rates_of_hidden), states=states, resets=resets, latches=latches)


class Structure:
    """Attributes: rates and output without branches on what is not known, surfaces (jumps first), limits (poles first)."""

    def __init__(self, equations: Equations) -> None:
        self.equations = equations
        # What a latch remembers changes where states are set anew alone: it has no surface, and branches are by its value.
        remembered = {state for state, _ in equations.latches}
        states = tuple(state for state in equations.states if state not in remembered)
        by_side = Branches(states, True, equations.inputs, equations.constants)
        by_value = Branches(states, by_side=False)
        written = [by_side.rewrite(expression) for expression in equations.rates]
        conditions_of_resets = values_of(by_side.rewrite(reset.condition) for reset in equations.resets)
        rates = values_of(written)
        known = values_of((*equations.conditions, *(condition for _, condition in equations.along)))
        classed = classified(rates, by_side, states, equations.constants, known)
        conditions_of_resets = [by_side.merged(condition) for condition in conditions_of_resets]
        classed = _with_jumps(classed, conditions_of_resets)
        merged = [replace(surface, expression=by_side.merged(surface.expression)) for surface in classed]
        powers = Powers(merged)
        whole_rates = [powers.rewrite(by_side.merged(rate)) for rate in written]
        self.rates = values_of(whole_rates)
        surfaces = [replace(surface, expression=powers.rewrite(surface.expression)) for surface in merged]
        steep = dict(zip(surfaces, steep_ones(surfaces, self.rates), strict=True))
        self.surfaces = sorted(surfaces, key=lambda surface: (not surface.jump, not surface.jump and not steep[surface]))
        self.resets = [
            replace(
                reset,
                condition=value_of(powers.rewrite(condition)),
                values=tuple((state, value_of(powers.rewrite(by_value.rewrite(value)))) for state, value in reset.values),
            )
            for reset, condition in zip(equations.resets, conditions_of_resets, strict=True)
        ]
        self.updates = [
            replace(one, values=tuple((state, value_of(powers.rewrite(by_value.rewrite(value)))) for state, value in one.values))
            for one in equations.updates
        ]
        whole_output = [powers.rewrite(by_value.rewrite(expression)) for expression in equations.output]
        self.output = values_of(whole_output)

        domain = Domain(equations.constants, self.surfaces)
        for text, condition in equations.along:
            domain.declare(by_value.rewrite(condition), condition, text)
        for condition in equations.conditions:
            domain.declare(by_value.rewrite(condition), condition)
            if isinstance(condition, Defined):
                domain.read(by_value.rewrite(condition), by_value.origin)
        of_rates, of_output = (powers.origin_of(branches.origin) for branches in (by_side, by_value))
        for expression in (*whole_rates, *(surface.expression for surface in self.surfaces)):
            domain.read(expression, of_rates)
        for expression in whole_output:
            domain.read(expression, of_output, measured=True)
        moving = {*equations.states, *equations.inputs, *(surface.side for surface in self.surfaces)}
        limits = domain.limits
        self.limits = [limit for limit in limits if reads(limit.expression, moving)]
        self.of_parameters = [limit for limit in limits if not reads(limit.expression, moving)]
        self._check_constants()

    def _check_constants(self) -> None:
        parameters = set(self.equations.parameters)
        fixed = [limit for limit in self.of_parameters if not reads(limit.expression, parameters)]
        self.of_parameters = [limit for limit in self.of_parameters if limit not in fixed]
        _refuse(fixed, evaluate([limit.expression for limit in fixed], self.equations.constants), "constants.")

    def check_theta(self, rows: Array) -> None:
        """Raise where one of the rows (K, p) breaks a limit that neither state nor input enters."""
        if self.of_parameters:
            given = dict(zip(self.equations.parameters, rows.T, strict=True))
            _refuse(self.of_parameters, self._values_of_limits({**self.equations.constants, **given}), "")

    @cached_property
    def _values_of_limits(self) -> Evaluator:
        """The values of `of_parameters`."""
        return Evaluator([limit.expression for limit in self.of_parameters])

    def rough(self) -> list[bool]:
        """Whether f takes a root or a logarithm of what is zero on each jump and kink, or of what reads its side."""
        if not self.surfaces:
            return []
        under = {part.args[0] for part in parts(*self.rates) if _is_root(part)}
        factors = {factor for base in under for factor in sympy.Mul.make_args(base) if not factor.is_number}
        values = {factor.args[0] if isinstance(factor, sympy.Abs) else factor for factor in factors}
        forms = {normal_form(value)[0] for value in values}
        return [
            normal_form(surface.expression)[0] in forms or any(reads(base, {surface.side}) for base in under)
            for surface in self.surfaces
        ]

    @cached_property
    def programs(self) -> Programs:
        """All programs of the model."""
        equations = self.equations
        surfaces = Surfaces(
            values=[*(surface.expression for surface in self.surfaces), *(limit.expression for limit in self.limits)],
            sides=[surface.side for surface in self.surfaces],
            poles=sum(limit.pole for limit in self.limits),
            measured=sum(limit.measured for limit in self.limits),
            crossable=[surface.crossable for surface in self.surfaces if surface.jump],
            rough=self.rough(),
            steep=steep_ones(self.surfaces, self.rates),
            closed=[limit.closed for limit in self.limits if not limit.pole and not limit.measured],
        )
        of = equations.states, equations.inputs, equations.parameters
        more = equations.constants, self.resets, equations.delays
        return build_programs(self.rates, self.output, surfaces, *of, *more, updates=self.updates)


def steep_ones(surfaces: Sequence[Surface], rates: Sequence[Any]) -> list[bool]:
    """Whether the slope of rates has no bounds at each surface: they take a root of what is zero on it."""
    if not surfaces:
        return []
    powers = [part for part in parts(*rates) if part.is_Pow and isinstance(part.base, sympy.Abs)]
    forms = {normal_form(power.base.args[0])[0] for power in powers if not power.exp.is_number or 0 < power.exp < 1}
    return [normal_form(surface.expression)[0] in forms for surface in surfaces]


def _with_jumps(surfaces: Sequence[Surface], conditions: Sequence[Any]) -> list[Surface]:
    """Jumps first, among them all surfaces on whose sides states are set anew."""
    read = symbols_of(*conditions)
    # Those at which f has no jump move no other surface either.
    classed = [
        replace(surface, jump=True, crossable=surface.crossable or not surface.jump) if surface.side in read else surface
        for surface in surfaces
    ]
    return [surface for surface in classed if surface.jump] + [surface for surface in classed if not surface.jump]


def _refuse(limits: Sequence[Limit], values: Sequence[Any], place: str) -> None:
    """Raise where a limit does not hold with its values."""
    for limit, given in zip(limits, map(np.atleast_1d, values), strict=True):
        holds = given != 0 if limit.pole else given > 0
        if not holds.all():
            expected = "a number other than 0" if limit.pole else "a positive number"
            raise ValueError(f"{place}{limit.name}: expected {expected}, given {given[~holds][0]:g}")


def _is_root(part: Any) -> bool:
    return part.func is sympy.log or (part.is_Pow and not part.exp.is_Integer)
