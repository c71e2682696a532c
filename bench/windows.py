"""``python -m bench.windows``: a published experiment whose outputs are measured continuously in windows.

Lotka-Volterra with fishing (Corleone.jl, example lotka_oed): x' = x - a x y - 0.4 u x, y' = -y + b x y - 0.2 u y over [0, 12],
x(0) = 0.5, y(0) = 0.7, a = b = 1. u in [0, 1] is constant on intervals of 0.25. x and y are measured with unit noise intensity,
each for 4 time units at most: x on intervals of 0.5, y on intervals of 0.15, of each the whole or a share. Minimised is tr F^-1.

The information of every interval is integrated with the trajectory, as further states of the model. For a given u the best shares
are a convex problem, and their optimality is proven by what a linear bound leaves (Frank and Wolfe 1956). The u is found by
L-BFGS-B from many starts; its gradient is that at fixed shares (Danskin 1967), by differences: 48 further trajectories.
"""

from __future__ import annotations

import argparse
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize, minimize_scalar

import fisherpoint as fp
from fisherpoint.basics.values import Array

PUBLISHED = 0.03707509

GRID, STEPS = 0.05, 240
LEVELS, X_WINDOWS, Y_WINDOWS = 48, 24, 80
MOST = {"x": 4 / 0.5, "y": 4 / 0.15}
"""Windows of x and of y that may be measured."""

DIFFERENCE, LEAST_GAP, MOST_ROUNDS = 1e-6, 1e-12, 1000


class Plan(NamedTuple):
    """tr F^-1, the levels of u, shares of the windows of x and y, and by how much other shares may be better at most."""

    value: float
    u: Array
    shares: Array
    gap: float


def model() -> fp.SymbolicModel:
    """States, their derivatives by a and b, and the integrals of these derivatives' products for x and y."""
    tangents = {
        "xa": "(1 - a*y - 0.4*u)*xa - a*x*ya - x*y",
        "xb": "(1 - a*y - 0.4*u)*xb - a*x*yb",
        "ya": "b*y*xa + (-1 + b*x - 0.2*u)*ya",
        "yb": "b*y*xb + (-1 + b*x - 0.2*u)*yb + x*y",
    }
    integrals = {f"F_{i}{j}": f"{i}*{j}" for one in "xy" for i, j in ((one + "a",) * 2, (one + "a", one + "b"), (one + "b",) * 2)}
    states = {"x": "x - a*x*y - 0.4*u*x", "y": "-y + b*x*y - 0.2*u*y", **tangents, **integrals}
    return fp.SymbolicModel(
        list(states.values()),
        ["x"],
        states=dict.fromkeys(states, "1"),
        inputs={"u": "1"},
        outputs={"x_m": "1"},
        parameters={"a": "1", "b": "1"},
    )


def windows_of(equations: fp.SymbolicModel, u: Array) -> Array:
    """F_aa, F_ab and F_bb of every window (K, 24 + 80, 3), for levels u (K, 48)."""
    start = np.zeros((len(u), len(equations.states)))
    start[:, :2] = 0.5, 0.7
    runs = fp.Runs(start, np.repeat(u, STEPS // LEVELS, axis=1)[:, :, None], np.full((len(u), STEPS), GRID))
    done = fp.simulate(equations, runs, equations.theta(np.ones(2)), rtol=1e-9)
    assert not np.any(done.status)
    steps = np.diff(done.x[:, :, 6:], axis=1)
    of_x, of_y = (
        steps[:, :, 3 * k : 3 * k + 3].reshape(len(u), n, -1, 3).sum(axis=2) for k, n in enumerate((X_WINDOWS, Y_WINDOWS))
    )
    return np.concatenate([of_x, of_y], axis=1)


def trace_of_inverse(f: Array) -> Array:
    """tr F^-1 of F (..., 3)."""
    return np.asarray((f[..., 0] + f[..., 2]) / (f[..., 0] * f[..., 2] - f[..., 1] ** 2))


def best_shares(windows: Array) -> tuple[Array, float]:
    """Shares (104,) of the windows with the least tr F^-1, and by how much others may be better at most."""
    parts = ((slice(0, X_WINDOWS), MOST["x"]), (slice(X_WINDOWS, None), MOST["y"]))
    shares = np.concatenate([np.full(X_WINDOWS, MOST["x"] / X_WINDOWS), np.full(Y_WINDOWS, MOST["y"] / Y_WINDOWS)])
    gap = np.inf
    for _ in range(MOST_ROUNDS):
        aa, ab, bb = shares @ windows
        det, trace = aa * bb - ab * ab, aa + bb
        gradient = windows @ np.array([1 / det - trace * bb / det**2, 2 * trace * ab / det**2, 1 / det - trace * aa / det**2])
        there = np.zeros(len(shares))
        for part, most in parts:  # the linear bound is least where the windows with the steepest descent are measured whole
            order = np.argsort(gradient[part], kind="stable")
            there[part][order] = np.clip(most - np.arange(len(order)), 0.0, 1.0)
        gap = float(gradient @ (shares - there))
        if gap <= LEAST_GAP:
            break
        way = there - shares

        def along(share: float, shares: Array = shares, way: Array = way) -> float:
            return float(trace_of_inverse((shares + share * way) @ windows))

        found = minimize_scalar(along, bounds=(0.0, 1.0), method="bounded", options={"xatol": 1e-12})
        shares = there if along(1.0) <= found.fun else shares + found.x * way
    return shares, gap


def plan_from(equations: fp.SymbolicModel, start: Array) -> Plan:
    """The local minimum to which a start leads."""

    def objective(u: Array) -> tuple[float, Array]:
        tried = np.tile(u, (LEVELS + 1, 1))
        steps = np.where(u > 0.5, -DIFFERENCE, DIFFERENCE)
        tried[np.arange(1, LEVELS + 1), np.arange(LEVELS)] += steps
        windows = windows_of(equations, tried)
        shares, _ = best_shares(windows[0])
        values = trace_of_inverse(np.einsum("k,nkj->nj", shares, windows))
        return float(np.log(values[0])), (np.log(values[1:]) - np.log(values[0])) / steps

    found = minimize(objective, start, jac=True, method="L-BFGS-B", bounds=[(0.0, 1.0)] * LEVELS)
    shares, gap = best_shares(windows_of(equations, found.x[None])[0])
    return Plan(float(np.exp(found.fun)), found.x, shares, gap)


def random_levels(rng: np.random.Generator) -> Array:
    """Noise, steps or a few pulses."""
    kind = rng.integers(3)
    if kind == 0:
        return rng.random(LEVELS)
    if kind == 1:
        return np.repeat(rng.integers(0, 2, LEVELS // 3), 3).astype(float)
    edges = np.sort(rng.integers(0, LEVELS + 1, 2 * rng.integers(1, 5))).reshape(-1, 2)
    return np.asarray(sum((((np.arange(LEVELS) >= a) & (np.arange(LEVELS) < b)).astype(float) for a, b in edges)).clip(0, 1))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--starts", type=int, default=20)
    count = parser.parse_args().starts
    equations = model()
    plans = [plan_from(equations, random_levels(np.random.default_rng(seed))) for seed in range(count)]
    best = min(plans, key=lambda plan: plan.value)
    reached = sum(plan.value <= PUBLISHED for plan in plans)
    print(f"tr F^-1 {best.value:.10f}, published {PUBLISHED}; {reached} of {count} starts reach it")
    print(f"other windows are better by {best.gap:.1e} at most, for this u")
    print("u:", ", ".join(f"{value:.4f}" for value in best.u))
    for name, part, width in (("x", best.shares[:X_WINDOWS], 0.5), ("y", best.shares[X_WINDOWS:], 0.15)):
        told = ", ".join(f"{k * width:g} ({share:.3g})" for k, share in enumerate(part) if share > 0)
        print(f"windows of {name} that are measured, by their beginning (and share): {told}")
    return 0 if best.value <= PUBLISHED else 1


if __name__ == "__main__":
    raise SystemExit(main())
