"""Models in TOML files: text in, the same text out; the command line takes any model; a mistake is one line."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

import fisherpoint as fp
from defaults import MODEL
from fisherpoint.design.file.configuration import ConfigError, load_config
from fisherpoint_command import cli

TEXT = """\
[model]
name = "tanks"
domain = ["h_max - h1"]

[model.states]
h1 = "m"
h2 = { unit = "m", scale = 0.1, description = "level of the lower tank" }

[model.inputs]
u = "V"

[model.parameters]
k1 = { nominal = 0.05, unit = "m^0.5/s" }
k2 = "m^0.5/s"
k3 = "m^0.5/s"

[model.constants]
k4 = { value = 0.03, unit = "m/(V s)" }
h_max = { value = 1.0, unit = "m" }

[model.outputs]
h2 = "m"
h1 = { unit = "m", equation = "2*h1" }

[model.equations]
h1 = "-k1 * sqrt( h1 ) + k4*u"
h2 = "k2*h1**0.5 - k3*sqrt(h2)"
"""

DESIGN = """
[prior]
k1 = { mean = 0.05, relative_std = 0.1, unit = "m^0.5/s" }
k2 = { mean = 0.04, relative_std = 0.1 }
k3 = { mean = 0.06, relative_std = 0.1 }

[noise]
h2 = 1e-3
h1 = { std = 1e-3, unit = "m" }

[region]
h1 = [0.1, 0.5]
h2 = { bounds = [0.1, 0.5], unit = "m" }
u = [0.0, 2.0]
dt = [0.5, 3.0]

[design]
n_experiments = 3
n_candidates = 10
max_iterations = 5
"""


def write(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def test_text_in_the_same_text_out(tmp_path: Path) -> None:
    model = fp.load_model(write(tmp_path / "tanks.toml", TEXT))
    assert model.to_toml() == TEXT
    assert model.states[1] == fp.Quantity("h2", "m", "level of the lower tank", scale=0.1)
    assert dict(model.nominal) == {"k1": 0.05} and dict(model.constants) == {"k4": 0.03, "h_max": 1.0}
    assert model.domain == ("h_max - h1", "h1", "h2")
    assert model.output([0.2, 0.3], 0.0, [1.0, 1.0, 1.0]).tolist() == [0.3, 0.4]


def test_models_from_python_come_back_equal(tmp_path: Path) -> None:
    @fp.model(
        states={"x": "1", "θ": "rad"},
        parameters={"k": fp.Quantity("k", "1", 'says "hello"\n\\ twice')},
        constants={"c": (1e-300, "m")},
        outputs={"y": "1", "θ": "rad"},
    )
    def model(x, u, p):  # type: ignore[no-untyped-def]
        condition = (x.x > p.k) & ~(x.θ <= 1) | (x.x < -3)
        f = [
            fp.math.where(condition, fp.math.max(x.x, 0, p.k) / 3, -(fp.math.abs(x.θ) ** 1.5)),
            0.1 * fp.math.sign(x.x) - p.c / (x.θ - x.x),
        ]
        return f, [fp.math.atan2(x.x, x.θ), x.θ], [p.k]

    for one in (model, MODEL, MODEL.symbolic(), MODEL.estimate("T_1", "q_max"), MODEL.fix(p_t=5e5)):
        again = fp.load_model(write(tmp_path / "model.toml", one.to_toml()))
        assert again == one and again.to_toml() == one.to_toml()
        assert (again.jumps, again.kinks, again.domain) == (one.jumps, one.kinks, one.domain)


def test_other_tables_are_left_to_the_command_line(tmp_path: Path) -> None:
    path = write(tmp_path / "run.toml", TEXT + DESIGN)
    assert fp.load_model(path).to_toml() == TEXT
    problem = load_config(path).problem()
    assert problem.model == fp.load_model(path) and problem.region is not None


MISTAKES = {
    "unknown name": ("k4*u", "k5*u", "model.equations.h1: column 20: expected the names h1, h2, u, k1"),
    "a call": ("k4*u", "__import__('os')", "model.equations.h1: column 20: expected the functions"),
    "attribute": ("k4*u", "u.real", "model.equations.h1: column 20: expected names, numbers"),
    "lambda": ("k4*u", "(lambda: 1)()", "model.equations.h1: column 20: expected names, numbers"),
    "power": ("k4*u", "u**1000000", "model.equations.h1: column 20: expected exponents of at most 1000"),
    "brackets": ("k4*u", "(" * 10**5, "model.equations.h1: expected a formula of at most 10000 characters, given 100019"),
    "unit": ('u = "V"', 'u = "volt"', "model.inputs.u: expected a unit such as"),
    "missing": ('h2 = "k2*h1**0.5 - k3*sqrt(h2)"\n', "", "model.equations.h2: expected the rate of h2 as a text, given none"),
    "one too many": ("[model.equations]", '[model.equations]\nh3 = "1"', "model.equations.h3: expected an equation for each of h1"),
    "domain": ("h_max - h1", "h_max -", "model.domain[0]: column"),
    "twice": ('u = "V"', 'h1 = "V"', "model.inputs.h1: expected a name of its own, given one"),
    "keyword": ('u = "V"', 'lambda = "V"', "model.inputs.'lambda': expected a name that is not in use"),
    "unknown key": ("scale = 0.1", "scal = 0.1", "unknown key model.states.h2.scal; expected one of unit, scale, description"),
    "no unit": ('{ unit = "m", scale = 0.1', "{ scale = 0.1", "model.states.h2.unit: missing; expected a value"),
    "no text": ('"k2*h1**0.5 - k3*sqrt(h2)"', "3", "model.equations.h2: expected text in quotes, given 3"),
    "nothing": ("2*h1", "2*k4", "model.outputs.h1: expected an output that depends on something, given 2*k4"),
    "other table": ('equation = "2*h1"', 'nominal = 1.0', "unknown key model.outputs.h1.nominal"),
    "no equations": (TEXT[TEXT.index("[model.equations]") :], "", 'model.name: expected one of hydraulic_cylinder, given "tanks"'),
    "region": ("u = [0.0, 2.0]", "v = [0.0, 2.0]", "unknown key region.v; expected one of h1, h2, u, dt, constraints"),
    "prior": ("k3 = { mean = 0.06, relative_std = 0.1 }", "", "prior.k3: missing"),
}  # fmt: skip


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_one_line(tmp_path: Path, mistake: str, capsys: pytest.CaptureFixture[str]) -> None:
    old, new, expected = MISTAKES[mistake]
    assert old in TEXT + DESIGN
    path = write(tmp_path / "run.toml", (TEXT + DESIGN).replace(old, new, 1))
    with pytest.raises(ConfigError) as caught:
        load_config(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: {expected}") and "\n" not in message
    with pytest.raises(SystemExit) as left:
        cli.main(["design", str(path), "-o", str(tmp_path / "run")])
    assert left.value.code == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_a_file_without_a_model(tmp_path: Path) -> None:
    for text, expected in (("", "model: missing"), ("model = 3", "model: expected a table"), ("[model", "not valid TOML")):
        with pytest.raises(ConfigError, match=expected):
            fp.load_model(write(tmp_path / "model.toml", text))
    with pytest.raises(ConfigError, match="not valid TOML"):
        fp.load_model(write(tmp_path / "model.toml", "x = " + "[" * 100_000))
    with pytest.raises(ConfigError, match="no such file"):
        fp.load_model(tmp_path / "none.toml")


def test_the_command_line_designs_for_any_model(tmp_path: Path) -> None:
    path = write(tmp_path / "run.toml", TEXT + DESIGN)
    with pytest.raises(SystemExit) as left:
        cli.main(["design", str(path), "-o", str(tmp_path / "run"), "--quiet"])
    assert left.value.code == 0
    found = fp.Design.load(tmp_path / "run")
    assert found.problem.model == fp.load_model(path) and found.evaluation.rank == 3
    assert (tmp_path / "run" / "points.png").exists()
    for command in (["evaluate"], ["simulate"]):
        with pytest.raises(SystemExit) as left:
            cli.main([*command, str(path), str(tmp_path / "run" / "design.csv")])
        assert left.value.code == 0


def test_what_is_written_is_toml(tmp_path: Path) -> None:
    table = tomllib.loads(MODEL.to_toml())["model"]
    assert table["name"] == "hydraulic_cylinder" and table["constants"]["p_s"]["value"] == 21e6
