"""The command as a process: what it leaves behind where it is interrupted, cannot write, or cannot be imported."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import fisherpoint as fp
from fisherpoint.engine import _core

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
PROGRAM = "from fisherpoint_command import main; print('ready', flush=True, file=__import__('sys').stderr); main()"
MISSING = "import sys; sys.modules[{package!r}] = None; from fisherpoint_command import main; main()"
SLOW_PICTURES = f"""
import os, sys, time
from fisherpoint_command import drawing
os.sched_getaffinity = lambda process: range(int(os.environ["CORES"]))
drawn = drawing._encoded
def slow(name, plot):
    if name in ("correlation", "comparison"):
        print("slow", file=sys.stderr, flush=True)
        time.sleep(300)
    return drawn(name, plot)
drawing._encoded = slow
pictures = drawing.Drawers.drawn
def awaited(self, plots):
    print("awaited", file=sys.stderr, flush=True)
    yield from pictures(self, plots)
drawing.Drawers.drawn = awaited
{PROGRAM}
"""
HEADER = "q,v,p_A,p_B,x_v,u,dt\n"
POINTS = HEADER + "0.15,0.1,8e6,8e6,0.5,-0.5,0.002\n" * 2000


def environment(**changes: str) -> dict[str, str]:
    given = {name: value for name, value in os.environ.items() if name != "FISHERPOINT_ISA"}
    return given | {"PYTHONPATH": str(Path(fp.__file__).parents[1])} | changes


def run(*arguments: object, program: str = PROGRAM, **changes: str) -> subprocess.CompletedProcess[str]:
    done = subprocess.run(
        [sys.executable, "-c", program, *map(str, arguments)],
        env=environment(**changes),
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    done.stderr = done.stderr.removeprefix("ready\n")
    return done


def started(*arguments: object, program: str = PROGRAM, **changes: str) -> subprocess.Popen[str]:
    """The program at its work, which hears Ctrl-C: a shell's background jobs start with it ignored."""
    return subprocess.Popen(
        [sys.executable, "-c", program, *map(str, arguments)],
        env=environment(**changes),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )


@pytest.fixture
def points(tmp_path: Path) -> Path:
    path = tmp_path / "points.csv"
    path.write_text(POINTS)
    return path


@pytest.mark.parametrize("delay", [0.02, 0.1, 0.25, 0.5, 0.8, 1.1, 1.5, 2.0])
def test_an_interrupt_at_any_time_is_one_line(delay: float, tmp_path: Path) -> None:
    """During imports too. What is done by then may have ended, or have saved what there is."""
    arguments = ["design", EXAMPLES / "paper.toml", "-o", tmp_path / "run", "--quiet", "--no-plots"]
    process = started(*arguments)
    assert process.stderr is not None
    assert process.stderr.readline() == "ready\n"
    time.sleep(delay)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert (process.returncode, out) == (130, "")
    if (tmp_path / "run" / "design.json").exists():  # the search was interrupted, or the report of what it had found
        assert err.startswith("fisherpoint: interrupted; kept in ") and "design.json" in err and err.count("\n") == 1
    else:
        assert err in ("fisherpoint: interrupted\n", "fisherpoint: interrupted before a design was found; nothing was saved\n")


@pytest.mark.long
@pytest.mark.parametrize("cores", [2, 3])
@pytest.mark.parametrize("command", ["design", "evaluate", "estimate", "compare"])
def test_an_interrupt_of_the_drawing_keeps_what_there_is(command: str, cores: int, tmp_path: Path) -> None:
    """One picture, the last, takes for ever; those before it are there where there is another process that draws."""
    points, output = tmp_path / "points.csv", tmp_path / "run"
    points.write_text("s,y_rate\n1.1,200\n0.1,130\n0.5,190\n")
    given = [] if command == "design" else [points]
    process = started(command, EXAMPLES / "michaelis_menten.toml", *given, "-o", output, program=SLOW_PICTURES, CORES=str(cores))
    assert process.stderr is not None
    # A design's pictures begin before its last numbers are there: it is at nothing else when it awaits them.
    steps = {"slow\n", "awaited\n"}
    for line in process.stderr:
        steps.discard(line)
        if not steps:
            break
    begun = time.perf_counter()
    while cores > 2 and command != "compare" and not list(output.glob("*.png")):
        assert time.perf_counter() - begun < 60
        time.sleep(0.02)
    begun = time.perf_counter()
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=60)
    err = err.replace("slow\n", "").replace("awaited\n", "")
    assert process.returncode == 130 and err.startswith(f"fisherpoint: interrupted; kept in {output}: ") and err.count("\n") == 1
    assert time.perf_counter() - begun < 30  # the pictures take minutes
    written = {path.name for path in output.iterdir()}
    assert {"report.html", "report.txt"} <= written and written == set(err.rpartition(": ")[2].strip().split(", "))
    page = (output / "report.html").read_text()
    assert "Interrupted while pictures were drawn; missing: " in page and page.count("<figure>") == sum("png" in f for f in written)


def test_a_reader_that_leaves_is_no_error(points: Path) -> None:
    for arguments in (["--help"], ["info"], ["simulate", EXAMPLES / "paper.toml", points]):
        process = started(*arguments)
        assert process.stdout is not None and process.stderr is not None
        process.stdout.close()
        err = process.stderr.read()
        process.stderr.close()
        assert (process.wait(timeout=60), err) == (1, "ready\n")


@pytest.mark.parametrize("closed", [">&-", "2>&-", "<&-", "<&- >&- 2>&-"])
def test_closed_streams_are_no_error(closed: str, tmp_path: Path, points: Path) -> None:
    out = tmp_path / "outputs.csv"
    command = f'"{sys.executable}" -c "{PROGRAM}" simulate "{EXAMPLES / "paper.toml"}" "{points}" -o "{out}" {closed}'
    done = subprocess.run(command, shell=True, env=environment(), capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0
    assert done.stderr.removeprefix("ready\n") == ""
    assert out.read_text().startswith(HEADER.strip()) and "\n\n" not in out.read_text()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full")
def test_a_full_device_is_one_line(points: Path, tmp_path: Path) -> None:
    for arguments in (["--help"], ["info"], ["simulate", EXAMPLES / "paper.toml", points]):
        with open("/dev/full", "w") as full:
            done = subprocess.run(
                [sys.executable, "-c", PROGRAM, *map(str, arguments)],
                env=environment(),
                stdout=full,
                stderr=subprocess.PIPE,
                text=True,
                timeout=60,
                check=False,
            )
        assert (done.returncode, done.stderr) == (2, "ready\nfisherpoint: output: No space left on device\n")
    done = run("simulate", EXAMPLES / "paper.toml", points, "-o", "/dev/full")
    assert (done.returncode, done.stderr) == (2, "fisherpoint: /dev/full: No space left on device\n")


def test_nobody_to_complain_to(tmp_path: Path) -> None:
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [
                sys.executable,
                "-c",
                "from fisherpoint_command import main; main()",
                "simulate",
                str(tmp_path / "none.toml"),
                "x.csv",
            ],
            env=environment(),
            stderr=full,
            timeout=60,
            check=False,
        )
    assert done.returncode == 2


@pytest.mark.parametrize("wrong", ["v9", "nonsense \x1b[31m", ""])
def test_an_unknown_instruction_set_is_one_line(wrong: str) -> None:
    done = run("info", FISHERPOINT_ISA=wrong)
    assert (done.returncode, done.stdout) == (2, "")
    given = repr(wrong)
    assert done.stderr == f"fisherpoint: FISHERPOINT_ISA: expected one of {', '.join(fp.instruction_sets())}, given {given}\n"


def test_an_instruction_set_that_the_machine_lacks_is_one_line() -> None:
    available = ", ".join(fp.instruction_sets())
    for level in {"v2", "v3", "v4", "generic"}.difference(fp.instruction_sets()):
        done = run("info", FISHERPOINT_ISA=level)
        assert (done.returncode, done.stdout) == (2, "")
        why = "which is not installed" if level in _core.supported_isas() else "which this machine does not have"
        assert done.stderr == f"fisherpoint: FISHERPOINT_ISA: expected one of {available}, given {level!r}, {why}\n"


@pytest.mark.long
@pytest.mark.parametrize("package", ["numpy", "scipy.special", "fisherpoint.engine._core", "typer", "rich", "pydantic"])
def test_an_installation_that_is_not_whole_is_one_line(package: str, points: Path, tmp_path: Path) -> None:
    arguments = ["design", EXAMPLES / "paper.toml", "-o", tmp_path / "run", "--no-plots"]
    done = run(*arguments, program=MISSING.format(package=package))
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("fisherpoint: expected an installation that can be imported, given: ")
    assert package.rpartition(".")[2] in done.stderr and done.stderr.count("\n") == 1


def test_tables_without_their_package(points: Path, tmp_path: Path) -> None:
    simulate = ["simulate", EXAMPLES / "paper.toml", points]
    done = run(*simulate, "-o", tmp_path / "outputs.csv", program=MISSING.format(package="pandas"))
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "fisherpoint: tables: expected the package pandas, given none: pip install 'fisherpoint[all]'\n"
    assert run(*simulate, program=MISSING.format(package="pandas")).returncode == 0


def test_it_runs_as_a_module_too() -> None:
    done = subprocess.run([sys.executable, "-m", "fisherpoint", "--version"], env=environment(), capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, f"fisherpoint {fp.__version__}\n")


@pytest.mark.parametrize("arguments", ["--version", "--help", "design --help", "campaign --help"])
def test_who_asks_for_help_waits_for_no_work(arguments: str) -> None:
    done = run(*arguments.split(), program=f"import atexit, sys; atexit.register(lambda: print(*sys.modules)); {PROGRAM}")
    imported = {name.partition(".")[0] for name in done.stdout.splitlines()[-1].split()}
    assert done.returncode == 0 and {"fisherpoint", "fisherpoint_command"} <= imported
    assert not {"numpy", "scipy", "pandas", "matplotlib", "sympy"} & imported


def test_the_import_and_a_problem_need_no_slow_package() -> None:
    code = """
import sys, fisherpoint
assert "numpy" not in sys.modules
model = fisherpoint.HydraulicCylinder()
prior = fisherpoint.GaussianPrior(mean=model.nominal, relative_std=dict.fromkeys(model.nominal, 0.2))
fisherpoint.exchange, fisherpoint.design_runs, fisherpoint.estimate, fisherpoint.validate, fisherpoint.Campaign
print(*sys.modules)
"""
    done = run(program=code)
    imported = {name.partition(".")[0] for name in done.stdout.split()}
    assert done.returncode == 0 and "numpy" in imported, done.stderr
    assert not {"scipy", "pandas", "matplotlib", "sympy", "pydantic", "rich", "typer"} & imported


def test_pictures_without_their_package(tmp_path: Path) -> None:
    design = ["design", EXAMPLES / "paper.toml", "-o", tmp_path / "run", "--max-iterations", 1]
    done = run(*design, program=MISSING.format(package="matplotlib"))
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == (
        "fisherpoint: pictures: expected the package matplotlib, given none: pip install 'fisherpoint[all]', or use --no-plots\n"
    )
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(("package", "method"), [("pandas", "to_pandas"), ("matplotlib", "plot")])
def test_a_missing_extra_is_named(package: str, method: str) -> None:
    done = run(
        program=f"""
import sys
sys.modules[{package!r}] = None
import fisherpoint as fp
model = fp.model(states={{"x": "m"}}, parameters={{"k": "1/s"}}, outputs={{"y": "m"}})(lambda x, u, p: ([-p.k * x.x], [x.x]))
prior = fp.GaussianPrior(mean={{"k": 1.0}}, relative_std={{"k": 0.1}})
problem = fp.DesignProblem(model, prior, fp.ExperimentRegion(dict(x=(1, 2), dt=(0.5, 2))), noise={{"y": 0.1}})
fp.evaluate(problem, problem.region.draw(model, 3)).{method}()
"""
    )
    last = done.stderr.strip().splitlines()[-1]
    assert last == f"ModuleNotFoundError: {method}: expected the package {package}, given none: pip install 'fisherpoint[all]'"


def test_equations_without_their_package(tmp_path: Path) -> None:
    done = run("design", EXAMPLES / "box_lucas.toml", "-o", tmp_path / "run", "--no-plots", program=MISSING.format(package="sympy"))
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("fisherpoint: expected an installation that can be imported, given: ")
    assert "sympy" in done.stderr and done.stderr.endswith("; reinstall fisherpoint\n") and done.stderr.count("\n") == 1
