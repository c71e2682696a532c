"""A fit as plain data, and its files, each of which appears whole or not at all."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from ..basics.checks import as_path
from ..basics.csv_file import csv_text
from ..basics.files import REPORTS, built_from, read_bytes, write_together
from ..basics.messages import printable, shown
from ..basics.quantity import names_of
from ..basics.result_files import content_of, encoded, sealed
from ..data.measurements import Measurements
from . import report
from .fit_state import FitState
from .noise_estimate import OutputNoiseEstimate
from .picture_list import PICTURES
from .residual_checks import ResidualCheck
from .statistics import FitStatistics

PLAIN = ("noise_known", "converged", "stop_reason", "evaluations", "starts", "reached")
"""What JSON has as it is."""


def fit_dict(fit: FitStatistics) -> dict[str, Any]:
    """See `Fit.to_dict`."""
    outputs = list(names_of(fit.model.outputs))
    tests = {
        name: {
            "measured": test.count,
            "chi_square": test.chi_square,
            "degrees_of_freedom": test.degrees_of_freedom,
            "p_value": test.p_value,
        }
        for name, test in fit.tests.items()
    }
    degrees = fit.quantile_degrees_of_freedom
    plain: dict[str, Any] = _plain(
        {
            "model": fit.model.name,
            "parameters": {
                name: {
                    "unit": fit.units[name],
                    "estimate": value,
                    "standard_error": fit.standard_errors[name],
                    "robust_standard_error": fit.robust_standard_errors[name],
                    "interval_95": list(fit.intervals()[name]),
                    "t_degrees_of_freedom": degrees[name],
                    "prior_mean": fit.prior.mean[name] if fit.prior is not None and name in fit.prior.names else None,
                    "prior_std": fit.prior.std[name] if fit.prior is not None and name in fit.prior.names else None,
                }
                for name, value in fit.estimate.items()
            },
            "local": [
                {
                    "parameter": one.parameter,
                    "by": one.by,
                    "group": one.group,
                    "unit": fit.units[f"{one.parameter}[{one.group}]"],
                    "estimate": one.estimate,
                    "standard_error": one.standard_error,
                    "interval_95": list(one.interval),
                }
                for of in fit.local.values()
                for one in of.values()
            ],
            "spread": {
                name: {"std": one.std, "standard_error": one.standard_error, "interval_95": one.interval}
                for name, one in fit.spread.items()
            },
            "covariance": fit.covariance,
            "correlation": fit.correlation,
            "information": fit.information,
            "outputs": outputs,
            "noise_covariance": fit.noise_covariance,
            "noise_estimate": {name: _noise_dict(found) for name, found in (fit.noise_estimate or {}).items()},
            "residual_covariance": fit.residual_covariance,
            "chi_square": fit.chi_square,
            "degrees_of_freedom": fit.degrees_of_freedom,
            "tests": tests,
            "residual_checks": {name: _check_dict(check) for name, check in fit.residual_checks.items()},
            "null_directions": list(fit.null_directions),
            "weak_directions": list(fit.weak_directions),
            "at_bounds": list(fit.at_bounds),
            "warnings": list(report.warnings(fit)),
            **{name: getattr(fit, name) for name in PLAIN},
        }
    )
    return plain


def _noise_dict(found: OutputNoiseEstimate) -> dict[str, Any]:
    return {
        "form": found.form,
        "values": dict(found.values),
        "standard_errors": dict(found.standard_errors),
        "penalised_deviance_above_least": dict(found.tried),
        "correlation_times": found.correlation_times,
    }


def _check_dict(check: ResidualCheck) -> dict[str, Any]:
    signs, memory = check.signs, check.memory
    return {
        "white": check.white,
        "p_value": check.p_value,
        "in_series": check.count,
        "autocorrelation": check.autocorrelation.values,
        "expected_autocorrelation": check.autocorrelation.expected,
        "autocorrelation_band_95": check.autocorrelation.band,
        "lags": check.lags,
        "lag_p_value": check.lag_p_value,
        "spectrum_p_value": check.spectrum_p_value,
        "signs_along": None if signs is None else signs.setting,
        "sign_changes": None if signs is None else signs.count,
        "signs_p_value": None if signs is None else signs.p_value,
        "memory_in_samples": None if memory is None else memory.samples,
        "memory_share": None if memory is None else memory.share,
    }


def save_fit(fit: FitStatistics, directory: str | Path) -> list[Path]:
    """See `Fit.save`."""
    directory = as_path(directory, "directory")
    contents = {
        "estimate.csv": _estimate_csv(fit),
        "residuals.csv": _residuals_csv(fit),
        "fit.json": _whole(fit),
    }
    if fit.local:
        contents = {"local.csv": _local_csv(fit), **contents}
    directory.mkdir(parents=True, exist_ok=True)
    return write_together(directory, contents, stale=(*REPORTS, *PICTURES, *(() if fit.local else ("local.csv",))))


def _whole(fit: FitStatistics) -> str:
    """What a fit says, for people, and what it is."""
    state = FitState.of(fit)
    try:
        content = encoded(state)
    except TypeError as error:  # a model of functions, which no file can hold
        content = {"not_saved": str(error)}
    return sealed(FitState, content, **fit_dict(fit))


def load_fit(directory: str | Path) -> dict[str, Any]:
    """The fields of a fit; see `Fit.load`."""
    path = as_path(directory, "directory") / "fit.json"
    given = read_bytes(path)
    content = content_of(path, given, FitState)
    if isinstance(content, dict) and "not_saved" in content:
        why = shown(content["not_saved"], 200)
        raise ValueError(f"{printable(path)}: expected a fit with its model, given one without: {why}")
    return built_from(path, "fit", FitState._read(path, given), FitState.fields)


def _plain(given: Any) -> Any:
    """Lists, dicts, numbers and strings; what is not finite as null, which JSON has no number for."""
    if isinstance(given, dict):
        return {str(key): _plain(value) for key, value in given.items()}
    if isinstance(given, np.ndarray | list | tuple):
        return [_plain(value) for value in given]
    if isinstance(given, float | np.floating):
        return float(given) if math.isfinite(given) else None
    return given.item() if isinstance(given, np.generic) else given


def _estimate_csv(fit: FitStatistics) -> str:
    header = ["parameter", "unit", "estimate", "standard_error", "rse", "lower_95", "upper_95", "prior_mean", "prior_std"]
    rows: list[list[float | str]] = []
    for name in fit.common:
        value = fit.estimate[name]
        prior = fit.prior if fit.prior is not None and name in fit.prior.names else None
        numbers = [value, fit.standard_errors[name], fit.rse[name], *fit.intervals()[name]]
        numbers += [np.nan, np.nan] if prior is None else [prior.mean[name], prior.std[name]]
        rows.append([name, fit.units[name], *numbers])
    return csv_text(header, rows, "\n")


def _local_csv(fit: FitStatistics) -> str:
    header = ["parameter", "by", "group", "unit", "estimate", "standard_error", "lower_95", "upper_95"]
    rows: list[list[float | str]] = [
        [one.parameter, one.by, one.group, fit.units[f"{name}[{group}]"], one.estimate, one.standard_error, *one.interval]
        for name, values in fit.local.items()
        for group, one in values.items()
    ]
    return csv_text(header, rows, "\n")


def _residuals_csv(fit: FitStatistics) -> str:
    """A row per number that was measured: which part of the data, sample within it, output, and what was found.

    Where there are runs among the data, their numbers and those of their segments too.
    """
    of_runs = any(isinstance(part, Measurements) and part.points is part.runs for part in fit.data)
    header = [
        "data",
        "sample",
        *(["run", "segment"] if of_runs else []),
        "output",
        "measured",
        "predicted",
        "residual",
        "standardised",
    ]
    standardised, names, n = fit.standardised, names_of(fit.model.outputs), 0
    rows: list[list[float | str]] = []
    for number, part in enumerate(fit.data, start=1):
        places = np.argwhere(part.runs.measured) + 1 if isinstance(part, Measurements) and part.points is part.runs else None
        for k, y in enumerate(part.samples):
            place = [] if not of_runs else ["", ""] if places is None else [str(i) for i in places[k]]
            for i in np.flatnonzero(np.isfinite(fit.residuals[n])):
                numbers = (y[i], fit.predicted[n, i], fit.residuals[n, i], standardised[n, i])
                rows.append([str(number), str(k + 1), *place, names[i], *numbers])
            n += 1
    return csv_text(header, rows, "\n")
