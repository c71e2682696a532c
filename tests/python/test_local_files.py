"""Local parameters in TOML files, tables of data and commands."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import fisherpoint as fp
from fisherpoint.design.file.configuration import ConfigError, load_config
from fisherpoint.points.run_files import runs_csv
from fisherpoint_command.cli import app, main
from local_cases import NOISE, START, cart, measured

FILE = """
[model]
name = "cart"
states = { v = "m/s" }
inputs = { F = "N" }
parameters = { d = "N s/m", c = "N", m_load = "kg" }
outputs = { y = "m/s" }

[model.equations]
v = "(F - d*v - c*tanh(v/0.05))/(2.0 + m_load)"
y = "v"

[prior]
d = { mean = 1.0, std = 0.8 }
c = { mean = 0.3, std = 0.3 }
m_load = { mean = 2.0, std = 1.5 }

[noise]
y = 0.01

[region]
v = 0.0
F = [1, 6]
dt = 0.2

[runs]
segments = 6
n_starts = 1
"""


def written(tmp_path: Path, local: str, more: str = "") -> Path:
    path = tmp_path / "cart.toml"
    path.write_text(f"{FILE}\n[local]\n{local}\n{more}")
    return path


def run(*arguments: object) -> str:
    found = CliRunner().invoke(app, [*map(str, arguments)])
    assert found.exit_code == 0, found.output
    return found.output


def code(*arguments: object) -> int:
    with pytest.raises(SystemExit) as left:
        main([str(argument) for argument in arguments])
    return int(left.value.code or 0)


@pytest.mark.parametrize(
    ("local", "expected"),
    [
        ('m_load = "run"', fp.Local("run")),
        ('m_load = { by = "plant", spread = 300, unit = "g" }', fp.Local("plant", spread=0.3)),
        ('m_load = { by = "day", spread = "estimated" }', fp.Local("day", spread="estimated")),
    ],
)
def test_the_table_says_whose_a_parameter_is(local: str, expected: fp.Local, tmp_path: Path) -> None:
    problem = load_config(written(tmp_path, local)).problem()
    assert problem.local == {"m_load": expected} and problem.estimated == ("d", "c")
    assert problem.deviations.local == {"m_load": expected}


@pytest.mark.parametrize(
    ("local", "more", "message"),
    [
        ('mass = "run"', "", "unknown key local.mass; expected one of d, c, m_load"),
        ("m_load = 3", "", 'local.m_load: expected a word such as "run" or "plant"'),
        ("m_load = { spread = 0.1 }", "", "local.m_load.by: missing"),
        ('m_load = { by = "run", spread = -1 }', "", "local.m_load.spread"),
        (
            'm_load = "run"',
            "[varies]\nm_load = 0.1\n",
            r"local.m_load: expected a name that is not in \[varies\]",
        ),
        (
            'm_load = "run"',
            '[design]\nparameters = ["d", "m_load"]\n',
            "m_load: expected a parameter that is not among design.par",
        ),
        ('m_load = "run"\nd = "run"\nc = "run"', "", "local: expected a parameter that is not local, given all of d, c, m_load"),
    ],
)
def test_mistakes_in_the_table_are_named(local: str, more: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=message):
        load_config(written(tmp_path, local, more))


def test_commands_take_it(tmp_path: Path) -> None:
    file = written(tmp_path, 'm_load = { by = "rig", spread = 0.8 }')
    data = measured(6, each=2, labels={"rig": ["A", "A", "B", "B", "C", "C"]})
    data.to_csv(tmp_path / "data.csv", cart())
    run("estimate", file, tmp_path / "data.csv", "-o", tmp_path / "fit", "--no-prior", "--quiet")
    found = json.loads((tmp_path / "fit" / "fit.json").read_text())
    fit = fp.estimate(
        cart(), data, start=START, noise={"y": NOISE}, deviations=fp.Deviations(local={"m_load": fp.Local("rig", spread=0.8)})
    )
    assert [one["group"] for one in found["local"]] == ["A", "B", "C"]
    assert [one["estimate"] for one in found["local"]] == pytest.approx([one.estimate for one in fit.local["m_load"].values()])
    assert "m_load of each rig, kg" in (tmp_path / "fit" / "report.txt").read_text()
    assert (tmp_path / "fit" / "local.csv").exists() and (tmp_path / "fit" / "report.html").exists()
    design = written(tmp_path, 'm_load = "run"')
    assert "No mistake found" in run("design", design, "--check")
    run("design", design, "-o", tmp_path / "design", "--quiet")
    assert "m_load of each run" in (tmp_path / "design" / "report.txt").read_text()
    assert "c " in run("evaluate", design, tmp_path / "design" / "design.csv")


def test_columns_with_labels_are_read(tmp_path: Path) -> None:
    points = fp.Experiments([[0.1], [0.2], [0.3]], [[1.0], [2.0], [3.0]], [0.2, 0.3, 0.4])
    data = fp.Measurements(points, [0.1, 0.2, 0.3], labels={"plant": ["A", "B", "B"], "day": [1, 1, 2]})
    data.to_csv(tmp_path / "points.csv", cart())
    again = fp.Measurements.from_csv(tmp_path / "points.csv", cart())
    assert again == data and again.labels["day"] == ("1", "1", "2")
    assert data[1:].labels == {"plant": ("B", "B"), "day": ("1", "2")}
    assert fp.Measurements.join([data, data]).labels["plant"] == ("A", "B", "B") * 2
    frame = {"Rig": ["A", "B"], "v": [0.1, 0.2], "F": [1.0, 2.0], "dt": [0.2, 0.3], "y_y": [0.1, 0.2]}
    named = {"rig": "Rig", "v": "v", "F": "F", "dt": "dt", "y": "y_y"}
    assert fp.Measurements.from_table(frame, cart(), columns=named, labels=["rig"]).labels == {"rig": ("A", "B")}

    runs = measured(2, 3, labels={"plant": ["A", "B"]})
    runs.to_csv(tmp_path / "runs.csv", cart())
    assert fp.Measurements.from_csv(tmp_path / "runs.csv", cart()) == runs
    text = (tmp_path / "runs.csv").read_text().replace(",A\r\n", ",\r\n").replace(",\r\n", ",A\r\n", 1)
    (tmp_path / "first.csv").write_text(text)
    assert fp.Measurements.from_csv(tmp_path / "first.csv", cart()).labels == runs.labels  # of a run, the first row is enough
    (tmp_path / "other.csv").write_text((tmp_path / "runs.csv").read_text().replace(",B", ",C", 1))
    with pytest.raises(ValueError, match="row 5, column plant: expected the label above it, given 'B'"):
        fp.Measurements.from_csv(tmp_path / "other.csv", cart())

    record = fp.Record([0.0, 0.2, 0.4], [1.0, 2.0, 3.0], [0.0, 0.1, 0.2], labels={"plant": "A"})
    record.to_csv(tmp_path / "record.csv", cart())
    assert fp.Record.from_csv(tmp_path / "record.csv", cart()).labels == {"plant": "A"} and record[1:].labels == {"plant": "A"}


@pytest.mark.parametrize("labels", [["v"], ["y"], ["status"], ["run"]])
def test_labels_have_names_of_their_own(labels: list[str], tmp_path: Path) -> None:
    measured(2, 3).to_csv(tmp_path / "runs.csv", cart())
    with pytest.raises(ValueError, match="labels: expected names that no quantity of the model has, given"):
        fp.Measurements.from_csv(tmp_path / "runs.csv", cart(), labels=labels)
    with pytest.raises(ValueError, match=r"labels\['plant'\]: expected 2 labels, one for each point or run; given 1"):
        fp.Measurements(measured(2, 3).points, np.zeros((2, 3)), labels={"plant": ("A",)})


def test_validate_reads_labels_and_spreads(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, data = written(tmp_path, 'm_load = { by = "rig", spread = 0.8 }'), measured(4, 8)
    one, several = tmp_path / "one.csv", tmp_path / "several.csv"
    data.runs.to_csv(one, cart())
    fleet = fp.Measurements(data.points, data.y, labels={"rig": ["A", "A", "B", "C"]})
    lines = fleet_plan(fleet).splitlines()
    several.write_text("\n".join(lines) + "\n")
    common = ("-n", "20", "--no-plots", "--quiet", "--force")
    assert code("validate", file, one, several, *common, "-o", tmp_path / "out", "--spread", "m_load=0.2") == 0
    text = (tmp_path / "out" / "report.txt").read_text()
    assert "m_load: all 3 values together" in text and "m_load of each rig, with a spread of 0.2" in text
    table = (tmp_path / "out" / "validation.csv").read_text()
    assert table.count(",m_load,") == 2 and table.count(",local\n") == 2
    for wrong in ("mass=1", "m_load", "m_load=x", "m_load=-1"):
        assert code("validate", file, one, *common, "-o", tmp_path / "out", "--spread", wrong) == 2
        assert capsys.readouterr().err.count("\n") == 1
    several.write_text("\n".join([lines[0], *(line.replace(",A", ",") for line in lines[1:])]) + "\n")
    assert code("validate", file, several, *common, "-o", tmp_path / "out") == 2
    assert "rig" in capsys.readouterr().err


def fleet_plan(data: fp.Measurements) -> str:
    """The runs of several rigs as a plan, with the label in each run's first row alone."""
    return runs_csv(data.runs, cart(), labels=data.labels)


def test_campaign_reads_days(tmp_path: Path) -> None:
    file = written(tmp_path, 'm_load = "day"', "[campaign]\nbatch = 1\ntargets = 0.1\n\n[design]\nn_candidates = 8\n")
    rig = fp.VirtualRig(cart(), START, {"y": NOISE}, seed=1)
    for k, day in enumerate(["Mon", "Mon", "Tue"], 1):
        assert code("campaign", file, "-o", tmp_path / "run", "--no-plots", "--quiet") == 0
        data = rig.measure(fp.Runs.from_csv(tmp_path / "run" / f"batch_{k}.csv", cart()))
        fp.Measurements(data.points, data.y, labels={"day": day}).to_csv(tmp_path / "data.csv", cart())
        given = ("campaign", file, "-o", tmp_path / "run", "--data", tmp_path / "data.csv", "--no-plots", "--quiet")
        assert code(*given) == 0
    report = (tmp_path / "run" / "report.txt").read_text()
    assert "m_load[Mon]" in report and "m_load[Tue]" in report and "m_load of each day" in report
    assert tuple((fp.Campaign.load(tmp_path / "run").fit or fp).local["m_load"]) == ("Mon", "Tue")


FLEET = """
[fleet]
plants = ["north", "south"]
starts = 1
rounds = 1

[design]
n_candidates = 5
"""


@pytest.mark.long
def test_design_of_a_fleet(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = FILE.replace("n_starts = 1\n", "")
    file = tmp_path / "fleet.toml"
    file.write_text(f'{text}\n[local]\nm_load = "plant"\n{FLEET}')
    assert code("design", file, "--check") == 0
    assert "plants" in (out := capsys.readouterr().out) and "2: north, south" in out and "1 run each" in out
    assert code("design", file, "-o", tmp_path / "run", "--quiet") == 0
    names = {"design.csv", "plan.csv", "design.json", "report.txt", "report.html"}
    assert {path.name for path in (tmp_path / "run").iterdir()} == names | {"plants.png", "standard_errors.png", "correlation.png"}
    fleet = fp.FleetDesign.load(tmp_path / "run")
    assert list(fleet.points) == ["north", "south"] and fleet.settings.rounds == 1 and fleet.settings.n_candidates == 5
    assert "Runs of plant south" in (tmp_path / "run" / "report.html").read_text()
    assert code("validate", file, tmp_path / "run" / "design.csv", "-n", 20, "-o", tmp_path / "v", "--no-plots", "--quiet") == 0
    assert "m_load: all 2 values together" in (tmp_path / "v" / "report.txt").read_text()
    assert code("design", file, "-o", tmp_path / "run", "--quiet", "--force", "-L", 2, "--seed", 3, "--starts", 1) == 0
    again = fp.FleetDesign.load(tmp_path / "run")
    assert again.settings.size == 2 and again.settings.seed == 3 and {len(one) for one in again.points.values()} == {2}


OF_PLANT = '[local]\nm_load = "plant"\n[fleet]\n'


@pytest.mark.parametrize(
    ("more", "options", "message"),
    [
        (OF_PLANT + "plants = 0\n", (), "fleet.plants: expected"),
        (OF_PLANT + "plants = []\n", (), "fleet.plants: expected"),
        (OF_PLANT + "plants = 2.5\n", (), "fleet.plants: expected"),
        (OF_PLANT + 'plants = ["A", "A"]\n', (), "fleet.plants: expected at least one label, and each once; given A"),
        (OF_PLANT + 'plants = [""]\n', (), "fleet.plants"),
        (OF_PLANT, (), "fleet.plants: missing"),
        (OF_PLANT + "plants = 2\nround = 1\n", (), "unknown key fleet.round; expected one of"),
        (OF_PLANT + "plants = 2\nrounds = 0\n", (), "fleet.rounds: expected"),
        (OF_PLANT + 'plants = 2\nalike = "no"\n', (), "fleet.alike: expected"),
        ('[local]\nm_load = "run"\n[fleet]\nplants = 2\n', (), "local: expected parameters that are local to a plant"),
        ("[fleet]\nplants = 2\n", (), "local: expected parameters that are local to a plant"),
        (OF_PLANT + 'plants = 2\n[design]\nmethod = "paper"\n', (), 'design.method: expected none beside [fleet], given "paper"'),
        (OF_PLANT + "plants = 2\n", ("--workers", "2"), "--workers: expected a file without a table [fleet]"),
        (OF_PLANT + "plants = 2\n", ("--over", "log"), "--over: expected a file without a table [fleet]"),
    ],
)
def test_mistakes_of_a_fleet_are_one_line(
    more: str, options: tuple[str, ...], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "fleet.toml"
    file.write_text(FILE.replace("n_starts = 1\n", "") + "\n" + more)
    assert code("design", file, "-o", tmp_path / "run", "--quiet", *options) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and message in error, error
    assert not (tmp_path / "run").exists()
