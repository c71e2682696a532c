"""When the exchange algorithm stops: iterations, patience, time, interrupts."""

from __future__ import annotations

import itertools
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from defaults import problem, same_bits
from fisherpoint.information.candidates import CandidateSource

QUICK: dict[str, Any] = {
    "n_experiments": 9,
    "n_candidates": 8,
    "max_iterations": 12,
    "method": fp.ExchangeMethod("paper", references=False),
}


def test_no_iterations_are_the_random_start() -> None:
    design = fp.exchange(problem(), **QUICK | {"max_iterations": 0})
    assert len(design.trace) == 1 and design.stop_reason == "max_iterations"
    start = CandidateSource(problem(), np.random.default_rng(0), threads=1).draw_confirmed(9)
    assert same_bits(design.points.table, start.points.table)


@pytest.mark.parametrize("patience", [1, 3])
def test_patience(patience: int) -> None:
    method = fp.ExchangeMethod("paper", references=False, patience=patience, max_redraws=0)
    design = fp.exchange(problem(), **QUICK | {"max_iterations": 400, "n_candidates": 1, "method": method})
    assert design.stop_reason == "patience"
    exchanged = [record.exchanged for record in design.trace[1:]]
    assert not any(exchanged[-patience:])
    idle = [len(list(group)) for value, group in itertools.groupby(exchanged) if not value]
    assert max(idle) == patience == idle[-1]  # and it did not stop before


@pytest.mark.parametrize("references", [False, True])
def test_a_time_limit_bounds_the_whole_call(references: bool) -> None:
    seconds = []
    for _ in range(3):  # the least counts: a machine that is busy stands still now and then
        started = time.process_time()
        design = fp.exchange(
            problem(output_covariance="pooled"),
            9,
            n_candidates=10,
            max_iterations=10**6,
            method=fp.ExchangeMethod(references=references, patience=None, time_limit=0.3),
            threads=1,
        )
        seconds.append(time.process_time() - started)
        assert design.stop_reason == "time_limit"
        assert design.trace[-1].seconds >= 0.2  # the rest is for the evaluation and the references
        assert design.seconds >= 0.2
    assert min(seconds) < 1.0


def test_progress_is_called_once_per_iteration() -> None:
    calls: list[fp.Progress] = []
    design = fp.exchange(problem(), **QUICK, progress=calls.append)
    assert [call.step for call in calls] == list(range(1, 13))
    assert [call.value for call in calls] == [record.log_det for record in design.trace[1:]]
    assert all(call.total == 12 for call in calls)
    assert all(call.message.startswith(f"log det {call.value:.3f}, ") for call in calls[:-1])
    assert calls[-1].message == "proving how good it is"
    assert all(b.seconds >= a.seconds for a, b in itertools.pairwise(calls))


def test_an_error_in_the_callback_is_not_swallowed() -> None:
    def fail(_: fp.Progress) -> None:
        raise RuntimeError("the user's own")

    with pytest.raises(RuntimeError, match="the user's own"):
        fp.exchange(problem(), **QUICK, progress=fail)


def test_an_interrupt_returns_the_best_design_so_far() -> None:
    def interrupt(state: fp.Progress) -> None:
        if state.step == 5:
            raise KeyboardInterrupt

    design = fp.exchange(problem(), **QUICK | {"method": "paper"}, progress=interrupt)
    assert design.stop_reason == "interrupted" and len(design.trace) == 6
    whole = fp.exchange(problem(), **QUICK | {"max_iterations": 5})
    assert same_bits(design.points.table, whole.points.table)
    assert design.evaluation.log_det == whole.evaluation.log_det
    assert design.efficiency is None


LONG_RUN = """
import signal, sys, time
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs start with Ctrl-C ignored
import fisherpoint as fp
m = fp.HydraulicCylinder()
prior = fp.GaussianPrior(m.nominal, relative_std=dict(
    a_tau=.3, b_tau=.2, m_q=.05, E_oil=.2, p_t=.2, B_v=.1, c_L=.3, V_0A=.1, V_0B=.1))
region = fp.ExperimentRegion(dict(q=(.1, .2), v=(.1, .2), p_A=(8e6, 9e6), p_B=(12e6, 13e6), x_v=(.2, .5), u=(-.5, -.2),
                                  dt=(1e-4, 3e-4)))
problem = fp.DesignProblem(m, prior, region, rule=fp.TensorGrid(4), output_covariance="pooled")
print("started", flush=True)
def progress(p):
    print("iteration", p.step, flush=True)
design = fp.exchange(problem, n_candidates=400, max_iterations=10**6, progress=progress,
                     method=fp.ExchangeMethod(screen=False))
print("returned", time.time(), design.stop_reason, len(design.points), design.evaluation.log_det == design.trace[-1].log_det,
      flush=True)
"""


def test_ctrl_c_stops_a_long_run_within_a_second_and_leaves_its_best_design(tmp_path: Path) -> None:
    """4^9 nodes for 400 candidates: an iteration takes tens of seconds, so the signal falls into the core."""
    environment = os.environ | {"PYTHONPATH": str(Path(fp.__file__).parents[1])}
    program = LONG_RUN.replace("n_candidates=400", "n_experiments=2, n_candidates=400")
    with subprocess.Popen(
        [sys.executable, "-c", program], env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None and process.stderr is not None
        try:
            assert process.stdout.readline() == "started\n"
            time.sleep(2.5)  # the two points of the start take a fraction of this
            sent = time.time()
            process.send_signal(signal.SIGINT)
            output, errors = process.communicate(timeout=20)
        finally:
            process.kill()
    assert process.returncode == 0, errors
    words = output.split()
    assert "iteration 1" not in output  # it was within the first one
    words = words[words.index("returned") :]
    assert words[2:5] == ["interrupted", "2", "True"]
    assert float(words[1]) - sent < 1.5  # a second, and some for a busy machine
