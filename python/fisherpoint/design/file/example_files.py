"""The examples that come with the project."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path

PLACES = (files("fisherpoint") / "examples", Path(__file__).resolve().parents[4] / "examples")
"""Folders of the examples in an installed package, and in the project's own tree."""


def example_texts(ending: str = ".toml") -> Mapping[str, str]:
    """The text of each example's TOML file, or of its measurements with the ending .csv, by its name, in alphabetical order."""
    for place in PLACES:
        if place.is_dir():
            found = {file.name: file for file in place.iterdir() if file.name.endswith(ending)}
            return {name.removesuffix(ending): found[name].read_text(encoding="utf-8") for name in sorted(found)}
    raise ValueError("examples: expected the examples in the package, given an installation without them; reinstall fisherpoint")
