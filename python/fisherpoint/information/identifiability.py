"""Local structural identifiability: whether any two sets of parameters nearby could be distinguished at all."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, TypeAlias

import numpy as np

from ..basics.checks import check_positive_int, check_type, names_among, some_names_among
from ..basics.extras import needed_for
from ..basics.field_checks import Extents
from ..basics.messages import with_counts
from ..basics.quantity import names_of
from ..basics.result_files import Kept
from ..basics.values import Array, FrozenMapping
from ..models import Model
from ..points.region import ExperimentRegion
from ..points.settings import crossed_surfaces
from ..points.status import Status
from ..prior.gaussian import GaussianPrior
from ..show.display import Plots, Shown
from ..show.section import Report, Section
from .combinations import changes_of, describe
from .identifiability_domain import default_region, draw_theta
from .null_space import column_scaled_svd, pivots, reduced_basis
from .sensitivity_stack import Sampler, Stack

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FLOOR = 1e-11
"""A singular value is zero up to this share of the largest, and up to what the looser tolerance changes."""

MOST_POINTS, MOST_THETA = 10**6, 1000
"""Starts at each theta, and sets of parameters, past which they count as a slip."""

DEAD = 1e-13
"""A parameter has no influence up to this share of the largest column, and up to what the looser tolerance changes."""

HIDING = (Status.met_jump, Status.two_jumps, Status.chatters)
"""How trajectories end at jumps from whole neighbourhoods of starts, so that what would show there alone is not seen elsewhere."""

WEAK = 1e-4
"""Share of the largest singular value below which a direction is called weak."""


@dataclass(frozen=True, eq=False, repr=False)
class Identifiability(Shown, Kept):
    """Result of `identifiability`; `print` shows it.

    Attributes
    ----------
    parameters : tuple of str
        Those whose identifiability was requested.
    identifiable : bool or None
        False where there is a null direction; None where that is not known of some direction, but of no other.
    rank : int
        The largest at any theta.
    rank_at : int
        The number of theta at which it is that.
    singular_values : ndarray, (n_theta, p)
        Of the sensitivities with columns scaled to length 1, largest first; what unknown starts explain is taken out after that.
    null_directions : tuple of str
        Changes of parameters that no output notices, in words.
    null_components : tuple of mapping of parameter name to float
        The same as relative changes d log theta (absolute ones of parameters that are zero), largest component 1.
    not_known : tuple of str
        Changes that no output notices at the points that were taken, while others may: those whose trajectory meets a jump
        that cannot be crossed, or where an output itself jumps. With the reason, in words.
    weak : tuple of str
        Changes that hardly show: their singular value is not zero, but below 1e-4 of the largest at every theta.
    idle : tuple of str
        Parameters that reach no output by the structure of the equations; they are among the null directions too.
    blocks : tuple of tuple of str
        `Model.blocks`; empty where the model has no equations.
    unknown_start : tuple of str
    n_points, n_theta : int
        Starts and sets of parameters that were used.
    left_out : mapping of reason to int
        Draws that were not taken: as "constraint" where one of the region's fails, as "starts on a surface" where the model
        divides by zero at the start or has a jump there that is not in `Model.crossable`, by the name of their `Status`, and as
        "inaccurate" where sensitivities at rtol = 1e-10 and 1e-8 differ by more than 1e-5 of the largest at any point.
    """

    parameters: tuple[str, ...]
    identifiable: bool | None
    rank: int
    rank_at: int
    singular_values: Array
    null_directions: tuple[str, ...]
    null_components: tuple[Mapping[str, float], ...]
    not_known: tuple[str, ...]
    weak: tuple[str, ...]
    idle: tuple[str, ...]
    blocks: tuple[tuple[str, ...], ...]
    unknown_start: tuple[str, ...]
    n_points: int
    n_theta: int
    left_out: Mapping[str, int]

    _EXTENTS: ClassVar[Extents] = {
        "singular_values": ("n_theta", "parameters"),
        "null_components": ("null_directions", "some parameters"),
        "idle": ("any parameters",),
    }

    def _check_content(self) -> None:
        if self.rank > len(self.parameters):
            raise ValueError(f"rank: expected at most that of {len(self.parameters)} parameters, given {self.rank}")

    def report(self) -> Report:
        """The verdict, and all that it rests on."""
        (_, verdict), *rows = self._rows()
        return Report(verdict, [Section("", (), rows)])

    def _plots(self) -> Plots:
        return {"identifiability": self.plot}

    def plot(self, *, path: str | Path | None = None) -> Figure:
        """Draw the singular values of the sensitivities, the rank, and where directions are weak; needs matplotlib.

        Parameters
        ----------
        path : path, optional
            Where the picture is also written; the ending says the format, PNG where there is none.
        """
        with needed_for("plot"):
            from ..show.style import drawn
            from .pictures import plot_singular_values

        shares = self.singular_values / np.maximum(self.singular_values[:, :1], 1e-300)
        return drawn(plot_singular_values(shares, WEAK, self.rank, self.report().headline), path)

    def _rows(self) -> list[tuple[str, str]]:
        verdicts = {True: "locally identifiable", False: "locally not identifiable", None: "not known whether locally identifiable"}
        rank = f"rank {'at least ' if self.not_known else ''}{self.rank} of {len(self.parameters)} parameters"
        some = f", at {self.rank_at} of {self.n_theta} theta" if self.rank_at < self.n_theta else ""
        rows = [("", f"{verdicts[self.identifiable]}: {rank}{some}")]
        rows += [("null", f"{text}{self._place(of)}") for text, of in zip(self.null_directions, self.null_components, strict=True)]
        rows += [("open", text) for text in self.not_known]
        rows += [("weak", text) for text in self.weak]
        if self.idle:
            rows.append(("idle", f"{', '.join(self.idle)}: does not influence any output"))
        if len(self.blocks) > 1:
            rows += [(f"block {number}", ", ".join(block)) for number, block in enumerate(self.blocks, 1)]
        if self.unknown_start:
            rows.append(("not known", ", ".join(f"the start of {name}" for name in self.unknown_start)))
        # Of a theta with this rank: what is smaller at others belongs to a lower one.
        shares = self.singular_values / np.maximum(self.singular_values[:, :1], 1e-300)
        best = self.singular_values[np.argmax(shares[:, max(self.rank, 1) - 1])]
        rows.append(("singular", " ".join(f"{value:.2g}" for value in best)))
        lost = with_counts(self.left_out)
        rows.append(("from", f"{self.n_points} points at {self.n_theta} theta{f'; left out: {lost}' if lost else ''}"))
        return rows

    def _place(self, changed: Iterable[str]) -> str:
        """The block of a null direction, by the parameters that change; of one of idle parameters none."""
        changed = set(changed)
        met = [str(number) for number, block in enumerate(self.blocks, 1) if changed & set(block)]
        return f" (block {' and '.join(met)})" if len(self.blocks) > 1 and met else ""


def identifiability(
    model: Model,
    prior: GaussianPrior | None = None,
    region: ExperimentRegion | None = None,
    *,
    n_points: int | None = None,
    n_theta: int = 5,
    seed: int = 0,
    parameters: Sequence[str] | None = None,
    unknown_start: Sequence[str] = (),
    threads: int | None = None,
) -> Identifiability:
    """Find combinations of parameters that no experiment can identify: null directions of sensitivities at random points.

    The sensitivities dy/dtheta of (8) and (9) at points all over the region are stacked, each output and then each column scaled,
    at several random theta. Rank is generic: a direction is null only where there is one at every theta. A singular value is zero
    where it is no larger than the spectral norm of what a 100 times looser tolerance changes in the stack, by which singular
    values can be off, or than 1e-11 of the largest.

    Trajectories cross kinks and jumps, so that a threshold at which f jumps shows at the points that pass it. Points that meet a
    jump which cannot be crossed, as in a `CallableModel`, are left out. What would show at these alone is not called null but not
    known, unless the equations stay as they are along the direction.

    Parameters
    ----------
    model : Model
    prior : GaussianPrior, optional
        Where theta is drawn: within one standard deviation of the mean. Default: within 40 % of the model's nominal values.
    region : ExperimentRegion, optional
        Where points are drawn, durations logarithmically where they span more than a decade. Default: states and inputs up to
        their natural sizes (`Quantity.scale`), of either sign where the model takes that, and durations in which states change by
        about as much.
    n_points : int, optional
        Starts at each theta. Default: four times what p parameters need, at least 20.
    n_theta : int
        Sets of parameters; the first is the mean.
    seed : int
    parameters : sequence of str, optional
        Parameters to identify; the others are known. Default: all.
    unknown_start : sequence of str, optional
        States whose start is set, but not known. Each start is then one record of 8 samples, spread over its dt, and what
        the sensitivities to its start explain is taken out of them. Without this, x0 is known, as for every experiment point.
    threads : int, optional

    Returns
    -------
    Identifiability

    Raises
    ------
    TypeError, ValueError
        For misuse, where no theta is known, and where too few points survive.

    Notes
    -----
    With x0 known the cascaded tanks h1' = -k1 sqrt(h1) + k4 u, h2' = k2 sqrt(h1) - k3 sqrt(h2), y = h2 are identifiable: the start
    of the upper tank sets the scale of its level. With ``unknown_start=("h1",)``, the benchmark's situation, nothing sets it, and
    k1, k2 and k4 can only be identified up to it; a known level at which the tank overflows, or k1 = k2, sets it again.
    """
    check_type(model, Model, "model")
    names = names_of(model.parameters)
    chosen = some_names_among(names if parameters is None else parameters, names, "parameters")
    starts = names_among(unknown_start, names_of(model.states), "unknown_start")
    count = max(20, 4 * -(-len(chosen) // len(model.outputs)))
    if n_points is not None:
        count = check_positive_int(n_points, "n_points", most=MOST_POINTS)
    rng = np.random.default_rng(check_positive_int(seed, "seed", 0))
    if prior is not None:
        check_type(prior, GaussianPrior, "prior")
    theta = draw_theta(model, prior, check_positive_int(n_theta, "n_theta", most=MOST_THETA), rng)
    region = default_region(model, theta[0]) if region is None else region
    check_type(region, ExperimentRegion, "region")
    region = region.in_units_of(model)
    region.check(model, crossed_surfaces(model, kinks=True, jumps=True))

    sampler = Sampler(model, region, chosen, starts, rng, threads)
    stacks = sampler.stacks(theta, count)
    spectra = [spectrum(stack) for stack in stacks]
    null = min(len(found.null) for found in spectra)
    generic = [(stack, found) for stack, found in zip(stacks, spectra, strict=True) if len(found.null) == null]
    full = next(row for row, found in zip(theta, spectra, strict=True) if len(found.null) == null)
    reaching, blocks = _structure(model)
    idle = tuple(name for name in chosen if reaching.get(name) == ())
    described, not_known = [], []
    for text, components, change in _described(generic, null) if null else ():
        changes = dict(zip(chosen, change, strict=True))
        reason = "" if set(components) <= set(idle) else _hidden(model, region, full, changes, sampler)
        if reason:
            not_known.append(f"{text.split(': no output changes')[0]}: not known: {reason}")
        else:
            described.append((text, components))
    return Identifiability(
        parameters=chosen,
        identifiable=False if described else None if not_known else True,
        rank=len(chosen) - null,
        rank_at=len(generic),
        singular_values=np.array([found.values for found in spectra]),
        null_directions=tuple(text for text, _ in described),
        null_components=tuple(FrozenMapping(components) for _, components in described),
        not_known=tuple(not_known),
        weak=_weak(generic, null),
        idle=idle,
        blocks=blocks,
        unknown_start=starts,
        n_points=min(len(stack.x0) for stack in stacks),
        n_theta=len(stacks),
        left_out=FrozenMapping(dict(sampler.left_out)),
    )


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Singular values (p,), all right singular vectors as rows, and which of them are null; vectors of columns of length 1."""

    values: Array
    vectors: Array
    null: Array
    length: Array


def spectrum(stack: Stack) -> Spectrum:
    """Singular values of a stack, with the null directions by the criterion of `identifiability`."""
    rows, looser = stack.projected(stack.tight), stack.projected(stack.loose)
    change = np.linalg.norm(rows - looser, axis=0)
    length = np.linalg.norm(stack.tight[..., : len(stack.names)], axis=(0, 1))  # before starts explain some of it
    dead = length <= np.maximum(change, DEAD * length.max(initial=0.0))
    rows[:, dead] = looser[:, dead] = length[dead] = 0.0
    values, vectors, length = column_scaled_svd(rows, length)
    length = np.where(length > 0, length, 1.0)
    off = np.linalg.norm((rows - looser) / length, 2)
    return Spectrum(values, vectors, vectors[values <= max(off, FLOOR * values.max(initial=0.0))], length)


Generic: TypeAlias = Sequence[tuple[Stack, Spectrum]]
"""The theta at which there are no more null directions than at every other."""


def _described(generic: Generic, null: int) -> Iterator[tuple[str, Mapping[str, float], Array]]:
    """The null directions in words, in components, and as changes (p,) of the first theta."""
    columns = pivots(generic[0][1].null)
    bases = [reduced_basis(found.null / found.length, columns) for _, found in generic]  # relative changes, but where theta is zero
    theta = np.array([stack.theta for stack, _ in generic])
    for i in range(null):
        effects = np.array([basis[i] * found.length for basis, (_, found) in zip(bases, generic, strict=True)])
        directions = np.array([stack.size * basis[i] for basis, (stack, _) in zip(bases, generic, strict=True)])
        moves = [stack.start_changes(direction) for (stack, _), direction in zip(generic, directions, strict=True)]
        starts = {name: [move[:, q] for move in moves] for q, name in enumerate(generic[0][0].starts)}
        relative = directions / np.where(theta != 0, theta, 1.0)
        yield *describe(relative, effects, theta, generic[0][0].names, starts), directions[0]


def _hidden(model: Model, region: ExperimentRegion, theta: Array, changes: Mapping[str, float], sampler: Sampler) -> str:
    """Where a null direction may show that sensitivities do not see, in words; empty where it is one for all."""
    lost = {status.name: sampler.left_out[status.name] for status in HIDING if sampler.left_out[status.name]}
    met, named = sum(lost.values()), ", ".join(lost)
    said = f"{met} point{'s' * (met != 1)} that meet{'s' * (met == 1)} a jump {'were' if met != 1 else 'was'} left out ({named})"
    try:
        equations = model.symbolic()
    except TypeError:
        return said if met else ""
    from ..models.invariance import jumps_by_value, leaves_equations  # SymPy is slow to import
    from ..models.symbolic import SymbolicModel

    assert isinstance(equations, SymbolicModel)
    if not met and not jumps_by_value(equations):
        return ""
    points = region.draw(model, 64, seed=0)
    change = np.array([changes.get(name, 0.0) for name in names_of(model.parameters)])
    relative = np.abs(change) / np.where(theta != 0, np.abs(theta), 1.0)
    change[relative <= 1e-12 * relative.max()] = 0.0
    if leaves_equations(equations, theta, change, points.x0, points.u):
        return ""
    return said if met else "it may change where the model jumps, which sensitivities do not show"


def _weak(generic: Generic, null: int) -> tuple[str, ...]:
    shares = np.max([found.values / found.values.max(initial=1e-300) for _, found in generic], axis=0)
    rows = range(int((shares > WEAK).sum()), len(shares) - null)
    stack, first = generic[0]
    relative = first.vectors / first.length * stack.size / np.where(stack.theta != 0, stack.theta, 1.0)
    return tuple(
        f"{changes_of(relative[i], stack.names, first.vectors[i])}: singular value {shares[i]:.1g} of the largest" for i in rows
    )


def _structure(model: Model) -> tuple[Mapping[str, tuple[str, ...]], tuple[tuple[str, ...], ...]]:
    """`Model.reaches` and `Model.blocks`; nothing of a model without equations."""
    try:
        return model.reaches, model.blocks
    except TypeError:
        return {}, ()
