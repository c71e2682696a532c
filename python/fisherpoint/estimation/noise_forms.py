"""Forms that the noise of an output may have, and the most likely one of each: by restricted likelihood and its penalty.

Of all forms that one counts as found which has the least -2 log L + k log n, with k numbers and n samples less what the unknowns
take up (Schwarz 1978): a further number must pay for itself, and the more so the longer the data are.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..basics.values import Array
from .restricted_likelihood import OutputNoise, RestrictedLikelihood

SHORTEST, LONGEST = 0.1, 1.0
"""Correlation times that are tried: from this share of a step, to this share of the longest series."""

SHARES = (0.95, 0.7, 0.3)
"""Shares of the variance that has a memory, at first."""

TIMES = 9
"""Correlation times at first."""

FEWEST = 20
"""Samples, less what the unknowns take up, from which on more than a variance is looked for."""

STEP = 0.05
"""Step of the logarithms of a noise's numbers by which the likelihood is differentiated."""


@dataclass(frozen=True)
class NoiseForm:
    """A form of noise.

    Attributes
    ----------
    name : str
    white : bool
        Whether there is a white part.
    grows : bool
        Whether it grows with the output.
    parts : int
        Number of parts with a memory.
    """

    name: str
    white: bool
    grows: bool
    parts: int

    @property
    def size(self) -> int:
        """Number of numbers that it has."""
        return self.white + self.grows + 2 * self.parts

    def noise(self, logs: Array) -> OutputNoise:
        """The noise of the logarithms of its numbers: standard deviation, relative, then (std, correlation time) of parts."""
        given = iter(np.exp(logs).tolist())
        std = next(given) if self.white else 0.0
        relative = next(given) if self.grows else 0.0
        return OutputNoise(std, relative, tuple((next(given), next(given)) for _ in range(self.parts)))

    def logs(self, noise: OutputNoise) -> Array:
        """The logarithms of the numbers of a noise of this form."""
        numbers = [noise.std] * self.white + [noise.relative] * self.grows + [number for part in noise.parts for number in part]
        found: Array = np.log(np.maximum(numbers, 1e-300))
        return found

    @property
    def labels(self) -> tuple[str, ...]:
        """What its numbers are."""
        numbers = (" 1", " 2") if self.parts > 1 else ("",) * self.parts
        own = ("std",) * self.white + ("relative",) * self.grows
        return own + tuple(f"{label}{number}" for number in numbers for label in ("std of memory", "correlation time"))


WHITE = NoiseForm("white", True, False, 0)
MEMORY = NoiseForm("memory", False, False, 1)
WHITE_AND_MEMORY = NoiseForm("white, memory", True, False, 1)
FORMS = (
    WHITE,
    NoiseForm("growing", True, True, 0),
    MEMORY,
    WHITE_AND_MEMORY,
    NoiseForm("growing, memory", True, True, 1),
    NoiseForm("two memories", False, False, 2),
    NoiseForm("white, two memories", True, False, 2),
)


@dataclass(frozen=True, eq=False)
class FormOfNoise:
    """The most likely noise of a form.

    Attributes
    ----------
    form : NoiseForm
    noise : OutputNoise
    deviance : float
        -2 log L.
    penalised : float
        With k log n.
    """

    form: NoiseForm
    noise: OutputNoise
    deviance: float
    penalised: float


def likely_forms(likelihood: RestrictedLikelihood) -> list[FormOfNoise]:
    """The most likely noise of each form that the data may show, from the least penalised deviance on."""
    several, found = likelihood.degrees_of_freedom >= FEWEST, []
    for form in FORMS:
        if form is WHITE or (several and (not form.parts or likelihood.step > 0)):
            found.append(most_likely(likelihood, form))
    return sorted(found, key=lambda one: one.penalised)


def most_likely(likelihood: RestrictedLikelihood, form: NoiseForm) -> FormOfNoise:
    """The most likely noise of a form."""
    starts = list(_starts(likelihood, form))
    values = [likelihood.best_scale(_noise_of_shape(form, start, likelihood))[1] for start in starts]
    noise, deviance = _descended(likelihood, form, starts[int(np.argmin(values))])
    penalty = form.size * float(np.log(max(likelihood.degrees_of_freedom, 2)))
    return FormOfNoise(form, noise, deviance, deviance + penalty)


def again(likelihood: RestrictedLikelihood, before: FormOfNoise) -> FormOfNoise:
    """The most likely noise of the same form, from where it was."""
    noise, deviance = _descended(likelihood, before.form, _shape_of(before.form, before.noise, likelihood))
    return FormOfNoise(before.form, noise, deviance, deviance + before.penalised - before.deviance)


def log_covariance(likelihood: RestrictedLikelihood, found: FormOfNoise) -> Array:
    """Covariance (k, k) of the logarithms of the noise's numbers, by the likelihood's second derivatives; inf where it is flat."""
    form, center = found.form, found.form.logs(found.noise)
    k = form.size

    def deviance(change: Array) -> float:
        return likelihood.deviance(form.noise(center + STEP * change))

    unit, at = np.eye(k), deviance(np.zeros(k))
    ways = [(deviance(e), deviance(-e)) for e in unit]
    second = np.empty((k, k))
    for i in range(k):
        second[i, i] = ways[i][0] + ways[i][1] - 2 * at
        for j in range(i):
            both = deviance(unit[i] + unit[j]) + deviance(-unit[i] - unit[j])
            second[i, j] = second[j, i] = (both - sum(ways[i]) - sum(ways[j]) + 2 * at) / 2
    sizes, directions = np.linalg.eigh(second / (2 * STEP**2))
    if not np.isfinite(sizes).all() or sizes[0] <= 1e-6 * max(sizes[-1], 1e-300):
        return np.full((k, k), np.inf)
    covariance: Array = (directions / sizes) @ directions.T
    return covariance


def _descended(likelihood: RestrictedLikelihood, form: NoiseForm, start: Array) -> tuple[OutputNoise, float]:
    """Downhill from a shape: what is not a scale, which is known for each."""
    from scipy.optimize import minimize

    if len(start):
        simplex = np.vstack([start, start + 0.3 * np.eye(len(start))])
        options: Any = {"xatol": 1e-4, "fatol": 1e-5, "maxfev": 400, "initial_simplex": simplex}
        start = minimize(  # type: ignore[call-overload]
            lambda shape: likelihood.best_scale(_noise_of_shape(form, shape, likelihood))[1],
            start,
            method="Nelder-Mead",
            options=options,
        ).x
    return likelihood.best_scale(_noise_of_shape(form, start, likelihood))


def _noise_of_shape(form: NoiseForm, shape: Array, likelihood: RestrictedLikelihood) -> OutputNoise:
    """Noise by logarithms of correlation times, logits of the shares that have a memory, and the logarithm of growth."""
    times = _bounded(shape[: form.parts], likelihood)
    shares = _shares(form, shape)
    rest, parts = 1.0, []
    for time, share in zip(times, shares, strict=True):
        parts.append((float(np.sqrt(rest * share)), float(time)))
        rest *= 1 - share
    std = float(np.sqrt(rest)) if form.white else 0.0
    growth = float(np.exp(np.clip(shape[-1], -12.0, 12.0))) / _size(likelihood) if form.grows else 0.0
    return OutputNoise(std, std * growth, tuple(parts))


def _shape_of(form: NoiseForm, noise: OutputNoise, likelihood: RestrictedLikelihood) -> Array:
    shape = [float(np.log(time)) for _, time in noise.parts]
    rest = noise.std**2 + sum(std**2 for std, _ in noise.parts)
    for k, (std, _) in enumerate(noise.parts):
        if form.white or k + 1 < form.parts:
            share = min(max(std**2 / rest, 1e-6), 1 - 1e-6)
            shape.append(float(np.log(share / (1 - share))))
            rest -= std**2
    if form.grows:
        shape.append(float(np.log(max(noise.relative / noise.std * _size(likelihood), 1e-5))))
    return np.array(shape)


def _shares(form: NoiseForm, shape: Array) -> list[float]:
    """Share of each part in what the parts before it leave of the variance; the last one takes all where nothing is white."""
    count = form.parts if form.white else max(form.parts - 1, 0)
    logits = np.clip(shape[form.parts : form.parts + count], -14.0, 14.0)
    return [*(1 / (1 + np.exp(-logits))).tolist(), *[1.0] * (form.parts - count)]


def _bounded(log_times: Array, likelihood: RestrictedLikelihood) -> Array:
    if not len(log_times):
        return log_times
    low, high = SHORTEST * likelihood.step, LONGEST * float(likelihood.spans.max())
    return np.exp(np.clip(log_times, np.log(low), np.log(max(high, low))))


def _size(likelihood: RestrictedLikelihood) -> float:
    return float(np.sqrt(np.mean(np.square(likelihood.outputs)))) or 1.0


def _starts(likelihood: RestrictedLikelihood, form: NoiseForm) -> Iterator[Array]:
    growths = [[-2.0], [0.0], [2.0]] if form.grows else [[]]
    logits = [np.log(share / (1 - share)) for share in SHARES]
    low, high = (np.log(factor) for factor in (0.5 * likelihood.step or 1.0, LONGEST * float(likelihood.spans.max()) or 1.0))
    times = np.linspace(low, max(high, low), TIMES)
    for growth in growths:
        if not form.parts:
            yield np.array(growth)
        elif form.parts == 1:
            for time in times:
                for logit in logits if form.white else [None]:
                    yield np.array([time, *([] if logit is None else [logit]), *growth])
        else:
            for k, first in enumerate(times[::2]):
                for second in times[::2][k + 1 :]:
                    for logit in logits:
                        yield np.array([first, second, logit, *([0.0] if form.white else [])])
