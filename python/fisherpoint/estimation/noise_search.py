"""A fit with noise that is looked for: the form of each output's noise, its numbers, and the estimate that it weighs, in turn."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from ..basics.quantity import names_of
from ..basics.stop_reason import StopReason
from ..basics.values import FrozenMapping
from ..noise.models import Noise
from .fit import Fit
from .noise_estimate import OutputNoiseEstimate, noise_of
from .noise_forms import WHITE, FormOfNoise, again, likely_forms, log_covariance
from .residual_checks import OFF
from .restricted_likelihood import RestrictedLikelihood
from .sensor_noise import times_and_series

ROUNDS = 20
"""How often at most noise and estimate are found in turn."""

CHOSEN_ANEW = 3
"""Rounds in which the form is chosen anew; then it stays."""

SETTLED = 1e-3
"""Change of the logarithms of the noise's numbers from which on they are the same."""


def with_noise_found(fit: Fit, refitted: Callable[[Fit, Mapping[str, Noise]], Fit]) -> Fit:
    """The fit with the smallest noise that its residuals may be.

    Parameters
    ----------
    fit : Fit
        With white noise, estimated.
    refitted : callable
        The fit with given noise, from the estimate of another fit.
    """
    outputs = [j for j in range(len(fit.model.outputs)) if np.isfinite(fit.residuals[:, j]).any()]
    names = names_of(fit.model.outputs)
    tried = {j: likely_forms(_likelihood(fit, j)) for j in outputs}
    found = {j: forms[0] for j, forms in tried.items()}
    larger: set[int] = set()
    for _ in range(3):  # forms that leave residuals that are not white make room for larger ones
        if all(one.form is WHITE for one in found.values()):
            break
        fit, found, tried = _settled(fit, found, tried, refitted, larger)
        colored = [j for j in outputs if _is_colored(fit, names[j]) and _next(tried[j], found[j]) is not None]
        if not colored:
            break
        larger |= set(colored)
        found |= {j: following for j in colored if (following := _next(tried[j], found[j])) is not None}
    of_outputs = {names[j]: _estimate(fit, j, one, tried[j]) for j, one in found.items()}
    return replace(fit, noise_estimate=FrozenMapping(of_outputs))


def _settled(
    fit: Fit,
    found: dict[int, FormOfNoise],
    tried: dict[int, list[FormOfNoise]],
    refitted: Callable[[Fit, Mapping[str, Noise]], Fit],
    larger: set[int],
) -> tuple[Fit, dict[int, FormOfNoise], dict[int, list[FormOfNoise]]]:
    """The fit at which noise and estimate belong to each other."""
    names = names_of(fit.model.outputs)
    for number in range(ROUNDS):
        fit = refitted(fit, {names[j]: noise_of(one.noise) for j, one in found.items()})
        latest = {}
        for j, one in found.items():
            likelihood = _likelihood(fit, j)
            if number < CHOSEN_ANEW and j not in larger:
                tried[j] = likely_forms(likelihood)
                latest[j] = tried[j][0]
            else:
                latest[j] = again(likelihood, one)
        if all(_same(one, latest[j]) for j, one in found.items()):
            return fit, found, tried
        found = latest
    return replace(fit, stop_reason=StopReason.weights_changed), found, tried


def _likelihood(fit: Fit, output: int) -> RestrictedLikelihood:
    response = fit.weighted.observed.respond(fit.values[None])
    there = np.isfinite(fit.residuals[:, output])
    local, common = fit.weighted.observed.local, fit.weighted.observed.common
    places = local.samples[there]
    free = np.broadcast_to(~fit.held[:common], (len(places), common))
    own = ~fit.held[common:][places] if local.each else np.ones(places.shape, dtype=bool)
    jacobian = (response.dy * fit.weighted.slopes(fit.values[None]))[0, there, output] * np.concatenate([free, own], axis=1)
    times, series = times_and_series(fit.data)
    samples = fit.residuals[there, output], jacobian, times[there], fit.predicted[there, output], series[there]
    return RestrictedLikelihood.of(*samples, places if local.each else None)


def _same(one: FormOfNoise, other: FormOfNoise) -> bool:
    if one.form is not other.form:
        return False
    return bool(np.abs(one.form.logs(one.noise) - other.form.logs(other.noise)).max() <= SETTLED)


def _is_colored(fit: Fit, name: str) -> bool:
    check = fit.residual_checks.get(name)
    return check is not None and check.series_p_value is not None and check.series_p_value < OFF


def _next(forms: list[FormOfNoise], one: FormOfNoise) -> FormOfNoise | None:
    """The likeliest form with more numbers."""
    return next((other for other in forms if other.form.size > one.form.size), None)


def _estimate(fit: Fit, output: int, one: FormOfNoise, tried: list[FormOfNoise]) -> OutputNoiseEstimate:
    likelihood = _likelihood(fit, output)
    values = np.exp(one.form.logs(one.noise)).tolist()
    least = min(form.penalised for form in tried)
    longest = max((time for _, time in one.noise.parts), default=0.0)
    return OutputNoiseEstimate(
        form=one.form.name,
        values=FrozenMapping(dict(zip(one.form.labels, values, strict=True))),
        log_covariance=log_covariance(likelihood, one),
        tried=FrozenMapping({form.form.name: form.penalised - least for form in tried}),
        correlation_times=float(likelihood.spans.sum()) / longest if longest else np.inf,
    )
