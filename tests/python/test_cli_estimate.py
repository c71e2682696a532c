"""`fisherpoint estimate` as a user runs it."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.design.file.configuration import load_config
from fisherpoint_command.cli import main

EXAMPLES = Path(__file__).parents[2] / "examples"
DECAY = EXAMPLES / "exponential_decay.toml"


def run(*arguments: object) -> int:
    with pytest.raises(SystemExit) as stopped:
        main(["estimate", *map(str, arguments)])
    return int(stopped.value.code or 0)


@pytest.fixture
def measured(tmp_path: Path) -> Path:
    model = load_config(DECAY).build_model()
    dt = np.linspace(100.0, 6000.0, 8)
    points = fp.Experiments(np.ones((8, 1)), np.zeros((8, 0)), dt)
    rig = fp.VirtualRig(model, dict(model.nominal), {"c": 0.2}, seed=4)
    rig.measure(points).to_csv(tmp_path / "measured.csv", model)
    return tmp_path / "measured.csv"


def test_it_writes_the_fit_and_prints_the_report(tmp_path: Path, measured: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "fit"
    assert run(DECAY, measured, "-o", out, "--profiles") == 0
    printed = capsys.readouterr().out
    names = {"estimate.csv", "residuals.csv", "fit.json", "report.txt", "report.html"}
    pictures = {f"{name}.png" for name in ("parity", "residuals", "correlation", "ellipses", "profiles")}
    assert {path.name for path in out.iterdir()} == names | pictures
    assert "Profile likelihood" in printed
    assert "maximum a posteriori, noise given" in printed
    assert (out / "report.txt").read_text(encoding="utf-8").strip() in printed
    config = load_config(DECAY)
    data = fp.Measurements.from_table(measured, config.build_model())
    expected = fp.estimate(config.build_model(), data, config.build_prior(), noise={"c": 0.2})
    told = json.loads((out / "fit.json").read_text())
    assert told["parameters"]["k"]["estimate"] == pytest.approx(expected.estimate["k"], rel=1e-12)


def test_runs_are_read_by_their_columns(tmp_path: Path, measured: Path) -> None:
    config = load_config(DECAY)
    model, out = config.build_model(), tmp_path / "fit"
    rig = fp.VirtualRig(model, dict(model.nominal), {"c": 0.2}, seed=5)
    runs = fp.Runs(np.ones((2, 1)), np.zeros((2, 4, 0)), 500.0, [True, False, True, True])
    rig.measure(runs).to_csv(tmp_path / "runs.csv", model)
    assert run(DECAY, measured, tmp_path / "runs.csv", "-o", out) == 0
    data = [fp.Measurements.from_table(path, model) for path in (measured, tmp_path / "runs.csv")]
    expected = fp.estimate(model, data, config.build_prior(), noise={"c": 0.2})
    told = json.loads((out / "fit.json").read_text())
    assert told["parameters"]["k"]["estimate"] == pytest.approx(expected.estimate["k"], rel=1e-12)
    assert (out / "time.png").exists() and fp.Fit.load(out).data[1] == data[1]


def test_residuals_with_a_memory_come_first(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model, rng, noise = load_config(DECAY).build_model(), np.random.default_rng(0), np.zeros(200)
    for k in range(1, 200):
        noise[k] = 0.9 * noise[k - 1] + 0.1 * rng.standard_normal()
    t = 30.0 * np.arange(200)
    record = fp.Record(t, np.zeros((200, 0)), 20.0 * np.exp(-5e-4 * t) + noise, x0={"share": 1.0})
    record.to_csv(tmp_path / "record.csv", model)
    assert run(DECAY, tmp_path / "record.csv", "-o", tmp_path / "fit", "--stability") == 0
    printed = capsys.readouterr()
    assert printed.out.split("Warning: ")[1].startswith("c: the residuals are not white")
    assert "Estimates of parts of the data" in printed.out
    assert "expected white noise" not in printed.err  # once is enough
    assert (tmp_path / "fit" / "autocorrelation.png").exists()
    assert json.loads((tmp_path / "fit" / "fit.json").read_text())["residual_checks"]["c"]["white"] is False
    assert run(DECAY, tmp_path / "record.csv", "-o", tmp_path / "found", "--noise", "estimated") == 0
    printed = capsys.readouterr()
    assert "Noise found in the residuals" in printed.out and "not white" not in printed.out
    found = json.loads((tmp_path / "found" / "fit.json").read_text())["noise_estimate"]["c"]
    assert found["form"] == "memory" and found["values"]["correlation time"] == pytest.approx(30 / 0.105, rel=0.7)
    given = DECAY.read_text().replace(
        "c = 0.2", f"c = {{ colored = {{ std = {found['values']['std of memory']}, correlation_time = 300 }} }}"
    )
    assert given != DECAY.read_text()
    (tmp_path / "given.toml").write_text(given)
    assert run(tmp_path / "given.toml", tmp_path / "record.csv", "-o", tmp_path / "given") == 0
    assert "correlated over 300 s" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "known", "prior"),
    [
        ([], True, True),
        (["--noise", "known", "--no-prior"], True, False),
        (["--noise", "estimated", "--no-prior"], False, False),
        (["--noise", "estimated"], False, True),
    ],
)
def test_noise_and_prior_are_as_asked(tmp_path: Path, measured: Path, options: list[str], known: bool, prior: bool) -> None:
    assert run(DECAY, measured, "-o", tmp_path / "fit", "--no-plots", "--quiet", *options) == 0
    told = json.loads((tmp_path / "fit" / "fit.json").read_text())
    assert told["noise_known"] is known
    assert (told["parameters"]["k"]["prior_std"] is not None) is prior


def test_several_files_are_one_fit(tmp_path: Path, measured: Path) -> None:
    other = tmp_path / "other.csv"
    other.write_bytes(measured.read_bytes())
    assert run(DECAY, measured, other, "-o", tmp_path / "fit", "--no-plots", "--quiet") == 0
    with (tmp_path / "fit" / "residuals.csv").open() as file:
        assert [row["data"] for row in csv.DictReader(file)] == ["1"] * 8 + ["2"] * 8


def test_quiet_prints_nothing(tmp_path: Path, measured: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(DECAY, measured, "-o", tmp_path / "fit", "--no-plots", "--quiet") == 0
    assert capsys.readouterr() == ("", "")


def test_a_file_with_times_is_a_record(tmp_path: Path) -> None:
    config = load_config(EXAMPLES / "cascaded_tanks.toml")
    model, t = config.build_model(), 4.0 * np.arange(60)
    u = 2.0 + np.where((np.arange(60) // 15) % 2, 1.0, -1.0)
    y = fp.simulate_record(model, t, u, dict(model.nominal), {"h1": 5.0, "h2": 4.0}).y[:, 0]
    noisy = y + np.random.default_rng(0).normal(0.0, 0.05, 60)
    rows = ["t,u,y_level", *(f"{a!r},{b!r},{c!r}" for a, b, c in zip(t.tolist(), u.tolist(), noisy.tolist(), strict=True))]
    (tmp_path / "record.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    assert run(EXAMPLES / "cascaded_tanks.toml", tmp_path / "record.csv", "-o", tmp_path / "fit", "--quiet") == 0
    told = json.loads((tmp_path / "fit" / "fit.json").read_text())
    assert {"x0_h1", "x0_h2"} < set(told["parameters"])
    assert (tmp_path / "fit" / "time.png").exists()


def test_mistakes_are_one_line_and_code_2(tmp_path: Path, measured: Path, capsys: pytest.CaptureFixture[str]) -> None:
    without_noise = tmp_path / "without_noise.toml"
    text = DECAY.read_text(encoding="utf-8")
    without_noise.write_text(text.replace("[noise]\nc = 0.2\n", ""), encoding="utf-8")
    taken = tmp_path / "taken"
    taken.write_text("a file", encoding="utf-8")
    broken = tmp_path / "broken.csv"
    broken.write_text(measured.read_text().replace("20.", "twenty", 1) + "1,2\n", encoding="utf-8")
    cases = [
        ((DECAY, tmp_path / "no.csv", "-o", tmp_path / "fit"), "expected a CSV file of measurements, found no such file"),
        ((tmp_path / "no.toml", measured, "-o", tmp_path / "fit"), "expected a TOML file, found no such file"),
        ((EXAMPLES / "box_lucas.toml", measured, "-o", tmp_path / "fit"), "measured.csv: expected the columns A, B, dt"),
        ((without_noise, measured, "-o", tmp_path / "fit", "--noise", "known"), "noise: missing"),
        ((DECAY, measured, "-o", taken), "--output: expected a directory"),
        ((DECAY, broken, "-o", tmp_path / "fit"), "broken.csv: row"),
        ((DECAY, measured, "-o", tmp_path / "fit", "--noise", "perhaps"), "perhaps"),
        ((DECAY, measured, tmp_path / "." / measured.name, "-o", tmp_path / "fit"), "DATA.csv: expected each file once"),
        ((DECAY, measured), "--output: missing; expected a directory"),
        ((DECAY, "-o", tmp_path / "fit"), "DATA.csv...: missing; expected a file or directory: Measurements"),
    ]
    for arguments, message in cases:
        assert run(*arguments) == 2
        told = capsys.readouterr()
        assert told.out == ""
        assert told.err.count("\n") == 1
        assert message in told.err
        assert not (tmp_path / "fit").exists()


def test_help_has_an_example(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("--help") == 0
    assert "fisherpoint estimate examples/cylinder.toml measured.csv" in " ".join(capsys.readouterr().out.split())


CLOCK = """
[model]
name = "infusion"
[model.states]
{clock} = "s"
c = "1"
[model.parameters]
r = {{ unit = "1/s", nominal = 1.2 }}
k = {{ unit = "1/s", nominal = 0.3 }}
[model.outputs]
c = "1"
[model.equations]
{clock} = "1"
c = "where({clock} < 0.77, r, 0) - k*c"
[prior]
r = {{ mean = 1.0, relative_std = 0.5 }}
k = {{ mean = 0.4, relative_std = 0.5 }}
[noise]
c = 0.01
"""


def infused(t: np.ndarray, start: float) -> np.ndarray:
    """c of the model with r = 1.2, k = 0.3."""
    on = np.minimum(t, 0.77)
    return (4.0 - (4.0 - start) * np.exp(-0.3 * on)) * np.exp(-0.3 * (t - on))


@pytest.mark.parametrize("clock", ["clock", "t", "time"])
def test_a_record_has_its_known_starts_beside_it(tmp_path: Path, clock: str) -> None:
    """Two records, one with an unknown start of c: r and k are found, as a state called t is not taken for the time."""
    (tmp_path / "infusion.toml").write_text(CLOCK.format(clock=clock))
    t = 0.1 * np.arange(41)
    for name, start, told in (("one", 0.0, "0,0"), ("two", 0.5, "0,")):
        rows = [f"{a:.1f},{b:.8f},{told if i == 0 else ','}" for i, (a, b) in enumerate(zip(t, infused(t, start), strict=True))]
        (tmp_path / f"{name}.csv").write_text("\n".join([f"t,y_c,x0_{clock},x0_c", *rows]) + "\n")
    assert run(tmp_path / "infusion.toml", tmp_path / "one.csv", tmp_path / "two.csv", "-o", tmp_path / "fit", "--no-prior") == 0
    told = json.loads((tmp_path / "fit" / "fit.json").read_text())["parameters"]
    assert told["r"]["estimate"] == pytest.approx(1.2, rel=1e-4)
    assert told["k"]["estimate"] == pytest.approx(0.3, rel=1e-4)


def test_points_of_a_state_called_t_are_points(tmp_path: Path) -> None:
    (tmp_path / "infusion.toml").write_text(CLOCK.format(clock="t"))
    rows = [f"0,0,{a:.2f},{b:.8f}" for a in (0.3, 0.6, 1.0, 2.0) for b in (infused(np.array(a), 0.0),)]
    (tmp_path / "points.csv").write_text("\n".join(["t,c,dt,y_c", *rows]) + "\n")
    assert run(tmp_path / "infusion.toml", tmp_path / "points.csv", "-o", tmp_path / "fit", "--no-prior") == 0
    told = json.loads((tmp_path / "fit" / "fit.json").read_text())["parameters"]
    assert told["k"]["estimate"] == pytest.approx(0.3, rel=1e-4)


# --- Tables of loggers --------------------------------------------------------------------------------------------------


def as_logged(own: Path, path: Path, names: dict[str, str]) -> Path:
    """A file with other names, a further column, and rows above, as a German spreadsheet saves it."""
    heads, *rows = own.read_text().splitlines()
    lines = ["Logger 7;", ";;", ";".join([*(names[name] for name in heads.split(",")), "Temp °C"])]
    lines += [f"{row.replace(',', ';').replace('.', ',')};21,5" for row in rows]
    path.write_bytes("\r\n".join([*lines, ""]).encode("utf-16"))
    return path


def estimates(directory: Path) -> object:
    return json.loads((directory / "fit.json").read_text())["parameters"]


@pytest.mark.filterwarnings("always:.*left out")
def test_a_loggers_file_gives_the_same_fit(tmp_path: Path, measured: Path, capsys: pytest.CaptureFixture[str]) -> None:
    names = {"share": "Anfang", "dt": "Dauer", "y_c": "Konzentration"}
    log = as_logged(measured, tmp_path / "log.csv", names)
    assert run(DECAY, measured, "-o", tmp_path / "own", "--no-plots", "--quiet") == 0
    file = tmp_path / "decay.toml"
    file.write_text(DECAY.read_text() + '\n[data]\nshare = "Anfang"\ndt = "Dauer"\ny_c = "Conc"\n')
    capsys.readouterr()
    assert run(file, log, "-o", tmp_path / "fit", "--no-plots", "--quiet", "--column", "y_c=Konzentration") == 0
    assert capsys.readouterr().err == f"fisherpoint: warning: {log}: left out what is not named: Temp °C\n"
    assert estimates(tmp_path / "fit") == estimates(tmp_path / "own")
    assert run(file, log, "-o", tmp_path / "no", "--no-plots") == 2
    assert f"{log}: expected the columns Conc, given Anfang, Dauer, Konzentration, Temp °C" in capsys.readouterr().err


def test_times_of_day_make_a_record(tmp_path: Path) -> None:
    model, t = load_config(DECAY).build_model(), 60.0 * np.arange(40)
    y = fp.simulate_record(model, t, np.zeros((40, 0)), dict(model.nominal), {"share": 1.0}).y[:, 0]
    fp.Record(t, np.zeros((40, 0)), y, x0={"share": 1.0}).to_csv(tmp_path / "own.csv", model)
    rows = [f"{23 + n // 60:02}:{n % 60:02}:00,{value!r},{1.0 if n == 0 else ''}" for n, value in enumerate(y.tolist())]
    (tmp_path / "log.csv").write_text("\n".join(["time,conc,start", *rows, ""]))
    for name, options in (("own", []), ("log", ["--column=t=time", "--column=y_c=conc", "--column=x0_share=start"])):
        assert run(DECAY, tmp_path / f"{name}.csv", "-o", tmp_path / name, "--no-plots", "--quiet", *options) == 0
    assert estimates(tmp_path / "log") == estimates(tmp_path / "own")
