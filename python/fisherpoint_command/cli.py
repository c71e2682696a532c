"""The command line, ``fisherpoint``: its commands, and how it ends."""

from __future__ import annotations

import io
import os
import sys
import warnings
from collections.abc import Callable, Sequence
from inspect import getdoc
from time import perf_counter
from typing import Annotated

import typer

import fisherpoint as fp
from fisherpoint.basics.interrupts import WorkersLost
from fisherpoint.basics.standard_input import hold_standard_input

from .argv import ARGUMENTS, is_quiet
from .browse import browse
from .campaign import campaign
from .compare import compare
from .design import design
from .estimate import estimate
from .exits import INTERRUPTED, MISUSE, READER_LEFT, complain, why_not_imported
from .heartbeat import Sign
from .importing import importing
from .init import init
from .partial_output import WRITING, kept
from .points import evaluate, simulate
from .sweep import sweep
from .validate import validate

app = typer.Typer(
    help="Which short experiments to run so that the parameters of a nonlinear state space model come out precise.",
    epilog="Example: fisherpoint design examples/cylinder.toml -o run/",
    add_completion=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
)


def _version(requested: bool) -> None:
    if requested:
        print(f"fisherpoint {fp.__version__}")
        raise typer.Exit


@app.callback()
def _main(
    show_version: Annotated[bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")] = False,
) -> None:
    """Which short experiments to run so that the parameters of a nonlinear state space model come out precise."""


def info() -> int:
    """Show versions and the instruction set in use."""
    import platform
    from importlib.metadata import PackageNotFoundError, version

    instructions = f"{fp.instruction_set()} (available: {', '.join(fp.instruction_sets())})"
    print(f"fisherpoint      {fp.__version__}")
    print(f"instruction set  {instructions}")
    print(f"processors       {os.cpu_count()}")
    print(f"Python           {platform.python_version()} on {platform.system()} {platform.machine()}")
    for package in ("numpy", "scipy", "sympy", "pydantic", "typer", "rich", "pandas", "matplotlib"):
        try:
            print(f"{package:<15}  {version(package)}")
        except PackageNotFoundError:
            print(f"{package:<15}  not installed")
    return 0


COMMANDS: tuple[tuple[str, Callable[..., int], str], ...] = (
    ("design", design, "examples/cylinder.toml -o run/"),
    ("evaluate", evaluate, "examples/cylinder.toml run/design.csv"),
    ("sweep", sweep, "examples/cylinder.toml -L 9:30 -o sizes/"),
    ("compare", compare, "examples/cylinder.toml run/design.csv other/design.csv"),
    ("simulate", simulate, "examples/cylinder.toml run/design.csv -o outputs.csv"),
    ("estimate", estimate, "examples/cylinder.toml measured.csv -o fit/"),
    ("validate", validate, "examples/cylinder.toml run/design.csv -o validated/"),
    ("campaign", campaign, "examples/cylinder.toml -o run/ --data measured.csv"),
    ("init", init, "--example exponential_decay"),
    ("open", browse, "run/"),
    ("info", info, ""),
)
"""Names, functions and the arguments of examples."""

for _name, _function, _example in COMMANDS:
    _paragraphs = (getdoc(_function) or "").split("\n\n")
    app.command(
        _name,
        # A line of a docstring is no line of the terminal, and what is in brackets is no markup.
        help="\n\n".join(" ".join(paragraph.split()).replace("[", "\\[") for paragraph in _paragraphs),
        epilog=f"Example: fisherpoint {_name} {_example}".rstrip(),
    )(_function)


def main(arguments: Sequence[str] | None = None) -> None:
    """Entry point: run a command and exit with its code, with one line on standard error where it fails."""
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal that cannot show a line of a table shows a mark
    ARGUMENTS.set(arguments)
    Sign.last = perf_counter()
    hold_standard_input(None)
    WRITING.set(None)
    with warnings.catch_warnings():
        warnings.showwarning = _show_warning
        code = _run(arguments or ["--help"])
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:
            # It was reported; without this Python complains once more when it flushes at exit.
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
    sys.exit(code)


def _show_warning(message: Warning | str, *_: object, **__: object) -> None:
    complain(f"warning: {message}")


COMPLETING = "_FISHERPOINT_COMPLETE"

HELP = {"-h", "--help", "--version"}


def _run(arguments: list[str]) -> int:
    try:
        command = typer.main.get_command(app)
        if COMPLETING in os.environ:  # a shell asks what may come next
            command.main(arguments, prog_name="fisherpoint")
        if "" in arguments or any(given.endswith("=") for given in arguments):
            from .usage import empty_value

            if wrong := empty_value(arguments):
                return _fail(wrong)
        if not HELP.intersection(arguments):
            with importing():
                from pydantic import BaseModel, BeforeValidator, TypeAdapter  # noqa: F401  as typer does when a command begins
        with command.make_context("fisherpoint", arguments) as context:  # typer's own way ends without a word at Ctrl-C
            code: int = command.invoke(context) or 0
        if code == INTERRUPTED and is_quiet() and (there := kept()):  # else what it has printed says so
            complain(f"interrupted; {there}")
        sys.stdout.flush()
        return code
    except typer.Exit as left:  # after --help and --version
        return left.exit_code
    except KeyboardInterrupt:
        return _interrupted()
    except typer.TyperException as error:
        from .usage import usage_error

        return _fail(usage_error(error))
    except ImportError as error:
        if _came_of_an_interrupt(error):
            return _interrupted()
        why = why_not_imported(error)
        return _fail(f"{why}, or use --no-plots" if error.name == "matplotlib" else why)
    except BrokenPipeError:  # the reader of a pipe has left
        return READER_LEFT
    except MemoryError:
        return _fail("expected a task that fits into memory, given one that does not: fewer points, candidates or nodes")
    except OSError as error:
        return _fail(f"{error.filename or 'output'}: {error.strerror or error}")
    except (ValueError, TypeError, WorkersLost) as error:
        return _fail(*getattr(error, "lines", [str(error)]))


def _interrupted() -> int:
    there = kept()
    complain(f"interrupted; {there}" if there else "interrupted")
    return INTERRUPTED


def _came_of_an_interrupt(error: BaseException | None) -> bool:
    """Whether Ctrl-C is behind an error: modules that are not written in Python fail to import then."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error is not None


def _fail(*lines: str) -> int:
    complain(*lines)
    return MISUSE


if __name__ == "__main__":
    main()
