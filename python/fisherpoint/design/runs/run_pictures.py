"""Pictures of designs of runs: inputs and outputs over time, and the information of each sample on each parameter."""

from __future__ import annotations

import re
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from ...basics.quantity import names_of
from ...basics.values import Array
from ...information.problem import DesignProblem
from ...information.run_information import run_rows
from ...points.run_trajectories import checked_run_trajectories
from ...points.runs import Runs
from ...points.sampling import holds_of
from ...points.status import Status
from ...show.numbers import counted
from ...show.style import NOISE, PRIOR, STYLE, TEXT, Picture, labelled, scale, show_under_mouse
from ...show.time_axes import MANY, RunTime, shares_of
from .sampled_plants import RunPlants

DRAWN = 100
"""Plants whose outputs show the spread."""

NUMBER = r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?"

MOST_SHOWN = 6
"""Runs of a picture."""


def plot_runs(problem: DesignProblem, runs: Runs) -> Figure:
    """Inputs, and outputs at the prior mean with samples, and where 90 % of the prior's plants are; limits are dashed."""
    model, settings = problem.model, problem.integration(None)
    shown = runs[: min(len(runs), MOST_SHOWN)]
    shares = shares_of(shown.dt.shape[1])
    fine, looks_each = shown.divided(shares), len(shares)
    mean = checked_run_trajectories(model, fine, problem.theta, settings)
    plants = RunPlants(problem, DRAWN, np.random.default_rng(0), settings)
    spread, reached = plants.outputs(fine)
    limits = {name: values for name, values in limits_of(problem).items() if name in names_of(model.outputs)}
    rows, columns = len(model.inputs) + len(model.outputs), len(shown)
    readings = np.broadcast_to(shown.readings, (*shown.dt.shape, len(model.outputs)))
    of = holds_of(shown.u, shown.dt, shown.readings)
    times = [RunTime(dt[dt > 0], y if shown.dt.shape[1] == 1 else None) for dt, y in zip(of.dt, mean.y, strict=True)]
    width = max(4.2, *(time.width for time in times))
    with mpl.rc_context(STYLE):
        figure = Picture(figsize=(1.5 + width * columns, 0.6 + 1.5 * rows), layout="constrained")
        grid = figure.subplots(rows, columns, squeeze=False, sharex="col", sharey="row")
        for k, time in enumerate(times):
            n = int(shown.segments[k])
            t = time(np.append(0.0, shown.t[k, :n]))
            looks = time.within(np.array(shares)) if not of.dense[k] else time(fine.t[k, : n * looks_each])
            for i, quantity in enumerate(model.inputs):
                factor, unit = scale(quantity, shown.u[:, :, i])
                held = factor * np.append(shown.u[k, :n, i], shown.u[k, n - 1, i])
                grid[i, k].step(t, held, where="post", color=TEXT, linewidth=1.2)
                grid[i, 0].set_ylabel(labelled(quantity.name, unit))
            for j, quantity in enumerate(model.outputs):
                axes: Any = grid[len(model.inputs) + j, k]
                factor, unit = scale(quantity, mean.y[:, :, j])
                if reached[:, k].any():
                    low, high = np.quantile(spread[reached[:, k], k, : n * looks_each, j], [0.05, 0.95], axis=0)
                    axes.fill_between(looks, factor * low, factor * high, color=PRIOR, alpha=0.35, linewidth=0)
                for limit in limits.get(quantity.name, ()):
                    axes.axhline(factor * limit, color=TEXT, linewidth=0.8, linestyle="--")
                (line,) = axes.plot(looks, factor * mean.y[k, : n * looks_each, j], color=NOISE, linewidth=1.2)
                at = np.flatnonzero(readings[k, :n, j])
                samples = counted(len(at), "sample")
                show_under_mouse([line], f"run {k + 1}: {labelled(quantity.name, unit)} at the prior mean, {samples}", f"{k}-{j}")
                sampled = mean.y[k, at * looks_each + looks_each - 1, j]
                axes.plot(t[at + 1], factor * sampled, "o", color=NOISE, markersize=3.2 if len(at) < MANY else 1.2)
                grid[len(model.inputs) + j, 0].set_ylabel(labelled(quantity.name, unit))
            grid[0, k].set_title(f"run {k + 1}")
            time.mark(grid[:, k])
        more = f"; {len(runs) - columns} further runs are not shown" if len(runs) > columns else ""
        marks = f"dots: samples{', dashed: limits' if limits else ''}{more}"
        title = f"At the prior mean, and 90 % of the prior's plants (grey)\n{marks}"
        figure.suptitle(title, x=0.01, ha="left")
    return figure


def plot_information(problem: DesignProblem, runs: Runs) -> Figure:
    """The share of each sample in the information about each parameter by itself, run after run."""
    rows = run_rows(problem, runs, problem.theta, problem.integration(None))
    information = _information(problem, rows.sensitivity[rows.status == Status.ok], runs.measured[rows.status == Status.ok])
    share = information / np.maximum(information.sum(axis=0), 1e-300)
    with mpl.rc_context(STYLE | {"axes.grid": False}):
        figure = Picture(figsize=(max(6.0, min(14.0, 2.0 + 0.12 * len(share))), 1.2 + 0.32 * share.shape[1]), layout="constrained")
        axes: Any = figure.subplots()
        count = len(share)
        image = axes.imshow(
            100 * share.T,
            aspect="auto",
            cmap="cividis",
            interpolation="nearest",
            vmin=0,
            extent=(0.5, count + 0.5, share.shape[1] - 0.5, -0.5),
        )
        axes.set_yticks(range(len(problem.estimated)), problem.estimated)
        ends = np.cumsum(runs.measured.sum(axis=1))
        for end in ends[:-1]:
            axes.axvline(end + 0.5, color="white", linewidth=1.0)
        axes.set_xlabel("sample" if len(runs) == 1 else "sample, run after run")
        axes.set_title("Share of each sample in the information on a parameter, the others known")
        figure.colorbar(image, ax=axes, pad=0.01, format="%g %%")
    return figure


def limits_of(problem: DesignProblem) -> dict[str, list[float]]:
    """Numbers that limits along the way compare single states or outputs with, by name; other limits are no lines.

    An output is also known by its equation: limits speak of states, inputs and parameters alone.
    """
    found: dict[str, list[float]] = {}
    texts = getattr(problem.model, "texts", ((), ()))[1]  # of equations; a model of functions has none
    shown = {"".join(text.split()): q.name for text, q in zip(texts, problem.model.outputs, strict=False)}
    for limit in problem.along or ():
        parts = ["".join(part.split()) for part in re.split(r"[<>]=?", limit)]
        numbers = [float(part) for part in parts if re.fullmatch(NUMBER, part)]
        for part in parts:
            inside = part.removeprefix("abs(").removesuffix(")") if part.startswith("abs(") else part
            values = numbers if inside == part else [*numbers, *(-number for number in numbers)]
            names = {inside} if re.fullmatch(r"[A-Za-z_]\w*", inside) else set()
            for name in names | {shown[text] for text in (inside, part) if text in shown}:
                found.setdefault(name, []).extend(values)
    return found


def _information(problem: DesignProblem, sensitivity: Array, measured: Array) -> Array:
    """Information (S, p) of each sample about each parameter."""
    white = sensitivity / np.sqrt(np.diag(problem.noise_covariance))[:, None]
    information: Array = np.square(white).sum(axis=2)[measured]
    return information
