"""The kinds of profiles, by the words of files."""

from __future__ import annotations

from collections.abc import Mapping

from ..basics.values import FrozenMapping
from .profiles import PRBS, Given, Held, InputProfile, Ramps, Spline
from .sines import Chirp, Multisine

PROFILES: Mapping[str, type[InputProfile]] = FrozenMapping(
    {"held": Held, "ramps": Ramps, "spline": Spline, "multisine": Multisine, "chirp": Chirp, "prbs": PRBS, "given": Given}
)
