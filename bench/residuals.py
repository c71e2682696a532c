"""``python -m bench.residuals``: whether fits hear of noise with a memory, and how good robust standard errors are.

Noise with correlations of 0 to 0.99 from sample to sample is added to a record and to runs of four models, each at least 50
correlation times long, and the parameters are estimated as if it were white. The table has the share of 95 % intervals that hold,
by standard errors and by robust ones, and the share of fits that warn. It must be at most 5 % at white noise, and at least 95 %
where less than 80 % of the intervals hold; the exit code is 1 where it is not.

With ``--found`` the noise is looked for, by ``noise="estimated"``: the table has the share of 95 % intervals that hold, and how
often the form of the noise was found. The share must be 93 to 97 % but for chance, by three standard deviations.
"""

from __future__ import annotations

import argparse
import sys
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

import fisherpoint as fp
from fisherpoint.basics.values import Array
from fisherpoint.design.file.configuration import load_config

CORRELATIONS = (0.0, 0.5, 0.9, 0.95, 0.99)
LONG, SHORTEST = 50, 200
"""Least length of data in correlation times, and in samples."""

RUNS = 25
"""Runs that share the samples."""

EXAMPLES = Path(__file__).parents[1] / "examples"


class Case(NamedTuple):
    """A model with what is estimated, the noise, and simulated outputs (n,) of n samples under inputs (n,)."""

    model: fp.Model
    theta: dict[str, float]
    estimated: tuple[str, ...]
    std: float
    x0: dict[str, float]
    step: float
    inputs: Callable[[int], Array]


class Line(NamedTuple):
    """A line of the table: shares of intervals that hold, by standard errors and robust ones, and of fits that warn."""

    samples: int
    held: float
    robust: float
    warned: float


class FoundLine(NamedTuple):
    """A line of the table of found noise: shares of intervals that hold, and of fits that found the form of the noise."""

    samples: int
    held: float
    found: float
    allowed: float


def switched(low: float, high: float, every: int) -> Callable[[int], Array]:
    """An input that switches between two levels; each comes for another time."""
    return lambda n: np.asarray(
        np.where((np.arange(n) // every + np.arange(n) // (3 * every + 1)) % 2, high, low), dtype=np.float64
    )


def cases() -> dict[str, Case]:
    """The models."""
    tanks = load_config(EXAMPLES / "cascaded_tanks.toml").build_model()
    joint = fp.SymbolicModel(
        ["w", "(u - b*w - F*sign(w))/J"],
        ["w"],
        {"q": "rad", "w": "rad/s"},
        {"u": "N m"},
        {"J": "kg m2", "b": "N m s/rad", "F": "N m"},
        {"w": "rad/s"},
        name="joint with sharp friction",
    )
    reactor = fp.SymbolicModel(
        ["(u - c)/tau - k*c"], ["c"], {"c": "mol/m3"}, {"u": "mol/m3"}, {"k": "1/s", "tau": "s"}, {"c": "mol/m3"}, name="reactor"
    )
    line = fp.SymbolicModel([], ["p + q*s"], {}, {"s": "1"}, {"p": "1", "q": "1"}, {"y": "1"}, name="line")
    return {
        "tanks": Case(tanks, dict(tanks.nominal), ("k1", "k3", "k4"), 0.05, {"h1": 5.0, "h2": 4.0}, 4.0, switched(1.0, 3.0, 15)),
        "joint": Case(
            joint, {"J": 1.0, "b": 2.0, "F": 3.0}, ("J", "b", "F"), 0.05, {"q": 0.0, "w": 0.0}, 0.05, switched(-8.0, 10.0, 12)
        ),
        "reactor": Case(reactor, {"k": 0.1, "tau": 5.0}, ("k", "tau"), 0.02, {"c": 0.2}, 0.5, switched(0.5, 2.0, 20)),
        "line": Case(line, {"p": 1.0, "q": 2.0}, ("p", "q"), 0.1, {}, 1.0, lambda n: np.linspace(-1, 1, n)),
    }


def noise(rng: np.random.Generator, count: int, length: int, correlation: float) -> Array:
    """Gauss-Markov noise (count, length) of unit variance."""
    fresh = rng.standard_normal((count, length))
    for k in range(1, length):
        fresh[:, k] = correlation * fresh[:, k - 1] + np.sqrt(1 - correlation**2) * fresh[:, k]
    return fresh


def data_of(case: Case, kind: str, n: int) -> Callable[[Array], fp.Record | fp.Measurements]:
    """Data with given noise: a record, or runs of as many samples in all, each with another beginning of the inputs."""
    if kind == "record":
        t, u = np.asarray(case.step * np.arange(n)), case.inputs(n)
        y = fp.simulate_record(case.model, t, u, case.theta, case.x0).y
        return lambda v: fp.Record(t, u, y + case.std * v.reshape(-1, 1), x0=case.x0)
    length = n // RUNS
    levels = case.inputs(n + 7 * RUNS)
    u = np.stack([levels[k * (length + 7) : k * (length + 7) + length] for k in range(RUNS)])
    runs = fp.Runs([list(case.x0.values())] * RUNS, u, case.step)
    outputs = fp.simulate(case.model, runs, case.theta).y
    return lambda v: fp.Measurements(runs, outputs + case.std * v.reshape(RUNS, length, 1))


def line_of(case: Case, kind: str, correlation: float, fits: int, seed: int) -> Line:
    """Estimate from the same data with new noise each time."""
    n = samples_of(correlation)
    rng, truth = np.random.default_rng(seed), np.array([case.theta[name] for name in case.estimated])
    make, count = data_of(case, kind, n), 1 if kind == "record" else RUNS
    off, errors, robust, warned = [], [], [], 0
    for _ in range(fits):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            data = make(noise(rng, count, n // count, correlation))
            fit = fp.estimate(case.model, data, start=case.theta, parameters=case.estimated)
        warned += any("expected white noise" in str(one.message) for one in caught)
        off.append(np.array([fit.estimate[name] for name in case.estimated]) - truth)
        errors.append([fit.standard_errors[name] for name in case.estimated])
        robust.append([fit.robust_standard_errors[name] for name in case.estimated])
    held, by_robust = (float(np.mean(np.abs(off) < 1.96 * np.array(std))) for std in (errors, robust))
    return Line(n, held, by_robust, warned / fits)


def samples_of(correlation: float) -> int:
    """Samples of a record, or of all runs."""
    n = max(SHORTEST, int(np.ceil(-LONG / np.log(correlation))) if correlation else SHORTEST)
    return RUNS * -(-n // RUNS)


def found_line_of(case: Case, kind: str, correlation: float, fits: int, seed: int) -> FoundLine:
    """Look for the noise of the same data with new noise each time."""
    n, rng = samples_of(correlation), np.random.default_rng(seed)
    make, count = data_of(case, kind, n), 1 if kind == "record" else RUNS
    held, found = [], 0
    for _ in range(fits):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            data = make(noise(rng, count, n // count, correlation))
            fit = fp.estimate(case.model, data, start=case.theta, parameters=case.estimated, noise="estimated")
        intervals = fit.intervals()
        held.append([intervals[name][0] <= case.theta[name] <= intervals[name][1] for name in case.estimated])
        estimates = (fit.noise_estimate or {}).values()
        found += all(one.form == ("memory" if correlation else "white") for one in estimates)
    # The intervals of one fit are not independent of each other: the spread of its own share counts.
    chance = 3 * float(np.std(np.mean(held, axis=1))) / np.sqrt(fits)
    return FoundLine(n, float(np.mean(held)), found / fits, chance)


def table(names: list[str], fits: int, seed: int) -> Iterator[tuple[str, str, float, Line]]:
    """The lines of all models, kinds of data and correlations."""
    for name in names:
        for kind in ("record", "runs"):
            for correlation in CORRELATIONS:
                yield name, kind, correlation, line_of(cases()[name], kind, correlation, fits, seed)


def main() -> int:
    """Print the table; the exit code is 1 where it shows what must not be."""
    parser = argparse.ArgumentParser(prog="python -m bench.residuals", description=__doc__)
    parser.add_argument("--fits", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--models", nargs="+", choices=tuple(cases()), default=list(cases()))
    parser.add_argument("--found", action="store_true")
    options = parser.parse_args()
    return found_table(options.models, options.fits, options.seed) if options.found else white_table(options)


def white_table(options: argparse.Namespace) -> int:
    wrong = 0
    heads = ("model", "data", "correlation", "samples", "intervals hold", "by robust errors", "fits that warn")
    print(f"| {' | '.join(heads)} |", "|---|---|" + "--:|" * 5, sep="\n")
    for name, kind, correlation, line in table(options.models, options.fits, options.seed):
        shares = " | ".join(f"{100 * share:.0f} %" for share in line[1:])
        print(f"| {name} | {kind} | {correlation:g} | {line.samples} | {shares} |", flush=True)
        wrong += line.warned > 0.05 if correlation == 0 else line.held < 0.8 and line.warned < 0.95
    return int(wrong > 0)


def found_table(names: list[str], fits: int, seed: int) -> int:
    wrong = 0
    print("| model | data | correlation | samples | intervals hold | form found |", "|---|---|--:|--:|--:|--:|", sep="\n")
    for name in names:
        for kind in ("record", "runs"):
            for correlation in CORRELATIONS:
                line = found_line_of(cases()[name], kind, correlation, fits, seed)
                shares = " | ".join(f"{100 * share:.1f} %" for share in (line.held, line.found))
                print(f"| {name} | {kind} | {correlation:g} | {line.samples} | {shares} |", flush=True)
                wrong += not 0.93 - line.allowed <= line.held <= 0.97 + line.allowed
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
