"""``python -m bench``: measure, show and save. The exit code is 1 where fisherpoint misses the accuracy rule, otherwise 0.

``python -m bench peers`` and ``python -m bench scaling`` do the same for other programs and for how the cost grows;
``python -m bench models`` compares the built-in cylinder with the same model written in Python, interpreted and compiled;
``python -m bench validation`` times a thousand fits next to a loop over SciPy's `least_squares`, and compares the minima;
``python -m bench campaign`` compares experiments that are designed in batches with as many that are designed at once;
``python -m bench stiff`` compares stiff models with CVODES;
``python -m bench runs`` compares designs of runs with published ones, and ``python -m bench.windows`` one with windows;
``python -m bench strokes`` looks for runs within limits from five seeds, and exits with 1 where one is not good;
``python -m bench.residuals`` counts fits that hear of noise with a memory;
``python -m bench.noise_promises`` shows whether designs keep what they promise under noise of every kind;
``python -m bench.budgets`` shows whether limits of time hold, and ``python -m bench.starts`` which fits from afar are right;
``python -m bench pieces`` picks the best windows of a log of a million samples;
``python -m bench approximate`` finds optimal weights of a million candidates;
``python -m bench exact`` finds the best designs of given candidates with their proofs;
``python -m bench packs`` for what the core's packs could be made of;
``python -m bench cost`` counts instructions and cache misses per trajectory, and exits with 1 where they grew;
``python -m bench table FILE`` prints what they wrote with ``--json`` as Markdown.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict
from pathlib import Path
from time import perf_counter
from typing import Any

from fisherpoint.points.settings import resolve_threads

from . import (
    approximate,
    campaign,
    cost,
    covariances,
    designs,
    exact,
    machine,
    memory,
    models,
    packs,
    pieces,
    runs,
    scaling,
    screening,
    sensitivities,
    stiff,
    strokes,
    tables,
    validation,
)
from .peers import compare, show

TARGET = 500
"""Predictive covariances on one core, next to SciPy's RK45 at matched accuracy."""


def main() -> int:
    """Run the command line and return the exit code."""
    options = _options()
    if options.task == "table":
        print(show.markdown(json.loads(options.file.read_text())))
        return 0
    found = machine.describe()
    tables.show_machine(found)
    if options.task == "cost":
        return _cost(options)
    if options.task == "peers":
        comparison = compare.measure(options.quick, tables.console.print)
        tables.show_comparison(comparison)
        _save(options, {"machine": found, "quick": options.quick, "peers": asdict(comparison)})
        return 0
    if options.task == "campaign":
        of_campaigns = campaign.measure(options.quick, tables.console.print)
        tables.show_campaign(of_campaigns)
        _save(options, {"machine": found, "quick": options.quick, "campaign": asdict(of_campaigns)})
        return 0
    if options.task == "stiff":
        of_stiff = stiff.measure(options.quick)
        tables.show_stiff(of_stiff)
        _save(options, {"machine": found, "quick": options.quick, "stiff": [asdict(figures) for figures in of_stiff]})
        return 0
    if options.task == "runs":
        of_runs = runs.measure(options.quick, tables.console.print)
        tables.show_runs(of_runs)
        _save(options, {"machine": found, "quick": options.quick, "runs": [asdict(figures) for figures in of_runs]})
        return 0
    if options.task == "strokes":
        of_strokes = strokes.measure(options.quick, tables.console.print)
        tables.show_strokes(of_strokes)
        _save(options, {"machine": found, "quick": options.quick, "strokes": [asdict(figures) for figures in of_strokes]})
        return 0 if all(figures.good for figures in of_strokes) else 1
    if options.task == "exact":
        of_counts = exact.measure(options.quick)
        print(exact.show(of_counts))
        _save(options, {"machine": found, "quick": options.quick, "exact": [asdict(figures) for figures in of_counts]})
        return 0
    if options.task == "approximate":
        of_weights = approximate.measure(options.quick)
        print(approximate.show(of_weights))
        _save(options, {"machine": found, "quick": options.quick, "approximate": [asdict(figures) for figures in of_weights]})
        return 0
    if options.task == "pieces":
        of_pieces = pieces.measure(options.quick)
        tables.show_pieces(of_pieces)
        _save(options, {"machine": found, "quick": options.quick, "pieces": [asdict(figures) for figures in of_pieces]})
        return 0
    if options.task == "packs":
        of_packs, left_out = packs.measure(options.quick)
        tables.show_packs(of_packs, left_out)
        _save(options, {"machine": found, "quick": options.quick, "packs": [asdict(figures) for figures in of_packs]})
        return 0
    if options.task == "models":
        of_models, first_trajectory = models.measure(options.quick)
        tables.show_models(of_models, first_trajectory)
        report = {"models": [asdict(figures) for figures in of_models], "first_trajectory": first_trajectory}
        _save(options, {"machine": found, "quick": options.quick, **report})
        return 0
    if options.task == "validation":
        of_fits = validation.measure(options.quick)
        tables.show_validation(of_fits)
        _save(options, {"machine": found, "quick": options.quick, "validation": [asdict(figures) for figures in of_fits]})
        return 0
    if options.task == "scaling":
        series = scaling.measure(options.quick)
        tables.show_scaling(series)
        _save(options, {"machine": found, "quick": options.quick, "scaling": [asdict(one) for one in series]})
        return 0
    return _all(options, found)


def _cost(options: argparse.Namespace) -> int:
    lacking = cost.missing()
    if lacking is not None:
        tables.console.print(f"Nothing counted, for want of {lacking}")
        return 1
    found, before = cost.measure(), cost.recorded()
    tables.show_cost(found, before)
    if options.record:
        cost.record(found)
        return 0
    said, passed = cost.verdict(found, before)
    for line in said:
        tables.console.print(line)
    return 0 if passed else 1


def _all(options: argparse.Namespace, found: dict[str, str]) -> int:
    threads: list[int] = options.threads
    begin = perf_counter()
    of_covariances = covariances.measure(options.quick, threads)
    tables.show_covariances(of_covariances)
    of_sensitivities = sensitivities.measure(options.quick, threads)
    tables.show_sensitivities(of_sensitivities)
    of_designs = designs.measure(options.quick, threads)
    tables.show_designs(of_designs)
    of_screening = screening.measure(options.quick)
    tables.show_screening(of_screening)
    of_memory = memory.measure()
    tables.show_memory(of_memory)
    seconds = perf_counter() - begin

    report = {
        "machine": found,
        "quick": options.quick,
        "seconds": seconds,
        "covariances": asdict(of_covariances),
        "sensitivities": asdict(of_sensitivities),
        "designs": [asdict(figures) for figures in of_designs],
        "screening": [asdict(figures) for figures in of_screening],
        "memory": [asdict(figures) for figures in of_memory],
    }
    _save(options, report)
    accurate = of_covariances.accurate and of_sensitivities.accurate
    tables.console.print(f"{seconds:.0f} s. Accuracy rule: {'met' if accurate else 'MISSED'} by fisherpoint's default tolerance.")
    tables.console.print(
        f"sensitivities: {of_sensitivities.ratio:,.0f} x SciPy RK45; predictive covariances next to stacked nodes:"
        f" {of_covariances.ratio_to_stacked:,.0f} x"
    )
    tables.console.print(f"predictive covariances: {of_covariances.ratio:,.0f} x SciPy RK45 at matched accuracy (target {TARGET})")
    return 0 if accurate else 1


def _save(options: argparse.Namespace, report: dict[str, Any]) -> None:
    if options.json is not None:
        options.json.write_text(json.dumps(report, indent=1) + "\n")


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m bench", description="Measure speed and memory next to SciPy, or other programs, at the same accuracy."
    )
    parser.add_argument(
        "task",
        nargs="?",
        choices=(
            "peers",
            "scaling",
            "models",
            "validation",
            "campaign",
            "stiff",
            "runs",
            "strokes",
            "pieces",
            "approximate",
            "exact",
            "packs",
            "cost",
            "table",
        ),
        help="other programs; how the cost grows; models written in Python; many fits; design in batches; stiff"
        " models; designs of runs; the same within limits; windows of a log; weights and counts of candidates; kinds of vectors;"
        " instructions per trajectory next to the recorded ones; a report as Markdown; nothing for all of fisherpoint next to"
        " SciPy",
    )
    parser.add_argument("file", nargs="?", type=Path, help="the report for `table`")
    parser.add_argument("--quick", action="store_true", help="smaller samples and fewer rounds, for a look")
    parser.add_argument("--threads", type=thread_numbers, metavar="N,N", help="numbers of threads, the first for the ratios")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write all figures there")
    parser.add_argument("--record", action="store_true", help="with `cost`: hold later runs against this one")
    options = parser.parse_args()
    if (options.task == "table") != (options.file is not None):
        parser.error("expected a FILE for `table`, and for it alone")
    if options.threads is None:
        options.threads = sorted({1, resolve_threads(None)})
    return options


def thread_numbers(text: str) -> list[int]:
    numbers = [int(part) for part in text.split(",")]
    if min(numbers) < 1:
        raise ValueError(text)
    return numbers


if __name__ == "__main__":
    sys.exit(main())
