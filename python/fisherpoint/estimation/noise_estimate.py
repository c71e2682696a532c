"""Noise that was found in residuals: its form and numbers, and what their uncertainty does to standard errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..basics.values import Array, FrozenMapping
from ..data.measurements import Measurements
from ..data.record import Record
from ..noise.models import GaussMarkov, Noise
from ..noise.sensors import Sensors
from .noise_forms import FORMS, NoiseForm
from .precision import Precision
from .restricted_likelihood import OutputNoise
from .sensor_noise import SensorNoise
from .weighting import WeightedResiduals

STEP = 0.05
"""Step of the logarithms of the noise's numbers by which standard errors are differentiated."""

FEWEST_DEGREES = 1.0
"""Degrees of freedom that a standard error has at least: of one whose noise the data hardly show."""


@dataclass(frozen=True, eq=False)
class OutputNoiseEstimate:
    """The noise that was found in the residuals of one output.

    Attributes
    ----------
    form : str
        "white", "growing", "memory", "white, memory", "growing, memory", "two memories" or "white, two memories".
    values : mapping of str to float
        "std", "relative", "std of memory", "correlation time" and so on, SI units.
    log_covariance : ndarray, (k, k)
        Covariance of the logarithms of the values; inf where the data hardly show them.
    tried : mapping of form to float
        By how much the penalised deviance, -2 log L + k log n, of each form is above the least.
    correlation_times : float
        Length of all runs and records in the longest correlation time; inf without a memory.
    """

    form: str
    values: Mapping[str, float]
    log_covariance: Array
    tried: Mapping[str, float]
    correlation_times: float

    @property
    def noise(self) -> Noise:
        """As `estimate` takes it."""
        return noise_of(_form(self.form).noise(np.log(list(self.values.values()))))

    @property
    def standard_errors(self) -> Mapping[str, float]:
        """Standard errors of the values."""
        errors = np.sqrt(np.diag(self.log_covariance)) * np.array(list(self.values.values()))
        return FrozenMapping(dict(zip(self.values, errors.tolist(), strict=True)))


def noise_of(found: OutputNoise) -> Noise:
    """The noise as a user says it."""
    return Noise(found.std, relative=min(found.relative, 1.0), colored=[GaussMarkov(*part) for part in found.parts])


def _form(name: str) -> NoiseForm:
    return next(form for form in FORMS if form.name == name)


def student_degrees(
    weighted: WeightedResiduals,
    z: Array,
    held: NDArray[np.bool_],
    outputs: Sequence[str],
    data: Sequence[Measurements | Record],
    found: Mapping[str, OutputNoiseEstimate],
) -> Array:
    """Degrees of freedom (P,) of Student's t for the standard errors at coordinates z (P,), by Satterthwaite's formula.

    The logarithm of an unknown's variance has the variance g^T C g, with its derivatives g by the logarithms of the noise's
    numbers, which have the covariance C. That of chi-square with nu degrees of freedom has about 2 / nu.
    """
    values = weighted.unknowns.values(z[None])
    response = weighted.observed.respond(values)

    def log_variances(name: str, k: int, step: float) -> Array:
        noise: dict[str, float | Noise] = {}
        for other, one in found.items():
            logs = np.log(list(one.values.values()))
            if other == name:
                logs[k] += step
            noise[other] = noise_of(_form(one.form).noise(logs))
        of_samples = SensorNoise.of(Sensors.of(noise, outputs), data, False, 1)
        if of_samples is None:
            raise AssertionError("noise that is found here is more than white")
        of_samples = of_samples.at(response.y[0])
        rows = weighted.weighed(of_samples.covariance, (), of_samples).rows(values, response)
        with np.errstate(divide="ignore"):
            return np.asarray(np.log(np.diag(Precision.of(rows, held).covariance)))

    spread = np.zeros(len(z))
    for name, one in found.items():
        g = []
        for k in range(len(one.values)):
            with np.errstate(invalid="ignore"):
                g.append((log_variances(name, k, STEP) - log_variances(name, k, -STEP)) / (2 * STEP))
        derivatives = np.nan_to_num(np.array(g))
        known = np.isfinite(one.log_covariance).all()
        spread += np.einsum("kp,kl,lp->p", derivatives, one.log_covariance, derivatives) if known else np.inf
    with np.errstate(divide="ignore"):
        return np.maximum(2 / spread, FEWEST_DEGREES)
