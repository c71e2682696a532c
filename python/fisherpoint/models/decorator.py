"""The decorator `fisherpoint.model`: equations written as a Python function."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from types import CodeType
from typing import Any

from ..basics.checks import check_flag
from ..basics.messages import shortened, shown
from .clock import clock_names
from .expressions import symbol
from .quantities import Described, check_counts, checked_name, constants_of, quantities_of
from .symbolic import SymbolicModel
from .tape.programs import LIMIT
from .terms import Term, Unwritable


class UnknownName(AttributeError, ValueError):
    """A name that is not among the quantities of a namespace."""


class Namespace:
    """Symbols as attributes, and by place: ``x.h1``, ``x[0]``, ``h1, h2 = x``; those that are hidden only as attributes."""

    def __init__(self, kind: str, names: Sequence[str], hidden: Mapping[str, Term] | None = None) -> None:
        symbols = {name: Term(symbol(name)) for name in names}
        self.__dict__.update({"_kind": kind, "_symbols": symbols, "_hidden": dict(hidden or {})})

    def __getattr__(self, name: str) -> Any:
        if name in self._hidden:
            return self._hidden[name]
        if name.startswith("__") or name not in self._symbols:
            known = ", ".join(self._symbols) or "none"
            raise UnknownName(f"{self._kind}: expected one of {known}; given unknown {name!r}")
        return self._symbols[name]

    def __setattr__(self, name: str, value: Any) -> None:
        raise UnknownName(f"{self._kind}: expected nothing to be changed, given {name!r}")

    def __getitem__(self, place: int) -> Any:
        return list(self._symbols.values())[place]

    def __iter__(self) -> Iterator[Any]:
        return iter(self._symbols.values())

    def __len__(self) -> int:
        return len(self._symbols)


def model(
    *,
    states: Described | None = None,
    inputs: Described | None = None,
    parameters: Described,
    outputs: Described | None = None,
    constants: Mapping[str, Any] | None = None,
    name: str | None = None,
    nominal: Mapping[str, float] | None = None,
    resets: Mapping[Any, Mapping[str, Any]] | Iterable[tuple[Any, Mapping[str, Any]]] = (),
    check_units: bool = True,
) -> Callable[[Callable[..., Any]], SymbolicModel]:
    """Make a model of a function ``(x, u, p) -> f, g`` or ``(x, u, p) -> f, g, domain``.

    The function is called once, with the symbols of the states, the inputs, and the parameters and known constants as attributes;
    it uses + - * / ** and the functions of `fisherpoint.math`, as ``fp.math.sqrt``. `domain` lists what must stay
    positive beside the arguments of roots and logarithms. A model without states returns ``None`` or ``[]`` for f.

    Arguments and errors are those of `SymbolicModel`; the name is by default the function's.

    Examples
    --------
    >>> @fp.model(states={"c": "mol/L"}, parameters={"k": "1/s"}, outputs={"c": "mol/L"})
    ... def decay(x, u, p):
    ...     return [-p.k * x.c], [x.c]
    """

    def make(function: Callable[..., Any]) -> SymbolicModel:
        if not callable(function):
            raise TypeError(f"model: expected a function of x, u, p, given {shown(function)}")
        check_counts(LIMIT, states=states, inputs=inputs, parameters=parameters, constants=constants)
        given = {"states": states, "inputs": inputs, "parameters": parameters}
        names = {kind: [q.name for q in quantities_of(of, kind)] for kind, of in given.items()}
        known = constants_of(constants)[0]
        own_name = checked_name(name if name is not None else getattr(function, "__name__", "model"))
        times = clock_names({*(name for of in names.values() for name in of), *(q.name for q in known)}) if names["states"] else []
        spaces = (
            Namespace("x", names["states"], {time: Term(symbol(times[0])) for time in times}),
            Namespace("u", names["inputs"]),
            Namespace("p", [*names["parameters"], *(q.name for q in known)]),
        )
        f, g, domain = _returned(function, spaces, own_name)
        options: dict[str, Any] = dict(
            constants=constants,
            domain=domain,
            name=own_name,
            nominal=nominal,
            resets=resets,
            check_units=False,
        )
        made = SymbolicModel(f, g, states or {}, inputs or {}, parameters, outputs, **options)
        if check_flag(check_units, "check_units"):
            made.warn_of_units(stacklevel=3)
        return made

    return make


def _returned(function: Callable[..., Any], spaces: tuple[Namespace, ...], name: str) -> tuple[Any, Any, Any]:
    try:
        result = function(*spaces)
    except (TypeError, AttributeError, ValueError, ZeroDivisionError) as error:
        what = shortened(" ".join(str(error).split()), 300)
        if not isinstance(error, UnknownName | Unwritable):
            what = f"expected + - * / ** and functions of fisherpoint.math such as sqrt and where, given: {what}"
        raise ValueError(f"{name}{_line(error, getattr(function, '__code__', None))}: {what}") from error
    if not isinstance(result, tuple) or len(result) not in (2, 3):
        raise ValueError(f"{name}: expected it to return f, g or f, g, domain; given {shown(result, 80)}")
    return (*result, ()) if len(result) == 2 else result


def _line(error: BaseException, code: CodeType | None) -> str:
    """The line of the function where an error comes from."""
    numbers = [line for frame, line in traceback.walk_tb(error.__traceback__) if frame.f_code is code]
    return f", line {numbers[-1] - code.co_firstlineno + 1}" if numbers and code is not None else ""
