"""A design of weights as a report that says what is proven and what is not."""

from __future__ import annotations

from collections.abc import Iterator

from ...basics.quantity import names_of
from ...information.combinations import combination
from ...show.numbers import computed, counted, number, percent_down
from ...show.section import Report, Section
from ..results.settings_section import option_facts
from .approximate_weights import ApproximateWeights

CLEARLY = 0.999
"""A proven efficiency below which the report warns."""


def approximate_report(design: ApproximateWeights) -> Report:
    """Support, criterion, proof and search."""
    among = f"{counted(design.n_candidates, 'candidate')}"
    if design.starts:
        among += f" and {counted(design.starts, 'local ascent')} of the sensitivity function"
    headline = (
        f"Weights of {counted(len(design.points), 'point')}: {design.goal.criterion}-efficiency at least "
        f"{floored(design.efficiency)} among {among}"
    )
    return Report(headline, [_support(design), _proof(design)], list(_warnings(design)))


def floored(efficiency: float) -> str:
    """In percent, rounded down."""
    return f"{percent_down(efficiency, 6).removesuffix(' %').rstrip('0').rstrip('.')} %"


def _support(design: ApproximateWeights) -> Section:
    names = names_of(design.problem.model.axes)
    columns = (*(f"{quantity.name} [{quantity.unit}]" for quantity in design.problem.model.axes), "weight")
    table = design.points.table[:, : len(names)].tolist()
    rows = [(*(number(x, 5) for x in row), f"{w:.5f}") for row, w in zip(table, design.weights.tolist(), strict=True)]
    return Section("Points", columns, rows)


def _proof(design: ApproximateWeights) -> Section:
    goal = design.goal
    facts = [
        ("criterion", goal.short),
        *option_facts(goal, "criterion", "of", "over"),
        *_values(design),
        ("largest sensitivity met, the level at best", f"{design.level * design.largest:.7g}, level {design.level}"),
        ("efficiency by concavity", f"at least {floored(design.efficiency)}"),
        ("over all of", counted(design.n_candidates, "candidate")),
    ]
    if design.starts:
        facts.append(("and what was met by", f"{counted(design.starts, 'local ascent')} in the region"))
    if design.n_experiments is not None:
        facts.append(("what is known beforehand counts once in", counted(design.n_experiments, "experiment")))
    facts += [("not determined (in prior std)", combination(null)) for null in design.null_directions]
    facts += [(f"left out: {reason}", str(count)) for reason, count in design.left_out.items()]
    facts.append(("ended by", design.stop_reason.words))
    if design.deleted:
        facts.append(("proven to have no weight", counted(design.deleted, "candidate")))
    notes = []
    if design.starts:
        notes.append(
            "Points of the region that the search did not come to are not covered: the sensitivity function has many maxima"
        )
    return Section("What is proven", (), [*facts, ("time", f"{design.seconds:.1f} s")], notes=notes)


def _values(design: ApproximateWeights) -> Iterator[tuple[str, str]]:
    """The criterion of one experiment, or its average over scenarios, and the smallest and largest of these."""
    words, over, values = design.goal.row.words, design.goal.over, design.scenario_values
    if over is None or values is None:
        yield f"{words} of one experiment", computed(design.value, 7)
        return
    yield "maximised", f"{design.goal.maximised} over {counted(len(values), 'scenario')}"
    yield "its value, of one experiment", computed(design.value, 7)
    yield "in the scenarios", f"{words} from {computed(min(values), 5)} to {computed(max(values), 5)}"


def _warnings(design: ApproximateWeights) -> Iterator[str]:
    if design.null_directions:
        yield (
            f"The candidates leave {counted(len(design.null_directions), 'combination')} of parameters undetermined, named above:"
            " the design is for the others."
        )
    if design.efficiency < CLEARLY:
        if design.starts:
            why = "the search ended while it still found places that improve the design. More candidates (n_candidates) may help"
        else:
            why = "double precision has no more here"
        yield f"The efficiency is proven to be at least {floored(design.efficiency)} only: {why}."
