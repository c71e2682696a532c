"""The residuals of a fit in words: what is not white, how many times too small standard errors are, and what to do."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..basics.quantity import names_of
from ..show.numbers import counted, number, p_value_text, probability
from ..show.section import Section
from .residual_checks import LONG, OFF, ResidualCheck
from .sandwich import MANY_SERIES
from .statistics import FitStatistics

DIFFERENT, VERY_DIFFERENT = 1.5, 2.0
"""Ratio of robust and other standard errors from which on both are shown, and from which on many series alone are a finding."""

CORRELATED, UNLIKELY = 0.2, 4.0
"""Correlation of the residuals of two outputs from which on it matters, and in standard deviations by chance, it is a finding."""

NAMED = 4
"""Unknowns whose standard errors are too small that a sentence names."""

NOTABLE = 1.2
"""Ratio up to which standard errors hardly suffer."""


def residual_findings(fit: FitStatistics) -> Iterator[str]:
    """What is wrong with the residuals, each as a sentence; nothing where they may be white noise."""
    correlated = {name: check for name, check in fit.residual_checks.items() if check.memory is not None}
    for name, check in correlated.items():
        yield f"{name}: the residuals are not white, {_how(check)}"
    if correlated:
        yield _consequence(fit, correlated)
    for name, check in fit.residual_checks.items():
        signs = check.signs
        if signs is not None and not check.white and signs.p_value < OFF:
            yield (
                f"{name}: along {signs.setting}, the residuals' signs change {counted(signs.count, 'time')} where about "
                f"{signs.most // 2} are expected: the model lacks something that depends on {signs.setting}, and standard errors "
                "do not have it"
            )
    yield from _short_memories(fit)
    yield from _correlated_outputs(fit)
    if not correlated and fit.robust.weight >= MANY_SERIES and _largest(fit) > VERY_DIFFERENT:
        yield (
            f"residuals scatter unevenly: standard errors are {_how_small(fit)}. Give the noise that these data have, or "
            "look for what the model lacks"
        )


def robust_errors_differ(fit: FitStatistics) -> bool:
    """Whether robust standard errors are shown beside the others."""
    if any(check.memory is not None for check in fit.residual_checks.values()):
        return True
    ratios = np.array(list(fit.robust_ratios.values()))
    return bool(fit.robust.weight >= MANY_SERIES and ((ratios > DIFFERENT) | (ratios < 1 / DIFFERENT)).any())


def residual_section(fit: FitStatistics) -> Iterator[Section]:
    """The tests of the residuals, a row for each output."""
    rows, marked = [], []
    for k, (name, check) in enumerate(fit.residual_checks.items()):
        lag_one = check.autocorrelation.values[:1]
        signs = "-" if check.signs is None else f"{check.signs.count} of {check.signs.most} along {check.signs.setting}"
        p_values = (check.lag_p_value, check.spectrum_p_value, None if check.signs is None else check.signs.p_value)
        lags, spectrum, of_signs = ("-" if p_value is None else probability(p_value) for p_value in p_values)
        row = (name, number(float(lag_one[0]), 2) if len(lag_one) else "-", str(check.lags) if check.lags else "-", lags, spectrum)
        rows.append((*row, signs, of_signs, "yes" if check.white and check.p_value is not None else "-" if check.white else "no"))
        if not check.white:
            marked.append(k)
    if any(check.p_value is not None for check in fit.residual_checks.values()):
        columns = ("output", "lag 1", "lags", "p of lags", "p of spectrum", "sign changes", "p of signs", "white")
        yield Section("Are the residuals white?", columns, tuple(rows), tuple(marked), _notes(fit))


def noise_section(fit: FitStatistics) -> Iterator[Section]:
    """The noise that was found in the residuals, a row for each of its numbers."""
    units, rows, notes = {q.name: q.unit for q in fit.model.outputs}, [], []
    for name, found in (fit.noise_estimate or {}).items():
        for k, (label, value) in enumerate(found.values.items()):
            unit = "s" if label.startswith("correlation time") else "1" if label == "relative" else units[name]
            error = found.standard_errors[label]
            shown = number(error, 2) if np.isfinite(error) else "-"
            rows.append((name if k == 0 else "", found.form if k == 0 else "", label, unit, number(value), shown))
        others = sorted((more, form) for form, more in found.tried.items() if form != found.form)
        if others:
            notes.append(f"{name}: the next form by penalised likelihood is {others[0][1]}, {number(others[0][0], 2)} above.")
    if rows:
        columns = ("output", "form", "", "unit", "value", "std error")
        yield Section("Noise found in the residuals", columns, tuple(rows), (), tuple(notes))


def _notes(fit: FitStatistics) -> tuple[str, ...]:
    if all(check.memory is None for check in fit.residual_checks.values()):
        return ()
    lags = "Lags count measured samples of a run or record, whatever the steps between them."
    if fit.robust.method == "series":
        return (lags, "Robust standard errors count each run, record and point as one.")
    return (lags, f"Robust standard errors are by Newey and West's window of {fit.robust.bandwidth:.1f} lags, after prewhitening.")


def _short_memories(fit: FitStatistics) -> Iterator[str]:
    for name, found in (fit.noise_estimate or {}).items():
        if found.correlation_times < LONG:
            yield (
                f"{name}: the data are only {number(found.correlation_times, 2)} correlation times of the noise long: too short "
                f"to show how large standard errors are, which takes {LONG:g}. Measure longer"
            )


def _correlated_outputs(fit: FitStatistics) -> Iterator[str]:
    """Pairs of outputs whose whitened residuals are correlated, where the noise of the fit is without that."""
    if fit.noise is None:
        return
    measured, white, names = np.isfinite(fit.residuals), fit.whitened, list(fit.residual_checks)
    places = [names_of(fit.model.outputs).index(name) for name in names]
    for k, i in enumerate(places):
        for name, j in zip(names[:k], places[:k], strict=True):
            both = measured[:, i] & measured[:, j]
            left = int(both.sum()) - len(fit.parameters)
            a, b = white[both, i], white[both, j]
            size = float(np.sqrt(np.square(a).sum() * np.square(b).sum()))
            correlation = float(a @ b) / size if size > 0 else 0.0
            if left > 0 and abs(correlation) > CORRELATED and abs(correlation) * np.sqrt(left) > UNLIKELY:
                yield (
                    f"{name} and {names[k]}: the residuals are correlated by {correlation:.2f}, which the noise is not: give it in "
                    "fp.NoiseModel(correlation=...), or look for what the model lacks"
                )


def _how(check: ResidualCheck) -> str:
    p_value = p_value_text(check.p_value or 0.0)
    times, values = check.memory.samples if check.memory is not None else 0.0, check.autocorrelation.values
    correlation = f"with a correlation of {values[0]:.2f} from sample to sample" if len(values) else "by their spectrum"
    if times >= 1:
        correlation += f" and a memory of about {counted(round(times), 'sample')}"
    return f"{correlation} ({p_value})"


def _consequence(fit: FitStatistics, correlated: dict[str, ResidualCheck]) -> str:
    advice = 'let the noise be found, by noise="estimated", or look for what the model lacks'
    if fit.noise_estimate is not None:
        advice = "the noise has a form that is not among those that are tried, or the model lacks something"
    times = min(check.correlation_times for check in correlated.values())
    if fit.robust.method == "window" and times < LONG:
        return (
            f"the data are only {number(times, 2)} correlation times long: too short to show how large standard errors are, which "
            f"takes {LONG:g}; these are {_how_small(fit, 'at least about')}. Measure longer; {advice}"
        )
    return f"standard errors are {_how_small(fit)}: {advice}"


def _how_small(fit: FitStatistics, about: str = "about") -> str:
    """How many times too small standard errors are, by unknown."""
    ratios = sorted(((name, ratio) for name, ratio in fit.robust_ratios.items() if ratio >= NOTABLE), key=lambda item: -item[1])
    if not ratios:
        return "hardly too small, by what the residuals show"
    (first, largest), *others = ratios[:NAMED]
    rest = f", and for {len(ratios) - NAMED} more" if len(ratios) > NAMED else ""
    more = "".join(f", {number(ratio, 2)} for {name}" for name, ratio in others)
    return f"{about} {number(largest, 2)} times too small for {first}{more}{rest}"


def _largest(fit: FitStatistics) -> float:
    return max(fit.robust_ratios.values(), default=1.0)
