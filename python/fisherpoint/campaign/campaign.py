"""A campaign: experiments are designed, measured and estimated in batches, each design made with what is known by then."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..basics.checks import check_type
from ..basics.extras import needed_for
from ..basics.result_files import decoded, encoded
from ..basics.values import FrozenMapping, relative_errors
from ..data import Measurements
from ..design.results.report import points_section
from ..design.results.settings_section import settings_section
from ..design.runs.run_tables import segments_table
from ..estimation.estimate import estimate
from ..estimation.fit import Fit
from ..estimation.precision import quantile
from ..information.problem import DesignProblem
from ..information.problem_report import problem_sections
from ..information.run_information import checked_problem
from ..points.points_or_runs import Points, as_runs
from ..points.settings import resolve_threads
from ..show.display import Plots, Shown
from ..show.progress import Progress
from ..show.section import Report, Section
from .batches import Settings, designed, search_of
from .files import CampaignFiles
from .local import as_previous, check_plants, deviations_of, labelled, of_this_plant, words_of
from .repeated import check_new
from .report import campaign_report
from .settings import batch_seed, batch_settings, checked_targets
from .state import Batch, CampaignState

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


class Campaign(Shown):
    """Design, measure and estimate in batches, until every relative standard error is at its target.

    Each batch is designed at the current estimate, with the information of all data so far: points by `exchange`, or runs by
    `design_runs`, as the region says. Each estimate is the maximum a posteriori of the problem's own prior and all data so far, so
    that nothing counts twice.

    Local parameters are estimated beside the others. Data without labels are of one plant, and each batch is of a day of its own;
    `Measurements` with labels say otherwise. The next batch is designed for the plant of the last one, and for a new day.

    Parameters
    ----------
    problem : DesignProblem
        With an `ExperimentRegion` for points, or a `RunRegion` and the sensor noise for runs.
    batch : int, optional
        Points of a batch, or runs. Default: 6 points, or 1 run.
    targets : mapping of parameter name to float, or float, optional
        Largest relative standard errors (shares of the estimate); one number for all estimated parameters. Parameters without
        target are estimated and designed for like the others.
    seed : int
        Batch k is designed with a seed that follows from this and k.
    directory : path, optional
        Where every change is saved at once; created if necessary. `Campaign.load` continues from there.
    threads : int, optional
        The result does not depend on it.
    **settings
        Of `exchange`, such as goal and n_candidates, or of `design_runs`, such as goal and n_starts; without time_limit, by which
        no search would repeat another.

    Raises
    ------
    TypeError, ValueError
        For misuse, a directory that has a campaign, and what cannot be saved: functions among the constraints or as a model.
    """

    def __init__(
        self,
        problem: DesignProblem,
        batch: int | None = None,
        *,
        targets: Mapping[str, float] | float | None = None,
        seed: int = 0,
        directory: str | Path | None = None,
        threads: int | None = None,
        **settings: Any,
    ) -> None:
        check_type(problem, DesignProblem, "problem")
        words_of(problem)
        state = CampaignState(problem, batch_settings(problem, batch, seed, settings), checked_targets(targets, problem))
        self._begin(state, None, threads)
        if directory is not None:
            self._keep_in(directory)

    def _keep_in(self, directory: str | Path) -> None:
        # What is read from a file has to lead to the same bits: so this campaign too works with what was written.
        files = CampaignFiles(directory, self.problem)
        state = decoded(encoded(self._state), CampaignState)
        self._begin(state, files, self._threads)
        files.create(self._state)

    def _begin(self, state: CampaignState, files: CampaignFiles | None, threads: int | None) -> None:
        self._state, self._files, self._threads = state, files, resolve_threads(threads)
        self._fit: Fit | None = None

    @staticmethod
    def is_in(directory: str | Path) -> bool:
        """Whether `directory` contains a campaign, which `load` continues."""
        return CampaignFiles.path_in(directory).exists()

    @classmethod
    def load(cls, directory: str | Path, *, threads: int | None = None) -> Campaign:
        """Go on with a campaign that was saved in `directory`, at any moment: with the same points, to the same result.

        Raises
        ------
        OSError
            Where campaign.json cannot be read.
        ValueError
            Where it, or the data of a batch, are not as they were written.
        """
        files, state = CampaignFiles.read(directory)
        campaign = cls.__new__(cls)
        campaign._begin(state, files, threads)
        return campaign

    @property
    def problem(self) -> DesignProblem:
        """As it was before the first batch."""
        return self._state.problem

    @property
    def settings(self) -> Settings:
        """Settings of each batch's search; their seed is that of the whole campaign."""
        return self._state.settings

    @property
    def batch(self) -> int:
        """Points of a batch, or runs."""
        return int(getattr(self.settings, search_of(self.problem).size))

    @property
    def history(self) -> tuple[Batch, ...]:
        """The data of each batch, with the estimates after it."""
        return self._state.batches

    @property
    def planned(self) -> Points | None:
        """The points, or runs, that were designed and whose data are still missing."""
        return self._state.planned

    @property
    def targets(self) -> Mapping[str, float]:
        """Relative standard errors to reach. They decide when to stop, not what is designed, and may be changed on the way."""
        return self._state.targets

    @targets.setter
    def targets(self, targets: Mapping[str, float] | float | None) -> None:
        self._change(targets=checked_targets(targets, self.problem))

    @property
    def estimate(self) -> Mapping[str, float]:
        """The estimate so far, SI units: the prior's mean before any data."""
        return self._state.estimate

    @property
    def standard_errors(self) -> Mapping[str, float]:
        """The standard errors so far, SI units: the prior's standard deviations before any data."""
        return self._state.standard_errors

    @property
    def rse(self) -> Mapping[str, float]:
        """The relative standard errors so far."""
        return relative_errors(self.standard_errors, self.estimate)

    @property
    def met(self) -> Mapping[str, bool]:
        """Whether the target of each parameter that has one is met.

        Where the noise is estimated from little, standard errors are small by chance: they count as much wider as Student's t makes
        their 95 % intervals.
        """
        wider = self._wider()
        return FrozenMapping({name: bool(self.rse[name] * wider[name] <= target) for name, target in self.targets.items()})

    def _wider(self) -> Mapping[str, float]:
        fit = self.fit if self.problem.noise is None else None
        if fit is None:
            return dict.fromkeys(self.problem.estimated, 1.0)
        quantiles = quantile(0.95, np.array(list(fit.quantile_degrees_of_freedom.values())))
        return dict(zip(fit.parameters, (quantiles / quantile(0.95, np.array(np.inf))).tolist(), strict=True))

    @property
    def done(self) -> bool:
        """Whether there are targets, and an estimate that is a minimum by which all of them are met."""
        return bool(self.history and self.targets) and self.history[-1].converged and all(self.met.values())

    @property
    def data(self) -> Measurements | None:
        """All data so far, without points and runs of which nothing was measured; None before any."""
        return self._measured([one.data for one in self.history]) if self.history else None

    @property
    def fit(self) -> Fit | None:
        """The fit of all data so far; None before any."""
        if self._fit is None and self.history:
            self._fit = self._estimated(self.history[:-1], self.history[-1].data)
        return self._fit

    def next(self, *, progress: bool | Callable[[Progress], None] | None = None) -> Points:
        """Return the next points, or runs, to measure: those that are planned, or else newly designed ones.

        Parameters
        ----------
        progress : bool or callable, optional
            As for `exchange`, or `design_runs`: True shows a bar.

        Raises
        ------
        KeyboardInterrupt
            Where Ctrl-C ended the search; nothing is planned then.
        ValueError
            As `exchange`, or `design_runs`.
        """
        if self.planned is not None:
            if self._files is not None:
                self._files.write_batch(self._state, again=True)
            return self.planned
        prior, settings = self.problem.prior, replace(self.settings, seed=batch_seed(self.settings.seed, len(self.history)))
        # The posterior has the data in it, but for what they say of constants that all data share.
        again = not settings.goal.prior_information or self.problem.n_nuisance > 0
        if self.fit is not None:
            posterior = self.fit.posterior()
            prior = prior.moved_to(posterior.mean) if settings.goal.prior_information and again else posterior
            prior = of_this_plant(self.problem, self.fit, prior)
        found = designed(
            self.problem.replace(prior=prior),
            settings,
            threads=self._threads,
            progress=progress,
            previous=as_previous(self.problem, self.data) if again and self.data is not None else None,
        )
        if self._files is not None:
            self._files.write_batch(replace(self._state, planned=found))
        self._change(planned=found)
        return found

    def tell(self, data: Measurements, *, progress: bool | Callable[[Progress], None] | None = None) -> Fit:
        """Add data, estimate, and save; the next points will be new ones.

        Parameters
        ----------
        data : Measurements
            Of the planned points or runs, or of others: starts as measured, some left out, replicates, data from before the
            campaign.
        progress : bool or callable, optional
            As for `estimate`: True shows a bar.

        Returns
        -------
        Fit
            Of all data so far.

        Raises
        ------
        TypeError, ValueError
            For data of another model, data of runs where D is not the sensor noise, data that were added before, and as
            `estimate`; the campaign stays as it was. Two points that were added before, to the last bit, are refused among
            others too. So is a run whose samples were all added before, also where one of the two continues beyond the other's
            end. A single repeated sample counts as a replicate, with a warning: replicates of a coarse sensor, several of which
            read the same, can be added one at a time. A run of which half the samples were added before counts too, with a
            warning.
        """
        check_type(data, Measurements, "data")
        if data.runs.points is None:
            checked_problem(self.problem)
        model, points = self.problem.model, data.points
        given = (points.x0.shape[1], points.u.shape[-1], data.y.shape[-1])
        expected = (len(model.states), len(model.inputs), len(model.outputs))
        if given != expected:
            raise ValueError(f"data: expected {expected} states, inputs and outputs of {model.name}, given {given}")
        number = self.known_batch(data)
        if number is not None:
            raise ValueError(f"data: expected new measurements, given those of batch {number} again")
        check_new([one.data for one in self.history], data)
        check_plants(self.problem, [one.data for one in self.history], data)
        fit = self._estimated(self.history, data, progress)
        own = [name for name in fit.parameters if name not in self.problem.common]
        batch = Batch(
            planned=self.planned,
            data=data,
            estimate=_some(fit.estimate, self.problem.common),
            standard_errors=_some(fit.standard_errors, self.problem.common),
            local=_some(fit.estimate, own),
            local_errors=_some(fit.standard_errors, own),
            chi_square=fit.chi_square,
            degrees_of_freedom=fit.degrees_of_freedom,
            stop_reason=fit.stop_reason,
        )
        if self._files is not None:
            self._files.write_data(len(self.history) + 1, data, model)
        self._change(batches=(*self.history, batch), planned=None)
        self._fit = fit
        return fit

    def known_batch(self, data: Measurements) -> int | None:
        """The number, from 1, of the batch that has exactly these data; None where they are new."""
        check_type(data, Measurements, "data")
        return next((k for k, one in enumerate(self.history, 1) if one.data == data), None)

    def to_pandas(self) -> pd.DataFrame:
        """Relative standard errors: one row per parameter, a column for the prior and one for each batch."""
        with needed_for("to_pandas"):
            import pandas as pd

        names = ["prior", *(f"batch {k}" for k in range(1, len(self.history) + 1))]
        frame = pd.DataFrame(dict(zip(names, map(dict, self._state.rse), strict=True)))
        return frame.rename_axis("parameter")

    def save(self, directory: str | Path) -> None:
        """Keep a campaign that has no directory in one that has no campaign; from now on every change is saved there at once."""
        if self._files is not None:
            raise ValueError(f"directory: expected a campaign without one, given one that is saved in {self._files.directory}")
        self._keep_in(directory)

    def report(self) -> Report:
        """Relative standard errors over the batches, targets and what is met."""
        return campaign_report(self._state, self.met, self.done)

    def _page_report(self) -> Report:
        report, model, planned = self.report(), self.problem.model, self.planned
        if planned is None:
            return report
        title = "Next batch"
        runs = as_runs(planned)
        table = segments_table(model, runs, title) if planned is runs else points_section(title, model, runs.starts)
        return replace(report, sections=[*report.sections, table])

    def _problem_sections(self) -> Sequence[Section]:
        return [*problem_sections(self.problem), settings_section(self.settings)]

    def _plots(self) -> Plots:
        return {"campaign": self.plot} if self.history else {}

    def plot(self, *, path: str | Path | None = None) -> Figure:
        """Draw the relative standard errors over the batches, with the targets as lines; needs matplotlib.

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
            from .pictures import plot_campaign

        return drawn(plot_campaign(self._state.rse, self.targets), path)

    def __repr__(self) -> str:
        stage = "all targets met" if self.done else "a batch to measure" if self.planned is not None else "a batch to design"
        return f"Campaign({self.problem.model.name}, {len(self.history)} batches measured, {stage})"

    def _estimated(
        self,
        before: tuple[Batch, ...],
        data: Measurements,
        progress: bool | Callable[[Progress], None] | None = None,
    ) -> Fit:
        """The fit of the data of the batches `before` and of `data`, a function of these alone.

        It starts at the estimate before, too: the batch was designed there, and at the prior's mean their trajectories may fail.
        """
        problem, measured = self.problem, self._measured([*(one.data for one in before), data])
        return estimate(
            problem.model,
            measured,
            prior=problem.prior,
            start={**before[-1].estimate, **before[-1].local} if before else None,
            parameters=problem.estimated,
            noise=problem.noise,
            deviations=deviations_of(problem, measured),
            threads=self._threads,
            progress=progress,
        )

    def _measured(self, batches: list[Measurements]) -> Measurements:
        """The data of all batches, without points and runs of which nothing was measured: their trajectories may well fail."""
        return Measurements.join(labelled(self.problem, batches)).measured_part

    def _change(self, **changes: Any) -> None:
        """Save, then take over: where that fails, nothing has changed."""
        state = replace(self._state, **changes)
        if self._files is not None:
            self._files.write(state)
        self._state = state


def _some(given: Mapping[str, float], names: Sequence[str]) -> Mapping[str, float]:
    return FrozenMapping({name: given[name] for name in names})
