"""What a design, a set of points or a simulation is worth, as a report."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

from numpy.typing import NDArray

from ...basics.messages import with_counts
from ...basics.quantity import Quantity
from ...basics.stop_reason import StopReason
from ...information.evaluation import WITH_PRIOR, value_of_criterion
from ...information.feasibility import Feasibility
from ...information.local_robustness import DISTANCE, Nearby, times
from ...information.problem import DesignProblem
from ...information.problem_report import local_in_words
from ...models import Model
from ...points.experiments import Experiments
from ...points.outside_region import few, outside
from ...points.status import Status
from ...show.numbers import column, computed, counted, number, percent
from ...show.section import Report, Section
from .criterion_report import at_least, bound_of, goal_facts, in_units
from .efficiency import Efficiency
from .evaluated_points import EvaluatedPoints
from .found_design import FoundDesign
from .over_report import over_sections
from .settings import searched_by
from .settings_section import left_out_facts
from .singular_report import ridge_facts, singular_warning

ROWS, ROWS_OF_PAGES = 40, 1000  # points shown of a longer list
_WORST = 3  # parameters named in a warning

GUIDE = "docs/explanation/output_covariance.md"

USUAL = 0.99
"""Share of the plants that should be able to run a design."""


def design_report(design: FoundDesign, most: int = ROWS) -> Report:
    """The report of a design: at most so many points, parameters, criterion, efficiency, search, warnings."""
    sections = [
        _points_table(design, most),
        _parameter_table(design),
        _criterion(design),
        *over_sections(design),
    ]
    sections += _efficiency(design)
    if design.feasibility is not None:
        sections += plants_sections(design.feasibility, design.settings.goal.share_of_plants)
    sections.append(_search(design))
    if design.rejected:
        sections.append(_counts("Rejected candidates", design.rejected, design.drawn, "of drawn"))
    return Report(_headline(design), sections, [*_plants_warnings(design), *_warnings(design)])


def plants_sections(feasibility: Feasibility, confidence: float | None = None) -> Iterator[Section]:
    """Which plants can run a design, and why others cannot; `confidence` is the required share."""
    first, *others = feasibility.report().sections
    required = [] if confidence is None else [("required", percent(confidence))]
    yield Section("Plants that can run the design", (), [*first.rows, *required], notes=["The search has not seen these plants."])
    yield from others


def _plants_warnings(design: FoundDesign) -> Iterator[str]:
    feasibility = design.feasibility
    if feasibility is not None and not design.feasible:
        yield (
            f"Only {percent(feasibility.share)} of the plants that the prior allows can run all points, where"
            f" {percent(design.settings.goal.confidence or 0.0)} was required: narrow the region, or give the search more time."
        )
    elif feasibility is not None and design.settings.goal.share_of_plants is None and feasibility.share < USUAL:
        yield (
            f"Only {percent(feasibility.share)} of the plants that the prior allows can run all points. The table of points says"
            " which to leave out, or to begin elsewhere; narrower bounds of the region help."
        )


def evaluation_report(evaluated: EvaluatedPoints) -> Report:
    """The report of evaluated points: points, parameters, criterion, warnings."""
    sections = [_points_table(evaluated), _parameter_table(evaluated), _criterion(evaluated)]
    return Report(_headline(evaluated), sections, list(_warnings(evaluated)))


def simulation_report(model: Model, points: Experiments, y: NDArray[Any], status: NDArray[Any]) -> Report:
    """The report of a simulation: the outputs at dt and how the trajectories ended, with advice."""
    duration = [quantity for quantity in model.axes if quantity.name == "dt"]
    names = [Status(int(code)).name for code in status]
    cells = [*(column(points.dt) for _ in duration), *(column(values) for values in y.T), names]
    rows = [(str(k + 1), *row) for k, row in enumerate(zip(*(cell[:ROWS] for cell in cells), strict=True))]
    marked = [k for k, name in enumerate(names[:ROWS]) if name != "ok"]
    columns = ["#", *map(_header, [*duration, *model.outputs]), "status"]
    table = Section("", columns, rows, marked, _more(len(points)))
    after = " after dt" if duration else ""
    counts = _counts("Trajectories", Counter(names), len(points), "of all")
    return Report(f"Outputs{after} at the prior mean, {counted(len(points), 'point')}", [table, counts])


def _header(quantity: Quantity) -> str:
    return f"{quantity.name} [{quantity.unit}]"


def _headline(evaluated: EvaluatedPoints) -> str:
    parameters, points = evaluated.evaluation.parameters, evaluated.points
    previous = evaluated.n_previous if isinstance(evaluated, FoundDesign) else 0
    beside = f" beside {previous} previous ones" if previous else ""
    goal = evaluated.settings.goal.headline if isinstance(evaluated, FoundDesign) else ""
    return (
        f"{counted(len(points), 'experiment point')}{beside} for {evaluated.problem.model.name}, "
        f"{counted(len(parameters), 'parameter')} to estimate: {', '.join(parameters)}{goal}"
    )


def _points_table(evaluated: EvaluatedPoints, most: int = ROWS) -> Section:
    table = points_section("Points", evaluated.problem.model, evaluated.points, most)
    return replace(table, notes=[*table.notes, *_kept(evaluated)])


def points_section(title: str, model: Model, points: Experiments, most: int = ROWS) -> Section:
    """At most so many points, and how one is carried out."""
    start, held = "start in this state, " if model.states else "", "hold the inputs, " if model.inputs else ""
    title = f"{title}: {start}{held}sample the outputs{' after dt' if model.states else ''}"
    columns = [column(values[:most]) for values in points.table.T[: len(model.axes)]]
    rows = [(str(k + 1), *row) for k, row in enumerate(zip(*columns, strict=True))]
    return Section(title, ["#", *map(_header, model.axes)], rows, notes=_more(len(points), most))


def _kept(evaluated: EvaluatedPoints) -> list[str]:
    return kept_note("Point", evaluated.n_kept if isinstance(evaluated, FoundDesign) else 0)


def kept_note(kind: str, count: int) -> list[str]:
    """Which of the points, or runs, were given."""
    if not count:
        return []
    return [f"{f'{kind} 1 was' if count == 1 else f'{kind}s 1 to {count} were'} given, and kept; the others were searched for."]


def _more(total: int, most: int = ROWS) -> list[str]:
    return [f"... and {total - most} more"] if total > most else []


def _parameter_table(evaluated: EvaluatedPoints) -> Section:
    """Standard errors under the sensor noise; none where it is not known, as no other D promises any."""
    problem, under_noise = evaluated.problem, evaluated.under_noise
    if under_noise is None:
        note = (
            "The precision of an estimate follows from the sensor noise, which is not known. The D of the criterion is the spread "
            "of the outputs over the prior; it ranks designs. Give [noise]."
        )
        return Section("No standard errors", notes=[note])
    noise = "the sensor noise (D = R)"
    if problem.assumed is not None:
        anew = "the sensor noise and what is drawn anew (R_k)" if problem.assumed.columns else noise
        also = "uncertain constants" if problem.uncertain or problem.shared_starts else "local parameters"
        noise = f"{anew}, with {also} unknown too" if problem.n_nuisance else anew
    alone = under_noise.without_prior
    columns = ["parameter", "unit", "mean", "prior std", "standard error", "RSE", "of prior std"]
    columns += [] if alone is None else ["without the prior"]
    units = {quantity.name: quantity.unit for quantity in problem.model.parameters}
    rows, marked = [], []
    for k, name in enumerate(problem.estimated):
        mean, std = problem.prior.mean[name], problem.prior.std[name]
        error = (under_noise.standard_errors or {}).get(name, math.nan)
        rse = (under_noise.rse or {}).get(name, math.nan)
        row = (name, units[name], number(mean), number(std), computed(error), percent(rse), percent(error / std))
        rows.append(row if alone is None else (*row, computed(alone[name])))
        if name in under_noise.weak_parameters:
            marked.append(k)
    notes = [] if alone is None else [WITH_PRIOR]
    if problem.assumed is not None and problem.assumed.columns and problem.assumed_covariance != "predictive":
        notes.append(
            'To first order in what is drawn anew; assumed_covariance = "predictive" takes in curvature, which may make estimates '
            "worse than this. fisherpoint validate shows whether it does."
        )
    if under_noise.nearby is not None:
        notes.append(under_noise.nearby.described)
    return Section(f"Parameters, predicted under {noise}", columns, rows, marked, notes)


def _criterion(evaluated: EvaluatedPoints) -> Section:
    evaluation = evaluated.evaluation
    facts = [
        ("output covariance D", _describe_covariance(evaluated.problem)),
        ("outputs used", ", ".join(evaluation.outputs)),
    ]
    if evaluation.outputs_left_out:
        left_out = ", ".join(evaluation.outputs_left_out)
        why = "no noise is given and no parameter has an influence" if evaluated.problem.noise is None else "not measured"
        facts.append(("outputs left out", f"{left_out}: {why}"))
    if evaluated.problem.along:
        facts.append(("limits along the way", "; ".join(evaluated.problem.along)))
    facts += _assumed(evaluated.problem)
    if isinstance(evaluated, FoundDesign):
        facts += goal_facts(evaluated)
    facts += value_of_criterion(evaluation)
    if evaluated.under_noise is not None and evaluation.output_covariance_kind != "noise":
        facts.append(("log det F under the noise", f"{evaluated.under_noise.log_det:.4f}"))
    return Section("Criterion", (), facts)


def _assumed(problem: DesignProblem) -> Iterator[tuple[str, str]]:
    """What is not known exactly: constants of the plant, what is drawn anew in each point or run, and local parameters."""
    if problem.local_parameters:
        yield "local parameters, estimated too", local_in_words(problem.local_parameters)
    model = problem.model
    units = {q.name: q.unit for q in (*model.states, *model.parameters, *model.constant_quantities)}
    drawn = ("drawn anew in each point or run", problem.varies)
    for label, stds in (("uncertain", problem.uncertain), drawn, ("starts deviate by", problem.initial_state_std)):
        if stds:
            yield label, ", ".join(f"{name} {number(std)}{f' {units[name]}' * (units[name] != '1')}" for name, std in stds.items())


def _describe_covariance(problem: DesignProblem) -> str:
    noise = "" if problem.noise is None else "R + "
    form = {
        "noise": "noise: D = R, the sensor noise",
        "region": f"region: D = {noise}mean predictive covariance over the region",
        "pooled": f"pooled: D = {noise}mean predictive covariance of the points, (17)",
        "pointwise": f"pointwise: D_k = {noise}predictive covariance of the point itself",
    }[problem.output_covariance or ""]
    if problem.assumed is None or not problem.assumed.columns:
        return form
    return f"{form}; plus what is drawn anew in each point"


def _efficiency(design: FoundDesign) -> Iterator[Section]:
    efficiency, name, facts = design.efficiency, design.settings.goal.criterion, []
    if efficiency is None:
        return
    notes = []
    if efficiency.at_least is not None:
        assert efficiency.at_most is not None
        of_all = f"of any design of the {efficiency.n_candidates} candidates"
        facts.append((of_all, f"{at_least(efficiency.at_least)} ({bound_of(design, efficiency.at_most)})"))
        notes = [
            "Proven by the weights that are best for these candidates; designs of whole points may all fall short of them. It says "
            "nothing of points between the candidates: fp.approximate_design searches the region."
        ]
    if efficiency.vs_best is not None:
        other = f"(log det {efficiency.best_found:.4f})"
        facts.append(("of the best that another search with D = R found", f"{percent(efficiency.vs_best)} {other}"))
    if efficiency.vs_random is not None:
        assert efficiency.random_median is not None
        what = "log det" if name == "D" else design.settings.goal.named
        median = f"({what} {in_units(design, efficiency.random_median)})"
        facts.append(("of the median random design", f"{percent(efficiency.vs_random)} {median}"))
    if efficiency.vs_bound is not None:
        bound = f"(log det {efficiency.bound:.4f}, under the D of the criterion)"
        facts.append(("of the closed bound", f"{percent(efficiency.vs_bound)} {bound}"))
    if name == "ME":
        notes = ["No bound is known for the condition number: better designs may exist."]
    under = ""
    if efficiency.under_noise is not None and name == "D":
        under = f"; under the sensor noise, log det {efficiency.under_noise:.4f}"
    if facts:
        yield Section(f"{name}-efficiency{under}", (), facts, notes=notes)


_METHOD = {"paper": "paper: Algorithm 1, with moves of points", "auto": "auto: exchange over pools, and ascents of all numbers"}


def _search(design: FoundDesign) -> Section:
    settings, problem = design.settings, design.problem
    exchanges = sum(record.exchanged for record in design.trace)
    last = design.trace[-1].iteration if design.trace else 0
    limits = {
        StopReason.patience: f": {counted(settings.method.patience or 0, 'iteration')}",
        StopReason.time_limit: f" of {settings.method.time_limit or 0:g} s",
    }
    rate = f" ({design.drawn / design.seconds:.0f} per second)" if design.seconds > 0 else ""
    method = searched_by(settings.method.name, problem)
    each = f", {settings.n_candidates} per iteration" if method == "paper" else ""
    facts = [
        ("method", _METHOD[method]),
        *([("starts", f"as good in {design.again} of {len(design.ends)}")] if len(design.ends) > 1 else []),
        ("stopped by", design.stop_reason.words + limits.get(design.stop_reason, "")),
        ("iterations", f"{last} of at most {settings.max_iterations}, {counted(exchanges, 'exchange')}"),
        (
            "candidates",
            f"{design.drawn} drawn{rate}, {design.accepted} accepted{each}",
        ),
        ("rule over the prior", f"{problem.rule}, {counted(problem.rule.size(problem.prior), 'node')}"),
        ("distinct points", f"{design.distinct_points} of {len(design.points)}"),
        ("seed, time", f"{settings.seed}, {design.seconds:.1f} s"),
    ]
    facts += ridge_facts(design.ridge)
    facts += left_out_facts(design.left_out)
    if design.previous_left_out:
        lost = with_counts(design.previous_left_out)
        facts.append(("previous points left out", f"{lost}: not valid at the prior mean, not used"))
    return Section("Search", (), facts, notes=[design.stop_reason.advice])


_CONSTRAINT = "The point violates a constraint of the region; tighter bounds would waste fewer draws."


_NEAR = "A deviation of the start, three of initial_state_std, may move the point across it: start further away."


def _counts(title: str, counts: Mapping[str, int], total: int, share: str) -> Section:
    """How many there were of each status or reason, and what to do about it."""
    rows = []
    for name, count in sorted(counts.items(), key=lambda item: -item[1]):
        if name in Status.__members__:
            advice = "" if name == "ok" else Status[name].advice
        else:
            advice = _CONSTRAINT if name == "constraint" else _NEAR if name.startswith("starts near") else ""
        rows.append((name, str(count), percent(count / total) if count else "0 %", advice))
    return Section(title, ("what", "number", share, "advice"), rows)


def _warnings(evaluated: EvaluatedPoints) -> Iterator[str]:
    """What the user should not miss, each as a paragraph."""
    places = list(outside(evaluated.problem.model, evaluated.problem.region, evaluated.points))
    if places:
        yield f"Outside of the region: {few(places, 10)}."
    if isinstance(evaluated, FoundDesign):
        yield from _of_covariance(evaluated.evaluation.output_covariance_kind, evaluated.efficiency)
    if evaluated.evaluation.covariance is None:
        yield singular_warning(evaluated)
    elif evaluated.under_noise is not None and evaluated.under_noise.weak_parameters:
        yield (
            f"The standard error stays above half the prior std for {', '.join(evaluated.under_noise.weak_parameters)}: these "
            "experiments add little information about them. More points, a longer dt or wider bounds may help."
        )
    if evaluated.under_noise is not None and evaluated.under_noise.nearby is not None:
        yield from _nearby_warnings(evaluated, evaluated.under_noise.nearby)


def _of_covariance(kind: str, efficiency: Efficiency | None) -> Iterator[str]:
    """What a D that is not that of the noise does to the estimates."""
    below = efficiency is not None and efficiency.below_random
    sentence = "Under the sensor noise this design is worse than the median random design" if below else ""
    if kind == "pooled":
        if efficiency is not None and efficiency.vs_best is not None and not below:
            sentence = (
                f"Under the sensor noise this design has {percent(efficiency.vs_best)} of what another search with D = R found"
            )
        why = 'D = "pooled" ignores the size of the signals: the better it is optimised, the worse the estimates may be'
        sentence += ". " * bool(sentence)
        use = '"noise"' if sentence else '"region", or "noise" with `noise` given'
        yield f"{sentence}{why}. Use output_covariance = {use}; {GUIDE} says why."
    elif below:
        yield (
            f'{sentence}. The criterion\'s D ("{kind}") ignores the size of the signals; use output_covariance = "noise". '
            f"{GUIDE} says why."
        )


def _nearby_warnings(evaluated: EvaluatedPoints, nearby: Nearby) -> Iterator[str]:
    """What happens to the promise within what it promises."""
    problem = evaluated.problem
    if nearby.broken:
        units = {quantity.name: quantity.unit for quantity in problem.model.parameters}
        worst = nearby.broken[:_WORST]
        errors = ", ".join(f"that of {name} is up to {times(nearby.growth[name])} as large" for name in worst)
        where = ", ".join(f"{name} = {number(nearby.parameters[name])} {units[name]}".removesuffix(" 1") for name in worst)
        ways = "other or more points"
        if problem.jumps == "cross" and problem.model.crossable:
            ways += ', jumps = "exclude", or a smooth form of what jumps'
        yield (
            f"The standard errors hold at the prior mean, but not {DISTANCE:g} of them away from it: there {errors}. It is worst "
            f"at {where}, where {_losing(evaluated, nearby)} much less information than at the mean, as behind a threshold. "
            "Estimates may be worse than promised, and fits may fail: validate before measuring (fisherpoint validate). What may "
            f"help: {ways}."
        )
    if nearby.without_trajectory:
        lost = with_counts(nearby.without_trajectory)
        advice = " ".join(Status[name].advice for name in nearby.without_trajectory)
        yield (
            f"Points have no trajectory where the parameters are {DISTANCE:g} standard errors off: {lost}. {advice} "
            "Validate before measuring (fisherpoint validate)."
        )


def _losing(evaluated: EvaluatedPoints, nearby: Nearby) -> str:
    """The points with less information there, as the report numbers them, and the verb."""
    previous = evaluated.n_previous if isinstance(evaluated, FoundDesign) else 0
    own = [str(k - previous + 1) for k in nearby.points if k >= previous]
    texts = [f"point{'s' * (len(own) > 1)} {' and '.join(own)}"] if own else []
    texts += ["previous points"] * (len(own) < len(nearby.points))
    return f"{' and '.join(texts)} {'has' if len(own) == len(nearby.points) == 1 else 'have'}"
