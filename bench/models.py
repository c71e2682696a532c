"""The cylinder as the core compiles it, as an interpreted model written in Python, and as that model compiled: the same work."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass
from functools import partial
from typing import Any

import fisherpoint as fp

from .timing import best_times
from .workload import MODEL, PRIOR, RULE, candidates, random_pairs

FIRST_TRAJECTORY = """
from time import perf_counter
import fisherpoint as fp
begin = perf_counter()
@fp.model(states={"h1": "m", "h2": "m"}, inputs={"u": "V"}, outputs={"y": "m"},
          parameters={"k1": "m^0.5/s", "k2": "m^0.5/s", "k3": "m^0.5/s", "k4": "m/(s V)"})
def tanks(x, u, p):
    return [-p.k1 * fp.math.sqrt(x.h1) + p.k4 * u.u, p.k2 * fp.math.sqrt(x.h1) - p.k3 * fp.math.sqrt(x.h2)], [x.h2]
fp.simulate(tanks, fp.Experiments([[0.1, 0.05]], [1.0], [3.0]), {"k1": 0.05, "k2": 0.05, "k3": 0.05, "k4": 0.02})
print(perf_counter() - begin)
"""


@dataclass(frozen=True)
class ModelFigures:
    """One way to run the cylinder: trajectories and experiments per second on one core, and both as shares of the built-in's."""

    name: str
    trajectories: float
    experiments: float
    of_trajectories: float
    of_experiments: float


def measure(quick: bool) -> tuple[list[ModelFigures], float]:
    """Return the figures of every way, and the seconds from a model's source to its first trajectory in a new process."""
    interpreted = MODEL.symbolic()
    models: dict[str, Any] = {"built in": MODEL, "interpreted": interpreted}
    compiled = interpreted.compile()
    if compiled.compiled:
        models["compiled"] = compiled
    points = candidates()[:: 16 if quick else 4]
    pairs = random_pairs(2 if quick else 20, seed=5)
    nodes = len(points) * 3 ** len(MODEL.parameters)
    tasks: dict[str, Any] = {}
    for name, model in models.items():
        tasks[f"{name}/trajectories"] = partial(fp.predictive_covariance, model, points, PRIOR, RULE, threads=1)
        tasks[f"{name}/experiments"] = partial(fp.sensitivities, model, pairs.points, pairs.theta, threads=1)
    times = best_times(tasks, 2 if quick else 5)
    rates = {
        name: (nodes / times[f"{name}/trajectories"].seconds, len(pairs.points) / times[f"{name}/experiments"].seconds)
        for name in models
    }
    first, second = rates["built in"]
    figures = [ModelFigures(name, w1, w2, w1 / first, w2 / second) for name, (w1, w2) in rates.items()]
    return figures, min(_first_trajectory() for _ in range(2))


def _first_trajectory() -> float:
    done = subprocess.run([sys.executable, "-c", FIRST_TRAJECTORY], capture_output=True, text=True, check=True)
    return float(done.stdout)
