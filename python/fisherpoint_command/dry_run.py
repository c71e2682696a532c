"""``--check``: what is given has no mistake, and what the command would do with it, in a few lines."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import fisherpoint as fp
from fisherpoint.basics.messages import listed
from fisherpoint.information.problem_report import noise_in_words
from fisherpoint.noise.models import outputs_of
from fisherpoint.points.sample_clock import in_words
from fisherpoint.show.numbers import counted, number
from fisherpoint.show.section import Report, Section

from .terminal import show

Row = tuple[str, str]


def show_plan(problem: fp.DesignProblem, files: Sequence[Path], work: Iterable[Row], output: Path | None) -> int:
    """Print what a command would do, and return its exit code."""
    rows = [*problem_rows(problem), *work]
    if output is not None:
        rows.append(("would write to", str(output)))
    show(Report(f"No mistake found in {listed(files)}; nothing was computed.", [Section("", (), rows)]))
    return 0


def problem_rows(problem: fp.DesignProblem) -> list[Row]:
    """Model, what is estimated, noise, region, and how expectations are taken."""
    model, region = problem.model, problem.region
    measured = {} if problem.noise is None else outputs_of(problem.noise)
    rule = problem.rule
    rows = [
        ("model", f"{model.name}: {_kinds(model)}"),
        ("estimated", listed(problem.estimated)),
        ("noise", noise_in_words(problem.noise, model.outputs) or "not given"),
    ]
    if measured and len(measured) < len(model.outputs):
        rows.append(("not measured", listed(q.name for q in model.outputs if q.name not in measured)))
    if region is not None:
        bounds = {
            name: f"{number(low)} to {number(high)}" if low < high else number(low) for name, (low, high) in region.bounds.items()
        }
        rows.append(("region", _values(model.axes, bounds)))
        if isinstance(region, fp.ExperimentRegion) and region.constraints:
            rows.append(("constraints", "; ".join(map(str, region.constraints))))
    rows.append(("output covariance", str(problem.output_covariance)))
    rows.append(("rule", f"{rule}, {counted(rule.size(problem.prior), 'node')}"))
    return rows


def about(trajectories: float, what: str = "") -> Row:
    """About how many trajectories a command would compute, to two digits."""
    rounded = float(f"{trajectories:.2g}")
    return "trajectories", f"about {rounded:,.0f}{f': {what}' if what else ''}"


def settings_of(problem: fp.DesignProblem, given: Mapping[str, Any]) -> fp.results.ExchangeSettings:
    """The settings of a search for points, with its defaults for what is not given; raise as the search does."""
    from fisherpoint.design.results.settings import ExchangeSettings, check_goal, most_iterations

    chosen = {one.name: given[one.name] for one in fields(ExchangeSettings) if one.name in given}
    method = chosen.get("method", fp.ExchangeMethod())
    settings = ExchangeSettings(**chosen | {"max_iterations": most_iterations(chosen.get("max_iterations"), method, problem)})
    check_goal(settings, problem)
    return settings


def search_rows(problem: fp.DesignProblem, settings: fp.results.ExchangeSettings) -> list[Row]:
    """How points would be searched for."""
    from fisherpoint.design.points.tuning import PointSearchTuning
    from fisherpoint.design.results.settings import searched_by
    from fisherpoint.information.output_covariance import needs_covariances

    method = searched_by(settings.method.name, problem)
    rows = [
        ("points", str(settings.n_experiments)),
        *_goal_rows(settings.goal),
        ("method", f"{method}, at most {counted(settings.max_iterations, 'iteration')}"),
    ]
    m, iterations = settings.n_candidates, settings.max_iterations
    drawn: float
    if method == "auto":
        tuning = PointSearchTuning()
        climbing = tuning.climb.rounds * tuning.climbing_candidates * m * tuning.climb.near_per_point
        of_group = min(tuning.most_edge_candidates, tuning.edge_candidates * m) + climbing
        near = max(tuning.near_candidates * m, tuning.least_near_per_point * settings.n_experiments)
        drawn = (tuning.groups + tuning.merged_climbs + 0.5) * of_group + iterations * near
    else:
        drawn = settings.n_experiments + iterations * m * (1 + settings.method.local)
    nodes = problem.rule.size(problem.prior) if needs_covariances(str(problem.output_covariance)) else 0
    return [*rows, about(drawn * (1 + nodes), "at most, if the search takes all its iterations")]


def run_rows(problem: fp.DesignProblem, given: Mapping[str, Any]) -> list[Row]:
    """How runs would be searched for."""
    from fisherpoint.design.results.settings import RunSettings

    settings = RunSettings(**{one.name: given[one.name] for one in fields(RunSettings) if one.name in given})
    n = problem.run_region.segments
    return [
        *_goal_rows(settings.goal),
        ("runs", f"{settings.n_runs} of {counted(n, 'segment')}"),
        *([] if (every := problem.run_region.sample_every) is None else [("samples", in_words(every))]),
        ("method", f"{counted(settings.n_starts, 'start')} from a pool of {counted(settings.n_candidates, 'random run')}"),
        about(settings.n_candidates * n, "segments of the pool; ascents take as many again and more"),
    ]


def _goal_rows(goal: fp.Goal) -> list[Row]:
    from fisherpoint.design.results.settings_section import option_facts

    return [("criterion", goal.short), *option_facts(goal, "criterion", "of")]


def points_row(name: str, points: fp.Experiments | fp.Runs) -> Row:
    """How many points there are in a file."""
    return name, counted(len(points), points.kind)


def size_of(points: fp.Experiments | fp.Runs) -> int:
    """Trajectories of points, or segments of runs."""
    return int((points.dt > 0).sum())


def _kinds(model: fp.Model) -> str:
    counts = (("state", model.states), ("input", model.inputs), ("parameter", model.parameters), ("output", model.outputs))
    return ", ".join(counted(len(given), kind) for kind, given in counts if given)


def _values(quantities: Iterable[object], values: dict[str, str]) -> str:
    units = {getattr(q, "name", ""): getattr(q, "unit", "1") for q in quantities}
    return ", ".join(f"{name} {value} {units.get(name, '')}".removesuffix(" 1").rstrip() for name, value in values.items())
