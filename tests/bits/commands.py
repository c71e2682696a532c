"""Commands whose files and texts are recorded: each in a directory of its own, of a number of threads."""

from __future__ import annotations

import contextlib
import io
import json
import re
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import fisherpoint as fp
from calls import EXAMPLES
from fisherpoint_command import cli

#: What is read: pictures and pages are drawn of the same numbers.
READ = {".csv", ".json", ".txt", ".toml"}

Command = Callable[[Path, int], None]

#: What is searched less, by the table of the file.
LESS = {"[design]": {"max_iterations": 2, "n_experiments": 4, "n_candidates": 10}, "[runs]": {"n_starts": 1, "segments": 3}}


DESIGNS = "{design}", "-o", "{out}"
AFTER = {
    "evaluate": DESIGNS,
    "simulate": ("{design}", "-o", "{out}.csv", "--noise"),
    "compare": ("{design}", "{other}", "-o", "{out}"),
    "validate": (*DESIGNS, "--runs", "10"),
    "sweep": ("--sizes", "2", "-o", "{out}"),
}


def commands() -> dict[str, Command]:
    """By a name each."""
    found: dict[str, Command] = {f"design {path.name}": partial(_design, path) for path in sorted(EXAMPLES.glob("*.toml"))}
    found |= {name: partial(_after, name, arguments) for name, arguments in AFTER.items()}
    found |= {f"estimate {name}": partial(_estimate, name) for name in ("battery", "robot_joint", "alpha_pinene")}
    return found | {"campaign": _campaign}


def files(directory: Path) -> Iterator[tuple[str, object]]:
    """What is in the files of a result, but for seconds and checksums."""
    for path in sorted(directory.rglob("*")):
        if path.suffix in READ:
            name = path.relative_to(directory).as_posix()
            yield name, _without_seconds(json.loads(path.read_text())) if path.suffix == ".json" else path.read_text()


def _without_seconds(data: object) -> object:
    if isinstance(data, dict):
        return {name: _without_seconds(one) for name, one in data.items() if name not in ("seconds", "sha256")}
    return [_without_seconds(one) for one in data] if isinstance(data, list) else data


def _shortened(path: Path, into: Path) -> Path:
    """The file with less to search."""
    text = path.read_text()
    table = "[runs]" if "[runs]" in text else "[design]"
    for name, value in LESS[table].items():
        text, count = re.subn(rf"(?m)^{name}\s*=.*$", f"{name} = {value}", text)
        text = text if count else text.replace(table, f"{table}\n{name} = {value}")
    into.mkdir(parents=True, exist_ok=True)
    file = into / path.name
    file.write_text(text)
    return file


def _design(path: Path, into: Path, threads: int) -> None:
    _run("design", _shortened(path, into), "-o", into / "run", threads=threads)


def _estimate(name: str, into: Path, threads: int) -> None:
    _run("estimate", EXAMPLES / f"{name}.toml", EXAMPLES / f"{name}.csv", "-o", into, threads=threads)


def _after(command: str, arguments: tuple[str, ...], into: Path, threads: int) -> None:
    """A command about points of the fed reactor."""
    file = _shortened(EXAMPLES / "fed_batch.toml", into)
    design, other = into / "design.csv", into / "other.csv"
    problem = fp.load_problem(file)
    assert isinstance(problem.region, fp.ExperimentRegion)
    for seed, path in enumerate((design, other)):
        problem.region.draw(problem.model, 8, seed=seed).to_csv(path, problem.model)
    given = [one.format(design=design, other=other, out=into / "run") for one in arguments]
    _run(command, file, *given, threads=threads)


def _campaign(into: Path, threads: int) -> None:
    """Two batches of the cylinder."""
    file = _shortened(EXAMPLES / "cylinder.toml", into)
    _run("campaign", file, "-o", into / "run", threads=threads)
    problem = fp.load_problem(file)
    batch = fp.Experiments.from_csv(into / "run" / "batch_1.csv", problem.model)
    measured = fp.VirtualRig(problem.model, dict(problem.prior.mean), dict(problem.noise or {}), seed=0).measure(batch)
    measured.to_csv(into / "measured.csv", problem.model)
    _run("campaign", file, "-o", into / "run", "--data", into / "measured.csv", threads=threads)


def _run(*arguments: object, threads: int) -> None:
    """Run a command in this process.

    Raises
    ------
    RuntimeError
        The command fails; with what it printed.
    """
    given = [*map(str, arguments), "--quiet", "--threads", str(threads)]
    given += [] if given[0] == "simulate" else ["--no-plots"]
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        try:
            cli.main(given)
        except SystemExit as end:
            if end.code:
                raise RuntimeError(f"fisherpoint {' '.join(given)}: exit code {end.code}\n{said.getvalue()}") from None
