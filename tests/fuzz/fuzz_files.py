"""Damages saved results entry by entry, seals them again, and loads and shows them: only a ValueError in our words may come out.

Run ``python tests/fuzz/fuzz_files.py`` for every damage at every place of every file, or with ``--share 0.1 --seed S`` for some.
"""

import argparse
import json
import resource
import signal
import sys
import tempfile
import time
import warnings
from collections import Counter
from pathlib import Path
from random import Random

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "python"))

from saved_cases import damaged, damages, outcome, places, saved_cases

MEMORY = 2 << 30
"""Bytes: what asks for more counts as a fault."""

SECONDS = 20
"""For one file; what takes longer counts as a fault."""


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--share", type=float, default=1.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", help="name of one saved result")
    parser.add_argument("--plots", action="store_true", help="draw what was loaded, too")
    given = parser.parse_args()
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    random, counts, faults, begin = Random(given.seed), Counter(), 0, time.perf_counter()
    warnings.simplefilter("ignore")

    def too_long(*_: object) -> None:
        raise TimeoutError("took too long")

    signal.signal(signal.SIGALRM, too_long)
    for label, case in saved_cases().items():
        if given.only and given.only != label:
            continue
        with tempfile.TemporaryDirectory() as directory:
            case.save(Path(directory))
            path = Path(directory) / case.name
            data = json.loads(path.read_text())
            del data["sha256"]
            for place in places(data):
                for name, _ in damages(data, place):
                    if random.random() > given.share:
                        continue
                    path.write_text(damaged(data, place, name))
                    signal.alarm(SECONDS)
                    found = outcome(case, Path(directory), given.plots)
                    signal.alarm(0)
                    counts[found.kind] += 1
                    if found.kind == "fault":
                        faults += 1
                        print(f"{label}: {'.'.join(map(str, place))}: {name}: {found.words}", flush=True)
    print(f"{sum(counts.values())} files in {time.perf_counter() - begin:.0f} s: {dict(counts)}")
    sys.exit(bool(faults))


if __name__ == "__main__":
    main()
