"""What a picture shows, as data that can be stored: titles, labels, limits, and some places of every curve, mark and area.

Numbers are rounded, and compared with a tolerance, as their last digits depend on the processor. What follows from the fonts, as
where a layout puts the panels, is left out.

``python tests/python/picture_data.py`` records the pictures of ``picture_cases.py`` anew, in ``data/pictures.json``.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.ticker import FixedFormatter
from numpy.typing import ArrayLike

STORED = Path(__file__).with_name("data") / "pictures.json"

PLACES = 9
"""Of a curve that are stored."""

NUMBER = re.compile(r"[-+]?\d[\d.e-]*")

NEXT = re.compile(r"\n\s+")

DIGITS, TOLERANCE = 4, 1e-3
"""Of a stored number; and the share of the largest one beside it by which another may differ."""


def data_of(figure: Figure) -> dict[str, Any]:
    """All that a picture shows."""
    legends = [*figure.legends, *(legend for axes in figure.axes if (legend := axes.get_legend()))]
    return {
        "size": _rounded(figure.get_size_inches()),
        "texts": [text.get_text() for text in [*filter(None, (figure._suptitle,)), *figure.texts] if text.get_text()],  # type: ignore[attr-defined]
        "legends": [[text.get_text() for text in (legend.get_title(), *legend.get_texts())] for legend in legends],
        "panels": [_panel(axes) for axes in figure.axes],
    }


def _panel(axes: Axes) -> dict[str, Any]:
    shown: dict[str, Any] = {
        "title": " ".join(filter(None, (axes.get_title(loc=place) for place in ("left", "center", "right")))),
        "labels": [axes.get_xlabel(), axes.get_ylabel()],
        "scales": [axes.get_xscale(), axes.get_yscale()],
        "limits": [_rounded(axes.get_xlim()), _rounded(axes.get_ylim())],
        "ticks": [text for axis in (axes.xaxis, axes.yaxis) for text in _ticks(axis)],
        "lines": [
            {"look": _look(line), "label": _label(line), "count": len(line.get_xdata()), **_places(line.get_xydata())}
            for line in axes.lines
        ],
        "areas": [
            {"count": len(path.vertices), "label": _label(area), **_places(path.vertices)}
            for area in axes.collections
            for path in _paths(area)
        ],
        "texts": [[text.get_text(), *_rounded(text.get_position() if not hasattr(text, "xy") else text.xy)] for text in axes.texts],
        "patches": [_places(patch.get_path().transformed(patch.get_patch_transform()).vertices) for patch in axes.patches],
        "images": [
            {"shape": list(image.get_array().shape), **_places(np.ravel(image.get_array())[:, None])} for image in axes.images
        ],
    }
    return {name: value for name, value in shown.items() if value}


def _paths(area: Any) -> Iterator[Any]:
    """The outlines of an area or of lines that belong together; of a cloud of marks, their places."""
    if isinstance(area, PathCollection):
        from matplotlib.path import Path as Outline

        yield Outline(np.asarray(area.get_offsets()))
    else:
        yield from area.get_paths()


def _ticks(axis: Any) -> list[str]:
    """The labels of ticks that are named by the picture and not by matplotlib."""
    formatters = axis.get_major_formatter(), axis.get_minor_formatter()
    return [text for formatter in formatters if isinstance(formatter, FixedFormatter) for text in formatter.seq]


def _look(line: Any) -> str:
    return f"{to_hex(line.get_color())} {line.get_linestyle()} {line.get_marker()}"


def _label(artist: Any) -> str:
    """Label of an artist, in the legend or under the mouse, without its numbers."""
    label = str(artist.get_label())
    return "" if label.startswith("_") else NUMBER.sub("#", label)


def _places(points: ArrayLike) -> dict[str, list[float | None]]:
    points = np.asarray(points, dtype=float)
    some = points[np.unique(np.linspace(0, len(points) - 1, PLACES).astype(int))] if len(points) else points
    return {f"at_{k}": _rounded(column) for k, column in enumerate(some.T)}


def _rounded(values: ArrayLike) -> list[float | None]:
    return [float(f"{value:.{DIGITS}g}") if np.isfinite(value) else None for value in np.asarray(values, dtype=float).tolist()]


def differences(shown: Any, stored: Any, where: str = "") -> Iterator[str]:
    """Where two pictures differ, and how."""
    if isinstance(shown, dict) and isinstance(stored, dict):
        for name in sorted(shown.keys() | stored.keys()):
            yield from differences(shown.get(name), stored.get(name), f"{where}.{name}" if where else name)
    elif _are_numbers(shown) and _are_numbers(stored) and len(shown) == len(stored):
        one, other = (np.array(values, dtype=float) for values in (shown, stored))
        if not np.allclose(one, other, rtol=0.0, atol=TOLERANCE * np.nanmax(np.abs(other), initial=0.0), equal_nan=True):
            yield f"{where}: expected {stored}, given {shown}"
    elif isinstance(shown, list) and isinstance(stored, list) and len(shown) == len(stored):
        for k, (one, other) in enumerate(zip(shown, stored, strict=True)):
            yield from differences(one, other, f"{where}[{k}]")
    elif isinstance(shown, float) and isinstance(stored, float):
        if not np.isclose(shown, stored, rtol=TOLERANCE, atol=1e-12):
            yield f"{where}: expected {stored}, given {shown}"
    elif shown != stored:
        yield f"{where}: expected {stored!r}, given {shown!r}"


def _are_numbers(values: Any) -> bool:
    return isinstance(values, Sequence) and not isinstance(values, str) and all(isinstance(one, float | None) for one in values)


def record(pictures: Mapping[str, Callable[[], Figure]]) -> None:
    """Store what the pictures show; lists of numbers in one line, so that changes can be read."""
    stored = {name: data_of(draw()) for name, draw in sorted(pictures.items())}
    text = json.dumps(stored, indent=1, ensure_ascii=False)
    text = re.sub(r"\[\s+([^\[\]{}]*?)\s+\]", lambda inner: f"[{NEXT.sub(' ', inner[1])}]", text)
    STORED.write_text(f"{text}\n", encoding="utf-8")


if __name__ == "__main__":
    from picture_cases import PICTURES

    record(PICTURES)
