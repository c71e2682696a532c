"""Pyomo.DoE: all points are the inputs of one experiment, from one start that is spread over the range, as its examples have one.

It searches from one start only, so that a variant takes the best of three, two of them random, by the program's own value.

Settings are its defaults, with sensitivities scaled by the nominal parameters as in its example of a reactor. The solver is Ipopt,
or where there is none the port of it that comes with discopt (POUNCE), which reads the same files.
"""

from __future__ import annotations

import gc
import logging
import shutil
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas  # noqa: F401
import pyomo.environ as pyo
from pyomo.contrib.doe import DesignOfExperiments

from .design_cases import DesignCase

PACKAGES = ("pyomo",)


class PointsExperiment:
    """The labelled model that Pyomo.DoE asks for."""

    def __init__(self, case: DesignCase, start: list[float]) -> None:
        self.case, self.start = case, start
        self.model: Any = None

    def get_labeled_model(self) -> Any:
        if self.model is None:  # kept, as in its examples: suffixes hold weak references
            self.model = self._create()
        return self.model

    def _create(self) -> Any:
        case, m = self.case, pyo.ConcreteModel()
        m.points = pyo.RangeSet(case.n_points)
        m.x = pyo.Var(m.points, bounds=case.bounds)
        m.y = pyo.Var(m.points)
        m.theta = pyo.Var(list(case.parameters))
        for name, value in case.parameters.items():
            m.theta[name].fix(value)
        y, at_start = case.output(pyo.exp), case.output(np.exp)
        for i, x in zip(m.points, self.start, strict=True):
            m.x[i].fix(x)
            m.y[i].set_value(float(at_start(x, case.parameters)))
        theta = {name: m.theta[name] for name in case.parameters}
        m.output = pyo.ConstraintList()
        for i in m.points:
            m.output.add(m.y[i] == y(m.x[i], theta))
        for name in ("experiment_outputs", "measurement_error", "experiment_inputs", "unknown_parameters"):
            setattr(m, name, pyo.Suffix(direction=pyo.Suffix.LOCAL))
        m.experiment_outputs.update((m.y[i], None) for i in m.points)
        m.measurement_error.update((m.y[i], case.sigma) for i in m.points)
        m.experiment_inputs.update((m.x[i], None) for i in m.points)
        m.unknown_parameters.update((m.theta[name], value) for name, value in case.parameters.items())
        return m


def solve(case: DesignCase, variant: str) -> list[float]:
    """Return the points; `variant` is "1 start" or "3 starts"."""
    logging.getLogger("pyomo").setLevel(logging.CRITICAL)
    gc.disable()  # a collection may take what only weak references hold, and run_doe ends with an AttributeError
    rng, fine = np.random.default_rng(0), case.spread(1001)
    random = [[fine[i] for i in sorted(rng.integers(1, 1000, case.n_points))] for _ in range(2)]
    inner = case.spread(2 * case.n_points + 1)[1::2]  # no start on a bound
    starts = [inner, *(random if variant == "3 starts" else [])]
    found, failures = [], []
    for start in starts:
        try:
            found.append(_search(case, start))
        except (RuntimeError, ValueError) as error:
            failures.append(f"{type(error).__name__}: {error}")
    if not found:
        raise RuntimeError("; ".join(sorted(set(failures))))
    return max(found)[1]


def _search(case: DesignCase, start: list[float]) -> tuple[float, list[float]]:
    solver = pyo.SolverFactory("ipopt", executable=executable())
    solver.options["max_iter"] = 3000  # as with Pyomo.DoE's own choice of solver
    design = DesignOfExperiments(PointsExperiment(case, start), solver=solver, scale_nominal_param_value=True)
    design.run_doe()
    condition = str(design.results["Termination Condition"])
    if condition != "optimal":
        raise RuntimeError(f"the solver ended with {condition}")
    return float(design.results["log10 D-opt"]), [float(value) for value in design.results["Experiment Design"]]


def executable() -> str:
    """Return where Ipopt is, or POUNCE."""
    beside = Path(sys.executable).parent / "pounce"
    found = shutil.which("ipopt") or shutil.which("pounce") or (str(beside) if beside.exists() else None)
    if found is None:
        raise RuntimeError("no solver: install Ipopt, or pip install pounce-solver")
    return found
