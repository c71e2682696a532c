"""CampaignState of a campaign: its problem and settings, the batches that were measured, and the planned one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from ..basics.checks import check_type
from ..basics.field_checks import Extents
from ..basics.messages import listed, shown
from ..basics.result_files import Kept
from ..basics.stop_reason import StopReason
from ..basics.values import FrozenMapping, relative_errors
from ..data import Measurements
from ..information.problem import DesignProblem
from ..points.points_or_runs import Points
from .batches import Settings, search_of


@dataclass(frozen=True, eq=False)
class Batch:
    """One batch that was measured, and what all data up to it say.

    Attributes
    ----------
    planned : Experiments, Runs or None
        What was designed; None where data came without a design.
    data : Measurements
    estimate, standard_errors : mapping of name to float
        Maximum a posteriori of all data up to this batch, SI units.
    chi_square, degrees_of_freedom : float
        Of all data up to this batch.
    stop_reason : StopReason
        Why the search for the estimate ended.
    local, local_errors : mapping of name to float
        Values of local parameters, as "m_load[3]", and their standard errors, SI units.
    """

    planned: Points | None
    data: Measurements
    estimate: Mapping[str, float]
    standard_errors: Mapping[str, float]
    chi_square: float
    degrees_of_freedom: float
    stop_reason: StopReason
    local: Mapping[str, float] = FrozenMapping({})
    local_errors: Mapping[str, float] = FrozenMapping({})

    _EXTENTS: ClassVar[Extents] = {"local_errors": ("local",)}

    @property
    def converged(self) -> bool:
        """Whether the estimate is a minimum."""
        return self.stop_reason == StopReason.converged

    @property
    def rse(self) -> Mapping[str, float]:
        """Relative standard errors, shares of |estimate|; of an estimate that is zero, inf."""
        return relative_errors(self.standard_errors, self.estimate)


@dataclass(frozen=True, eq=False)
class CampaignState(Kept):
    """All of a campaign: what else it knows follows from this.

    Attributes
    ----------
    problem : DesignProblem
        As it was before the first batch.
    settings : ExchangeSettings or RunSettings
        Of a batch's search; their seed is that of the whole campaign.
    targets : mapping of name to float
    batches : tuple of Batch
    planned : Experiments, Runs or None
        What was designed and whose data are still missing.
    """

    problem: DesignProblem
    settings: Settings
    targets: Mapping[str, float]
    batches: tuple[Batch, ...] = ()
    planned: Points | None = None

    _EXTENTS: ClassVar[Extents] = {
        "targets": ("any problem.estimated",),
        "batches.estimate": ("problem.common",),
        "batches.standard_errors": ("problem.common",),
    }

    def _check_content(self) -> None:
        check_type(self.settings, search_of(self.problem).settings, "settings")
        local = self.problem.local_parameters
        for name in (name for batch in self.batches for name in batch.local if name.partition("[")[0] not in local):
            raise ValueError(f"local: expected values of {listed(local)}, given {shown(name)}")

    @property
    def estimate(self) -> Mapping[str, float]:
        """The estimate so far, SI units: the prior's mean before any data."""
        mean = self.problem.prior.mean
        return self.batches[-1].estimate if self.batches else FrozenMapping({name: mean[name] for name in self.problem.estimated})

    @property
    def standard_errors(self) -> Mapping[str, float]:
        """The standard errors so far, SI units: the prior's standard deviations before any data."""
        std = self.problem.prior.std
        errors = self.batches[-1].standard_errors if self.batches else {name: std[name] for name in self.problem.estimated}
        return FrozenMapping(dict(errors))

    @property
    def rse(self) -> tuple[Mapping[str, float], ...]:
        """Relative standard errors before any data, and after each batch."""
        prior = self.problem.prior
        before = relative_errors({name: prior.std[name] for name in self.problem.estimated}, prior.mean)
        return (before, *(batch.rse for batch in self.batches))
