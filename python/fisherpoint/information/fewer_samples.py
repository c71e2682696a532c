"""Runs with fewer samples that are worth about as much, for searches.

Neighbours among thousands of samples inform alike. Where their noise is white, one in k of them with a k-th of its variance makes
nearly the same F, at a fraction of the work: F is a sum over samples, which this replaces by one with wider steps.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ..noise.models import Noise, NoiseModel
from ..points.run_region import RunRegion
from .problem import DesignProblem

ENOUGH = 500
"""About as many samples of a run are left."""


def with_fewer_samples(problem: DesignProblem, region: RunRegion) -> tuple[DesignProblem, RunRegion]:
    """The problem and its region with longer periods of samples and less noise; as they are where that would change F.

    One in k readings of an output, with a k-th of its variance, is left, so that the shortest run has about `ENOUGH` samples. Of
    outputs with periods of their own, those that are read often come near to one period, and the others, and tables, stay.

    Parameters
    ----------
    problem : DesignProblem
    region : RunRegion
        Its region, or a part of it.
    """
    noise, every = problem.noise, region.sample_every
    if every is None or noise is None or isinstance(noise, NoiseModel) or not problem.white_alone:
        return problem, region
    stds = {name: one.nominal if isinstance(one, Noise) else one for name, one in noise.items()}
    of_each = every if isinstance(every, Mapping) else dict.fromkeys(stds, every)
    periods = {name: one for name, one in of_each.items() if not isinstance(one, tuple)}
    finest, shortest = min(periods.values(), default=np.inf), region.segments * region.bounds["dt"][0]
    k = int(shortest / (finest * ENOUGH))
    if k < 2:
        return problem, region
    fewer = {name: max(1, round(k * finest / period)) for name, period in periods.items()}
    region = region.sampling(
        {**every, **{name: fewer[name] * period for name, period in periods.items()}} if isinstance(every, Mapping) else k * finest
    )
    noise = {name: std / float(np.sqrt(fewer.get(name, 1))) for name, std in stds.items()}
    return replace(problem, noise=noise, region=region), region
