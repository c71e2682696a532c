"""``python -m bench.smooth_cylinder``: what the cylinder's smooth form changes in predicted accuracy and in speed."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np
from rich.console import Console
from rich.table import Table

import fisherpoint as fp

from .designs import NOISE_STD, REGION, RELATIVE_STD
from .timing import best_times

SHARP = fp.HydraulicCylinder()
WIDTHS = (1e-2, 1e-3, 1e-4)
PLACES = {
    "away": ("v", {}, ["abs(v) > 0.05", "abs(x_v) > 0.05"]),
    "near v = 0": ("v", {"v": (-0.01, 0.01)}, ["abs(v) < 1e-3"]),
    "near x_v = 0": ("x_v", {"x_v": (-0.01, 0.01)}, ["abs(x_v) < 1e-3", "abs(v) > 0.05"]),
}
"""Where the designs start: the surface made smooth, bounds that differ from the default region's, and constraints."""


def problem(place: str) -> fp.DesignProblem:
    """The default problem with starts in this place; none crosses the jump, which the smooth form turns into something else."""
    _, bounds, constraints = PLACES[place]
    prior = fp.GaussianPrior(SHARP.nominal, relative_std=RELATIVE_STD)
    region = fp.ExperimentRegion({**REGION.bounds, **bounds}, constraints)
    return fp.DesignProblem(SHARP, prior, region, noise=NOISE_STD, jumps="exclude")


def accuracy(place: str, design: fp.Design) -> Iterator[list[str]]:
    """For every width: changes of standard errors in percent, and the largest change of an output in std of its noise."""
    sharp = fp.evaluate(design.problem, design.points)
    reference = fp.simulate(SHARP, design.points, SHARP.nominal, rtol=1e-9).y
    assert sharp.standard_errors is not None
    surface = PLACES[place][0]
    for width in WIDTHS:
        model = fp.HydraulicCylinder(smooth={surface: width})
        found = fp.evaluate(design.problem.replace(model=model), design.points)
        assert found.standard_errors is not None
        change = {name: 100 * (found.standard_errors[name] / value - 1) for name, value in sharp.standard_errors.items()}
        worst = max((name for name in change if name not in ("a_tau", "b_tau")), key=lambda name: abs(change[name]))
        outputs = fp.simulate(model, design.points, SHARP.nominal, rtol=1e-9).y - reference
        yield [
            place,
            f"{surface}: {width:.0e}",
            *(f"{change[name]:+.2g}" for name in ("a_tau", "b_tau")),
            f"{change[worst]:+.2g} ({worst})",
            f"{found.log_det - sharp.log_det:+.2g}",
            f"{(np.abs(outputs) / list(NOISE_STD.values())).max():.2g}",
        ]


def speed(designs: dict[str, fp.Design]) -> Iterator[list[str]]:
    """Experiments per second with nine sensitivities on one core, for every form and design."""
    compiled = fp.HydraulicCylinder(smooth=dict.fromkeys(("v", "x_v"), 1e-3)).compile()
    forms = {"sharp, built in": SHARP, "sharp, interpreted": SHARP.symbolic()}
    forms |= {f"smooth, {width:.0e}": fp.HydraulicCylinder(smooth={"v": width, "x_v": width}) for width in WIDTHS}
    forms |= {"smooth, 1e-03, compiled": compiled} if compiled.compiled else {}
    points = {place: design.points[np.arange(3000) % len(design.points)] for place, design in designs.items()}
    tasks = {
        f"{form}/{place}": partial(fp.sensitivities, model, points[place], SHARP.nominal, threads=1, jumps="exclude")
        for form, model in forms.items()
        for place in PLACES
    }
    times = best_times(tasks, 5)
    for form in forms:
        yield [form, *(f"{len(points[place]) / times[f'{form}/{place}'].seconds / 1000:.1f}" for place in PLACES)]


def main() -> None:
    """Print both tables."""
    console = Console(width=120)
    designs = {
        place: fp.exchange(
            problem(place), n_experiments=12, max_iterations=200, seed=0, method=fp.ExchangeMethod("paper", references=False)
        )
        for place in PLACES
    }
    changed = Table("starts", "width", "a_tau, %", "b_tau, %", "worst other, %", "log det", "outputs / noise std", title="Changes")
    for place, design in designs.items():
        for row in accuracy(place, design):
            changed.add_row(*row)
    console.print(changed)
    rates = Table("form", *PLACES, title="Thousand experiments per second, nine sensitivities, one core")
    for row in speed(designs):
        rates.add_row(*row)
    console.print(rates)


if __name__ == "__main__":
    main()
