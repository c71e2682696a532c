"""Runs with round and equal numbers, where that changes next to nothing.

A search leaves inputs that wiggle by a share of a percent, which say nothing and which an operator would have to type. So all
numbers are rounded as coarsely as log det F allows, and then neighbouring segments get one value, as many as it allows.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import pairwise

import numpy as np

from ...basics.quantity import names_of
from ...basics.values import Array
from ...models import Model
from ...points.run_coordinates import DECADE
from ...points.run_region import RunRegion
from ...points.runs import Runs
from .tuning import RunSearchTuning


def tidied(
    runs: Runs,
    region: RunRegion,
    model: Model,
    worth: Callable[[list[Runs]], Array],
    able: Callable[[Runs], bool],
    least: float,
    tuning: RunSearchTuning = RunSearchTuning(),
) -> Runs:
    """The runs with round numbers, and with fewer different ones.

    Parameters
    ----------
    runs : Runs
    region : RunRegion
        Whose bounds and rates the runs keep.
    model : Model
    worth : callable
        From designs to their log det F, or what is maximised.
    able : callable
        Whether enough plants can run a design.
    least : float
        What log det F must not fall below.
    tuning : RunSearchTuning
    """
    fits = _Fits(region, model, tuning)

    def best(designs: list[Runs]) -> Runs | None:
        """The first that is worth enough and can be run."""
        designs = [one for one in designs if fits.keeps(one)]
        values = worth(designs) if designs else np.empty(0)
        return next((one for one, value in zip(designs, values, strict=True) if value >= least and able(one)), None)

    rounded = best([fits.rounded(runs, share) for share in _shares(tuning)])
    runs = runs if rounded is None else rounded
    for _ in range(tuning.merge_rounds):
        merges = list(fits.merges(runs))
        if not merges:
            break
        values = worth([fits.merged(runs, [one]) for one in merges])
        order = [k for k in np.argsort(-values, kind="stable").tolist() if values[k] >= least]
        lengths = sorted(
            {-(-len(order) * k // tuning.merge_prefixes) for k in range(1, tuning.merge_prefixes + 1)} - {0}, reverse=True
        )
        found = best([fits.merged(runs, [merges[k] for k in order[:length]]) for length in lengths])
        if found is None:
            break
        runs = found
    return runs


def _shares(tuning: RunSearchTuning) -> Iterator[float]:
    """Steps as shares of a range, the coarsest first."""
    share = tuning.coarsest_step
    while share >= tuning.finest_step:
        yield share
        share /= 2


class _Fits:
    """Which numbers of the runs of a region may be rounded."""

    def __init__(self, region: RunRegion, model: Model, tuning: RunSearchTuning) -> None:
        self._tuning = tuning
        self._region, states, inputs = region, names_of(model.states), names_of(model.inputs)
        resting = () if region.rest is None else region.rest.names(states)
        self._starts = [(i, *region.bounds[name]) for i, name in enumerate(states) if name not in resting and self._free(name)]
        held = [(i, name) for i, name in enumerate(inputs) if name not in region.given and region.profile_of(name) is None]
        self._inputs = [(i, *region.bounds[name]) for i, name in held if self._free(name)]
        self._merged = [one for one in self._inputs if inputs[one[0]] not in (*region.constant, *region.shared)]
        self._slew = [(i, region.slew[name]) for i, name in enumerate(inputs) if name in region.slew]

    def _free(self, name: str) -> bool:
        lower, upper = self._region.bounds[name]
        return lower < upper and name not in self._region.levels

    def rounded(self, runs: Runs, share: float) -> Runs:
        """All free numbers at multiples of a step that is about this share of their range."""
        x0, u, dt = runs.x0.copy(), runs.u.copy(), runs.dt.copy()
        for i, lower, upper in self._starts:
            x0[:, i] = _round(x0[:, i], lower, upper, share)
        for i, lower, upper in self._inputs:
            u[:, :, i] = _round(u[:, :, i], lower, upper, share)
        lower, upper = self._region.bounds["dt"]
        if lower < upper:
            linear = _round(dt, lower, upper, share)
            dt = np.where(dt > 0, _significant(dt, lower, upper, share) if upper > DECADE * lower else linear, 0.0)
        return Runs(x0, u, dt, runs.measured, rest=runs.rest, before=runs.before, columns=runs.columns)

    def merges(self, runs: Runs) -> Iterator[tuple[int, int, int, int, float]]:
        """Holds of an input that may become equal to a neighbour: run, input, first and last segment, value."""
        for i, lower, upper in self._merged:
            for k in range(len(runs)):
                values = runs.u[k, : runs.segments[k], i]
                edges = [0, *(np.flatnonzero(np.diff(values)) + 1).tolist(), len(values)]
                for (a, b), (c, d) in pairwise(pairwise(edges)):
                    if abs(values[a] - values[c]) <= self._tuning.merge_distance * (upper - lower):
                        yield k, i, a, b, float(values[c])
                        yield k, i, c, d, float(values[a])

    def merged(self, runs: Runs, merges: list[tuple[int, int, int, int, float]]) -> Runs:
        """The runs with some of these; of two that concern one hold the first counts."""
        u, done = runs.u.copy(), np.zeros(runs.u.shape, dtype=bool)
        for k, i, first, stop, value in merges:
            beside = slice(max(first - 1, 0), stop + 1)
            if not done[k, beside, i].any():
                u[k, first:stop, i], done[k, first:stop, i] = value, True
        return Runs(runs.x0, u, runs.dt, runs.measured, rest=runs.rest, before=runs.before, columns=runs.columns)

    def keeps(self, runs: Runs) -> bool:
        """Whether rates and the duration are within what the region allows."""
        longest = self._region.duration
        if longest is not None and runs.dt.sum(axis=1).max() > longest * (1 + 1e-12):
            return False
        there = runs.dt[:, 1:] > 0
        return all((np.abs(np.diff(runs.u[:, :, i], axis=1))[there] <= most * (1 + 1e-12)).all() for i, most in self._slew)


def _round(values: Array, lower: float, upper: float, share: float) -> Array:
    """Multiples of a round step, or the bounds."""
    power = 10.0 ** np.floor(np.log10(share * (upper - lower)))
    step = power * max(one for one in (1.0, 2.0, 5.0) if one * power <= share * (upper - lower) * (1 + 1e-9))
    digits = int(-np.floor(np.log10(power)))
    near = np.round(np.rint(values / step) * step, digits)
    near = np.where(values - lower < step / 2, lower, np.where(upper - values < step / 2, upper, near))
    return np.asarray(np.clip(near, lower, upper))


def _significant(values: Array, lower: float, upper: float, share: float) -> Array:
    """Round to so many significant digits that the last is about this share of a value, or to the bounds."""
    power = 10.0 ** np.floor(np.log10(np.maximum(values, lower)))
    step = 10.0 ** np.floor(np.log10(share)) * power
    near = np.where(values > upper - step / 2, upper, np.where(values < lower + step / 2, lower, np.rint(values / step) * step))
    return np.asarray(np.clip([float(f"{one:.12g}") for one in near.ravel()], lower, upper)).reshape(values.shape)
