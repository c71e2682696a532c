"""Estimates parameters from data, (5): weighted least squares, maximum likelihood with unknown noise, maximum a posteriori."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from time import perf_counter
from typing import Any, Literal

import numpy as np

from ..basics.checks import as_float, by_name, check_choice, check_positive_int, check_type, some_names_among
from ..basics.messages import listed, shown, stacklevel_of_user
from ..basics.options import with_options
from ..basics.quantity import names_of
from ..basics.stop_reason import StopReason
from ..basics.values import Array
from ..data.measurements import Measurements
from ..data.record import Record
from ..information.assumed import assumed_of
from ..information.deviations import EXACT, Deviations
from ..information.local import check_local
from ..models import Model
from ..noise.models import Noise, NoiseOf, checked_noise, outputs_of
from ..noise.sensors import Sensors
from ..points.natural_sizes import warn_of_small_states
from ..points.settings import check_rtol, resolve_threads
from ..prior.gaussian import GaussianPrior
from ..show.numbers import counted
from ..show.progress import Progress, check_progress, following
from .fit import Fit
from .known_noise import KnownNoise
from .local_spread import LocalSearch
from .local_unknowns import LocalUnknowns, of_common
from .local_values import NO_SPREAD, Spread
from .noise_search import with_noise_found
from .nuisance import Nuisance, known_beforehand, nuisance_of, own_parameters
from .observed import Observed, check_outputs
from .residual_report import residual_findings
from .search import (
    MOST_STARTS,
    SAME_MINIMUM,
    FoundMinimum,
    evaluable_starts,
    further_starts,
    search_with_known_noise,
    search_with_unknown_noise,
    start_guess,
)
from .sensor_noise import SensorNoise
from .small_samples import unbiased
from .unknown_noise import check_noise_is_determined
from .unknowns import checked_bounds, prior_factor, unknowns_of
from .weighting import WeightedResiduals


@with_options
def estimate(
    model: Model,
    data: Any,
    prior: GaussianPrior | None = None,
    *,
    start: Mapping[str, float] | GaussianPrior | None = None,
    parameters: Sequence[str] | None = None,
    noise: NoiseOf | Literal["estimated"] | None = None,
    bounds: Mapping[str, tuple[float | None, float | None]] | None = None,
    deviations: Deviations = EXACT,
    starts: int = 8,
    rtol: float = 1e-9,
    threads: int | None = None,
    progress: bool | Callable[[Progress], None] | None = None,
) -> Fit:
    """Estimate parameters from measured data, (5).

    With known noise this is weighted least squares, which is maximum likelihood, or the maximum likelihood of readings where noise
    grows with the outputs, or readings are rounded or limited (docs/how_to/noise.md); with unknown noise, the parameters that
    minimise log det of the residual covariance (10); with a prior, the maximum a posteriori. The search is Levenberg and
    Marquardt's with the engine's exact derivatives in standardised coordinates, from the best of several starts.

    Parameters
    ----------
    model : Model
    data : Measurements, Record, or a sequence of these
        Points and runs of which nothing was measured are left out, and runs end at their last number.
    prior : GaussianPrior, optional
        Takes part in the estimate. Log-normal parameters stay positive: their logarithms are what is searched.
    start : mapping of name to float, or GaussianPrior, optional
        Where the search starts; and, for unknown starts of records, "x0_h1". A GaussianPrior gives starts, but takes no part in the
        estimate. Default: the prior's mean, else the model's nominal values.
    parameters : sequence of str, optional
        Names of the parameters to estimate that all data share; the others are known to be at their start. Default: all that are
        not local.
    noise : mapping of output name to float or Noise, or NoiseModel, optional
        The sensor noise, SI units: a number is the standard deviation of white noise. Data of outputs that are not named are left
        out. "estimated" looks for the smallest noise that leaves white residuals: white, growing, with a memory
        (docs/how_to/noise.md). Default: white noise that is not known, and all outputs take part.
    bounds : mapping of name to (lower, upper), optional
        None for no bound. Default: what the model itself demands (`Model.least`).
    deviations : Deviations, optional
        By how much constants, loads and starts deviate, such as ``fp.Deviations(uncertain={"m": 0.1})``, or those of a problem,
        ``problem.deviations``; and which parameters are local, with a value for each run or plant:
        ``fp.Deviations(local={"m_load": "run"})``. Default: all of it is known exactly, and all data share their parameters.
    starts : int
        Number of starts where there is a prior: its mean, and nodes spread over it, without those at which trajectories are not
        ok. Where at most half of them come to the best fit, or this leaves residuals that the known noise does not
        explain (probability below 0.001), twice as many starts follow: the best of many nodes that lie twice as far out.
    rtol : float
        Tolerance of the trajectories.
    threads : int, optional
    progress : bool or callable, optional
        True shows a bar, on the terminal and in notebooks; needs rich. A function is called with a `Progress` after each
        evaluation of the residuals, with how many sets of unknowns they were evaluated at; the message says from how many starts
        it goes on.

    Returns
    -------
    Fit
        Where the data do not determine all unknowns, `Fit.null_directions` says which combinations they leave open. Where the
        search stopped away from a minimum, `Fit.converged` is False, and `Fit.stop_reason` says why.

    Raises
    ------
    TypeError, ValueError
        For misuse, and where no start has trajectories that are ok.
    """
    check_type(model, Model, "model")
    check_progress(progress)
    names = names_of(model.parameters)
    check_type(deviations, Deviations, "deviations")
    local = deviations.local_parameters
    shared = [name for name in names if name not in local] if parameters is None else parameters
    chosen = some_names_among(shared, names, "parameters")
    look_for = isinstance(noise, str)
    if isinstance(noise, str):
        noise = None if noise == "estimated" else check_choice(noise, ("estimated",), "noise")
    if noise is not None:
        noise = checked_noise(noise, names_of(model.outputs))
    uncertain, varies = deviations.uncertain, deviations.varies
    check_local(local, names, chosen, {"uncertain": uncertain, "varies": varies})
    for label, stds in (("uncertain", uncertain), ("varies", varies)):
        for name in (name for name in chosen if stds is not None and name in stds):
            raise ValueError(f"{label}: expected constants or parameters that are not estimated, given {name!r}, which is")
    parts = _parts(data, model, noise)
    of_groups = LocalUnknowns.of(local, parts)
    nuisance, starts_anew = nuisance_of(uncertain, deviations.initial_state_std, deviations.shared)
    assumed_of(model, uncertain, varies, deviations.initial_state_std)  # unknown names, and what is in two of them
    joint = nuisance.of(model)
    for label, given in (("prior", prior), ("start", start)):
        if (label == "prior" and given is not None) or isinstance(given, GaussianPrior):
            check_type(given, GaussianPrior, label)
    beforehand = prior if prior is not None else start if isinstance(start, GaussianPrior) else None
    spread = of_common(beforehand, local)
    if nuisance.starts and not all(isinstance(part, Measurements) for part in parts):
        raise ValueError("shared: expected measurements of points or runs, given a record: estimate its start")
    first = of_groups.starts(_first(model, prior, start, parts))
    theta = joint.theta(model.theta({name: first[name] for name in names}))
    for name, place in zip(joint.nuisance_names, joint.nuisance, strict=True):
        first.setdefault(name, float(theta[place]))
    threads = resolve_threads(threads)
    rtol = check_rtol(rtol)
    observed = Observed(joint.model, parts, (*chosen, *joint.nuisance_names), theta, rtol, threads, of_groups)
    starts_given = (part.points.x0 for part in parts if isinstance(part, Measurements))
    warn_of_small_states(model, "the starts keep", *starts_given, stacklevel=4)  # past `with_options`
    known_names = dict.fromkeys((*names, *observed.names))
    for label, mapping in (("start", start), ("prior", prior)):
        given_names = mapping.names if isinstance(mapping, GaussianPrior) else tuple(mapping or ())
        for unknown in (name for name in given_names if name not in known_names):
            raise ValueError(f"{label}: expected names of {listed(known_names)}; given unknown {shown(unknown)}")
    begin = {name: first[name] if name in first else start_guess(model, *observed.starts[name]) for name in observed.names}
    scales = {q.name: q.scale or 0.0 for q in model.states}
    sizes = {name: scales[state] for name, (state, _) in observed.starts.items()}
    limits = of_groups.bounds(checked_bounds(joint.model, bounds, (*observed.names, *local)))
    about = of_groups.coordinates(first, beforehand)
    unknowns = unknowns_of(begin, known_beforehand(spread, joint, theta), sizes, limits, about)
    for name, log in zip(observed.names, unknowns.log, strict=True):
        if log and not begin[name] > 0:
            raise ValueError(f"start[{name!r}]: expected a positive number, as its prior is log-normal; given {begin[name]:g}")
    starts = check_positive_int(starts, "starts", most=MOST_STARTS)
    with _heard(observed, progress):
        z0 = evaluable_starts(observed, unknowns, begin, spread, starts)
        factor = prior_factor(known_beforehand(of_common(prior, local), joint, theta), unknowns)
        residuals = WeightedResiduals(observed, unknowns, observed.y[None], np.eye(observed.y.shape[1]), factor)

        if noise is not None:
            sensors = Sensors.of(noise, names_of(model.outputs))
            of_sensors, anew = np.diag(np.square(sensors.nominal_std)), bool(varies or starts_anew)
            more = SensorNoise.of(sensors, parts, anew, threads)
            known = KnownNoise(joint.model, parts, of_sensors, more, varies, starts_anew, deviations.rule, rtol, threads)
            search = LocalSearch(residuals, known)
            found, spreads = search(z0)
        elif any(one.spread is not None for one in local.values()):
            unknown = "'estimated'" if look_for else "none"
            raise ValueError(f"noise: expected the sensor noise together with the spread of local parameters, given {unknown}")
        elif varies or starts_anew:
            raise ValueError("noise: expected the sensor noise together with varies or initial_state_std, given none")
        else:
            check_noise_is_determined(observed, prior)
            found = search_with_unknown_noise(residuals, z0)
            of_sensors, spreads = found.residuals.covariance, NO_SPREAD

        fit = _fit(model, nuisance, parts, prior, noise, of_sensors, found, len(z0), spreads)
        if not fit.noise_known:
            fit = _with_unbiased_noise(fit)
            return _heard_of(with_noise_found(fit, partial(_refitted, residuals)) if look_for else fit)
        if len(z0) > 1 and spread is not None and (fit.unexplained or 2 * fit.reached <= fit.starts):
            further = further_starts(found.residuals, begin, spread, len(z0))
            again, spreads = search(np.concatenate([found.z[None], further]))
            fit = _better(fit, _fit(model, nuisance, parts, prior, noise, of_sensors, again, len(z0) + len(further), spreads))
        return _heard_of(fit)


def _refitted(residuals: WeightedResiduals, fit: Fit, noise: Mapping[str, Noise]) -> Fit:
    """The fit by noise that was found, from the estimate of another fit."""
    sensors, observed = Sensors.of(noise, names_of(fit.model.outputs)), residuals.observed
    covariance, of_samples = np.diag(np.square(sensors.nominal_std)), SensorNoise.of(sensors, fit.data, False, 1)
    known = KnownNoise(observed.model, fit.data, covariance, of_samples, None, None, None, observed.rtol, 1)
    found = search_with_known_noise(residuals, fit.z[None], known)
    again = _fit(fit.model, fit.nuisance, fit.data, fit.prior, noise, covariance, found, fit.starts)
    return replace(again, noise_known=False, reached=fit.reached, evaluations=fit.evaluations + found.evaluations)


def _heard_of(fit: Fit) -> Fit:
    """The fit, after a warning where its residuals are not white."""
    findings = list(residual_findings(fit))
    if findings:
        message = f"residuals: expected white noise, given others: {'; '.join(findings)}"
        warnings.warn(message, RuntimeWarning, stacklevel=stacklevel_of_user())
    return fit


@contextmanager
def _heard(observed: Observed, progress: bool | Callable[[Progress], None] | None) -> Iterator[None]:
    """Report every evaluation of the residuals."""
    started, evaluations = perf_counter(), 0

    with following(progress, "estimating", counted=False) as report:
        if report is None:
            yield
            return

        def heard(searches: int) -> None:
            nonlocal evaluations
            evaluations += searches
            message = f"{counted(evaluations, 'evaluation')}, from {counted(searches, 'start')}"
            report(Progress(evaluations, None, None, message, perf_counter() - started))

        observed.heard = heard
        try:
            yield
        finally:
            observed.heard = None  # the fit goes on with it


def _fit(
    model: Model,
    nuisance: Nuisance,
    parts: tuple[Measurements | Record, ...],
    prior: GaussianPrior | None,
    noise: NoiseOf | None,
    sensors: Array,
    found: FoundMinimum,
    starts: int,
    spread: Mapping[str, Spread] = NO_SPREAD,
) -> Fit:
    observed, values = found.residuals.observed, found.residuals.unknowns.values(found.z[None])
    response = observed.respond(values)
    return Fit(
        model=model,
        data=parts,
        prior=prior,
        nuisance=nuisance,
        theta=own_parameters(model, observed.parameters(values)[0]),
        values=values[0],
        predicted=response.y[0],
        residuals=observed.y - response.y[0],
        noise_known=noise is not None,
        noise=noise,
        noise_covariance=sensors,
        stop_reason=found.stop_reason,
        evaluations=found.evaluations,
        starts=starts,
        reached=found.reached,
        weighted=found.residuals,
        spread=spread,
    )


def _better(fit: Fit, again: Fit) -> Fit:
    """The fit of a second search, which started at the first one's minimum too: `reached` counts no start twice."""
    first, second = (one.chi_square + one.weighted.prior_square(one.z[None])[0] for one in (fit, again))
    same = abs(first - second) <= 2 * SAME_MINIMUM
    if not same:
        return again
    return replace(again, reached=fit.reached + again.reached - 1, evaluations=fit.evaluations + again.evaluations)


def _parts(data: Any, model: Model, noise: NoiseOf | None) -> tuple[Measurements | Record, ...]:
    """The sets of data, without points and runs of which nothing was measured: their trajectories may well fail.

    Where noise is known, an output without known noise is not measured.
    """
    given = tuple(data) if isinstance(data, list | tuple) else (data,)
    if not given:
        raise ValueError("data: expected at least one set of data, given none")
    parts: list[Measurements | Record] = []
    for part in given:
        if not isinstance(part, Measurements | Record):
            raise TypeError(f"data: expected Measurements, a Record or a sequence of them, given {type(part).__name__}")
        check_outputs(part, model)
        if noise is not None:
            y = np.where([name in outputs_of(noise) for name in names_of(model.outputs)], part.y, np.nan)
            if np.isnan(y).all():
                continue
            part = replace(part, y=y)
        parts.append(part.measured_part if isinstance(part, Measurements) else part)
    if not parts:
        raise ValueError(f"data: expected a number of {listed(outputs_of(noise or {}))}, whose noise is known; given none")
    return tuple(parts)


def _first(model: Model, prior: GaussianPrior | None, start: Any, parts: Sequence[Any]) -> dict[str, float]:
    """A value for every parameter of the model, and the starts of records that are given one."""
    if start is not None and not isinstance(start, Mapping | GaussianPrior):
        raise TypeError(f"start: expected a mapping of names to numbers or a GaussianPrior, given {type(start).__name__}")
    given = start.mean if isinstance(start, GaussianPrior) else start or {}
    values = {**model.nominal, **(prior.mean if prior is not None else {})}
    values |= by_name(given, None, "start", as_float)
    for missing in (name for name in names_of(model.parameters) if name not in values):
        raise ValueError(f"start: expected a value of {missing!r}, which has neither a prior nor a nominal value; given none")
    return values


def _with_unbiased_noise(fit: Fit) -> Fit:
    """The fit with the noise's variances divided by degrees of freedom instead of the number of samples.

    Where the likelihood grows without end as the noise of an output that can be fitted exactly vanishes, it has not converged.
    """
    if fit.noise_not_estimable:
        fit = replace(fit, stop_reason=StopReason.no_maximum)
    counts = np.isfinite(fit.residuals).sum(axis=0)
    covariance = unbiased(fit.noise_covariance[None], fit.output_degrees_of_freedom[None], counts)[0]
    return replace(fit, noise_covariance=covariance, weighted=replace(fit.weighted, covariance=covariance))
