"""Cases of the random campaign with given points, for tests of its judges."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

import fisherpoint as fp
from random_models import Case
from reading import Floats


@dataclass(frozen=True)
class At(Case):
    """A case with given points: (x0, u, dt) and the parameters."""

    given: Any = None

    def points(self, count: int) -> tuple[fp.Experiments, Floats]:
        experiments, theta = self.given
        return fp.Experiments(*experiments), np.array(theta)
