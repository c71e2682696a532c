"""The whole machine as a textbook writes it: a hydraulic platform on six legs, compared with an independent implementation.

That, in the folder `shared` beside this repository, has mechanics of its own, about another point and in another frame, by NumPy,
and SciPy's integrator.
"""

from __future__ import annotations

import copy
import importlib.util
import json
import pickle
import re
import subprocess
import sys
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any
from unittest import mock

import numpy as np
import pytest

import fisherpoint as fp
from examples.hexapod import hexapod
from fisherpoint.models.codec import model_from_json, model_to_json
from fisherpoint.models.model_text import LINES, WIDTH

FOLDER = Path(__file__).resolve().parents[3] / "shared" / "hexapod"

pytestmark = pytest.mark.skipif(not FOLDER.is_dir(), reason="the independent implementation of the platform is not there")

VARIANTS = (9, 54, 64)


@cache
def numbers() -> ModuleType:
    """Names and numbers of the platform."""
    return _module("hexapod", FOLDER / "hexapod.py")


@cache
def independent(variant: int, friction: str) -> Any:
    """The independent implementation, which reads its variant from the command line."""
    numbers()
    with mock.patch.object(sys, "argv", ["check.py", str(variant), friction]):
        found: Any = _module(f"hexapod_check_{variant}_{friction}", FOLDER / "check.py")
    solve = found.solve_ivp
    found.solve_ivp = lambda *given, **options: solve(*given, **options | {"rtol": 1e-13, "atol": 0.01 * options["atol"]})
    return found


def _module(name: str, path: Path) -> ModuleType:
    found = importlib.util.spec_from_file_location(name, path)
    assert found is not None and found.loader is not None
    module = sys.modules[name] = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    return module


@cache
def model(variant: int = 9, friction: str = "coulomb", names: bool = True) -> Any:
    return hexapod(variant, friction, names)


def drawn(count: int, seed: int = 1) -> tuple[Any, Any, Any]:
    box = numbers().region()
    low, high = (np.array([box[k][j] for k in box], float) for j in (0, 1))
    draws = low + (high - low) * np.random.default_rng(seed).random((count, len(low)))
    return draws[:, :30], draws[:, 30:36], draws[:, 36]


@pytest.mark.long
@pytest.mark.parametrize("friction", ["coulomb", "tanh"])
@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("names", [True, False])
def test_rates_and_outputs_are_those_of_the_independent_implementation(variant: int, friction: str, names: bool) -> None:
    x, u, _ = drawn(50)
    theta, other = numbers().nominal(variant), independent(variant, friction)
    of = model(variant, friction, names)
    expected = np.array([other.rhs(a, b, other.values(theta)) for a, b in zip(x, u, strict=True)])
    assert np.max(np.abs(of.rhs(x, u, theta) - expected) / np.max(np.abs(expected), axis=0)) < 1e-9
    expected = np.array([other.output(a) for a in x])
    assert np.max(np.abs(of.output(x, u, theta) - expected) / np.max(np.abs(expected), axis=0)) < 1e-9


@pytest.mark.filterwarnings("ignore:.*natural size:RuntimeWarning")
@pytest.mark.parametrize(("variant", "friction"), [(64, "tanh"), (9, "coulomb")])
def test_outputs_and_sensitivities_are_those_of_the_independent_implementation(variant: int, friction: str) -> None:
    x, u, dt = drawn(60)
    hx, other, of = numbers(), independent(variant, friction), model(variant, friction)
    theta = hx.nominal(variant)
    found = fp.simulate(of, fp.Experiments(x, u, dt), theta, rtol=1e-12, threads=1)
    good = next(k for k in np.flatnonzero(found.status == fp.Status.ok) if other.trajectory(x[k], u[k], dt[k], theta)[2])
    scale = np.repeat([0.5, 1e7, 1e7, 1.0], 6)
    y = other.trajectory(x[good], u[good], dt[good], theta)[1]
    assert np.max(np.abs(found.y[good] - y) / scale) < 1e-9
    point = fp.Experiments(x[good : good + 1], u[good : good + 1], dt[good : good + 1])
    slopes = fp.sensitivities(of, point, theta, rtol=1e-12, threads=1).dy_dtheta[0]
    for name in list(theta)[:: max(1, len(theta) // 5)]:
        step = 1e-2 * hx.std(variant)[name]
        at = [other.trajectory(x[good], u[good], dt[good], theta | {name: theta[name] + k * step})[1] for k in (1, -1, 2, -2)]
        expected = (8 * (at[0] - at[1]) - (at[2] - at[3])) / (12 * step) / scale
        own = slopes[:, list(theta).index(name)] / scale
        assert np.max(np.abs(own - expected)) < 1e-6 * max(np.max(np.abs(expected)), 1e-3 / hx.std(variant)[name]), name


@pytest.mark.parametrize("variant", [9, 64])
def test_it_prints_on_a_page_with_its_names(variant: int) -> None:
    lines = str(model(variant)).splitlines()
    assert len(lines) <= LINES and max(map(len, lines)) <= WIDTH
    assert sorted(model(variant).jumps) == [f"rate_{i}" for i in range(1, 7)]
    assert {"length_1", "rate_6", "pull_3", "moment_x", "dw_z"} <= model(variant).definitions.keys()
    assert lines[-1] == "all of it: print(model.to_toml())"


@pytest.mark.long
@pytest.mark.parametrize("names", [True, False])
def test_it_is_the_same_when_saved_and_loaded_copied_and_pickled(names: bool, tmp_path: Path) -> None:
    given = model(9, "coulomb", names)
    (tmp_path / "model.toml").write_text(given.to_toml())
    again = fp.load_model(tmp_path / "model.toml")
    assert max(map(len, (tmp_path / "model.toml").read_text().splitlines())) < 2500
    for other in (again, pickle.loads(pickle.dumps(given)), copy.deepcopy(given)):
        assert other == given and hash(other) == hash(given)
        assert other.structure.programs == given.structure.programs
        assert other.texts == given.texts
        assert (other.domain, other.jumps) == (given.domain, given.jumps)
    assert again.within("z < 3").estimate("g").fix(g=9.81).definitions == given.definitions
    x, u, _ = drawn(3)
    np.save(tmp_path / "x.npy", np.hstack([x, u]))
    (tmp_path / "pickled").write_bytes(pickle.dumps(given))
    code = (
        "import numpy as np, pickle, sys\n"
        "model, points = pickle.load(open(sys.argv[1], 'rb')), np.load(sys.argv[2])\n"
        "print(model.rhs(points[:, :30], points[:, 30:], list(map(float, sys.argv[3:]))).tobytes().hex())\n"
    )
    theta = list(numbers().nominal(9).values())
    command = [sys.executable, "-c", code, str(tmp_path / "pickled"), str(tmp_path / "x.npy"), *map(repr, theta)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == given.rhs(x, u, theta).tobytes().hex()


def test_files_of_results_hold_it() -> None:
    data = json.loads(json.dumps(model_to_json(model(64, "tanh"))))
    assert model_from_json(data) == model(64, "tanh")


def test_conditions_are_shown_without_names_that_the_model_has_made() -> None:
    given = model(54, "tanh")
    shown = {"cos(pitch)", "p_A6 - p_t_6", "A_A*(length_1 - 1) + V_0A_1"}
    assert shown <= set(given.domain) and re.search(r"\bd[0-9]", " ".join(given.texts.rates))
    own = [text for text in given.domain if re.search(r"\bd[0-9]", text)]
    assert len(own) == 6 and all(text.count("**2") == 3 for text in own)  # squares of lengths, which would be a line each
