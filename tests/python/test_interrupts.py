"""Ctrl-C while something is made that stays for the rest of the process: it is heard, and nothing that is half done stays."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

import fisherpoint as fp
from fisherpoint.basics.extras import needed_for
from fisherpoint.basics.interrupts import interrupts_wait

FIRST_NODES = """
import signal
import numpy as np
import fisherpoint as fp

signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs start with Ctrl-C ignored
prior = fp.GaussianPrior({"a": 0.0, "b": 0.0}, std={"a": 1.0, "b": 1.0})
load, calls = np.load, []

def interrupted(*arguments, **options):
    calls.append(1)
    WHAT
    return load(*arguments, **options)

np.load = interrupted
try:
    fp.Sobol(64).nodes(prior)
except BaseException as error:
    print(type(error).__name__)
np.load = load
print(len(calls), len(np.unique(fp.Sobol(64).nodes(prior)[0][:, 0])))
"""


def run(program: str) -> list[str]:
    environment = os.environ | {"PYTHONPATH": str(Path(fp.__file__).parents[1])}
    done = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def test_ctrl_c_while_scipy_reads_its_table_is_heard_and_leaves_no_nodes_that_are_the_same() -> None:
    assert run(FIRST_NODES.replace("WHAT", "signal.raise_signal(signal.SIGINT)")) == ["KeyboardInterrupt", "1 64"]


def test_nodes_without_scipys_table_are_refused_and_not_kept() -> None:
    """Whatever else fails there is swallowed by SciPy too, such as a lack of memory."""
    assert run(FIRST_NODES.replace("WHAT", "raise MemoryError")) == ["RuntimeError", "1 64"]


@pytest.fixture
def default_handler() -> object:
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_an_interrupt_waits_for_the_end_of_the_block(default_handler: object) -> None:
    done = []
    with pytest.raises(KeyboardInterrupt), interrupts_wait():
        signal.raise_signal(signal.SIGINT)
        done.append(1)
    assert done == [1]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_an_interrupt_is_heard_where_the_block_fails_too(default_handler: object) -> None:
    with pytest.raises(KeyboardInterrupt) as caught, interrupts_wait():
        signal.raise_signal(signal.SIGINT)
        raise ValueError("of the block")
    assert isinstance(caught.value.__context__, ValueError)


def test_an_import_of_a_further_package_is_not_broken_off(default_handler: object) -> None:
    """As one that is broken off fails in pandas and matplotlib for the rest of the process."""
    done = []
    with pytest.raises(KeyboardInterrupt), needed_for("a picture"):
        signal.raise_signal(signal.SIGINT)
        done.append(1)
    assert done == [1]


def test_an_ignored_interrupt_stays_ignored(default_handler: object) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with interrupts_wait():
        signal.raise_signal(signal.SIGINT)
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN


def test_other_threads_leave_the_handler_alone(default_handler: object) -> None:
    seen: list[object] = []

    def work() -> None:
        with interrupts_wait():
            seen.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert seen == [signal.default_int_handler]
