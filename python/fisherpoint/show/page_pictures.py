"""Pictures for a page: as PNG or SVG, mostly the smaller of both, or where curves show their names, as elements of the page."""

from __future__ import annotations

import re
from base64 import b64encode
from html import escape
from io import BytesIO
from typing import Any
from xml.etree import ElementTree

import matplotlib as mpl
from matplotlib.figure import Figure
from matplotlib.text import Text

from .page import PagePicture
from .style import LABELLED, encoded, settle

SVG = "http://www.w3.org/2000/svg"
MOST_BYTES, MOST_INLINE = 290_000, 500_000
"""Maximum size of a picture in a page, and of one that is an element of it, so that pages stay below 2 MB."""
SMALL_DPI = 72

TITLES = {"criterion": "Search: the criterion over the iterations", "parity": "Measured against predicted outputs"}
"""Titles of pictures whose names do not say enough."""


def for_page(name: str, figure: Figure, png: bytes | None = None) -> PagePicture:
    """A picture for a page; `png` is its file where there is one."""
    settle(figure)
    title = TITLES.get(name, name.replace("_", " ").capitalize())
    png = png or encoded(figure, "png")
    labels = {gid: str(artist.get_label()) for artist in figure.findobj() if (gid := artist.get_gid() or "").startswith(LABELLED)}
    width = float(figure.get_size_inches()[0])
    kind, data = "png", png
    if labels or _is_large(png) or not _has_outlined_texts(figure):
        svg = _svg(figure, title)
        if labels and (inline := _inline(svg, labels, title)) and len(inline) <= MOST_INLINE:
            return PagePicture(title, inline, width)
        kind, data = min(("svg+xml", svg), ("png", png), key=lambda one: len(one[1]))
    if _is_large(data):
        kind, data = "png", encoded(figure, "png", SMALL_DPI)
    source = f"data:image/{kind};base64,{b64encode(data).decode()}"
    return PagePicture(title, f'<img alt="{escape(title)}" src="{source}">', width)


def _is_large(data: bytes) -> bool:
    return len(data) * 4 / 3 > MOST_BYTES


def _has_outlined_texts(figure: Figure) -> bool:
    """Whether some texts would be paths in an SVG, which takes long and is large."""
    return any(text.get_path_effects() for text in figure.findobj(Text))


def _svg(figure: Figure, title: str) -> bytes:
    metadata: dict[str, Any] = dict.fromkeys(("Creator", "Date", "Format", "Type"))  # that is, none
    out = BytesIO()
    # Texts stay texts, that can be searched and are small. Ids follow from the title, as a page must have each but once.
    fonts = ["DejaVu Sans", "Verdana", "sans-serif"]
    with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": title, "font.sans-serif": fonts}):
        figure.savefig(out, format="svg", metadata=metadata)
    return out.getvalue()


def _inline(svg: bytes, labels: dict[str, str], title: str) -> str:
    """The picture as an element, in which the curves of these ids show their labels."""
    ElementTree.register_namespace("", SVG)
    ElementTree.register_namespace("xlink", "http://www.w3.org/1999/xlink")
    root = ElementTree.fromstring(svg)
    used = {name for element in root.iter() for value in element.attrib.values() for name in re.findall(r"#([\w-]+)", value)}
    for element in root.iter():
        element.tail = element.tail and element.tail.strip()
        for style in element.findall(f"{{{SVG}}}style"):
            element.remove(style)  # it would hold for the whole page
        name = element.get("id", "")
        if name in labels:
            texts, dots = labels[name].split("\n"), list(element.iter(f"{{{SVG}}}use"))
            if len(texts) == len(dots):
                for dot, text in zip(dots, texts, strict=True):
                    _label(dot, text)
            elif len(texts) == 1:
                _label(element, texts[0])
        if name and name not in used:
            del element.attrib["id"]
    root.set("role", "img")
    root.set("aria-label", title)
    return ElementTree.tostring(root, encoding="unicode")


def _label(element: ElementTree.Element, text: str) -> None:
    element.set("class", "hover")
    title = ElementTree.Element(f"{{{SVG}}}title")
    title.text = text
    element.insert(0, title)
