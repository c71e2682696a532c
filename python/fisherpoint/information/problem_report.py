"""A problem as tables."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Protocol

from ..basics.quantity import Quantity
from ..models import Model
from ..noise.models import Noise, NoiseModel, NoiseOf, outputs_of
from ..points.region import ExperimentRegion
from ..points.run_region import RunRegion
from ..prior.gaussian import GaussianPrior
from ..prior.rules import Rule
from ..show.numbers import number
from ..show.section import Section
from .local import Local


class ProblemFacts(Protocol):
    """A :class:`fisherpoint.DesignProblem`."""

    @property
    def model(self) -> Model: ...
    @property
    def prior(self) -> GaussianPrior: ...
    @property
    def region(self) -> ExperimentRegion | RunRegion | None: ...
    @property
    def estimated(self) -> tuple[str, ...]: ...
    @property
    def noise(self) -> NoiseOf | None: ...
    @property
    def uncertain(self) -> Mapping[str, float] | None: ...
    @property
    def varies(self) -> Mapping[str, float] | None: ...
    @property
    def initial_state_std(self) -> Mapping[str, float] | None: ...
    @property
    def local_parameters(self) -> Mapping[str, Local]: ...
    @property
    def output_covariance(self) -> str | None: ...
    @property
    def rule(self) -> Rule: ...
    @property
    def kinks(self) -> str: ...
    @property
    def jumps(self) -> str: ...
    @property
    def along(self) -> Sequence[str] | None: ...
    @property
    def rtol(self) -> float: ...


def problem_sections(problem: ProblemFacts) -> list[Section]:
    """Model, noise and options; the prior; the region."""
    model = problem.model
    facts = [
        ("model", model.name),
        ("states", _listed(model.states)),
        ("inputs", _listed(model.inputs)),
        ("outputs", _listed(model.outputs)),
        ("parameters to estimate", ", ".join(problem.estimated)),
        ("sensor noise, one std", noise_in_words(problem.noise, model.outputs)),
        ("not measured", ", ".join(q.name for q in model.outputs if problem.noise and q.name not in outputs_of(problem.noise))),
        ("uncertain constants, one std", _numbers(problem.uncertain)),
        ("drawn anew in each point or run, one std", _numbers(problem.varies)),
        ("local parameters", local_in_words(problem.local_parameters)),
        ("uncertain starts, one std", _numbers(problem.initial_state_std, model.states)),
        ("output covariance", str(problem.output_covariance)),
        ("rule over the prior", repr(problem.rule)),
        ("kinks, jumps", f"{problem.kinks}, {problem.jumps}"),
        ("limits along the way", "; ".join(problem.along or ())),
        ("tolerance of trajectories", number(problem.rtol)),
    ]
    sections = [Section("Problem", (), [fact for fact in facts if fact[1]]), prior_section(problem.prior, model.parameters)]
    return [*sections, *_region(problem)]


def local_in_words(local: Mapping[str, Local]) -> str:
    """Whose each local parameter is."""
    return "; ".join(f"{name} {one.words}" for name, one in local.items())


def noise_in_words(noise: NoiseOf | None, outputs: Iterable[Quantity]) -> str:
    """The noise of each output that is measured, and correlations."""
    units = {quantity.name: "" if quantity.unit == "1" else quantity.unit for quantity in outputs}
    given = {} if noise is None else outputs_of(noise)
    texts = [f"{name} {_of_output(one, units.get(name, ''))}".rstrip() for name, one in given.items()]
    if isinstance(noise, NoiseModel):
        texts += [f"correlation of {pair} {number(value)}" for pair, value in (noise.correlation or {}).items()]
    return ", ".join(texts)


def _of_output(noise: float | Noise, unit: str) -> str:
    if not isinstance(noise, Noise):
        return f"{number(noise)} {unit}"
    parts = [f"{number(noise.std)} {unit}"] if noise.std else []
    parts += [f"{number(100 * noise.relative)} % of its value"] if noise.relative else []
    parts += [f"{number(one.std)} {unit} correlated over {number(one.correlation_time)} s" for one in noise.parts]
    parts += [f"steps of {number(noise.resolution)} {unit}"] if noise.resolution else []
    for word, limit in zip(("shows at least", "shows at most"), noise.limits, strict=True):
        parts += [] if limit is None else [f"{word} {number(limit)} {unit}"]
    return " and ".join(part.rstrip() for part in parts)


def prior_section(prior: GaussianPrior, parameters: Iterable[Quantity]) -> Section:
    """Means and standard deviations, and which parameters are log-normal."""
    units = {quantity.name: quantity.unit for quantity in parameters}
    rows = [
        (name, units.get(name, ""), number(mean), number(prior.std[name]), "log-normal" if name in prior.log else "normal")
        for name, mean in prior.mean.items()
    ]
    notes = ["Parameters are correlated."] if prior.correlated else []
    return Section("Prior", ("parameter", "unit", "mean", "std", "distribution"), rows, notes=notes)


def _region(problem: ProblemFacts) -> Iterator[Section]:
    region, model = problem.region, problem.model
    if region is None:
        return
    units = {quantity.name: quantity.unit for quantity in model.axes}
    rows = [(name, units.get(name, ""), number(low), number(high)) for name, (low, high) in region.bounds.items()]
    yield Section("Region", ("quantity", "unit", "from", "to"), rows, notes=_limits(region))


def _limits(region: ExperimentRegion | RunRegion) -> list[str]:
    if isinstance(region, ExperimentRegion):
        return [f"Constraint: {constraint}" for constraint in region.constraints]
    return [repr(region)]


def _listed(quantities: Iterable[Quantity]) -> str:
    return ", ".join(f"{quantity.name} [{quantity.unit}]" for quantity in quantities)


def _numbers(given: Mapping[str, float] | None, quantities: Iterable[Quantity] = ()) -> str:
    units = {quantity.name: quantity.unit for quantity in quantities}
    return ", ".join(f"{name} {number(value)} {units.get(name, '')}".rstrip() for name, value in (given or {}).items())
