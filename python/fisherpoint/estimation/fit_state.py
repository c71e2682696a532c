"""What a fit is made from: all that is not computed from the rest, as its file has it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ..basics.checks import as_floats, as_positive, names_among
from ..basics.field_checks import Extents
from ..basics.messages import listed, shown
from ..basics.quantity import names_of
from ..basics.result_files import Codec, Kept
from ..basics.stop_reason import StopReason
from ..basics.values import Array
from ..data.measurements import Measurements
from ..data.record import Record
from ..information.local import Local
from ..models import Model
from ..models.codec import model_from_json, model_to_json
from ..noise.models import NoiseOf, checked_noise
from ..noise.sensors import Sensors
from ..points.settings import resolve_threads
from ..prior.gaussian import GaussianPrior
from .local_spread import beside
from .local_unknowns import LocalUnknowns, of_common
from .local_values import Spread
from .noise_estimate import OutputNoiseEstimate
from .nuisance import Nuisance, known_beforehand
from .observed import Observed, check_outputs
from .sensor_noise import SensorNoise
from .statistics import FitStatistics
from .unknowns import Unknowns, prior_factor
from .weighting import RunError, WeightedResiduals


@dataclass(frozen=True, eq=False)
class FitState(Kept):
    """What a fit is made from; trajectories are computed again when it is read.

    Attributes
    ----------
    model, data, prior, nuisance, theta, values, noise_known, noise, noise_covariance, stop_reason, evaluations, starts, reached
    noise_estimate
        As of `FitStatistics`.
    prior_takes_part : bool
        Whether the prior is in the residuals; else it was only given.
    estimated : tuple of str
        The parameters among the unknowns, without the nuisance ones.
    rtol : float
        Tolerance of the trajectories.
    unknowns : Unknowns
    weights : ndarray, (..., n_y, n_y)
        Covariances by which residuals are weighted.
    common : tuple of RunError
        Errors of all samples of a run.
    weighed_at : ndarray, (N, n_y), or None
        Outputs at which noise that grows is taken, where readings are weighed as normal ones.
    local : mapping of name to Local
        Parameters with a value for each group of the data.
    spread : mapping of name to Spread
        As of `FitStatistics`.
    """

    model: Model
    data: tuple[Measurements | Record, ...]
    prior: GaussianPrior | None
    prior_takes_part: bool
    nuisance: Nuisance
    estimated: tuple[str, ...]
    theta: Array
    values: Array
    rtol: float
    unknowns: Unknowns
    weights: Array
    common: tuple[RunError, ...]
    weighed_at: Array | None
    noise_known: bool
    noise: NoiseOf | None
    noise_covariance: Array
    stop_reason: StopReason
    evaluations: int
    starts: int
    reached: int
    local: Mapping[str, Local]
    spread: Mapping[str, Spread]
    noise_estimate: Mapping[str, OutputNoiseEstimate] | None = None

    _CODEC: ClassVar[Codec] = {Model: (model_to_json, model_from_json)}
    _EXTENTS: ClassVar[Extents] = {
        "theta": ("model.parameters",),
        "values": ("unknowns.names",),
        **{f"unknowns.{name}": ("unknowns.names",) for name in ("center", "scale", "log", "lower", "upper", "has_prior")},
        "weights": ("...", "model.outputs", "model.outputs"),
        "noise_covariance": ("model.outputs", "model.outputs"),
        "common.moved": ("*", "model.outputs", "*"),
        "common.variances": ("*", "model.outputs"),
        "nuisance.starts": ("any model.states",),
        "local": ("any model.parameters",),
        "spread": ("any local",),
    }
    _POSITIVE = ("rtol",)

    @classmethod
    def of(cls, fit: FitStatistics) -> FitState:
        """The state of a fit."""
        unknowns, names, weighted = fit.weighted.unknowns, names_of(fit.model.parameters), fit.weighted
        return cls(
            model=fit.model,
            data=fit.data,
            prior=fit.prior,
            prior_takes_part=fit.prior is not None and weighted.prior_factor is not None,
            nuisance=fit.nuisance,
            estimated=tuple(
                name
                for name in unknowns.names
                if name in names and name not in (*fit.nuisance.uncertain, *weighted.observed.local.local)
            ),
            theta=fit.theta,
            values=fit.values,
            rtol=weighted.observed.rtol,
            unknowns=unknowns,
            weights=weighted.covariance,
            common=weighted.common,
            weighed_at=None if weighted.noise is None else weighted.noise.outputs,
            noise_known=fit.noise_known,
            noise=fit.noise,
            noise_covariance=fit.noise_covariance,
            stop_reason=fit.stop_reason,
            evaluations=fit.evaluations,
            starts=fit.starts,
            reached=fit.reached,
            noise_estimate=fit.noise_estimate,
            local=weighted.observed.local.local,
            spread=fit.spread,
        )

    def fields(self) -> dict[str, Any]:
        """The fields of the fit.

        Raises
        ------
        ValueError
            Where parts do not fit each other, as of a file that was changed.
        """
        model, values = self.model, self.values
        for part in self.data:
            check_outputs(part, model)
        as_floats(self.theta, "theta"), as_floats(values, "values"), as_positive(self.rtol, "rtol")
        names_among(self.estimated, names_of(model.parameters), "estimated")
        joint = self.nuisance.of(model)
        full = joint.theta(self.theta)
        of_groups, common = LocalUnknowns.of(self.local, self.data), (*self.estimated, *joint.nuisance_names)
        observed = Observed(joint.model, self.data, common, full, self.rtol, resolve_threads(None), of_groups)
        if self.unknowns.names != observed.names:
            raise ValueError(f"unknowns: expected {listed(observed.names)}; given {listed(self.unknowns.names)}")
        self._check_numbers(observed)
        prior = of_common(self.prior, self.local) if self.prior_takes_part else None
        rows = of_groups.spread_rows(self.unknowns, {name: one.std for name, one in self.spread.items()})
        factor = beside(prior_factor(known_beforehand(prior, joint, full), self.unknowns), rows)
        weighted = WeightedResiduals(observed, self.unknowns, observed.y[None], self.weights, factor, self.common, self._noise())
        response = observed.respond(values[None])
        kept = ("model", "data", "prior", "nuisance", "theta", "values", "noise_known", "noise", "noise_covariance", "stop_reason")
        return {
            **{name: getattr(self, name) for name in (*kept, "evaluations", "starts", "reached", "noise_estimate", "spread")},
            "predicted": response.y[0],
            "residuals": observed.y - response.y[0],
            "weighted": weighted,
        }

    def _noise(self) -> SensorNoise | None:
        """The noise of sensors that are more than white."""
        if self.noise is None or self.weighed_at is None:
            return None
        names = names_of(self.model.outputs)
        sensors, samples = Sensors.of(checked_noise(self.noise, names), names), sum(len(part.samples) for part in self.data)
        anew = bool(self.common) or self.weights.ndim > 2
        noise = SensorNoise.of(sensors, self.data, anew, resolve_threads(None))
        if self.weighed_at.shape != (samples, len(names)):
            raise ValueError(f"weighed_at: expected shape ({samples}, {len(names)}), given {self.weighed_at.shape}")
        return None if noise is None else noise.at(as_floats(self.weighed_at, "weighed_at"))

    def _check_numbers(self, observed: Observed) -> None:
        """Raise ValueError where numbers are none that a fit can have."""
        as_floats(self.unknowns.center, "unknowns.center"), as_floats(self.noise_covariance, "noise_covariance")
        if not (as_floats(self.unknowns.scale, "unknowns.scale") > 0).all():
            raise ValueError(f"unknowns.scale: expected positive numbers, given {shown(self.unknowns.scale.tolist())}")
        shape = (1, len(observed.y), *self.noise_covariance.shape)
        if self.weights.ndim > 4 or np.broadcast_shapes(self.weights.shape, shape) != shape:
            raise ValueError(f"weights: expected covariances of {len(observed.y)} samples, given shape {self.weights.shape}")
        np.linalg.cholesky(as_floats(self.weights, "weights"))
        for error in self.common:
            if error.first + len(as_floats(error.moved, "common.moved")) > len(observed.y):
                raise ValueError(f"common: expected parts of {len(observed.y)} samples, given one from {error.first} on")
