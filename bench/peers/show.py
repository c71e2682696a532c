"""The comparison as a table for the terminal, and as Markdown for the documentation."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

HEADER = ("", "rtol", "rate", "cores", "ratio", "median", "99 %", "worst", "steps", "MB", "pairs")
UNITS = {"states": "trajectories/s", "sensitivities": "experiments/s"}
TITLES = {
    "states": "States alone, on the grid of the predictive covariances; errors are those of y",
    "sensitivities": "States and all nine sensitivities; errors are those of dy/dtheta",
}

SCALING_HEADER = ("against", "of", "values", "ms", "exponent", "target")

TARGETS = (
    ("states", "heyoka batch", 8.0),
    ("states", "Boost.odeint on packs", 3.0),
    ("sensitivities", "Boost.odeint", 2.5),
    ("sensitivities", "Boost.odeint on packs", 1.5),
)
"""What our default is asked to be, in multiples of a program's rate."""


def header(task: str) -> tuple[str, ...]:
    return tuple(UNITS[task] if name == "rate" else name for name in HEADER)


def rows(figures: Sequence[Mapping[str, Any]]) -> Iterator[tuple[str, ...]]:
    """Yield the cells of each program; the ratio is the rate of our default to the program's."""
    for i, f in enumerate(figures):
        ratio = figures[0]["rate"] / f["rate"]
        errors = f["errors"]
        yield (
            f["name"] + (", default" if i == 0 else ""),
            f"{f['rtol']:.1e}",
            f"{f['rate']:,.0f}",
            f"{f['cores']:.1f}",
            "" if i < 2 else f"{ratio:,.{0 if ratio > 100 else 1}f}",
            *(f"{errors[name]:.1e}" for name in ("median", "quantile_99", "worst")),
            "" if f["steps"] is None else f"{f['steps']:.1f}",
            "" if f["memory"] is None else f"{f['memory']:.0f}",
            f"{f['sample']:,}",
        )


def targets(comparison: Mapping[str, Any]) -> Iterator[str]:
    """Yield one line for each target whose program was there."""
    for task, name, target in TARGETS:
        figures = comparison[task]
        for f in figures:
            if f["name"] == name:
                ratio = figures[0]["rate"] / f["rate"]
                verdict = "met" if ratio >= target else "MISSED"
                loosest = figures[1]["rate"] / f["rate"]
                at_loosest = f" ({loosest:.1f} with ours at its loosest tolerance)"
                yield f"{task}: {ratio:.1f} x {name}{at_loosest}, target {target:g}: {verdict}"


def scaling_rows(series: Sequence[Mapping[str, Any]]) -> Iterator[tuple[str, ...]]:
    """Yield the cells of each series; the target is that of the exponent."""
    for s in series:
        low, high = s["low"], s["high"]
        met = (low is None or s["exponent"] >= low) and (high is None or s["exponent"] <= high)
        target = "" if high is None else f"below {high:g}" if low is None else f"{low:g} to {high:g}"
        yield (
            s["quantity"],
            s["what"],
            ", ".join(f"{value:,}" for value in s["values"]),
            ", ".join(f"{1e3 * seconds:.3g}" for seconds in s["seconds"]),
            f"{s['exponent']:.3f}",
            target and f"{target}: {'met' if met else 'MISSED'}",
        )


def markdown(report: Mapping[str, Any]) -> str:
    """Return the tables of a report of ``python -m bench peers`` or ``python -m bench scaling``, written with ``--json``."""
    machine, comparison = report["machine"], report.get("peers", {})
    versions = {name: machine[name] for name in ("python", "numpy", "scipy")} | comparison.get("versions", {})
    taken = ", ".join(f"{name} {number}" for name, number in versions.items())
    lines = [f"{machine['processor']}, {machine['cores']} cores, {machine['instruction set']}; {taken}.", ""]
    if "scaling" in report:
        return "\n".join(lines + _table(SCALING_HEADER, scaling_rows(report["scaling"])))
    for task, title in TITLES.items():
        lines += [f"**{title}**", ""]
        lines += _table(header(task), rows(comparison[task]))
        lines.append("")
    lines += [f"- {line}" for line in targets(comparison)]
    return "\n".join(lines)


def _table(head: Sequence[str], body: Iterator[tuple[str, ...]]) -> list[str]:
    rule = ["---"] + ["---:"] * (len(head) - 1)
    return ["| " + " | ".join(cells) + " |" for cells in (head, rule, *body)]
