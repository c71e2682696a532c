"""Kinds of everyday equations as parts of random models (kinds.py), against the integration mode by mode (automaton.py).

Points, runs, records and covariances over the nodes of a prior. Half of the cases are on a grid of tenths, where starts, thresholds
and ends of segments fall together. A status other than ok is counted; what is ok is right: to 100 times the tolerance, times what
deviations of the start grow to, unless another event is within what the tolerance can tell.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

import fisherpoint as fp
from automaton import OTHER_STEPS, STEPS, NoAnswer, PilesUp, Slopes, slopes
from checks import ALLOWED, OK, Bench
from figures import Finding
from kinds import KINDS
from random_kinds import Drawn, drawn
from reading import Floats

POINTS = 3
TOLERANCES = (1e-4, 1e-6, 1e-6, 1e-9)
METHODS = (None, None, "RK45", "DOP853")
CLOSER = (0.1, 0.01)  # shares of the tolerance, at which a chance is gone
SPREAD = 0.02  # relative standard deviations of a prior
LOST = (NoAnswer, PilesUp, ValueError, OverflowError)


@dataclass
class Trial:
    """One kind with the numbers of one trajectory, in natural units, and how it is integrated."""

    bench: Bench
    one: Drawn
    model: fp.SymbolicModel
    x0: Floats
    u: Floats  # (N, n_u)
    dt: Floats  # (N,)
    theta: Floats
    rtol: float
    method: str | None

    # --- mode by mode ---------------------------------------------------------------------------------------------------------

    def ends(self, theta: Floats, x0: Floats | None = None, longer: float = 0.0) -> tuple[Floats, list[Any]]:
        """x and y (N, n) at the ends of the segments, and what was met."""
        x, mode, rows, met = self.x0 if x0 is None else x0, "", [], []
        outputs = self.one.automaton.function(self.one.outputs)
        for u, dt in zip(self.u, self.dt + longer, strict=True):
            done = self.one.automaton.course(x.tolist(), u.tolist(), theta.tolist(), dt, mode if self.one.kind.memory else "")
            x, mode = done.x, done.mode
            rows.append([*x, *outputs(x.tolist(), u.tolist(), theta.tolist())])
            met.append((done.mode, done.events))
        return np.array(rows), met

    def slopes(self, steps: tuple[float, float] = STEPS) -> Slopes | None:
        shape = (len(self.dt), -1, len(self.theta))
        try:
            found = slopes(lambda theta: self.ends(theta)[0].ravel(), self.theta, steps)
        except LOST:
            return None
        return Slopes(found.value.reshape(shape), found.error.reshape(shape), found.bent.reshape(shape))

    def growth(self, expected: Floats, met: list[Any]) -> float:
        """What a deviation of the start or of the time by the tolerance becomes; infinite where other events are met."""
        largest, step = 1.0, self.rtol
        n = len(self.x0)
        for move in (*np.diag(np.full(n, step)), *np.diag(np.full(n, -step)), 0.0, math.nan):
            for longer in (ALLOWED * step, -ALLOWED * step) if np.isnan(move).any() else (0.0,):
                try:
                    rows, other = self.ends(self.theta, self.x0 + np.nan_to_num(move), longer)
                except LOST:
                    return math.inf
                if other != met:
                    return math.inf
                if not longer:
                    largest = max(largest, float(np.max(np.abs(rows - expected))) / step)
        return largest

    # --- the package ----------------------------------------------------------------------------------------------------------

    def points(self, theta: Floats | None = None) -> fp.Experiments:
        return self.one.experiments(self.x0, self.u[:1], self.dt[:1])

    def runs(self) -> fp.Runs:
        one, x0 = self.one, self.x0 * self.one.size(self.one.states)
        u = self.u * one.size(one.inputs)
        return fp.Runs(
            [x0.tolist()], [u.tolist()], [(self.dt * one.time).tolist()], np.ones((1, len(self.dt)), dtype=bool).tolist()
        )

    @property
    def given_theta(self) -> Floats:
        return self.theta * self.one.size(self.one.parameters)

    def natural(self, x: Floats, y: Floats) -> Floats:
        """x (N, n_x) and y (N, n_y) as rows in natural units: outputs of kinds are of the order of one."""
        return np.hstack([x / self.one.size(self.one.states), y])

    def natural_slopes(self, dx: Floats, dy: Floats) -> Floats:
        dx = dx / self.one.size(self.one.states)[:, None]
        return np.concatenate([dx, dy], axis=1) * self.one.size(self.one.parameters)

    def call(self, name: str, what: str) -> str:
        method = f", method={self.method!r}" if self.method else ""
        return f"done = fp.{name}(model, {what}, {self.given_theta.tolist()}, rtol={self.rtol:g}{method})"

    def report(self, sort: str, ratio: float, call: str, remark: str) -> None:
        kind = f"wrong ok: {sort} of {self.one.name}"
        if all(finding.kind != kind for finding in self.bench.findings):
            code = self.one.code(f"{call}\nprint(done)\n# {remark}")
            self.bench.findings.append(Finding(kind, ratio, code))


def check_kinds(bench: Bench) -> None:
    rng = np.random.default_rng(bench.case.seed)
    name = list(KINDS)[bench.case.seed % len(KINDS)]
    one = drawn(name, rng, scaled=bool(rng.integers(2)))
    model, nice = one.model(), bool(rng.integers(2))
    for k in range(POINTS):
        x0, u, dt, theta = one.numbers(rng, nice)
        rtol, method = float(rng.choice(TOLERANCES)), METHODS[rng.integers(len(METHODS))]
        trial = Trial(bench, one, model, x0, u[None], np.array([dt]), theta, rtol, method)
        check_point(trial)
        count = int(rng.integers(2, 5))
        held = np.tile(u, (count, 1)) * (rng.choice([1.0, 1.0, 0.5, -1.0], (count, 1)) if rng.integers(2) else 1.0)
        parts = rng.choice([0.1, 0.2, 0.3, 0.5, 1.0], count) * (1.0 if nice else rng.uniform(0.9, 1.1))
        run = Trial(bench, one, model, x0, held, parts, theta, rtol, None)
        check_run(run)
        if k == 0:
            check_nodes(trial, rng)


# --- points, runs and records -------------------------------------------------------------------------------------------------


def admitted(trial: Trial, sort: str, call: Any) -> Any:
    figures = trial.bench.figures
    try:
        done = call()
    except ValueError:
        figures.count(f"kinds: {sort} refused")
        return None
    status = fp.Status(int(np.ravel(done.status)[0]))
    figures.count(f"kinds: {sort} {status.name}")
    if status != OK:
        figures.count(f"kinds: {trial.one.name}, {sort} {status.name}")
    return done if status == OK else None


def check_point(trial: Trial) -> None:
    points, theta = trial.points(), trial.given_theta
    what = f"fp.Experiments({points.x0.tolist()}, {points.u.tolist()}, {points.dt.tolist()})"
    options = {"rtol": trial.rtol, "threads": 1, "method": trial.method}
    done = admitted(trial, "points", lambda: fp.simulate(trial.model, points, theta, **options))
    if done is not None:
        judge(trial, "states", trial.natural(done.x, done.y), trial.call("simulate", what))
    slope = admitted(trial, "sensitivities", lambda: fp.sensitivities(trial.model, points, theta, **options))
    if slope is not None:
        judge(trial, "states with sensitivities", trial.natural(slope.x, slope.y), trial.call("sensitivities", what))
        judge_slopes(
            trial, "sensitivities", trial.natural_slopes(slope.dx_dtheta, slope.dy_dtheta), trial.call("sensitivities", what)
        )


def check_run(trial: Trial) -> None:
    runs, theta = trial.runs(), trial.given_theta
    what = f"fp.Runs({runs.x0.tolist()}, {runs.u.tolist()}, {runs.dt.tolist()}, {runs.measured.tolist()})"
    done = admitted(trial, "runs", lambda: fp.sensitivities(trial.model, runs, theta, rtol=trial.rtol, threads=1))
    if done is not None:
        call = trial.call("sensitivities", what)
        judge(trial, "runs", trial.natural(done.x[0, 1:], done.y[0]), call)
        judge_slopes(trial, "sensitivities of runs", trial.natural_slopes(done.dx_dtheta[0], done.dy_dtheta[0]), call)
    t = np.concatenate([[0.0], np.cumsum(trial.dt)]) * trial.one.time
    held = np.concatenate([trial.u, trial.u[-1:]]) * trial.one.size(trial.one.inputs)
    x0 = runs.x0[0]
    record = admitted(trial, "records", lambda: fp.simulate_record(trial.model, t, held, theta, x0, rtol=trial.rtol))
    if record is not None:
        call = (
            f"done = fp.simulate_record(model, {t.tolist()}, {held.tolist()}, {theta.tolist()}, {x0.tolist()}, rtol={trial.rtol:g})"
        )
        judge(trial, "records", trial.natural(record.x[1:], record.y[1:]), call)


def judge(trial: Trial, sort: str, given: Floats, call: str) -> None:
    figures = trial.bench.figures
    try:
        expected, met = trial.ends(trial.theta)
    except PilesUp:
        trial.report(sort, math.inf, call, "events pile up")
        return
    except LOST as error:
        figures.count("kinds: without another answer")
        figures.count(f"kinds: {trial.one.name}, no answer: {error}")
        return
    figures.count(f"kinds: {sort} compared")
    error = float(np.max(np.abs(given - expected) / (1 + np.abs(expected))))
    if not error <= ALLOWED * trial.rtol:
        error /= trial.growth(expected, met)
        figures.count("kinds: too close to tell", error == 0)
    figures.ratio(f"kinds: {sort}", error / trial.rtol)
    if not error <= ALLOWED * trial.rtol:
        trial.report(sort, error / (ALLOWED * trial.rtol), call, f"x, y = {expected.tolist()}")


def judge_slopes(trial: Trial, sort: str, given: Floats, call: str) -> None:
    """(N, n_x + n_y, p) where there are differences, and one side alone."""
    figures, found = trial.bench.figures, trial.slopes()
    if found is None:
        figures.count("kinds: columns without differences")
        return
    column = np.maximum(np.max(np.abs(found.value), axis=(0, 1), keepdims=True), 1.0)
    column = np.maximum(column, np.abs(found.value))
    off = np.where(found.bent, 0.0, np.maximum(np.abs(given - found.value) - 2 * found.error, 0.0) / column)
    figures.count("kinds: columns compared", int((~found.bent).all(axis=(0, 1)).sum()))
    figures.count("kinds: columns with two sides", int(found.bent.any(axis=(0, 1)).sum()))
    error, allowed = float(off.max(initial=0.0)), ALLOWED * trial.rtol * (10 if trial.one.kind.beside_roots else 1)
    if not error <= allowed:
        expected, met = trial.ends(trial.theta)
        error /= trial.growth(expected, met)
    if not error <= allowed and not repeated(trial, found, column * allowed):
        figures.count("kinds: columns whose differences hang on their steps")
        return
    figures.ratio(f"kinds: {sort}", error / trial.rtol)
    if not error <= allowed:
        trial.report(sort, error / allowed, call, f"d(x, y)/dtheta in natural units: {found.value.tolist()}")


def repeated(trial: Trial, found: Slopes, room: Floats) -> bool:
    """Whether differences with other steps are the same: those of ends that are less exact than they should be are not."""
    again = trial.slopes(OTHER_STEPS)
    return again is not None and bool((np.abs(again.value - found.value) <= 2 * found.error + room)[~found.bent].all())


# --- covariances over the nodes -------------------------------------------------------------------------------------------------


def check_nodes(trial: Trial, rng: np.random.Generator) -> None:
    """The predictive covariance of one point: sums over the nodes."""
    one, figures, points = trial.one, trial.bench.figures, trial.points()
    rule: fp.Rule = (fp.Unscented(), fp.SparseGaussHermite(2))[rng.integers(2)]
    mean = dict(zip(one.parameters, trial.given_theta.tolist(), strict=True))
    sizes = dict(zip(one.parameters, one.size(one.parameters).tolist(), strict=True))
    prior = fp.GaussianPrior(mean, std={of: SPREAD * (abs(value) or sizes[of]) for of, value in mean.items()})
    rtol = min(trial.rtol, 1e-6)
    done = admitted(trial, "covariances", lambda: fp.predictive_covariance(trial.model, points, prior, rule, rtol=rtol, threads=1))
    if done is None:
        return
    nodes, weights = rule.nodes(prior)
    try:
        middle = trial.ends(trial.theta)[0]
        n = len(trial.x0)
        spread = []
        for node in nodes / one.size(one.parameters):
            rows, _ = trial.ends(node)
            if trial.growth(*trial.ends(node)) == math.inf:
                figures.count("kinds: covariances too close to tell")
                return
            spread.append(rows[0, n:] - middle[0, n:])
    except LOST:
        figures.count("kinds: covariances without another answer")
        return
    off = np.array(spread)
    expected = (off.T * weights) @ off / weights.sum()
    figures.count("kinds: covariances compared")
    size = np.abs(off).max(initial=0.0)
    error = float(np.max(np.abs(done.covariance[0] - expected)))
    allowed = ALLOWED * rtol * 10 * (size + rtol) * np.abs(weights).sum() / abs(weights.sum())
    figures.ratio("kinds: covariances", error / allowed * ALLOWED)
    if error > allowed:
        call = (
            f"prior = {prior!r}\ndone = fp.predictive_covariance(model, fp.Experiments({points.x0.tolist()}, {points.u.tolist()}, "
        )
        call += f"{points.dt.tolist()}), prior, fp.{rule!r}, rtol={rtol:g})"
        trial.report("covariances", error / allowed, call, f"covariance = {expected.tolist()}")
