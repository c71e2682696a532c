"""Kinds of batches of a campaign, points or runs, and how each is designed: the region decides which."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

from ..basics.values import FrozenMapping
from ..data import Measurements
from ..design.exchange import exchange
from ..design.runs.design_runs import design_runs
from ..design.settings import ExchangeSettings, RunSettings
from ..information.problem import DesignProblem
from ..information.run_information import checked_problem
from ..models import Model
from ..points.codec import points_from_json, points_to_json, runs_from_json, runs_to_json
from ..points.experiments import Experiments, points_csv
from ..points.region import ExperimentRegion
from ..points.run_files import plan_csv, runs_csv
from ..points.run_region import RunRegion
from ..points.runs import Runs
from ..show.numbers import percent

Points: TypeAlias = Experiments | Runs
Settings: TypeAlias = ExchangeSettings | RunSettings


@dataclass(frozen=True, eq=False)
class Kind:
    """One of the two kinds of campaigns.

    Attributes
    ----------
    name : str
        What a batch has several of, in the singular.
    points, region, settings : type
        The class of these, of the regions in which they are found, and of the settings of the search.
    search : callable
        Finds them: `exchange` or `design_runs`.
    size : str
        The search's argument for their number.
    batch : int
        Their number where none is given.
    tables : mapping of name to callable
        The text of each file of a batch, ``<name>_<k>.csv``.
    to_json, from_json : callable
    """

    name: str
    points: type[Points]
    region: type[ExperimentRegion | RunRegion]
    settings: type[Settings]
    search: Callable[..., Any]
    size: str
    batch: int
    tables: Mapping[str, Callable[[Any, Model], str]]
    to_json: Callable[[Any], dict[str, Any]]
    from_json: Callable[[dict[str, Any]], Points]

    def design(
        self,
        problem: DesignProblem,
        settings: Settings,
        *,
        threads: int,
        progress: bool | Callable[..., None] | None,
        previous: Measurements | None,
    ) -> Points:
        """The next batch.

        Raises
        ------
        KeyboardInterrupt
            Where Ctrl-C ended the search, whatever it had found by then: another search would not stop there.
        """
        found = self.search(problem, **vars(settings), threads=threads, progress=progress, previous=previous)
        if found.stop_reason == "interrupted":
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

    def check(self, data: Measurements) -> None:
        """Raise TypeError for measurements of the other kind."""
        if not isinstance(data.points, self.points):
            other = next(kind for kind in KINDS if isinstance(data.points, kind.points))
            raise TypeError(
                f"data: expected measurements of {self.name}s, as those that this campaign designs, given those of {other.name}s"
            )


POINTS = Kind(
    name="point",
    points=Experiments,
    region=ExperimentRegion,
    settings=ExchangeSettings,
    search=exchange,
    size="n_experiments",
    batch=6,
    tables=FrozenMapping({"batch": points_csv}),
    to_json=points_to_json,
    from_json=points_from_json,
)
RUNS = Kind(
    name="run",
    points=Runs,
    region=RunRegion,
    settings=RunSettings,
    search=design_runs,
    size="n_runs",
    batch=1,
    tables=FrozenMapping({"batch": runs_csv, "plan": plan_csv}),
    to_json=runs_to_json,
    from_json=runs_from_json,
)
KINDS = (POINTS, RUNS)


def kind_of(problem: DesignProblem) -> Kind:
    """The kind that a problem's region is of.

    Raises
    ------
    ValueError
        Where there is no region, and for runs that could not be designed.
    """
    for kind in KINDS:
        if isinstance(problem.region, kind.region):
            if kind is RUNS:
                checked_problem(problem)
            return kind
    raise ValueError("region: expected an ExperimentRegion or a RunRegion to design in, given None")
