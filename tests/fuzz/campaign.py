"""The random campaign: models, points and priors at random, and every result that is said to be ok checked by another route.

    python tests/fuzz/campaign.py --minutes 60 --seed 0

prints its progress and, at the end or after Ctrl-C, a table of figures. What is wrong is made as small as Hypothesis can, and
written to a file that reproduces it. The program ends with 1 where anything was wrong.

Rounds of cases run in processes of their own, so that one that dies takes nothing with it and memory does not grow. FISHERPOINT_ISA
chooses the instruction set; the others that are installed are compared with it.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import signal
import sys
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any

import fisherpoint as fp
from check_bits import Levels
from check_states import CHANCE, CHANCES
from checks import TIGHT
from figures import Figures, Finding
from random_models import Case
from rounds import Round, run_round

ROUND = 25  # cases
ROUNDS = 40  # of one process
COMPILED_EVERY = 600.0  # seconds; a compilation takes most of a minute


def work(pipe: Connection, case_file: Path) -> None:
    """A process that runs the rounds that it is told, until it is told None."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    levels = Levels()

    def before(case: Case) -> None:
        case_file.write_text(case.code() + "\n")

    try:
        while (task := pipe.recv()) is not None:
            number, known, until, also = task
            pipe.send(run_round(number, ROUND if also is None else 1, known, until, levels, before, also))
    except EOFError:
        pass
    finally:
        levels.close()


@dataclass
class Worker:
    """A process, its end of the pipe, and the round that it is at."""

    process: Any
    pipe: Connection
    case_file: Path
    number: int | None = None
    rounds: int = 0


@dataclass
class Campaign:
    """Rounds until the time is over, in some processes."""

    minutes: float
    first: int
    directory: Path
    jobs: int = 1
    say: Callable[[str], None] = print
    figures: Figures = field(default_factory=Figures)
    kept: Counter[str] = field(default_factory=Counter)

    def run(self) -> None:
        self.directory.mkdir(parents=True, exist_ok=True)
        begin = last = compiled = time.monotonic()
        until, number = begin + 60 * self.minutes, self.first * 1_000_000
        workers = [self.start(j) for j in range(self.jobs)]
        try:
            while time.monotonic() < until or any(worker.number is not None for worker in workers):
                for j, worker in enumerate(workers):
                    if worker.number is None and time.monotonic() < until:
                        if worker.rounds >= ROUNDS:
                            self.stop(worker)
                            workers[j] = worker = self.start(j)
                        also = None
                        if time.monotonic() > compiled + COMPILED_EVERY:
                            also, compiled = "compiled", time.monotonic()
                        worker.pipe.send((number, dict(self.kept), until, also))
                        worker.number, worker.rounds, number = number, worker.rounds + 1, number + 1
                for pipe in wait([worker.pipe for worker in workers if worker.number is not None], timeout=1.0):
                    j = next(j for j, worker in enumerate(workers) if worker.pipe is pipe)
                    if not self.take(workers[j]):
                        workers[j] = self.start(j)
                if time.monotonic() > last + 60:
                    last = time.monotonic()
                    self.progress((last - begin) / 60)
        except KeyboardInterrupt:
            self.say("interrupted")
        finally:
            for worker in workers:
                worker.process.terminate()
                worker.process.join()

    def start(self, j: int) -> Worker:
        here, there = multiprocessing.Pipe()
        case_file = self.directory / f"case_{j}.py"
        process = multiprocessing.get_context("spawn").Process(target=work, args=(there, case_file), daemon=False)
        process.start()
        there.close()
        return Worker(process, here, case_file)

    def stop(self, worker: Worker) -> None:
        worker.pipe.send(None)
        worker.process.join(30)
        worker.process.terminate()

    def take(self, worker: Worker) -> bool:
        """Take in the round of a worker; whether it lives."""
        number, worker.number = worker.number, None
        try:
            done: Round = worker.pipe.recv()
        except EOFError:
            worker.process.join()
            code = worker.case_file.read_text() if worker.case_file.exists() else ""
            self.figures.count("WRONG: the process dies")
            self.keep(Finding("the process dies", 1.0, f"{code}# exit code {worker.process.exitcode}"), number or 0)
            return False
        self.figures.add(done.figures)
        for finding in done.findings:
            self.keep(finding, done.number)
        return True

    def keep(self, finding: Finding, number: int) -> None:
        self.kept[finding.kind] += 1
        name = "".join(letter if letter.isalnum() else "_" for letter in finding.kind)
        path = self.directory / f"{name}_{self.kept[finding.kind]}.py"
        text = "".join(f"# {line}\n" for line in (finding.title, f"round {number}"))
        path.write_text(f"{text}\n{finding.code}\n")
        self.say(f"\nWRONG, see {path}: {finding.title}\n{finding.code}\n")

    def progress(self, minutes: float) -> None:
        counts = self.figures.counts
        self.say(
            f"{minutes:.0f} min: {counts['cases']:,} cases, {counts['calls']:,} calls, {counts['trajectories']:,} trajectories, "
            f"{self.wrong} wrong"
        )

    def weigh_chances(self) -> None:
        """What may happen by chance is wrong where it is not as rare as it may be."""
        chances, of = (self.figures.counts[name] for name in (CHANCE, f"trajectories compared with rtol {TIGHT:g}"))
        if chances > 1 + CHANCES * of:
            self.figures.count(f"WRONG: {CHANCE}", chances)

    @property
    def wrong(self) -> int:
        return sum(count for name, count in self.figures.counts.items() if name.startswith("WRONG"))


def main(given: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1, help="processes (default: %(default)s)")
    parser.add_argument("--output", type=Path, default=Path("run/campaign"), help="where findings go (default: %(default)s)")
    chosen = parser.parse_args(given)
    campaign = Campaign(chosen.minutes, chosen.seed, chosen.output, chosen.jobs, lambda text: print(text, flush=True))
    os.environ.setdefault("FISHERPOINT_CACHE", str(chosen.output.resolve() / "compiled"))
    campaign.run()
    campaign.weigh_chances()
    print(f"\ninstruction set {fp.instruction_set()} of {', '.join(fp.instruction_sets())}, seed {chosen.seed}\n")
    print(campaign.figures.table())
    for kind, findings in sorted(campaign.figures.examples.items()):
        print(f"\n--- {kind}: the shortest example\n{findings[0].code}")
    return int(campaign.wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
