"""Named physical quantities."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import KW_ONLY, dataclass

from .checks import as_positive
from .messages import shortened, shown

LONGEST_NAME, LONGEST_UNIT, LONGEST_DESCRIPTION = 200, 100, 2000
"""Characters."""


@dataclass(frozen=True)
class Quantity:
    """A state, input, output, parameter or constant: its name, SI unit and description. An empty unit is "1", dimensionless.

    `scale` is a state's or output's natural size, in its unit, to which tolerances refer; None is taken as 1.
    """

    name: str
    unit: str
    description: str = ""
    _: KW_ONLY
    scale: float | None = None

    def __post_init__(self) -> None:
        for field, longest in (("name", LONGEST_NAME), ("unit", LONGEST_UNIT), ("description", LONGEST_DESCRIPTION)):
            text, label = getattr(self, field), field if field == "name" else f"{shortened(self.name)}.{field}"
            if not isinstance(text, str) or not (field == "description" or text.isprintable()) or (field == "name" and not text):
                raise TypeError(f"{label}: expected the {field} of a quantity as text, given {shown(text)}")
            if len(text) > longest:
                raise ValueError(f"{label}: expected at most {longest} characters, given {len(text):,}")
        object.__setattr__(self, "unit", self.unit.strip() or "1")
        if self.scale is not None:
            object.__setattr__(self, "scale", as_positive(self.scale, f"{shortened(self.name)}.scale"))


def names_of(quantities: Iterable[Quantity]) -> tuple[str, ...]:
    return tuple(quantity.name for quantity in quantities)


DURATION = Quantity("dt", "s", "duration")
"""Duration of an experiment point."""
