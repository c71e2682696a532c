"""How the batches of a campaign are designed: points by the exchange, or runs, as the region says."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

from ..basics.stop_reason import StopReason
from ..basics.values import FrozenMapping
from ..data import Measurements
from ..design.points.exchange import exchange
from ..design.results.settings import ExchangeSettings, RunSettings
from ..design.runs.design_runs import design_runs
from ..information.problem import DesignProblem
from ..information.run_information import checked_problem
from ..points.points_or_runs import Points
from ..show.numbers import percent

Settings: TypeAlias = ExchangeSettings | RunSettings


class BatchSearch(NamedTuple):
    """The search that designs batches.

    Attributes
    ----------
    kind : {"point", "run"}
        What a batch has several of.
    search : callable
    settings : type
        The class of its settings.
    size : str
        Its argument for the number of points or runs.
    batch : int
        Their number where none is given.
    """

    kind: str
    search: Callable[..., Any]
    settings: type[Settings]
    size: str
    batch: int


BY_REGION: Mapping[str, BatchSearch] = FrozenMapping(
    {
        "point": BatchSearch("point", exchange, ExchangeSettings, "n_experiments", 6),
        "run": BatchSearch("run", design_runs, RunSettings, "n_runs", 1),
    }
)


def search_of(problem: DesignProblem) -> BatchSearch:
    """The search in a problem's region.

    Raises
    ------
    ValueError
        Where there is no region, and for runs that could not be designed.
    """
    if problem.region is None:
        raise ValueError("region: expected an ExperimentRegion or a RunRegion to design in, given None")
    if problem.region.kind == "run":
        checked_problem(problem)
    return BY_REGION[problem.region.kind]


def designed(
    problem: DesignProblem,
    settings: Settings,
    *,
    threads: int,
    progress: bool | Callable[..., None] | None,
    previous: Sequence[Measurements] | None,
) -> Points:
    """Design the next batch.

    Raises
    ------
    KeyboardInterrupt
        Where Ctrl-C ended the search, whatever it had found by then: another search would not stop there.
    """
    found = search_of(problem).search(problem, **vars(settings), threads=threads, progress=progress, previous=previous)
    if found.stop_reason == StopReason.interrupted:
        raise KeyboardInterrupt
    able = found.feasibility
    required = found.settings.goal.share_of_plants
    if required is not None and able is not None and not found.feasible:
        warnings.warn(
            f"confidence: expected a batch that {percent(required)} of the plants can run, "
            f"found one that {percent(able.share)} can",
            stacklevel=3,
        )
    points: Points = found.points
    return points
