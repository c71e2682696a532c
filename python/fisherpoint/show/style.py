"""How all pictures look: colours, fonts, and units that are easy to read."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter
from numpy.typing import ArrayLike

from ..basics.checks import as_path
from ..basics.files import write_whole
from ..basics.messages import shown
from ..basics.quantity import Quantity
from .numbers import number

PRIOR, CRITERION, NOISE, TEXT = "#8c8c8c", "#d55e00", "#0072b2", "#333333"
DPI, NOTEBOOK_DPI = 150, 100
STYLE: dict[Any, Any] = {
    "font.size": 9.0,
    "axes.titlesize": 10.0,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": TEXT,
    "axes.labelcolor": TEXT,
    "xtick.color": TEXT,
    "ytick.color": TEXT,
    "text.color": TEXT,
    "axes.grid": True,
    "grid.color": "#e6e6e6",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "legend.frameon": False,
}


TIMES = ((86400.0, "d"), (3600.0, "h"), (60.0, "min"), (1.0, "s"), (1e-3, "ms"), (1e-6, "µs"))
"""Units of time, in s."""

SMALL, LARGE = 1e-3, 1e5
"""Range of an axis's largest value outside of which its unit has a power of ten, instead of one at the end of the axis."""

LABELLED = "label-"
"""Prefix of the ids of curves whose labels a page shows where the mouse is."""


def show_under_mouse(curves: Iterable[Artist], label: str, name: str) -> None:
    """Show a text where the mouse is on curves and areas in a page; `name` is theirs in the picture."""
    for k, curve in enumerate(curves):
        curve.set_gid(f"{LABELLED}{name}-{k}")
        curve.set_label(label)


def show_each_under_mouse(dots: Line2D, texts: Iterable[str], name: str) -> None:
    """Show a text for each dot of a line without gaps where the mouse is on it, in a page."""
    show_under_mouse([dots], "\n".join(texts), name)


def scale(quantity: Quantity, values: ArrayLike) -> tuple[float, str]:
    """Factor and unit that make the values easy to read along an axis: MPa for 2e7 Pa, h for 2e5 s, 1e-6 m3 for 4e-6 m3."""
    factor, unit = prefixed(quantity, values)
    largest = float(np.nanmax(np.abs(np.asarray(values)), initial=0.0)) * factor
    if largest and np.isfinite(largest) and not SMALL <= largest < LARGE:
        power = 3 * int(np.floor(np.log10(largest) / 3))
        return factor * 10.0**-power, f"1e{power} {unit}".removesuffix(" 1")
    return factor, unit


def said(quantity: Quantity, value: float) -> str:
    """A value in a sentence, in a unit that is easy to read."""
    factor, unit = prefixed(quantity, value)
    return f"{number(factor * value)} {unit}".removesuffix(" 1")


def prefixed(quantity: Quantity, values: ArrayLike) -> tuple[float, str]:
    """Factor and unit, with a prefix where the unit is one that has some: MPa for 2e7 Pa, ms for 0.01 s, h for 2e5 s."""
    largest = float(np.nanmax(np.abs(np.asarray(values)), initial=0.0))
    if quantity.unit == "s":
        for seconds, unit in TIMES[:3]:
            if largest >= 3 * seconds:
                return 1 / seconds, unit
    for factor, prefix in ((1e-6, "M"), (1e-3, "k"), (1.0, ""), (1e3, "m"), (1e6, "µ")):
        if quantity.unit == "s" and factor < 1:
            continue  # nobody reads kiloseconds
        if quantity.unit in ("m", "s", "Pa", "N", "V", "A", "W") and largest * factor >= 0.1:
            return factor, prefix + quantity.unit
    return 1.0, quantity.unit


def labelled(name: str, unit: str) -> str:
    """The label of an axis; what has no dimension has no unit."""
    return name if unit in ("", "1") else f"{name} [{unit}]"


def share_formatter() -> FuncFormatter:
    """Shares along an axis as percentages, with the digits that each needs: along a logarithmic axis 0.1% stands beside 100%."""
    return FuncFormatter(lambda share, _: f"{100 * share:g}%")


class Picture(Figure):
    """A figure that shows itself in notebooks, also where `%matplotlib` has not prepared them for figures."""

    def _repr_png_(self) -> bytes:
        return encoded(self, "png", dpi=NOTEBOOK_DPI)


def nothing_drawn(text: str) -> Figure:
    """A picture that says why there is nothing to draw."""
    figure = Picture(figsize=(6.0, 1.2))
    figure.text(0.02, 0.5, text, va="center")
    return figure


def drawn(figure: Figure, path: str | Path | None) -> Figure:
    """The picture, which is also written where a path is given."""
    if path is not None:
        save_figure(figure, path)
    return figure


def save_figure(figure: Figure, path: str | Path) -> None:
    """Write a picture, whole or not at all; the ending says the format, PNG where there is none."""
    path = as_path(path, "path")
    if not path.suffix:
        path = path.with_name(f"{path.name}.png")
    kind, known = path.suffix[1:].lower(), figure.canvas.get_supported_filetypes()
    if kind not in known:
        raise ValueError(f"path: expected the ending of a picture, one of {', '.join(sorted(known))}; given {shown(path.suffix)}")
    write_whole(path, encoded(figure, kind))


def encoded(figure: Figure, kind: str, dpi: int = DPI) -> bytes:
    """A picture in a format."""
    picture = BytesIO()
    with settled(figure):
        figure.savefig(picture, format=kind, dpi=dpi)
    return picture.getvalue()


@contextmanager
def settled(figure: Figure) -> Iterator[None]:
    """Have the layout decided once: else a picture is drawn twice for each file, the first time for its layout alone."""
    engine, dpi = figure.get_layout_engine(), figure.dpi
    figure.dpi = DPI
    try:
        settle(figure)
        yield
    finally:
        figure.dpi = dpi
        figure.set_layout_engine(engine)


def settle(figure: Figure) -> None:
    """Let the layout decide where all is, and no more after that."""
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)
        figure.set_layout_engine(None)  # an engine that does nothing, "none", would still have each file drawn twice
