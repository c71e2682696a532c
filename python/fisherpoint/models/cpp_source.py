"""A model's programs as C++: a struct such as those that the core compiles itself, operation by operation."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Sequence

from ..basics.quantity import Quantity
from .base import Model
from .tape.program import TABLE, Program
from .tape.programs import Programs

_FORMS = {
    "add": "{} + {}",
    "sub": "{} - {}",
    "mul": "{} * {}",
    "div": "{} / {}",
    "neg": "-{}",
    "mul_add": "{} * {} + {}",
    "mul_sub": "{} * {} - {}",
    "sub_mul": "{2} - {0} * {1}",
    "pow": "power({}, {})",
    "select": "choose({}, {}, {})",
}


def cpp_model(model: Model, states: Sequence[Quantity], programs: Programs, name: str) -> str:
    """Return the C++ source of a model (cpp/include/fisherpoint/models/model.hpp says what that is) as a struct called `name`.

    `states` are those that the programs have.
    """
    n_x, n_u, p = len(states), len(model.inputs), len(model.parameters)
    sides = len(model.jumps) + len(model.kinks)
    leaves = [f"{area}_{i}" for area, n in (("theta", p), ("u", n_u), ("x", n_x), ("side", sides)) for i in range(n)]
    rates, output, surfaces = (_Body(program, leaves, n_x) for program in (programs.rates, programs.output, programs.surfaces))
    ahead, behind = rates.setup_parts(p)
    values = surfaces.results
    constant = [entry for entry, constant in zip(programs.rate_entries, programs.constant_slopes, strict=True) if constant]
    sided = surfaces.reads([name for name in leaves if name.startswith("side_")], values[sides:])
    return f"""#pragma once

#include "fisherpoint/models/model.hpp"
#include "fisherpoint/numbers/functions.hpp"

namespace fisherpoint {{

struct {name} {{
  static constexpr std::string_view name = {_quoted(model.name)};
  static constexpr std::array<Quantity, {n_x}> states = {_quantities(states)};
  static constexpr std::array<Quantity, {n_u}> inputs = {_quantities(model.inputs)};
  static constexpr std::array<Quantity, {len(model.outputs)}> outputs = {_quantities(model.outputs)};
  static constexpr std::array<Quantity, {p}> parameters = {_quantities(model.parameters)};
  static constexpr std::array<Surface, {len(model.jumps)}> jumps = {_surfaces(model.jumps)};
  static constexpr std::array<Surface, {len(model.kinks)}> kinks = {_surfaces(model.kinks)};
  static constexpr std::array<Surface, {len(model.domain)}> domain = {_surfaces(model.domain)};
  static constexpr int poles = {programs.poles};
  static constexpr int measured = {programs.measured};
  static constexpr std::array<bool, {n_x}> varying_states = {_flags(programs.varying_states)};
  static constexpr std::array<bool, {len(model.outputs)}> varying_outputs = {_flags(programs.varying_outputs)};
  static constexpr std::array<bool, {sides}> varying_surfaces = {_flags(programs.varying_surfaces)};
  static constexpr std::array<bool, {len(model.jumps)}> crossable = {_flags(programs.crossable)};
  static constexpr std::array<bool, {sides}> rough = {_flags(programs.rough)};
  static constexpr std::array<bool, {sides}> steep = {_flags(programs.steep)};
  static constexpr std::array<bool, {len(programs.closed)}> closed = {_flags(programs.closed)};
  static constexpr std::array<Variables, {n_x}> read_through_jumps = {_variables(programs.rate_entries, n_x)};
  static constexpr std::array<Variables, {n_x}> constant_slopes = {_variables(constant, n_x)};

  auto dynamics(const auto& parameters) const {{
    {_taken("theta", p, "parameters")}
{_lines(ahead, 4)}
    return [=]([[maybe_unused]] const auto& states, [[maybe_unused]] const auto& inputs,
               [[maybe_unused]] const auto& sides) {{
      {_taken("x", n_x, "states")}
      {_taken("u", n_u, "inputs")}
      {_indexed("side", sides, "sides")}
{_lines([*behind, *rates.stage], 6)}
      return std::tuple{{{", ".join(rates.results)}}};
    }};
  }}

  auto output([[maybe_unused]] const auto& states, [[maybe_unused]] const auto& inputs,
              [[maybe_unused]] const auto& parameters) const {{
    {_all_taken(n_x, n_u, p)}
{_lines(output.setup + output.stage, 4)}
    return std::tuple{{{", ".join(output.results)}}};
  }}

  auto switching([[maybe_unused]] const auto& states, [[maybe_unused]] const auto& inputs,
                 [[maybe_unused]] const auto& parameters) const {{
    {_all_taken(n_x, n_u, p)}
{_lines(surfaces.needed(values[:sides]), 4)}
    return std::tuple{{{", ".join(values[:sides])}}};
  }}

  auto limits([[maybe_unused]] const auto& states, [[maybe_unused]] const auto& inputs,
              [[maybe_unused]] const auto& parameters{", const auto& sides" if sided else ""}) const {{
    {_all_taken(n_x, n_u, p)}
    {_indexed("side", sides, "sides") if sided else ""}
{_lines(surfaces.needed(values[sides:]), 4)}
    return std::tuple{{{", ".join(values[sides:])}}};
  }}
}};

}}  // namespace fisherpoint
"""


def _variables(entries: Iterable[tuple[int, int]], rows: int) -> str:
    """The variables that each row reads, as bits."""
    read = [0] * rows
    for row, variable in entries:
        read[row] |= 1 << variable
    return f"{{{', '.join(f'{bits:#x}u' for bits in read)}}}"


def _flags(flags: Sequence[bool]) -> str:
    return f"{{{', '.join('true' if flag else 'false' for flag in flags)}}}"


class _Body:
    """A program's operations as C++ statements, each result with a name of its own."""

    def __init__(self, program: Program, leaves: Sequence[str], n_x: int) -> None:
        self._reads: dict[str, list[str]] = {}  # of every result, by its name
        self._statement: dict[str, str] = {}
        names = [_literal(float(value)) for value in program.literals] + [*leaves] + [""] * n_x
        names += [""] * (program.registers - len(names))
        self.setup = self._statements(program.setup.tolist(), names)
        self.stage = self._statements(program.stage.tolist(), names)
        self.results = [names[register] for register in program.outputs.tolist()]

    def _statements(self, rows: Iterable[list[int]], names: list[str]) -> list[str]:
        statements = []
        for code, out, *operands in rows:
            operation = TABLE[code]
            read = [names[register] for register in operands[: operation.operands]]
            form = _FORMS.get(operation.name, f"{operation.name}({', '.join('{}' for _ in read)})")
            result = names[out] = f"r{len(self._statement)}"
            self._reads[result] = read
            self._statement[result] = f"[[maybe_unused]] const auto {result} = {form.format(*map(_bracketed, read))};"
            statements.append(self._statement[result])
        return statements

    def setup_parts(self, parameters: int) -> tuple[list[str], list[str]]:
        """The setup's statements that read theta alone, and the others."""
        alone: set[str] = {f"theta_{j}" for j in range(parameters)}
        ahead, behind = [], []
        for result, statement in list(self._statement.items())[: len(self.setup)]:
            if all(name in alone or _is_literal(name) for name in self._reads[result]):
                alone.add(result)
                ahead.append(statement)
            else:
                behind.append(statement)
        return ahead, behind

    def reads(self, leaves: Sequence[str], results: Sequence[str]) -> bool:
        """Whether any of these results reads any of these leaves."""
        wanted, pending = set(), list(results)
        while pending:
            if (name := pending.pop()) not in wanted:
                wanted.add(name)
                pending += self._reads.get(name, [])
        return not wanted.isdisjoint(leaves)

    def needed(self, results: Iterable[str]) -> list[str]:
        """The statements, in order, that these results need."""
        wanted, pending = set(), list(results)
        while pending:
            name = pending.pop()
            if name in self._statement and name not in wanted:
                wanted.add(name)
                pending += self._reads[name]
        return [statement for result, statement in self._statement.items() if result in wanted]


def _literal(value: float) -> str:
    if math.isnan(value):
        return "(0.0 / 0.0)"
    return repr(value) if math.isfinite(value) else f"({'-' * (value < 0)}1.0 / 0.0)"


def _is_literal(name: str) -> bool:
    return not name[:1].isalpha()


def _bracketed(name: str) -> str:
    return f"({name})" if name.startswith("-") else name


def _taken(area: str, count: int, of: str) -> str:
    names = ", ".join(f"{area}_{i}" for i in range(count))
    return f"[[maybe_unused]] const auto& [{names}] = {of};" if count else ""


def _indexed(area: str, count: int, of: str) -> str:
    return " ".join(f"[[maybe_unused]] const auto& {area}_{i} = {of}[{i}];" for i in range(count))


def _all_taken(n_x: int, n_u: int, p: int) -> str:
    return "\n    ".join(
        line for line in (_taken("x", n_x, "states"), _taken("u", n_u, "inputs"), _taken("theta", p, "parameters")) if line
    )


def _lines(statements: Iterable[str], indent: int) -> str:
    return "\n".join(" " * indent + statement for statement in statements)


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=True)


def _quantities(quantities: Iterable[Quantity]) -> str:
    entries = (f"{{{_quoted(q.name)}, {_quoted(q.unit)}, {_quoted('')}, {q.scale or 1.0!r}}}" for q in quantities)
    inside = ", ".join(f"Quantity{entry}" for entry in entries)
    return f"{{{inside}}}"


def _surfaces(names: Iterable[str]) -> str:
    inside = ", ".join(f"Surface{{{_quoted(name)}}}" for name in names)
    return f"{{{inside}}}"
