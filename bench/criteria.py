"""``python -m bench.criteria``: how good exact designs by other criteria than log det F are, over seeds.

The efficiency of each design is against the best that any seed has found, by the criterion: the share of the measurements with
which the better one would do. "Proven" is what the report of the first seed's design says, of the candidates of its search.
``--quick`` takes three seeds.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from time import process_time
from typing import Any

import numpy as np

import fisherpoint as fp

from .algorithm_cases import CASES
from .algorithms import GOOD, QUICK_SEEDS, arguments, summary

ASKED: tuple[tuple[str, str, dict[str, Any]], ...] = (
    ("Michaelis-Menten", "A", {}),
    ("Michaelis-Menten", "c", {"of": "V / K"}),
    ("Michaelis-Menten", "E", {}),
    ("Arrhenius", "A", {}),
    ("Arrhenius", "c", {"of": "k_1 / k_2"}),
    ("Arrhenius", "Ds", {"of": ["E_1", "E_2"]}),
    ("Arrhenius", "E", {}),
    ("cylinder, noise", "A", {}),
    ("cylinder, noise", "c", {"of": "E_oil"}),
    ("cylinder, noise", "E", {}),
)


@dataclass
class Trials:
    """Designs of one problem by one criterion: log phi of the sum over the points, its bound, and seconds of the processor."""

    case: str
    criterion: str
    of: str
    log_phi: list[float] = field(default_factory=list)
    at_most: float = float("nan")
    cpu: list[float] = field(default_factory=list)


def add(trials: Trials, options: dict[str, Any], seed: int, threads: int) -> None:
    """Design once more."""
    case = next(case for case in CASES if case.name == trials.case)
    problem = case.problem()
    goal = fp.Goal(trials.criterion, **options)
    started = process_time()
    design = fp.exchange(
        problem, case.n_experiments, seed=seed, threads=threads, method=fp.ExchangeMethod(references=False), goal=goal
    )
    trials.cpu.append(process_time() - started)
    trials.log_phi.append(design.criterion.log_phi(design.evaluation.information))
    if seed == 0:
        efficiency = fp.exchange(problem, case.n_experiments, seed=seed, threads=threads, goal=goal).efficiency
        if efficiency is not None and efficiency.at_most is not None:
            trials.at_most = efficiency.at_most / design.criterion.level + float(np.log(case.n_experiments / 2))


def table(found: list[Trials]) -> str:
    """Markdown: a row for each problem and criterion."""
    lines = [
        f"| problem | criterion | efficiency, least | median | of seeds at {GOOD:g} or more | proven, first seed | CPU s |",
        "|---|---|---|---|---|---|---|",
    ]
    for one in found:
        best = max(one.log_phi)
        shares = np.exp(np.array(one.log_phi) - best)
        proven = np.exp(one.log_phi[0] - one.at_most)
        lines.append(
            f"| {one.case} | {one.criterion}{one.of and ' of ' + one.of} | {summary(shares)} "
            f"| {proven:.3f} | {np.median(one.cpu):.1f} |"
        )
    return "\n".join(lines)


def main() -> None:
    parser = arguments(__doc__)
    parser.add_argument("--criterion", action="append")
    given = parser.parse_args()
    found: list[Trials] = []
    if given.json is not None and given.json.exists():
        found = [Trials(**one) for one in json.loads(given.json.read_text())]
    for case, criterion, options in ASKED:
        if given.case is not None and not case.startswith(tuple(given.case)):
            continue
        if given.criterion is not None and criterion not in given.criterion:
            continue
        of = options.get("of", "")
        of = of if isinstance(of, str) else ", ".join(of)
        own = next((one for one in found if (one.case, one.criterion, one.of) == (case, criterion, of)), None)
        if own is None:
            own = Trials(case, criterion, of)
            found.append(own)
        for seed in range(len(own.log_phi), QUICK_SEEDS if given.quick else given.seeds):
            add(own, options, seed, given.threads)
            if given.json is not None:
                given.json.write_text(json.dumps([asdict(one) for one in found], indent=1) + "\n")
    print(table(found))


if __name__ == "__main__":
    main()
