"""`fp.compare`: designs beside each other, by their information under the sensor noise."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from ...basics.checks import check_mapping, check_name, check_positive_int, check_type
from ...basics.extras import needed_for
from ...basics.field_checks import Choices, Extents
from ...basics.result_files import Kept
from ...basics.values import FrozenMapping
from ...engine.workers import Workers, distributed_over
from ...information.evaluate import evaluate
from ...information.feasibility import Feasibility, feasibility
from ...information.problem import DesignProblem
from ...information.problem_report import problem_sections
from ...points.points_or_runs import Points, as_runs, points_of
from ...points.settings import check_threads
from ...points.status import NoTrajectory
from ...show.display import Plots, Shown
from ...show.numbers import computed, counted, number, percent
from ...show.progress import Progress, check_progress, following
from ...show.section import Report, Section
from ..results.efficiency import d_efficiency

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class ComparedDesign:
    """One of the designs.

    Attributes
    ----------
    kind : {"point", "run"}
    count : int
        Points, or runs.
    samples : int
    duration : float
        Of all of them, s; without the way to their starts.
    log_det : float
        log det F in its sum form, standardised; -inf where F is singular.
    standard_errors : mapping of parameter name to float, or None
        SI units; None where F is singular.
    feasibility : Feasibility
        Which plants of the prior can run it.
    without : str
        Why there is no information: the points or runs that do not reach their ends at the prior mean. Empty where all do.
    """

    kind: str
    count: int
    samples: int
    duration: float
    log_det: float
    standard_errors: Mapping[str, float] | None
    feasibility: Feasibility
    without: str = field(default="", kw_only=True)

    _CHOICES: ClassVar[Choices] = {"kind": ("point", "run")}
    _POSITIVE = ("count", "samples")


@dataclass(frozen=True, eq=False, repr=False)
class DesignComparison(Shown, Kept):
    """What `compare` found; it shows itself as tables.

    Attributes
    ----------
    problem : DesignProblem
    designs : mapping of name to ComparedDesign
    """

    problem: DesignProblem
    designs: Mapping[str, ComparedDesign]

    _EXTENTS: ClassVar[Extents] = {"designs": ("+",), "designs.standard_errors": ("problem.estimated",)}

    @property
    def efficiency(self) -> Mapping[str, float]:
        """D-efficiency of each design against the best of them, (det ratio)^(1/p); 0 where F is singular.

        The best one, repeated that share of times, has as much information as the other.
        """
        return self._against_the_best({name: of.log_det for name, of in self.designs.items()})

    @property
    def efficiency_per_sample(self) -> Mapping[str, float]:
        """D-efficiency of each design by the information in a sample, against the best of them."""
        p = len(self.problem.estimated)
        return self._against_the_best({name: of.log_det - p * np.log(of.samples) for name, of in self.designs.items()})

    def _against_the_best(self, log_dets: Mapping[str, float]) -> Mapping[str, float]:
        best, p = max(log_dets.values()), len(self.problem.estimated)
        return FrozenMapping({name: d_efficiency(value, best, p) or 0.0 for name, value in log_dets.items()})

    def to_pandas(self) -> pd.DataFrame:
        """One row per design and parameter, SI units: standard_error, of_prior; NaN where F is singular."""
        with needed_for("to_pandas"):
            import pandas as pd

        rows = []
        for name, of in self.designs.items():
            for parameter in self.problem.estimated:
                error = (of.standard_errors or {}).get(parameter, np.nan)
                row: dict[str, Any] = {"design": name, "parameter": parameter, "standard_error": error}
                rows.append(row | {"of_prior": error / self.problem.prior.std[parameter]})
        return pd.DataFrame(rows).set_index(["design", "parameter"])

    def plot(self, *, path: str | Path | None = None) -> Figure:
        """Draw the standard errors of all designs, as shares of the prior's; needs matplotlib.

        Parameters
        ----------
        path : path, optional
            Where the picture is also written; the ending says the format, PNG where there is none.
        """
        with needed_for("plot"):
            from ...show.style import drawn
            from .compare_picture import plot_comparison

        errors = {name: of.standard_errors for name, of in self.designs.items()}
        prior_std = {name: self.problem.prior.std[name] for name in self.problem.estimated}
        return drawn(plot_comparison(errors, prior_std), path)

    def _problem_sections(self) -> Sequence[Section]:
        return problem_sections(self.problem)

    def _plots(self) -> Plots:
        return {"comparison": self.plot}

    def report(self) -> Report:
        """Effort and information of each design, and the standard errors beside each other."""
        whole, each = self.efficiency, self.efficiency_per_sample
        rows = []
        for name, of in self.designs.items():
            singular = "none" if of.without else "-inf: singular"
            value = computed(of.log_det, 5) if np.isfinite(of.log_det) else singular
            sizes = counted(of.count, of.kind), str(of.samples), number(of.duration)
            rows.append((name, *sizes, value, percent(whole[name]), percent(each[name]), percent(of.feasibility.share)))
        columns = ("design", "size", "samples", "duration [s]", "log det F, sum", "D-efficiency", "per sample", "plants that can")
        notes = (
            "log det F: standardised, under the sensor noise. D-efficiency: against the best of these, that is the share of times"
            " that one would be repeated for as much information.",
            "Plants that can: of those that the prior allows, which reach the end of every point or run.",
        )
        first = Section("Designs", columns, rows, notes=notes)
        errors = []
        for parameter in self.problem.estimated:
            std = self.problem.prior.std[parameter]
            shares = (None if of.standard_errors is None else of.standard_errors[parameter] / std for of in self.designs.values())
            errors.append((parameter, *("-" if share is None else percent(share) for share in shares)))
        second = Section("Standard errors, of the prior std", ("parameter", *self.designs), errors)
        title = f"{counted(len(self.designs), 'design')} for {self.problem.model.name} beside each other"
        warnings = [f"No information of {name}: {of.without}" for name, of in self.designs.items() if of.without]
        return Report(title, [first, second], warnings)


def compare(
    problem: DesignProblem,
    designs: Any,
    *,
    draws: int = 1000,
    seed: int = 0,
    threads: int | None = None,
    workers: Workers | None = None,
    progress: bool | Callable[[Progress], None] | None = None,
) -> DesignComparison:
    """Compare designs by their information under the sensor noise, and by how many plants can run them.

    Parameters
    ----------
    problem : DesignProblem
        With the sensor noise; its region may be None.
    designs : Experiments, Runs or a design, or a sequence, or a mapping of name to these
        At least one; points and runs beside each other. Without names they are called "design 1" and so on.
    draws, seed : int
        Of the plants on which they are tried (`feasibility`); the same for all designs.
    threads : int, optional
        Default: every core.
    workers : int, Executor or Dask client, optional
        Who looks at the designs, one each at a time (docs/how_to/workers.md). The figures are the same. Default: this process.
    progress : bool or callable, optional
        True shows a bar, on the terminal and in notebooks; needs rich. A function is called with a `Progress` before each
        design, whose name is the message, and at the end.

    Returns
    -------
    DesignComparison

    Raises
    ------
    TypeError, ValueError
        For misuse, and as `evaluate`; the message names the design. A design that does not reach its end at the prior mean
        stands beside the others without information.
    """
    check_type(problem, DesignProblem, "problem")
    check_progress(progress)
    if problem.noise is None:
        raise ValueError("noise: expected the sensor noise, as designs are compared by it, given None")
    named, threads = named_designs(designs), check_threads(threads)
    draws, seed = check_positive_int(draws, "draws"), check_positive_int(seed, "seed", 0)
    started = perf_counter()
    found: dict[str, ComparedDesign] = {}

    with following(progress, "comparing designs") as report, distributed_over(workers, threads) as distributor:
        work = _Comparison(problem, draws, seed, distributor.threads)
        compared = distributor.map(work, named.items(), lambda k: f"designs[{list(named)[k]!r}]", ahead=1)
        for name in named:
            if report is not None:
                report(Progress(len(found), len(named), None, name, perf_counter() - started))
            found[name] = next(compared)
        if report is not None:
            report(Progress(len(found), len(named), None, "", perf_counter() - started))
    return DesignComparison(problem, FrozenMapping(found))


@dataclass(frozen=True, eq=False)
class _Comparison:
    """What is computed of each design."""

    problem: DesignProblem
    draws: int
    seed: int
    threads: int

    def __call__(self, named: tuple[str, Points]) -> ComparedDesign:
        (name, points), problem = named, self.problem
        evaluation, without = None, ""
        try:
            try:
                evaluation = evaluate(problem, points, output_covariance="noise", threads=self.threads)
            except NoTrajectory as error:
                without = str(error)
            able = feasibility(problem, points, draws=self.draws, seed=self.seed, threads=self.threads)
        except ValueError as error:
            raise ValueError(f"designs[{name!r}]: {error}") from error
        p, samples = len(problem.estimated), int(as_runs(points).measured.sum())
        return ComparedDesign(
            kind=points.kind,
            count=len(points),
            samples=samples,
            duration=float(points.dt.sum()),
            log_det=-np.inf if evaluation is None else float(evaluation.log_det + p * np.log(samples / 2)),
            standard_errors=None if evaluation is None else evaluation.standard_errors,
            feasibility=able,
            without=without,
        )


def named_designs(given: Any) -> dict[str, Points]:
    """The points or runs of designs by their names; one alone is called "design", and those of a sequence "design 1" and so on."""
    if _points_of(given) is not None:
        given = {"design": given}
    elif isinstance(given, list | tuple):
        given = {f"design {k + 1}": design for k, design in enumerate(given)} if len(given) != 1 else {"design": given[0]}
    check_mapping(given, "designs", "Experiments, Runs or a design")
    if not given:
        raise ValueError("designs: expected at least one, given none")
    named = {}
    for name, design in given.items():
        check_name(name, "designs")
        points = _points_of(design)
        if points is None:
            raise TypeError(f"designs[{name!r}]: expected Experiments, Runs or a Design, given {type(design).__name__}")
        if not len(points):
            raise ValueError(f"designs[{name!r}]: expected at least one point, given none")
        named[name] = points
    return named


def _points_of(design: Any) -> Points | None:
    """The points or runs of a design; None where it is none, or has weights instead of whole numbers of points."""
    return None if hasattr(design, "weights") else points_of(design)
