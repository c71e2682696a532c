"""Local parameters as unknowns of a fit: one for each group of points, runs and records."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..basics.messages import shown
from ..basics.values import Array, FrozenMapping
from ..data.measurements import Measurements
from ..data.record import Record
from ..information.local import RECORD, RUN, Local
from ..prior.gaussian import GaussianPrior
from .bordered import Bordered
from .unknowns import Unknowns

Bounds = tuple[float | None, float | None]


class LocalUnknown(NamedTuple):
    """One value of a local parameter, and whose it is."""

    parameter: str
    group: str

    @property
    def name(self) -> str:
        return f"{self.parameter}[{self.group}]"


@dataclass(frozen=True, eq=False)
class LocalUnknowns:
    """The n values of q local parameters.

    Attributes
    ----------
    local : mapping of name to Local
    each : tuple of LocalUnknown
        The values in their order: all of a parameter, one after the other.
    trajectories : tuple of ndarray of int, (K, q)
        Of each set of data, which value counts for each point, run or record.
    samples : ndarray of int, (N, q)
        The same of each sample.
    """

    local: Mapping[str, Local]
    each: tuple[LocalUnknown, ...]
    trajectories: tuple[NDArray[np.intp], ...]
    samples: NDArray[np.intp]

    @classmethod
    def of(cls, local: Mapping[str, Local], data: Sequence[Measurements | Record]) -> LocalUnknowns:
        """Group the points, runs and records of the data.

        Raises
        ------
        ValueError
            Where data have no such labels, are no records, or are of one group alone whose spread is to be estimated.
        """
        each: list[LocalUnknown] = []
        trajectories = tuple(np.empty((_count(part), len(local)), dtype=np.intp) for part in data)
        for j, (name, one) in enumerate(local.items()):
            found: dict[str, int] = {}
            for places, labels in zip(trajectories, _labels(name, one, data), strict=True):
                places[:, j] = [len(each) + found.setdefault(label, len(found)) for label in labels]
            if one.estimated and len(found) < 2:
                raise ValueError(f"local[{name!r}]: expected at least 2 groups to estimate their spread, given {len(found)}")
            each += [LocalUnknown(name, label) for label in found]
        return cls(FrozenMapping(dict(local)), tuple(each), trajectories, _of_samples(data, trajectories))

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the unknowns, such as "m_load[3]"."""
        return tuple(one.name for one in self.each)

    @cached_property
    def means(self) -> tuple[str, ...]:
        """Local parameters whose mean over the groups is an unknown too."""
        return tuple(name for name, one in self.local.items() if one.estimated)

    def of_parameter(self, name: str) -> NDArray[np.intp]:
        """The places of a parameter's values."""
        return np.flatnonzero([one.parameter == name for one in self.each])

    def starts(self, first: Mapping[str, float]) -> dict[str, float]:
        """Where the search of each value starts that has no start of its own: at that of its parameter."""
        return {one.name: first[one.parameter] for one in self.each} | dict(first)

    def bounds(self, given: Mapping[str, Bounds]) -> dict[str, Bounds]:
        """Bounds of each value, where it has none of its own: those of its parameter."""
        return {one.name: given[one.parameter] for one in self.each if one.parameter in given} | dict(given)

    def coordinates(self, first: Mapping[str, float], prior: GaussianPrior | None) -> dict[str, tuple[float, float]]:
        """Center and unit of the coordinates of values and means, by name: the mean and the spread, or the prior's deviation."""
        of = {name: self._coordinate(name, first[name], prior) for name in self.local}
        found = {one.name: of[one.parameter] for one in self.each} | {name: of[name] for name in self.means}
        return {name: both for name, both in found.items() if both is not None}

    def _coordinate(self, name: str, mean: float, prior: GaussianPrior | None) -> tuple[float, float] | None:
        std = prior.std[name] if prior is not None and name in prior.names else abs(mean) or 1.0
        if (one := self.local[name]).spread is None:
            return (mean, std) if prior is not None and name in prior.names else None
        return mean, one.std or std

    def spread_rows(self, unknowns: Unknowns, spreads: Mapping[str, float]) -> Array:
        """What the spreads say of the values, as rows (k, P) beside those of data: (value - mean) / spread.

        The last n of the unknowns are the values; the coordinates of both, and of known means, are zero at the mean.
        """
        first, rows = len(unknowns) - len(self.each), [np.zeros((0, len(unknowns)))]
        for name, spread in spreads.items():
            places = first + self.of_parameter(name)
            own = np.zeros((len(places), len(unknowns)))
            own[np.arange(len(places)), places] = unknowns.scale[places] / spread
            if name in self.means:
                mean = unknowns.names.index(name)
                own[:, mean] = -unknowns.scale[mean] / spread
            rows.append(own)
        return np.concatenate(rows)

    def layout(self, outputs: int, further: Array) -> tuple[Bordered, Array]:
        """How Jacobians of all samples of so many outputs are stored, above `further` rows (k, P); and these as they are stored."""
        n, width, common = len(self.each), len(self.local), further.shape[1] - len(self.each)
        places, stored = np.full((len(further), width), -1, dtype=np.intp), np.zeros((len(further), common + width))
        stored[:, :common] = further[:, :common]
        parameter = np.array([list(self.local).index(one.parameter) for one in self.each], dtype=np.intp)
        for row, place in zip(*np.nonzero(further[:, common:]), strict=True):
            column = parameter[place]
            if places[row, column] >= 0:
                raise ValueError("prior: expected at most one value of each local parameter in a row, given more")
            places[row, column], stored[row, common + column] = place, further[row, common + place]
        return Bordered(np.concatenate([np.repeat(self.samples, outputs, axis=0), places]), common, n), stored


def of_common(prior: GaussianPrior | None, local: Mapping[str, Local]) -> GaussianPrior | None:
    """The prior without local parameters, of which it says where they start; None of none."""
    if prior is None or not set(prior.names) & set(local):
        return prior
    kept = [name for name in prior.names if name not in local]
    return prior.marginal(kept) if kept else None


def _labels(name: str, one: Local, data: Sequence[Measurements | Record]) -> list[list[str]]:
    """The labels of all points, runs and records of each set of data."""
    found, number = list[list[str]](), 0
    for k, part in enumerate(data):
        of_set = f"data[{k}]" if len(data) > 1 else "the data"
        if one.by == RECORD and isinstance(part, Measurements):
            raise ValueError(f"local[{name!r}]: expected records, given measurements of {part.points.kind}s in {of_set}")
        if one.by in (RUN, RECORD):
            found.append([str(number + j + 1) for j in range(_count(part))])
            number += _count(part)
            continue
        if one.by not in part.labels:
            raise ValueError(f"local[{name!r}]: expected labels {shown(one.by)}, given none in {of_set}")
        found.append(list(part.labels[one.by]) if isinstance(part, Measurements) else [part.labels[one.by]])
    return found


def _count(part: Measurements | Record) -> int:
    """Number of points or runs; a record is one."""
    return len(part) if isinstance(part, Measurements) else 1


def _of_samples(data: Sequence[Measurements | Record], trajectories: Sequence[NDArray[np.intp]]) -> NDArray[np.intp]:
    parts = []
    for part, places in zip(data, trajectories, strict=True):
        of = np.nonzero(part.runs.measured)[0] if isinstance(part, Measurements) else np.zeros(len(part), dtype=np.intp)
        parts.append(places[of])
    return np.concatenate(parts)
