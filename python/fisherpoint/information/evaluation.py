"""Evaluation of a design: Fisher matrix (7), its determinant, and the standard errors that follow."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from ..basics.checks import check_choice
from ..basics.extras import needed_for
from ..basics.field_checks import Choices, Extents
from ..basics.quantity import names_of
from ..basics.result_files import Kept
from ..basics.values import Array, FrozenMapping, relative_errors
from ..basics.work_clock import Clock
from ..engine import _core
from ..show.display import Plots, Shown
from ..show.numbers import computed, counted, number, percent
from ..show.section import Report, Section
from .combinations import combination
from .local_robustness import Nearby, nearby_of
from .nuisance import marginal_rows
from .null_space import column_scaled_svd, null_directions, without_rounding
from .output_covariance import OutputCovariance, cholesky_factor, whitened
from .point_information import PointInformation
from .prior_information import nuisance_rows
from .problem import OUTPUT_COVARIANCES, DesignProblem
from .uneven_readings import mean_covariance

NEARBY = "standard errors away from the prior mean"
"""What `Evaluation.nearby` has, in words."""

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

RANK_TOLERANCE = 1e-9
"""Singular values of the whitened, column-scaled sensitivities below this share of the largest count as zero."""

UNDETERMINED = 1e-6
"""Share of a parameter in what the data leave open from which on they do not determine it."""

WITH_PRIOR = "With the prior's information, as of an estimate in which the prior takes part; the last column is of the data alone."

ACCURATE = 1e-6
"""Below this share of the largest, the squares in F have lost digits: log det is taken from the singular values then."""


@dataclass(frozen=True, eq=False, repr=False)
class Evaluation(Shown, Kept):
    """The information in a design.

    Attributes
    ----------
    parameters : tuple of str
        Estimated parameters, in the order of every array below.
    log_det : float
        log det of `fisher`, by Cholesky, or from singular values where that would lose digits; -inf where it is singular.
    fisher : ndarray, (p, p)
        (7) with its factor 2/L, for parameters divided by their prior standard deviations; `information` is without the factor.
        Where constants are uncertain, it is what is known about the parameters without knowing these: the Schur complement.
    output_covariance_kind : str
    output_covariance : ndarray, (n, n), or (K, n, n) where each point has its own
        D over `outputs`, in squared output units: one for each point, previous ones first, for "pointwise" and where something
        is drawn anew in each point. Of runs R, beside which what is drawn anew is common to a run.
    outputs, outputs_left_out : tuple of str
        Outputs that take part; those that carry neither variance nor sensitivity do not.
    covariance : ndarray, (p, p), or None
        Cramer-Rao bound (sum_k S_k^T D^-1 S_k)^-1 in SI units; None where F is singular. Where readings are rounded or limited, its
        mean over where the prior has the outputs (`information.uneven_readings`).
    standard_errors, rse : mapping of parameter name to float, or None
        Square roots of its diagonal, SI units, and their shares of the |prior mean|, inf where that is zero. Only where D is R are
        they those of an estimate: see `output_covariance` of `evaluate`.
    correlation : ndarray, (p, p), or None
    rank : int
    null_directions : tuple of mappings of parameter name to float
        Combinations of standardised parameters that the design does not determine.
    prior_std : mapping of parameter name to float
    n_points : int
        L of (7): the points, or samples of runs, that were evaluated, previous ones with them.
    nearby : Nearby or None
        What becomes of the standard errors where the parameters are two of them off; where D is R, and F is not singular.
    units : mapping of parameter name to str
        Those of the model.
    log_det_estimable : float or None
        log det of `fisher` over what it determines: of Q^T F Q, with an orthonormal basis Q of all that is orthogonal to the
        `null_directions`; `log_det` where there are none. Only designs that leave the same directions open compare by it. None
        where nothing is determined.
    without_prior : mapping of parameter name to float, or None
        Where the prior's information counts beside that of the data, the standard errors of the data alone, inf of parameters that
        these do not determine; else None. `fisher`, and all that follows from it, then has the prior's information in it, once:
        2/L of it, with L the measurements alone.
    """

    _EXTENTS: ClassVar[Extents] = {
        "fisher": ("parameters", "parameters"),
        "covariance": ("parameters", "parameters"),
        "correlation": ("parameters", "parameters"),
        "output_covariance": ("...", "outputs", "outputs"),
        "standard_errors": ("parameters",),
        "rse": ("parameters",),
        "null_directions": ("*", "some parameters"),
        "prior_std": ("parameters",),
        "units": ("any parameters",),
        "without_prior": ("parameters",),
        "nearby.growth": ("parameters",),
        "nearby.parameters": ("parameters",),
    }
    _CHOICES: ClassVar[Choices] = {"output_covariance_kind": OUTPUT_COVARIANCES}
    _POSITIVE = ("n_points", "prior_std")

    parameters: tuple[str, ...]
    log_det: float
    fisher: Array
    output_covariance_kind: str
    output_covariance: Array
    outputs: tuple[str, ...]
    outputs_left_out: tuple[str, ...]
    covariance: Array | None
    standard_errors: Mapping[str, float] | None
    rse: Mapping[str, float] | None
    correlation: Array | None
    rank: int
    null_directions: tuple[Mapping[str, float], ...]
    prior_std: Mapping[str, float]
    n_points: int
    nearby: Nearby | None = None
    units: Mapping[str, str] = field(default_factory=lambda: FrozenMapping({}))
    log_det_estimable: float | None = None
    without_prior: Mapping[str, float] | None = None

    def _check_content(self) -> None:
        if self.nearby is not None and not set(self.nearby.points) <= set(range(self.n_points)):
            raise ValueError(f"nearby.points: expected numbers below n_points = {self.n_points}, given {list(self.nearby.points)}")

    @property
    def without_nearby(self) -> bool:
        """Whether there was no time for `nearby`."""
        return self.nearby is None and self.covariance is not None and self.output_covariance_kind == "noise"

    @property
    def information(self) -> Array:
        """Fisher information (p, p) in its sum form, sum_k S_k^T D^-1 S_k, in the units of `fisher`, as `Fit.information` has it.

        It adds up over points and grows with their number, while `fisher` is a mean over them. Where constants are uncertain it
        does not add up: all points share them.
        """
        return self.fisher * (self.n_points / 2)

    @property
    def weak_parameters(self) -> tuple[str, ...]:
        """Parameters whose standard error stays above half their prior standard deviation."""
        if self.standard_errors is None:
            return self.parameters
        return tuple(name for name in self.parameters if self.standard_errors[name] > 0.5 * self.prior_std[name])

    def plot(self, kind: str = "standard_errors", *, path: str | Path | None = None) -> Figure:
        """Draw the standard errors or their correlation; needs matplotlib.

        Parameters
        ----------
        kind : {"standard_errors", "correlation"}
        path : path, optional
            Where the picture is also written; the ending says the format, PNG where there is none.

        Returns
        -------
        matplotlib.figure.Figure

        Raises
        ------
        ValueError
            For another kind, or the ending of no format of pictures.
        """
        check_choice(kind, ("standard_errors", "correlation"), "kind")
        with needed_for("plot"):
            from ..show.parameter_pictures import correlation_figure, standard_error_figure
            from ..show.style import drawn

        own_d = f'the D of the criterion ("{self.output_covariance_kind}")'
        where = "the sensor noise" if self.output_covariance_kind == "noise" else own_d
        if kind == "standard_errors":
            return drawn(standard_error_figure(self.standard_errors, self.prior_std, f"under {where}", self.units), path)
        title = f"Correlation of the estimates under {where}"
        singular = f"F is singular: rank {self.rank} of {len(self.parameters)}"
        return drawn(correlation_figure(self.correlation, self.parameters, title, singular), path)

    def _plots(self) -> Plots:
        return {kind: partial(self.plot, kind) for kind in ("standard_errors", "correlation")}

    def to_pandas(self) -> pd.DataFrame:
        """One row per parameter, SI units: prior_std, standard_error, rse, of_prior; NaN where F is singular."""
        with needed_for("to_pandas"):
            import pandas as pd

        errors, relative = self.standard_errors or {}, self.rse or {}
        rows = [(self.prior_std[name], errors.get(name, np.nan), relative.get(name, np.nan)) for name in self.parameters]
        index = pd.Index(self.parameters, name="parameter")
        frame = pd.DataFrame(rows, index, ["prior_std", "standard_error", "rse"], dtype=float)
        return frame.assign(of_prior=frame.standard_error / frame.prior_std)

    def report(self) -> Report:
        """Standard errors, and what is not determined."""
        kind = self.output_covariance_kind
        alone = self.without_prior
        columns = ["parameter", "unit", "prior std", "standard error", "RSE", "of prior std"]
        columns += [] if alone is None else ["without the prior"]
        rows = []
        for name in self.parameters:
            error, std = (self.standard_errors or {}).get(name, np.nan), self.prior_std[name]
            share = percent((self.rse or {}).get(name, np.nan))
            last = [] if alone is None else [computed(alone[name])]
            rows.append((name, self.units.get(name, "-"), number(std), computed(error), share, percent(error / std), *last))
        marked = [k for k, name in enumerate(self.parameters) if name in self.weak_parameters]
        notes = [] if kind == "noise" else ["Those of an estimate only where D is R: see output_covariance of evaluate"]
        notes += [] if alone is None else [WITH_PRIOR]
        notes += [] if self.nearby is None else [self.nearby.described]
        facts = [("output covariance D", kind), ("outputs used", ", ".join(self.outputs))]
        if self.outputs_left_out:
            facts.append(("outputs left out", ", ".join(self.outputs_left_out)))
        facts += value_of_criterion(self)
        table = Section("Parameters", columns, rows, marked, notes)
        return Report(f"Information about {counted(len(self.parameters), 'parameter')}", [table, Section("Criterion", (), facts)])


def value_of_criterion(evaluation: Evaluation) -> list[tuple[str, str]]:
    """The criterion, or what makes F singular, as facts of a report."""
    if evaluation.covariance is not None:
        prior = ", with the prior's information" * (evaluation.without_prior is not None)
        return [("log det F", f"{evaluation.log_det:.4f} (parameters in units of their prior std, F as in (7){prior})")]
    rank = f"{evaluation.rank} of {len(evaluation.parameters)}: singular, log det is -inf"
    facts = [("rank of F", rank), *(("not determined (in prior std)", combination(null)) for null in evaluation.null_directions)]
    if evaluation.log_det_estimable is not None:
        units = "parameters in units of their prior std, F as in (7)"
        facts.append(("log det F of the rest", f"{evaluation.log_det_estimable:.4f} ({units})"))
    return facts


def evaluate_information(
    problem: DesignProblem,
    information: PointInformation,
    d: OutputCovariance,
    threads: int | None,
    prior: Array | None = None,
    clock: Clock | None = None,
) -> Evaluation:
    """Evaluate points whose information is known, beside rows (k, n_unknowns) of what is known of the parameters.

    There is no `nearby` where the clock leaves no time for it.
    """
    names, std = problem.estimated, problem.std
    prepared, nuisance = d.prepare(information), problem.n_nuisance
    accumulator = d.accumulate(prepared)
    covariance_of_outputs = accumulator.output_covariance(d.given, d.pooled)
    factor = cholesky_factor(covariance_of_outputs, d.names, d.kind)
    fisher = finite_fisher(accumulator.fisher(covariance_of_outputs))
    white, known, without_prior = whitened(factor, prepared.sensitivity).reshape(-1, problem.n_unknowns), None, None
    white = without_rounding(white) if d.kind == "noise" else white
    has_effect = np.abs(white).max(axis=0, initial=0.0) > 0.0
    fisher = np.where(has_effect[:, None] & has_effect, fisher, 0.0)
    if prior is not None:
        alone = np.concatenate([white, nuisance_rows(problem)])
        without_prior = _errors_of(marginal_rows(alone, nuisance), names, std)
    if prior is not None or nuisance:
        known = nuisance_rows(problem) if prior is None else np.concatenate([prior, nuisance_rows(problem)])
        fisher, white = fisher + 2 / len(prepared) * known.T @ known, np.concatenate([white, known])
    if nuisance:
        white = marginal_rows(white, nuisance)
        fisher = 2 / len(prepared) * white.T @ white
    log_det = _core.log_det(fisher)

    singular_values, directions, length = column_scaled_svd(white)
    share = singular_values / max(singular_values.max(), 1e-300)
    rank = int((share > RANK_TOLERANCE).sum())
    if rank == len(names) and share[-1] < ACCURATE and (np.diag(fisher) > 0).all():
        log_det = len(names) * np.log(2 / len(prepared)) + 2 * float(np.log(singular_values * length).sum())
    if not np.isfinite(log_det):
        rank = min(rank, len(names) - 1)  # so small that squares are zero
    null, estimable = null_directions(directions[rank:], length, names), None
    if 0 < rank < len(names) and (share[:rank] > RANK_TOLERANCE).all():
        # Of V_r^T s V_r in an orthonormal basis Q of D V_r, with D of the lengths: D V_r = Q R.
        triangle = np.linalg.qr(directions[:rank].T * length[:, None], mode="r")
        parts = np.log(singular_values[:rank]) + np.log(np.abs(np.diag(triangle)))
        estimable = rank * float(np.log(2 / len(prepared))) + 2 * float(parts.sum())

    covariance = correlation = standard_errors = rse = nearby = None
    if rank == len(names) and np.isfinite(log_det):
        # (sum S^T D^-1 S)^-1 = V s^-2 V^T of the column-scaled sensitivities, without forming or inverting their square.
        half = directions.T / singular_values / length[:, None]
        if d.kind == "noise" and problem.has_uneven_readings and share[-1] > ACCURATE:
            covariance = mean_covariance(problem, information, d, factor, known, prior is not None, threads)
            half = np.asarray(np.linalg.cholesky(covariance), dtype=np.float64)
        errors = np.linalg.norm(half, axis=1)
        unit = half / errors[:, None]
        correlation = unit @ unit.T
        with np.errstate(over="ignore", invalid="ignore"):
            covariance = (half * std[:, None]) @ (half * std[:, None]).T
        if not np.isfinite(covariance).all():
            name = names[int(np.argmax(~np.isfinite(covariance).all(axis=0)))]
            raise ValueError(
                f"covariance: expected standard errors whose squares are numbers, given one of {name!r} that overflows: check noise"
            )
        standard_errors = FrozenMapping(dict(zip(names, (errors * std).tolist(), strict=True)))
        rse = relative_errors(standard_errors, problem.prior.mean)
        if d.kind == "noise":
            nearby = nearby_of(problem, information, d, factor, half, threads, known, clock)
    else:
        log_det = -np.inf

    if d.own:
        covariance_of_outputs = d.own_covariances(information.of_outputs(d.used))
    outputs = names_of(problem.model.outputs)
    return Evaluation(
        parameters=names,
        log_det=float(log_det),
        fisher=fisher,
        output_covariance_kind=d.kind,
        output_covariance=covariance_of_outputs,
        outputs=tuple(name for name, taken in zip(outputs, d.used, strict=True) if taken),
        outputs_left_out=tuple(name for name, taken in zip(outputs, d.used, strict=True) if not taken),
        covariance=covariance,
        standard_errors=standard_errors,
        rse=rse,
        correlation=correlation,
        rank=rank,
        null_directions=null,
        prior_std=FrozenMapping(dict(zip(names, std.tolist(), strict=True))),
        n_points=len(prepared),
        units=FrozenMapping({q.name: q.unit for q in problem.model.parameters if q.name in names}),
        nearby=nearby,
        log_det_estimable=float(log_det) if np.isfinite(log_det) else estimable,
        without_prior=without_prior,
    )


def _errors_of(white: Array, names: tuple[str, ...], std: Array) -> Mapping[str, float]:
    """Standard errors from whitened sensitivities (m, p) alone; inf of parameters that these do not determine."""
    singular_values, directions, length = column_scaled_svd(white)
    is_determined = singular_values > RANK_TOLERANCE * max(singular_values.max(), 1e-300)
    size = np.where(length > 0, length, 1.0)
    errors = np.linalg.norm(directions[is_determined].T / singular_values[is_determined], axis=1) / size
    left_open = np.linalg.norm(directions[~is_determined], axis=0) > UNDETERMINED
    errors = np.where(left_open | ~(length > 0), np.inf, errors)
    return FrozenMapping(dict(zip(names, (errors * std).tolist(), strict=True)))


def finite_fisher(fisher: Array) -> Array:
    """The Fisher matrix, which must be finite."""
    if not np.isfinite(fisher).all():
        raise ValueError(
            "fisher: expected sensitivities and noise whose squares are numbers, given a Fisher matrix that overflows: "
            "check noise and the prior's standard deviations"
        )
    return fisher
