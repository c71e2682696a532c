"""A design problem: the model, what is known beforehand, where points may lie, and how the outputs are weighed."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..basics.checks import as_sequence, as_std, by_name, check_choice, check_names, some_names_among
from ..basics.messages import listed, shown
from ..basics.quantity import names_of
from ..basics.result_files import Codec
from ..basics.values import Array
from ..models import Model
from ..models.codec import model_from_json, model_to_json
from ..noise.models import Noise, NoiseModel, checked_noise, nominal_std, outputs_of
from ..noise.sensors import Sensors
from ..points.natural_sizes import warn_of_small_states
from ..points.region import ExperimentRegion
from ..points.run_region import RunRegion
from ..points.settings import Integration, check_jumps, check_kinks, check_rtol, crossed_surfaces, resolve_threads
from ..prior.gaussian import GaussianPrior
from ..prior.rules import DEFAULT_RULE, Rule
from ..show.numbers import counted
from ..show.section import Report
from ..show.table_preview import InNotebooks
from .assumed import Assumed, assumed_of
from .deviations import Deviations
from .local import Local, LocalStds, check_local, checked_local
from .problem_report import problem_sections

OUTPUT_COVARIANCES = ("noise", "region", "pooled", "pointwise")
ASSUMED_COVARIANCES = ("tangents", "predictive")
DERIVED = ("output_covariance", "parameters")

LARGEST_SENSITIVITY = 1e140
"""Largest change of an output by a prior standard deviation, in its unit and in noise standard deviations; squares are summed."""


@dataclass(frozen=True, eq=False)
class DesignProblem(InNotebooks):
    """Everything that a design depends on, except for the settings of the search.

    Parameters
    ----------
    model : Model
    prior : GaussianPrior
        One mean and standard deviation for every parameter of the model; kept in the model's order.
    region : ExperimentRegion, RunRegion or None
        Where points, or runs, may lie. None is enough to evaluate given ones.
    noise : mapping of output name to float or Noise, or NoiseModel, optional
        The sensor noise, SI units: a number is the standard deviation of white noise; R of (17) is their squares. An output that is
        not named is not measured: it adds no information, and data of it are left out.
    rule : TensorGrid, GaussHermite, SparseGaussHermite, Sobol, Unscented or LinearizedRule
        How expectations over the prior are taken. Default: `SparseGaussHermite(2)`; the paper's cells are `TensorGrid()`.
    output_covariance : {"noise", "region", "pooled", "pointwise"}, optional
        D of (7): R alone; R plus the mean predictive covariance over a fixed sample of the region; R plus that over the
        design's points, (17); or R plus each point's own. Default: "noise" where `noise` is given, else "region".
    parameters : sequence of str, optional
        Names of the parameters to estimate that all data share; the others are known to be at their mean. Default: all that are
        not local.
    kinks : {"cross", "exclude"}
        Whether points that cross a kink are allowed; "exclude" is the strict reading of (21).
    jumps : {"cross", "exclude"}
        Whether points that meet a jump cross it, as in `simulate`, or are excluded, as in (21), which is the paper's reading.
    rtol : float
        Tolerance of the trajectories.
    uncertain : mapping of name to float, optional
        Standard deviations, SI units, of constants, and of parameters that are not estimated, which are else known exactly. Each
        has one value for the whole plant, in previous data too: however many points there are, they do not average it out.
    varies : mapping of name to float, optional
        The same for what is drawn anew in each point or run: a load, a temperature of the day. It adds to the covariance of the
        outputs of a point or run: R_k = R + H_k P H_k^T.
    initial_state_std : mapping of state name to float, optional
        Standard deviations, SI units, by which starts deviate from x0, anew in each point or run, and once for all runs where the
        region has the start `shared`. A candidate must then start three of them away from jumps and limits.
    local : mapping of name to str or Local, optional
        Parameters with one value for each run, plant or day, instead of one for all data: ``{"m_load": "run"}``, or with a spread,
        ``{"m_load": fp.Local("run", spread=0.1)}``; as `estimate` takes them. They are estimated too, and the design is for the
        others, which all data share. Points and runs have values of their own of what is local to a run or record; the whole
        design shares a value of what is local to a plant or day.
    assumed_covariance : {"tangents", "predictive"}
        Whether R_k has H_k P H_k^T with the exact tangents at the mean, or (16) over the distribution of what is drawn anew, by
        `rule`.
    along : sequence of str, optional
        Limits along the way: comparisons such as ``"abs(v) < 0.4"`` that hold on whole trajectories, see `SymbolicModel.within`. A
        point or run that breaks one at the prior mean is none. What was measured already need not keep them.

    Attributes
    ----------
    estimated : tuple of str
        `parameters` as they are in any case: names in the model's order, also where none were given.
    derived : tuple of str
        Options that were not given: `output_covariance` and `parameters` follow from the others then.

    Raises
    ------
    TypeError, ValueError
        For anything that does not fit together, naming the quantity.
    """

    model: Model
    prior: GaussianPrior
    region: ExperimentRegion | RunRegion | None
    _: KW_ONLY
    noise: Mapping[str, float | Noise] | NoiseModel | None = None
    rule: Rule = DEFAULT_RULE
    output_covariance: str | None = None
    parameters: Sequence[str] | None = None
    kinks: str = "cross"
    jumps: str = "cross"
    rtol: float = 1e-6
    uncertain: Mapping[str, float] | None = None
    varies: Mapping[str, float] | None = None
    initial_state_std: Mapping[str, float] | None = None
    local: Mapping[str, str | Local] | None = None
    assumed_covariance: str = "tangents"
    along: Sequence[str] | None = None
    derived: tuple[str, ...] = field(init=False)

    _CODEC: ClassVar[Codec] = {Model: (model_to_json, model_from_json)}

    def __post_init__(self) -> None:
        object.__setattr__(self, "derived", tuple(name for name in DERIVED if getattr(self, name) is None))
        for name, kind in (("model", Model), ("prior", GaussianPrior), ("rule", Rule)):
            if not isinstance(getattr(self, name), kind):
                raise TypeError(f"{name}: expected a {kind.__name__}, given {type(getattr(self, name)).__name__}")
        if self.region is not None and not isinstance(self.region, ExperimentRegion | RunRegion):
            raise TypeError(f"region: expected an ExperimentRegion, a RunRegion or None, given {type(self.region).__name__}")
        everything = names_of(self.model.parameters)
        check_names(self.prior.names, everything, "prior")
        if self.prior.names != everything:
            object.__setattr__(self, "prior", self.prior.marginal(everything))
        self.model.theta(self.prior.mean)
        self.rule.check(self.prior)
        check_kinks(self.kinks)
        check_jumps(self.jumps)
        set_field = object.__setattr__
        set_field(self, "rtol", check_rtol(self.rtol))
        if self.region is not None:
            set_field(self, "region", self.region.in_units_of(self.model))
            self.region.check(self.model, self.crossed)
            bounds = [self.region.bounds[quantity.name] for quantity in self.model.states]
            warn_of_small_states(self.model, "the region keeps", np.array(bounds).reshape(-1, 2).T, stacklevel=4)
        if self.noise is not None:
            set_field(self, "noise", checked_noise(self.noise, names_of(self.model.outputs)))
        if isinstance(every := getattr(self.region, "sample_every", None), Mapping):
            self._check_clocks(every)
        set_field(self, "local", checked_local(self.local, everything) or None)
        shared = tuple(name for name in everything if name not in self.local_parameters)
        given = (shared or everything) if self.parameters is None else self.parameters
        set_field(self, "parameters", some_names_among(given, everything, "parameters"))
        limits = () if self.along is None else (self.along,) if isinstance(self.along, str) else self.along
        set_field(self, "along", as_sequence(limits, "along", "comparisons as text") or None)
        self._check_assumed(everything)
        of = None if self.region is None else self.region.kind
        default = "noise" if self.noise is not None or of == "run" else "region"
        given_kind = default if self.output_covariance is None else self.output_covariance
        set_field(self, "output_covariance", check_choice(given_kind, OUTPUT_COVARIANCES, "output_covariance"))
        if self.output_covariance == "noise" and self.noise is None:
            raise ValueError("noise: expected the sensor noise for output_covariance='noise', given none")
        if self.output_covariance == "region" and of != "point":
            given_region = "None" if of is None else "one of runs"
            raise ValueError(f"region: expected a region of points for output_covariance='region', given {given_region}")
        self.check_weighs(str(self.output_covariance))

    def _check_clocks(self, every: Iterable[str]) -> None:
        """Raise unless the outputs with samples of their own are those that are measured."""
        there = [name for name, one in zip(names_of(self.model.outputs), self.measured, strict=True) if one]
        for name in (name for name in there if name not in every):
            raise ValueError(
                f"sample_every: expected instants of each output that noise has, {listed(there)}; given none of {name!r}"
            )
        for name in (name for name in every if name not in there):
            raise ValueError(f"sample_every: expected instants of outputs that noise has, {listed(there)}; given some of {name!r}")

    def check_weighs(self, kind: str) -> None:
        """Raise where D of this kind, or what is drawn anew, does not go with the noise, or with local parameters."""
        if self.assumed is not None and self.assumed.free:
            if kind != "noise":
                raise ValueError(f"local: expected a spread between points or runs for output_covariance={kind!r}, given none")
            if self.assumed_covariance != "tangents":
                raise ValueError("local: expected a spread between points or runs for assumed_covariance='predictive', given none")
            if self.region is not None and self.region.kind == "point" and self.measured.sum() <= len(self.assumed.free):
                raise ValueError(
                    f"local: expected more than {counted(int(self.measured.sum()), 'measured output')} to know something beside "
                    f"{counted(len(self.assumed.free), 'value')} of each point, given no more: design runs, or give a spread"
                )
        if self.sensors is None or self.sensors.white:
            return
        white = "noise: expected white noise of constant standard deviations for"
        given = "given noise that grows, has a memory, a resolution or limits, or is correlated"
        if kind != "noise":
            raise ValueError(f"{white} output_covariance={kind!r}, {given}")
        if self.assumed is not None and self.assumed_covariance != "tangents":
            raise ValueError(f"{white} assumed_covariance='predictive', {given}")

    def _in_notebook(self) -> Report:
        return Report(f"Design problem for {self.model.name}", problem_sections(self))

    @property
    def point_region(self) -> ExperimentRegion:
        """The region, which must be one of points."""
        if not isinstance(self.region, ExperimentRegion):
            raise ValueError(f"region: expected an ExperimentRegion for points, given {_kind(self.region)}")
        return self.region

    @property
    def run_region(self) -> RunRegion:
        """The region, which must be one of runs."""
        if not isinstance(self.region, RunRegion):
            raise ValueError(f"region: expected a RunRegion for runs, given {_kind(self.region)}")
        return self.region

    @property
    def crossed(self) -> tuple[str, ...]:
        """Names of the surfaces that trajectories cross, and may start on."""
        return crossed_surfaces(self.model, check_kinks(self.kinks), check_jumps(self.jumps))

    @cached_property
    def limited(self) -> Model:
        """The model within the limits along the way."""
        return self.model.within(*self.along) if self.along else self.model

    def _check_assumed(self, everything: tuple[str, ...]) -> None:
        known = (*names_of(self.model.constant_quantities), *everything)
        _ = self.limited  # raises for limits that cannot be read
        for label, names in (("uncertain", known), ("varies", known), ("initial_state_std", names_of(self.model.states))):
            object.__setattr__(self, label, by_name(getattr(self, label), names, label, as_std) or None)
        for label, given in (("uncertain", self.uncertain), ("varies", self.varies)):
            for name in (name for name in given or () if name in self.estimated):
                raise ValueError(f"{label}: expected constants or parameters that are not estimated, given {name!r}, which is")
        check_local(self.local_parameters, everything, self.estimated, {"uncertain": self.uncertain, "varies": self.varies})
        check_choice(self.assumed_covariance, ASSUMED_COVARIANCES, "assumed_covariance")
        if self.assumed is not None and self.assumed_covariance == "predictive":
            try:
                self.rule.check(self.assumed.prior(self.theta))
            except ValueError as error:
                raise ValueError(
                    f"rule: expected one without names of parameters for assumed_covariance='predictive': {error}"
                ) from error

    def integration(self, threads: int | None) -> Integration:
        """How the problem's trajectories are integrated, in so many threads; None for as many as there are cores."""
        return Integration(self.rtol, check_kinks(self.kinks), check_jumps(self.jumps), threads=resolve_threads(threads))

    def replace(self, **changes: Any) -> DesignProblem:
        """Return a copy with some arguments changed; options that were not given are derived again from the others."""
        known = [one.name for one in dataclasses.fields(self) if one.init]
        for unknown in (name for name in changes if name not in known):
            raise TypeError(f"replace: expected names of {', '.join(known)}; given unknown {shown(unknown)}")
        arguments: dict[str, Any] = dict.fromkeys(self.derived) | changes
        return dataclasses.replace(self, **arguments)

    @property
    def estimated(self) -> tuple[str, ...]:
        """Names of the parameters to estimate, in the model's order."""
        return tuple(self.parameters or ())

    @cached_property
    def theta(self) -> Array:
        """Prior mean in the model's order, (p,)."""
        return _read_only(np.array([self.prior.mean[name] for name in names_of(self.model.parameters)]))

    @cached_property
    def std(self) -> Array:
        """Prior standard deviations of the estimated parameters, (p,)."""
        return _read_only(np.array([self.prior.std[name] for name in self.estimated]))

    @cached_property
    def estimated_columns(self) -> list[int]:
        """Places of the estimated parameters among the model's."""
        return [names_of(self.model.parameters).index(name) for name in self.estimated]

    @cached_property
    def assumed(self) -> Assumed | None:
        """The model with what is not known exactly among its parameters; None where all is."""
        if not self.uncertain and not self.varies and not self.initial_state_std and not self.local:
            return None
        local = LocalStds.of(self.local_parameters, self.prior.std)
        return assumed_of(self.limited, self.uncertain, self.varies, self.initial_state_std, self.shared_starts, local)

    @property
    def local_parameters(self) -> Mapping[str, Local]:
        """The local parameters by name; none where there are none."""
        return checked_local(self.local)

    @property
    def shared_starts(self) -> tuple[str, ...]:
        """States whose start deviates once for all runs, as the region has it `shared`."""
        shared = () if self.region is None else self.region.shared
        return tuple(name for name in self.initial_state_std or () if name in shared)

    @property
    def n_nuisance(self) -> int:
        """How many unknowns there are beside the estimated parameters: uncertain constants, starts that all runs share, and
        local parameters that the whole design shares."""
        return 0 if self.assumed is None else len(self.assumed.nuisance)

    @property
    def unknowns(self) -> tuple[str, ...]:
        """Names of the columns of standardised sensitivities: estimated parameters, and then the nuisance ones."""
        return self.estimated if self.assumed is None else self.estimated + self.assumed.nuisance_names

    @property
    def common(self) -> tuple[str, ...]:
        """Those of them that all data share, whatever their labels."""
        return tuple(name for name in self.unknowns if name not in self.local_parameters)

    @property
    def n_unknowns(self) -> int:
        """How many there are."""
        return len(self.estimated) + self.n_nuisance

    @cached_property
    def _unknown_columns(self) -> list[int]:
        """Places of these among the parameters of the model, or of the model of `assumed`."""
        return self.estimated_columns + ([] if self.assumed is None else self.assumed.nuisance)

    @cached_property
    def _unknown_std(self) -> Array:
        return self.std if self.assumed is None else _read_only(np.append(self.std, self.assumed.nuisance_std))

    @property
    def deviations(self) -> Deviations:
        """By how much what is not known exactly deviates, as `estimate` takes it."""
        rule = self.rule if self.assumed_covariance == "predictive" else None
        return Deviations(
            uncertain=self.uncertain,
            varies=self.varies,
            initial_state_std=self.initial_state_std,
            shared=self.shared_starts,
            local=self.local,
            rule=rule,
        )

    @cached_property
    def largest_sensitivity(self) -> Array:
        """Largest standardised sensitivity of each output (n_y, 1): a point with a larger one is rejected, as its information would
        overflow."""
        given = nominal_std(self.noise)
        noise = [min(1.0, given.get(name, 1.0)) for name in names_of(self.model.outputs)]
        return _read_only(LARGEST_SENSITIVITY * np.array(noise)[:, None])

    def standardised(self, dy_dtheta: Array) -> Array:
        """dy/dtheta (..., n_y, q), of the model's parameters or more, by the `n_unknowns` ones in units of their prior std.

        (..., n_y, n_unknowns); infinite where that is larger than `largest_sensitivity`, or is no number.
        """
        columns = self._unknown_columns
        of_all = columns == list(range(dy_dtheta.shape[-1]))  # nearly always, and a copy less
        with np.errstate(over="ignore", invalid="ignore"):
            scaled: Array = (dy_dtheta if of_all else dy_dtheta[..., columns]) * self._unknown_std
        scaled[~(np.abs(scaled) <= self.largest_sensitivity)] = np.inf
        return scaled

    @cached_property
    def measured(self) -> NDArray[np.bool_]:
        """Which outputs are measured, (n_y,): those that `noise` names, and all where it is not given."""
        return np.array([self.noise is None or name in outputs_of(self.noise) for name in names_of(self.model.outputs)])

    @cached_property
    def sensors(self) -> Sensors | None:
        """The sensors as arrays; None where the noise is not known."""
        return None if self.noise is None else Sensors.of(self.noise, names_of(self.model.outputs))

    @property
    def has_uneven_readings(self) -> bool:
        """Whether an output is rounded or limited."""
        return self.sensors is not None and bool(self.sensors.uneven.any())

    @property
    def white_alone(self) -> bool:
        """Whether D alone whitens rows; else what they need is in the rows: other noise, or free local parameters taken out."""
        return (self.sensors is None or self.sensors.white) and not (self.assumed is not None and self.assumed.free)

    @cached_property
    def noise_covariance(self) -> Array:
        """R of (17), (n_y, n_y); zero where the noise is not known, and 1 of an output that is not `measured`, which has none.

        Of noise that is more than white R is what it has where the outputs are zero; the rows of `white_rows` go with it.
        """
        if self.noise is None:
            return _read_only(np.zeros((len(self.model.outputs), len(self.model.outputs))))
        given = nominal_std(self.noise)
        return _read_only(np.diag(np.square([given.get(name, 1.0) for name in names_of(self.model.outputs)])))


def _read_only(array: Array) -> Array:
    array = array.copy()
    array.flags.writeable = False
    return array


def _kind(region: object) -> str:
    return "None" if region is None else f"a {type(region).__name__}"
