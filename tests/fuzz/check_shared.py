"""Standard errors where constants are uncertain, against the joint information of parameters and constants.

What is `uncertain` is one value of the whole plant: the information of (theta, c) is the sum of [J G]^T R_k^-1 [J G] over the
points or runs, plus 1/std^2 of c once. What `varies` is drawn anew in each of them: R_k = R + H P_z H^T.
"""

from __future__ import annotations

import inspect
from typing import Any

import numpy as np

import fisherpoint as fp
from checks import Bench
from figures import Finding
from reading import Floats

RATES, OUTPUTS = ("u*c - k*x", "k*x - z*w"), ("x + d", "w*c")
THETA = {"k": 1.0, "d": 0.5}
KNOWN = {"c": 1.0, "z": 0.5}
NOISE = np.array([0.01, 0.02])
TOLERANCE = 1e-5


def model_of(estimated: tuple[str, ...]) -> fp.SymbolicModel:
    every = THETA | KNOWN
    return fp.SymbolicModel(
        f=list(RATES),
        g=list(OUTPUTS),
        states={"x": ("1", 1.0), "w": ("1", 1.0)},
        inputs={"u": "1"},
        outputs={"y": "1", "v": "1"},
        parameters=dict.fromkeys(estimated, "1"),
        constants={name: (value, "1") for name, value in every.items() if name not in estimated},
    )


def check_shared(bench: Bench) -> None:
    """Points and runs of one model, of which each constant is known, uncertain, or varies."""
    if "varies" not in inspect.signature(fp.DesignProblem).parameters:
        bench.figures.count("shared: skipped, as constants are of one kind")
        return
    rng = np.random.default_rng(bench.case.seed)
    kinds = {name: str(rng.choice(["known", "uncertain", "varies"])) for name in KNOWN}
    std = {name: float(rng.choice([0.01, 0.1, 0.3])) for name in KNOWN}
    chosen = {kind: {name: std[name] for name in KNOWN if kinds[name] == kind} for kind in ("uncertain", "varies")}
    count, segments = int(rng.integers(2, 9)), int(rng.integers(1, 4))
    x0, u = rng.choice([0.0, 0.5, 1.0], (count, 2)), rng.choice([0.0, 1.0, 2.0], (count, segments, 1))
    dt = rng.choice([0.1, 0.5, 1.0], (count, segments))
    of_points = segments == 1 and bool(rng.integers(2))
    design: Any = fp.Experiments(x0, u[:, 0], dt[:, 0]) if of_points else fp.Runs(x0, u, dt)
    expected = brute_force(fp.Runs(x0, u, dt), chosen)
    prior = fp.GaussianPrior(THETA, relative_std=dict.fromkeys(THETA, 0.3))
    noise = dict(zip("yv", NOISE.tolist(), strict=True))
    more: dict[str, Any] = {kind: of or None for kind, of in chosen.items()}
    problem = fp.DesignProblem(model_of(tuple(THETA)), prior, None, noise=noise, output_covariance="noise", **more)
    if expected is None:
        bench.figures.count("shared: singular")
        return
    given = fp.evaluate(problem, design, threads=1).covariance
    bench.figures.count("shared: designs compared")
    size = np.sqrt(np.diag(expected))
    error = float(np.max(np.abs(given - expected) / np.outer(size, size)))
    bench.figures.ratio("shared: covariances", error / TOLERANCE)
    if not error <= TOLERANCE:
        code = f"# f = {RATES}, g = {OUTPUTS}, {chosen}\n# {design!r}: {x0.tolist()}, {u.tolist()}, {dt.tolist()}"
        code += f"\n# expected {expected.tolist()}, given {given.tolist()}"
        bench.findings.append(Finding("wrong ok: shared constants", error / TOLERANCE, code))


def brute_force(runs: fp.Runs, chosen: dict[str, dict[str, float]]) -> Floats | None:
    """The covariance of theta from the joint information; None where that is next to singular."""
    shared, anew = list(chosen["uncertain"].items()), list(chosen["varies"].items())
    every = [*THETA, *(name for name, _ in shared + anew)]
    values = [(THETA | KNOWN)[name] for name in every]
    slopes = fp.sensitivities(model_of(tuple(every)), runs, values, rtol=1e-10, threads=1)
    kept = len(THETA) + len(shared)
    information = np.diag([0.0] * len(THETA) + [1 / std**2 for _, std in shared])
    for dy in slopes.dy_dtheta:
        rows = dy.reshape(-1, len(every))
        noise = np.diag(np.tile(NOISE**2, len(rows) // 2)) + rows[:, kept:] * [std**2 for _, std in anew] @ rows[:, kept:].T
        information = information + rows[:, :kept].T @ np.linalg.solve(noise, rows[:, :kept])
    scale = np.sqrt(np.diag(information))
    if not scale.all() or np.linalg.cond(information / np.outer(scale, scale)) > 1e8:
        return None
    return np.asarray(np.linalg.inv(information)[: len(THETA), : len(THETA)])
