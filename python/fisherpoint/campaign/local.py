"""Local parameters in a campaign: the plant and the day of each batch, and what the next one shares with those before."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..basics.messages import shown
from ..data import Measurements, Record
from ..estimation.fit import Fit
from ..information.deviations import Deviations
from ..information.local import RECORD, RUN, Local
from ..information.problem import DesignProblem
from ..prior.gaussian import GaussianPrior

PLANT = "plant"
"""The label that all batches without labels share, as a campaign is carried out on one plant. Others are new in each batch."""


def words_of(problem: DesignProblem) -> tuple[str, ...]:
    """Names of the labels by which parameters are local.

    Raises
    ------
    ValueError
        For what is local to a record, which a campaign does not have.
    """
    for name in (name for name, one in problem.local_parameters.items() if one.by == RECORD):
        raise ValueError(f"local[{name!r}]: expected 'run', or a label such as 'day', in a campaign, given 'record'")
    return tuple(dict.fromkeys(one.by for one in problem.local_parameters.values() if one.by != RUN))


def check_plants(problem: DesignProblem, batches: Sequence[Measurements], data: Measurements) -> None:
    """Raise where some batches have a label of their plant and others have none."""
    if PLANT not in words_of(problem):
        return
    for k, one in enumerate(batches, 1):
        if (PLANT in one.labels) != (PLANT in data.labels):
            expected, given = ("labels", "none") if PLANT in one.labels else ("no labels", shown(data.labels[PLANT][0]))
            raise ValueError(f"data: expected {expected} {PLANT!r} as in batch {k}, given {given}")


def labelled(problem: DesignProblem, batches: Sequence[Measurements]) -> list[Measurements]:
    """The data of all batches with the labels that local parameters need: those without are of the one plant, and of a new day."""
    found = []
    for k, data in enumerate(batches, 1):
        missing = {word: "1" if word == PLANT else f"batch {k}" for word in words_of(problem) if word not in data.labels}
        found.append(replace(data, labels={**data.labels, **{word: (label,) * len(data) for word, label in missing.items()}}))
    return found


def deviations_of(problem: DesignProblem, data: Measurements) -> Deviations:
    """What deviates in a fit; a spread between fewer than two values is not estimated yet."""

    def one(of: Local) -> Local:
        groups = len(data) if of.by == RUN else len(set(data.labels[of.by]))
        return Local(of.by) if of.estimated and groups < 2 else of

    local = {name: one(of) for name, of in problem.local_parameters.items()}
    return replace(problem.deviations, local=local) if local else problem.deviations


def as_previous(problem: DesignProblem, data: Measurements) -> list[Measurements]:
    """All data beside the next batch, which is on the plant of the last one: what is of that has no label of a plant."""
    if PLANT not in words_of(problem):
        return [data]
    plants = data.labels[PLANT]
    here, elsewhere = ([k for k, one in enumerate(plants) if (one == plants[-1]) is same] for same in (True, False))
    labels = {name: of for name, of in data[here].labels.items() if name != PLANT}
    return [replace(data[here], labels=labels), *([data[elsewhere]] if elsewhere else [])]


def of_this_plant(problem: DesignProblem, fit: Fit, prior: GaussianPrior) -> GaussianPrior:
    """The prior where what is local to a plant has the mean that was found of the one that is measured next."""
    found = {}
    for name, one in problem.local_parameters.items():
        if one.by == PLANT:
            value = fit.local[name][_labels(fit.data[-1])[-1]]
            if np.isfinite(value.standard_error) and (name not in prior.log or value.estimate > 0):
                found[name] = value.estimate
    return prior.moved_to({**prior.mean, **found}) if found else prior


def _labels(data: Measurements | Record) -> tuple[str, ...]:
    label = data.labels[PLANT]
    return (label,) if isinstance(label, str) else label
