"""Changes of saved files, at places by the names of fields alone."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from fisherpoint.basics.files import _sha256

DELETE = object()


def inner(entry: Any) -> Any:
    """What an entry has, without the name of its class, and the entries of an array."""
    while isinstance(entry, dict) and len(entry) == 1 and next(iter(entry))[0].isupper():
        (entry,) = entry.values()
    return entry["array"] if isinstance(entry, dict) and "array" in entry else entry


def edited(data: dict[str, Any], place: str, value: Any) -> None:
    """Put another value at a place of the content such as "problem.prior.mean.k", or delete what is there."""
    holder, key = data, "content"
    for name in place.split("."):
        entry = inner(holder[key])
        if isinstance(entry, dict) and set(entry) == {"mapping"}:
            pairs = entry["mapping"]
            if name not in [pair[0] for pair in pairs]:
                pairs.append([name, None])
            holder, key = next([pairs, k] for k, pair in enumerate(pairs) if pair[0] == name)
            if not place.endswith(f".{name}") or value is not DELETE:
                holder, key = holder[key], 1
        else:
            holder, key = entry, int(name) if isinstance(entry, list) else name
    if value is DELETE:
        del holder[key]
    else:
        holder[key] = value


def edit(path: Path, place: str, value: Any) -> None:
    """Change a file so, and seal it again."""
    data = json.loads(path.read_text())
    del data["sha256"]
    edited(data, place, value)
    path.write_text(json.dumps(data | {"sha256": _sha256(data)}))
