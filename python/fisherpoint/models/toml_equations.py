"""A model with equations from the table [model] of a TOML file."""

from __future__ import annotations

from ..basics.messages import listed, shortened, shown
from ..basics.quantity import Quantity
from .symbolic import SymbolicModel
from .toml_tables import ModelTable


def model_of_table(table: ModelTable) -> SymbolicModel:
    """The model of a table [model] with equations.

    Raises
    ------
    ValueError
        One line that names the key below [model].
    """
    described = {
        kind: {name: Quantity(name, entry.unit, entry.description, scale=entry.scale) for name, entry in entries.items()}
        for kind, entries in table.quantities.items()
    }
    constants = {
        name: (entry.value, Quantity(name, entry.unit or "1", entry.description)) for name, entry in table.constants.items()
    }
    nominal = {name: entry.nominal for name, entry in table.parameters.items() if entry.nominal is not None}
    f, g = _equations(table)
    kinds = (described[kind] for kind in ("states", "inputs", "parameters", "outputs"))
    return SymbolicModel(
        f,
        g,
        *kinds,
        constants=constants,
        domain=table.domain,
        name=table.name,
        nominal=nominal,
        resets=table.resets,
        check_units=False,
    )


def _equations(table: ModelTable) -> tuple[list[str], list[str]]:
    equations, states, outputs = table.equations or {}, table.states, table.outputs
    expected = list(dict.fromkeys([*states, *outputs]))
    for name in equations:
        if name not in expected:
            raise ValueError(
                f"equations.{shortened(name)}: expected an equation for each of {listed(expected)}; given one for {shown(name)}"
            )
    for name in expected:
        if name not in equations and (name in states or name not in table.inputs):
            what = f"the rate of {name}" if name in states else name
            raise ValueError(f"equations.{name}: expected {what} as a text, given none")
    for name, output in outputs.items():
        if output.equation is not None and name not in states:
            raise ValueError(f"outputs.{name}.equation: expected only for an output with the name of a state, given {shown(name)}")
    # Without an equation, an output with the name of a state or an input is that.
    g = [entry.equation or (name if name in states else equations.get(name, name)) for name, entry in outputs.items()]
    return [equations[name] for name in states], g
