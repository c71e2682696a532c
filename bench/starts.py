"""``python -m bench.starts``: how many fits are right from starts that are two prior standard deviations off in everything.

Data are those of designs for the examples, from several seeds, by a virtual rig at the prior mean. The starts of a fit lie around
each corner of the box of two standard deviations, with the prior's spread: eight, and twice as many further out where these do not
agree. A fit is right where its chi-square is at most that of the minimum next to the truth.
"""

from __future__ import annotations

import argparse
from itertools import product
from pathlib import Path
from typing import NamedTuple

import fisherpoint as fp
from fisherpoint.design.file.configuration import load_config

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
NAMES = "cascaded_tanks", "reactor", "cylinder", "robot_joint"
FAR = 2.0
"""By how many prior standard deviations starts are off."""
STARTS, CORNERS = 8, 32


class Counts(NamedTuple):
    """Fits; those that are right, of these those from eight starts; those that are wrong, of these those that say so."""

    fits: int
    right: int
    of_eight: int
    wrong: int
    said: int


def counted(name: str, seeds: int) -> Counts:
    """Count the fits of an example from all corners of the box; where there are more than `CORNERS`, from so many spread evenly."""
    problem = load_config(EXAMPLES / f"{name}.toml").problem()
    of, mean, std = problem.prior, problem.prior.mean, problem.prior.std
    assert problem.noise is not None
    corners = list(product((-FAR, FAR), repeat=len(of.names)))
    corners = corners[:: -(-len(corners) // CORNERS)]
    right = of_eight = wrong = said = 0
    for seed in range(seeds):
        design = fp.exchange(problem, 12, seed=seed)
        data = fp.VirtualRig(problem.model, mean, problem.noise, seed=seed).measure(design.points)
        least = fp.estimate(problem.model, data, start=mean, noise=problem.noise).chi_square
        for corner in corners:
            around = fp.GaussianPrior({k: mean[k] + by * std[k] for k, by in zip(of.names, corner, strict=True)}, std)
            fit = fp.estimate(problem.model, data, start=around, noise=problem.noise, starts=STARTS)
            if fit.chi_square <= least * (1 + 1e-6):
                right, of_eight = right + 1, of_eight + (fit.starts <= STARTS)
            else:
                wrong, said = wrong + 1, said + bool(fit.unexplained or fit.reached == 1 or not fit.converged)
    return Counts(right + wrong, right, of_eight, wrong, said)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m bench.starts", description=__doc__)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("names", nargs="*", default=NAMES)
    given = parser.parse_args()
    print("| example | fits | right | of these from eight starts | wrong | of these say so |", "|---|" + "--:|" * 5, sep="\n")
    for name in given.names:
        print(f"| {name} | {' | '.join(map(str, counted(name, given.seeds)))} |", flush=True)


if __name__ == "__main__":
    main()
