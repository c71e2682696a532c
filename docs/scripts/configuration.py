"""Writes the reference of the TOML file, docs/reference/configuration.md, from the models by which the program checks it.

Keys, types, limits and defaults come from the program; the descriptions are those of configuration_texts.py. A key without a
description is an error, as is a description without its key. With ``--check`` nothing is written, and the exit code says whether
the page is up to date.
"""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from configuration_texts import INTRODUCTION, OPTIONS, SAID, TABLES

import fisherpoint as fp
from fisherpoint.basics.options import options_of
from fisherpoint.design.file.configuration import Config
from fisherpoint.design.goal.goal import Goal
from fisherpoint.design.results.settings import ExchangeMethod, ExchangeSettings

PAGE = Path(__file__).resolve().parents[1] / "reference" / "configuration.md"

RULES = (fp.TensorGrid, fp.GaussHermite, fp.SparseGaussHermite, fp.Sobol, fp.Unscented, fp.LinearizedRule)


def page() -> str:
    """The whole page."""
    schema = Config.model_json_schema()
    top = _tables(schema)
    listed = {name.split(".")[0] for name in TABLES}
    if set(top) != listed:
        raise SystemExit(f"configuration.py: expected the tables {sorted(top)}, given {sorted(listed)}")
    parts = [INTRODUCTION, "| table | needed |", "|---|---|"]
    parts += [f"| [`[{name}]`](#{name}) | {'yes' if name in schema['required'] else 'no'} |" for name in TABLES if name in top]
    for name, (text, example, meanings) in TABLES.items():
        parts += ["", f"## {name}", "", text]
        if example:
            parts += ["", "```toml", example.rstrip("\n"), "```"]
        rows = list(_rows(schema, name, meanings))
        if rows:
            parts += ["", "| key | value | default | meaning |", "|---|---|---|---|", *rows]
    return "\n".join(parts) + "\n"


def _tables(schema: Mapping[str, Any]) -> dict[str, Any]:
    return dict(schema["properties"])


def _rows(schema: Mapping[str, Any], table: str, meanings: Mapping[str, str]) -> Iterator[str]:
    found = _keys(schema, table)
    if set(found) != set(meanings):
        raise SystemExit(f"configuration.py: {table}: expected descriptions of {sorted(found)}, given {sorted(meanings)}")
    for key, meaning in meanings.items():
        kind, needed = found[key]
        default = "needed" if needed else _default(table, key, kind)
        yield f"| `{key}` | {_kind(schema, kind)} | {default} | {meaning} |"


def _keys(schema: Mapping[str, Any], table: str) -> dict[str, tuple[Mapping[str, Any], bool]]:
    """The keys of a table, or of an entry of a table by name: their schemas, and whether they are needed."""
    node: Any = schema
    for name in table.split("."):
        node = _resolved(schema, node["properties"][name])
    keys = {key: (kind, key in node.get("required", ())) for key, kind in node.get("properties", {}).items()}
    entry = node.get("additionalProperties")
    if isinstance(entry, dict):
        inner = _resolved(schema, entry)
        keys |= {key: (kind, key in inner.get("required", ())) for key, kind in inner.get("properties", {}).items()}
    return keys


def _resolved(schema: Mapping[str, Any], node: Mapping[str, Any]) -> Mapping[str, Any]:
    """The object that a node refers to, without the possibility that it is left out."""
    for choice in node.get("anyOf", ()):
        if choice.get("type") != "null":
            return _resolved(schema, choice)
    if "$ref" in node:
        found: Mapping[str, Any] = schema["$defs"][node["$ref"].rpartition("/")[2]]
        return found
    return node


def _kind(schema: Mapping[str, Any], node: Mapping[str, Any]) -> str:
    """A type in words, with its limits."""
    if "anyOf" in node:
        return " or ".join(_kind(schema, choice) for choice in node["anyOf"] if choice.get("type") != "null")
    if "enum" in node:
        return " or ".join(f'`"{value}"`' for value in node["enum"])
    kind = node.get("type")
    if kind == "array":
        return f"list of {_kind(schema, node['items'])}s"
    if kind == "object":
        inner = node.get("additionalProperties")
        if isinstance(inner, dict) and "$ref" not in inner:
            return f"by name: {_kind(schema, inner)}"
        first, *others = _resolved(schema, inner or {}).get("properties", {"": {}}).items()
        bare = [name for name, _ in others] == ["unit"] and first[0].startswith("value")  # then braces may be left out
        return f"by name: {_kind(schema, first[1])}, or a table" if bare else "table by name"
    words = {"integer": "integer", "number": "number", "string": "text", "boolean": "`true` or `false`"}
    return words.get(str(kind), "table") + _limits(node)


def _limits(node: Mapping[str, Any]) -> str:
    signs = {"exclusiveMinimum": ">", "minimum": "≥", "exclusiveMaximum": "<", "maximum": "≤"}
    limits = [f"{sign} {node[key]:,}".replace(",", " ") for key, sign in signs.items() if key in node]
    return f" {', '.join(limits)}" if limits else ""


def _default(table: str, key: str, node: Mapping[str, Any]) -> str:
    if f"{table}.{key}" in SAID:
        return SAID[f"{table}.{key}"]
    if table == "rule":
        return _of_rules(key)
    of_option = OPTIONS.get(table, {}).get(key)
    if of_option is not None and of_option.default:
        return of_option.default
    known: dict[str, tuple[Any, ...]] = {
        "design": (fp.DesignProblem,),
        "runs": (fp.RunRegion, fp.design_runs),
        "campaign": (fp.Campaign,),
        "fleet": (fp.design_fleet,),
    }
    functions = known.get(table, ())
    values = [inspect.signature(function).parameters[key].default for function in functions if key in _arguments(function)]
    of_options = {one.name: one.default for kind in (Goal, ExchangeSettings, ExchangeMethod) for one in options_of(kind)}
    value = values[0] if values else of_options.get(key) if of_option is not None else node.get("default")
    return "none" if value in (None, "", [], {}, ()) else f"`{str(value).lower() if isinstance(value, bool) else _toml(value)}`"


def _arguments(function: Any) -> list[str]:
    return list(inspect.signature(function).parameters)


def _of_rules(key: str) -> str:
    """The default of an argument of a rule, for each rule that takes it."""
    defaults = []
    for rule in RULES:
        if key in _arguments(rule):
            value = getattr(rule(), key)
            kind = re.sub(r"(?<!^)(?=[A-Z])", "_", rule.__name__).lower()
            defaults.append(f"{'none' if value is None else f'`{value:g}`'} (`{kind}`)")
    return ", ".join(defaults)


def _toml(value: object) -> str:
    return f'"{value}"' if isinstance(value, str) else str(value)


def main(arguments: list[str]) -> int:
    """Write the page, or compare it."""
    if arguments not in ([], ["--check"]):
        raise SystemExit("usage: configuration.py [--check]")
    written = page()
    if arguments and (not PAGE.exists() or PAGE.read_text() != written):
        print(f"{PAGE}: expected what docs/scripts/configuration.py writes, given other text: run make docs-pages")
        return 1
    if not arguments:
        PAGE.write_text(written)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
