"""Makes the gallery, docs/gallery.md and its pictures in docs/images/examples, by running the examples.

Only examples that changed since their pictures were made, or of which the code that draws them did, are run, or those that are
named, as by ``python docs/scripts/gallery.py battery``.
With ``--check`` nothing is made, and the exit code says whether page and pictures are those of the examples and of that code.
"""

from __future__ import annotations

import ast
import hashlib
import json
import sys
import tomllib
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

import fisherpoint as fp
from fisherpoint.design.file.configuration import load_config
from fisherpoint.show.style import encoded

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES, IMAGES, PAGE = ROOT / "examples", ROOT / "docs" / "images" / "examples", ROOT / "docs" / "gallery.md"
MADE_OF = IMAGES / "made_of.json"

DPI = 80
"""Of the pictures: a page of a site needs no more."""


class Example(NamedTuple):
    """An example: pictures of its design and, where there are measurements, of the fit; and the page that tells more.

    `large` are pictures of its design that other pages show, in docs/images.
    """

    name: str
    heading: str
    of_design: Sequence[str]
    of_fit: Sequence[str] = ()
    noise_known: bool = True
    page: str = ""
    large: Sequence[str] = ()


SHOWN = (
    Example("exponential_decay", "Exponential decay", ["points"], page="how_to/examples.md#exponential-decay"),
    Example("michaelis_menten", "Michaelis-Menten", ["points"], page="how_to/examples.md#michaelis-menten"),
    Example("box_lucas", "Box-Lucas", ["points"], page="how_to/examples.md#box-lucas"),
    Example("pharmacokinetics", "Pharmacokinetics", ["points"], page="how_to/examples.md#pharmacokinetics"),
    Example("alpha_pinene", "Alpha-pinene", ["points"], ["profiles"], noise_known=False, page="how_to/reaction.md"),
    Example("cascaded_tanks", "Cascaded tanks", ["points"], page="how_to/examples.md#cascaded-tanks"),
    Example("positioning_axis", "Positioning axis", ["points"], page="how_to/examples.md#positioning-axis"),
    Example("fed_batch", "Fed-batch reactor", ["points"], page="how_to/examples.md#fed-batch-reactor"),
    Example("dc_motor", "DC motor", ["points"], page="how_to/examples.md#dc-motor"),
    Example("battery", "Battery cell", ["runs"], ["time"], page="how_to/battery.md"),
    Example("robot_joint", "Robot joint", ["runs"], ["time"], page="how_to/robot_joint.md"),
    Example("reactor", "Reactor", ["runs"], page="how_to/runs.md"),
    Example("tclab", "Heater", ["runs"], page="how_to/runs.md"),
    Example("cylinder_runs", "Cylinder from rest", ["runs"], page="tutorial/cylinder_from_rest.md"),
    Example(
        "cylinder", "Cylinder", ["points"], page="how_to/examples.md#the-cylinder-in-python", large=["points", "standard_errors"]
    ),
)


PACKAGE = Path(fp.__file__).parent
EVERY = ("show/style.py",)
_OF_FIT = ("estimation/pictures.py", "show/time_axes.py")
DRAWN_BY = {
    "points": (
        "design/results/pictures_points.py",
        "design/results/pictures_responses.py",
        "design/results/paths.py",
        "show/time_axes.py",
    ),
    "standard_errors": ("show/parameter_pictures.py",),
    "runs": ("design/runs/run_pictures.py", "show/time_axes.py"),
    "profiles": _OF_FIT,
    "time": _OF_FIT,
}
"""The code that draws each kind of picture."""


@cache
def code(file: str) -> str:
    """The lines of a module without comments and docstrings, on which no picture depends; the same for every version of Python."""
    text = (PACKAGE / file).read_text()
    lines = text.splitlines()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            lines[node.lineno - 1 : node.end_lineno] = [""] * len(lines[node.lineno - 1 : node.end_lineno])
    return "\n".join(line for line in lines if line.strip() and not line.lstrip().startswith("#"))


def digest(example: Example) -> str:
    """What the pictures of an example are made of, and by which code; comments do not count."""
    files = sorted({file for kind in (*example.of_design, *example.of_fit, *example.large) for file in DRAWN_BY[kind]} | set(EVERY))
    parts = [code(file) for file in files]
    parts += [json.dumps(tomllib.loads((EXAMPLES / f"{example.name}.toml").read_text()), sort_keys=True)]
    parts += [(EXAMPLES / f"{example.name}.csv").read_text()] if example.of_fit else []
    return hashlib.sha256("\n".join([*parts, *example.of_design, *example.of_fit]).encode()).hexdigest()[:16]


def pictures(example: Example) -> Iterator[tuple[str, str]]:
    """Kind and file of each picture."""
    kinds = (*example.of_design, *example.of_fit)
    yield from ((kind, f"{example.name}.png" if k == 0 else f"{example.name}_{kind}.png") for k, kind in enumerate(kinds))


def make(example: Example) -> None:
    """Run an example and draw it."""
    config = load_config(EXAMPLES / f"{example.name}.toml")
    problem = config.problem()
    found: fp.Design | fp.RunDesign
    if config.runs is None:
        found = fp.exchange(problem, **config.exchange_settings())
    else:
        found = fp.design_runs(problem, **config.run_settings())
    fit = None
    if example.of_fit:
        data = fp.Measurements.from_table(EXAMPLES / f"{example.name}.csv", problem.model)
        fit = fp.estimate(problem.model, data, problem.prior, noise=problem.noise if example.noise_known else None)
    for kind, file in pictures(example):
        figure = found.plot(kind) if kind in example.of_design or fit is None else fit.plot(kind)
        (IMAGES / file).write_bytes(encoded(figure, "png", DPI))
    for kind in example.large:
        found.plot(kind, path=IMAGES.parent / f"{kind}.png")


def title(example: Example) -> str:
    """The first sentence of an example's file."""
    text = (EXAMPLES / f"{example.name}.toml").read_text().partition("\n#\n")[0]
    return " ".join(line.removeprefix("# ") for line in text.splitlines()).partition(". ")[0].rstrip(".")


def page() -> str:
    """The gallery as Markdown."""
    lines = [
        "# Gallery",
        "",
        "<!-- Written by docs/scripts/gallery.py: run it after a change of an example or of how pictures look. -->",
        "",
        "Every picture is made by `fisherpoint design examples/NAME.toml -o run/`, or by `fisherpoint estimate` where there are",
        "measurements.",
    ]
    for example in SHOWN:
        lines += ["", f"## {example.heading}", "", f"{title(example)}. [More]({example.page})", ""]
        lines += [f"![{example.name}: {kind}](images/examples/{file})" for kind, file in pictures(example)]
    return "\n".join([*lines, ""])


def stale() -> list[str]:
    """Examples of which pictures are missing, or of another state of the file or of the code."""
    made = json.loads(MADE_OF.read_text()) if MADE_OF.exists() else {}
    there = {path.name for path in IMAGES.glob("*.png")}
    return [
        example.name
        for example in SHOWN
        if made.get(example.name) != digest(example) or any(file not in there for _, file in pictures(example))
    ]


def main(arguments: Sequence[str]) -> int:
    """Make what is stale or named; or only say what is stale."""
    if "--check" in arguments:
        old = [f"pictures of {name}" for name in stale()]
        if PAGE.read_text() != page():
            old.append(PAGE.name)
        if old:
            print(f"stale: {', '.join(old)}; run python docs/scripts/gallery.py", file=sys.stderr)
        return int(bool(old))
    for name in arguments or stale():
        example = next(example for example in SHOWN if example.name == name)
        print(name, flush=True)
        make(example)
        made = json.loads(MADE_OF.read_text()) if MADE_OF.exists() else {}
        MADE_OF.write_text(json.dumps(dict(sorted({**made, name: digest(example)}.items())), indent=1) + "\n")
    PAGE.write_text(page())
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
