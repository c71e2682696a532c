"""The fits of one design's virtual data, all advanced together."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..basics.quantity import names_of
from ..basics.values import Array, FrozenMapping
from ..data.measurements import Measurements
from ..estimation.known_noise import KnownNoise
from ..estimation.least_squares import CONVERGED, ENDS, UNNOTICED
from ..estimation.local_spread import beside
from ..estimation.local_unknowns import LocalUnknowns, of_common
from ..estimation.nuisance import known_beforehand, nuisance_of
from ..estimation.observed import Observed
from ..estimation.precision import Precision, covariances, in_words, quantile
from ..estimation.response import Response
from ..estimation.search import evaluable_starts
from ..estimation.sensor_noise import SensorNoise
from ..estimation.small_samples import inflated, output_degrees_of_freedom, unbiased
from ..estimation.unknown_noise import check_noise_is_determined, correlations_can_be_estimated
from ..estimation.unknowns import Unknowns, checked_bounds, prior_factor, unknowns_of
from ..estimation.weighting import WeightedResiduals
from ..information.local import RECORD, RUN, Local
from ..information.problem import DesignProblem
from ..information.run_information import information_of
from ..information.uneven_readings import covariance_over, draws, past_row
from ..noise.models import NoiseOf, outputs_of
from ..noise.sensors import Sensors
from ..points.points_or_runs import Points, as_runs
from ..points.status import Status
from .figures import LEVEL
from .fit_accuracy import EXACT, accuracy_of
from .searches import Searched, Searches
from .truths import Rig, Streams

MOST_NUMBERS = 16_000_000
"""Entries of the Jacobians of the problems that are advanced at once, so that memory stays bounded."""

NO_LABELS: Mapping[str, tuple[str, ...]] = FrozenMapping({})

STARTS = 8
"""Starts of a search at most, as `estimate` has by default."""

SEVERAL = 16
"""Places of outputs at which is seen what rounded and limited readings determine."""

NO_DATA = "the true trajectory"
"""Beginning of the reason of a virtual experiment that gave no data."""

WRONG = "a wrong minimum: from the true parameters, the search ends lower"
"""Why a fit that ended at a minimum counts as failed."""


class VirtualFits(NamedTuple):
    """n virtual experiments and their fits; P estimated parameters, without the nuisance ones, and L values of local parameters.

    estimate and standard_error (n, P) in SI units, covered (n, P) by an interval that has ends, at_bound (n, P), and why a fit
    failed (n,), an empty string for one that did not. The estimate of one that did is where its search ended, NaN where there were
    no data; its other numbers mean nothing. Of local parameters the errors of their estimates, standard errors, and whether
    intervals cover the truth, (n, L): all values of one parameter after those of another.
    """

    truth: Array
    estimate: Array
    standard_error: Array
    covered: NDArray[np.bool_]
    at_bound: NDArray[np.bool_]
    failure: NDArray[np.str_]
    local_error: Array
    local_standard_error: Array
    local_covered: NDArray[np.bool_]

    @classmethod
    def none(cls, n_parameters: int, n_local: int = 0, failure: NDArray[np.str_] | None = None) -> VirtualFits:
        """Experiments without fits, by default none at all."""
        failure = np.empty(0, dtype=np.str_) if failure is None else failure
        blank, own = (np.full((len(failure), n), np.nan) for n in (n_parameters, n_local))
        flags = blank > 0
        return cls(blank, blank.copy(), blank.copy(), flags, flags.copy(), failure, own, own.copy(), own > 0)


@dataclass(frozen=True, eq=False)
class Estimator:
    """Estimator that turns the data of one design into estimates.

    Attributes
    ----------
    residuals : WeightedResiduals
        Its data are replaced; the covariance is that of the known noise.
    starts : ndarray, (k, P)
        In coordinates; first the prior mean, then nodes spread over the prior, for searches that get stuck or end wrong.
    noise_known : bool
    promise : Precision
        What the noise and the points promise at the prior mean.
    nuisance : int
        So many unknowns behind the parameters are constants of the plant that are not known exactly, and starts that all runs
        share.
    solved : float
        Distance to the minimum, in standard errors, at which a fit ends.
    """

    residuals: WeightedResiduals
    starts: Array
    noise_known: bool
    promise: Precision
    nuisance: int = 0
    solved: float = EXACT.solved

    @classmethod
    def of(
        cls,
        problem: DesignProblem,
        points: Points,
        noise: NoiseOf,
        noise_known: bool,
        use_prior: bool,
        rtol: float | None,
        threads: int,
        over_prior: bool = False,
        labels: Mapping[str, tuple[str, ...]] = NO_LABELS,
    ) -> Estimator:
        model, names = problem.model, problem.estimated
        outputs = names_of(model.outputs)
        blank_of = _blank(points, np.array([0.0 if name in outputs_of(noise) else np.nan for name in outputs]))
        local = {name: Local(RUN if one.by == RECORD else one.by, spread=one.std) for name, one in problem.local_parameters.items()}
        words = dict.fromkeys(one.by for one in local.values() if one.by != RUN)
        data = Measurements(points, blank_of, labels={word: labels.get(word, ("1",) * len(points)) for word in words})
        blank, of_groups, prior = data.samples, LocalUnknowns.of(local, [data]), of_common(problem.prior, local)
        nuisance, starts_anew = nuisance_of(problem.uncertain, problem.initial_state_std, problem.shared_starts)
        joint = nuisance.of(model)
        theta = joint.theta(problem.theta)
        enough, solved = accuracy_of(joint.model, len(names) + len(joint.nuisance_names))
        rtol = enough if rtol is None else rtol
        observed = Observed(joint.model, [data], (*names, *joint.nuisance_names), theta, rtol, threads, of_groups)
        if not noise_known:
            check_noise_is_determined(observed, prior if use_prior else None)
        information_of(problem, data.runs, threads)  # which must be there
        places = names_of(joint.model.parameters)
        own = {name: float(theta[places.index(name)]) for name in (*names, *joint.nuisance_names, *local)}
        mean = {name: of_groups.starts(own)[name] for name in observed.names}
        bounds = of_groups.bounds(checked_bounds(joint.model, None, tuple(own)))
        about = of_groups.coordinates(own, problem.prior)
        unknowns = unknowns_of(mean, known_beforehand(prior, joint, theta), {}, bounds, about)
        factor = prior_factor(known_beforehand(prior if use_prior else None, joint, theta), unknowns)
        spreads = {name: one.std for name, one in local.items() if one.std is not None}
        factor = beside(factor, of_groups.spread_rows(unknowns, spreads))
        sensors = Sensors.of(noise, outputs)
        covariance, varies = np.diag(np.square(sensors.nominal_std)), problem.varies
        more = SensorNoise.of(sensors, [data], bool(varies or starts_anew), threads)
        known = KnownNoise(joint.model, (data,), covariance, more, varies, starts_anew, problem.deviations.rule, rtol, threads)
        residuals = WeightedResiduals(observed, unknowns, blank[None], covariance, factor)
        starts = evaluable_starts(observed, unknowns, mean, prior, STARTS)
        residuals = known.weighed(residuals, starts[0])
        values = unknowns.values(starts[:1])
        response = observed.respond(values)
        promise = Precision.of(residuals.rows(values, response))
        if over_prior and residuals.uneven is not None:
            correlation = np.eye(len(unknowns))
            correlation[: len(names), : len(names)] = problem.prior.marginal(names).correlation
            promise = _over_prior(residuals, values, response, correlation, use_prior)
        return cls(residuals, starts, noise_known, promise, len(joint.nuisance), solved)

    @property
    def unknowns(self) -> Unknowns:
        return self.residuals.unknowns

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the P estimated parameters."""
        return self.unknowns.names[: self.residuals.observed.common - self.nuisance]

    @property
    def local(self) -> LocalUnknowns:
        """The values of local parameters, which are the last unknowns."""
        return self.residuals.observed.local

    @property
    def promised_errors(self) -> Array:
        """Standard errors (P,) in SI units at the prior mean; NaN for what the points do not determine."""
        return self._promised_errors[: len(self.parameters)]

    @property
    def local_errors(self) -> Mapping[str, Array]:
        """Standard errors in SI units, as promised, of the values of each local parameter."""
        own = self._promised_errors[self.residuals.observed.common :]
        return {name: own[self.local.of_parameter(name)] for name in self.local.local}

    @property
    def _promised_errors(self) -> Array:
        slopes = self.unknowns.slopes(self.unknowns.values(self.starts[:1]))[0]
        errors: Array = np.sqrt(np.diag(self.promise.covariance)) * slopes
        return np.where(self.promise.determined, errors, np.nan)

    @property
    def promises(self) -> bool:
        """Whether the points determine a parameter."""
        return bool(self.promise.determined[: len(self.parameters)].any())

    @property
    def null_directions(self) -> tuple[str, ...]:
        """Combinations that the points leave open at the prior mean, in words."""
        values = self.unknowns.values(self.starts[:1])
        return in_words(self.promise.null, self.unknowns.slopes(values)[0], values[0], self.unknowns.names)

    @property
    def at_once(self) -> int:
        """How many experiments may be fitted together; two searches of each are advanced at once."""
        return max(1, MOST_NUMBERS // (2 * int(self.residuals.y[0].size) * len(self.unknowns)))

    @property
    def start(self) -> Array:
        """The prior mean in coordinates, (P,)."""
        start: Array = self.starts[0]
        return start

    def searched(self, residuals: WeightedResiduals, truth: Array) -> Searched:
        """The minima of experiments whose truth is (B, P) in coordinates."""
        return Searches(residuals, self.noise_known, self.starts, self.solved).searched(truth)

    def fit(self, y: Array, truth: Array) -> VirtualFits:
        """Fit data (B, N, n_y) of true unknowns, the nuisance and local ones with them."""
        unknowns, residuals = self.unknowns, replace(self.residuals, y=y)
        true = unknowns.coordinates(truth)
        found = self.searched(residuals, true)
        minima, everything = found.minima, np.arange(len(y))
        if not self.noise_known:
            residuals = replace(residuals, covariance=found.noise[:, None])
        _, jacobian, _ = residuals.scores(minima.z, everything)
        held = unknowns.held(minima.z)
        covariance, determined = covariances(jacobian, held)
        degrees_of_freedom = np.full(minima.z.shape, np.inf)
        if not self.noise_known:
            counts = residuals.measured.sum(axis=0)
            degrees = output_degrees_of_freedom(self._of_data(jacobian), covariance, counts)
            residuals = replace(residuals, covariance=unbiased(found.noise, degrees, counts)[:, None])
            _, jacobian, _ = residuals(minima.z, everything)
            covariance, determined = covariances(jacobian, held)
            full = correlations_can_be_estimated(residuals.measured, len(unknowns))
            covariance, degrees_of_freedom = inflated(self._of_data(jacobian), covariance, counts, full)
        spread = np.where(determined, np.sqrt(np.einsum("bii->bi", covariance)), np.inf)
        estimate = unknowns.values(minima.z)
        within = np.abs(minima.z - true) <= quantile(LEVEL, degrees_of_freedom) * spread
        common = self.residuals.observed.common
        # A value of a local parameter that no sample notices is nothing to the others.
        fine = (minima.end == CONVERGED) | ((minima.end == UNNOTICED) & determined[:, :common].all(axis=1))
        ends = [
            (WRONG if wrong else "") if good else ENDS[int(end)].words
            for end, wrong, good in zip(minima.end, found.wrong, fine, strict=True)
        ]
        own, local = slice(0, len(self.parameters)), slice(common, None)
        errors = spread * unknowns.slopes(estimate)
        return VirtualFits(
            truth[:, own],
            estimate[:, own],
            errors[:, own],
            (within & determined)[:, own],
            held[:, own],
            np.array(ends, dtype=np.str_),
            (estimate - truth)[:, local],
            errors[:, local],
            (within & determined)[:, local],
        )

    def _of_data(self, jacobian: Array) -> Array:
        """The rows of Jacobians (B, M, P) that belong to the data, (B, N, n_y, P)."""
        shape = self.residuals.y.shape[1:]
        return jacobian[:, : shape[0] * shape[1]].reshape(len(jacobian), *shape, -1)


def _over_prior(residuals: WeightedResiduals, values: Array, response: Response, correlation: Array, with_prior: bool) -> Precision:
    """The promise of rounded and limited readings: the mean over where a prior (P, P) in coordinates has the outputs."""
    factor = np.linalg.cholesky(correlation)
    places = draws(len(factor), response.y.size) @ factor.T
    several = np.concatenate([residuals.rows(values, response, place) for place in places[:SEVERAL]])
    promise = Precision.of(several / np.sqrt(SEVERAL))
    if not promise.determined.all():
        return promise
    inverse = np.linalg.solve(factor, np.eye(len(factor)))
    of_prior = np.zeros((0, len(factor))) if with_prior else inverse
    dy, sensors = response.dy * residuals.slopes(values), residuals.uneven
    alike = sensors is not None and dy.shape[-1] == len(factor)  # no local parameters: each unknown has one column

    def informations() -> Iterator[tuple[Array, Array]]:
        for place in places:
            rows, beside = residuals.rows(values, response, place), of_prior
            if sensors is not None and alike:
                past = past_row(sensors, response.y, dy @ factor, residuals.measured, inverse @ place)
                beside = np.concatenate([of_prior, past[None] @ inverse])
            yield rows.T @ rows, beside.T @ beside

    return replace(promise, covariance=covariance_over(informations(), of_prior.T @ of_prior))


def _blank(points: Points, of_sample: Array) -> Array:
    """Outputs of points or runs that are the same at every sample."""
    there = as_runs(points).readings
    return np.where(there.reshape(*points.dt.shape, -1), of_sample, np.nan)


@dataclass(frozen=True, eq=False)
class VirtualExperiments:
    """Virtual experiments with one design."""

    estimator: Estimator
    rig: Rig
    points: Points
    threads: int

    def truth(self, theta: Array) -> Array:
        """True values (n, P) of the estimated parameters, of true parameters theta (n, p)."""
        return theta[:, [names_of(self.rig.model.parameters).index(name) for name in self.estimator.parameters]]

    def passed(self, theta: Array, streams: Streams) -> None:
        """Draw the random numbers of virtual experiments and drop them."""
        self.rig.local_values(theta, self.estimator.local, streams)
        self.rig.deviations(self.points, len(theta), streams)

    def run(self, theta: Array, streams: Streams) -> VirtualFits:
        """Measure the points at true parameters theta (n, p), and fit the data of each virtual experiment."""
        estimator, known = self.estimator, self.truth(theta)
        local = self.rig.local_values(theta, estimator.local, streams)
        of_runs = self.rig.of_runs(theta, estimator.local, local)
        y, status, deviations = self.rig.measure(self.points, of_runs, streams, self.threads)
        of_nuisance = np.tile(estimator.unknowns.center[known.shape[1] :][: estimator.nuisance], (len(theta), 1))
        if deviations.shape[1]:  # a true model of its own has its own constants
            of_nuisance += deviations
        truth = np.concatenate([known, of_nuisance, local], axis=1)
        failure = np.array([f"{NO_DATA}: {Status(int(code)).name}" for code in status], dtype="<U80")
        ok = status == Status.ok
        found = VirtualFits.none(known.shape[1], local.shape[1], failure)._replace(truth=known)
        if ok.any():
            for whole, part in zip(found[1:], estimator.fit(y[ok], truth[ok])[1:], strict=True):
                whole[ok] = part
        return found._replace(failure=np.array(failure.tolist(), dtype=np.str_))  # no longer than needed


def together(parts: Sequence[VirtualFits]) -> VirtualFits:
    """The fits of all parts, one after the other."""
    return VirtualFits(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))
