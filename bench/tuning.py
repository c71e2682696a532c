"""``python -m bench.tuning``: which numbers of the search for points make a difference.

One number of `PointSearchTuning` at a time is halved, doubled, or set to what disables its rule; then designs of several seeds are
searched for, with few iterations and few candidates. The efficiency of each is (det F / det F of the best that any has)^(1/p).
Work is counted, not timed: candidates that are drawn, each of them a trajectory with sensitivities, and points that are tried on
the nodes of the rule. ``--only TEXT`` takes the changes whose name contains a text.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import fisherpoint as fp
from fisherpoint.basics.values import Array
from fisherpoint.design.points.auto_search import AutoSearch
from fisherpoint.design.points.past_moves import Lineage
from fisherpoint.design.points.tuning import PointSearchTuning
from fisherpoint.design.results.settings import ExchangeSettings

from .algorithm_cases import CASES, Case

NAMES = ("cylinder, noise", "cylinder, noise, jumps excluded", "FitzHugh-Nagumo")
SEEDS, CANDIDATES, ITERATIONS = 8, 10, 200
USUAL = "as it is"

OTHERS: dict[str, tuple[Any, ...]] = {
    "checks_per_exchange": (1,),
    "climb.generations": (0,),
    "climb.shortened_per_point": (0, 3),
    "climbing_survivors": (1.0,),
    "unchecked_rounds": (1,),
    "random_starts": (1,),
    "start_share": (1.0,),
    "pilot_candidates": (0,),
    "near_share_in_groups": (1.0,),
    "first_rounds": (0,),
    "last_rounds": (0,),
    "merged_rounds": (0,),
    "agreeing_groups": (99,),
    "ascent_iterations": (0,),
    "ascent.step_shares": ((1.0,),),
    "ascent.reach_growth": (1.0,),
    "least_near_per_point": (1,),
    "climb.least_distance": (0.02,),
    "merged_climbs": (0,),
    "ascent.reach_factors": ((1.0, 1 / 16),),
    "edge_candidates": (0.1, 200),
    "groups": (2,),
    "climbing_candidates": (0.1,),
    "climb.near_per_point": (8,),
    "near_candidates": (4, 16),
    "checked_per_point": (2, 8),
    "climb.rounds": (6,),
    "least_start_candidates": (150,),
    "cycle_rounds": (8,),
}
"""Other values of each number: one that disables its rule where there is one, or else a half or twice as much."""


@dataclass(frozen=True)
class Trial:
    """One design: its log det F, as a sum over the points, candidates drawn, and points tried on the nodes."""

    case: str
    change: str
    seed: int
    log_det: float
    parameters: int
    drawn: int
    tried: int


class _Forgetful(Lineage):
    """No directions: all candidates near points are drawn on all scales."""

    def add(self, points: Array, parents: Array) -> None:
        pass


def changed(path: str, value: Any) -> PointSearchTuning:
    """The tuning with another value of one number."""
    usual, (name, *inside) = PointSearchTuning(), path.split(".")
    if inside:
        value = replace(getattr(usual, name), **{inside[0]: value})
    return replace(usual, **{name: value})


def trial(case: Case, change: str, tuning: PointSearchTuning, seed: int) -> Trial:
    problem = case.problem()
    settings = ExchangeSettings(
        n_experiments=case.n_experiments,
        n_candidates=CANDIDATES,
        max_iterations=ITERATIONS,
        seed=seed,
        method=fp.ExchangeMethod(references=False),
    )
    search = AutoSearch(problem, settings, 1, tuning=tuning)
    if not tuning.climb.generations:
        search.lineage = _Forgetful(1)
    search.run(None)
    tried = len(search.seen.validity._known)
    return Trial(case.name, change, seed, search.best.log_det, problem.n_unknowns, search.source.drawn, tried)


def table(trials: Iterable[Trial]) -> str:
    """A line per change: for each case the median efficiency less that of the usual tuning, in per cent, and the relative work."""
    trials = list(trials)
    cases = list(dict.fromkeys(one.case for one in trials))
    best = {case: max(one.log_det for one in trials if one.case == case) for case in cases}

    def figures(case: str, change: str) -> tuple[float, float, float, float, float]:
        own = [one for one in trials if (one.case, one.change) == (case, change)]
        values = [100 * np.exp((one.log_det - best[case]) / one.parameters) for one in own]
        quarter, median, three = np.quantile(values, [0.25, 0.5, 0.75]) if own else [np.nan] * 3
        return median, quarter, three, *(np.mean([getattr(one, name) for one in own]) for name in ("drawn", "tried"))

    lines = [" | ".join(["", "change", *(f"{case}: efficiency, drawn, tried" for case in cases), ""]).strip()]
    lines.append("|---|" + "---|" * len(cases))
    for change in dict.fromkeys(one.change for one in trials):
        cells = []
        for case in cases:
            median, quarter, three, *work = figures(case, change)
            usual = figures(case, USUAL)
            if change == USUAL:
                cells.append(f"{median:.2f} ({quarter:.2f} to {three:.2f}), {work[0]:.0f}, {work[1]:.0f}")
            else:
                cells.append(f"{median - usual[0]:+.2f}, {work[0] / usual[3]:.2f}, {work[1] / max(usual[4], 1):.2f}")
        lines.append(f"| {change} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=SEEDS)
    parser.add_argument("--first", type=int, default=0, metavar="SEED", help="the first seed")
    parser.add_argument("--only", default="", metavar="TEXT")
    parser.add_argument("--case", action="append", choices=NAMES)
    parser.add_argument("--json", type=Path, metavar="FILE", help="keep all trials there, and continue from those that it has")
    given = parser.parse_args()
    kept = given.json is not None and given.json.exists()
    trials = [Trial(**one) for one in json.loads(given.json.read_text())] if kept else []
    done = {(one.case, one.change, one.seed) for one in trials}
    changes = {USUAL: PointSearchTuning()}
    for path, values in OTHERS.items():
        changes |= {f"{path} = {value}": changed(path, value) for value in values if given.only in path}
    for change, tuning in changes.items():
        for case in (case for case in CASES if case.name in (given.case or NAMES)):
            for seed in range(given.first, given.first + given.seeds):
                if (case.name, change, seed) not in done:
                    trials.append(trial(case, change, tuning, seed))
        if given.json is not None:
            given.json.write_text(json.dumps([asdict(one) for one in trials], indent=1) + "\n")
    print(table(trials))


if __name__ == "__main__":
    main()
