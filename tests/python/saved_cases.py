"""A saved result of every kind, and files of it that were damaged and sealed again."""

from __future__ import annotations

import copy
import json
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import fisherpoint as fp
from fisherpoint.basics.files import _sha256

Place = tuple[str | int, ...]


@dataclass(frozen=True)
class Saved:
    """A result, how it is saved in and loaded from a directory, and the file in it that has the content."""

    result: Any
    save: Callable[[Path], object]
    load: Callable[[Path], Any]
    name: str = "saved.json"


def tanks() -> fp.Model:
    """Two tanks in a row, quick to read."""
    return fp.SymbolicModel(
        ["c*u - k1*a", "k1*a - k2*b"],
        ["b", "a"],
        states={"a": "m", "b": "m"},
        inputs={"u": "1"},
        outputs={"y": "m", "z": "m"},
        parameters={"k1": "1", "k2": "1"},
        constants={"c": (1.0, "1")},
        nominal={"k1": 1.0, "k2": 0.8},
        check_units=False,
    )


def problem(**changes: Any) -> fp.DesignProblem:
    prior = fp.GaussianPrior({"k1": 1.0, "k2": 0.8}, relative_std={"k1": 0.2, "k2": 0.3})
    region = fp.ExperimentRegion({"a": (0.5, 2.0), "b": (0.5, 2.0), "u": (0.0, 2.0), "dt": (0.1, 2.0)}, ["a > b / 4"])
    given: dict[str, Any] = {"noise": {"y": 0.01, "z": 0.02}, "rule": fp.GaussHermite(3)} | changes
    return fp.DesignProblem(tanks(), prior, given.pop("region", region), **given)


def of_runs(**changes: Any) -> fp.DesignProblem:
    region = fp.RunRegion({"a": 1.0, "b": (0.5, 1.0), "u": (0.0, 2.0), "dt": 0.2}, segments=4, levels={"u": [0.0, 1.0, 2.0]})
    return problem(region=region, **changes)


OTHER_NOISE = fp.NoiseModel(
    {
        "y": fp.Noise(0.01, relative=0.01, colored=[fp.GaussMarkov(0.01, 1.0), fp.GaussMarkov(0.02, 0.1)]),
        "z": fp.Noise(0.02, resolution=0.001),
    },
    correlation={("y", "z"): 0.5},
)
"""Noise that is not white."""


def saved_cases() -> dict[str, Saved]:
    """By a name each."""
    small: dict[str, Any] = {"n_candidates": 5, "max_iterations": 2}
    one = problem()
    assumed = problem(uncertain={"c": 0.1}, initial_state_std={"a": 0.01}, along=["a >= 0"])
    design = fp.exchange(one, n_experiments=4, **small, method=fp.ExchangeMethod(references=True))
    over = fp.exchange(
        problem(rule=fp.LinearizedRule()), n_experiments=3, goal=fp.Goal(over=fp.OverPrior("log", scenarios=fp.Sobol(4))), **small
    )
    points = design.points
    singular = fp.exchange(problem(noise={"y": 0.01, "z": 1e9}), n_experiments=1, **small)
    rig = fp.VirtualRig(one.model, one.prior.mean, {"y": 0.01, "z": 0.02}, seed=1)
    measured = rig.measure(points)
    runs = fp.design_runs(of_runs(), n_runs=2, n_starts=1, n_candidates=10)
    bounds = {"a": 1.0, "b": (0.5, 1.0), "u": (0.0, 2.0), "dt": 0.2}
    of_signals = problem(
        region=fp.RunRegion(bounds, 8, sample_every={"y": 0.1, "z": 0.4}, profile={"u": fp.Multisine(2, crest=3.0)})
    )
    signals = fp.design_runs(of_signals, n_runs=1, n_starts=1, n_candidates=10)
    u = np.tile([1.0, 1.0, 0.3, 0.3], (1, 10))
    long = fp.VirtualRig(one.model, one.prior.mean, {"y": 0.01, "z": 0.02}).measure(
        fp.Runs(np.array([[1.0, 0.7]]), u, np.full(u.shape, 0.1), np.ones(u.shape, bool))
    )
    t = np.linspace(0.0, 4.0, 41)
    record = fp.Record(t, np.append(u[0], 0.3)[:, None], np.vstack([[0.7, 1.0], long.y[0]]), x0={"a": 1.0, "b": 0.7})

    candidates = one.region.draw(one.model, 8, seed=0)
    pieces = fp.design_pieces(problem(), fp.pieces(record, one.model, length=5), 2)

    def campaign(of: fp.DesignProblem, directory: Path) -> None:
        ours = fp.Campaign(
            of,
            batch=2,
            targets=0.001,
            directory=directory,
        )
        ours.tell(fp.VirtualRig(of.model, of.prior.mean, {"y": 0.01, "z": 0.02}, seed=1).measure(ours.next()))
        ours.next()

    def file(result: Any) -> Saved:
        return Saved(result, lambda to: result.save(to / "saved.json"), lambda at: type(result).load(at / "saved.json"))

    def directory(result: Any, name: str) -> Saved:
        return Saved(result, result.save, type(result).load, name)

    fits = [fp.estimate(one.model, measured, one.prior, noise=one.noise)]
    fits += [fp.estimate(one.model, record, one.prior)]
    fits += [fp.estimate(one.model, fp.VirtualRig(one.model, one.prior.mean, {"y": 0.01, "z": 0.02}).measure(runs.runs))]
    local = fp.Deviations(local={"k2": fp.Local("plant", spread="estimated")})
    several = fp.VirtualRig(one.model, one.prior.mean, {"y": 0.01, "z": 0.02}, seed=1).measure(points, repeats=3)
    several = fp.Measurements(several.points, several.y, labels={"plant": [str(k % 3) for k in range(len(several))]})
    fits += [fp.estimate(one.model, several, one.prior, noise=one.noise, deviations=local)]
    of_plant = problem(local={"k2": fp.Local("plant", spread=0.1)})
    fleet, of_fleet = problem(local={"k2": "plant"}), {"starts": 1, "rounds": 1, "max_iterations": 1, "n_candidates": 5}
    cases = {
        "design": directory(design, "design.json"),
        "design over the prior": directory(over, "design.json"),
        "singular design": directory(singular, "design.json"),
        "design of what is assumed": directory(fp.exchange(assumed, n_experiments=3, **small), "design.json"),
        "design under other noise": directory(fp.exchange(problem(noise=OTHER_NOISE), n_experiments=3, **small), "design.json"),
        "design of a function": directory(
            fp.exchange(one, n_experiments=3, goal=fp.Goal("c", of="k1 / k2"), **small), "design.json"
        ),
        "design of predictions": directory(
            fp.exchange(one, n_experiments=3, goal=fp.Goal("I", of="y", conditions=points[:2]), **small), "design.json"
        ),
        "design of scaled errors": directory(
            fp.exchange(one, n_experiments=3, goal=fp.Goal("A", scale={"k1": 1.0, "k2": 2.0}), **small), "design.json"
        ),
        "robust design": directory(fp.exchange(one, n_experiments=3, goal=fp.Goal(confidence=0.9), **small), "design.json"),
        "fit": directory(fits[0], "fit.json"),
        "fit of a record": directory(fits[1], "fit.json"),
        "fit of runs": directory(fits[2], "fit.json"),
        "fit of local parameters": directory(fits[3], "fit.json"),
        "design beside local parameters": directory(fp.exchange(of_plant, n_experiments=3, **small), "design.json"),
        "fleet": directory(fp.design_fleet(fleet, ["A", "B"], 2, **of_fleet), "design.json"),
        "pieces": file(pieces),
        "runs": Saved(runs, runs.save, fp.RunDesign.load, "design.json"),
        "signals": Saved(signals, signals.save, fp.RunDesign.load, "design.json"),
        "sweep": file(fp.sweep(one, (2, 3), cost=fp.Cost(per_experiment=1.0, per_change={"u": 2.0}), **small)),
        "approximate": file(fp.approximate_design(one, candidates)),
        "approximate over the prior": file(
            fp.approximate_design(one, candidates, goal=fp.Goal(over=fp.OverPrior("log", scenarios=fp.Sobol(4))))
        ),
        "exact": file(fp.exact_design(one, candidates, 3)),
        "comparison": file(fp.compare(one, {"points": design, "other": points}, draws=20)),
        "rules": file(fp.compare_rules(one, points[:2], rules=[fp.GaussHermite(2), fp.TensorGrid(2)])),
        "evaluation": file(design.evaluation),
        "feasibility": file(design.feasibility),
        "validation": file(fp.validate(one, {"design": points}, runs=8)),
        "validation beside local parameters": file(
            fp.validate(of_plant, points, runs=4, truth={"k2": fp.Local("plant", spread=0.2)})
        ),
        "validation of runs": file(fp.validate(of_runs(), {"runs": runs}, runs=4, theta="mean")),
        "identifiability": file(fp.identifiability(one.model)),
        "campaign": Saved(None, lambda to: campaign(one, to), fp.Campaign.load, "campaign.json"),
        "campaign of days": Saved(None, lambda to: campaign(problem(local={"k2": "day"}), to), fp.Campaign.load, "campaign.json"),
        "campaign of runs": Saved(None, lambda to: campaign(of_runs(), to), fp.Campaign.load, "campaign.json"),
    }
    return cases


VALUES: dict[str, Any] = {
    "text": "x",
    "empty text": "",
    "none": None,
    "true": True,
    "zero": 0,
    "negative": -1,
    "fraction": 0.5,
    "huge": 10**30,
    "large": 10**9,
    "nan": float("nan"),
    "infinite": float("inf"),
    "written nan": {"float": "nan"},
    "no number": {"float": "x"},
    "empty list": [],
    "list": [1],
    "lists": [[1.0]],
    "empty mapping": {},
    "mapping": {"x": 1},
    "array": {"array": [1.0], "shape": [1], "dtype": "<f8"},
    "wide array": {"array": ["x"], "shape": [1], "dtype": "<U100000000"},
    "array of objects": {"array": [1.0], "shape": [1], "dtype": "|O"},
    "long array": {"array": [], "shape": [10**12, 0], "dtype": "<f8"},
    "mapping of pairs": {"mapping": [["x", 1]]},
    "kind": {"Figure": {"value": 1.0, "error": 1.0}},
}


def nested(depth: int) -> Any:
    found: Any = 1
    for _ in range(depth):
        found = [found]
    return found


def places(data: Any, most: int = 3, at: Place = ()) -> Iterator[Place]:
    """All places in a file's content; of long lists the first and the last alone."""
    if at:
        yield at
    if isinstance(data, dict):
        for name in data:
            yield from places(data[name], most, (*at, name))
    elif isinstance(data, list):
        chosen = range(len(data)) if len(data) <= most else (0, len(data) - 1)
        for k in chosen:
            yield from places(data[k], most, (*at, k))


def damages(data: Any, place: Place) -> Iterator[tuple[str, Callable[[Any], None]]]:
    """What can be done to a place, by name: functions that do it to a copy of the content."""
    *above, last = place

    def holder(of: Any) -> Any:
        for name in above:
            of = of[name]
        return of

    def put(value: Any) -> Callable[[Any], None]:
        return lambda of: holder(of).__setitem__(last, value)

    def rename(of: Any) -> None:
        there = holder(of)
        there[f"{last}_"] = there.pop(last)

    for name, value in VALUES.items():
        yield name, put(value)
    for depth in (150, 400):
        yield f"nested {depth}", put(nested(depth))
    yield "missing", lambda of: holder(of).__delitem__(last)
    if isinstance(holder(data), dict):
        yield "renamed", rename
        yield "extra", lambda of: holder(of).__setitem__("extra", 1)
    else:
        yield "twice", lambda of: holder(of).insert(last, copy.deepcopy(holder(of)[last]))
    given = holder(data)[last]
    if isinstance(given, str):
        yield "other text", put(f"{given}x")
    elif isinstance(given, int | float) and not isinstance(given, bool):
        yield "other number", put(given * 2 + 1)
    elif isinstance(given, list) and given:
        yield "reversed", lambda of: holder(of)[last].reverse()
        yield "emptied", lambda of: holder(of)[last].clear()


def damaged(data: dict[str, Any], place: Place, name: str) -> str:
    """The text of a file with the damage, under a seal of its own."""
    changed = copy.deepcopy(data)
    dict(damages(data, place))[name](changed)
    return json.dumps(changed | {"sha256": _sha256(changed)})


def use(result: Any, plots: bool = False) -> None:
    """All that shows a result and is cheap; pictures on request."""
    str(result)
    repr(result)
    if hasattr(result, "_repr_html_"):
        result._repr_html_()
    for name in ("report", "to_pandas", "to_dict"):
        if hasattr(result, name):
            getattr(result, name)()
    if plots:
        for plot in result._plots().values() if hasattr(result, "_plots") else ():
            plot()


@dataclass(frozen=True)
class Outcome:
    """What came of a damaged file: "fine", "refused" or "fault", and in which words."""

    kind: str
    words: str = ""


def outcome(case: Saved, directory: Path, plots: bool = False) -> Outcome:
    """Load what is in a directory and show it."""
    try:
        result = case.load(directory)
    except ValueError as error:
        words = str(error)
        ours = words.startswith(str(directory)) and "expected" in words and words.isprintable() and len(words) < 1000
        return Outcome("refused" if ours else "fault", f"words {words[:300]}")
    except Exception as error:
        return Outcome("fault", f"load {_where(error)}")
    try:
        use(result, plots)
    except Exception as error:
        if "functions are not saved" in str(error):  # of the constraints of a region: what needs them says so
            return Outcome("fine")
        return Outcome("fault", f"use {_where(error)}")
    return Outcome("fine")


def _where(error: Exception) -> str:
    frame = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__} {str(error)[:120]!r} at {Path(frame.filename).name}:{frame.lineno}"
