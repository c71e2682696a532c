"""Python functions as a model's core: plain arrays of rows in, real or complex, and arrays out."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextvars import ContextVar
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...basics.messages import listed, shortened, shown
from ...basics.quantity import names_of
from ...basics.values import Array
from ..base import Model
from .tangents import complex_step_works, tangents

Function = Callable[[Any, Any, Any], Any]


class Columns(np.ndarray[Any, Any]):
    """Rows of numbers (K, n) whose columns can be read by name too: ``x.h1`` is ``x[:, 0]``.

    Names of columns, and of known constants, come before those of the array itself.
    """

    def __new__(cls, rows: NDArray[Any], names: Sequence[str], constants: Mapping[str, float] | None = None) -> Columns:
        plain = np.asarray(rows)
        self = plain.view(cls)
        rows = plain if cls is Columns else plain.view(cls)
        self.__dict__.update(_rows=rows, _places={name: j for j, name in enumerate(names)}, _constants=constants or {})
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


class Watched(Columns):
    """Columns that note what functions ask of complex numbers and no complex step comes through, also where it is not seen yet.

    np.abs drops the imaginary part and np.sign turns it, which shows only where their argument depends on what is stepped along.
    Both may be used elsewhere than where a function is tried: all are noted.
    """

    lossy = frozenset({np.absolute, np.sign, np.linalg.norm, np.real})
    met: ContextVar[list[str]] = ContextVar("met")

    def __array_ufunc__(self, ufunc: np.ufunc, method: Any, *inputs: Any, out: Any = None, **options: Any) -> Any:
        if ufunc in self.lossy and np.iscomplexobj(inputs[0]):
            self.met.get().append(ufunc.__name__)
        given = [np.asarray(one) if isinstance(one, np.ndarray) else one for one in inputs]
        into = {} if out is None else {"out": tuple(np.asarray(one) for one in out)}
        return self._watched(getattr(ufunc, method)(*given, **into, **options))

    def __array_function__(self, function: Any, types: Any, given: Any, options: Any) -> Any:
        if function in self.lossy and np.iscomplexobj(given[0]):
            self.met.get().append(function.__name__)
        return self._watched(super().__array_function__(function, types, given, options))

    @staticmethod
    def _watched(result: Any) -> Any:
        return result.view(Watched) if isinstance(result, np.ndarray) else result


class CallableCore:
    """A model's functions on plain arrays of rows, real or complex."""

    def __init__(self, model: Model, f: Function | None, g: Function, *named: Mapping[str, Function]) -> None:
        jumps, kinks, domain = named
        self._f, self._g = f, g
        self._surfaces, self._domain = {**jumps, **kinks}, domain
        self.name, self.n_jumps = model.name, len(jumps)
        self._states, self._inputs, self._parameters = map(names_of, (model.states, model.inputs, model.parameters))
        self._outputs, self._constants = names_of(model.outputs), model.constants
        self.n_x, self.n_y, self.n_surfaces = len(self._states), len(self._outputs), len(self._surfaces)
        self.scale = np.array([q.scale or 1.0 for q in model.states])
        self.by_complex_step: bool | None = None  # not tried yet
        self.warned: set[str] = set()
        self._columns = Columns

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
            met: list[str] = []
            self._columns, token = Watched, Watched.met.set(met)
            try:
                works = complex_step_works((self.rhs, self.output), self.scale, x[:64], u[:64], theta[:64])
            finally:
                self._columns = Columns
                Watched.met.reset(token)
            self.by_complex_step = works and not met
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
        of = self._columns
        arguments = of(x, self._states), of(u, self._inputs), of(theta, self._parameters, self._constants)
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
