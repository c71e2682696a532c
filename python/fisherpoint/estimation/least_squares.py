"""Many nonlinear least-squares problems of one shape, advanced together by Levenberg and Marquardt's method.

A problem is solved where the gradient vanishes: where next to nothing of the residuals lies in the tangent space. What does lie
there is measured by its length, which is that of the undamped step in standard errors, and does not depend on the unknowns' units.
Near a minimum the cost is flat to within its rounding and the integrator's; steps are then taken where that length becomes less.

Far from a minimum residuals are mostly the model's curvature. Steps that take them for noise lead unknowns on which they hardly
depend far off. How far off an unknown may be is known where it has a prior. So a step takes the noise for as large as what it could
take off the residuals, and the prior for what it is: with q, the mean square of that part, it minimises ||r + J s||^2 + q ||s||^2,
in standard deviations of the prior. At a minimum q is zero, and steps come to be undamped ones. Damping by the residuals' size
is Levenberg's, in the form of Yamashita and Fukushima (2001); Marquardt's is added where steps are refused.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from ..basics.stop_reason import StopReason
from ..basics.values import Array, IntArray
from .tangent_space import DENSE, DampedSteps, Layout, TangentSpace

CONVERGED, LIMIT, STALLED, NOT_EVALUABLE, UNNOTICED, ROUGH, UNSETTLED, RAN_OFF = range(8)
ENDS = {
    CONVERGED: StopReason.converged,
    LIMIT: StopReason.max_evaluations,
    STALLED: StopReason.stalled,
    NOT_EVALUABLE: StopReason.not_evaluable,
    UNNOTICED: StopReason.no_effect,
    ROUGH: StopReason.rounding,
    UNSETTLED: StopReason.weights_changed,
    RAN_OFF: StopReason.diverged,
}
"""Why a search ended, by the number that arrays have for it."""

TOLERANCE = 1e-8
"""Length of the residuals' part in the tangent space, in standard errors, from which on a problem is solved."""

TOLERABLE, TOLERABLE_SPACING = 1e-2, 0.1
"""The same, where the residuals' own rounding keeps it from becoming less; and where the unknowns' does: the estimate then is the
best that there is in doubles."""

FLAT = 1e-13
"""Expected decrease, as a share of the cost, that rounding hides in any case."""

AS_EXPECTED = 0.75
"""Share of itself by which a decrease may differ from what was expected, and is not taken for rounding."""

FIRST_DAMPING = 1e-2
"""First damping, in units of the squared lengths of the columns. From 0.01 to 1, NIST's problems show no difference."""

STRIDE, FIRST_STRIDE, FIRST_STRIDE_OF_PRIOR = 10.0, 0.5, 2.0
"""Longest step of a coordinate, in units of max(1, |z|), and of the first one: past it, where the model is another one,
trajectories cost most. Every step that is taken doubles what the next one may be. The last of the three is the first step's where
all coordinates have a prior, in its standard deviations."""

CURVED_FROM = 20
"""Iterations after which steps are bent along the residuals' curvature, at the price of an evaluation each."""

REACH, BEND = 0.1, 0.75
"""Share of a step at which the curvature is taken; and how much longer than the step, twice the bend may be."""

RETREAT = 0.25
"""Share of a step to which the next one is limited where it led to what cannot be evaluated: such trajectories cost most of all."""

LARGEST = 1e150
"""Largest residuals and derivatives, whose squares have to be numbers."""

LEAST_NEGLIGIBLE = 1e-13
"""Share of the largest singular value up to which a direction is not determined, whatever the residuals' precision."""

MOST_REFUSED = 12
"""Trials in a row that are refused, each with more damping than the one before, after which a search has stalled."""

CREEP, MOST_CREPT = 1e-4, 30
"""A search has stalled too where so many iterations, the last of them with bent steps, lower the cost by less than CREEP, in
squares of the noise, while the undamped step promises more. A friction that data show as a jump is fitted the better the steeper
it is, and every step there costs more."""

MOST_FAILED = 15
"""Trials of a search that cannot be evaluated, after which it counts as stuck at the border of what can."""


INWARD, NEARER = 0.9, 1e-3
"""Share of the way to a bound that a coordinate goes at most, once a trial on that bound could not be evaluated: the bound may be
the border of what can, as zero is of a volume. After n such trials the bound is tried again at a distance of NEARER**n from it."""


class Residuals(Protocol):
    def __call__(self, z: Array, rows: NDArray[np.intp]) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Residuals (b, M) and their Jacobian (b, M, P) of the problems `rows` (b,) at z (b, P), and which can be evaluated."""


def _doubles(z: Array) -> Array:
    return np.asarray(np.spacing(z))


class Accuracy(NamedTuple):
    """Accuracy of residuals: the length (B,), or (1,), of their numerical error, and the share of a number to which they are
    computed; and of z (B, P): how far apart neighbouring values are, (B, P)."""

    rounding: Array | float
    precision: float
    spacing: Callable[[Array], Array] = _doubles


EXACT = Accuracy(0.0, 0.0)


class Minima(NamedTuple):
    """z (B, P), cost (B,) = half the sum of squares, how each search ended (B,), the evaluations that each took (B,), and the
    length (B,) of what the rounding of z makes of the residuals."""

    z: Array
    cost: Array
    end: IntArray
    evaluations: IntArray
    spacing: Array


def minimise(
    residuals: Residuals,
    z0: Array,
    lower: Array,
    upper: Array,
    max_evaluations: int = 200,
    *,
    unit: float = 1.0,
    accuracy: Accuracy = EXACT,
    tolerance: float | Array = TOLERANCE,
    layout: Layout = DENSE,
    has_prior: NDArray[np.bool_] | None = None,
) -> Minima:
    """Minimise half the sum of squared residuals of B problems of P coordinates each.

    Parameters
    ----------
    residuals : callable
    z0 : ndarray, (B, P)
        Starts within the bounds.
    lower, upper : ndarray, (P,)
    max_evaluations : int
        Of each problem; where they are spent, its search ends.
    unit : float
        Lower bound of the residuals' noise; 0 where it is not known, and their root mean square estimates it.
    accuracy : Accuracy
        Of the residuals.
    tolerance : float or ndarray, (B,)
        As `TOLERANCE`; more where only costs are needed, which are half its square too large then, in squares of the noise.
    layout : Layout
        How the residuals' Jacobians are stored.
    has_prior : ndarray of bool, (P,), optional
        Whether the unit of a coordinate is the standard deviation of a prior, whose mean is zero; by default of none.

    Returns
    -------
    Minima
    """
    search = _Searches(residuals, z0, lower, upper, unit, accuracy, tolerance, layout, has_prior)
    iteration = 0
    while len(search.active):
        search.iterate(iteration >= CURVED_FROM)
        search.active = search.active[search.evaluations[search.active] < max_evaluations]
        iteration += 1
    return Minima(search.z, search.cost, search.end, search.evaluations, search.spacing)


class _Searches:
    """State of B searches; those that go on are `active`."""

    def __init__(
        self,
        residuals: Residuals,
        z0: Array,
        lower: Array,
        upper: Array,
        unit: float,
        accuracy: Accuracy,
        tolerance: float | Array,
        layout: Layout,
        has_prior: NDArray[np.bool_] | None,
    ) -> None:
        self.layout = layout
        self.has_prior = np.zeros(z0.shape[1], dtype=bool) if has_prior is None else has_prior
        self.residuals, self.lower, self.upper, self.unit = residuals, lower, upper, unit
        self.negligible = max(LEAST_NEGLIGIBLE, 30 * accuracy.precision)
        count = len(z0)
        self.tolerance = np.broadcast_to(tolerance, count)
        self.z, everything = z0.copy(), np.arange(count)
        self.r, self.jacobian, ok = self._evaluated(self.z, everything)
        self.cost, self.tangent = _cost(self.r), layout.tangent(self.r, self.jacobian)
        self.units = np.where(self.tangent.blank, 0.0, self.tangent.size)  # longest columns that were met
        self.free, self.length = self._free(self.z, self.tangent), np.full(count, np.inf)
        self.length[ok] = self.tangent.some(ok).length(self.free[ok], self.negligible)
        self.last = np.full(count, np.inf)  # length before the latest undamped step
        self.rounding, self.spaced = np.broadcast_to(accuracy.rounding, count), accuracy.spacing
        self.spacing = self._spacing(self.z, self.tangent)
        self.damping, self.growth = np.full(count, FIRST_DAMPING), np.full(count, 2.0)
        self.stride = np.full(count, FIRST_STRIDE_OF_PRIOR if self.has_prior.all() else FIRST_STRIDE)
        self.refused, self.failed = np.zeros(count, dtype=np.int32), np.zeros(count, dtype=np.int32)
        self.failed_there = np.zeros(self.z.shape, dtype=np.int32)  # trials with a coordinate on a bound
        self.noticed, self.crept = self.cost.copy(), np.zeros(count, dtype=np.int32)  # cost that last fell, and steps since
        self.evaluations = np.ones(count, dtype=np.int32)
        self.end = np.where(ok, LIMIT, NOT_EVALUABLE).astype(np.int32)
        self.active = everything[ok]

    def _evaluated(self, z: Array, rows: NDArray[np.intp]) -> tuple[Array, Array, NDArray[np.bool_]]:
        """As `Residuals`; what is too large for its squares to be numbers cannot be evaluated either."""
        r, jacobian, ok = self.residuals(z, rows)
        largest = np.maximum(np.abs(r).max(axis=1, initial=0.0), np.abs(jacobian).max(axis=(1, 2), initial=0.0))
        ok = ok & (largest < LARGEST)
        if not ok.all():
            r, jacobian = np.where(ok[:, None], r, 0.0), np.where(ok[:, None, None], jacobian, 0.0)
        return r, jacobian, ok

    def _free(self, z: Array, tangent: TangentSpace) -> NDArray[np.bool_]:
        """Whether no bound holds a coordinate."""
        gradient = tangent.gradient
        return ~(((z <= self.lower) & (gradient > 0)) | ((z >= self.upper) & (gradient < 0)))

    def _spacing(self, z: Array, tangent: TangentSpace) -> Array:
        """Length (B,) of what the residuals change by where every coordinate goes to the next double."""
        return np.asarray((np.where(tangent.blank, 0.0, tangent.size) * np.abs(self.spaced(z))).sum(axis=1))

    def iterate(self, bent: bool) -> None:
        """Take, or refuse, a step of each."""
        self._end_what_is_solved()
        some = self.active
        if not len(some):
            return
        z, tangent, length = self.z[some], self.tangent.some(some), self.length[some]
        rounding, size = self.rounding[some] + self.spacing[some], np.sqrt(2 * self.cost[some])
        flat = 0.5 * length**2 <= 10 * rounding * (size + rounding) + FLAT * self.cost[some]
        plain = flat & (self.refused[some] == 0)
        damping = np.where(plain, self.negligible**2, self.damping[some])
        units = np.where(self.units[some] > 0, self.units[some], tangent.size)
        as_prior = np.square(length) / self.r.shape[1] * np.maximum(1.0, damping / FIRST_DAMPING)
        units = np.hypot(units, np.sqrt(as_prior / damping)[:, None] * self.has_prior)
        damped = tangent.damped(self.free[some], units, damping)
        step = damped.step(tangent.along)
        stride = self.stride[some]
        share = np.max(np.abs(step) / np.maximum(1.0, np.abs(z)), axis=1, initial=0.0)  # of what the coordinates are
        step *= np.minimum(1.0, stride / np.maximum(share, 1e-300))[:, None]
        failures = self.failed_there[some]
        held_off = (failures > 0) & (np.minimum(z - self.lower, self.upper - z) > NEARER**failures)
        inward = np.where(held_off, INWARD, 1.0)
        taken = np.clip(step, inward * (self.lower - z), inward * (self.upper - z))
        trial, strong = z + taken, np.zeros(len(some), dtype=bool)
        if bent:
            bend, strong = self._bend(some, taken, damped, ~flat)
            trial = z + taken + bend
        trial = np.clip(trial, self.lower, self.upper)

        r, jacobian, ok = self._evaluated(trial, some)
        self.evaluations[some] += 1
        cost, new = _cost(r), self.layout.tangent(r, jacobian)
        free = self._free(trial, new)
        new_length = new.length(free, self.negligible)
        effect = self.layout.effect(self.jacobian[some], taken)
        expected = -(tangent.gradient * taken).sum(axis=1) - 0.5 * np.square(effect).sum(axis=1)
        gain = np.divide(self.cost[some] - cost, expected, out=np.full(len(some), -1.0), where=expected > 0)
        foreseen = np.abs(gain - 1) < AS_EXPECTED
        better = ok & np.where(flat, (new_length < length) | foreseen, (gain > 1e-4) & ~strong)

        rows = some[better]
        self.z[rows], self.r[rows], self.jacobian[rows], self.cost[rows] = trial[better], r[better], jacobian[better], cost[better]
        self.last[rows] = np.where(plain, length, np.inf)[better]
        self.tangent.put(rows, new.some(better))
        self.free[rows], self.length[rows] = free[better], new_length[better]
        self.spacing[rows] = self._spacing(trial[better], new.some(better))
        self.units[rows] = np.maximum(self.units[rows], np.where(new.blank, 0.0, new.size)[better])
        least = np.where(self.refused[some] > 0, 0.5, 0.1)  # what was just too little will be so again
        shrink = np.maximum(least, 1 - (2 * np.clip(gain, 0.0, 1.0) - 1) ** 3)  # Nielsen's rule
        self.damping[rows] *= np.where(flat, 0.1, shrink)[better]
        self.damping[rows], self.growth[rows], self.refused[rows] = np.maximum(self.damping[rows], 1e-40), 2.0, 0
        self.failed[some[~ok]] += 1
        self.failed_there[some[~ok]] += ((taken != 0) & ((trial <= self.lower) | (trial >= self.upper)))[~ok]
        self.stride[some[~ok]] = RETREAT * np.minimum(share, stride)[~ok]
        self.stride[rows] = np.minimum(STRIDE, 2 * self.stride[rows])
        self._refuse(some[~better], flat[~better])
        self._end_what_creeps()

    def _end_what_is_solved(self) -> None:
        """Set apart the searches at which the gradient is zero, or as near to it as the residuals' rounding lets it come."""
        some = self.active
        length = self.length[some]
        solved: NDArray[np.bool_] = length <= self.tolerance[some] * self._noise(some)
        solved = solved | (self._near(some) & (length >= 0.5 * self.last[some]))
        unnoticed = (self.tangent.blank[some[solved]] & self.free[some[solved]]).any(axis=1)
        self.end[some[solved]] = np.where(unnoticed, UNNOTICED, CONVERGED)
        self.active = some[~solved]

    def _noise(self, some: NDArray[np.intp]) -> Array:
        """Root mean square of the residuals, or the unit of known noise where that is more."""
        noise: Array = np.maximum(self.unit, np.sqrt(2 * self.cost[some] / self.r.shape[1]))
        return noise

    def _near(self, some: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Whether rounding may keep the gradient from zero: it is as small as that, or the residuals themselves are."""
        rounding, spacing, noise = self.rounding[some], self.spacing[some], self._noise(some)
        least = np.maximum(np.minimum(rounding, TOLERABLE * noise), np.minimum(spacing, TOLERABLE_SPACING * noise))
        allowed = (
            TOLERABLE * self.unit * np.sqrt(self.r.shape[1]) if self.unit > 0 else np.inf
        )  # of residuals that are next to no noise
        nothing = np.sqrt(2 * self.cost[some]) <= np.minimum(rounding + spacing, allowed)
        return np.asarray((self.length[some] <= least) | nothing)

    def _bend(
        self, some: NDArray[np.intp], taken: Array, damped: DampedSteps, wanted: NDArray[np.bool_]
    ) -> tuple[Array, NDArray[np.bool_]]:
        """Second-order correction of a step (Transtrum and Sethna 2012), and whether it is too large for the step to be right."""
        reach = np.clip(self.z[some] + REACH * taken, self.lower, self.upper) - self.z[some]
        r, _, ok = self._evaluated(self.z[some] + reach, some)
        self.evaluations[some] += 1
        effect = self.layout.effect(self.jacobian[some], reach)
        curvature = 2 * (r - self.r[some] - effect) / REACH**2
        bend = 0.5 * damped.step(self.tangent.some(some).projected(curvature))
        ratio = 2 * np.linalg.norm(damped.units * bend, axis=1) / np.maximum(np.linalg.norm(damped.units * taken, axis=1), 1e-300)
        usable = ok & wanted
        return np.where((usable & (ratio <= BEND))[:, None], bend, 0.0), usable & (ratio > BEND)

    def _refuse(self, rows: NDArray[np.intp], flat: NDArray[np.bool_]) -> None:
        """Damp more; end what is as near to a minimum as it comes, and what has been refused too often."""
        least = np.where(flat, 1e-6, 0.0)
        self.damping[rows] = np.maximum(self.damping[rows], least) * self.growth[rows]
        self.growth[rows] *= 2.0
        self.refused[rows] += 1
        near = np.asarray(flat & self._near(rows))
        stuck = ~near & ((self.refused[rows] >= MOST_REFUSED) | (self.failed[rows] >= MOST_FAILED))
        self.last[rows[near]] = 0.0  # ends it
        self.end[rows[stuck]] = np.where(flat[stuck], ROUGH, STALLED)
        self.active = self.active[~np.isin(self.active, rows[stuck])]

    def _end_what_creeps(self) -> None:
        some = self.active
        little = CREEP * np.square(self._noise(some))
        fell = self.cost[some] < self.noticed[some] - little
        self.crept[some] = np.where(fell, 0, self.crept[some] + 1)
        self.noticed[some[fell]] = self.cost[some[fell]]
        creeps = (self.crept[some] >= MOST_CREPT) & (0.5 * np.square(self.length[some]) > little)
        self.end[some[creeps]] = STALLED
        self.active = some[~creeps]


def _cost(r: Array) -> Array:
    """Half the sum of squares, (B,)."""
    return np.asarray(0.5 * np.einsum("bm,bm->b", r, r))
