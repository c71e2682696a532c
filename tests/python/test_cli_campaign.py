"""``fisherpoint campaign``: what it writes and says, going on, and one line where it fails."""

from __future__ import annotations

import shlex
import shutil
from pathlib import Path
from typing import Any

import pytest

import fisherpoint as fp
from fisherpoint.design.file.configuration import ConfigError, load_config

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """The cylinder with settings that take a fraction of a second."""
    return edited(
        EXAMPLES / "cylinder.toml",
        tmp_path / "quick.toml",
        {"= 50 ": "= 10 ", "max_iterations = 400": "max_iterations = 10", "targets = 0.02": "targets = 0.2"},
    )


def edited(source: Path, target: Path, changes: dict[str, str]) -> Path:
    text = source.read_text()
    for old, new in changes.items():
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    target.write_text(text)
    return target


def measured(file: Path, points: Path, target: Path, seed: int = 0) -> Path:
    problem = load_config(file).problem()
    rig = fp.VirtualRig(problem.model, 1.05 * problem.theta, problem.noise or {}, seed=seed)
    rig.measure(fp.Experiments.from_csv(points, problem.model)).to_csv(target, problem.model)
    return target


def names(directory: Path) -> list[str]:
    return sorted(path.name for path in directory.iterdir())


def test_a_campaign_from_the_first_batch_to_its_targets(run: Any, file: Path, tmp_path: Path) -> None:
    directory = tmp_path / "run"
    code, out, err = run("campaign", file, "-o", directory)
    assert (code, err) == (0, "")
    assert names(directory) == ["batch_1.csv", "campaign.json", "report.html"]
    assert "Next batch" in (directory / "report.html").read_text()
    assert f"Measure the points of {directory / 'batch_1.csv'}" in out
    assert "y_q, y_p_A, y_p_B, y_x_v" in out and f"fisherpoint campaign {file} -o {directory} --data MEASURED.csv" in out
    points = (directory / "batch_1.csv").read_bytes()
    assert run("campaign", file, "-o", directory)[:2] == (0, out)
    assert (directory / "batch_1.csv").read_bytes() == points and len(points.splitlines()) == 7

    data = measured(file, directory / "batch_1.csv", tmp_path / "measured.csv")
    code, out, err = run("campaign", file, "-o", directory, "--data", data)
    assert (code, err) == (0, "")
    assert f"{data}: taken as batch 1" in out and "Campaign on hydraulic_cylinder: 1 batch, 6 points measured" in out
    assert names(directory) == ["batch_1.csv", "campaign.json", "campaign.png", "data_1.csv", "report.html", "report.txt"]
    assert "All targets are met" in out and "Measure the points" not in out
    assert (directory / "report.txt").read_text().strip() in out

    code, again, _ = run("campaign", file, "-o", directory, "--data", data)
    assert code == 0 and f"{data}: these are the data of batch 1, which were taken before" in again
    assert len(fp.Campaign.load(directory).history) == 1

    finer = edited(file, tmp_path / "finer.toml", {"targets = 0.2": "targets = {c_L = 1e-3, m_q = 0.5}"})
    code, out, _ = run("campaign", finer, "-o", directory, "--no-plots")
    assert code == 0 and f"Measure the points of {directory / 'batch_2.csv'}" in out and "above target: c_L" in out
    assert fp.Campaign.load(directory).targets == {"m_q": 0.5, "c_L": 1e-3}
    assert run("campaign", finer, "-o", directory, "--quiet", "--no-plots")[:2] == (0, "")


def test_the_next_command_can_be_typed_where_names_have_spaces(run: Any, file: Path, tmp_path: Path) -> None:
    directory = tmp_path / "a campaign"
    out = run("campaign", file, "-o", directory, "--no-plots")[1]
    (line,) = (line for line in out.splitlines() if line.startswith("  fisherpoint campaign"))
    assert shlex.split(line)[1:] == ["campaign", str(file), "-o", str(directory), "--data", "MEASURED.csv"]


def test_a_file_that_was_changed_needs_another_directory(run: Any, file: Path, tmp_path: Path) -> None:
    directory = tmp_path / "run"
    assert run("campaign", file, "-o", directory, "--no-plots")[0] == 0
    for changes, said in (
        ({"mean = 400.0": "mean = 401.0"}, ("prior.a_tau.mean: expected 400.0", "given 401.0 (also: prior.a_tau.std)")),
        ({"seed = 0": "seed = 1"}, ("design.seed: expected 0", "given 1")),
        ({"batch = 6": "batch = 5"}, ("campaign.batch: expected 6", "given 5")),
        ({"x_v = 1e-3": "x_v = 2e-3"}, ("noise.x_v: expected 0.001", "given 0.002")),
        ({"u   = [-1.0, 1.0]": "u   = [-1.0, 0.5]"}, ("region.u: expected [-1.0, 1.0]", "given [-1.0, 0.5]")),
    ):
        changed = edited(file, tmp_path / "changed.toml", changes)
        code, _, err = run("campaign", changed, "-o", directory)
        was = f"what the campaign in {directory} was started with"
        assert code == 2 and f"changed.toml: {said[0]}, {was}, {said[1]}; another" in err and len(err.splitlines()) == 1
    changed = edited(file, tmp_path / "changed.toml", {"seed = 0": 'jumps = "exclude"\nseed = 0'})
    code, _, err = run("campaign", changed, "-o", directory)
    assert code == 2 and len(err.splitlines()) == 1
    said = f'expected "cross", what the campaign in {directory} was started with, given "exclude"'
    assert f"changed.toml: design.jumps: {said}; another needs another directory" in err
    assert run("campaign", file, "-o", directory, "--no-plots")[0] == 0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"targets = 0.2": "rse = 0.2"}, "campaign.rse: expected campaign.targets, which is the name of this key now"),
        ({"targets = 0.2": "targets = 0"}, "campaign.targets: expected a number > 0, given 0"),
        ({"targets = 0.2": "targets = 5"}, "campaign.targets: expected a share of at most 1, such as 0.05 for 5 %, given 5"),
        (
            {"targets = 0.2": "targets = {c_M = 0.1}"},
            'unknown key campaign.targets.c_M; expected one of a_tau, .* (did you mean "c_L"?)',
        ),
        ({"batch = 6": "batch = 0"}, "campaign.batch: expected a number >= 1, given 0"),
        ({"batch = 6": "batch = 1000001"}, "campaign.batch: expected a number <= 1000000, given 1000001"),
        ({"= 10 ": "= 1000000000 "}, "design.n_candidates: expected a number <= 1000000, given 1000000000"),
        ({"batch = 6": "batches = 6"}, "unknown key campaign.batches; expected one of batch, targets"),
        ({"# time_limit = 600 ": "time_limit = 600 #"}, "design.time_limit: expected none with a campaign"),
    ],
)
def test_mistakes_in_the_file_are_one_line(run: Any, file: Path, tmp_path: Path, changes: dict[str, str], message: str) -> None:
    wrong = edited(file, tmp_path / "wrong.toml", changes)
    code, out, err = run("campaign", wrong, "-o", tmp_path / "run")
    assert (code, out, len(err.splitlines())) == (2, "", 1)
    assert all(part in err for part in message.split(".* ")), err


def test_other_failures_are_one_line_and_change_nothing(run: Any, file: Path, tmp_path: Path) -> None:
    directory = tmp_path / "run"
    assert run("campaign", file, "-o", directory, "--no-plots")[0] == 0
    before = {path: path.read_bytes() for path in directory.iterdir()}
    data = measured(file, directory / "batch_1.csv", tmp_path / "measured.csv")
    (tmp_path / "cut.csv").write_text(data.read_text()[:-30])
    for given, message in (
        (tmp_path / "nowhere.csv", "expected a CSV file of measurements, found no such file"),
        (directory / "batch_1.csv", "expected the columns"),
        (tmp_path / "cut.csv", "cut.csv: "),
    ):
        code, _, err = run("campaign", file, "-o", directory, "--data", given, "--no-plots")
        assert code == 2 and message in err and len(err.splitlines()) == 1
        assert {path: path.read_bytes() for path in directory.iterdir()} == before

    broken = Path(shutil.copytree(directory, tmp_path / "broken"))
    state = broken / "campaign.json"
    state.write_text(state.read_text()[:-100])
    code, _, err = run("campaign", file, "-o", broken)
    assert code == 2 and "campaign.json: expected a whole JSON file" in err and len(err.splitlines()) == 1

    without = edited(
        EXAMPLES / "michaelis_menten.toml",
        tmp_path / "m.toml",
        {"[region]": "[design]", 's = { bounds = [0.0, 1.1], unit = "ppm" }\n\n[design]': ""},
    )
    code, _, err = run("campaign", without, "-o", tmp_path / "other")
    assert code == 2 and "region: missing" in err


def test_an_interrupt_leaves_a_campaign_to_go_on_with(
    run: Any, file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object, **__: object) -> fp.Experiments:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(fp.Campaign, "next", interrupted)
        code, _, err = run("campaign", file, "-o", tmp_path / "run")
    assert code == 130 and "run the same command to continue" in err
    assert run("campaign", file, "-o", tmp_path / "run", "--no-plots")[0] == 0
    assert (tmp_path / "run" / "batch_1.csv").exists()


def test_the_table_is_optional(file: Path, tmp_path: Path) -> None:
    config = load_config(EXAMPLES / "michaelis_menten.toml")
    assert config.campaign.batch is None and config.campaign.targets is None
    with pytest.raises(ConfigError, match=r"campaign.targets.c_L: expected a number > 0, given -1$"):
        load_config(edited(file, tmp_path / "wrong.toml", {"targets = 0.2": "targets = {c_L = -1}"}))


# --- Runs ----------------------------------------------------------------------------------------------------------------


@pytest.fixture
def runs_file(tmp_path: Path) -> Path:
    """The reactor with three segments and a short search."""
    changes = {
        "segments = 8": "segments = 3\nn_starts = 2\nn_runs = 4\n\n[design]\nn_candidates = 20\n\n[campaign]\ntargets = 0.1\n"
    }
    return edited(EXAMPLES / "reactor.toml", tmp_path / "runs.toml", changes)


def measured_runs(file: Path, table: Path, target: Path) -> Path:
    problem = load_config(file).problem()
    runs = fp.Runs.from_csv(table, problem.model)
    rig = fp.VirtualRig(problem.model, 1.05 * problem.theta, problem.noise or {})
    rig.measure(runs).to_csv(target, problem.model)
    return target


def test_a_campaign_of_runs_from_the_first_batch_to_its_targets(run: Any, runs_file: Path, tmp_path: Path) -> None:
    directory = tmp_path / "run"
    code, out, err = run("campaign", runs_file, "-o", directory)
    assert (code, err) == (0, "")
    assert names(directory) == ["batch_1.csv", "campaign.json", "plan_1.csv", "report.html"]
    assert f"Measure the runs of {directory / 'batch_1.csv'}" in out and "y_A, y_B, y_C" in out
    assert f"The time table of the next batch is {directory / 'plan_1.csv'}." in out
    campaign = fp.Campaign.load(directory)
    assert (campaign.batch, campaign.settings.n_candidates) == (1, 20) and isinstance(campaign.settings, fp.results.RunSettings)
    assert run("campaign", runs_file, "-o", directory)[:2] == (0, out)

    data = measured_runs(runs_file, directory / "batch_1.csv", tmp_path / "measured.csv")
    code, out, err = run("campaign", runs_file, "-o", directory, "--data", data)
    assert (code, err) == (0, "")
    assert f"{data}: taken as batch 1" in out and "Campaign on reactor: 1 batch, 1 run measured" in out
    assert "All targets are met" in out and "Measure the runs" not in out
    assert names(directory) == [
        "batch_1.csv",
        "campaign.json",
        "campaign.png",
        "data_1.csv",
        "plan_1.csv",
        "report.html",
        "report.txt",
    ]
    code, out, _ = run("campaign", runs_file, "-o", directory, "--data", data, "--no-plots")
    assert code == 0 and "these are the data of batch 1, which were taken before" in out

    stricter = edited(runs_file, tmp_path / "stricter.toml", {"targets = 0.1": "targets = 0.01"})
    code, out, _ = run("campaign", stricter, "-o", directory, "--no-plots")
    assert code == 0 and (directory / "plan_2.csv").exists() and f"Measure the runs of {directory / 'batch_2.csv'}" in out


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"n_starts = 2": "n_starts = 3"}, "runs.n_starts: expected 2, what the campaign in"),
        ({"segments = 3": "segments = 4"}, "runs.segments: expected 3, what the campaign in"),
        ({"targets = 0.1": "targets = 0.1\nbatch = 2"}, "campaign.batch: expected 1, what the campaign in"),
        ({"n_candidates = 20": "n_candidates = 20\ntime_limit = 5"}, "design.time_limit: expected none with a campaign"),
        ({"[noise]\nA = 0.01\nB = 0.01\nC = 0.01\n": ""}, "noise: expected the sensor noise"),
    ],
)
def test_mistakes_in_a_file_of_runs_are_one_line(
    run: Any, runs_file: Path, tmp_path: Path, changes: dict[str, str], message: str
) -> None:
    assert run("campaign", runs_file, "-o", tmp_path / "run")[0] == 0
    code, out, err = run("campaign", edited(runs_file, tmp_path / "wrong.toml", changes), "-o", tmp_path / "run")
    assert (code, out, len(err.splitlines())) == (2, "", 1) and message in err
