"""Calls public functions with clumsy values: each must be refused in our words, or be one that may be taken.

Run ``python tests/fuzz/fuzz_misuse.py`` for every value in the place of every argument, or with ``--calls N --seed S`` for a random
choice with two arguments replaced at once. It tells what was neither, what hung, and by its end what crashed.
"""

import argparse
import faulthandler
import resource
import sys
import time
from pathlib import Path
from random import Random

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "python"))

from misuse_cases import SWAPPED, cases
from misuse_outcomes import Misuse, outcome
from misuse_values import CLUMSY

MEMORY = 6 << 30
"""Bytes: what asks for more is refused by the system, not by us, and counts as a fault."""


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--calls", type=int, help="at random; default: all")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    faulthandler.enable()
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    misuse, begin = Misuse(), time.perf_counter()
    if given.calls is None:
        for name, case in cases().items():
            for argument in case.arguments:
                for value in CLUMSY:
                    misuse.try_one(name, argument, value)
        for name, call in SWAPPED.items():
            misuse.count(f"swapped in {name}", outcome(call, False))
    else:
        random, known, clumsy = Random(given.seed), list(cases()), list(CLUMSY)
        for _ in range(given.calls):
            name = random.choice(known)
            arguments = list(cases()[name].arguments)
            chosen = random.sample(arguments, min(len(arguments), random.choice((1, 1, 2))))
            misuse.try_some(name, {argument: random.choice(clumsy) for argument in chosen})
    print("\n".join(misuse.faults))
    total = sum(misuse.counts.values())
    print(f"{total} calls in {time.perf_counter() - begin:.0f} s: {misuse.counts}, {len(misuse.faults) / total:.3%} faults")
    sys.exit(bool(misuse.faults))


if __name__ == "__main__":
    main()
