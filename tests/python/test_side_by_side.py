"""Pieces of work in processes side by side."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from fisherpoint_command.side_by_side import side_by_side

TWO_CORES = pytest.mark.skipif(
    not hasattr(os, "sched_getaffinity") or len(os.sched_getaffinity(0)) < 2, reason="one core, on which nothing is side by side"
)


def doubled(value: int) -> tuple[int, int]:
    return os.getpid(), 2 * value


def test_what_they_return_comes_in_their_order() -> None:
    works = [partial(doubled, k) for k in range(7)]
    assert [value for _, value in side_by_side(works)] == [0, 2, 4, 6, 8, 10, 12]
    assert list(side_by_side([])) == []


@TWO_CORES
def test_many_run_in_forks_and_one_here() -> None:
    local = [3]  # what cannot be pickled is there all the same
    found = list(side_by_side([lambda k=k: doubled(local[0] + k) for k in range(4)]))
    assert os.getpid() not in {process for process, _ in found} and [value for _, value in found] == [6, 8, 10, 12]
    assert list(side_by_side([partial(doubled, 1)])) == [(os.getpid(), 2)]


def test_on_one_core_they_run_here(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0}, raising=False)
    assert list(side_by_side([partial(doubled, k) for k in range(3)])) == [(os.getpid(), 0), (os.getpid(), 2), (os.getpid(), 4)]


def _raises() -> tuple[int, int]:
    raise RuntimeError("no picture")


def _fails_in(work: Callable[[], tuple[int, int]], here: int, error: Callable[[], object]) -> tuple[int, int]:
    if os.getpid() != here:
        error()
    return work()


def test_an_error_is_raised_here_after_what_came_before() -> None:
    found = side_by_side([partial(doubled, 1), _raises, partial(doubled, 3)])
    assert next(found)[1] == 2
    with pytest.raises(RuntimeError, match="no picture"):
        next(found)


def test_what_nobody_wants_any_more_ends_at_once() -> None:
    found = side_by_side([partial(doubled, 1), partial(time.sleep, 300), partial(time.sleep, 300)][::-1])
    found.close()
    found = side_by_side([partial(doubled, 1), partial(time.sleep, 300)])
    next(found)
    found.close()
    assert not multiprocessing.active_children()


@TWO_CORES
def test_what_cannot_be_sent_is_done_here() -> None:
    assert [f() for f in side_by_side([lambda: lambda: 3, lambda: lambda: 4])] == [3, 4]


@TWO_CORES
@pytest.mark.parametrize("error", [lambda: os._exit(1), lambda: os.kill(os.getpid(), signal.SIGKILL)], ids=["ends", "killed"])
def test_where_a_fork_dies_the_work_is_done_here(error: Callable[[], object]) -> None:
    works = [partial(_fails_in, partial(doubled, k), os.getpid(), error) for k in range(3)]
    assert [value for _, value in side_by_side(works)] == [0, 2, 4]


SLOW = """
import sys, time
from fisherpoint_command.side_by_side import side_by_side
print("begun", flush=True)
try:
    list(side_by_side([lambda: time.sleep(300)] * 4))
except KeyboardInterrupt:
    sys.exit(130)
"""


def test_an_interrupt_of_all_ends_them_at_once_without_a_word() -> None:
    """As a terminal sends it, to all processes at once: nobody waits for what has begun."""
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).resolve().parents[2] / "python")}
    command = subprocess.Popen(
        [sys.executable, "-c", SLOW],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment,
        start_new_session=True,
    )
    assert command.stdout is not None and command.stdout.readline() == "begun\n"
    time.sleep(1.0)
    os.killpg(command.pid, signal.SIGINT)
    _, complaint = command.communicate(timeout=30)
    assert (command.returncode, complaint) == (130, "")
