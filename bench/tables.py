"""The figures as tables."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict

from rich.console import Console
from rich.table import Table

from fisherpoint.design.points.tuning import PaperSearchTuning

from . import cost, packs
from .accuracy import ACCURACY_RULE, Errors
from .campaign import CampaignFigures, Outcome
from .covariances import Contender, CovarianceFigures
from .designs import DesignFigures
from .memory import MemoryFigures
from .models import ModelFigures
from .peers import show
from .peers.compare import Comparison
from .pieces import PieceFigures
from .runs import RunFigures
from .scaling import Series
from .screening import ScreeningFigures
from .sensitivities import SensitivityFigures
from .stiff import StiffFigures
from .strokes import StrokeFigures
from .validation import SAME, ValidationFigures

console = Console(highlight=False, width=max(Console().width, 120))  # narrower, the tables break their rows


def show_machine(machine: Mapping[str, str]) -> None:
    """Print what the figures are taken on."""
    grid = Table.grid(padding=(0, 2))
    for name, value in machine.items():
        grid.add_row(name, value)
    console.print(grid, "")


def show_covariances(figures: CovarianceFigures) -> None:
    """Print the trajectories per second, the errors that go with them, and the instruction sets."""
    _show_contenders(
        f"Predictive covariances, 96 candidates on the 3^9 grid ({figures.workload})",
        "trajectories",
        figures.ours,
        [*figures.peers, figures.stacked],
    )
    console.print(
        f"Errors of y on {figures.sample} pairs of candidate and node; the rule: 99 % below {ACCURACY_RULE.quantile_99:.0e},"
        f" all below {ACCURACY_RULE.worst:.0e}. Reference: DOP853 at 1e-12,"
        f" which differs from fisherpoint at 1e-12 by {figures.reference_difference:.0e}.\n"
        f"fisherpoint's errors on {figures.grid_sample:,} of all {figures.trajectories:,} trajectories:"
        f" {_text(figures.grid_errors)}; of predictive standard deviations, at most {figures.std_error:.1e}.\n"
    )
    slowest = min(figures.rate_by_isa.values())
    rows = [(isa, f"{rate:,.0f}", f"{rate / slowest:.2f}") for isa, rate in figures.rate_by_isa.items()]
    _show("The same on one thread, by instruction set", ("", "trajectories/s", "ratio"), rows)


def show_sensitivities(figures: SensitivityFigures) -> None:
    """Print the experiments per second and the errors that go with them."""
    _show_contenders("States and all nine sensitivities", "experiments", figures.ours, figures.peers)
    console.print(
        f"Errors of dy/dtheta relative to the root mean square of each entry, on {figures.sample} experiments; the same rule."
        f" Reference: DOP853 at 1e-12, which differs from fisherpoint at 1e-12 by {figures.reference_difference:.0e}.\n"
    )


def show_designs(figures: Sequence[DesignFigures]) -> None:
    """Print one row per search."""
    header = ("D", "threads", "iterations", "seconds", "cores", "candidates/s", "trajectories", "Fisher accumulator", "Python")
    rows = [
        (
            f.name,
            str(f.threads),
            str(f.iterations),
            f"{f.seconds:.2f}",
            f"{f.cores:.1f}",
            "" if f.candidates_per_second is None else f"{f.candidates_per_second:,.0f}",
            f"{f.share_of_trajectories:.0%}",
            f"{f.share_of_accumulator:.0%}",
            f"{1 - f.share_of_trajectories - f.share_of_accumulator:.0%}",
        )
        for f in figures
    ]
    _show("Designs of 12 points, 50 candidates per draw, default cylinder; shares of the time", header, rows)


def show_screening(figures: Sequence[ScreeningFigures]) -> None:
    """Print one line per output covariance."""
    left = PaperSearchTuning().shortlist
    for f in figures:
        console.print(
            f"Screening, {f.output_covariance}: the best of 50 candidates under the rule was among the {left} that are left in"
            f" {f.same} of {f.draws} draws ({f.share:.1%})."
        )
    console.print()


def show_validation(figures: Sequence[ValidationFigures]) -> None:
    """Print one row per design and tolerance, and how near SciPy's minima are."""
    header = ("design", "rtol", "threads", "1000 fits, s", "cores", "validate, s", "per fit, next to a loop")
    rows = [
        (f.design, f"{f.rtol:.0e}", str(f.threads), f"{f.seconds:.2f}", f"{f.cores:.1f}", f"{f.whole:.2f}", f"{f.ratio:.0f} x")
        for f in figures
    ]
    _show("Fits of the cylinder, nine parameters", header, rows)
    for f in figures:
        console.print(
            f"{f.design}, rtol {f.rtol:.0e}: {f.same} of {f.compared} within {SAME:.0e} standard errors of SciPy's (median"
            f" {f.median:.0e}, worst {f.worst:.0e}); after a Gauss-Newton step from there, worst {f.worst_stepped:.0e}."
        )
    console.print()


def show_campaign(figures: CampaignFigures) -> None:
    """Print how often campaigns come out ahead of single designs, and by how much."""

    def standard_error(outcome: Outcome) -> float:
        return outcome.standard_error

    def error(outcome: Outcome) -> float:
        return outcome.error

    whole = figures.whole
    header = ("geometric mean over the parameters", "campaign lower in", "campaign / single: quartiles", "", "")
    rows = []
    for name, figure in (("achieved standard errors", standard_error), ("amounts of the errors", error)):
        quartiles = [f"{value:.2f}" for value in figures.ratios(figure)]
        rows.append((name, f"{figures.wins(figure)} of {len(whole)}", *quartiles))
    _show(f"Four batches of six against one design of 24 points, {len(figures.runs)} truths from twice the prior std", header, rows)
    missing = [24 * len(whole) - sum(pair[way].measured for pair in whole) for way in (0, 1)]
    console.print(
        f"Root mean square of the errors, geometric mean over the parameters: {figures.rmse(True):.4f} against"
        f" {figures.rmse(False):.4f} prior std. Points that gave no measurement: {missing[0]} against {missing[1]}."
        f" Runs that failed: {len(figures.runs) - len(whole)}. {figures.max_iterations} iterations a batch;"
        f" {figures.seconds:.0f} s."
    )
    console.print()


def show_memory(figures: Sequence[MemoryFigures]) -> None:
    """Print one row per grid."""
    header = ("nodes", "seconds", "peak grows by, MB", "nodes and outputs stored, MB")
    rows = [(f"{f.nodes:,}", f"{f.seconds:.2g}", f"{f.grown:.1f}", f"{f.stored:.1f}") for f in figures]
    _show("Memory of one predictive covariance, all cores", header, rows)


def show_comparison(comparison: Comparison) -> None:
    """Print the programs on both tasks, and what became of the targets."""
    figures = asdict(comparison)
    for task, title in show.TITLES.items():
        _show(title, show.header(task), show.rows(figures[task]))
    for name, missing in comparison.skipped.items():
        console.print(f"{name}: left out, for want of it: {missing}")
    console.print(
        "Ratios are those of our default tolerance; the other programs run at the loosest that meets the accuracy rule."
        f" Reference: fisherpoint at 1e-12, from which DOP853 of SciPy differs by {comparison.reference_difference:.0e}.\n"
    )
    for line in show.targets(figures):
        console.print(line)


def show_scaling(found: Sequence[Series]) -> None:
    """Print one row per series."""
    _show("How the cost grows", show.SCALING_HEADER, show.scaling_rows([asdict(series) for series in found]))


def show_cost(now: cost.Cost, before: cost.Cost) -> None:
    """Print a row per kind of work: what each event counts now, and how that differs from the record."""
    grown = cost.changes(now.counts, before.counts)
    events = tuple(cost.EVENTS.values())
    rows = [(kind, *(f"{now.counts[kind][event]:,.0f} ({grown[kind, event]:+.1%})" for event in events)) for kind in now.counts]
    _show(f"Per trajectory, x86-64-v3, caches of 32 kB, {now.compiler}; the record is of {before.compiler}", ("", *events), rows)


def show_runs(figures: Sequence[RunFigures]) -> None:
    """Print a row per problem."""
    header = ("", "published", "least", "largest", "reached", "longest, s", "least share of plants", "asked share met")
    rows = [
        (
            f.name,
            *(f"{value:.4f}" for value in (f.published, f.least, f.largest)),
            f"{f.reached} of {f.seeds}",
            f"{f.longest:.1f}",
            f"{f.least_share:.1%}",
            f"{f.feasible} of {f.seeds}",
        )
        for f in figures
    ]
    _show("Designs of runs: log det F from several seeds", header, rows)


def show_strokes(figures: Sequence[StrokeFigures]) -> None:
    """Print a row per problem and seed."""
    header = ("", "seed", "log det F", "plants that can", "best classical run of as many", "s", "limit, s", "good")
    rows = [
        (
            f.name,
            str(f.seed),
            f"{f.log_det:.3f}",
            f"{f.share:.1%}",
            f"{f.classical:.3f}",
            f"{f.seconds:.0f}",
            "-" if f.time_limit is None else f"{f.time_limit:.0f}",
            "yes" if f.good else "no",
        )
        for f in figures
    ]
    _show("Designs of runs within limits", header, rows)


def show_pieces(figures: Sequence[PieceFigures]) -> None:
    """Print a row per choice."""
    header = ("windows", "one every", "left out", "s", "peak, MB", "before, MB", "efficiency", "of all", "to spread", "to random")
    rows = [
        (
            f"{f.windows:,}",
            f"{f.every}",
            f"{f.left_out:,}",
            f"{f.seconds:.1f}",
            f"{f.peak:.0f}",
            f"{f.before:.0f}",
            f"{f.efficiency:.3%}",
            f"{f.share:.1%}",
            f"{f.versus_spread:.1f} x",
            f"{f.versus_random:.1f} x",
        )
        for f in figures
    ]
    _show(f"The 200 best windows of a log of {figures[0].samples:,} samples", header, rows)


def show_stiff(figures: Sequence[StiffFigures]) -> None:
    """Print two rows per model."""
    header = (
        "",
        "rtol",
        "CVODES'",
        "one, ms",
        "interpreted",
        "CVODES",
        "ratio",
        "each of 1000, ms",
        "interpreted",
        "CVODES",
        "ratio",
    )
    rows = [
        (
            f"{f.model}, {'dx/dtheta' if f.sensitivities else 'states'}",
            *("none" if rtol is None else f"{rtol:.0e}" for rtol in (f.rtol, f.rtol_cvodes)),
            *(f"{1e3 * seconds:.3g}" for seconds in (f.one, f.one_interpreted, f.one_cvodes)),
            f"{f.one_cvodes / f.one:.1f}",
            *(f"{1e3 * seconds:.3g}" for seconds in (f.each, f.each_interpreted, f.each_cvodes)),
            f"{f.each_cvodes / f.each:.0f}",
        )
        for f in figures
    ]
    _show("Stiff models, next to CVODES through CasADi at matched accuracy; compiled, ratios likewise, one core", header, rows)


def show_packs(figures: Sequence[packs.Figures], left_out: Iterable[str]) -> None:
    """Print one row per kind of vector, width and instruction set."""
    header = ("", "instruction set", "lanes", "trajectories/s", "ratio", "compilation, s")
    rows = [
        (f.name, f"x86-64-{f.level}", str(f.lanes), f"{f.rate:,.0f}", f"{f.ratio:.2f}", f"{f.compile_seconds:.1f}") for f in figures
    ]
    _show("The same trajectories on every kind of vector, one core", header, rows)
    for reason in left_out:
        console.print(f"Left out, for want of {reason}")


def _show_contenders(title: str, unit: str, ours: Mapping[int, Contender], peers: Iterable[Contender]) -> None:
    first = next(iter(ours.values()))
    header = ("", "rtol", f"{unit}/s", "cores", "ratio", "median error", "99 %", "worst")
    rows = [
        (
            c.name,
            f"{c.rtol:.1e}",
            f"{c.rate:,.0f}",
            f"{c.cores:.1f}",
            f"{first.rate / c.rate:,.{0 if first.rate > 100 * c.rate else 1}f}",
            *(f"{error:.1e}" for error in (c.errors.median, c.errors.quantile_99, c.errors.worst)),
        )
        for c in (*ours.values(), *peers)
    ]
    _show(title, header, rows)


def _show(title: str, header: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    table = Table(title=title, title_justify="left", title_style="bold", header_style="", min_width=min(len(title), 100))
    for i, name in enumerate(header):
        table.add_column(name, justify="right" if i else "left", no_wrap=not i)
    for row in rows:
        table.add_row(*row)
    console.print(table, "")


def _text(errors: Errors) -> str:
    return f"median {errors.median:.1e}, 99 % {errors.quantile_99:.1e}, worst {errors.worst:.1e}"


def show_models(figures: Sequence[ModelFigures], first_trajectory: float) -> None:
    """Print what the same model costs in each of its forms."""
    table = Table(title="The cylinder on one core", title_justify="left")
    for column in ("model", "trajectories/s", "of built in", "experiments with sensitivities/s", "of built in"):
        table.add_column(column, justify="left" if column == "model" else "right")
    for one in figures:
        rates = f"{one.trajectories:,.0f}", f"{one.of_trajectories:.0%}", f"{one.experiments:,.0f}", f"{one.of_experiments:.0%}"
        table.add_row(one.name, *rates)
    console.print(table)
    console.print(f"From a model's source to its first trajectory: {first_trajectory:.2f} s", "")
