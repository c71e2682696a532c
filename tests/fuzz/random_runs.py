"""Runs of random models: nice durations, inputs that stay or change, ends of segments on surfaces to the last digit, samples."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

import fisherpoint as fp
from checks import OK, ROUNDING, TIGHT, Bench
from reading import Floats, side_of
from room import undecided

RTOL = 1e-6
MOST_SEGMENTS = 5
LOOKS, HALVINGS = 33, 12  # at a segment, for an event in it


@dataclass
class Run:
    """One run of a bench, with its parameters."""

    bench: Bench
    runs: fp.Runs
    theta: Floats

    @property
    def sizes(self) -> Floats:
        return self.bench.case.sizes

    def simulate(self, rtol: float, jumps: str = "cross", theta: Floats | None = None) -> fp.Trajectories | None:
        """None where it is refused."""
        try:
            values = self.theta if theta is None else theta
            return fp.simulate(self.bench.model, self.runs, values, rtol=rtol, threads=1, jumps=jumps)
        except ValueError:
            return None

    def sensitivities(self, rtol: float) -> fp.Sensitivities:
        return fp.sensitivities(self.bench.model, self.runs, self.theta, rtol=rtol, threads=1)

    def error(self, given: Floats, expected: Floats) -> float:
        """The largest in units of the states' sizes, less what rounding may do."""
        error = np.abs(given - expected) - ROUNDING * np.maximum(np.abs(given), np.abs(expected))
        return float(np.max(error / self.sizes, initial=0.0))

    def call(self, what: str, rtol: float, jumps: str = "cross") -> str:
        of = self.runs
        rows = f"{of.x0.tolist()}, {of.u.tolist()}, {of.dt.tolist()}, {of.measured.tolist()}"
        return f"fp.{what}(model, fp.Runs({rows}), theta, rtol={rtol:g}, jumps={jumps!r})"

    def report(self, kind: str, ratio: float, call: str, remark: str) -> None:
        if all(finding.kind != kind for finding in self.bench.findings):
            self.bench.report(kind, ratio, 0, call, remark)
            finding = self.bench.findings[-1]
            code = f"{self.bench.case.code()}\ntheta = {self.theta.tolist()}\nprint({call})\n# {remark}"
            self.bench.findings[-1] = type(finding)(finding.kind, finding.ratio, code)


def drawn(bench: Bench, rng: np.random.Generator, k: int) -> Run | None:
    """A run from the start of point k; the ends of some of its segments are on surfaces."""
    case, count = bench.case, int(rng.integers(2, MOST_SEGMENTS + 1))
    unit = case.time * 10.0 ** np.floor(np.log10(case.duration[1] / count))
    dt = unit * rng.choice([0.1, 0.2, 0.3, 0.5, 1.0, 2.0, 3.0], count)
    x0 = bench.points.x0[k : k + 1]
    u = np.tile(bench.points.u[k], (1, count, 1))
    if rng.integers(3):
        levels = rng.choice([0.1, 0.5, 1.0, 1.2, 2.0], (1, count, len(case.inputs))) * case.input_sizes
        u = np.where(rng.random((1, count, 1)) < 0.6, levels, u)
    if rng.integers(2):
        x0 = np.maximum(np.round(x0 / case.sizes, 1), 0.1) * case.sizes
    theta = bench.theta[k] if rng.integers(2) else case.mean
    measured = np.ones((1, count), bool)
    one = Run(bench, fp.Runs(x0, u, dt[None], measured), theta)
    for n in range(count):
        if rng.integers(2):
            at = event(one, n)
            if at is not None:
                dt[n] = at
                for _ in range(int(rng.integers(3))):
                    dt[n] = np.nextafter(dt[n], rng.choice([0.0, np.inf]))
                bench.figures.count("runs: ends of segments on surfaces")
                # There may be no derivative of what is measured at the surface itself.
                measured[0, n] = n == count - 1 or not rng.integers(3)
                one = Run(bench, fp.Runs(x0, u, dt[None], measured), theta)
    if rng.integers(2):
        shares = np.unique(np.append(rng.choice([1e-6, 0.01, 0.1, 0.25, 1 / 3, 0.5, 0.7, 1 - 1e-6], 3), 1.0))
        one = Run(bench, one.runs.divided(shares), theta)
        flags = rng.random(one.runs.dt.shape) < 0.8
        flags[:, -1] = True  # as a point is compared with the last
        one.runs = one.runs.measuring(flags) if rng.integers(2) else one.runs
        bench.figures.count("runs: samples within segments")
    return one if one.simulate(RTOL) is not None else None


def event(one: Run, n: int) -> float | None:
    """How long segment n takes to the first of the model's surfaces that it meets, to the last digit; None without one."""
    reading, done = one.bench.reading, one.simulate(RTOL)
    if not reading.surfaces or done is None or done.reached[0] < n:
        return None
    start, u, p = done.x[0, n : n + 1], one.runs.u[0, n], one.theta.tolist()
    low, high = 0.0, float(one.runs.dt[0, n]) * 1.5
    for _ in range(HALVINGS):
        times = np.unique(np.linspace(low, high, LOOKS)[1:])
        points = fp.Experiments(start.repeat(len(times), 0), u[None].repeat(len(times), 0), times)
        try:
            ends = fp.simulate(one.bench.model, points, one.theta, rtol=RTOL, threads=1)
        except ValueError:
            return None
        good = ends.status == OK
        signs = [tuple(map(side_of, reading.heights(x, u.tolist(), p))) for x in ends.x[good].tolist()]
        changes = [j for j in range(1, len(signs)) if signs[j] != signs[j - 1]]
        if not changes:
            return None if low == 0.0 else high
        low, high = times[good][changes[0] - 1], times[good][changes[0]]
        if high <= np.nextafter(low, math.inf):
            break
    return float(high)


def undecided_on(one: Run, x: Floats) -> bool:
    """Whether rounding decides about a condition at the start or within a segment: one whose sides are the same.

    Ends of segments are not looked at: on a surface that is crossed there, rounding decides about the side, and about nothing else.
    """
    u, dt, unit = one.runs.u[0], one.runs.dt[0], one.sizes / one.bench.case.time
    seen = [(x[0], u[0])]
    for n in range(len(dt)):
        points = fp.Experiments(x[[n, n, n]], u[[n, n, n]], dt[n] * np.array([0.1, 0.4, 0.8]))
        try:
            seen += [(state, u[n]) for state in fp.simulate(one.bench.model, points, one.theta, threads=1).x]
        except ValueError:
            continue
    return any(undecided(one.bench.reading, state.tolist(), put.tolist(), one.theta.tolist(), unit) for state, put in seen)


def growth_of(one: Run, x: Floats, jumps: str) -> float:
    """What a deviation at the start of any segment has grown to at any later end; infinite where another surface is met then."""
    largest, u, dt = 1.0, one.runs.u, one.runs.dt
    moves = np.concatenate([np.zeros((1, len(one.sizes))), np.diag(one.sizes), -np.diag(one.sizes)])
    for n in range(len(x) - 1):
        rest = fp.Runs(x[n] + RTOL * moves, u[:, n:].repeat(len(moves), 0), dt[:, n:].repeat(len(moves), 0))
        done = Run(one.bench, rest, one.theta).simulate(TIGHT, jumps)
        if done is None or done.status.any():
            return math.inf
        largest = max(largest, one.error(done.x[1:], done.x[:1]) / RTOL)
    return largest
