"""What redesigning is worth: a campaign of four batches of six against one design of 24 points, for truths far from the prior mean.

The default cylinder with twice its prior standard deviations. Truths are drawn from the prior; a draw with a parameter that is not
positive makes no sense and is drawn again. Both are measured by virtual rigs, on which a point whose true trajectory fails is not
measured, and both are estimated from the same prior by the same maximum a posteriori.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter

import numpy as np

import fisherpoint as fp
from fisherpoint.basics.values import Array
from fisherpoint.estimation.fit import Fit

from .designs import RELATIVE_STD, default_problem

BATCHES, BATCH = 4, 6


@dataclass(frozen=True)
class Outcome:
    """What one way to spend 24 points came to for one truth, per parameter.

    Attributes
    ----------
    standard_errors : list of float
        Achieved ones, from the Fisher matrix at the truth of the points that were measured, in prior standard deviations.
    errors : list of float
        Of the estimate, in prior standard deviations.
    measured : int
        Points whose true trajectory reached its end.
    """

    standard_errors: list[float]
    errors: list[float]
    measured: int

    @property
    def standard_error(self) -> float:
        """Geometric mean over the parameters."""
        return geometric_mean(self.standard_errors)

    @property
    def error(self) -> float:
        """Geometric mean over the parameters of their amounts."""
        return geometric_mean(np.abs(self.errors))


@dataclass(frozen=True)
class Run:
    """A truth, in prior standard deviations from the mean, and what became of it; None where a fit or a rig failed."""

    truth: list[float]
    campaign: Outcome | None
    single: Outcome | None
    failure: str = ""


@dataclass(frozen=True)
class CampaignFigures:
    runs: list[Run]
    max_iterations: int
    seconds: float

    @property
    def whole(self) -> list[tuple[Outcome, Outcome]]:
        """Pairs of campaign and single design, of runs in which neither failed."""
        return [(run.campaign, run.single) for run in self.runs if run.campaign is not None and run.single is not None]

    def wins(self, figure: Callable[[Outcome], float]) -> int:
        """Runs in which the campaign's figure is lower."""
        return sum(figure(campaign) < figure(single) for campaign, single in self.whole)

    def ratios(self, figure: Callable[[Outcome], float]) -> Array:
        """The campaign's figure over the single design's: quartiles."""
        return np.quantile([figure(campaign) / figure(single) for campaign, single in self.whole], [0.25, 0.5, 0.75])

    def rmse(self, of_campaign: bool) -> float:
        """Root mean square over the runs of each parameter's errors, in prior standard deviations; geometric mean over these."""
        errors = np.array([pair[0 if of_campaign else 1].errors for pair in self.whole])
        return geometric_mean(np.sqrt(np.mean(errors**2, axis=0)))


def geometric_mean(values: object) -> float:
    return float(np.exp(np.mean(np.log(np.asarray(values, dtype=float)))))


def wide_problem() -> fp.DesignProblem:
    """The default cylinder with twice the default prior standard deviations."""
    problem = default_problem("noise")
    relative_std = {name: 2 * std for name, std in RELATIVE_STD.items()}
    return problem.replace(prior=fp.GaussianPrior(problem.prior.mean, relative_std=relative_std))


def measure(quick: bool, tell: Callable[[str], None], runs: int | None = None, threads: int | None = None) -> CampaignFigures:
    """Run both ways for truths drawn from the prior; the single design is searched for as long as four batches together."""
    begin, problem = perf_counter(), wide_problem()
    count, iterations = (5, 40) if quick else (50, 200)
    single = fp.exchange(
        problem,
        BATCHES * BATCH,
        max_iterations=BATCHES * iterations,
        seed=0,
        threads=threads,
        method=fp.ExchangeMethod(references=False),
    )
    done = []
    for number in range(runs or count):
        run = _run(problem, single.points, number, iterations, threads)
        done.append(run)
        if run.campaign is None or run.single is None:
            tell(f"{number + 1:3}: {run.failure}")
        else:
            tell(
                f"{number + 1:3}: standard errors {run.campaign.standard_error:.5f} against {run.single.standard_error:.5f}"
                f" prior std, {run.campaign.measured} against {run.single.measured} points measured"
            )
    return CampaignFigures(done, iterations, perf_counter() - begin)


def _run(problem: fp.DesignProblem, single: fp.Experiments, number: int, iterations: int, threads: int | None) -> Run:
    theta = _truth(problem, number)
    z = ((theta - problem.theta) / problem.std).tolist()
    model, noise = problem.model, problem.noise
    assert noise is not None
    found: list[Outcome | None] = []
    failures = []
    for way, seed in ((_campaign, 2 * number), (_single, 2 * number + 1)):
        rig = fp.VirtualRig(model, theta, noise, seed=seed)
        try:
            with warnings.catch_warnings():
                warnings.filterwarnings("ignore", "[0-9]+ of [0-9]+ points are not measured", RuntimeWarning)
                found.append(_outcome(problem, theta, way(problem, single, rig, number, iterations, threads)))
        except ValueError as error:
            found.append(None)
            failures.append(f"{way.__name__.strip('_')}: {error}")
    return Run(z, found[0], found[1], "; ".join(failures))


def _truth(problem: fp.DesignProblem, number: int) -> Array:
    rng = np.random.default_rng([5, number])
    while True:
        theta: Array = problem.theta + problem.std * rng.standard_normal(len(problem.theta))
        if (theta > 0).all():
            return theta


def _campaign(
    problem: fp.DesignProblem, single: fp.Experiments, rig: fp.VirtualRig, number: int, iterations: int, threads: int | None
) -> Fit:
    campaign = fp.Campaign(problem, BATCH, seed=number, threads=threads, max_iterations=iterations)
    for _ in range(BATCHES):
        fit = campaign.tell(rig.measure(campaign.next()))
    return fit


def _single(
    problem: fp.DesignProblem, single: fp.Experiments, rig: fp.VirtualRig, number: int, iterations: int, threads: int | None
) -> Fit:
    campaign = fp.Campaign(problem, len(single), threads=threads)  # for the same estimate, from other points
    return campaign.tell(rig.measure(single))


def _outcome(problem: fp.DesignProblem, theta: Array, fit: Fit) -> Outcome:
    data = fp.Measurements.join([part for part in fit.data if isinstance(part, fp.Measurements)])
    sensitivities = fp.sensitivities(problem.model, data.points, theta, rtol=1e-10).dy_dtheta * problem.std
    noise = np.sqrt(np.diag(problem.noise_covariance))
    jacobian = (sensitivities / noise[:, None])[np.isfinite(data.y)]
    _, values, vectors = np.linalg.svd(jacobian, full_matrices=False)
    errors = np.sqrt(np.sum((vectors / values[:, None]) ** 2, axis=0))
    return Outcome(errors.tolist(), ((fit.theta - theta) / problem.std).tolist(), len(data))
