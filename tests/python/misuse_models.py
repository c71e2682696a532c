"""Models, priors, rules and functions of formulas: with good arguments, and the kinds of clumsy ones."""

from __future__ import annotations

from functools import cache

import sympy

import fisherpoint as fp
from misuse_case import Case, case
from misuse_examples import (
    CONSTANTS,
    INPUTS,
    OUTPUT,
    OUTPUTS,
    PARAMETERS,
    RATES,
    STATES,
    THETA,
    files,
    model,
    output,
    prior,
    rates,
)
from misuse_values import ARRAY, FLAG, FUNCTION, INT, MAP, NAMES, NONE, NUMBER, PATH, PRIOR, TERM, TEXT

EQUATIONS = (TEXT, TERM, NUMBER, ARRAY, NAMES)
TERM_GIVEN = sympy.Symbol("h") ** 2


@cache
def model_cases() -> dict[str, Case]:
    theta = (THETA, ARRAY, MAP)
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
    return {
        "Model.within": case(lambda limit: model().within(limit), limit=("h < 1.5", TEXT)),
        "Model.rhs": case(model().rhs, x=([1.0], ARRAY, NUMBER), u=([0.1], ARRAY, NUMBER), theta=theta),
        "Model.output": case(model().output, x=([1.0], ARRAY, NUMBER), u=([0.1], ARRAY, NUMBER), theta=theta),
        "Model.limits": case(model().limits, x=([1.0], ARRAY, NUMBER), u=([0.1], ARRAY, NUMBER), theta=theta),
        "Model.theta": case(model().theta, values=theta),
        "Model.estimate": case(lambda name: model().estimate(name), name=("d",)),
        "Model.fix": case(lambda k: model().fix(k=k), k=(0.1, NUMBER)),
        "Model.free_start": case(lambda name: model().free_start(name), name=("h",)),
        "HydraulicCylinder": case(fp.HydraulicCylinder, A_A=(2e-3, NUMBER), k_u=(1.0, NUMBER), smooth=({"v": 1e-3}, MAP, NONE)),
        "SymbolicModel": case(
            fp.SymbolicModel,
            f=(RATES, *EQUATIONS),
            g=(OUTPUT, *EQUATIONS),
            domain=(["h"], NONE, *EQUATIONS),
            resets=({"h < 0": {"h": "0"}}, MAP, NONE, NAMES, ARRAY),
            definitions=({"twice": "2*h"}, MAP, NONE),
            **quantities,
        ),
        "let": case(fp.let, name=("level", TEXT), value=(TERM_GIVEN, TERM, NUMBER, INT, FLAG)),
        "CallableModel": case(
            fp.CallableModel,
            f=(rates, FUNCTION),
            g=(output, FUNCTION),
            domain=({"h": output}, MAP, NONE),
            jumps=({}, MAP, NONE),
            kinks=({}, MAP, NONE),
            **quantities,
        ),
        "model": case(
            lambda function, **given: fp.model(**given)(function),
            function=(lambda x, u, p: ([-p.k * fp.math.sqrt(x.h) + p.a * u.u * p.d], [x.h]),),
            **quantities | {"name": ("tank", TEXT, NONE)},
        ),
        "load_problem": case(fp.load_problem, path=(files() / "problem.toml", TEXT, PATH)),
        "convert": case(
            fp.convert_unit,
            values=(1.0, NUMBER, INT, ARRAY, TERM),
            given=("mm", TEXT),
            wanted=("m", TEXT),
            width=(False, FLAG),
        ),
        "load_model": case(fp.load_model, path=(files() / "model.toml", TEXT, PATH)),
        "Quantity": case(fp.Quantity, name=("h", TEXT), unit=("m", TEXT), description=("level", TEXT), scale=(1.0, NUMBER, NONE)),
        "Noise": case(
            fp.Noise,
            std=(0.1, NUMBER),
            relative=(0.1, NUMBER),
            colored=(fp.GaussMarkov(0.1, 1.0), NONE),
            resolution=(0.1, NUMBER),
        ),
        "Noise limits": case(lambda limits: fp.Noise(0.1, limits=limits), limits=((0.0, 1.0), ARRAY)),
        "GaussMarkov": case(fp.GaussMarkov, std=(0.1, NUMBER), correlation_time=(0.1, NUMBER)),
        "NoiseModel": case(fp.NoiseModel, outputs=({"a": 0.1, "b": 0.2}, MAP), correlation=({("a", "b"): 0.3}, NONE, MAP)),
        "GaussianPrior": case(fp.GaussianPrior, mean=(THETA,), std=std, log=(["k"], NAMES)),
        "GaussianPrior relative": case(fp.GaussianPrior, mean=(THETA,), relative_std=std),
        "GaussianPrior covariance": case(
            fp.GaussianPrior, mean=(THETA,), covariance=([[0.01, 0.001], [0.001, 0.01]], ARRAY), log=((), NAMES)
        ),
        "prior std": case(lambda std: fp.GaussianPrior({"k": 0.1}, std={"k": std}), std=(0.1, NUMBER)),
        "prior relative std": case(lambda std: fp.GaussianPrior({"k": 0.1}, relative_std={"k": std}), std=(0.1, NUMBER)),
        "prior mean": case(lambda mean: fp.GaussianPrior({"k": mean}, std={"k": 0.1}), mean=(0.1, NUMBER)),
        "prior variance": case(
            lambda variance: fp.GaussianPrior({"k": 0.1, "a": 0.1}, covariance=[[variance, 0.0], [0.0, 1.0]]),
            variance=(0.1, NUMBER, FLAG),
        ),
        "prior covariance": case(
            lambda covariance: fp.GaussianPrior({"k": 0.1, "a": 0.1}, covariance=[[1.0, covariance], [covariance, 1.0]]),
            covariance=(0.1, NUMBER, FLAG),
        ),
        "GaussianPrior.marginal": case(prior().marginal, names=(["k"], NAMES)),
        "TensorGrid": case(fp.TensorGrid, levels=(2, INT, NONE, MAP), span=(1.0, NUMBER, NONE)),
        "TensorGrid edges": case(fp.TensorGrid, edges=([-1.0, 0.0, 1.0], ARRAY, NONE, MAP)),
        "GaussHermite": case(fp.GaussHermite, levels=(2, INT, MAP)),
        "SparseGaussHermite": case(fp.SparseGaussHermite, level=(2, INT)),
        "Sobol": case(fp.Sobol, n=(8, INT), seed=(0, INT)),
        **{
            f"Rule.{name}": case(
                lambda prior, name=name: [getattr(rule, name)(prior) for rule in (fp.TensorGrid({"k": 2, "a": 1}), fp.Sobol(8))],
                prior=(prior(), PRIOR),
            )
            for name in ("size", "check", "nodes", "second_moments", "variances")
        },
        "Rule.nodes of others": case(
            lambda prior: [
                rule.nodes(prior)
                for rule in (fp.GaussHermite(2), fp.SparseGaussHermite(1), fp.Unscented(), fp.LinearizedRule(), fp.TensorGrid())
            ],
            prior=(prior(), PRIOR),
        ),
        **{
            f"{name}()": case(lambda x, name=name: getattr(fp.math, name)(x), x=(0.5, NUMBER, TERM))
            for name in ("sqrt", "exp", "sin", "abs", "sign", "heaviside")
        },
        **{
            f"{name}()": case(lambda a, b, name=name: getattr(fp.math, name)(a, b), a=(0.5, NUMBER, TERM), b=(1, NUMBER, TERM))
            for name in ("min", "max", "atan2")
        },
        "latch()": case(
            lambda on, off, start: fp.math.latch(on, off, start),
            on=(sympy.Symbol("T") < 20,),
            off=(sympy.Symbol("T") > 22,),
            start=(0, FLAG, INT),
        ),
        "where()": case(
            lambda condition, a, b: fp.math.where(condition, a, b),
            condition=(sympy.Symbol("x") > 0, FLAG),
            a=(0.5, NUMBER, TERM),
            b=(1.0, NUMBER, TERM),
        ),
    }
