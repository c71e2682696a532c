"""Identifiability, estimates, virtual rigs and validations: with good arguments, and the kinds of clumsy ones."""

from __future__ import annotations

from functools import cache

import fisherpoint as fp
from misuse_case import Case, case, within
from misuse_examples import NOISE, THETA, data, fit, model, points, prior, problem, region, run_data, runs
from misuse_values import ARRAY, FLAG, FUNCTION, INT, MAP, MODEL, NAMES, NONE, NUMBER, PATH, POINTS, PRIOR, TEXT


@cache
def estimate_cases() -> dict[str, Case]:
    of_model = (model(), MODEL)
    of_points = (points(), POINTS)
    theta = (THETA, ARRAY, MAP)
    rtol = (1e-6, NUMBER)
    threads = (1, INT, NONE)
    return {
        "simulate_record": case(
            fp.simulate_record,
            model=of_model,
            theta=theta,
            t=([0.0, 0.1, 0.2], ARRAY),
            u=([0.1, 0.2, 0.3], ARRAY),
            x0=({"h": 1.0}, ARRAY, MAP),
            before=({"u": 0.1}, ARRAY, MAP, NONE),
            rtol=rtol,
        ),
        "VirtualRig": case(
            fp.VirtualRig,
            model=of_model,
            theta=theta,
            noise=(NOISE,),
            initial_state_std=({"h": 0.01}, MAP, NONE),
            seed=(0, INT),
            rtol=rtol,
        ),
        "VirtualRig.measure": case(fp.VirtualRig(model(), THETA, NOISE).measure, points=of_points, repeats=(1, INT)),
        "VirtualRig.measure, runs": case(fp.VirtualRig(model(), THETA, NOISE).measure, points=(runs(), POINTS), repeats=(1, INT)),
        "identifiability": case(
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
        "estimate": case(
            fp.estimate,
            model=of_model,
            data=(data(),),
            prior=(prior(), PRIOR, NONE),
            start=(THETA, MAP, NONE, PRIOR),
            parameters=(None, NONE, NAMES),
            noise=(NOISE, NONE),
            bounds=({"k": (0.0, 1.0)}, MAP, NONE),
            deviations=(fp.Deviations(uncertain={"d": 0.01}, initial_state_std={"h": 0.01}),),
            starts=(1, INT),
            rtol=rtol,
            threads=threads,
            progress=(None, NONE, FLAG, FUNCTION),
        ),
        "Deviations": case(
            fp.Deviations,
            varies=(None, MAP, NONE),
            uncertain=({"d": 0.01}, MAP, NONE),
            initial_state_std=({"h": 0.01}, MAP, NONE),
            shared=((), NAMES),
            local=({"a": "run"}, MAP, NONE),
            rule=(None, NONE),
        ),
        "Local": case(fp.Local, by=("run", TEXT), spread=(0.1, NUMBER, NONE)),
        "estimate, local": case(
            lambda local: fp.estimate(model(), run_data(), noise=NOISE, deviations=fp.Deviations(local=local)),
            local=({"a": fp.Local("run", spread=0.1)}, MAP, NONE),
        ),
        "estimate, runs": case(
            fp.estimate,
            model=of_model,
            data=(run_data(),),
            noise=(NOISE, NONE),
            deviations=(fp.Deviations(uncertain={"d": 0.01}, initial_state_std={"h": 0.01}),),
            rtol=rtol,
        ),
        "validate, runs": case(
            fp.validate,
            designs=({"one": runs()}, POINTS),
            problem=(problem(),),
            noise=(NOISE, NONE),
            runs=(2, INT),
            theta=("mean", MAP),
            threads=threads,
        ),
        "a bound": case(lambda bound: fp.estimate(model(), data(), noise=NOISE, bounds={"k": bound}), bound=((0.0, 1.0), ARRAY)),
        "Fit.intervals": case(lambda level: fit().intervals(level), level=(0.9, NUMBER)),
        "Fit.profile": case(
            lambda name, level, threads, progress: fit().profile(name, level=level, threads=threads, progress=progress),
            threads=threads,
            name=("k", TEXT),
            level=(0.9, NUMBER),
            progress=(None, NONE, FLAG, FUNCTION),
        ),
        "Fit.stability": case(lambda parts: fit().stability(parts), parts=(2, NONE, INT)),
        "Fit.save": case(
            lambda directory: fit().save(within(directory)),
            directory=("fit", TEXT, PATH),
        ),
        "validate, local": case(
            lambda truth: fp.validate(problem().replace(parameters=["k"], local={"a": "plant"}), points(), runs=2, truth=truth),
            truth=({"a": fp.Local("plant", spread=0.1)}, MAP, NONE, MODEL),
        ),
        "validate": case(
            fp.validate,
            designs=({"one": points()}, POINTS),
            problem=(problem(),),
            noise=(NOISE, NONE),
            runs=(2, INT),
            theta=("mean", MAP),
            seed=(0, INT),
            truth=(None, NONE, MODEL, MAP),
            noise_known=(True, FLAG),
            use_prior=(True, FLAG),
            threads=threads,
        ),
    }
