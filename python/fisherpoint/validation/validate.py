"""`fp.validate`: does a design keep what it promises?"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from time import perf_counter

import numpy as np

from ..basics.checks import as_std, by_name, check_choice, check_flag, check_positive_int, check_type
from ..basics.messages import listed
from ..basics.quantity import names_of
from ..basics.values import FrozenMapping
from ..design.compare import named_designs
from ..information.problem import DesignProblem
from ..models import Model
from ..points.experiments import Experiments
from ..points.runs import Runs
from ..points.settings import check_rtol, resolve_threads
from .design_validation import DesignValidation
from .figures import parameter_figures
from .fits import Estimator, VirtualFits, run
from .result import Validation
from .truths import Rig, truths_of

MOST_RUNS = 10**6
"""Virtual experiments with each design, past which they count as a slip."""


def validate(
    problem: DesignProblem,
    designs: Mapping[str, Experiments | Runs],
    *,
    noise_std: Mapping[str, float] | None = None,
    runs: int = 1000,
    theta: str | Mapping[str, float] = "prior",
    seed: int = 0,
    truth: Model | None = None,
    noise: str = "known",
    use_prior: bool = False,
    rtol: float = 1e-9,
    threads: int | None = None,
) -> Validation:
    """Measure designs virtually many times, estimate the parameters each time, and compare with what the designs promise.

    Every virtual experiment has true parameters, data y(theta) + v with v normal of standard deviations `noise_std`, and a fit
    that starts from the prior mean. All fits of a design advance together.

    Parameters
    ----------
    problem : DesignProblem
        With `uncertain`, the constants deviate, once in every virtual experiment, and with `initial_state_std` the start of every
        point, or run; the fits take the covariance that this adds to the outputs at the prior mean.
    designs : mapping of name to Experiments, Runs or Design
        They share the true parameters and the random numbers.
    noise_std : mapping of output name to float, optional
        Standard deviations of the sensor noise, SI units. Outputs that are left out are not measured. Default: the problem's.
    runs : int
        Number of virtual experiments with each design.
    theta : "prior", "mean", or mapping of parameter name to float
        The truth: drawn from the prior for each virtual experiment, or the same for all; what a mapping leaves out is at the prior
        mean.
        Draws for which the model has no meaning, such as a negative mass, are left out and counted.
    seed : int
        The same seed gives the same figures on any number of threads.
    truth : Model, optional
        Makes the data in the place of the problem's model, with its own constants: a model error.
    noise : {"known", "estimated"}
        Whether the fits know `noise_std`, or estimate it from their residuals as `estimate` does.
    use_prior : bool
        Whether the prior takes part in the fits (maximum a posteriori), and in the promise.
    rtol : float
        Tolerance of the fits' trajectories.
    threads : int, optional

    Returns
    -------
    Validation

    Raises
    ------
    TypeError, ValueError
        For misuse, and where a point has no trajectory at the prior mean.
    """
    check_type(problem, DesignProblem, "problem")
    named = named_designs(designs)
    threads = resolve_threads(threads)
    rtol = check_rtol(rtol)
    count, seed = check_positive_int(runs, "runs", most=MOST_RUNS), check_positive_int(seed, "seed", 0)
    check_choice(noise, ("known", "estimated"), "noise")
    use_prior = check_flag(use_prior, "use_prior")
    if noise == "estimated" and problem.assumed is not None:
        raise ValueError("noise: expected 'known' beside uncertain or initial_state_std, given 'estimated'")
    if truth is not None:
        _check_truth(truth, problem.model)
    std = _noise_std(problem, noise_std)
    thetas, redrawn = truths_of(problem, theta, count, seed)
    rig, begin, validations = Rig.of(problem, truth, std), perf_counter(), {}
    for name, points in named.items():
        try:
            estimator = Estimator.of(problem, points, std, noise == "known", use_prior, rtol, threads)
        except ValueError as error:
            raise ValueError(f"designs[{name!r}]: {error}") from error
        per_run = None
        if estimator.promise.determined.any():
            per_run = run(estimator, rig, points, thetas, seed, threads)
        validations[name] = _validation(problem, points, estimator, per_run)
    described = theta if isinstance(theta, str) else FrozenMapping({key: float(value) for key, value in theta.items()})
    seconds = perf_counter() - begin
    return Validation(
        problem, FrozenMapping(validations), FrozenMapping(std), count, described, seed, redrawn, truth, noise, use_prior, seconds
    )


def _validation(
    problem: DesignProblem, points: Experiments | Runs, estimator: Estimator, fits: VirtualFits | None
) -> DesignValidation:
    """Figures of one design, of the fits that did not fail."""
    names, promised = estimator.unknowns.names, estimator.promised_errors
    nothing = np.empty((0, len(names)))
    errors, claimed, covered, at_bound, failures = nothing, nothing, nothing > 0, nothing > 0, Counter[str]()
    if fits is not None:
        fine = fits.failure == ""
        errors, claimed = (fits.estimate - fits.truth)[fine], fits.standard_error[fine]
        covered, at_bound = fits.covered[fine], fits.at_bound[fine]
        failures.update(fits.failure[~fine].tolist())
    figures = {
        name: parameter_figures(
            name, problem.prior.std[name], float(promised[j]), errors[:, j], claimed[:, j], covered[:, j], at_bound[:, j]
        )
        for j, name in enumerate(names)
    }
    return DesignValidation(
        points, FrozenMapping(figures), len(errors), FrozenMapping(dict(failures)), estimator.null_directions, fits
    )


def _check_truth(truth: Model, model: Model) -> None:
    check_type(truth, Model, "truth")
    for kind in ("states", "inputs", "outputs", "parameters"):
        expected, given = names_of(getattr(model, kind)), names_of(getattr(truth, kind))
        if expected != given:
            raise ValueError(f"truth: expected the {kind} {listed(expected)}; given {listed(given)}")


def _noise_std(problem: DesignProblem, given: Mapping[str, float] | None) -> dict[str, float]:
    """Standard deviations of the outputs that are measured."""
    if given is None and problem.noise_std is None:
        raise ValueError("noise_std: expected the sensor noise, which the problem does not have either; given none")
    outputs = names_of(problem.model.outputs)
    stds = by_name(problem.noise_std if given is None else given, outputs, "noise_std", as_std)
    if not stds:
        raise ValueError(f"noise_std: expected at least one of {listed(outputs)}; given none")
    return dict(stds)
