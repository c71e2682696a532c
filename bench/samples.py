"""``python -m bench.samples``: what many samples of a run cost, next to one for each held input.

50 held inputs of 20 ms on a smooth joint and one with sharp friction: CPU time over that of a sample for each input, and the
largest difference from the same run at the tightest tolerance, of y, and of dy/dtheta as a share of the largest.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

import fisherpoint as fp
from fisherpoint.basics.values import Array

from .timing import best_times

HELD, DT, RUNS = 50, 0.02, 32
SAMPLES = (1, 2, 5, 20, 100)
FRICTION = {"smooth": "F*tanh(w/0.1)", "sharp": "F*sign(w)"}


class Line(NamedTuple):
    """Samples for each input, CPU time over that of one, of states and with sensitivities, and errors of y and dy/dtheta."""

    samples: int
    states: float
    sensitivities: float
    error: float
    slope_error: float


def joint(friction: str) -> fp.SymbolicModel:
    """A joint with gravity."""
    return fp.SymbolicModel(
        ["w", f"(u - b*w - {friction} - G*sin(q))/J"],
        ["q", "w"],
        {"q": "rad", "w": "rad/s"},
        {"u": "N m"},
        {"J": "kg m2", "b": "N m s/rad", "F": "N m", "G": "N m"},
        {"q": "rad", "w": "rad/s"},
        nominal={"J": 0.05, "b": 0.1, "F": 0.3, "G": 0.6},
        check_units=False,
    )


def lines(friction: str, rounds: int) -> list[Line]:
    """The lines of a joint."""
    model = joint(friction)
    theta, rng = np.array(list(model.nominal.values())), np.random.default_rng(0)
    u = rng.uniform(-2, 2, (RUNS, HELD, 1))

    def runs(samples: int) -> fp.Runs:
        return fp.Runs(np.zeros((RUNS, 2)), np.repeat(u, samples, axis=1), DT / samples)

    tasks: dict[str, Callable[[], object]] = {}
    for n in SAMPLES:
        tasks[f"x{n}"] = partial(fp.simulate, model, runs(n), theta, threads=1)
        tasks[f"S{n}"] = partial(fp.sensitivities, model, runs(n), theta, threads=1)
    found = best_times(tasks, rounds)
    times = {name: timing.seconds * timing.cores for name, timing in found.items()}
    result = []
    for n in SAMPLES:
        y, tight = fp.simulate(model, runs(n), theta).y, fp.sensitivities(model, runs(n), theta, rtol=1e-12)
        slopes: Array = np.abs(fp.sensitivities(model, runs(n), theta).dy_dtheta - tight.dy_dtheta)
        share = float((slopes.max(axis=(0, 1)) / np.abs(tight.dy_dtheta).max(axis=(0, 1))).max())
        result.append(Line(n, times[f"x{n}"] / times["x1"], times[f"S{n}"] / times["S1"], float(np.abs(y - tight.y).max()), share))
    return result


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m bench.samples", description=__doc__)
    parser.add_argument("--rounds", type=int, default=5)
    rounds = parser.parse_args().rounds
    heads = ("friction", "samples for each input", "states", "with sensitivities", "error of y", "of dy/dtheta")
    print(f"| {' | '.join(heads)} |", "|---|" + "--:|" * 5, sep="\n")
    for name, friction in FRICTION.items():
        for line in lines(friction, rounds):
            print(
                f"| {name} | {line.samples} | {line.states:.2f} | {line.sensitivities:.2f} | {line.error:.0e} |"
                f" {line.slope_error:.0e} |"
            )


if __name__ == "__main__":
    main()
