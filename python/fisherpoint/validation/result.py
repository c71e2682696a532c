"""What `validate` found: per design and parameter, as a table and a picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from ..basics.extras import needed_for
from ..basics.kept import Codec, Kept
from ..information.codec import problem_from_json, problem_to_json
from ..information.problem import DesignProblem
from ..information.problem_report import problem_sections
from ..models import Model
from ..models.codec import model_from_json, model_to_json
from ..points.codec import points_from_json, points_to_json, runs_from_json, runs_to_json
from ..points.experiments import Experiments
from ..points.runs import Runs
from ..show.numbers import computed, with_error
from ..show.section import Report, Section
from ..show.shown import Plots, Shown
from .design_validation import DesignValidation
from .figures import FEWEST, Figure, ParameterFigures
from .fits import VirtualFits

if TYPE_CHECKING:
    import matplotlib.figure
    import pandas as pd


LEGEND = (
    "promised: standard error under the noise that the fits reckon with, at the prior mean; claimed: mean of the fits' own ones; "
    "achieved: standard deviation of the estimates' errors, and its ratio to promised; typical ratio: the same of their median "
    "size, which a few diverging fits do not move; rmse: root mean square error; coverage: of the fits' 95 % intervals.",
    "promised, claimed, achieved, bias and rmse in shares of the prior std; 0.987(22) is 0.987 +- 0.022, a Monte Carlo standard "
    "error.",
)


@dataclass(frozen=True, eq=False, repr=False)
class Validation(Shown, Kept):
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

    FORMAT_VERSION = 2
    _RENAMED: ClassVar[Mapping[str, str]] = {"Runs": "VirtualFits"}
    _INSIDE = (DesignValidation, ParameterFigures, Figure, VirtualFits)
    _CODEC: ClassVar[Codec] = {
        DesignProblem: (problem_to_json, problem_from_json),
        Experiments: (points_to_json, points_from_json),
        Runs: (runs_to_json, runs_from_json),
        Model: (model_to_json, model_from_json),
    }

    def to_pandas(self) -> pd.DataFrame:
        """All figures, one row per design and parameter; columns that end in "_mc" are Monte Carlo standard errors. SI units."""
        with needed_for("to_pandas"):
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

    def plot(self, *, path: str | Path | None = None) -> matplotlib.figure.Figure:
        """Draw promised against achieved standard errors, and the coverage of the intervals, of every design; needs matplotlib.

        Parameters
        ----------
        path : path, optional
            Where the picture is also written; the ending says the format, PNG where there is none.

        Returns
        -------
        matplotlib.figure.Figure
        """
        with needed_for("plot"):
            from ..show.style import drawn
            from .pictures import plot_validation

        return drawn(plot_validation(self.designs), path)

    def _asked(self) -> Sequence[Section]:
        return problem_sections(self.problem)

    def _plots(self) -> Plots:
        return {"validation": self.plot}

    def report(self) -> Report:
        """One table per design, headed by what was done."""
        sections = [_section(name, design, self.runs) for name, design in self.designs.items()]
        return Report(headline(self), [*sections, Section("", notes=LEGEND)])


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
        runs = [isinstance(design.points, Runs) for design in validation.designs.values()]
        kinds = [kind for kind, there in (("point", not all(runs)), ("run", any(runs))) if there]
        parts.append(f"starts off by an error of each {' and '.join(kinds)}")
    if validation.redrawn:
        parts.append(f"{validation.redrawn} draws from the prior left out, which make no sense to the model")
    return "; ".join(parts)


def _section(name: str, design: DesignValidation, n: int) -> Section:
    failed = sum(design.failures.values())
    notes = [f"{count} of {n}: {reason}" for reason, count in design.failures.items()]
    notes += [f"not determined: {direction}" for direction in design.null_directions]
    title = f"{name}: {design.size}, {design.fits} fits, {failed} failed"
    if design.per_run is None:
        return Section(title, notes=[*notes, "nothing was fitted: the points determine no parameter"])
    if design.fits < FEWEST:
        notes.append(f"no figures: expected at least {FEWEST} fits that did not fail")
    columns = ("parameter", "promised", "claimed", "achieved", "ratio", "typical ratio", "bias", "rmse", "coverage")
    rows = []
    for parameter, of in design.parameters.items():
        prior = of.prior_std
        told = (computed(value / prior) for value in (of.promised, of.claimed.value))
        figures = (of.achieved.over(prior), of.ratio, of.typical_ratio, of.bias.over(prior), of.rmse)
        coverage = with_error(100 * of.coverage.value, 100 * of.coverage.error, " %")
        rows.append((parameter, *told, *(with_error(one.value, one.error) for one in figures), coverage))
    notes += [f"{of.at_bound} fits have {parameter} at a bound" for parameter, of in design.parameters.items() if of.at_bound]
    return Section(title, columns, rows, notes=notes)
