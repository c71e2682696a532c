"""Exact answers at nice numbers: thresholds met at ends of segments, equal rates, pauses, amounts that are used up.

A case draws its models, start and segments from grids of multiples of 0.1, where random numbers never are. All states have closed
forms. A status other than ok is counted: what is on a switch to the last digit may have no derivative. What is ok is right.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

import fisherpoint as fp
from checks import OK, Bench
from figures import Finding
from reading import Floats

RTOL = 1e-6
ALLOWED = 100.0  # times rtol, as in checks.py
DRAWS = 4  # of a case
ZEROS = ("0", "0.0")


@dataclass(frozen=True)
class Exact:
    """A model with one input u >= 0, by which all its rates are multiplied, and its states by tau, the integral of u."""

    arguments: dict[str, Any]
    x0: list[float]
    theta: list[float]
    switches: list[float]  # values of tau at which it has no derivative
    room: float = 0.0  # how far the closed form is off the model

    def state(self, tau: float, theta: Floats) -> Floats:
        raise NotImplementedError


class Depot(Exact):
    """a falls by k, and below e by m; b takes up what a has lost."""

    def state(self, tau: float, theta: Floats) -> Floats:
        k, m = theta
        start, edge = self.x0[0], float(self.arguments["constants"]["e"][0])
        until = max(start - edge, 0.0) / k
        fallen = k * min(tau, until) + m * max(tau - until, 0.0)
        return np.array([start - fallen, self.x0[1] + fallen])


class Emptied(Exact):
    """a falls by k until it is used up, and rests there; b takes it up."""

    def state(self, tau: float, theta: Floats) -> Floats:
        fallen = min(theta[0] * tau, self.x0[0])
        return np.array([self.x0[0] - fallen, self.x0[1] + theta[1] * fallen])


class Pulse(Exact):
    """a is a clock; b rises by r from e on, which is a parameter or a constant."""

    def state(self, tau: float, theta: Floats) -> Floats:
        edge = theta[1] if len(theta) > 1 else float(self.arguments["constants"]["e"][0])
        return np.array([self.x0[0] + tau, theta[0] * max(self.x0[0] + tau - max(edge, self.x0[0]), 0.0)])


class Reagents(Exact):
    """a is used up by what is fed, F; two of them where there are two feeds. The rate is k, of up to 1e10."""

    def state(self, tau: float, theta: Floats) -> Floats:
        pairs = []
        for n, feed in enumerate(theta[1:]):
            left = self.x0[2 * n] - feed * tau
            pairs += [max(left, 0.0), max(-left, 0.0)]
        return np.array(pairs)


def nice(rng: np.random.Generator, *numbers: float) -> float:
    return float(rng.choice(numbers or (0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0)))


def drawn(rng: np.random.Generator) -> Exact:
    """A model of one of the kinds above; a constant is an integer or a float."""
    kind, zero = rng.integers(4), str(rng.choice(ZEROS))
    one = {"inputs": {"u": "1"}, "states": {"a": ("1", 1.0), "b": ("1", 1.0)}, "g": ["a", "b"]}
    if kind == 0:
        k, m, start, edge = nice(rng), nice(rng), nice(rng, 1.0, 1.2, 2.0), nice(rng, 0.0, 0.5, 0.7, 1.0, -0.3)
        fall = f"where(a > e, k, {'m' if rng.integers(2) else 'm + ' + zero})"
        rates = [f"-u*{fall}", f"u*{fall}"]
        more = {"f": rates, "parameters": {"k": "1", "m": "1"}, "constants": {"e": (edge, "1")}}
        return Depot(one | more, [start, 0.0], [k, m], [(start - edge) / k])
    if kind == 1:
        k, share, start = nice(rng), nice(rng), nice(rng)
        fall = (f"where(a > {zero}, k, {zero})", f"k*heaviside(a - {zero})")[rng.integers(2)]
        rates = [f"-u*{fall}", f"u*s*{fall}"]
        more = {"f": rates, "parameters": {"k": "1", "s": "1"}}
        return Emptied(one | more, [start, 0.0], [k, share], [start / k])
    if kind == 2:
        r, edge, start = nice(rng), nice(rng), nice(rng, 0.0, 0.1, 0.5)
        rise = (f"where(a > e, r, {zero})", "r*heaviside(a - e)", f"where(a <= e, {zero}, r)")[rng.integers(3)]
        more = {"f": ["u", f"u*{rise}"], "parameters": {"r": "1", "e": "1"}}
        theta = [r, edge]
        if rng.integers(2):
            more, theta = more | {"parameters": {"r": "1"}, "constants": {"e": (edge, "1")}}, [r]
        return Pulse(one | more, [start, 0.0], theta, [edge - start])
    count, power = int(rng.integers(1, 3)), float(rng.integers(5, 11))
    feeds = [nice(rng) for _ in range(count)]
    names, rates, start = [], [], []
    for n in range(count):
        a, b = f"a{n}", f"b{n}"
        names += [a, b]
        rates += [f"-u*k*{a}*{b}", f"u*(f{n} - k*{a}*{b})"]
        start += [nice(rng), 0.0]
    more = {
        "states": dict.fromkeys(names, ("1", 1.0)),
        "g": names,
        "f": rates,
        "parameters": dict.fromkeys(["k", *(f"f{n}" for n in range(count))], "1"),
    }
    switches = [start[2 * n] / feeds[n] for n in range(count)]
    return Reagents(one | more, start, [10.0**power, *feeds], switches, 3 * 10 ** (-power / 2))


def segments(rng: np.random.Generator, exact: Exact) -> tuple[Floats, Floats]:
    """Inputs and durations of some segments, of which one often ends on a switch."""
    count = int(rng.integers(1, 5))
    u = rng.choice([0.0, 0.5, 1.0, 1.0, 2.0], count)
    dt = rng.choice([0.1, 0.2, 0.3, 0.5, 1.0, 2.0], count)
    at, n = float(rng.choice(exact.switches)), int(rng.integers(count))
    before = float(u[:n] @ dt[:n])
    if rng.integers(2) and u[n] and at > before:
        dt[n] = (at - before) / u[n]
    return u, dt


def check_nice(bench: Bench) -> None:
    """Runs, their points and records of some models with closed forms."""
    rng = np.random.default_rng(bench.case.seed)
    for _ in range(DRAWS):
        exact = drawn(rng)
        compare(bench, exact, *segments(rng, exact))


def compare(bench: Bench, exact: Exact, u: Floats, dt: Floats) -> None:
    model, theta = fp.SymbolicModel(**exact.arguments), np.array(exact.theta)
    tau = np.cumsum(u * dt)
    states = np.array([exact.state(at, theta) for at in tau])
    arguments = ", ".join(f"{name}={value!r}" for name, value in exact.arguments.items())
    head = f"import fisherpoint as fp\n\nmodel = fp.SymbolicModel({arguments})\n"

    def wrong(what: str, call: str, error: float, allowed: float, expected: Floats) -> None:
        bench.figures.count(f"nice: {what} compared")
        bench.figures.ratio(f"nice: {what}", error / allowed * ALLOWED)
        if not error <= allowed and all(finding.kind != f"wrong ok: nice {what}" for finding in bench.findings):
            code = f"{head}{call}\n# expected {expected.tolist()}"
            bench.findings.append(Finding(f"wrong ok: nice {what}", error / allowed, code))

    def admitted(what: str, call: Callable[[], Any]) -> Any:
        """What the call returns, of one trajectory that is ok; None otherwise."""
        try:
            done = call()
        except ValueError:
            bench.figures.count(f"nice: {what} refused")
            return None
        status = fp.Status(int(np.ravel(done.status)[0]))
        bench.figures.count(f"nice: {what} {status.name}")
        return done if status == OK else None

    allowed = ALLOWED * RTOL + exact.room
    measured = [bool(min(abs(at - s) for s in exact.switches) > 1e-9) for at in tau]  # on a switch there is no derivative
    measured[-1] |= not any(measured)
    rows = f"[{exact.x0}], [{u.tolist()}], [{dt.tolist()}], [{measured}]"
    runs = fp.Runs([exact.x0], [u.tolist()], [dt.tolist()], [measured])
    done = admitted("runs", lambda: fp.sensitivities(model, runs, theta, rtol=RTOL, threads=1))
    call = f"print(fp.sensitivities(model, fp.Runs({rows}), {exact.theta}))"
    if done is not None:
        wrong("runs", call, float(np.max(np.abs(done.x[0, 1:] - states))), allowed, states)
        slopes(exact, theta, tau[measured], done.dx_dtheta[0, measured], lambda *found: wrong("derivatives of runs", call, *found))
    t, held = np.concatenate([[0.0], np.cumsum(dt)]), np.concatenate([u, u[-1:]])[:, None]
    record = admitted("records", lambda: fp.simulate_record(model, t, held, theta, exact.x0, rtol=RTOL))
    if record is not None:
        call = f"print(fp.simulate_record(model, {t.tolist()}, {held.tolist()}, {exact.theta}, {exact.x0}).x)"
        wrong("records", call, float(np.max(np.abs(record.x[1:] - states))), allowed, states)
    if (u == u[0]).all():  # the same as one point
        point = fp.Experiments([exact.x0], [[u[0]]], [float(dt.sum())])
        one = admitted("points", lambda: fp.sensitivities(model, point, theta, rtol=RTOL, threads=1))
        if one is not None:
            call = f"print(fp.sensitivities(model, fp.Experiments([{exact.x0}], [[{u[0]}]], [{dt.sum()}]), {exact.theta}))"
            wrong("points", call, float(np.max(np.abs(one.x[0] - states[-1]))), allowed, states[-1])
            slopes(exact, theta, tau[-1:], one.dx_dtheta, lambda *found: wrong("derivatives of points", call, *found))


def slopes(exact: Exact, theta: Floats, tau: Floats, given: Floats, wrong: Any) -> None:
    """dx/dtheta (N, n_x, p) where both one-sided differences are the same: on a switch there is none, or one for each side."""
    for n, at in enumerate(tau.tolist()):
        for j in range(len(theta)):
            if isinstance(exact, Reagents) and (j == 0 or min(abs(at - s) for s in exact.switches) < 0.01):
                continue  # of the rate, and next to where it is what decides
            step = 1e-6 * theta[j] * (np.arange(len(theta)) == j)
            middle, up, down = (exact.state(at, theta + sign * step) for sign in (0, 1, -1))
            right, left = (up - middle) / step[j], (middle - down) / step[j]
            if np.max(np.abs(right - left)) > 1e-3:
                continue
            size = max(1.0, float(np.max(np.abs(right))))
            error = float(np.max(np.abs(given[n, :, j] - right)))
            wrong(error, 1e-4 * size + exact.room * 100 * size, right)
