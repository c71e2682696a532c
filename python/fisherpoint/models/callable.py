"""Models given by NumPy functions: the slow path for what cannot be written as equations."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..kernels import Kernels
from ..messages import listed, shortened, shown
from ..quantity import Array, FrozenMapping, as_float, check_known, check_mapping, check_name, names_of
from .base import Model
from .quantities import Described, check_distinct, checked_name, constants_of, quantities_of, start_offsets
from .tangents import complex_step_works, tangents

Function = Callable[[Any, Any, Any], Any]


class Columns(np.ndarray[Any, Any]):
    """Rows of numbers (K, n) of which the columns can be read by name too: ``x.h1`` is ``x[:, 0]``.

    Names of columns, and of known constants, come before those of the array itself.
    """

    def __new__(cls, rows: NDArray[Any], names: Sequence[str], constants: Mapping[str, float] | None = None) -> Columns:
        plain = np.asarray(rows)
        self = plain.view(cls)
        self.__dict__.update(_rows=plain, _places={name: j for j, name in enumerate(names)}, _constants=constants or {})
        return self

    def __getattribute__(self, name: str) -> Any:
        known = object.__getattribute__(self, "__dict__")
        if known:
            if name in known["_places"]:
                return known["_rows"][:, known["_places"][name]]
            if name in known["_constants"]:
                return known["_constants"][name]
        return object.__getattribute__(self, name)

    def __getattr__(self, name: str) -> Any:
        known = self.__dict__
        names = listed([*known.get("_places", ()), *known.get("_constants", ())], "no names")
        raise AttributeError(f"expected one of {names}; given unknown {shown(name)}")


class CallableModel(Model):
    """A model x' = f(x, u, theta), y = g(x, u, theta) given by Python functions.

    The functions are called with x (K, n_x), u (K, n_u) and p (K, p), of which columns can be read by name, ``p.k1 * x.h1``; known
    constants are attributes of p. They return an array (K, n), or a list of n entries each a number or (K,).

    Trajectories are integrated one by one with `scipy.integrate.solve_ivp`, on one core, whatever `threads` says. Sensitivities
    come from the equations of variation with derivatives of f and g along their directions: by complex step where the functions
    take complex numbers and do not lose them, which is tried once, else by central differences. A `UserWarning` at the first use
    says which, and what it costs. Equations (`SymbolicModel`) are a thousand times faster and more.

    Parameters
    ----------
    f : callable or None
        Rates of the states, SI units; None for a model without states.
    g : callable
        Outputs.
    states, inputs, parameters, outputs, constants, name, nominal
        As for `SymbolicModel`.
    jumps, kinks : mapping of name to callable, optional
        What is zero where f jumps, and where it has a corner: functions of x, u, p that return (K,). What is not declared here is
        not seen.
    domain : mapping of name to callable, optional
        What must stay positive.

    Raises
    ------
    TypeError, ValueError
        For a function that fails, or that returns another shape; the message names it.
    """

    def __init__(
        self,
        f: Function | None,
        g: Function,
        states: Described | None,
        inputs: Described | None,
        parameters: Described,
        outputs: Described | None = None,
        constants: Mapping[str, Any] | None = None,
        domain: Mapping[str, Function] | None = None,
        jumps: Mapping[str, Function] | None = None,
        kinks: Mapping[str, Function] | None = None,
        name: str = "model",
        nominal: Mapping[str, float] | None = None,
    ) -> None:
        self.name = checked_name(name)
        self.states, self.inputs = quantities_of(states, "states"), quantities_of(inputs, "inputs")
        self.parameters = quantities_of(parameters, "parameters")
        self.outputs = quantities_of({"y": "1"} if outputs is None else outputs, "outputs")
        self.constant_quantities, values = constants_of(constants)
        self._constants = FrozenMapping(values)
        kinds = {"states": self.states, "inputs": self.inputs, "parameters": self.parameters, "constants": self.constant_quantities}
        check_distinct((q.name, kind) for kind, of in kinds.items() for q in of)
        for kind in ("parameters", "outputs"):
            if not getattr(self, kind):
                raise ValueError(f"{kind}: expected at least one, given none")
        own = names_of(self.parameters)
        usual = {} if nominal is None else check_mapping(nominal, "nominal")
        check_known(usual, own, "nominal", "the names")
        self.nominal = FrozenMapping({key: as_float(value, f"nominal[{key!r}]") for key, value in usual.items()})
        if (f is None) != (not self.states):
            raise TypeError(f"f: expected {'a function' if self.states else 'None for a model without states'}, given {shown(f)}")
        self.f, self.g = f, g
        named = {"jumps": jumps, "kinks": kinks, "domain": domain}
        self._given = tuple(_functions_of(given, kind) for kind, given in named.items())
        self.jumps, self.kinks, self.domain = (tuple(of) for of in self._given)
        self.core.check()

    @property
    def constants(self) -> Mapping[str, float]:
        """The known constants by name, SI units."""
        return self._constants

    @cached_property
    def core(self) -> CallableCore:
        """The functions, with arrays in and arrays out."""
        return CallableCore(self, *self._given)

    @property
    def kernels(self) -> Kernels:
        """Integration by `solve_ivp`."""
        from . import callable_kernels

        return callable_kernels

    def free_start(self, *names: str) -> CallableModel:
        """Return the model in which these states start off their x0 by a further parameter each: they come last, nominally 0."""
        offsets = start_offsets(self, names)
        places = tuple(names_of(self.states).index(name) for name in names)

        def shifted(function: Function) -> Function:
            return _Shifted(function, places, names_of(self.states), names_of(self.parameters), self.constants)

        jumps, kinks, domain = ({name: shifted(function) for name, function in of.items()} for of in self._given)
        return CallableModel(
            None if self.f is None else shifted(self.f),
            shifted(self.g),
            self.states,
            self.inputs,
            (*self.parameters, *offsets),
            self.outputs,
            {q.name: (self.constants[q.name], q) for q in self.constant_quantities},
            domain,
            jumps,
            kinks,
            self.name,
            {**self.nominal, **dict.fromkeys(names_of(offsets), 0.0)},
        )

    def to_toml(self) -> str:
        """Refused: functions cannot be written into a file."""
        raise TypeError(f"{self.name}: expected a model with equations, given CallableModel")

    def _check_theta(self, rows: Array) -> None:
        """Nothing is known about parameters."""

    def _identity(self) -> Hashable:
        described = (self.states, self.inputs, self.parameters, self.outputs, self.constant_quantities)
        given = (tuple(of.items()) for of in self._given)  # their order is that of the surfaces
        return (self.name, self.f, self.g, *given, *described, self._constants, self.nominal)

    def __reduce__(self) -> tuple[Any, ...]:
        jumps, kinks, domain = map(dict, self._given)
        constants = {q.name: (self.constants[q.name], q) for q in self.constant_quantities}
        quantities = (self.states, self.inputs, self.parameters, self.outputs, constants)
        return (CallableModel, (self.f, self.g, *quantities, domain, jumps, kinks, self.name, dict(self.nominal)))

    def __repr__(self) -> str:
        kinds = {"state": self.states, "input": self.inputs, "parameter": self.parameters, "output": self.outputs}
        return (
            f"CallableModel({self.name!r}, {', '.join(f'{len(of)} {kind}' + 's' * (len(of) != 1) for kind, of in kinds.items())})"
        )


def _functions_of(given: Mapping[str, Function] | None, kind: str) -> FrozenMapping[Function]:
    functions = {} if given is None else check_mapping(given, kind, "functions")
    for name, function in functions.items():
        if not callable(function):
            raise TypeError(f"{kind}[{shown(name)}]: expected a function of x, u, p, given {shown(function)}")
    return FrozenMapping({check_name(name, kind): function for name, function in functions.items()})


class _Shifted:
    """A function of a model, with further parameters added to states."""

    def __init__(
        self, function: Function, places: tuple[int, ...], states: tuple[str, ...], parameters: tuple[str, ...], constants: Any
    ) -> None:
        self._function, self._places, self._states = function, places, states
        self._parameters, self._constants = parameters, constants

    def __call__(self, x: Any, u: Any, p: Any) -> Any:
        theta, n = np.asarray(p), len(self._parameters)
        moved = np.asarray(x).astype(np.result_type(x, theta))
        moved[:, list(self._places)] += theta[:, n:]
        return self._function(Columns(moved, self._states), u, Columns(theta[:, :n], self._parameters, self._constants))


class CallableCore:
    """A model's functions on plain arrays of rows, real or complex."""

    def __init__(
        self, model: CallableModel, jumps: Mapping[str, Function], kinks: Mapping[str, Function], domain: Mapping[str, Function]
    ) -> None:
        self._f, self._g = model.f, model.g
        self._surfaces, self._domain = {**jumps, **kinks}, domain
        self.name, self.n_jumps = model.name, len(jumps)
        self._states, self._inputs, self._parameters = map(names_of, (model.states, model.inputs, model.parameters))
        self._outputs, self._constants = names_of(model.outputs), model.constants
        self.n_x, self.n_y, self.n_surfaces, self.n_limits = len(self._states), len(self._outputs), len(self._surfaces), len(domain)
        self.scale = np.array([q.scale or 1.0 for q in model.states])
        self.by_complex_step: bool | None = None  # not tried yet
        self.warned: set[str] = set()

    def check(self) -> None:
        """Raise where a function fails, or returns another shape, on rows of ordinary numbers."""
        x, u, theta = (np.full((2, n), 0.5) for n in (self.n_x, len(self._inputs), len(self._parameters)))
        for label, function in self._functions():
            if not callable(function):
                raise TypeError(f"{label}: expected a function of x, u, p, given {type(function).__name__}")
        for function in (self.rhs, self.output, self.switching, self.limits):
            function(x, u, theta)

    def rhs(self, x: NDArray[Any], u: NDArray[Any], theta: NDArray[Any]) -> NDArray[Any]:
        if self._f is None:
            return np.empty((len(x), 0))
        return self._call(self._f, "f", self.n_x, x, u, theta)

    def output(self, x: NDArray[Any], u: NDArray[Any], theta: NDArray[Any]) -> NDArray[Any]:
        return self._call(self._g, "g", self.n_y, x, u, theta)

    def output_jacobian(self, x: Array, u: Array, theta: Array) -> Array:
        """Derivatives of g by the parameters where the state is held: (K, n_y, p)."""
        by_complex_step, held = self.takes_complex(x, u, theta), np.zeros((self.n_x, theta.shape[1]))
        slopes = np.empty((len(x), self.n_y, theta.shape[1]))
        for k, size in enumerate(np.where(theta != 0, np.abs(theta), 1.0)):
            slopes[k] = tangents(self.output, x[k], held, u[k], theta[k], size, self.scale, by_complex_step)[1] / size
        return slopes

    def takes_complex(self, x: Array, u: Array, theta: Array) -> bool:
        """Whether f and g take complex numbers; found out at some of the first rows."""
        if self.by_complex_step is None and len(x):
            self.by_complex_step = complex_step_works(self, x[:64], u[:64], theta[:64])
        return bool(self.by_complex_step)

    def switching(self, x: NDArray[Any], u: NDArray[Any], theta: NDArray[Any]) -> NDArray[Any]:
        return self._each(self._surfaces, x, u, theta)

    def limits(self, x: NDArray[Any], u: NDArray[Any], theta: NDArray[Any]) -> NDArray[Any]:
        return self._each(self._domain, x, u, theta)

    def boundary(self, m: int, x: NDArray[Any], u: NDArray[Any], theta: NDArray[Any]) -> float:
        """Value at one row of surface m or, behind the surfaces, of a limit."""
        label, function = [*self._surfaces.items(), *self._domain.items()][m]
        return float(self._call(function, label, 1, x, u, theta)[0, 0])

    def _functions(self) -> Iterator[tuple[str, Any]]:
        if self._f is not None:
            yield "f", self._f
        yield "g", self._g
        yield from self._surfaces.items()
        yield from self._domain.items()

    def _each(self, functions: Mapping[str, Function], *rows: NDArray[Any]) -> NDArray[Any]:
        values = [self._call(function, label, 1, *rows) for label, function in functions.items()]
        return np.hstack(values) if values else np.empty((len(rows[0]), 0))

    def _call(self, function: Function, label: str, n: int, x: NDArray[Any], u: NDArray[Any], theta: NDArray[Any]) -> NDArray[Any]:
        arguments = Columns(x, self._states), Columns(u, self._inputs), Columns(theta, self._parameters, self._constants)
        count = len(x)
        try:
            with np.errstate(all="ignore"):
                result = function(*arguments)
        except (AttributeError, IndexError, NameError, TypeError, ValueError) as error:
            what = f"{type(error).__name__}: {shortened(' '.join(str(error).split()), 200)}"
            raise ValueError(f"{label}: expected a function of x, u, p, given one that raises {what}") from error
        if isinstance(result, list | tuple):
            if len(result) != n:
                raise ValueError(f"{label}: expected {n} entries, given {len(result)}")
            entries, result = result, np.empty((count, n), np.result_type(np.float64, *result))
            for i, entry in enumerate(entries):
                result[:, i] = entry
        rows = np.asarray(result)
        if n == 1 and rows.shape in ((), (count,)):
            rows = np.broadcast_to(rows, (count,)).reshape(count, 1)
        if rows.shape != (count, n):
            raise ValueError(f"{label}: expected shape ({count}, {n}) for {count} rows, given {rows.shape}")
        return rows
