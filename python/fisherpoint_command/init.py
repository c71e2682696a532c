"""``fisherpoint init``: a commented file to begin with, of an example or for a model."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fisherpoint.basics.standard_input import STANDARD_INPUT

from .importing import importing
from .standard_input import one_from_standard_input


def init(
    model: Annotated[
        Path | None,
        typer.Argument(metavar="[MODEL.toml]", callback=one_from_standard_input, help="A file with a model to write one for."),
    ] = None,
    example: Annotated[str | None, typer.Option(metavar="NAME", help="Write this example.")] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FILE.toml", help="File to write; - for standard output.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace a file that is there.")] = False,
) -> int:
    """Write a commented TOML file to begin with: an example, or for a model with guesses of all that a design needs besides.

    Without an argument, examples are listed. The file is written to NAME.toml, or to MODEL_problem.toml; beside an example that has
    measurements, these to NAME.csv.
    """
    with importing():
        from fisherpoint.basics.files import write_whole
        from fisherpoint.basics.messages import listed
        from fisherpoint.basics.toml_mistakes import choices
        from fisherpoint.design.file.configuration import ConfigError
        from fisherpoint.design.file.first_file import example_texts, first_file

        from .argv import shell_line
        from .terminal import check_file, say
    texts = example_texts()
    if model is not None and example is not None:
        raise ConfigError(f"--example: expected none beside a model, given {example} and {model}")
    if model is None and example is None:
        if output is not None:
            raise ConfigError(f"--output: expected a model or --example with it, given {output} alone")
        width = max(map(len, texts))
        for name, text in texts.items():
            say(f"{name:<{width}}  {text.partition(chr(10))[0].lstrip('# ')}")
        return 0
    if example is not None and example not in texts:
        raise ConfigError(f"--example: expected one of {choices(texts, example)}, given {example}")
    if output is None:
        stem = "model" if model == STANDARD_INPUT else model.stem if model is not None else ""
        output = Path(f"{stem}_problem.toml" if stem else f"{example}.toml")
    to_standard_output = str(output) == "-"
    measured = example_texts(".csv").get(example or "")  # which some examples come with
    data = output.with_name(f"{example}.csv")
    if not to_standard_output:
        check_file(output, force)
        if measured is not None:
            check_file(data, force)
    open_questions: list[str] = []
    if model is not None:
        text, open_questions = first_file(model, shell_line("FILE.toml" if to_standard_output else output))
    else:
        text = texts[example or ""]
    if example is not None and not to_standard_output:
        text = text.replace(f"examples/{example}.toml", str(output))
    if to_standard_output:
        print(text, end="")
        return 0
    write_whole(output, text)
    if measured is not None:
        write_whole(data, measured)
    files = f"{output}" if measured is None else f"{output}, and {data} with measurements"
    say(f"Written: {files}. To check it: {shell_line('fisherpoint', 'design', output, '--check')}")
    if open_questions:
        say(f"Set in it first: {listed(open_questions)}.")
    return 0
