"""A model's programs as straight C++ functions, for kernels that interpret all others: see straight.hpp in the core."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain

from .tape.fusion import depth_first
from .tape.program import TABLE, Program
from .tape.programs import Programs

PART = 256
"""Operations of one function: those of a compiler take time that grows faster than what is in a function."""

FILE = 2500
"""Operations of one file: files are built side by side."""

_PROGRAMS = (  # in the order of the table that the core takes
    *("rates", "output", "surfaces", "surface_rates", "state_jacobian", "rate_jacobian", "output_jacobian", "jump_jacobian"),
    *("resets", "reset_jacobian", "updates", "update_jacobian"),
)
_LIBRARY = "library"
_HEAD = '#include "fisherpoint/compiled/straight.hpp"\n\nnamespace fisherpoint::straight {\n\n'
_FOOT = "\n}  // namespace fisherpoint::straight\n"
_LITERALS = '[[gnu::visibility("hidden")]] extern const double literals[];'  # in another file: functions of them are not folded
_ARGUMENTS = "const FisherpointLeaves& leaves, double* own, std::int32_t used"

AREAS = ("theta", "u", "x", "side", "dx")
"""What programs read, in the order of their registers behind the literals."""

Value = tuple[str, int]
"""Where it comes from: a literal, a leaf of an area, or an operation of setup or stage; with its number there."""


@dataclass
class _Operation:
    result: Value
    name: str
    operands: list[Value]


@dataclass
class _Function:
    """The setup or the stage of a program, in parts that pass values on through memory."""

    name: str
    parts: list[list[_Operation]]
    copied: list[tuple[Value, int]]  # values that are outputs as they are, with their places
    places: dict[Value, list[int]] = field(default_factory=dict)  # packs to which a value is stored; it is read from the first


def straight_sources(programs: Programs, parameters: int, inputs: int, states: int, sides: int) -> dict[str, str]:
    """Return C++ files by name, each to be compiled alone, of all programs of a model with as many leaves."""
    areas = dict(zip(AREAS, (parameters, inputs, states, sides, states), strict=True))
    literals: dict[str, int] = {}
    made = [_Straight(name, getattr(programs, name), areas, literals) for name in _PROGRAMS]
    functions = [function for straight in made for function in (straight.setup, straight.stage)]
    files: list[list[str]] = []
    room = 0
    for text, length in chain.from_iterable(map(_parts_of, functions)):
        if room < length:
            files.append([])
            room = FILE
        files[-1].append(text)
        room -= length
    sources = {f"part_{k}": "\n".join([_HEAD + _LITERALS + "\n", *texts, _FOOT]) for k, texts in enumerate(files)}
    return sources | {_LIBRARY: _library(made, functions, literals)}


class _Straight:
    """A program's functions, and the packs that they share: outputs, what the stage reads of the setup, what parts pass on."""

    def __init__(self, name: str, program: Program, areas: Mapping[str, int], literals: dict[str, int]) -> None:
        values: list[Value] = [("literal", literals.setdefault(_literal(float(of)), len(literals))) for of in program.literals]
        values += [(area, i) for area, count in areas.items() for i in range(count)]
        values += [("none", 0)] * (program.registers - len(values))
        setup = _operations("setup", program.setup.tolist(), values)
        stage = _operations("stage", program.stage.tolist(), values)
        outputs = [values[register] for register in program.outputs.tolist()]
        # What is computed shortly before it is read can stay in a register.
        by_result = {operation.result: operation for operation in stage}
        stage = [by_result[value] for value in depth_first({of: one.operands for of, one in by_result.items()}, outputs)]
        self.packs = len(outputs)

        read = {operand for operation in stage for operand in operation.operands}
        places: dict[Value, list[int]] = {}
        copied: dict[str, list[tuple[Value, int]]] = {"setup": [], "stage": []}
        for place, value in enumerate(outputs):
            if value[0] in ("setup", "stage"):
                places.setdefault(value, []).append(place)
            else:
                copied["stage" if value[0] in ("x", "side", "dx") else "setup"].append((value, place))
        for operation in setup:
            if operation.result in read and operation.result not in places:
                places[operation.result] = [self._further()]
        self.setup = self._function(f"{name}_setup", setup, copied["setup"], places)
        self.stage = self._function(f"{name}_stage", stage, copied["stage"], places)

    def _further(self) -> int:
        self.packs += 1
        return self.packs - 1

    def _function(
        self, name: str, operations: list[_Operation], copied: list[tuple[Value, int]], places: dict[Value, list[int]]
    ) -> _Function:
        """Cut operations into parts; what passes between them gets a pack that is free again behind the last part that reads it."""
        count = -(-len(operations) // PART)
        size = -(-len(operations) // max(count, 1))
        parts = [operations[k * size : (k + 1) * size] for k in range(count)]
        home = {operation.result: k for k, part in enumerate(parts) for operation in part}
        last = {operand: k for k, part in enumerate(parts) for operation in part for operand in operation.operands}
        own = dict(places)
        free: list[int] = []
        freed: dict[int, list[int]] = {}
        for k, part in enumerate(parts):
            free += freed.pop(k, [])
            for operation in part:
                value = operation.result
                if value not in own and last.get(value, k) > k:
                    own[value] = [free.pop() if free else self._further()]
                    freed.setdefault(last[value] + 1, []).append(own[value][0])
        return _Function(name, parts, copied, {value: at for value, at in own.items() if value in home or value in last})


def _operations(area: str, rows: Sequence[Sequence[int]], values: list[Value]) -> list[_Operation]:
    """Operations of rows (code, out, a, b, c); `values`, of the registers, are what they leave there."""
    operations = []
    for k, (code, out, *registers) in enumerate(rows):
        operation = TABLE[code]
        operands = [values[register] for register in registers[: operation.operands]]
        values[out] = (area, k)
        operations.append(_Operation(values[out], operation.name, operands))
    return operations


def _parts_of(function: _Function) -> Iterator[tuple[str, int]]:
    """Functions of the parts, with their numbers of operations; a last one copies outputs."""
    for k, part in enumerate(function.parts):
        yield _part(f"{function.name}_{k}", part, function.places), len(part)
    if function.copied:
        lines = [f"store(to, {place}, {_read(value, {})});" for value, place in function.copied]
        yield _body(f"{function.name}_copies", lines, (value for value, _ in function.copied)), len(lines)


def _part(name: str, operations: list[_Operation], places: Mapping[Value, list[int]]) -> str:
    lines, known = [], set[Value]()
    for operation in operations:
        for operand in operation.operands:
            if operand not in known:
                known.add(operand)
                lines.append(f"const V {_named(operand)} = {_read(operand, places)};")
        known.add(operation.result)
        result = _named(operation.result)
        lines.append(f"const V {result} = {operation.name}({', '.join(map(_named, operation.operands))});")
        lines += [f"store(to, {place}, {result});" for place in places.get(operation.result, ())]
    return _body(name, lines, known)


def _body(name: str, lines: Sequence[str], read: Iterable[Value]) -> str:
    areas = dict.fromkeys(area for area, _ in sorted(read) if area in AREAS)
    inside = "\n".join(f"    {line}" for line in [*(f"const double* const {of} = leaves.{of} + lane;" for of in areas), *lines])
    return f"""void {name}({_ARGUMENTS}) {{
  for (int lane = 0; lane < used; lane += native_lanes) {{
    double* const __restrict to = own + lane;
{inside}
  }}
}}
"""


def _named(value: Value) -> str:
    return f"{value[0]}_{value[1]}"


def _read(value: Value, places: Mapping[Value, list[int]]) -> str:
    area, number = value
    if area == "literal":
        return f"all(literals[{number}])"
    return f"load(to, {places[value][0]})" if value in places else f"load({area}, {number})"


def _library(made: Sequence[_Straight], functions: Sequence[_Function], literals: Mapping[str, int]) -> str:
    """The file with the literals, the functions of whole programs, and the table of these."""
    declared, whole = [], []
    for function in functions:
        names = [f"{function.name}_{k}" for k in range(len(function.parts))] + [f"{function.name}_copies"] * bool(function.copied)
        declared += [f"void {name}({_ARGUMENTS});" for name in names]
        calls = "".join(f"\n  {name}(*leaves, own, used);" for name in names)
        whole.append(f"static void {function.name}(const FisherpointLeaves* leaves, double* own, std::int32_t used) {{{calls}\n}}")
    rows = "".join(
        f",\n    {{lanes, register_bytes, {straight.packs}, {straight.setup.name}, {straight.stage.name}}}" for straight in made
    )
    return f"""{_HEAD}{_LITERALS}
const double literals[] = {{{", ".join(literals) or "0.0"}}};

{chr(10).join(declared)}

{chr(10).join(whole)}

static const FisherpointPrograms programs{{fisherpoint_straight_version{rows}}};
{_FOOT}
extern "C" __attribute__((visibility("default"))) const FisherpointPrograms* fisherpoint_programs() {{
  return &fisherpoint::straight::programs;
}}
"""


def _literal(value: float) -> str:
    if value != value:
        return '__builtin_nan("")'
    return value.hex() if abs(value) < float("inf") else f"{'-' * (value < 0)}__builtin_inf()"
