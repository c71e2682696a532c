"""``python -m bench.algorithms``: how good the designs of each method are, and what they cost.

For each case and method designs of several seeds. The efficiency of each is (det F / det F of the best that any of them has)^(1/p).
"paper, as long" is the paper's search with as many iterations as it makes in the time of "auto" with the same seed. Times are those
of the processor, all threads together; "cores" is how many were at work in the mean. ``--quick`` takes three seeds of three cases.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import numpy as np

import fisherpoint as fp
from fisherpoint.basics.values import Array

from .algorithm_cases import CASES, Case

METHODS: dict[str, dict[str, Any]] = {
    "paper": {"method": "paper"},
    "auto": {"method": "auto"},
    "paper, as long": {"method": "paper"},
}
OF_PAPER = 200
"""Iterations of the paper's search where none are given."""
SEEDS, QUICK_SEEDS = 20, 3
GOOD = 0.98
"""The efficiency against the best design of all methods and seeds from which on one counts as good; there may be better ones."""


@dataclass(frozen=True)
class Trial:
    """One design: its log det F, as a sum over the points, candidates that were drawn, and seconds."""

    case: str
    method: str
    seed: int
    log_det: float
    parameters: int
    drawn: int
    cpu: float
    wall: float


def trial(case: Case, method: str, seed: int, threads: int, before: Iterable[Trial] = ()) -> Trial:
    """Design once; as long as another method took `before`, with the same seed."""
    problem, settings = case.problem(), dict(METHODS[method])
    if method == "paper, as long":
        seconds = {one.method: one.cpu for one in before if (one.case, one.seed) == (case.name, seed)}
        settings["max_iterations"] = max(OF_PAPER, round(OF_PAPER * seconds["auto"] / seconds["paper"]))
    wall, cpu = perf_counter(), process_time()
    design = fp.exchange(problem, case.n_experiments, seed=seed, threads=threads, references=False, **settings)
    cpu, wall, p = process_time() - cpu, perf_counter() - wall, len(problem.estimated)
    log_det = design.evaluation.log_det + p * float(np.log(case.n_experiments / 2))
    return Trial(case.name, method, seed, log_det, p, design.drawn, cpu, wall)


def table(trials: Iterable[Trial]) -> str:
    """Markdown: a row for each case and method."""
    by_case: dict[str, list[Trial]] = {}
    for one in trials:
        by_case.setdefault(one.case, []).append(one)
    lines = [
        f"| case | method | best log det | efficiency, least | median | of seeds at {GOOD:g} or more | drawn | CPU s | cores |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for name, own in by_case.items():
        best = max(one.log_det for one in own)
        for method in dict.fromkeys(one.method for one in own):
            some = [one for one in own if one.method == method]
            shares = np.exp([(one.log_det - best) / one.parameters for one in some])
            cpu, wall, drawn = (np.median([getattr(one, key) for one in some]) for key in ("cpu", "wall", "drawn"))
            lines.append(
                f"| {name} | {method} | {max(one.log_det for one in some):.2f} | {summary(shares)} "
                f"| {drawn:.0f} | {cpu:.1f} | {cpu / wall:.1f} |"
            )
    return "\n".join(lines)


def summary(shares: Array) -> str:
    """Three cells of efficiencies: the least, the median, and how many are good."""
    return f"{shares.min():.3f} | {np.median(shares):.3f} | {int((shares >= GOOD).sum())} of {len(shares)}"


def arguments(description: str | None) -> argparse.ArgumentParser:
    """What studies over seeds are asked for at the command line."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="three seeds, and the first few cases where there are many")
    parser.add_argument("--seeds", type=int, default=SEEDS)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--case", action="append", help="the beginning of names; default: all")
    parser.add_argument("--json", type=Path, help="where trials are kept; those that are there are not done again")
    return parser


def main() -> None:
    parser = arguments(__doc__)
    parser.add_argument("--method", action="append", choices=METHODS)
    given = parser.parse_args()
    cases = [case for case in CASES if given.case is None or case.name.startswith(tuple(given.case))]
    if given.quick:
        cases = [case for case in cases if case.name in ("cylinder, noise", "FitzHugh-Nagumo", "Arrhenius")]
    trials: list[Trial] = []
    if given.json is not None and given.json.exists():
        trials = [Trial(**one) for one in json.loads(given.json.read_text())]
    done = {(one.case, one.method, one.seed) for one in trials}
    for case in cases:
        for seed in range(QUICK_SEEDS if given.quick else given.seeds):
            for method in given.method or METHODS:
                if (case.name, method, seed) not in done:
                    trials.append(trial(case, method, seed, given.threads, trials))
                    if given.json is not None:
                        given.json.write_text(json.dumps([asdict(one) for one in trials], indent=1) + "\n")
    print(table(trials))


if __name__ == "__main__":
    main()
