"""The pictures of a command, drawn by processes that make themselves ready while it is at its work."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING

from fisherpoint.basics.extras import needed_for
from fisherpoint.show.display import Plots
from fisherpoint.show.page import PagePicture

from .importing import importing
from .work_processes import Helpers

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_DRAWERS = 2
"""Processes that draw: the longest picture takes as long as all others together."""


class Drawers:
    """Draws pictures, each of them once.

    Parameters
    ----------
    helpers : Helpers or None
        None where nothing is to be drawn.
    """

    def __init__(self, helpers: Helpers | None) -> None:
        self._helpers = helpers
        self._begun: dict[str, Callable[[], tuple[bytes, PagePicture]]] = {}

    def unless(self, interrupted: bool) -> Drawers:
        """These, or where it was interrupted such as draw nothing: who does so wants an end."""
        return Drawers(None) if interrupted else self

    def begin(self, plots: Plots) -> None:
        """Begin to draw those that have not been begun, the last first: they take longest."""
        if self._helpers is not None:
            for name in reversed([name for name in plots if name not in self._begun]):
                self._begun[name] = self._helpers.begin(partial(_encoded, name, plots[name]))

    def drawn(self, plots: Plots) -> Iterator[tuple[str, bytes, PagePicture]]:
        """Yield the name of each picture, its PNG file, and the picture for the page."""
        self.begin(plots)
        for name in (name for name in plots if name in self._begun):
            yield name, *self._begun[name]()

    def __bool__(self) -> bool:
        return self._helpers is not None


@contextmanager
def drawers(module: str | None) -> Iterator[Drawers]:
    """Begin to import a module of pictures, or none: what can fail for a trivial reason fails before the work, not after it."""
    if module is None:
        yield Drawers(None)
        return
    with needed_for("pictures"):
        if find_spec("matplotlib") is None:
            raise ModuleNotFoundError("No module named 'matplotlib'", name="matplotlib")
    with importing():
        helpers = Helpers(MOST_DRAWERS, partial(_prepare, module))
    with helpers:
        yield Drawers(helpers)


def _prepare(module: str) -> None:
    import_module("fisherpoint.show.page_pictures")
    import_module(module)


def _encoded(name: str, plot: Callable[[], Figure]) -> tuple[bytes, PagePicture]:
    """A picture as a file, and for the page."""
    from fisherpoint.show.page_pictures import for_page
    from fisherpoint.show.style import encoded, settle

    figure = plot()
    settle(figure)
    png = encoded(figure, "png")
    return png, for_page(name, figure, png)
