"""The report of a validation: whether the promises hold, what to do where they do not, and one table per design."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from ..show.numbers import computed, counted, number, with_error
from ..show.section import Report, Section
from .design_validation import DesignValidation
from .figures import FEWEST
from .needed_runs import needed_runs
from .validation_record import ValidatedDesigns
from .verdict import (
    BROKEN,
    COVERAGE_TOLERANCE,
    HOLDS,
    OPEN,
    RATIO_TOLERANCE,
    ParameterVerdict,
    in_words,
    level_of_each,
    verdicts_of,
)

TOLERANCES = f"{100 * RATIO_TOLERANCE:.0f} % of standard errors and {100 * COVERAGE_TOLERANCE:.0f} points of coverage"

LEGEND = (
    f"The promise of a parameter holds where achieved / promised is 1 and coverage 95 %, to within {TOLERANCES}, beyond "
    "chance; it is broken where one of them is further off beyond chance, at 5 % over all parameters together; open is what so few "
    "runs cannot decide.",
    "promised: standard error under the noise that the fits reckon with, at the prior mean; claimed: mean of the fits' own ones; "
    "achieved: standard deviation of the estimates' errors, and its ratio to promised; typical ratio: the same of their median "
    "size, which a few diverging fits do not move; rmse: root mean square error. All these are of the fits that did not fail.",
    "coverage: share of all virtual experiments in which the fit's own 95 % interval contains the truth; low, high: in which it "
    "does not, and the estimate, or where the search ended, is too low or too high. A failed fit has no interval that counts. What "
    "is left to 100 % gave no data.",
    "promised, claimed, achieved, bias and rmse in shares of the prior std; 0.987(22) is 0.987 +- 0.022, a Monte Carlo standard "
    "error.",
)


def validation_report(validation: ValidatedDesigns) -> Report:
    """The verdict first; what was done; a table per design."""
    verdicts = verdicts_of(validation.designs)
    sections = [
        _section(name, design, verdicts[name], validation.runs, _advice(validation, design, verdicts[name]))
        for name, design in validation.designs.items()
    ]
    lines = said(validation, verdicts)
    head = "; ".join(line if k == len(lines) - 1 else line.removesuffix(".") for k, line in enumerate(lines))
    title = f"Validation of {validation.problem.model.name}: {counted(len(validation.designs), 'design')}"
    title += f", {counted(validation.runs, 'virtual experiment')}" + (" each" if len(validation.designs) > 1 else "")
    body = [Section("", notes=[done(validation)]), *sections, Section("", notes=LEGEND)]
    return Report(head, body, title=title, lines=lines)


def said(validation: ValidatedDesigns, verdicts: Mapping[str, Mapping[str, ParameterVerdict]]) -> list[str]:
    """Whether the promises hold, in a line for each design."""
    lines = [_verdict(validation, design, verdicts[name]) for name, design in validation.designs.items()]
    if len(lines) > 1:
        lines = [f"{name}: {line}" for name, line in zip(validation.designs, lines, strict=True)]
    if validation.runs < validation.requested:
        return [f"Interrupted after {validation.runs} of {validation.requested} virtual experiments; {lines[0]}", *lines[1:]]
    return [f"{lines[0][0].upper()}{lines[0][1:]}"] if len(lines) == 1 else lines


def _verdict(validation: ValidatedDesigns, design: DesignValidation, verdicts: Mapping[str, ParameterVerdict]) -> str:
    if design.without:
        return f"nothing is promised: {design.without}"
    if design.per_run is None or not verdicts:
        return "nothing is promised: the points determine no parameter"
    undetermined = len(design.parameters) - len(verdicts)
    beside = f"; {undetermined} of {len(design.parameters)} parameters are not determined" if undetermined else ""
    if design.failed:
        beside += f"; {design.failed} of {validation.runs} without a fit"
        beside += f", {design.without_data} of them without data" if design.without_data else ""
        beside += f", {counted(design.wrong_minima, 'wrong minimum', 'wrong minima')} among them" if design.wrong_minima else ""
    some = {kind: [one for one in verdicts.values() if one.outcome == kind] for kind in (HOLDS, BROKEN, OPEN)}
    if some[BROKEN]:
        advice = " ".join(f"{one[0].upper()}{one[1:]}." for one in _advice(validation, design, verdicts)[:2])
        rest = f"; it holds for {_names(some[HOLDS])}" if some[HOLDS] else ""
        rest += f"; open for {_names(some[OPEN])}" if some[OPEN] else ""
        return f"the promise does not hold: {in_words(some[BROKEN])}{rest}{beside}. {advice}".rstrip()
    if some[OPEN]:
        rest = f"the promise holds for {_names(some[HOLDS])}; " if some[HOLDS] else ""
        whether = "it does" if some[HOLDS] else "the promise holds"
        needed = needed_runs(verdicts, validation.runs, level_of_each(validation.designs))
        more = f", about {needed} could" if needed > validation.runs else ""
        few = f"{counted(validation.runs, 'virtual experiment')} cannot decide whether {whether} for {_names(some[OPEN])}"
        return f"{rest}{few} (to {TOLERANCES}){more}{beside}"
    which = _names(some[HOLDS]) if undetermined or len(verdicts) == 1 else f"all {len(verdicts)} parameters"
    return f"the promise holds for {which}, to within {TOLERANCES}{beside}"


def _names(verdicts: list[ParameterVerdict]) -> str:
    return ", ".join(one.parameter for one in verdicts)


def _advice(validation: ValidatedDesigns, design: DesignValidation, verdicts: Mapping[str, ParameterVerdict]) -> list[str]:
    """Advice that surely helps against what was seen, the most urgent first."""
    return list(_all_advice(validation, design, verdicts))


def _all_advice(validation: ValidatedDesigns, design: DesignValidation, verdicts: Mapping[str, ParameterVerdict]) -> Iterator[str]:
    broken = [one for one in verdicts.values() if one.outcome == BROKEN]
    if not broken:
        return
    short = [one.parameter for one in broken if one.ratio == "high" or one.coverage == "low"]
    if validation.truth is not None:
        yield "the data are another model's, and more points do not remove the error of a model: see the bias"
        return
    if validation.spread:
        yield f"values of {', '.join(validation.spread)} spread otherwise than the problem says: state that, or none (None)"
    lost = design.failed - design.without_data - design.wrong_minima
    if design.without_data > COVERAGE_TOLERANCE * validation.runs:
        yield f"{design.without_data} of the plants cannot run the whole design: points further inside, or shorter ones"
    if lost > COVERAGE_TOLERANCE * validation.runs and not validation.use_prior:
        yield f"{lost} fits found no minimum: with the prior in the fits (use_prior, --use-prior), estimates cannot run off"
    if design.wrong_minima > COVERAGE_TOLERANCE * validation.runs:
        yield "estimate with more starts, or start nearer, where other minima are as deep as these"
    weak = [one.parameter for one in broken if one.parameter in short and not one.figures.well_determined]
    if weak and not validation.use_prior and not lost > COVERAGE_TOLERANCE * validation.runs:
        yield f"{', '.join(weak)} known hardly better than before: plan with more points, or take the prior into the fits"
    if any(one.ratio == "high" for one in broken):
        yield "reckon with the achieved errors, not with the promised ones, or plan with more points"
        if all(not one.coverage for one in broken):
            yield "the fits' own intervals hold: trust these"
        if validation.theta == "prior":
            yield "the promise is for the prior mean, and plants differ from it: theta='mean' (--theta mean) shows what is left"
    if not validation.noise_known and short:
        yield "the noise was estimated: known noise, or more samples, make the errors smaller"
    if not short:
        yield "errors are smaller, or intervals wider, than promised: the plan is on the safe side"


def done(validation: ValidatedDesigns) -> str:
    """Description of the validation, in a sentence."""
    theta = validation.theta
    truth = {"prior": "true parameters from the prior", "mean": "true parameters at the prior mean"}
    said = truth[theta] if isinstance(theta, str) else "true parameters as given"
    kind = "maximum a posteriori" if validation.use_prior else "weighted least squares"
    known = "known" if validation.noise_known else "estimated"
    parts = [f"{validation.runs} virtual experiments each, {said}, noise {known}, {kind}, seed {validation.seed}"]
    if validation.truth is not None:
        parts.append(f"data made by another model ({validation.truth.name})")
    if validation.problem.uncertain and validation.truth is None:
        parts.append(f"{', '.join(validation.problem.uncertain)} off by an error that all points of an experiment share")
    if validation.problem.varies and validation.truth is None:
        parts.append(f"{', '.join(validation.problem.varies)} drawn anew in each point or run")
    if validation.problem.initial_state_std:
        kinds = sorted({design.points.kind for design in validation.designs.values()})
        parts.append(f"starts off by an error of each {' and '.join(kinds)}")
    for name, one in validation.problem.local_parameters.items():
        std = validation.spread.get(name, one.std)
        own = f"a spread of {number(std)}" if std is not None else "values from the prior" if theta == "prior" else "the same value"
        parts.append(f"{name} of each {one.by}, with {own}")
    if validation.redrawn:
        parts.append(f"{validation.redrawn} draws from the prior left out, which make no sense to the model")
    return "; ".join(parts)


def _section(name: str, design: DesignValidation, verdicts: Mapping[str, ParameterVerdict], n: int, advice: list[str]) -> Section:
    notes = [f"{count} of {n}: {reason}" for reason, count in design.failures.items()]
    notes += [f"not determined: {direction}" for direction in design.null_directions]
    if design.without:
        return Section(f"{name}: {design.size}", notes=[f"nothing was fitted: {design.without}"])
    title = f"{name}: {design.size}, {counted(design.fits, 'fit')}, {design.failed} failed"
    if design.per_run is None:
        return Section(title, notes=[*notes, "nothing was fitted: the points determine no parameter"])
    if design.fits < FEWEST:
        notes.append(f"no figures of errors: expected at least {FEWEST} fits that did not fail")
    columns = (
        *("parameter", "promise", "promised", "claimed", "achieved", "ratio", "typical ratio", "bias", "rmse"),
        *("coverage", "low", "high"),
    )
    rows = []
    for parameter, of in design.figures.items():
        prior = of.prior_std
        stated = (computed(value / prior) for value in (of.promised, of.claimed.value))
        figures = (of.achieved.over(prior), of.ratio, of.typical_ratio, of.bias.over(prior), of.rmse)
        shares = (with_error(100 * one.value, 100 * one.error, " %") for one in (of.coverage, of.too_low, of.too_high))
        outcome = "local" if parameter in design.local else verdicts[parameter].outcome if parameter in verdicts else "-"
        rows.append((parameter, outcome, *stated, *(with_error(one.value, one.error) for one in figures), *shares))
    marked = [place for place, parameter in enumerate(design.parameters) if _is_broken(verdicts.get(parameter))]
    notes += [
        f"{parameter} has no interval with ends in {of.without_interval} of {n}"
        for parameter, of in design.parameters.items()
        if of.without_interval > design.failed
    ]
    notes += [f"{name}: all {counted(count, 'value')} together" for name, count in design.values.items() if count > 1]
    notes += [f"{of.at_bound} fits have {parameter} at a bound" for parameter, of in design.parameters.items() if of.at_bound]
    return Section(title, columns, rows, marked, [*notes, *(f"to do: {one}" for one in advice)])


def _is_broken(verdict: ParameterVerdict | None) -> bool:
    return verdict is not None and verdict.outcome == BROKEN
