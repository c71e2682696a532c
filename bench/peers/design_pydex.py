"""pydex: weights of candidates on a grid by CVXPY, apportioned to a number of measurements, as its examples do.

Its default optimiser is commercial; Clarabel takes its place. Its examples have about a hundred candidates; here there are 201,
geometrically spaced where a user would do so. Outputs are closed forms, or the equations integrated by odeint, as in its examples,
where its differences would step on a pole of the closed form.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import redirect_stdout
from io import StringIO
from typing import Any

import cvxpy  # noqa: F401
import numpy as np
from pydex.core.designer import Designer
from scipy.integrate import odeint

from .design_cases import DesignCase

PACKAGES = ("pydex", "cvxpy", "clarabel")
CANDIDATES = 201


def solve(case: DesignCase, variant: str) -> list[float]:
    """Return the points; `variant` is "differences", its default, or "derivatives", which it is then given."""
    designer = Designer()
    grid = np.array(case.spread(CANDIDATES))
    dynamic = case.has_pole and variant == "differences"
    designer.model_parameters = np.array(list(case.parameters.values()))
    designer.error_cov = np.array([[case.sigma**2]])
    if dynamic:
        designer.simulate = _integrated(case)
        designer.sampling_times_candidates = grid[None]
    else:
        designer.simulate = _closed_form(case, variant)
        designer.ti_controls_candidates = grid[:, None]
        designer.use_finite_difference = variant == "differences"
    with redirect_stdout(StringIO()):
        designer.initialize(verbose=0)
        options = {"optimize_sampling_times": True} if dynamic else {}
        designer.design_experiment(designer.d_opt_criterion, package="cvxpy", optimizer="CLARABEL", write=False, **options)
        designer.apportion(case.n_points)
    places = [value for found in designer.optimal_candidates for value in (found[3] if dynamic else [found[1][0]])]
    counts = np.ravel(designer.apportionments)
    counts = counts[np.isfinite(counts)].astype(int)
    return [float(place) for place, count in zip(places, counts, strict=True) for _ in range(count)]


def _integrated(case: DesignCase) -> Callable[..., Any]:
    names = [name for name, _ in case.start]
    rates = [compile(text, case.name, "eval") for text in case.f]
    output = compile(case.g, case.name, "eval")

    def simulate(sampling_times: Any, model_parameters: Any) -> Any:
        values = dict(zip(case.parameters, model_parameters, strict=True))

        def f(x: Any, t: float) -> list[Any]:
            scope = values | dict(zip(names, x, strict=True))
            return [eval(rate, scope) for rate in rates]

        states = odeint(f, [value for _, value in case.start], np.append(0.0, sampling_times))[1:]
        return np.asarray(eval(output, values | dict(zip(names, states.T, strict=True))))[:, None]

    return simulate


def _closed_form(case: DesignCase, variant: str) -> Callable[..., Any]:
    y = case.output(np.exp)

    def simulate(ti_controls: Any, model_parameters: Any) -> Any:
        values = dict(zip(case.parameters, model_parameters, strict=True))
        response = np.array([y(ti_controls[0], values)])
        if variant == "differences" or not Designer.detect_sensitivity_analysis_function():
            return response
        # By a complex step: exact to rounding.
        rows = [y(ti_controls[0], values | {name: value * (1 + 1e-30j)}).imag / (value * 1e-30) for name, value in values.items()]
        return response, np.array([[rows]])

    return simulate
