"""Report of a fit: its unknowns, outputs and profiles, how it was found, and warnings."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ..basics.quantity import names_of
from ..basics.stop_reason import StopReason
from ..information.problem_report import noise_in_words
from ..prior.gaussian import GaussianPrior
from ..show.numbers import counted, digits_of, number, percent, probability
from ..show.section import Report, Section
from .local_report import local_findings, local_sections
from .profile_curve import ProfileCurve
from .residual_checks import OFF
from .residual_report import noise_section, residual_findings, residual_section, robust_errors_differ
from .stability import Stability
from .statistics import NUMERICAL, FitStatistics

STRONG = 0.98
"""Correlation of two unknowns from which on it is pointed out."""


FAR_OFF = 3.0
"""Prior standard deviations from the prior's mean from which on an estimate is pointed out."""


def fit_report(fit: FitStatistics, profiles: Sequence[ProfileCurve] = (), stability: Stability | None = None) -> Report:
    """The report of a fit, with the profile likelihoods and the fits of parts of the data that were computed."""
    of_parts = Report("") if stability is None else stability.report()
    tables = [*sections(fit), *([_profiles(profiles)] if profiles else []), *of_parts.sections]
    tables.append(Section("Fit", (), list(facts(fit))))
    better = [f"{one.name}: a better estimate was found on the profile; give more starts" for one in profiles if one.better]
    return Report(headline(fit), tables, [*warnings(fit), *of_parts.warnings, *better])


def headline(fit: FitStatistics) -> str:
    """Headline: what was estimated, how, and from what."""
    count, samples = int(np.isfinite(fit.residuals).sum()), len(fit.residuals)
    kind = "least squares" if len(fit.tests) == 1 else "least log det of the residual covariance (10)"
    if fit.noise is not None:
        more = fit.weighted.noise
        kind = "weighted least squares" if more is None or more.normal else "maximum likelihood"
    kind += ", noise found in the residuals" if fit.noise is not None and not fit.noise_known else ""
    if fit.prior is not None and fit.weighted.prior_factor is not None:
        kind = f"maximum a posteriori, {'noise given' if fit.noise_known else 'noise estimated'}"
    unknowns = counted(len(fit.common), "unknown")
    if fit.local:
        unknowns += f" and {counted(len(fit.parameters) - len(fit.common), 'local one')}"
    return f"Fit of {fit.model.name}: {unknowns} from {counted(count, 'number')} in {counted(samples, 'sample')}, {kind}"


def fit_facts(fit: FitStatistics) -> list[tuple[str, str]]:
    """Facts of the fit: model, data, unknowns and noise."""
    parts = [f"{counted(len(part.samples), 'sample')} of {type(part).__name__}" for part in fit.data]
    given = noise_in_words(fit.noise, (q for q in fit.model.outputs if q.name in fit.tests))
    return [
        ("model", fit.model.name),
        ("data", ", ".join(parts)),
        ("unknowns", ", ".join((*fit.common, *(f"{name} of {counted(len(of), 'group')}" for name, of in fit.local.items())))),
        ("sensor noise, one std", given if fit.noise_known else " ".join(["estimated from the residuals", given]).strip()),
    ]


def sections(fit: FitStatistics) -> Iterator[Section]:
    """The tables: unknowns, outputs, and noise beside residuals."""
    yield _unknowns(fit)
    yield from local_sections(fit)
    if fit.prior is not None and fit.weighted.prior_factor is not None:
        yield _beside_prior(fit, fit.prior)
    yield _outputs(fit)
    yield from noise_section(fit)
    yield from residual_section(fit)
    if len(fit.tests) > 1 and not fit.noise_known:
        yield _noise_correlation(fit)


def facts(fit: FitStatistics) -> Iterator[tuple[str, str]]:
    """How good the fit is, and how it was found."""
    degrees = fit.degrees_of_freedom
    if fit.noise_known:
        if fit.weighted.noise is not None:
            yield "sensor noise", noise_in_words(fit.noise, (q for q in fit.model.outputs if q.name in fit.tests))
        per = f", {number(fit.chi_square / degrees)} per degree of freedom" if degrees > 1e-9 else ""
        yield "chi-square", f"{number(fit.chi_square)} with {_degrees(degrees)}{per}"
    else:
        yield "noise", f"estimated with {_degrees(degrees)}"
    known = {**fit.nuisance.uncertain, **fit.nuisance.starts}
    if known:
        yield "uncertain constants, one std beforehand", ", ".join(f"{name} {number(std)}" for name, std in known.items())
    yield "search", f"{fit.stop_reason.words}, {counted(fit.evaluations, 'evaluation')}"
    if fit.starts > 1:
        yield "starts at this minimum", f"{fit.reached} of {fit.starts}"


def warnings(fit: FitStatistics) -> Iterator[str]:
    """Warnings, each as a sentence."""
    if not fit.converged:
        yield f"not converged: {fit.stop_reason.words}. {fit.stop_reason.advice.removesuffix('.')}"
    yield from residual_findings(fit)
    for direction in fit.null_directions:
        yield f"not determined: {direction}, no measured output changes"
    for direction in fit.weak_directions:
        yield f"hardly determined: {direction}"
    for name in fit.at_bounds:
        yield f"{name} is at its bound: it has no standard error, and those of the others are with {name} there"
    for name in (name for name in fit.parameters if fit.prior is not None and name in fit.prior.names):
        off = shift(fit, fit.prior, name) if fit.prior is not None else 0.0
        if abs(off) > FAR_OFF:
            yield f"{name} is {abs(off):.1f} prior std from its prior mean: the prior, the model or the data may be wrong"
    for name, test in fit.tests.items():
        per = number(test.per_degree_of_freedom, 3)
        if test.p_value is not None and test.p_value < OFF:
            wrong = "the model, the noise of this output or the minimum found is wrong"
            yield f"{name}: chi-square per degree of freedom {per}: {wrong}"
        elif test.p_value is not None and test.p_value > 1 - OFF:
            yield f"{name}: chi-square per degree of freedom {per}: the noise of this output is smaller than given"
    yield from _beside_numerical_error(fit)
    for name in fit.noise_not_estimable:
        yield f"{name}: the unknowns fit it exactly, so its noise cannot be estimated: give noise, or measure more"
    if fit.starts > 1 and fit.reached == 1:
        yield f"only one of {fit.starts} starts reached this minimum: more starts may find a better one"
    if not fit.noise_known and fit.degrees_of_freedom < 3:
        yield (
            f"the noise is estimated with {_degrees(fit.degrees_of_freedom)} left: standard errors are rough; give noise, "
            "or measure more"
        )
    yield from local_findings(fit)
    names = fit.common
    correlation = fit.correlation[: len(names), : len(names)]
    for i, j in zip(*np.nonzero(np.triu(np.abs(correlation) > STRONG, 1)), strict=True):
        yield f"{names[i]} and {names[j]} cannot be separated: their correlation is {correlation[i, j]:.3f}"


def _beside_numerical_error(fit: FitStatistics) -> Iterator[str]:
    """Outputs whose estimated noise is hardly larger than the numerical error of what is fitted."""
    if fit.noise_known:
        return
    observed, stds = fit.weighted.observed, np.sqrt(np.diag(fit.noise_covariance))
    for name, i in ((name, names_of(fit.model.outputs).index(name)) for name in fit.tests):
        error = float(fit.numerical_errors[i])
        if stds[i] > NUMERICAL * error:
            continue
        source = (
            f"the tolerance of the trajectories, rtol = {observed.rtol:g}" if fit.model.states else "the rounding of its numbers"
        )
        size = f"only {number(stds[i] / error, 2)} times" if stds[i] > 3 * error else "no larger than"
        advice = "; check with a smaller rtol" if fit.model.states else ""
        yield f"{name}: the estimated noise, {number(stds[i], 2)}, is {size} {source}: standard errors may be due to that{advice}"


# Tables


def _unknowns(fit: FitStatistics) -> Section:
    units, errors, intervals = fit.units, fit.standard_errors, fit.intervals()
    beside = fit.robust_standard_errors if robust_errors_differ(fit) else None
    columns = ("parameter", "unit", "estimate", "std error", *(("robust",) if beside else ()), "RSE", "95 % interval")
    rows: list[tuple[str, ...]] = []
    for name in fit.common:
        value, error, (low, high) = fit.estimate[name], errors[name], intervals[name]
        digits = digits_of(value, error)
        if name in fit.at_bounds:
            rows.append((name, units[name], number(value, digits), "at its bound", *(["-"] if beside else []), "-", "-"))
            continue
        row = [name, units[name], number(value, digits), number(error, 3), *([number(beside[name], 3)] if beside else [])]
        row.append(percent(error / abs(value)) if value else "-")
        rows.append((*row, f"{number(low, min(digits, 6))} to {number(high, min(digits, 6))}"))
    marked = {*fit.at_bounds, *(name for name, error in errors.items() if not np.isfinite(error))}
    title = "Estimates" + ("" if fit.noise_known else ", intervals by Student's t")
    return Section(title, columns, tuple(rows), tuple(i for i, name in enumerate(fit.common) if name in marked))


def _beside_prior(fit: FitStatistics, prior: GaussianPrior) -> Section:
    """Estimate beside the prior: how far the estimate has moved, and what is left of the standard deviation."""
    rows, marked = [], []
    for i, name in enumerate(name for name in fit.parameters if name in prior.names):
        row = [name, fit.units[name], number(prior.mean[name]), number(prior.std[name], 3)]
        rows.append((*row, f"{shift(fit, prior, name):+.2f} std", percent(fit.standard_errors[name] / prior.std[name])))
        if abs(shift(fit, prior, name)) > FAR_OFF:
            marked.append(i)
    columns = ("parameter", "unit", "prior mean", "prior std", "estimate off by", "std error of prior std")
    return Section("Beside the prior", columns, tuple(rows), tuple(marked))


def shift(fit: FitStatistics, prior: GaussianPrior, name: str) -> float:
    """Estimate less prior mean in prior standard deviations; of log-normal ones the difference and the deviation of logarithms."""
    if name in prior.log:
        std = float(prior.normal_std[prior.names.index(name)])
        return float(np.log(fit.estimate[name] / prior.mean[name])) / std
    return (fit.estimate[name] - prior.mean[name]) / prior.std[name]


def _outputs(fit: FitStatistics) -> Section:
    """Residuals of each output beside its noise; with chi-square, where the noise is known."""
    units = {q.name: q.unit for q in fit.model.outputs}
    given, found = (np.sqrt(np.diag(m)) for m in (fit.noise_covariance, fit.residual_covariance))
    expected, more = fit.expected_std, fit.weighted.noise
    if more is not None and not fit.weighted.common:
        given = expected  # noise that grows has no other standard deviation
    places = {name: i for i, name in enumerate(names_of(fit.model.outputs))}
    noise = "noise std" if fit.noise_known else "noise std, estimated"
    assumed = fit.noise_known and not np.allclose(expected, given)
    before = None if fit.apriori_covariance is None else np.sqrt(np.diag(fit.apriori_covariance))
    columns = ["output", "unit", "count", noise, *(["with assumed"] if assumed else [])]
    columns += [*(["a priori (17)"] if before is not None else []), "residual rms (10)", "dof"]
    rows, marked = [], []
    for k, (name, test) in enumerate(fit.tests.items()):
        i = places[name]
        of_noise = [number(given[i]), *([number(expected[i])] if assumed else [])]
        of_noise += [] if before is None else [number(before[i])]
        row = [name, units[name], str(test.count), *of_noise, number(found[i]), f"{test.degrees_of_freedom:.1f}"]
        if fit.noise_known:
            row += [number(test.chi_square), number(test.per_degree_of_freedom, 3)]
            row += ["-" if test.p_value is None else probability(test.p_value)]
            if test.p_value is not None and not OFF <= test.p_value <= 1 - OFF:
                marked.append(k)
        rows.append(tuple(row))
    if fit.noise_known:
        columns += ["chi-square", "per dof", "p"]
    return Section("Outputs", tuple(columns), tuple(rows), tuple(marked))


def _profiles(profiles: Sequence[ProfileCurve]) -> Section:
    level = f"{100 * profiles[0].level:g} %"
    columns = ("parameter", "unit", f"{level} by likelihood", f"{level} by standard error", "lower end", "upper end")
    rows = []
    for profile in profiles:
        intervals = (" to ".join(number(end, 4) for end in pair) for pair in (profile.interval, profile.linear_interval))
        rows.append((profile.name, profile.unit, *intervals, *(end.words for end in profile.ends)))
    marked = tuple(k for k, profile in enumerate(profiles) if set(profile.ends) != {StopReason.converged})
    return Section("Profile likelihood", columns, tuple(rows), marked)


def _noise_correlation(fit: FitStatistics) -> Section:
    """Correlation of the residuals of outputs that were measured together."""
    names, places = list(fit.tests), [names_of(fit.model.outputs).index(name) for name in fit.tests]
    covariance = fit.residual_covariance[np.ix_(places, places)]
    std = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    rows = [(name, *(f"{value:.2f}" for value in row)) for name, row in zip(names, covariance / np.outer(std, std), strict=True)]
    return Section("Correlation of the residuals, (10)", ("output", *names), tuple(rows))


def _degrees(degrees: float) -> str:
    return f"{degrees:.0f} degrees of freedom" if abs(degrees - round(degrees)) < 1e-6 else f"{degrees:.1f} degrees of freedom"
