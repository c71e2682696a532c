"""Pieces of work over workers: the same bits from whoever computes them, and nothing is lost or left behind."""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import time
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from engines import ENGINES
from fisherpoint.engine import workers as engine
from fisherpoint.engine.workers import WorkersLost, distributed_over, sent
from fisherpoint.validation import parts
from tests.bits.digest import parts as digests

MODEL = fp.SymbolicModel(
    [], ["a*exp(-b*u)"], {}, {"u": "1"}, {"a": "1", "b": "1"}, {"y": "1"}, nominal={"a": 1.0, "b": 1.0}, name="decay"
)
PRIOR = fp.GaussianPrior({"a": 1.0, "b": 1.0}, relative_std={"a": 0.3, "b": 0.4}, log=["a", "b"])
PROBLEM = fp.DesignProblem(MODEL, PRIOR, fp.ExperimentRegion({"u": (0.0, 3.0)}), noise={"y": 0.1}, uncertain=None)


def at(*u: float) -> fp.Experiments:
    return fp.Experiments(np.empty((len(u), 0)), np.array(u)[:, None])


DESIGNS = {"spread": at(0.1, 0.5, 1.0, 2.0), "twice": at(0.2, 0.2, 1.5, 1.5)}
DATA = fp.VirtualRig(MODEL, MODEL.nominal, {"y": 0.1}).measure(DESIGNS["spread"])
FIT = fp.estimate(MODEL, DATA, noise={"y": 0.1})


def results(workers: Any, threads: int | None = None, searches: bool = True) -> dict[str, str]:
    """What functions with workers find, to the last bit; searches take longer than all else."""
    who = {"workers": workers, "threads": threads}
    found = {
        "validate": fp.validate(PROBLEM, DESIGNS, runs=150, **who),
        "compare": fp.compare(PROBLEM, DESIGNS, draws=50, **who),
        "profiles": FIT.profiles(**who),
    }
    if searches:
        found["approximate"] = fp.approximate_design(PROBLEM, n_candidates=50, starts=5, **who)
    return dict(digests(found))


@pytest.fixture(scope="module")
def alone() -> dict[str, str]:
    return results(None, 1)


@pytest.mark.parametrize("threads", [2, 5])
def test_the_bits_do_not_depend_on_threads(threads: int, alone: dict[str, str]) -> None:
    assert results(None, threads) == alone


@pytest.mark.long
@pytest.mark.parametrize("name", ENGINES)
def test_the_bits_are_those_of_this_process(name: str, alone: dict[str, str], monkeypatch: pytest.MonkeyPatch) -> None:
    searches = name in ("5 processes", "backwards")
    with ENGINES[name]() as workers:
        found = results(workers, searches=searches)
    assert found == {place: digest for place, digest in alone.items() if searches or not place.startswith("[approximate]")}


@pytest.mark.long
@pytest.mark.parametrize("fewest", [1, 20, 150])
def test_the_bits_do_not_depend_on_the_size_of_parts(fewest: int, alone: dict[str, str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parts, "FEWEST", fewest)
    with ThreadPoolExecutor(2) as executor:
        found = dict(digests({"validate": fp.validate(PROBLEM, DESIGNS, runs=150, workers=executor)}))
    assert found == {place: digest for place, digest in alone.items() if place.startswith("[validate]")}


# --- Processes that end -------------------------------------------------------------------------------------------------


def squared(value: int) -> int:
    return value**2


def noted(directory: Path, value: int) -> int:
    (directory / f"{value}_{time.monotonic_ns()}").touch()
    if value == 3 and len(list(directory.glob("3_*"))) == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    return value**2


def deadly(value: int) -> int:
    if value == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    return value


def test_a_process_that_is_killed_costs_its_pieces(tmp_path: Path) -> None:
    with distributed_over(2, None) as distributor:
        assert list(distributor.map(partial(noted, tmp_path), range(8))) == [value**2 for value in range(8)]
        assert list(distributor.map(squared, range(3))) == [0, 1, 4]
    times = [len(list(tmp_path.glob(f"{value}_*"))) for value in range(8)]
    assert times[3] == 2 and sum(times) <= 8 + engine.AHEAD


def test_a_piece_that_kills_twice_is_named() -> None:
    with distributed_over(1, None) as distributor:
        found = distributor.map(deadly, range(5), "part {} of the test".format)
        assert [next(found), next(found)] == [0, 1]
        with pytest.raises(WorkersLost, match=r"ended with part 2 of the test, the last one by SIGKILL"):
            next(found)


def test_a_dask_worker_that_is_killed_costs_its_pieces(tmp_path: Path) -> None:
    with ENGINES["dask"]() as client, distributed_over(client, None) as distributor:
        assert list(distributor.map(partial(noted, tmp_path), range(8))) == [value**2 for value in range(8)]


def test_an_executor_that_breaks_is_named() -> None:
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    with (
        ProcessPoolExecutor(1, mp_context=get_context("spawn")) as executor,
        distributed_over(executor, None) as distributor,
        pytest.raises(WorkersLost, match=r"an executor that goes on, given one that broke at piece"),
    ):
        list(distributor.map(deadly, range(5)))


def test_an_error_of_a_piece_is_raised_after_those_before_it_and_the_workers_go_on() -> None:
    with ThreadPoolExecutor(2) as executor, distributed_over(executor, None) as distributor:
        with pytest.raises(ZeroDivisionError):
            list(distributor.map((1).__truediv__, [2, 1, 0, 3]))
        assert list(distributor.map(squared, range(3))) == [0, 1, 4]


# --- What is sent -------------------------------------------------------------------------------------------------------


def test_few_pieces_are_under_way_and_a_message_is_small(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[int] = []
    with ThreadPoolExecutor(2) as executor, distributed_over(executor, None) as distributor:
        for done in distributor.map(squared, (drawn.append(k) or k for k in range(1000))):  # type: ignore[func-returns-value]
            assert len(drawn) <= done**0.5 + 1 + 2 * engine.WINDOW + 2 * engine.AHEAD
    sizes: list[int] = []
    monkeypatch.setattr(engine, "sent", lambda value: sizes.append(len(found := sent(value))) or found)  # type: ignore[func-returns-value]
    with ThreadPoolExecutor(2) as executor:
        fp.validate(PROBLEM, DESIGNS, runs=200, workers=executor)
    assert max(sizes) < 100_000


def test_the_fits_of_the_largest_part_are_a_small_message(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parts, "FEWEST", 1)
    sizes: list[int] = []

    class Weighing(ThreadPoolExecutor):
        def submit(self, *given: Any, **options: Any) -> Future[Any]:
            future = super().submit(*given, **options)
            future.add_done_callback(lambda done: sizes.append(len(pickle.dumps(done.result()))))
            return future

    with Weighing(2) as executor:
        fp.validate(PROBLEM, DESIGNS, runs=4000, workers=executor)
    assert len(sizes) > 1
    assert 50_000 < max(sizes) < 100_000


def test_what_cannot_be_sent_is_named_at_the_call(monkeypatch: pytest.MonkeyPatch) -> None:
    with ThreadPoolExecutor(1) as executor, distributed_over(executor, None) as distributor:
        monkeypatch.setitem(sys.modules, "cloudpickle", None)
        with pytest.raises(ValueError, match=r"^workers: expected what can be sent, given .*lambda.* or install cloudpickle"):
            list(distributor.map(lambda value: value, [1]))


@pytest.mark.parametrize("wrong", [True, 0, -1, 1.5, "8", "tcp://head:8786", object()])
def test_other_workers_are_refused(wrong: Any) -> None:
    with pytest.raises((TypeError, ValueError), match=r"^workers: expected a"):
        fp.compare(PROBLEM, DESIGNS, workers=wrong)


def test_processes_of_another_arithmetic_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    others = [one for one in fp.instruction_sets() if one != fp.instruction_set()]
    if not others:
        pytest.skip("one instruction set")
    monkeypatch.setenv("FISHERPOINT_ISA", others[0])
    with pytest.raises(ValueError, match=rf"^workers: expected isa {fp.instruction_set()} as here, given {others[0]}: set FISHER"):
        fp.compare(PROBLEM, DESIGNS, workers=1)


def test_warnings_of_pieces_are_given_here() -> None:
    import warnings

    with distributed_over(1, None) as distributor, pytest.warns(UserWarning, match="of a piece"):
        assert list(distributor.map(partial(warnings.warn, category=UserWarning), ["of a piece"])) == [None]


# --- Ctrl-C -------------------------------------------------------------------------------------------------------------

PROGRAM = """
import os, signal, sys, time
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs start with Ctrl-C ignored
from fisherpoint.engine.workers import distributed_over

def work(value):
    time.sleep(0.1)
    return value

done = []
print("begun", flush=True)
try:
    with distributed_over(2, None) as distributor:
        for value in distributor.map(work, range(100_000)):
            done.append(value)
            print("one", flush=True)
except KeyboardInterrupt:
    pass
print("ended", done == list(range(len(done))), flush=True)
"""


def running(group: int) -> list[int]:
    """Processes of a group that have not ended."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                status = (entry / "stat").read_text().rpartition(")")[2].split()
            except OSError:
                continue
            if status[0] != "Z" and int(status[2]) == group:
                found.append(int(entry.name))
    return found


def begun() -> subprocess.Popen[str]:
    pytest.importorskip("cloudpickle", reason="functions of a script are sent by it")
    return subprocess.Popen(
        [sys.executable, "-c", PROGRAM],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": str(Path(fp.__file__).parents[1])},
        start_new_session=True,
    )


def gone(group: int, seconds: float) -> bool:
    deadline = time.monotonic() + seconds
    while running(group) and time.monotonic() < deadline:
        time.sleep(0.05)
    return not running(group)


@pytest.mark.parametrize("moment", ["begun", "one"])
def test_ctrl_c_keeps_what_is_finished_and_leaves_no_process(moment: str) -> None:
    command = begun()
    assert command.stdout is not None
    while moment not in command.stdout.readline():
        pass
    time.sleep(0.2)
    os.killpg(command.pid, signal.SIGINT)  # as a terminal sends it, to all at once
    said, complaint = command.communicate(timeout=30)
    assert (said.splitlines()[-1], complaint, command.returncode) == ("ended True", "", 0)
    assert gone(command.pid, 5.0)


def test_processes_end_with_the_one_that_has_begun_them() -> None:
    command = begun()
    assert command.stdout is not None
    while "one" not in command.stdout.readline():
        pass
    assert len(running(command.pid)) >= 3
    command.kill()
    command.communicate(timeout=30)
    assert gone(command.pid, 20.0)


def test_an_interrupted_validation_has_the_first_of_its_runs(alone: dict[str, str]) -> None:
    def stop(now: fp.Progress) -> None:
        if now.step >= 20:
            raise KeyboardInterrupt

    with ThreadPoolExecutor(2) as executor:
        found = fp.validate(PROBLEM, DESIGNS, runs=150, workers=executor, progress=stop)
    assert found.interrupted and 20 <= found.runs < 150
    whole = fp.validate(PROBLEM, DESIGNS, runs=found.runs)
    assert found.to_pandas().to_csv() == whole.to_pandas().to_csv()


# --- The command line ---------------------------------------------------------------------------------------------------

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "michaelis_menten.toml"


def validated(run: Any, directory: Path, name: str, *options: str) -> str:
    points = directory / "points.csv"
    fp.Experiments(np.empty((4, 0)), [[0.2], [0.5], [0.8], [1.0]]).to_csv(points, fp.load_model(EXAMPLE))
    shown = ("--runs", "40", "--no-plots", "--quiet", "-o", directory / name)
    code, said, complaint = run("validate", EXAMPLE, points, *shown, *options)
    assert (code, said, complaint) == (0, "", "")
    return (directory / name / "validation.csv").read_text()


def test_the_command_takes_a_number_of_workers_and_a_scheduler(run: Any, tmp_path: Path) -> None:
    here = validated(run, tmp_path, "here")
    assert validated(run, tmp_path, "two", "--workers", "2") == here
    with ENGINES["dask"]() as client:
        assert validated(run, tmp_path, "cluster", "--workers", client.scheduler.address) == here


@pytest.mark.parametrize("wrong", ["0", "-1", "two", "1.5", "head:8786", "99999"])
def test_the_command_refuses_other_workers(run: Any, tmp_path: Path, wrong: str) -> None:
    code, _, complaint = run("validate", EXAMPLE, tmp_path / "none.csv", "-o", tmp_path / "out", "--workers", wrong)
    assert code == 2 and "--workers" in complaint and "address of a Dask scheduler" in complaint


def test_a_scheduler_that_does_not_answer_is_named(run: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed", reason="distributed is not installed")
    monkeypatch.setattr("fisherpoint_command.workers.SECONDS", 0.2)
    points = tmp_path / "points.csv"
    fp.Experiments(np.empty((4, 0)), [[0.2], [0.5], [0.8], [1.0]]).to_csv(points, fp.load_model(EXAMPLE))
    code, _, complaint = run("validate", EXAMPLE, points, "-o", tmp_path / "out", "--workers", "tcp://127.0.0.1:9")
    assert code == 2 and "--workers: expected a Dask scheduler that answers, given tcp://127.0.0.1:9" in complaint
    assert len(complaint.splitlines()) == 1
