"""What `design_quality` found, as Markdown and as pictures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter
from numpy.typing import NDArray

from fisherpoint.show.style import CRITERION, NOISE, PRIOR, STYLE, TEXT
from fisherpoint.validation.figures import NORMAL_MEDIAN

Array = NDArray[np.float64]
Found = Mapping[str, Sequence[Mapping[str, Any]]]

LEVELS = {"0.1": "a tenth of the noise", "1": "the default noise", "10": "ten times the noise"}
LARGE = 100.0
"""Errors in prior std beyond which a picture or a table gives no figure."""


@dataclass(frozen=True)
class Summary:
    """All seeds of one design together; geometric means over the nine parameters, in prior std.

    `rmse` and its Monte Carlo standard error are of the fits that did not fail, `seeds` those of each seed; `typical` is the median
    error over 0.6745, of all fits, where a failed one counts as the prior mean. `own` is the promise under the criterion's D.
    """

    promised: float
    rmse: float
    error: float
    seeds: tuple[float, ...]
    typical: float
    own: float | None
    coverage: float
    chi_square: Array
    failed: float
    cannot_run: float
    fits: int
    t_1: float | None


def summary(runs: Sequence[Mapping[str, Any]]) -> Summary:
    """Pool the seeds."""
    everything = [np.array(run["squares"]) for run in runs]
    kept = [np.delete(squares, run["failed_rows"], axis=0) for squares, run in zip(everything, runs, strict=True)]
    squares = np.concatenate(kept)
    influence = 0.5 * (squares / squares.mean(axis=0)).mean(axis=1)
    rmse = _gm(np.sqrt(squares.mean(axis=0)))
    owns = [_gm(np.array(run["own"])) for run in runs if run["own"] is not None]
    rigs, fits = sum(run["rigs"] for run in runs), sum(map(len, everything))
    return Summary(
        promised=_gm(np.array([run["promised"] for run in runs])),
        rmse=rmse,
        error=float(rmse * influence.std() / np.sqrt(len(squares))),
        seeds=tuple(_gm(np.sqrt(one.mean(axis=0))) for one in kept),
        typical=_gm(np.median(np.sqrt(np.concatenate(everything)), axis=0) / NORMAL_MEDIAN),
        own=_gm(np.array(owns)) if owns else None,
        coverage=float(np.mean([run["coverage"] for run in runs])),
        chi_square=np.mean([run["chi_square"] for run in runs], axis=0),
        failed=sum(len(run["failed_rows"]) for run in runs) / fits,
        cannot_run=1 - fits / rigs,
        fits=fits,
        t_1=None if runs[0]["t_1"] is None else float(np.mean([run["t_1"] for run in runs])),
    )


def _gm(values: Array) -> float:
    """Geometric mean of all."""
    with np.errstate(divide="ignore"):
        return float(np.exp(np.mean(np.log(values))))


def show(found: Found) -> None:
    """Print one table for each noise level and case, as Markdown."""
    groups: dict[tuple[str, str], dict[str, Summary]] = {}
    for key, runs in found.items():
        name, level, case = key.split("|")
        groups.setdefault((level, case), {})[name] = summary(runs)
    header = (
        "design",
        "promised",
        "RMSE",
        "lowest - highest design",
        "typical",
        "achieved / promised",
        "own promise / achieved",
        "coverage, %",
        "failed fits, %",
        "rigs that cannot run, %",
        "chi-square of q, p_A, p_B, x_v",
    )
    for (level, case), designs in sorted(groups.items()):
        print(f"\n**Noise times {level}, {case}**\n\n| {' | '.join(header)} |\n|{'---|' * len(header)}")
        for name, s in designs.items():
            own = "" if s.own is None else f"{s.own / s.rmse:.1f}"
            row = [
                name,
                _number(s.promised),
                f"{_number(s.rmse)} +- {s.error:.1g}",
                f"{_number(min(s.seeds))} - {_number(max(s.seeds))}" if len(s.seeds) > 1 else "",
                _number(s.typical),
                f"{s.rmse / s.promised:.2f}",
                own,
                f"{100 * s.coverage:.1f}",
                f"{100 * s.failed:.1f}",
                f"{100 * s.cannot_run:.0f}",
                " ".join(f"{value:.3g}" for value in s.chi_square) + ("" if s.t_1 is None else f"; T_1 to {s.t_1:.1e} s"),
            ]
            print(f"| {' | '.join(row)} |")


def _number(value: float) -> str:
    return f"{value:.2g}".removeprefix("0") if value < LARGE else f"> {LARGE:g}"


def plot(found: Found, directory: Path) -> None:
    """Draw design_quality.png, promised against achieved, and design_quality_wrong_constant.png."""
    of_levels(found).savefig(directory / "design_quality.png", dpi=150)
    of_wrong_constant(found).savefig(directory / "design_quality_wrong_constant.png", dpi=150)


def of_levels(found: Found) -> Figure:
    """One panel per noise level: promised, achieved, and what the criterion's own D promised."""
    names = _designs(found)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(10.0, 1.7 + 0.3 * len(names)), layout="constrained")
        for axes, (level, title) in zip(figure.subplots(1, len(LEVELS), sharey=True), LEVELS.items(), strict=True):
            axes.axvline(1.0, color=PRIOR, linewidth=1.5, label="prior")
            places = [row for row, name in enumerate(names) if f"{name}|{level}|right" in found]
            found_here = [summary(found[f"{names[row]}|{level}|right"]) for row in places]
            for row, s in zip(places, found_here, strict=True):
                axes.plot(s.seeds, [row] * len(s.seeds), "o", color=CRITERION, markersize=3, alpha=0.45, markeredgewidth=0)
            own = np.array([(s.own, row) for row, s in zip(places, found_here, strict=True) if s.own is not None]).reshape(-1, 2)
            axes.plot(
                [s.promised for s in found_here],
                places,
                "|",
                color=NOISE,
                markersize=13,
                markeredgewidth=2.2,
                label="promised under R",
            )
            axes.plot(own[:, 0], own[:, 1], "D", color=PRIOR, markersize=5, label="promised under the criterion's D")
            for label, few in (
                ("achieved: RMSE (small: each design)", True),
                ("achieved, where over a tenth of the fits fail", False),
            ):
                some = [(s.rmse, row) for row, s in zip(places, found_here, strict=True) if (s.failed < 0.1) is few]
                rmse, at = np.array(some).reshape(-1, 2).T
                face = CRITERION if few else "white"
                axes.plot(rmse, at, "o", color=CRITERION, markerfacecolor=face, markersize=6, label=label)
            axes.set_title(title)
            _finish(axes, names)
        handles, labels = axes.get_legend_handles_labels()
        title = "Standard errors over prior std, geometric mean of nine parameters"
        figure.legend(handles, labels, loc="outside upper left", ncols=3, title=title, alignment="left")
    return figure


def of_wrong_constant(found: Found) -> Figure:
    """What a T_1 that is off by 10 % does to every design, at the default noise."""
    names = [name for name in _designs(found) if f"{name}|1|T_1 off" in found]
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.0, 1.5 + 0.3 * len(names)), layout="constrained")
        axes = figure.subplots()
        axes.axvline(1.0, color=PRIOR, linewidth=1.5, label="prior")
        right, wrong = ([summary(found[f"{name}|1|{case}"]).rmse for name in names] for case in ("right", "T_1 off"))
        rows = np.arange(len(names))
        axes.hlines(rows, right, wrong, color=CRITERION, alpha=0.35, linewidth=3)
        axes.plot(right, rows, "o", color=NOISE, markersize=6, label="T_1 right")
        axes.plot(wrong, rows, "o", color=CRITERION, markersize=6, label="T_1 off by 10 %")
        for case, marker, label in (
            ("estimated, T_1 off", "s", "off, but estimated"),
            ("stated, T_1 off", "^", "off, said to vary"),
        ):
            if f"noise|1|{case}" in found:
                place = ([summary(found[f"noise|1|{case}"]).rmse], [names.index("noise")])
                axes.plot(*place, marker, color=TEXT, markerfacecolor="white", markersize=6, label=label)
        _finish(axes, names)
        title = "Achieved RMSE over prior std, geometric mean of nine parameters"
        figure.legend(loc="outside upper left", ncols=3, title=title, alignment="left")
    return figure


def _designs(found: Found) -> list[str]:
    """Designs of the main comparison, the best first, then records."""
    names = {key.split("|")[0] for key in found if key.endswith("|1|right") and "paper" not in key}
    return sorted(names, key=lambda name: (name.startswith(("PRBS", "steps")), summary(found[f"{name}|1|right"]).rmse))


def _finish(axes: Axes, names: Sequence[str]) -> None:
    axes.set_xscale("log")
    low, high = axes.get_xlim()
    axes.set_xlim(min(low, 0.1), min(high, LARGE))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.grid(axis="y", visible=False)
