"""Profile likelihood: what it costs to move one unknown when all others follow.

Where the noise is known, the deviance is twice the rise of the cost of (5), and its threshold is the quantile of chi-square with
one degree of freedom. Where it is estimated, the deviance is that of (10), N log(det D / det D^), with the noise estimated anew at
each value, and the threshold n log(1 + t^2 / nu). For one output of n samples with nu degrees of freedom left, this is the F ratio;
for several, nu is that of `Fit.quantile_degrees_of_freedom`, and n / nu how much unbiased noise makes the unknown's variance grow.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..basics.checks import as_probability, check_known, some_names_among
from ..basics.extras import needed_for
from ..basics.stop_reason import StopReason
from ..basics.values import Array
from ..engine.workers import Workers, distributed_over
from ..points.settings import check_threads, resolve_threads
from ..show.numbers import counted, number
from ..show.progress import Progress, check_progress, following
from ..show.section import Report, Section
from ..show.table_preview import InNotebooks
from .least_squares import CONVERGED, NOT_EVALUABLE, Accuracy, Residuals, minimise
from .precision import Precision
from .profile_curve import ProfileCurve
from .profile_sides import FINEST, Minimum, Side, refine, walk
from .statistics import FitStatistics
from .unknown_noise import (
    MAX_ROUNDS,
    above_floor,
    correlations_can_be_estimated,
    floor,
    likelihood_deviance,
    relative_change,
    residual_covariance,
)
from .unknowns import AT, FARTHEST, NEXT_TO
from .weighting import WeightedResiduals

if TYPE_CHECKING:
    from matplotlib.figure import Figure


EVALUATIONS = 5
"""Maximum number of evaluations of least squares with the same weights, which then are updated."""

SETTLED = 1e-5
"""Change of the weights, as a share, from which on the deviance, which is flat there, no longer changes."""


@dataclass(frozen=True, eq=False)
class Profile(ProfileCurve, InNotebooks):
    """The likelihood of one unknown; see `ProfileCurve` for its attributes."""

    def plot(self, *, path: str | Path | None = None) -> Figure:
        """Draw the deviance over the unknown, beside the parabola of the linear interval; needs matplotlib.

        Parameters
        ----------
        path : path, optional
            Where the picture is also written; the ending says the format, PNG where there is none.

        Returns
        -------
        matplotlib.figure.Figure
        """
        with needed_for("plot"):
            from ..show.style import drawn
            from .pictures import plot_profiles

        return drawn(plot_profiles([self]), path)

    def _in_notebook(self) -> Report:
        unit = "" if self.unit == "1" else f" [{self.unit}]"
        rows = [
            ("by profile likelihood", *map(number, self.interval), ", ".join(end.words for end in dict.fromkeys(self.ends))),
            ("by standard error", *map(number, self.linear_interval), ""),
        ]
        _, *notes = str(self).split("\n")
        table = Section(f"{100 * self.level:g} % interval", ("", "from", "to", "ends"), rows, notes=notes)
        return Report(f"{self.name}{unit} = {number(self.estimate, 6)}", [table])

    def __str__(self) -> str:
        unit = "" if self.unit == "1" else f" {self.unit}"
        lines = [
            f"{self.name} = {self.estimate:.6g}{unit}, {100 * self.level:g} % interval by profile likelihood "
            f"{self.interval[0]:.4g} to {self.interval[1]:.4g}, by standard error "
            f"{self.linear_interval[0]:.4g} to {self.linear_interval[1]:.4g}"
        ]
        lines += [f"{side} end: {end.words}" for side, end in zip(("lower", "upper"), self.ends, strict=True) if not end.complete]
        if not self.converged.all():
            missed = int((~self.converged).sum())
            lines.append(f"at {missed} of {len(self.values)} values the others' search did not converge: the interval may be wider")
        if self.better:
            lines.append("a better estimate was found on the way: estimate again, from `unknowns` where the deviance is least")
        return "\n".join(lines)


def profile_of(
    fit: FitStatistics,
    name: str,
    level: float = 0.95,
    progress: bool | Callable[[Progress], None] | None = None,
    threads: int | None = None,
) -> Profile:
    """See `Fit.profile`."""
    check_progress(progress)
    if threads is not None:
        observed = fit.weighted.observed.with_threads(resolve_threads(threads))
        fit = replace(fit, weighted=replace(fit.weighted, observed=observed))
    check_known([name], fit.parameters, "name", "one of")
    level = as_probability(level, "level")
    j, unknowns = fit.parameters.index(name), fit.weighted.unknowns
    freed = replace(fit, weighted=replace(fit.weighted, unknowns=unknowns.without_bounds((name,))))  # where it is held itself
    z, held, threshold = fit.z, _held_minimum(fit, j), _threshold(freed, j, level)
    covariance, determined = freed.precision.covariance, freed.precision.determined[j]
    spread = float(np.sqrt(covariance[j, j])) if determined else 1.0
    tangent = covariance[:, j] / covariance[j, j] if determined else np.eye(len(z))[j]
    limits = (float(unknowns.lower[j]), float(unknowns.upper[j]))
    reach = spread * float(np.sqrt(threshold))
    finest = max(FINEST * reach, AT * float(unknowns.spacing(z)[j]))
    sides = [Side(z, tangent, j, sign, reach, limit, finest) for sign, limit in zip((-1, 1), limits, strict=True)]
    started = perf_counter()

    with following(progress, f"profile of {name}", counted=False) as report:
        heard = held if report is None else _heard(held, report, started)
        walk(sides, heard, threshold)
        refine(sides, heard, threshold)

    points = [*sides[0].points[:0:-1], *sides[1].points]
    at = np.array([point.z for point in points])
    values = unknowns.values(at)
    for side in sides:
        if side.how == StopReason.at_bound and unknowns.log[j] and abs(side.limit) * unknowns.scale[j] >= FARTHEST - NEXT_TO:
            side.how = StopReason.not_bounded  # that limit is ours, not the user's
    beyond = [0.0 if unknowns.log[j] else -np.inf, np.inf]
    ends = [
        beyond[i] if side.how == StopReason.not_bounded else float(unknowns.values(side.end[None])[0, j])
        for i, side in enumerate(sides)
    ]
    return Profile(
        name,
        fit.units[name],
        level,
        fit.estimate[name],
        values[:, j],
        np.array([point.deviance for point in points]),
        np.array([point.converged for point in points]),
        values,
        threshold,
        (ends[0], ends[1]),
        (sides[0].ended, sides[1].ended),
        fit.intervals(level)[name],
    )


def profiles_of(
    fit: FitStatistics,
    names: Iterable[str] | None,
    level: float = 0.95,
    threads: int | None = None,
    workers: Workers | None = None,
    progress: bool | Callable[[Progress], None] | None = None,
) -> dict[str, Profile]:
    """See `Fit.profiles`."""
    check_progress(progress)
    chosen = fit.common if names is None else some_names_among(names, fit.parameters, "names")
    found: dict[str, Profile] = {}
    started = perf_counter()
    with following(progress, "profiles") as report, distributed_over(workers, check_threads(threads)) as distributor:
        work = partial(_profile, fit, level, distributor.threads)
        for profile in distributor.map(work, chosen, lambda k: f"the profile of {chosen[k]}", ahead=1):
            found[profile.name] = profile
            if report is not None:
                report(Progress(len(found), len(chosen), None, profile.name, perf_counter() - started))
    return found


def _profile(fit: FitStatistics, level: float, threads: int, name: str) -> Profile:
    return profile_of(fit, name, level, threads=threads)


# The minimum over the other unknowns


def _heard(held: Minimum, report: Callable[[Progress], None], started: float) -> Minimum:
    """Return `held` with a report of every value."""
    values = 0

    def heard(z: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
        nonlocal values
        found = held(z)
        values += len(z)
        report(Progress(values, None, None, f"at {counted(values, 'value')}", perf_counter() - started))
        return found

    return heard


class _Held(NamedTuple):
    """Residuals as a function of all coordinates but `j`, which each problem holds at its own value in `at` (B,)."""

    residuals: Residuals
    j: int
    at: Array

    def __call__(self, z: Array, rows: NDArray[np.intp]) -> tuple[Array, Array, NDArray[np.bool_]]:
        r, jacobian, ok = self.residuals(np.insert(z, self.j, self.at[rows], axis=1), rows)
        return r, np.delete(jacobian, self.j, axis=2), ok

    def accuracy(self, problem: WeightedResiduals) -> Accuracy:
        """Accuracy of the residuals, in the remaining coordinates."""

        def spacing(z: Array) -> Array:
            return np.delete(problem.unknowns.spacing(np.insert(z, self.j, 0.0, axis=1)), self.j, axis=1)

        return problem.accuracy._replace(spacing=spacing)


def _minimum(
    problem: WeightedResiduals, j: int, z: Array, unit: float = 1.0, evaluations: int = 200
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Minimise over all coordinates (B, P) but `j`: where, the cost (B,), inf where no trajectories are, and if it converged."""
    others = np.arange(z.shape[1]) != j
    if not others.any():
        r, _, ok = problem(z, np.arange(len(z)))
        return z, np.where(ok, 0.5 * np.square(r).sum(axis=1), np.inf), ok
    lower, upper = problem.unknowns.lower[others], problem.unknowns.upper[others]
    start = np.clip(z[:, others], lower, upper)
    held = _Held(problem, j, z[:, j])
    found = minimise(held, start, lower, upper, evaluations, unit=unit, accuracy=held.accuracy(problem))
    cost = np.where(found.end == NOT_EVALUABLE, np.inf, found.cost)
    return np.insert(found.z, j, z[:, j], axis=1), cost, found.end == CONVERGED


def _held_minimum(fit: FitStatistics, j: int) -> Minimum:
    if fit.noise is None:
        return _held_likelihood(fit, j)
    least = 0.5 * np.square(fit.weighted(fit.z[None], np.zeros(1, dtype=np.intp))[0]).sum()

    def deviance(z: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
        found, cost, converged = _minimum(fit.weighted, j, z)
        return found, 2 * (cost - least), converged

    return deviance


def _held_likelihood(fit: FitStatistics, j: int) -> Minimum:
    """The minimum of log det of (10), by least squares weighted with the residual covariance of the minimum before."""
    problem, measured = fit.weighted, fit.weighted.measured
    keep = _kept(fit)
    full = bool(keep[~np.eye(len(keep), dtype=bool)].any())
    least = floor(problem.y)

    def covariance_at(z: Array) -> tuple[Array, NDArray[np.bool_]]:
        response = problem.observed.respond(problem.unknowns.values(z))
        return above_floor(residual_covariance(problem.y - response.y) * keep, least), response.status == 0

    def likelihood(z: Array, covariance: Array) -> Array:
        return likelihood_deviance(covariance, measured, full) + problem.prior_square(z)

    at_fit, _ = covariance_at(fit.z[None])
    least_likelihood = likelihood(fit.z[None], at_fit)

    def deviance(z: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
        z = z.copy()
        covariance, ok = covariance_at(z)
        active, converged = np.flatnonzero(ok), np.zeros(len(z), dtype=bool)
        for _ in range(MAX_ROUNDS):
            if not len(active):
                break
            weighted = replace(problem, covariance=covariance[active][:, None])
            z[active], cost, converged[active] = _minimum(weighted, j, z[active], 0.0, EVALUATIONS)
            ok[active] = np.isfinite(cost)
            update, _ = covariance_at(z[active])
            change = relative_change(update, covariance[active])
            covariance[active] = update
            active = active[ok[active] & ((change > SETTLED) | ~converged[active])]
        return z, np.where(ok, likelihood(z, covariance) - least_likelihood, np.inf), converged

    return deviance


def _kept(fit: FitStatistics) -> Array:
    """Whether the estimate used an entry of the residual covariance, (n_y, n_y)."""
    full = correlations_can_be_estimated(fit.weighted.measured, len(fit.parameters))
    return np.ones_like(fit.noise_covariance) if full else np.eye(len(fit.noise_covariance))


def _threshold(fit: FitStatistics, j: int, level: float) -> float:
    from scipy.stats import norm, t

    if fit.noise_known:
        return float(norm.ppf(0.5 + level / 2) ** 2)
    if fit.noise is not None:
        return float(t.ppf(0.5 + level / 2, fit.quantile_degrees_of_freedom[fit.parameters[j]]) ** 2)
    counts = fit.weighted.measured.sum(axis=0)
    maximum_likelihood = residual_covariance(fit.residuals[None])[0] * _kept(fit) + np.diag(1.0 * (counts == 0))
    weighted = replace(fit.weighted, covariance=maximum_likelihood)
    plain = Precision.of(weighted(fit.z[None], np.zeros(1, dtype=np.intp))[1][0], fit.held)
    # What estimated weights add beyond that is in the profile itself, which estimates them anew at each value.
    unbiased = Precision.of(fit.jacobian, fit.held)
    ratio = float(unbiased.covariance[j, j] / plain.covariance[j, j]) if plain.covariance[j, j] > 0 else 1.0
    degrees = fit.quantile_degrees_of_freedom[fit.parameters[j]]
    squared = float(t.ppf(0.5 + level / 2, degrees) ** 2)
    return ratio * (degrees * float(np.log1p(squared / degrees)) if np.isfinite(degrees) else squared)
