"""The cache of compiled models: what others could have written does not run, what is damaged is built anew.

A script stands in for the compiler: it hands out a library that was built before.
"""

from __future__ import annotations

import os
import re
import shutil
import signal
import stat
import subprocess
import sys
import textwrap
import time
import warnings
from pathlib import Path
from typing import Any

import pytest

import fisherpoint as fp
from fisherpoint.engine import _core
from fisherpoint.models import compiled as building
from fisherpoint.models import library_cache

COMPILER = building.find_compiler()
pytestmark = pytest.mark.skipif(COMPILER is None, reason="no C++ compiler")

MODEL = """
import fisherpoint as fp
decay = fp.SymbolicModel(["-k*c"], ["c"], {"c": "mol/L"}, {}, {"k": "1/s"}, {"c": "mol/L"})
"""


def shared_object(path: Path, more: str = "", version: str = "fisherpoint_interface_version") -> Path:
    source = path.with_suffix(".cpp")
    source.write_text(
        f"""#include "fisherpoint/compiled/c_interface.hpp"
static const FisherpointKernels kernels{{{version}, nullptr, nullptr, nullptr, nullptr}};
extern "C" const FisherpointKernels* fisherpoint_kernels() {{ return &kernels; }}
{more}
"""
    )
    command = [str(COMPILER), "-std=c++20", f"-I{building._include_directory()}", "-shared", "-fPIC", "-o", path, source]
    subprocess.run(command, check=True)
    return path


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return shared_object(tmp_path_factory.mktemp("library") / "library.so")


@pytest.fixture
def compiler(library: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A compiler that is done at once; what it links is counted in the file linked."""
    return stand_in(f'case "$1" in -shared) cp {library} library.so; echo . >> {tmp_path}/linked ;; esac', tmp_path, monkeypatch)


def stand_in(commands: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    script = tmp_path / "compiler"
    script.write_text(f'#!/bin/sh\n[ "$1" = --version ] && {{ echo stand-in 1.0; exit; }}\n{commands}\n')
    script.chmod(0o755)
    monkeypatch.setenv("CXX", str(script))
    return script


def linked(tmp_path: Path) -> int:
    return len((tmp_path / "linked").read_text().split()) if (tmp_path / "linked").exists() else 0


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("FISHERPOINT_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(library_cache, "_private", None)
    return tmp_path / "cache"


@pytest.fixture(scope="module")
def decay() -> fp.SymbolicModel:
    names: dict[str, Any] = {}
    exec(MODEL, names)
    model: fp.SymbolicModel = names["decay"]
    return model


def compiles(model: fp.SymbolicModel, remark: str | None = None) -> None:
    """The model is compiled, with exactly one warning that matches the remark, or none."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        assert model.compile().compiled
    texts = [str(warning.message) for warning in caught]
    assert len(texts) == (remark is not None), texts
    if remark is not None:
        assert re.search(remark, texts[0]) and texts[0].startswith("compile: expected "), texts
        assert "\n" not in texts[0]


def run(program: str, *arguments: object) -> subprocess.CompletedProcess[str]:
    environment = os.environ | {"PYTHONPATH": str(Path(fp.__file__).parents[1])}
    command = [sys.executable, "-c", MODEL + textwrap.dedent(program), *map(str, arguments)]
    return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60, check=False)


def entry(cache: Path) -> Path:
    (path,) = cache.iterdir()
    return path


@pytest.mark.usefixtures("compiler")
def test_an_entry_is_built_once_and_nobody_else_can_write_to_it(decay: fp.SymbolicModel, cache: Path, tmp_path: Path) -> None:
    before = os.umask(0)
    try:
        for _ in range(2):
            compiles(decay)
    finally:
        os.umask(before)
    assert linked(tmp_path) == 1
    for path in (cache, entry(cache)):
        assert not path.stat().st_mode & (stat.S_IRWXG | stat.S_IRWXO)


def planted(cache: Path, own: Path, tmp_path: Path) -> Path:
    """Put a library that tells when it is loaded in the place of the own one, with a name that fits its content."""
    mark = tmp_path / "ran"
    foreign = shared_object(
        tmp_path / "foreign.so",
        f'#include <cstdio>\n__attribute__((constructor)) void ran() {{ std::fclose(std::fopen("{mark}", "w")); }}',
    )
    digest = library_cache.hashlib.sha256(foreign.read_bytes()).hexdigest()
    key = own.name.split(".")[0]
    own.unlink()
    shutil.copy(foreign, cache / f"{key}.{digest}.so")
    (cache / f"{key}.{digest}.so").chmod(0o600)
    return mark


@pytest.mark.usefixtures("compiler")
def test_a_planted_library_that_one_could_have_written_runs(decay: fp.SymbolicModel, cache: Path, tmp_path: Path) -> None:
    """Or else the tests below would show nothing."""
    compiles(decay)
    mark = planted(cache, entry(cache), tmp_path)
    compiles(decay)
    assert mark.exists() and linked(tmp_path) == 1


@pytest.mark.usefixtures("compiler")
@pytest.mark.parametrize("mode", [0o777, 0o770, 0o1777])
def test_a_directory_to_which_others_can_write_is_left_alone(
    decay: fp.SymbolicModel, cache: Path, tmp_path: Path, mode: int
) -> None:
    compiles(decay)
    mark = planted(cache, entry(cache), tmp_path)
    cache.chmod(mode)
    for _ in range(2):
        compiles(decay, f"which others can write to .mode {mode:o}, .*last as long as this process")
    assert not mark.exists()
    assert linked(tmp_path) == 2  # once in the cache, once in the process' own directory
    cache.chmod(0o700)


@pytest.mark.usefixtures("compiler")
def test_so_is_one_below_such_a_directory(decay: fp.SymbolicModel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(library_cache, "_private", None)
    above = tmp_path / "above"
    cache = above / "cache"
    monkeypatch.setenv("FISHERPOINT_CACHE", str(cache))
    compiles(decay)
    mark = planted(cache, entry(cache), tmp_path)
    above.chmod(0o777)
    compiles(decay, "above, which others can write to")
    assert not mark.exists()


@pytest.mark.usefixtures("compiler")
@pytest.mark.parametrize("mode", [0o666, 0o620])
def test_a_library_to_which_others_could_write_is_built_anew(
    decay: fp.SymbolicModel, cache: Path, tmp_path: Path, mode: int
) -> None:
    compiles(decay)
    mark = planted(cache, entry(cache), tmp_path)
    entry(cache).chmod(mode)
    compiles(decay, "which others can write to .*built again")
    assert not mark.exists() and linked(tmp_path) == 2
    compiles(decay)
    assert linked(tmp_path) == 2


@pytest.mark.usefixtures("compiler")
def test_what_belongs_to_another_user_does_not_run(
    decay: fp.SymbolicModel, cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    compiles(decay)
    mark = planted(cache, entry(cache), tmp_path)
    if os.geteuid() == 0:
        os.chown(entry(cache), 12345, 12345)
        compiles(decay, "belongs to user 12345; it is built again")
        os.chown(cache, 12345, 12345)
        compiles(decay, "belongs to user 12345; compiled models last")
    else:
        monkeypatch.setattr(os, "geteuid", lambda: 12345)
        with pytest.warns(UserWarning, match="stays interpreted"):
            assert not decay.compile().compiled
    assert not mark.exists()


@pytest.mark.usefixtures("compiler")
def test_a_link_is_not_followed(decay: fp.SymbolicModel, cache: Path, tmp_path: Path) -> None:
    compiles(decay)
    own = entry(cache)
    mark = planted(cache, own, tmp_path)
    shutil.move(entry(cache), tmp_path / "elsewhere.so")
    own.symlink_to(tmp_path / "elsewhere.so")
    compiles(decay, "which is a link")
    assert not mark.exists()


@pytest.mark.usefixtures("compiler")
def test_a_library_that_was_cut_off_is_built_anew(decay: fp.SymbolicModel, cache: Path, tmp_path: Path) -> None:
    compiles(decay)
    # In a process of its own, which a library that is cut off would end.
    program = """
        import sys, warnings
        from pathlib import Path
        path, whole = Path(sys.argv[1]), Path(sys.argv[1]).read_bytes()
        for length in (0, 1, 63, 64, 1000, 4096, len(whole) // 2, len(whole) - 1):
            path.unlink()
            path.write_bytes(whole[:length])
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                compiled = decay.compile().compiled
            told = [str(warning.message).endswith("which was cut off or changed; it is built again") for warning in caught]
            print(compiled, told, path.read_bytes() == whole)
    """
    done = run(program, entry(cache))
    assert (done.returncode, done.stdout.splitlines()) == (0, 8 * ["True [True] True"]), done.stderr
    assert linked(tmp_path) == 9


@pytest.mark.usefixtures("compiler")
def test_a_library_with_a_changed_byte_is_built_anew(decay: fp.SymbolicModel, cache: Path) -> None:
    compiles(decay)
    path = entry(cache)
    whole = path.read_bytes()
    path.unlink()  # the file itself is in use by this process
    path.write_bytes(whole[:200] + bytes([whole[200] ^ 1]) + whole[201:])
    compiles(decay, "cut off or changed")
    assert entry(cache).read_bytes() == whole


@pytest.mark.usefixtures("compiler")
def test_a_library_that_does_not_load_is_built_anew(decay: fp.SymbolicModel, cache: Path) -> None:
    compiles(decay)
    path = entry(cache)
    whole, text = path.read_bytes(), b"no library at all"
    path.unlink()
    (cache / f"{path.name.split('.')[0]}.{library_cache.hashlib.sha256(text).hexdigest()}.so").write_bytes(text)
    compiles(decay, "expected a library as it was built, given .*; it is built again")
    assert entry(cache).read_bytes() == whole


@pytest.mark.usefixtures("compiler")
def test_a_library_with_another_interface_is_built_anew(decay: fp.SymbolicModel, cache: Path, tmp_path: Path) -> None:
    compiles(decay)
    path = entry(cache)
    whole, other = path.read_bytes(), shared_object(tmp_path / "other.so", version="1000").read_bytes()
    path.unlink()
    (cache / f"{path.name.split('.')[0]}.{library_cache.hashlib.sha256(other).hexdigest()}.so").write_bytes(other)
    compiles(decay, r"expected version \d+ of the kernels' interface, given 1000; it is built again")
    assert entry(cache).read_bytes() == whole


def test_a_library_without_kernels_is_refused(decay: fp.SymbolicModel, tmp_path: Path) -> None:
    subprocess.run([str(COMPILER), "-shared", "-fPIC", "-x", "c++", "/dev/null", "-o", tmp_path / "empty.so"], check=True)
    with pytest.raises(RuntimeError, match=r"empty.so: expected the function fisherpoint_kernels, given none"):
        _core.CompiledModel(decay.core, str(tmp_path / "empty.so"))


@pytest.mark.usefixtures("compiler", "cache")
@pytest.mark.parametrize("where", ["/proc/nowhere/cache", "file/cache", None])
def test_without_a_directory_the_kernels_last_as_long_as_the_process(
    decay: fp.SymbolicModel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, where: str | None
) -> None:
    (tmp_path / "file").write_text("")
    if where is None:

        def no_home() -> Path:
            raise RuntimeError("Could not determine home directory.")

        monkeypatch.delenv("FISHERPOINT_CACHE")
        monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
        monkeypatch.setattr(Path, "home", no_home)
    else:
        monkeypatch.setenv("FISHERPOINT_CACHE", str(tmp_path / where))
    compiles(decay, "FISHERPOINT_CACHE can name another directory")


@pytest.mark.usefixtures("compiler", "cache")
def test_without_any_directory_it_stays_interpreted(decay: fp.SymbolicModel, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", "/proc/nowhere")
    with pytest.warns(UserWarning, match="compile: .* the model stays interpreted"):
        assert not decay.compile().compiled


def test_processes_that_build_the_same_at_once(library: Path, cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stand_in(f'case "$1" in -shared) sleep 1; cp {library} library.so; echo . >> {tmp_path}/linked ;; esac', tmp_path, monkeypatch)
    environment = os.environ | {"PYTHONPATH": str(Path(fp.__file__).parents[1])}
    command = [sys.executable, "-W", "error", "-c", MODEL + "print(decay.compile().compiled)"]
    processes = [subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    assert [process.communicate(timeout=60)[0] for process in processes] == ["True\n", "True\n"]
    assert linked(tmp_path) == 2
    assert entry(cache).suffix == ".so"


def heed_signals() -> None:
    """As in a shell's foreground: its background jobs start with SIGINT ignored, and those of nohup with SIGHUP."""
    for one in (signal.SIGINT, signal.SIGHUP):
        signal.signal(one, signal.SIG_DFL)


@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL, signal.SIGHUP])
def test_a_signal_ends_the_compilers_too(sent: int, cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    of_its_own = "echo > $TMPDIR/of_a_compiler.s"
    stand_in(f"{of_its_own}; echo $$ >> {tmp_path}/started; sleep 600 & echo $! >> {tmp_path}/started; wait", tmp_path, monkeypatch)
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setenv("TMPDIR", str(temporary))
    environment = os.environ | {"PYTHONPATH": str(Path(fp.__file__).parents[1])}
    process = subprocess.Popen(
        [sys.executable, "-c", MODEL + "decay.compile()"],
        env=environment,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=heed_signals,
    )
    deadline = time.monotonic() + 540  # before the stand-in ends by itself: how busy the machine is decides nothing
    while not (tmp_path / "started").exists() or len((tmp_path / "started").read_text().split()) < 2:
        assert time.monotonic() < deadline
        time.sleep(0.05)
    process.send_signal(sent)
    errors = process.communicate(timeout=540)[1]
    assert not cache.exists()
    if sent == signal.SIGINT:
        assert errors.strip().endswith("KeyboardInterrupt") and not list(temporary.iterdir())
    while any(map(is_running, (tmp_path / "started").read_text().split())) or list(temporary.iterdir()):
        assert time.monotonic() < deadline
        time.sleep(0.05)


@pytest.mark.usefixtures("compiler")
@pytest.mark.parametrize("sent", [None, signal.SIGTERM, signal.SIGKILL])
def test_a_library_of_the_process_goes_with_it(sent: int | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FISHERPOINT_CACHE", "/proc/nowhere")
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setenv("TMPDIR", str(temporary))
    environment = os.environ | {"PYTHONPATH": str(Path(fp.__file__).parents[1])}
    script = (
        MODEL
        + f"""
import os, time, warnings
warnings.simplefilter("ignore", UserWarning)
print(decay.compile().compiled, len(os.listdir({str(temporary)!r})), flush=True)
if os.fork() == 0:
    raise SystemExit  # what is the parent's stays
os.wait()
print(len(os.listdir({str(temporary)!r})), flush=True)
time.sleep({0 if sent is None else 600})
"""
    )
    process = subprocess.Popen([sys.executable, "-W", "error", "-c", script], env=environment, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert [process.stdout.readline() for _ in range(2)] == ["True 1\n", "1\n"]
    if sent is not None:
        process.send_signal(sent)
    process.communicate(timeout=60)
    deadline = time.monotonic() + 120
    while list(temporary.iterdir()):
        assert time.monotonic() < deadline
        time.sleep(0.05)


def is_running(process: str) -> bool:
    try:
        return "Z (zombie)" not in Path(f"/proc/{process}/status").read_text()
    except (FileNotFoundError, ProcessLookupError):
        return False


def test_a_key_is_of_all_that_decides_what_is_built(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    header = tmp_path / "include" / "fisherpoint" / "deep" / "one.hpp"
    header.parent.mkdir(parents=True)
    header.write_text("int one();")
    sources, flags = {"model.hpp": "struct M;"}, ["-O3", "-march=x86-64-v3"]
    script = stand_in("true", tmp_path, monkeypatch)

    def key(flags: list[str] = flags, sources: dict[str, str] = sources) -> str:
        return building._key(str(script), flags, sources, tmp_path / "include")

    first = key()
    assert key() == first
    keys = {first, key(flags=["-O3", "-march=x86-64-v4"]), key(sources={"model.hpp": "struct N;"})}
    header.write_text("int two();")
    keys.add(key())
    script.write_text(script.read_text().replace("1.0", "2.0"))
    keys.add(key())
    assert len(keys) == 5


def test_a_compiler_is_told_by_its_first_error_and_its_last_lines(
    decay: fp.SymbolicModel, cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stand_in(
        r"printf 'in file\nmodel.hpp:3: error: first thing\nmore\nand more\nlast but two\n\033[31mkilled\nended\n' >&2; exit 4",
        tmp_path,
        monkeypatch,
    )
    expected = r"error: first thing; last but two; \x1b[31mkilled; ended; the model stays interpreted"
    with pytest.warns(UserWarning, match=re.escape(expected)):
        assert not decay.compile().compiled
    assert not cache.exists()
    for script in ("exit 3", "kill -9 $$"):
        stand_in(script, tmp_path, monkeypatch)
        with pytest.warns(UserWarning, match="exit status -?[39]; the model stays interpreted"):
            assert not decay.compile().compiled


@pytest.mark.parametrize("text", ["#!/bin/sh\nexit 1\n", "no program"])
def test_a_compiler_that_is_none_is_told(
    decay: fp.SymbolicModel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str
) -> None:
    script = stand_in("", tmp_path, monkeypatch)
    script.write_text(text)
    with pytest.warns(UserWarning, match="compile: expected .*compiler to build the model, given: .*; the model stays interpreted"):
        assert not decay.compile().compiled
