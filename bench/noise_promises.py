"""``python -m bench.noise_promises``: whether designs keep their standard errors under noise of every kind.

Points and runs are designed for a chain of two reactions, and measured on virtual rigs with truths from the prior. The table has
the achieved over the promised standard error with its Monte Carlo error, and the share of 95 % intervals that hold, of the
parameter that is farthest off. The exit code is 1 where a ratio is off 1 by more than 5 % and two Monte Carlo errors.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from time import process_time

import fisherpoint as fp
from fisherpoint.noise.models import NoiseOf

STD = 0.01


def of_both(noise: fp.Noise) -> NoiseOf:
    return {"a": noise, "b": noise}


KINDS: dict[str, NoiseOf] = {
    "white": of_both(fp.Noise(STD)),
    "proportional": of_both(fp.Noise(STD, relative=0.05)),
    "memory": of_both(fp.Noise(STD, colored=fp.GaussMarkov(0.02, 0.5))),
    "steps of 2 std": of_both(fp.Noise(STD, resolution=2 * STD)),
    "steps of 5 std": of_both(fp.Noise(STD, resolution=5 * STD)),
    "limits": {"a": fp.Noise(STD, limits=(None, 1.0)), "b": fp.Noise(STD, limits=(0.8, None))},
    "limits nearby": {"a": fp.Noise(STD, limits=(0.45, 0.6)), "b": fp.Noise(STD, limits=(None, 0.7))},
    "correlated": fp.NoiseModel({"a": STD, "b": STD}, correlation={("a", "b"): 0.7}),
}


def problem(noise: NoiseOf, of_runs: bool) -> fp.DesignProblem:
    """Two reactions in a row, with parameters that are known to 10 %."""
    model = fp.SymbolicModel(
        ["u - k*a", "k*a - c*b"],
        ["a", "b"],
        {"a": "1", "b": "1"},
        {"u": "1/s"},
        {"k": "1/s", "c": "1/s"},
        {"a": "1", "b": "1"},
        name="two reactions",
    )
    prior = fp.GaussianPrior({"k": 1.0, "c": 0.5}, relative_std={"k": 0.1, "c": 0.1})
    bounds = {"a": (0.5, 2.0), "b": (0.5, 2.0), "u": (0.0, 1.0)}
    region = fp.RunRegion(bounds | {"dt": 0.2}, segments=25) if of_runs else fp.ExperimentRegion(bounds | {"dt": (0.1, 2.0)})
    return fp.DesignProblem(model, prior, region, noise=noise)


def rows(names: list[str], rigs: int, seed: int) -> Iterator[tuple[str, str, float, float, float, float]]:
    """Kind, design, ratio, its error, coverage, and CPU s of the design."""
    for name in names:
        for what in ("points", "runs"):
            given, begin = problem(KINDS[name], what == "runs"), process_time()
            designed = fp.exchange(given, 12, seed=seed) if what == "points" else fp.design_runs(given, 2, n_starts=4, seed=seed)
            took = process_time() - begin
            validation = fp.validate(given, designed, runs=rigs, seed=seed + 1).designs["design"]
            of = max(validation.parameters.values(), key=lambda figures: abs(figures.ratio.value - 1))
            yield name, what, of.ratio.value, of.ratio.error, of.coverage.value, took


def main() -> int:
    """Print the table; the exit code is 1 where a promise is not kept."""
    parser = argparse.ArgumentParser(prog="python -m bench.noise_promises", description=__doc__)
    parser.add_argument("--rigs", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kinds", nargs="+", choices=tuple(KINDS), default=list(KINDS))
    options = parser.parse_args()
    print("| noise | design | achieved / promised | intervals hold | CPU s of the design |", "|---|---|--:|--:|--:|", sep="\n")
    broken = 0
    for name, what, ratio, error, coverage, took in rows(options.kinds, options.rigs, options.seed):
        print(f"| {name} | {what} | {ratio:.3f} ± {error:.3f} | {100 * coverage:.1f} % | {took:.1f} |", flush=True)
        broken += abs(ratio - 1) > 0.05 + 2 * error
    return int(broken > 0)


if __name__ == "__main__":
    sys.exit(main())
