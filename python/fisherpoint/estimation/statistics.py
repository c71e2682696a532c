"""The statistics of a fit: covariance, intervals, degrees of freedom, tests of the residuals, and directions that stay open."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..basics.checks import as_probability
from ..basics.quantity import names_of
from ..basics.stop_reason import StopReason
from ..basics.values import Array, FrozenMapping, relative_errors
from ..data.measurements import Measurements
from ..data.record import Record
from ..models import Model
from ..noise.models import NoiseOf
from ..prior.gaussian import GaussianPrior
from .apriori_covariance import apriori_covariance
from .bordered import BorderedTangent
from .local_values import NO_SPREAD, LocalValue, Spread
from .noise_estimate import OutputNoiseEstimate, student_degrees
from .nuisance import Nuisance
from .output_tests import OutputTest
from .precision import Precision, in_words, is_clear, quantile
from .residual_checks import OFF, ResidualCheck, Series, ShareOfBlocks, WhitenedRows, residual_checks, robust
from .sandwich import Sandwich
from .small_samples import Inflated, inflated, output_degrees_of_freedom
from .unknown_noise import TINY, correlations_can_be_estimated, residual_covariance
from .weighting import WeightedResiduals

NUMERICAL = 1000.0
"""Multiple of the numerical error of an output up to which its residuals, and its estimated noise, may be due to that."""

FEWEST_DEGREES = 0.5
"""Degrees of freedom of an output below which its residuals do not determine its noise."""


@dataclass(frozen=True, eq=False, repr=False)
class FitStatistics:
    """An estimate, and what its residuals and their derivatives say about it.

    Attributes
    ----------
    model : Model
    data : tuple of Measurements or Record
    prior : GaussianPrior or None
        That took part in the estimate.
    nuisance : Nuisance
        What was estimated beside the parameters, with what is known of it beforehand.
    theta : ndarray, (p,)
        All parameters of the model: the estimated ones, and those that were known.
    values : ndarray, (P,)
        The unknowns in the order of `parameters`: estimated parameters, uncertain constants, and starts of records.
    predicted, residuals : ndarray, (N, n_y)
        Of all samples in a row, run after run, SI units; measured - predicted, NaN where not measured.
    noise_known : bool
    noise : mapping of output name to float or Noise, NoiseModel, or None
        As it was given or, by `noise_estimate`, found; None where it is white and estimated.
    noise_covariance : ndarray, (n_y, n_y)
        R: of the given noise where the outputs are zero, or the estimated one, with each variance divided by its degrees of freedom
        instead of the samples.
    stop_reason : StopReason
        Why the search ended.
    evaluations : int
    starts, reached : int
        Starts of the search, and how many of them came to this minimum.
    weighted : WeightedResiduals
        The residuals in units of the noise, with the prior's, as a function of the unknowns: what was minimised.
    noise_estimate : mapping of output name to OutputNoiseEstimate, or None
        Where it was looked for.
    spread : mapping of name to Spread
        Standard deviation between the values of each local parameter that has one, as given or estimated.
    """

    model: Model
    data: tuple[Measurements | Record, ...]
    prior: GaussianPrior | None
    nuisance: Nuisance
    theta: Array
    values: Array
    predicted: Array
    residuals: Array
    noise_known: bool
    noise: NoiseOf | None
    noise_covariance: Array
    stop_reason: StopReason
    evaluations: int
    starts: int
    reached: int
    weighted: WeightedResiduals
    noise_estimate: Mapping[str, OutputNoiseEstimate] | None = field(default=None, kw_only=True)
    spread: Mapping[str, Spread] = field(default=NO_SPREAD, kw_only=True)

    @property
    def converged(self) -> bool:
        """Whether the gradient is zero: no step lowers the residuals, or rounding hides what it would. Nothing else counts."""
        return self.stop_reason == StopReason.converged

    @property
    def message(self) -> str:
        """Why the search ended, in words, and what helps."""
        return f"{self.stop_reason.words}. {self.stop_reason.advice}"

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the unknowns: estimated parameters, uncertain constants, starts of records that were not known, as "x0_h1",
        and values of local parameters, as "m_load[3]"."""
        return self.weighted.unknowns.names

    @property
    def estimate(self) -> Mapping[str, float]:
        """The unknowns by name, SI units."""
        return self._by_name(self.values)

    @property
    def units(self) -> Mapping[str, str]:
        """Units of the unknowns, by name."""
        of_states = {q.name: q.unit for q in self.model.states}
        units = {q.name: q.unit for q in self.weighted.observed.model.parameters}
        units |= {name: of_states[state] for name, (state, _) in self.weighted.observed.starts.items()}
        units |= {one.name: units[one.parameter] for one in self.weighted.observed.local.each}
        return FrozenMapping({name: units[name] for name in self.parameters})

    @property
    def common(self) -> tuple[str, ...]:
        """Names of the unknowns that are no values of local parameters."""
        return self.parameters[: self.weighted.observed.common]

    @property
    def local(self) -> Mapping[str, Mapping[str, LocalValue]]:
        """The values of each local parameter, by the number of the run or record, or by label: ``fit.local["m_load"]["3"]``."""
        local, errors, intervals = self.weighted.observed.local, self.standard_errors, self.intervals()
        found: dict[str, dict[str, LocalValue]] = {name: {} for name in local.local}
        for one in local.each:
            value, error = self.estimate[one.name], errors[one.name]
            by = local.local[one.parameter].by
            found[one.parameter][one.group] = LocalValue(one.parameter, by, one.group, value, error, intervals[one.name])
        return FrozenMapping({name: FrozenMapping(values) for name, values in found.items()})

    @cached_property
    def precision(self) -> Precision:
        """The a-posteriori information, standardised; where the noise was estimated, the covariance has its share."""
        precision = self._precision
        return precision if self.noise is not None else replace(precision, covariance=self._inflated.covariance[0])

    @property
    def information(self) -> Array:
        """A-posteriori Fisher information (P, P) in its sum form, with the prior's where it took part; standardised.

        `Evaluation.information` has the same form, and predicts it."""
        return self.precision.information

    @property
    def covariance(self) -> Array:
        """Covariance (P, P) of the unknowns in SI units; inf for those that the data do not determine, or that a bound holds."""
        covariance: Array = self.precision.covariance * np.outer(self.slopes, self.slopes)
        covariance[~self.precision.determined] = np.inf
        covariance[:, ~self.precision.determined] = np.inf
        return covariance

    @property
    def standard_errors(self) -> Mapping[str, float]:
        """Standard errors by name, SI units; inf for what the data do not determine, or a bound holds; others with that held."""
        return self._by_name(np.sqrt(np.diag(self.covariance)))

    @property
    def robust_standard_errors(self) -> Mapping[str, float]:
        """Standard errors that do not need the noise to be white, by name, SI units; inf as `standard_errors`, and of exact fits.

        From the residuals themselves: of many points and runs by their own scores, of few records and runs by Newey and West's
        window after prewhitening. The former have none for values of local parameters. See `fisherpoint.estimation.sandwich`.
        """
        errors = np.sqrt(np.diag(self.robust.covariance)) * np.abs(self.slopes)
        alone = (np.arange(len(errors)) >= len(self.common)) & (self.robust.method == "series")  # values that one series determines
        left = (self.degrees_of_freedom >= FEWEST_DEGREES) & ~alone
        return self._by_name(np.where(self.precision.determined & left, errors, np.inf))

    @property
    def robust_ratios(self) -> Mapping[str, float]:
        """Robust standard errors over standard errors, by name, where both are finite; above one, the latter are too small.

        Of `common` unknowns.
        """
        both = [(name, self.robust_standard_errors[name], self.standard_errors[name]) for name in self.common]
        return FrozenMapping({name: a / b for name, a, b in both if np.isfinite([a, b]).all() and b > 0})

    @property
    def rse(self) -> Mapping[str, float]:
        """Relative standard errors, shares of |estimate|; of an estimate that is zero, inf."""
        return relative_errors(self.standard_errors, self.estimate)

    @property
    def correlation(self) -> Array:
        """Correlation (P, P) of the unknowns that are determined; the rows of others are those of the identity."""
        covariance = self.precision.covariance
        std = np.sqrt(np.diag(covariance))
        std = np.where(std > 0, std, 1.0)
        correlation: Array = covariance / np.outer(std, std)
        open_ = ~self.precision.determined
        correlation[open_], correlation[:, open_] = 0.0, 0.0
        np.fill_diagonal(correlation, 1.0)
        return correlation

    @property
    def null_directions(self) -> tuple[str, ...]:
        """Changes of the unknowns that no measured output notices, in words."""
        return in_words(self.precision.null, self.slopes, self.values, self.parameters)

    @property
    def weak_directions(self) -> tuple[str, ...]:
        """Changes of the unknowns that hardly show in the outputs, in words."""
        return in_words(self.precision.weak, self.slopes, self.values, self.parameters)

    @property
    def at_bounds(self) -> tuple[str, ...]:
        """Unknowns that a bound holds: they are not free, take up no degree of freedom, and have no standard error."""
        return self.weighted.unknowns.at_bounds(self.z)

    @property
    def held(self) -> NDArray[np.bool_]:
        """Whether each unknown is one of `at_bounds`, (P,)."""
        return self.weighted.unknowns.held(self.z)

    @property
    def expected_std(self) -> Array:
        """Root mean square (n_y,) of how measurements scatter: the noise, with the share of what is assumed and not exact."""
        return np.asarray(np.sqrt(np.square(self.sample_std).mean(axis=0)))

    @property
    def sample_std(self) -> Array:
        """Standard deviation (N, n_y) of the noise of each sample, with the share of what is assumed, SI units."""
        noise, variances = self.weighted.noise, self.weighted.variances
        if noise is not None and not noise.normal:
            return noise.sensors.white_std(self.predicted)
        return np.asarray(np.broadcast_to(np.sqrt(variances), self.residuals.shape))

    @property
    def residual_covariance(self) -> Array:
        """(10): mean of residual times residual transposed, (n_y, n_y), zero for outputs that were never measured together."""
        covariance: Array = residual_covariance(self.residuals[None])[0]
        return covariance

    @cached_property
    def apriori_covariance(self) -> Array | None:
        """D of (17) for the measured points, beside which (10) shows what the data have added: the noise's covariance plus the mean
        predictive covariance over the prior, (n_y, n_y); None without a prior of all parameters, for records, and beside
        uncertain constants and local parameters, which samples share."""
        if self.nuisance or self.weighted.observed.local.each:
            return None
        return apriori_covariance(self.model, self.data, self.prior, self.parameters, self.noise_covariance)

    @cached_property
    def output_degrees_of_freedom(self) -> Array:
        """Number of measured values of each output less what the unknowns take up of it, (n_y,)."""
        counts = np.isfinite(self.residuals).sum(axis=0)
        if (blocks := self._whitened_rows.blocks) is not None:
            return np.asarray(np.maximum(counts - np.square(blocks.rows).sum(axis=(0, 2)), 0.0))
        degrees: Array = output_degrees_of_freedom(self._data_jacobian, self._precision.covariance[None], counts)[0]
        return degrees

    @property
    def chi_square(self) -> float:
        """Sum of squares of the data's residuals in units of the noise."""
        return float(np.square(self.whitened).sum())

    @property
    def degrees_of_freedom(self) -> float:
        """Number of measured values less what the unknowns take up; with a prior, not a whole number."""
        return float(self.output_degrees_of_freedom.sum())

    @property
    def tests(self) -> Mapping[str, OutputTest]:
        """Chi-square of every measured output: far above its degrees of freedom where the model or the noise is wrong."""
        counts, squares = np.isfinite(self.residuals).sum(axis=0), np.square(self.whitened).sum(axis=0)
        found = {}
        for i, name in enumerate(names_of(self.model.outputs)):
            if counts[i]:
                unit = self._unit_of_squares(i) if self.noise_known else None
                found[name] = OutputTest.of(int(counts[i]), float(squares[i]), float(self.output_degrees_of_freedom[i]), unit)
        return FrozenMapping(found)

    def _unit_of_squares(self, output: int) -> float:
        """By how much the squares of an output's scores scatter, in units of those of normal residuals."""
        noise, there = self.weighted.noise, np.isfinite(self.residuals[:, output])
        return 1.0 if noise is None else float(noise.kurtosis(self.predicted[there], output).mean() - 1) / 2

    @cached_property
    def residual_checks(self) -> Mapping[str, ResidualCheck]:
        """Whether the residuals of each measured output are white; without outputs whose residuals may be numerical errors."""
        counts = np.isfinite(self.residuals).sum(axis=0)
        size = np.sqrt(np.square(np.nan_to_num(self.residuals)).sum(axis=0) / np.maximum(counts, 1))
        judged = (counts > 0) & (size > NUMERICAL * self.numerical_errors)
        return residual_checks(self.model, self.series, self._whitened_rows, judged)

    @cached_property
    def robust(self) -> Sandwich:
        """The robust covariance of the unknowns, standardised, and how it was found."""
        rows = self.jacobian[self.residuals.size :]
        return robust(self.model, self.series, self.residual_checks, self._whitened_rows, rows.T @ rows)

    @cached_property
    def series(self) -> Series:
        """Which samples belong to the same run or record."""
        return Series.of(self.model, self.data)

    @property
    def numerical_errors(self) -> Array:
        """Root mean square (n_y,) of the error of each output by the trajectories' tolerance, or by rounding."""
        y = np.nan_to_num(self.weighted.observed.y)
        size = np.sqrt(np.square(y).sum(axis=0) / np.maximum(np.isfinite(self.residuals).sum(axis=0), 1))
        return np.asarray(np.maximum(self.weighted.observed.precision * size, TINY**0.5))

    @property
    def unexplained(self) -> tuple[str, ...]:
        """Outputs whose residuals are larger than the known noise explains: their chi-square has a probability below 0.001."""
        return tuple(name for name, test in self.tests.items() if test.p_value is not None and test.p_value < OFF)

    @property
    def noise_not_estimable(self) -> tuple[str, ...]:
        """Outputs whose noise was to be estimated, but which the unknowns fit exactly, so that the estimated noise is zero."""
        if self.noise_known:
            return ()
        names, measured = names_of(self.model.outputs), np.isfinite(self.residuals).any(axis=0)
        return tuple(names[i] for i in np.flatnonzero(measured & (self.output_degrees_of_freedom < FEWEST_DEGREES)))

    @property
    def quantile_degrees_of_freedom(self) -> Mapping[str, float]:
        """Degrees of freedom of Student's t for each unknown: inf where the noise is known.

        An unknown's variance is a sum of shares of the outputs' estimated variances; Satterthwaite's formula says how many degrees
        of freedom such a sum has. See `fisherpoint.estimation.small_samples`.
        """
        if self.noise_known:
            return self._by_name(np.full(len(self.values), np.inf))
        if self.noise is not None:
            return self._by_name(self._degrees_by_noise)
        return self._by_name(self._inflated.degrees_of_freedom[0])

    def intervals(self, level: float = 0.95) -> Mapping[str, tuple[float, float]]:
        """Confidence intervals by name: estimate -+ quantile times standard error, of the logarithm where the prior is log-normal.

        The quantile is the normal one where the noise is known, and Student's t where it was estimated.
        """
        level = as_probability(level, "level")
        unknowns, spread = self.weighted.unknowns, np.sqrt(np.diag(self.precision.covariance))
        quantiles = quantile(level, np.array(list(self.quantile_degrees_of_freedom.values())))
        reach = np.where(self.precision.determined, quantiles * spread, np.inf)
        low, high = (unknowns.values(self.z + side * reach) for side in (-1, 1))
        return FrozenMapping({name: (float(a), float(b)) for name, a, b in zip(self.parameters, low, high, strict=True)})

    @cached_property
    def z(self) -> Array:
        """The unknowns in standardised coordinates, (P,)."""
        z: Array = self.weighted.unknowns.coordinates(self.values[None])[0]
        return z

    @cached_property
    def slopes(self) -> Array:
        """d values / dz, (P,)."""
        slopes: Array = self.weighted.unknowns.slopes(self.values[None])[0]
        return slopes

    @cached_property
    def jacobian(self) -> Array:
        """Jacobian (M, P) of the whitened residuals, with the prior's rows last; of independent readings, by their information."""
        jacobian: Array = self.weighted.scores(self.z[None], np.zeros(1, dtype=np.intp))[1][0]
        return jacobian

    @cached_property
    def _precision(self) -> Precision:
        """Precision as if the weights were known."""
        return Precision.of(self.jacobian, self.held) if self._tangent is None else Precision.of_blocks(self._tangent)

    @cached_property
    def _tangent(self) -> BorderedTangent | None:
        """The factors of the Jacobian by blocks; None where there are none, or where it is not clearly regular."""
        layout = self.weighted.layout
        if not self.weighted.observed.local.each or self.held.any():
            return None
        found = layout.tangent(*self.weighted.stored(self.z[None], np.zeros(1, dtype=np.intp), scores=True)[:2])
        return found if isinstance(found, BorderedTangent) and is_clear(found) else None

    @cached_property
    def _inflated(self) -> Inflated:
        measured = np.isfinite(self.residuals)
        full = correlations_can_be_estimated(measured, len(self.values))
        return inflated(self._data_jacobian, self._precision.covariance[None], measured.sum(axis=0), full)

    @cached_property
    def _degrees_by_noise(self) -> Array:
        outputs = names_of(self.model.outputs)
        return student_degrees(self.weighted, self.z, self.held, outputs, self.data, self.noise_estimate or {})

    @cached_property
    def _whitened_rows(self) -> WhitenedRows:
        measured, covariance = np.isfinite(self.residuals), self._precision.covariance
        given = self.whitened, self._data_jacobian[0], covariance, measured
        if self._tangent is None:
            return WhitenedRows(*given)
        share, block = self._tangent.shares()
        (count, outputs), n = self.residuals.shape, self.residuals.size
        return WhitenedRows(*given, ShareOfBlocks(share[:n].reshape(count, outputs, -1), len(self.common), block[:n:outputs]))

    @property
    def _data_jacobian(self) -> Array:
        """The rows of `jacobian` that belong to the data, (1, N, n_y, P)."""
        return self.jacobian[: self.residuals.size].reshape(1, *self.residuals.shape, len(self.values))

    @cached_property
    def whitened(self) -> Array:
        """Residuals in units of the noise, (N, n_y), zero where not measured; with a memory, innovations; of readings, scores."""
        return self.weighted.whitened(self.predicted)

    @property
    def standardised(self) -> Array:
        """Residuals over the standard deviation of their noise, (N, n_y), NaN where not measured."""
        return np.asarray(self.residuals / self.sample_std)

    def _by_name(self, values: Array) -> Mapping[str, float]:
        return FrozenMapping(dict(zip(self.parameters, values.tolist(), strict=True)))
