"""What a design, a set of points or a simulation is worth, as tables for the terminal and for ``report.txt``."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from io import StringIO
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from rich import box
from rich.console import Console, Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from ..basics.messages import printable
from ..basics.quantity import Quantity
from ..information.problem import DesignProblem
from ..models import Model
from ..points.experiments import Experiments
from ..points.trajectories import Status
from .efficiency import Efficiency
from .evaluated import Evaluated, parameter_frame
from .result import Design

WIDTH = 100
"""Columns of ``report.txt`` and of a report that is piped."""

_ROWS = 40  # points shown of a longer list


def design_report(design: Design) -> Group:
    """The report of `fisherpoint design`: points, parameters, criterion, efficiency, search, warnings."""
    parts = [_headline(design), _points_table(design), _parameter_table(design)]
    parts += [_criterion(design), _efficiency(design), _search(design)]
    if design.rejected:
        parts.append(_counts("Rejected candidates", design.rejected, design.drawn, "of drawn"))
    return Group(*parts, *_warnings(design, design.efficiency))


def evaluation_report(evaluated: Evaluated) -> Group:
    """The report of `fisherpoint evaluate`: points, parameters, criterion, warnings."""
    parts = [_headline(evaluated), _points_table(evaluated), _parameter_table(evaluated), _criterion(evaluated)]
    return Group(*parts, *_warnings(evaluated, None))


def simulation_report(model: Model, points: Experiments, y: NDArray[Any], status: NDArray[Any]) -> Group:
    """The report of `fisherpoint simulate`: the outputs at dt and how the trajectories ended, with advice."""
    duration = [quantity for quantity in model.axes if quantity.name == "dt"]
    after = " after dt" if duration else ""
    title = Text(f"Outputs{after} at the prior mean, {len(points)} points", "bold")
    table = _table(None, ["#"])
    for quantity in [*duration, *model.outputs]:
        table.add_column(_header(quantity), justify="right")
    table.add_column("status")
    names = [Status(int(code)).name for code in status]
    cells = [*(column_text(points.dt) for _ in duration), *(column_text(values) for values in y.T), names]
    for k, row in enumerate(zip(*(cell[:_ROWS] for cell in cells), strict=True)):
        table.add_row(str(k + 1), *row, style=None if names[k] == "ok" else "yellow")
    counts = pd.Series(names).value_counts()
    parts = [title, table, *_more(len(points))]
    return Group(*parts, _counts("Trajectories", {str(k): int(n) for k, n in counts.items()}, len(points), "of all"))


def to_text(report: RenderableType) -> str:
    """A report as plain text, `WIDTH` columns wide."""
    stream = StringIO()
    Console(file=stream, width=WIDTH, color_system=None, highlight=False, legacy_windows=False).print(report)
    text = "\n".join(printable(line.rstrip()) for line in stream.getvalue().split("\n"))
    return re.sub(r"\n{3,}", "\n\n", text).strip("\n") + "\n"


# Numbers


def number(value: float, digits: int = 4) -> str:
    """A given number, with at most that many significant digits; ``-`` where there is none."""
    return "-" if math.isnan(value) else _short_exponent(f"{value:.{digits}g}")


def result(value: float, digits: int = 3) -> str:
    """A computed number, with exactly that many significant digits; ``-`` where there is none."""
    return "-" if math.isnan(value) else _short_exponent(f"{value:#.{digits}g}").rstrip(".")


def percent(share: float) -> str:
    """A share in percent with three significant digits; what is far above all, as a factor."""
    if share >= 9.995:
        return f"{result(share)} times"
    if 0 < share < 1e-4:
        return "< 0.01 %"
    return "-" if math.isnan(share) else f"{result(100 * share)} %"


def column_text(values: Iterable[float], digits: int = 4) -> list[str]:
    """A column of numbers of one quantity with the same number of decimals, so that they line up."""
    values = np.asarray(list(values), dtype=float)
    largest = float(np.max(np.abs(values), initial=0.0, where=np.isfinite(values)))
    if largest and not 1e-3 <= largest < 1e5:
        texts = [_short_exponent(f"{value:.{digits - 1}e}") for value in values]
    else:
        decimals = max(0, digits - 1 - math.floor(math.log10(largest))) if largest else 0
        # What would look like zero is written out.
        small = 10.0 ** (1 - decimals)
        texts = [f"{value:.{decimals}f}" if not 0 < abs(value) < small else result(value, 2) for value in values]
    return ["-" if math.isnan(value) else text for value, text in zip(values, texts, strict=True)]


def _short_exponent(text: str) -> str:
    """1.2e+07 as 1.2e7."""
    mantissa, _, exponent = text.partition("e")
    return f"{mantissa}e{int(exponent)}" if exponent else text


# Tables


def _table(title: str | None, columns: Sequence[str] = ()) -> Table:
    table = Table(box=box.SIMPLE_HEAD, title=Text(title, "bold") if title else None, title_justify="left", pad_edge=False)
    for column in columns:
        table.add_column(column, justify="right")
    return table


def _header(quantity: Quantity) -> Text:
    return Text.assemble(quantity.name, "\n", (f"[{quantity.unit}]", "dim"))


def _facts(title: str, facts: Iterable[tuple[str, str]]) -> Table:
    """Lines of a name and what holds for it."""
    table = Table(box=None, title=Text(title, "bold"), title_justify="left", show_header=False)
    table.add_column(style="dim", width=31)
    table.add_column()
    for name, fact in facts:
        table.add_row(Text(name), Text(fact))
    return table


def _headline(evaluated: Evaluated) -> Text:
    parameters, points = evaluated.evaluation.parameters, evaluated.points
    previous = getattr(evaluated, "n_previous", 0)
    beside = f" beside {previous} previous ones" if previous else ""
    return Text(
        f"\n{_plural(len(points), 'experiment point')}{beside} for {evaluated.problem.model.name}, "
        f"{_plural(len(parameters), 'parameter')} to estimate: {', '.join(parameters)}\n",
        "bold",
    )


def _points_table(evaluated: Evaluated) -> RenderableType:
    model, points = evaluated.problem.model, evaluated.points
    start, held = "start in this state, " if model.states else "", "hold the inputs, " if model.inputs else ""
    title = Text(f"Points: {start}{held}sample the outputs{' after dt' if model.states else ''}", "bold")
    table = _table(None, ["#"])
    for quantity in model.axes:
        table.add_column(_header(quantity), justify="right")
    columns = [column_text(column[:_ROWS]) for column in points.table.T[: len(model.axes)]]
    for k, row in enumerate(zip(*columns, strict=True)):
        table.add_row(str(k + 1), *row)
    return Group(title, table, *_more(len(points)))  # a title of the table's own would be broken to its width


def _more(total: int) -> list[RenderableType]:
    return [Text(f"... and {total - _ROWS} more\n", "dim")] if total > _ROWS else []


def _parameter_table(evaluated: Evaluated) -> RenderableType:
    """Standard errors under the sensor noise; none where it is not known, as no other D promises any."""
    problem, under_noise = evaluated.problem, evaluated.under_noise
    if under_noise is None:
        return Text(
            "No standard errors: the precision of an estimate follows from the sensor noise, which is not known. The D of the "
            "criterion is the spread of the outputs over the prior; it ranks designs. Give [noise_std].\n",
            "italic",
        )
    noise = "the sensor noise (D = R)" if problem.assumed is None else "the sensor noise and what is uncertain (R_k)"
    table = _table(f"Parameters, predicted under {noise}")
    table.add_column("parameter")
    table.add_column("unit", style="dim")
    for column in ("mean", "prior std", "standard error", "RSE", "of prior std"):
        table.add_column(column, justify="right")
    for name, row in parameter_frame(problem, under_noise).iterrows():
        table.add_row(
            Text(str(name)),
            Text(row.unit),
            number(row["mean"]),
            number(row.prior_std),
            result(row.standard_error),
            percent(row.rse),
            percent(row.of_prior),
            style="yellow" if name in under_noise.weak_parameters else None,
        )
    if problem.assumed is None or problem.assumed_covariance == "predictive":
        return table
    return Group(
        table,
        Text(
            'To first order in what is uncertain; assumed_covariance = "predictive" takes in curvature, which may make estimates '
            "worse than this. fisherpoint validate tells.\n",
            "italic",
        ),
    )


def _criterion(evaluated: Evaluated) -> Table:
    evaluation = evaluated.evaluation
    facts = [
        ("output covariance D", _describe_covariance(evaluated.problem)),
        ("outputs used", ", ".join(evaluation.outputs)),
    ]
    if evaluation.outputs_left_out:
        left_out = ", ".join(evaluation.outputs_left_out)
        facts.append(("outputs left out", f"{left_out}: no noise is given and no parameter has an influence"))
    facts += _assumed(evaluated.problem)
    if evaluation.covariance is None:
        facts.append(("rank of F", f"{evaluation.rank} of {len(evaluation.parameters)}: singular, log det is -inf"))
        facts += [("not determined (in prior std)", _combination(null)) for null in evaluation.null_directions]
    else:
        facts.append(("log det F", f"{evaluation.log_det:.4f} (parameters in units of their prior std, F as in (7))"))
    if evaluated.under_noise is not None and evaluation.output_covariance_kind != "noise":
        facts.append(("log det F under the noise", f"{evaluated.under_noise.log_det:.4f}"))
    return _facts("Criterion", facts)


def _assumed(problem: DesignProblem) -> Iterator[tuple[str, str]]:
    """What is uncertain and so takes part in the output covariance of each point."""
    model = problem.model
    units = {q.name: q.unit for q in (*model.states, *model.parameters, *model.constant_quantities)}
    for label, stds in (("uncertain", problem.uncertain), ("starts deviate by", problem.initial_state_std)):
        if stds:
            yield label, ", ".join(f"{name} {number(std)}{f' {units[name]}' * (units[name] != '1')}" for name, std in stds.items())


def _describe_covariance(problem: DesignProblem) -> str:
    noise = "" if problem.noise_std is None else "R + "
    form = {
        "noise": "noise: D = R, the sensor noise",
        "region": f"region: D = {noise}mean predictive covariance over the region",
        "pooled": f"pooled: D = {noise}mean predictive covariance of the points, (17)",
        "pointwise": f"pointwise: D_k = {noise}predictive covariance of the point itself",
    }[problem.output_covariance or ""]
    return form if problem.assumed is None else f"{form}; and of each point what is uncertain"


def _combination(direction: Mapping[str, float]) -> str:
    """A direction in parameter space as a sum of its larger terms, of which the first is positive."""
    terms = sorted(direction.items(), key=lambda term: -abs(term[1]))
    largest = terms[0][1]
    shown = [(name, value * math.copysign(1.0, largest)) for name, value in terms if abs(value) > 0.05 * abs(largest)]
    text = " ".join(f"{'-' if value < 0 else '+'} {abs(value):.2f} {name}" for name, value in shown)
    return text.removeprefix("+ ") + (" + ..." if len(shown) < len(terms) else "")


def _efficiency(design: Design) -> RenderableType:
    efficiency, facts = design.efficiency, []
    if efficiency is None:
        return Group()
    if efficiency.vs_optimum is not None:
        optimum = f"(log det {efficiency.noise_optimum:.4f})"
        facts.append(("of the noise-only optimum found", f"{percent(efficiency.vs_optimum)} {optimum}"))
    if efficiency.vs_random is not None:
        median = f"(log det {efficiency.random_median:.4f})"
        facts.append(("of the median random design", f"{percent(efficiency.vs_random)} {median}"))
    if efficiency.vs_bound is not None:
        bound = f"(log det {efficiency.bound:.4f}, under the D of the criterion)"
        facts.append(("of the closed bound", f"{percent(efficiency.vs_bound)} {bound}"))
    under = "" if efficiency.under_noise is None else f"; under the sensor noise, log det {efficiency.under_noise:.4f}"
    return Padding(_facts(f"D-efficiency{under}", facts), (1, 0, 0, 0)) if facts else Group()


_STOP = {
    "max_iterations": "all iterations done",
    "patience": "no exchange for {patience} iterations",
    "time_limit": "the time limit of {time_limit:g} s",
    "interrupted": "interrupted; this is the best design until then",
}


def _search(design: Design) -> RenderableType:
    settings, problem = design.settings, design.problem
    exchanges = sum(record.exchanged for record in design.trace)
    last = design.trace[-1].iteration if design.trace else 0
    stop = _STOP[design.stop_reason].format(patience=settings.patience, time_limit=settings.time_limit or 0)
    rate = f" ({design.drawn / design.seconds:.0f} per second)" if design.seconds > 0 else ""
    facts = [
        ("stopped by", stop),
        ("iterations", f"{last} of at most {settings.max_iterations}, {_plural(exchanges, 'exchange')}"),
        (
            "candidates",
            f"{design.drawn} drawn{rate}, {design.accepted} accepted, {settings.n_candidates} per iteration",
        ),
        ("rule over the prior", f"{problem.rule}, {_plural(problem.rule.size(problem.prior), 'node')}"),
        ("distinct points", f"{design.distinct_points} of {len(design.points)}"),
        ("seed, time", f"{settings.seed}, {design.seconds:.1f} s"),
    ]
    if design.previous_left_out:
        lost = ", ".join(f"{reason} {count}" for reason, count in design.previous_left_out.items())
        facts.append(("previous points left out", f"{lost}: none at the prior mean, they say nothing"))
    return Padding(_facts("Search", facts), (1, 0, 0, 0))


_CONSTRAINT = "The point breaks a constraint of the region: bounds that fit the constraints waste fewer draws."


_NEAR = "A deviation of the start, three of initial_state_std, may put the point past it: start further off."


def _counts(title: str, counts: Mapping[str, int], total: int, share: str) -> RenderableType:
    """How many there were of each status or reason, and what to do about it."""
    table = _table(title)
    table.add_column("what")
    table.add_column("number", justify="right")
    table.add_column(share, justify="right")
    table.add_column("advice")
    for name, count in sorted(counts.items(), key=lambda item: -item[1]):
        if name in Status.__members__:
            advice = "" if name == "ok" else Status[name].advice
        else:
            advice = _CONSTRAINT if name == "constraint" else _NEAR if name.startswith("starts near") else ""
        table.add_row(Text(name), str(count), percent(count / total) if count else "0 %", Text(advice))
    return Padding(table, (1, 0, 0, 0))


def _warnings(evaluated: Evaluated, efficiency: Efficiency | None) -> Iterator[RenderableType]:
    """What the user should not miss, each as a paragraph."""
    texts = []
    if efficiency is not None and efficiency.below_random:
        kind = evaluated.evaluation.output_covariance_kind
        texts.append(
            f"Under the sensor noise this design is worse than the median random design. The criterion's D "
            f'("{kind}") does not see the size of a signal; use output_covariance = "noise".'
        )
    if evaluated.evaluation.covariance is None:
        texts.append(
            "F is singular: the points do not determine all parameters. Add points, widen the region, or leave "
            "parameters out (parameters = [...])."
        )
    elif evaluated.under_noise is not None and evaluated.under_noise.weak_parameters:
        texts.append(
            f"The standard error stays above half the prior std for {', '.join(evaluated.under_noise.weak_parameters)}: these "
            "experiments say little about them. More points, a longer dt or wider bounds may."
        )
    for text in texts:
        yield Padding(Text.assemble(("Warning: ", "bold yellow"), text), (1, 0, 0, 0))


def _plural(count: int, what: str) -> str:
    return f"{count} {what}" if count == 1 else f"{count} {what}s"
