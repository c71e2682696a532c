"""The programs, and what each of them needs."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import version
from importlib.util import find_spec

from . import boost_odeint
from .peer import Peer


@dataclass(frozen=True)
class Entry:
    """A module of this package, and the Python packages that it imports."""

    module: str
    packages: tuple[str, ...] = ()

    def missing(self) -> str | None:
        """Return what to install, or None where everything is there."""
        if self.module == "boost_odeint":
            return boost_odeint.missing()
        absent = [name for name in self.packages if find_spec(name) is None]
        return f"pip install {' '.join(absent)}" if absent else None

    def versions(self) -> dict[str, str]:
        """Return the versions of what is installed."""
        return boost_odeint.versions() if self.module == "boost_odeint" else {name: version(name) for name in self.packages}

    def load(self) -> list[Peer]:
        peers: list[Peer] = import_module(f"{__package__}.{self.module}").PEERS
        return peers


OURS = Entry("ours")
ENTRIES = (
    Entry("boost_odeint"),
    Entry("heyoka_batch", ("heyoka",)),
    Entry("jax_lanes", ("jax",)),
    Entry("numba_dop853", ("numba", "numbalsoda")),
    Entry("numpy_lanes"),
    Entry("diffrax_tsit5", ("jax", "diffrax")),
    Entry("casadi_cvodes", ("casadi",)),
    Entry("scipy_solvers"),
)
