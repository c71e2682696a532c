"""fisherpoint: the model as equations, and the exchange with its default settings."""

from __future__ import annotations

import scipy.optimize  # noqa: F401  (what is imported when it is used is not to count as solving)

import fisherpoint as fp
import fisherpoint.design.points.exchange
import fisherpoint.models.symbolic

from .design_cases import DesignCase

PACKAGES = ("numpy", "scipy")


def solve(case: DesignCase, variant: str) -> list[float]:
    """Return the points; `variant` is "exchange"."""
    static = not case.f
    model = fp.SymbolicModel(
        list(case.f),
        [case.g],
        {name: "1" for name, _ in case.start},
        {case.factor: "1"} if static else {},
        dict.fromkeys(case.parameters, "1"),
        {"measured": "1"},
        check_units=False,
    )
    prior = fp.GaussianPrior(mean=case.parameters, std={name: 0.1 * value for name, value in case.parameters.items()})
    bounds = {name: (value, value) for name, value in case.start} | {case.factor if static else "dt": case.bounds}
    problem = fp.DesignProblem(model, prior, fp.ExperimentRegion(bounds), noise={"measured": case.sigma})
    points = fp.exchange(problem, case.n_points).points
    return [float(value) for value in (points.u[:, 0] if static else points.dt)]
