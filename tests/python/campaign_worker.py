"""A process that runs campaigns in children of its own, and kills these.

It reads lines "<directory> <seconds> <writes>" and runs a campaign, or goes on with the one in the directory, in a fork that dies
by SIGKILL after so many seconds, or around the replacement of the file that is so many replacements on (0.5: before the first one,
1: after it); nan is never. It answers with a line each: "killed", "finished" or "failed".
"""

from __future__ import annotations

import math
import os
import signal
import sys
import time
import traceback
from pathlib import Path

import scipy.optimize  # whatever is imported before the fork need not be after it
import scipy.special
import scipy.stats  # noqa: F401

import fisherpoint as fp
from fisherpoint.design.file.configuration import load_config

BATCHES = 2

for name in fp.__all__:
    getattr(fp, name)


def main() -> None:
    problem = load_config(sys.argv[1]).problem()
    for line in sys.stdin:
        directory, seconds, writes = line.rsplit(maxsplit=2)
        child = os.fork()
        if child == 0:
            try:
                die_at(float(writes))
                run(problem, Path(directory))
            except BaseException:
                traceback.print_exc()
                os._exit(1)
            os._exit(0)
        print(outcome(child, float(seconds)), flush=True)


def run(problem: fp.DesignProblem, directory: Path) -> None:
    if fp.Campaign.is_in(directory):
        campaign = fp.Campaign.load(directory, threads=1)
    else:
        of_runs = isinstance(problem.region, fp.RunRegion)
        quick = {"n_candidates": 20, "n_starts": 2} if of_runs else {"n_candidates": 8, "max_iterations": 12}
        campaign = fp.Campaign(problem, 2, targets=0.01, seed=3, directory=directory, threads=1, **quick)
    truth = problem.theta * (1.0 + 0.1 * (-1.0) ** sum(map(ord, problem.model.name)))
    while len(campaign.history) < BATCHES:
        rig = fp.VirtualRig(problem.model, truth, problem.noise or {}, seed=len(campaign.history))
        campaign.tell(rig.measure(campaign.next()))


def die_at(writes: float) -> None:
    replace, done = os.replace, 0

    def counted(source: str, target: str) -> None:
        nonlocal done
        if done + 0.5 == writes:
            os.kill(os.getpid(), signal.SIGKILL)
        replace(source, target)
        done += 1
        if done == writes:
            os.kill(os.getpid(), signal.SIGKILL)

    os.replace = counted  # type: ignore[assignment]


def outcome(child: int, seconds: float) -> str:
    """Wait for the child, and kill it when its time is over."""
    end = math.inf if math.isnan(seconds) else time.monotonic() + seconds
    while True:
        found, status = os.waitpid(child, os.WNOHANG)
        if found:
            return "killed" if os.WIFSIGNALED(status) else "failed" if os.WEXITSTATUS(status) else "finished"
        if time.monotonic() >= end:
            os.kill(child, signal.SIGKILL)
            end = math.inf
        time.sleep(1e-3)


if __name__ == "__main__":
    main()
