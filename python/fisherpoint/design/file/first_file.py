"""Files to begin with: the examples, and a commented configuration for a model, with guesses that a search can begin with."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path

import numpy as np

from ...basics.files import read_bytes
from ...basics.toml_reader import read_toml
from ...information.identifiability_domain import default_region
from ...models import Model
from ...models.toml_to_model import load_model
from ...points.region import ExperimentRegion
from ...points.simulate import simulate
from ...points.status import Status

PLACES = (files("fisherpoint") / "examples", Path(__file__).resolve().parents[4] / "examples")
"""Folders of the examples in an installed package, and in the project's own tree."""


def example_texts(ending: str = ".toml") -> Mapping[str, str]:
    """The text of each example's TOML file, or of its measurements with the ending .csv, by its name, in alphabetical order."""
    for place in PLACES:
        if place.is_dir():
            found = {file.name: file for file in place.iterdir() if file.name.endswith(ending)}
            return {name.removesuffix(ending): found[name].read_text(encoding="utf-8") for name in sorted(found)}
    raise ValueError("examples: expected the examples in the package, given an installation without them; reinstall fisherpoint")


RELATIVE_STD = 0.2
"""Relative standard deviation of every parameter."""

NOISE = 0.01
"""Noise of every sensor, as a share of the median output in the region."""

TRIED = 200
"""Number of points of the region whose outputs are looked at."""

DIGITS = 3


def first_file(path: Path, name: str) -> tuple[str, list[str]]:
    """The text of a file, to be called `name`, for the model of another one, and what the user has to set in it.

    Raises
    ------
    ConfigError
        Where there is no model in the file, or one with a mistake.
    """
    model = load_model(path)
    unknown = [q.name for q in model.parameters if q.name not in model.nominal]
    theta = model.theta({q.name: model.nominal.get(q.name, 1.0) for q in model.parameters})
    region, outputs = _region(model, theta)
    text = "\n".join(
        [
            f"# A design problem for {model.name}, to begin with. Below the model stand guesses: put in what you know, then:",
            "#",
            f"#     fisherpoint design {name} --check",
            f"#     fisherpoint design {name} -o run/",
            "",
            _model_text(path, model).strip("\n"),
            "",
            "[prior]                      # what is believed of each parameter before the experiments: std or relative_std",
            *_prior(model),
            "# A parameter that can only be positive may be log-normal: { mean = 2.5, relative_std = 0.3, log = true }",
            "",
            "[noise]                      # standard deviation of each sensor: a data sheet's, or a recording's at rest",
            *(_line(q.name, _rounded(std), q.unit) for q, std in zip(model.outputs, outputs, strict=True)),
            "",
            "[region]                     # where experiments may start, what may be applied, and how long they last",
            *(_bounds(q.name, region.bounds[q.name], q.unit) for q in model.axes),
            '# constraints = ["a + b < 1"]  # relations between states, inputs and dt that every point must satisfy',
            "",
            *(_runs(model, region) if model.states else ()),
            "[design]",
            f"n_experiments = {2 * len(model.parameters)}            # points of the design",
            "seed = 0                     # the same seed gives the same design",
            "",
        ]
    )
    return text, unknown


def _runs(model: Model, region: ExperimentRegion) -> list[str]:
    """What a design of runs needs, as comments."""
    lines = [
        "# [runs]                     # runs instead of points: [region] then bounds their start, and the inputs and dt of",
        "#                            # each segment; one number there, as dt = 0.01, fixes a value",
        "# segments = 20              # of a run, with inputs that are held",
        "# n_runs = 1",
    ]
    if model.inputs:
        held = ", ".join(f"{_key(q.name)} = {_rounded(sum(region.bounds[q.name]) / 2)!r}" for q in model.inputs)
        name = model.inputs[0].name
        change = _rounded(region.bounds[name][1] - region.bounds[name][0])
        lines += [
            f"# slew = {{ {_key(name)} = {change!r} }}  # the most that an input may change from one segment to the next",
            f"# rest = {{ u = {{ {held} }} }}  # runs start where the plant has settled under these inputs",
        ]
    return [*lines, ""]


def _model_text(path: Path, model: Model) -> str:
    """The model as it was written, with its comments, where there is nothing else in the file."""
    given = read_bytes(path).decode("utf-8-sig")
    return given if set(read_toml(path)) == {"model"} else model.to_toml()


def _prior(model: Model) -> list[str]:
    lines = []
    for q in model.parameters:
        mean = model.nominal.get(q.name, 1.0)
        spread = f"relative_std = {RELATIVE_STD}" if mean else "std = 1.0"
        why = "" if q.name in model.nominal else "not known from the model: set it"
        lines.append(f'{_key(q.name)} = {{ mean = {float(mean)!r}, {spread}, unit = "{q.unit}" }}' + (f"  # {why}" if why else ""))
    return lines


def _region(model: Model, theta: np.ndarray) -> tuple[ExperimentRegion, list[float]]:
    """A region in natural sizes, positive where that gives trajectories, and the noise of each output there."""
    both = default_region(model, theta)
    positive = {name: (0.1 * high if low < 0 else low, high) for name, (low, high) in both.bounds.items()}
    for bounds in (positive, dict(both.bounds)):
        region = ExperimentRegion({name: (_rounded(low), _rounded(high)) for name, (low, high) in bounds.items()})
        done = simulate(model, region.draw(model, TRIED), theta)
        ok = done.status == Status.ok
        if ok.mean() > 0.5:
            break
    sizes = np.median(np.abs(done.y[ok]), axis=0) if ok.any() else np.ones(len(model.outputs))
    return region, [float(NOISE * size) if size > 0 else NOISE for size in sizes]


def _bounds(name: str, bounds: tuple[float, float], unit: str) -> str:
    return f'{_key(name)} = {{ bounds = [{bounds[0]!r}, {bounds[1]!r}], unit = "{unit}" }}'


def _line(name: str, value: float, unit: str) -> str:
    return f'{_key(name)} = {{ std = {value!r}, unit = "{unit}" }}'


def _key(name: str) -> str:
    return name if name.isascii() else f'"{name}"'


def _rounded(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")
