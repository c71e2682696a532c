"""Good arguments of public functions: one of every kind of object, made once."""

from __future__ import annotations

import atexit
import shutil
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import fisherpoint as fp

STATES, INPUTS, PARAMETERS, OUTPUTS = {"h": ("m", 1.0)}, {"u": "V"}, {"k": "m^0.5/s", "a": "m/(s V)"}, {"y": "m"}
CONSTANTS, THETA, NOISE = {"d": (1.0, "1")}, {"k": 0.1, "a": 0.2}, {"y": 1e-3}
BOUNDS = {"h": (0.5, 2.0), "u": (0.0, 1.0), "dt": (0.1, 2.0)}
RATES, OUTPUT = ["-d*k*sqrt(h) + a*u"], ["h"]


@cache
def model() -> fp.SymbolicModel:
    return fp.SymbolicModel(RATES, OUTPUT, STATES, INPUTS, PARAMETERS, OUTPUTS, constants=CONSTANTS, nominal=THETA, name="tank")


@cache
def prior() -> fp.GaussianPrior:
    return fp.GaussianPrior(THETA, relative_std={"k": 0.1, "a": 0.1})


@cache
def region() -> fp.ExperimentRegion:
    return fp.ExperimentRegion(BOUNDS)


@cache
def points() -> fp.Experiments:
    return fp.Experiments([[1.0], [1.5], [0.8]], [0.5, 0.1, 0.9], [0.5, 1.0, 1.5])


@cache
def runs() -> fp.Runs:
    return fp.Runs([[1.0], [1.5], [0.8]], [[0.5, 0.1, 0.9], [0.2, 0.4, 0.1], [0.3, 0.3, 0.3]], 0.5)


@cache
def run_data() -> fp.Measurements:
    return fp.VirtualRig(model(), THETA, NOISE).measure(runs())


@cache
def problem() -> fp.DesignProblem:
    return fp.DesignProblem(model(), prior(), region(), noise=NOISE)


@cache
def run_problem() -> fp.DesignProblem:
    region = fp.RunRegion({"h": 1.0, "u": (0.1, 1.0), "dt": (0.2, 0.5)}, 3)
    return fp.DesignProblem(model(), prior(), region, noise=NOISE)


@cache
def data() -> fp.Measurements:
    return fp.VirtualRig(model(), THETA, NOISE).measure(points(), repeats=2)


@cache
def record() -> fp.Record:
    return fp.Record([0.0, 0.5, 1.0, 1.5], [0.5, 0.1, 0.2, 0.3], [1.0, 0.95, 0.9, 0.85], x0={"h": 1.0})


@cache
def log_pieces() -> fp.Pieces:
    n = np.arange(20.0)
    return fp.pieces(fp.Record(0.5 * n, 0.1 + 0.2 * np.sin(n) ** 2, 1.0 + 0.1 * np.cos(n)), model(), length=5, every=2)


@cache
def fit() -> fp.Fit:
    return fp.estimate(model(), data(), noise=NOISE)


@cache
def design() -> fp.Design:
    return fp.exchange(problem(), n_experiments=3, n_candidates=2, max_iterations=1, method=fp.ExchangeMethod(references=False))


def campaign() -> fp.Campaign:
    return fp.Campaign(problem(), batch=2, n_candidates=2, max_iterations=1)


@cache
def comparison() -> fp.results.RuleComparison:
    return fp.compare_rules(problem(), points()[0], [fp.LinearizedRule()])


def output(x: Any, u: Any, p: Any) -> Any:
    return x.h


def rates(x: Any, u: Any, p: Any) -> Any:
    return -p.k * np.sqrt(x.h) + p.a * u.u


@cache
def files() -> Path:
    """A directory with good files."""
    directory = Path(tempfile.mkdtemp(prefix="misuse-"))
    atexit.register(shutil.rmtree, directory, ignore_errors=True)
    points().to_csv(directory / "points.csv", model())
    data().to_csv(directory / "data.csv", model())
    runs().to_csv(directory / "runs.csv", model())
    run_data().to_csv(directory / "run_data.csv", model())
    record().to_csv(directory / "record.csv", model())
    (directory / "model.toml").write_text(model().to_toml())
    rest = "".join(f"[prior.{name}]\nmean = {value}\nstd = 0.1\n" for name, value in THETA.items())
    (directory / "problem.toml").write_text(model().to_toml() + "\n[noise]\ny = 0.01\n" + rest)
    design().save(directory / "design")
    fp.Campaign(problem(), batch=2, directory=directory / "campaign")
    return directory
