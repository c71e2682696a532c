"""Runs on the command line: design, evaluate, simulate, estimate and validate."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

import fisherpoint as fp
from fisherpoint.design.file.configuration import ConfigError, load_config, load_problem
from fisherpoint.design.runs.run_picture_list import PICTURES
from fisherpoint.points.run_coordinates import RunCoordinates
from fisherpoint_command.cli import main

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def run(*arguments: object) -> int:
    with pytest.raises(SystemExit) as left:
        main([str(argument) for argument in arguments])
    return int(left.value.code or 0)


@pytest.fixture(scope="module")
def reactor(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The example with a short search, designed in `run`."""
    directory = tmp_path_factory.mktemp("reactor")
    text = (EXAMPLES / "reactor.toml").read_text() + "n_starts = 2\nlead_in = 1\n\n[design]\nn_candidates = 60\n"
    (directory / "reactor.toml").write_text(text)
    assert run("design", directory / "reactor.toml", "-o", directory / "run", "--quiet") == 0
    return directory


def test_design_writes_what_it_says(reactor: Path) -> None:
    found = {path.name for path in (reactor / "run").iterdir()}
    pictures = {"runs.png", "information.png", "standard_errors.png", "correlation.png"}
    assert found == {"design.csv", "plan.csv", "design.json", "report.txt", "report.html"} | pictures
    page = (reactor / "run" / "report.html").read_text()
    assert "Segments of the runs" in page and page.count("<figure>") == 4 and "lead_in = 1" in page
    design = fp.RunDesign.load(reactor / "run")
    assert design.runs.measured[0].tolist() == [False] + [True] * 7 and design.settings.n_starts == 2
    report = (reactor / "run" / "report.txt").read_text()
    assert "Plants that can run the design" in report and "1 run with 7 samples" in report


def test_other_commands_take_runs(reactor: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, table = reactor / "reactor.toml", reactor / "run" / "design.csv"
    assert run("evaluate", file, table, "-o", reactor / "evaluated") == 0
    assert "Information about 4 parameters" in capsys.readouterr().out
    assert (reactor / "evaluated" / "parameters.csv").read_text().count("\n") == 5
    page = (reactor / "evaluated" / "report.html").read_text()
    assert "Information about 4 parameters" in page and page.count("<figure>") == 4
    assert {path.name for path in (reactor / "evaluated").glob("*.png")} == set(PICTURES)
    assert run("simulate", file, table, "-o", reactor / "outputs.csv") == 0
    rows = (reactor / "outputs.csv").read_text().splitlines()
    assert rows[0] == "run,segment,t,y_A,y_B,y_C,status" and len(rows) == 9 and rows[8].startswith("1,8,1.0,")
    assert run("validate", file, table, "-n", "30", "-o", reactor / "validated", "--no-plots", "--quiet") == 0
    problem = load_problem(file)
    rig = fp.VirtualRig(problem.model, problem.prior.mean, dict(problem.noise or {}))
    rig.measure(fp.Runs.from_csv(table, problem.model)).to_csv(reactor / "measured.csv", problem.model)
    assert run("estimate", file, reactor / "measured.csv", "-o", reactor / "fit", "--no-plots", "--quiet") == 0
    assert "A_1" in (reactor / "fit" / "estimate.csv").read_text()


def test_a_design_of_runs_takes_the_pictures_of_another_with_it(reactor: Path, tmp_path: Path) -> None:
    shutil.copytree(reactor / "run", tmp_path / "run")
    fp.RunDesign.load(reactor / "run").save(tmp_path / "run")
    assert {path.name for path in (tmp_path / "run").iterdir()} == {"design.csv", "plan.csv", "design.json"}


def test_designs_are_compared(reactor: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, table, other = reactor / "reactor.toml", reactor / "run" / "design.csv", reactor / "other" / "design.csv"
    other.parent.mkdir()
    other.write_text("\n".join(table.read_text().splitlines()[:5]) + "\n")  # three samples
    assert run("compare", file, table, other, "-o", reactor / "compared") == 0
    shown = capsys.readouterr().out
    assert "run/design" in shown and "other/design" in shown and "D-efficiency" in shown and "Written to" in shown
    assert {path.name for path in (reactor / "compared").iterdir()} == {
        "comparison.csv",
        "comparison.png",
        "report.txt",
        "report.html",
    }
    assert (reactor / "compared" / "comparison.csv").read_text().count("\n") == 9
    assert run("compare", file, table, "--no-plots") == 0 and "Written" not in capsys.readouterr().out
    assert run("compare", file, table, table) == 2
    assert "DESIGN.csv: expected different files" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["cylinder_runs", "tclab", "battery"])
def test_the_examples_describe_regions_of_runs(name: str) -> None:
    problem = load_problem(EXAMPLES / f"{name}.toml")
    assert isinstance(problem.region, fp.RunRegion)
    assert len(RunCoordinates(problem.region, problem.model)) > 5


@pytest.mark.parametrize(
    ("added", "said"),
    [
        ("segments = 0", "runs.segments"),
        ("segments = 3\nlead_in = 3", "runs.lead_in: expected fewer than all 3 segments"),
        ("segments = 3\nlevels = { T = [100.0] }", "runs.levels.T: expected values within 300 and 700"),
        ("segments = 3\nconstant = ['w']", "runs.constant: "),
        ("segments = 3\nsegment = 3", "unknown key segment|runs.segment"),
        ("lead_in = 1", "runs.segments"),
    ],
)
def test_what_is_wrong_in_a_file_is_told(added: str, said: str, tmp_path: Path) -> None:
    text = (EXAMPLES / "reactor.toml").read_text().replace("segments = 8", added)
    (tmp_path / "wrong.toml").write_text(text)
    with pytest.raises(ConfigError, match=said):
        load_config(tmp_path / "wrong.toml").problem()
