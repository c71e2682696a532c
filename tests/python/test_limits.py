"""What is too large, too deep or too long is refused in words and at once; what is large and sensible works."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

import fisherpoint as fp
from fisherpoint.basics import files
from fisherpoint.basics.checks import MOST_CHARACTERS, check_name
from fisherpoint.basics.quantity import LONGEST_DESCRIPTION, LONGEST_NAME, LONGEST_UNIT

config = pytest.importorskip("fisherpoint.design.file.configuration", reason="needs the extras", exc_type=ImportError)
toml_to_model = pytest.importorskip("fisherpoint.models.toml_to_model", reason="needs the extras", exc_type=ImportError)
toml_reader = pytest.importorskip("fisherpoint.basics.toml_reader")

MODEL = """[model]
name = "decay"
states = { x = "m" }
inputs = { u = "m/s" }
parameters = { k = "1/s" }
outputs = { x = "m" }
equations = { x = "u - k*x" }
"""


PRIOR = "prior.k = { mean = 1.0, std = 0.1 }\n"


@contextmanager
def soon(seconds: float = 10.0) -> Iterator[None]:
    """What takes hours, or for ever, where it is not bounded."""
    started = time.perf_counter()
    yield
    assert time.perf_counter() - started < seconds


def model(rate: str, parameters: int = 60) -> fp.SymbolicModel:
    return fp.SymbolicModel([rate], ["x"], {"x": "1"}, {"u": "1"}, {f"p{k}": "1" for k in range(parameters)})


def nested() -> str:
    """min and max in turns, 40 of them."""
    text = "x"
    for k in range(40):
        text = f"{'min' if k % 2 else 'max'}({text}, p{k})"
    return text


PRODUCT = "*".join(f"(p{2 * k} + p{2 * k + 1})" for k in range(30))
CONDITIONS = [f"u > {k}*p{k % 60}" for k in range(200)]


@pytest.mark.parametrize(
    ("rate", "jumps", "kinks"),
    [
        (f"sign(x - p0)*({PRODUCT} + p1)", 1, 0),
        (f"sign(x - p0)*({PRODUCT})*({PRODUCT} + p1)", 1, 0),
        (nested(), 0, 40),
        (f"where({' and '.join(CONDITIONS)}, p1, p2) - x", 0, 0),
        (f"where({' or '.join(CONDITIONS)}, p1, p2) - x", 0, 0),
    ],
    ids=["product", "products", "nested", "and", "or"],
)
def test_long_equations_are_models(rate: str, jumps: int, kinks: int) -> None:
    with soon():
        made = model(rate)
        y = fp.simulate(made, fp.Experiments([[0.5]], [[1.0]], [0.01]), [1.0 + 0.01 * k for k in range(60)])
    assert len(made.jumps) == jumps and len(made.kinks) == kinks
    assert y.status.shape == (1,)


@pytest.mark.parametrize("word", ["and", "or"])
def test_more_surfaces_than_there_may_be_are_refused_at_once(word: str) -> None:
    conditions = f" {word} ".join(f"x > {k}*p{k % 60}" for k in range(300))
    with soon(), pytest.raises(ValueError, match=r"^f: expected at most 256 switching surfaces, given more"):
        model(f"where({conditions}, 1, p1)")


def test_more_conditions_of_the_domain_than_there_may_be_are_refused_at_once() -> None:
    with soon(), pytest.raises(ValueError, match=r"^domain: expected at most 256 conditions, given 5000$"):
        fp.SymbolicModel(["-k*x"], ["x"], {"x": "1"}, {}, {"k": "1"}, domain=[f"x + {k}" for k in range(5000)])


MANY = "".join(f"key_{k} = 1\n" for k in range(9_000))
TOO_LARGE: dict[str, tuple[str, str]] = {
    "600,000 keys": ("".join(f"k{k}=1\n" for k in range(600_000)) + MODEL, "expected a file of at most 1 MB, given a larger one"),
    "keys below 1 MB": (MANY + MODEL, "unknown key key_0; expected one of model, prior"),
    "140,000 numbers": (MODEL + f"[rule]\nedges = [{'1,' * 140_000}]", "expected at most 20,000 keys and list entries, given 140,"),
    "keys of the model": (MODEL + MANY, "unknown key model.key_0; expected one of name, smooth"),
    "constants": (MODEL + "[model.constants]\n" + MANY.replace("1\n", "true\n"), "model.constants.key_0: expected a number"),
    "lists": ("x = " + "[" * 10_000, "not valid TOML: expected lists and tables inside each other, given them too deep"),
    "tables": ("x = " + "{a = " * 10_000, "not valid TOML: expected lists and tables inside each other, given them too deep"),
    "dots": ("model" + ".a" * 30_000 + " = 1", "expected keys of at most 20 parts, given one of more"),
    "quoted dots": ("model" + " . 'a b' . \"c\"" * 30_000 + " = 1", "expected keys of at most 20 parts"),
    "dots of a table": (f"[model{'.a' * 30_000}]", "expected keys of at most 20 parts"),
    "a long key": (MODEL + "x" * 900_000 + " = 1", "unknown key model.xxx"),
    "a long word": (MODEL + f'description = "{"x" * 900_000}"', "unknown key model.description"),
    "a long value": (MODEL.replace('"decay"', f'["{"x" * 900_000}"]'), 'model.name: expected text in quotes, given ["xxx'),
    "a deep value": (MODEL.replace('"decay"', "[" * 150 + "]" * 150), "model.name: expected text in quotes, given [[[[...]]]]"),
    "a long name": (MODEL.replace("{ x =", "{ " + "x" * 300 + " ="), "model.name: expected at most 200 characters, given 300"),
    "a long unit": (MODEL.replace('"m/s"', f'"{"m" * 300}"'), "model.u.unit: expected at most 100 characters, given 300"),
    "a long description": (
        MODEL.replace('"1/s"', f'{{ unit = "1/s", description = "{"x" * 3000}" }}'),
        "model.k.description: expected at most 2000 characters, given 3,000",
    ),
    "a long number": (MODEL + "x = " + "9" * 10_000, "not valid TOML: Exceeds the limit"),
}  # fmt: skip


@pytest.mark.parametrize("case", TOO_LARGE)
def test_files_that_are_too_large_are_refused_in_few_lines(tmp_path: Path, case: str) -> None:
    text, expected = TOO_LARGE[case]
    path = tmp_path / "run.toml"
    path.write_text(PRIOR + text)
    with soon(), pytest.raises(config.ConfigError) as caught:
        config.load_config(path)
    assert str(caught.value).startswith(f"{path}: {expected}") and 0 < len(caught.value.lines) <= 50
    assert all(line.startswith(f"{path}: ") and len(line) < 500 and line.isprintable() for line in caught.value.lines)


def test_a_text_with_a_model_is_bounded_too() -> None:
    for text, expected in (("x" * 2_000_000, "1,000,000 characters, given 2,000,000"), ("x = " + "[" * 5000, "too deep")):
        with soon(), pytest.raises(config.ConfigError, match=f"^model: .*{expected}"):
            toml_to_model.model_from_toml(text)


def test_a_device_without_end_is_read_to_the_limit() -> None:
    with soon(), pytest.raises(config.ConfigError, match=r"^/dev/zero: expected a file of at most 1 MB, given a larger one$"):
        config.load_config("/dev/zero")


def test_data_that_are_too_large_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    points = tmp_path / "points.csv"
    points.write_text("x,u,dt\n" + "1,1,1\n" * 100)
    decay = toml_to_model.model_from_toml(MODEL)
    assert len(fp.Experiments.from_csv(points, decay)) == 100
    monkeypatch.setattr(files.read_bytes, "__defaults__", (500,))
    with pytest.raises(ValueError, match=r"points.csv: expected a file of at most 0.0005 MB, given a larger one"):
        fp.Experiments.from_csv(points, decay)
    for name, load in (("design", fp.Design.load), ("fit", fp.Fit.load), ("campaign", fp.Campaign.load)):
        (tmp_path / f"{name}.json").write_text(json.dumps({"x": "y" * 500}))
        with pytest.raises(ValueError, match=f"{name}.json: expected a file of at most"):
            load(tmp_path)


@pytest.mark.parametrize(("name", "load"), [("design", fp.Design.load), ("fit", fp.Fit.load), ("campaign", fp.Campaign.load)])
def test_deep_json_is_refused_in_words(tmp_path: Path, name: str, load: Any) -> None:
    for text in ("[" * 100_000, '{"format":' * 100_000, "[" * 100_000 + "]" * 100_000):
        (tmp_path / f"{name}.json").write_text(text)
        with soon(), pytest.raises(ValueError, match=f"{name}.json: expected a whole JSON file"):
            load(tmp_path)


def test_deep_constraints_and_units_are_refused_in_words() -> None:
    for text in (
        "(" * 5000 + "x" + ")" * 5000 + " > 1",
        "-" * 5000 + "x > 1",
        "x" + " + x" * 5000 + " > 1",
        "x**" * 5000 + "x > 1",
    ):
        with soon(), pytest.raises(ValueError, match=r"^constraint .*expected"):
            fp.ExperimentRegion({"x": (0, 1), "u": (0, 1), "dt": (1, 2)}, constraints=[text]).check(
                toml_to_model.model_from_toml(MODEL)
            )
    for unit in ("(" * 90 + "m" + ")" * 9, "sqrt(" * 19, "m^" * 49):
        with soon(), pytest.raises(ValueError, match=r"^states.x: expected a unit such as"):
            fp.SymbolicModel(["-k*x"], ["x"], {"x": unit}, {}, {"k": "1"})


def test_names_units_and_descriptions_have_an_end() -> None:
    longest = fp.Quantity("n" * LONGEST_NAME, "u" * LONGEST_UNIT, "d" * LONGEST_DESCRIPTION)
    for field, label, longer in (
        ("name", "", longest.name),
        ("unit", "n.", longest.unit),
        ("description", "n.", longest.description),
    ):
        with pytest.raises(ValueError, match=f"^{label}{field}: expected at most {len(longer)} characters, given"):
            fp.Quantity(**{"name": "n", "unit": "u", field: longer + longer[0]})
    path = "n" * MOST_CHARACTERS
    assert check_name(path, "columns") == path
    with pytest.raises(ValueError, match=r"^columns: expected names of at most 4096 characters"):
        check_name(path + "n", "columns")
