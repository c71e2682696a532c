"""A design of whole numbers of measurements as a report that says what is proven and what is not."""

from __future__ import annotations

from collections.abc import Iterator

from ...basics.quantity import names_of
from ...information.combinations import combination
from ...show.numbers import computed, counted, number
from ...show.section import Report, Section
from ..approximate.approximate_report import floored
from ..results.settings_section import option_facts
from .exact_counts import ExactCounts


def exact_report(design: ExactCounts) -> Report:
    """Points, criterion, proof and search."""
    among = counted(design.n_candidates, "candidate")
    what = f"{counted(len(design.points), 'measurement')} at {counted(len(design.counts), 'point')}"
    if design.proven:
        headline = f"{what}: proven {design.goal.criterion}-optimal among {among}, to {number(design.gap, 2)}"
    else:
        headline = f"{what}: {design.goal.criterion}-efficiency at least {floored(design.efficiency)} among {among}"
    return Report(headline, [_points(design), _proof(design)], list(_warnings(design)))


def _points(design: ExactCounts) -> Section:
    names = names_of(design.problem.model.axes)
    columns = (*(f"{quantity.name} [{quantity.unit}]" for quantity in design.problem.model.axes), "measured")
    table = design.distinct.table[:, : len(names)].tolist()
    rows = [(*(number(x, 5) for x in row), str(count)) for row, count in zip(table, design.counts.tolist(), strict=True)]
    return Section("Points", columns, rows)


def _proof(design: ExactCounts) -> Section:
    goal = design.goal
    facts = [
        ("criterion", goal.short),
        *option_facts(goal, "criterion", "of"),
        (f"{design.goal.row.words} of all measurements", computed(design.value, 7)),
        (f"efficiency against any {counted(len(design.points), 'measurement')}", f"at least {floored(design.efficiency)}"),
        ("against weights that need not be whole", f"at least {floored(design.of_weights)}"),
        ("among", counted(design.n_candidates, "candidate")),
        ("of which better designs could have", str(design.n_left)),
        ("nodes of branch and bound", str(design.nodes)),
        ("ended by", design.stop_reason.words),
    ]
    facts += [("not determined (in prior std)", combination(null)) for null in design.null_directions]
    facts += [(f"left out: {reason}", str(count)) for reason, count in design.left_out.items()]
    notes = ["Only designs of these candidates are covered: points between them may be better"]
    return Section("What is proven", (), [*facts, ("time", f"{design.seconds:.1f} s")], notes=notes)


def _warnings(design: ExactCounts) -> Iterator[str]:
    if design.null_directions:
        yield (
            f"The candidates leave {counted(len(design.null_directions), 'combination')} of parameters undetermined, named above:"
            " the design is for the others."
        )
    if not design.proven:
        yield (
            f"No better design is known, but there may be one with up to {number(100 * (1 / design.efficiency - 1), 2)} % more "
            f"information: {design.stop_reason.words}. {design.stop_reason.advice}"
        )
