"""Lets the reference pages name what `fisherpoint` imports only when it is asked for, such as `fisherpoint.model`.

The pages are made from the sources without running them, and there these names do not occur.
"""

from __future__ import annotations

from typing import Any

import griffe

import fisherpoint as fp

LAZY = ("CallableModel", "SymbolicModel", "load_model", "model")


class LazyNames(griffe.Extension):
    """Adds each lazy name to the package as an alias of the object that it gives."""

    def on_package(self, *, pkg: griffe.Module, **_: Any) -> None:
        if pkg.path != fp.__name__:
            return
        for name in LAZY:
            found = getattr(fp, name)
            pkg.set_member(name, griffe.Alias(name, f"{found.__module__}.{found.__qualname__}"))
