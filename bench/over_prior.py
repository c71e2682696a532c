"""``python -m bench.over_prior``: what designs over the prior are worth, beside those for its mean.

For the cylinder and a spiking cell, two seeds: designs for the mean and with each criterion over the prior, log det F at parameters
that no search has seen, and virtual experiments with truths from the prior. Times are those of the processor, of the search alone.
"""

from __future__ import annotations

import argparse
from time import process_time

import numpy as np

import fisherpoint as fp

from .algorithm_cases import example, fitzhugh_nagumo

PROBLEMS = {"cylinder": example("cylinder"), "FitzHugh-Nagumo": fitzhugh_nagumo}
KINDS = ("log", "cvar", "worst")
UNSEEN = fp.OverPrior("log", scenarios=fp.Sobol(64, seed=99))


def log_dets(problem: fp.DesignProblem, points: fp.Experiments) -> np.ndarray:
    """log det F where the parameters are others; NaN where a point has no trajectory."""
    found = []
    for theta in UNSEEN.nodes(problem)[0]:
        prior = fp.GaussianPrior(dict(zip(problem.prior.names, theta.tolist(), strict=True)), dict(problem.prior.std))
        try:
            found.append(fp.evaluate(problem.replace(prior=prior), points).log_det)
        except ValueError:
            found.append(np.nan)
    return np.array(found)


def rows(name: str, seed: int, runs: int) -> list[str]:
    """Rows of the table, one per criterion."""
    problem, designs, told = PROBLEMS[name](), {}, {}
    for kind in (None, *KINDS):
        label, started = kind or "mean", process_time()
        over = None if kind is None else fp.OverPrior(kind)
        designs[label] = fp.exchange(problem, 12, seed=seed, method=fp.ExchangeMethod(references=False), goal=fp.Goal(over=over))
        told[label] = process_time() - started, log_dets(problem, designs[label].points)
    points = {label: design.points for label, design in designs.items()}
    validation = fp.validate(problem, points, runs=runs, theta="prior", seed=3)
    lines = []
    for label, of in validation.designs.items():
        cpu, there = told[label]
        worst = sorted(of.parameters.values(), key=lambda figures: -figures.ratio.value)[:2]
        ratios = ", ".join(f"{figures.parameter} {figures.ratio.value:.2f}" for figures in worst)
        achieved, promised = (
            float(np.exp(np.mean([np.log(value / figures.prior_std) for value, figures in values])))
            for values in (
                [(figures.achieved.value, figures) for figures in of.parameters.values()],
                [(figures.promised, figures) for figures in of.parameters.values()],
            )
        )
        lines.append(
            f"| {name}, {seed} | {label} | {designs[label].evaluation.log_det:.2f} "
            f"| {np.nanmean(there):.2f} | {np.nanmin(there):.2f} | {ratios} | {promised:.4f} | {achieved:.4f} | {cpu:.1f} |"
        )
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=300, help="virtual experiments with each design")
    given = parser.parse_args()
    print(
        "| problem, seed | criterion | at the mean | unseen, mean | smallest | achieved / promised | promised | achieved | CPU s |"
    )
    print("|---|---|---|---|---|---|---|---|---|")
    for name in PROBLEMS:
        for seed in (0, 1):
            print("\n".join(rows(name, seed, given.runs)), flush=True)


if __name__ == "__main__":
    main()
