"""Files of outputs that are measured at instants of their own, and mistakes in these."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.basics.toml_mistakes import ConfigError
from fisherpoint.points.run_coordinates import RunCoordinates
from output_clock_cases import CLOCKS, NOISE, held, instants, model, problem, region
from sampling_cases import THETA

# --- Files ---


@pytest.mark.parametrize("every", CLOCKS.values(), ids=CLOCKS)
@pytest.mark.parametrize("shapes", [((0.02,) * 5, (0.013,) * 5), ((0.2,) * 5, (0.13,) * 5)])
def test_files_of_runs_have_periods_or_flags_of_outputs(every: Any, shapes: Any, tmp_path: Path) -> None:
    own, path = model(), tmp_path / "runs.csv"
    sampled = held(own, shapes=shapes).sampled(every, model=own)
    mixed = fp.Runs.join([sampled, held(own, 1), held(own, 2).sampled({"s": [0.011]}, model=own)])
    for runs in (sampled, mixed):
        runs.to_csv(path, own)
        read = fp.Runs.from_csv(path, own)
        assert np.allclose(read.dt, runs.dt, rtol=0, atol=1e-12) and np.array_equal(read.u, runs.u)
        assert np.array_equal(read.readings, runs.readings)
    data = fp.VirtualRig(own, THETA, NOISE["white"]).measure(mixed)
    data.to_csv(path, own)
    assert fp.Measurements.from_csv(path, own) == data
    lines = path.read_text().splitlines()
    own_rows = [line for line in lines[1:] if line.startswith("5,")]
    assert sum(line.endswith(",") for line in own_rows) < len(own_rows)  # empty where not measured


def test_densely_sampled_runs_are_written_by_their_periods(tmp_path: Path) -> None:
    own, path = model(), tmp_path / "runs.csv"
    held(own, shapes=((0.05,) * 10,)).sampled(CLOCKS["multiples"], model=own).to_csv(path, own)
    lines = path.read_text().splitlines()
    assert lines[0] == "run,segment,q,w,u,dt,measured,sample_every_q,sample_every_s" and len(lines) == 11
    assert lines[1].endswith(",1,0.001,0.01") and lines[2].endswith(",1,,")
    path.write_text("run,segment,q,w,u,dt [ms],measured,sample_every_s [ms]\n1,1,0,0,1.5,20,1,5\n1,2,,,-1.5,30,1,\n")
    by_hand = fp.Runs.from_csv(path, own)
    assert np.allclose(instants(by_hand, 0, 1), 0.005 * np.arange(1, 11)) and not by_hand.readings[..., 0].any()


HEAD = "run,segment,q,w,u,dt,measured"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (",measured_q\n1,1,0,0,1,0.02,1,1", "expected the column measured_s beside measured_q, given none"),
        (",measured_q,measured_s\n1,1,0,0,1,0.02,1,1,2", "row 1, column measured_s: expected 1 or 0"),
        (",measured_q,measured_s\n1,1,0,0,1,0.02,1,1,", "row 1, column measured_s: expected 1 or 0"),
        (",measured_q,measured_s\n1,1,0,0,1,0.02,0,1,0", "row 1, column measured_q: expected no 1 where measured is 0"),
        (",sample_every_q,sample_every\n1,1,0,0,1,0.02,1,0.01,0.01", "expected sample_every of all outputs or of each"),
        (",sample_every_q\n1,1,0,0,1,0.02,1,0.03", "row 1, column sample_every_q: expected a period of at most the shortest run"),
        (",sample_every_q\n1,1,0,0,1,0.02,1,-1", "row 1, column sample_every_q: expected a positive period"),
        (",sample_every_v\n1,1,0,0,1,0.02,1,1", "expected the columns"),
    ],
)
def test_mistakes_of_files_are_named(text: str, expected: str, tmp_path: Path) -> None:
    path = tmp_path / "runs.csv"
    path.write_text(HEAD + text + "\n")
    with pytest.raises(ValueError) as error:
        fp.Runs.from_csv(path, model())
    assert expected in str(error.value) and "\n" not in str(error.value)


def test_numbers_of_outputs_that_are_not_measured_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "data.csv"
    path.write_text(HEAD + ",measured_q,measured_s,y_q,y_s\n1,1,0,0,1,0.02,1,1,0,0.1,0.2\n")
    with pytest.raises(ValueError, match="row 1, column y_s: expected no number where measured_s is 0"):
        fp.Measurements.from_csv(path, model())
    with pytest.raises(ValueError, match="model: expected the model, whose outputs are measured at different instants"):
        held(model()).sampled(CLOCKS["others"], model=model()).to_csv(path)


# --- Misuse ---


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"every": {"q": 0.01}}, "model: expected the model whose outputs have instants of their own, given None"),
        ({"every": {"x": 0.01}, "model": model()}, "every: expected names of outputs, q, s; given unknown 'x'"),
        ({"every": {}, "model": model()}, "every: expected at least one output that is measured, given none"),
        ({"every": {"q": 0.2}, "model": model()}, "every['q']: expected a period of at most the shortest run, 0.065 s, given 0.2"),
        ({"every": {"q": "soon"}, "model": model()}, "every['q']: expected a time with its unit, as 5 ms, given 'soon'"),
        ({"every": {"q": "5 kg"}, "model": model()}, "every['q']: expected a unit of time, given 'kg'"),
        ({"every": {"q": "0 ms"}, "model": model()}, "every['q']: expected a positive period in s"),
        ({"every": {"q": [0.02, 0.01]}, "model": model()}, "every['q']: expected a period, or increasing instants above zero"),
        ({"every": {"q": [0.02, 0.2]}, "model": model()}, "every['q']: expected instants within the runs"),
        ({"every": {"q": [0.07, 0.09]}, "model": model()}, "the first up to 0.065 s and the last up to 0.1 s; given 0.07 and 0.09"),
        ({"every": {"q": 0.01}, "model": "joint"}, "model: expected"),
    ],
)
def test_mistakes_of_sampling_are_named(arguments: Any, text: str) -> None:
    with pytest.raises((TypeError, ValueError)) as error:
        held(model()).sampled(**arguments)
    assert text in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("every", "noise", "text"),
    [
        ({"q": 0.01}, NOISE["white"], "sample_every: expected instants of each output that noise has, q, s; given none of 's'"),
        (CLOCKS["others"], {"q": 1e-3}, "sample_every: expected instants of outputs that noise has, q; given some of 's'"),
        ({"q": 0.01, "x": 0.01}, NOISE["white"], "sample_every: expected names of outputs, q, s; given unknown 'x'"),
        ({}, NOISE["white"], "sample_every: expected at least one output that is measured, given none"),
        ({"q": 1.0, "s": 0.01}, NOISE["white"], "sample_every['q']: expected a period of at most the shortest run, 0.1 s, given 1"),
        ({"q": 0, "s": 0.01}, NOISE["white"], "sample_every['q']: expected a positive period in s"),
        ({"q": [0.1, 0.2], "s": 0.01}, NOISE["white"], "sample_every['q']: expected instants within the runs"),
    ],
)
def test_mistakes_of_problems_are_named(every: Any, noise: Any, text: str) -> None:
    with pytest.raises((TypeError, ValueError)) as error:
        problem(model(), noise, region(every))
    assert text in str(error.value) and "\n" not in str(error.value)


def test_flags_of_another_number_of_outputs_are_refused() -> None:
    flags = np.ones((2, 5, 3), dtype=bool)
    flags[0, 0, 0] = False
    runs = held(model())
    with pytest.raises(ValueError, match=r"measured: expected shape \(K, N, 2\), given \(2, 5, 3\)"):
        fp.evaluate(problem(model(), NOISE["white"]), fp.Runs(runs.x0, runs.u, runs.dt, flags))
    with pytest.raises(ValueError, match=r"measured: expected shape \(2, 5\), or \(2, 5, n_y\) by outputs, given \(2, 4, 3\)"):
        fp.Runs(runs.x0, runs.u, runs.dt, flags[:, :4])
    with pytest.raises(ValueError, match="expected NaN where runs are not measured"):
        fp.Measurements(
            runs.sampled(CLOCKS["others"], model=model()),
            np.zeros((2, 50, 2))[:, : runs.sampled(CLOCKS["others"], model=model()).dt.shape[1]],
        )


TOML = """
[model]
name = "joint"
states = { q = "rad", w = "rad/s" }
inputs = { u = "N m" }
outputs = { q = "rad", w = "rad/s" }
parameters = { J = "kg m2", b = "N m s/rad" }
equations = { q = "w", w = "(u - b*w)/J" }

[prior]
J = { mean = 0.05, relative_std = 0.1 }
b = { mean = 0.1, relative_std = 0.1 }

[noise]
q = 0.001
w = 0.01

[region]
q = 0.0
w = 0.0
u = [-2, 2]
dt = 0.02

[runs]
segments = 25
sample_every = { q = 0.002, w = { value = 10, unit = "ms" } }
"""


def test_files_of_problems_have_a_clock_of_each_output(tmp_path: Path) -> None:
    path = tmp_path / "joint.toml"
    path.write_text(TOML)
    found = fp.load_problem(path).run_region
    assert found.sample_every == {"q": pytest.approx(0.002), "w": pytest.approx(0.01)}
    assert RunCoordinates(found, fp.load_problem(path).model).clock is not None
    path.write_text(TOML.replace("q = 0.002", 'q = { value = [5, 20, 500], unit = "ms" }'))
    assert fp.load_problem(path).run_region.sample_every["q"] == pytest.approx((0.005, 0.02, 0.5))
    path.write_text(TOML.replace("sample_every = { q", "sample_every = [0.005, 0.02, 0.5] #"))
    assert fp.load_problem(path).run_region.sample_every == (0.005, 0.02, 0.5)


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        (', w = { value = 10, unit = "ms" }', "", "sample_every: expected instants of each output that noise has, q, w"),
        ("q = 0.002, w", "q = 0.002, x = 0.1, w", "names of outputs, q, w; given unknown 'x'"),
        ("q = 0.002", "q = -1", "runs.sample_every.q.value: expected a number > 0, given -1"),
        ("q = 0.002", 'q = "2 ms"', "runs.sample_every.q: expected a number, a list of numbers, or {value = ..., unit"),
        ("q = 0.002", "q = [0.2, 0.1]", "sample_every.q: expected a period, or increasing instants"),
        ("q = 0.002", "q = []", "sample_every.q: expected a period, or increasing instants"),
        ("sample_every = { q", "sample_every = true #", "runs.sample_every: expected a number, a list of numbers, or {value"),
        ("sample_every = { q", "sample_every = -1 #", "runs.sample_every.value: expected a number > 0, given -1"),
        ("segments = 25", "segments = 25\nsamples = 2", "runs.samples: expected none beside sample_every"),
    ],
)
def test_mistakes_of_files_of_problems_are_named(old: str, new: str, text: str, tmp_path: Path) -> None:
    path = tmp_path / "joint.toml"
    path.write_text(TOML.replace(old, new))
    with pytest.raises(ConfigError) as error:
        fp.load_problem(path)
    assert text in str(error.value), str(error.value)
