"""Points, runs, regions, data and what is simulated: with good arguments, and the kinds of clumsy ones."""

from __future__ import annotations

from functools import cache

import numpy as np

import fisherpoint as fp
from misuse_case import SETTINGS, Case, case, within
from misuse_examples import BOUNDS, THETA, data, files, model, points, prior, record, region, run_data, runs
from misuse_values import ARRAY, FLAG, FUNCTION, INT, MAP, MODEL, NAMES, NONE, NUMBER, PATH, POINTS, PRIOR, SLICE, TEXT


@cache
def point_cases() -> dict[str, Case]:
    of_model = (model(), MODEL)
    of_points = (points(), POINTS)
    theta = (THETA, ARRAY, MAP)
    return {
        "simulate": case(fp.simulate, model=of_model, points=of_points, theta=theta, method=(None, NONE), **SETTINGS),
        "sensitivities": case(fp.sensitivities, model=of_model, points=of_points, theta=theta, method=(None, NONE), **SETTINGS),
        "predictive_covariance": case(
            fp.predictive_covariance,
            model=of_model,
            points=of_points,
            prior=(prior(), PRIOR),
            rule=(fp.SparseGaussHermite(1),),
            parameters=(None, NONE, NAMES),
            **SETTINGS,
        ),
        "assumed_covariance": case(
            fp.assumed_covariance,
            model=of_model,
            points=of_points,
            theta=theta,
            varies=({"d": 0.1}, MAP, NONE),
            initial_state_std=({"h": 0.01}, MAP, NONE),
            rule=(None, NONE),
            **SETTINGS,
        ),
        "Experiments": case(
            fp.Experiments,
            x0=([[1.0], [2.0]], ARRAY),
            u=([0.1, 0.2], ARRAY),
            dt=([0.1, 0.2], ARRAY),
            columns=(("h", "u"), NONE, NAMES),
        ),
        "Rest": case(
            fp.Rest,
            u=({"u": 0.1}, MAP, NONE),
            states=(["h"], NONE, NAMES),
            hold=(["h"], NAMES),
            outputs=({"h": 0.5}, MAP),
            solve=(["u", "w"], NAMES),
        ),
        "Runs": case(
            lambda **given: fp.simulate(model(), fp.Runs(**given), THETA, threads=1),
            x0=([[1.0], [2.0]], ARRAY),
            u=([[0.1, 0.2, 0.1], [0.3, 0.4, 0.1]], ARRAY),
            dt=([[0.1, 0.2, 0.1], [0.1, 0.1, 0.1]], ARRAY, NUMBER, INT),
            measured=(True, NONE, FLAG),
            rest=(fp.Rest({"u": 0.5}), NONE),
            before=([[0.1], [0.2]], NONE, ARRAY),
            columns=(("h", "u"), NONE, NAMES),
        ),
        "broken_limits": case(fp.broken_limits, model=of_model, points=of_points, theta=theta, method=(None, NONE), **SETTINGS),
        "points[]": case(lambda index: points()[index], index=(0, INT, ARRAY, NAMES, SLICE)),
        "Experiments.join": case(fp.Experiments.join, parts=([points(), points()], POINTS)),
        "Experiments.to_csv": case(
            lambda path, model: points().to_csv(within(path), model),
            path=("out", TEXT, PATH),
            model=(model(), MODEL, NONE),
        ),
        "Experiments.from_csv": case(fp.Experiments.from_csv, path=(files() / "points.csv", TEXT, PATH), model=of_model),
        "RunRegion": case(
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
        "RunRegion by outputs": case(
            fp.RunRegion,
            bounds=({"h": 0.5, "u": (0.1, 1.0), "dt": 0.1}, MAP),
            segments=(9, INT),
            sample_every=({"y": 0.01}, MAP, NUMBER, ARRAY, NONE),
        ),
        "RunRegion()": case(
            fp.RunRegion,
            bounds=({"h": 0.5, "u": (0.1, 1.0), "dt": 0.1}, MAP),
            segments=(9, INT),
            sample_every=(0.01, NUMBER, ARRAY, MAP, NONE),
            profile=({"u": fp.Chirp()}, MAP, NONE),
        ),
        "Ramps": case(fp.Ramps, knots=(5, INT)),
        "Spline": case(fp.Spline, knots=(5, INT)),
        "PRBS": case(fp.PRBS, order=(5, INT), hold=((1, 3), NONE)),
        "Multisine": case(fp.Multisine, harmonics=(3, INT), bandwidth=((1.0, 5.0), NONE), crest=(3.0, NUMBER, NONE)),
        "Chirp": case(fp.Chirp, bandwidth=((1.0, 5.0), NONE), sweep=("linear",)),
        "Given": case(fp.Given, values=([1.0, 2.0], ARRAY), t=([0.0, 1.0], ARRAY, NONE)),
        "Runs.sampled": case(lambda every: runs().sampled(every), every=(0.05, NUMBER, ARRAY)),
        "Runs.sampled by outputs": case(
            lambda every, model: runs().sampled(every, model=model), every=({"y": [0.05, 0.1]}, MAP, NUMBER, ARRAY), model=of_model
        ),
        "Runs()": case(
            fp.Runs,
            x0=([[1.0], [2.0]], ARRAY),
            u=([[0.1, 0.2, 0.3], [0.3, 0.4, 0.5]], ARRAY),
            dt=([0.1, 0.2, 0.1], ARRAY, NUMBER),
            measured=([False, True, True], NONE, FLAG, ARRAY),
            columns=(("h", "u"), NONE, NAMES),
        ),
        "runs[]": case(lambda index: runs()[index], index=(0, INT, ARRAY, NAMES, SLICE)),
        "Runs.of_points": case(fp.Runs.of_points, points=of_points),
        "Runs.join": case(fp.Runs.join, parts=([runs(), runs()],)),
        "Runs.to_csv": case(
            lambda path, model: runs().to_csv(within(path), model),
            path=("out", TEXT, PATH),
            model=(model(), MODEL, NONE),
        ),
        "Runs.from_csv": case(fp.Runs.from_csv, path=(files() / "runs.csv", TEXT, PATH), model=of_model),
        "Measurements": case(
            fp.Measurements, points=of_points, y=([0.1, 0.2, 0.3], ARRAY), labels=({"plant": ["A", "B", "B"]}, MAP, NONE)
        ),
        "data[]": case(lambda index: data()[index], index=(0, INT, ARRAY, NAMES, SLICE)),
        "Measurements.join": case(fp.Measurements.join, parts=([data(), data()],)),
        "Measurements.from_table": case(
            fp.Measurements.from_table,
            table=(files() / "data.csv", TEXT, PATH),
            model=of_model,
            columns=({"h": "h", "u": "u", "dt": "dt", "y": "y_y"}, NONE, MAP),
            labels=(["rig"], NONE, NAMES, TEXT),
        ),
        "Measurements.from_csv": case(fp.Measurements.from_csv, path=(files() / "data.csv", TEXT, PATH), model=of_model),
        "Measurements.to_csv": case(lambda model: data().to_csv(files() / "out.csv", model), model=of_model),
        "Measurements of runs": case(fp.Measurements, points=(runs(), POINTS), y=([[0.1, 0.2, 0.3]] * 3, ARRAY)),
        "run_data[]": case(lambda index: run_data()[index], index=(0, INT, ARRAY, NAMES, SLICE)),
        "Measurements.join, runs": case(fp.Measurements.join, parts=([run_data(), run_data()],)),
        "Measurements.from_table, runs": case(
            fp.Measurements.from_table, table=(files() / "run_data.csv", TEXT, PATH), model=of_model
        ),
        "Record": case(
            fp.Record,
            t=([0.0, 1.0, 2.0], ARRAY),
            u=([0.1, 0.2, 0.3], ARRAY),
            y=([0.1, 0.2, 0.3], ARRAY),
            x0=({"h": 1.0}, MAP, NONE),
            begin=(0.0, NUMBER, NONE),
            labels=({"plant": "A"}, MAP, NONE),
            before=([0.1], NONE, ARRAY),
        ),
        "record[]": case(lambda index: record()[index], index=(slice(0, 2), SLICE)),
        "Record.check": case(record().check, model=of_model),
        "Record.from_table": case(
            fp.Record.from_table,
            table=(files() / "record.csv", TEXT, PATH),
            model=of_model,
            columns=({"t": "t", "u": "u", "y": "y_y", "x0_h": "x0_h"}, NONE, MAP),
            x0=({"h": 1.0}, MAP, NONE),
            labels=(["rig"], NONE, NAMES, TEXT),
        ),
        "Record.from_csv": case(
            fp.Record.from_csv, path=(files() / "record.csv", TEXT, PATH), model=of_model, x0=({"h": 1.0}, MAP, NONE)
        ),
        "Record.from_table, columns": case(
            lambda t: fp.Record.from_table({"t": t, "u": [0.5, 0.1, 0.2], "y": [1.0, 0.9, 0.8]}, model()),
            t=([0.0, 0.5, 1.0], ARRAY),
        ),
        "Record.merged": case(
            fp.Record.merged,
            channels=({"u": ([0.0, 1.0], [0.1, 0.2]), "y": ([0.5, 1.0], [0.9, 0.8])}, MAP),
            model=of_model,
            x0=({"h": 1.0}, MAP, NONE),
        ),
        "channel of Record.merged": case(
            lambda t, y: fp.Record.merged({"u": ([0.0, 1.0], [0.1, 0.2]), "y": (t, y)}, model()),
            t=([0.5, 1.0, 2.0], ARRAY),
            y=([0.9, 0.8, 0.7], ARRAY),
        ),
        "ExperimentRegion": case(fp.ExperimentRegion, bounds=(BOUNDS, MAP), constraints=(["h < 1.5"], ARRAY, NAMES, FUNCTION)),
        "bounds of h": case(lambda pair: fp.ExperimentRegion(BOUNDS | {"h": pair}), pair=((0.5, 2.0), ARRAY)),
        "unit of h": case(lambda unit: fp.ExperimentRegion(BOUNDS | {"h": (0.5, 2.0, unit)}), unit=("m", TEXT)),
        "lower bound of h": case(lambda lower: fp.ExperimentRegion(BOUNDS | {"h": (lower, 2.0)}), lower=(0.5, NUMBER)),
        "ExperimentRegion.check": case(region().check, model=of_model),
        "ExperimentRegion.draw": case(
            region().draw,
            model=of_model,
            count=(2, INT),
            seed=(0, INT),
            decades=(False, FLAG),
        ),
        "ExperimentRegion.satisfied": case(region().satisfied, model=of_model, points=of_points),
        "constraint": case(
            lambda holds: fp.ExperimentRegion(BOUNDS, [lambda columns: holds]).satisfied(model(), points()),
            holds=(np.array([True, True, False]),),
        ),
    }
