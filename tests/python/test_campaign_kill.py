"""Campaigns, of points and of runs, that are killed by SIGKILL at any moment come to the same result to the last bit."""

from __future__ import annotations

import math
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import fisherpoint as fp

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="kills children that are forks")

HERE = Path(__file__).resolve().parent
KILLS = 20
TABLES = {"points": ("batch", "data"), "runs": ("batch", "plan", "data")}


class Worker:
    """Runs campaigns in children that it kills."""

    def __init__(self, kind: str, example: Path) -> None:
        self.tables = TABLES[kind]
        self.process = subprocess.Popen(
            [sys.executable, str(HERE / "campaign_worker.py"), str(example)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": os.pathsep.join(sys.path)},
        )

    def run(self, directory: Path, seconds: float = math.nan, writes: float = math.nan) -> str:
        assert self.process.stdin is not None and self.process.stdout is not None
        print(directory, seconds, writes, file=self.process.stdin, flush=True)
        return self.process.stdout.readline().strip()

    def close(self) -> None:
        assert self.process.stdin is not None and self.process.stdout is not None
        self.process.stdin.close()
        self.process.stdout.close()
        self.process.wait(timeout=30)


@pytest.fixture(scope="module", params=list(TABLES))
def worker(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Worker]:
    example = HERE.parents[1] / "examples" / "exponential_decay.toml"  # quick: it is killed dozens of times
    if request.param == "runs":
        text = example.with_name("reactor.toml").read_text().replace("segments = 8", "segments = 3\nlead_in = 1")
        example = tmp_path_factory.mktemp("example") / "short_runs.toml"
        example.write_text(text)
    worker = Worker(request.param, example)
    yield worker
    worker.close()


@pytest.fixture(scope="module")
def undisturbed(worker: Worker, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """The files of a campaign that nothing happened to."""
    directory = tmp_path_factory.mktemp("undisturbed") / "campaign"
    assert worker.run(directory) == "finished"
    found = files(directory)
    assert sorted(found) == sorted(["campaign.json", *(f"{table}_{k}.csv" for table in worker.tables for k in (1, 2))])
    return found


def files(directory: Path) -> dict[str, bytes]:
    """What is in the directory, without the parts of files that a killed process left."""
    return {path.name: path.read_bytes() for path in directory.iterdir() if path.suffix != ".part"}


@pytest.mark.long
def test_a_campaign_that_is_killed_at_random_moments_has_the_same_result(
    worker: Worker, undisturbed: dict[str, bytes], tmp_path: Path
) -> None:
    begin = time.monotonic()
    assert worker.run(tmp_path / "campaign to time") == "finished"
    whole = time.monotonic() - begin
    rng = np.random.default_rng(11)
    kills, stages = 0, set()
    for number in range(20 * KILLS):
        directory = tmp_path / f"campaign {number}"
        while (end := worker.run(directory, rng.uniform(0.0, 0.8 * whole) if kills < KILLS else math.nan)) == "killed":
            kills += 1
            if fp.Campaign.is_in(directory):  # at any moment it can be read, as a whole
                campaign = fp.Campaign.load(directory)
                stages.add((len(campaign.history), campaign.planned is not None))
        assert end == "finished"
        assert files(directory) == undisturbed
        if kills >= KILLS:
            break
    assert kills >= KILLS
    assert len(stages) >= 2, "kills at different stages"


@pytest.mark.long
def test_a_campaign_that_is_killed_around_any_write_has_the_same_result(
    worker: Worker, undisturbed: dict[str, bytes], tmp_path: Path
) -> None:
    finished = 0
    for k in range(1, 100):
        directory = tmp_path / str(k)
        end = worker.run(directory, writes=k / 2)
        if end == "finished":
            finished = k
            break
        assert end == "killed"
        assert worker.run(directory) == "finished"
        assert files(directory) == undisturbed
    writes = 1 + 2 * (len(worker.tables) + 2)
    assert finished == 2 * writes + 1, "a state at the start, and the tables and two states a batch, before and after each"


def test_the_saved_results_are_those_of_one_fit_of_all_data(worker: Worker, undisturbed: dict[str, bytes], tmp_path: Path) -> None:
    for name, content in undisturbed.items():
        (tmp_path / name).write_bytes(content)
    campaign = fp.Campaign.load(tmp_path)
    fit = campaign.fit
    assert fit is not None
    assert dict(fit.estimate) == dict(campaign.history[-1].estimate)
    assert dict(fit.standard_errors) == dict(campaign.history[-1].standard_errors)


def lengths(content: bytes) -> list[int]:
    """Where a file may be cut: at and beside the ends of its first and last lines, and at some places between."""
    ends = [at for at, byte in enumerate(content) if byte == ord("\n")]
    beside = {end + off for end in (*ends[:3], *ends[-3:]) for off in (0, 1, 2)}
    return sorted(n for n in {0, 1, *beside, *range(0, len(content), 1 + len(content) // 16), len(content) - 1} if n < len(content))


def test_a_truncated_file_is_never_read_as_a_whole_one(undisturbed: dict[str, bytes], tmp_path: Path) -> None:
    for name, content in undisturbed.items():
        (tmp_path / name).write_bytes(content)
    state = undisturbed["campaign.json"]
    for length in lengths(state[:-2]):
        (tmp_path / "campaign.json").write_bytes(state[:length])
        with pytest.raises(ValueError, match=r"campaign.json: expected a whole JSON file"):
            fp.Campaign.load(tmp_path)
    (tmp_path / "campaign.json").write_bytes(state)
    data = undisturbed["data_2.csv"]
    for length in lengths(data):
        (tmp_path / "data_2.csv").write_bytes(data[:length])
        with pytest.raises(ValueError, match=r"data_2.csv: expected the data as they were read"):
            fp.Campaign.load(tmp_path)
    (tmp_path / "data_2.csv").unlink()
    fp.Campaign.load(tmp_path)
    assert (tmp_path / "data_2.csv").read_bytes() == data
