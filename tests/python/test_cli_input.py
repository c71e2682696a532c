"""The command line before and around its work: --check, standard input, virtual data, init, completion, warnings."""

from __future__ import annotations

import io
import os
import subprocess
import sys
import time
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from cli_files import DATA, DECAY, ENZYME, FILES
from fisherpoint.basics.standard_input import held
from fisherpoint.design.file.configuration import load_config
from fisherpoint.design.file.first_file import PLACES, example_texts
from fisherpoint.models.toml_to_model import load_model
from fisherpoint_command import cli
from fisherpoint_command import heartbeat as signs
from fisherpoint_command.argv import ARGUMENTS

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "examples"


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The directory in which commands are typed, with the files of the mistakes."""
    for name, content in FILES.items():
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(content.encode() if isinstance(content, str) else content)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def there(directory: Path) -> set[str]:
    return {str(path.relative_to(directory)) for path in directory.rglob("*")}


# --- --check --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("typed", "says"),
    [
        (
            "design enzyme.toml",
            ["points             6", "method             auto, at most 200 iterations", "rule               Sparse"],
        ),
        ("design enzyme.toml -L 4 -o out --seed 3", ["points             4", "would write to     out"]),
        ("design cylinder.toml", ["constraints        p_A + p_B < 30e6", "v -0.25 to 0.25 m/s"]),
        ("design reactor.toml", ["1 of 8 segments", "8 starts from a pool of 500 random runs"]),
        ("evaluate enzyme.toml points.csv", ["points             2 points", "about 38"]),
        ("sweep enzyme.toml -L 2:5", ["4, from 2 to 5 points"]),
        ("compare enzyme.toml points.csv", ["1000 plants, seed 0", "about 2,000"]),
        ("simulate enzyme.toml points.csv --noise", ["by [noise], seed 0", "about 2"]),
        ("estimate enzyme.toml data.csv", ["3 points, 1 outputs, 3 of 3 numbers", "as given", "as information"]),
        ("estimate enzyme.toml data.csv --no-prior --noise estimated", ["estimated from the residuals", "as a start alone"]),
        ("validate enzyme.toml points.csv -n 50", ["50 of each, seed 0, noise known", "about 800"]),
        ("campaign enzyme.toml", ["a new one", "batch              2", "V 5.00 %, K 5.00 %"]),
        ("campaign reactor.toml", ["a new one", "1 of 8 segments"]),
    ],
)
def test_check_says_what_would_be_done_and_does_nothing(typed: str, says: list[str], run: Any, place: Path) -> None:
    before = there(place)
    code, out, err = run(*typed.split(), "--check")
    assert (code, err) == (0, "")
    assert out.startswith("No mistake found in ") and "nothing was computed" in out and "  model  " in out
    for part in says:
        assert part in out
    assert there(place) == before


@pytest.mark.parametrize(
    "typed",
    [
        "design wrong.toml",
        "evaluate wrong.toml points.csv",
        "evaluate enzyme.toml cylinder.csv",
        "estimate enzyme.toml points.csv",
        "design enzyme.toml --keep cylinder.csv",
        "design enzyme.toml --previous cylinder.csv",
        "design enzyme.toml -o taken",
        "design enzyme.toml -L 2 --keep points.csv",
        "validate enzyme.toml cylinder.csv",
        "compare enzyme.toml cylinder.csv",
        "simulate enzyme.toml points.csv -o there.csv",
        "sweep enzyme.toml -L 0",
        "campaign enzyme.toml --data points.csv",
    ],
)
def test_check_finds_what_the_command_would_refuse(typed: str, run: Any, place: Path) -> None:
    (place / "wrong.toml").write_text(ENZYME.replace("mean = 212.7", "mean = 0"))
    code, out, err = run(*typed.split(), "--check")
    assert (code, out) == (2, "") and "expected" in err
    again = run(*typed.split(), *(() if "-o" in typed else ("-o", "out")))
    assert again == (2, "", err)


def test_check_of_a_campaign_that_has_begun(run: Any, place: Path) -> None:
    assert run("campaign", "enzyme.toml", "-o", "run", "--quiet", "--no-plots")[0] == 0
    before = (place / "run" / "campaign.json").read_bytes()
    code, out, _ = run("campaign", "enzyme.toml", "-o", "run", "--check", "--data", "data.csv")
    assert code == 0 and "the one in run, 0 batches measured" in out and "3 points, 1 outputs" in out
    code, _, err = run("campaign", "enzyme.toml", "-o", "run", "--check", "-L", "3")
    assert code == 2 and "campaign.batch: expected 2, what the campaign in run was started with, given 3" in err
    assert (place / "run" / "campaign.json").read_bytes() == before


def test_data_of_a_logger_are_read_by_the_names_of_their_columns(run: Any, place: Path) -> None:
    (place / "log.csv").write_text("Conc;Rate\nppm;\n1,1;200\n0,1;130\n0,5;190\n")
    (place / "named.toml").write_text((place / "enzyme.toml").read_text() + '\n[data]\ns = "Conc"\ny_rate = "Rate"\n')
    named = ("--column", "s=Conc", "--column", "y_rate=Rate")
    for file, columns in (("named.toml", ()), ("enzyme.toml", named)):
        for command in (["estimate", file, "log.csv"], ["campaign", file, "--data", "log.csv"]):
            code, out, err = run(*command, *columns, "--check")
            assert (code, err) == (0, "") and "Measurements(3 points, 1 outputs, 3 of 3 numbers)" in out
        for command in (["design", file], ["sweep", file, "-L", "2:3"]):
            code, _, err = run(*command, "--previous", "log.csv", "--previous", "points.csv", *columns, "--check")
            assert (code, err) == (0, "")
    code, _, err = run("design", "enzyme.toml", "--previous", "log.csv", "--check")
    assert code == 2 and "log.csv: expected the columns s; given Conc, Rate" in err


# --- Standard input -------------------------------------------------------------------------------------------------------


def test_a_file_on_standard_input(run: Any, place: Path) -> None:
    code, out, err = run("evaluate", "-", "points.csv", stdin=ENZYME)
    assert (code, err) == (0, "") and out == run("evaluate", "enzyme.toml", "points.csv")[1]
    assert held(Path("standard input")) is None  # the next command does not find it
    assert run("evaluate", "enzyme.toml", "-", stdin=FILES["points.csv"])[1] == out
    code, _, err = run("estimate", "enzyme.toml", "-", "-o", "fit", "--no-plots", "--quiet", stdin=DATA)
    assert (code, err) == (0, "") and (place / "fit" / "estimate.csv").exists()
    assert "<summary>enzyme.toml</summary>" in (place / "fit" / "report.html").read_text()
    options = ["--no-plots", "--quiet", "--max-iterations", "2"]
    assert run("design", "-", "-o", "run", *options, stdin=ENZYME)[0] == 0
    page = (place / "run" / "report.html").read_text()
    assert "<summary>standard input</summary>" in page and "fisherpoint design - -o run" in page
    assert run("design", "enzyme.toml", "-o", "other", "--keep", "-", *options, stdin="s\n0.3\n")[0] == 0
    assert (place / "other" / "design.csv").read_text().split()[:2] == ["s", "0.3"]


def test_help_does_not_wait_for_standard_input(run: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", None)
    assert run("design", "-", "--help")[0] == 0
    code, _, err = run("design", "-", "-o", "out")
    assert code == 2 and "-: expected a file on standard input, given none" in err


# --- Virtual data ---------------------------------------------------------------------------------------------------------


def test_virtual_data_are_what_estimate_reads(run: Any, place: Path) -> None:
    code, out, err = run("simulate", "enzyme.toml", "points.csv", "--noise", "--seed", "4", "-o", "measured.csv")
    assert (code, err) == (0, "") and out == "2 points measured virtually at the prior mean, seed 4\n"
    problem = fp.load_problem(place / "enzyme.toml")
    found = fp.Measurements.from_table(place / "measured.csv", problem.model)
    points = fp.Experiments.from_csv(place / "points.csv", problem.model)
    rig = fp.VirtualRig(problem.model, problem.prior.mean, problem.noise or {}, seed=4)
    assert found == rig.measure(points)
    assert run("estimate", "enzyme.toml", "measured.csv", "-o", "fit", "--no-plots", "--quiet")[0] == 0

    text = (place / "measured.csv").read_bytes().decode()
    assert run("simulate", "enzyme.toml", "points.csv", "--noise", "--seed", "4")[1].split() == text.split()
    assert run("simulate", "enzyme.toml", "points.csv", "--noise", "--seed", "4", "-o", "-", "--quiet")[1].split() == text.split()
    assert run("simulate", "enzyme.toml", "points.csv", "--noise")[1].split() != text.split()


def test_virtual_data_of_runs_and_of_starts_that_are_off(run: Any, place: Path) -> None:
    assert run("simulate", "reactor.toml", "runs.csv", "--noise", "-o", "measured.csv", "--quiet") == (0, "", "")
    model = load_config(place / "reactor.toml").build_model()
    assert isinstance(fp.Measurements.from_table(place / "measured.csv", model).points, fp.Runs)

    (place / "off.toml").write_text(DECAY.replace("[region]", "[initial_state_std]\nshare = 0.1\n\n[region]"))
    (place / "decay.csv").write_text("share,dt\n" + "1,0.001\n" * 200)
    assert run("simulate", "off.toml", "decay.csv", "--noise", "-o", "off.csv", "--quiet")[0] == 0
    y = fp.Measurements.from_table(place / "off.csv", load_config(place / "off.toml").build_model()).y
    assert np.std(y) == pytest.approx(np.hypot(20 * 0.1, 0.2), rel=0.2)


def test_simulated_outputs_on_standard_output(run: Any) -> None:
    code, out, err = run("simulate", "enzyme.toml", "points.csv", "-o", "-")
    header, *rows = out.split()
    assert (code, err, header) == (0, "", "s,y_rate,status")
    for row, s in zip(rows, (1.1, 0.1), strict=True):
        given, rate, status = row.split(",")
        assert (float(given), float(rate), status) == (s, pytest.approx(212.7 * s / (0.0641 + s)), "ok")


# --- init -----------------------------------------------------------------------------------------------------------------


def test_the_examples_are_listed(run: Any) -> None:
    code, out, _ = run("init")
    names = [line.split()[0] for line in out.splitlines()]
    assert code == 0 and names == sorted(path.stem for path in EXAMPLES.glob("*.toml"))
    assert "Two reactions in series, A -> B -> C" in out


def test_examples_are_taken_from_an_installed_package_first(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    installed, tree = PLACES
    assert tree.name == "examples" and str(installed).endswith("fisherpoint/examples")
    (tmp_path / "examples").mkdir()
    (tmp_path / "examples" / "one.toml").write_text("# one\n")
    monkeypatch.setattr("fisherpoint.design.file.first_file.PLACES", (tmp_path / "examples", tree))
    assert example_texts() == {"one": "# one\n"} and example_texts(".csv") == {}
    monkeypatch.setattr("fisherpoint.design.file.first_file.PLACES", (tmp_path / "none",))
    with pytest.raises(ValueError, match="examples: expected the examples in the package"):
        example_texts()
    built = (ROOT / "CMakeLists.txt").read_text()
    assert 'install(DIRECTORY examples/ DESTINATION fisherpoint/examples FILES_MATCHING PATTERN "*.toml" PATTERN "*.csv")' in built
    excluded = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["scikit-build"]["sdist"]["exclude"]
    assert "examples" not in excluded


def test_an_example_is_written_and_can_be_designed(run: Any, place: Path) -> None:
    code, out, err = run("init", "--example", "box_lucas")
    assert (code, err) == (0, "") and out == "Written: box_lucas.toml. To check it: fisherpoint design box_lucas.toml --check\n"
    text = (place / "box_lucas.toml").read_text()
    assert "fisherpoint design box_lucas.toml -o run/" in text
    assert tomllib.loads(text) == tomllib.loads((EXAMPLES / "box_lucas.toml").read_text())
    assert run("init", "--example", "box_lucas")[0] == 2
    assert run("init", "--example", "box_lucas", "--force")[0] == 0
    assert run("init", "--example", "box_lucas", "-o", "-")[1] == (EXAMPLES / "box_lucas.toml").read_text()
    assert run("design", "box_lucas.toml", "--check")[0] == 0


def test_an_example_with_measurements_is_written_with_these(run: Any, place: Path) -> None:
    code, out, _ = run("init", "--example", "alpha_pinene")
    assert code == 0 and "Written: alpha_pinene.toml, and alpha_pinene.csv with measurements. To check it:" in " ".join(out.split())
    assert (place / "alpha_pinene.csv").read_bytes() == (EXAMPLES / "alpha_pinene.csv").read_bytes()
    assert run("estimate", "alpha_pinene.toml", "alpha_pinene.csv", "--check")[0] == 0
    (place / "alpha_pinene.toml").unlink()
    code, _, err = run("init", "--example", "alpha_pinene")
    assert code == 2 and "alpha_pinene.csv" in err and not (place / "alpha_pinene.toml").exists()
    assert run("init", "--example", "alpha_pinene", "--force")[0] == 0
    (place / "alpha_pinene.csv").unlink()
    run("init", "--example", "alpha_pinene", "-o", "-")
    assert not (place / "alpha_pinene.csv").exists()


@pytest.mark.parametrize("name", ["michaelis_menten", "box_lucas", "dc_motor", "cascaded_tanks", "fed_batch", "cylinder"])
def test_a_file_for_a_model_can_be_checked_and_designed(name: str, run: Any, place: Path) -> None:
    (place / "model.toml").write_text(load_model(EXAMPLES / f"{name}.toml").to_toml())
    code, out, err = run("init", "model.toml")
    assert (code, err) == (0, "") and out.startswith("Written: model_problem.toml. To check it: fisherpoint design model_problem")
    assert run("design", "model_problem.toml", "--check")[0] == 0
    options = ["--no-plots", "--quiet", "--max-iterations", "2"]
    assert run("design", "model_problem.toml", "-o", "run", *options) == (0, "", "")
    # The tanks overflow nowhere in the region that is guessed, which the report of the design says.
    assert np.isfinite(fp.Design.load(place / "run").evaluation.log_det) == (name != "cascaded_tanks")


def test_a_file_for_a_model_keeps_its_text_and_says_what_is_open(run: Any, place: Path) -> None:
    model = (
        '# my model\n[model]\nname = "mine"\n\n[model.states]\nx = "m"  # a place\n\n[model.parameters]\nk = "1/s"\nc = "m/s"\n\n'
    )
    model += '[model.outputs]\nx = "m"\n\n[model.equations]\nx = "-k*x + c"\n'
    (place / "mine.toml").write_text(model)
    code, out, _ = run("init", "mine.toml", "-o", "a problem.toml")
    assert code == 0 and "fisherpoint design 'a problem.toml' --check" in out and "Set in it first: k, c." in out
    text = (place / "a problem.toml").read_text()
    assert model.strip() in text and text.count("not known from the model: set it") == 2
    assert run("design", "a problem.toml", "--check")[0] == 0


# --- Around the work ------------------------------------------------------------------------------------------------------


def completed(*words: str) -> list[str]:
    """What a shell is told that may come next."""
    told = {"_FISHERPOINT_COMPLETE": "complete_bash", "COMP_WORDS": " ".join(words), "COMP_CWORD": str(len(words) - 1)}
    paths = {"PYTHONPATH": str(Path(fp.__file__).parents[1])}
    program = [sys.executable, "-m", "fisherpoint"]
    done = subprocess.run(program, env=os.environ | told | paths, capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout.split()


def test_commands_and_options_are_completed(run: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    assert completed("fisherpoint", "des") == ["design"]
    assert completed("fisherpoint", "design", "--me") == ["--method"]
    assert "auto" in completed("fisherpoint", "design", "--method", "a")
    monkeypatch.setenv("_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION", "1")  # which shell calls tests is not known
    code, out, _ = run("--show-completion", "bash")
    assert code == 0 and "_FISHERPOINT_COMPLETE=complete_bash" in out and "fisherpoint" in out


def test_help_is_tidy(run: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    for name, *_ in (*cli.COMMANDS, ("",)):
        lines = run(*([name] if name else []), "--help")[1].splitlines()
        assert max(map(len, lines)) <= 80 and not any("<" + "class" in line for line in lines)


@pytest.mark.filterwarnings("default")
def test_a_warning_is_one_line_and_the_work_goes_on(run: Any, place: Path) -> None:
    (place / "cut.csv").write_text(DATA.rstrip("\n"))
    code, _, err = run("estimate", "enzyme.toml", "cut.csv", "-o", "fit", "--no-plots", "--quiet")
    said = (
        "expected a line break at the end of the file, given '190' there: is the file cut off within it? If not, add a line break"
    )
    assert (code, err) == (0, f"fisherpoint: warning: cut.csv: row 3: {said}\n")


class Terminal(io.StringIO):
    """A stream that is looked at."""

    def isatty(self) -> bool:
        return True


def test_what_takes_its_time_shows_that_it_lives(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(signs, "AFTER", 0.01)
    monkeypatch.setattr(signs, "EVERY", 0.01)

    def shown(what: str, *arguments: str, seconds: float = 0.2) -> str:
        monkeypatch.setattr(sys, "stderr", Terminal())
        monkeypatch.setattr(signs.Sign, "last", time.perf_counter())
        token = ARGUMENTS.set(arguments)
        with signs.alive(what):
            time.sleep(seconds)
        ARGUMENTS.reset(token)
        assert isinstance(sys.stderr, Terminal)
        return sys.stderr.getvalue()

    text = shown("thinking")
    assert text.startswith(f"{signs.ERASE}thinking, 0 s") and text.endswith(signs.ERASE)  # nothing of it is left
    assert shown("thinking", "--quiet") == ""
    monkeypatch.setattr(signs, "AFTER", 60.0)
    assert shown("thinking", seconds=0.0) == ""
    monkeypatch.setattr(signs, "AFTER", 0.01)
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    with signs.alive("thinking"):
        time.sleep(0.05)
    assert sys.stderr.getvalue() == ""


def test_points_outside_are_named(run: Any, place: Path) -> None:
    (place / "far.csv").write_text("s,comment\n1.1,\n5.0,too much\n-1,none\n")
    code, out, err = run("evaluate", "enzyme.toml", "far.csv", "-o", "evaluated", "--no-plots")
    said = "Outside of the region: point 2: s = 5 ppm, above 1.1; point 3: s = -1 ppm, below 0."
    assert (code, err) == (0, "") and said in " ".join(out.split())
    assert said in (place / "evaluated" / "report.html").read_text()
    line = f"fisherpoint: warning: far.csv: outside of the region: {said.removeprefix('Outside of the region: ').rstrip('.')}\n"
    assert run("compare", "enzyme.toml", "far.csv", "--quiet") == (0, "", line)
    assert run("validate", "enzyme.toml", "far.csv", "-n", "5", "-o", "v", "--no-plots", "--quiet") == (0, "", line)

    (place / "runs_far.csv").write_text(str(FILES["runs.csv"]).replace("1,2,,,,450", "1,2,,,,900"))
    out = run("evaluate", "reactor.toml", "runs_far.csv")[1]
    assert "Outside of the region: run 1, segment 2: T = 900 K, above 700." in " ".join(out.split())


def test_options_mean_the_same_everywhere(run: Any, place: Path) -> None:
    quick = ["--no-plots", "--quiet", "--max-iterations", "2"]
    assert run("design", "enzyme.toml", "-o", "four", "-L", "4", *quick) == (0, "", "")
    assert len(fp.Design.load(place / "four").points) == 4
    assert run("campaign", "enzyme.toml", "-o", "run", "-L", "3", "--seed", "5", "--no-plots", "--quiet") == (0, "", "")
    campaign = fp.Campaign.load(place / "run")
    assert (campaign.batch, campaign.settings.seed) == (3, 5)
    one, two = (run("evaluate", "enzyme.toml", "points.csv", "--threads", threads)[1] for threads in (1, 2))
    assert one == two
    assert run("evaluate", "enzyme.toml", "points.csv", "--quiet") == (0, "", "")
    assert run("compare", "enzyme.toml", "points.csv", "--quiet") == (0, "", "")
    assert run("simulate", "enzyme.toml", "points.csv", "--quiet", "--threads", 2) == (0, "", "")


def test_all_mistakes_of_a_file_are_told(run: Any, place: Path) -> None:
    (place / "wrong.toml").write_text(ENZYME.replace("mean = 212.7", "mean = 0").replace("rate = 10.9", "rates = 10.9"))
    code, out, err = run("design", "wrong.toml", "-o", "out")
    assert (code, out) == (2, "")
    assert [line[:36] for line in err.splitlines()] == [
        "fisherpoint: wrong.toml: prior.V: ex",
        "fisherpoint: wrong.toml: unknown key",
    ]


def test_a_file_for_a_model_has_what_runs_need_as_comments(run: Any, place: Path) -> None:
    """Uncommented, it is a problem of runs; a model without states has no runs."""
    (place / "model.toml").write_text(load_model(EXAMPLES / "cascaded_tanks.toml").to_toml())
    assert run("init", "model.toml")[0] == 0
    path = place / "model_problem.toml"
    head, block = path.read_text().split("# [runs]")
    block, tail = ("# [runs]" + block).split("\n\n", 1)
    for lines in (block.splitlines(), [line for line in block.splitlines() if not line.startswith("# rest")]):
        path.write_text(head + "\n".join(line.removeprefix("# ") for line in lines) + "\n\n" + tail)
        region = load_config(path).problem().region
        assert isinstance(region, fp.RunRegion) and region.segments == 20 and set(region.slew) == {"u"}
        assert (region.rest is None) == (len(lines) < len(block.splitlines()))
        assert run("design", "model_problem.toml", "--check")[0] == 0
    (place / "static.toml").write_text(load_model(EXAMPLES / "michaelis_menten.toml").to_toml())
    assert run("init", "static.toml")[0] == 0 and "[runs]" not in (place / "static_problem.toml").read_text()
