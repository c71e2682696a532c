"""Pieces of work in processes side by side."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from fisherpoint_command.work_processes import Helpers

TWO_CORES = pytest.mark.skipif(
    not hasattr(os, "sched_getaffinity") or len(os.sched_getaffinity(0)) < 2, reason="one core, on which nothing is side by side"
)
READY: list[int] = []


def ready() -> None:
    READY.append(os.getpid())


def ready_here() -> list[int]:
    return READY


def doubled(value: int) -> tuple[int, int]:
    return os.getpid(), 2 * value


def doubled_slowly(value: int) -> tuple[int, int]:
    time.sleep(0.1)
    return doubled(value)


def all_of(works: Sequence[Callable[[], Any]]) -> list[Any]:
    with Helpers(2, ready) as helpers:
        return [wait() for wait in [helpers.begin(work) for work in works]]


@TWO_CORES
def test_forks_are_ready_before_they_do_anything() -> None:
    READY.clear()
    found = all_of([ready_here, partial(doubled, 2), ready_here, partial(doubled, 3)])
    assert (found[1][1], found[3][1]) == (4, 6) and not READY
    assert os.getpid() not in {*found[0], *found[2], found[1][0]} and len(found[0]) == len(found[2]) == 1


def test_what_comes_first_is_begun_first_and_each_has_its_own() -> None:
    assert [value for _, value in all_of([partial(doubled, k) for k in range(7)])] == [0, 2, 4, 6, 8, 10, 12]
    assert all_of([]) == []


@TWO_CORES
def test_they_work_while_this_process_does() -> None:
    with Helpers(1, ready) as helpers:
        first, second = helpers.begin(partial(time.sleep, 0.3)), helpers.begin(time.perf_counter)
        time.sleep(0.6)
        begin = time.perf_counter()
        assert first() is None and second() < begin  # on one clock for all processes


@TWO_CORES
@pytest.mark.parametrize(("cores", "forks"), [(2, 1), (3, 2), (8, 2)])
def test_a_core_is_left_to_this_process(cores: int, forks: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(cores)))
    assert len({found for found, _ in all_of([partial(doubled_slowly, k) for k in range(4)])}) == forks


def test_on_one_core_this_process_does_it_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0}, raising=False)
    READY.clear()
    assert all_of([partial(doubled, k) for k in range(3)]) == [(os.getpid(), 0), (os.getpid(), 2), (os.getpid(), 4)]
    assert [os.getpid()] == READY


def _raises() -> tuple[int, int]:
    raise RuntimeError("no picture")


def _ends() -> None:
    os._exit(1)


def _killed() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def _fails_in(here: int, error: Callable[[], None], work: Callable[[], tuple[int, int]]) -> tuple[int, int]:
    if os.getpid() != here:
        error()
    return work()


def test_an_error_is_raised_where_its_work_is_waited_for() -> None:
    with Helpers(2, ready) as helpers:
        waits = [helpers.begin(work) for work in (partial(doubled, 1), _raises, partial(doubled, 3))]
        assert waits[0]()[1] == 2
        with pytest.raises(RuntimeError, match="no picture"):
            waits[1]()
        assert waits[2]()[1] == 6


@TWO_CORES
def test_what_nobody_wants_any_more_ends_at_once() -> None:
    begin = time.perf_counter()
    with Helpers(2, ready) as helpers:
        for _ in range(5):
            helpers.begin(partial(time.sleep, 300))
        helpers.begin(partial(doubled, 1))
    assert not multiprocessing.active_children() and time.perf_counter() - begin < 100


@TWO_CORES
def test_what_cannot_be_sent_is_done_here() -> None:
    found = all_of([lambda: doubled(1), partial(_unsendable, 3), partial(doubled, 2)])
    assert found[0] == (os.getpid(), 2) and found[1]() == 3 and found[2][1] == 4


def _unsendable(value: int) -> Callable[[], int]:
    return lambda: value


@TWO_CORES
def test_where_a_fork_is_not_ready_the_work_is_done_here() -> None:
    with Helpers(2, _ends) as helpers:
        assert [wait() for wait in [helpers.begin(partial(doubled, k)) for k in range(3)]] == [
            (os.getpid(), 2 * k) for k in range(3)
        ]


@TWO_CORES
@pytest.mark.parametrize("error", [_ends, _killed])
def test_where_a_fork_dies_the_work_is_done_here(error: Callable[[], None]) -> None:
    found = all_of([partial(_fails_in, os.getpid(), error, partial(doubled, k)) for k in range(3)])
    assert [value for _, value in found] == [0, 2, 4]


BUSY = """
import os, sys, time
from functools import partial
from fisherpoint_command.work_processes import Helpers
os.sched_getaffinity = lambda _: range(3)
try:
    with Helpers(2, lambda: None) as helpers:
        waits = [helpers.begin(partial(*work)) for work in {works}]
        print(*{{wait() for wait in waits}}, flush=True)
        time.sleep(300)
except KeyboardInterrupt:
    sys.exit(130)
"""


def begun(works: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", BUSY.format(works=works)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": str(Path(__file__).resolve().parents[2] / "python")},
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # a shell's background jobs start with it ignored
    )


def test_an_interrupt_of_all_ends_them_at_once_without_a_word() -> None:
    """As a terminal sends it, to all processes at once: nobody waits for what has begun."""
    command = begun("[(time.sleep, 300)] * 4")
    time.sleep(2.0)
    os.killpg(command.pid, signal.SIGINT)
    _, complaint = command.communicate(timeout=30)
    assert (command.returncode, complaint) == (130, "")


@TWO_CORES
def test_forks_that_wait_do_not_outlive_a_process_that_is_killed() -> None:
    command = begun("""[(eval, "__import__('time').sleep(0.5) or __import__('os').getpid()")] * 4""")
    assert command.stdout is not None
    forks = [int(pid) for pid in command.stdout.readline().split()]
    assert len(forks) == 2 and all(map(runs, forks))
    command.kill()
    command.communicate(timeout=30)
    deadline = time.perf_counter() + 60
    while any(map(runs, forks)):
        assert time.perf_counter() < deadline
        time.sleep(0.1)


def runs(pid: int) -> bool:
    """Whether there is such a process, which has not ended either."""
    try:
        return "State:\tZ" not in Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return False
