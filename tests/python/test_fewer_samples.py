"""Searches for densely sampled runs look at fewer samples, and say what all are worth."""

from __future__ import annotations

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.information.fewer_samples import ENOUGH, with_fewer_samples

MODEL = fp.SymbolicModel(
    ["w", "(u - b*w - F*tanh(w/0.05))/J"],
    ["q"],
    {"q": "rad", "w": "rad/s"},
    {"u": "N m"},
    {"J": "kg m2", "b": "N m s/rad", "F": "N m"},
    {"q": "rad"},
    check_units=False,
)
PRIOR = fp.GaussianPrior({"J": 0.05, "b": 0.1, "F": 0.3}, relative_std={"J": 0.2, "b": 0.3, "F": 0.3})


def problem(noise: object = 1e-3, every: float = 0.0005, dt: object = 0.05, along: list[str] | None = None) -> fp.DesignProblem:
    region = fp.RunRegion({"q": 0.0, "w": 0.0, "u": (-1, 1), "dt": dt}, 20, sample_every=every)
    return fp.DesignProblem(MODEL, PRIOR, region, noise={"q": noise}, along=along)


def information(of: fp.DesignProblem, runs: fp.Runs) -> float:
    """log det of the sum over samples."""
    found = fp.evaluate(of, runs)
    return found.log_det + 3 * float(np.log(found.n_points / 2))


def test_a_search_by_fewer_samples_sees_nearly_the_same_information() -> None:
    whole = problem()
    fewer, region = with_fewer_samples(whole, whole.run_region)
    assert region.sample_every == pytest.approx(4 * 0.0005) and fewer.run_region == region
    held = fp.Runs([[0.0, 0.0]], np.random.default_rng(0).uniform(-1, 1, (1, 20, 1)), 0.05)
    both = [information(of, held.sampled(of.run_region.sample_every)) for of in (whole, fewer)]
    assert both[0] == pytest.approx(both[1], abs=0.02) and both[0] != both[1]


@pytest.mark.parametrize(
    "other",
    [
        problem(every=1.0 / ENOUGH),
        problem(fp.Noise(1e-3, colored=fp.GaussMarkov(1e-3, 0.01))),
        problem(fp.Noise(1e-3, relative=0.1)),
        problem(fp.Noise(1e-3, resolution=5e-3)),
        problem(dt=(0.005, 0.05)),
    ],
)
def test_where_that_would_change_the_information_all_samples_count(other: fp.DesignProblem) -> None:
    found, region = with_fewer_samples(other, other.run_region)
    assert found is other and region is other.run_region


def test_a_design_is_worth_what_all_its_samples_are() -> None:
    region = fp.RunRegion({"q": 0.0, "w": 0.0, "u": (-1, 1), "dt": 0.05}, 4, sample_every=1e-4)
    whole = fp.DesignProblem(MODEL, PRIOR, region, noise={"q": 1e-3})
    design = fp.design_runs(whole, n_starts=1, n_candidates=20)
    assert design.runs.measured.sum() == 2000
    assert design.log_det == pytest.approx(information(whole, design.runs), abs=1e-6)
    assert max(design.ends) == pytest.approx(design.log_det, abs=0.05)


@pytest.mark.long
def test_a_search_within_limits_ends_no_lower_than_the_best_of_its_pool_that_plants_can_run() -> None:
    """Plants of little friction slide where others stick, which no distance to first order shows."""
    region = fp.RunRegion({"q": 0.0, "w": 0.0, "u": (-1, 1), "dt": 0.1}, 8)
    of = fp.DesignProblem(MODEL, PRIOR, region, noise={"q": 1e-3}, along=["abs(q) < 0.5", "abs(w) < 1.5"])
    design = fp.design_runs(of, n_starts=1, n_candidates=60)
    assert design.feasibility.share >= 0.99
    rng = np.random.default_rng(1)
    best = -np.inf
    for _ in range(60):
        levels = np.repeat(rng.uniform(-0.5, 0.5, 4), 2)[None, :, None]
        runs = fp.Runs([[0.0, 0.0]], levels, 0.1)
        if fp.feasibility(of, runs).share >= 0.99:
            best = max(best, information(of, runs))
    assert design.log_det > best + 2
