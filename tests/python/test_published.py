"""Published problems (docs/studies/published.md): published designs as this library evaluates them, a search, and a certificate."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from bench.runs import yeast

PUBLISHED = {
    44.80424: [(0.2, 35, 2.84653), (0.05, 5, 10), (0.2, 35, 1.26717), (0.2, 35, 6.48231), (0.2, 35, 6.48231)],
    44.89973: [(0.2, 35, 2.7268), (0.05, 5, 10), (0.2, 35, 1.2789), (0.2, 35, 4.4897), (0.2, 35, 8.6801)],
}
"""Of the fed-batch yeast: mean ln det over 128 plants, and (D, S_in, X_0) of five runs."""


def runs_of(settings: list[tuple[float, float, float]]) -> fp.Runs:
    """Sampled every two hours up to ten."""
    d, feed, x = np.array(settings).T
    u = np.repeat(np.column_stack([d, feed])[:, None], 5, axis=1)
    return fp.Runs(x0=np.column_stack([x, np.full(len(x), 0.1)]), u=u, dt=np.full((len(x), 5), 2.0))


def log_dets(problem: fp.DesignProblem, runs: fp.Runs, plants: Any) -> np.ndarray:
    """ln det F on each plant, parameters in their own units, F the sum over the samples."""
    found = []
    for plant in plants:
        there = problem.replace(prior=fp.GaussianPrior(plant, dict(problem.prior.std)))
        f = fp.evaluate(there, runs).information
        found.append(np.linalg.slogdet(f)[1] - 2 * np.log(problem.std).sum())
    return np.array(found)


@pytest.mark.parametrize("published", PUBLISHED)
def test_published_designs_of_the_yeast_have_the_published_values(published: float) -> None:
    case = yeast()
    plants = case.options["goal"].over.scenarios
    assert len(plants) == 128
    assert log_dets(case.problem, runs_of(PUBLISHED[published]), plants).mean() == pytest.approx(published, abs=1e-5)


@pytest.mark.long
def test_a_short_search_for_the_yeast_beats_both() -> None:
    """Over eight of the plants, by their mean."""
    case = yeast()
    plants = case.options["goal"].over.scenarios[::16]
    over = fp.OverPrior("log", scenarios=plants)
    design = fp.design_runs(case.problem, 5, goal=fp.Goal(over=over, confidence=0.0), n_starts=2, n_candidates=100)
    found = log_dets(case.problem, design.runs, plants).mean()
    assert design.log_det - 2 * np.log(case.problem.std).sum() == pytest.approx(found, abs=1e-3)
    for settings in PUBLISHED.values():
        assert found > log_dets(case.problem, runs_of(settings), plants).mean() + 1e-3


def test_the_certificate_of_three_exponentials() -> None:
    """A sixth of the weight at each of six times, of which one sample each is therefore the best design of six."""
    terms = [f"a_{k}*exp(-k_{k}*t)" for k in (1, 2, 3)]
    mean = {"a_1": 1.0, "a_2": 0.5, "a_3": 0.2, "k_1": 5.0, "k_2": 0.8, "k_3": 0.05}
    units = {name: "1" if name.startswith("a") else "1/s" for name in mean}
    model = fp.SymbolicModel(f=[], g=[" + ".join(terms)], states={}, inputs={"t": "s"}, outputs={"y": "1"}, parameters=units)
    prior = fp.GaussianPrior(mean, {name: 0.1 * value for name, value in mean.items()})
    problem = fp.DesignProblem(model, prior, fp.ExperimentRegion({"t": (0.01, 60)}), noise={"y": 0.01})
    design = fp.approximate_design(problem, tolerance=1e-7)
    times = np.sort(design.points.u[:, 0])
    assert times == pytest.approx([0.01, 0.1753, 0.6679, 2.0025, 6.2531, 26.8048], rel=1e-3)
    assert design.weights == pytest.approx(np.full(6, 1 / 6), abs=1e-5)
    assert 6 * design.largest <= 6.00001 and design.starts >= 1000
    fine = fp.Experiments(np.zeros((20_000, 0)), np.geomspace(0.01, 60, 20_000)[:, None])
    assert design.sensitivity(fine).max() <= 6.00001
    value = np.linalg.slogdet(6 * design.information)[1] - 2 * np.log(problem.std).sum()
    assert value == pytest.approx(42.86974505, abs=1e-5)
    exact = fp.exchange(problem, 6, n_candidates=20)
    found = np.linalg.slogdet(exact.evaluation.information)[1] - 2 * np.log(problem.std).sum()
    assert found == pytest.approx(42.86974505, abs=1e-5) and found <= value + 1e-6
    off = fp.exchange(problem, 6, n_candidates=20, max_iterations=0, seed=1)  # the certificate is none of a poor design
    assert design.efficiency_of(off) < 0.9
