"""A fit: what `estimate` found, with all that can be made of it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..basics.checks import check_choice
from ..basics.extras import needed_for
from ..engine.workers import Workers
from ..information.problem_report import prior_section
from ..prior.gaussian import GaussianPrior
from ..show.display import Plots, Shown
from ..show.progress import Progress
from ..show.section import Report, Section
from .fit_files import fit_dict, load_fit, save_fit
from .picture_list import plots_of
from .posterior import posterior_of
from .profile import Profile, profile_of, profiles_of
from .profile_curve import ProfileCurve
from .report import fit_facts, fit_report
from .stability import Stability, stability_of
from .statistics import FitStatistics

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False, repr=False)
class Fit(FitStatistics, Shown):
    """Result of `estimate`; see `FitStatistics` for its attributes."""

    def profile(
        self,
        name: str,
        *,
        level: float = 0.95,
        threads: int | None = None,
        progress: bool | Callable[[Progress], None] | None = None,
    ) -> Profile:
        """The profile likelihood of one unknown, and the confidence interval by it; it is right where `intervals` are too linear.

        All other unknowns are estimated again at each value of this one, on values outward from the estimate until the deviance
        passes its threshold on both sides, or an end is shown not to be bounded: the quantile of chi-square with one degree of
        freedom where the noise is known, and its counterpart by Student's t where it was estimated. A prior takes part.

        Parameters
        ----------
        name : str
            One of `parameters`.
        level : float
            Probability of the interval.
        threads : int, optional
            Default: those of the estimate. They do not change the result.
        progress : bool or callable, optional
            True shows a bar, on the terminal and in notebooks; needs rich. A function is called with a `Progress` after each
            evaluation, with how many values of the unknown there were.

        Raises
        ------
        ValueError
            For an unknown name, a level outside 0 to 1, or a number of threads that is none.
        """
        return profile_of(self, name, level, progress, threads)

    def profiles(
        self,
        names: Iterable[str] | None = None,
        *,
        level: float = 0.95,
        threads: int | None = None,
        workers: Workers | None = None,
        progress: bool | Callable[[Progress], None] | None = None,
    ) -> dict[str, Profile]:
        """The profile likelihoods of several unknowns, by their names; see `profile`.

        Parameters
        ----------
        names : iterable of str, optional
            Of `parameters`. Default: `common`, all but the values of local parameters.
        level : float
            Probability of the intervals.
        threads : int, optional
            Default: every core.
        workers : int, Executor or Dask client, optional
            Who computes them, one each at a time (docs/how_to/workers.md). They are the same. Default: this process.
        progress : bool or callable, optional
            True shows a bar, on the terminal and in notebooks; needs rich. A function is called with a `Progress` after each.

        Raises
        ------
        TypeError, ValueError
            As `profile`.
        """
        return profiles_of(self, names, level, threads, workers, progress)

    def stability(self, parts: int | None = None) -> Stability:
        """Fits of parts of the data against each other, each from the fit of all data and with its noise.

        The differences of the estimates are tested by chi-square, with what is common to the parts, as a prior is, taken into
        account; they are as large as chance allows where the model and the noise are right.

        Parameters
        ----------
        parts : int, optional
            Number of parts: consecutive groups of points and runs, and consecutive pieces of each record, and of a run that is
            alone in its set. Default: the sets of data against each other; of a single one, its halves.

        Returns
        -------
        Stability
            A part that cannot be fitted is there with the reason.

        Raises
        ------
        TypeError, ValueError
            For parts that are no whole number above one.
        """
        return stability_of(self, parts)

    def posterior(self) -> GaussianPrior:
        """The estimate and its covariance as the prior of what comes next, of all parameters of the model.

        Starts of records are left behind. Parameters that were not estimated keep their prior. One at its bound gets the covariance
        that it would have without: it is not known as well as not to vary.

        Raises
        ------
        ValueError
            Where the data leave a direction open, or where a parameter was neither estimated nor has a prior.
        """
        return posterior_of(self)

    def report(self, *, profiles: Sequence[ProfileCurve] = (), stability: Stability | None = None) -> Report:
        """The fit as tables, with the profile likelihoods, and the fits of parts of the data, that were computed."""
        return fit_report(self, profiles, stability)

    def _problem_sections(self) -> Sequence[Section]:
        sections = [Section("Fit", (), fit_facts(self))]
        return sections if self.prior is None else [*sections, prior_section(self.prior, self.model.parameters)]

    def _plots(self) -> Plots:
        return plots_of(self)

    def __repr__(self) -> str:
        return f"Fit({', '.join(f'{name}={value:.6g}' for name, value in self.estimate.items())})"

    def plot(
        self,
        kind: str = "parity",
        *,
        path: str | Path | None = None,
        progress: bool | Callable[[Progress], None] | None = None,
    ) -> Figure:
        """Draw how well the fit describes the data, or how well it knows the parameters; needs matplotlib.

        Parameters
        ----------
        kind : {"parity", "residuals", "time", "autocorrelation", "correlation", "ellipses", "local", "profiles"}
            Measured against predicted outputs; residuals in units of the noise; records and runs over time; autocorrelation and
            spectrum of what is left in these; the correlation of the estimates; joint confidence ellipses; the values of local
            parameters; the profile likelihood of every unknown, which takes a while.
        path : path, optional
            Where the picture is also written; the ending says the format, PNG where there is none.
        progress : bool or callable, optional
            Of each of the "profiles", as `profile` takes it; the others are there at once.

        Returns
        -------
        matplotlib.figure.Figure

        Raises
        ------
        ValueError
            For another kind, or the ending of no format of pictures.
        """
        with needed_for("plot"):
            from ..show.style import drawn
            from .pictures import PLOTS, plot_profiles

        if check_choice(kind, (*PLOTS, "profiles"), "kind") == "profiles":
            return drawn(plot_profiles([self.profile(name, progress=progress) for name in self.common]), path)
        return drawn(PLOTS[kind](self), path)

    def to_pandas(self) -> pd.DataFrame:
        """One row per unknown: unit, estimate, standard_error, robust_standard_error, rse, lower_95 and upper_95 of `intervals`."""
        with needed_for("to_pandas"):
            import pandas as pd

        robust = self.robust_standard_errors
        rows = [
            (self.units[name], value, self.standard_errors[name], robust[name], self.rse[name], *self.intervals()[name])
            for name, value in self.estimate.items()
        ]
        columns = ["unit", "estimate", "standard_error", "robust_standard_error", "rse", "lower_95", "upper_95"]
        return pd.DataFrame(rows, pd.Index(self.parameters, name="parameter"), columns)

    def to_dict(self) -> dict[str, Any]:
        """Estimate, covariances, tests and how the search ended, as what JSON can hold; numbers that are not finite are None."""
        return fit_dict(self)

    def save(self, directory: str | Path) -> list[Path]:
        """Write ``estimate.csv``, ``residuals.csv`` and ``fit.json`` (`to_dict`), and ``local.csv`` of local parameters; return
        their paths.

        Each appears whole or not at all, and fit.json last: where it stands, what is beside it belongs to it. Of a fit that was
        there before, the command line's report and pictures go.
        """
        return save_fit(self, directory)

    @classmethod
    def load(cls, directory: str | Path) -> Fit:
        """Read a fit that `save` wrote, with its model, data and prior; its trajectories are computed again.

        Raises
        ------
        OSError
            Where fit.json cannot be read.
        ValueError
            Where it is truncated, was changed, is of another format, or of a model of Python functions, which no file can hold:
            pickle such a fit.
        """
        return Fit(**load_fit(directory))
