"""Public functions with good arguments, and clumsy values to put in the place of one of them."""

from __future__ import annotations

import atexit
import re
import shutil
import signal
import tempfile
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from decimal import Decimal
from fractions import Fraction
from functools import cache
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
import pandas as pd
import sympy

import fisherpoint as fp
from fisherpoint.config import ConfigError

# --- What a value may be taken for ---------------------------------------------------------------------------------------

NONE, NUMBER, INT, FLAG, TEXT, TERM, ARRAY, NAMES, MAP = "none", "number", "int", "flag", "text", "term", "array", "names", "map"
MODEL, POINTS, PRIOR, FUNCTION, CLASS, SLICE, PATH = "model", "points", "prior", "function", "class", "slice", "path"


@dataclass(frozen=True)
class Clumsy:
    """A value, made anew for each call, and what it may be taken for: an argument that takes nothing of that must refuse it."""

    make: Callable[[], Any]
    kinds: frozenset[str]


class Rude:
    """An object of which nothing works."""

    def __repr__(self) -> str:
        raise RuntimeError("no repr")

    def __len__(self) -> int:
        raise RuntimeError("no length")

    def __iter__(self) -> Iterator[Any]:
        raise RuntimeError("no iteration")

    def __float__(self) -> float:
        raise RuntimeError("no number")

    def __eq__(self, other: object) -> bool:
        raise RuntimeError("no comparison")

    __hash__ = None  # type: ignore[assignment]


def _value(make: Callable[[], Any], *kinds: str) -> Clumsy:
    return Clumsy(make, frozenset(kinds))


CLUMSY: dict[str, Clumsy] = {
    "None": _value(lambda: None, NONE),
    "''": _value(lambda: "", TEXT),
    "'1.0'": _value(lambda: "1.0", TEXT, PATH),
    "'a'": _value(lambda: "a", TEXT, PATH),
    "bytes": _value(lambda: b"h"),
    "control characters": _value(lambda: "\x1b[31m\n\x00", TEXT),
    "long text": _value(lambda: "x" * 100_000, TEXT),
    "10**9": _value(lambda: 10**9, NUMBER, INT),
    "10**400": _value(lambda: 10**400),
    "-10**400": _value(lambda: -(10**400)),
    "10**5000": _value(lambda: 10**5000),
    "2**63": _value(lambda: 2**63, NUMBER, INT),
    "Fraction": _value(lambda: Fraction(1, 3), NUMBER),
    "Decimal": _value(lambda: Decimal("0.25"), NUMBER),
    "Decimal NaN": _value(lambda: Decimal("nan")),
    "sympy number": _value(lambda: sympy.Rational(1, 3), NUMBER),
    "sympy symbol": _value(lambda: sympy.Symbol("a"), TERM),
    "nan": _value(lambda: float("nan")),
    "inf": _value(lambda: float("inf")),
    "-inf": _value(lambda: float("-inf")),
    "1e308": _value(lambda: 1e308, NUMBER),
    "1e-308": _value(lambda: 1e-308, NUMBER),
    "-1": _value(lambda: -1, NUMBER, INT),
    "0": _value(lambda: 0, NUMBER, INT),
    "1": _value(lambda: 1, NUMBER, INT),
    "0.5": _value(lambda: 0.5, NUMBER),
    "2.0": _value(lambda: 2.0, NUMBER),
    "True": _value(lambda: True, FLAG),
    "False": _value(lambda: False, FLAG),
    "np.True_": _value(lambda: np.True_, FLAG),
    "1j": _value(lambda: 1 + 1j),
    "[]": _value(list, ARRAY, NAMES),
    "()": _value(tuple, ARRAY, NAMES),
    "[[]]": _value(lambda: [[]], ARRAY),
    "{}": _value(dict, MAP, NAMES),
    "a set": _value(lambda: {1.0, 2.0}),
    "[None]": _value(lambda: [None]),
    "['a']": _value(lambda: ["a"], NAMES),
    "['h']": _value(lambda: ["h"], NAMES),
    "[1j]": _value(lambda: [1j]),
    "[True]": _value(lambda: [True]),
    "[10**400]": _value(lambda: [10**400]),
    "ragged": _value(lambda: [[1.0], [1.0, 2.0]]),
    "[Fraction]": _value(lambda: [Fraction(1, 2)], ARRAY),
    "a vector": _value(lambda: np.ones(3), ARRAY),
    "a matrix": _value(lambda: np.ones((2, 2)), ARRAY),
    "a cube": _value(lambda: np.ones((2, 1, 1)), ARRAY),
    "an empty array": _value(lambda: np.empty((0, 1)), ARRAY, NAMES),
    "a numpy number": _value(lambda: np.float64(0.5), NUMBER),
    "a 0-d array": _value(lambda: np.array(0.5), NUMBER, ARRAY),
    "complex": _value(lambda: np.ones((2, 1), complex)),
    "objects": _value(lambda: np.array([[object()]])),
    "an array of text": _value(lambda: np.array([["1.0"]])),
    "dates": _value(lambda: np.array([["2020-01-01"]], dtype="M8[D]")),
    "an array of nan": _value(lambda: np.array([[np.nan]])),
    "a structured array": _value(lambda: np.zeros(2, dtype=[("a", float)])),
    "a masked array": _value(lambda: np.ma.masked_array([[1.0], [2.0]], [[True], [False]])),
    "an array of flags": _value(lambda: np.array([True, False])),
    "a DataFrame": _value(lambda: pd.DataFrame({"h": [1.0, 2.0]}), ARRAY, NAMES),
    "a Series": _value(lambda: pd.Series([1.0, 2.0], index=["h", "u"]), ARRAY),
    "{'x': 1.0}": _value(lambda: {"x": 1.0}, MAP),
    "{1: 2}": _value(lambda: {1: 2}),
    "a mapping to text": _value(lambda: dict.fromkeys(("k", "a", "h", "u", "dt", "y"), "x")),
    "a mapping to None": _value(lambda: dict.fromkeys(("k", "a", "h", "u", "dt", "y"))),
    "a mapping to 10**400": _value(lambda: dict.fromkeys(("k", "a", "h", "u", "dt", "y"), 10**400)),
    "a mapping to lists": _value(lambda: {key: [1.0] for key in ("k", "a", "h", "u", "dt", "y")}),
    "many keys": _value(lambda: dict.fromkeys(map(str, range(20_000)), 1.0), MAP),
    "many names": _value(lambda: [f"n{i}" for i in range(20_000)]),
    "a model": _value(lambda: model(), MODEL),
    "points": _value(lambda: points(), POINTS),
    "a prior": _value(lambda: prior(), PRIOR),
    "a class": _value(lambda: fp.Experiments, CLASS),
    "a function": _value(lambda: lambda *_: 1.0, FUNCTION),
    "a generator": _value(lambda: (x for x in (1.0, 2.0)), NAMES),
    "an iterator of names": _value(lambda: iter(["k"]), NAMES),
    "a range": _value(lambda: range(3), ARRAY),
    "an object": _value(object),
    "a rude object": _value(Rude),
    "Ellipsis": _value(lambda: ...),
    "a slice": _value(lambda: slice(None), SLICE),
    "a path": _value(lambda: files() / "\x1b[31m", PATH),
}
"""Values that a hurried user, another program or a damaged file may hand in."""


# --- Good arguments ------------------------------------------------------------------------------------------------------


STATES, INPUTS, PARAMETERS, OUTPUTS = {"h": ("m", 1.0)}, {"u": "V"}, {"k": "m^0.5/s", "a": "m/(s V)"}, {"y": "m"}
CONSTANTS, THETA, NOISE = {"d": (1.0, "1")}, {"k": 0.1, "a": 0.2}, {"y": 1e-3}
BOUNDS = {"h": (0.5, 2.0), "u": (0.0, 1.0), "dt": (0.1, 2.0)}
RATES, OUTPUT = ["-d*k*sqrt(h) + a*u"], ["h"]


@cache
def model() -> fp.SymbolicModel:
    return fp.SymbolicModel(RATES, OUTPUT, STATES, INPUTS, PARAMETERS, OUTPUTS, CONSTANTS, nominal=THETA, name="tank")


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
def problem() -> fp.DesignProblem:
    return fp.DesignProblem(model(), prior(), region(), noise_std=NOISE)


@cache
def data() -> fp.Measurements:
    return fp.VirtualRig(model(), THETA, NOISE).measure(points(), repeats=2)


@cache
def record() -> fp.Record:
    return fp.Record([0.0, 0.5, 1.0, 1.5], [0.5, 0.1, 0.2, 0.3], [1.0, 0.95, 0.9, 0.85], {"h": 1.0})


@cache
def fit() -> fp.Fit:
    return fp.estimate(model(), data(), noise_std=NOISE)


@cache
def design() -> fp.Design:
    return fp.exchange(problem(), n_experiments=3, n_candidates=2, max_iterations=1, references=False)


def campaign() -> fp.Campaign:
    return fp.Campaign(problem(), batch=2, n_candidates=2, max_iterations=1)


@cache
def comparison() -> fp.RuleComparison:
    return fp.compare_rules(problem(), points()[0], [fp.Linearized()])


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
    record().to_csv(directory / "record.csv", model())
    (directory / "model.toml").write_text(model().to_toml())
    design().save(directory / "design")
    fp.Campaign(problem(), batch=2, directory=directory / "campaign")
    return directory


# --- Calls ---------------------------------------------------------------------------------------------------------------

EQUATIONS = (TEXT, TERM, NUMBER, ARRAY, NAMES)
Argument = tuple[Any, ...]
"""A good value, and the kinds of clumsy ones that may be taken."""


NEW = "a new directory"


def _within(path: Any) -> Any:
    """A path below that of the files, where it is a text for a name."""
    return files() / path if isinstance(path, str) and path.isalnum() else path


@dataclass(frozen=True)
class Case:
    """A public function with good arguments."""

    call: Callable[..., Any]
    arguments: dict[str, Argument]


def _case(call: Callable[..., Any], **arguments: Argument) -> Case:
    return Case(call, arguments)


@cache
def cases() -> dict[str, Case]:
    """By name, as messages and the choice by a seed need it."""
    of_model, of_points, theta = (model(), MODEL), (points(), POINTS), (THETA, ARRAY, MAP)
    rtol, threads, kinks = (1e-6, NUMBER), (1, INT, NONE), ("cross",)
    settings = {"rtol": rtol, "threads": threads, "kinks": kinks}
    std = ({"k": 0.1, "a": 0.1},)
    quantities = {
        "states": (STATES,),
        "inputs": (INPUTS, MAP, NONE),
        "parameters": (PARAMETERS,),
        "outputs": (OUTPUTS, NONE),
        "constants": (CONSTANTS, MAP, NONE),
        "nominal": (THETA, MAP, NONE),
        "name": ("tank", TEXT),
    }
    all_cases = {
        "simulate": _case(fp.simulate, model=of_model, points=of_points, theta=theta, method=(None, NONE), **settings),
        "sensitivities": _case(fp.sensitivities, model=of_model, points=of_points, theta=theta, method=(None, NONE), **settings),
        "predictive_covariance": _case(
            fp.predictive_covariance,
            model=of_model,
            points=of_points,
            prior=(prior(), PRIOR),
            rule=(fp.SparseGaussHermite(1),),
            parameters=(None, NONE, NAMES),
            **settings,
        ),
        "assumed_covariance": _case(
            fp.assumed_covariance,
            model=of_model,
            points=of_points,
            theta=theta,
            uncertain=({"d": 0.1}, MAP, NONE),
            initial_state_std=({"h": 0.01}, MAP, NONE),
            rule=(None, NONE),
            **settings,
        ),
        "Experiments": _case(
            fp.Experiments,
            x0=([[1.0], [2.0]], ARRAY),
            u=([0.1, 0.2], ARRAY),
            dt=([0.1, 0.2], ARRAY),
            columns=(("h", "u"), NONE, NAMES),
        ),
        "points[]": _case(lambda index: points()[index], index=(0, INT, ARRAY, NAMES, SLICE)),
        "Experiments.join": _case(fp.Experiments.join, parts=([points(), points()], POINTS)),
        "Experiments.to_csv": _case(
            lambda path, model: points().to_csv(_within(path), model),
            path=("out", TEXT, PATH),
            model=(model(), MODEL, NONE),
        ),
        "Experiments.from_csv": _case(fp.Experiments.from_csv, path=(files() / "points.csv", TEXT, PATH), model=of_model),
        "Measurements": _case(fp.Measurements, points=of_points, y=([0.1, 0.2, 0.3], ARRAY)),
        "data[]": _case(lambda index: data()[index], index=(0, INT, ARRAY, NAMES, SLICE)),
        "Measurements.join": _case(fp.Measurements.join, parts=([data(), data()],)),
        "Measurements.from_csv": _case(fp.Measurements.from_csv, path=(files() / "data.csv", TEXT, PATH), model=of_model),
        "Measurements.to_csv": _case(lambda model: data().to_csv(files() / "out.csv", model), model=of_model),
        "Record": _case(
            fp.Record,
            t=([0.0, 1.0, 2.0], ARRAY),
            u=([0.1, 0.2, 0.3], ARRAY),
            y=([0.1, 0.2, 0.3], ARRAY),
            x0=({"h": 1.0}, MAP, NONE),
        ),
        "record[]": _case(lambda index: record()[index], index=(slice(0, 2), SLICE)),
        "Record.check": _case(record().check, model=of_model),
        "Record.from_csv": _case(
            fp.Record.from_csv, path=(files() / "record.csv", TEXT, PATH), model=of_model, x0=({"h": 1.0}, MAP, NONE)
        ),
        "simulate_record": _case(
            fp.simulate_record,
            model=of_model,
            theta=theta,
            t=([0.0, 0.1, 0.2], ARRAY),
            u=([0.1, 0.2, 0.3], ARRAY),
            x0=({"h": 1.0}, ARRAY, MAP),
            rtol=rtol,
        ),
        "VirtualRig": _case(
            fp.VirtualRig,
            model=of_model,
            theta_true=theta,
            noise_std=(NOISE,),
            initial_state_std=({"h": 0.01}, MAP, NONE),
            seed=(0, INT),
            rtol=rtol,
        ),
        "VirtualRig.measure": _case(fp.VirtualRig(model(), THETA, NOISE).measure, points=of_points, repeats=(1, INT)),
        "Model.rhs": _case(model().rhs, x=([1.0], ARRAY, NUMBER), u=([0.1], ARRAY, NUMBER), theta=theta),
        "Model.output": _case(model().output, x=([1.0], ARRAY, NUMBER), u=([0.1], ARRAY, NUMBER), theta=theta),
        "Model.limits": _case(model().limits, x=([1.0], ARRAY, NUMBER), u=([0.1], ARRAY, NUMBER), theta=theta),
        "Model.theta": _case(model().theta, values=theta),
        "Model.estimate": _case(lambda name: model().estimate(name), name=("d",)),
        "Model.fix": _case(lambda k: model().fix(k=k), k=(0.1, NUMBER)),
        "Model.free_start": _case(lambda name: model().free_start(name), name=("h",)),
        "HydraulicCylinder": _case(fp.HydraulicCylinder, A_A=(2e-3, NUMBER), k_u=(1.0, NUMBER), smooth=({"v": 1e-3}, MAP, NONE)),
        "SymbolicModel": _case(
            fp.SymbolicModel,
            f=(RATES, *EQUATIONS),
            g=(OUTPUT, *EQUATIONS),
            domain=(["h"], NONE, *EQUATIONS),
            **quantities,
        ),
        "CallableModel": _case(
            fp.CallableModel,
            f=(rates, FUNCTION),
            g=(output, FUNCTION),
            domain=({"h": output}, MAP, NONE),
            jumps=({}, MAP, NONE),
            kinks=({}, MAP, NONE),
            **quantities,
        ),
        "model": _case(
            lambda function, **given: fp.model(**given)(function),
            function=(lambda x, u, p: ([-p.k * fp.sqrt(x.h) + p.a * u.u * p.d], [x.h]),),
            **quantities | {"name": ("tank", TEXT, NONE)},
        ),
        "load_model": _case(fp.load_model, path=(files() / "model.toml", TEXT, PATH)),
        "Quantity": _case(fp.Quantity, name=("h", TEXT), unit=("m", TEXT), description=("level", TEXT), scale=(1.0, NUMBER, NONE)),
        "GaussianPrior": _case(fp.GaussianPrior, mean=(THETA,), std=std, log=(["k"], NAMES)),
        "GaussianPrior relative": _case(fp.GaussianPrior, mean=(THETA,), relative_std=std),
        "GaussianPrior covariance": _case(
            fp.GaussianPrior, mean=(THETA,), covariance=([[0.01, 0.001], [0.001, 0.01]], ARRAY), log=((), NAMES)
        ),
        "prior std": _case(lambda std: fp.GaussianPrior({"k": 0.1}, std={"k": std}), std=(0.1, NUMBER)),
        "prior relative std": _case(lambda std: fp.GaussianPrior({"k": 0.1}, relative_std={"k": std}), std=(0.1, NUMBER)),
        "prior mean": _case(lambda mean: fp.GaussianPrior({"k": mean}, std={"k": 0.1}), mean=(0.1, NUMBER)),
        "prior variance": _case(
            lambda variance: fp.GaussianPrior({"k": 0.1, "a": 0.1}, covariance=[[variance, 0.0], [0.0, 1.0]]),
            variance=(0.1, NUMBER, FLAG),
        ),
        "prior covariance": _case(
            lambda covariance: fp.GaussianPrior({"k": 0.1, "a": 0.1}, covariance=[[1.0, covariance], [covariance, 1.0]]),
            covariance=(0.1, NUMBER, FLAG),
        ),
        "GaussianPrior.marginal": _case(prior().marginal, names=(["k"], NAMES)),
        "TensorGrid": _case(fp.TensorGrid, levels=(2, INT, NONE, MAP), span=(1.0, NUMBER, NONE)),
        "TensorGrid edges": _case(fp.TensorGrid, edges=([-1.0, 0.0, 1.0], ARRAY, NONE, MAP)),
        "GaussHermite": _case(fp.GaussHermite, levels=(2, INT, MAP)),
        "SparseGaussHermite": _case(fp.SparseGaussHermite, level=(2, INT)),
        "Sobol": _case(fp.Sobol, n=(8, INT), seed=(0, INT)),
        **{
            f"Rule.{name}": _case(
                lambda prior, name=name: [getattr(rule, name)(prior) for rule in (fp.TensorGrid({"k": 2, "a": 1}), fp.Sobol(8))],
                prior=(prior(), PRIOR),
            )
            for name in ("size", "check", "nodes", "second_moments", "variances")
        },
        "Rule.nodes of others": _case(
            lambda prior: [
                rule.nodes(prior)
                for rule in (fp.GaussHermite(2), fp.SparseGaussHermite(1), fp.Unscented(), fp.Linearized(), fp.TensorGrid())
            ],
            prior=(prior(), PRIOR),
        ),
        "ExperimentRegion": _case(fp.ExperimentRegion, bounds=(BOUNDS, MAP), constraints=(["h < 1.5"], ARRAY, NAMES, FUNCTION)),
        "bounds of h": _case(lambda pair: fp.ExperimentRegion(BOUNDS | {"h": pair}), pair=((0.5, 2.0), ARRAY)),
        "lower bound of h": _case(lambda lower: fp.ExperimentRegion(BOUNDS | {"h": (lower, 2.0)}), lower=(0.5, NUMBER)),
        "ExperimentRegion.check": _case(region().check, model=of_model),
        "ExperimentRegion.draw": _case(
            lambda model, count, rng: region().draw(model, count, rng),
            model=of_model,
            count=(2, INT),
            rng=(np.random.default_rng(0),),
        ),
        "ExperimentRegion.satisfied": _case(region().satisfied, model=of_model, points=of_points),
        "constraint": _case(
            lambda holds: fp.ExperimentRegion(BOUNDS, [lambda columns: holds]).satisfied(model(), points()),
            holds=(np.array([True, True, False]),),
        ),
        "DesignProblem": _case(
            fp.DesignProblem,
            model=of_model,
            prior=(prior(), PRIOR),
            region=(region(), NONE),
            noise_std=(NOISE, NONE),
            rule=(fp.SparseGaussHermite(1),),
            output_covariance=("noise", NONE),
            parameters=(["k"], NONE, NAMES),
            kinks=("cross",),
            rtol=rtol,
            uncertain=({"d": 0.1}, MAP, NONE),
            initial_state_std=({"h": 0.1}, MAP, NONE),
            assumed_covariance=("tangents",),
        ),
        "DesignProblem.replace": _case(
            lambda **changes: problem().replace(**changes),
            prior=(prior(), PRIOR),
            noise_std=(NOISE, NONE),
            parameters=(["k"], NONE, NAMES),
            rtol=rtol,
        ),
        "evaluate_design": _case(
            fp.evaluate_design, problem=(problem(),), points=of_points, threads=threads, previous=(None, NONE, POINTS, ARRAY, NAMES)
        ),
        "evaluate_under_noise": _case(
            fp.evaluate_under_noise,
            problem=(problem(),),
            points=of_points,
            threads=threads,
            previous=(None, NONE, POINTS, ARRAY, NAMES),
        ),
        "compare_rules": _case(
            fp.compare_rules,
            problem=(problem(),),
            points=(points()[:1], POINTS),
            rules=([fp.Linearized()], NONE, ARRAY, NAMES),
            threads=threads,
        ),
        "exchange": _case(
            fp.exchange,
            problem=(problem(),),
            n_experiments=(2, INT),
            n_candidates=(2, INT),
            max_iterations=(1, INT),
            seed=(0, INT),
            threads=threads,
            progress=(None, NONE, FUNCTION),
            patience=(None, NONE, INT),
            time_limit=(1.0, NONE, NUMBER),
            max_redraws=(1, INT),
            references=(False, FLAG),
            screen=(True, FLAG),
            local=(0.5, NUMBER),
            previous=(None, NONE, POINTS, ARRAY, NAMES),
        ),
        "Design.load": _case(fp.Design.load, directory=(files() / "design", TEXT, PATH)),
        "Design.save": _case(
            lambda directory: design().save(_within(directory)),
            directory=("again", TEXT, PATH),
        ),
        "identifiability": _case(
            fp.identifiability,
            model=of_model,
            prior=(prior(), PRIOR, NONE),
            region=(region(), NONE),
            n_points=(20, INT, NONE),
            n_theta=(2, INT),
            seed=(0, INT),
            parameters=(["k"], NONE, NAMES),
            unknown_start=((), NAMES),
            threads=threads,
        ),
        "estimate": _case(
            fp.estimate,
            model=of_model,
            data=(data(),),
            prior=(prior(), PRIOR, NONE),
            start=(THETA, MAP, NONE, PRIOR),
            parameters=(None, NONE, NAMES),
            noise_std=(NOISE, NONE),
            bounds=({"k": (0.0, 1.0)}, MAP, NONE),
            uncertain=({"d": 0.01}, MAP, NONE),
            initial_state_std=({"h": 0.01}, MAP, NONE),
            assumed_rule=(None, NONE),
            starts=(1, INT),
            rtol=rtol,
            threads=threads,
        ),
        "a bound": _case(
            lambda bound: fp.estimate(model(), data(), noise_std=NOISE, bounds={"k": bound}), bound=((0.0, 1.0), ARRAY)
        ),
        "Fit.intervals": _case(lambda level: fit().intervals(level), level=(0.9, NUMBER)),
        "Fit.profile": _case(lambda name, level: fit().profile(name, level), name=("k", TEXT), level=(0.9, NUMBER)),
        "Fit.save": _case(
            lambda directory: fit().save(_within(directory)),
            directory=("fit", TEXT, PATH),
        ),
        "validate": _case(
            fp.validate,
            designs=({"one": points()},),
            problem=(problem(),),
            noise_std=(NOISE, NONE),
            n=(2, INT),
            theta=("mean", MAP),
            seed=(0, INT),
            truth=(None, NONE, MODEL),
            noise=("known",),
            use_prior=(True, FLAG),
            rtol=rtol,
            threads=threads,
        ),
        "Campaign": _case(
            fp.Campaign,
            problem=(problem(),),
            batch=(2, INT),
            targets=({"k": 0.1}, MAP, NONE, NUMBER),
            seed=(0, INT),
            threads=threads,
            n_candidates=(2, INT),
            local=(0.5, NUMBER),
        ),
        "Campaign directory": _case(
            lambda directory: fp.Campaign(
                problem(), directory=tempfile.mkdtemp(dir=files()) if directory is NEW else directory, batch=2
            ),
            directory=(NEW, PATH, NONE),
        ),
        "Campaign.load": _case(fp.Campaign.load, directory=(files() / "campaign", PATH, TEXT)),
        "Campaign.is_in": _case(fp.Campaign.is_in, directory=(files(), PATH, TEXT)),
        "Campaign.told": _case(lambda data: campaign().told(data), data=(data(),)),
        "RuleComparison.cheapest": _case(lambda within: comparison().cheapest(within), within=(0.01, NUMBER)),
        "Campaign.tell": _case(lambda data: campaign().tell(data), data=(data(),)),
        "Campaign.next": _case(lambda progress: campaign().next(progress), progress=(None, NONE, FUNCTION)),
        "Campaign.targets": _case(lambda targets: setattr(campaign(), "targets", targets), targets=({"k": 0.1}, MAP, NONE, NUMBER)),
        **{
            f"{name}()": _case(lambda x, name=name: getattr(fp, name)(x), x=(0.5, NUMBER, TERM))
            for name in ("sqrt", "exp", "sin", "abs", "sign", "heaviside")
        },
        **{
            f"{name}()": _case(lambda a, b, name=name: getattr(fp, name)(a, b), a=(0.5, NUMBER, TERM), b=(1, NUMBER, TERM))
            for name in ("min", "max", "atan2")
        },
        "where()": _case(
            lambda condition, a, b: fp.where(condition, a, b),
            condition=(sympy.Symbol("x") > 0, FLAG),
            a=(0.5, NUMBER, TERM),
            b=(1.0, NUMBER, TERM),
        ),
    }
    return all_cases


SWAPPED: dict[str, Callable[[], Any]] = {
    "simulate": lambda: fp.simulate(points(), model(), THETA),  # type: ignore[arg-type]
    "simulate, theta first": lambda: fp.simulate(THETA, points(), model()),  # type: ignore[arg-type]
    "simulate, theta second": lambda: fp.simulate(model(), THETA, points()),  # type: ignore[arg-type]
    "predictive_covariance": lambda: fp.predictive_covariance(model(), prior(), points(), fp.Sobol(8)),  # type: ignore[arg-type]
    "rule and prior": lambda: fp.predictive_covariance(model(), points(), fp.Sobol(8), prior()),  # type: ignore[arg-type]
    "DesignProblem": lambda: fp.DesignProblem(prior(), model(), region()),  # type: ignore[arg-type]
    "region and prior": lambda: fp.DesignProblem(model(), region(), prior()),  # type: ignore[arg-type]
    "evaluate_design": lambda: fp.evaluate_design(points(), problem()),  # type: ignore[arg-type]
    "estimate": lambda: fp.estimate(data(), model()),  # type: ignore[arg-type]
    "estimate, prior second": lambda: fp.estimate(model(), prior(), data()),  # type: ignore[arg-type]
    "validate": lambda: fp.validate(problem(), {"one": points()}),  # type: ignore[arg-type]
    "Measurements": lambda: fp.Measurements([0.1, 0.2, 0.3], points()),  # type: ignore[arg-type]
    "Experiments": lambda: fp.Experiments([0.1, 0.2], [[1.0], [2.0]], [0.1, 0.2]),
    "simulate_record": lambda: fp.simulate_record(THETA, model(), [0.0, 1.0], [0.1, 0.1], {"h": 1.0}),  # type: ignore[arg-type]
    "to_csv": lambda: data().to_csv(model(), files() / "x.csv"),  # type: ignore[arg-type]
    "from_csv": lambda: fp.Experiments.from_csv(model(), files() / "points.csv"),  # type: ignore[arg-type]
    "VirtualRig": lambda: fp.VirtualRig(THETA, model(), NOISE),  # type: ignore[arg-type]
    "identifiability": lambda: fp.identifiability(prior(), model()),  # type: ignore[arg-type]
    "exchange": lambda: fp.exchange(12, problem()),  # type: ignore[arg-type]
}
"""Calls with two arguments in each other's place."""


# --- What comes of them --------------------------------------------------------------------------------------------------

OURS = re.compile(r"[^\n]*\bexpected\b[^\n]*\b(given|found)\b[^\n]*")
LONGEST = 1000
"""Characters of a message."""


@dataclass
class Outcome:
    """How a call ended: "refused" in our words, "taken" where the value may be, or in a way that must not be."""

    kind: str
    text: str = ""


class Hangs(BaseException):
    """A call takes too long."""


def outcome(call: Callable[[], Any], may_be_taken: bool, seconds: float = 20.0) -> Outcome:
    """Call, and judge what comes of it."""

    def ring(number: int, frame: FrameType | None) -> None:
        raise Hangs

    before = signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            result = call()
    except Hangs:
        return Outcome("hangs")
    except OSError as error:  # of a path, which the system names
        return Outcome("refused" if error.filename is not None or OURS.fullmatch(str(error)) else "foreign", repr(error))
    except (ValueError, TypeError, KeyError, IndexError) as error:
        text = str(error)
        ours = (OURS.fullmatch(text) or isinstance(error, ConfigError)) and text.isprintable() and len(text) <= LONGEST
        return Outcome("refused" if ours else "foreign", f"{type(error).__name__}: {text[:300]!r}")
    except Exception as error:
        return Outcome("foreign", f"{type(error).__name__}: {str(error)[:300]!r}")
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    return Outcome("taken" if may_be_taken else "accepted", repr(type(result)))


@dataclass
class Misuse:
    """What came of calls with clumsy arguments."""

    counts: dict[str, int] = field(default_factory=dict)
    faults: list[str] = field(default_factory=list)

    def try_one(self, name: str, argument: str, value: str) -> None:
        """Call with one argument replaced."""
        self.try_some(name, {argument: value})

    def try_some(self, name: str, values: dict[str, str]) -> None:
        """Call with arguments replaced; what comes of it may be a result only where each may be taken."""
        case = cases()[name]
        kinds = {argument: set(case.arguments[argument][1:]) for argument in values}
        if any(FUNCTION in kinds[argument] and CLASS in CLUMSY[value].kinds for argument, value in values.items()):
            return  # a function too, of which the errors are its own
        arguments = {key: good for key, (good, *_) in case.arguments.items()}
        arguments |= {argument: CLUMSY[value].make() for argument, value in values.items()}
        may_be_taken = all(CLUMSY[value].kinds & kinds[argument] for argument, value in values.items())
        self.count(f"{name}({values})", outcome(lambda: case.call(**arguments), may_be_taken))

    def count(self, call: str, found: Outcome) -> None:
        """Count an outcome, and keep what must not be."""
        self.counts[found.kind] = self.counts.get(found.kind, 0) + 1
        if found.kind not in ("refused", "taken"):
            self.faults.append(f"{call}: {found.kind} {found.text}")
