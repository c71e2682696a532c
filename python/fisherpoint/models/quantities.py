"""What a user writes about states, inputs, parameters, constants and outputs, made into quantities: checks of names and units."""

from __future__ import annotations

import keyword
import unicodedata
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from ..basics.checks import as_float, as_positive, as_sequence, by_name, check_known
from ..basics.formulas import ARGUMENTS
from ..basics.messages import shown
from ..basics.quantity import LONGEST_NAME, Quantity, names_of
from ..basics.units import check_unit
from ..basics.values import FrozenMapping
from .base import Model

RESERVED = (*ARGUMENTS, "pi", "dt")

Described = Mapping[Any, Any] | Iterable[Any]

OTHERS = 1000
"""The most inputs, outputs and known constants of a model of equations."""


def quantities_of(described: Described | None, kind: str) -> tuple[Quantity, ...]:
    """Quantities of ``{name: unit}``, ``{name: (unit, scale)}`` or ``{name: Quantity}``, or of a sequence of quantities.

    Raises
    ------
    ValueError
        For a name that is none, twice the same, or a unit that cannot be read; the message names the place.
    """
    if described is None:
        return ()
    if isinstance(described, Mapping):
        entries = [(checked_quantity_name(key, kind), entry) for key, entry in described.items()]
    elif isinstance(described, str) or not isinstance(described, Iterable):
        raise TypeError(f"{kind}: expected a mapping of names to units, given {shown(described)}")
    else:
        given = as_sequence(described, kind, "Quantities")
        for entry in given:
            if not isinstance(entry, Quantity):
                raise TypeError(f"{kind}: expected a mapping of names to units, or Quantities, given {shown(entry)}")
        entries = [(checked_quantity_name(entry.name, kind), entry) for entry in given]
    quantities = tuple(_quantity(name, entry, f"{kind}.{name}") for name, entry in entries)
    check_distinct((quantity.name, kind) for quantity in quantities)
    return quantities


def check_counts(most: int, **described: Any) -> None:
    """Raise where states or parameters are more than `most`, or others more than `OTHERS`, before any of them is looked at."""
    for kind, given in described.items():
        limit = most if kind in ("states", "parameters") else OTHERS
        if isinstance(given, Mapping | list | tuple) and len(given) > limit:
            raise ValueError(f"{kind}: expected at most {limit}, given {len(given)}")


def constants_of(described: Mapping[Any, Any] | None) -> tuple[tuple[Quantity, ...], dict[str, float]]:
    """Quantities and values of ``{name: (value, unit)}`` or ``{name: value}``; a Quantity may stand for the unit."""
    if described is None:
        return (), {}
    if not isinstance(described, Mapping):
        raise TypeError(f"constants: expected a mapping of names to (value, unit), given {shown(described)}")
    units, values = {}, {}
    for key, entry in described.items():
        name = checked_quantity_name(key, "constants")
        value, unit = entry if isinstance(entry, tuple) and len(entry) == 2 else (entry, "1")
        units[name], values[name] = unit, as_float(value, f"constants.{name}")
    return quantities_of(units, "constants"), values


class DescribedModel(Model):
    """A model whose quantities a user has described; a subclass adds its equations or functions."""

    def _describe(
        self,
        states: Described | None,
        inputs: Described | None,
        parameters: Described,
        outputs: Described,
        constants: Mapping[str, Any] | None,
        name: str,
        nominal: Mapping[str, float] | None,
    ) -> None:
        self.name = checked_name(name)
        self.states, self.inputs = quantities_of(states, "states"), quantities_of(inputs, "inputs")
        self.parameters, self.outputs = quantities_of(parameters, "parameters"), quantities_of(outputs, "outputs")
        self.constant_quantities, values = constants_of(constants)
        self._constants = FrozenMapping(values)
        kinds = {"states": self.states, "inputs": self.inputs, "parameters": self.parameters, "constants": self.constant_quantities}
        check_distinct((q.name, kind) for kind, of in kinds.items() for q in of)
        for kind in ("parameters", "outputs"):
            if not getattr(self, kind):
                raise ValueError(f"{kind}: expected at least one, given none")
        self.nominal = by_name(nominal, names_of(self.parameters), "nominal", as_float)

    @property
    def constants(self) -> Mapping[str, float]:
        """The known constants by name, SI units."""
        return self._constants

    def _quantities(self) -> tuple[tuple[Quantity, ...], ...]:
        return self.states, self.inputs, self.parameters, self.constant_quantities

    @property
    def _given_constants(self) -> dict[str, tuple[float, Quantity]]:
        """Constants as they are described."""
        return {q.name: (self.constants[q.name], q) for q in self.constant_quantities}

    def __repr__(self) -> str:
        kinds = {"state": self.states, "input": self.inputs, "parameter": self.parameters, "output": self.outputs}
        counts = ", ".join(f"{len(of)} {kind}{'s' * (len(of) != 1)}" for kind, of in kinds.items())
        return f"{type(self).__name__}({self.name!r}, {counts})"


def start_offsets(model: Model, names: Sequence[str]) -> tuple[Quantity, ...]:
    """A quantity for each of the named states by which its start differs from x0; it has a name of its own."""
    states = {quantity.name: quantity for quantity in model.states}
    taken = {q.name for of in (model.states, model.inputs, model.parameters, model.constant_quantities) for q in of}
    offsets = []
    check_known(names, states, "unknown_start", "names of states,")
    for name in names:
        own = f"{name}_0"
        while own in taken:
            own += "_"
        taken.add(own)
        offsets.append(Quantity(own, states[name].unit, f"start of {name}, as it differs from x0"))
    return tuple(offsets)


def check_distinct(named: Iterable[tuple[str, str]]) -> None:
    """Raise where a name comes twice among (name, kind)."""
    seen: dict[str, str] = {}
    for name, kind in named:
        if name in seen:
            raise ValueError(f"{kind}.{name}: expected a name of its own, given one that is among the {seen[name]} too")
        seen[name] = kind


def checked_quantity_name(key: Any, kind: str) -> str:
    """A name that may stand in equations, of a text or a symbol."""
    name = key if isinstance(key, str) else getattr(key, "name", None) or getattr(getattr(key, "func", None), "__name__", None)
    place = f"{kind}.{shown(name)}"
    if not isinstance(name, str) or len(name) > LONGEST_NAME or not _is_plain(name):
        raise ValueError(f"{place}: expected a name of letters, digits and _ that starts with a letter, given {shown(key)}")
    if keyword.iskeyword(name) or name in RESERVED:
        raise ValueError(
            f"{place}: expected a name that is not in use, given {shown(name)}, which means something else in equations"
        )
    return name


def _is_plain(name: str) -> bool:
    return name.isidentifier() and not name.startswith("_") and unicodedata.normalize("NFKC", name) == name


def checked_name(given: Any) -> str:
    """The name of a model."""
    if not isinstance(given, str) or not given.strip() or not given.isprintable():
        raise ValueError(f"name: expected a name, given {shown(given)}")
    if len(given) > LONGEST_NAME:
        raise ValueError(f"name: expected a name of at most {LONGEST_NAME} characters, given {shown(given)}")
    return given


def _quantity(name: str, entry: Any, place: str) -> Quantity:
    if isinstance(entry, Quantity):
        unit, scale, description = entry.unit, entry.scale, entry.description
        if entry.name != name:
            raise ValueError(f"{place}: expected the quantity of this name, given {shown(entry.name)}")
    elif isinstance(entry, tuple) and len(entry) == 2:
        (unit, scale), description = entry, ""
    else:
        unit, scale, description = entry, None, ""
    check_unit(unit, place)
    if scale is not None:
        scale = as_positive(scale, f"{place}.scale")
    return Quantity(name, unit, description, scale=scale)
