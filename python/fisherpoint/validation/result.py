"""What `validate` found: per design and parameter, as a table and a picture."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..basics.extras import needed_for
from ..information.problem import DesignProblem
from ..models import Model
from .figures import FEWEST, Figure
from .of_design import DesignValidation

if TYPE_CHECKING:
    import pandas as pd


LEGEND = """\
promised: standard error under the noise that the fits reckon with, at the prior mean; claimed: mean of the fits' own ones;
achieved: standard deviation of the estimates' errors, and its ratio to promised; typical ratio: the same of their median size,
which a few fits that run away do not move; rmse: root mean square error; coverage: of the fits' 95 % intervals.
promised, claimed, achieved, bias and rmse in shares of the prior std; 0.987(22) is 0.987 +- 0.022, a Monte Carlo standard error."""


@dataclass(frozen=True, eq=False, repr=False)
class Validation:
    """What `validate` found; it shows itself as a table.

    Attributes
    ----------
    problem : DesignProblem
    designs : mapping of name to DesignValidation
    noise_std : mapping of output name to float
        Of the outputs that were measured.
    runs : int
        Virtual experiments with each design.
    theta : "prior", "mean" or mapping of parameter name to float
    seed : int
    redrawn : int
        Draws from the prior that were left out because they make no sense to the model.
    truth : Model or None
        That made the data in the place of the problem's model.
    noise : {"known", "estimated"}
    use_prior : bool
    seconds : float
    """

    problem: DesignProblem
    designs: Mapping[str, DesignValidation]
    noise_std: Mapping[str, float]
    runs: int
    theta: str | Mapping[str, float]
    seed: int
    redrawn: int
    truth: Model | None
    noise: str
    use_prior: bool
    seconds: float

    def frame(self) -> pd.DataFrame:
        """All figures, one row per design and parameter; columns that end in "_mc" are Monte Carlo standard errors. SI units."""
        with needed_for("frame"):
            import pandas as pd

        rows = []
        for name, design in self.designs.items():
            for parameter, of in design.parameters.items():
                row: dict[str, Any] = {"design": name, "parameter": parameter, "prior_std": of.prior_std, "promised": of.promised}
                for label in ("achieved", "ratio", "typical", "typical_ratio", "bias", "rmse", "claimed", "coverage"):
                    figure: Figure = getattr(of, label)
                    row |= {label: figure.value, f"{label}_mc": figure.error}
                rows.append(row | {"at_bound": of.at_bound, "fits": design.fits, "failed": sum(design.failures.values())})
        return pd.DataFrame(rows).set_index(["design", "parameter"])

    def plot(self, path: str | Path) -> None:
        """Draw promised against achieved standard errors and the coverage of every design; the ending says the format."""
        with needed_for("plot"):
            from ..show.style import save_figure
            from .pictures import plot_validation

        save_figure(plot_validation(self.designs), path)

    def __str__(self) -> str:
        return text(self)

    __repr__ = __str__


def text(validation: Validation) -> str:
    """One table per design, headed by what was done."""
    lines = [headline(validation)]
    for name, design in validation.designs.items():
        lines += ["", *_design(name, design, validation.runs)]
    return "\n".join([*lines, "", LEGEND])


def headline(validation: Validation) -> str:
    """What was done, in a sentence."""
    theta = validation.theta
    truth = {"prior": "true parameters from the prior", "mean": "true parameters at the prior mean"}
    said = truth[theta] if isinstance(theta, str) else "true parameters as given"
    kind = "maximum a posteriori" if validation.use_prior else "weighted least squares"
    parts = [f"{validation.runs} virtual experiments each, {said}, noise {validation.noise}, {kind}, seed {validation.seed}"]
    if validation.truth is not None:
        parts.append(f"data made by another model ({validation.truth.name})")
    if validation.problem.uncertain and validation.truth is None:
        parts.append(f"{', '.join(validation.problem.uncertain)} off by an error that all points of an experiment share")
    if validation.problem.initial_state_std:
        parts.append("starts off by an error of each point")
    if validation.redrawn:
        parts.append(f"{validation.redrawn} draws from the prior left out, which make no sense to the model")
    return "; ".join(parts)


def _design(name: str, design: DesignValidation, n: int) -> Iterator[str]:
    failed = sum(design.failures.values())
    yield f"{name}: {len(design.points)} points, {design.fits} fits, {failed} failed"
    for reason, count in design.failures.items():
        yield f"  {count} of {n}: {reason}"
    for direction in design.null_directions:
        yield f"  not determined: {direction}"
    if design.per_run is None:
        yield "  nothing was fitted: the points determine no parameter"
        return
    if design.fits < FEWEST:
        yield f"  no figures: expected at least {FEWEST} fits that did not fail"
    columns = ("promised", "claimed", "achieved", "ratio", "typical ratio", "bias", "rmse", "coverage")
    width = max(len("parameter"), *map(len, design.parameters))
    yield f"  {'parameter':<{width}} {columns[0]:>9} {columns[1]:>9}" + "".join(f" {column:>13}" for column in columns[2:])
    for parameter, of in design.parameters.items():
        prior = of.prior_std
        figures = (
            of.achieved.over(prior),
            of.ratio,
            of.typical_ratio,
            of.bias.over(prior),
            of.rmse,
        )
        told = "".join(f" {'-' if np.isnan(value) else f'{value / prior:#.3g}':>9}" for value in (of.promised, of.claimed.value))
        cells = [*map(with_error, figures), with_error(Figure(100 * of.coverage.value, 100 * of.coverage.error), " %")]
        at_bound = f"  {of.at_bound} at a bound" if of.at_bound else ""
        yield f"  {parameter:<{width}}{told}" + "".join(f" {cell:>13}" for cell in cells) + at_bound


def with_error(figure: Figure, unit: str = "") -> str:
    """A figure with its error in its last digits: 0.987(22) for 0.987 +- 0.022."""
    if np.isnan(figure.value):
        return "-"
    if not figure.error > 0:
        return f"{figure.value:.3g}{unit}"
    if figure.error >= 9.95:
        return f"{figure.value:.2g}({figure.error:.1g}){unit}"
    decimals = min(9, max(0, 1 - int(np.floor(np.log10(figure.error)))))
    error = round(figure.error * 10**decimals)
    return f"{figure.value:.{decimals}f}({error}){unit}" if decimals else f"{figure.value:.0f}({figure.error:.0f}){unit}"
