"""``python -m bench.algorithms``: how good the designs of each method are, and what they cost.

For each case and method designs of several seeds. The efficiency of each is (det F / det F of the best that any of them has)^(1/p).
"paper, as long" is the paper's search with as many iterations as it makes in the time of "auto" with the same seed; "auto, 99 %"
asks that 99 % of the plants can run the design; for the cylinder it is counted what share of other plants can. Times are those of
the processor, all threads together; "cores" is how many were at work in the mean. ``--quick`` takes three seeds of three cases.
``--picture`` draws performance profiles: of all designs of a method, the share whose efficiency is at least that of the axis.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from time import perf_counter, process_time

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

import fisherpoint as fp
from fisherpoint.basics.values import Array
from fisherpoint.show.style import STYLE

from .algorithm_cases import CASES, Case

METHODS = {
    "paper": ("paper", fp.Goal()),
    "auto": ("auto", fp.Goal()),
    "paper, as long": ("paper", fp.Goal()),
    "auto, 99 %": ("auto", fp.Goal(confidence=0.99)),
}
"""The method of `exchange` and the goal."""
OF_PAPER = 200
"""Iterations of the paper's search where none are given."""
SEEDS, QUICK_SEEDS = 20, 3
PLANTS, OTHERS = 4000, 7_000_003
"""On which is counted whether they can run a design, and what is added to the seed for them: others than a search has seen."""
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
    can_run: float | None = None  # the share of plants, of the cylinder


def trial(case: Case, method: str, seed: int, threads: int, before: Iterable[Trial] = ()) -> Trial:
    """Design once; as long as another method took `before`, with the same seed."""
    problem, (search, goal) = case.problem(), METHODS[method]
    iterations = None
    if method == "paper, as long":
        seconds = {one.method: one.cpu for one in before if (one.case, one.seed) == (case.name, seed)}
        iterations = max(OF_PAPER, round(OF_PAPER * seconds["auto"] / seconds["paper"]))
    wall, cpu = perf_counter(), process_time()
    design = fp.exchange(
        problem,
        case.n_experiments,
        seed=seed,
        threads=threads,
        max_iterations=iterations,
        method=fp.ExchangeMethod(search, references=False),
        goal=goal,
    )
    cpu, wall, p = process_time() - cpu, perf_counter() - wall, len(problem.estimated)
    log_det = design.evaluation.log_det + p * float(np.log(case.n_experiments / 2))
    can_run = None
    if case.name.startswith("cylinder"):
        can_run = fp.feasibility(problem, design.points, draws=PLANTS, seed=OTHERS + seed, threads=threads).share
    return Trial(case.name, method, seed, log_det, p, design.drawn, cpu, wall, can_run)


def table(trials: Iterable[Trial]) -> str:
    """Markdown: a row for each case and method."""
    by_case: dict[str, list[Trial]] = {}
    for one in trials:
        by_case.setdefault(one.case, []).append(one)
    lines = [
        f"| case | method | best log det | efficiency, least | median | of seeds at {GOOD:g} or more "
        "| drawn | CPU s | cores | can run, least |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for name, own in by_case.items():
        for method in dict.fromkeys(one.method for one in own):
            some = [one for one in own if one.method == method]
            shares = efficiencies(some, own)
            cpu, wall, drawn = (np.median([getattr(one, key) for one in some]) for key in ("cpu", "wall", "drawn"))
            lines.append(
                f"| {name} | {method} | {max(one.log_det for one in some):.2f} | {summary(shares)} "
                f"| {drawn:.0f} | {cpu:.1f} | {cpu / wall:.1f} | {least_share(some)} |"
            )
    return "\n".join(lines)


def efficiencies(some: Iterable[Trial], of_case: Iterable[Trial]) -> Array:
    """Of trials of one case, against the best of all of it."""
    best = max(one.log_det for one in of_case)
    shares: Array = np.exp([(one.log_det - best) / one.parameters for one in some])
    return shares


def picture(trials: Iterable[Trial], file: Path) -> None:
    """Performance profiles of the methods that have trials of all cases: the share of designs at each efficiency or above."""
    by_case: dict[str, list[Trial]] = {}
    for one in trials:
        by_case.setdefault(one.case, []).append(one)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.0, 4.0), layout="constrained")
        axes = figure.subplots()
        for method in METHODS:
            some = [[one for one in own if one.method == method] for own in by_case.values()]
            if not all(some):
                continue
            shares = np.sort(np.concatenate([efficiencies(few, own) for few, own in zip(some, by_case.values(), strict=True)]))
            axes.step(shares, 1.0 - np.arange(len(shares)) / len(shares), where="pre", label=method)
        axes.set_xlabel("efficiency against the best design of all methods and seeds")
        axes.set_ylabel("share of designs at that or above")
        axes.set_title(f"{len(by_case)} cases")
        axes.set_ylim(0.0, 1.02)
        axes.legend(loc="lower left")
        figure.savefig(file, dpi=150)


def least_share(trials: Iterable[Trial]) -> str:
    """Of the plants that can run a design, and of designs that 99 % can run how many there are."""
    shares = [one.can_run for one in trials if one.can_run is not None]
    if not shares:
        return ""
    return f"{100 * min(shares):.1f} %, {sum(share >= 0.99 for share in shares)} of {len(shares)} at 99 %"


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
    parser.add_argument("--picture", type=Path, help="where performance profiles are drawn")
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
                if METHODS[method][1].confidence is not None and not case.name.startswith(("cylinder, noise", "cylinder, region")):
                    continue
                if (case.name, method, seed) not in done:
                    trials.append(trial(case, method, seed, given.threads, trials))
                    if given.json is not None:
                        given.json.write_text(json.dumps([asdict(one) for one in trials], indent=1) + "\n")
    print(table(trials))
    if given.picture is not None:
        picture(trials, given.picture)


if __name__ == "__main__":
    main()
