"""Information beside local parameters, against that of all unknowns with a column for each group's value."""

from __future__ import annotations

import inspect
from collections.abc import Sequence
from typing import Any

import numpy as np

import fisherpoint as fp
from check_shared import KNOWN, NOISE, THETA, model_of
from checks import Bench
from figures import Finding
from fisherpoint.validation.fits import Estimator
from reading import Floats

TOLERANCE, PROMISED = 1e-5, 1e-4
EVERY = THETA | KNOWN


def check_local(bench: Bench) -> None:
    """Points and runs of one model, of which two parameters are local to a run or a plant; some data are of other plants."""
    if "local" not in inspect.signature(fp.DesignProblem).parameters:
        bench.figures.count("local: skipped, as all parameters are shared")
        return
    rng = np.random.default_rng(bench.case.seed)
    words = {name: str(rng.choice(["run", "plant"])) for name in KNOWN}
    spreads = {name: float(rng.choice([0.03, 0.3])) if rng.integers(2) else None for name in KNOWN}
    count, segments = int(rng.integers(2, 9)), int(rng.integers(2, 5))
    x0, u = rng.choice([0.0, 0.5, 1.0], (count, 2)), rng.choice([0.0, 1.0, 2.0], (count, segments, 1))
    dt = rng.choice([0.1, 0.5, 1.0], (count, segments))
    plants = np.sort(rng.integers(0, 3, count))
    plants[-1] = 3  # of the design
    for plant in np.flatnonzero(rng.integers(0, 4, 4) == 0):  # at rest, where nothing shows what is its own
        x0[plants == plant], u[plants == plant] = 0.0, 0.0
    runs = fp.Runs(x0, u, dt)
    groups = {name: np.arange(count) if word == "run" else plants for name, word in words.items()}
    expected = brute_force(runs, groups, spreads)
    if expected is None:
        bench.figures.count("local: singular")
        return
    prior = fp.GaussianPrior(EVERY, relative_std=dict.fromkeys(EVERY, 0.3))
    noise = dict(zip("yv", NOISE.tolist(), strict=True))
    local = {name: fp.Local(words[name], spread=spreads[name]) for name in KNOWN}
    problem = fp.DesignProblem(model_of(tuple(EVERY)), prior, None, noise=noise, output_covariance="noise", local=local)
    own, others = plants == 3, None
    if not own.all():
        unmeasured = np.zeros((*runs[~own].dt.shape, 2))
        others = fp.Measurements(runs[~own], unmeasured, labels={"plant": plants[~own].tolist()})
    given = fp.evaluate(problem, runs[own], previous=others, threads=1).information / np.outer(problem.std, problem.std)
    bench.figures.count("local: designs compared")
    size = np.sqrt(np.diag(expected))
    error = float(np.max(np.abs(given - expected) / np.outer(size, size)))
    bench.figures.ratio("local: information", error / TOLERANCE)
    if not error <= TOLERANCE:
        code = f"# {local}, plants {plants.tolist()}\n# {x0.tolist()}, {u.tolist()}, {runs.dt.tolist()}"
        code += f"\n# expected {expected.tolist()}, given {given.tolist()}"
        bench.findings.append(Finding("wrong ok: local parameters", error / TOLERANCE, code))
    check_promise(bench, problem, runs, plants, expected)


def check_promise(bench: Bench, problem: fp.DesignProblem, runs: fp.Runs, plants: Floats, information: Floats) -> None:
    """What a validation promises of the common parameters, where all data are of one design with labels."""
    scale = np.sqrt(np.diag(information))
    if not scale.all() or np.linalg.cond(information / np.outer(scale, scale)) > 1e6:
        bench.figures.count("local: open")
        return
    noise, labels = dict(zip("yv", NOISE.tolist(), strict=True)), {"plant": tuple(map(str, plants.tolist()))}
    promised = Estimator.of(problem, runs, noise, True, False, 1e-9, 1, labels=labels).promised_errors
    error = float(np.max(np.abs(promised / np.sqrt(np.diag(np.linalg.inv(information))) - 1)))
    bench.figures.count("local: promises compared")
    bench.figures.ratio("local: promise", error / PROMISED)
    if not error <= PROMISED:
        code = f"# {problem.local}, plants {plants.tolist()}\n# {runs.x0.tolist()}, {runs.u.tolist()}, {runs.dt.tolist()}"
        bench.findings.append(Finding("wrong ok: promise beside local parameters", error / PROMISED, code))


def brute_force(runs: fp.Runs, groups: dict[str, Floats], spreads: dict[str, float | None]) -> Floats | None:
    """F of theta as a Schur complement; None where values, or what is left of theta, are next to undetermined."""
    slopes: Any = fp.sensitivities(model_of(tuple(EVERY)), runs, list(EVERY.values()), rtol=1e-10, threads=1)
    white = slopes.dy_dtheta / NOISE[:, None]
    blocks: Sequence[Any] = [white[..., : len(THETA)].reshape(-1, len(THETA))]
    known: list[float] = [0.0] * len(THETA)
    for j, (name, of) in enumerate(groups.items()):
        for group in np.unique(of):
            own = np.where((of == group)[:, None, None], white[..., len(THETA) + j], 0.0)
            if not own.any():
                continue  # no sample notices this value, and not to know it costs nothing
            blocks = [*blocks, own.reshape(-1, 1)]
            spread = spreads[name]
            known.append(0.0 if spread is None else 1 / spread**2)
    rows = np.concatenate(blocks, axis=1)
    information = rows.T @ rows + np.diag(known)
    scale = np.sqrt(np.diag(information))
    if not scale.all() or np.linalg.cond(information / np.outer(scale, scale)) > 1e6:
        return None
    n = len(THETA)
    return np.asarray(information[:n, :n] - information[:n, n:] @ np.linalg.solve(information[n:, n:], information[n:, :n]))
