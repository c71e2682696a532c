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

from pathlib import Path

from ..basics.checks import as_path
from ..basics.files import built_from, read_bytes, write_whole
from ..basics.messages import printable
from ..data import Measurements
from ..data.measurement_files import measurements_csv
from ..engine.versions import versions
from ..information.problem import DesignProblem
from ..models import Model
from ..points.experiments import points_csv
from ..points.points_or_runs import Points, as_runs
from ..points.region import ExperimentRegion
from ..points.run_files import plan_csv, runs_csv
from .state import CampaignState

NAME = "campaign.json"


class CampaignFiles:
    """The directory of one campaign.

    Parameters
    ----------
    directory : path
    problem : DesignProblem
        Whose constraints must be texts.
    """

    def __init__(self, directory: str | Path, problem: DesignProblem) -> None:
        self.directory = as_path(directory, "directory")
        constraints = problem.region.constraints if isinstance(problem.region, ExperimentRegion) else ()
        if any(callable(one) for one in constraints):
            raise ValueError("constraints: expected text for a campaign in a directory, given a function, which cannot be saved")
        self._last: bytes | None = None

    @staticmethod
    def path_in(directory: str | Path) -> Path:
        return as_path(directory, "directory") / NAME

    @property
    def path(self) -> Path:
        return self.path_in(self.directory)

    def create(self, state: CampaignState) -> None:
        """Write the first state into a directory that has none."""
        if self.path.exists():
            given = printable(self.directory)
            raise ValueError(f"directory: expected one without a campaign, given {given}; Campaign.load continues it")
        self.directory.mkdir(parents=True, exist_ok=True)
        self._write(state)

    def write(self, state: CampaignState) -> None:
        """Write the state.

        Raises
        ------
        RuntimeError
            Where another process has changed the campaign meanwhile.
        """
        self._check_alone()
        self._write(state)

    def write_batch(self, state: CampaignState, again: bool = False) -> None:
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
        write_whole(self._data_path(number), measurements_csv(data.points, data.y, model, data.labels))

    @classmethod
    def read(cls, directory: str | Path) -> tuple[CampaignFiles, CampaignState]:
        """Read the state of a campaign, and make sure that the data beside it are unchanged."""
        path = cls.path_in(directory)
        given = read_bytes(path)
        state = CampaignState._read(path, given)
        files = built_from(path, "campaign", state.problem, lambda problem: cls(directory, problem))
        files._last = given
        files._check_data(state)
        return files, state

    def _check_data(self, state: CampaignState) -> None:
        for number, batch in enumerate(state.batches, 1):
            path, data = self._data_path(number), batch.data
            text = measurements_csv(data.points, data.y, state.problem.model, data.labels)
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

    def _write(self, state: CampaignState) -> None:
        text = state._file(versions=versions())
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
