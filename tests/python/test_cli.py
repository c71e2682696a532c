"""The command line: what it prints and writes, its exit codes, one line where it fails."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np
import pandas as pd
import pytest

import fisherpoint as fp
from fisherpoint.design.points.exchange import designs
from fisherpoint_command import cli

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


class Result:
    """What a command left behind."""

    def __init__(self, code: int, out: str, err: str) -> None:
        self.code, self.out, self.err = code, out, err


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Any:
    """Run a command in this process."""

    def call(*arguments: object) -> Result:
        capsys.readouterr()
        with pytest.raises(SystemExit) as caught:
            cli.main([str(argument) for argument in arguments])
        captured = capsys.readouterr()
        return Result(int(caught.value.code or 0), captured.out, captured.err)

    return call


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """The paper's example with settings that take a second."""
    text = (EXAMPLES / "paper.toml").read_text()
    for old, new in (
        ("levels = 3", "levels = 2"),
        ("n_candidates = 50", "n_candidates = 5"),
        ("max_iterations = 200", "max_iterations = 4"),
    ):
        assert old in text
        text = text.replace(old, new)
    path = tmp_path / "quick.toml"
    path.write_text(text)
    return path


PICTURES = {"criterion.png", "points.png", "standard_errors.png", "correlation.png", "trajectories.png"}


def names(directory: Path) -> set[str]:
    return {path.name for path in directory.iterdir()}


@pytest.mark.parametrize(
    "command", ["design", "evaluate", "compare", "simulate", "estimate", "validate", "campaign", "open", "info"]
)
def test_help_has_an_example(run: Any, command: str) -> None:
    result = run(command, "--help")
    assert result.code == 0
    assert f"Example: fisherpoint {command}" in result.out


@pytest.mark.parametrize("name", [name for name, _, _ in cli.COMMANDS])
def test_help_shows_every_word(name: str, run: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Words in brackets too, which markup would take for its own."""
    monkeypatch.setenv("COLUMNS", "400")
    shown = " ".join(run(name, "-h").out.split())
    assert shown == " ".join(run(name, "--help").out.split())
    function = dict((name, function) for name, function, _ in cli.COMMANDS)[name]
    assert " ".join((function.__doc__ or "").split()) in shown
    for hint in get_type_hints(function, include_extras=True).values():
        for option in getattr(hint, "__metadata__", ()):
            assert option.help.replace("\\[", "[") in shown
            assert not re.search(r"(?<!\\)\[", option.help)


def test_help_without_a_command_version_and_info(run: Any) -> None:
    assert "design" in run().out
    assert run("--version").out == f"fisherpoint {fp.__version__}\n"
    result = run("info")
    assert result.code == 0
    assert fp.instruction_set() in result.out
    assert fp.__version__ in result.out


def test_design_prints_and_writes_its_result(run: Any, file: Path, tmp_path: Path) -> None:
    result = run("design", file, "-o", tmp_path / "run")
    assert (result.code, result.err) == (0, "")
    assert names(tmp_path / "run") == {"design.csv", "design.json", "report.txt", "report.html"} | PICTURES
    report = (tmp_path / "run" / "report.txt").read_text(encoding="utf-8")
    assert result.out.startswith(report)
    assert "\x1b" not in result.out
    assert max(map(len, report.splitlines())) <= 100
    assert len(fp.Design.load(tmp_path / "run").points) == 12


def test_options_override_the_file(run: Any, file: Path, tmp_path: Path) -> None:
    options = ["--no-plots", "--quiet", "--seed", 3, "--max-iterations", 2, "--method", "auto"]
    for threads in (1, 2):
        result = run("design", file, "-o", tmp_path / str(threads), "--threads", threads, *options)
        assert (result.code, result.out, result.err) == (0, "", "")
        assert names(tmp_path / str(threads)) == {"design.csv", "design.json", "report.txt", "report.html"}
    assert (tmp_path / "1" / "design.csv").read_bytes() == (tmp_path / "2" / "design.csv").read_bytes()
    settings = fp.Design.load(tmp_path / "1").settings
    assert (settings.seed, settings.max_iterations, settings.method.name) == (3, 2, "auto")


def test_a_design_over_the_prior(run: Any, file: Path, tmp_path: Path) -> None:
    options = ["--no-plots", "--max-iterations", 2, "--over", "worst"]
    result = run("design", EXAMPLES / "michaelis_menten.toml", "-o", tmp_path / "run", *options)
    assert (result.code, result.err) == (0, "") and "the smallest log det F over 8 scenarios" in result.out
    design = fp.Design.load(tmp_path / "run")
    assert design.settings.goal.over == fp.OverPrior("worst") and design.scenarios is not None
    refused = run("design", file, "-o", tmp_path / "none", "--over", "log")
    assert refused.code == 2 and refused.err.count("\n") == 1 and "over: expected method" in refused.err


def test_an_interrupted_design_is_saved_and_reported(run: Any, file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*arguments: Any, progress: Any, **settings: Any) -> Iterator[fp.Design]:
        def stop(now: fp.Progress) -> None:
            assert progress is True
            if now.step == 2:
                raise KeyboardInterrupt

        return designs(*arguments, progress=stop, **settings)

    monkeypatch.setattr("fisherpoint.design.points.exchange.designs", interrupted)
    result = run("design", file, "-o", tmp_path / "run")
    assert (result.code, result.err) == (130, "")
    assert "interrupted" in result.out
    assert names(tmp_path / "run") == {"design.csv", "design.json", "report.txt", "report.html"}
    assert fp.Design.load(tmp_path / "run").stop_reason == "interrupted"


def test_a_design_that_is_not_compared_any_more_is_saved(
    run: Any, file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ctrl-C may come between two steps, when a design has been found already."""

    def interrupted(*arguments: Any, **settings: Any) -> Iterator[fp.Design]:
        found = designs(*arguments, **settings)
        yield next(found)
        raise KeyboardInterrupt

    monkeypatch.setattr("fisherpoint.design.points.exchange.designs", interrupted)
    result = run("design", file, "-o", tmp_path / "run")
    assert (result.code, result.err) == (130, "")
    assert names(tmp_path / "run") == {"design.csv", "design.json", "report.txt", "report.html"}
    design = fp.Design.load(tmp_path / "run")
    assert design.stop_reason == "interrupted" and design.efficiency is None


def test_the_page_shows_what_was_asked_and_how_to_repeat_it(run: Any, file: Path, tmp_path: Path) -> None:
    directory = tmp_path / "a run"
    result = run("design", file, "-o", directory)
    assert result.out.rstrip().endswith(", report.html")
    page = (directory / "report.html").read_text(encoding="utf-8")
    assert f"<pre>fisherpoint design {file} -o &#x27;{directory}&#x27;</pre>" in page
    assert f"<summary>{file}</summary>" in page and "n_candidates = 5" in page and "Problem and settings" in page
    assert page.count("<figure>") == len(PICTURES) and page.count("<svg") == 1 and ">point 12: " in page

    run("design", file, "-o", directory, "--no-plots", "--quiet", "--force")
    assert names(directory) == {"design.csv", "design.json", "report.txt", "report.html"}
    page = (directory / "report.html").read_text(encoding="utf-8")
    assert "<figure>" not in page and "<svg" not in page and "<img" not in page and "--no-plots" in page


def test_a_page_is_opened_in_the_browser(run: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []
    answer = [True]

    def browser(address: str) -> bool:
        opened.append(address)
        return answer[0]

    monkeypatch.setattr("webbrowser.open", browser)
    result = run("open", tmp_path)
    assert result.code == 2 and opened == []
    assert (
        result.err == f"fisherpoint: DIR: expected a directory with a report.html, as commands write it with -o; given {tmp_path}\n"
    )
    page = tmp_path / "report.html"
    page.write_text("<p>")
    for given in (tmp_path, page):
        assert (run("open", given).code, opened.pop()) == (0, page.as_uri())
    answer[0] = False
    result = run("open", tmp_path)
    assert (result.code, result.err) == (2, f"fisherpoint: open: expected a browser, found none; the page is {page}\n")


def test_interrupted_before_there_is_a_design(run: Any, file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*arguments: Any, **settings: Any) -> Iterator[fp.Design]:
        raise KeyboardInterrupt

    monkeypatch.setattr("fisherpoint.design.points.exchange.designs", interrupted)
    result = run("design", file, "-o", tmp_path / "run")
    assert (result.code, result.out) == (130, "")
    assert result.err == "fisherpoint: interrupted before a design was found; nothing was saved\n"


def test_evaluate(run: Any, file: Path, tmp_path: Path) -> None:
    run("design", file, "-o", tmp_path / "run", "--quiet", "--no-plots")
    points = tmp_path / "run" / "design.csv"
    result = run("evaluate", file, points, "-o", tmp_path / "evaluated")
    assert (result.code, result.err) == (0, "")
    assert "under the sensor noise" in result.out
    assert names(tmp_path / "evaluated") == {"report.txt", "report.html", "parameters.csv"} | PICTURES - {"criterion.png"}
    table = pd.read_csv(tmp_path / "evaluated" / "parameters.csv", index_col="parameter")
    under_noise = fp.Design.load(tmp_path / "run").under_noise
    assert table.standard_error.to_dict() == pytest.approx(dict(under_noise.standard_errors), rel=1e-9)

    two = tmp_path / "two.csv"
    two.write_text("\n".join(points.read_text().splitlines()[:3]) + "\n")
    result = run("evaluate", file, two)
    assert result.code == 0
    assert "singular" in result.out


def test_simulate(run: Any, file: Path, tmp_path: Path) -> None:
    points = tmp_path / "points.csv"
    points.write_text("q,v,p_A,p_B,x_v,u,dt\n0.15,0.1,8e6,8e6,0.5,-0.5,0.002\n0.15,0.001,2e6,18e6,0.5,-0.5,0.005\n")
    result = run("simulate", EXAMPLES / "cylinder.toml", points, "-o", tmp_path / "outputs.csv")
    assert (result.code, result.err) == (0, "")
    assert "met_jump" not in result.out
    assert list(pd.read_csv(tmp_path / "outputs.csv").status) == ["ok", "ok"]

    result = run("simulate", file, points, "-o", tmp_path / "outputs.csv")
    assert result.code == 2 and "expected a file that is not there yet" in result.err
    result = run("simulate", file, points, "-o", tmp_path / "outputs.csv", "--force")  # the paper's, which excludes jumps
    assert (result.code, result.err) == (0, "")
    assert "met_jump" in result.out and "jumps='exclude'" in result.out
    table = pd.read_csv(tmp_path / "outputs.csv")
    assert list(table.columns)[7:] == ["y_q", "y_p_A", "y_p_B", "y_x_v", "status"]
    assert list(table.status) == ["ok", "met_jump"]
    assert table.y_q[0] > 0.15
    data = fp.Measurements.from_table(tmp_path / "outputs.csv", fp.HydraulicCylinder())
    assert data.y[0].tolist() == pytest.approx(table.iloc[0, 7:11].tolist(), rel=1e-15) and np.isnan(data.y[1]).all()


def test_misuse_exits_2_with_one_line(run: Any, file: Path, tmp_path: Path) -> None:
    csv = tmp_path / "points.csv"
    csv.write_text("a,b\n1,2\n")
    wrong = tmp_path / "wrong.toml"
    wrong.write_text(file.read_text().replace("[0.03, 0.27]", "[0.3, 0.1]"))
    no_region = tmp_path / "no_region.toml"
    text = file.read_text()
    no_region.write_text(text[: text.index("\n[region]")] + text[text.index("\n[rule]") :])
    for arguments, expected in (
        (["desing"], "design"),
        (["design", "--foo"], "--foo"),
        (["design", file], "--output"),
        (["design", file, "-o", tmp_path / "run", "--threads", 0], "--threads"),
        (["design", tmp_path / "none.toml", "-o", tmp_path / "run"], "none.toml"),
        (["design", wrong, "-o", tmp_path / "run"], "region.q.bounds"),
        (["design", no_region, "-o", tmp_path / "run"], "region: missing"),
        (["design", file, "-o", csv], "--output: expected a directory"),
        (["evaluate", file, tmp_path / "none.csv"], "none.csv"),
        (["evaluate", file, csv], "points.csv"),
        (["simulate", file, csv], "points.csv"),
    ):
        result = run(*arguments)
        assert result.code == 2
        assert result.out == ""
        assert expected in result.err
        assert result.err.count("\n") == 1
        assert result.err.startswith("fisherpoint: ")
    assert not (tmp_path / "run").exists()
