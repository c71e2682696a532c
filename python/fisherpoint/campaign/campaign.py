"""A campaign: experiments are designed, measured and estimated in batches, each design made with what is known by then."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import asdict, fields, replace
from inspect import signature
from pathlib import Path
from typing import Any

import numpy as np

from ..basics.checks import as_float, check_known, check_positive_int
from ..basics.extras import needed_for
from ..basics.messages import shown
from ..basics.quantity import names_of
from ..basics.values import Array, FrozenMapping
from ..data import Measurements
from ..design.exchange import exchange
from ..design.found import ExchangeSettings
from ..design.search import Progress
from ..estimation.estimate import estimate
from ..estimation.fit import Fit
from ..estimation.precision import quantile
from ..information.files import problem_from_json, problem_to_json
from ..information.problem import DesignProblem
from ..points.experiments import Experiments
from ..points.trajectories import check_type, resolve_threads
from .files import CampaignFiles
from .report import report_text
from .state import Batch, State, relative

_NOT_SETTINGS = ("n_experiments", "seed", "time_limit")


class Campaign:
    """Design, measure and estimate in batches, until every relative standard error is at its target.

    Each batch is the exchange's at the current estimate, with the information of all data so far; each estimate is the maximum a
    posteriori of the problem's own prior and all data so far, so that nothing counts twice.

    Parameters
    ----------
    problem : DesignProblem
        With a region.
    batch : int
        Points of a batch.
    targets : mapping of parameter name to float, or float, optional
        Largest relative standard errors (shares of the estimate); one number for all estimated parameters. Parameters without
        target are estimated and designed for like the others.
    seed : int
        Batch k is designed with a seed that follows from this and k.
    directory : path, optional
        Where every change is saved at once; made where needed. `Campaign.load` goes on from there.
    threads : int, optional
        The result does not depend on it.
    **settings
        Of `exchange`, such as n_candidates and max_iterations; without time_limit, by which no run would repeat another.

    Raises
    ------
    TypeError, ValueError
        For misuse, a directory that has a campaign, and what cannot be saved: functions among the constraints or as a model.
    """

    def __init__(
        self,
        problem: DesignProblem,
        batch: int = 6,
        *,
        targets: Mapping[str, float] | float | None = None,
        seed: int = 0,
        directory: str | Path | None = None,
        threads: int | None = None,
        **settings: Any,
    ) -> None:
        check_type(problem, DesignProblem, "problem")
        if problem.region is None:
            raise ValueError("region: expected an ExperimentRegion to design in, given None")
        state = State(problem, _settings(batch, seed, settings), _targets(targets, problem))
        self._begin(state, None, threads)
        if directory is not None:
            # What is read from a file has to lead to the same bits: so this campaign too works with what was written.
            files = CampaignFiles(directory, problem_to_json(problem))
            self._begin(replace(state, problem=problem_from_json(files.problem_json)), files, threads)
            files.create(self._state)

    def _begin(self, state: State, files: CampaignFiles | None, threads: int | None) -> None:
        self._state, self._files, self._threads = state, files, resolve_threads(threads)
        self._fit: Fit | None = None

    @staticmethod
    def is_in(directory: str | Path) -> bool:
        """Whether a campaign was begun in `directory`: `load` goes on with it."""
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
    def settings(self) -> ExchangeSettings:
        """Of a batch's search; their seed is that of the whole campaign."""
        return self._state.settings

    @property
    def batch(self) -> int:
        """Points of a batch."""
        return self._state.settings.n_experiments

    @property
    def history(self) -> tuple[Batch, ...]:
        """What was told, with the estimates after it."""
        return self._state.batches

    @property
    def planned(self) -> Experiments | None:
        """Points that were designed and not yet told."""
        return self._state.planned

    @property
    def targets(self) -> Mapping[str, float]:
        """Relative standard errors to reach. They decide when to stop, not what is designed, and may be changed on the way."""
        return self._state.targets

    @targets.setter
    def targets(self, targets: Mapping[str, float] | float | None) -> None:
        self._change(targets=_targets(targets, self.problem))

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
        return relative(self.standard_errors, self.estimate)

    @property
    def met(self) -> Mapping[str, bool]:
        """Whether the target of each parameter that has one is met.

        Where the noise is estimated from little, standard errors are small by chance: they count as much wider as Student's t makes
        their 95 % intervals.
        """
        wider = self._wider()
        return FrozenMapping({name: bool(self.rse[name] * wider[name] <= target) for name, target in self.targets.items()})

    def _wider(self) -> Mapping[str, float]:
        fit = self.fit if self.problem.noise_std is None else None
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
        """All data so far, without points of which nothing was measured; None before any."""
        return _measured([one.data for one in self.history]) if self.history else None

    @property
    def fit(self) -> Fit | None:
        """The fit of all data so far; None before any."""
        if self._fit is None and self.history:
            self._fit = self._estimated(self.history[:-1], self.history[-1].data)
        return self._fit

    def next(self, *, progress: Callable[[Progress], None] | None = None) -> Experiments:
        """Return the next points to measure: those that are planned, or else newly designed ones.

        Parameters
        ----------
        progress : callable, optional
            As for `exchange`.

        Raises
        ------
        KeyboardInterrupt
            Where Ctrl-C ended the search; nothing is planned then.
        ValueError
            As `exchange`.
        """
        if self.planned is None:
            prior = self.problem.prior if self.fit is None else self.fit.posterior()
            settings = replace(self.settings, seed=_seed(self.settings.seed, len(self.history)))
            found = exchange(
                self.problem.replace(prior=prior),
                **asdict(settings),
                threads=self._threads,
                progress=progress,
                previous=self.data,
            )
            if found.stop_reason == "interrupted":
                raise KeyboardInterrupt
            if self._files is not None:
                self._files.write_points(replace(self._state, planned=found.points))
            self._change(planned=found.points)
            return found.points
        if self._files is not None:
            self._files.write_points(self._state, again=True)
        return self.planned

    def tell(self, data: Measurements) -> Fit:
        """Add data, estimate, and save; the next points will be new ones.

        Parameters
        ----------
        data : Measurements
            Of the planned points, or of others: starts as measured, points left out, replicates, data from before the campaign.

        Returns
        -------
        Fit
            Of all data so far.

        Raises
        ------
        TypeError, ValueError
            For data of another model, data that were told before, and as `estimate`; the campaign stays as it was. Two rows that
            were told before, to the last bit, are refused among others too. A single one is taken as a replicate that reads the
            same, with a warning: replicates of a coarse sensor, of which several do, can be told one at a time.
        """
        check_type(data, Measurements, "data")
        model = self.problem.model
        given = (data.points.x0.shape[1], data.points.u.shape[1], data.y.shape[1])
        expected = (len(model.states), len(model.inputs), len(model.outputs))
        if given != expected:
            raise ValueError(f"data: expected {expected} states, inputs and outputs of {model.name}, given {given}")
        told = self.told(data)
        if told is not None:
            raise ValueError(f"data: expected new measurements, given those of batch {told} once more")
        self._refuse_rows_again(data)
        fit = self._estimated(self.history, data)
        batch = Batch(
            planned=self.planned,
            data=data,
            estimate=fit.estimate,
            standard_errors=fit.standard_errors,
            chi_square=fit.chi_square,
            degrees_of_freedom=fit.degrees_of_freedom,
            converged=fit.converged,
        )
        if self._files is not None:
            self._files.write_data(len(self.history) + 1, data, model)
        self._change(batches=(*self.history, batch), planned=None)
        self._fit = fit
        return fit

    def _refuse_rows_again(self, data: Measurements) -> None:
        """Raise for rows that would count twice; warn of a single one, which may be a replicate."""
        again = {k: rows for k, one in enumerate(self.history, 1) if (rows := _rows_again(one.data, data))}
        count = len(set().union(*again.values()))
        if not count:
            return
        k = max(again, key=lambda k: len(again[k]))
        number = int(np.isfinite(self.history[k - 1].data.y).any(axis=1).sum())
        if count == 1:
            row = min(again[k])
            warnings.warn(f"data: row {row} was told with batch {k} too; it counts as measured once more", stacklevel=3)
            return
        which = "those" if len(again[k]) >= number else f"{len(again[k])} of the {number} rows"
        raise ValueError(f"data: expected new measurements alone, given {which} of batch {k} among them once more")

    def told(self, data: Measurements) -> int | None:
        """The number, from 1, of the batch that has exactly these data; None where they are new."""
        check_type(data, Measurements, "data")
        return next((k for k, one in enumerate(self.history, 1) if one.data == data), None)

    def report(self) -> str:
        """Relative standard errors over the batches, targets and what is met, as text."""
        return report_text(self._state, self.met, self.done)

    def plot(self, path: str | Path) -> None:
        """Draw the relative standard errors over the batches, with the targets as lines; needs matplotlib."""
        with needed_for("plot"):
            from ..show.style import save_figure
            from .pictures import plot_campaign

        save_figure(plot_campaign(self._state.rse, self.targets), path)

    def __repr__(self) -> str:
        stage = "all targets met" if self.done else "a batch to measure" if self.planned is not None else "a batch to design"
        return f"Campaign({self.problem.model.name}, {len(self.history)} batches told, {stage})"

    def _estimated(self, before: tuple[Batch, ...], data: Measurements) -> Fit:
        """The fit of the data of the batches `before` and of `data`, a function of these alone.

        It starts at the estimate before, too: the points were designed there, and at the prior's mean their trajectories may fail.
        """
        problem = self.problem
        return estimate(
            problem.model,
            _measured([*(one.data for one in before), data]),
            prior=problem.prior,
            start=before[-1].estimate if before else None,
            parameters=problem.estimated,
            noise_std=problem.noise_std,
            uncertain=problem.uncertain,
            initial_state_std=problem.initial_state_std,
            assumed_rule=problem.assumed_rule,
            threads=self._threads,
        )

    def _change(self, **changes: Any) -> None:
        """Save, then take over: where that fails, nothing has changed."""
        state = replace(self._state, **changes)
        if self._files is not None:
            self._files.write(state)
        self._state = state


def _measured(parts: list[Measurements]) -> Measurements:
    """All parts, without points of which nothing was measured: their trajectories may well fail."""
    joined = Measurements.join(parts)
    return joined[np.flatnonzero(np.isfinite(joined.y).any(axis=1))]


def _rows_again(told: Measurements, data: Measurements) -> set[int]:
    """Rows of `data` at a point of `told` at which the outputs that both have are the same to the last bit."""
    before: dict[bytes, list[Array]] = {}
    for point, y in zip(told.points.table, told.y, strict=True):
        before.setdefault(point.tobytes(), []).append(y)
    again = set()
    for row, (point, y) in enumerate(zip(data.points.table, data.y, strict=True)):
        for other in before.get(point.tobytes(), ()):
            both = np.isfinite(y) & np.isfinite(other)
            if both.any() and (y[both] == other[both]).all():
                again.add(row)
    return again


def _seed(seed: int, batches: int) -> int:
    """The seed of the search after so many batches."""
    return int(np.random.SeedSequence([seed, batches]).generate_state(1)[0])


def _settings(batch: int, seed: int, given: Mapping[str, Any]) -> ExchangeSettings:
    """Settings of the search for a batch, with the defaults of `exchange` but for references, which a batch needs none of."""
    defaults = {name: one.default for name, one in signature(exchange).parameters.items()}
    known = [field.name for field in fields(ExchangeSettings) if field.name not in _NOT_SETTINGS]
    for unknown in (name for name in given if name not in known):
        raise TypeError(f"settings: expected names of {', '.join(known)}; given {shown(unknown)}")
    values = {name: defaults[name] for name in known} | {"references": False} | dict(given)
    return ExchangeSettings(
        n_experiments=check_positive_int(batch, "batch"), seed=check_positive_int(seed, "seed", 0), time_limit=None, **values
    )


def _targets(given: Mapping[str, float] | float | None, problem: DesignProblem) -> Mapping[str, float]:
    """Targets by name, in the model's order of parameters."""
    names = problem.estimated
    if given is None:
        return FrozenMapping({})
    targets = dict(given) if isinstance(given, Mapping) else dict.fromkeys(names, given)
    check_known(targets, names, "targets")
    checked = {
        name: as_float(targets[name], f"targets[{name!r}]") for name in names_of(problem.model.parameters) if name in targets
    }
    for name, value in checked.items():
        if not value > 0:
            raise ValueError(f"targets[{name!r}]: expected a positive share of the estimate, given {value:g}")
    return FrozenMapping(checked)
