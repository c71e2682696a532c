"""`fp.campaigns`: a campaign for each of many plants, in one table."""

from __future__ import annotations

import copy
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..basics.checks import as_path, check_mapping, check_name, check_positive_int, check_type
from ..basics.csv_file import csv_text
from ..basics.extras import needed_for
from ..basics.files import write_whole
from ..basics.messages import printable, shown
from ..basics.result_files import encoded
from ..basics.stop_reason import StopReason
from ..basics.values import FrozenMapping
from ..data import Measurements, VirtualRig
from ..engine.workers import Workers, distributed_over
from ..information.problem import DesignProblem
from ..points.settings import check_threads
from ..show.display import Shown
from ..show.numbers import computed, counted, percent
from ..show.progress import Progress, check_progress, following
from ..show.section import Report, Section
from .batches import search_of
from .campaign import Campaign
from .settings import batch_settings, checked_targets
from .state import CampaignState

if TYPE_CHECKING:
    import pandas as pd

TABLE = "plants.csv"
MOST_BATCHES = 10_000

COLUMNS = ("plant", "parameter", "batches", "estimate", "standard_error", "rse", "target", "met", "state")


class PlantCampaign(NamedTuple):
    """Where the campaign of a plant stands.

    Attributes
    ----------
    state : CampaignState
    met : mapping of parameter name to bool
        Whether the target of each parameter that has one is met.
    done : bool
        Whether all of them are.
    """

    state: CampaignState
    met: Mapping[str, bool]
    done: bool

    @property
    def words(self) -> str:
        """What is next."""
        return "done" if self.done else "to be measured" if self.state.planned is not None else "not done"


@dataclass(frozen=True, eq=False, repr=False)
class Campaigns(Shown):
    """Campaigns of many plants, as `campaigns` left them.

    Attributes
    ----------
    directory : Path
        The campaign of each plant is in the directory of its name: `fp.Campaign.load` opens it.
    plants : mapping of name to PlantCampaign
    failed : mapping of name to str
        Why plants have none, or did not go on.
    stop_reason : StopReason
        "completed", or "interrupted": then plants are missing, which the same call goes on with.
    """

    directory: Path
    plants: Mapping[str, PlantCampaign]
    failed: Mapping[str, str]
    stop_reason: StopReason

    def _rows(self) -> Iterator[tuple[Any, ...]]:
        for name, plant in self.plants.items():
            state = plant.state
            for parameter in state.problem.estimated:
                figures = state.estimate[parameter], state.standard_errors[parameter], state.rse[-1][parameter]
                target = state.targets.get(parameter, np.nan), plant.met.get(parameter, "")
                yield name, parameter, len(state.batches), *figures, *target, plant.words

    def to_pandas(self) -> pd.DataFrame:
        """One row per plant and parameter, SI units: batches, estimate, standard_error, rse, target, met, and state."""
        with needed_for("to_pandas"):
            import pandas as pd

        return pd.DataFrame(self._rows(), columns=COLUMNS).set_index(["plant", "parameter"])

    def report(self) -> Report:
        """The plants beside each other: batches, the largest relative standard error, and what is next."""
        rows = []
        for name, plant in self.plants.items():
            rse = plant.state.rse[-1]
            worst = max(rse, key=lambda one: rse[one])
            met = f"{sum(plant.met.values())} of {len(plant.met)}" if plant.met else "no targets"
            rows.append((name, str(len(plant.state.batches)), f"{percent(rse[worst])} of {worst}", met, plant.words))
        table = Section("Plants", ("plant", "batches", "largest relative standard error", "targets met", "state"), rows)
        warnings = [f"{name}: {why}" for name, why in self.failed.items()]
        if self.stop_reason != StopReason.completed:
            warnings.append(self.stop_reason.advice)
        done = sum(plant.done for plant in self.plants.values())
        return Report(f"Campaigns of {counted(len(self.plants), 'plant')}, {computed(done, 6)} of them done", [table], warnings)


class _Plant(NamedTuple):
    """A plant, and what is measured of it."""

    name: str
    problem: DesignProblem
    rig: VirtualRig | None
    data: Measurements | None


@dataclass(frozen=True, eq=False)
class _GoingOn:
    """Goes on with the campaign of a plant, and returns where it stands, or why it does not go on."""

    directory: Path
    batch: int | None
    batches: int
    targets: Mapping[str, float] | float | None
    seed: int
    threads: int
    settings: Mapping[str, Any]

    def __call__(self, plant: _Plant) -> PlantCampaign | str:
        try:
            campaign = self._opened(plant)
            if plant.data is not None and campaign.known_batch(plant.data) is None:
                campaign.tell(plant.data)
            if plant.rig is None:
                if not campaign.done:
                    campaign.next()
            else:
                self._measured(campaign, copy.deepcopy(plant.rig))
        except (ValueError, RuntimeError, OSError) as error:
            return " ".join(str(error).split())
        return PlantCampaign(campaign._state, dict(campaign.met), campaign.done)

    def _opened(self, plant: _Plant) -> Campaign:
        directory = self.directory / plant.name
        if Campaign.is_in(directory):
            campaign = Campaign.load(directory, threads=self.threads)
            if encoded(campaign.problem) != encoded(plant.problem):
                where = printable(directory)
                raise ValueError(f"problems[{plant.name!r}]: expected that of the campaign in {where}, given another")
            return campaign
        seed = int(np.random.SeedSequence([self.seed, *plant.name.encode()]).generate_state(1)[0])
        return Campaign(
            plant.problem,
            self.batch,
            targets=self.targets,
            seed=seed,
            directory=directory,
            threads=self.threads,
            **self.settings,
        )

    def _measured(self, campaign: Campaign, rig: VirtualRig) -> None:
        """Measure on a rig until the campaign is done; its random numbers go on behind those of the batches that there are."""
        for one in campaign.history:
            if one.planned is not None:
                rig.measure(one.planned)
        while not campaign.done and len(campaign.history) < self.batches:
            campaign.tell(rig.measure(campaign.next()))


def campaigns(
    problems: Mapping[str, DesignProblem],
    directory: str | Path,
    *,
    data: Mapping[str, Measurements] | None = None,
    rigs: Mapping[str, VirtualRig] | None = None,
    batch: int | None = None,
    batches: int = 10,
    targets: Mapping[str, float] | float | None = None,
    seed: int = 0,
    threads: int | None = None,
    workers: Workers | None = None,
    progress: bool | Callable[[Progress], None] | None = None,
    **settings: Any,
) -> Campaigns:
    """Begin a campaign for each of many plants, or go on with those that there are.

    The data of each plant are added to its campaign, and its next batch is designed. With virtual rigs each campaign goes on until
    it is done. The same call goes on after Ctrl-C, and after being killed, to the same results.

    Parameters
    ----------
    problems : mapping of name to DesignProblem
        A plant each; names are those of directories.
    directory : path
        The campaign of each plant is in the directory of its name, and `plants.csv` is the table of all. All workers see it.
    data : mapping of name to Measurements, optional
        The last batch of some plants; data that a campaign has already are not added again.
    rigs : mapping of name to VirtualRig, optional
        Of plants that are simulated.
    batch : int, optional
        Points of a batch, or runs. Default: 6 points, or 1 run.
    batches : int
        Batches that are measured on a virtual rig, at most.
    targets : mapping of parameter name to float, or float, optional
        Largest relative standard errors, as of `fp.Campaign`.
    seed : int
        The seed of each campaign follows from this and its name.
    threads : int, optional
        Default: every core.
    workers : int, Executor or Dask client, optional
        Who goes on with the campaigns, one each at a time (docs/how_to/workers.md). The results are the same. Default: this
        process.
    progress : bool or callable, optional
        True shows a bar, on the terminal and in notebooks; needs rich. A function is called with a `Progress` after each plant.
    **settings
        As of `fp.Campaign`.

    Returns
    -------
    Campaigns
        Ctrl-C returns the plants that have been gone on with, without a gap.

    Raises
    ------
    TypeError, ValueError
        For misuse. What is wrong with one plant alone is in `Campaigns.failed`.
    """
    check_mapping(problems, "problems", "DesignProblem")
    if not problems:
        raise ValueError("problems: expected at least one plant, given none")
    for name, problem in problems.items():
        check_type(problem, DesignProblem, f"problems[{check_name(name, 'problems')!r}]")
        if name in (".", "..") or Path(name).name != name:
            raise ValueError(f"problems: expected names that directories may have, given {shown(name)}")
        batch_settings(problem, batch, seed, settings)
        checked_targets(targets, problem)
        search_of(problem)
    of_data, of_rigs = _by_plant(data, problems, Measurements, "data"), _by_plant(rigs, problems, VirtualRig, "rigs")
    batches = check_positive_int(batches, "batches", most=MOST_BATCHES)
    check_progress(progress)
    given_threads, place = check_threads(threads), as_path(directory, "directory").resolve()
    place.mkdir(parents=True, exist_ok=True)
    begin, stop_reason = time.perf_counter(), StopReason.completed
    found: dict[str, PlantCampaign] = {}
    failed: dict[str, str] = {}
    plants = [_Plant(name, problem, of_rigs.get(name), of_data.get(name)) for name, problem in problems.items()]
    try:
        with following(progress, "plants") as report, distributed_over(workers, given_threads) as distributor:
            work = _GoingOn(place, batch, batches, targets, seed, distributor.threads, settings)
            ended = distributor.map(work, plants, lambda k: f"the campaign of {plants[k].name}", ahead=1)
            for plant, one in zip(plants, ended, strict=True):
                if isinstance(one, str):
                    failed[plant.name] = one
                else:
                    found[plant.name] = one
                if report is not None:
                    report(Progress(len(found) + len(failed), len(plants), None, plant.name, time.perf_counter() - begin))
    except KeyboardInterrupt:
        if not found and not failed:
            raise
        stop_reason = StopReason.interrupted
    result = Campaigns(place, FrozenMapping(found), FrozenMapping(failed), stop_reason)
    write_whole(place / TABLE, csv_text(COLUMNS, map(partial(map, _cell), result._rows())))
    return result


def _cell(value: Any) -> float | str:
    """A value as the table of a file has it."""
    return ("no", "yes")[value] if isinstance(value, bool) else str(value) if isinstance(value, int) else value


def _by_plant(given: Any, problems: Mapping[str, DesignProblem], kind: type, label: str) -> Mapping[str, Any]:
    if given is None:
        return {}
    for name, one in check_mapping(given, label, kind.__name__).items():
        if name not in problems:
            raise ValueError(f"{label}: expected names of problems, given {shown(name)}")
        check_type(one, kind, f"{label}[{name!r}]")
    return dict(given)
