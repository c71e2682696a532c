"""A campaign as a directory: campaign.json is all of it, the tables beside it are for people and for the rig.

==================  ==================================================================================================
campaign.json       the whole state, with its own SHA-256; the only file from which a campaign goes on
batch_<k>.csv       the points or runs to measure
plan_<k>.csv        for runs, the batch as a time table
data_<k>.csv        the measurements; one that was changed since is refused, as the change would have no effect
==================  ==================================================================================================

Every file is replaced as a whole, and campaign.json last: a run that is killed leaves the state before a change or the one after
it. Tables of a batch that campaign.json does not have yet will be written again.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ..basics.checks import as_path, check_type
from ..basics.declared import check_declared
from ..basics.files import built_from, parse_json, read_bytes, sealed_json, write_whole
from ..basics.messages import printable
from ..basics.stop_reason import StopReason
from ..basics.values import FrozenMapping, finite_or_none
from ..data import Measurements
from ..data.measurement_files import measurements_csv
from ..design.settings import read_settings, settings_json
from ..engine.versions import versions
from ..information.codec import problem_from_json
from ..models import Model
from ..points.codec import points_or_runs_from_json, points_to_json
from ..points.experiments import points_csv
from ..points.run_files import plan_csv, runs_csv
from ..points.runs import Points, as_runs
from .batches import search_of
from .state import Batch, State

FORMAT = "fisherpoint campaign"
FORMAT_VERSION = 1
NAME = "campaign.json"


class CampaignFiles:
    """The directory of one campaign.

    Parameters
    ----------
    directory : path
    problem_json : dict
        The problem as it is written each time, so that what is read stays the same to the last bit.
    """

    def __init__(self, directory: str | Path, problem_json: dict[str, Any]) -> None:
        self.directory = as_path(directory, "directory")
        self.problem_json = problem_json
        region = problem_json["region"]
        if region and None in region.get("constraints", ()):
            raise ValueError("constraints: expected text for a campaign in a directory, given a function, which cannot be saved")
        self._last: bytes | None = None

    @staticmethod
    def path_in(directory: str | Path) -> Path:
        return as_path(directory, "directory") / NAME

    @property
    def path(self) -> Path:
        return self.path_in(self.directory)

    def create(self, state: State) -> None:
        """Write the first state into a directory that has none."""
        if self.path.exists():
            given = printable(self.directory)
            raise ValueError(f"directory: expected one without a campaign, given {given}; Campaign.load continues it")
        self.directory.mkdir(parents=True, exist_ok=True)
        self._write(state)

    def write(self, state: State) -> None:
        """Write the state.

        Raises
        ------
        RuntimeError
            Where another process has changed the campaign meanwhile.
        """
        self._check_alone()
        self._write(state)

    def write_batch(self, state: State, again: bool = False) -> None:
        """Write the tables of what is planned; `again`, only those that are gone, as others may have been filled in."""
        if state.planned is None:
            return
        for name, text in _tables(state.planned, state.problem.model).items():
            path = self.directory / f"{name}_{len(state.batches) + 1}.csv"
            if not (again and path.exists()):
                self._check_alone()
                write_whole(path, text)

    def write_data(self, number: int, data: Measurements, model: Model) -> None:
        """Write the measurements of the batch of this number."""
        self._check_alone()
        write_whole(self._data_path(number), measurements_csv(data.points, data.y, model))

    @classmethod
    def read(cls, directory: str | Path) -> tuple[CampaignFiles, State]:
        """Read the state of a campaign, and make sure that the data beside it are unchanged."""
        path = cls.path_in(directory)
        given = read_bytes(path)
        data = parse_json(path, given, FORMAT, FORMAT_VERSION)
        state = built_from(path, "campaign", data, _state_from_json)
        files = built_from(path, "campaign", data, lambda whole: cls(directory, whole["problem"]))
        files._last = given
        files._check_data(state)
        return files, state

    def _check_data(self, state: State) -> None:
        for number, batch in enumerate(state.batches, 1):
            path, text = self._data_path(number), measurements_csv(batch.data.points, batch.data.y, state.problem.model)
            if not path.exists():
                write_whole(path, text)
            elif read_bytes(path) != text.encode():
                raise ValueError(
                    f"{printable(path)}: expected the data as they were read, given a file that was changed; "
                    "delete it to restore them"
                )

    def _check_alone(self) -> None:
        if not self.path.exists() or read_bytes(self.path) != self._last:
            raise RuntimeError(
                f"{printable(self.path)}: expected the state that this process wrote or read last, given another: "
                "two work on one campaign"
            )

    def _write(self, state: State) -> None:
        text = sealed_json(_state_to_json(state, self.problem_json))
        write_whole(self.path, text)
        self._last = text.encode()

    def _data_path(self, number: int) -> Path:
        return self.directory / f"data_{number}.csv"


def _tables(points: Points, model: Model) -> dict[str, str]:
    """The texts of the tables of a batch, by the beginnings of their files' names."""
    runs = as_runs(points)
    if points is runs:
        return {"batch": runs_csv(runs, model), "plan": plan_csv(runs, model)}
    return {"batch": points_csv(runs.starts, model)}


def _state_to_json(state: State, problem_json: dict[str, Any]) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "versions": versions(),
        "problem": problem_json,
        "settings": settings_json(state.settings),
        "targets": dict(state.targets),
        "batches": [_batch_to_json(batch) for batch in state.batches],
        "planned": _or_none(points_to_json, state.planned),
    }


def _state_from_json(data: dict[str, Any]) -> State:
    problem = problem_from_json(data["problem"])
    state = State(
        problem=problem,
        settings=read_settings(data["settings"]),
        targets=FrozenMapping(data["targets"]),
        batches=tuple(_batch_from_json(batch) for batch in data["batches"]),
        planned=_or_none(points_or_runs_from_json, data["planned"]),
    )
    check_type(state.settings, search_of(problem).settings, "settings")
    check_declared(state)
    return state


def _batch_to_json(batch: Batch) -> dict[str, Any]:
    return {
        "planned": _or_none(points_to_json, batch.planned),
        "data": {"points": points_to_json(batch.data.points), "y": finite_or_none(batch.data.y)},
        "estimate": dict(batch.estimate),
        "standard_errors": {name: value if np.isfinite(value) else None for name, value in batch.standard_errors.items()},
        "chi_square": batch.chi_square,
        "degrees_of_freedom": batch.degrees_of_freedom,
        "stop_reason": batch.stop_reason,
    }


def _batch_from_json(data: dict[str, Any]) -> Batch:
    errors = {name: np.inf if value is None else value for name, value in data["standard_errors"].items()}
    return Batch(
        planned=_or_none(points_or_runs_from_json, data["planned"]),
        data=Measurements(points_or_runs_from_json(data["data"]["points"]), np.array(data["data"]["y"], dtype=np.float64)),
        estimate=FrozenMapping(data["estimate"]),
        standard_errors=FrozenMapping(errors),
        chi_square=data["chi_square"],
        degrees_of_freedom=data["degrees_of_freedom"],
        stop_reason=StopReason(data["stop_reason"]),
    )


def _or_none(function: Callable[[Any], Any], given: Any) -> Any:
    return None if given is None else function(given)
