"""Public functions with good arguments, and the kinds of clumsy ones that each may take."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import sympy

import fisherpoint as fp
from misuse_examples import (
    BOUNDS,
    CONSTANTS,
    INPUTS,
    NOISE,
    OUTPUT,
    OUTPUTS,
    PARAMETERS,
    RATES,
    STATES,
    THETA,
    campaign,
    comparison,
    data,
    design,
    files,
    fit,
    log_pieces,
    model,
    output,
    points,
    prior,
    problem,
    rates,
    record,
    region,
    run_data,
    run_problem,
    runs,
)
from misuse_values import ARRAY, FLAG, FUNCTION, INT, MAP, MODEL, NAMES, NONE, NUMBER, PATH, POINTS, PRIOR, SLICE, TERM, TEXT

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
    settings = {"rtol": rtol, "threads": threads, "kinks": kinks, "jumps": kinks}
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
        "Rest": _case(
            fp.Rest,
            u=({"u": 0.1}, MAP, NONE),
            states=(["h"], NONE, NAMES),
        ),
        "Runs": _case(
            lambda **given: fp.simulate(model(), fp.Runs(**given), THETA, threads=1),
            x0=([[1.0], [2.0]], ARRAY),
            u=([[0.1, 0.2, 0.1], [0.3, 0.4, 0.1]], ARRAY),
            dt=([[0.1, 0.2, 0.1], [0.1, 0.1, 0.1]], ARRAY, NUMBER, INT),
            measured=(True, NONE, FLAG),
            rest=(fp.Rest({"u": 0.5}), NONE),
            columns=(("h", "u"), NONE, NAMES),
        ),
        "broken_limits": _case(fp.broken_limits, model=of_model, points=of_points, theta=theta, method=(None, NONE), **settings),
        "Model.within": _case(lambda limit: model().within(limit), limit=("h < 1.5", TEXT)),
        "points[]": _case(lambda index: points()[index], index=(0, INT, ARRAY, NAMES, SLICE)),
        "Experiments.join": _case(fp.Experiments.join, parts=([points(), points()], POINTS)),
        "Experiments.to_csv": _case(
            lambda path, model: points().to_csv(_within(path), model),
            path=("out", TEXT, PATH),
            model=(model(), MODEL, NONE),
        ),
        "Experiments.from_csv": _case(fp.Experiments.from_csv, path=(files() / "points.csv", TEXT, PATH), model=of_model),
        "RunRegion": _case(
            fp.RunRegion,
            bounds=({"h": 0.5, "u": (0.1, 1.0), "dt": (0.1, 0.2)}, MAP),
            segments=(3, INT),
            constant=((), NAMES),
            shared=((), NAMES),
            levels=({"u": [0.1, 1.0]}, MAP, NONE),
            slew=({"u": 0.5}, MAP, NONE),
            duration=(1.0, NUMBER, NONE),
            measured=([True, True, True], NONE, ARRAY),
            samples=(2, INT, NONE),
            rest=(fp.Rest({"u": 0.5}), NONE),
        ),
        "design_runs": _case(
            fp.design_runs,
            problem=(run_problem(),),
            n_runs=(1, INT),
            n_starts=(1, INT),
            n_candidates=(20, INT),
            confidence=(0.9, NUMBER, NONE),
            plants=(None, NONE, ARRAY),
            seed=(0, INT),
            threads=threads,
            time_limit=(1.0, NUMBER, NONE),
            progress=(None, NONE),
            previous=(None, NONE),
        ),
        "Runs()": _case(
            fp.Runs,
            x0=([[1.0], [2.0]], ARRAY),
            u=([[0.1, 0.2, 0.3], [0.3, 0.4, 0.5]], ARRAY),
            dt=([0.1, 0.2, 0.1], ARRAY, NUMBER),
            measured=([False, True, True], NONE, FLAG, ARRAY),
            columns=(("h", "u"), NONE, NAMES),
        ),
        "runs[]": _case(lambda index: runs()[index], index=(0, INT, ARRAY, NAMES, SLICE)),
        "Runs.of_points": _case(fp.Runs.of_points, points=of_points),
        "Runs.join": _case(fp.Runs.join, parts=([runs(), runs()],)),
        "Runs.to_csv": _case(
            lambda path, model: runs().to_csv(_within(path), model),
            path=("out", TEXT, PATH),
            model=(model(), MODEL, NONE),
        ),
        "Runs.from_csv": _case(fp.Runs.from_csv, path=(files() / "runs.csv", TEXT, PATH), model=of_model),
        "Measurements": _case(fp.Measurements, points=of_points, y=([0.1, 0.2, 0.3], ARRAY)),
        "data[]": _case(lambda index: data()[index], index=(0, INT, ARRAY, NAMES, SLICE)),
        "Measurements.join": _case(fp.Measurements.join, parts=([data(), data()],)),
        "Measurements.from_csv": _case(fp.Measurements.from_csv, path=(files() / "data.csv", TEXT, PATH), model=of_model),
        "Measurements.to_csv": _case(lambda model: data().to_csv(files() / "out.csv", model), model=of_model),
        "Measurements of runs": _case(fp.Measurements, points=(runs(), POINTS), y=([[0.1, 0.2, 0.3]] * 3, ARRAY)),
        "run_data[]": _case(lambda index: run_data()[index], index=(0, INT, ARRAY, NAMES, SLICE)),
        "Measurements.join, runs": _case(fp.Measurements.join, parts=([run_data(), run_data()],)),
        "Measurements.from_csv, runs": _case(fp.Measurements.from_csv, path=(files() / "run_data.csv", TEXT, PATH), model=of_model),
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
        "pieces": _case(
            fp.pieces,
            record=(record(),),
            model=of_model,
            length=(2, INT),
            every=(1, INT, NONE),
            states=({"h": [1.0, 0.9, 0.8, 0.7]}, MAP, NONE),
            longest_step=(2.0, NUMBER, NONE),
        ),
        "pieces[]": _case(lambda index: log_pieces()[index], index=(0, INT, ARRAY, NAMES, SLICE)),
        "best_pieces": _case(
            fp.best_pieces, problem=(problem(),), pieces=(log_pieces(),), n_pieces=(1, INT), seed=(0, INT), threads=threads
        ),
        "approximate": _case(
            fp.approximate,
            problem=(problem(),),
            candidates=(points(), POINTS, NONE),
            criterion=("D",),
            of=(None, NONE),
            conditions=(None, NONE),
            scale=(None, NONE),
            prior_information=(False, FLAG),
            n_experiments=(None, NONE),
            n_candidates=(20, INT),
            starts=(5, INT),
            tolerance=(1e-4, NUMBER),
            seed=(0, INT),
            threads=threads,
        ),
        "criterion": _case(
            fp.criterion,
            problem=(problem(),),
            name=("D",),
            of=(None, NONE),
            conditions=(None, NONE),
            scale=(None, NONE),
            threads=threads,
        ),
        "criterion of a function": _case(fp.criterion, problem=(problem(),), name=("c",), of=("a", TEXT, TERM)),
        "criterion of predictions": _case(
            fp.criterion, problem=(problem(),), name=("I",), of=("y", TEXT), conditions=(points(), POINTS)
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
            theta=theta,
            noise_std=(NOISE,),
            initial_state_std=({"h": 0.01}, MAP, NONE),
            seed=(0, INT),
            rtol=rtol,
        ),
        "VirtualRig.measure": _case(fp.VirtualRig(model(), THETA, NOISE).measure, points=of_points, repeats=(1, INT)),
        "VirtualRig.measure, runs": _case(fp.VirtualRig(model(), THETA, NOISE).measure, points=(runs(), POINTS), repeats=(1, INT)),
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
        "load_problem": _case(fp.load_problem, path=(files() / "problem.toml", TEXT, PATH)),
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
            region().draw,
            model=of_model,
            count=(2, INT),
            seed=(0, INT),
            decades=(False, FLAG),
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
            kinks=kinks,
            jumps=kinks,
            rtol=rtol,
            uncertain=({"d": 0.1}, MAP, NONE),
            initial_state_std=({"h": 0.1}, MAP, NONE),
            assumed_covariance=("tangents",),
            along=(["h < 9"], NONE, NAMES, ARRAY),
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
        "feasibility": _case(
            fp.feasibility,
            problem=(problem(),),
            points=of_points,
            draws=(20, INT),
            seed=(0, INT),
            threads=threads,
        ),
        "Feasibility.holds": _case(fp.feasibility(problem(), points(), draws=20).holds, share=(0.5, NUMBER)),
        "compare": _case(
            fp.compare,
            problem=(problem(),),
            designs=({"one": points()}, MAP, POINTS, ARRAY),
            draws=(20, INT),
            seed=(0, INT),
            threads=threads,
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
            method=("paper", TEXT),
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
        "estimate, runs": _case(
            fp.estimate,
            model=of_model,
            data=(run_data(),),
            noise_std=(NOISE, NONE),
            uncertain=({"d": 0.01}, MAP, NONE),
            initial_state_std=({"h": 0.01}, MAP, NONE),
            rtol=rtol,
        ),
        "validate, runs": _case(
            fp.validate,
            designs=({"one": runs()},),
            problem=(problem(),),
            noise_std=(NOISE, NONE),
            runs=(2, INT),
            theta=("mean", MAP),
            rtol=rtol,
            threads=threads,
        ),
        "a bound": _case(
            lambda bound: fp.estimate(model(), data(), noise_std=NOISE, bounds={"k": bound}), bound=((0.0, 1.0), ARRAY)
        ),
        "Fit.intervals": _case(lambda level: fit().intervals(level), level=(0.9, NUMBER)),
        "Fit.profile": _case(lambda name, level: fit().profile(name, level=level), name=("k", TEXT), level=(0.9, NUMBER)),
        "Fit.save": _case(
            lambda directory: fit().save(_within(directory)),
            directory=("fit", TEXT, PATH),
        ),
        "validate": _case(
            fp.validate,
            designs=({"one": points()},),
            problem=(problem(),),
            noise_std=(NOISE, NONE),
            runs=(2, INT),
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
            batch=(2, INT, NONE),
            targets=({"k": 0.1}, MAP, NONE, NUMBER),
            seed=(0, INT),
            threads=threads,
            n_candidates=(2, INT),
            local=(0.5, NUMBER),
        ),
        "Campaign of runs": _case(
            fp.Campaign,
            problem=(run_problem(),),
            batch=(2, INT, NONE),
            targets=({"k": 0.1}, MAP, NONE, NUMBER),
            seed=(0, INT),
            threads=threads,
            n_starts=(1, INT),
            n_candidates=(2, INT),
            confidence=(0.9, NUMBER, NONE),
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
        "Campaign.tell runs": _case(lambda data: fp.Campaign(run_problem(), n_starts=1).tell(data), data=(run_data(),)),
        "Campaign.next": _case(lambda progress: campaign().next(progress=progress), progress=(None, NONE, FUNCTION)),
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
    "validate": lambda: fp.validate({"one": points()}, problem()),  # type: ignore[arg-type]
    "Measurements": lambda: fp.Measurements([0.1, 0.2, 0.3], points()),  # type: ignore[arg-type]
    "Experiments": lambda: fp.Experiments([0.1, 0.2], [[1.0], [2.0]], [0.1, 0.2]),
    "simulate_record": lambda: fp.simulate_record(THETA, [0.0, 1.0], [0.1, 0.1], model(), {"h": 1.0}),  # type: ignore[arg-type]
    "to_csv": lambda: data().to_csv(model(), files() / "x.csv"),  # type: ignore[arg-type]
    "from_csv": lambda: fp.Experiments.from_csv(model(), files() / "points.csv"),  # type: ignore[arg-type]
    "VirtualRig": lambda: fp.VirtualRig(THETA, model(), NOISE),  # type: ignore[arg-type]
    "identifiability": lambda: fp.identifiability(prior(), model()),  # type: ignore[arg-type]
    "exchange": lambda: fp.exchange(12, problem()),  # type: ignore[arg-type]
}
"""Calls with two arguments in each other's place."""
