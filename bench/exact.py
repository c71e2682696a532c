"""``python -m bench exact``: exact designs of candidates with their proofs: nodes and seconds of the processor."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from time import process_time

import numpy as np

import fisherpoint as fp

TIME_LIMIT = 60.0


@dataclass(frozen=True)
class ExactFigures:
    """Of one design: candidates, measurements, log det F, efficiencies against weights and any design, nodes, processor seconds."""

    model: str
    candidates: int
    n: int
    log_det: float
    of_weights: float
    efficiency: float
    ended: str
    nodes: int
    seconds: float


def measure(quick: bool) -> list[ExactFigures]:
    """Quadratics on three levels of two and three factors, and three nonlinear models on grids."""
    rows = []
    for name, problem, candidates, sizes in _cases():
        for n in sizes[:1] if quick else sizes:
            begin = process_time()
            found = fp.exact_design(problem, candidates, n, time_limit=TIME_LIMIT, threads=1)
            seconds = process_time() - begin
            proven = found.of_weights, found.efficiency, found.stop_reason, found.nodes
            rows.append(ExactFigures(name, len(candidates), n, found.value, *proven, seconds))
    return rows


def _cases() -> Iterator[tuple[str, fp.DesignProblem, fp.Experiments, range | tuple[int, ...]]]:
    for factors, sizes in ((2, range(6, 15)), (3, range(10, 15))):
        names = "abc"[:factors]
        terms = ["1", *names, *("*".join(two) for two in itertools.combinations_with_replacement(names, 2))]
        levels = np.array(list(itertools.product((-1.0, 0.0, 1.0), repeat=factors)))
        of = " + ".join(f"p{k}*{term}" for k, term in enumerate(terms))
        problem = _problem(of, {f"p{k}": 1.0 for k in range(len(terms))}, dict.fromkeys(names, (-1.0, 1.0)))
        yield f"quadratic in {factors} factors", problem, _at(levels), sizes
    nonlinear = (
        ("Michaelis-Menten", "V*x/(K + x)", {"V": 1.0, "K": 1.0}, 5.0),
        ("Box-Lucas", "a/(a - b)*(exp(-b*x) - exp(-a*x))", {"a": 0.7, "b": 0.2}, 20.0),
        ("one compartment", "c*(exp(-a*x) - exp(-b*x))", {"a": 0.05884, "b": 4.298, "c": 21.80}, 48.0),
    )
    for (name, of, mean, end), count in itertools.product(nonlinear, (50, 500, 2000)):
        yield name, _problem(of, mean, {"x": (0.0, end)}), _at(np.linspace(0, end, count + 1)[1:, None]), (5, 7)


def _problem(of: str, mean: dict[str, float], bounds: dict[str, tuple[float, float]]) -> fp.DesignProblem:
    model = fp.SymbolicModel([], [of], {}, dict.fromkeys(bounds, "1"), dict.fromkeys(mean, "1"), {"y": "1"})
    region = fp.ExperimentRegion(bounds)
    return fp.DesignProblem(model, fp.GaussianPrior(mean, mean), region, noise={"y": 1.0}, rule=fp.LinearizedRule())


def _at(u: np.ndarray) -> fp.Experiments:
    return fp.Experiments(np.empty((len(u), 0)), u)


def show(figures: list[ExactFigures]) -> str:
    """As a table in Markdown."""
    head = "| model | candidates | N | log det F | weights | proven | nodes | s |\n|---|--:|--:|--:|--:|--:|--:|--:|"
    lines = [
        f"| {f.model} | {f.candidates} | {f.n} | {f.log_det:.6f} | {f.of_weights:.4f} | "
        f"{'optimal' if f.ended == 'proven' else f'{f.efficiency:.4f}'} | {f.nodes} | {f.seconds:.2f} |"
        for f in figures
    ]
    return "\n".join([head, *lines])
