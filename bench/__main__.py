"""``python -m bench``: measure, show and save. Exit code 1 where the accuracy rule is missed."""

from __future__ import annotations

import json
import os
import platform
import sys
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

import fisherpoint as fp

from . import covariances, designs, memory, sensitivities

TARGET = 500
"""Predictive covariances on one core, next to SciPy's RK45 at the same accuracy."""

console = Console(width=None if sys.stdout.isatty() else 110)


def machine() -> dict[str, Any]:
    cpuinfo = Path("/proc/cpuinfo")
    lines = cpuinfo.read_text().splitlines() if cpuinfo.exists() else []
    model = next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), platform.processor())
    return {
        "processor": model,
        "cores": len(os.sched_getaffinity(0)),
        "instruction set": fp.isa(),
        "python": platform.python_version(),
        **{name: version(name) for name in ("numpy", "scipy")},
    }


def table(title: str, header: list[str], rows: list[list[Any]]) -> None:
    result = Table(title=title, title_justify="left", title_style="bold", header_style="", min_width=len(title))
    for i, name in enumerate(header):
        result.add_column(name, justify="left" if i == 0 else "right")
    for row in rows:
        result.add_row(*(f"{value:,.3g}" if isinstance(value, float) and value < 1e3 else _text(value) for value in row))
    console.print(result, "")


def _text(value: Any) -> str:
    return f"{value:,.0f}" if isinstance(value, float) else str(value)


def show_speed(title: str, unit: str, result: dict[str, Any], errors: dict[str, Any]) -> None:
    ours = result[f"{unit} per second"]
    first = next(iter(ours.values()))
    rows = [[f"fisherpoint, {n} thread{'s' * (n != '1')}", "1e-06", rate, "", *errors.values()] for n, rate in ours.items()]
    for name, peer in result["scipy"].items():
        peer_errors = [peer[key] for key in ("median", "99 %", "worst")]
        rate = peer[f"{unit} per second"]
        rows.append([f"SciPy RK45, {name}", f"{peer['rtol']:.1e}", rate, first / rate, *peer_errors])
    table(title, ["", "rtol", f"{unit} per s", "ratio", "error: median", "99 %", "worst"], rows)


def main(
    quick: Annotated[bool, typer.Option("--quick", help="Smaller samples: half a minute.")] = False,
    threads: Annotated[str, typer.Option(help="Numbers of threads, the first for the ratios.")] = "1,2",
    json_file: Annotated[Path | None, typer.Option("--json", metavar="FILE", help="Also write all figures there.")] = None,
) -> None:
    """Measure speed next to SciPy at the same accuracy, whole designs, and memory."""
    try:
        counts = [int(n) for n in threads.split(",")]
        if min(counts) < 1:
            raise ValueError
    except ValueError:
        raise typer.BadParameter(f"--threads: expected whole numbers such as 1,2; given {threads!r}") from None

    report: dict[str, Any] = {"machine": machine()}
    console.print(", ".join(f"{name} {value}" for name, value in report["machine"].items()), "")

    report["covariances"] = w1 = covariances.measure(quick, counts)
    show_speed(f"Predictive covariances over the 3^9 grid, {w1['workload']}", "trajectories", w1, w1["same pairs"])
    table("Instruction sets, one thread", ["level", "trajectories per s"], [list(item) for item in w1["levels"].items()])
    accuracy = w1["accuracy"]
    table(
        "Errors at the default tolerance over the grid of all candidates",
        ["trajectories", "median", "99 %", "worst", "covariances, worst"],
        [[f"{accuracy['trajectories']:,}", accuracy["median"], accuracy["99 %"], accuracy["worst"], w1["covariance error"]]],
    )
    report["sensitivities"] = w2 = sensitivities.measure(quick, counts)
    show_speed("States with nine sensitivities; errors are those of dy/dtheta", "experiments", w2, w2["errors of dy_dtheta"])
    report["designs"] = rows = designs.measure(quick, counts)
    table("Designs: 12 points, 50 candidates, default cylinder", list(rows[0]), [list(row.values()) for row in rows])
    report["memory"] = peak = memory.measure(quick)
    table("Peak memory of one predictive covariance", ["nodes", "MB"], [[f"{int(n):,}", mb] for n, mb in peak.items()])

    if json_file is not None:
        json_file.write_text(json.dumps(report, indent=1) + "\n")
    ok = accuracy["meets rule"] and w2["meets rule"]
    console.print(f"Accuracy rule {'met' if ok else 'MISSED'}.")
    console.print(f"Predictive covariances: {w1['ratio']:,.0f} times SciPy RK45 at matched accuracy (target {TARGET}).")
    raise typer.Exit(0 if ok else 1)


if __name__ == "__main__":
    typer.run(main)
