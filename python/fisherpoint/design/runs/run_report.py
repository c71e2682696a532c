"""What a design of runs is worth, as a report."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ...basics.messages import with_counts
from ...basics.quantity import names_of
from ...information.evaluation import Evaluation
from ...information.problem import DesignProblem
from ...information.problem_report import local_in_words
from ...points.run_region import RunRegion
from ...show.numbers import computed, counted, number, percent
from ...show.section import Report, Section
from ..results.criterion_report import goal_facts
from ..results.efficiency import d_efficiency
from ..results.found_runs import FoundRuns
from ..results.over_report import over_sections
from ..results.report import plants_sections
from ..results.settings_section import left_out_facts
from ..results.singular_report import ridge_facts
from .run_tables import divided, runs_tables

REASONS = 4
"""Why random runs do not reach their ends: the most frequent reasons."""

OF_MEAN, OF_SUM = "F as in (7)", "F summed over samples"
"""How a log det F is scaled: in the report of an evaluation, and in this one."""


def run_report(design: FoundRuns) -> Report:
    """Runs, parameters, which plants can run them, the search, and warnings."""
    problem, runs = design.problem, design.runs
    parameters = design.evaluation.parameters
    samples = counted(int(runs.measured.sum()), "sample")
    headline = (
        f"{counted(len(runs), 'run')} with {samples} for {problem.model.name}, {counted(len(parameters), 'parameter')} to estimate"
        f"{design.settings.goal.headline}"
    )
    inner = design.evaluation.report()
    plants = plants_sections(design.feasibility, design.settings.goal.share_of_plants)
    over = [part for one in over_sections(design) for part in (divided(one) if one.columns else [one])]
    facts = list(goal_facts(design))
    goal = [Section("Goal", (), facts)] if facts else []
    if problem.local_parameters:
        goal.append(Section("Estimated too", (), [("local parameters", local_in_words(problem.local_parameters))]))
    parameter_table, *criterion = inner.sections
    tables = [*runs_tables(problem.model, runs, design.n_kept), *_signals(design), *divided(_with_means(parameter_table, problem))]
    tables += [*(_summed(one, design.evaluation) for one in criterion), *goal, *_known(design)]
    sections = [*tables, *over, *plants, _search(design), *_classical(design)]
    return Report(headline, sections, [*_warnings(design), *inner.warnings])


def _with_means(table: Section, problem: DesignProblem) -> Section:
    """The table of an evaluation, which does not know the means, with these before the standard deviations."""
    place = list(table.columns).index("prior std")
    columns = [*table.columns[:place], "mean", *table.columns[place:]]
    rows = [(*row[:place], number(problem.prior.mean[row[0]]), *row[place:]) for row in table.rows]
    return replace(table, columns=columns, rows=rows)


def _summed(section: Section, evaluation: Evaluation) -> Section:
    """The criterion of an evaluation, of F as the sum over samples, which is what a search for runs maximises."""
    rows = []
    for name, fact in section.rows:
        if name.startswith("log det F") and OF_MEAN in fact:
            level = evaluation.rank if name != "log det F" else len(evaluation.parameters)
            value = evaluation.log_det if name == "log det F" else float(evaluation.log_det_estimable or 0.0)
            fact = f"{value + level * np.log(evaluation.n_points / 2):.4f}" + fact[fact.index(" (") :].replace(OF_MEAN, OF_SUM)
        rows.append((name, fact))
    return replace(section, rows=rows)


def _signals(design: FoundRuns) -> Iterator[Section]:
    """The numbers of profiles of inputs, a column for each run."""
    for name, runs in design.signals.items():
        first = design.n_kept + 1
        columns = [name, "unit", *(f"run {first + k}" for k in range(len(runs)))]
        rows = [(of[0].name, of[0].unit, *(number(one.value) for one in of)) for of in zip(*runs, strict=True)]
        yield from divided(Section(f"Profile of {name}", columns, rows), keys=2)


def _known(design: FoundRuns) -> Iterator[Section]:
    """How good the design is for all that is known, where designs of points have a certificate."""
    facts = [("bound", "none is proven: better runs may exist, and more starts may find them")]
    finite, name = {one: value for one, value in design.classical.items() if np.isfinite(value)}, design.settings.goal.criterion
    if finite and np.isfinite(design.log_det):
        best = max(finite, key=lambda one: finite[one])
        efficiency = d_efficiency(finite[best], design.log_det, design.criterion.level)
        share = percent(design.classical_shares.get(best, np.nan))
        fact = f"{percent(efficiency or 0.0)} of the design ({best}, which {share} of the plants can run)"
        facts.insert(0, ("the best classical run", fact))
    yield Section(f"{name}-efficiency", (), facts)


def _search(design: FoundRuns) -> Section:
    singular = not np.isfinite(design.log_det)
    what = f"{design.settings.goal.maximised}, sum over samples"
    facts = [
        (what, "-inf: singular" if singular else computed(design.log_det, 6)),
        ("starts", f"{len(design.ends)} of {design.settings.n_starts}"),
        ("that ended as well as the best", f"{design.again} of {len(design.ends)}"),
        ("end of the search", design.stop_reason.words),
        ("runs drawn", f"{design.drawn}, of which {sum(design.rejected.values())} do not reach their ends"),
        *ridge_facts(design.ridge, False),
        *left_out_facts(design.left_out),
        ("time", f"{design.seconds:.1f} s"),
    ]
    others = sorted((end for end in design.ends if np.isfinite(end)), reverse=True)
    values = ", ".join(computed(end, 5) for end in others[:8]) + (" ..." if len(others) > 8 else "")
    why = sorted(design.rejected.items(), key=lambda one: -one[1])[:REASONS]
    notes = [f"Those that do not: {with_counts(dict(why))}."] if why else []
    note = f"Starts ended, or were left behind, at {design.settings.goal.maximised} = {values}."
    if len(others) < len(design.ends):
        note += f" {len(design.ends) - len(others)} ended at runs that touch a surface at the problem's tolerance."
    return Section("Search", (), facts, notes=[*notes, *([] if singular or not others else [note])])


def _classical(design: FoundRuns) -> Iterator[Section]:
    """Runs as they are chosen by hand, beside the design."""
    if not design.classical:
        return
    rows = []
    for name, value in sorted(design.classical.items(), key=lambda one: -one[1]):
        efficiency = d_efficiency(value, design.log_det, design.criterion.level)
        share = percent(design.classical_shares.get(name, np.nan))
        rows.append((name, "-inf: singular" if not np.isfinite(value) else computed(value, 5), percent(efficiency or 0.0), share))
    note = (
        "The best of a hundred random ones of each kind at the prior mean, or of fewer where they are long. They may have more"
        " information than the design where fewer plants can run them."
    )
    columns = (
        "inputs",
        f"{design.settings.goal.maximised}, sum",
        f"{design.settings.goal.criterion}-efficiency",
        "plants that can",
    )
    yield Section("Beside classical runs", columns, rows, notes=[note])


def _warnings(design: FoundRuns) -> Iterator[str]:
    if not design.feasible:
        required = percent(design.settings.goal.share_of_plants or 0.0)
        yield (
            f"Only {percent(design.feasibility.share)} of the plants that the prior allows can run this design, where {required}"
            " was required: shorten the runs, narrow the region, or give the search more starts."
        )
    if not design.stop_reason.complete:
        yield f"The search was ended early ({design.stop_reason.words}). {design.stop_reason.advice}"
    elif design.again == 1 and len(design.ends) > 1:
        yield "Only one start came to this design: there may be a better one. Run more starts (n_starts) to check."
    evaluation = design.evaluation
    if evaluation.rank < len(evaluation.parameters) and design.settings.goal.criterion != "D":
        yield (
            f"F is singular: the runs determine criterion {design.settings.goal.criterion}, but not all parameters. What is"
            " left open stands beside the criterion."
        )
    elif evaluation.rank < len(evaluation.parameters):
        yield (
            f"The runs determine {evaluation.rank} of {len(evaluation.parameters)} parameters: the combinations named below"
            " the criterion cannot be estimated from them, however often they are repeated."
        )
    region = design.problem.region
    if isinstance(region, RunRegion):
        at = [name for name in names_of(design.problem.model.states) if _at_bound(design, region, name)]
        if at:
            yield f"Starts lie on bounds of {', '.join(at)}: wider bounds would allow a better design."


def _at_bound(design: FoundRuns, region: RunRegion, name: str) -> bool:
    lower, upper = region.bounds[name]
    values = design.runs.x0[:, names_of(design.problem.model.states).index(name)]
    return lower < upper and bool(np.isin(values, (lower, upper)).all())
