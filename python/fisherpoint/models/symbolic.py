"""Models given by their equations, as SymPy expressions or as text."""

from __future__ import annotations

import copy
import warnings
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from typing import Any, Unpack

import numpy as np
from numpy.typing import NDArray

from ..basics.checks import check_flag, check_known
from ..basics.quantity import Quantity, names_of
from ..basics.values import Array, FrozenMapping
from ..engine import _core
from ..engine.levels import Kernels
from .clock import NAMES, clock_quantity
from .compiled import CompiledCore, compiled_model
from .dependence import Dependence, states_by_parameters
from .expression_list import key_of
from .expressions import symbol
from .given_equations import Written, listed_equations
from .hidden_states import HiddenCore, HiddenKernels
from .model_text import latex, model_text
from .model_to_toml import Texts, equations_toml
from .quantities import RESERVED, Described, DescribedModel, check_counts, start_offsets
from .read_equations import FurtherEquations, given_equations, read_equations
from .sharing import Shared, is_made_by_models, is_readable, with_shared_parts
from .surfaces.branches import Surface
from .surfaces.domain import Limit
from .surfaces.printing import to_text
from .surfaces.structure import Structure, followed
from .tape.delay import delay_in
from .tape.parts import replaced, symbols_of
from .tape.program import Program, to_core
from .tape.programs import LIMIT
from .units_of_models import mistakes_of, warn_of_mistakes
from .written import WrittenEquations


def _names(of: Callable[[Structure], Iterable[Surface | Limit]]) -> Any:
    """An attribute with what is zero on surfaces or limits as text, which is made at its first use."""

    def names(model: SymbolicModel) -> tuple[str, ...]:
        written = (one.written for one in of(model.structure))
        return tuple(one if isinstance(one, str) else model._text_of(one) for one in written)

    return cached_property(names)


class SymbolicModel(DescribedModel):
    """A model x' = f(x, u, theta), y = g(x, u, theta) given by its equations.

    Where f is not smooth and where f and g have no value is found in the equations: see `jumps`, `kinks` and `domain`.

    Parameters
    ----------
    f : sequence or matrix of sympy.Expr or str
        Rates of the states, SI units; empty for a static model y = g(u, theta).
    g : sequence or matrix of sympy.Expr or str
        Outputs.
    states, inputs, parameters : mapping of name to unit
        A unit is a text such as ``"m3/(s sqrt(Pa))"``; ``(unit, scale)`` states the natural size too, to which tolerances refer,
        and a `Quantity` more. Symbols of the equations are known by these names.
    outputs : mapping of name to unit
        Default: y or y_1, y_2, ... without unit.
    constants : mapping of name to (value, unit), optional
        Known constants.
    name : str
    nominal : mapping of parameter name to float, optional
        Usual values.
    check_units : bool
        Whether a warning names places of the equations where units do not fit, as of ``x**2 - k*x`` with x in m and k in 1/s.
    definitions : mapping of name to sympy.Expr or str, optional
        Intermediate quantities, which equations and later definitions have by name; see `let`.
    domain : sequence of sympy.Expr or str, optional
        What else must stay positive, beside the arguments of roots and logarithms.
    resets : mapping of condition or times to mapping of state name to value, or sequence of such pairs, optional
        States that get new values where a condition becomes true, as ``{"x < 0": {"v": "-e*v"}}`` of a mass that bounces, or at
        known times, as ``{"every 5 ms": {"i": "i + k*(r - q)"}}`` of a controller and ``{"each segment": {"d": "d + dose"}}``.
        Conditions and values are texts, expressions or terms; the values are of the states just before.

    Raises
    ------
    ValueError
        For a mistake in the equations, names or units: one line that names the equation or quantity.
    """

    def __init__(
        self,
        f: Any,
        g: Any,
        states: Described,
        inputs: Described,
        parameters: Described,
        outputs: Described | None = None,
        *,
        constants: Mapping[str, Any] | None = None,
        name: str = "model",
        nominal: Mapping[str, float] | None = None,
        check_units: bool = True,
        **further: Unpack[FurtherEquations],
    ) -> None:
        given = given_equations(f, g, **further)
        if outputs is None:
            outputs = {"y": "1"} if len(given.g) == 1 else {f"y_{i + 1}": "1" for i in range(len(given.g))}
        check_counts(LIMIT, states=states, inputs=inputs, parameters=parameters, outputs=outputs, constants=constants)
        self._describe(states, inputs, parameters, outputs, constants, name, nominal)
        if not self.states and not self.inputs:
            raise ValueError("states: expected a state or an input, given neither")
        for kind in ("states", "parameters"):
            if len(getattr(self, kind)) > LIMIT:
                raise ValueError(f"{kind}: expected at most {LIMIT}, given {len(getattr(self, kind))}")
        read = read_equations(self, given)
        self._written, self._written_out, self.equations, self.clock = read.written, read.written_out, read.equations, read.clock
        self.delays = FrozenMapping(read.delays)
        late = {self.outputs[i].name: tau for i, tau in self.equations.late.items()}
        self.late_outputs = FrozenMapping({name: tau.name if tau.is_Symbol else float(tau) for name, tau in late.items()})
        self.updates = tuple(update.times for update in self.equations.updates)
        self.structure = Structure(followed(self.equations, self.clock))
        self.latches = len(self.structure.equations.latches)
        if check_flag(check_units, "check_units"):
            self.warn_of_units(stacklevel=3)

    @cached_property
    def _shared(self) -> Shared:
        """The equations as they are written, with definitions of the model's own where formulas are long."""
        names = {q.name for of in (*self._quantities(), self.outputs) for q in of}
        return with_shared_parts(self._written, {*names, *NAMES, *RESERVED})

    @cached_property
    def texts(self) -> Texts:
        """The equations as text; those that were given as text as they were given."""
        return self._shared.written.texts()

    @property
    def definitions(self) -> Mapping[str, str]:
        """The definitions of intermediate quantities by name, as text, those before others in which they stand."""
        return FrozenMapping(self.texts.definitions)

    def _text_of(self, expression: Any) -> str:
        """An expression of `equations` as text, with definitions by their names; with those that models make where it is long."""
        named = self._shared.named | self._written_out.named
        given = {value: one for value, one in named.items() if not is_made_by_models(one.name)}
        readable = replaced(expression, given) if given else expression
        if is_readable(readable) or len(given) == len(named):
            return to_text(readable)
        return to_text(replaced(expression, named))

    jumps: tuple[str, ...] = _names(lambda of: (surface for surface in of.surfaces if surface.jump))
    kinks: tuple[str, ...] = _names(lambda of: (surface for surface in of.surfaces if not surface.jump))
    crossable: tuple[str, ...] = _names(lambda of: (surface for surface in of.surfaces if surface.crossable))
    domain: tuple[str, ...] = _names(lambda of: of.limits)
    poles: tuple[str, ...] = _names(lambda of: (limit for limit in of.limits if limit.pole))

    @cached_property
    def mistakes_in_units(self) -> tuple[str, ...]:
        """Where units of the equations do not fit for certain, a sentence each.

        Quantities in "1", and numbers other than small whole ones, may be in any unit: they are no mistake.
        """
        return mistakes_of(self, self.equations, self.clock)

    def warn_of_units(self, stacklevel: int = 2) -> None:
        """Warn of `mistakes_in_units`, where there are any."""
        warn_of_mistakes(self.name, self.mistakes_in_units, stacklevel + 1)

    @cached_property
    def core(self) -> Any:
        """The model's programs, as the compiled kernels interpret them, or with kernels of its own."""
        core = self._tape if self._compiled is None else self._compiled.core
        return HiddenCore(core, len(self.states), self._hidden_starts) if self._hidden_starts else core

    @property
    def kernels(self) -> Kernels:
        """What runs `core`."""
        return HiddenKernels(super().kernels) if self._hidden_starts else super().kernels

    def at(self, x: Array, t: Any) -> Array:
        """States (..., n_x) at the times t (...) as `core` and `kernels` take them; without times, it is at the start."""
        if not self._hidden_starts:
            return x
        hidden = np.array(np.broadcast_to(self._hidden_starts, (*x.shape[:-1], len(self._hidden_starts))))
        if self.clock is not None:
            hidden[..., -1] = t
        return np.concatenate([x, hidden], axis=-1)

    @property
    def _hidden_starts(self) -> tuple[float, ...]:
        """Values at the start of what the core follows beside the states: what latches remember, and the clock."""
        latches = tuple(float(start) for _, start in self.structure.equations.latches)
        return latches if self.clock is None else (*latches, 0.0)

    @property
    def _followed(self) -> tuple[Quantity, ...]:
        """The states that the core follows."""
        latches = tuple(Quantity(symbol.name, "1", "what a latch remembers") for symbol, _ in self.structure.equations.latches)
        clock = () if self.clock is None else (clock_quantity(self.clock.name),)
        return (*self.states, *latches, *clock)

    def compile(self) -> SymbolicModel:
        """Return the model compiled, which is two to three times as fast as interpreted.

        A model of up to 11 states, and of up to 64 states and parameters together, gets kernels of its own, and results that
        differ by rounding. They take a minute or so to build, once: a cache keeps them for every later run
        (``FISHERPOINT_CACHE`` names another directory for it than the user's own). A larger model, and one with latch() or
        resets, gets functions for its equations and their derivatives, within seconds, and the same results to the last bit.
        It takes a C++ compiler, g++ or clang++; without one the model goes on interpreted, and a warning says so. Where others
        could write to the cache, or it cannot be written at all, a warning says so too, and what was built lasts as long as
        the process. A pickled copy is compiled as well, or an error where another compiler, other flags, or none would have it
        compute otherwise.
        """
        if self.compiled:
            return self
        compiled = copy.copy(self)
        compiled.__dict__.pop("core", None)
        compiled._compiled = compiled_model(compiled, self._followed, self.structure.programs, compiled._tape)
        return compiled

    @property
    def compiled(self) -> bool:
        """Whether the model has kernels of its own."""
        return self._compiled is not None

    @cached_property
    def states_by_parameters(self) -> NDArray[np.bool_] | None:
        """Which states depend on which parameters in the end, as kernels of an interpreted model take it."""
        if self.compiled or self._hidden_starts:
            return None
        return states_by_parameters(self.structure.programs.rate_entries, len(self.states), len(self.parameters))

    @property
    def shown_states(self) -> Mapping[str, str]:
        """For each state that is an output as it is, by its equation, the first such output."""
        shown = super().shown_states
        own = names_of(self.states)
        return shown if not self._hidden_starts else FrozenMapping({name: y for name, y in shown.items() if name in own})

    @cached_property
    def _tape(self) -> Any:
        programs = self.structure.programs
        # By the names that the core has for them too.
        parts: dict[str, Any] = {name: to_core(of) if isinstance(of, Program) else of for name, of in vars(programs).items()}
        return _core.TapeModel(
            scales=[quantity.scale or 1.0 for quantity in self._followed],
            inputs=len(self.inputs),
            outputs=len(self.outputs),
            parameters=len(self.parameters),
            jumps=sum(surface.jump for surface in self.structure.surfaces),
            kinks=sum(not surface.jump for surface in self.structure.surfaces),
            limits=len(self.structure.limits),
            **parts,
        )

    _compiled: CompiledCore | None = None

    def symbolic(self) -> SymbolicModel:
        """The model itself."""
        return self

    def estimate(self, *names: str) -> SymbolicModel:
        """Return the model with known constants made parameters; their values become nominal ones."""
        check_known(names, self.constants, "estimate", "names of constants,")
        moved = {name: given for name, given in self._given_constants.items() if name in names}
        return self._changed(
            self._written,
            (*self.parameters, *(quantity for _, quantity in moved.values())),
            {name: given for name, given in self._given_constants.items() if name not in moved},
            {**self.nominal, **{name: value for name, (value, _) in moved.items()}},
        )

    def fix(self, **values: float) -> SymbolicModel:
        """Return the model with parameters made known constants of these values, SI units."""
        names = names_of(self.parameters)
        check_known(values, names, "fix", "names of parameters,")
        fixed = {q.name: (values[q.name], replace(q, scale=None)) for q in self.parameters if q.name in values}
        return self._changed(
            self._written,
            tuple(q for q in self.parameters if q.name not in values),
            {**self._given_constants, **fixed},
            {name: value for name, value in self.nominal.items() if name not in values},
        )

    def free_start(self, *names: str) -> SymbolicModel:
        """Return the model in which these states start off their x0 by a further parameter each: they come last, nominally 0."""
        offsets = start_offsets(self, names)
        moved = dict(zip(names, map(symbol, names_of(offsets)), strict=True))
        read = symbols_of(*(one.expression for one in self._written.all()))
        shift = {symbol(name): symbol(name) + offset for name, offset in moved.items()}
        # Late outputs read the states with their offsets too.
        shift |= {one: one + moved[late[0]] for one in read if (late := delay_in(one)) and late[0] in moved}
        equations = self._written.replaced(shift)
        # A reset sets the state itself, whose offset stays.
        resets = tuple(
            (when, {x: Written(value.expression - moved[x]) if x in moved else value for x, value in values.items()})
            for when, values in equations.resets
        )
        nominal = {**self.nominal, **dict.fromkeys(names_of(offsets), 0.0)}
        further = {**self.offsets, **dict(zip(names_of(offsets), names, strict=True))}
        equations = replace(equations, resets=resets)
        return self._changed(equations, (*self.parameters, *offsets), self._given_constants, nominal, offsets=further)

    def within(self, *limits: str) -> SymbolicModel:
        """Return the model with limits that its states keep on the way, as further limits of its domain.

        Each is a comparison of terms as text: ``"p_A < 19e6"``, ``"abs(v) < 0.4"``, ``"0.01 < q < 0.29"``. A trajectory that
        reaches one ends there as `Status.left_domain`, also between two samples. A compiled model is compiled again.
        """
        limited = self._changed(
            self._written,
            self.parameters,
            self._given_constants,
            self.nominal,
            along=(*self.along, *listed_equations(limits, "along")),
        )
        return limited.compile() if self.compiled else limited

    def _changed(
        self,
        equations: WrittenEquations,
        parameters: Described,
        constants: Mapping[str, Any],
        nominal: Mapping[str, float],
        **further: Any,
    ) -> SymbolicModel:
        """The model with other equations, parameters, constants and nominal values."""
        options = self._options | {"constants": constants, "nominal": nominal} | further
        return SymbolicModel._made(equations, self.states, self.inputs, parameters, self.outputs, **options)

    @classmethod
    def _made(
        cls, equations: WrittenEquations, *described: Any, along: Iterable[str], offsets: Mapping[str, str], **options: Any
    ) -> SymbolicModel:
        """A model of equations that have been read, with what `within` and `free_start` add, which is there before.

        Limits along the way are those of the states themselves; `offsets` are the parameters by which these start off their x0.
        """
        model = cls.__new__(cls)
        model.along, model.offsets = tuple(listed_equations(along, "along")), FrozenMapping(offsets)
        options |= {name: getattr(equations, name) for name in ("domain", "resets", "definitions")}
        SymbolicModel.__init__(model, equations.rates, equations.output, *described, **options)
        return model

    @property
    def _options(self) -> dict[str, Any]:
        """What makes the same model, beside equations and quantities."""
        constants, nominal = self._given_constants, dict(self.nominal)
        given: dict[str, Any] = dict(constants=constants, name=self.name, nominal=nominal, check_units=False)
        return given | dict(along=self.along, offsets=dict(self.offsets))

    @cached_property
    def _dependence(self) -> Dependence:
        sizes = {q.name: q.scale or 1.0 for q in (*self._followed, *self.inputs, *self.parameters)}
        sizes |= {name: abs(value) for name, value in self.nominal.items() if value != 0}
        names = [names_of(of) for of in (self._followed, self.inputs, self.parameters, self.outputs)]
        return Dependence(self.structure, names[0], names[1], names[2], names[3], sizes)

    def to_toml(self) -> str:
        """The model as the table [model] of a TOML file; `load_model` reads it back."""
        limits = [*self.texts.domain, *(self._text_of(condition) for _, condition in self.equations.along)]
        return equations_toml(self, self.texts, limits)

    @cached_property
    def least(self) -> Mapping[str, float]:
        """Zero for every parameter that alone is a limit of the domain."""
        own = {symbol(q.name): q.name for q in self.parameters}
        limits = (limit.expression for limit in self.structure.of_parameters if not limit.pole)
        positive = {own[expression]: 0.0 for expression in limits if expression in own}
        return FrozenMapping(positive | {self.parameters[j].name: 0.0 for j in self._dead_columns})

    def _check_theta(self, rows: Array) -> None:
        self.structure.check_theta(rows)
        for j in self._dead_columns:
            if not (given := rows[:, j].min(initial=0.0)) >= 0:
                raise ValueError(f"{self.parameters[j].name}: expected a dead time of at least 0 s, given {given:g}")

    @cached_property
    def _dead_columns(self) -> list[int]:
        return [*self.delay_columns.values(), *self.late_columns.values()]

    @cached_property
    def _key(self) -> Hashable:
        return key_of(self.equations)

    def _identity(self) -> Hashable:
        described = (self.outputs, tuple(self.constants.items()), frozenset(self.nominal.items()))
        delays = frozenset(self.delays.items()), frozenset(self.late_outputs.items())
        return (self.name, *delays, self._key, *self._quantities(), *described)

    def __copy__(self) -> SymbolicModel:
        made = object.__new__(type(self))
        made.__dict__.update(self.__dict__)
        return made

    def __deepcopy__(self, _: Any) -> SymbolicModel:
        return self.__copy__()

    def __reduce__(self) -> tuple[Any, ...]:
        made = partial(SymbolicModel._made, **self._options)
        given = (self._written, self.states, self.inputs, self.parameters, self.outputs)
        return (made, given) if self._compiled is None else (_compiled_again, (made, given, self._compiled.key))

    def __str__(self) -> str:
        return model_text(self, self.texts)

    def _repr_latex_(self) -> str:
        return latex(self._shared.written, names_of(self.states), names_of(self.outputs))


def _compiled_again(made: Callable[..., SymbolicModel], given: Sequence[Any], key: str) -> SymbolicModel:
    """A compiled model that was pickled.

    Raises
    ------
    RuntimeError
        Where it would not compute to the same bits.
    """
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        model = made(*given).compile()
    if model._compiled is None or model._compiled.key != key:
        what = "; ".join(str(one.message) for one in heard) or "another compiler, other flags or another instruction set"
        raise RuntimeError(
            f"model: expected {model.name} compiled as where it was pickled, given {what}: install the same compiler, or give the"
            " model as it is, without compile()"
        )
    return model
