"""Runs with fewer samples that are worth about as much, for searches.

Neighbours among thousands of samples inform alike. Where their noise is white, one in k of them with a k-th of its variance makes
nearly the same F, at a fraction of the work: F is a sum over samples, which this replaces by one with wider steps.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..noise.models import Noise, NoiseModel
from ..points.run_region import RunRegion
from .problem import DesignProblem

ENOUGH = 500
"""About as many samples of a run are left."""


def with_fewer_samples(problem: DesignProblem, region: RunRegion) -> tuple[DesignProblem, RunRegion]:
    """The problem and its region with a longer period of samples and less noise; as they are where that would change F."""
    noise = problem.noise
    if region.sample_every is None or noise is None or isinstance(noise, NoiseModel) or not problem.white_alone:
        return problem, region
    stds = {name: one.nominal if isinstance(one, Noise) else one for name, one in noise.items()}
    shortest = region.segments * region.bounds["dt"][0]
    k = int(shortest / (region.sample_every * ENOUGH))
    if k < 2:
        return problem, region
    fewer = RunRegion(**region._arguments() | {"sample_every": k * region.sample_every})
    return replace(problem, noise={name: std / float(np.sqrt(k)) for name, std in stds.items()}, region=fewer), fewer
