"""The files of a run: what cannot be written is told before the work; no kill leaves a mixture of runs."""

from __future__ import annotations

import errno
import os
import re
import shutil
import tempfile
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

import fisherpoint as fp
from fisherpoint.basics.files import write_together, write_whole
from fisherpoint.design.results import evaluated_points as evaluated
from fisherpoint.design.results import pictures as plots
from fisherpoint.design.results.picture_list import PICTURES
from fisherpoint.estimation import pictures as plots_fit
from fisherpoint.estimation.picture_list import PICTURES as PICTURES_OF_A_FIT
from fisherpoint.show.style import save_figure
from fisherpoint.validation import pictures as plots_validation
from fisherpoint_command import cli

DECAY = Path(__file__).resolve().parents[2] / "examples" / "exponential_decay.toml"
COMMANDS = ("design", "evaluate", "estimate", "validate", "campaign")
LAST = {"design": "design.json", "evaluate": "report.txt", "estimate": "fit.json", "validate": "report.txt"}
"""The file of a command that stands only beside files of the same run."""


@pytest.fixture(scope="module")
def tables(decay_designs: tuple[fp.Design, fp.Design], tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Measurements of each design."""
    directory, model = tmp_path_factory.mktemp("tables"), decay_designs[0].problem.model
    for k, design in enumerate(decay_designs):
        fp.VirtualRig(model, dict(model.nominal), {"c": 0.2}, seed=k).measure(design.points).to_csv(directory / f"{k}.csv", model)
        design.points.to_csv(directory / f"points_{k}.csv", model)
    return directory / "0.csv", directory / "1.csv"


def arguments(command: str, table: Path, output: Path) -> list[str]:
    given: list[object] = {
        "design": [],
        "campaign": [],
        "estimate": [table],
        "evaluate": [table.with_name(f"points_{table.name}")],
        "validate": [table.with_name(f"points_{table.name}"), "-n", 3],
    }[command]
    quiet = [] if command == "evaluate" else ["--quiet"]
    force = [] if command == "campaign" else ["--force"]
    return [command, *map(str, [DECAY, *given, "-o", output, *quiet, *force])]


def run(*given: object) -> int:
    with pytest.raises(SystemExit) as stopped:
        cli.main(list(map(str, given)))
    return int(stopped.value.code or 0)


# --- What cannot be written ---------------------------------------------------------------------------------------------


def never(*_: Any, **__: Any) -> None:
    raise AssertionError("this is work, before which the directory is to be looked at")


@pytest.fixture
def no_work(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("exchange", "estimate", "validate", "simulate"):
        monkeypatch.setattr(fp, name, never)
    for name in ("__init__", "load"):
        monkeypatch.setattr(fp.Campaign, name, never)
    monkeypatch.setattr(evaluated, "evaluate_points", never)


def places(directory: Path) -> Iterator[tuple[Path, str]]:
    """Where no directory of a run can be."""
    file = directory / "file"
    file.touch()
    under = "which is or lies under a file"
    yield from ((file, under), (file / "run", under), (file / "deep" / "run", under))
    (directory / "link").symlink_to(directory / "link")
    yield directory / "link", ""
    yield directory / ("long" * 100), os.strerror(errno.ENAMETOOLONG)
    if Path("/proc/self").exists():
        yield from ((Path("/proc"), ""), (Path("/proc/run"), ""))  # even root can write nothing there
    if os.name == "posix" and os.geteuid():
        (directory / "mine").mkdir(mode=0o555)
        yield from ((directory / "mine", "Permission denied"), (directory / "mine" / "run", "Permission denied"))


@pytest.mark.usefixtures("no_work")
@pytest.mark.parametrize("command", COMMANDS)
def test_what_cannot_be_written_is_told_before_the_work(
    command: str, tables: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for output, message in places(tmp_path):
        assert run(*arguments(command, tables[0], output)) == 2, output
        out, err = capsys.readouterr()
        assert out == "" and err.count("\n") == 1 and str(output) in err
        assert err.startswith("fisherpoint: --output: expected a directory") and message in err


@pytest.mark.usefixtures("no_work")
@pytest.mark.parametrize("command", COMMANDS)
def test_a_directory_that_was_writable_once(
    command: str,
    tables: tuple[Path, Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def refuse(*_: Any, **__: Any) -> None:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    (tmp_path / "run").mkdir()
    monkeypatch.setattr(tempfile, "NamedTemporaryFile", refuse)
    assert run(*arguments(command, tables[0], tmp_path / "run")) == 2
    expected = f"--output: expected a directory to write to, given {tmp_path / 'run'}: Read-only file system"
    assert capsys.readouterr().err == f"fisherpoint: {expected}\n"


@pytest.mark.usefixtures("no_work")
def test_a_file_that_cannot_be_written_is_told_before_the_work(
    tables: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").touch()
    outputs = [tmp_path, tmp_path / "nowhere" / "out.csv", tmp_path / "file" / "out.csv"]
    if Path("/proc/self").exists():
        outputs.append(Path("/proc/out.csv"))
    for output in outputs:
        assert run("simulate", DECAY, tables[0].with_name("points_0.csv"), "-o", output) == 2
        out, err = capsys.readouterr()
        assert out == "" and err.count("\n") == 1
        assert err.startswith("fisherpoint: --output: expected a file") and str(output) in err


def test_looking_whether_a_directory_can_be_written_leaves_nothing(tables: tuple[Path, Path], tmp_path: Path) -> None:
    assert run("simulate", DECAY, tables[0].with_name("points_0.csv"), "-o", tmp_path / "out.csv") == 0
    assert [path.name for path in tmp_path.iterdir()] == ["out.csv"]


# --- Kills --------------------------------------------------------------------------------------------------------------


class Killed(BaseException):
    """A process ends here: nothing after it has an effect on files."""


@contextmanager
def killed_at(step: int) -> Iterator[list[str]]:
    """Let a process end before it puts or removes a file for the time `step`; yields the names of those until then."""
    replace, unlink, done, dead = os.replace, os.unlink, [], False

    def or_die(act: Callable[[], None], name: object) -> None:
        nonlocal dead
        dead = dead or len(done) == step
        if dead:
            raise Killed
        act()
        done.append(Path(str(name)).name)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "replace", lambda part, target: or_die(lambda: replace(part, target), target))
        patch.setattr(os, "unlink", lambda path: or_die(lambda: unlink(path), path))
        yield done


def files(directory: Path) -> dict[str, bytes]:
    """What is in the directory, without the parts that a killed process leaves, and a page without its command, which names it."""
    found = {path.name: path.read_bytes() for path in directory.iterdir() if path.suffix != ".part"}
    return {name: re.sub(rb"<pre>fisherpoint .*?</pre>", b"", content) for name, content in found.items()}


class Runs:
    """Two runs of a command with different results, which take no time."""

    def __init__(self, command: str, tables: tuple[Path, Path], decay_designs: tuple[fp.Design, fp.Design]) -> None:
        self.command, self.tables, self.designs = command, tables, decay_designs
        self.found: dict[int, Any] = {}

    def work(self, which: int, function: Callable[..., Any]) -> Callable[..., Any]:
        def once(*given: Any, **settings: Any) -> Any:
            if which not in self.found:
                self.found[which] = function(*given, **settings)
            return self.found[which]

        return once

    def __call__(self, which: int, output: Path) -> None:
        def savefig(figure: Figure, target: Any, *, format: str, **_: Any) -> None:
            vector = format == "svg"
            target.write(b'<svg xmlns="http://www.w3.org/2000/svg">%d</svg>' % which if vector else b"picture of run %d" % which)

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(Figure, "savefig", savefig)
            for module in (plots, plots_fit, plots_validation):
                for name in (name for name in vars(module) if name.startswith("plot_")):
                    patch.setattr(module, name, lambda *_: Figure())
            patch.setattr("fisherpoint.design.points.exchange.designs", lambda *_, **__: iter([self.designs[which]]))
            for name in ("estimate", "validate"):
                patch.setattr(fp, name, self.work(which, getattr(fp, name)))
            assert run(*arguments(self.command, self.tables[which], output)) == 0

    def is_detectable(self, directory: Path, *whole: dict[str, bytes]) -> None:
        """What is there is of one run, or has no last file, and then no report and no pictures either."""
        found, last = files(directory), LAST[self.command]
        if last in found:
            (own,) = [one for one in whole if one[last] == found[last]]
            assert found.items() <= own.items()
            assert {name for name in own if name.endswith((".csv", ".json"))} <= set(found)
        else:
            assert not {name for name in found if not name.endswith(".csv")}
        for name, content in found.items():
            assert content in [one[name] for one in whole]
        if self.command == "design" and last in found:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                assert fp.Design.load(directory).points in [design.points for design in self.designs]


@pytest.mark.long
@pytest.mark.parametrize("before", [True, False], ids=["over another run", "alone"])
@pytest.mark.parametrize("command", LAST)
def test_a_run_that_is_killed_at_any_file_leaves_no_mixture(
    command: str, before: bool, tables: tuple[Path, Path], decay_designs: tuple[fp.Design, fp.Design], tmp_path: Path
) -> None:
    runs = Runs(command, tables, decay_designs)
    for which in (0, 1):
        runs(which, tmp_path / str(which))
    whole = [files(tmp_path / str(which)) for which in (0, 1)]
    assert all(whole[0][name] != whole[1][name] for name in whole[0]), "each file tells the runs apart"
    for step in range(100):
        directory = tmp_path / f"killed at {step}"
        if before:
            shutil.copytree(tmp_path / "0", directory)
        with killed_at(step) as done:
            try:
                runs(1, directory)
            except Killed:
                runs.is_detectable(directory, *whole)
            else:
                break
        runs(1, directory)
        assert files(directory) == whole[1]
    removed = [name for name in whole[0] if not name.endswith(".csv")] if before else []
    assert sorted(done) == sorted([*removed, *whole[1]])


def test_a_run_without_pictures_leaves_none_of_another(
    tables: tuple[Path, Path], decay_designs: tuple[fp.Design, fp.Design], tmp_path: Path
) -> None:
    for command in ("design", "estimate", "validate"):
        Runs(command, tables, decay_designs)(0, tmp_path / command)
        (tmp_path / command / "mine.png").write_text("stays")
        assert run(*arguments(command, tables[1], tmp_path / command), "--no-plots") == 0
        assert [path.name for path in (tmp_path / command).glob("*.png")] == ["mine.png"]


@pytest.mark.parametrize("command", LAST)
def test_a_campaign_is_never_replaced(
    command: str, tables: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    directory = tmp_path / "campaign"
    assert run("campaign", DECAY, "-o", directory, "--no-plots", "--quiet") == 0
    before = files(directory)
    capsys.readouterr()
    given = arguments(command, tables[0], directory)
    assert given[-1] == "--force" and run(*given) == 2 and files(directory) == before
    told = capsys.readouterr().err
    assert told.count("\n") == 1 and f"expected a directory without a campaign, given {directory}, which has campaign.json" in told


@pytest.mark.long
@pytest.mark.parametrize("command", LAST)
def test_no_result_is_replaced_unless_it_is_asked_for(
    command: str,
    tables: tuple[Path, Path],
    decay_designs: tuple[fp.Design, fp.Design],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    directory, runs = tmp_path / "run", Runs("design", tables, decay_designs)
    runs(0, directory)
    before = files(directory)
    capsys.readouterr()
    *given, force = arguments(command, tables[1], directory)
    assert force == "--force" and run(*given) == 2
    expected = f"--output: expected a directory without a result, given {directory}, which has design.json, report.txt"
    assert capsys.readouterr().err == f"fisherpoint: {expected}; --force replaces it\n" and files(directory) == before

    assert run(*(word for word in [*given, force] if word != "--quiet")) == 0
    after, out = files(directory), capsys.readouterr().out
    gone = [name for name in before if name not in after]
    assert all(name in out.split("of the result before: ")[1] for name in gone) if gone else "result before" not in out
    assert {"validate": "points.png", "estimate": "points.png", "evaluate": "criterion.png"}.get(command, "") in ["", *gone]
    assert all(after[name] != before[name] for name in after if name in before and name not in ("design.csv", "design.json"))


def test_files_that_only_have_the_names_of_pictures_stay(decay_designs: tuple[fp.Design, fp.Design], tmp_path: Path) -> None:
    """Where there was no design before."""
    (tmp_path / "points.png").write_text("a holiday")
    decay_designs[0].save(tmp_path)
    assert set(files(tmp_path)) == {"points.png", "design.csv", "design.json"}


def test_all_pictures_are_known(tables: tuple[Path, Path], tmp_path: Path) -> None:
    assert run(*arguments("design", tables[0], tmp_path / "design")) == 0
    assert {path.name for path in (tmp_path / "design").glob("*.png")} == set(PICTURES)
    record = tmp_path / "record.csv"
    record.write_text("t,c\n" + "".join(f"{t},{20 * np.exp(-1e-3 * t) + 0.01 * (-1) ** t}\n" for t in range(0, 3000, 300)))
    assert run("estimate", DECAY, record, "-o", tmp_path / "fit", "--profiles", "--quiet") == 0
    assert {path.name for path in (tmp_path / "fit").glob("*.png")} == set(PICTURES_OF_A_FIT) - {
        "local.png"
    }  # of fits with local parameters alone


def test_what_fails_leaves_everything_as_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_together(tmp_path, {"a.csv": "1", "b.json": "1"})
    (tmp_path / "picture.png").write_text("1")
    before, fsync, calls = files(tmp_path), os.fsync, 0

    def full(descriptor: int) -> None:
        nonlocal calls
        calls += 1
        if calls == 2:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        fsync(descriptor)

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", full)
        with pytest.raises(OSError, match=r"No space left on device: .*b\.json'"):
            write_together(tmp_path, {"a.csv": "2", "b.json": "2"}, stale=["picture.png"])
    assert files(tmp_path) == before and not list(tmp_path.glob(".*"))
    (tmp_path / "c.csv").mkdir()
    with pytest.raises(IsADirectoryError, match=r"c\.csv"):
        write_together(tmp_path, {"a.csv": "2", "c.csv": "2", "b.json": "2"}, stale=["picture.png"])
    (tmp_path / "c.csv").rmdir()
    assert files(tmp_path) == before and not list(tmp_path.glob(".*"))


def test_of_links_the_files_are_replaced(tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "b.json").symlink_to(tmp_path / "elsewhere" / "b.json")
    for text in ("1", "2"):
        write_together(tmp_path, {"a.csv": text, "b.json": text})
        assert (tmp_path / "b.json").is_symlink() and (tmp_path / "elsewhere" / "b.json").read_text() == text


# --- Pictures -----------------------------------------------------------------------------------------------------------


def test_pictures_are_written_whole_in_the_format_of_their_ending(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, begin in (("a.png", b"\x89PNG"), ("a.PDF", b"%PDF"), ("a.svg", b"<?xml"), ("b", b"\x89PNG")):
        save_figure(Figure(), tmp_path / name)
        assert (tmp_path / (name if "." in name else f"{name}.png")).read_bytes().startswith(begin)
    for name in ("a.toml", "a.p\x1bng"):
        with pytest.raises(ValueError, match=r"^path: expected the ending of a picture, one of .*png.*; given '\.") as caught:
            save_figure(Figure(), tmp_path / name)
        assert str(caught.value).isprintable()
    before = files(tmp_path)
    figure = Figure()
    figure.text(0.5, 0.5, "another")
    with killed_at(0), pytest.raises(Killed):
        save_figure(figure, tmp_path / "a.png")
    assert files(tmp_path) == before

    def breaks(*_: Any, **__: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Figure, "draw", breaks)
    with pytest.raises(KeyboardInterrupt):
        save_figure(figure, tmp_path / "a.png")
    assert files(tmp_path) == before


def test_bytes_and_text_are_written_as_they_are(tmp_path: Path) -> None:
    write_whole(tmp_path / "text", "é\r\n")
    write_whole(str(tmp_path / "bytes"), b"\x00\xff")
    assert files(tmp_path) == {"text": "é\r\n".encode(), "bytes": b"\x00\xff"}


def test_files_of_a_run_do_not_take_the_place_of_a_pipe(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "b.json")
    with pytest.raises(OSError, match=r"Invalid argument: .*b\.json"):
        write_together(tmp_path, {"a.csv": "1\n", "b.json": "{}\n"})
    assert os.listdir(tmp_path) == ["b.json"] and (tmp_path / "b.json").is_fifo()
